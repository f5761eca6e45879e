"""Covariates of a user's own, from the columns of logs to forecasts."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge
from tests.support.refusals import refusal, refuses

import tripwatt as tw
from tripwatt.forecasting.inner import inner_fits
from tripwatt.hybrid import power_corrector, segment_trips
from tripwatt.hybrid.covariates import CovariateCorrector
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet

NAMES = ("traffic", "driver")
CAR = tw.load_vehicle(VEHICLE)
TRAFFIC_W, BEN_W = 600.0, 1000.0


@pytest.fixture(scope="module")
def trips():
    """Trips whose power is higher by 600 W a step of the traffic, and by 1000 W with one of two drivers."""
    rng, tables = np.random.default_rng(1), {}
    for number, trip in enumerate(synthetic_fleet(20).trips):
        traffic, is_ben = float(rng.integers(0, 3)), bool(number % 2)
        more_w = TRAFFIC_W * (traffic - 1.0) + BEN_W * (is_ben - 0.5)
        table = trip.samples.assign(traffic=traffic, driver="ben" if is_ben else "anna")
        tables[trip.trip_id] = table.assign(current_a=table["current_a"] + more_w / table["voltage_v"])
    return tw.audit(tw.read_logs(tables)).trips


@pytest.fixture(scope="module")
def model(trips):
    return tw.fit(trips, CAR, corrector="linear", identified=False, covariates=NAMES)


@pytest.fixture(scope="module")
def table(trips):
    return segment_trips(trips, CAR)


def given(table, **values):
    """The first trip of a table with other covariates."""
    return replace(table.take([0]), covariates=pd.DataFrame([values]))


def test_planted_effects_are_recovered_and_told(trips, model):
    assert model.covariate_errors_["with"] < 0.7 * model.covariate_errors_["without"]
    plan = tw.Plan.from_trip(trips[0])
    hours = plan.duration_s / 3600.0

    def energy(traffic, driver):
        departure = tw.Departure(covariates={"traffic": traffic, "driver": driver})
        return model.forecast(plan, departure).energy_wh

    assert energy(2.0, "anna") - energy(0.0, "anna") == pytest.approx(2.0 * TRAFFIC_W * hours, rel=0.3)
    assert energy(1.0, "ben") - energy(1.0, "anna") == pytest.approx(BEN_W * hours, rel=0.3)
    assert "error without traffic, driver" in model._repr_html_()
    assert list(model.to_dict()["covariates"]) == ["traffic, driver"]


def test_an_unknown_covariate_is_integrated_over_the_training_trips(trips, model):
    plan = tw.Plan.from_trip(trips[0])
    bare = replace(plan, departure=replace(plan.departure, covariates=None))
    seen = [trip.departure.covariates for trip in trips]
    at = [model.forecast(plan, tw.Departure(covariates=values)) for values in seen]
    forecast = model.forecast(bare)
    assert forecast.energy_wh == pytest.approx(np.mean([each.energy_wh for each in at]), rel=1e-9)
    assert forecast.state_sd_wh == pytest.approx(np.std([each.energy_wh for each in at]), rel=1e-6)
    assert np.diff(forecast.interval(0.9)) > 1.1 * np.diff(at[0].interval(0.9))
    assert [flag.subject for flag in forecast.flags if flag.code == "covariate_unknown"] == [*NAMES]
    half = model.forecast(bare, tw.Departure(covariates={"traffic": 1, "driver": "a third"}))
    assert [flag.subject for flag in half.flags if flag.code == "covariate_unknown"] == ["driver"]
    assert 0.0 < half.state_sd_wh < forecast.state_sd_wh


def test_a_number_outside_of_the_training_trips_is_flagged(trips, model):
    """Words have no range: an unknown one is integrated out."""
    told = {}
    for traffic in (1.0, 2.0, 9.0):
        departure = tw.Departure(covariates={"traffic": traffic, "driver": "anna"})
        flags = model.forecast(trips[0], departure).flags
        told[traffic] = [f.subject for f in flags if f.code == "outside_training" and f.subject in NAMES]
    assert told == {1.0: [], 2.0: [], 9.0: ["traffic"]}
    assert ("traffic", [0.0, 2.0]) in model.to_dict()["training"].items()
    assert "0 to 2<" in model._repr_html_()


class OnTable:
    """An object of a user's own that reads a covariate by its name."""

    def fit(self, table):
        self.slope = np.polyfit(table.features["traffic"], table.residual_w, 1)

    def predict(self, table):
        return np.polyval(self.slope, table.features["traffic"])


