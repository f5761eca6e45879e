"""The posterior of groups against its dense form: one Gaussian of all trips, and one of all weights."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from tripwatt.errors import InvalidInput
from tripwatt.hybrid.groups import (
    LOG_SD,
    ROOT_SD,
    GroupPosterior,
    Scales,
    Sums,
    Tree,
    fit_scales,
    group_posterior,
    log_likelihood_gradient,
)


def log_likelihood(sums: Sums, scales: Scales) -> float:
    return log_likelihood_gradient(Tree.from_groups(sums.groups), sums, scales)[0]


SPLIT = np.array([0, 0, 1])
SCALES = Scales(((0.7, 0.4), (0.5, 0.9), (0.3, 0.2)), 1.7, (0, 0, 1))
GROUPS = (
    ("a", "v1", ""),
    ("a", "v1", "Ada"),
    ("a", "v2", "Bob"),
    ("b", "v3", ""),
)


def trips(seed=0, count=(3, 2, 4, 5)):
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(len(count)), count)
    X = rng.normal(size=(len(group), 3))
    n = rng.uniform(0.5, 2.0, len(group))
    y = X @ rng.normal(size=3) + rng.normal(size=len(group))
    return group, X, y, n


def sums_of(group, X, y, n, groups=GROUPS):
    w = 1.0 / n
    parts = [np.flatnonzero(group == i) for i in range(len(groups))]
    return Sums(
        tuple(groups),
        np.array([float(len(p)) for p in parts]),
        np.array([np.log(n[p]).sum() for p in parts]),
        np.array([(X[p] * w[p, None]).T @ X[p] for p in parts]),
        np.array([(X[p] * w[p, None]).T @ y[p] for p in parts]),
        np.array([(y[p] * w[p]) @ y[p] for p in parts]),
    )


def dense_covariance(group, X, Z, other):
    """Prior covariance of x'w_g between trips and target weights, by hand: levels that two groups share."""
    shared = np.zeros((len(group), len(other), 3))
    for i, g in enumerate(group):
        for j, h in enumerate(other):
            a = [GROUPS[g][0], GROUPS[g][:2], GROUPS[g]]
            b = [GROUPS[h][0], GROUPS[h][:2], GROUPS[h]]
            v = np.full(3, ROOT_SD**2)
            for level in range(3):
                if a[level] == b[level] and not (level == 2 and GROUPS[g][2] == ""):
                    v = v + np.array(SCALES.sds[level])[SPLIT] ** 2
            shared[i, j] = v
    return np.einsum("ip,ijp,jp->ij", X, shared, Z)


def test_likelihood_and_posterior_are_those_of_one_gaussian():
    group, X, y, n = trips()
    sums = sums_of(group, X, y, n)
    K = dense_covariance(group, X, X, group) + SCALES.noise * np.diag(n)
    dense = multivariate_normal(np.zeros(len(y)), K).logpdf(y)
    assert log_likelihood(sums, SCALES) == pytest.approx(dense, rel=1e-10)
    found = group_posterior(sums, SCALES)
    for g, names in enumerate(GROUPS):
        if names[2] == "" and names[1] == "v1":
            continue  # a trip of v1 without a driver: its drivers' variance is checked below
        targets = np.eye(3)
        cross = dense_covariance(group, X, targets, [g] * 3)
        prior = dense_covariance([g] * 3, targets, targets, [g] * 3)
        gain = np.linalg.solve(K, cross)
        mean, covariance = found.weights(*[name for name in names if name])
        extra = np.diag(np.array(SCALES.sds[2])[SPLIT] ** 2) if names[2] == "" else 0.0
        assert mean == pytest.approx(gain.T @ y, rel=1e-9, abs=1e-12)
        assert covariance - extra == pytest.approx(prior - cross.T @ gain, rel=1e-8, abs=1e-10)


