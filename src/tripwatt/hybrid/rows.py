"""Values of trips in parallel: records with a value per trip, and flat tables with rows per trip."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import Field, fields, replace
from typing import Any, ClassVar, Self, cast

import numpy as np
import pandas as pd

from tripwatt.arrays import IntArray, running_sum


class Records:
    """Base of a dataclass of which each field has a value for each trip: an array, a table, a tuple or records.

    Examples
    --------
    >>> from tripwatt.hybrid.learning import Innovations
    >>> two = Innovations(np.array([1.0, 2.0]), np.ones(2), np.ones((2, 1)))
    >>> two.take([1]).mean_wh, (two + two.take([0])).mean_wh
    (array([2.]), array([1., 2., 1.]))
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def take(self, members: Sequence[int] | IntArray) -> Self:
        """Take some of the trips, by index, in this order."""
        index = np.asarray(members, dtype=np.int64)
        return type(self)(*(taken(getattr(self, f.name), index) for f in fields(self)))

    def __add__(self, later: Self) -> Self:
        """Append the values of further trips."""
        return cast(Self, joined((self, later)))


class RowTable:
    """Base of a dataclass of trips as one flat table: rows of trip i are ``offsets[i]:offsets[i + 1]``.

    The fields `by_trip` have a value for each trip, the fields `by_row` one for each row.
    """

    by_trip: ClassVar[tuple[str, ...]]
    by_row: ClassVar[tuple[str, ...]]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    offsets: IntArray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def groups(self) -> IntArray:
        """Index of the trip that each row belongs to, shape (rows,)."""
        return np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.offsets))

    def rows_of(self, members: IntArray) -> IntArray:
        """List the rows of some trips.

        Parameters
        ----------
        members : ndarray of int
            Indices of the trips.

        Returns
        -------
        ndarray of int
            Row numbers, trip by trip in the order of `members`.
        """
        spans = (np.arange(self.offsets[i], self.offsets[i + 1]) for i in members)
        return np.concatenate([np.empty(0, np.int64), *spans])

    def take(self, members: Sequence[int] | IntArray) -> Self:
        """Take some of the trips. O(rows of these trips).

        Parameters
        ----------
        members : sequence of int
            Indices of the trips.

        Returns
        -------
        table of the same class
            The trips in the order of `members`.
        """
        index = np.asarray(members, dtype=np.int64)
        rows = self.rows_of(index)
        values = {name: taken(getattr(self, name), index) for name in self.by_trip}
        values |= {name: taken(getattr(self, name), rows) for name in self.by_row}
        offsets = running_sum(np.diff(self.offsets)[index]).astype(np.int64)
        return replace(self, offsets=offsets, **values)


def taken(values: Any, index: IntArray) -> Any:
    """Take some of the trips' values, by index; None if there are none.

    Examples
    --------
    >>> taken(("a", "b"), np.array([1, 1])), taken({"x": np.array([2.0, 3.0])}, np.array([1])), taken(None, np.array([0]))
    (('b', 'b'), {'x': array([3.])}, None)
    """
    if isinstance(values, tuple):
        return tuple(values[i] for i in index)
    if isinstance(values, Mapping):
        return {name: taken(inner, index) for name, inner in values.items()}
    if isinstance(values, Records):
        return values.take(index)
    if isinstance(values, pd.DataFrame):
        return values.iloc[index].reset_index(drop=True)
    return None if values is None else values[index]


def joined(parts: Sequence[Any]) -> Any:
    """Join the values of several sets of trips, in order; None unless all have them.

    Examples
    --------
    >>> joined([("a",), ("b",)]), joined([np.zeros(1), np.ones(1)]), joined([np.zeros(1), None])
    (('a', 'b'), array([0., 1.]), None)
    """
    if any(part is None for part in parts):
        return None
    if isinstance(parts[0], tuple):
        return tuple(itertools.chain(*parts))
    if isinstance(parts[0], Records):
        return type(parts[0])(*(joined([getattr(p, f.name) for p in parts]) for f in fields(parts[0])))
    return (
        pd.concat(parts, ignore_index=True) if isinstance(parts[0], pd.DataFrame) else np.concatenate(parts)
    )
