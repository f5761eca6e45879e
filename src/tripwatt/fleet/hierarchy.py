"""The mixed model of a fleet: fleet, car model, vehicle, driver and trip, exact from sums of trips.

The residual energy of a trip is linear in known features `x` with the weights of its group,

    y_i = x_i' (w + d_model + d_vehicle + d_driver) + e_i,   e_i ~ N(0, lambda n_i),
    w ~ N(0, W),  d_model ~ N(0, D_m),  d_vehicle ~ N(0, D_v),  d_driver ~ N(0, D_d),

with diagonal prior variances, one scale for each level and group of features; the mixed model of `hybrid`, with the same
reading of its levels: what is not known of a vehicle is that of its car model (partial pooling; Gelman et al., Bayesian
Data Analysis, chapters 5 and 15). The groups form a tree, so the posterior is exact by one pass to the root and one back:
a node passes on what its trips say of its parent's weights as an information matrix and vector (Lauritzen 1996, section
6.2.3). A node needs only X' N^-1 X, X' N^-1 y and y' N^-1 y of its trips. The scales are at the maximum of the marginal
likelihood, which the pass to the root gives as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import Fault, InvalidInput
from tripwatt.fleet.features import SPLIT
from tripwatt.fleet.statistics import NO_DRIVER, Sums

LEVELS: Final = ("fleet", "car_model", "vehicle", "driver")

FLEET_SD: Final = 3.0
"""Prior standard deviation of the fleet's own weights, in units of their usual size."""

START: Final = (0.5, 0.5, 0.3)
"""Where the search of the scales of car models, vehicles and drivers starts."""

LOG_SD: Final = 1.5
"""Of the log-normal prior of each scale around its start: one car model carries no information on how models differ."""


@dataclass(frozen=True, slots=True)
class Scales:
    """Prior standard deviations of the deviations, and the variance of a trip.

    Attributes
    ----------
    sds : tuple of tuple of float, shape (3, groups of features)
        Of car models, vehicles and drivers, in units of the weights' usual size.
    noise : float
        Variance of a trip over its usual one.
    """

    sds: tuple[tuple[float, ...], ...]
    noise: float

    def variances(self, level: int, split: IntArray) -> FloatArray:
        """Prior variances at a level of `LEVELS`, shape (features,)."""
        if level == 0:
            return np.full(len(split), FLEET_SD**2)
        return np.asarray(self.sds[level - 1])[split] ** 2