def test_new_groups_take_the_weights_of_those_around_them():
    group, X, y, n = trips()
    found = group_posterior(sums_of(group, X, y, n), SCALES)
    model_mean, model_cov = found.weights("a")
    new_mean, new_cov = found.weights("a", "new")
    assert new_mean.tolist() == model_mean.tolist()
    assert new_cov.tolist() == model_cov.tolist()
    node = found.tree.names.index(("a",))
    own = np.array(SCALES.sds[1])[SPLIT] ** 2 + np.array(SCALES.sds[2])[SPLIT] ** 2
    assert new_cov - found.covariance[node] == pytest.approx(np.diag(own))
    unknown_mean, unknown_cov = found.weights("never seen")
    assert unknown_mean.tolist() == found.mean[0].tolist()
    every = sum(np.array(SCALES.sds[k])[SPLIT] ** 2 for k in range(3))
    assert unknown_cov - found.covariance[0] == pytest.approx(np.diag(every))
    known = found.weights("a", "v2", "Bob")[1]
    assert known.tolist() == found.covariance[found.tree.names.index(("a", "v2", "Bob"))].tolist()
    assert found.weights("a", "v2", "Eve")[0].tolist() == found.weights("a", "v2")[0].tolist()
    assert found.weights(None, "v2")[0].tolist() == found.mean[0].tolist()
    assert ("a", "v1") in found.tree.names
    assert ("a", "v3") not in found.tree.names


def test_without_drivers_no_driver_adds_to_the_variance():
    group, X, y, n = trips(count=(3, 2))
    found = group_posterior(sums_of(group, X, y, n, (("a", "v1", ""), ("a", "v2", ""))), SCALES)
    node = found.tree.names.index(("a", "v1"))
    assert found.weights("a", "v1")[1].tolist() == found.covariance[node].tolist()


def test_sums_merge_and_a_group_without_trips_changes_nothing():
    group, X, y, n = trips()
    half = np.arange(len(y)) % 2 == 0
    whole = sums_of(group, X, y, n)
    parts = [sums_of(group[m], X[m], y[m], n[m]) for m in (half, ~half)]
    merged = parts[0] + parts[1]
    left = whole - parts[1]
    for name in ("count", "log_variance", "xx", "xy", "yy"):
        assert getattr(merged, name) == pytest.approx(getattr(whole, name), rel=1e-12)
        assert getattr(left, name) == pytest.approx(getattr(parts[0], name), rel=1e-10, abs=1e-12)
    with_empty = whole + sums_of(group[:0], X[:0], y[:0], n[:0], (("z", "v9", ""),))
    assert len(with_empty.groups) == 5
    assert log_likelihood(with_empty, SCALES) == pytest.approx(log_likelihood(whole, SCALES), rel=1e-12)
    assert whole.take([2]).groups == (GROUPS[2],)
    assert whole.take([2]).xy.tolist() == [whole.xy[2].tolist()]
    again = Sums.from_arrays(whole.to_arrays())
    assert again.groups == whole.groups
    assert again.xx.tolist() == whole.xx.tolist()
    assert (Sums.empty(3) + whole).yy.tolist() == whole.yy.tolist()


def test_the_tree_puts_parents_first():
    tree = Tree.from_groups(GROUPS)
    assert tree.names[0] == ()
    assert all(tree.parent[i] < i for i in range(1, len(tree.names)))
    assert [tree.names[i] for i in tree.leaf] == [("a", "v1"), GROUPS[1], GROUPS[2], ("b", "v3")]
    assert [len(tree.nodes(level)) for level in range(4)] == [1, 2, 3, 2]


@pytest.mark.parametrize("seed", range(4))
def test_the_gradient_is_that_of_the_likelihood(seed):
    rng = np.random.default_rng(seed)
    sums = sums_of(*trips(seed, count=rng.integers(0, 9, 4)))
    logs = rng.normal(0.0, 0.7, 7)

    def scales(logs):
        sds = np.exp(logs[:6]).reshape(3, 2)
        return Scales(tuple(tuple(row) for row in sds.tolist()), float(np.exp(logs[6])), (0, 0, 1))

    value, gradient = log_likelihood_gradient(Tree.from_groups(sums.groups), sums, scales(logs))
    assert value == pytest.approx(log_likelihood(sums, scales(logs)), rel=1e-12)
    step = 1e-5
    for k, slope in enumerate(gradient):
        up, down = (log_likelihood(sums, scales(logs + sign * step * np.eye(7)[k])) for sign in (1, -1))
        assert slope == pytest.approx((up - down) / (2.0 * step), rel=1e-5, abs=1e-7)


