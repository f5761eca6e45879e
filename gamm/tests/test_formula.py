"""Formulas: what is read, that it is written back the same, and what every complaint says."""

import pandas as pd
import pytest

from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.formula import parse_formula
from tripwatt_gamm.model import GAMM
from tripwatt_gamm.terms import Formula, Parametric, RandomEffect, Smooth, Tensor


def test_the_papers_formula():
    formula = parse_formula(
        """Energy ~ Weather + s(Time) + s(Ambient) + s(Time, by=winter)
             + ti(a, b, bs=c("ps", "ps"), k=6) + s(Ambient, Diff_elevation, k=30) + s(Trip, bs='re') - 1"""
    )
    assert formula == Formula(
        "Energy",
        (
            Parametric("Weather"),
            Smooth(("Time",)),
            Smooth(("Ambient",)),
            Smooth(("Time",), by="winter"),
            Tensor(("a", "b"), "ps", (6, 6), "ti"),
            Smooth(("Ambient", "Diff_elevation"), k=30),
            RandomEffect("Trip"),
        ),
        intercept=False,
    )


def test_random_effects_of_lme4_and_of_mgcv():
    formula = parse_formula("y ~ (1 | g) + (x + `my x` | h) + (1 + z | a.b) + s(g, f, x, bs='re')")
    apart = parse_formula("y ~ (1 + x + z || g)").terms
    assert apart == (RandomEffect("g"), RandomEffect("g", ("x",)), RandomEffect("g", ("z",)))
    assert formula.terms == (
        RandomEffect("g"),
        RandomEffect("h", ("x", "my x"), correlated=True),
        RandomEffect("a.b", ("z",), correlated=True),
        RandomEffect("g", ("f", "x")),
    )
    shown = str(parse_formula("y ~ -1 + s(t, by=f) + offset(`a b`) + w:x"))
    assert shown == "y ~ s(t):f + w:x + offset(a b) + 0"


@pytest.mark.parametrize(
    ("text", "labels"),
    [
        ("a*b", "a b a:b"),
        ("a/b", "a a:b"),
        ("a*b*c", "a b a:b c a:c b:c a:b:c"),
        ("(a + b)/c", "a b a:b:c"),
        ("a*(b + c)", "a b c a:b a:c"),
        ("a : `b`:c + a*a", "a:b:c a"),
    ],
)
def test_products_of_columns(text, labels):
    assert [term.label for term in parse_formula(f"y ~ {text}").terms] == labels.split()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("y ~ s(time", ["cannot be read", "at character 10", "never closed"]),
        ("y ~ a + daytime + b +* c", ["near 'daytime + b +* c' at character 22"]),
        ("y ~ s(time):winter", ["cannot be read", "s(x, by=f)"]),
        ("y = s(time)", ["wrong number of ~", "0 of them"]),
        ("y ~ a ~ b", ["wrong number of ~", "2 of them"]),
        ("log(y) ~ a", ["response is not a column", "log(y)"]),
        ("y ~ smooth(time)", ["unknown function", "'smooth(time)' at character 5", "s(), te(), ti()"]),
        ("y ~ `ü b` + q(x)", ["'q(x)' at character 13"]),
        (
            "y ~ s(time, bs='pss')",
            ["unknown basis", "bs='pss'", '"tp", "ps", "cr", "cc", "fs", "re"', "did you mean ps"],
        ),
        ("y ~ s(time, kk=3)", ["unknown argument", "got kk", "bs, k, by"]),
        ("y ~ s(time, k=2.5)", ["k is no whole number", "2.5"]),
        ("y ~ s(time, k=c(3, 4))", ["k takes one number"]),
        ("y ~ ti(a, b, k=c(3, 4, 5))", ["3 numbers for 2 covariates"]),
        ("y ~ ti(a)", ["two or more covariates"]),
        ("y ~ s(a, b, bs='ps')", ["basis of one covariate only", 'te(a, b, bs="ps")']),
        ("y ~ s(trip, bs='re', k=3)", ["takes columns only", "got k"]),
        ("y ~ 1 + x | g", ["without brackets", "(1 + x | group)"]),
        ("y ~ a + (1 + x | g + h)", ["cannot be read", "'1 + x | g + h' at character 10"]),
        ("y ~ (1 + x * z | g)", ["cannot be read", "(1 + x | group)"]),
        ("y ~ (0 + x | g)", ["cannot be read"]),
        ("y ~ (1 - x | g)", ["cannot be read"]),
        ("y ~ (1 + x + x | g)", ["cannot be read"]),
        ("y ~ (1 + g | g)", ["cannot be read"]),
        ("y ~ s(a, a)", ["column given twice"]),
        ("y ~ s()", ["a smooth takes columns"]),
        ("y ~ `a b`:c * s(b)", ["not a term", "'s(b)' at character 15", "interaction of smooths"]),
        ("y ~ s(a, bs='fs')", ["a factor-smooth takes two columns", 's(x, f, bs="fs")']),
        ("y ~ offset(a, b) + a", ["an offset is one column", "'offset(a, b)' at character 5"]),
        ("y ~ (1 + a || b) + (1 + c || d + e)", ["'1 + c || d + e' at character 21"]),
        ("y ~ a - b", ["only the intercept can be taken away", "- b"]),
        ("y ~ ", ["no terms", "-1, joined by +"]),
    ],
)
def test_complaint_names_term_position_and_what_is_allowed(text, words):
    with pytest.raises(InvalidInput) as caught:
        parse_formula(text)
    for word in words:
        assert word in str(caught.value)


def test_all_faults_travel_together():
    with pytest.raises(InvalidInput) as caught:
        parse_formula("y ~ f(a) + s(b, k=0) + s(c, bs=9)")
    assert [fault.what for fault in caught.value.faults] == [
        "unknown function",
        "k is no whole number",
        "unknown basis",
    ]


def test_fit_names_near_matches_of_an_unknown_column():
    frame = pd.DataFrame({"time": [1.0, 2.0, 3.0], "season": ["a", "b", "a"], "y": [1.0, 2.0, 4.0]})
    with pytest.raises(
        InvalidInput, match=r"'tme'.*did you mean time\?[\s\S]*'seasn'.*did you mean season\?"
    ):
        GAMM("y ~ s(tme, by=seasn)").fit(frame)
