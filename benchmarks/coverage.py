"""Coverage of the intervals on many synthetic trips, by ten folds: `python -m benchmarks.coverage [--trips 600]`.

Every trip is forecast by a model whose corrector, process, scale and scores have not seen it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from tools.command import run

from tripwatt.forecasting import ForecastModel
from tripwatt.study.evaluation.forecast_data import ForecastData
from tripwatt.study.evaluation.forecast_scores import LEVELS
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.vehicles import load_vehicle

FOLDS = 10
SEED = 2026


@dataclass(frozen=True)
class Covered:
    """Shares of held-out trips inside their intervals and mean widths, in the order of `LEVELS`."""

    trips: int
    share: tuple[float, ...]
    width_wh: tuple[float, ...]
    mape: float


def synthetic_coverage(trips: int = 600, seed: int = SEED) -> Covered:
    car = load_vehicle("bmw_i3_60ah")
    fleet = ForecastData.from_trips(synthetic_fleet(trips, seed=seed).trips, car)
    folds = np.random.default_rng(seed).permutation(trips) % FOLDS
    inside, width, apes = [], [], []
    for fold in range(FOLDS):
        model = ForecastModel(car).fit_segments(fleet.segments.take(np.flatnonzero(folds != fold)))
        for i in np.flatnonzero(folds == fold):
            forecast = model.forecast(fleet.plans[i])
            observed = float(fleet.logs[i]["observed_energy_wh"].iloc[-1])
            bounds = np.array([forecast.interval(level) for level in LEVELS])
            inside.append((bounds[:, 0] <= observed) & (observed <= bounds[:, 1]))
            width.append(bounds[:, 1] - bounds[:, 0])
            apes.append(abs(forecast.energy_wh - observed) / observed)
    return Covered(
        trips,
        tuple(map(float, np.mean(inside, axis=0))),
        tuple(map(float, np.mean(width, axis=0))),
        float(np.mean(apes)),
    )


def main(trips: int = 600, seed: int = SEED) -> None:
    """Print error, coverage and width."""
    covered = synthetic_coverage(trips, seed)
    print(f"{covered.trips} synthetic trips, {FOLDS} folds, mean APE {covered.mape:.4f}")
    for level, share, width in zip(LEVELS, covered.share, covered.width_wh, strict=True):
        print(f"{level:.0%} interval: covers {share:.1%}, mean width {width / 1000:.3f} kWh")


if __name__ == "__main__":
    run(main)
