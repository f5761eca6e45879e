"""Spline bases and their penalties: P-splines, cubic regression splines, thin plate regression splines.

A basis is built from the covariates and then stays fixed: `matrix` evaluates its columns at any points, `penalty` is
the quadratic form that measures wiggliness. Bases are independent of factors, constraints and smoothing parameters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from tripwatt_gamm.arrays import FloatArray

MAX_KNOTS = 2000
"""Largest number of distinct points from which a thin plate eigenbasis is built: that of mgcv."""

CACHED_ROWS = 128
"""Number of rows whose radial functions are formed at a time: a choice, because those of more rows leave the cache."""


@dataclass(frozen=True)
class PSpline:
    """Cubic B-splines on even knots with a penalty on second differences (Eilers & Marx 1996).

    The knots reach 0.1 % of the range beyond the data on both sides.

    Parameters
    ----------
    low, high : float
        Range of the covariate.
    k : int
        Number of B-splines, at least 4.

    Examples
    --------
    >>> basis = PSpline(0.0, 1.0, k=8)
    >>> basis.matrix(np.array([[0.3]])).sum().round(12)
    np.float64(1.0)
    """

    low: float
    high: float
    k: int

    @cached_property
    def knots(self) -> FloatArray:
        """The k + 4 even knots."""
        margin = 0.001 * (self.high - self.low)
        step = (self.high - self.low + 2 * margin) / (self.k - 3)
        return self.low - margin + step * np.arange(-3.0, self.k + 1.0)

    @property
    def penalty(self) -> FloatArray:
        """Crossproduct of the difference matrix, (k, k)."""
        differences = np.diff(np.eye(self.k), n=2, axis=0)
        return differences.T @ differences

    def matrix(self, x: FloatArray) -> FloatArray:
        """Evaluate the B-splines at `x` (n, 1), as (n, k); they are constant beyond the inner knots."""
        inside = np.clip(x[:, 0], self.knots[3], self.knots[-4])
        values: FloatArray = BSpline.design_matrix(inside, self.knots, 3).toarray()
        return values


@dataclass(frozen=True)
class CubicRegression:
    """Natural or cyclic cubic spline, parametrised by its values at the knots (Wood 2017, sections 5.3.1 and 5.3.2).

    Parameters
    ----------
    knots : ndarray (m,)
        Increasing knots.
    cyclic : bool
        Whether the first knot is the last one, a period later.
    """

    knots: FloatArray
    cyclic: bool = False

    @property
    def k(self) -> int:
        """Number of distinct knots."""
        return len(self.knots) - self.cyclic

    @cached_property
    def _second_derivatives(self) -> tuple[FloatArray, FloatArray]:
        """Matrix from values to second derivatives at the knots (m, k), and the penalty (k, k)."""
        h, every = np.diff(self.knots), np.arange(self.k)
        here = every if self.cyclic else every[1:-1]
        before, after = h[here - 1, None], h[here, None]
        left, right, own = np.eye(self.k)[here - 1], np.eye(self.k)[(here + 1) % self.k], np.eye(self.k)[here]
        D = left / before + right / after - own * (1 / before + 1 / after)
        B = left * before / 6 + right * after / 6 + own * (before + after) / 3
        F = np.zeros((self.k, self.k))  # the second derivatives of a natural spline are zero at both ends
        F[here] = np.linalg.solve(B[:, here], D)
        return F[np.arange(len(self.knots)) % self.k], np.asarray(D.T @ F[here])

    @property
    def penalty(self) -> FloatArray:
        """Integrated squared second derivative, (k, k)."""
        S = self._second_derivatives[1]
        return np.asarray((S + S.T) / 2)

    def matrix(self, x: FloatArray) -> FloatArray:
        """Evaluate the columns at `x` (n, 1), as (n, k); beyond the knots they are constant, or continue periodically."""
        F, (low, high) = self._second_derivatives[0], self.knots[[0, -1]]
        v = low + np.mod(x[:, 0] - low, high - low) if self.cyclic else np.clip(x[:, 0], low, high)
        j = np.clip(np.searchsorted(self.knots, v, side="right") - 1, 0, len(self.knots) - 2)
        left, right = self.knots[j], self.knots[j + 1]
        h, up, down = right - left, right - v, v - left  # the way up to the next knot, and down to the last
        values = (
            F[j] * ((up**3 / h - h * up) / 6)[:, None] + F[j + 1] * ((down**3 / h - h * down) / 6)[:, None]
        )
        rows = np.arange(len(v))
        values[rows, j] += up / h
        values[rows, (j + 1) % self.k] += down / h
        return np.asarray(values)


@dataclass(frozen=True)
class ThinPlate:
    """Thin plate regression spline: the truncated eigenbasis of Wood (2003).

    Made by `thin_plate`.

    Parameters
    ----------
    knots : ndarray (m, d)
        Centred points that carry radial functions.
    shift : ndarray (d,)
        Centre.
    loadings : ndarray (m, k - M)
        Matrix that maps the radial functions to the columns; M is the number of polynomials.
    scale : ndarray (k,)
        Divisors of the columns.
    penalty : ndarray (k, k)
    order : int
        Order m of the derivatives in the penalty, 2 m > d.
    """

    knots: FloatArray
    shift: FloatArray
    loadings: FloatArray
    scale: FloatArray
    penalty: FloatArray
    order: int

    @property
    def k(self) -> int:
        """Number of columns."""
        return len(self.scale)

    def matrix(self, x: FloatArray) -> FloatArray:
        """Evaluate the columns at `x` (n, d), as (n, k)."""
        centred = x - self.shift
        columns = np.empty((len(x), self.k))
        radial_columns = self.loadings.shape[1]
        for start in range(0, len(x), CACHED_ROWS):
            rows = slice(start, start + CACHED_ROWS)
            columns[rows, :radial_columns] = _radial(centred[rows], self.knots, self.order) @ self.loadings
        columns[:, radial_columns:] = _polynomials(centred, self.order)
        columns /= self.scale
        return columns


def _polynomials(x: FloatArray, order: int) -> FloatArray:
    """Monomials (n, M) of the points `x` (n, d) whose total degree is below `order`, lower degrees first."""
    exponents = [e for e in product(range(order - 1, -1, -1), repeat=x.shape[1]) if sum(e) < order]
    return np.stack([np.prod(x ** np.array(e), axis=1) for e in sorted(exponents, key=sum)], axis=1)


def _radial(x: FloatArray, knots: FloatArray, order: int) -> FloatArray:
    """Thin plate function of the distances between `x` (n, d) and `knots` (m, d) (Wood 2003, eq. 2)."""
    d = x.shape[1]
    if d == 1:
        square = (x - knots.T) ** 2
    else:
        square = (x**2).sum(1)[:, None] + (knots**2).sum(1) - 2 * x @ knots.T
        np.maximum(square, 0.0, out=square)
    power = 2 * order - d
    if d % 2:
        constant = math.gamma(d / 2 - order) / (
            2 ** (2 * order) * math.pi ** (d / 2) * math.factorial(order - 1)
        )
        # a power of a half takes five times as long
        return np.asarray(constant * square ** (power // 2) * np.sqrt(square))
    constant = (-1) ** (order + 1 + d // 2) / (
        2 ** (2 * order - 1) * math.pi ** (d / 2) * math.factorial(order - 1) * math.factorial(order - d // 2)
    )
    logarithm = np.log(np.maximum(square, 1e-300))
    return np.asarray(constant / 2 * square ** (power // 2) * logarithm)


def _trailing_null_space(C: FloatArray) -> FloatArray:
    """Orthonormal Z (k, k - M) with C Z = 0, from Householder reflections that map C to [0, T] (Gill, Murray & Wright)."""
    M, k = C.shape
    work, Q = C.copy(), np.eye(k)
    for i in range(M):
        v = np.zeros(k)
        v[: k - i] = work[i, : k - i]
        size = float(np.linalg.norm(v))
        # for evenly spaced points the pivot is zero up to rounding; the sign of that rounding must not decide the basis
        v[k - 1 - i] += -size if v[k - 1 - i] < -1e-9 * size else size
        v /= np.linalg.norm(v)
        work -= 2 * np.outer(work @ v, v)
        Q -= 2 * np.outer(Q @ v, v)
    return Q[:, : k - M]


def _largest_eigenpairs(E: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
    """Return the `k` eigenvalues of largest modulus, in descending order of the values themselves, and their eigenvectors."""
    n = len(E)
    if n <= 400 or k > n // 4:
        values, vectors = eigh(E)
        keep = np.argsort(-np.abs(values), kind="stable")[:k]
        values, vectors = values[keep], vectors[:, keep]
    else:
        start = np.linspace(1.0, 2.0, n)  # fixed, so that two fits agree to the last digit
        values, vectors = eigsh(E, k=k, which="LM", v0=start, tol=0)
    order = np.argsort(-values)
    values, vectors = values[order], vectors[:, order]
    return values, vectors * np.where(vectors[0] < 0, -1.0, 1.0)


def _basis_knots(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return knots (m, d) and weights (m,): up to `MAX_KNOTS` points themselves, beyond that the means of grid cells.

    The weight of a cell is its number of points.
    """
    if len(points) <= MAX_KNOTS:
        return points, np.ones(len(points))
    d = points.shape[1]
    low, span = points.min(axis=0), np.ptp(points, axis=0)
    cells = MAX_KNOTS
    while True:
        place = np.minimum((points - low) / span * cells, cells - 1).astype(np.int64)
        numbers = place @ cells ** np.arange(d)[::-1]
        _, index, counts = np.unique(numbers, return_inverse=True, return_counts=True)
        if len(counts) <= MAX_KNOTS:
            break
        cells = cells * 9 // 10
    sums = [np.bincount(index, weights=points[:, j]) for j in range(d)]
    return np.stack(sums, axis=1) / counts[:, None], counts.astype(np.float64)


