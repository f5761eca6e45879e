"""The model matrix: factors, smooths by factors, levels without rows, and input that cannot be used."""

import numpy as np
import pandas as pd
import pytest

from gamm_samples import FULL, X, clustered, study
from tripwatt_gamm import GAMM, Formula, Parametric, Smooth
from tripwatt_gamm.errors import InvalidInput


def test_factor_smooths_and_parametric_levels_agree_with_least_squares():
    frame = clustered(1).assign(w=lambda f: np.where(f["z"] > 0, "hi", "lo"))
    formula = Formula("y", (Parametric("w"), Parametric("z"), Smooth(("x",), "ps", 5, by="w")))
    model = GAMM(formula, smoothing_parameters=[1e-10, 1e-10]).fit(frame)
    X = np.hstack([fitted.matrix(frame) for fitted in model.terms_])
    beta = np.linalg.lstsq(X, frame["y"], rcond=None)[0]
    assert model.fitted_values_ == pytest.approx(X @ beta, abs=1e-6)


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
    terms = model.predict_terms(ordered)
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


def test_levels_without_rows_are_zero(frame):
    formula = Formula("y", (Parametric("w"), Smooth(("x",), "ps", 8, by="w")))
    wide = frame.assign(w=pd.Categorical(frame["w"], ["a", "b", "c", "fog"]))
    model = GAMM(formula).fit(wide)
    assert "wfog" in model.empty_columns_
    i = model.coef_names_.index("wfog")
    assert (model.coef_[i], model.Vp_[i, i], model.edf_[i]) == (0, 0, 0)
    assert sum(name.startswith("s(x):wfog") for name in model.empty_columns_) == 7
    assert np.isnan(model.smoothing_parameters_["s(x):wfog"])


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


def test_what_cannot_be_fitted_is_named():
    frame = study("sleepstudy")
    with pytest.raises(InvalidInput, match=r"correlated effects of unlike size.*\(1\+days\|subject\).*units"):
        GAMM("reaction ~ days + (1 + days | subject)").fit(frame.assign(days=frame["days"] * 1e-6))
    with pytest.raises(InvalidInput, match="not numeric: column 'days'"):
        GAMM("reaction ~ (1 + days | subject)").fit(frame.assign(days=frame["days"].astype(str)))
    with pytest.raises(InvalidInput, match="no score for a correlation"):
        GAMM("reaction ~ days + (1 + days | subject)", "scat").fit(frame)
    scores = study("machines")
    broken = scores.assign(machine=scores["machine"].where(scores["machine"] != "B"))
    with pytest.raises(InvalidInput, match="a number before a factor"):
        GAMM('score ~ s(worker, machine, bs="re")').fit(scores.astype({"worker": int}))
    with pytest.raises(InvalidInput, match="missing level: column 'machine'"):
        GAMM('score ~ s(worker, machine, bs="re")').fit(broken)


def test_rounded_slopes_of_many_rows_change_next_to_nothing(monkeypatch):
    frame = pd.concat([clustered(i) for i in range(4)], ignore_index=True)
    formula = 'y ~ x + z + s(g, bs="re") + s(g, x, bs="re")'
    exact = GAMM(formula).fit(frame)
    monkeypatch.setattr("tripwatt_gamm.design.EXACT_ROWS", 0)
    monkeypatch.setattr("tripwatt_gamm.design.MAX_VALUES", 200)
    rounded = GAMM(formula).fit(frame)
    assert np.abs(exact.fitted_values_ - rounded.fitted_values_).max() < 0.05 * frame["y"].std()
    assert rounded.edf_.sum() == pytest.approx(exact.edf_.sum(), abs=0.1)
