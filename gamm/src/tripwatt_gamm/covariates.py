"""Read columns of a frame, with all faults at once; find their distinct values, levels and training support."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from tripwatt_gamm.arrays import BoolArray, FloatArray, Index
from tripwatt_gamm.errors import Fault, InvalidInput, raise_faults
from tripwatt_gamm.formula import nearest

MAX_JOINT = 10_000
"""Largest number of distinct points of a discretised set of covariates: a choice that bounds the length of a table."""

EXACT_ROWS = 10_000
"""Number of rows up to which `discretise=True` leaves covariates unchanged: a choice, because exact fits of so few are fast."""

REACH = 0.05
"""Distance from the nearest training point, as a share of each range, beyond which a surface is held constant: a choice, half of
the distance up to which figures show a surface."""


def is_factor(column: pd.Series[Any]) -> bool:
    """Whether a column holds levels rather than numbers (booleans count as the numbers 0 and 1)."""
    return not pd.api.types.is_numeric_dtype(column.dtype)


def crossed(frame: pd.DataFrame, names: tuple[str, ...]) -> pd.Series[Any]:
    """Column of one factor, or the combined levels of several factors, joined by colons."""
    crossed_levels, *rest = (frame[name] for name in names)
    for column in rest:
        crossed_levels = crossed_levels.astype(str) + ":" + column.astype(str)
    return crossed_levels


def missing_columns(frame: pd.DataFrame, wanted: Iterable[str]) -> list[Fault]:
    """Return one fault for each wanted column that the frame does not have."""
    names = [str(name) for name in frame.columns]
    present = ", ".join(names)
    return [
        Fault("unknown column", repr(name), "not in the frame", present, nearest(name, names))
        for name in wanted
        if name not in frame.columns
    ]


def numbers(frame: pd.DataFrame, name: str, label: str) -> tuple[FloatArray, list[Fault]]:
    """Return a numeric column (n,) and its faults; a column that is not numeric is returned as zeros.

    Parameters
    ----------
    frame : DataFrame
    name : str
        Column.
    label : str
        Term that uses the column, for the message.
    """
    column = frame[name]
    if is_factor(column):
        fault = Fault("not numeric", f"column {name!r} of {label}", str(column.dtype), "numbers")
        return np.zeros(len(frame)), [fault]
    values = column.to_numpy(dtype=np.float64, na_value=np.nan)
    invalid = ~np.isfinite(values)
    if invalid.any():
        row = int(np.argmax(invalid))
        got = f"{values[row]} in {int(invalid.sum())} rows, first at row {row}"
        return values, [Fault("not finite", f"column {name!r} of {label}", got, "finite numbers")]
    return values, []


def missing_levels(frame: pd.DataFrame, name: str, label: str) -> list[Fault]:
    """Return one fault if a factor has missing entries, otherwise none."""
    missing = frame[name].isna().to_numpy()
    if not missing.any():
        return []
    got = f"{int(missing.sum())} missing, first at row {int(np.argmax(missing))}"
    return [Fault("missing level", f"column {name!r} of {label}", got, "a level in every row")]


@dataclass(frozen=True)
class Levels:
    """Levels of a factor, and the share of the training rows at each level.

    Attributes
    ----------
    names : tuple of str
    share : ndarray (L,)
        Zero for a level without training rows.
    """

    names: tuple[str, ...]
    share: FloatArray

    @classmethod
    def from_column(cls, column: pd.Series[Any]) -> Levels:
        """Read the levels of a column: its categories, or its sorted distinct values."""
        if isinstance(column.dtype, pd.CategoricalDtype):
            names = tuple(map(str, column.dtype.categories))
        else:
            names = tuple(sorted(map(str, pd.unique(column))))
        codes = cls(names, np.ones(len(names))).codes(column)
        return cls(names, np.bincount(codes, minlength=len(names)) / len(codes))

    def codes(self, column: pd.Series[Any]) -> Index:
        """Position of each row's level (n,); -1 if the level is unknown."""
        position = {name: i for i, name in enumerate(self.names)}
        codes, values = pd.factorize(column)
        table = np.array([position.get(str(value), -1) for value in values] + [-1], dtype=np.intp)
        return table[codes]

    def rows(self, codes: Index) -> FloatArray:
        """Indicator row of each code (n, L); a level without training rows gets the mean of the training rows."""
        table = np.vstack([np.eye(len(self.names)), self.share])
        table[:-1][self.share == 0] = self.share
        return table[codes]


