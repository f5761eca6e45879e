"""A model matrix X that is never formed: small tables, and for each row its position in each of them.

Products with X cost a few operations per row and term; crossproducts go chunk by chunk through BLAS (Wood et al.
2017, section 3, has the idea of discrete covariates).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.sparse import csr_array

from tripwatt_gamm.arrays import FloatArray, Index
from tripwatt_gamm.gram import Factor, Gram

CHUNK = 4096
"""Number of rows of X that are formed at a time: a choice that bounds the memory."""


@dataclass(frozen=True)
class IndexedColumns:
    """Columns of X that share an index.

    They are the rows of a table (m, q) at each row's position, times a multiplier for each row (None is 1). The table of
    an effect whose levels are eliminated (see `tripwatt_gamm.gram`) is the identity matrix, as None.
    """

    columns: Index
    table: FloatArray | None
    index: Index
    scale: FloatArray | None = None

    def times(self, beta: FloatArray) -> FloatArray:
        """Multiply the table by the part of `beta` (p, ...) that belongs to its columns."""
        own = beta[self.columns]
        return own if self.table is None else np.asarray(self.table @ own)

    @property
    def multiplier(self) -> FloatArray:
        """Multiplier (n,) of each row."""
        return np.ones(len(self.index)) if self.scale is None else self.scale

    def indicators(self, rows: slice) -> csr_array:
        """Return some rows of an effect's columns, as a sparse matrix."""
        values, index = self.multiplier[rows], self.index[rows]
        return csr_array((values, index, np.arange(len(index) + 1)), shape=(len(index), len(self.columns)))


@dataclass(frozen=True)
class Whitening:
    """Map of autocorrelated rows v_t of a group to (v_t - rho v_(t-1)) / sqrt(1 - rho^2); first rows stay as they are.

    Attributes
    ----------
    previous : ndarray (n,)
        Number of the preceding row of the same group; -1 for the first row of a group.
    rho : float
        Correlation of successive rows.
    """

    previous: Index
    rho: float

    @property
    def weights(self) -> tuple[FloatArray, FloatArray]:
        """Weights (n,) of each row and of the row before it."""
        root, first = math.sqrt(1 - self.rho**2), self.previous < 0
        return np.where(first, 1.0, 1 / root), np.where(first, 0.0, -self.rho / root)

    @property
    def log_jacobian(self) -> float:
        """Log determinant of the map."""
        return -float((self.previous >= 0).sum()) / 2 * math.log(1 - self.rho**2)

    def values(self, v: FloatArray) -> FloatArray:
        """Whiten a vector (n,)."""
        now, before = self.weights
        return np.asarray(now * v + before * v[self.previous])

    def rows(self, rows: TableRows) -> TableRows:
        """Whiten the rows of a model matrix."""
        now, before = self.weights
        parts = [*rows.scaled(now).parts, *rows.subset(self.previous).scaled(before).parts]
        return TableRows(parts, rows.n, rows.p)


def previous_rows(groups: Index) -> Index:
    """Return the number of the preceding row of the same group for each row (n,); -1 for the first of a group."""
    rows = pd.Series(np.arange(len(groups), dtype=np.intp))
    return rows.groupby(groups).shift(fill_value=-1).to_numpy()


