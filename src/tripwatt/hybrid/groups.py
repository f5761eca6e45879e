"""Hierarchical groups of trips (fleet, car model, vehicle, driver): the exact posterior of their weights from sums of trips.

The residual energy of a trip is linear in known features `x` with the weights of its group,

    y_i = x_i' (w + d_model + d_vehicle + d_driver) + e_i,   e_i ~ N(0, lambda n_i),
    w ~ N(0, W),  d_model ~ N(0, D_m),  d_vehicle ~ N(0, D_v),  d_driver ~ N(0, D_d),

with diagonal prior variances, one scale for each level below the root and group of features. Weights that a vehicle's trips do not
determine are those of its car model (partial pooling). The groups form a tree, so one pass to the root and one back give the exact
posterior: each node passes the information of its trips about its parent's weights on as a matrix and a vector (Lauritzen 1996,
section 6.2.3). A node needs only X' N^-1 X, X' N^-1 y and y' N^-1 y of its trips, which add up. The scales are at the maximum of the
marginal likelihood, which the pass to the root also gives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import InvalidInput
from tripwatt.hybrid.rows import Records

ROOT_SD: Final = 3.0
"""Prior standard deviation of the root's own weights, in units of their usual size."""

LOG_SD: Final = 1.5
"""Standard deviation of the log-normal prior of each scale around its usual value: one car model does not show how models differ."""

_TINY: Final = 1e-12
_SUMS: Final = ("count", "log_variance", "xx", "xy", "yy")


@dataclass(frozen=True, eq=False)
class Sums(Records):
    """Additive sums over the trips of each group.

    For the trips of a group with features `X`, residual energies `y` and usual variances `n` (`N` is their diagonal matrix), the sums
    are ``X' N^-1 X``, ``X' N^-1 y`` and ``y' N^-1 y``.

    Attributes
    ----------
    groups : tuple of tuple of str
        Names from the root down, such as car model, vehicle, driver, sorted; "" for last names that are not known.
    count : ndarray, shape (groups,)
        Number of trips.
    log_variance : ndarray, shape (groups,)
        Sum of the logarithms of the usual variances.
    xx : ndarray, shape (groups, features, features)
        ``X' N^-1 X``.
    xy : ndarray, shape (groups, features)
        ``X' N^-1 y``.
    yy : ndarray, shape (groups,)
        ``y' N^-1 y``.

    Examples
    --------
    >>> one = Sums.from_trips([("m", "v", "")], np.ones((1, 1)), np.ones(1), np.ones(1))
    >>> (one + one).count, (one + one).xy.ravel()
    (array([2.]), array([2.]))
    """

    groups: tuple[tuple[str, ...], ...]
    count: FloatArray
    log_variance: FloatArray
    xx: FloatArray
    xy: FloatArray
    yy: FloatArray

    @classmethod
    def empty(cls, features: int, groups: Sequence[tuple[str, ...]] = ()) -> Sums:
        """Make the sums of groups without trips: zeros."""
        n, p = len(groups), features
        return cls(tuple(groups), *(np.zeros(shape) for shape in (n, n, (n, p, p), (n, p), n)))

    @classmethod
    def from_trips(
        cls,
        groups: Sequence[tuple[str, ...]],
        X: FloatArray,
        y: FloatArray,
        n: FloatArray,
    ) -> Sums:
        """Sum up trips that are sorted by group. O(trips x features^2).

        Parameters
        ----------
        groups : sequence of tuple of str
            Group of each trip, sorted.
        X : ndarray, shape (trips, features)
            Energy by each feature [Wh].
        y, n : ndarray, shape (trips,)
            Residual energy [Wh] and usual variance [Wh²].
        """
        if not len(groups):
            return cls.empty(X.shape[1])
        starts = [i for i, group in enumerate(groups) if i == 0 or group != groups[i - 1]]
        root = np.sqrt(1.0 / n)
        X, y = X * root[:, None], y * root
        spans = [slice(a, b) for a, b in pairwise([*starts, len(groups)])]
        return cls(
            tuple(groups[i] for i in starts),
            np.array([float(s.stop - s.start) for s in spans]),
            np.add.reduceat(np.log(n), starts),
            np.array([X[s].T @ X[s] for s in spans]),
            np.array([X[s].T @ y[s] for s in spans]),
            np.array([y[s] @ y[s] for s in spans]),
        )

    def __add__(self, other: Sums) -> Sums:
        return self._merged(other, 1.0)

    def __sub__(self, other: Sums) -> Sums:
        """Subtract the sums of some trips; groups without a trip remain, with zeros."""
        return self._merged(other, -1.0)

    def _merged(self, other: Sums, sign: float) -> Sums:
        groups = sorted({*self.groups, *other.groups})
        place = {group: i for i, group in enumerate(groups)}
        total = Sums.empty(self.xx.shape[1] or other.xx.shape[1], groups)
        for part, factor in ((self, 1.0), (other, sign)):
            index = [place[group] for group in part.groups]
            for name in _SUMS:
                getattr(total, name)[index] += factor * getattr(part, name)
        return total

    def to_arrays(self) -> dict[str, Any]:
        """Return plain arrays."""
        return {"groups": np.array(self.groups, dtype=np.str_), **{n: getattr(self, n) for n in _SUMS}}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Sums:
        """Reverse of `to_arrays`."""
        groups = tuple(tuple(str(name) for name in group) for group in arrays["groups"])
        return cls(groups, *(arrays[name] for name in _SUMS))


