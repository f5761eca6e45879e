"""Crossproducts of a design with itself and a response, whose differences are those of the rows that remain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.covariates import Index
from tripwatt_gamm.fit import NormalEquations
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.tables import CHUNK, TableRows


@dataclass(frozen=True)
class Moments:
    """Crossproducts summed over rows, of the columns X with themselves and with the response y.

    Attributes
    ----------
    gram : ndarray (p, p)
        X'X.
    cross : ndarray (p,)
        X'y.
    square, n : float
        y'y, and the number of rows.
    """

    gram: FloatArray
    cross: FloatArray
    square: float
    n: float

    def __sub__(self, other: Moments) -> Moments:
        """Moments of the rows of `self` without those of `other`."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Moments(*(mine - theirs for mine, theirs in pairs))

    def normal(self, stack: PenaltyStack, log_jacobian: float = 0.0) -> NormalEquations:
        """Normal equations in the rotated coordinates of `stack`; `log_jacobian` is that of whitened rows."""
        gram, cross = stack.rotate_both(self.gram), stack.rotate(self.cross)
        return NormalEquations(gram, cross, self.square, self.n, log_jacobian)

    def of_columns(self, columns: Index) -> Moments:
        """Moments of some columns."""
        return Moments(self.gram[np.ix_(columns, columns)], self.cross[columns], self.square, self.n)


def moments(rows: TableRows, y: FloatArray) -> Moments:
    """Compute the moments of rows with responses y (n,)."""
    gram, cross, square = np.zeros((rows.p, rows.p)), np.zeros(rows.p), 0.0
    for start in range(0, rows.n, CHUNK):
        X, v = rows.dense(slice(start, start + CHUNK)), y[start : start + CHUNK]
        gram += X.T @ X
        cross += X.T @ v
        square += float(v @ v)
    return Moments(gram, cross, square, float(rows.n))
