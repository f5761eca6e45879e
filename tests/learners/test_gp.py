"""The process on totals: what it recovers, what it ignores, and that it is stored as arrays."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.learners.gp import AdditiveGP, KernelTerm

PARTS = (KernelTerm(("dose",), "line", 10.0), KernelTerm(("age",), "smooth", 2.0))


def clusters(n=60, rows=8, seed=0, effect=0.3):
    rng = np.random.default_rng(seed)
    site = np.repeat(np.arange(n), rows)
    X = pd.DataFrame({"dose": rng.uniform(0, 5, n * rows), "age": rng.uniform(0, 10, n)[site]})
    truth = 3.0 * X["dose"].to_numpy() + 2.0 * np.sin(X["age"].to_numpy())
    return X, truth, truth + effect * rng.standard_normal(n)[site], site


def test_line_and_smooth_are_recovered():
    X, truth, y, site = clusters()
    model = AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, site)
    assert np.sqrt(np.mean((model.predict(X) - truth) ** 2)) < 0.3 * truth.std()
    slope = np.diff(model.predict(pd.DataFrame({"dose": [1.0, 2.0], "age": [5.0, 5.0]})))[0]
    assert slope == pytest.approx(3.0, abs=0.5)


def test_a_cluster_counts_once_however_often_it_was_sampled():
    X, _, y, site = clusters()
    once = AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, site)
    twice = AdditiveGP(PARTS, effect_sd=1.0).fit(
        pd.concat([X, X], ignore_index=True), np.tile(y, 2), np.tile(site, 2), weight=np.full(2 * len(y), 0.5)
    )
    np.testing.assert_allclose(twice.predict(X), once.predict(X), rtol=1e-6, atol=1e-6)


def test_clusters_that_stand_out_bend_the_t_less():
    X, truth, y, site = clusters(n=30)
    y = y + np.where(site < 3, 40.0, 0.0)
    errors = {
        df: np.abs(AdditiveGP(PARTS, effect_sd=1.0, df=df).fit(X, y, site).predict(X) - truth)[
            site >= 3
        ].mean()
        for df in (None, 4.0)
    }
    assert errors[4.0] < 0.7 * errors[None]


def test_smooth_parts_stay_bounded_outside_the_range():
    X, _, y, site = clusters()
    model = AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, site)
    edge, far = (pd.DataFrame({"dose": [1.0], "age": [age]}) for age in (float(X["age"].max()), 1e6))
    assert model.predict(far)[0] == pytest.approx(model.predict(edge)[0])
    assert [model.outside_factor(X).any() for X in (far, edge)] == [True, False]


def test_doubt_is_smallest_where_the_data_are():
    X, _, y, site = clusters()
    X = X.assign(age=np.where(X["age"] > 6, X["age"] - 6, X["age"]))
    model = AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, site)
    factor = model.factor(model.features(pd.DataFrame({"dose": [1.0, 50.0], "age": [3.0, 3.0]})))
    near, far = (factor**2).sum(axis=1)
    assert far > 10.0 * near


def test_outside_of_the_range_the_prior_returns():
    X, _, y, site = clusters()
    model = AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, site)
    high, sd = float(X["age"].max()), float(X["age"].std(ddof=0))
    ages = [5.0, high, high + 0.5 * sd, high + 2.0 * sd, 1e6]
    found = model.outside_factor(pd.DataFrame({"dose": np.linspace(0.0, 99.0, 5), "age": ages}))
    prior = model.variances_[1]
    # the mean square of the difference of two values of a process with a squared-exponential kernel
    expected = [0.0, 0.0, 2.0 * prior * (1 - np.exp(-0.125)), 2.0 * prior * (1 - np.exp(-2.0)), 2.0 * prior]
    np.testing.assert_allclose(found[:, 0] ** 2, expected, rtol=1e-9, atol=1e-9 * prior)
    # a line has a posterior everywhere and is no part of it
    assert found.shape == (5, 1)
    assert model.outside_factor(X).shape == (len(X), 0)
    # values that are held at the edge of the range are not outside of it; a missing one is not either
    table = pd.DataFrame({"dose": np.linspace(0.0, 99.0, 5), "age": [*ages[:4], np.nan]})
    low, high = float(X["age"].min()), float(X["age"].max())
    assert model.outside_factor(table, {"age": high}).shape == (5, 0)
    assert model.outside_factor(table, {"age": high + 0.01}).shape == (5, 1)
    assert model.outside_factor(X.assign(age=low - 0.01)).shape == (len(X), 1)


def test_arrays_hold_everything():
    X, _, y, site = clusters()
    model = AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, site)
    again = AdditiveGP(PARTS, effect_sd=1.0).load_arrays(model.to_arrays())
    np.testing.assert_array_equal(again.predict(X), model.predict(X))
    np.testing.assert_array_equal(*(one.factor(one.features(X)) for one in (again, model)))
    assert all(a.dtype.kind in "fU" for a in model.to_arrays().values())


def test_the_factor_is_a_triangle_and_no_wider_than_the_prior():
    X, _, y, site = clusters()
    model = AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, site)
    assert not np.triu(model.factor_, 1).any()
    features = model.features(X)
    posterior, prior = (
        (factor**2).sum(axis=1) for factor in (model.factor(features), model.prior_factor(features))
    )
    assert (posterior < 0.2 * prior).all()


def test_missing_columns_and_groups_are_named():
    X, _, y, site = clusters()
    with pytest.raises(InvalidInput, match=r"age(.|\n)*missing column|missing column(.|\n)*age"):
        AdditiveGP(PARTS, effect_sd=1.0).fit(X[["dose"]], y, site)
    with pytest.raises(InvalidInput, match="too few groups"):
        AdditiveGP(PARTS, effect_sd=1.0).fit(X, y, np.zeros(len(X)))
