"""Quadratic penalties of a model, rotated so that unpenalised directions have exactly zero entries.

Each block of coefficients is rotated to the eigenvectors of its summed penalty. A single penalty becomes diagonal.
Several penalties share one range space, in which log|S|+ is exact for smoothing parameters of any ratio
(Wood 2011, appendix B).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import eigh, lapack

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.gram import Factor, Gram

RANK_TOLERANCE = 1e-12
"""Relative size of an eigenvalue of a penalty up to which its direction is unpenalised, and of an entry up to which it is
rounding: a choice, some thousand times the working precision. Tensor products have true eigenvalues of 1e-10."""

LOG_RATIO = (-31.0, 22.0)
"""Bounds of log(smoothing parameter), relative to the value at which penalty and data have equal weight: beyond them, 3e-14 and
1e10, one of the two is lost in rounding."""

MAX_CORRELATED = 14.0
"""Upper bound for correlated effects, whose penalties overlap: beyond it the smaller penalty is lost in rounding."""


@dataclass(frozen=True)
class PenaltyBlock:
    """Penalties of one term in the rotated coordinates of its block.

    Attributes
    ----------
    start, stop : int
        Coefficients of the block.
    copies : int
        The block has m times this number of coefficients: each of the m from all copies, the levels of a factor, one after
        the other. Penalties of several copies sum to a matrix of full rank. The following are those of one copy.
    rank : int
        Dimension of the range space: the first `rank` rotated coefficients.
    rotation : ndarray (m, m)
        Original = rotation @ rotated; the identity for several copies.
    matrices : list of ndarray (rank, rank)
        Penalties in the range space.
    roots : list of ndarray (r, rank)
        Matrices of full row rank whose crossproducts are the penalties.
    sizes : ndarray (m,) or None
        Root mean squares of the columns of correlated effects.
    """

    start: int
    stop: int
    copies: int
    rank: int
    rotation: FloatArray
    matrices: list[FloatArray]
    roots: list[FloatArray]
    sizes: FloatArray | None = None

    @classmethod
    def from_matrices(
        cls, start: int, matrices: list[FloatArray], copies: int = 1, sizes: FloatArray | None = None
    ) -> PenaltyBlock:
        """Rotate the penalties (m, m) of a block that starts at coefficient `start`."""
        total = sum((S / np.linalg.norm(S) for S in matrices), np.zeros_like(matrices[0]))
        values, vectors = eigh((total + total.T) / 2)
        values, vectors = values[::-1], np.eye(len(total)) if copies > 1 else vectors[:, ::-1]
        stop = start + len(total) * copies
        rank = int((values > RANK_TOLERANCE * values[0]).sum())
        U = vectors[:, :rank]
        in_range, roots = [U.T @ (S + S.T) @ U / 2 for S in matrices], []
        for S in in_range:
            # a large smoothing parameter must not carry rounding into directions that other penalties reach
            S[np.abs(S) < RANK_TOLERANCE * np.abs(S).max()] = 0.0
            values, W = eigh(S)
            positive = values > RANK_TOLERANCE * values[-1]
            roots.append(np.sqrt(values[positive])[:, None] * W[:, positive].T)
        return cls(start, stop, copies, rank, vectors, in_range, roots, sizes)

    @cached_property
    def log_single(self) -> float:
        """Log determinant of the only penalty of one copy."""
        return float(np.linalg.slogdet(self.matrices[0])[1])

    def log_determinant(self, rho: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log|S|+, its gradient and its Hessian in the log smoothing parameters `rho` of the block.

        The QR decomposition of the stacked, sorted square roots is stable under scaling of rows.
        """
        n = self.copies
        if len(rho) == 1:
            value = n * (self.rank * float(rho[0]) + self.log_single)
            return value, np.full(1, float(n * self.rank)), np.zeros((1, 1))
        order = np.argsort(-rho)
        stacked = np.vstack([np.exp(rho[j] / 2) * self.roots[j] for j in order])
        # much faster than through `scipy.linalg.qr` for matrices of this size
        R, _, tau, *_ = lapack.dgeqp3(stacked)
        value = 2 * n * float(np.log(np.abs(np.diag(R))).sum())
        Q = lapack.dorgqr(R[:, : len(tau)], tau)[0]
        # the rows of Q that belong to penalty j give lambda_j S_j in the basis in which the sum is the identity
        ends = np.cumsum([0, *(len(self.roots[j]) for j in order)]).tolist()
        pieces = [Q[start:end] for start, end in itertools.pairwise(ends)]
        weighted = [pieces[i].T @ pieces[i] for i in np.argsort(order)]
        gradient = np.array([np.trace(W) for W in weighted])
        hessian = np.diag(gradient) - np.array([[float((A * B).sum()) for A in weighted] for B in weighted])
        return value, n * gradient, n * hessian


