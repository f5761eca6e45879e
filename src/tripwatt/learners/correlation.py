"""Working correlation of the rows of a group (Liang & Zeger 1986), inverted in closed form: O(rows)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tripwatt.arrays import FloatArray, IntArray

Correlation = Literal["independence", "exchangeable", "ar1"]
LARGEST = {"independence": 0.0, "exchangeable": 0.95, "ar1": 0.99}
"""Largest correlation of each kind; a choice below 1, where the matrix has no inverse."""


class WorkingCorrelation:
    """Working covariance V_i of every group i, inverted in closed form, for rows sorted by group.

    V_i = R_i(rho) / w_i with the weight w_i of the group's rows; R_i is the identity, or has rho off its diagonal
    (exchangeable), or rho^|j - k| (first-order autoregression over the rows of a group in their order).

    Parameters
    ----------
    kind : {"independence", "exchangeable", "ar1"}
        Structure of R_i.
    codes : ndarray of shape (n_rows,)
        Group of each row, ascending.
    weight : ndarray of shape (n_rows,)
        Weight of each row, constant within a group; 0 leaves the group out.

    Examples
    --------
    >>> codes = np.array([0, 0, 1])
    >>> working = WorkingCorrelation("exchangeable", codes, np.ones(3))
    >>> working.rho = 0.5
    >>> working.solve(np.array([1.0, 0.0, 1.0])).round(3)
    array([ 1.333, -0.667,  1.   ])
    """

    def __init__(self, kind: Correlation, codes: IntArray, weight: FloatArray) -> None:
        self.kind = kind
        self.codes = codes
        self.weight = weight
        self.rho = 0.0
        self.sizes = np.bincount(codes)
        together = np.concatenate(([False], codes[1:] == codes[:-1], [False]))
        self.pair = together[
            1:-1
        ]  # whether a row, from the second on, is of the same group as the one before
        self.neighbours = together[1:].astype(np.int64) + together[:-1]  # of a row in its group: 0, 1 or 2

    def estimate(self, residual: FloatArray) -> None:
        """Set rho to its moment estimate from the current residuals, between 0 and `LARGEST`."""
        if self.kind == "independence":
            return
        weighted = self.weight * residual
        total = float((weighted * residual).sum())
        if self.kind == "ar1":
            pairs = float((weighted[1:] * residual[:-1])[self.pair].sum())
            share = self.weight[1:][self.pair].sum() / max(self.weight.sum(), 1e-300)
        else:
            sums, squares = np.bincount(self.codes, weighted), np.bincount(self.codes, weighted * residual)
            plain_sums = np.bincount(self.codes, residual)
            several = self.sizes > 1
            pairs = float(((sums * plain_sums - squares)[several] / (self.sizes[several] - 1)).sum())
            share = self.weight[several[self.codes]].sum() / max(self.weight.sum(), 1e-300)
        rho = pairs / (total * share) if total * share > 0 else 0.0
        self.rho = float(np.clip(rho, 0.0, LARGEST[self.kind]))

    def _group_shrinkage(self) -> FloatArray:
        """Rho / (1 + (n_i - 1) rho) of each group."""
        return np.asarray(self.rho / (1.0 + (self.sizes - 1) * self.rho))

    def solve(self, residual: FloatArray) -> FloatArray:
        """Compute V^-1 r for the residuals r, in one pass over the rows."""
        weighted = self.weight * residual
        if self.kind == "independence" or self.rho == 0.0:
            return weighted
        if self.kind == "exchangeable":
            sums = np.bincount(self.codes, weighted)
            return np.asarray((weighted - (self._group_shrinkage() * sums)[self.codes]) / (1.0 - self.rho))
        result = self._ar1_diagonal() * weighted
        result[1:][self.pair] -= self.rho * weighted[:-1][self.pair]
        result[:-1][self.pair] -= self.rho * weighted[1:][self.pair]
        return np.asarray(result / (1.0 - self.rho**2))

    def _ar1_diagonal(self) -> FloatArray:
        return np.asarray(np.array([1.0 - self.rho**2, 1.0, 1.0 + self.rho**2])[self.neighbours])

    def leaf_values(self, leaf: IntArray, gradient: FloatArray) -> FloatArray:
        """Solve Z' V^-1 Z b = Z' g for the indicators Z of the leaves, shape (n_leaves,); a leaf without weight has the score itself."""
        n_leaves = int(leaf.max()) + 1
        score = np.bincount(leaf, gradient, n_leaves)
        if self.kind == "independence" or self.rho == 0.0:
            weight = np.bincount(leaf, self.weight, n_leaves)
            return np.asarray(score / np.where(weight > 0, weight, 1.0))
        normal = self.normal_matrix(leaf, n_leaves)
        normal += np.diag(np.diag(normal) <= 0)
        return np.asarray(np.linalg.solve(normal, score))

    def normal_matrix(self, leaf: IntArray, n_leaves: int) -> FloatArray:
        """Compute Z' V^-1 Z for the indicators Z of the leaves, shape (n_leaves, n_leaves)."""
        if self.kind == "exchangeable":
            n_groups = self.sizes.size
            in_leaf = np.bincount(self.codes * n_leaves + leaf, minlength=n_groups * n_leaves)
            table = in_leaf.reshape(n_groups, n_leaves).astype(float)
            weight = np.zeros(n_groups)
            weight[self.codes] = self.weight
            diagonal = np.diag((table * weight[:, None]).sum(axis=0))
            shared = (table * (self._group_shrinkage() * weight)[:, None]).T @ table
            return np.asarray((diagonal - shared) / (1.0 - self.rho))
        diagonal = np.diag(np.bincount(leaf, self._ar1_diagonal() * self.weight, n_leaves))
        flat = leaf[1:][self.pair] * n_leaves + leaf[:-1][self.pair]
        cross = np.bincount(flat, self.weight[1:][self.pair], n_leaves**2).reshape(n_leaves, n_leaves)
        return np.asarray((diagonal - self.rho * (cross + cross.T)) / (1.0 - self.rho**2))
