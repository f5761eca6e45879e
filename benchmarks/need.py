"""Need without a road: python -m benchmarks.need [FOLDER] [--fit].

Trips of TUM, VED and the sedan as if distance, kind of road and outside temperature were all that is known. The kind is the shares of city, country and
motorway rounded to quarters, or nothing ("mixed"). The roads of the data set that is scored are left out. The car is known by its
other trips: each is forecast by a model that has not seen its fold; or by none. The sedan's trips teach no model that is shipped.
`--fit` prints what `tripwatt.roads.journey.kinds.STUDIES` holds.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from scipy.optimize import nnls
from tools import DATA
from tools.command import run
from typer import Argument

import tripwatt as tw
from benchmarks.measure import Row, report, seconds
from benchmarks.unknown_climb import trips_of
from tripwatt.auditing import audit
from tripwatt.forecasting import ForecastModel
from tripwatt.physics import simulate_trip
from tripwatt.population.adapting import Adaptation, population_of
from tripwatt.roads.journey.distances import BAND, KindForecaster, roads_of_model
from tripwatt.roads.journey.kinds import (
    STUDIES,
    USUAL_KM_H,
    USUAL_SHARES,
    RoadPrior,
    RoadStudy,
    road_prior,
    round_shares,
)
from tripwatt.routes.free_flow import driven_by_kind
from tripwatt.sources import read_logs
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.units import M_S_PER_KM_H
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.comparing import without_data

QUANTILE = 0.9
HOLDS = (0.85, 0.96)
INSIDE = (0.86, 0.96)
SHORTEST_M = 2000.0
FOLDS = 3


def trips_and_car(name: str, data: Path) -> tuple[list[Trip], Vehicle]:
    """Trips of a data set that are long enough, with their car."""
    if name == "ved":
        trips, car = list(audit(read_logs(data / "ved", "ved")).trips), tw.load_vehicle("nissan_leaf_24")
    else:
        with tempfile.TemporaryDirectory() as folder:
            trips, car = trips_of(name, data, Path(folder))
    return [t for t in trips if t.distance_m > SHORTEST_M and t.observed_energy_wh is not None], car


def study(trips: Sequence[Trip], car: Vehicle) -> RoadStudy:
    """What a data set shows: speeds by class, and the errors of simulated energy by the kind of road alone."""
    classes = [driven_by_kind(trip).reshape(2, 3) for trip in trips]
    length, time = (np.sum([c[i] for c in classes], axis=0) for i in (0, 1))
    own = RoadPrior(tuple(M_S_PER_KM_H * speed for speed in USUAL_KM_H), USUAL_SHARES, (), ())
    driven_wh = [simulate_trip(car, _flat(Plan.from_trip(trip))).simulated_energy_wh for trip in trips]
    parts = []
    for known in (True, False):
        errors = []
        for trip, driven, (metres, _) in zip(trips, driven_wh, classes, strict=True):
            plan = own.plan(trip.distance_m, round_shares(metres) if known else own.usual)
            kind = simulate_trip(car, plan.with_departure(trip.departure)).simulated_energy_wh
            errors.append(driven / kind - 1.0)
        design = np.column_stack((np.ones(len(trips)), [1.0 / t.distance_m for t in trips]))
        parts.append(tuple(nnls(design, np.array(errors) ** 2)[0].tolist()))
    return RoadStudy(tuple(length.tolist()), tuple(time.tolist()), *parts)


def _flat(plan: Plan) -> Plan:
    return replace(plan, samples=plan.samples.drop(columns=["elevation_m", "grade"], errors="ignore"))


def models(name: str, trips: Sequence[Trip], car: Vehicle) -> Iterator[tuple[str, list[int], ForecastModel]]:
    """What is known of the car, numbers of some trips, and a model: without trips of the car, and with the trips of the other folds.

    The latter is fitted on those of TUM; for other cars the model of TUM is adapted.
    """
    base = tw.load_model()
    new = Adaptation.before_trips(base, without_data(car, name), population_of(base).without([name]))
    yield "no trips", list(range(len(trips))), new.model
    fold = np.arange(len(trips)) % FOLDS
    for number in range(FOLDS):
        train = [t for t, f in zip(trips, fold, strict=True) if f != number]
        model = ForecastModel(car).fit(train) if name == "tum" else new.with_trips(train).model
        yield "own trips", np.flatnonzero(fold == number).tolist(), model


Outcome = tuple[float, float, float, float, float, float]


def outcomes(name: str, trips: Sequence[Trip], car: Vehicle) -> dict[tuple[str, str], list[Outcome]]:
    """By what is known of the car and of the road, of each trip: its measured energy, this over need, range with what it took over its distance (the fall of its
    display, else its energy), and the low end, the median and the high end of the need over the measured energy. The quantile holds where the second and the third are at
    most 1."""
    prior, found = road_prior(without=name), dict[tuple[str, str], list[Outcome]]()
    for known, members, model in models(name, trips, car):
        own = roads_of_model(model, prior)
        for k, road in itertools.product(members, ("kind", "mixed")):
            trip, of_kind = trips[k], road == "kind"
            departure = Departure(ambient_temperature_degc=trip.departure.ambient_temperature_degc)
            shares = round_shares(driven_by_kind(trip)[:3]) if of_kind else prior.usual
            asked = KindForecaster(model, departure, shares, of_kind, prior, not of_kind, own)
            energy, _, _ = asked.quantiles(trip.distance_m, (BAND[0], 0.5, QUANTILE, BAND[1]))
            observed = float(trip.observed_energy_wh or np.nan)
            shown = trip.array("displayed_soc") if "displayed_soc" in trip else np.empty(0)
            shown = shown[np.isfinite(shown)]
            falls = len(shown) > 1 and bool(shown[0] > shown[-1])
            fell = float(shown[0] - shown[-1]) if falls else observed
            (far_m,) = asked.inverse(fell, (QUANTILE,), 1 if falls else 0)
            low, middle, most, high = (energy / observed).tolist()
            row = (observed, 1.0 / most, far_m / trip.distance_m, low, middle, high)
            found.setdefault((known, road), []).append(row)
    return found


def set_rows(name: str, data: Path, most: int | None = None) -> Iterator[Row]:
    """How often need and range hold on the trips of a data set, or on a seeded sample of them, and how wide the interval of need is."""
    trips, car = trips_and_car(name, data)
    if most is not None:
        chosen = np.random.default_rng(38).choice(len(trips), min(most, len(trips)), replace=False)
        trips = [trips[k] for k in sorted(chosen)]
    for (known, road), rows in outcomes(name, trips, car).items():
        observed, need, far, low, middle, high = np.array(rows).T
        of = f"{name}, {known}, {road}"
        if known == "own trips":
            for asked, ratio in (("need", need), ("range", far)):
                held = float(np.mean(ratio <= 1.0))
                yield Row(f"{of}: {asked} of {QUANTILE:.0%} holds, of {len(rows)}", held, "", *HOLDS)
        inside = float(np.mean((low <= 1.0) & (high >= 1.0)))
        yield Row(f"{of}: need inside 90 %, of {len(rows)}", inside, "", *INSIDE)
        weight = observed / observed.sum()
        yield Row(f"{of}: width of the 90 % over the energy", float((high - low) @ weight))
        yield Row(f"{of}: median over the measured energy", float(middle @ weight))


def speed_rows() -> Iterator[Row]:
    """Time of need and range in process: of distances and charges that were not asked before, and of a new temperature."""
    model = tw.load_model()
    cold = tw.Departure(ambient_temperature_degc=-5.0)
    distances, charges = itertools.count(20), itertools.count(1)
    calls = {
        "need": lambda: tw.need(next(distances), departure=cold, model=model),
        "range": lambda: tw.range_km(0.3 + 0.01 * next(charges), departure=cold, model=model),
    }
    for name, call in calls.items():
        yield Row(f"{name}, p50", 1000.0 * seconds(call, 31), "ms", most=10.0)
    degrees = itertools.count(100)
    first = {
        "need": lambda d: tw.need(50.0, departure=d, model=model),
        "range": lambda d: tw.range_km(0.5, departure=d, model=model),
    }
    for name, ask in first.items():
        took = seconds(lambda ask=ask: ask(tw.Departure(ambient_temperature_degc=0.1 * next(degrees))), 5)
        yield Row(f"{name}, first of a temperature, p50", 1000.0 * took, "ms")


def main(
    data: Annotated[Path, Argument(metavar="[FOLDER]")] = DATA,
    fit: bool = False,
    only: str | None = None,
    most: int | None = None,
) -> int:
    """Print the rows; 1 when a bound is missed. `--only` a data set or "speed"; `--most` trips of each, drawn with a seed; `--fit` prints the studies of the roads."""
    if fit:
        for name in STUDIES:
            print(name, study(*trips_and_car(name, data)))
        return 0
    sets = [name for name in ("tum", "ved", "sedan") if only in (None, name)]
    rows = itertools.chain(
        *(set_rows(name, data, most) for name in sets), speed_rows() if only in (None, "speed") else ()
    )
    return report(rows)


if __name__ == "__main__":
    run(main)
