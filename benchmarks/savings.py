"""Savings that are stated against savings that were measured: python -m benchmarks.savings [FOLDER].

Constant speeds of the sedan on a dynamometer: the steady parts of its runs, the mean of the repetitions. Each pair of speeds has a saving, which is
predicted from certified values alone and by the car with its own road trips; no laboratory run enters a fit. `MIN_SHARE` of a difference comes from
another car on another dynamometer: schedules that Argonne drove with a warm BMW i3.
Other speeds on planned roads: `OTHER_SPEEDS` comes from trips of TUM, driven and on their links.
Heating off: `benchmarks.heating`. Synthetic worlds: `benchmarks.advised`, `--worlds N` drives of each.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from tools import DATA, REFERENCE
from tools.command import run
from typer import Argument

import tripwatt as tw
from benchmarks.advised import world_rows
from benchmarks.argonne import TEST_MASS_KG
from benchmarks.heating import heating_rows
from benchmarks.measure import Row, report
from benchmarks.need import trips_and_car
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.difference import MIN_SHARE, OTHER_SPEEDS
from tripwatt.physics import DriveConditions, simulate, simulate_trip
from tripwatt.population import for_car
from tripwatt.population.adapting import Adaptation, population_of
from tripwatt.roads.advice.actions import GENTLE_M_S2, SPEEDS_KM_H, cap_speed, limit_acceleration
from tripwatt.routes.links import links_of_trip
from tripwatt.trips import Plan
from tripwatt.uncertainty.route import LENGTHS_M
from tripwatt.units import M_PER_MILE, M_S_PER_KM_H, SECONDS_PER_HOUR

STEADY_M_S = 0.3
DISTANCE_M = 20_000.0
MAX_LINKED = 60
SEDAN = "tesla_model_3_lr"
LAB_DEGC = 23.0
COLD_START = "01"
"""Mark of the runs from a cold start, or the first of a day."""


def steady(data: Path) -> dict[float, float]:
    """Speed [km/h] -> measured consumption of the steady parts [Wh/km], the mean of the repetitions with a warm car."""
    found: dict[float, list[float]] = {}
    for path in sorted((data / "sedan" / "lab").glob("*.csv")):
        name = re.search(r"_(?:CS|SPEED)_(\d+)(?:_(\w+))?\.csv$", path.name)
        if name is None or name[2] == COLD_START:
            continue
        table = pd.read_csv(path)
        speed = table["speed [km/h]"].to_numpy() * M_S_PER_KM_H
        near = np.abs(speed - np.median(speed[speed > 1.0])) < STEADY_M_S
        near &= np.roll(near, 1) & np.roll(near, -1)
        current = table["battery current [A]"] + table["low-voltage branch current [A]"]
        power = -(current * table["battery voltage [V]"]).to_numpy()
        wh_per_km = power[near].mean() / speed[near].mean() * 1000.0 / SECONDS_PER_HOUR
        found.setdefault(float(name[1]), []).append(float(wh_per_km))
    return {speed: float(np.mean(values)) for speed, values in sorted(found.items())}


def at_speeds(model: ForecastModel, speeds: Mapping[float, float]) -> dict[float, Forecast]:
    """Forecasts of `DISTANCE_M` at constant speeds on rollers: level, climate control off, without the load of a moving car."""
    still = replace(model.vehicle.auxiliaries, moving_load_w=0.0)
    lab = replace(model, vehicle=replace(model.vehicle, auxiliaries=still))
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=LAB_DEGC, climate="off", follows_trip=True)
    made = {}
    for speed in speeds:
        time = np.arange(round(DISTANCE_M / (speed * M_S_PER_KM_H)) + 1.0)
        samples = {"time_s": time, "speed_m_s": np.full_like(time, speed * M_S_PER_KM_H), "elevation_m": 0.0}
        made[speed] = lab.forecast(tw.Plan.from_trace(f"{speed:g}", pd.DataFrame(samples), departure))
    return made


def pair_rows(name: str, model: ForecastModel, measured: Mapping[float, float], most: float) -> Iterator[Row]:
    """Error, coverage and width of the savings of all pairs of speeds."""
    forecasts, km = at_speeds(model, measured), DISTANCE_M / 1000.0
    errors, held, width, apart = [], [], [], []
    for slow, fast in itertools.combinations(measured, 2):
        saved = forecasts[fast].difference(forecasts[slow])
        low, high = saved.interval(0.9)
        seen = (measured[fast] - measured[slow]) * km
        errors.append(abs(saved.energy_wh - seen) / km)
        held.append(low <= seen <= high)
        width.append((high - low) / km)
        apart.append(
            float(np.hypot(*(np.ptp(forecasts[speed].interval(0.9)) for speed in (slow, fast)))) / km
        )
    yield Row(
        f"{name}: mean absolute error of {len(errors)} savings", float(np.mean(errors)), "Wh/km", most=most
    )
    yield Row(f"{name}: in the 90 % interval", float(np.mean(held)))
    yield Row(f"{name}: mean width", float(np.mean(width)), "Wh/km")
    ratio = float(np.mean(width) / np.mean(apart))
    yield Row(f"{name}: over the width of two independent forecasts", ratio, most=0.5)


def schedules(data: Path, reference: Path) -> Iterator[Row]:
    """Differences between schedules of a warm BMW i3 at 23 °C: the error over the norm of the simulated causes."""
    rows = pd.read_csv(reference / "anl_d3_i3.csv")
    rows = rows[(rows.climate == "off") & (rows.start == "hot")]
    measured, causes = rows.groupby("cycle").dc_wh_per_mile.mean(), {}
    car = tw.load_vehicle("bmw_i3_60ah")
    conditions = DriveConditions(
        on_dynamometer=True,
        ambient_temperature_degc=LAB_DEGC,
        payload_mass_kg=TEST_MASS_KG - car.body.test_mass_kg,
        climate="off",
        initial_warmth=1.0,
        air_density_kg_m3=car.road_load.coastdown_air_density_kg_m3,
    )
    for name in measured.index:
        cycle = pd.read_csv(data / "cycles" / f"{name.lower()}.csv")
        time, speed = (cycle[c].to_numpy(float) for c in ("cycSecs", "cycMps"))
        by_cause = simulate(car, time, speed, conditions=conditions).by_cause_wh
        causes[name] = np.array([*by_cause.values()]) / (np.trapezoid(speed, time) / M_PER_MILE)
    shares = []
    for one, other in itertools.combinations(measured.index, 2):
        changed = causes[one] - causes[other]
        shares.append((changed.sum() - measured[one] + measured[other]) / np.linalg.norm(changed))
    spread = float(np.sqrt(np.mean(np.square(shares))))
    yield Row(
        "BMW i3, error of a difference over its causes",
        spread,
        least=0.9 * MIN_SHARE,
        most=1.1 * MIN_SHARE,
    )


def link_rows(data: Path) -> Iterator[Row]:
    """What other speeds change on driven traces and on plans of the same trips: the error over that which links cause."""
    route = tw.load_model().fitted_parts("links")[1].route
    assert route is not None
    for name in ("tum", "sedan"):
        trips, car = trips_and_car(name, data)
        squares = []
        for length_m in LENGTHS_M:
            errors: dict[float | None, list[float]] = {}
            for trip in trips[:MAX_LINKED]:
                plans = (
                    Plan.from_trip(trip),
                    links_of_trip(trip, length_m).plan().with_departure(trip.departure),
                )
                before = [simulate_trip(car, plan).simulated_energy_wh for plan in plans]
                for km_h in (None, *SPEEDS_KM_H):
                    if km_h is not None and plans[1].array("speed_m_s").max() < km_h * M_S_PER_KM_H + 1.0:
                        continue
                    driven, planned = (
                        simulate_trip(car, slower(plan, km_h)).simulated_energy_wh for plan in plans
                    )
                    error = planned - before[1] - (driven - before[0])
                    errors.setdefault(km_h, []).append(error / (route.share(length_m) * before[1]))
            squares += [float(np.mean(np.square(each))) for each in errors.values()]
        ends = (0.9 * OTHER_SPEEDS, 1.1 * OTHER_SPEEDS) if name == "tum" else (-np.inf, np.inf)
        spread = float(np.sqrt(np.mean(squares)))
        yield Row(f"{name}, error of other speeds on links over that of the links", spread, "", *ends)


def slower(plan: Plan, km_h: float | None) -> Plan:
    """A plan driven no faster than a speed, or calmly without one."""
    return limit_acceleration(plan, GENTLE_M_S2) if km_h is None else cap_speed(plan, km_h * M_S_PER_KM_H)


def main(
    data: Annotated[Path, Argument(metavar="[FOLDER]")] = DATA, worlds: int = 1000, only: str | None = None
) -> int:
    """Print the rows; 1 when a bound is missed. `--only` lab, links, heating or worlds; `--worlds` is the number of drives."""
    parts: dict[str, Callable[[], Iterator[Row]]] = {
        "lab": partial(lab_rows, data),
        "links": partial(link_rows, data),
        "heating": partial(heating_rows, data),
        "worlds": lambda: world_rows(worlds, tw.load_model()),
    }
    return report(
        itertools.chain.from_iterable(part() for name, part in parts.items() if only in (None, name))
    )


def lab_rows(data: Path) -> Iterator[Row]:
    """The sedan and the BMW i3 on dynamometers."""
    measured, base = steady(data), tw.load_model()
    trips, car = trips_and_car("sedan", data)
    own = Adaptation.before_trips(base, car, population_of(base).without(["sedan"])).with_trips(trips).model
    yield from (
        Row(f"sedan, measured at {speed:g} km/h", value, "Wh/km") for speed, value in measured.items()
    )
    yield from schedules(data, REFERENCE)
    yield from pair_rows("from certified values", for_car(base, SEDAN), measured, 6.0)
    yield from pair_rows("with its road trips", own, measured, 4.0)


def rows() -> Iterator[Row]:
    """All bars."""
    yield from lab_rows(DATA)
    yield from link_rows(DATA)
    yield from heating_rows(DATA)
    yield from world_rows(1000, tw.load_model())


if __name__ == "__main__":
    run(main)
