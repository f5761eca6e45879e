"""Normal equations: crossproducts of a design with itself and a response, whose differences are those of the rows that remain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tripwatt_gamm.arrays import BoolArray, FloatArray, Index
from tripwatt_gamm.gram import Gram
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.tables import TableRows


@dataclass(frozen=True)
class NormalEquations:
    """Sufficient statistics of a Gaussian model, summed over rows.

    Attributes
    ----------
    gram : Gram
        X'X.
    cross : ndarray (p,)
        X'y.
    square, n : float
        y'y, and the number of rows.
    log_jacobian : float
        Log determinant of the whitening of the rows; 0 if they are not whitened.
    """

    gram: Gram
    cross: FloatArray
    square: float
    n: float
    log_jacobian: float = 0.0

    @classmethod
    def of_rows(cls, rows: TableRows, y: FloatArray, log_jacobian: float = 0.0) -> NormalEquations:
        """Sum over rows with responses y (n,)."""
        return cls(rows.gram(), rows.rmatvec(y), float(y @ y), float(rows.n), log_jacobian)

    def __sub__(self, other: NormalEquations) -> NormalEquations:
        """Return the sums over the rows of `self` without those of `other`."""
        gram, cross = self.gram - other.gram, self.cross - other.cross
        return NormalEquations(gram, cross, self.square - other.square, self.n - other.n)

    def of_columns(self, columns: Index) -> NormalEquations:
        """Select columns."""
        return NormalEquations(self.gram.of_columns(columns), self.cross[columns], self.square, self.n)

    def without(self, dead: BoolArray) -> NormalEquations:
        """Set some columns to zero."""
        return replace(self, gram=self.gram.without(dead), cross=np.where(dead, 0.0, self.cross))

    def rotated(self, stack: PenaltyStack) -> NormalEquations:
        """Rotate to the coordinates of `stack`."""
        return replace(self, gram=stack.rotate_gram(self.gram), cross=stack.rotate(self.cross))