def test_scales_are_found_where_the_likelihood_is_largest():
    rng = np.random.default_rng(3)
    groups = tuple((f"m{i % 6}", f"v{i:03d}", "") for i in range(120))
    groups = tuple(sorted(groups))
    true = {"model": 0.6, "vehicle": 0.25, "noise": 0.5}
    models = {f"m{k}": true["model"] * rng.normal(size=3) for k in range(6)}
    group = np.repeat(np.arange(120), 12)
    X, n = rng.normal(size=(1440, 3)), rng.uniform(0.5, 2.0, 1440)
    own = np.array([models[g[0]] + true["vehicle"] * rng.normal(size=3) for g in groups])
    y = np.einsum("ip,ip->i", X, own[group]) + np.sqrt(true["noise"] * n) * rng.normal(size=1440)
    sums = sums_of(group, X, y, n, groups)
    usual = Scales(((0.5, 0.5), (0.5, 0.5), (0.3, 0.3)), 1.0, (0, 0, 1))
    found = fit_scales(sums, usual)
    assert found.noise == pytest.approx(0.5, rel=0.1)
    assert found.sds[1] == pytest.approx((0.25, 0.25), rel=0.25)
    assert 0.3 < found.sds[0][0] < 1.2
    best = log_likelihood(sums, found)
    for factor in (0.8, 1.25):
        assert log_likelihood(sums, replace(found, noise=found.noise * factor)) < best - 1.0
    assert usual.with_logs(found.logs).sds[1] == pytest.approx(found.sds[1], rel=1e-12)
    with pytest.raises(InvalidInput, match="no trips"):
        fit_scales(Sums.empty(3), usual)


def test_a_posterior_comes_back_from_its_arrays():
    group, X, y, n = trips()
    found = group_posterior(sums_of(group, X, y, n), SCALES)
    again = GroupPosterior.from_arrays(found.to_arrays())
    for names in (("a",), ("a", "v2", "Bob"), ("b", "v3"), ("c",)):
        for ours, theirs in zip(found.weights(*names), again.weights(*names), strict=True):
            assert ours.tolist() == theirs.tolist()
    assert again.scales == found.scales


def test_sums_are_those_of_the_trips_of_each_group():
    group, X, y, n = trips()
    by_hand = sums_of(group, X, y, n)
    made = Sums.from_trips([GROUPS[g] for g in group], X, y, n)
    assert made.groups == by_hand.groups
    for name in ("count", "log_variance", "xx", "xy", "yy"):
        assert getattr(made, name) == pytest.approx(getattr(by_hand, name), rel=1e-12)


@pytest.mark.parametrize("root", [ROOT_SD, 0.2])
@pytest.mark.parametrize("node", [(), ("a",), ("a", "v2"), ("a", "v2", "Bob"), ("b", "v3")])
def test_the_tree_and_one_normal_model_of_all_deviations_give_one_posterior(node, root):
    """Each node of the tree has a deviation; the weights of a group are the sum of those around it."""
    group, X, y, n = trips()
    scales = replace(SCALES, root=root)
    posterior = group_posterior(sums_of(group, X, y, n), scales)
    names = posterior.tree.names
    paths = [tuple(name for name in GROUPS[g] if name) for g in group]
    inside = np.array([[path[: len(name)] == name for name in names] for path in paths], dtype=float)
    design = np.einsum("ik,ip->ikp", inside, X).reshape(len(y), -1)
    prior = np.concatenate([scales.variances(len(name)) for name in names])
    weighted = design.T / (scales.noise * n)
    covariance = np.linalg.inv(weighted @ design + np.diag(1.0 / prior))
    mean = covariance @ (weighted @ y)
    total = np.kron([float(node[: len(name)] == name) for name in names], np.eye(3))
    i = names.index(node)
    assert posterior.mean[i] == pytest.approx(total @ mean, rel=1e-9, abs=1e-12)
    assert posterior.covariance[i] == pytest.approx(total @ covariance @ total.T, rel=1e-8, abs=1e-10)


