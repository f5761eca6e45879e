"""Hold-outs: leave one trip out, leave one day out, leave a regime out, a split by time, random draws, other splitters."""

from __future__ import annotations

import itertools
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final, Generic, Protocol, TypeVar

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.auditing import Audit
from tripwatt.errors import Fault, InvalidInput, raise_faults, require_type
from tripwatt.hybrid import TripTable
from tripwatt.learners.folds import Split, leave_one_out
from tripwatt.trips import Trip, TripSet
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_document, vehicle_from_document

LEAVE_ONE_TRIP_OUT: Final = "leave_one_trip_out"
LEAVE_ONE_DAY_OUT: Final = "leave_one_day_out"
OTHER_TRIPS: Final = "other_trips"
LEAVE_REGIME_OUT: Final = "leave_regime_out"
TIME_SPLIT: Final = "time_split"
RANDOM_DRAWS: Final = "random_draws"

REFERENCE: Final = "reference"
"""Name of the set of trips on which a protocol compares settings inside the folds."""

MIN_DAYS: Final = 3
"""Smallest number of days for which one day is left out at a time: a choice, at least two days to fit on."""

WITHOUT_DAYS: Final = "leave-one-day-out left out: the dates of the trips are unknown or fewer than three"
WITHOUT_GROUPS: Final = "fewer than three dates of trips are known: each trip is a group of its own"


class Trips(Protocol):
    """Trips in the form that the models of a protocol need.

    Examples
    --------
    >>> trips: Trips = table  # doctest: +SKIP
    """

    def take(self, members: IntArray) -> Any:
        """Return some of the trips, by their numbers.

        Parameters
        ----------
        members : ndarray of int

        Examples
        --------
        >>> table.take(np.arange(3))  # doctest: +SKIP
        """


D = TypeVar("D", bound=Trips)
"""Form of the trips that the models of a protocol need."""


