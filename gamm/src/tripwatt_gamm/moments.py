"""Crossproducts of a design with itself and a response, per group of rows, with or without AR(1) whitening.

Within a group whose errors follow e_t = rho e_(t-1) + noise, the rows (x_t - rho x_(t-1)) / sqrt(1 - rho^2) have
independent errors. Apart from the factor 1 / (1 - rho^2) their crossproduct is a polynomial in rho whose coefficients
are fixed matrices, so that rho can be estimated, and groups left out, without another pass over the rows.
"""

from __future__ import annotations

import math
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
    gram : ndarray (s, p, p)
        X'X. Without autocorrelation s = 1. Otherwise s = 4: over all rows, lagged products (symmetrised), over rows
        with a successor, over first rows of groups.
    cross : ndarray (s, p)
        X'y, the same sums.
    square : ndarray (s,)
        y'y, the same sums.
    n, firsts : float
        Number of rows, and number of groups (first rows).
    """

    gram: FloatArray
    cross: FloatArray
    square: FloatArray
    n: float
    firsts: float

    def __sub__(self, other: Moments) -> Moments:
        """Moments of the rows of `self` without those of `other`."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Moments(*(mine - theirs for mine, theirs in pairs))

    def __add__(self, other: Moments) -> Moments:
        """Moments of the rows of both."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Moments(*(mine + theirs for mine, theirs in pairs))

    @property
    def lagged(self) -> bool:
        """Whether there are lagged products, for autocorrelated errors."""
        return len(self.gram) > 1

    def mixture(self, rho: float) -> FloatArray:
        """Weights (s,) that combine the sums to those of whitened rows at autocorrelation `rho`."""
        if not self.lagged:
            return np.ones(1)
        # sum of (x_t - rho x_(t-1))^2 / (1 - rho^2) over rows with a predecessor, plus first rows unchanged
        return np.array([1.0, -rho, rho**2, -(rho**2)]) / (1 - rho**2)

    def normal(self, stack: PenaltyStack, active: Index, rho: float = 0.0) -> NormalEquations:
        """Normal equations of the active coefficients in the rotated coordinates of `stack`."""
        mix = self.mixture(rho)
        gram = np.tensordot(mix, self.gram, axes=1)[np.ix_(active, active)]
        jacobian = -(self.n - self.firsts) / 2 * math.log(1 - rho**2)
        cross = stack.rotate((mix @ self.cross)[active])
        return NormalEquations(stack.rotate_both(gram), cross, float(mix @ self.square), self.n, jacobian)


def moments(rows: TableRows, y: FloatArray, order: Index, lagged: bool) -> Moments:
    """Compute the moments of the rows `order`; if `lagged`, these are consecutive in time and of one group.

    Parameters
    ----------
    rows : TableRows
    y : ndarray (n,)
    order : ndarray (m,)
        Numbers of the rows.
    lagged : bool
        Whether to sum lagged products too.

    Returns
    -------
    Moments
    """
    p, s = rows.p, 4 if lagged else 1
    gram, cross, square = np.zeros((s, p, p)), np.zeros((s, p)), np.zeros(s)
    for start in range(0, len(order), CHUNK):
        stop = min(start + CHUNK, len(order))
        X, v = rows.dense(order[start:stop]), y[order[start:stop]]
        gram[0] += X.T @ X
        cross[0] += X.T @ v
        square[0] += v @ v
        if not lagged:
            continue
        if start == 0:
            gram[3] += np.outer(X[0], X[0])
            cross[3] += X[0] * v[0]
            square[3] += v[0] ** 2
        if stop < len(order):  # the successor of the last row
            X = np.vstack([X, rows.dense(order[stop : stop + 1])])
            v = np.append(v, y[order[stop]])
        B = X[:-1].T @ X[1:]
        gram[1] += B + B.T
        cross[1] += X[:-1].T @ v[1:] + X[1:].T @ v[:-1]
        square[1] += 2 * float(v[:-1] @ v[1:])
        gram[2] += X[:-1].T @ X[:-1]
        cross[2] += X[:-1].T @ v[:-1]
        square[2] += float(v[:-1] @ v[:-1])
    return Moments(gram, cross, square, float(len(order)), 1.0)