def correlated_penalties(loadings: FloatArray, sizes: FloatArray) -> tuple[list[FloatArray], FloatArray]:
    """Build the q penalties (q, q) of the q correlated effects of a level; return them and the remaining loadings.

    The effects of a level are b = L u, with L unit lower triangular and independent u of variances D. Their covariance
    is L D L', and its inverse is the sum of v_j v_j' / D_j over the rows v_j of the inverse of L: one penalty for each
    j.

    Parameters
    ----------
    loadings : ndarray
        The first q (q - 1) / 2 are the lower triangle of L, row by row, in units of the ratio of `sizes`.
    sizes : ndarray (q,)
        Root mean squares of the effects' columns.
    """
    row, column = np.tril_indices(len(sizes), -1)
    L = np.eye(len(sizes))
    L[row, column] = loadings[: len(row)] * sizes[column] / sizes[row]
    return [np.outer(v, v) for v in np.linalg.inv(L)], loadings[len(row) :]


@dataclass(frozen=True)
class Penalty:
    """One penalty in rotated coordinates.

    Attributes
    ----------
    where : slice
        Coefficients that the penalty acts on: r of each copy.
    matrix : ndarray (r, r)
        Penalty of one copy.
    copies : int
    trace : float
        Trace of the penalty; the trace of the crossproduct of `where`, divided by it, is the scale of the smoothing
        parameter.
    log_most : float
        Upper bound of the log smoothing parameter, relative to the log of that scale.
    """

    where: slice
    matrix: FloatArray
    copies: int
    trace: float
    log_most: float

    @cached_property
    def full(self) -> FloatArray:
        """Penalty of all copies, which many eliminated levels never need."""
        return np.asarray(np.kron(self.matrix, np.eye(self.copies)), dtype=np.float64)

    def times(self, M: FloatArray) -> FloatArray:
        """Multiply the penalty by the rows `where` of a vector or a matrix."""
        return np.asarray((self.matrix @ M.reshape(len(self.matrix), -1)).reshape(M.shape))


