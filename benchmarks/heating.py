"""What switching climate control off saves in the cold, against logs of TUM and VED: python -m benchmarks.savings --only heating.

The saving is that of advice: the forecast of a trip without climate control less that with it. No log of the scored set is in the model, nor in the
values of the car. It is compared in two ways. In the trip itself: heater and compressor are logged, and what they took is what they would not have
taken. Over pairs: a trip with heating and one without, of one vehicle on the same road (VED, both ends at one place), or of the same kind.

The first is the fairer comparison: it has the same road, day and driver, as the advice has. A pair has the errors of two trips, of which none is a
saving: its intervals have them as well.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

import tripwatt as tw
from benchmarks.measure import Row
from benchmarks.need import trips_and_car
from tripwatt.forecasting import Difference, Forecast, ForecastModel
from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.population.adapting import Adaptation, population_of
from tripwatt.trips import Trip
from tripwatt.uncertainty.coverage import clopper_pearson
from tripwatt.units import SECONDS_PER_HOUR, WH_PER_J
from tripwatt.vehicles import Vehicle, without_data

COLD_DEGC = 15.0
HEATED_W, UNHEATED_W = 300.0, 100.0
"""Mean logged power of climate control of a trip with heating, at least, and of one without it, at most."""
SAME_PLACE_M = 500.0
SAME_LENGTH = 0.1
ALIKE = 0.25
ALIKE_K = 8.0
M_PER_DEGREE = 111_000.0
DRAWS = 4000


@dataclass(frozen=True)
class Heated:
    """A trip in the cold: its forecasts with and without climate control, and what its log shows."""

    trip: Trip
    auto: Forecast
    off: Forecast
    climate_w: float

    @classmethod
    def of(cls, trip: Trip, model: ForecastModel) -> Heated | None:
        """None where the log has no power of heater and air conditioner."""
        edges = trip.array("time_s")[[0, -1]] + (0.0, 1e-6)
        logged = logged_climate(trip.samples, np.linspace(*edges, max(2, round(trip.duration_s / 30.0))))
        if logged is None or not np.isfinite(logged).any():
            return None
        power = float(np.nanmean(logged))
        return cls(trip, model.forecast(trip), model.forecast(trip, tw.Departure(climate="off")), power)

    @property
    def is_heated(self) -> bool:
        """Heater and compressor took as much as heating takes."""
        return self.climate_w >= HEATED_W

    @property
    def saved_wh(self) -> float:
        """What climate control took by the log, and its fans, which no log has, as simulated [Wh]; below 0 as a saving."""
        simulation = self.auto.drive.simulation
        fans_wh = float(simulation.fan_power_w @ np.diff(simulation.time_s, prepend=simulation.time_s[0]))
        return -self.climate_w * self.trip.duration_s / SECONDS_PER_HOUR - fans_wh * WH_PER_J

    @cached_property
    def own_sd_wh(self) -> float:
        """Standard deviation of the energy of such a trip with the right factors [Wh]."""
        scale = self.auto.uncertainty.scale
        return replace(scale, values=scale.values * (1.0, 1.0, 1.0, 0.0)).sd_wh(self.auto.drive.segments)


def unseen_model(name: str, vehicle: Vehicle) -> ForecastModel:
    """The model of a car to which no log of a data set gave anything."""
    base = tw.load_model()
    others = population_of(base).without([name])
    return Adaptation.before_trips(base, without_data(vehicle, name), others).model


def trips_in_the_cold(name: str, data: Path, most: int | None = None) -> list[Heated]:
    """Trips whose outside air is colder than `COLD_DEGC`, or of a heated cabin in warmer air than that; or a seeded sample of them."""
    trips, vehicle = trips_and_car(name, data)
    if most is not None:
        chosen = np.random.default_rng(39).choice(len(trips), min(most, len(trips)), replace=False)
        trips = [trips[k] for k in sorted(chosen)]
    model = unseen_model(name, vehicle)
    cold = [t for t in trips if (t.departure.ambient_temperature_degc or np.inf) < mildest(name)]
    return [seen for trip in cold if (seen := Heated.of(trip, model)) is not None]


def mildest(name: str) -> float:
    """Outside air up to which trips count [°C]: of TUM all of heating, since each of its trips in winter has it."""
    return {"tum": 20.0}.get(name, COLD_DEGC)


def ends(data: Path) -> dict[str, np.ndarray]:
    """First and last position of each trip of VED [m] on a plane."""
    names = ["VehId", "Trip", "Latitude[deg]", "Longitude[deg]"]
    weeks = [pd.read_csv(path, usecols=names) for path in sorted((data / "ved").glob("*_week.csv"))]
    groups = pd.concat(weeks).groupby(names[:2], sort=False)[names[2:]]
    first, last = groups.first(), groups.last()
    scale = M_PER_DEGREE * np.array([1.0, np.cos(np.radians(first[names[2]].mean()))])
    placed = np.stack((first.to_numpy() * scale, last.to_numpy() * scale), axis=1)
    return {f"VED{car}-{trip}": place for (car, trip), place in zip(first.index, placed, strict=True)}


def same_road(data: Path) -> Callable[[Trip, Trip], bool]:
    """Whether two trips of VED begin and end at the same places and are as long."""
    at = ends(data)

    def same(a: Trip, b: Trip) -> bool:
        apart = np.linalg.norm(at[a.trip_id] - at[b.trip_id], axis=1).max()
        return bool(apart < SAME_PLACE_M and abs(a.distance_m / b.distance_m - 1.0) < SAME_LENGTH)

    return same


def same_kind(a: Trip, b: Trip) -> bool:
    """Whether two trips are about as long and as fast, in about the same air."""
    degc = [trip.departure.ambient_temperature_degc or np.nan for trip in (a, b)]
    speed = a.distance_m / a.duration_s / (b.distance_m / b.duration_s)
    likes = abs(a.distance_m / b.distance_m - 1.0) < ALIKE and abs(speed - 1.0) < ALIKE
    return bool(likes and abs(degc[0] - degc[1]) <= ALIKE_K)


def two_way_interval(
    values: np.ndarray, groups: Sequence[Sequence[int]], seed: int = 0
) -> tuple[float, float]:
    """95 % interval of a mean over pairs by a bootstrap over the members of both sides, since a trip has several pairs."""
    rng, weight = np.random.default_rng(seed), np.ones((DRAWS, len(values)))
    for members in groups:
        _, its = np.unique(members, return_inverse=True)
        weight *= rng.multinomial(n := its.max() + 1, np.full(n, 1.0 / n), DRAWS)[:, its]
    total = weight.sum(axis=1)
    means = (weight @ values)[total > 0.0] / total[total > 0.0]
    low, high = np.quantile(means, (0.025, 0.975))
    return float(low), float(high)


def rows_of(
    what: str, stated: Sequence[Difference], seen_wh: Sequence[float], groups: Sequence[Sequence[int]]
) -> Iterator[Row]:
    """Stated and seen savings: means, error, bias and coverage."""
    mean, seen = np.array([d.energy_wh for d in stated]), np.array(seen_wh)
    held = [
        low <= wh <= high for (low, high), wh in zip((d.interval(0.9) for d in stated), seen, strict=True)
    ]
    low, high = two_way_interval(mean - seen, groups)
    shares = "{:.2f} to {:.2f}".format(*clopper_pearson(sum(held), len(held)))
    width = np.mean([np.ptp(d.interval(0.9)) for d in stated])
    yield Row(f"{what}: stated, mean of {len(seen)}", float(mean.mean()), "Wh")
    yield Row(f"{what}: measured, mean", float(seen.mean()), "Wh")
    yield Row(f"{what}: mean absolute error", float(np.abs(mean - seen).mean()), "Wh")
    note = f"95 % interval {low:.0f} to {high:.0f}"
    yield Row(f"{what}: bias, stated less measured", float((mean - seen).mean()), "Wh", note=note)
    yield Row(f"{what}: in the 90 % interval", float(np.mean(held)), note=f"95 % interval {shares}")
    yield Row(f"{what}: mean width of the 90 % interval", float(width), "Wh")


def pair_rows(what: str, trips: Sequence[Heated], same: Callable[[Trip, Trip], bool]) -> Iterator[Row]:
    """Trips without heating less those with it, of one vehicle."""
    with_it = [k for k, t in enumerate(trips) if t.is_heated]
    without = [k for k, t in enumerate(trips) if t.climate_w <= UNHEATED_W]
    pairs = [
        (k, j)
        for k, j in itertools.product(with_it, without)
        if trips[k].trip.context.car == trips[j].trip.context.car and same(trips[k].trip, trips[j].trip)
    ]
    stated, seen = [], []
    for k, j in pairs:
        heated, unheated = trips[k], trips[j]
        apart = unheated.off.difference(heated.auto)
        sd_wh = float(np.linalg.norm((apart.sd_wh, heated.own_sd_wh, unheated.own_sd_wh)))
        stated.append(replace(apart, sd_wh=sd_wh))
        seen.append(
            float(unheated.trip.observed_energy_wh or 0.0) - float(heated.trip.observed_energy_wh or 0.0)
        )
    if pairs:
        sides = list(zip(*pairs, strict=True))
        counts = f"{len({*sides[0]})} trips with, {len({*sides[1]})} without"
        yield from rows_of(f"{what} ({counts})", stated, seen, sides)


def heating_rows(data: Path, sets: Sequence[str] = ("ved", "tum"), most: int | None = None) -> Iterator[Row]:
    """Savings by climate control off, of each data set in both ways; a pair of its `most` trips."""
    for name in sets:
        trips = trips_in_the_cold(name, data, most)
        heated = [t for t in trips if t.is_heated]
        stated, seen = [t.off.difference(t.auto) for t in heated], [t.saved_wh for t in heated]
        yield from rows_of(f"{name}, heating off, in the trip", stated, seen, [range(len(heated))])
        if name == "ved":
            yield from pair_rows("ved, heating off, pairs of one road", trips, same_road(data))
        yield from pair_rows(f"{name}, heating off, pairs of one kind", trips, same_kind)
