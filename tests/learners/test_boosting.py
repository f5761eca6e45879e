import pickle

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.utils.estimator_checks import check_estimator

from tripwatt.errors import InvalidInput
from tripwatt.learners.boosting import ClusteredBoosting
from tripwatt.learners.correlation import WorkingCorrelation
from tripwatt.learners.trees import TreeGrower

KINDS = ("independence", "exchangeable", "ar1")


def clustered(n_groups=20, n_rows=15, seed=0):
    rng = np.random.default_rng(seed)
    subject = np.repeat(np.arange(n_groups), n_rows)
    table = pd.DataFrame(
        {"dose": rng.uniform(0, 1, subject.size), "site": rng.choice(["north", "south"], n_groups)[subject]}
    )
    y = 3.0 * (table["dose"] > 0.5) + (table["site"] == "north") + rng.normal(0, 0.7, n_groups)[subject]
    return table, y.to_numpy() + rng.normal(0, 0.1, subject.size), np.array([f"s{i:02d}" for i in subject])


def small(**settings_):
    return ClusteredBoosting(**{"n_rounds": 40, "patience": 10, "random_state": 0} | settings_)


def dense(working, kind):
    """V^-1 by brute force."""
    n = working.codes.size
    V = np.zeros((n, n))
    for group in np.unique(working.codes):
        rows = np.flatnonzero(working.codes == group)
        lag = np.abs(np.subtract.outer(rows, rows))
        R = {
            "independence": lag == 0,
            "exchangeable": np.where(lag == 0, 1, working.rho),
            "ar1": working.rho**lag,
        }[kind]
        V[np.ix_(rows, rows)] = R / working.weight[rows[0]]
    return np.linalg.inv(V)


@pytest.mark.parametrize("kind", KINDS)
@given(
    sizes=st.lists(st.integers(1, 5), min_size=1, max_size=5),
    rho=st.floats(0.0, 0.9),
    seed=st.integers(0, 999),
)
@settings(max_examples=25, deadline=None)
def test_closed_form_is_the_dense_inverse(kind, sizes, rho, seed):
    rng = np.random.default_rng(seed)
    codes = np.repeat(np.arange(len(sizes)), sizes)
    working = WorkingCorrelation(kind, codes, rng.uniform(0.5, 2, len(sizes))[codes])
    working.rho = 0.0 if kind == "independence" else rho
    inverse = dense(working, kind)
    residual, leaf = rng.normal(size=codes.size), rng.integers(0, 3, codes.size)
    np.testing.assert_allclose(working.solve(residual), inverse @ residual, atol=1e-9)
    Z = np.eye(3)[leaf]
    np.testing.assert_allclose(working.normal_matrix(leaf, 3), Z.T @ inverse @ Z, atol=1e-9)


