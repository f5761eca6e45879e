"""Grown trees as plain arrays for stored models; their sum is evaluated with NumPy only.

Trees of LightGBM are read from its documented text format. The sum over trees is bit-identical to LightGBM's: the same
comparisons, and the same values added in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import Fault, InvalidInput, raise_faults

_DEFAULT_LEFT, _MISSING = 2, 12
_ZERO_IS_MISSING = 4
_FIELDS: Final = ("split_feature", "threshold", "decision", "left", "right", "leaf_value")


@dataclass(frozen=True, eq=False)
class TreeTable:
    """Trees with numeric splits as arrays; smaller trees are padded.

    Attributes
    ----------
    split_feature, threshold, decision : ndarray, shape (trees, splits)
        Column, threshold and LightGBM's decision bits of each split.
    left, right : ndarray of int, shape (trees, splits)
        Index of the next split, or ``-1 - leaf``.
    leaf_value : ndarray, shape (trees, leaves)
        Value of each leaf.

    Raises
    ------
    InvalidInput
        If the arrays do not make trees: if they have a wrong shape or type, are not finite, or a split does not lead to a later
        split or a leaf of its tree, so that a row might never reach a leaf.
    """

    split_feature: IntArray
    threshold: FloatArray
    decision: IntArray
    left: IntArray
    right: IntArray
    leaf_value: FloatArray

    def __post_init__(self) -> None:
        raise_faults(self._faults())

    def __len__(self) -> int:
        return len(self.leaf_value)

    @classmethod
    def from_text(cls, text: str, n_trees: int) -> Self:
        """Read the first `n_trees` trees of a model in LightGBM's text format. O(trees x leaves).

        Raises
        ------
        InvalidInput
            If the text has fewer trees, or a tree splits on levels or has linear leaves.
        """
        trees = [_fields(block) for block in text.split("\nTree=")[1 : n_trees + 1]]
        if len(trees) < n_trees:
            raise InvalidInput.of("too few trees", "LightGBM text", str(len(trees)), str(n_trees))
        if any(int(t.get("num_cat", "0")) or int(t.get("is_linear", "0")) for t in trees):
            raise InvalidInput.of("trees cannot be stored", "LightGBM text", "levels", "numeric splits")
        splits = max([1, *(len(t.get("split_feature", "").split()) for t in trees)])
        arrays: dict[str, npt.NDArray[Any]] = {}
        sources = ("split_feature", "threshold", "decision_type", "left_child", "right_child", "leaf_value")
        for name, source in zip(_FIELDS, sources, strict=True):
            kind = np.float64 if name in ("threshold", "leaf_value") else np.int64
            width = splits + (name == "leaf_value")
            # a lone leaf is stored as a split with leaf 0 on both sides
            arrays[name] = np.full((n_trees, width), -1 if name in ("left", "right") else 0, dtype=kind)
            for row, tree in enumerate(trees):
                values = tree.get(source, "").split()
                arrays[name][row, : len(values)] = [kind(v) for v in values]
        return cls(**arrays)

    def _faults(self) -> Iterator[Fault]:
        """Yield every reason why the arrays are not trees. O(splits)."""
        shape = self.split_feature.shape
        # a forest of 500 trees of 255 leaves has 127,000 splits; the splits of a tree bound the steps to a leaf
        if len(shape) != 2 or not (1 <= shape[1] <= 20_000 and self.split_feature.size <= 5_000_000):
            yield Fault("wrong shape of trees", "trees, split_feature", f"{shape}", "(trees, splits)")
            return
        for name in _FIELDS:
            values = getattr(self, name)
            expected = (shape[0], shape[1] + (name == "leaf_value"))
            kinds = "f" if name in ("threshold", "leaf_value") else "i"
            if values.shape != expected or values.dtype.kind != kinds:
                got = f"{values.dtype} of shape {values.shape}"
                allowed = f"{'float' if kinds == 'f' else 'int'} of shape {expected}"
                yield Fault("wrong shape of trees", f"trees, {name}", got, allowed)
            elif kinds == "f" and not np.isfinite(values).all():
                yield Fault("not a finite number", f"trees, {name}", "nan or inf", "finite numbers")
            elif name in ("left", "right"):
                # a child that is a split comes later than its parent, so that every path ends
                place = np.arange(shape[1])
                outside = (values < -1 - shape[1]) | (values >= shape[1])
                if (outside | ((values >= 0) & (values <= place))).any():
                    yield Fault("split leads back", f"trees, {name}", "a cycle", "a later split or a leaf")
            elif name == "split_feature" and (values < 0).any():
                yield Fault("wrong column of a split", f"trees, {name}", f"{values.min()}", "0 or more")

    @cached_property
    def _nodes(self) -> tuple[npt.NDArray[Any], ...]:
        """Roots; columns and thresholds of all splits; and where each node leads, to the right and to the left.

        The nodes are the splits of all trees, then their leaves, which lead to themselves. Each column has four versions, by what counts
        as missing and by where a missing value goes.
        """
        tree, splits = np.arange(len(self))[:, None], self.split_feature.shape[1]
        missing = self.decision & _MISSING
        # a missing value goes the default way of its split, and counts as zero at a split that has none
        left_if_missing = np.where(missing > 0, (self.decision & _DEFAULT_LEFT) > 0, self.threshold >= 0.0)
        columns = 4 * self.split_feature + 2 * (missing == _ZERO_IS_MISSING) + left_if_missing
        leaf = self.split_feature.size + (splits + 1) * tree - 1
        ways = [np.where(to < 0, leaf - to, splits * tree + to) for to in (self.right, self.left)]
        leaves = np.repeat(self.split_feature.size + np.arange(self.leaf_value.size), 2)
        # any index of a leaf takes the last threshold, which no value exceeds
        return splits * tree, columns, np.append(self.threshold, np.inf), np.append(np.dstack(ways), leaves)

    def sum(self, X: FloatArray) -> FloatArray:
        """Sum of all trees, shape (rows,), for rows of shape (rows, columns). O(trees x rows x depth)."""
        if not len(self):
            return np.zeros(len(X))
        node, columns, threshold, ways = self._nodes
        # LightGBM treats values up to this size as zero
        masks = np.isnan(X.T), ~(np.abs(X.T) > 1e-35)
        cells = np.stack([np.where(mask, end, X.T) for mask in masks for end in (np.inf, -np.inf)], axis=1)
        rows, first = np.arange(len(X)), columns * len(X)
        while np.isfinite(limit := threshold.take(node, mode="clip")).any():
            value = cells.take(first.take(node, mode="clip") + rows)
            node = ways.take(2 * node + (value <= limit))
        # a running sum adds tree after tree; a plain sum may add in pairs
        return np.asarray(np.cumsum(self.leaf_value.take(node - self.split_feature.size), axis=0)[-1])


def _fields(block: str) -> dict[str, str]:
    """Parse the `key=value` lines of one tree."""
    pairs = (line.split("=", 1) for line in block.split("\n\n")[0].splitlines()[1:] if "=" in line)
    return dict(pairs)
