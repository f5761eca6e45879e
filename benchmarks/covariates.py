"""What the covariates of the Renault Twizy's trips bring, each trip forecast by a fit on the others: ``python -m benchmarks.covariates``.

The logs have traffic, humidity and wind. The trips are those of the package's sample; nothing is chosen on them.
"""

from __future__ import annotations

import numpy as np
from tools.command import run

import tripwatt as tw
from tripwatt.arrays import FloatArray

NAMES = ("traffic", "humidity", "wind")


def errors(corrector: str, covariates: tuple[str, ...]) -> FloatArray:
    """Relative error of the forecast of each trip by a model fitted on all others."""
    trips, car = tw.audit(tw.sample_trips("twizy")).trips, tw.describe_car(body="quadricycle")
    shares = []
    for trip in trips:
        others = [other for other in trips if other is not trip]
        model = tw.fit(others, car, corrector=corrector, covariates=covariates)
        shares.append(model.forecast(trip).energy_wh / (trip.observed_energy_wh or np.nan) - 1.0)
    return np.array(shares)


def main(corrector: str = "linear") -> None:
    """Print the mean absolute errors and their paired difference with its standard error."""
    without = 100.0 * np.abs(errors(corrector, ()))
    print(f"{corrector}, without covariates: {without.mean():.2f} % on {len(without)} trips")
    for names in ((name,) for name in NAMES):
        _show(corrector, names, without)
    _show(corrector, NAMES, without)


def _show(corrector: str, names: tuple[str, ...], without: FloatArray) -> None:
    paired = 100.0 * np.abs(errors(corrector, names)) - without
    sd = paired.std(ddof=1) / np.sqrt(len(paired))
    print(
        f"with {', '.join(names)}: {(without + paired).mean():.2f} %, difference {paired.mean():+.2f} ± {sd:.2f}"
    )


if __name__ == "__main__":
    run(main)