@dataclass(frozen=True)
class Points:
    """Distinct points of one or several covariates, and the point of each row.

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
        """Find the distinct points of rows `x` (n, d).

        A covariate with more distinct values than its entry in `limits` is rounded to an even grid of that many values.
        """
        wanted = limits if limits is not None else (None,) * x.shape[1]
        axes = [_distinct(x[:, j], limit) for j, limit in enumerate(wanted)]
        code = axes[0][1]
        for values, index in axes[1:]:
            code = code * len(values) + index
        index, rest = pd.factorize(code, sort=True)
        values = np.empty((len(rest), len(axes)))
        for j in range(len(axes) - 1, -1, -1):
            rest, position = np.divmod(rest, len(axes[j][0]))
            values[:, j] = axes[j][0][position]
        return cls(values, index.astype(np.intp, copy=False), np.bincount(index).astype(float))


def grid_limit(x: FloatArray, limit: int) -> int:
    """Lower `limit`, the values per covariate, until rows `x` (n, d) have at most `MAX_JOINT` distinct points.

    A limit of 20 or less is not lowered.
    """
    while limit > 20 and len(Points.from_values(x, (limit,) * x.shape[1]).values) > MAX_JOINT:
        limit = limit * 3 // 4
    return limit


def _distinct(x: FloatArray, limit: int | None) -> tuple[FloatArray, Index]:
    """Return the sorted distinct values, or an even grid of at most `limit` values, and the position of each row."""
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
    """Region that training data cover, and the rule that moves points from outside to its edge.

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
        """Mark rows of `x` (n, d) that are out of the range of a covariate or, on a surface, far from all training points."""
        slack = 1e-9 * self._span
        out = ((x < self.low - slack) | (x > self.high + slack)).any(axis=1)
        if x.shape[1] > 1:
            distance, _ = self._tree.query((x - self.low) / self._span)
            out |= distance > REACH * (1 + 1e-9)
        return np.asarray(out)

    def clamp(self, x: FloatArray) -> FloatArray:
        """Move rows of `x` (n, d) into the range and, on a surface, to within `REACH` of the nearest training point."""
        inside = np.clip(x, self.low, self.high)
        if x.shape[1] == 1:
            return inside
        unit = (inside - self.low) / self._span
        distance, closest = self._tree.query(unit)
        far = distance > REACH
        if far.any():
            nearest_point = (self.points[closest[far]] - self.low) / self._span
            unit[far] = nearest_point + (unit[far] - nearest_point) * (REACH / distance[far])[:, None]
            inside[far] = self.low + unit[far] * self._span
        return np.asarray(inside)


ByPart: TypeAlias = tuple[tuple[str, ...], str, str | None]
"""Covariates of a by-smooth, its by-variable, and the level if that variable is a factor."""


