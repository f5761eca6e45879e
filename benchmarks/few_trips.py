"""What a few own trips teach: `python -m benchmarks.few_trips [--cars 100]`.

Synthetic cars of the middle class whose book values are off by the published spreads (`PARAMETERS`) forecast ten further trips
without trips of their own and with 5, 10 and 20. Prints the error, that of the same number of trips as a constant Wh/km, the
share inside of the 90 % interval and its width over the energy.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from joblib import Parallel, delayed

import tripwatt as tw
from benchmarks.long_trips import LEVELS, scored
from tripwatt.hybrid.parameters import PARAMETERS, changed
from tripwatt.transfer.zero_shot import on_vehicle
from tripwatt.trips import Trip

CAR = "vw_id3"
OWN = (0, 5, 10, 20)
ASKED = 10
COVERAGE = (0.86, 0.95)
WIDTHS = {0: 0.45, 10: 0.30}


def constant(own: Sequence[Trip], asked: Sequence[Trip]) -> np.ndarray:
    """Error of the energy of a kilometre of own trips, relative to each energy."""
    energy = sum(trip.observed_energy_wh or 0.0 for trip in own)
    rate = energy / sum(trip.distance_m for trip in own)
    return np.array([rate * trip.distance_m / (trip.observed_energy_wh or np.nan) - 1.0 for trip in asked])


def of_car(seed: int, base: tw.ForecastModel) -> list[np.ndarray]:
    """Scores of one car for each number of own trips: of the model as `scored`, and of the constant."""
    book = tw.load_vehicle(CAR)
    rng = np.random.default_rng(seed)
    true = changed(book, {p.name: float(np.expm1(p.width * rng.standard_normal())) for p in PARAMETERS})
    trips = tw.synthetic_fleet(max(OWN) + ASKED, 30_000 + seed, vehicle=true).trips
    order = rng.permutation(len(trips))  # days have a driver and a weather of their own
    own, asked = ([trips[i] for i in part] for part in (order[ASKED:], order[:ASKED]))
    found = []
    for k in OWN:
        model = tw.adapt(base, own[:k], book) if k else on_vehicle(base, book)[0]
        rate = constant(own[:k], asked) if k else np.full(ASKED, np.nan)
        found.append(np.column_stack([scored(model, asked), rate]))
    return found


def main() -> int:
    """Print a line for each number of own trips; exit code 1 when a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    base = tw.load_model()
    cars = Parallel(n_jobs=chosen.jobs)(delayed(of_car)(seed, base) for seed in range(chosen.cars))
    every_met = True
    for i, k in enumerate(OWN):
        rows = np.concatenate([car[i] for car in cars])
        ours, theirs = np.abs(rows[:, 0]).mean(), np.abs(rows[:, -1]).mean()
        inside, width = rows[:, len(LEVELS)].mean(), rows[:, len(LEVELS) + 1].mean()
        met = COVERAGE[0] <= inside <= COVERAGE[1] and width <= WIDTHS.get(k, np.inf) and not ours > theirs
        every_met &= bool(met)
        print(
            f"{k} own trips: error {ours:.1%}, constant {theirs:.1%}, inside 90 %: {inside:.1%}, width {width:.1%} of the "
            f"energy, {len(rows)} trips; {'met' if met else 'missed'}",
            flush=True,
        )
    return 0 if every_met else 1


if __name__ == "__main__":
    raise SystemExit(main())
