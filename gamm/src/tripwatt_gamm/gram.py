"""Crossproducts of many levels: a dense corner, bordered by levels that have no products with each other.

Coefficients of the levels are eliminated first, level by level; what remains is the Schur complement of the corner
(Golub & Van Loan 2013, Matrix Computations, section 3.2.6). A model without such levels has a corner only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from tripwatt_gamm.arrays import BoolArray, FloatArray, Index


def by_level(blocks: FloatArray, M: FloatArray) -> FloatArray:
    """Multiply the rows (q L, ...) of M, effect by effect, by the matrix of each level in `blocks` (q, q, L)."""
    if not blocks.size:
        return M
    q, _, count = blocks.shape
    product = np.einsum("abl,bl...->al...", blocks, M.reshape(q, count, *M.shape[1:]))
    return np.asarray(product.reshape(M.shape))


def _spread(blocks: FloatArray) -> FloatArray:
    """Matrix (q L, q L) of the matrices of all levels in `blocks` (q, q, L)."""
    q, _, count = blocks.shape
    full = np.zeros((q, count, q, count))
    level = np.arange(count)
    full[:, level, :, level] = np.moveaxis(blocks, 2, 0)
    return full.reshape(q * count, q * count)


@dataclass(frozen=True)
class Gram:
    """Symmetric matrix (p, p) whose last q L coefficients are q effects of L levels, effect by effect.

    Attributes
    ----------
    corner : ndarray (d, d)
        Products of the other coefficients.
    border : ndarray (d, q L)
        Their products with those of the levels.
    blocks : ndarray (q, q, L)
        Products of the effects of each level.
    """

    corner: FloatArray
    border: FloatArray
    blocks: FloatArray

    def __sub__(self, other: Gram) -> Gram:
        """Subtract a matrix of the same levels."""
        return Gram(self.corner - other.corner, self.border - other.border, self.blocks - other.blocks)

    def __mul__(self, factor: float) -> Gram:
        """Multiply by a number."""
        return Gram(self.corner * factor, self.border * factor, self.blocks * factor)

    def __matmul__(self, v: FloatArray) -> FloatArray:
        """Multiply a vector (p,)."""
        first, last = np.split(v, [len(self.corner)])
        lower = self.border.T @ first + by_level(self.blocks, last)
        return np.concatenate([self.corner @ first + self.border @ last, lower])

    @property
    def diagonal(self) -> FloatArray:
        """Diagonal (p,)."""
        return np.concatenate([np.diag(self.corner), np.einsum("aal->al", self.blocks).ravel()])

    def of_columns(self, columns: Index) -> Gram:
        """Select coefficients, those of all levels among them."""
        columns = columns[columns < len(self.corner)]
        return Gram(self.corner[np.ix_(columns, columns)], self.border[columns], self.blocks)

    def without(self, dead: BoolArray) -> Gram:
        """Set the rows and columns of some coefficients (p,) to zero."""
        first, last = np.split(np.where(dead, 0.0, 1.0), [len(self.corner)])
        own = last.reshape(self.blocks.shape[1:])
        corner, border = self.corner * first * first[:, None], self.border * last * first[:, None]
        return Gram(corner, border, self.blocks * own * own[:, None])

    def dense(self) -> FloatArray:
        """Form the matrix (p, p)."""
        return np.block([[self.corner, self.border], [self.border.T, _spread(self.blocks)]])


@dataclass(frozen=True)
class Factor:
    """Inverse of a positive definite `Gram`: ``root @ root.T``, plus the inverse of the block of each level.

    Attributes
    ----------
    root : ndarray (p, d)
    blocks : ndarray (q, q, L)
        Inverses of the blocks of the levels.
    log_determinant : float
        That of the matrix itself.
    """

    root: FloatArray
    blocks: FloatArray
    log_determinant: float

    @classmethod
    def from_gram(cls, A: Gram) -> Factor | None:
        """Factor `A`, its Schur complement scaled to a unit diagonal; None if it is not positive definite in working precision."""
        levels = np.moveaxis(A.blocks, 2, 0)
        try:
            roots = np.linalg.cholesky(levels)
        except np.linalg.LinAlgError:
            return None
        blocks = np.ascontiguousarray(np.moveaxis(np.linalg.inv(levels), 0, 2))
        shift = by_level(blocks, A.border.T)
        schur = A.corner - A.border @ shift
        diagonal = np.diag(schur)
        if not np.all(np.isfinite(diagonal)) or diagonal.min(initial=np.inf) <= 0:
            return None
        d = 1 / np.sqrt(diagonal)
        chol, info = lapack.dpotrf(schur * d * d[:, None], lower=1) if len(d) else (schur, 0)
        if info:
            return None
        root = d[:, None] * (lapack.dtrtri(chol, lower=1)[0].T if len(d) else schur)
        value = np.log(np.diag(chol)).sum() - np.log(d).sum() + np.log(np.einsum("laa->la", roots)).sum()
        return cls(np.vstack([root, -shift @ root]), blocks, 2 * float(value))

    def solve(self, v: FloatArray) -> FloatArray:
        """Multiply the inverse by v (p,) or (p, k)."""
        solution, d = self.root @ (self.root.T @ v), self.root.shape[1]
        solution[d:] += by_level(self.blocks, v[d:])
        return np.asarray(solution)

    @property
    def diagonal(self) -> FloatArray:
        """Diagonal (p,) of the inverse."""
        diagonal = np.einsum("ij,ij->i", self.root, self.root)
        diagonal[self.root.shape[1] :] += np.einsum("aal->al", self.blocks).ravel()
        return np.asarray(diagonal)

    def dense(self) -> FloatArray:
        """Form the inverse (p, p)."""
        inverse, d = self.root @ self.root.T, self.root.shape[1]
        inverse[d:, d:] += _spread(self.blocks)
        return np.asarray(inverse)
