import pickle

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn import config_context
from sklearn.base import clone
from sklearn.model_selection import GroupKFold, cross_validate
from sklearn.utils.estimator_checks import check_estimator
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.learners.clusters import thinned_rows
from tripwatt.learners.forest import ClusteredForest


def clustered(n_groups=24, n_rows=30, seed=0):
    """Dose response with a large effect of the subject, a factor that matters and a column of noise."""
    rng = np.random.default_rng(seed)
    subject = np.repeat(np.arange(n_groups), n_rows)
    site = rng.choice(["north", "south", "west"], n_groups)[subject]
    table = pd.DataFrame(
        {"dose": rng.uniform(0, 1, subject.size), "site": site, "noise": rng.normal(size=subject.size)}
    )
    y = 3.0 * (table["dose"] > 0.5) + 2.0 * (table["site"] == "north") + rng.normal(0, 0.7, n_groups)[subject]
    return table, y.to_numpy() + rng.normal(0, 0.1, subject.size), np.array([f"s{i:02d}" for i in subject])


GRID = {"max_leaf_nodes": [4, 12], "max_features": [0.5, 1.0]}


def small(**settings_):
    return ClusteredForest(**{"n_trees": 150, "param_grid": GRID, "random_state": 0} | settings_)


def test_scikit_learn_takes_it_for_one_of_its_own():
    check_estimator(ClusteredForest(n_trees=15, param_grid={"max_leaf_nodes": [4, 12]}), on_skip=None)


@pytest.mark.parametrize("routed", [True, False])
def test_cross_validation_fits_with_the_groups_that_it_splits_by(routed):
    X, y, groups = clustered(n_groups=9, n_rows=8)
    learner = small(n_trees=10, param_grid=None)
    given = {"params": {"groups": groups}} | ({} if routed else {"groups": groups})
    with config_context(enable_metadata_routing=routed):
        found = cross_validate(
            learner, X, y, cv=GroupKFold(3), return_estimator=True, return_indices=True, **given
        )
    for fitted, train, test, score in zip(
        found["estimator"], *found["indices"].values(), found["test_score"], strict=True
    ):
        assert set(fitted.groups_) == set(groups[train])
        assert not set(groups[train]) & set(groups[test])
        by_hand = clone(learner).fit(X.iloc[train], y[train], groups[train])
        assert score == pytest.approx(by_hand.score(X.iloc[test], y[test]))


def test_bootstrap_draws_whole_groups():
    X, y, groups = clustered()
    forest = small().fit(X, y, groups)
    assert (forest.counts_.sum(axis=1) == 24).all()
    assert 0.30 < (forest.counts_ == 0).mean() < 0.42  # 1/e
    # subjects differ: a row bootstrap would see the held-out subject's other rows and look falsely good
    X["height"] = np.random.default_rng(1).normal(size=24)[[int(g[1:]) for g in groups]]
    by_row = small(param_grid=None).fit(X, y)
    by_group = small(param_grid=None).fit(X, y, groups)
    assert by_row.oob_error_.mean() < 0.5 * by_group.oob_error_.mean()


def test_leave_groups_out_is_the_refit_in_law():
    X, y, groups = clustered()
    settings_ = {"n_trees": 1500, "param_grid": None}
    shortcut = small(**settings_).leave_groups_out(X, y, groups)
    for label in ("s03", "s17"):
        out = groups == label
        refit = small(**settings_).fit(X[~out], y[~out], groups[~out]).predict(X[out])
        assert np.abs(shortcut[out] - refit).max() < 0.25  # Monte Carlo error of two forests
        assert np.corrcoef(shortcut[out], refit)[0, 1] > 0.99


@pytest.mark.parametrize("per_fold", [1, 8])
def test_held_out_target_moves_nothing_to_the_last_bit(per_fold):
    X, y, groups = clustered()
    folds = np.array([int(g[1:]) // per_fold for g in groups])
    forest, other = small(n_trees=400), small(n_trees=400)
    before = forest.leave_groups_out(X, y, groups, folds)
    out = folds == 1
    rng = np.random.default_rng(1)
    after = other.leave_groups_out(X, np.where(out, rng.normal(0, 1e6, y.size), y), groups, folds)
    np.testing.assert_array_equal(before[out], after[out])
    assert forest.fold_params_[1] == other.fold_params_[1]
    assert (before[~out] != after[~out]).any()


def test_unseen_levels_and_missing_values_are_predicted():
    X, y, groups = clustered()
    X.loc[::7, "dose"] = np.nan
    forest = small().fit(X, y, groups)
    new = pd.DataFrame({"dose": [0.9, np.nan], "site": ["elsewhere", None], "noise": [0.0, np.nan]})
    assert np.isfinite(forest.predict(new)).all()
    as_category = X.astype({"site": "category"})
    np.testing.assert_array_equal(small().fit(as_category, y, groups).predict(as_category), forest.predict(X))


def test_a_forest_travels_to_another_process():
    X, y, groups = clustered()
    forest = small().fit(X, y, groups)
    back = pickle.loads(pickle.dumps(forest))
    np.testing.assert_array_equal(back.predict(X), forest.predict(X))
    again = clone(back).fit(X, y, groups)
    np.testing.assert_array_equal(again.predict(X), forest.predict(X))


def test_a_group_drawn_twice_weighs_twice():
    """One column that splits nothing: a tree is the mean of the drawn groups, each as often as it was drawn."""
    y, groups = np.array([0.0, 1.0, 1.0, 1.0, 5.0]), np.array([0, 1, 1, 1, 2])
    forest = ClusteredForest(n_trees=40, param_grid=None, random_state=0).fit(np.zeros((5, 1)), y, groups)
    np.testing.assert_allclose(forest.values_[:, 0], forest.counts_ @ [0.0, 1.0, 5.0] / 3)


def test_wrong_settings_are_named_all_at_once():
    X, y, groups = clustered(4, 5)
    with pytest.raises(InvalidInput) as caught:
        ClusteredForest(n_trees=0, max_features=2.0, loss="cubic").fit(X, y, groups)
    assert len(caught.value.faults) == 3
    refuses("unknown setting", ClusteredForest(param_grid={"depth": [1]}).fit, X, y, groups)
    refuses("two folds", small().leave_groups_out, X, y, groups, folds=np.arange(20))


@given(st.lists(st.integers(0, 5), min_size=1, max_size=60), st.integers(1, 7))
@settings(max_examples=50, deadline=None)
def test_thinning_keeps_order_ends_and_limit(labels, limit):
    codes = np.unique(labels, return_inverse=True)[1]
    kept = thinned_rows(codes, limit)
    for group in np.unique(codes):
        rows = kept[codes[kept] == group]
        own = np.flatnonzero(codes == group)
        assert rows.size == min(limit, own.size)
        assert (np.diff(rows) > 0).all()
        assert rows[-1] == own[-1]
        assert limit == 1 or rows[0] == own[0]