class TableRows:
    """A model matrix X made of parts, with all products that fitting needs; no (n, p) array is formed.

    Parameters
    ----------
    parts : list of IndexedColumns
        Those of eliminated levels share their index, and their columns are the last ones.
    n, p : int
        Rows and columns.
    """

    def __init__(self, parts: list[IndexedColumns], n: int, p: int) -> None:
        self.parts, self.n, self.p = parts, n, p
        self.effects = [part for part in parts if part.table is None]
        self.d = p - sum(len(part.columns) for part in self.effects)

    def subset(self, rows: Index, columns: Index | None = None) -> TableRows:
        """Return some rows, in the given order, and some columns."""
        columns = np.arange(self.p) if columns is None else columns
        position, parts = np.full(self.p, -1), []
        position[columns] = np.arange(len(columns))
        for part in self.parts:
            wanted = position[part.columns] >= 0
            if wanted.any():
                table = None if part.table is None else part.table[:, wanted]
                scale = None if part.scale is None else part.scale[rows]
                own = position[part.columns[wanted]]
                parts.append(IndexedColumns(own, table, part.index[rows], scale))
        return TableRows(parts, len(rows), len(columns))

    def scaled(self, factor: FloatArray) -> TableRows:
        """Return the rows, each times its factor (n,)."""
        parts = [replace(part, scale=factor * part.multiplier) for part in self.parts]
        return TableRows(parts, self.n, self.p)

    def predictor(self, beta: FloatArray) -> FloatArray:
        """X beta for beta (p,) or (p, part)."""
        total = np.zeros((self.n, *beta.shape[1:]))
        for part in self.parts:
            piece = np.take(part.times(beta), part.index, axis=0)
            if part.scale is not None:
                piece *= part.scale if beta.ndim == 1 else part.scale[:, None]
            total += piece
        return total

    def rmatvec(self, v: FloatArray) -> FloatArray:
        """X' v for v (n,) or (n, k)."""
        if v.ndim == 2:
            return np.stack([self.rmatvec(np.ascontiguousarray(column)) for column in v.T], axis=1)
        total = np.zeros(self.p)
        for part in self.parts:
            weights = v if part.scale is None else v * part.scale
            count = len(part.columns if part.table is None else part.table)
            sums = np.bincount(part.index, weights=weights, minlength=count)
            total[part.columns] += sums if part.table is None else part.table.T @ sums
        return total

    def dense(self, rows: slice | Index) -> FloatArray:
        """Return rows of X as an array, without the columns of eliminated levels."""
        first = self.parts[0].index[rows]
        X = np.zeros((len(first), self.d))
        for part in self.parts:
            if part.table is None:
                continue
            piece = np.take(part.table, part.index[rows], axis=0)
            if part.scale is not None:
                piece *= part.scale[rows][:, None]
            contiguous = len(part.columns) and part.columns[-1] - part.columns[0] + 1 == len(part.columns)
            at = slice(part.columns[0], part.columns[-1] + 1) if contiguous else part.columns
            X[:, at] += piece
        return X

    def _chunks(self) -> list[slice]:
        return [slice(start, min(start + CHUNK, self.n)) for start in range(0, self.n, CHUNK)]

    def gram(self, weights: FloatArray | None = None) -> Gram:
        """X' W X with the diagonal `weights` of W, by default 1."""
        count = len(self.effects[0].columns) if self.effects else 0
        corner, border = np.zeros((self.d, self.d)), np.zeros((self.p - self.d, self.d))
        blocks = np.zeros((len(self.effects), len(self.effects), count))
        for a, b in np.ndindex(blocks.shape[:2]):
            products = self.effects[a].multiplier * self.effects[b].multiplier
            products = products if weights is None else products * weights
            blocks[a, b] = np.bincount(self.effects[a].index, weights=products, minlength=count)
        for rows in self._chunks():
            X = self.dense(rows)
            WX = X if weights is None else weights[rows, None] * X
            corner += WX.T @ X
            for a, effect in enumerate(self.effects):
                border[a * count : (a + 1) * count] += effect.indicators(rows).T @ WX
        return Gram(corner, np.ascontiguousarray(border.T), blocks)

    def leverage(self, factor: Factor) -> FloatArray:
        """Diagonal (n,) of X K X', with the inverse K = `factor`."""
        leverages = np.empty(self.n)
        for rows in self._chunks():
            projected = self.dense(rows) @ factor.root[: self.d]
            for effect in self.effects:
                projected += effect.indicators(rows) @ factor.root[effect.columns]
            leverages[rows] = np.einsum("ij,ij->i", projected, projected)
        for a, b in np.ndindex(factor.blocks.shape[:2]):
            products = self.effects[a].multiplier * self.effects[b].multiplier
            leverages += products * factor.blocks[a, b, self.effects[a].index]
        return leverages
