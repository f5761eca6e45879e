"""A car's values as a table for the documentation: what, value, unit, where from."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from tripwatt.vehicles.loading import load_vehicle
from tripwatt.vehicles.vehicle import SECTIONS, Entry, Vehicle


def describe_vehicle(
    name_or_path: str | Path, preset: str = "default", overrides: Mapping[str, float | str] | None = None
) -> tuple[tuple[str, str, str, str, str], ...]:
    """List all values of a car, in the order of the parts.

    Arguments and errors as in `load_vehicle`.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a bundled car, or the path of a TOML file.
    preset : str
        Name of a preset of that file.
    overrides : mapping of str to (float or str), optional
        Values that replace those of the car, by key or short name.

    Returns
    -------
    tuple of tuple of str
        Rows (key, value, unit, source, licence).

    Examples
    --------
    >>> describe_vehicle("bmw_i3_60ah", overrides={"mass": 1300.0})[0]
    ('body.curb_mass_kg', '1300', 'kg', 'given by the caller', 'user')
    """
    vehicle = load_vehicle(name_or_path, preset, overrides)
    keys = [f"{section}.{f.name}" for section, part in SECTIONS.items() for f in dataclasses.fields(part)]
    return tuple(
        (
            key,
            _format_value(entry),
            entry.unit,
            f"{entry.source} (estimated: {entry.estimated})" if entry.estimated else entry.source,
            entry.licence,
        )
        for key in keys
        if (entry := vehicle.entries.get(key)) is not None
    )


def render_parameters(vehicle: Vehicle) -> str:
    """Markdown tables of all values of a car, one for each part, with unit and source.

    Parameters
    ----------
    vehicle : Vehicle
        A car with its entries.

    Returns
    -------
    str
        Ends with a line break; a part that the car lacks has no table.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> print(render_parameters(load_vehicle("bmw_i3_60ah")).splitlines()[0])
    #### body
    """
    blocks = []
    for section, part in SECTIONS.items():
        meanings = {f.name: str(f.metadata["meaning"]) for f in dataclasses.fields(part)}
        rows = [
            f"| `{key}` | {_format_value(entry)} | {entry.unit} | {meanings[key]} | {_origin(entry)} |"
            for key in meanings
            if (entry := vehicle.entries.get(f"{section}.{key}")) is not None
        ]
        if rows:
            head = ["| key | value | unit | meaning | source |", "|---|---|---|---|---|"]
            blocks.append("\n".join([f"#### {section}", "", *head, *rows]))
    return "\n\n".join(blocks) + "\n"


def _format_value(entry: Entry) -> str:
    if isinstance(entry.value, str):
        return entry.value
    if isinstance(entry.value, tuple):
        return ", ".join(f"{v:.7g}" for v in entry.value)
    return f"{entry.value:.7g}" + (f" (on the {entry.scale} scale)" if entry.scale else "")


def _origin(entry: Entry) -> str:
    return f"{entry.source} *Estimated: {entry.estimated}.*" if entry.estimated else entry.source