class PenaltyStack:
    """All penalties of a model with `p` coefficients.

    Parameters
    ----------
    p : int
        Number of coefficients.
    blocks : list of PenaltyBlock

    Examples
    --------
    >>> stack = PenaltyStack(4, [PenaltyBlock.from_matrices(1, [np.diag([2.0, 1.0, 0.0])])])
    >>> stack.size, stack.null_dim
    (1, 2)
    """

    def __init__(self, p: int, blocks: list[PenaltyBlock]) -> None:
        self.p, self.blocks = p, blocks
        self.penalties: list[Penalty] = []
        for block in blocks:
            sizes, inside = block.sizes, slice(block.start, block.start + block.copies * block.rank)
            for j, S in enumerate(block.matrices):
                trace, most = block.copies * float(np.trace(S)), LOG_RATIO[1]
                if sizes is not None:
                    trace, most = block.copies * float(sizes @ sizes) / sizes[j] ** 2, MAX_CORRELATED
                self.penalties.append(Penalty(inside, S, block.copies, trace, most))
        self.size = len(self.penalties)
        self.null_dim = p - sum(block.copies * block.rank for block in blocks)

    @cached_property
    def diagonals(self) -> FloatArray | None:
        """Diagonals of the penalties, as the columns of (p, M); None if a penalty is not diagonal."""
        columns = np.zeros((self.p, self.size))
        for j, penalty in enumerate(self.penalties):
            diagonal = np.diag(penalty.matrix)
            if np.count_nonzero(penalty.matrix) > np.count_nonzero(diagonal):
                return None
            columns[penalty.where, j] = np.repeat(diagonal, penalty.copies)
        return columns

    @property
    def n_loadings(self) -> int:
        """Number of loadings: parameters of correlation, in which the penalties are not linear."""
        sizes = [block.sizes for block in self.blocks if block.sizes is not None]
        return sum(len(size) * (len(size) - 1) // 2 for size in sizes)

    def loaded(self, x: FloatArray) -> PenaltyStack:
        """Return the stack with new loadings of its correlated effects.

        Parameters
        ----------
        x : ndarray (n_loadings,)
            Loadings of all blocks, in units of the ratio of the sizes of the effects' columns.
        """
        blocks, remaining = [], x
        for block in self.blocks:
            if (size := block.sizes) is not None:
                matrices, remaining = correlated_penalties(remaining, size)
                block = PenaltyBlock.from_matrices(block.start, matrices, block.copies, size)
            blocks.append(block)
        return PenaltyStack(self.p, blocks)

    def rotate(self, M: FloatArray, back: bool = False) -> FloatArray:
        """Rotate a vector (p,) or the rows of a matrix (p, q), or rotate them back to the coordinates of the model."""
        rotated = M.copy()
        for block in self.blocks:
            if block.copies == 1:
                where = slice(block.start, block.stop)
                rotated[where] = (block.rotation if back else block.rotation.T) @ M[where]
        return rotated

    def rotate_gram(self, gram: Gram, back: bool = False) -> Gram:
        """Rotate the rows and columns of a crossproduct, or rotate them back; those of levels are not rotated."""
        corner = np.ascontiguousarray(self.rotate(self.rotate(gram.corner, back).T, back))
        return Gram(corner, self.rotate(gram.border, back), gram.blocks)

    def rotate_factor(self, factor: Factor) -> Factor:
        """Rotate an inverse back to the coordinates of the model."""
        return replace(factor, root=self.rotate(factor.root, back=True))

    def _of_levels(self, rho: FloatArray, blocks: FloatArray) -> FloatArray:
        """Return lambda_j S_j of one level for every penalty j, as (M, q, q), for `blocks` of levels (q, q, L)."""
        q, _, count = blocks.shape
        matrices, first = np.zeros((self.size, q, q)), self.p - q * count
        for j, (penalty, r) in enumerate(zip(self.penalties, rho, strict=True)):
            if q and penalty.where.start >= first:
                start = (penalty.where.start - first) // count
                own = slice(start, start + len(penalty.matrix))
                matrices[j, own, own] = np.exp(r) * penalty.matrix
        return matrices

    def add_to(self, gram: Gram, rho: FloatArray) -> Gram:
        """Add the penalties with log smoothing parameters `rho`; return the sum."""
        corner, d = gram.corner.copy(), len(gram.corner)
        if (diagonals := self.diagonals) is not None:
            corner.flat[:: d + 1] += (diagonals @ np.exp(rho))[:d]
        else:
            for penalty, r in zip(self.penalties, rho, strict=True):
                if penalty.where.start < d:
                    corner[penalty.where, penalty.where] += np.exp(r) * penalty.full
        levels = self._of_levels(rho, gram.blocks).sum(axis=0)
        return Gram(corner, gram.border, gram.blocks + levels[:, :, None])

    def log_determinant(self, rho: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log|S|+, its gradient (M,) and its Hessian (M, M) in `rho`."""
        ends = np.cumsum([len(block.matrices) for block in self.blocks], dtype=np.intp)
        value, gradient, hessian, start = 0.0, np.zeros(self.size), np.zeros((self.size, self.size)), 0
        for block, end in zip(self.blocks, ends.tolist(), strict=True):
            own, start = slice(start, end), end
            part, gradient[own], hessian[own, own] = block.log_determinant(rho[own])
            value += part
        return value, gradient, hessian

    def products(self, rho: FloatArray, beta: FloatArray) -> FloatArray:
        """Return lambda_j S_j beta for every penalty j, as the columns of (p, M)."""
        if (diagonals := self.diagonals) is not None:
            return np.asarray(diagonals * np.exp(rho) * beta[:, None])
        columns = np.zeros((self.p, self.size))
        for j, (penalty, r) in enumerate(zip(self.penalties, rho, strict=True)):
            columns[penalty.where, j] = np.exp(r) * penalty.times(beta[penalty.where])
        return columns

    def traces(self, rho: FloatArray, factor: Factor) -> tuple[FloatArray, FloatArray]:
        """Return lambda_j tr(K S_j) as (M,) and lambda_i lambda_j tr(K S_i K S_j) as (M, M) of the inverse K = `factor`."""
        root, E = factor.root, factor.blocks
        if (diagonals := self.diagonals) is not None and self.p <= 2 * root.shape[1]:
            K, weights = factor.dense(), diagonals * np.exp(rho)
            return np.diag(K) @ weights, weights.T @ (K * K) @ weights
        inner = np.zeros((self.size, root.shape[1], root.shape[1]))
        for j, (penalty, r) in enumerate(zip(self.penalties, rho, strict=True)):
            own = root[penalty.where]
            inner[j] = np.exp(r) * own.T @ penalty.times(own)
        flat = inner.reshape(self.size, root.shape[1] ** 2)
        if not E.size:
            return np.trace(inner, axis1=1, axis2=2), flat @ flat.T
        levels = self._of_levels(rho, E)
        own = root[root.shape[1] :].reshape(*E.shape[1:], root.shape[1])
        # of the product of the roots, only the blocks of the levels meet the inverses of the levels
        both = E + 2 * np.einsum("ald,bld->abl", own, own)
        single = np.trace(inner, axis1=1, axis2=2) + np.einsum("jab,bal->j", levels, E)
        left, right = np.einsum("abl,ibc->iacl", E, levels), np.einsum("cdl,jda->jacl", both, levels)
        return single, flat @ flat.T + np.einsum("iacl,jacl->ij", left, right)
