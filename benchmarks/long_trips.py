"""Coverage on long trips that training never had: ``python -m benchmarks.long_trips [--trips 560] [--cars 100]``.

Synthetic trips of 100 to 400 km with a car of 75 kWh: its own model, fitted on 60 trips of less than an hour, then cars
whose book values are off by the published spreads (`PARAMETERS`), without trips and with ten short ones of their own.
Prints the share inside of the 50, 80 and 90 % interval and the width of the last over the energy.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from joblib import Parallel, delayed

import tripwatt as tw
from tripwatt.hybrid.parameters import PARAMETERS, changed
from tripwatt.transfer.zero_shot import on_vehicle
from tripwatt.trips import Trip, plan_from_trip
from tripwatt.vehicles import Vehicle

CAR = "tesla_model_3_lr"
HOURS = (1.1, 4.3)
KM = (100.0, 400.0)
LEVELS = (0.5, 0.8, 0.9)
OWN_TRIPS, LONG_TRIPS = 10, 4
TRAINING = 60
BAR = (0.86, 0.94)
BATCH = 40


def long_trips(vehicle: Vehicle, n: int, seed: int) -> list[Trip]:
    """Trips of `KM` kilometres that the battery lasts for."""
    fleet = tw.synthetic_fleet(n, seed, vehicle=vehicle, hours=HOURS)
    return [
        trip
        for trip in fleet.trips
        if KM[0] <= trip.distance_m / 1000.0 <= KM[1] and float(trip.array("soc")[-1]) > 0.02
    ]


def scored(model: tw.ForecastModel, trips: Sequence[Trip]) -> np.ndarray:
    """Energy relative to the forecast, whether each of `LEVELS` holds it, and the width of the last, a row for each trip."""
    rows = []
    for trip in trips:
        found = model.forecast(plan_from_trip(trip))
        observed = float(trip.observed_energy_wh or np.nan)
        inside = [low <= observed <= high for low, high in map(found.interval, LEVELS)]
        low, high = found.interval(LEVELS[-1])
        rows.append([found.energy_wh / observed - 1.0, *inside, (high - low) / found.energy_wh])
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(LEVELS) + 2)


def of_car(seed: int, base: tw.ForecastModel) -> tuple[np.ndarray, np.ndarray]:
    """Scores of one car with wrong book values: without trips, and with `OWN_TRIPS`."""
    book = tw.load_vehicle(CAR)
    rng = np.random.default_rng(seed)
    # log-normal, so that no value changes its sign
    changes = {p.name: float(np.expm1(p.width * rng.standard_normal())) for p in PARAMETERS}
    true = changed(book, changes)
    trips = long_trips(true, 2 * LONG_TRIPS, 10_000 + seed)[:LONG_TRIPS]
    own = tw.synthetic_fleet(OWN_TRIPS, 20_000 + seed, vehicle=true).trips
    without = scored(on_vehicle(base, book)[0], trips)
    return without, scored(tw.adapt(base, own, book), trips)


def line(name: str, rows: np.ndarray) -> bool:
    """Print one set of trips; whether its 90 % interval meets the bar."""
    error, *inside, width = rows.mean(axis=0)
    mape = np.abs(rows[:, 0]).mean()
    shares = ", ".join(f"{level:.0%}: {share:.1%}" for level, share in zip(LEVELS, inside, strict=True))
    met = BAR[0] <= inside[-1] <= BAR[1]
    print(
        f"{name}: {len(rows)} trips, error {mape:.1%}, bias {error:+.1%}, inside {shares}, 90 % width {width:.1%} of the "
        f"energy; {'met' if met else 'missed'}",
        flush=True,
    )
    return bool(met)


def main() -> int:
    """Print the coverage; exit code 1 when a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trips", type=int, default=560)
    parser.add_argument("--cars", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    car = tw.load_vehicle(CAR)
    own = tw.fit(tw.synthetic_fleet(TRAINING, 1, vehicle=car).trips, car)
    run = Parallel(n_jobs=chosen.jobs)
    batches = -(-chosen.trips // BATCH)
    parts = run(
        delayed(lambda seed: scored(own, long_trips(car, 2 * BATCH, seed)[:BATCH]))(100 + k)
        for k in range(batches)
    )
    met = line("own model", np.concatenate(parts)[: chosen.trips])
    base = tw.load_model()
    cars = run(delayed(of_car)(seed, base) for seed in range(chosen.cars))
    met &= line("wrong book values, no trips", np.concatenate([without for without, _ in cars]))
    met &= line(f"wrong book values, {OWN_TRIPS} trips", np.concatenate([adapted for _, adapted in cars]))
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main())