@dataclass(frozen=True, slots=True)
class Scales:
    """Prior standard deviations of the groups' deviations, and the scale of the variance of a trip.

    Attributes
    ----------
    sds : tuple of tuple of float, shape (levels below the root, parts)
        Standard deviations of each level, such as car models, vehicles and drivers, in units of the weights' usual size.
    noise : float
        Variance of a trip relative to its usual variance.
    split : tuple of int
        Part that each feature belongs to; the features of a part share one standard deviation per level.
    root : float
        Prior standard deviation of the root's own weights, in units of their usual size.
    """

    sds: tuple[tuple[float, ...], ...]
    noise: float
    split: tuple[int, ...]
    root: float = ROOT_SD

    def variances(self, level: int) -> FloatArray:
        """Prior variances at a level, shape (features,); level 0 is the root."""
        if level == 0:
            return np.full(len(self.split), self.root**2)
        return np.asarray(self.sds[level - 1])[list(self.split)] ** 2

    @property
    def logs(self) -> FloatArray:
        """Logarithms of `sds`, row by row, and of `noise`."""
        return np.asarray(np.log(np.append(np.ravel(self.sds), self.noise)))

    def with_logs(self, logs: FloatArray) -> Scales:
        """Make scales from logarithms in the order of `logs`, for the same features."""
        sds = np.exp(logs[:-1]).reshape(np.shape(self.sds)).tolist()
        return replace(self, sds=tuple(map(tuple, sds)), noise=float(np.exp(logs[-1])))


@dataclass(frozen=True, eq=False)
class Tree:
    """Tree of nested groups: node 0 is the root, such as a fleet; parents come before their children.

    Attributes
    ----------
    names : tuple of tuple of str
        Name of each node from the root down: (), (car model,), (car model, vehicle), (car model, vehicle, driver).
    parent : ndarray of int, shape (nodes,)
        Parent of each node; 0 for the root.
    level : ndarray of int, shape (nodes,)
        Level of each node; 0 for the root.
    leaf : ndarray of int, shape (groups,)
        Node that holds the trips of each group of sums, by the known names of the group.
    """

    names: tuple[tuple[str, ...], ...]
    parent: IntArray
    level: IntArray
    leaf: IntArray

    @classmethod
    def from_groups(cls, groups: Sequence[tuple[str, ...]]) -> Tree:
        """Make the tree over some groups of sums."""
        paths = [tuple(name for name in group if name) for group in groups]
        every = {path[:k] for path in paths for k in range(len(path) + 1)} | {()}
        return cls.from_names(sorted(every, key=lambda name: (len(name), name)), paths)

    @classmethod
    def from_names(cls, names: Sequence[tuple[str, ...]], leaves: Sequence[tuple[str, ...]] = ()) -> Tree:
        """Make the tree of all names, with parents first."""
        place = {name: i for i, name in enumerate(names)}
        numbers = (
            [place[name[:-1]] if name else 0 for name in names],
            [len(name) for name in names],
            [place[name] for name in leaves],
        )
        return cls(tuple(names), *(np.array(values, dtype=np.int64) for values in numbers))

    def nodes(self, level: int) -> IntArray:
        """Indices of the nodes of a level."""
        return np.flatnonzero(self.level == level)


