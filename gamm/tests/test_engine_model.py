"""The estimator: prediction, unseen levels, extrapolation, leave-group-out, autocorrelation, bad input."""

import numpy as np
import pandas as pd
import pytest

from tripwatt_gamm import GAMM, Formula, Parametric, RandomEffect, Smooth, Tensor
from tripwatt_gamm.covariates import Points, Support, grid_limit
from tripwatt_gamm.errors import InvalidInput

X = Smooth(("x",), "ps", 10)
FULL = Formula("y", (Parametric("w"), X, Smooth(("x", "z"), k=15), RandomEffect("g")))


def table(seed=0, n=240, groups=8):
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(groups), n // groups)
    x, z = rng.uniform(-2, 5, n), rng.normal(size=n)
    w = np.array(["a", "b", "b", "c"])[group % 4]
    y = np.sin(x) + 0.3 * z * x + (w == "b") + rng.normal(0, 0.5, groups)[group] + 0.3 * rng.standard_t(5, n)
    return pd.DataFrame({"x": x, "z": z, "w": w, "g": [f"g{i}" for i in group], "on": (z > 0) * 1.0, "y": y})


@pytest.fixture(scope="module")
def frame():
    return table()


@pytest.fixture(scope="module")
def model(frame):
    return GAMM(FULL, "scat").fit(frame)


def test_predictions_add_up(frame, model):
    fit, se = model.predict(frame, se=True)
    terms, term_se = model.predict(frame, terms=True, se=True)
    assert fit == pytest.approx(model.fitted_values_, abs=1e-8)
    assert terms.sum(axis=1).to_numpy() == pytest.approx(fit)
    assert list(terms) == ["(Intercept)", "w", "s(x)", "s(x,z)", "s(g)"]
    without = model.predict(frame, exclude=["s(g)"])
    assert fit - without == pytest.approx(terms["s(g)"].to_numpy())
    dense = np.hstack([fitted.matrix(frame) for fitted in model.terms_])
    assert se == pytest.approx(np.sqrt(np.einsum("ij,jk,ik->i", dense, model.Vp_, dense)))
    assert (term_se["s(g)"] > 0).all()
    assert pytest.approx(np.linalg.pinv(model.Vp_) @ model.F_, abs=1e-4) == model.R_.T @ model.R_


def test_unseen_levels_follow_the_stated_rule(frame, model):
    row = frame.iloc[[0]]
    seen = [model.predict(row.assign(w=level, g="new"))[0] for level in "abc"]
    share = frame["w"].value_counts(normalize=True).loc[list("abc")].to_numpy()
    assert model.predict(row.assign(w="never", g="new"))[0] == pytest.approx(np.array(seen) @ share)
    assert model.predict(row.drop(columns="g"))[0] == pytest.approx(model.predict(row, exclude=["s(g)"])[0])
    assert model.extrapolation_mask(row.assign(w="never")).all()
    assert not model.extrapolation_mask(frame).any()


def test_outside_the_range_a_curve_is_held_or_goes_straight(frame):
    far = pd.DataFrame({"x": np.array([5.5, 6.5, 7.5, 1e6])})
    held = GAMM(Formula("y", (X,))).fit(frame)
    assert np.ptp(held.predict(far)) < 1e-9
    assert held.extrapolation_mask(far).all()
    straight = GAMM(Formula("y", (X,)), extrapolation="linear").fit(frame)
    steps = np.diff(straight.predict(far)[:3])
    assert steps[0] == pytest.approx(steps[1])
    slope = Formula("y", (Parametric("x"),))
    assert np.ptp(GAMM(slope).fit(frame).predict(far)) < 1e-9
    line = GAMM(slope, extrapolation="linear").fit(frame)
    assert np.diff(line.predict(far))[0] == pytest.approx(line.coef_[1])
    edge = straight.predict(pd.DataFrame({"x": [frame["x"].max() - 0.001, frame["x"].max()]}))
    assert steps[0] == pytest.approx((edge[1] - edge[0]) / 0.001, rel=0.02)


