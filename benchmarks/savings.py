"""Savings that are stated against savings that were measured: python -m benchmarks.savings [FOLDER].

Constant speeds of the sedan on a dynamometer: the steady parts of its runs, the mean of the repetitions. Each pair of speeds has a saving, which is
predicted from certified values alone and by the car with its own road trips; no laboratory run enters a fit. `LEAST_SHARE` of a difference comes from
another car on another dynamometer: schedules that Argonne drove with a warm BMW i3.
Synthetic worlds: cars of `benchmarks.worlds`, whose values are not the published ones, drive trips with and without what is advised. `--worlds N` of them.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from tools import DATA, REFERENCE
from tools.command import run
from typer import Argument

import tripwatt as tw
from benchmarks.argonne import TEST_MASS_KG
from benchmarks.measure import Row, report
from benchmarks.need import trips_and_car
from benchmarks.worlds import WORLDS
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.difference import LEAST_SHARE
from tripwatt.hybrid.parameters import changed
from tripwatt.physics import DriveConditions, simulate, simulate_trip
from tripwatt.population import for_car
from tripwatt.population.adapting import Adaptation, population_of
from tripwatt.trips import Plan, plan_from_trip
from tripwatt.units import M_PER_MILE, M_S_PER_KM_H, SECONDS_PER_HOUR

STEADY_M_S = 0.3
DISTANCE_M = 20_000.0
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
        made[speed] = lab.forecast(tw.Plan.from_samples(f"{speed:g}", pd.DataFrame(samples), departure))
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
        least=0.9 * LEAST_SHARE,
        most=1.1 * LEAST_SHARE,
    )


def followed(world: str, seed: int, base: ForecastModel) -> tuple[list[bool], bool | None]:
    """Whether the true saving of each action is in its 90 % interval, and whether a driver who follows the advice arrives; None where none suffices."""
    rng = np.random.default_rng(seed)
    book = tw.load_vehicle(SEDAN)
    true = changed(book, WORLDS[world][1](rng))
    (trip,) = tw.synthetic_fleet(1, 40_000 + seed, vehicle=book, hours=(0.5, 2.0)).trips
    known = replace(plan_from_trip(trip).departure, extras=("roof_box",), soc=None, bms_soc=None)
    plan = replace(plan_from_trip(trip), departure=known)
    model = for_car(base, book)
    needed = model.forecast(plan).soc_needed(0.1, float(rng.uniform(0.75, 0.94)))
    advice = tw.advise(model.forecast(plan, tw.Departure(soc=min(max(needed, 0.11), 1.0))))

    def taken_wh(of: Plan) -> float:
        return simulate_trip(true, of).simulated_energy_wh

    before = advice.forecast.plan
    as_it_is = taken_wh(before)
    held = []
    for advised in advice.singly:
        saved = taken_wh(advised.forecast.plan) - as_it_is
        low, high = advised.difference.interval(0.9)
        held.append(bool(low <= saved <= high))
    if not advice.least:
        return held, None
    best = advice.least[0]
    left = (
        float(before.departure.soc or 0.0)
        - taken_wh(best.forecast.plan) / best.forecast.charge.wh_per_display
    )
    return held, left >= advice.reserve


def world_rows(worlds: int, base: ForecastModel) -> Iterator[Row]:
    """Coverage of savings, and the share that arrives, in worlds that the intervals do not know and in one whose spreads they contain."""
    for world in ("published", "siblings"):
        results = [followed(world, seed, base) for seed in range(worlds)]
        held = [inside for each, _ in results for inside in each]
        arrived = [there for _, there in results if there is not None]
        yield Row(
            f"{world}: savings in their 90 % interval, of {len(held)}", float(np.mean(held)), "", 0.86, 0.94
        )
        yield Row(f"{world}: arrived as advised, of {len(arrived)}", float(np.mean(arrived)), "", 0.93, 0.97)


def main(
    data: Annotated[Path, Argument(metavar="[FOLDER]")] = DATA, worlds: int = 100, only: str | None = None
) -> int:
    """Print the rows; 1 when a bound is missed. `--only` lab or worlds."""
    if only == "worlds":
        return report(world_rows(worlds, tw.load_model()))
    measured, base = steady(data), tw.load_model()
    trips, car = trips_and_car("sedan", data)
    own = Adaptation.before_trips(base, car, population_of(base).without(["sedan"])).with_trips(trips).model
    return report(
        itertools.chain(
            (Row(f"sedan, measured at {speed:g} km/h", value, "Wh/km") for speed, value in measured.items()),
            schedules(data, REFERENCE),
            pair_rows("from certified values", for_car(base, SEDAN), measured, 6.0),
            pair_rows("with its road trips", own, measured, 4.0),
            () if only == "lab" else world_rows(worlds, base),
        )
    )


if __name__ == "__main__":
    run(main)
