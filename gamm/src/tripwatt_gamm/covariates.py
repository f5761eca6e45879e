"""From columns of a frame to numbers: reading with all faults at once, distinct values, levels, training support."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.spatial import cKDTree

from tripwatt_gamm.arrays import BoolArray, FloatArray
from tripwatt_gamm.errors import Fault, InvalidInput, raise_faults
from tripwatt_gamm.formula import nearest

Index: TypeAlias = npt.NDArray[np.intp]

MAX_VALUES = 1000
"""Distinct values that a discretised covariate keeps."""

MAX_JOINT = 10_000
"""Distinct points that a discretised set of covariates keeps."""

EXACT_ROWS = 10_000
"""Up to this many rows `discretise=True` leaves covariates as they are."""

REACH = 0.05
"""How far from the nearest training point, in ranges, a surface is followed before it is held."""


def is_factor(column: pd.Series[Any]) -> bool:
    """Whether a column holds levels rather than numbers (booleans count as the numbers 0 and 1)."""
    return not pd.api.types.is_numeric_dtype(column.dtype)


def is_ordered(column: pd.Series[Any]) -> bool:
    """Whether a factor's levels have an order: a categorical column that was declared `ordered`."""
    return isinstance(column.dtype, pd.CategoricalDtype) and bool(column.dtype.ordered)


def crossed(frame: pd.DataFrame, names: tuple[str, ...]) -> pd.Series[Any]:
    """Levels of a factor, or of several together, joined by colons."""
    first, *rest = (frame[name] for name in names)
    for column in rest:
        first = first.astype(str) + ":" + column.astype(str)
    return first


def missing_columns(frame: pd.DataFrame, wanted: Iterable[str]) -> list[Fault]:
    """One fault for each column that the frame does not have."""
    names = [str(name) for name in frame.columns]
    have = ", ".join(names)
    return [
        Fault("unknown column", repr(name), "not in the frame", have, nearest(name, names))
        for name in wanted
        if name not in frame.columns
    ]


def numbers(frame: pd.DataFrame, name: str, label: str) -> tuple[FloatArray, list[Fault]]:
    """A finite numeric column (n,) and what is wrong with it.

    Parameters
    ----------
    frame : DataFrame
    name : str
        Column.
    label : str
        Term that needs it, for the message.
    """
    column = frame[name]
    if is_factor(column):
        fault = Fault("not numeric", f"column {name!r} of {label}", str(column.dtype), "numbers")
        return np.zeros(len(frame)), [fault]
    values = column.to_numpy(dtype=np.float64, na_value=np.nan)
    bad = ~np.isfinite(values)
    if bad.any():
        row = int(np.argmax(bad))
        got = f"{values[row]} in {int(bad.sum())} rows, first at row {row}"
        return values, [Fault("not finite", f"column {name!r} of {label}", got, "finite numbers")]
    return values, []


def missing_levels(frame: pd.DataFrame, name: str, label: str) -> list[Fault]:
    """A fault where a factor has missing entries."""
    bad = frame[name].isna().to_numpy()
    if not bad.any():
        return []
    got = f"{int(bad.sum())} missing, first at row {int(np.argmax(bad))}"
    return [Fault("missing level", f"column {name!r} of {label}", got, "a level in every row")]


@dataclass(frozen=True)
class Levels:
    """Levels of a factor, and the share of training rows that each has.

    Attributes
    ----------
    names : tuple of str
    share : ndarray (L,)
        Zero for a level that no training row has.
    """

    names: tuple[str, ...]
    share: FloatArray

    @classmethod
    def from_column(cls, column: pd.Series[Any]) -> Levels:
        """Levels of a column: its categories, or its values, sorted."""
        if isinstance(column.dtype, pd.CategoricalDtype):
            names = tuple(map(str, column.dtype.categories))
        else:
            names = tuple(sorted(map(str, pd.unique(column))))
        codes = cls(names, np.ones(len(names))).codes(column)
        return cls(names, np.bincount(codes, minlength=len(names)) / len(codes))

    def codes(self, column: pd.Series[Any]) -> Index:
        """Position of each row's level (n,), -1 for a level that is not known."""
        position = {name: i for i, name in enumerate(self.names)}
        codes, values = pd.factorize(column)
        table = np.array([position.get(str(value), -1) for value in values] + [-1], dtype=np.intp)
        return table[codes]

    def rows(self, codes: Index) -> FloatArray:
        """Indicator rows (L + 1, L) to be indexed by codes: a level unseen in training has the mean of training rows."""
        table = np.vstack([np.eye(len(self.names)), self.share])
        table[:-1][self.share == 0] = self.share
        return table[codes]


