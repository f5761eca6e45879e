"""The held-out runs: nothing leaks, nothing depends on chance, an interrupted run ends like any other."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid.trip_table import build_table
from tripwatt.learners.folds import leave_one_out
from tripwatt.study.evaluation import Execution, choose_models, evaluate, find_protocol, write_results
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.paper_protocol import PRESETS
from tripwatt.study.evaluation.table_models import TableMethod
from tripwatt.study.paper import HybridModel
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.vehicles import load_vehicle

FAST = ("constant", "linear4", "physics-paper", "physics", "physics4")


@pytest.fixture(scope="module")
def fleet():
    return synthetic_fleet(n_trips=10, seed=3)


@pytest.fixture(scope="module")
def table(fleet):
    cars = {name: load_vehicle("bmw_i3_60ah", preset=preset) for name, preset in PRESETS.items()}
    return build_table(fleet.trips, cars, step_s=5.0)


@pytest.fixture(scope="module")
def coarse(fleet):
    """Six trips: each model is fitted on them several times."""
    cars = {name: load_vehicle("bmw_i3_60ah", preset=preset) for name, preset in PRESETS.items()}
    return build_table(fleet.trips[:6], cars, step_s=15.0)


PAPER = find_protocol("paper")


def chosen(name):
    """A model of the paper's protocol; the GAMM takes every other row, because its few rows would fit anything; the forest has few trees."""
    (spec,) = choose_models(PAPER, (name,))

    def make(seed):
        model = spec.method.make(seed)
        if isinstance(model, HybridModel) and hasattr(model.corrector, "every_rows"):
            model.corrector.every_rows = 2
        if isinstance(model, HybridModel) and hasattr(model.corrector, "n_trees"):
            model.corrector.n_trees = 100
        return model

    return dataclasses.replace(spec, method=TableMethod(make))


@pytest.mark.parametrize("name", ["linear4", "physics4", "gamm", "forest", "boosting", "boosting-only"])
def test_the_held_out_energy_does_not_move_its_prediction(coarse, name):
    """Through the very function that the evaluation runs, not a copy of it."""
    folds, spec = np.arange(6) % 3, chosen(name)
    changed_wh = coarse.observed_wh.copy()
    rows = coarse.rows_of(np.flatnonzero(folds == 1))
    changed_wh[rows] = 7.0 * changed_wh[rows] + 321.0
    before, after = (
        of_folds(spec, which, folds)
        for which in (coarse, dataclasses.replace(coarse, observed_wh=changed_wh))
    )
    np.testing.assert_array_equal(before[1].predicted_wh, after[1].predicted_wh)
    assert not np.array_equal(before[0].predicted_wh, after[0].predicted_wh)


def of_folds(spec, table, folds):
    hold_out = HoldOut("s", "t", table, table, leave_one_out(folds))
    (task,) = spec.tasks(0, hold_out, hold_out.splits, 0)
    return task.run()


def test_corrections_start_from_the_simulation(coarse):
    table = coarse
    for name in ("forest", "boosting"):
        model = chosen(name).method.make(0).fit(table)
        perfect = dataclasses.replace(table, observed_wh=table.simulated_wh["physics-paper"])
        exact = chosen(name).method.make(0).fit(perfect).predict(perfect)
        np.testing.assert_allclose(exact, table.simulated_wh["physics-paper"], atol=1e-6)
        assert not np.allclose(model.predict(table), table.simulated_wh["physics-paper"], atol=1.0)


def test_regressions_recover_their_own_law(table):
    truth = (
        123.0 * table.totals["distance_km"]
        + 400.0 * table.totals["duration_h"]
        + 30.0 * table.totals["cold_h"]
    )
    lawful = dataclasses.replace(table, observed_wh=truth.to_numpy())
    model = choose_models(PAPER, ("linear4",))[0].method.make(0).fit(lawful.take(range(8)))
    np.testing.assert_allclose(model.predict(lawful), truth, rtol=1e-8, atol=1e-6)


