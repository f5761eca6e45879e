"""Every corrector that was tried for the forecast, leave-one-trip-out: `python -m benchmarks.variants`.

The 58 reference trips, point forecasts only. What the evaluation reports as models of its own is not repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from tools.command import run

from benchmarks.measure import tum_folder
from tripwatt.hybrid import SegmentTable, power_corrector, segment_table
from tripwatt.hybrid.power import (
    CLIMATE_TERMS,
    DRIVE_TERMS,
    DRIVE_TREE_FEATURES,
    TREE_FEATURES,
    EnsembleCorrector,
    GPCorrector,
    PowerCorrector,
    SplitCorrector,
    boosting_corrector,
)
from tripwatt.physics import simulate_trip
from tripwatt.sources import read_logs
from tripwatt.trips import Plan, Trip
from tripwatt.vehicles import load_vehicle

FRACTIONS = (0.25, 0.5, 0.75)
BEFORE = ("before_w", "before_acceleration_w")


def split(climate: PowerCorrector, drive: PowerCorrector) -> SplitCorrector:
    return SplitCorrector(climate, drive, drive, True)


def both(features: tuple[str, ...]) -> EnsembleCorrector:
    return EnsembleCorrector([GPCorrector(DRIVE_TERMS), boosting_corrector(0, features)])


def climate() -> GPCorrector:
    return GPCorrector(CLIMATE_TERMS, share_column="climate_w")


CLIMATE_TREE = (
    "climate_w",
    "simulated_w",
    "speed_m_s",
    "time_s",
    *(c for c in TREE_FEATURES if "temperature" in c),
)
VARIANTS: Mapping[str, tuple[str, Callable[[], PowerCorrector]]] = {
    "split": ("climate and driving separately: the default", lambda: power_corrector("split")),
    "split, driving by process": (
        "both by Gaussian processes",
        lambda: split(climate(), GPCorrector(DRIVE_TERMS)),
    ),
    "split, driving by boosting": (
        "climate by process, driving by boosting",
        lambda: split(climate(), boosting_corrector(0, DRIVE_TREE_FEATURES)),
    ),
    "split, climate by boosting": (
        "climate by boosting, driving as in the default",
        lambda: split(boosting_corrector(0, CLIMATE_TREE), both(DRIVE_TREE_FEATURES)),
    ),
    "split, segment before": (
        "the trees also see the simulated power of the segment before",
        lambda: split(climate(), both((*DRIVE_TREE_FEATURES, *BEFORE))),
    ),
    "split, time to the end": (
        "the trees also see the time to the end of the trip",
        lambda: split(climate(), both((*DRIVE_TREE_FEATURES, "to_end_s"))),
    ),
    "split, trip's speed": (
        "the trees also see the trip's mean speed",
        lambda: split(climate(), both((*DRIVE_TREE_FEATURES, "trip_speed_m_s"))),
    ),
}


def with_neighbours(table: SegmentTable) -> SegmentTable:
    """The table with the features that only variants look at."""
    first = np.zeros(len(table.hours), dtype=bool)
    first[table.offsets[:-1]] = True
    features = table.features
    extra = {
        name: np.where(first, 0.0, np.roll(features[of].to_numpy(), 1))
        for name, of in zip(BEFORE, ("simulated_w", "acceleration_w"), strict=True)
    }
    duration = np.repeat(np.add.reduceat(table.hours, table.offsets[:-1]) * 3600.0, np.diff(table.offsets))
    extra["to_end_s"] = duration - features["time_s"].to_numpy()
    return replace(table, features=features.assign(**extra))


def tabulated(trips: list[Trip], car: Any) -> SegmentTable:
    plans = [Plan.from_trip(trip) for trip in trips]
    runs = [segment_table(p, simulate_trip(car, p), t) for p, t in zip(plans, trips, strict=True)]
    return with_neighbours(SegmentTable.join(runs))


def left_out(table: SegmentTable, name: str, i: int) -> np.ndarray:
    """Residual power that is left of trip i by a corrector of all others [W]."""
    train = np.delete(np.arange(len(table)), i)
    held_out = table.take([i])
    return held_out.residual_w - VARIANTS[name][1]().fit(table.take(train)).predict(held_out)


def figures(table: SegmentTable, left: list[np.ndarray]) -> list[float]:
    """Mean APE and RMSE [kWh] of the total, then mean APE of the total with no update after each of `FRACTIONS`."""
    energy = table.totals_wh(table.observed_power_w)
    hours = [table.hours[a:b] for a, b in zip(table.offsets[:-1], table.offsets[1:], strict=True)]
    errors = np.array([h @ r for h, r in zip(hours, left, strict=True)])
    scores = [float(np.mean(np.abs(errors) / energy)), float(np.sqrt(np.mean(errors**2))) / 1000.0]
    for fraction in FRACTIONS:
        rest = [
            h[np.cumsum(h) > fraction * h.sum() + 1e-12] @ r[np.cumsum(h) > fraction * h.sum() + 1e-12]
            for h, r in zip(hours, left, strict=True)
        ]
        scores.append(float(np.mean(np.abs(rest) / energy)))
    return scores


def rows() -> dict[str, list[float]]:
    folder = tum_folder()
    if folder is None:
        raise SystemExit("no TUM trips at hand")
    trips = list(read_logs(folder).reference_trips())
    table = tabulated(trips, load_vehicle("bmw_i3_60ah"))
    variants = {}
    for name in VARIANTS:
        left = Parallel(-1)(delayed(left_out)(table, name, i) for i in range(len(table)))
        variants[name] = figures(table, left)
    return variants


def as_markdown(variants: Mapping[str, list[float]]) -> str:
    about = {name: text for name, (text, _) in VARIANTS.items()}
    head = "| variant | mean APE | RMSE | no update at 25 % | 50 % | 75 % |\n|---|---|---|---|---|---|"
    lines = [
        f"| {about[name]} | {ape:.4f} | {rmse:.3f} kWh | {' | '.join(f'{r:.4f}' for r in rest)} |"
        for name, (ape, rmse, *rest) in variants.items()
    ]
    return "\n".join([head, *lines])


def main() -> None:
    """Print the table."""
    print(as_markdown(rows()))


if __name__ == "__main__":
    run(main)
