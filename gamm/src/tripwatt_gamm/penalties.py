"""Quadratic penalties of a model, rotated so that unpenalised directions have exactly zero entries.

Each block of coefficients is rotated to the eigenvectors of its summed penalty. A single penalty becomes diagonal.
Several penalties share one range space, in which log|S|+ is exact for smoothing parameters of any ratio
(Wood 2011, appendix B).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh, qr

from tripwatt_gamm.arrays import FloatArray

RANK_TOLERANCE = 1e-9
"""Relative size of an eigenvalue of a penalty up to which its direction is unpenalised: a choice, far above rounding."""

LOG_RATIO = (-31.0, 22.0)
"""Bounds of log(smoothing parameter), relative to the value at which penalty and data have equal weight: beyond them, 3e-14 and
1e10, one of the two is lost in rounding."""

MAX_CORRELATED = 14.0
"""Upper bound for correlated effects, whose penalties overlap: beyond it the smaller penalty is lost in rounding."""

Blocks: TypeAlias = list[tuple[int, list[FloatArray]]]
"""First coefficient and penalties (m, m) of each penalised block."""


@dataclass(frozen=True)
class PenaltyBlock:
    """Penalties of one term in the rotated coordinates of its block.

    Attributes
    ----------
    start, stop : int
        Coefficients of the block.
    rank : int
        Dimension of the range space: the first `rank` rotated coefficients.
    rotation : ndarray (stop - start, stop - start)
        Original = rotation @ rotated.
    matrices : list of ndarray (rank, rank)
        Penalties in the range space.
    roots : list of ndarray (r, rank)
        Matrices of full row rank whose crossproducts are the penalties; empty for one penalty, which is diagonal.
    """

    start: int
    stop: int
    rank: int
    rotation: FloatArray
    matrices: list[FloatArray]
    roots: list[FloatArray]

    @classmethod
    def from_matrices(cls, start: int, matrices: list[FloatArray]) -> PenaltyBlock:
        """Rotate the penalties (m, m) of a block that starts at coefficient `start`."""
        total = sum((S / np.linalg.norm(S) for S in matrices), np.zeros_like(matrices[0]))
        values, vectors = eigh((total + total.T) / 2)
        values, vectors = values[::-1], vectors[:, ::-1]
        rank = int((values > RANK_TOLERANCE * values[0]).sum())
        U = vectors[:, :rank]
        if len(matrices) == 1:
            diagonal = values[:rank] * np.linalg.norm(matrices[0])
            return cls(start, start + len(total), rank, vectors, [np.diag(diagonal)], [])
        in_range, roots = [U.T @ (S + S.T) @ U / 2 for S in matrices], []
        for S in in_range:
            values, W = eigh(S)
            positive = values > RANK_TOLERANCE * values[-1]
            roots.append(np.sqrt(values[positive])[:, None] * W[:, positive].T)
        return cls(start, start + len(total), rank, vectors, in_range, roots)

    def log_determinant(self, rho: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log|S|+, its gradient and its Hessian in the log smoothing parameters `rho` of the block.

        Several penalties need a QR decomposition of their stacked, sorted square roots, which is stable under scaling of rows.
        """
        if not self.roots:
            value = float(np.log(np.diag(self.matrices[0])).sum() + self.rank * rho[0])
            return value, np.array([float(self.rank)]), np.zeros((1, 1))
        order = np.argsort(-rho)
        stacked = np.vstack([np.exp(rho[j] / 2) * self.roots[j] for j in order])
        Q, R, _ = qr(stacked, mode="economic", pivoting=True)
        # the rows of Q that belong to penalty j give lambda_j S_j in the basis in which the sum is the identity
        pieces = np.split(Q, np.cumsum([len(self.roots[j]) for j in order])[:-1])
        weighted = [pieces[i].T @ pieces[i] for i in np.argsort(order)]
        gradient = np.array([np.trace(W) for W in weighted])
        hessian = np.diag(gradient) - np.array([[float((A * B).sum()) for A in weighted] for B in weighted])
        return 2 * float(np.log(np.abs(np.diag(R))).sum()), gradient, hessian


def correlated_penalties(levels: int, loadings: FloatArray) -> list[FloatArray]:
    """Build the q penalties of q correlated effects; coefficients are ordered by effect, then by level.

    The effects of a level are b = L u, with L unit lower triangular and independent u of variances D. Their covariance
    is L D L', and its inverse is the sum of v_j v_j' / D_j over the rows v_j of the inverse of L: one penalty for each
    j.

    Parameters
    ----------
    levels : int
    loadings : ndarray (q (q - 1) / 2,)
        Lower triangle of L, row by row.
    """
    q = round((1 + math.sqrt(1 + 8 * len(loadings))) / 2)
    L = np.eye(q)
    L[np.tril_indices(q, -1)] = loadings
    rows = np.linalg.inv(L)
    return [np.asarray(np.kron(np.outer(v, v), np.eye(levels)), dtype=np.float64) for v in rows]


@dataclass(frozen=True)
class Penalty:
    """One penalty in rotated coordinates.

    Attributes
    ----------
    where : slice
        Coefficients that the penalty acts on.
    matrix : ndarray (r, r)
    diagonal : ndarray (r,) or None
        Diagonal of `matrix` if it is a diagonal matrix.
    trace : float
        Trace of the penalty; the trace of the crossproduct of `where`, divided by it, is the scale of the smoothing
        parameter.
    log_most : float
        Upper bound of the log smoothing parameter, relative to the log of that scale.
    """

    where: slice
    matrix: FloatArray
    diagonal: FloatArray | None
    trace: float
    log_most: float = LOG_RATIO[1]

    def times(self, M: FloatArray) -> FloatArray:
        """Multiply the penalty by M (r, ...), the rows `where` of a vector or a matrix."""
        if self.diagonal is not None:
            return np.asarray(self.diagonal * M if M.ndim == 1 else self.diagonal[:, None] * M)
        return np.asarray(self.matrix @ M)


