"""The rounds of boosting by estimating equations: one tree per round, with leaf values solved under V^-1 (see `boosting`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.learners.correlation import WorkingCorrelation
from tripwatt.learners.trees import Sample, Trees


@dataclass
class Path:
    """One run of boosting.

    `values[t]` are the leaf values of round t, and `losses[t]` the loss of each group after this round, NaN for the groups that are
    not scored or whose set has stopped improving. `rho` is the parameter of the working correlation after the last round.
    """

    start: float
    trees: Trees
    values: list[FloatArray] = field(default_factory=list)
    losses: list[FloatArray] = field(default_factory=list)
    rho: float = 0.0


def boost(
    sample: Sample,
    setting: dict[str, Any],
    allowed: BoolArray,
    n_rounds: int,
    seed: int,
    *,
    start: str,
    patience: int = 1,
    scored: Sequence[IntArray] = (),
) -> Path:
    """Boost on the allowed groups.

    Each of the `scored` sets of groups stops if its mean loss has not improved for `patience` rounds; when all have, boosting ends.
    """
    inside = allowed[sample.codes]
    weight = np.where(inside, sample.weight, 0.0)
    y = np.where(inside, sample.y, 0.0)
    path = Path(0.0, sample.grower.start(setting))
    working = WorkingCorrelation(setting["correlation"], sample.codes, weight)
    if start == "mean":
        working.estimate(np.where(inside, y - np.average(y, weights=weight), 0.0))
        single_leaf = np.zeros(y.size, dtype=np.int64)
        path.start = float(working.solve(y).sum() / working.normal_matrix(single_leaf, 1)[0, 0])
    fitted = np.full(y.size, path.start)
    rng = np.random.default_rng([seed, 2])
    best, since_best = np.full(len(scored), np.inf), np.zeros(len(scored))
    for _ in range(n_rounds):
        drawn = rng.random(sample.n_groups) < setting["subsample"]
        tree_seed = int(rng.integers(1, 2**31 - 1))
        residual = np.where(inside, y - fitted, 0.0)
        working.estimate(residual)
        if setting["subsample"] < 1.0 and (drawn & allowed).any():
            working.weight = np.where(drawn[sample.codes], weight, 0.0)
        gradient = working.solve(residual)
        path.trees.grow(gradient, working.weight, tree_seed)
        leaf = path.trees.last_leaves(sample.grower.X)
        path.values.append(setting["learning_rate"] * working.leaf_values(leaf, gradient))
        working.weight = weight
        fitted = fitted + path.values[-1][leaf]
        if scored:
            loss = sample.loss(fitted)
            path.losses.append(np.full(loss.shape, np.nan))
            for k in np.flatnonzero(since_best < patience).tolist():
                path.losses[-1][scored[k]] = own = loss[scored[k]]
                mean = own.mean()
                since_best[k] = 0 if mean < best[k] else since_best[k] + 1
                best[k] = min(best[k], mean)
            if (since_best >= patience).all():
                break
    path.rho = working.rho
    return path
