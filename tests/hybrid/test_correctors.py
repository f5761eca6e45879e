"""Settings of the correctors."""

import pytest
from tests.hybrid.tables import CAUSES_W

from tripwatt.hybrid import power, power_corrector, segment_trips
from tripwatt.hybrid.correctors import TUNED
from tripwatt.hybrid.power import (
    CLIMATE_TERMS,
    DRIVE_TERMS,
    DRIVE_TREE_FEATURES,
    TREE_FEATURES,
    GPCorrector,
    boosting_corrector,
    forest_corrector,
)
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
from tripwatt.trips import TEMPERATURES
from tripwatt.vehicles import load_vehicle

TABLE = segment_trips(synthetic_fleet(8).trips, load_vehicle(VEHICLE))


def test_settings_that_stored_models_were_learned_with() -> None:
    """Terms: 10 % of each cause, 30 % of the simulated climate control; 100 and 200 W of smooth functions."""
    lines = [t for t in power.LINES if t.kind == "line"]
    assert [(t.columns, t.sd) for t in lines] == [((name,), 0.1) for name in CAUSES_W]
    for terms, watts in (
        (power.smooth_terms("joint"), 100.0),
        (CLIMATE_TERMS[1:], 200.0),
        (DRIVE_TERMS[len(CAUSES_W) - 1 :], 100.0),
    ):
        assert {(t.kind, t.sd) for t in terms} == {("smooth", watts)}
        assert [t.length for t in terms] == [1.0] * (len(terms) - 1) + [1.5]
    assert (CLIMATE_TERMS[0].kind, CLIMATE_TERMS[0].sd) == ("line", 0.3)
    driven = [t.columns[0] for t in DRIVE_TERMS if t.kind == "line"]
    assert driven == [name for name in CAUSES_W if name != "climate_w"]
    assert {t.sd for t in DRIVE_TERMS if t.kind == "line"} == {0.1}
    assert set(TREE_FEATURES) - set(DRIVE_TREE_FEATURES) == {"climate_w", *TEMPERATURES[1:3]}
    process = GPCorrector().model
    assert (process.effect_sd, process.share_sd) == (220.0, 0.05)
    boosted = boosting_corrector(3).model.get_params()
    assert {k: boosted[k] for k in ("max_leaf_nodes", "learning_rate", "max_features", "subsample")} == {
        "max_leaf_nodes": 4,
        "learning_rate": 0.05,
        "max_features": 0.6,
        "subsample": 0.7,
    }
    assert boosted["random_state"] == 3
    for chosen, kept in ((0, 1), (7, 7)):
        fitted = boosting_corrector(3).model
        fitted.n_rounds_ = chosen
        assert fitted.tuned().get_params() == boosted | {"n_rounds": kept, "n_folds": None}
    assert forest_corrector(3).model.n_trees == 200


@pytest.mark.parametrize("kind", TUNED)
def test_settings_without_a_fit_are_those_of_the_fit(kind: str) -> None:
    tuned, fitted = power_corrector(kind).tune(TABLE), power_corrector(kind).fit(TABLE)
    again = [each.clone_tuned().fit(TABLE).predict(TABLE).tolist() for each in (tuned, fitted)]
    assert again[0] == again[1]
    assert again[0] != power_corrector("linear").fit(TABLE).predict(TABLE).tolist()
