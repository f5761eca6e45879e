"""What the fitted GAMM says of itself."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import PhysicsOnly
from tripwatt.hybrid.trip_table import TripTable, build_table
from tripwatt.study.paper import HybridModel, Table2Corrector
from tripwatt.study.paper.insight import insight
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.vehicles import load_vehicle
from tripwatt_gamm import RandomEffects

GAMM = {"gamm": HybridModel(Table2Corrector(), "physics-paper")}


@pytest.fixture(scope="module")
def table() -> TripTable:
    car = {"physics-paper": load_vehicle("bmw_i3_60ah", preset="paper")}
    return build_table(synthetic_fleet(n_trips=6, seed=3).trips, car)


def test_gamm_is_kept_with_its_numbers(table: TripTable) -> None:
    found = insight(table, GAMM)
    assert found is not None
    assert found.summary.n == len(found.diagnosis.residual)
    assert found.row_step_s == 60.0
    (trips,) = (e for e in found.effects.values() if isinstance(e, RandomEffects))
    assert set(trips.level) == set(table.trip_ids)
    model = GAMM["gamm"].fit(table).corrector.model_
    by_number = dict(zip(model.levels_["trip"], model.coef_[model.terms_[-1].slice], strict=True))
    shown = dict(zip(trips.level, trips.effect, strict=True))
    for number, name in enumerate(table.trip_ids):
        assert shown[name] == pytest.approx(by_number[str(number)], rel=1e-6)


def test_a_weather_of_the_data_set_that_no_trip_has_is_shown_as_zero(table: TripTable) -> None:
    found = insight(table, GAMM, weathers=("never seen",))
    assert found is not None
    never = found.summary.parametric.loc["weathernever seen"]
    assert never[["estimate", "std_error"]].tolist() == [0.0, 0.0]
    assert np.isnan(never["p_value"])


def test_a_run_without_gamm_has_none(table: TripTable) -> None:
    assert insight(table, {"physics-paper": PhysicsOnly("physics-paper")}) is None


def test_a_level_without_data_predicts_like_one_never_declared(table: TripTable) -> None:
    X, groups = table.covariates, table.groups
    y = table.observed_wh - table.simulated_wh["physics-paper"]
    declared = X.assign(weather=X["weather"].cat.add_categories(["hail"]))
    hail = declared.assign(weather=pd.Categorical(["hail"] * len(X), categories=["hail"]))
    with_level = Table2Corrector(every_rows=10).fit(declared, y, groups).predict(hail)
    without = Table2Corrector(every_rows=10).fit(X, y, groups).predict(hail)
    np.testing.assert_allclose(with_level, without, rtol=1e-4, atol=0.1)


def test_terms_that_cannot_vary_are_left_out_and_named(table: TripTable) -> None:
    same = table.covariates.assign(
        ambient_temperature_degc=20.0, weather=pd.Categorical(["sunny"] * len(table.covariates))
    )
    flat = replace(table, covariates=same)
    found = insight(flat, GAMM, weathers=("rainy",))
    assert found is not None
    assert set(found.left_out) == {
        "weather",
        "s(ambient_temperature_degc)",
        "s(ambient_temperature_degc, by=season)",
        "s(ambient_temperature_degc, elevation_difference_m, k=30)",
    }
    assert not any("ambient" in term for term in found.summary.smooth.index)


def test_evaluation_draws_nothing() -> None:
    code = "import sys, tripwatt.study.evaluation.run, tripwatt_gamm; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
