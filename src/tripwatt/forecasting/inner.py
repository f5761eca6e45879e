"""Fits that leave out a fold of the training trips, for forecasts of trips that the fit did not use.

Everything that is estimated from trips is estimated again without the fold: the values of the car that signals show, the corrector,
and the settings of the corrector. The settings are chosen once for each third of the folds, on the trips of the other two thirds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import IntArray
from tripwatt.hybrid import Corrector, PowerCorrector, SegmentTable, resimulated
from tripwatt.hybrid.correctors import TUNED, fresh_corrector
from tripwatt.hybrid.power import climate_logged
from tripwatt.learners.folds import leave_one_out
from tripwatt.trips import Plan, Trip
from tripwatt.vehicles import Vehicle

INNER_FOLDS: Final = 10
SETTINGS_BLOCKS: Final = 3
"""Number of blocks of folds that share settings. Each block costs one search; with fewer blocks a search has too few trips."""

CarsOf = Callable[[Sequence[IntArray]], Sequence[Vehicle]]
"""Function from several choices of training trips, as indices, to the car as each choice shows it."""

Again = Callable[[Sequence[IntArray]], Sequence[SegmentTable]]
"""Function from several choices of training trips, as indices, to one table per choice.

Each table has all training trips, simulated with the car as the chosen trips show it."""


def resimulation(trips: Sequence[Trip], table: SegmentTable, vehicle: Vehicle, cars_of: CarsOf) -> Again:
    """Return a function that simulates all trips with the car as some of them show it, see `Again`.

    Parameters
    ----------
    trips : sequence of Trip
    table : SegmentTable
        Segments of the same trips, simulated with `vehicle`.
    vehicle : Vehicle
    cars_of : callable
        See `CarsOf`.
    """
    plans = [Plan.from_trip(trip) for trip in trips]

    def again(several: Sequence[IntArray]) -> list[SegmentTable]:
        cars = cars_of(several)
        tables = iter(resimulated(table, plans, [car for car in cars if car is not vehicle]))
        return [table if car is vehicle else next(tables) for car in cars]

    return again


def inner_folds(table: SegmentTable, seed: int) -> IntArray:
    """Random fold of each trip, shape (trips,); trips that log their climate control are spread evenly over the folds."""
    order = np.random.default_rng(seed).permutation(len(table))
    order = order[np.argsort(climate_logged(table)[order], kind="stable")]
    folds = np.empty(len(table), dtype=np.int64)
    folds[order] = np.arange(len(table)) % min(INNER_FOLDS, len(table))
    return folds


@dataclass(frozen=True, eq=False)
class InnerFit:
    """One fold: the indices of its trips, the corrector fitted without them, and all trips as simulated for that fit."""

    members: IntArray
    corrector: PowerCorrector
    table: SegmentTable


def inner_fits(
    name: str | Corrector, seed: int, fitted: PowerCorrector, table: SegmentTable, again: Again | None = None
) -> Iterator[InnerFit]:
    """Fit the corrector for each fold without the trips of that fold.

    Parameters
    ----------
    name : str or Corrector
        Name of the corrector, or the object from outside.
    seed : int
    fitted : PowerCorrector
        The corrector, fitted on all trips. Its kind is used, and its settings only if they do not come from the trips.
    table : SegmentTable
        All trips.
    again : callable, optional
        Simulates the trips with the car as a part of them shows it. If not given, all folds use the car of `table`.
    """
    folds = inner_folds(table, seed)
    tunes = isinstance(name, str) and name in TUNED
    splits, blocks = leave_one_out(folds), leave_one_out(folds % SETTINGS_BLOCKS) if tunes else ()
    kept = [split.train for split in (*splits, *blocks)]
    tables = [table] * len(kept) if again is None else again(kept)
    tuned = [fitted] * SETTINGS_BLOCKS
    for block, simulated in zip(blocks, tables[len(splits) :], strict=True):
        tuned[block.number] = fresh_corrector(str(name), seed, fitted).tune(simulated.take(block.train))
    for split, simulated in zip(splits, tables, strict=False):
        corrector = tuned[split.number % SETTINGS_BLOCKS].clone_tuned().fit(simulated.take(split.train))
        yield InnerFit(split.test, corrector, simulated)
