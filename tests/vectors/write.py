"""Vectors that the tests of the page share with the library: `python tests/vectors/write.py` writes them.

Each JSON file beside this one holds inputs and what the library makes of them. `web/test` holds the page's own functions
against the same numbers; `tests/server/page/test_vectors.py` computes them again.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from tests.support.drives import example_trip

from tripwatt.forecasting import Forecast, load_model
from tripwatt.routes import route_from_links
from tripwatt.trips import Plan, Trip
from tripwatt.trips.energy import observed_cumulative_energy
from tripwatt.units import KG_PER_LB, M_PER_MILE, M_S_PER_KM_H, SECONDS_PER_HOUR, WH_PER_J

FOLDER: Final = Path(__file__).resolve().parent
FEET_PER_MILE: Final = 5280.0
DOTS: Final = 20
RESERVE: Final = 0.91
MEASURED_SHARE: Final = 0.5
TRIP_S: Final = 600
ENERGIES_WH: Final = (0.0, 500.0, 1234.5, 4000.0)


def units() -> list[dict[str, Any]]:
    """Values in SI and in the units of the page."""
    per_unit = {
        ("metric", "distance"): 1000.0,
        ("metric", "speed"): M_S_PER_KM_H,
        ("metric", "height"): 1.0,
        ("metric", "mass"): 1.0,
        ("metric", "consumption"): 1.0 / WH_PER_J / SECONDS_PER_HOUR / 100.0,
        ("imperial", "distance"): M_PER_MILE,
        ("imperial", "speed"): M_PER_MILE / SECONDS_PER_HOUR,
        ("imperial", "height"): M_PER_MILE / FEET_PER_MILE,
        ("imperial", "mass"): KG_PER_LB,
    }
    rows = [
        {"system": system, "quantity": quantity, "si": si, "shown": si / unit}
        for (system, quantity), unit in per_unit.items()
        for si in (0.163, 13.9, 250.0, 1609.344)
    ]
    degc = [-40.0, 0.0, 21.0, 37.5]
    rows += [{"system": "metric", "quantity": "temperature", "si": x, "shown": x} for x in degc]
    rows += [
        {
            "system": "imperial",
            "quantity": "temperature",
            "si": x,
            "shown": float(np.interp(x, [0, 100], [32, 212])),
        }
        for x in degc[1:]
    ]
    return rows


def interpolation() -> dict[str, Any]:
    """A line through points, inside, on and beyond them."""
    xs, ys = [0.0, 1.5, 2.0, 10.0], [4.0, -2.0, 0.5, 8.0]
    at = [-1.0, 0.0, 0.75, 1.5, 1.9, 2.0, 6.0, 10.0, 11.0]
    return {"xs": xs, "ys": ys, "at": at, "found": np.interp(at, xs, ys).tolist()}


def energy() -> list[dict[str, Any]]:
    """Measured energy so far, with samples of which voltage or current is missing."""
    time = [0.0, 1.0, 3.0, 4.5, 6.0, 9.0]
    voltage: list[float | None] = [360.0, 358.0, 350.0, 352.0, 365.0, 361.0]
    current: list[float | None] = [2.0, 40.0, 110.0, 95.0, -60.0, 3.0]
    columns = [
        (voltage, current),
        ([360.0, None, None, 352.0, 365.0, 361.0], current),
        (voltage, [None, 40.0, 110.0, None, -60.0, None]),
    ]
    rows = []
    for volts, amperes in columns:
        observed = {"time_s": time, "voltage_v": volts, "current_a": amperes}
        found = observed_cumulative_energy(pd.DataFrame(observed, dtype=np.float64))
        assert found is not None
        rows.append({"observed": observed, "energy_wh": found.tolist()})
    return rows


def profile() -> dict[str, Any]:
    """Distance along a speed trace."""
    samples = {"time_s": [0.0, 1.0, 2.0, 4.0, 7.0], "speed_m_s": [0.0, 3.0, 8.5, 12.0, 9.0]}
    parts = [Trip.from_samples("part", pd.DataFrame(samples).iloc[:k]) for k in range(2, 6)]
    return {"samples": samples, "distance_m": [0.0, *(part.distance_m for part in parts)]}


def links() -> dict[str, Any]:
    """Links, and how long each takes."""
    rows: list[dict[str, float]] = [
        {"length_m": 900.0, "speed_m_s": 8.5},
        {"length_m": 1200.0, "travel_time_s": 36.0, "stop_s": 2.0},
        {"length_m": 3000.0, "speed_m_s": 33.3, "stop_s": 0.0},
    ]
    return {"links": rows, "travel_time_s": route_from_links(rows).travel_time_s.tolist()}


def _charge(forecast: Forecast, energy_wh: float) -> float:
    """Displayed charge at the end of a trip that takes so much."""
    start = float(forecast.to_frame()["displayed_soc"].iloc[0])
    return float(np.clip(start - energy_wh / forecast.charge.wh_per_display, 0.0, 1.0))


def _arrival(forecast: Forecast) -> dict[str, Any]:
    """A forecast as a response of the service, and the values that the page derives from it."""
    document = forecast.to_dict(RESERVE)
    kept = (
        "energy_wh",
        "quantiles_wh",
        "soc_arrival",
        "soc_quantiles",
        "empty_at_m",
        "wh_per_display",
        "p_arrive_by_soc",
        "series",
        "by_cause_wh",
        "measured_until_s",
    )
    inner, outer = (forecast.quantile(p) - forecast.energy_wh for p in (0.75, 0.95))
    levels = sorted(map(float, document["soc_quantiles"]))
    middles = (np.arange(DOTS) + 0.5) / DOTS
    dots = np.interp(middles, levels, [forecast.arrival.quantile(p) for p in levels])
    return {
        "forecast": {name: document[name] for name in kept},
        "reserve": RESERVE,
        "chance": forecast.p_arrive(RESERVE),
        "band": list(forecast.arrival.interval(0.9)),
        "inner_share": inner / outer,
        "energies_wh": ENERGIES_WH,
        "charges": [_charge(forecast, energy_wh) for energy_wh in ENERGIES_WH],
        "dots": dots.tolist(),
    }


def arrivals() -> dict[str, Any]:
    """A forecast before departure and half way, and the naive gauge half way."""
    table = example_trip()
    table = table[table["time_s"] <= table["time_s"].iloc[0] + TRIP_S].reset_index(drop=True)
    trip = Trip.from_samples("example", table)
    before = load_model().forecast(Plan.from_samples(table, "example"))
    measured_s = MEASURED_SHARE * trip.duration_s
    observed = table.loc[table["time_s"] <= measured_s, ["time_s", "voltage_v", "current_a"]]
    after = before.update(observed)
    taken_wh = observed_cumulative_energy(table)
    assert taken_wh is not None
    driven = trip.between(float(table["time_s"].iloc[0]), float(observed["time_s"].iloc[-1]))
    gauge_wh = float(taken_wh[len(observed) - 1]) / driven.distance_m * trip.distance_m
    columns = ("time_s", "speed_m_s", "voltage_v", "current_a")
    return {
        "departure": _arrival(before),
        "half_way": _arrival(after),
        "samples": {name: table[name].tolist() for name in columns},
        "naive_charge": _charge(after, gauge_wh),
    }


def vectors() -> dict[str, Any]:
    """All vectors by the name of their file."""
    return {
        "units": units(),
        "interpolation": interpolation(),
        "energy": energy(),
        "profile": profile(),
        "links": links(),
        "arrivals": arrivals(),
    }


def main() -> None:
    """Write all vectors."""
    for name, document in vectors().items():
        (FOLDER / f"{name}.json").write_text(json.dumps(document) + "\n")


if __name__ == "__main__":
    main()
