"""Coverage on long trips that training never had: ``python -m benchmarks.long_trips [--trips 560] [--cars 100] [--write]``.

Synthetic trips of 100 to 400 km with a car of 75 kWh: its own model, fitted on 60 trips of less than an hour, then cars
of `benchmarks.worlds`, whose values are not the published ones, without trips and with ten short ones of their own.
Prints the share inside of the 50, 80 and 90 % interval and the width of the last over the energy. Bars are those of the world of the
published spreads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed
from tools.command import run
from tools.docs import pages

import tripwatt as tw
from benchmarks.worlds import LEVELS, WORLDS, Row, changed, table
from tripwatt.population import for_car
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan, Trip
from tripwatt.vehicles import Vehicle

CAR = "tesla_model_3_lr"
HOURS = (1.1, 4.3)
KM = (100.0, 400.0)
OWN_TRIPS, LONG_TRIPS = 10, 4
TRAINING = 60
BAR = (0.86, 0.94)
BATCH = 40
KNOWN = ("published values", f"{OWN_TRIPS} short trips of its own")


def long_trips(vehicle: Vehicle, n: int, seed: int) -> list[Trip]:
    """Trips of `KM` kilometres that the battery lasts for."""
    fleet = synthetic_fleet(n, seed, vehicle=vehicle, hours=HOURS)
    return [
        trip
        for trip in fleet.trips
        if KM[0] <= trip.distance_m / 1000.0 <= KM[1] and float(trip.array("soc")[-1]) > 0.02
    ]


def scored(model: tw.ForecastModel, trips: Sequence[Trip]) -> np.ndarray:
    """Energy relative to the forecast, whether each of `LEVELS` holds it, and the width of the last, a row for each trip."""
    rows = []
    for trip in trips:
        forecast = model.forecast(Plan.from_trip(trip))
        observed = float(trip.observed_energy_wh or np.nan)
        inside = [low <= observed <= high for low, high in map(forecast.interval, LEVELS)]
        low, high = forecast.interval(LEVELS[-1])
        rows.append([forecast.energy_wh / observed - 1.0, *inside, (high - low) / forecast.energy_wh])
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(LEVELS) + 2)


def of_car(world: str, seed: int, base: tw.ForecastModel) -> tuple[np.ndarray, np.ndarray]:
    """Scores of one car with other than its published values: without trips, and with `OWN_TRIPS`."""
    book = tw.load_vehicle(CAR)
    true = changed(book, WORLDS[world][1](np.random.default_rng(seed)))
    trips = long_trips(true, 2 * LONG_TRIPS, 10_000 + seed)[:LONG_TRIPS]
    own = synthetic_fleet(OWN_TRIPS, 20_000 + seed, vehicle=true).trips
    without = scored(for_car(base, book), trips)
    return without, scored(tw.adapt(base, own, book), trips)


def main(
    trips: int = 560, cars: int = 100, jobs: int = 2, world: str = "published", write: bool = False
) -> int:
    """Print the coverage; 1 when a bar is missed. `--write` renews docs/reference/synthetic.md, with all worlds; so does `--world all`."""
    car = tw.load_vehicle(CAR)
    own = tw.fit(synthetic_fleet(TRAINING, 1, vehicle=car).trips, car)
    parallel = Parallel(n_jobs=jobs)
    batches = -(-trips // BATCH)
    parts = parallel(
        delayed(lambda seed: scored(own, long_trips(car, 2 * BATCH, seed)[:BATCH]))(100 + k)
        for k in range(batches)
    )
    errors = np.concatenate(parts)[:trips]
    own_model = Row.of("its own", f"its model, of {TRAINING} short trips", list(errors[:, None, :]))
    rows = [replace(own_model, cars=1)]
    base = tw.load_model()
    for name in WORLDS if write or world == "all" else (world,):
        every = parallel(delayed(of_car)(name, seed, base) for seed in range(cars))
        rows += [
            Row.of(name, known, list(part))
            for known, part in zip(KNOWN, zip(*every, strict=True), strict=True)
        ]
    print(table(rows), flush=True)
    if write:
        pages.renew("reference/synthetic.md", "long-trips", table(rows))
        return 0
    bound = [row for row in rows if row.world in ("its own", "published")]
    return int(not all(BAR[0] <= row.inside[-1] <= BAR[1] for row in bound))


if __name__ == "__main__":
    run(main)
