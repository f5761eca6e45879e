"""Cross-validation: each item is predicted by a fit without the item's fold.

Protocols, the inner folds of a fit and the evaluation of fleets use this module to hold trips out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import IntArray

TRAINING_ONLY: Final = -1
"""Fold of an item that is only used for fitting."""


@dataclass(frozen=True, eq=False, slots=True)
class Split:
    """Items that a model is fitted on, and items that it is scored on.

    Attributes
    ----------
    number : int
        Number of the split within a hold-out; the fold for `leave_one_out`.
    train, test : ndarray of int
        Indices of items, ascending.
    draw : int
        Number of the random draw; 0 if nothing is drawn.
    """

    number: int
    train: IntArray
    test: IntArray
    draw: int = 0


def deal_folds(n: int, n_folds: int, rng: np.random.Generator) -> IntArray:
    """Assign n items at random to folds of nearly equal size; returns the fold of each item, shape (n,).

    Examples
    --------
    >>> np.bincount(deal_folds(7, 3, np.random.default_rng(0))).tolist()
    [3, 2, 2]
    """
    return np.asarray(rng.permutation(np.arange(n) % min(n, n_folds)), dtype=np.int64)


def leave_one_out(folds: IntArray) -> tuple[Split, ...]:
    """Make one split per fold: the fold is scored after a fit to all other items.

    Examples
    --------
    >>> [(s.number, s.train.tolist(), s.test.tolist()) for s in leave_one_out(np.array([2, TRAINING_ONLY, 5, 2]))]
    [(2, [1, 2], [0, 3]), (5, [0, 1, 3], [2])]
    """
    numbers = np.unique(folds[folds != TRAINING_ONLY]).tolist()
    return tuple(Split(k, np.flatnonzero(folds != k), np.flatnonzero(folds == k)) for k in numbers)