@dataclass(frozen=True)
class Points:
    """Distinct values of one or several covariates, and where each row lies.

    Attributes
    ----------
    values : ndarray (m, d)
        Sorted.
    index : ndarray (n,)
    counts : ndarray (m,)
    """

    values: FloatArray
    index: Index
    counts: FloatArray

    @classmethod
    def from_values(cls, x: FloatArray, limits: tuple[int | None, ...] | None = None) -> Points:
        """Distinct points of rows `x` (n, d), each covariate rounded to an even grid of at most so many values."""
        wanted = limits if limits is not None else (None,) * x.shape[1]
        axes = [_distinct(x[:, j], limit) for j, limit in enumerate(wanted)]
        code = axes[0][1]
        for values, index in axes[1:]:
            code = code * len(values) + index
        if len(axes) == 1:
            return cls(axes[0][0][:, None], code, np.bincount(code, minlength=len(axes[0][0])).astype(float))
        index, rest = pd.factorize(code, sort=True)
        values = np.empty((len(rest), len(axes)))
        for j in range(len(axes) - 1, -1, -1):
            rest, position = np.divmod(rest, len(axes[j][0]))
            values[:, j] = axes[j][0][position]
        return cls(
            values, index.astype(np.intp, copy=False), np.bincount(index, minlength=len(values)).astype(float)
        )


def grid_limit(x: FloatArray, limit: int) -> int:
    """Values per covariate that keep the distinct points of rows `x` (n, d) at `MAX_JOINT` or fewer."""
    while limit > 20 and len(Points.from_values(x, (limit,) * x.shape[1]).values) > MAX_JOINT:
        limit = limit * 3 // 4
    return limit


def _distinct(x: FloatArray, limit: int | None) -> tuple[FloatArray, Index]:
    """Sorted distinct values, or an even grid of at most `limit` values, and the position of each row."""
    index, values = pd.factorize(x, sort=True)
    if limit is None or len(values) <= limit:
        return values, index
    low, high = float(values[0]), float(values[-1])
    step = (high - low) / (limit - 1)
    cell = np.rint((values - low) / step).astype(np.intp)
    used, position = np.unique(cell, return_inverse=True)
    grid: FloatArray = np.asarray(low + step * used, dtype=np.float64)
    grid[0], grid[-1] = low, high
    return grid, position.astype(np.intp)[index]


@dataclass(frozen=True)
class Support:
    """Where training data lie, and the bounded rule for what lies outside.

    Attributes
    ----------
    points : ndarray (m, d)
        Distinct training points.
    """

    points: FloatArray

    @cached_property
    def low(self) -> FloatArray:
        """Smallest value of each covariate (d,)."""
        return np.asarray(self.points.min(axis=0))

    @cached_property
    def high(self) -> FloatArray:
        """Largest value of each covariate (d,)."""
        return np.asarray(self.points.max(axis=0))

    @cached_property
    def _span(self) -> FloatArray:
        span = self.high - self.low
        return np.where(span > 0, span, 1.0)

    @cached_property
    def _tree(self) -> Any:
        return cKDTree((self.points - self.low) / self._span)

    def outside(self, x: FloatArray) -> BoolArray:
        """Rows of `x` (n, d) out of the range of a covariate or, on a surface, far from all training points."""
        slack = 1e-9 * self._span
        out = ((x < self.low - slack) | (x > self.high + slack)).any(axis=1)
        if x.shape[1] > 1:
            distance, _ = self._tree.query((x - self.low) / self._span)
            out |= distance > REACH * (1 + 1e-9)
        return np.asarray(out)

    def clamp(self, x: FloatArray) -> FloatArray:
        """Rows of `x` (n, d) moved to the range and, on a surface, to within `REACH` of the nearest training point."""
        inside = np.clip(x, self.low, self.high)
        if x.shape[1] == 1:
            return inside
        unit = (inside - self.low) / self._span
        distance, nearest = self._tree.query(unit)
        far = distance > REACH
        if far.any():
            home = (self.points[nearest[far]] - self.low) / self._span
            unit[far] = home + (unit[far] - home) * (REACH / distance[far])[:, None]
            inside[far] = self.low + unit[far] * self._span
        return np.asarray(inside)