def thin_plate(points: FloatArray, counts: FloatArray, k: int, order: int) -> ThinPlate:
    """Build a thin plate regression spline on distinct points.

    Parameters
    ----------
    points : ndarray (n, d)
        Distinct points, sorted. If there are more than `MAX_KNOTS`, they are replaced by the means of grid cells,
        weighted by their numbers of points; this approximates the eigenbasis of all points.
    counts : ndarray (n,)
        Number of rows of the data at each point; columns are scaled to unit mean square over the rows.
    k : int
        Number of columns.
    order : int
        Order of the penalty.

    Returns
    -------
    ThinPlate

    Examples
    --------
    >>> basis = thin_plate(np.linspace(0, 1, 30)[:, None], np.ones(30), k=5, order=2)
    >>> basis.k
    5
    """
    shift = np.asarray(np.average(points, axis=0, weights=counts))
    knots, weights = _basis_knots(points)
    knots, root = knots - shift, np.sqrt(weights)
    T = root[:, None] * _polynomials(knots, order)
    M = T.shape[1]
    values, U = _largest_eigenpairs(_radial(knots, knots, order) * root * root[:, None], k)
    Z = _trailing_null_space(T.T @ U)
    S = np.zeros((k, k))
    S[: k - M, : k - M] = Z.T @ (values[:, None] * Z)
    loadings = root[:, None] * (U @ Z)
    raw = ThinPlate(knots, shift, loadings, np.ones(k), S, order)
    scale = np.sqrt(np.average(raw.matrix(points) ** 2, axis=0, weights=counts))
    scale[scale == 0] = 1.0
    S = S / np.outer(scale, scale)
    return ThinPlate(knots, shift, loadings, scale, (S + S.T) / 2, order)
