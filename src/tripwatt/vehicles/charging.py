"""Charging curves of the library's cars, from `data/table/charging.csv`; `python -m tools.data.car_table --write` makes it.

The curves are simplified from public charts of charging sessions; a car without a curve has that of its class
(`tripwatt.roads.journey.charging`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from tripwatt.arrays import by_key
from tripwatt.vehicles.catalogue import records

LISTED: Final = "simplified by its authors from public charts"


def charging_section(name: str) -> dict[str, Any]:
    """Return the section `charging` of a car's document; empty if no curve of the car is known.

    Parameters
    ----------
    name : str
        A car of the library.

    Returns
    -------
    dict
        {"charging": entries}, or an empty dict.

    Examples
    --------
    >>> charging_section("nissan_leaf_40")["charging"]["power_w"]["value"]
    [41000.0, 45000.0, 36000.0, 15000.0]
    >>> charging_section("bmw_i3_60ah")
    {}
    """
    section = _sections().get(name)
    return {} if section is None else {"charging": dict(section)}


@cache
def _sections() -> Mapping[str, Mapping[str, Any]]:
    sources = {row["source"]: row for row in records("sources.csv")}
    rows = by_key(records("charging.csv"), lambda row: row["car"])
    return {car: _section(points, sources[points[0]["source"]]) for car, points in rows.items()}


def _section(points: list[dict[str, str]], source: Mapping[str, str]) -> Mapping[str, Any]:
    cited = {"source": f"{source['text']}: {points[0]['note']}", "licence": source["licence"]}

    def values(key: str, factor: float) -> list[float]:
        return [factor * float(point[key]) for point in points]

    return {
        "displayed_soc": {**cited, "value": values("displayed_soc", 1.0), "unit": "1"},
        "power_w": {**cited, "value": values("power_kw", 1000.0), "unit": "W", "estimated": LISTED},
        "alternating_power_w": {**cited, "value": values("alternating_kw", 1000.0)[0], "unit": "W"},
    }
