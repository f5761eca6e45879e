"""Correctors as they are stored."""

from functools import partial

import numpy as np
import pytest
from sklearn.linear_model import Ridge
from tests.hybrid.tables import EXACT, table
from tests.support.refusals import refusal

from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.correctors import power_corrector
from tripwatt.hybrid.outside import TableCorrector
from tripwatt.hybrid.power import PowerCorrector, SplitCorrector
from tripwatt.hybrid.stored import (
    MAX_MEMBERS,
    REFIT,
    StoredTrees,
    new_converter,
    parts_tree,
    structured,
    tree_parts,
    value_faults,
    with_outside,
)
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.vehicles import load_vehicle

KINDS = "gp, ensemble, split, factors, trees, covariates"


@pytest.mark.parametrize(("divisor", "expected"), [(None, [105.0, 106.0]), (4, [2.5, 2.75])])
def test_stored_trees(divisor, expected) -> None:
    class Trees:
        """One column instead of trees."""

        def __len__(self) -> int:
            return 0

        def sum(self, X: np.ndarray) -> np.ndarray:
            return X[:, 0]

    trees = Trees()
    stored = StoredTrees(
        trees, ("row",), 100.0 if divisor is None else 0.0, 5.0 if divisor is None else 10.0, divisor
    )
    own = table([2], [0.1, 0.1])
    assert stored.predict(own) == pytest.approx(expected, **EXACT)
    assert stored.predict_with_uncertainty(own)[1].tolist() == [[0.0], [0.0]]
    assert stored.outside_factor(own).tolist() == [[0.0]] * 2


@pytest.mark.parametrize(("low", "high", "is_right"), [(1.0, 3.0, True), (2.0, 2.0, True), (3.0, 1.0, False)])
def test_the_ends_of_a_stored_range_are_in_order(low, high, is_right):
    faults = [*value_faults({"climate": [{"low": low, "high": high}]})]
    assert [fault.what for fault in faults] == ([] if is_right else ["values out of order"])
    assert all(f"low and high [{low}, {high}]" == fault.got for fault in faults)
    curve = [*value_faults({"factors": {"length_m": np.array([1.0, low, high])}})]
    assert [f.got for f in curve] == [] if is_right and low >= 1.0 else ["a value below the one before"]


@pytest.fixture(scope="module")
def driven():
    return segment_trips(synthetic_fleet(6, seed=2).trips, load_vehicle("bmw_i3_60ah"))


@pytest.fixture(scope="module")
def fitted(driven):
    found = {name: power_corrector(name).fit(driven) for name in ("linear", "boosting", "ensemble", "split")}
    forest = power_corrector("forest")
    forest.model.n_trees = 9
    return found | {
        "forest": forest.fit(driven),
        "both": SplitCorrector(found["linear"], found["ensemble"], found["linear"], True),
        "ridge": power_corrector(Ridge()).fit(driven),
    }


def stored(corrector):
    return new_converter().unstructure(corrector, unstructure_as=PowerCorrector)


def read(values):
    return structured(values, PowerCorrector, new_converter(), "a corrector")


@pytest.mark.parametrize("name", ["linear", "boosting", "ensemble", "split", "forest", "both", "ridge"])
def test_a_corrector_that_was_stored_corrects_to_the_last_bit(fitted, driven, name):
    values = parts_tree(tree_parts({"own": stored(fitted[name]), "most": np.inf}))
    assert values["most"] == np.inf
    outside = fitted[name].model.regressor_ if name == "ridge" else None
    again = with_outside(read(values["own"]), outside)
    for found, expected in zip(
        again.predict_with_uncertainty(driven), fitted[name].predict_with_uncertainty(driven), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(again.outside_factor(driven), fitted[name].outside_factor(driven))


@pytest.mark.parametrize(
    ("name", "place", "wrong", "message"),
    [
        ("linear", "kind", "gpx", f"unknown kind of corrector: kind: got 'gpx'; allowed: {KINDS}; did you mean 'gp'?"),
        ("linear", "shape", np.zeros(3), "wrong shape of an array: shape: got (3,); allowed: (8,)"),
        ("linear", "shape", 3.0, "TypeError: got 3.0, not an array"),
        ("linear", "shape", np.zeros(8, dtype=int), "TypeError: got an array of int64, not of float64"),
        ("linear", "share_column", 7, "TypeError: got 7, not str"),
        ("boosting", "columns", ("air_w",), "; allowed: 0 to 0"),
        ("boosting", "start", "3", "parts do not make a corrector: start: got TypeError: got '3', not float"),
        ("boosting", "divisor", True, "divisor"),
        ("boosting", "more", 1, "more"),
        ("ensemble", "members", [{}] * (MAX_MEMBERS + 1), f"too many members: model.members: got {MAX_MEMBERS + 1}; allowed: at most {MAX_MEMBERS}; {REFIT}"),
        ("ensemble", "members", [{"kind": "linear"}], "unknown kind of corrector: kind: got 'linear'"),
        ("both", "drive", {"sd": -1.0}, f"value out of range: model.drive.sd: got -1; allowed: 0 to inf; {REFIT}"),
    ],
)  # fmt: skip
def test_a_damaged_corrector_is_refused_with_the_place_of_its_fault(fitted, name, place, wrong, message):
    assert message in refusal(read, {**stored(fitted[name]), place: wrong})


def test_what_cannot_be_stored_or_lacks_its_object_is_refused(fitted):
    assert refusal(stored, object()) == (
        "corrector cannot be stored: corrector: got object; allowed: linear, gp, boosting, forest, ensemble or split"
    )
    assert "got LearnerCorrector" in refusal(StoredTrees.from_learner, fitted["ridge"])
    whole = partial(with_outside, fitted["linear"])
    assert whole(None) is fitted["linear"]
    none = "corrector has no effect: corrector: got Ridge; allowed: the model is whole"
    assert refusal(whole, Ridge()) == none
    for made in (fitted["ridge"], TableCorrector(Ridge())):
        waiting = read(stored(made))
        assert refusal(with_outside, waiting, None).startswith(
            "model lacks its corrector: corrector: got none; allowed: a fitted Ridge; load_model(FOLDER"
        )
