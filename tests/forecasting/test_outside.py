"""Forecasts with a corrector from outside: intervals, updates, storage."""

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import Ridge

import tripwatt as tw
from tripwatt.hybrid.power import PowerCorrector
from tripwatt.study.synthetic import synthetic_fleet

CAR = "bmw_i3_60ah"


@pytest.fixture(scope="module")
def trips():
    return synthetic_fleet(14).trips


@pytest.fixture(scope="module")
def model(trips):
    boosting = HistGradientBoostingRegressor(max_iter=20, max_leaf_nodes=4)
    return tw.fit(trips[:12], CAR, corrector=boosting, identified=False)


class Mean:
    def fit(self, table):
        self.mean_w = float(table.residual_w.mean())

    def predict(self, table):
        return np.full(len(table.hours), self.mean_w)


class Nothing(PowerCorrector):
    def fit(self, table):
        return self

    def predict(self, table):
        return np.zeros(len(table.hours))


def test_intervals_widen_with_what_they_cover_and_updates_narrow_them(model, trips):
    before = model.forecast(trips[13])
    widths = [np.diff(before.interval(level))[0] for level in (0.5, 0.8, 0.9)]
    assert 0.0 < widths[0] < widths[1] < widths[2]
    half = trips[13].samples.iloc[: len(trips[13].samples) // 2]
    after = before.update(half)
    assert np.diff(after.interval(0.9))[0] < widths[2]
    assert len(model.held_out_) == 12


def test_held_out_errors_are_those_of_fits_without_the_trip(trips):
    """Without a correction the error is that of the physics; a mean of the others is no mean of its own trip."""
    bare = tw.fit(trips[:12], CAR, corrector=Nothing(), identified=False)
    mean = tw.fit(trips[:12], CAR, corrector=Mean(), identified=False)
    from tripwatt.hybrid import segment_trips

    table = segment_trips(trips[:12], bare.vehicle)
    simulated = table.totals_wh(table.simulated_w)
    assert [trip.predicted_wh for trip in bare.held_out_] == pytest.approx(simulated.tolist())
    added_w = [
        (trip.predicted_wh - simulated[i]) / table.totals_wh(np.ones(len(table.hours)))[i]
        for i, trip in enumerate(mean.held_out_)
    ]
    assert max(abs(w - mean.outside.mean_w) for w in added_w) > 1.0
    assert np.mean(added_w) == pytest.approx(mean.outside.mean_w, rel=0.2)


@pytest.mark.parametrize("kind", ["regressor", "table"])
def test_a_stored_model_needs_the_fitted_object_that_it_had(model, trips, tmp_path, kind):
    stored = model if kind == "regressor" else tw.fit(trips[:12], CAR, corrector=Mean(), identified=False)
    tw.save_model(stored, tmp_path / "model")
    again = tw.load_model(tmp_path / "model", corrector=stored.outside)
    one, two = again.forecast(trips[13]), stored.forecast(trips[13])
    assert one.to_dict() == two.to_dict()
    assert repr(again) == repr(stored)
    name = type(stored.outside).__name__
    with pytest.raises(tw.InvalidInput, match=f"model lacks its corrector: .* a fitted {name}"):
        tw.load_model(tmp_path / "model")
    for other in (Mean(), Ridge(), HistGradientBoostingRegressor()):
        with pytest.raises(tw.InvalidInput, match=r"another corrector: .* fitted with the model"):
            tw.load_model(tmp_path / "model", corrector=other)
    assert not any(b"sklearn" in file.read_bytes() for file in (tmp_path / "model").iterdir())


def test_a_model_with_a_corrector_of_its_own_takes_no_other(tmp_path, trips):
    own = tw.fit(trips[:9], CAR, corrector="linear", identified=False)
    tw.save_model(own, tmp_path / "model")
    assert own.outside is None
    with pytest.raises(tw.InvalidInput, match="corrector has no effect: corrector: got Ridge"):
        tw.load_model(tmp_path / "model", corrector=Ridge())


def test_a_model_with_a_corrector_from_outside_is_adapted_and_told(model, trips):
    adapted = tw.adapt(model, trips[:2], "vw_id3")
    assert adapted.forecast(trips[13]).energy_wh > 0.0
    assert repr(model) == "<ForecastModel BMW i3 60 Ah, HistGradientBoostingRegressor corrector, 12 trips>"
    assert model.to_dict()["corrector"] == "HistGradientBoostingRegressor"