def test_results_hold_the_contract(fleet, tmp_path):
    run = evaluate(fleet, models=FAST, execution=Execution(n_jobs=1))
    write_results(run, tmp_path)
    results = json.loads((tmp_path / "results.json").read_text())
    assert {"protocol", "seed", "versions", "audit", "evaluations", "paired"} <= set(results)
    schemes = {(e["scheme"], e["trips"]) for e in results["evaluations"]}
    assert ("leave_one_trip_out", "audited") in schemes
    assert any(scheme == "leave_one_day_out" for scheme, _ in schemes)
    for evaluation in results["evaluations"]:
        assert list(evaluation["models"]) == list(FAST)
        for name, model in evaluation["models"].items():
            assert model["mape_ci95"][0] <= model["mape"] <= model["mape_ci95"][1], name
            assert model["max_ape"] >= model["median_ape"] >= 0
            assert {"bias", "rmse_wh", "improved_share", "fit_s", "predict_ms"} <= set(model)
    folds = pd.read_csv(tmp_path / "folds.csv")
    energies = [
        f"{kind}_wh" for kind in ("observed_energy", "simulated_energy", "correction", "predicted_energy")
    ]
    assert list(folds.columns) == ["scheme", "trips", "trip", "model", *energies, "ape"]
    np.testing.assert_allclose(
        folds["simulated_energy_wh"] + folds["correction_wh"], folds["predicted_energy_wh"]
    )
    part = folds[
        (folds["scheme"] == "leave_one_trip_out")
        & (folds["trips"] == "audited")
        & (folds["model"] == "linear4")
    ]
    assert part["ape"].mean() == pytest.approx(results["evaluations"][0]["models"]["linear4"]["mape"])
    assert len(results["paired"]) == len(FAST) * (len(FAST) - 1) // 2


class Stop(Exception):
    pass


def test_an_interrupted_run_resumes_to_the_identical_table(fleet, tmp_path):
    models = ("constant", "physics4")
    fleet = dataclasses.replace(fleet, logs=fleet.logs[:6])
    whole = evaluate(fleet, models=models, execution=Execution(n_jobs=1))

    def stop_half_way(finished, total):
        if finished > total // 2:
            raise Stop

    with pytest.raises(Stop):
        evaluate(
            fleet, models=models, execution=Execution(n_jobs=1, work_dir=tmp_path, progress=stop_half_way)
        )
    kept = len(list(tmp_path.rglob("*.fold")))
    assert kept > 0
    broken = next(tmp_path.rglob("*.fold"))
    broken.write_bytes(b"half a file")
    seen = []
    resumed = evaluate(
        fleet,
        models=models,
        execution=Execution(1, tmp_path, resume=True, progress=lambda done, total: seen.append(done)),
    )
    assert seen[0] == kept - 1, "finished folds are used, the broken one is run again"
    pd.testing.assert_frame_equal(resumed.folds, whole.folds)
    for old, new in zip(whole.results["evaluations"], resumed.results["evaluations"], strict=True):
        for name in models:
            assert old["models"][name]["mape_ci95"] == new["models"][name]["mape_ci95"]


def test_the_number_of_processes_changes_nothing(fleet):
    few = dataclasses.replace(fleet, logs=fleet.logs[:4])
    one = evaluate(few, models=("linear6", "physics4"), seed=5, execution=Execution(n_jobs=1))
    two = evaluate(few, models=("linear6", "physics4"), seed=5, execution=Execution(n_jobs=2))
    pd.testing.assert_frame_equal(one.folds, two.folds)


def test_the_times_of_a_fold_are_of_its_fit_and_of_one_predicted_trip(coarse, monkeypatch):
    clock = iter([100.0, 102.0, 102.0, 102.5, *range(4)])
    monkeypatch.setattr("tripwatt.study.evaluation.tasks.time.perf_counter", lambda: next(clock))
    found, _ = of_folds(chosen("linear4"), coarse, np.array([0, 0, -1, 1, 1, -1]))
    assert found.fit_s == 2.0
    assert found.predict_ms == pytest.approx(250.0)  # half a second for two trips
