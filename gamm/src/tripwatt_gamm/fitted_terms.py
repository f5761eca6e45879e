"""A fitted term of a model, and its columns at any rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd

from tripwatt_gamm.arrays import FloatArray, Index
from tripwatt_gamm.covariates import Levels, Points, Training, crossed
from tripwatt_gamm.penalties import PenaltyBlock
from tripwatt_gamm.smoothers import Smoother
from tripwatt_gamm.terms import Parametric, RandomEffect, Smooth, Tensor, Term

Extrapolation = Literal["clamp", "linear"]


@dataclass
class FittedTerm:
    """A fitted term of a model, or one level of a by-factor smooth.

    Attributes
    ----------
    label : str
        Label as in tables, e.g. ``s(time):seasonwinter``.
    term : Term
    kind : {"parametric", "smooth", "random"}
    names : list of str
        Names of the coefficients.
    matrices : list of ndarray (m, m)
        Penalties of each of the copies, in the coordinates of the term.
    null_dim, rank : int
        Dimension of the penalties' joint null space, and its complement.
    start : int
        First coefficient.
    smoother : Smoother or None
    by, level : str or None
        By-variable, and the level of this smooth.
    contrasts : dict of str to ndarray (L, q)
        Columns of the levels of each factor of a parametric term.
    groups : tuple of str
        Columns that hold the levels of a random effect.
    copies : int
        Levels that have the same penalties: the coefficients are m times this number, each of the m for all levels.
    scales : ndarray (q,) or None
        Root mean squares of the columns of correlated effects.
    training : Training
        Ranges and levels of the training rows, which decide how rows outside of them are treated.
    extrapolation : {"clamp", "linear"}
    """

    label: str
    term: Term | None
    kind: Literal["parametric", "smooth", "random"]
    names: list[str]
    matrices: list[FloatArray]
    start: int = 0
    smoother: Smoother | None = None
    by: str | None = None
    level: str | None = None
    contrasts: dict[str, FloatArray] = field(default_factory=dict)
    groups: tuple[str, ...] = ()
    copies: int = 1
    scales: FloatArray | None = None
    training: Training = field(default_factory=lambda: Training({}, {}, {}))
    extrapolation: Extrapolation = "clamp"

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.names)

    @property
    def slice(self) -> slice:
        """Positions of the term's coefficients among those of the model."""
        return slice(self.start, self.start + self.size)

    @property
    def penalties(self) -> list[FloatArray]:
        """Penalties (size, size) of all coefficients."""
        return [np.asarray(np.kron(S, np.eye(self.copies)), dtype=np.float64) for S in self.matrices]

    @property
    def null_dim(self) -> int:
        """Dimension of the unpenalised space."""
        blocks = [PenaltyBlock.from_matrices(0, self.matrices)] if self.matrices else []
        return self.size - sum(self.copies * block.rank for block in blocks)

    def matrix(self, frame: pd.DataFrame) -> FloatArray:
        """Compute the columns of the term at the rows of a frame.

        Parameters
        ----------
        frame : DataFrame
            Columns of the term, finite.

        Returns
        -------
        ndarray (n, size)
        """
        columns, (levels, column) = self._columns(frame), self._levels(frame)
        if not levels.names:
            return columns
        indicator = np.eye(len(levels.names) + 1)[levels.codes(column), :-1]
        return (columns[:, :, None] * indicator[:, None, :]).reshape(len(frame), -1)

    def new_levels(self, frame: pd.DataFrame) -> Iterator[tuple[str, Index, FloatArray]]:
        """Yield each level that training did not have, its rows of a frame, and there the columns (rows, q) of its effects."""
        levels, column = self._levels(frame)
        new = np.flatnonzero(levels.codes(column) < 0) if levels.names else np.arange(0)
        for level, rows in pd.Series(new).groupby(np.array([str(name) for name in column.iloc[new]])):
            yield str(level), rows.to_numpy(), self._columns(frame.iloc[rows])

    @property
    def factors(self) -> tuple[str, ...]:
        """Columns whose levels have effects each: those of a random effect, or the factor of curves."""
        return (str(self.by),) if getattr(self.term, "basis", None) == "fs" else self.groups

    def _levels(self, frame: pd.DataFrame) -> tuple[Levels, pd.Series[Any]]:
        """Levels of `factors`, none without them, and that of each row; rows without these columns have none."""
        known = self.factors and set(self.factors) <= set(frame.columns)
        column = crossed(frame, self.factors) if known else pd.Series(None, frame.index, dtype=object)
        return self.training.levels.get(":".join(self.factors), Levels((), np.zeros(0))), column

    def _columns(self, frame: pd.DataFrame) -> FloatArray:
        """Columns of the term, or of one level of `factors`."""
        if self.term is None:
            return np.ones((len(frame), 1))
        if isinstance(self.term, RandomEffect):
            effects = self.multipliers([frame[name].to_numpy(dtype=np.float64) for name in self.needed])
            return np.stack([np.ones(len(frame)) if x is None else x for x in effects], axis=1)
        if isinstance(self.term, Parametric):
            return self._parametric(frame, self.term.columns)
        return self._smooth(frame)

    @property
    def needed(self) -> tuple[str, ...]:
        """Columns that a prediction reads; levels of a random effect may be missing."""
        return () if self.term is None else tuple(n for n in self.term.columns if n not in self.groups)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that each level of a random effect has; empty for other terms."""
        if not isinstance(self.term, RandomEffect):
            return ()
        if self.term.correlated:
            return ("(Intercept)", *self.needed)
        return (":".join(self.needed) or "(Intercept)",)

    def multipliers(self, numbers: list[FloatArray]) -> list[FloatArray | None]:
        """Return the multiplier (n,) of each of `effects`, from the columns `needed`; None stands for 1."""
        correlated = isinstance(self.term, RandomEffect) and self.term.correlated
        return [None, *numbers] if correlated else [np.prod(numbers, axis=0) if numbers else None]

    def _parametric(self, frame: pd.DataFrame, names: tuple[str, ...]) -> FloatArray:
        """Columns of a parametric term; a frame whose values are to be held comes from `Training.clamp_frame`."""
        product = np.ones((len(frame), 1))
        for name in names:
            if name in self.contrasts:
                levels = self.training.levels[name]
                piece = levels.rows(levels.codes(frame[name])) @ self.contrasts[name]
            else:
                piece = frame[name].to_numpy(dtype=np.float64)[:, None]
            product = (product[:, :, None] * piece[:, None, :]).reshape(len(frame), -1)
        return product

    def _smooth(self, frame: pd.DataFrame) -> FloatArray:
        """Columns of a smooth, times its by-variable or the indicator of its level; outside its range by `extrapolation`."""
        assert isinstance(self.term, Smooth | Tensor)
        assert self.smoother is not None
        weight = self._by_weight(frame)
        columns = np.zeros((len(frame), self.size // self.copies))
        affected = np.flatnonzero(weight)
        if not len(affected):
            return columns
        points = Points.from_values(frame[list(self.term.names)].to_numpy(dtype=np.float64)[affected])
        support = self.training.supports[self.term.names]
        cyclic = self.term.basis == "cc"  # continues periodically
        table = self.smoother.matrix(points.values if cyclic else support.clamp(points.values))
        if self.extrapolation == "linear" and points.values.shape[1] == 1 and not cyclic:
            low, high = support.low, support.high
            h = 1e-4 * (high - low)
            B = self.smoother.matrix(np.stack([low, low + h, high - h, high]))
            below, above = np.minimum(points.values - low, 0.0), np.maximum(points.values - high, 0.0)
            table = table + (below * (B[1] - B[0]) / h + above * (B[3] - B[2]) / h)
        columns[affected] = table[points.index] * weight[affected, None]
        return columns

    def _by_weight(self, frame: pd.DataFrame) -> FloatArray:
        """Multiplier (n,) of a smooth: 1, the numeric by-variable, or the indicator of its level (for an unknown level, its share)."""
        if self.by is None or self.factors:
            return np.ones(len(frame))
        if self.level is None:
            return frame[self.by].to_numpy(dtype=np.float64)
        levels = self.training.levels[self.by]
        column = levels.rows(levels.codes(frame[self.by]))
        return np.asarray(column[:, levels.names.index(self.level)])
