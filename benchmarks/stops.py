"""Charging stops: plans against every plan, speed, and whether the stated chances hold in a made world.

Run: ``python -m benchmarks.stops``.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from tests.roads.journey.made import MadeRouter, straight
from tests.roads.journey.stop_problems import exhaustive, made_problem
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report, seconds
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.roads.journey import Atlas, ChargingCurve, Place, RoadForecaster
from tripwatt.roads.journey.corridor import Corridor, JourneyOptions
from tripwatt.roads.journey.plans import find_plans
from tripwatt.roads.journey.solver import LEVELS, least_time
from tripwatt.roads.journey.stops import ChargingPlan
from tripwatt.roads.maps.stations import Station
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.uncertainty import ChargeScale, UncertaintyModel
from tripwatt.uncertainty.charge import NORMAL_SCALE
from tripwatt.uncertainty.process import HeldOutResidual, Segments

INSTANCES = 500
DRAWS = 10_000
TRAINING_TRIPS = 200
STEP_S = 60.0
CONSTANT_W, DRIFT_W, DRIFT_S, SHARE = 350.0, 900.0, 600.0, 0.03
"""Errors of the made world: of every journey, drifting along it, and a share of the power that is moved."""
DISPLAY_SD = 0.006
CHANCE_ERROR = 0.02
LENGTH_KM, STATIONS = 1000.0, 200
ROAD = 330.0, 12
"""Length [km] and stations of the road on which the chances are counted."""


def residuals(moved_w: Any, rng: Any, constant_w: Any, share: Any) -> Any:
    """Errors of the power of the made world at steps of `STEP_S` [W], shape (draws, steps)."""
    draws, steps = len(constant_w), len(moved_w)
    keep = np.exp(-STEP_S / DRIFT_S)
    drift = np.empty((draws, steps))
    state = rng.normal(0.0, DRIFT_W, draws)
    for k in range(steps):
        state = keep * state + rng.normal(0.0, DRIFT_W * np.sqrt(1.0 - keep**2), draws)
        drift[:, k] = state
    return drift + constant_w[:, None] + share[:, None] * moved_w


def learned(rng: Any, charge: ChargeScale, count: int) -> UncertaintyModel:
    """Uncertainty from trips of the made world, of 15 to 70 minutes."""
    trips = []
    for _ in range(count):
        steps = int(rng.integers(15, 70))
        moved = np.full(steps, rng.uniform(4_000.0, 20_000.0))
        middle = (np.arange(steps) + 0.5) * STEP_S
        segments = Segments(np.asarray(middle, np.float64), np.full(steps, STEP_S), moved, np.zeros(steps))
        constant, share = rng.normal(0.0, CONSTANT_W, 1), rng.normal(0.0, SHARE, 1)
        trips.append(HeldOutResidual(segments, residuals(moved, rng, constant, share)[0]))
    return UncertaintyModel.from_held_out(trips, charge=charge)


class MadeModel(ForecastModel):
    """Forecasts whose errors are those of the made world alone: its corrector has no doubt of its own."""

    def forecast(self, trip: Plan | Trip, departure: Departure | None = None) -> Forecast:
        """With the spread of the learned process."""
        forecast = super().forecast(trip, departure)
        segments = replace(forecast.drive.segments, corrector_sd_wh=0.0, outside_sd_wh=0.0)
        uncertainty = forecast.uncertainty
        process_wh = float(forecast.posterior.sd_wh(forecast.open_hours)[-1])
        factor = uncertainty.scale.sd_wh(segments) / process_wh
        drive = replace(forecast.drive, segments=segments)
        return replace(forecast, drive=drive, sd_factor=factor, state_sd_wh=0.0)


@dataclass
class LevelRouter(MadeRouter):
    """Level roads: an unknown climb is no part of this world."""

    def roads(self, stops: Any, *, alternatives: int = 0) -> Any:
        """One road."""
        (leg,) = [straight(a, b, 110.0, "motorway", 1.05, level=True) for a, b in pairwise(stops)]
        return (leg,)


def planned(
    seed: int, length_km: float = ROAD[0], count: int = ROAD[1], trips: int = TRAINING_TRIPS
) -> Corridor:
    """A level road with stations in the made world, with what its trips taught."""
    rng = np.random.default_rng(seed)
    model = MadeModel(**vars(tw.load_model("bmw_i3_tum")))
    known = model.uncertainty_
    assert known is not None
    assert known.charge is not None
    charge = replace(known.charge, displayed_sd=DISPLAY_SD, hidden=0.0)
    model.uncertainty_ = learned(rng, charge, trips)
    end = Place(47.0, 9.0 + length_km / 1.05 / 75.9, "end")
    at = np.sort(rng.uniform(0.0, 1.0, count)) if count > 20 else (np.arange(count) + 1.0) / (count + 1.0)
    stations = tuple(
        Station(47.0, 9.0 + float(x) * (end.longitude_deg - 9.0), f"S{k}", 1e5, direct_current=True)
        for k, x in enumerate(at)
    )
    atlas = Atlas(LevelRouter(), stations=stations)
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=15.0, battery_temperature_degc=20.0)
    forecaster = RoadForecaster(model, departure)
    road = atlas.router.roads((Place(47.0, 9.0), end))[0]
    forecast = forecaster.forecast(road)
    curve = ChargingCurve.from_class(forecast.charge.wh_per_display)
    return Corridor(forecaster, road, forecast, atlas, JourneyOptions(0.1, charging_curve=curve))


def held(plan: ChargingPlan, draws: int, seed: int) -> tuple[list[float], float]:
    """Shares of drives of the made world that have the reserve at the end of each leg, and of all legs."""
    rng = np.random.default_rng(seed)
    constant, share = rng.normal(0.0, CONSTANT_W, draws), rng.normal(0.0, SHARE, draws)
    capacity = rng.normal(0.0, 0.03, draws)
    good = []
    for leg in plan.legs:
        forecast, charge = leg.forecast, leg.forecast.charge
        segments = forecast.drive.segments
        steps = np.arange(0.5 * STEP_S, forecast.plan.duration_s, STEP_S)
        edges = np.cumsum(segments.step_s)
        moved = segments.moved_w[np.minimum(np.searchsorted(edges, steps), len(edges) - 1)]
        error_wh = (
            residuals(moved, rng, constant, share).sum(axis=1)
            * forecast.plan.duration_s
            / len(steps)
            / 3600.0
        )
        taken = (forecast.energy_wh + error_wh) * (1.0 + capacity) / charge.wh_per_display
        start = float(forecast.along.soc(0.5)[0])
        shown = start - taken + rng.normal(0.0, DISPLAY_SD / NORMAL_SCALE, draws)
        good.append(shown >= plan.reserve)
    return [float(np.mean(leg)) for leg in good], float(np.mean(np.all(good, axis=0)))


def chances(
    draws: int = DRAWS, worlds: int = 3, trips: int = TRAINING_TRIPS, road: tuple[float, int] = ROAD
) -> tuple[float, float]:
    """Largest errors of the stated chance of a leg and of the whole journey, over worlds that were learned apart."""
    legs, wholes = [], []
    for seed in range(worlds):
        (plan, *_) = find_plans(planned(seed, *road, trips))

        shares, whole = held(plan, draws, 1000 + seed)
        legs += [share - leg.chance(plan.reserve) for share, leg in zip(shares, plan.legs, strict=True)]
        wholes.append(whole - plan.p_reserve)
    return max(legs, key=abs), max(wholes, key=abs)


def rows() -> Iterator[Row]:
    """All figures."""
    wrong = 0
    for seed in range(INSTANCES):
        problem = made_problem(seed)
        plan, least = least_time(problem), exhaustive(problem)
        wrong += abs(least - plan.duration_s) > 1e-6 if plan else np.isfinite(least)
    yield Row(f"roads of {INSTANCES} whose plan is not the best of all", wrong, most=0)
    problem = made_problem(0, stations=STATIONS, length_km=LENGTH_KM)
    times = np.random.default_rng(0).uniform(8.0, 30.0, (STATIONS + 2, 1))
    fine = replace(problem, charging_s=times * np.cumsum(1.0 + 4.0 * LEVELS**4))
    name = f"{LENGTH_KM:.0f} km with {STATIONS} stations"
    yield Row(
        f"optimum of {name}, from its legs", seconds(lambda: least_time(fine), clock=time.process_time), "s"
    )
    corridor = planned(0, LENGTH_KM, STATIONS)

    def plans() -> tuple[ChargingPlan, ...]:
        return find_plans(replace(corridor))

    found = plans()
    yield Row(
        f"all plans of {name}, routed and forecast with {corridor.forecaster.model.vehicle.name}, on one core",
        seconds(plans, 3, clock=time.process_time),
        "s",
        most=1.5,
        note=", ".join(f"{plan.label}: {len(plan.stops)} stops" for plan in found),
    )
    yield Row(
        "chance of the whole journey with the fastest of them", found[0].p_reserve, least=0.95, most=0.97
    )
    for road in (ROAD, (LENGTH_KM, STATIONS)):
        for name, error in zip(("a leg", "the whole journey"), chances(road=road), strict=True):
            yield Row(
                f"share of {DRAWS} drives that have the reserve less the stated chance, {road[0]:.0f} km, {name}",
                error,
                least=-CHANCE_ERROR,
                most=CHANCE_ERROR,
            )


def main() -> int:
    """Print every figure; 1 when a bound is missed."""
    return report(rows())


if __name__ == "__main__":
    run(main)