@dataclass(frozen=True)
class Training:
    """Ranges and levels of the training rows, as prediction uses them.

    Attributes
    ----------
    supports : mapping of covariate names to Support
    levels : mapping of factor to Levels
    within : mapping of (covariate names, by-variable, level) to Support
        Support of a by-smooth: the rows of its level, or the rows on which a numeric by-variable is not zero.
    """

    supports: Mapping[tuple[str, ...], Support]
    levels: Mapping[str, Levels]
    within: Mapping[ByPart, Support]

    def members(self, frame: pd.DataFrame, by: str, level: str | None) -> BoolArray:
        """Mark the rows (n,) of a frame on which a by-smooth has an effect."""
        if level is None:
            return np.asarray(frame[by].to_numpy(dtype=np.float64) != 0)
        return np.asarray(self.levels[by].codes(frame[by]) == self.levels[by].names.index(level))

    def clamp_frame(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Move the covariates of a frame into the range of the training data, before any term is evaluated.

        All terms are evaluated at the moved row, so that terms that share a covariate use the same point. (Far from
        the data such terms may be large and cancel.) Covariates are first moved into the range of the row's by-level,
        then into their own range, and last onto surfaces.
        """
        moved: dict[str, FloatArray] = {}

        def current(names: tuple[str, ...]) -> FloatArray:
            columns = [moved.get(name, frame[name].to_numpy(dtype=np.float64)) for name in names]
            return np.stack(columns, axis=1)

        in_frame = [names for names in self.supports if all(name in frame.columns for name in names)]
        for names in sorted(in_frame, key=len):
            for (covariates, by, level), support in self.within.items():
                if covariates == names and len(names) == 1 and by in frame.columns:
                    x, rows = current(names), self.members(frame, by, level)
                    x[rows] = support.clamp(x[rows])
                    moved.update(zip(names, x.T, strict=True))
            moved.update(zip(names, self.supports[names].clamp(current(names)).T, strict=True))
        return frame.assign(**moved)


@dataclass(frozen=True)
class Coverage:
    """What the rows of a frame say of ranges and levels.

    Attributes
    ----------
    joint : dict of covariate names to Points
    codes : dict of factor to (Levels, level of each row)
    members : dict of (covariate names, by-variable, level) to the rows (n,) of a by-smooth
    """

    joint: dict[tuple[str, ...], Points] = field(default_factory=dict)
    codes: dict[str, tuple[Levels, Index]] = field(default_factory=dict)
    members: dict[ByPart, BoolArray] = field(default_factory=dict)

    def training(self, rows: BoolArray) -> Training:
        """Find the ranges and levels of some rows, marked in a mask (n,)."""

        def support(names: tuple[str, ...], of: BoolArray) -> Support:
            points = self.joint[names]
            return Support(points.values[np.bincount(points.index[of], minlength=len(points.values)) > 0])

        levels = {}
        for name, (known, code) in self.codes.items():
            counts = np.bincount(code[rows], minlength=len(known.names))
            levels[name] = Levels(known.names, counts / counts.sum())
        masks = {part: rows & mask for part, mask in self.members.items() if (rows & mask).any()}
        within = {part: support(part[0], mask) for part, mask in masks.items()}
        return Training({names: support(names, rows) for names in self.joint}, levels, within)


def response(frame: pd.DataFrame, y: object, name: str | None) -> FloatArray:
    """Read the response (n,) from the argument `y` or the column `name`; raise if it cannot be fitted."""
    y = name if y is None else y
    if y is None:
        raise InvalidInput.of("no response", "fit(frame, y)", "y is None", "y, or a formula with a left side")
    values = row_values(frame, y, "the response")
    if len(values) and np.ptp(values) == 0:
        got = f"{values[0]} in every row"
        raise InvalidInput.of("constant response", f"{name or 'y'}", got, "at least two values")
    return values


def named_column(frame: pd.DataFrame, given: object) -> object:
    """Return the column of this name, or the given values; raise if the column is missing."""
    if isinstance(given, str):
        raise_faults(missing_columns(frame, [given]))
        return frame[given]
    return given


def row_values(frame: pd.DataFrame, given: object, label: str) -> FloatArray:
    """Read a number for each row (n,): the name of a column, a Series, which is aligned with the frame, or an array."""
    given = named_column(frame, given)
    series = pd.Series(np.ravel(np.asarray(given))) if not isinstance(given, pd.Series) else given
    if len(series) != len(frame):
        got = f"{len(series)} values"
        raise InvalidInput.of("wrong length", label, got, f"one for each of the {len(frame)} rows")
    if isinstance(given, pd.Series) and not series.index.equals(frame.index):
        if not (series.index.is_unique and frame.index.is_unique and frame.index.isin(series.index).all()):
            fix = "to_numpy() takes the values in their order"
            raise InvalidInput.of("another index", label, "a Series", "the index of the frame", fix)
        series = series.reindex(frame.index)
    values, faults = numbers(pd.DataFrame({"y": series.array}), "y", label)
    raise_faults(faults)
    return values