def test_the_root_holds_what_all_groups_have_in_common():
    """With one trip of one group the root's posterior is that of a normal mean; its own scale is kept by new logarithms."""
    sums = Sums.from_trips([("a",)], np.array([[2.0]]), np.array([3.0]), np.array([0.5]))
    for root in (0.1, 1.0, ROOT_SD):
        scales = Scales(((0.4,),), 1.5, (0,), root)
        found = group_posterior(sums, scales)
        # y = 2 (w + d) + e: variance 4 (root^2 + 0.4^2) + 1.5 * 0.5, covariance with w 2 root^2
        gain = 2.0 * root**2 / (4.0 * (root**2 + 0.16) + 0.75)
        assert found.mean[0, 0] == pytest.approx(3.0 * gain, rel=1e-12)
        assert found.covariance[0, 0, 0] == pytest.approx(root**2 * (1.0 - 2.0 * gain), rel=1e-10)
        assert scales.variances(0).tolist() == [root**2]
        assert scales.with_logs(scales.logs).root == root
        assert fit_scales(sums, scales).root == root
    assert Scales(((0.4,),), 1.5, (0,)).root == ROOT_SD


def test_a_narrow_prior_keeps_the_scales_and_a_wide_one_lets_them_follow_the_data():
    """Forty cars that differ by 0.8, against a usual scale of 0.2."""
    rng = np.random.default_rng(6)
    cars = [(f"car {i // 10:02d}",) for i in range(400)]
    X, n = rng.normal(size=(400, 2)), np.full(400, 0.5)
    own = np.repeat(0.8 * rng.normal(size=(40, 2)), 10, axis=0)
    y = (X * own).sum(axis=1) + np.sqrt(0.5) * rng.normal(size=400)
    sums, usual = Sums.from_trips(cars, X, y, n), Scales(((0.2,),), 1.0, (0, 0), 0.5)
    kept, free, default = (fit_scales(sums, usual, log_sd=sd) for sd in (0.01, 10.0, LOG_SD))
    assert kept.sds[0][0] == pytest.approx(0.2, rel=0.1)
    assert free.sds[0][0] == pytest.approx(0.8, rel=0.15)
    assert fit_scales(sums, usual) == default
    assert kept.sds[0][0] < fit_scales(sums, usual, log_sd=0.2).sds[0][0] < default.sds[0][0] < free.sds[0][0]
    assert free.noise == pytest.approx(1.0, rel=0.15)


def test_a_tree_has_as_many_levels_as_its_scales():
    """Cars below what all cars share: two levels."""
    rng = np.random.default_rng(8)
    cars = [(f"car {i // 20:02d}",) for i in range(400)]
    X, n = rng.normal(size=(400, 2)), np.full(400, 0.5)
    own = np.repeat([1.0, -0.5] + 0.4 * rng.normal(size=(20, 2)), 20, axis=0)
    y = (X * own).sum(axis=1) + np.sqrt(0.5) * rng.normal(size=400)
    sums = Sums.from_trips(cars, X, y, n)
    scales = fit_scales(sums, Scales(((1.0,),), 1.0, (0, 0)))
    assert scales.sds[0][0] == pytest.approx(0.4, rel=0.3)
    posterior = group_posterior(sums, scales)
    mean, covariance = posterior.weights("a new car")
    assert mean == pytest.approx([1.0, -0.5], abs=0.3)
    assert np.sqrt(np.diag(covariance)) == pytest.approx([scales.sds[0][0]] * 2, rel=0.2)
    again = GroupPosterior.from_arrays(posterior.to_arrays())
    assert again.weights("car 03")[0].tolist() == posterior.weights("car 03")[0].tolist()
