"""Physics alone on the logged trips of the VED's Leafs: nothing is fitted on them. Where the error comes from, by weather.

Run: ``python -m benchmarks.ved_trips`` (``--write`` also renews the tables in docs/explanation/ved.md). Needs TRIPWATT_DATA.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from tools import DATA
from tools.command import run
from tools.docs import pages

from benchmarks.measure import Row
from tripwatt.auditing import audit
from tripwatt.physics import simulate, simulate_trip
from tripwatt.physics.simulate import conditions_at_departure
from tripwatt.sources import read_logs
from tripwatt.trips import Trip, resample
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import Vehicle, load_vehicle

SHORTEST_M: Final = 2000.0
CAR: Final = "nissan_leaf_24"
ERROR_BAR, BIAS_BAR = 0.13, 0.04
CLASS_BIAS_BAR, CLASS_TRIPS = 0.08, 20
"""With the logged climate power put in, for each class of outside air with so many trips."""
BARS_ON: Final = ("car 10", "both cars")
EDGES_DEGC: Final = (-40.0, -5.0, 0.0, 5.0, 10.0, 18.0, 26.0, 50.0)


@dataclass(frozen=True, slots=True)
class Outcome:
    """One trip: energies [Wh] measured, simulated, and simulated with the logged power of heater and air conditioner; and the
    energy of these two as simulated and as the car logged it."""

    trip: str
    distance_m: float
    duration_s: float
    ambient_degc: float
    observed_wh: float
    simulated_wh: float
    given_climate_wh: float
    simulated_climate_wh: float
    logged_climate_wh: float


@dataclass(frozen=True, slots=True)
class Score:
    """Energy-weighted error and bias of some trips."""

    name: str
    n_trips: int
    error: float
    bias: float

    @property
    def met(self) -> bool:
        return self.error <= ERROR_BAR and abs(self.bias) <= BIAS_BAR


def outcomes(trips: Sequence[Trip], vehicle: Vehicle) -> list[Outcome]:
    """Simulation beside measurement, for trips with a measured energy that are long enough."""
    results = []
    for log in trips:
        if log.distance_m <= SHORTEST_M or log.observed_energy_wh is None:
            continue
        trip = resample(log)
        run = simulate_trip(vehicle, trip)
        ambient = trip.departure.ambient_temperature_degc
        time = trip.array("time_s")
        logged = np.nan_to_num(trip.array("heating_power_w")) + np.nan_to_num(trip.array("aircon_power_w"))
        given = simulate(
            vehicle,
            time,
            trip.array("speed_m_s"),
            elevation_m=trip.array("elevation_m") if "elevation_m" in trip else None,
            climate_power_w=logged + run.fan_power_w,
            conditions=conditions_at_departure(vehicle, trip.departure),
        )
        results.append(
            Outcome(
                log.trip_id,
                log.distance_m,
                log.duration_s,
                float("nan") if ambient is None else ambient,
                log.observed_energy_wh,
                run.simulated_energy_wh,
                given.simulated_energy_wh,
                run.by_cause_wh["climate"] - float(np.trapezoid(run.fan_power_w, time)) * WH_PER_J,
                float(np.trapezoid(logged, time)) * WH_PER_J,
            )
        )
    return results


def score(name: str, results: Sequence[Outcome]) -> Score:
    """Sum of absolute errors, and of errors, over the sum of the observed energies."""
    observed = np.array([r.observed_wh for r in results])
    error = np.array([r.simulated_wh for r in results]) - observed
    total = observed.sum()
    return Score(name, len(results), float(np.abs(error).sum() / total), float(error.sum() / total))


def scores(results: Sequence[Outcome]) -> list[Score]:
    """Each car and both."""
    groups = {
        "car 10": [r for r in results if r.trip.startswith("VED10-")],
        "car 541": [r for r in results if r.trip.startswith("VED541-")],
        "both cars": list(results),
    }
    return [score(name, group) for name, group in groups.items() if group]


def given_bias(results: Sequence[Outcome]) -> float:
    """Relative error of the sum of some trips with the logged climate power put in."""
    return sum(r.given_climate_wh for r in results) / sum(r.observed_wh for r in results) - 1.0


def classes(results: Sequence[Outcome]) -> list[list[Outcome]]:
    """The trips of each class of outside air that has any."""
    groups = [[r for r in results if low < r.ambient_degc <= high] for low, high in pairwise(EDGES_DEGC)]
    return [group for group in groups if group]


def by_weather(results: Sequence[Outcome]) -> list[str]:
    """Rows of a markdown table: what the cars used and what heating and cooling took, by outside air."""
    lines = [
        "| outside air °C | trips | measured Wh/km | simulated Wh/km | error | with the logged climate power | "
        "heating and cooling logged W | simulated W |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for low, high in pairwise(EDGES_DEGC):
        group = [r for r in results if low < r.ambient_degc <= high]
        if not group:
            continue
        km = sum(r.distance_m for r in group) / 1000.0
        hours = sum(r.duration_s for r in group) / 3600.0
        observed, simulated = sum(r.observed_wh for r in group), sum(r.simulated_wh for r in group)
        label = f"up to {high:g}" if low == EDGES_DEGC[0] else f"{low:g} to {high:g}"
        label = f"above {low:g}" if high == EDGES_DEGC[-1] else label
        lines.append(
            f"| {label} | {len(group)} | {observed / km:.0f} | {simulated / km:.0f} | {simulated / observed - 1:+.1%} "
            f"| {given_bias(group):+.1%} "
            f"| {sum(r.logged_climate_wh for r in group) / hours:.0f} "
            f"| {sum(r.simulated_climate_wh for r in group) / hours:.0f} |"
        )
    return lines


def bars() -> Iterator[Row]:
    """The bars on cars that the physics has not met."""
    for row in scores(outcomes(read_logs(DATA / "ved", "ved").trips, load_vehicle(CAR))):
        name = f"physics of the VED's Leafs, trips over 2 km, {row.name}, {row.n_trips} trips"
        most = (ERROR_BAR, BIAS_BAR) if row.name in BARS_ON else (math.inf, math.inf)
        yield Row(f"{name}: energy-weighted error", row.error, most=most[0])
        yield Row(f"{name}: size of the bias", abs(row.bias), most=most[1])


def report() -> tuple[str, bool]:
    """Both tables as markdown, and whether the bars are met; raises FileNotFoundError without the data."""
    fleet = read_logs(DATA / "ved", "ved")
    vehicle = load_vehicle(CAR)
    lines = ["| trips over 2 km | car | trips | energy-weighted error | bias |", "|---|---|---:|---:|---:|"]
    met = True
    sets = {"as logged": fleet.trips, "audited": audit(fleet).trips}
    results: list[Outcome] = []
    for name, trips in sets.items():
        results = outcomes(trips, vehicle)
        for row in scores(results):
            lines.append(f"| {name} | {row.name} | {row.n_trips} | {row.error:.1%} | {row.bias:+.1%} |")
            met &= row.met or row.name not in BARS_ON
    met &= all(abs(given_bias(g)) <= CLASS_BIAS_BAR for g in classes(results) if len(g) >= CLASS_TRIPS)
    return "\n".join([*lines, "", *by_weather(results)]), met


def main(write: bool = False) -> int:
    """Print the tables; 1 when a bar is missed. `--write` renews docs/explanation/ved.md."""
    text, met = report()
    print(text)
    print(
        f"\nbars (error <= {ERROR_BAR:.0%}, bias within {BIAS_BAR:.0%}, with the logged climate power within "
        f"{CLASS_BIAS_BAR:.0%} in each class of {CLASS_TRIPS} trips): {'met' if met else 'MISSED'}"
    )
    if write:
        pages.renew("explanation/ved.md", "tables", text)
    return int(not met and not write)


if __name__ == "__main__":
    run(main)