@dataclass(frozen=True, eq=False)
class GroupPosterior:
    """Posterior of the weights of every group.

    Attributes
    ----------
    tree : Tree
    scales : Scales
    mean : ndarray, shape (nodes, features)
        Mean of each node's weights: the sum of all deviations from the root to the node.
    covariance : ndarray, shape (nodes, features, features)
        Covariance of each node's weights.
    """

    tree: Tree
    scales: Scales
    mean: FloatArray
    covariance: FloatArray

    @cached_property
    def _place(self) -> Mapping[tuple[str, ...], int]:
        return {name: i for i, name in enumerate(self.tree.names)}

    def weights(self, *group: str | None) -> tuple[FloatArray, FloatArray]:
        """Mean and covariance of the weights of a group; a group without trips has those of a new member of its parent group.

        Parameters
        ----------
        *group : str or None
            Names from the root down, such as car model, vehicle, driver. None, "" and a name without trips stand for a new member of
            the group before.
        """
        node, depth = 0, 0
        for name in group:
            inner = None if not name else self._place.get((*self.tree.names[node], name))
            if inner is None:
                break
            node, depth = inner, depth + 1
        # a new vehicle of a known car model deviates from the model as vehicles do; drivers, if the tree has any, add to that
        deeper = range(depth + 1, int(self.tree.level.max()) + 1)
        own = sum((self.scales.variances(level) for level in deeper), np.zeros(self.mean.shape[1]))
        return self.mean[node], self.covariance[node] + np.diag(own)

    def to_arrays(self) -> dict[str, Any]:
        """Return plain arrays."""
        depth = max(len(self.scales.sds), 1)
        padded = [[*name, *[""] * (depth - len(name))] for name in self.tree.names]
        return {
            "names": np.array(padded, dtype=np.str_),
            "depth": self.tree.level,
            "mean": self.mean,
            "covariance": self.covariance,
            "sds": np.array(self.scales.sds),
            "noise": np.array([self.scales.noise]),
            "split": np.array(self.scales.split),
            "root": np.array([self.scales.root]),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> GroupPosterior:
        """Reverse of `to_arrays`."""
        names = [
            tuple(str(n) for n in name[:depth])
            for name, depth in zip(arrays["names"], arrays["depth"], strict=True)
        ]
        sds = tuple(tuple(row) for row in arrays["sds"].tolist())
        root = float(arrays.get("root", [ROOT_SD])[0])
        scales = Scales(sds, float(arrays["noise"][0]), tuple(arrays["split"].tolist()), root)
        return cls(Tree.from_names(names), scales, arrays["mean"], arrays["covariance"])


def group_posterior(sums: Sums, scales: Scales) -> GroupPosterior:
    """Posterior of the weights of every group. O(groups x features^3).

    Parameters
    ----------
    sums : Sums
    scales : Scales
    """
    tree = Tree.from_groups(sums.groups)
    info, shift, _ = _to_root(tree, sums, scales)
    mean, covariance, _ = _from_root(tree, info, shift, scales)
    return GroupPosterior(tree, scales, mean, covariance)


def _from_root(
    tree: Tree, info: FloatArray, shift: FloatArray, scales: Scales
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean and covariance of every node's weights, and the mean square of its own deviations, shape (nodes, features)."""
    p = len(scales.split)
    mean = np.zeros((len(tree.names), p))
    covariance = np.zeros((len(tree.names), p, p))
    square = np.zeros((len(tree.names), p))
    for level in range(len(scales.sds) + 1):
        nodes = tree.nodes(level)
        if not len(nodes):
            continue
        prior = scales.variances(level)
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


def log_likelihood_gradient(tree: Tree, sums: Sums, scales: Scales) -> tuple[float, FloatArray]:
    """Logarithm of the marginal likelihood, and its gradient with respect to `Scales.logs`. O(groups x features^3).

    By Fisher's identity the derivative is the posterior mean of that of the complete data. With respect to the logarithm of a
    standard deviation ``s``, it is the sum over deviations of ``E[d^2] / s^2 - 1``. With respect to the logarithm of the noise, it is
    half of (expected residual sum of squares / noise - number of trips) (McLachlan and Krishnan, The EM Algorithm and Extensions,
    section 3.8).

    Parameters
    ----------
    tree : Tree
        Tree of the groups of `sums`.
    sums : Sums
    scales : Scales

    Returns
    -------
    value : float
        Logarithm of the marginal likelihood.
    gradient : ndarray, shape (levels below the root * parts + 1,)
        Derivatives with respect to `Scales.logs`.
    """
    info, shift, value = _to_root(tree, sums, scales)
    mean, covariance, square = _from_root(tree, info, shift, scales)
    slopes = np.zeros((len(scales.sds), len(scales.sds[0])))
    for level in range(1, len(scales.sds) + 1):
        nodes = tree.nodes(level)
        excess = square[nodes].sum(axis=0) / scales.variances(level) - len(nodes)
        np.add.at(slopes[level - 1], list(scales.split), excess)
    m, C = mean[tree.leaf], covariance[tree.leaf]
    fit = (sums.xx * (C + m[:, :, None] * m[:, None, :])).sum() - 2.0 * (sums.xy * m).sum()
    by_noise = 0.5 * (float(sums.yy.sum() + fit) / scales.noise - float(sums.count.sum()))
    return value, np.append(slopes.ravel(), by_noise)


def _to_root(tree: Tree, sums: Sums, scales: Scales) -> tuple[FloatArray, FloatArray, float]:
    """Information matrix and vector of the trips under each node about its weights, and the log marginal likelihood."""
    p = len(scales.split)
    noise = scales.noise
    info = np.zeros((len(tree.names), p, p))
    shift = np.zeros((len(tree.names), p))
    np.add.at(info, tree.leaf, sums.xx / noise)
    np.add.at(shift, tree.leaf, sums.xy / noise)
    count = float(sums.count.sum())
    total = -0.5 * (
        count * np.log(2.0 * np.pi * noise) + float(sums.log_variance.sum()) + float(sums.yy.sum()) / noise
    )
    for level in range(len(scales.sds), -1, -1):
        nodes = tree.nodes(level)
        if not len(nodes):
            continue
        root = np.sqrt(np.maximum(scales.variances(level), _TINY))
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


def fit_scales(sums: Sums, usual: Scales, log_sd: FloatArray | float = LOG_SD) -> Scales:
    """Fit the scales by maximum marginal likelihood, with weak priors around their usual values.

    Parameters
    ----------
    sums : Sums
    usual : Scales
        Centre of the priors and start of the search; the noise has no prior.
    log_sd : float or ndarray, shape (levels below the root * parts,)
        Standard deviation of the logarithm of each scale before any trip.

    Raises
    ------
    InvalidInput
        If the sums have no trips.
    """
    from scipy.optimize import minimize

    if not sums.count.sum():
        raise InvalidInput.of("no trips", "fleet", "0", "at least one trip with measured energy")
    tree, first = Tree.from_groups(sums.groups), usual.logs

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = log_likelihood_gradient(tree, sums, usual.with_logs(logs))
        pull = (logs[:-1] - first[:-1]) / log_sd
        return -value + 0.5 * float(pull @ pull), np.append(pull / log_sd, 0.0) - gradient

    bounds = [(u - 6.0, u + 4.0) for u in first[:-1]] + [(-12.0, 12.0)]
    options = {"maxiter": 60, "ftol": 1e-10}
    best = minimize(cost, first, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return usual.with_logs(np.asarray(best.x))