ByPart: TypeAlias = tuple[tuple[str, ...], str, str | None]
"""Covariates, by-variable and its level, if it is a factor."""


@dataclass(frozen=True)
class Training:
    """Ranges and levels of the training rows, as prediction uses them.

    Attributes
    ----------
    supports : mapping of covariate names to Support
    levels : mapping of factor to Levels
    within : mapping of (covariate names, by-variable, level) to Support
        Rows of a by-smooth: those of its level, or those where a numeric by-variable is not zero.
    """

    supports: Mapping[tuple[str, ...], Support]
    levels: Mapping[str, Levels]
    within: Mapping[ByPart, Support]

    @classmethod
    def of_rows(
        cls,
        rows: BoolArray,
        joint: Mapping[tuple[str, ...], Points],
        codes: Mapping[str, tuple[tuple[str, ...], Index]],
        members: Mapping[ByPart, BoolArray],
    ) -> Training:
        """Ranges and levels of some rows (n,).

        Parameters
        ----------
        rows : ndarray of bool (n,)
        joint : mapping of covariate names to Points
        codes : mapping of factor to (names of its levels, level of each row)
        members : mapping of (covariate names, by-variable, level) to rows of a by-smooth
        """

        def support(names: tuple[str, ...], of: BoolArray) -> Support:
            points = joint[names]
            return Support(points.values[np.bincount(points.index[of], minlength=len(points.values)) > 0])

        counts = {
            name: np.bincount(level[rows], minlength=len(names)) for name, (names, level) in codes.items()
        }
        return cls(
            {names: support(names, rows) for names in joint},
            {name: Levels(codes[name][0], n / n.sum()) for name, n in counts.items()},
            {part: support(part[0], rows & own) for part, own in members.items() if (rows & own).any()},
        )

    def members(self, frame: pd.DataFrame, by: str, level: str | None) -> BoolArray:
        """Rows (n,) of a frame on which a by-smooth has an effect."""
        if level is None:
            return np.asarray(frame[by].to_numpy(dtype=np.float64) != 0)
        return np.asarray(self.levels[by].codes(frame[by]) == self.levels[by].names.index(level))

    def clamp_frame(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The frame with its covariates moved into the range of the training data, before any term is evaluated.

        Rows are moved, not terms: terms that share a covariate, and may cancel where there are no data, all see the
        same point. Ranges come first, those of a row's levels next, surfaces last.
        """
        moved: dict[str, FloatArray] = {}

        def current(names: tuple[str, ...]) -> FloatArray:
            columns = [moved.get(name, frame[name].to_numpy(dtype=np.float64)) for name in names]
            return np.stack(columns, axis=1)

        known = [names for names in self.supports if all(name in frame.columns for name in names)]
        for names in sorted(known, key=len):
            for (own, by, level), support in self.within.items():
                if own == names and len(names) == 1 and by in frame.columns:
                    x, rows = current(names), self.members(frame, by, level)
                    x[rows] = support.clamp(x[rows])
                    moved.update(zip(names, x.T, strict=True))
            moved.update(zip(names, self.supports[names].clamp(current(names)).T, strict=True))
        return frame.assign(**moved)


def response(frame: pd.DataFrame, y: object, name: str | None) -> FloatArray:
    """The response (n,) from an argument or a column; raises for what cannot be fitted."""
    if y is None:
        if name is None:
            raise InvalidInput.of(
                "no response", "fit(frame, y)", "y is None", "y, or a formula with a left side"
            )
        faults = missing_columns(frame, [name])
        raise_faults(faults)
        y = frame[name]
    series = pd.Series(np.asarray(y).ravel() if not isinstance(y, pd.Series) else y.to_numpy())
    if len(series) != len(frame):
        got = f"{len(series)} values"
        raise InvalidInput.of("wrong length", "response y", got, f"one for each of the {len(frame)} rows")
    values, faults = numbers(pd.DataFrame({"y": series}), "y", "the response")
    if not faults and len(values) and np.ptp(values) == 0:
        faults = [
            Fault("constant response", f"{name or 'y'}", f"{values[0]} in every row", "at least two values")
        ]
    raise_faults(faults)
    return values
