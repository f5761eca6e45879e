"""The text of a car's TOML with all its values, as it is: nothing is taken over from other files."""

from __future__ import annotations

import json

from tripwatt.vehicles.loading import SECTIONS, Entry, Vehicle


def render_vehicle(vehicle: Vehicle) -> str:
    """TOML of a car, which `load_vehicle` reads back.

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
    lines = [f"name = {_quoted(vehicle.title)}", f"anchor = {_quoted(vehicle.anchor)}"]
    for section in SECTIONS:
        entries = {
            key.partition(".")[2]: entry
            for key, entry in vehicle.entries.items()
            if key.startswith(f"{section}.")
        }
        if entries:
            lines += ["", f"[{section}]", *(_line(key, entry) for key, entry in entries.items())]
    return "\n".join(lines) + "\n"


def _line(key: str, entry: Entry) -> str:
    value = entry.value
    shown = (
        _quoted(value) if isinstance(value, str) else repr(list(value) if isinstance(value, tuple) else value)
    )
    fields = {"source": entry.source, "estimated": entry.estimated, "licence": entry.licence}
    more = "".join(f", {name} = {_quoted(text)}" for name, text in fields.items() if text)
    scale = f', scale = "{entry.scale}"' if entry.scale else ""
    return f'{key} = {{ value = {shown}, unit = "{entry.unit}"{scale}{more} }}'


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
