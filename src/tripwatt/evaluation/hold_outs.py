"""Ways to hold trips out: leave one trip out, leave one day out, leave a regime out, a split by time, random draws."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Generic, TypeVar

import numpy as np

from tripwatt.arrays import IntArray
from tripwatt.auditing import Audit
from tripwatt.hybrid import TripTable
from tripwatt.trips import Fleet, Trip
from tripwatt.vehicles import Vehicle

TRAINING_ONLY: Final = -1
"""Fold of a trip that is only fitted on."""

LEAVE_ONE_TRIP_OUT: Final = "leave_one_trip_out"
LEAVE_ONE_DAY_OUT: Final = "leave_one_day_out"
OTHER_TRIPS: Final = "other_trips"
LEAVE_REGIME_OUT: Final = "leave_regime_out"
TIME_SPLIT: Final = "time_split"
RANDOM_DRAWS: Final = "random_draws"

REFERENCE: Final = "reference"
"""The set of trips on which a protocol compares settings inside the folds."""

MIN_DAYS: Final = 3
"""Fewest days of which one is left out at a time."""

WITHOUT_DAYS: Final = "leave-one-day-out left out: the dates of the trips are unknown or fewer than three"

D = TypeVar("D")
"""What the models of a protocol need of trips."""


@dataclass(frozen=True, eq=False)
class Split:
    """Trips that a model is fitted on, and trips that it is scored on.

    Attributes
    ----------
    number : int
        Among the splits of a hold-out.
    train, test : ndarray of int
        Numbers of trips, ascending.
    draw : int
        Number of the random draw; 0 where nothing is drawn.
    """

    number: int
    train: IntArray
    test: IntArray
    draw: int = 0


@dataclass(frozen=True, eq=False)
class HoldOut(Generic[D]):
    """One way to hold trips out: the scheme, the set of trips, and the splits.

    Attributes
    ----------
    scheme : str
        A constant of this module, such as `LEAVE_ONE_TRIP_OUT`.
    trips : str
        "reference", "audited" or "all"; where a regime is held out, its name.
    table : TripTable
    data : object
        The trips as the models of the protocol need them.
    splits : tuple of Split
    """

    scheme: str
    trips: str
    table: TripTable
    data: D
    splits: tuple[Split, ...]

    @classmethod
    def from_folds(cls, scheme: str, trips: str, table: TripTable, data: D, folds: IntArray) -> HoldOut[D]:
        """Leave one fold out at a time.

        Parameters
        ----------
        scheme, trips : str
        table : TripTable
        data : object
        folds : ndarray of int, shape (trips,)
            Fold of each trip; `TRAINING_ONLY` for a trip that is not scored.
        """
        numbers = np.unique(folds[folds != TRAINING_ONLY])
        return cls.from_pairs(
            scheme, trips, table, data, ((folds != k, folds == k) for k in numbers), numbers.tolist()
        )

    @classmethod
    def from_pairs(
        cls,
        scheme: str,
        trips: str,
        table: TripTable,
        data: D,
        pairs: Iterable[tuple[Any, Any]],
        numbers: Sequence[int] | None = None,
    ) -> HoldOut[D]:
        """Fit on and score what a splitter of scikit-learn's kind gives.

        Parameters
        ----------
        scheme, trips : str
        table : TripTable
        data : object
        pairs : iterable of (array, array)
            Trips to fit on and trips to score, as numbers or as a mask over the trips.
        numbers : sequence of int, optional
            Numbers of the splits; from 0 on by default.
        """
        every = np.arange(len(table), dtype=np.int64)
        made = [(np.sort(every[train]), np.sort(every[test])) for train, test in pairs]
        names = range(len(made)) if numbers is None else numbers
        return cls(
            scheme, trips, table, data, tuple(Split(k, *pair) for k, pair in zip(names, made, strict=True))
        )

    @cached_property
    def scored(self) -> IntArray:
        """Numbers of the trips that are scored, ascending."""
        return np.unique(np.concatenate([split.test for split in self.splits]))

    @cached_property
    def folds(self) -> IntArray | None:
        """The split that scores each trip, shape (trips,), where each trip is scored once and fitted on in all others.

        Only then can a learner give the predictions of all splits at once. Else None.
        """
        count = np.bincount(np.concatenate([split.test for split in self.splits]), minlength=len(self.table))
        if (count != 1).any() or any(len(s.train) + len(s.test) != len(self.table) for s in self.splits):
            return None
        folds = np.empty(len(self.table), dtype=np.int64)
        for split in self.splits:
            folds[split.test] = split.number
        return folds

    @property
    def is_reference(self) -> bool:
        """Whether each of the reference trips is left out once, which is where settings are compared."""
        return self.scheme == LEAVE_ONE_TRIP_OUT and self.trips == REFERENCE


def random_draws(
    hold_out: HoldOut[D], sizes: Sequence[int], draws: int, least_scored: int, seed: int
) -> HoldOut[D]:
    """Random training sets of several sizes, each scored on all other trips.

    Parameters
    ----------
    hold_out : HoldOut
        Whose trips are drawn.
    sizes : sequence of int
        Numbers of training trips. A smaller set is part of the larger one of the same draw.
    draws : int
        Draws of each size.
    least_scored : int
        Sizes that leave fewer trips to score are left out.
    seed : int
    """
    n = len(hold_out.table)
    orders = [np.random.default_rng((seed, draw)).permutation(n) for draw in range(draws)]
    parts = [
        (np.sort(order[:size]), np.sort(order[size:]), draw)
        for size in sizes
        if size + least_scored <= n
        for draw, order in enumerate(orders)
    ]
    splits = tuple(Split(number, *part) for number, part in enumerate(parts))
    return HoldOut(RANDOM_DRAWS, hold_out.trips, hold_out.table, hold_out.data, splits)


def days_of(trips: Sequence[Trip]) -> IntArray | None:
    """Number of the day of each trip; None where a date is unknown or the days are fewer than `MIN_DAYS`."""
    days = [trip.context.day for trip in trips]
    if any(day is None for day in days) or len(set(days)) < MIN_DAYS:
        return None
    _, numbers = np.unique(np.array([str(day) for day in days]), return_inverse=True)
    return numbers.astype(np.int64)


@dataclass(frozen=True, eq=False)
class Prepared(Generic[D]):
    """Trips as a protocol evaluates them.

    Attributes
    ----------
    hold_outs : list of HoldOut
        The main one first.
    fleet, test_fleet : Fleet, Fleet or None
    audited : Audit
        Of the trips that are scored.
    cars : mapping of str to Vehicle
        Name of the simulated energy -> car.
    notes : tuple of str
    """

    hold_outs: list[HoldOut[D]]
    fleet: Fleet
    test_fleet: Fleet | None
    audited: Audit
    cars: Mapping[str, Vehicle]
    notes: tuple[str, ...]

    @property
    def scored_fleet(self) -> Fleet:
        """The fleet whose trips are scored."""
        return self.test_fleet or self.fleet


@dataclass(frozen=True, slots=True)
class CarChoice:
    """A car by name or path, and values that replace those of its file."""

    name: str
    overrides: Mapping[str, float | str] | None = None
