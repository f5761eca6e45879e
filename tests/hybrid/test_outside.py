"""Correctors from outside: what they are fitted to, and what of them counts."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression, LogisticRegression, Ridge
from tests.hybrid.tables import table as some_table

from tripwatt.errors import InvalidInput
from tripwatt.hybrid import PowerCorrector, power_corrector, segment_trips
from tripwatt.hybrid.correctors import corrector_name
from tripwatt.hybrid.outside import ENTRY_POINTS, TableCorrector, fitted_outside
from tripwatt.hybrid.power import TREE_FEATURES
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
from tripwatt.vehicles import load_vehicle


@pytest.fixture(scope="module")
def segments():
    return segment_trips(synthetic_fleet(6).trips, load_vehicle(VEHICLE))


class Mean:
    """The mean residual power."""

    def fit(self, table):
        self.mean_w = float(np.average(table.residual_w, weights=table.hours))

    def predict(self, table):
        return np.full(len(table.hours), self.mean_w)


class Sure(Mean):
    """With the methods that a corrector may have."""

    def __init__(self, factor_w=1.0):
        self.factor_w = factor_w

    def clone_tuned(self):
        return Sure(2.0 * self.factor_w)

    def predict_with_uncertainty(self, table):
        return self.predict(table), np.full((len(table.hours), 1), self.factor_w)

    def outside_factor(self, table):
        return np.full((len(table.hours), 2), 3.0 * self.factor_w)

    def predict_climate(self, table):
        return 0.5 * self.predict(table)


def test_a_regressor_is_fitted_to_the_features_and_the_residual_power(segments):
    made = LinearRegression()
    corrector = power_corrector(made).fit(segments)
    X = segments.features[list(TREE_FEATURES)].to_numpy()
    X = np.where(np.isfinite(X), X, np.nan_to_num(np.nanmedian(X, axis=0)))
    ours = LinearRegression().fit(X, segments.residual_w).predict(X)
    assert corrector.predict(segments) == pytest.approx(ours, rel=1e-6, abs=1e-3)
    assert not hasattr(made, "coef_")
    assert fitted_outside(corrector).coef_.shape == (len(TREE_FEATURES),)
    own = corrector.clone_tuned()
    assert fitted_outside(own) is None
    assert own.fit(segments).predict(segments) == pytest.approx(ours, rel=1e-6, abs=1e-3)


def test_the_correction_of_a_regressor_fades_outside_of_its_training(segments):
    corrector = power_corrector(Ridge()).fit(segments)
    far = segments.features.assign(ambient_temperature_degc=-60.0)
    assert corrector.familiarity.share(far).max() < 0.5
    import dataclasses

    table = dataclasses.replace(segments, features=far)
    plain = corrector.model.predict(far[list(TREE_FEATURES)])
    assert corrector.predict(table) == pytest.approx(plain * corrector.familiarity.share(far))


def test_an_object_on_tables_is_copied_for_each_fit(segments):
    made = Mean()
    corrector = power_corrector(made).fit(segments)
    mean_w = np.average(segments.residual_w, weights=segments.hours)
    assert corrector.predict(segments) == pytest.approx(np.full(len(segments.hours), mean_w))
    assert not hasattr(made, "mean_w")
    power_w, factor_w = corrector.predict_with_uncertainty(segments)
    assert (power_w == corrector.predict(segments)).all()
    assert factor_w.tolist() == np.zeros((len(segments.hours), 1)).tolist()
    assert corrector.outside_factor(segments).tolist() == np.zeros((len(segments.hours), 1)).tolist()
    assert corrector.predict_climate(segments) is None
    assert not hasattr(corrector.clone_tuned().model, "mean_w")


def test_the_other_methods_of_an_object_count(segments):
    corrector = power_corrector(Sure()).fit(segments)
    assert corrector.predict_with_uncertainty(segments)[1].max() == 1.0
    assert corrector.outside_factor(segments).tolist() == np.full((len(segments.hours), 2), 3.0).tolist()
    assert corrector.predict_climate(segments) == pytest.approx(0.5 * corrector.predict(segments))
    assert corrector.clone_tuned().fit(segments).predict_with_uncertainty(segments)[1].max() == 2.0


def test_the_empty_methods_of_the_base_class_count_as_none(segments):
    class Own(Mean, PowerCorrector):
        pass

    corrector = power_corrector(Own()).fit(segments)
    again = corrector.clone_tuned().fit(segments)
    assert again.predict(segments).tolist() == corrector.predict(segments).tolist()
    assert corrector.predict_with_uncertainty(segments)[1].max() == 0.0


def test_a_wrong_prediction_is_refused():
    class Short(Mean):
        def predict(self, table):
            return np.zeros(1)

    with pytest.raises(InvalidInput, match=r"predict of Short: got shape \(1,\); allowed: shape \(3,\)"):
        TableCorrector(Short()).predict(some_table([3], [0.1] * 3))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (Ridge, r"class in place of an object: corrector: got Ridge; allowed: Ridge\(\)"),
        (3, "object cannot be fitted: corrector: got 3; allowed: a regressor"),
        (
            LogisticRegression(),
            "object cannot be fitted: corrector: got the classifier LogisticRegression; allowed: a regressor",
        ),
        ("sgd", "unknown corrector: corrector: got 'sgd'; allowed: linear, gp"),
    ],
)
def test_what_is_no_corrector_is_refused(wrong, message):
    with pytest.raises(InvalidInput, match=message):
        power_corrector(wrong)


def test_an_installed_package_names_its_correctors(tmp_path, monkeypatch, segments):
    (tmp_path / "own_corrector.py").write_text(
        "from sklearn.linear_model import Ridge\n\n\ndef ridge(seed):\n    return Ridge(random_state=seed)\n"
    )
    about = tmp_path / "own-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: own\nVersion: 1\n")
    (about / "entry_points.txt").write_text(f"[{ENTRY_POINTS}]\nown-ridge = own_corrector:ridge\n")
    monkeypatch.syspath_prepend(tmp_path)
    corrector = power_corrector("own-ridge", 7).fit(segments)
    assert fitted_outside(corrector).random_state == 7
    with pytest.raises(InvalidInput, match=r"got 'other'; allowed: .*, own-ridge"):
        power_corrector("other")


def test_names():
    assert (corrector_name("split"), corrector_name(Ridge())) == ("split", "Ridge")
