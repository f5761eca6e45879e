"""Writing of a car with all its values as a document, TOML or table that inherits nothing from other files."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tripwatt.vehicles.loading import load_vehicle
from tripwatt.vehicles.reading import vehicle_from_document
from tripwatt.vehicles.vehicle import FIELDS, SECTIONS, Entry, Vehicle


def vehicle_document(vehicle: Vehicle) -> dict[str, Any]:
    """Convert a car to a document with the source of every value; `vehicle_from_document` makes the same car from it.

    Parameters
    ----------
    vehicle : Vehicle
        A car with its entries. If a value was replaced after the car was loaded, its source in the document says so.

    Returns
    -------
    dict
        Document as parsed from TOML: numbers, texts and lists.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("vw_id3")
    >>> vehicle_from_document(vehicle_document(car), "vw_id3", "example") == car
    True
    """
    document = _document(vehicle, vehicle.entries)
    loaded = vehicle_from_document(document, vehicle.name, "vehicle")
    if dataclasses.replace(loaded, preset=vehicle.preset) == vehicle:
        return document
    return _document(vehicle, {**vehicle.entries, **_replaced(vehicle, loaded)})


def _document(vehicle: Vehicle, entries: Mapping[str, Entry]) -> dict[str, Any]:
    document: dict[str, Any] = {"name": vehicle.title, "anchor": vehicle.anchor}
    for key, entry in entries.items():
        section, _, name = key.partition(".")
        if getattr(vehicle, section) is not None:
            document.setdefault(section, {})[name] = {
                field: list(value) if isinstance(value, tuple) else value
                for field, value in dataclasses.asdict(entry).items()
                if value not in ("", None) or field == "unit"
            }
    return document


def _replaced(vehicle: Vehicle, loaded: Vehicle) -> dict[str, Entry]:
    """Return entries for the values that were replaced after the car was loaded."""
    entries = {}
    for key, field in FIELDS.items():
        value, old = vehicle.value(key), vehicle.entries.get(key)
        # the other values of the battery change what the scale means
        rescaled = old is not None and old.scale == "displayed_soc" and vehicle.battery != loaded.battery
        if value is not None and (rescaled or value != loaded.value(key)):
            entries[key] = Entry(
                value,
                field.metadata["unit"],
                "set after the car was loaded",
                scale="soc" if field.metadata.get("scaled") else "",
                licence="user",
            )
    return entries


def render_vehicle(vehicle: Vehicle) -> str:
    """Write a car as TOML, which `load_vehicle` can read.

    Parameters
    ----------
    vehicle : Vehicle
        A car with its entries.

    Returns
    -------
    str
        TOML with the source and the licence of every value.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> print(render_vehicle(load_vehicle("vw_id4_pro")).splitlines()[0])
    name = "Volkswagen ID.4 Pro 77 kWh (2022)"
    """
    document = vehicle_document(vehicle)
    lines = [f"{key} = {_toml(document[key])}" for key in ("name", "anchor")]
    for section in SECTIONS:
        if section in document:
            lines += [
                "",
                f"[{section}]",
                *(f"{k} = {_toml(entry)}" for k, entry in document[section].items()),
            ]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """Write a number, a text, a list of numbers, or a table in one line."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_toml(part)}' for key, part in value.items())} }}"
    return json.dumps(value, ensure_ascii=False)


def describe_vehicle(
    name_or_path: str | Path, overrides: Mapping[str, float | str] | None = None
) -> tuple[tuple[str, str, str, str, str], ...]:
    """List all values of a car, in the order of the parts.

    Errors are those of `load_vehicle`.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a bundled car, or the path of a TOML file.
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
    vehicle = load_vehicle(name_or_path, overrides=overrides)
    return tuple(
        (
            key,
            format_value(entry),
            entry.unit,
            f"{entry.source} (estimated: {entry.estimated})" if entry.estimated else entry.source,
            entry.licence,
        )
        for key in FIELDS
        if (entry := vehicle.entries.get(key)) is not None
    )


def format_value(entry: Entry) -> str:
    """Format the value of an entry as text."""
    if isinstance(entry.value, str):
        return entry.value
    if isinstance(entry.value, tuple):
        return ", ".join(f"{v:.7g}" for v in entry.value)
    return f"{entry.value:.7g}" + (f" (on the {entry.scale} scale)" if entry.scale else "")
