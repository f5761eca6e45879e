"""A car's values as a table for the documentation: what, value, unit, where from."""

from __future__ import annotations

import dataclasses

from tripwatt.vehicles.loading import SECTIONS, Entry, Vehicle


def render_parameters(vehicle: Vehicle) -> str:
    """Markdown tables of all values of a car, one for each part, with unit and source.

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
            f"| `{key}` | {_shown(entry)} | {entry.unit} | {meanings[key]} | {_origin(entry)} |"
            for key in meanings
            if (entry := vehicle.entries.get(f"{section}.{key}")) is not None
        ]
        if rows:
            head = ["| key | value | unit | meaning | source |", "|---|---|---|---|---|"]
            blocks.append("\n".join([f"#### {section}", "", *head, *rows]))
    return "\n\n".join(blocks) + "\n"


def _shown(entry: Entry) -> str:
    if isinstance(entry.value, str):
        return entry.value
    if isinstance(entry.value, tuple):
        return ", ".join(f"{v:.7g}" for v in entry.value)
    return f"{entry.value:.7g}" + (f" (on the {entry.scale} scale)" if entry.scale else "")


def _origin(entry: Entry) -> str:
    return f"{entry.source} *Estimated: {entry.estimated}.*" if entry.estimated else entry.source