@pytest.mark.parametrize("kind", ["linear", "boosting", "ensemble", "gamm", Ridge(1e-3), OnTable()])
def test_every_kind_of_corrector_uses_them_by_name(table, kind):
    corrector = CovariateCorrector(power_corrector(kind), NAMES).fit(table).clone_tuned().fit(table)
    low, high = (corrector.predict(given(table, traffic=level, driver="anna")).mean() for level in (0.0, 2.0))
    assert 0.2 * TRAFFIC_W < high - low < 3.0 * TRAFFIC_W


def test_words_and_scales_are_those_of_the_fold(table):
    """A word and a number of one trip do not reach the fit that scores this trip."""
    alone = table.covariates.assign(driver=["zoe", *table.covariates["driver"][1:]])
    strange = [
        replace(table, covariates=alone.assign(traffic=[t, *alone["traffic"][1:]])) for t in (1.0, 99.0)
    ]
    fits = []
    for each in strange:
        corrector = CovariateCorrector(power_corrector("linear"), NAMES).fit(each)
        assert corrector.levels == {"driver": ("anna", "ben", "zoe")}
        fits.append(next(f for f in inner_fits("linear", 0, corrector, each) if 0 in f.members).corrector)
    assert fits[0].levels == {"driver": ("anna", "ben")}
    assert fits[0].seen.tolist() == fits[1].seen.tolist()
    assert fits[0].predict(table).tolist() == fits[1].predict(table).tolist()


def test_a_stored_model_has_them(tmp_path, trips, model):
    tw.save_model(model, tmp_path / "model")
    again = tw.load_model(tmp_path / "model")
    assert (again.covariates, again.covariate_errors_) == (NAMES, model.covariate_errors_)
    plan = tw.Plan.from_trip(trips[0])
    bare = replace(plan, departure=replace(plan.departure, covariates=None))
    assert [again.forecast(p).energy_wh for p in (plan, bare)] == [
        model.forecast(p).energy_wh for p in (plan, bare)
    ]
    ridge = tw.fit(trips[:9], CAR, corrector=Ridge(), identified=False, covariates=["traffic"])
    tw.save_model(ridge, tmp_path / "ridge")
    back = tw.load_model(tmp_path / "ridge", corrector=ridge.outside)
    assert back.forecast(bare).energy_wh == ridge.forecast(bare).energy_wh


def test_names_that_are_wrong_are_told(trips, model):
    with pytest.raises(
        tw.InvalidInput, match=r"unknown covariate: covariates: got 'trafic'.* did you mean 'traffic'"
    ):
        tw.fit(trips, CAR, corrector="linear", covariates=["trafic"])
    taken = segment_trips(trips[:3], CAR)
    taken.covariates["air_w"] = 1.0
    found = refusal(CovariateCorrector(power_corrector("linear"), ("air_w",)).fit, taken)
    assert found == "name is taken: covariates: got air_w; allowed: another name of the column"
    with pytest.raises(tw.InvalidInput, match="unknown covariate: departure: got 'trafic'"):
        model.forecast(trips[0], tw.Departure(covariates={"trafic": 1.0}))
    with pytest.raises(tw.InvalidInput, match="covariates: got 'traffic'; allowed: a list of names"):
        tw.fit(trips, CAR, covariates="traffic")
    for wrong in ("traffic", {"traffic": None}, {1: 1.0}, {"traffic": np.nan}):
        refuses("wrong type: covariates", tw.Departure, covariates=wrong)