@dataclass(frozen=True, eq=False)
class HoldOut(Generic[D]):
    """One way to hold trips out: the scheme, the set of trips, and the splits.

    Attributes
    ----------
    scheme : str
        A constant of this module, such as `LEAVE_ONE_TRIP_OUT`.
    trips : str
        "reference", "audited" or "all"; for a regime, its name.
    table : TripTable
    data : object
        Trips in the form that the models of the protocol need.
    splits : tuple of Split
    """

    scheme: str
    trips: str
    table: TripTable
    data: D
    splits: tuple[Split, ...]

    @cached_property
    def tested(self) -> IntArray:
        """Numbers of the scored trips, ascending; a trip appears once for each split that scores it."""
        return np.sort(np.concatenate([split.test for split in self.splits]))

    @cached_property
    def scored(self) -> IntArray:
        """Numbers of the scored trips, ascending, each once."""
        return np.unique(self.tested)

    @cached_property
    def folds(self) -> IntArray | None:
        """Number of the split that scores each trip, shape (trips,).

        None unless every trip is scored in one split and fitted on in all others; only then can a learner predict
        all splits at once.
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
        """Whether this is leave-one-trip-out on the reference trips, where settings are compared."""
        return self.scheme == LEAVE_ONE_TRIP_OUT and self.trips == REFERENCE


def random_draws(
    hold_out: HoldOut[D], sizes: Sequence[int], draws: int, min_scored: int, seed: int
) -> HoldOut[D]:
    """Draw random training sets of several sizes, each scored on all other trips.

    Parameters
    ----------
    hold_out : HoldOut
        Hold-out whose trips are drawn.
    sizes : sequence of int
        Numbers of training trips. A smaller set is part of the larger one of the same draw.
    draws : int
        Number of draws of each size.
    min_scored : int
        Sizes that leave fewer trips to score are left out.
    seed : int
    """
    n = len(hold_out.table)
    orders = [np.random.default_rng((seed, draw)).permutation(n) for draw in range(draws)]
    drawn = itertools.product((size for size in sizes if size + min_scored <= n), range(draws))
    splits = tuple(
        Split(number, np.sort(orders[draw][:size]), np.sort(orders[draw][size:]), draw)
        for number, (size, draw) in enumerate(drawn)
    )
    return replace(hold_out, scheme=RANDOM_DRAWS, splits=splits)


def number_days(trips: Sequence[Trip]) -> IntArray | None:
    """Number the day of each trip; returns None if a date is unknown or there are fewer than `MIN_DAYS` days."""
    days = [trip.context.day for trip in trips]
    if any(day is None for day in days) or len(set(days)) < MIN_DAYS:
        return None
    _, numbers = np.unique(np.array([str(day) for day in days]), return_inverse=True)
    return numbers.astype(np.int64)


@dataclass(frozen=True, eq=False)
class Prepared(Generic[D]):
    """Trips and hold-outs, prepared for a protocol.

    Attributes
    ----------
    hold_outs : list of HoldOut
        The hold-outs, the main one first.
    fleet, test_fleet : TripSet, TripSet or None
    audited : Audit
        Audit of the scored trips.
    cars : mapping of str to Vehicle
        Name of the simulated energy -> car.
    notes : tuple of str
    """

    hold_outs: list[HoldOut[D]]
    fleet: TripSet
    test_fleet: TripSet | None
    audited: Audit
    cars: Mapping[str, Vehicle]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CarChoice:
    """A choice of car, and values that replace those of its file.

    Attributes
    ----------
    car : Vehicle, str or path
        The car itself, its name, or the path of its TOML.
    overrides : mapping of str to (float or str), optional
        Values as for `load_vehicle`.

    Examples
    --------
    >>> CarChoice("bmw_i3_60ah", {"mass": 1500.0}).load("paper").body.curb_mass_kg
    1500.0
    """

    car: Vehicle | Path | str
    overrides: Mapping[str, float | str] | None = None

    @property
    def name(self) -> str:
        """Name or path of the car."""
        return self.car.name if isinstance(self.car, Vehicle) else str(self.car)

    def load(self, preset: str = "default", more: Mapping[str, float | str] | None = None) -> Vehicle:
        """Load the car under a preset, with `overrides` and further values.

        Parameters
        ----------
        preset : str
            As for `load_vehicle`.
        more : mapping of str to (float or str), optional
            Further values that replace those of the car.

        Returns
        -------
        Vehicle
            The car with these values.

        Raises
        ------
        InvalidInput
            If `load_vehicle` raises it.

        Examples
        --------
        >>> CarChoice("bmw_i3_60ah").load().title
        'BMW i3 60 Ah'
        """
        values = {**(self.overrides or {}), **(more or {})}
        if not isinstance(self.car, Vehicle):
            return load_vehicle(self.car, preset, values)
        if preset == "default" and not values:
            return self.car
        return vehicle_from_document(vehicle_document(self.car), self.name, self.name, preset, values)


class Splitter(Protocol):
    """A splitter with the interface of scikit-learn's splitters.

    Examples
    --------
    >>> from sklearn.model_selection import GroupKFold
    >>> splitter: Splitter = GroupKFold(5)
    """

    def split(self, X: Any, y: Any = None, groups: Any = None) -> Iterable[tuple[Any, Any]]:
        """Yield pairs of arrays: numbers of the trips to fit on, and of those to score.

        Parameters
        ----------
        X : list of Trip
            The trips of the main hold-out.
        y : ndarray, shape (trips,)
            Measured energy [Wh].
        groups : ndarray of int, shape (trips,)
            Number of the day of each trip or, if the days are unknown, of the trip itself.

        Examples
        --------
        >>> splitter.split(trips, energy_wh, days)  # doctest: +SKIP
        """


HoldOuts = str | Splitter | Sequence[str | Splitter]
"""Hold-outs as an argument of `evaluate`: a name, a splitter, or a list of names and splitters."""


def numbered_names(objects: Iterable[object]) -> list[str]:
    """Return the names: strings as they are, objects by their class, with a number if the class occurs again.

    Examples
    --------
    >>> numbered_names(["constant", 1, 2.0, 3])
    ['constant', 'int', 'float', 'int-2']
    """
    names: list[str] = []
    count: Counter[str] = Counter()
    for item in require_type("models", objects, Iterable, "a list of models, or a mapping"):
        name = item if isinstance(item, str) else type(item).__name__
        count[name] += 1
        names.append(name if isinstance(item, str) or count[name] == 1 else f"{name}-{count[name]}")
    return names


@dataclass(frozen=True, slots=True)
class HoldOutChoice:
    """The hold-outs of a run: all or some of those of the protocol, and splitters from outside.

    Attributes
    ----------
    chosen : mapping of str to (str or Splitter), or None
        Name, or class of a splitter with a number if it occurs again -> hold-out; None for all hold-outs of the protocol.

    Examples
    --------
    >>> HoldOutChoice.from_argument("reference").select([("leave_one_trip_out", "reference"), ("leave_one_trip_out", "all")])
    [('leave_one_trip_out', 'reference')]
    """

    chosen: Mapping[str, str | Splitter] | None = None

    @classmethod
    def from_argument(cls, hold_outs: HoldOuts | None) -> HoldOutChoice:
        """Read the argument `hold_outs` of `evaluate`; None chooses all hold-outs of the protocol.

        Parameters
        ----------
        hold_outs : str, Splitter, sequence of them, or None
            The argument of `evaluate`.

        Returns
        -------
        HoldOutChoice
            The choice.

        Raises
        ------
        InvalidInput
            If an element is neither a name nor a splitter, or the list is empty.

        Examples
        --------
        >>> HoldOutChoice.from_argument(None).chosen is None
        True
        """
        if hold_outs is None:
            return cls()
        chosen: tuple[Any, ...] = (hold_outs,)
        if isinstance(hold_outs, Sequence) and not isinstance(hold_outs, str):
            chosen = tuple(hold_outs)
        allowed = "names of hold-outs, or splitters of scikit-learn's kind (objects, not classes)"
        usable = [isinstance(c, str) or (hasattr(c, "split") and not isinstance(c, type)) for c in chosen]
        wrong = [f"{c!r}"[:80] for c, good in zip(chosen, usable, strict=True) if not good]
        wrong += [] if chosen else ["an empty list"]
        raise_faults(Fault("unknown hold-out", "hold_outs", got, allowed) for got in wrong)
        return cls(dict(zip(numbered_names(chosen), chosen, strict=True)))

    def select(self, available: Sequence[tuple[str, str]]) -> list[tuple[str, str | Splitter]]:
        """Find the chosen hold-outs among those of a protocol.

        A name is a scheme, a set of trips, or both as ``scheme:trips``.

        Parameters
        ----------
        available : sequence of (str, str)
            Scheme and set of trips of each hold-out.

        Returns
        -------
        list of (str, str or Splitter)
            All that are available if none was chosen. Else in the order of the choice: scheme and set of trips of a hold-out of the
            protocol, or label of a splitter and the splitter.

        Raises
        ------
        InvalidInput
            With every name that no hold-out has.

        Examples
        --------
        >>> HoldOutChoice().select([("leave_one_trip_out", "all")])
        [('leave_one_trip_out', 'all')]
        """
        chosen: list[tuple[str, str | Splitter]] = []
        faults = []
        for label, choice in (self.chosen or {}).items():
            matching = [pair for pair in available if choice in {*pair, ":".join(pair)}]
            if not isinstance(choice, str):
                chosen.append((label, choice))
            elif not matching:
                allowed = dict.fromkeys([*(scheme for scheme, _ in available), *map(":".join, available)])
                faults.append(Fault.unknown("unknown hold-out", "hold_outs", choice, allowed))
            chosen += [pair for pair in matching if pair not in chosen]
        raise_faults(faults)
        return list(available) if self.chosen is None else chosen

    def notes(self, trips: Sequence[Trip]) -> list[str]:
        """Note the splitters by groups for which each trip is a group, because the days of the trips are unknown or too few.

        Parameters
        ----------
        trips : sequence of Trip
            The trips that are split.

        Returns
        -------
        list of str
            A note for each such splitter.

        Examples
        --------
        >>> HoldOutChoice.from_argument("reference").notes([])
        []
        """
        grouped = [label for label in self.chosen or () if "Group" in label and number_days(trips) is None]
        return [f"{label}: {WITHOUT_GROUPS}" for label in grouped]


def split_trips(
    name: str, splitter: Splitter, trips: Sequence[Trip], energy_wh: FloatArray
) -> tuple[Split, ...]:
    """Split trips with a splitter.

    Parameters
    ----------
    name : str
        Name of the splitter, for error messages.
    splitter : Splitter
    trips : sequence of Trip
    energy_wh : ndarray, shape (trips,)
        Measured energy [Wh].

    Raises
    ------
    InvalidInput
        If the splitter cannot split the trips.
    """
    days, numbers = number_days(trips), np.arange(len(trips))
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "The groups parameter is ignored", UserWarning)
            pairs = list(splitter.split(list(trips), energy_wh, numbers if days is None else days))
        # a splitter yields numbers of trips, or a mask over the trips
        sorted_pairs = [(np.sort(numbers[train]), np.sort(numbers[test])) for train, test in pairs]
    except (ValueError, TypeError, IndexError) as error:
        raise InvalidInput.of("trips cannot be split", name, str(error)[:200]) from error
    return tuple(Split(number, *pair) for number, pair in enumerate(sorted_pairs))


Regimes = Mapping[tuple[str, str], tuple[IntArray, IntArray]]
"""Scheme and name of a part of the main trips -> numbers of its trips, and the fold of each of these."""


def build_hold_outs(
    sets: Mapping[str, Sequence[Trip]],
    by_day: IntArray | None,
    choice: HoldOutChoice,
    prepare: Callable[[Sequence[Trip]], D],
    table_of: Callable[[D], TripTable],
    regimes: Regimes | None = None,
) -> list[HoldOut[D]]:
    """Build the chosen hold-outs of a protocol.

    Every set of trips is held out trip by trip; the main set also by days, by regimes, and by splitters.

    Parameters
    ----------
    sets : mapping of str to sequence of Trip
        The main set first.
    by_day : ndarray of int or None, shape (trips of the main set,)
        Number of the day of each trip, for leave-one-day-out; None without it.
    choice : HoldOutChoice
    prepare : callable
        Function from trips to the form that the models need; called only for sets with a chosen hold-out.
    table_of : callable
        Function from that form to the table of the trips.
    regimes : mapping, optional
        See `Regimes`.
    """
    main, regimes = next(iter(sets)), regimes or {}
    available = [*((LEAVE_ONE_TRIP_OUT, name) for name in sets), *regimes]
    if by_day is not None:
        available.insert(len(sets), (LEAVE_ONE_DAY_OUT, main))
    prepared = cache(lambda name: prepare(sets[name]))
    hold_outs: list[HoldOut[D]] = []
    for scheme, chosen in choice.select(available):
        name, data = (chosen, prepared(chosen if isinstance(chosen, str) and chosen in sets else main))
        table = table_of(data)
        if not isinstance(chosen, str):
            name = main
            splits = split_trips(scheme, chosen, sets[main], table.observed_wh[table.last_rows])
        elif (scheme, chosen) in regimes:
            members, folds = regimes[scheme, chosen]
            data = data.take(members)
            splits = leave_one_out(folds)
        else:
            days = by_day if scheme == LEAVE_ONE_DAY_OUT else None
            splits = leave_one_out(np.arange(len(table)) if days is None else days)
        hold_outs.append(HoldOut(scheme, f"{name}", table_of(data), data, splits))
    return hold_outs