@pytest.mark.parametrize(("kind", "rho"), [("exchangeable", 0.6), ("ar1", 0.8)])
def test_moment_estimate_finds_the_correlation(kind, rho):
    rng = np.random.default_rng(0)
    n_groups, n = 3000, 8
    noise = rng.normal(size=(n_groups, n))
    if kind == "exchangeable":
        r = np.sqrt(1 - rho) * noise + np.sqrt(rho) * rng.normal(size=(n_groups, 1))
    else:
        r = noise.copy()
        for j in range(1, n):
            r[:, j] = rho * r[:, j - 1] + np.sqrt(1 - rho**2) * noise[:, j]
    working = WorkingCorrelation(kind, np.repeat(np.arange(n_groups), n), np.ones(r.size))
    working.estimate(r.ravel())
    assert working.rho == pytest.approx(rho, abs=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_leaves_solve_the_estimating_equation(kind):
    """One unshrunk tree: Z' V^-1 (y - F) vanishes on its leaves."""
    X, y, groups = clustered()
    model = small(n_rounds=1, n_folds=None, learning_rate=1.0, correlation=kind, start="zero").fit(
        X, y, groups
    )
    codes = np.unique(groups, return_inverse=True)[1]
    working = WorkingCorrelation(kind, codes, np.full(codes.size, 1 / 15))
    working.rho = model.correlation_parameter_
    assert (working.rho > 0) == (kind != "independence")
    F = model.predict(X)
    leaf = np.unique(F, return_inverse=True)[1]
    assert leaf.max() > 1
    np.testing.assert_allclose(np.bincount(leaf, working.solve(y - F)), 0, atol=1e-9)


def test_working_correlation_pays_when_subjects_differ():
    """Effect within subjects, large subject effects: exchangeable is closer to the truth than independence."""
    errors = {kind: [] for kind in ("independence", "exchangeable")}
    for seed in range(4):
        rng = np.random.default_rng(seed)
        subject = np.repeat(np.arange(25), 12)
        x = rng.uniform(0, 1, (300, 1)) * 0.5 + rng.uniform(0, 0.5, 25)[subject, None]
        truth = np.sin(6 * x[:, 0])
        y = truth + rng.normal(0, 2, 25)[subject] + rng.normal(0, 0.2, 300)
        for kind, found in errors.items():
            model = small(correlation=kind, n_folds=None, n_rounds=60, max_leaf_nodes=4).fit(x, y, subject)
            effect = model.predict(x)
            found.append(np.std(effect - truth))
    assert np.mean(errors["exchangeable"]) < 0.7 * np.mean(errors["independence"])


def test_scikit_learn_takes_it_for_one_of_its_own():
    check_estimator(ClusteredBoosting(n_rounds=8, n_folds=3), on_skip=None)
    check_estimator(ClusteredBoosting(n_rounds=8, n_folds=None, correlation="exchangeable"), on_skip=None)


@pytest.mark.parametrize("per_fold", [1, 3])
def test_held_out_target_moves_nothing_to_the_last_bit(per_fold):
    X, y, groups = clustered(9, 12)
    folds = np.array([int(g[1:]) // per_fold for g in groups])
    settings_ = {
        "param_grid": {"max_leaf_nodes": [2, 6]},
        "correlation": "exchangeable",
        "subsample": 0.7,
        "max_features": 0.5,
    }
    model, other = small(**settings_), small(**settings_)
    before = model.leave_groups_out(X, y, groups, folds)
    out = folds == 1
    rng = np.random.default_rng(1)
    after = other.leave_groups_out(X, np.where(out, rng.normal(0, 1e6, y.size), y), groups, folds)
    np.testing.assert_array_equal(before[out], after[out])
    assert (before[~out] != after[~out]).any()


def test_leave_groups_out_is_the_refit_of_the_fold():
    X, y, groups = clustered()
    model = small(start="zero")
    held_out = model.leave_groups_out(X, y, groups)
    out = groups == "s07"
    rounds = int(model.fold_rounds_[7])
    refit = small(start="zero", n_folds=None, n_rounds=rounds).fit(X[~out], y[~out], groups[~out])
    # only the edges of the bins know the held-out covariates
    assert np.sqrt(np.mean((held_out[out] - refit.predict(X[out])) ** 2)) < 0.1


def test_the_error_of_a_choice_is_that_of_its_round_and_has_not_seen_the_fold():
    X, y, groups = clustered(9, 12)
    one, other = small(param_grid={"max_leaf_nodes": [2]}), small(param_grid={"max_leaf_nodes": [6]})
    both = small(param_grid={"max_leaf_nodes": [2, 6]})
    for model in (one, other, both):
        model.leave_groups_out(X, y, groups)
    np.testing.assert_array_equal(both.fold_errors_, np.minimum(one.fold_errors_, other.fold_errors_))
    out = groups == "s07"
    again = small(param_grid={"max_leaf_nodes": [2, 6]})
    again.leave_groups_out(X, np.where(out, 1e6, y), groups)
    assert again.fold_errors_[7] == both.fold_errors_[7]
    assert (again.fold_errors_ != both.fold_errors_).any()
    unchosen = small(n_folds=None, n_rounds=3)
    unchosen.leave_groups_out(X, y, groups)
    assert np.isnan(unchosen.fold_errors_).all()


def test_a_boosting_travels_to_another_process():
    X, y, groups = clustered()
    model = small(correlation="ar1").fit(X, y, groups)
    back = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(back.predict(X), model.predict(X))


def test_wrong_settings_are_named_all_at_once():
    with pytest.raises(InvalidInput) as caught:
        ClusteredBoosting(learning_rate=0, correlation="toeplitz", n_folds=1).fit([[1.0], [2.0]], [1.0, 2.0])
    assert len(caught.value.faults) == 3


@pytest.mark.parametrize(("n_splits", "depth"), [(1, 1), (3, 2)])
def test_plain_boosting_is_that_of_htree(reference_dir, n_splits, depth):
    """R htree's htb: L2 boosting with working independence from 0 (lambda 0.05, nodesize 5, 200 trees)."""
    folder = reference_dir / "mgcv"
    table = pd.read_csv(folder / "tum_60s.csv")
    expected = pd.read_csv(folder / f"htb_nsplit{n_splits}_60s.csv")
    X = table[["time", "vel", "tamb", "delev"]].assign(
        **{name: table[name].astype("category").cat.codes.astype(float) for name in ("season", "weather")}
    )
    five_rows = 5 * table["trip"].nunique() / len(table)
    settings_ = {
        "learning_rate": 0.05,
        "max_depth": depth,
        "max_leaf_nodes": 2**depth,
        "min_leaf_weight": five_rows,
        "start": "zero",
        "group_weight": "rows",
        "max_rows_per_group": None,
        "max_bins": 5000,
        "n_folds": None,
    }
    for rounds, name in ((1, "tree1"), (200, "F200")):
        model = ClusteredBoosting(n_rounds=rounds, **settings_).fit(X, table["y"], table["trip"])
        np.testing.assert_allclose(model.predict(X), expected[name], atol=1e-9)


def test_leaves_come_from_the_scores_and_from_the_library_where_values_are_equal():
    X, target = np.arange(8.0)[:, None], np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0])
    setting = {"max_leaf_nodes": 4, "max_depth": None, "min_leaf_weight": 1.0, "max_features": 1.0}
    for y in (np.array([5.0, 5.0, 1.0, 1.0, 3.0, 3.0, 9.0, 9.0]), target):
        trees = TreeGrower(X, [], 255).start(setting)
        for seed in (1, 2, 3):
            trees.grow(y / seed, np.ones(8), seed)
            last = trees.last_leaves(X)
            np.testing.assert_array_equal(last, trees.leaves(X)[-1])
            assert len(set(last.tolist())) > 1