def test_a_level_has_its_own_range(frame):
    half = frame[(frame["w"] != "a") | (frame["x"] < 1)]
    for by in ("w", "on"):
        rows = half if by == "w" else frame[(frame["on"] == 0) | (frame["x"] < 1)]
        level = {"w": "a"} if by == "w" else {"on": 1.0}
        model = GAMM(Formula("y", (Smooth(("x",), "ps", 10, by=by),))).fit(rows)
        far = pd.DataFrame({"x": [1.5, 3.0, 4.5]}).assign(**level)
        assert np.ptp(model.predict(far)) < 1e-9
        assert model.extrapolation_mask(far).all()
        assert not model.extrapolation_mask(rows).any()


def test_a_surface_stays_bounded_far_from_its_data(frame):
    rng = np.random.default_rng(5)
    diagonal = pd.DataFrame({"x": rng.uniform(0, 1, 300)})
    diagonal["z"] = diagonal["x"] + rng.normal(0, 0.02, 300)
    diagonal["y"] = 5 * diagonal["x"] + rng.normal(0, 0.1, 300)
    surface = GAMM(Formula("y", (Tensor(("x", "z"), "ps", (6, 6), "te"),))).fit(diagonal)
    corner = pd.DataFrame({"x": [0.0, 1.0, 50.0], "z": [1.0, 0.0, -50.0]})
    assert surface.extrapolation_mask(corner).all()
    low, high = diagonal["y"].min() - 3, diagonal["y"].max() + 3
    assert ((surface.predict(corner) > low) & (surface.predict(corner) < high)).all()
    points = Support(frame[["x", "z"]].to_numpy())
    moved = points.clamp(np.array([[100.0, 100.0]]))
    assert not points.outside(moved).any()


def test_terms_of_one_covariate_are_held_at_the_same_point(frame):
    terms = (Smooth(("x",), "ps", 8), Smooth(("z",), "ps", 8), Tensor(("x", "z"), "ps", (5, 5)))
    model = GAMM(Formula("y", terms)).fit(frame)
    support = model.training_.supports[("x", "z")]
    far = pd.DataFrame({"x": [-2.0, 5.0, 9.0], "z": [3.0, -3.0, 9.0]})
    there = pd.DataFrame(support.clamp(far.to_numpy()), columns=["x", "z"])
    assert model.predict(far) == pytest.approx(model.predict(there))


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


def test_autocorrelation_is_found_and_widens_the_bands():
    rng = np.random.default_rng(2)
    n, rho = 400, 0.8
    e = rng.normal(size=(10, n))
    for i in range(1, n):
        e[:, i] = rho * e[:, i - 1] + np.sqrt(1 - rho**2) * e[:, i]
    frame = pd.DataFrame({"t": np.tile(np.linspace(0, 1, n), 10), "g": np.repeat(np.arange(10), n)})
    frame["y"] = np.sin(5 * frame["t"]) + e.ravel()
    formula = Formula("y", (Smooth(("t",), "ps", 20),))
    plain = GAMM(formula).fit(frame)
    model = GAMM(formula, ar1_rho="estimate").fit(frame, groups="g")
    assert model.ar1_rho_ == pytest.approx(rho, abs=0.03)
    assert model.scale_ == pytest.approx(1, abs=0.15)
    assert model.edf_.sum() < plain.edf_.sum()
    # against the whitened rows themselves
    y, whitened = frame["y"].to_numpy(), model.ar1_rho_
    dense = np.hstack([fitted.matrix(frame) for fitted in model.terms_])
    first = np.r_[True, np.diff(frame["g"]) != 0]
    W = np.where(
        first[:, None], dense, (dense - whitened * np.roll(dense, 1, axis=0)) / np.sqrt(1 - whitened**2)
    )
    v = np.where(first, y, (y - whitened * np.roll(y, 1)) / np.sqrt(1 - whitened**2))
    S = np.zeros((20, 20))
    S[1:, 1:] = model.smoothing_parameters_["s(t)"] * model.terms_[1].penalties[0]
    assert model.coef_ == pytest.approx(np.linalg.solve(W.T @ W + S, W.T @ v), abs=1e-6)
    shuffled = frame.sample(frac=1, random_state=0).sort_values(["t"], kind="stable")
    assert GAMM(formula, ar1_rho="estimate").fit(shuffled, groups="g").reml_ == pytest.approx(
        model.reml_, rel=1e-6
    )
    assert np.isfinite(GAMM(formula, ar1_rho=0.8).leave_groups_out(frame, groups="g")).all()