class PenaltyStack:
    """All penalties of a model with `p` coefficients.

    Parameters
    ----------
    p : int
        Number of coefficients.
    terms : list of (int, list of ndarray)
        As `Blocks`.
    scales : mapping of int to ndarray (q,), optional
        Root mean square of the columns of each effect, for each block of correlated effects, by its first coefficient.

    Examples
    --------
    >>> stack = PenaltyStack(4, [(1, [np.diag([2.0, 1.0, 0.0])])])
    >>> stack.size, stack.null_dim
    (1, 2)
    """

    def __init__(self, p: int, terms: Blocks, scales: Mapping[int, FloatArray] | None = None) -> None:
        self.p, self.terms, self.scales = p, terms, dict(scales or {})
        self.blocks = [PenaltyBlock.from_matrices(start, matrices) for start, matrices in terms]
        self.penalties: list[Penalty] = []
        self.members: list[npt.NDArray[np.intp]] = []
        for block in self.blocks:
            first = len(self.penalties)
            sizes, inside = self.scales.get(block.start), slice(block.start, block.start + block.rank)
            for j, S in enumerate(block.matrices):
                diagonal = np.diag(S) if len(block.matrices) == 1 else None
                if sizes is None:
                    self.penalties.append(Penalty(inside, S, diagonal, float(np.trace(S))))
                else:
                    scale = block.rank / len(sizes) * float(sizes @ sizes) / sizes[j] ** 2
                    self.penalties.append(Penalty(inside, S, None, scale, MAX_CORRELATED))
            self.members.append(np.arange(first, len(self.penalties)))
        self.size = len(self.penalties)
        self.null_dim = p - sum(block.rank for block in self.blocks)

    @property
    def n_loadings(self) -> int:
        """Number of loadings: parameters of correlation, in which the penalties are not linear."""
        return sum(len(size) * (len(size) - 1) // 2 for size in self.scales.values())

    def loaded(self, x: FloatArray) -> PenaltyStack:
        """Return the stack with new loadings of its correlated effects.

        Parameters
        ----------
        x : ndarray (n_loadings,)
            Loadings of all blocks, in units of the ratio of the sizes of the effects' columns.
        """
        terms, remaining = [], x
        for start, matrices in self.terms:
            if start in self.scales:
                size = self.scales[start]
                row, column = np.tril_indices(len(size), -1)
                own_loadings, remaining = remaining[: len(row)], remaining[len(row) :]
                levels = len(matrices[0]) // len(size)
                matrices = correlated_penalties(levels, own_loadings * size[column] / size[row])
            terms.append((start, matrices))
        return PenaltyStack(self.p, terms, self.scales)

    def rotate(self, M: FloatArray, back: bool = False) -> FloatArray:
        """Rotate a vector (p,) or the rows of a matrix (p, q), or rotate them back to the coordinates of the model."""
        rotated = M.copy()
        for block in self.blocks:
            where = slice(block.start, block.stop)
            rotated[where] = (block.rotation if back else block.rotation.T) @ M[where]
        return rotated

    def rotate_both(self, M: FloatArray, back: bool = False) -> FloatArray:
        """Rotate the rows and columns of a crossproduct or covariance (p, p), or rotate them back."""
        return np.ascontiguousarray(self.rotate(self.rotate(M, back).T, back))

    def add_to(self, M: FloatArray, rho: FloatArray) -> FloatArray:
        """Add the penalties with log smoothing parameters `rho` to M (p, p); return the sum."""
        total = M.copy()
        for penalty, r in zip(self.penalties, rho, strict=True):
            if penalty.diagonal is not None:
                index = np.arange(penalty.where.start, penalty.where.stop)
                total[index, index] += np.exp(r) * penalty.diagonal
            else:
                total[penalty.where, penalty.where] += np.exp(r) * penalty.matrix
        return total

    def log_determinant(self, rho: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log|S|+, its gradient (M,) and its Hessian (M, M) in `rho`."""
        value, gradient, hessian = 0.0, np.zeros(self.size), np.zeros((self.size, self.size))
        for block, index in zip(self.blocks, self.members, strict=True):
            v, g, h = block.log_determinant(rho[index])
            value += v
            gradient[index] = g
            hessian[np.ix_(index, index)] = h
        return value, gradient, hessian

    def products(self, rho: FloatArray, beta: FloatArray) -> FloatArray:
        """Return lambda_j S_j beta for every penalty j, as the columns of (p, M)."""
        columns = np.zeros((self.p, self.size))
        for j, (penalty, r) in enumerate(zip(self.penalties, rho, strict=True)):
            columns[penalty.where, j] = np.exp(r) * penalty.times(beta[penalty.where])
        return columns

    def traces(self, rho: FloatArray, K: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return lambda_j tr(K S_j) as (M,) and lambda_i lambda_j tr(K S_i K S_j) as (M, M); K is symmetric (p, p)."""
        products = [
            np.exp(r) * penalty.times(K[penalty.where]).T
            for penalty, r in zip(self.penalties, rho, strict=True)
        ]
        single = np.array(
            [np.trace(P[penalty.where]) for P, penalty in zip(products, self.penalties, strict=True)]
        )
        pairs = np.empty((self.size, self.size))
        for i in range(self.size):
            for j in range(i + 1):
                left, right = products[i][self.penalties[j].where], products[j][self.penalties[i].where]
                pairs[i, j] = pairs[j, i] = np.einsum("ab,ba->", left, right)
        return single, pairs
