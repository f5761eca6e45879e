"""The estimator: laws of its fits, prediction, and options that cannot be used."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamm_samples import FULL, X, clustered, study
from tripwatt_gamm import GAMM, Formula, RandomEffect, Smooth
from tripwatt_gamm.errors import InvalidInput, NotFittedError

few = settings(max_examples=8, deadline=None)


seeds = st.integers(0, 10_000)


CURVE = Formula("y", (Smooth(("x",), "ps", 12), RandomEffect("g")))


@few
@given(seed=seeds)
def test_relabelling_groups_changes_nothing(seed):
    frame = clustered(seed, n=160)
    other = frame.assign(
        g=frame["g"].map(dict(zip(["g0", "g1", "g2", "g3", "g4", "g5", "g6", "g7"], "pqhxwanb", strict=True)))
    )
    one, two = GAMM(CURVE, "scat").fit(frame), GAMM(CURVE, "scat").fit(other)
    assert np.abs(one.fitted_values_ - two.fitted_values_).max() < 1e-4 * frame["y"].std()
    assert one.reml_ == pytest.approx(two.reml_, rel=1e-6)


@few
@given(seed=seeds, constant=st.floats(-1e3, 1e3), family=st.sampled_from(["gaussian", "scat"]))
def test_a_constant_moves_only_the_intercept(seed, constant, family):
    frame = clustered(seed, n=160)
    one = GAMM(CURVE, family).fit(frame)
    two = GAMM(CURVE, family).fit(frame, frame["y"] + constant)
    assert two.coef_[0] - one.coef_[0] == pytest.approx(constant, abs=1e-3)
    assert two.coef_[1:] == pytest.approx(one.coef_[1:], abs=2e-3)


@few
@given(seed=seeds, factor=st.floats(1e-6, 1e6), family=st.sampled_from(["gaussian", "scat"]))
def test_scaling_the_response_scales_everything(seed, factor, family):
    frame = clustered(seed, n=160)
    one = GAMM(CURVE, family).fit(frame)
    two = GAMM(CURVE, family).fit(frame, frame["y"] * factor)
    assert two.fitted_values_ / factor == pytest.approx(one.fitted_values_, abs=2e-3)
    assert two.sigma_ / factor == pytest.approx(one.sigma_, rel=1e-3)
    assert np.diag(two.Vp_) / factor**2 == pytest.approx(np.diag(one.Vp_), rel=1e-2, abs=1e-4)


def test_predictions_add_up(frame, model):
    fit, se = model.predict(frame), model.intervals(frame)["std_error"].to_numpy()
    terms = model.predict_terms(frame)
    assert fit == pytest.approx(model.fitted_values_, abs=1e-8)
    assert terms.sum(axis=1).to_numpy() == pytest.approx(fit)
    assert list(terms) == ["(Intercept)", "w", "s(x)", "s(x,z)", "s(g)"]
    without = model.predict(frame, exclude=["s(g)"])
    assert fit - without == pytest.approx(terms["s(g)"].to_numpy())
    dense = np.hstack([fitted.matrix(frame) for fitted in model.terms_])
    assert se == pytest.approx(np.sqrt(np.einsum("ij,jk,ik->i", dense, model.Vp_, dense)))
    assert np.diag(model.Vp_ @ model.R_.T @ model.R_) == pytest.approx(model.edf_, abs=1e-6)


def test_predict_and_options_say_what_is_wrong(frame, model):
    with pytest.raises(InvalidInput, match=r"unknown column.*'x'"):
        model.predict(frame.drop(columns="x"))
    with pytest.raises(InvalidInput, match="not finite"):
        model.predict(frame.assign(x=np.nan))
    with pytest.raises(InvalidInput, match="unknown term"):
        model.predict(frame, exclude=["s(trip)"])
    with pytest.raises(InvalidInput, match="unknown family"):
        GAMM(FULL, "poison").fit(frame)
    with pytest.raises(InvalidInput, match="no score for a correlation"):
        GAMM(FULL, "scat", ar1_rho="estimate").fit(frame)
    with pytest.raises(InvalidInput, match=r"invalid smoothing parameters.*s\(x,z\)"):
        GAMM(FULL, smoothing_parameters=[1.0]).fit(frame)
    with pytest.raises(InvalidInput, match="got groups=None; allowed: groups, or a column"):
        GAMM(Formula("y", (X,))).leave_groups_out(frame)
    with pytest.raises(InvalidInput, match="only one group"):
        GAMM(Formula("y", (X,))).leave_groups_out(frame, groups=np.zeros(len(frame)))
    with pytest.raises(InvalidInput, match="wrong length"):
        GAMM(FULL).fit(frame, frame["y"][:-1])
    with pytest.raises(InvalidInput, match=r"another index: the response.*to_numpy"):
        GAMM(FULL).fit(frame, frame["y"].set_axis(range(1, len(frame) + 1)))
    for error in (NotFittedError, AttributeError, ValueError):
        with pytest.raises(error, match="not fitted: GAMM"):
            GAMM(FULL).predict(frame)
    assert not hasattr(GAMM(FULL), "coef_")


def test_draws_have_the_intervals_of_the_posterior_and_joint_ones_are_wider(frame, model):
    rows = frame.iloc[:40]
    band, joint = model.intervals(rows), model.intervals(rows, simultaneous=True)
    draws = model.sample(rows, 4000, seed=1)
    width = (band["upper"] - band["lower"]).to_numpy()
    assert np.ptp(np.quantile(draws, [0.025, 0.975], axis=0), axis=0) == pytest.approx(width, rel=0.1)
    held = (draws >= joint["lower"].to_numpy()) & (draws <= joint["upper"].to_numpy())
    assert held.all(axis=1).mean() == pytest.approx(0.95, abs=0.015)
    assert ((joint["upper"] - joint["lower"]) > width).all()


def test_a_series_is_aligned_with_the_frame(frame):
    order = np.random.default_rng(0).permutation(len(frame))
    aligned = GAMM(Formula(None, (X,))).fit(frame, frame["y"].iloc[order])
    assert aligned.coef_ == pytest.approx(GAMM(Formula("y", (X,))).fit(frame).coef_)


def test_a_fit_that_did_not_converge_says_so(frame):
    model = GAMM(FULL, "scat", max_iter=2).fit(frame)
    assert not model.converged_
    assert "2" in model.message_
    assert "max_iter" in model.message_
    assert np.isfinite(model.fitted_values_).all()


def test_a_level_that_is_unknown_or_missing_has_no_effect():
    frame = study("sleepstudy")
    model = GAMM("reaction ~ days + (1 + days | subject)").fit(frame)
    new = pd.DataFrame({"days": [0.0, 4.0], "subject": [999, 999]})
    line = model.coef_[0] + model.coef_[1] * new["days"].to_numpy()
    assert model.predict(new) == pytest.approx(line)
    assert model.predict(new[["days"]]) == pytest.approx(line)
    assert not model.extrapolation_mask(new).any()
    known = model.predict(new.assign(subject=308))
    own = model.coef_[[2, 20]]  # subject 308 is the first level: intercepts come first, slopes next
    assert known - line == pytest.approx(own[0] + own[1] * new["days"].to_numpy())
    assert model.predict(new.assign(subject=308), exclude=["(1+days|subject)"]) == pytest.approx(line)
    with pytest.raises(InvalidInput, match="unknown column: 'days'"):
        model.predict(new[["subject"]])


def test_the_error_of_a_new_level_has_the_variance_of_its_effect():
    rng, n = np.random.default_rng(3), 8
    y = np.repeat(rng.normal(0.0, 2.0, 12), n) + rng.standard_normal(12 * n)
    frame = pd.DataFrame(
        {"y": y, "g": pd.Categorical(np.repeat(list("abcdefghijkl"), n), [*"abcdefghijklm"])}
    )
    means = y.reshape(12, n).mean(axis=1)
    within, between = ((y - np.repeat(means, n)) ** 2).sum() / (12 * (n - 1)), n * means.var(ddof=1)
    model = GAMM('y ~ s(g, bs="re")').fit(frame)
    new = pd.DataFrame({"g": ["m", "new", "new", "other", "a"]})  # training declares "m", without rows
    error = model.intervals(new)["std_error"].to_numpy()
    constant = between / (12 * n)
    assert error[:4] == pytest.approx(np.sqrt((between - within) / n + constant), rel=1e-4)
    assert error[4] < np.sqrt(between / n) / 2
    assert model.intervals(new, exclude=["s(g)"])["std_error"].to_numpy() == pytest.approx(
        np.sqrt(constant), rel=1e-4
    )
    assert model.intervals(new[[]])["std_error"].to_numpy() == pytest.approx(error[0])
    covariance = np.cov(model.sample(new, 20_000).T)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(error, rel=0.03)
    assert covariance[1, 2] == pytest.approx(error[1] ** 2, rel=0.05)
    assert covariance[1, 3] == pytest.approx(constant, abs=0.05 * error[1] ** 2)
    alone, pair, both = (model.intervals(new.iloc[i], simultaneous=True) for i in ([1], [1, 2], [1, 3]))
    widths = [(band["upper"] - band["lower"]).iloc[0] for band in (alone, pair, both)]
    assert widths[0] == pytest.approx(widths[1])
    assert widths[2] > 1.05 * widths[0]


@pytest.mark.parametrize("effects", ["(1 + days | g)", 's(days, g, bs="fs", k=4)', 's(g, days, bs="re")'])
def test_a_new_level_has_the_error_of_a_level_that_is_declared_without_rows(effects):
    frame = study("sleepstudy")
    levels = [*sorted(map(str, frame["subject"].unique())), "empty"]
    frame = frame.assign(g=pd.Categorical(frame["subject"].astype(str), levels))
    model = GAMM(f"reaction ~ days + {effects}").fit(frame)
    new = pd.DataFrame({"days": [0.0, 3.0, 9.0]})
    known, empty, unknown = (model.intervals(new.assign(g=g)) for g in ("308", "empty", "999"))
    assert unknown["mean"].to_numpy() == pytest.approx(empty["mean"].to_numpy())
    assert unknown["std_error"].to_numpy() == pytest.approx(empty["std_error"].to_numpy(), rel=1e-6)
    assert known["std_error"].iloc[2] < 0.7 * unknown["std_error"].iloc[2]