def test_numeric_by_variables_share_one_constant(frame):
    terms = (X, Smooth(("x",), "ps", 8, by="on"), Smooth(("z",), by="on"))
    one = GAMM(Formula("y", (Smooth(("x",), "ps", 8, by="on"),))).fit(frame)
    assert one.terms_[-1].size == 8
    model = GAMM(Formula("y", terms)).fit(frame)
    assert any("s(z):on" in note for note in model.notes_)
    assert model.predict(frame.assign(on=0.0), exclude=["s(x)"]) == pytest.approx(model.coef_[0])


def test_an_ordered_factor_gives_centred_differences_from_its_lowest_level(frame):
    levels = ["b", "a", "c"]
    ordered = frame.assign(w=pd.Categorical(frame["w"], levels, ordered=True))
    model = GAMM(Formula("y", (X, Smooth(("x",), "ps", 8, by="w")))).fit(ordered)
    assert [fitted.label for fitted in model.terms_] == ["(Intercept)", "s(x)", "s(x):wa", "s(x):wc"]
    terms = model.predict(ordered, terms=True)
    for level in "ac":
        part = terms[f"s(x):w{level}"]
        assert (part[ordered["w"] != level] == 0).all()
        own = GAMM(Formula("y", (Smooth(("x",), "ps", 8),))).fit(frame)
        matrix = model.terms_[[t.label for t in model.terms_].index(f"s(x):w{level}")].matrix(
            ordered.assign(w=level)
        )
        assert np.abs(matrix.sum(axis=0)).max() < 1e-8  # centred over all rows, as every smooth
        assert matrix == pytest.approx(own.terms_[1].matrix(frame))
    assert set(model.training_.within) == {(("x",), "w", "a"), (("x",), "w", "c")}
    unordered = GAMM(Formula("y", (X, Smooth(("x",), "ps", 8, by="w")))).fit(frame)
    assert [fitted.label for fitted in unordered.terms_][2:] == ["s(x):wa", "s(x):wb", "s(x):wc"]


def test_an_ordered_factor_of_many_rows_has_the_same_columns(frame, monkeypatch):
    ordered = frame.assign(w=pd.Categorical(frame["w"], ["b", "a", "c"], ordered=True))
    formula = Formula("y", (X, Smooth(("x",), "ps", 8, by="w")))
    together = GAMM(formula).fit(ordered)
    held_out = GAMM(formula).leave_groups_out(ordered, groups="g")
    monkeypatch.setattr("tripwatt_gamm.design.MAX_TABLE_CELLS", 0)
    apart = GAMM(formula).fit(ordered)
    assert apart.coef_ == pytest.approx(together.coef_, abs=1e-9)
    assert GAMM(formula).leave_groups_out(ordered, groups="g") == pytest.approx(held_out, abs=1e-8)


def test_levels_without_rows_are_zero(frame):
    formula = Formula("y", (Parametric("w"), Smooth(("x",), "ps", 8, by="w")))
    wide = frame.assign(w=pd.Categorical(frame["w"], ["a", "b", "c", "fog"]))
    model = GAMM(formula).fit(wide)
    assert "wfog" in model.empty_columns_
    i = model.coef_names_.index("wfog")
    assert (model.coef_[i], model.Vp_[i, i], model.edf_[i]) == (0, 0, 0)
    assert sum(name.startswith("s(x):wfog") for name in model.empty_columns_) == 7
    assert np.isnan(model.smoothing_parameters_["s(x):wfog"])


def test_discretised_points_stay_within_half_a_step():
    x = np.random.default_rng(0).normal(size=(5000, 2))
    limit = grid_limit(x, 1000)
    points = Points.from_values(x, (limit, limit))
    assert len(points.values) <= 10_000
    step = np.ptp(x, axis=0) / (limit - 1)
    assert (np.abs(points.values[points.index] - x) <= step / 2 + 1e-12).all()
    assert points.counts.sum() == 5000


