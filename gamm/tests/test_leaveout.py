"""Leaving groups out is a fit without them, their response has no influence, and directions that nothing determines are removed."""

import numpy as np
import pandas as pd
import pytest

from gamm_samples import FULL, X, study
from tripwatt_gamm import GAMM, Formula, Parametric, RandomEffect, Smooth
from tripwatt_gamm.errors import InvalidInput


@pytest.mark.parametrize("family", ["gaussian", "scat"])
def test_leave_group_out_is_a_fit_without_the_group(frame, family):
    formula = Formula("y", (Parametric("w"), X, RandomEffect("g")))
    model = GAMM(formula, family, tolerance=1e-5)
    out = model.leave_groups_out(frame, groups="g")
    assert model.folds_["converged"].all()
    inner = frame["x"].between(frame["x"].quantile(0.02), frame["x"].quantile(0.98)).to_numpy()
    for group in ("g0", "g5"):
        held = (frame["g"] == group).to_numpy()
        again = GAMM(formula, family, tolerance=1e-5).fit(frame[~held])
        # the knots of a refit span the range of fewer rows, which is all that differs
        assert out[held & inner] == pytest.approx(again.predict(frame[held & inner]), abs=0.02)


@pytest.mark.parametrize("method", ["fREML", "REML"])
def test_the_held_out_response_has_no_influence(frame, method):
    held = (frame["g"] == "g2").to_numpy()
    other = frame.assign(y=frame["y"].where(~held, frame["y"] * -7 + 40))
    a, b = (GAMM(FULL, "scat", method).leave_groups_out(f, groups="g")[held] for f in (frame, other))
    assert a == pytest.approx(b, abs=1e-6)


def test_whole_folds_can_be_left_out(frame):
    days = frame["g"].map(lambda g: int(g[1]) // 2)
    model = GAMM(FULL)
    model.leave_groups_out(frame, groups="g", folds=days)
    assert model.folds_["rows"].tolist() == [60] * 4


def test_a_level_that_only_the_held_out_group_has(frame):
    odd = frame.assign(w=frame["w"].where(frame["g"] != "g1", "rare"))
    out = GAMM(FULL, "scat").leave_groups_out(odd, groups="g")
    assert np.isfinite(out).all()
    assert np.abs(out - odd["y"]).max() < 10


def test_other_rows_are_predicted_by_the_fit_without_their_group(frame):
    gamm = GAMM(FULL)
    held = gamm.leave_groups_out(frame, groups="g")
    order = np.random.default_rng(0).permutation(len(frame))
    shuffled = frame.iloc[order]
    at = gamm.leave_groups_out(frame, groups="g", at=shuffled, at_folds="g")
    assert at == pytest.approx(held[order])
    half = frame.iloc[::2]
    few = gamm.leave_groups_out(half, groups="g", at=frame.drop(columns="g"), at_folds=frame["g"].to_numpy())
    assert few[::2] == pytest.approx(gamm.leave_groups_out(half, groups="g"))
    assert np.std(few - held) < 0.5 * np.std(held)
    days = np.array(["u", "v"])[frame["g"].isin(["g0", "g1", "g2"]).astype(int)]
    by_day = gamm.leave_groups_out(frame, groups="g", folds=days, at=frame, at_folds=days)
    assert by_day == pytest.approx(gamm.leave_groups_out(frame, groups="g", folds=days))


@pytest.mark.parametrize(
    ("change", "folds", "words"),
    [
        (
            lambda f: f,
            ["nowhere"] * 240,
            "invalid groups: at_folds=: got 240 labels, 240 missing or unknown",
        ),
        (lambda f: f, None, "got 0 labels, 0 missing"),
        (lambda f: f, "day", "unknown column: 'day'"),
        (lambda f: f.drop(columns="x"), "g", "unknown column: 'x'"),
        (lambda f: f.assign(z=np.nan), "g", "not finite: column 'z'"),
    ],
)
def test_rows_that_cannot_be_predicted_are_named(frame, change, folds, words):
    with pytest.raises(InvalidInput, match=words):
        GAMM(FULL).leave_groups_out(frame, groups="g", at=change(frame), at_folds=folds)


SLEEP, BOYS, MACHINES = "reaction ~ days", "height_cm ~ age", "score ~ machine"


@pytest.mark.parametrize("term", ['s(subject, bs="re") + s(subject, days, bs="re")', "(1 + days | subject)"])
def test_leaving_a_subject_out_is_a_fit_without_it(term):
    frame = study("sleepstudy")
    frame = frame[frame["subject"].between(332, 335)]
    model = GAMM(f"{SLEEP} + {term}")
    held = model.leave_groups_out(frame, groups="subject")
    own = frame["subject"] == 334
    without = GAMM(f"{SLEEP} + {term}").fit(frame[~own])
    assert held[own] == pytest.approx(without.predict(frame[own]), abs=1e-4)
    at = model.leave_groups_out(
        frame, groups="subject", at=frame[["days"]], at_folds=frame["subject"].to_numpy()
    )
    assert at == pytest.approx(held)
    changed = frame.assign(reaction=frame["reaction"].where(~own, 0.0))
    assert model.leave_groups_out(changed, groups="subject")[own] == pytest.approx(held[own], abs=1e-9)


def test_what_can_be_reduced_is_reduced_and_reported(frame):
    coarse = frame.assign(x=frame["x"].round())
    model = GAMM(Formula("y", (X,))).fit(coarse)
    assert "k reduced from 10 to 8" in model.notes_[0]
    twice = frame.assign(copy=2 * frame["z"] - 1, same=frame["w"])
    model = GAMM(
        Formula("y", (Parametric("z"), Parametric("copy"), Parametric("w"), Parametric("same"), X))
    ).fit(twice)
    assert {"copy", "sameb", "samec"} <= set(model.empty_columns_)
    assert model.fitted_values_ == pytest.approx(
        GAMM(Formula("y", (Parametric("z"), Parametric("w"), X))).fit(frame).fitted_values_, abs=1e-5
    )
    nested = GAMM(Formula("y", (Smooth(("x",)), Smooth(("z",)), Smooth(("x", "z"))))).fit(frame)
    assert "s(x,z) repeats" in nested.notes_[0]
    assert nested.terms_[-1].size == 27


def test_a_fold_with_as_few_rows_as_free_coefficients_is_refused():
    rng = np.random.default_rng(3)
    frame = pd.DataFrame({"x": rng.normal(size=6), "z": rng.normal(size=6), "y": rng.normal(size=6)})
    model = GAMM(Formula("y", (Parametric("x"), Parametric("z"))))
    held_out = model.leave_groups_out(frame, groups=np.arange(6) // 2)
    assert np.isfinite(held_out).all(), "four rows for three coefficients"
    with pytest.raises(InvalidInput) as caught:
        model.leave_groups_out(frame, groups=np.arange(6) // 3)
    (fault,) = caught.value.faults
    assert (fault.what, fault.got) == ("too few rows", "3 rows")
    assert fault.where == "without fold of row 0"
    assert fault.allowed == "more than 3 unpenalised coefficients"
    with pytest.raises(InvalidInput, match="too few rows"):
        model.fit(frame.iloc[:3])