@dataclass(frozen=True, eq=False)
class Tree:
    """The groups of a fleet: node 0 is the fleet; parents come before their children.

    Attributes
    ----------
    names : tuple of tuple of str
        (), (car model,), (car model, vehicle), (car model, vehicle, driver).
    parent : ndarray of int, shape (nodes,)
    level : ndarray of int, shape (nodes,)
    leaf : ndarray of int, shape (groups,)
        Node that holds the trips of each group of sums: the driver, or the vehicle where no driver was logged.
    """

    names: tuple[tuple[str, ...], ...]
    parent: IntArray
    level: IntArray
    leaf: IntArray

    @classmethod
    def from_groups(cls, groups: Sequence[tuple[str, str, str]]) -> Tree:
        """The tree over some groups of sums."""
        paths = [group[:2] if group[2] == NO_DRIVER else group for group in groups]
        every = {path[:k] for path in paths for k in range(len(path) + 1)} | {()}
        names = sorted(every, key=lambda name: (len(name), name))
        place = {name: i for i, name in enumerate(names)}
        return cls(
            tuple(names),
            np.array([place[name[:-1]] if name else 0 for name in names], dtype=np.int64),
            np.array([len(name) for name in names], dtype=np.int64),
            np.array([place[path] for path in paths], dtype=np.int64),
        )

    def nodes(self, level: int) -> IntArray:
        """Nodes of a level."""
        return np.flatnonzero(self.level == level)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of the weights of every group.

    Attributes
    ----------
    tree : Tree
    scales : Scales
    mean : ndarray, shape (nodes, features)
        Of the sum of all deviations from the root to the node.
    covariance : ndarray, shape (nodes, features, features)
    split : ndarray of int, shape (features,)
    """

    tree: Tree
    scales: Scales
    mean: FloatArray
    covariance: FloatArray
    split: IntArray

    @cached_property
    def _place(self) -> Mapping[tuple[str, ...], int]:
        return {name: i for i, name in enumerate(self.tree.names)}

    def knows(self, *group: str) -> bool:
        """Whether there were trips of a group: car model, vehicle, driver."""
        return group in self._place

    def weights(
        self, car_model: str | None = None, vehicle_id: str | None = None, driver: str | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Mean and covariance of the weights of a group; what is not known of it is that of the group around it.

        Parameters
        ----------
        car_model, vehicle_id, driver : str, optional
            None, and a name without trips, stand for a new one of the group around it.
        """
        node, depth = 0, 0
        for name in (car_model, vehicle_id, driver):
            found = None if name is None else self._place.get((*self.tree.names[node], name))
            if found is None:
                break
            node, depth = found, depth + 1
        # a new vehicle of a known car model differs from it as vehicles do; drivers, where there are any, add to that
        deeper = range(depth + 1, int(self.tree.level.max()) + 1)
        own = sum((self.scales.variances(level, self.split) for level in deeper), np.zeros(len(self.split)))
        return self.mean[node], self.covariance[node] + np.diag(own)

    def to_arrays(self) -> dict[str, Any]:
        """Plain arrays."""
        padded = [[*name, *[""] * (3 - len(name))] for name in self.tree.names]
        return {
            "names": np.array(padded, dtype=np.str_),
            "depth": self.tree.level,
            "mean": self.mean,
            "covariance": self.covariance,
            "sds": np.array(self.scales.sds),
            "noise": np.array([self.scales.noise]),
            "split": self.split,
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Posterior:
        """Reverse of `to_arrays`."""
        names = [
            tuple(str(n) for n in name[:depth])
            for name, depth in zip(arrays["names"], arrays["depth"], strict=True)
        ]
        place = {name: i for i, name in enumerate(names)}
        parent = np.array([place[name[:-1]] if name else 0 for name in names], dtype=np.int64)
        tree = Tree(tuple(names), parent, arrays["depth"], np.zeros(0, dtype=np.int64))
        sds = tuple(tuple(float(v) for v in row) for row in arrays["sds"])
        return cls(
            tree,
            Scales(sds, float(arrays["noise"][0])),
            arrays["mean"],
            arrays["covariance"],
            arrays["split"],
        )


def posterior(sums: Sums, scales: Scales, split: IntArray = SPLIT) -> Posterior:
    """Posterior of the weights of every group. O(groups x features^3).

    Parameters
    ----------
    sums : Sums
    scales : Scales
    split : ndarray of int, shape (features,)
        Group of each feature.
    """
    tree = Tree.from_groups(sums.groups)
    info, shift, _ = _to_root(tree, sums, scales, split)
    mean, covariance, _ = _from_root(tree, info, shift, scales, split)
    return Posterior(tree, scales, mean, covariance, split)


def _from_root(
    tree: Tree, info: FloatArray, shift: FloatArray, scales: Scales, split: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean and covariance of every node's weights, and the mean square of its own deviations, shape (nodes, features)."""
    p = len(split)
    mean = np.zeros((len(tree.names), p))
    covariance = np.zeros((len(tree.names), p, p))
    square = np.zeros((len(tree.names), p))
    for level in range(len(LEVELS)):
        nodes = tree.nodes(level)
        if not len(nodes):
            continue
        prior = scales.variances(level, split)
        # deviation of the node given its parent's weights: precision S = 1 / prior + info
        inverse = np.linalg.inv(info[nodes] + np.diag(1.0 / np.maximum(prior, _TINY)))
        if level == 0:
            mean[0], covariance[0] = inverse[0] @ shift[0], inverse[0]
            continue
        around, spread = mean[tree.parent[nodes]], covariance[tree.parent[nodes]]
        # w_node = w_parent + d with d | w_parent ~ N(S^-1 (shift - info w_parent), S^-1)
        gain = inverse @ info[nodes]
        deviation = ((inverse @ shift[nodes][:, :, None]) - gain @ around[:, :, None])[:, :, 0]
        by_parent = gain @ spread
        mean[nodes] = around + deviation
        own = inverse + by_parent @ np.swapaxes(gain, 1, 2)
        covariance[nodes] = spread + own - by_parent - np.swapaxes(by_parent, 1, 2)
        square[nodes] = deviation**2 + np.diagonal(own, axis1=1, axis2=2)
    return mean, 0.5 * (covariance + np.swapaxes(covariance, 1, 2)), square


def log_likelihood(sums: Sums, scales: Scales, split: IntArray = SPLIT) -> float:
    """Logarithm of the marginal likelihood of all trips. O(groups x features^3)."""
    return _to_root(Tree.from_groups(sums.groups), sums, scales, split)[2]


def log_likelihood_gradient(
    tree: Tree, sums: Sums, scales: Scales, split: IntArray = SPLIT
) -> tuple[float, FloatArray]:
    """The marginal likelihood's logarithm, and its derivatives by those of the scales. O(groups x features^3).

    By Fisher's identity the derivative is the posterior mean of that of the complete data: by the logarithm of a standard
    deviation ``s``, the sum over deviations of ``E[d^2] / s^2 - 1``; by that of the trips' variance, half of the expected
    residual sum of squares over it less the number of trips (McLachlan and Krishnan, The EM Algorithm and Extensions,
    section 3.8).

    Parameters
    ----------
    tree : Tree
        Of the groups of `sums`.
    sums : Sums
    scales : Scales
    split : ndarray of int, shape (features,)

    Returns
    -------
    value : float
    gradient : ndarray, shape (3 * groups of features + 1,)
        By `Scales.sds`, row by row, and by `Scales.noise`.
    """
    info, shift, value = _to_root(tree, sums, scales, split)
    mean, covariance, square = _from_root(tree, info, shift, scales, split)
    parts = len(scales.sds[0])
    slopes = np.zeros((3, parts))
    for level in (1, 2, 3):
        nodes = tree.nodes(level)
        excess = square[nodes].sum(axis=0) / scales.variances(level, split) - len(nodes)
        np.add.at(slopes[level - 1], split, excess)
    m, C = mean[tree.leaf], covariance[tree.leaf]
    fit = (sums.xx * (C + m[:, :, None] * m[:, None, :])).sum() - 2.0 * (sums.xy * m).sum()
    by_noise = 0.5 * (float(sums.yy.sum() + fit) / scales.noise - float(sums.count.sum()))
    return value, np.append(slopes.ravel(), by_noise)


_TINY: Final = 1e-12


def _to_root(tree: Tree, sums: Sums, scales: Scales, split: IntArray) -> tuple[FloatArray, FloatArray, float]:
    """Information of the trips under each node about the node's own weights, and the marginal likelihood."""
    p = len(split)
    noise = scales.noise
    info = np.zeros((len(tree.names), p, p))
    shift = np.zeros((len(tree.names), p))
    np.add.at(info, tree.leaf, sums.xx / noise)
    np.add.at(shift, tree.leaf, sums.xy / noise)
    count = float(sums.count.sum())
    total = -0.5 * (
        count * np.log(2.0 * np.pi * noise) + float(sums.log_variance.sum()) + float(sums.yy.sum()) / noise
    )
    for level in range(len(LEVELS) - 1, -1, -1):
        nodes = tree.nodes(level)
        if not len(nodes):
            continue
        root = np.sqrt(np.maximum(scales.variances(level, split), _TINY))
        # d = root z with z ~ N(0, 1): K = 1 + root info root is well conditioned
        scaled = root[:, None] * info[nodes] * root
        K = scaled + np.eye(p)
        factor = np.linalg.cholesky(K)
        b = (shift[nodes] * root)[:, :, None]
        solved = np.linalg.solve(K, b)
        total += 0.5 * float((b * solved).sum()) - float(np.log(np.diagonal(factor, axis1=1, axis2=2)).sum())
        if level:
            # integrating the node out: info - info root K^-1 root info = root^-1 (1 - K^-1) root^-1
            inner = np.linalg.solve(K, np.swapaxes(info[nodes] * root, 1, 2))
            passed = info[nodes] - (info[nodes] * root) @ inner
            given = shift[nodes] - np.einsum("nij,nj->ni", info[nodes] * root, solved[:, :, 0])
            np.add.at(info, tree.parent[nodes], 0.5 * (passed + np.swapaxes(passed, 1, 2)))
            np.add.at(shift, tree.parent[nodes], given)
    return info, shift, total


def fit_scales(sums: Sums, split: IntArray = SPLIT, start: Scales | None = None) -> Scales:
    """Scales at the maximum of the marginal likelihood, with weak priors around their starts.

    Parameters
    ----------
    sums : Sums
    split : ndarray of int, shape (features,)
    start : Scales, optional
        Where the search starts.

    Raises
    ------
    InvalidInput
        Without a trip.
    """
    from scipy.optimize import minimize

    if not sums.count.sum():
        raise InvalidInput(Fault("no trips", "fleet", "0", "at least one trip with measured energy"))
    parts = int(split.max()) + 1
    usual = np.log(np.append(np.repeat(START, parts), 1.0))
    first = usual if start is None else np.log(np.append(np.array(start.sds).ravel(), start.noise))

    def scales(logs: FloatArray) -> Scales:
        values = np.exp(logs)
        sds = values[:-1].reshape(3, parts)
        return Scales(tuple(tuple(float(v) for v in row) for row in sds), float(values[-1]))

    tree = Tree.from_groups(sums.groups)

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = log_likelihood_gradient(tree, sums, scales(logs), split)
        pull = np.append((logs[:-1] - usual[:-1]) / LOG_SD, 0.0)
        return -value + 0.5 * float(pull @ pull), pull / LOG_SD - gradient

    bounds = [(u - 6.0, u + 4.0) for u in usual[:-1]] + [(-12.0, 12.0)]
    options = {"maxiter": 60, "ftol": 1e-10}
    found = minimize(cost, first, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return scales(np.asarray(found.x))