@pytest.mark.parametrize(
    ("change", "formula", "words"),
    [
        ({"x": 1.0}, Formula("y", (X,)), ["constant covariate", "s(x)"]),
        ({"x": np.nan}, Formula("y", (X,)), ["not finite", "s(x)", "240 rows"]),
        ({"z": np.inf}, FULL, ["not finite", "'z'", "s(x,z)"]),
        ({"y": 3.0}, Formula("y", (X,)), ["constant response"]),
        ({"y": np.inf}, Formula("y", (X,)), ["not finite", "response"]),
        ({"g": "only"}, FULL, ["only one group", "s(g)"]),
        ({"w": "only"}, FULL, ["one level", "w"]),
        ({"w": None}, FULL, ["missing level", "'w'"]),
        (
            {"w": pd.Categorical(["a"] * 240, ["a"], ordered=True)},
            Formula("y", (Smooth(("x",), by="w"),)),
            ["factor with one level: s(x):w: got a; allowed: at least two"],
        ),
        ({"x": "text"}, Formula("y", (X,)), ["not numeric", "s(x)"]),
        (
            {},
            Formula("y", (Smooth(("speed",)), Parametric("wether"))),
            ["unknown column", "'speed'", "'wether'"],
        ),
        ({}, Formula("q", (X,)), ["unknown column", "'q'"]),
        ({}, Formula("y", (X, X)), ["term given twice", "s(x)"]),
        ({}, Formula("y", (Smooth(("x",), "ps", 3),)), ["k too small", "s(x)"]),
        ({"z": lambda f: 2 * f["x"]}, Formula("y", (Smooth(("x", "z"), k=10),)), ["collinear", "s(x,z)"]),
        ({"x": lambda f: np.sign(f["x"])}, Formula("y", (X,)), ["too few distinct", "s(x)"]),
    ],
)
def test_bad_input_is_named(frame, change, formula, words):
    with pytest.raises(InvalidInput) as caught:
        GAMM(formula).fit(frame.assign(**change))
    for word in words:
        assert word in str(caught.value)


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


def test_predict_and_options_say_what_is_wrong(frame, model):
    with pytest.raises(InvalidInput, match=r"unknown column.*'x'"):
        model.predict(frame.drop(columns="x"))
    with pytest.raises(InvalidInput, match="not finite"):
        model.predict(frame.assign(x=np.nan))
    with pytest.raises(InvalidInput, match="unknown term"):
        model.predict(frame, exclude=["s(trip)"])
    with pytest.raises(InvalidInput, match="unknown family"):
        GAMM(FULL, "poisson").fit(frame)
    with pytest.raises(InvalidInput, match="no score for a correlation"):
        GAMM(FULL, "scat", ar1_rho="estimate").fit(frame)
    with pytest.raises(InvalidInput, match=r"invalid smoothing parameters.*s\(x,z\)"):
        GAMM(FULL, smoothing_parameters=[1.0]).fit(frame)
    with pytest.raises(InvalidInput, match="only one group"):
        GAMM(Formula("y", (X,))).leave_groups_out(frame, groups=np.zeros(len(frame)))
    with pytest.raises(InvalidInput, match="wrong length"):
        GAMM(FULL).fit(frame, frame["y"][:-1])


def test_a_fit_that_did_not_converge_says_so(frame):
    model = GAMM(FULL, "scat", max_iter=2).fit(frame)
    assert not model.converged_
    assert "2" in model.message_
    assert "max_iter" in model.message_
    assert np.isfinite(model.fitted_values_).all()


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
            "invalid groups: at_folds=: got 240 labels for 240 rows, 240 unknown",
        ),
        (lambda f: f, None, "got 0 labels for 240 rows"),
        (lambda f: f, "day", "unknown column: 'day'"),
        (lambda f: f.drop(columns="x"), "g", "unknown column: 'x'"),
        (lambda f: f.assign(z=np.nan), "g", "not finite: column 'z'"),
    ],
)
def test_rows_that_cannot_be_predicted_are_named(frame, change, folds, words):
    with pytest.raises(InvalidInput, match=words):
        GAMM(FULL).leave_groups_out(frame, groups="g", at=change(frame), at_folds=folds)


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
