"""Fits without some of the training trips: what a model would have said of each trip if it had never seen it.

Whatever is estimated from a trip is estimated again without it: the values of the car that its signals show, the corrector, and the settings
of the corrector. The settings are chosen once for each third of the folds, on the trips of the other two thirds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import IntArray
from tripwatt.hybrid import Corrector, PowerCorrector, SegmentTable, resimulated
from tripwatt.hybrid.correctors import TUNED, fresh_corrector
from tripwatt.hybrid.split import climate_logged
from tripwatt.learners.folds import leave_one_out
from tripwatt.trips import Trip, plan_from_trip
from tripwatt.vehicles import Vehicle

INNER_FOLDS: Final = 10
SETTINGS_BLOCKS: Final = 3
"""Parts of the folds that share their settings. More cost a search each; fewer leave the search too few trips."""

Again = Callable[[Sequence[IntArray]], Sequence[SegmentTable]]
"""Choices of some training trips by their numbers -> for each all of them, simulated with the car as those show it."""


def shown_by(
    trips: Sequence[Trip], table: SegmentTable, vehicle: Vehicle, car_of: Callable[[IntArray], Vehicle]
) -> Again:
    """Trips, simulated with the car as some of them show it.

    Parameters
    ----------
    trips : sequence of Trip
    table : SegmentTable
        Of the same trips, simulated with `vehicle`.
    vehicle : Vehicle
    car_of : callable
        Numbers of some trips -> the car as those show it.
    """
    plans = [plan_from_trip(trip) for trip in trips]

    def again(several: Sequence[IntArray]) -> list[SegmentTable]:
        cars = [car_of(members) for members in several]
        tables = iter(resimulated(table, plans, [car for car in cars if car is not vehicle]))
        return [table if car is vehicle else next(tables) for car in cars]

    return again


def inner_folds(table: SegmentTable, seed: int) -> IntArray:
    """Fold of each trip, shape (trips,): at random, trips that log their climate control evenly among the folds."""
    order = np.random.default_rng(seed).permutation(len(table))
    order = order[np.argsort(climate_logged(table)[order], kind="stable")]
    folds = np.empty(len(table), dtype=np.int64)
    folds[order] = np.arange(len(table)) % min(INNER_FOLDS, len(table))
    return folds


@dataclass(frozen=True, eq=False)
class InnerFit:
    """One fold: its trips, the corrector that was fitted without them, and all trips as that fit simulates them."""

    members: IntArray
    corrector: PowerCorrector
    table: SegmentTable


def inner_fits(
    name: str | Corrector, seed: int, fitted: PowerCorrector, table: SegmentTable, again: Again | None = None
) -> Iterator[InnerFit]:
    """A fit for each fold, without its trips.

    Parameters
    ----------
    name : str or Corrector
        Of the corrector, or the object from outside.
    seed : int
    fitted : PowerCorrector
        The corrector, fitted on all trips; its kind is taken, and its settings only where these come from no trip.
    table : SegmentTable
        All trips.
    again : callable, optional
        How a part of the trips shows the car; without it all folds have the car of `table`.
    """
    folds = inner_folds(table, seed)
    tunes = isinstance(name, str) and name in TUNED
    splits, blocks = leave_one_out(folds), leave_one_out(folds % SETTINGS_BLOCKS) if tunes else ()
    kept = [split.train for split in (*splits, *blocks)]
    seen = [table] * len(kept) if again is None else again(kept)
    tuned = [fitted] * SETTINGS_BLOCKS
    for block, own in zip(blocks, seen[len(splits) :], strict=True):
        tuned[block.number] = fresh_corrector(str(name), seed, fitted).fit(own.take(block.train))
    for split, own in zip(splits, seen, strict=False):
        corrector = tuned[split.number % SETTINGS_BLOCKS].clone_tuned().fit(own.take(split.train))
        yield InnerFit(split.test, corrector, own)
