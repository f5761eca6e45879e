"""A fleet from its store to its forecasts: the same whoever computes it, resumed after a kill, updated as fitted anew."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from benchmarks.many_vehicles import CAR_MODELS, FleetPlan, many_vehicles

from tripwatt.errors import InvalidInput
from tripwatt.fleet.corrector import FleetCorrector, FleetTrees, choose_rounds
from tripwatt.fleet.executors import AHEAD, InProcess, executor_for, map_bounded
from tripwatt.fleet.features import FEATURES, SCALES, segment_features, trip_features, trip_variance_wh2
from tripwatt.fleet.mapping import (
    SampledTrips,
    drives_of,
    map_store,
    read_rows,
    rows_of_file,
    sample_of,
    segments_of,
    tasks_of,
)
from tripwatt.fleet.model import (
    MIN_TRIPS,
    fit_fleet,
    held_out_correctors,
    predict_rows,
    update_fleet,
    without_vehicle,
)
from tripwatt.fleet.statistics import ROWS, TripRows
from tripwatt.fleet.storage import load_fleet, save_fleet
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.groups import group_posterior
from tripwatt.trips import Trip
from tripwatt.vehicles import load_vehicle

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def new_logs(plan, more):
    longer = FleetPlan(plan.trips + more, plan.vehicles, plan.car_models, plan.seed, plan.minutes)
    known = {log.trip_id for log in many_vehicles(plan)}
    return [log for log in many_vehicles(longer) if log.trip_id not in known]


def test_features_are_energies_by_cause_and_climate(fleet):
    plan, *_ = fleet
    log = next(many_vehicles(plan))
    car = load_vehicle("bmw_i3_60ah")
    table = segment_trips([Trip.from_log(log)], car)
    X = segment_features(table) / SCALES
    features = table.features
    assert X[:, 0] == pytest.approx(features["air_w"].to_numpy(), rel=1e-12)
    assert X[:, FEATURES.index("hvac")] == pytest.approx(features["hvac_w"].to_numpy(), rel=1e-12)
    ambient, time_s = features["ambient_temperature_degc"].to_numpy(), features["time_s"].to_numpy()
    assert X[:, FEATURES.index("cold")] == pytest.approx(np.maximum(20.0 - ambient, 0.0))
    assert X[:, FEATURES.index("hot")] == pytest.approx(np.maximum(ambient - 20.0, 0.0))
    assert X[:, FEATURES.index("start")] == pytest.approx(np.exp(-time_s / 900.0))
    assert X[:, FEATURES.index("cold_start")] == pytest.approx(
        np.maximum(20.0 - ambient, 0.0) * np.exp(-time_s / 900.0)
    )
    assert trip_features(table)[0] == pytest.approx(table.hours @ segment_features(table), rel=1e-12)
    moved = float(table.hours @ features["moved_w"].to_numpy())
    assert trip_variance_wh2(table) == pytest.approx([1600.0 + 0.0025 * moved**2])
    unknown = replace(table, features=features.assign(ambient_temperature_degc=np.nan))
    assert not segment_features(unknown)[:, [FEATURES.index("cold"), FEATURES.index("hot")]].any()


def test_the_map_sums_every_sound_drive_up_once(fleet):
    plan, store, model, folder = fleet
    tasks = tasks_of(store, store.trip_rows(), folder / "rows")
    results = list(map_store(tasks, InProcess(), 1))
    rows = read_rows(results)
    assert len(rows) == sum(r.trips for r in results) == sum(r.drives for r in results) == model.trips
    assert model.trips == sum(row["drives"] for row in store.trip_rows())
    logs = {log.trip_id: log for log in many_vehicles(plan)}
    first = dict(zip(rows.table.column_names, (c[0].as_py() for c in rows.table.columns), strict=True))
    log = logs[first["drive"]]
    table = segment_trips([Trip.from_log(log)], load_vehicle(first["car_model"]))
    assert first["observed_wh"] == pytest.approx(log.observed_energy_wh, rel=1e-12)
    assert first["simulated_wh"] == pytest.approx(table.totals_wh(table.simulated_w)[0], rel=1e-12)
    assert [first[f"x_{name}"] for name in FEATURES] == pytest.approx(
        trip_features(table)[0].tolist(), rel=1e-12
    )
    assert first["distance_m"] == pytest.approx(log.distance_m)
    assert first["hours"] == pytest.approx(table.hours.sum())
    assert (first["vehicle_id"], first["driver"]) == (log.context.car, log.context.driver)
    assert first["started_at"] == log.context.started_at.isoformat()
    again = list(map_store(tasks, InProcess(), 1))
    assert sorted(r.rows for r in again) == sorted(r.rows for r in results)
    assert TripRows.join([rows.table, rows.table]).table.equals(rows.table)  # a drive counts once
    assert TripRows.join([]).table.schema.equals(ROWS)


def test_sums_do_not_depend_on_the_parts(fleet):
    _, store, model, folder = fleet
    rows = read_rows(map_store(tasks_of(store, store.trip_rows(), folder / "rows"), InProcess(), 1))
    whole = rows.sums
    X, y, w = rows.X, rows.residual_wh, 1.0 / rows.numbers("variance_wh2")
    assert whole.xx.sum(axis=0) == pytest.approx(X.T @ (X * w[:, None]), rel=1e-10)
    assert whole.xy.sum(axis=0) == pytest.approx(X.T @ (y * w), rel=1e-8, abs=1e-8)
    assert whole.yy.sum() == pytest.approx(y @ (y * w), rel=1e-12)
    assert whole.log_variance.sum() == pytest.approx(-np.log(w).sum(), rel=1e-12)
    assert whole.count.sum() == len(rows)
    assert all(np.array_equal(getattr(whole, n), getattr(model.sums, n)) for n in ("xx", "xy", "yy", "count"))
    half = np.arange(len(rows)) % 3 == 0
    merged = rows.where(half).sums + rows.where(~half).sums
    for name in ("xx", "xy", "yy"):
        scale = np.abs(getattr(whole, name)).max()
        assert np.abs(getattr(merged, name) - getattr(whole, name)).max() < 1e-10 * scale
    assert rows.where(np.zeros(len(rows), dtype=bool)).sums.groups == ()


def test_processes_of_this_machine_are_an_executor():
    with executor_for(2) as (executor, workers):
        assert workers == 2
        assert sorted(map_bounded(executor, workers, abs, [-3, 2, -1])) == [1, 2, 3]
        assert executor.submit(os.getpid).result() != os.getpid()


def test_dask_with_a_killed_worker_gives_the_same_rows(fleet):
    distributed = pytest.importorskip("distributed", reason="needs the extra tripwatt[fleet]")
    _, store, model, folder = fleet
    tasks = tasks_of(store, store.trip_rows(), folder / "dask")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        with distributed.Client(cluster, set_as_default=False) as client:
            victim = next(iter(client.run(os.getpid).values()))
        done = []

        def kill(finished, total):
            if not done:
                os.kill(victim, signal.SIGKILL)
            done.append(finished)

        with executor_for(cluster=cluster.scheduler_address) as (executor, workers):
            assert workers == 2
            rows = read_rows(map_store(tasks, executor, workers, kill))
    assert done[-1] == len(tasks)
    assert np.array_equal(rows.sums.xx, model.sums.xx)


DRIVER = """
import sys
sys.path[:0] = sys.argv[3:]
from tripwatt.fleet.executors import InProcess
from tripwatt.fleet.mapping import map_store, tasks_of
from tripwatt.store import open_store
store = open_store(sys.argv[1])
for result in map_store(tasks_of(store, store.trip_rows(), sys.argv[2]), InProcess(), 1):
    print(result.rows, flush=True)
"""


def test_a_killed_driver_goes_on_where_it_was(fleet):
    _, store, model, folder = fleet
    out = folder / "resumed"
    driver = subprocess.Popen(
        [sys.executable, "-c", DRIVER, store.place, str(out), *sys.path], stdout=subprocess.PIPE, text=True
    )
    first = [driver.stdout.readline().strip() for _ in range(2)]
    driver.send_signal(signal.SIGKILL)
    driver.wait(timeout=60)
    driver.stdout.close()
    before = {path: Path(path).stat().st_mtime_ns for path in first}
    tasks = tasks_of(store, store.trip_rows(), out)
    seen = []
    rows = read_rows(map_store(tasks, InProcess(), 1, lambda done, total: seen.append(done)))
    assert {path: Path(path).stat().st_mtime_ns for path in first} == before
    assert len(seen) <= len(tasks) - 2  # progress is of what was left
    assert np.array_equal(rows.sums.xx, model.sums.xx)
    assert not [
        p for p in out.iterdir() if p.name.startswith(".") and p.stat().st_mtime_ns > max(before.values())
    ]


def test_a_task_is_named_by_all_that_its_result_depends_on(fleet):
    _, store, _, folder = fleet
    rows = store.trip_rows()
    task = tasks_of(store, rows, folder / "names")[0]
    digest = task.rows[0]["digest"]
    names = {
        task.name,
        replace(task, path="other").name,
        replace(task, rows=task.rows[1:]).name,
        replace(task, sampled=frozenset({digest})).name,
        replace(task, place="elsewhere").name,
    }
    assert len(names) == 5
    assert (
        replace(task, rows=tuple(reversed(task.rows)), out="x", sampled=frozenset({"not here"})).name
        == task.name
    )
    unusable = [{**rows[0], "drives": 0}, {**rows[1], "energy_wh": None}]
    assert tasks_of(store, unusable, folder) == []
    result = rows_of_file(replace(task, sampled=frozenset({digest})))
    assert pq.read_table(result.segments)["digest"].unique().to_pylist() == [digest]
    assert result == rows_of_file(replace(task, sampled=frozenset({digest})))


def test_the_sample_depends_on_names_and_digests_alone():
    rows = [
        {"drives": 1, "energy_wh": 1.0, "car_model": f"m{v % 2}", "vehicle_id": f"v{v}", "digest": f"{v}-{k}"}
        for v in range(6)
        for k in range(5)
    ]
    chosen = sample_of(rows, 2, 2)
    assert len(chosen) == 8
    assert sample_of(rows[::-1], 2, 2) == chosen
    assert sample_of(rows, 2, 2, seed=1) != chosen
    by_vehicle = [d.split("-")[0] for d in chosen]
    assert {by_vehicle.count(v) for v in set(by_vehicle)} == {2}
    assert chosen <= sample_of(rows, 3, 3)
    assert sample_of([{**rows[0], "drives": 0}, {**rows[1], "energy_wh": None}], 9, 9) == frozenset()


def test_an_update_is_the_fit_of_all_trips(fleet, tmp_path):
    plan, store, model, _ = fleet
    import shutil

    from tripwatt.store import open_store

    shutil.copytree(store.place, tmp_path / "store")
    copy = open_store(tmp_path / "store")
    same, none = update_fleet(model, copy, tmp_path / "work", InProcess())
    assert same is model
    assert len(none) == 0
    logs = new_logs(plan, 8)
    for k, car_model in enumerate(plan.car_models):
        copy.add([log for log in logs if int(log.context.car[1:]) % 2 == k], car_model=car_model)
    updated, rows = update_fleet(model, copy, tmp_path / "work", InProcess())
    assert len(rows) == sum(r["drives"] for r in copy.trip_rows() if r["digest"] not in model.digests) > 5
    assert updated.trips == model.trips + len(rows)
    assert updated.digests > model.digests
    assert updated.trees is model.trees
    assert updated.uncertainty is model.uncertainty
    everything = read_rows(map_store(tasks_of(copy, copy.trip_rows(), tmp_path / "all"), InProcess(), 1))
    full = group_posterior(everything.sums, model.posterior.scales)
    assert np.abs(full.mean - updated.posterior.mean).max() < 1e-10 * np.abs(full.mean).max()
    assert (
        np.abs(full.covariance - updated.posterior.covariance).max() < 1e-10 * np.abs(full.covariance).max()
    )
    trip = Trip.from_log(logs[0])
    fitted = replace(updated, posterior=full)
    energies = [m.forecast(trip, vehicle_id=trip.context.car).energy_wh for m in (updated, fitted)]
    assert energies[0] == pytest.approx(energies[1], abs=1e-6)
    left = without_vehicle(updated, logs[0].context.car)
    assert logs[0].context.car not in left.vehicles()
    its = [g for g in updated.sums.groups if g[1] == logs[0].context.car]
    gone = sum(updated.sums.count[updated.sums.groups.index(g)] for g in its)
    assert left.trips == updated.trips - gone


def test_each_vehicle_has_its_own_forecast(fleet):
    plan, _, model, _ = fleet
    trip = Trip.from_log(next(many_vehicles(plan)))
    own = model.forecast(trip, vehicle_id="V00000", driver=trip.context.driver)
    other = model.forecast(trip, vehicle_id="V00002")
    new = model.forecast(trip, vehicle_id="new", car_model=plan.car_models[0])
    assert own.energy_wh != other.energy_wh
    assert own.sd_wh < new.sd_wh
    assert own.interval(0.9)[0] < own.energy_wh < own.interval(0.9)[1]
    assert repr(model) == f"<FleetModel {model.trips} trips of 8 vehicles, 2 car models>"
    its = [i for i, group in enumerate(model.sums.groups) if group[1] == "V00000"]
    assert len(model.of_vehicle("V00000").trip_ids_) == model.sums.count[its].sum()
    assert model.of_vehicle("new", car_model="vw_id3").vehicle.name == "vw_id3"
    linear = model.of_vehicle("V00000").corrector_
    weights, covariance = model.posterior.weights(plan.car_models[0], "V00000")
    table = segment_trips([trip], load_vehicle(plan.car_models[0]))
    trees = model.trees.predict(table)
    assert linear.predict(table) == pytest.approx(segment_features(table) @ weights + trees)
    factor = linear.predict_with_uncertainty(table)[1]
    features = segment_features(table)
    assert factor @ factor.T == pytest.approx(features @ covariance @ features.T, rel=1e-8, abs=1e-6)
    with pytest.raises(InvalidInput, match="unknown vehicle: vehicle_id: got 'new'"):
        model.forecast(trip, vehicle_id="new")
    with pytest.raises(InvalidInput, match="another car model"):
        model.of_vehicle("V00000", car_model="vw_id3")
    with pytest.raises(InvalidInput, match="cannot be fitted"):
        linear.fit(table)
    with pytest.raises(InvalidInput, match="cannot be fitted"):
        linear.clone_tuned()


def test_held_out_trips_are_out_of_the_whole_posterior(fleet):
    _, store, model, folder = fleet
    rows = store.trip_rows()
    chosen = sample_of(rows, 3, 3)
    results = list(map_store(tasks_of(store, rows, folder / "sample", chosen), InProcess(), 1))
    sample = SampledTrips.read([r.segments for r in results if r.segments])
    assert len(sample) == len(chosen) == 18
    assert set(sample.digests) == chosen
    folds = np.arange(18) % 3
    found = held_out_correctors(model.sums, model.posterior.scales, sample, folds)
    everything = read_rows(results)
    kept = everything.where(
        [d not in np.array(sample.digests)[folds == 0] for d in everything.texts("digest")]
    )
    left = group_posterior(kept.sums, model.posterior.scales)
    car_model, vehicle, driver = sample.groups[0]
    mean, _ = left.weights(car_model, vehicle, driver)
    assert found[0].mean == pytest.approx(mean, rel=1e-7, abs=1e-9)
    sums = sample.sums(np.arange(18))
    picked = everything.where([d in chosen for d in everything.texts("digest")])
    assert sums.xx == pytest.approx(picked.sums.xx, rel=1e-9)
    assert sums.log_variance == pytest.approx(picked.sums.log_variance, rel=1e-9)
    energy, sd = predict_rows(model.posterior, everything)
    i = 5
    key = [everything.texts(name)[i] for name in ("car_model", "vehicle_id", "driver")]
    mean, covariance = model.posterior.weights(*key)
    x = everything.X[i]
    assert energy[i] == pytest.approx(everything.numbers("simulated_wh")[i] + x @ mean)
    assert sd[i] == pytest.approx(np.sqrt(x @ covariance @ x))
    with pytest.raises(InvalidInput, match="no trips"):
        SampledTrips.read([])


def test_trees_are_used_where_they_help(fleet):
    _, store, _, folder = fleet
    rows = store.trip_rows()
    chosen = sample_of(rows, 9, 9)
    results = map_store(tasks_of(store, rows, folder / "trees", chosen), InProcess(), 1)
    table = SampledTrips.read([r.segments for r in results if r.segments]).table
    folds = np.arange(len(table)) % 4
    speed = table.features["speed_m_s"].to_numpy()
    step = np.where(speed > np.median(speed), 900.0, -900.0)
    rounds, held_out = choose_rounds(table, step, folds, 0)
    assert rounds in range(20, 121, 20)
    assert np.abs(step - held_out).mean() < 0.5 * np.abs(step).mean()
    noise = np.random.default_rng(0).normal(0.0, 900.0, len(speed))
    assert choose_rounds(table, noise, folds, 0)[0] == 0
    trees = FleetTrees.fit(table, step, 60, 3)
    assert trees.text == FleetTrees.fit(table, step, 60, 3).text
    assert np.abs(step - trees.predict(table)).mean() < 0.4 * 900.0
    assert not FleetTrees.fit(table, step, 0, 3).predict(table).any()
    corrector = FleetCorrector(np.zeros(12), np.zeros((12, 12)), trees)
    assert corrector.predict_with_uncertainty(table)[0].tolist() == trees.predict(table).tolist()
    assert corrector.outside_factor(table).shape == (len(speed), 0)
    assert corrector.predict_climate(table) is None


def test_a_stored_model_forecasts_alike(fleet, tmp_path):
    plan, _, model, _ = fleet
    save_fleet(model, tmp_path / "m")
    again = load_fleet(tmp_path / "m")
    trip = Trip.from_log(next(many_vehicles(plan)))
    ours, theirs = (m.forecast(trip, vehicle_id="V00000") for m in (model, again))
    assert ours.energy_wh == theirs.energy_wh
    assert ours.interval(0.9) == theirs.interval(0.9)
    assert ours.soc_interval(0.9) == theirs.soc_interval(0.9)
    assert again.digests == model.digests
    assert again.vehicles() == model.vehicles()
    observed = trip.samples.iloc[:200]
    assert ours.update(observed).energy_wh == theirs.update(observed).energy_wh
    (tmp_path / "m" / "fleet.npz").write_bytes(b"x")
    with pytest.raises(InvalidInput, match=r"fleet\.npz"):
        load_fleet(tmp_path / "m")
    import tripwatt as tw

    tw.save_model(tw.load_model(), tmp_path / "one")
    with pytest.raises(InvalidInput, match="no model of a fleet"):
        load_fleet(tmp_path / "one")


def test_a_fleet_of_0_2_0_forecasts_as_it_did_and_is_written_anew(tmp_path):
    """Fitted on 16 trips of 4 vehicles."""
    old = Path(__file__).parents[1] / "fixtures" / "model_0_2_0"
    model = load_fleet(old / "fleet")
    save_fleet(model, tmp_path / "m")
    trip = Trip.from_log(
        next(many_vehicles(FleetPlan(16, vehicles=4, car_models=CAR_MODELS[:2], minutes=6.0)))
    )
    then = json.loads((old / "fleet.json").read_text())
    for found in (model, load_fleet(tmp_path / "m")):
        now = found.forecast(trip, vehicle_id="V00000").to_dict()
        for name in (
            "energy_wh",
            "soc_arrival",
            "wh_per_display",
            "quantiles_wh",
            "soc_quantiles",
            "by_cause_wh",
        ):
            assert now[name] == pytest.approx(then[name], rel=1e-9), name
    assert load_fleet(tmp_path / "m").digests == model.digests


def test_too_few_trips_are_an_error(fleet, tmp_path):
    _, store, *_ = fleet
    with pytest.raises(InvalidInput, match=f"at least {MIN_TRIPS}"):
        fit_fleet(store, tmp_path, InProcess(), which={"vehicle_id": "nobody"})


def test_drives_that_cannot_be_used_give_no_row(fleet):
    plan, store, *_ = fleet
    log = next(many_vehicles(plan))
    row = next(r for r in store.trip_rows() if r["trip_id"] == log.trip_id)
    assert [d.trip_id for d in drives_of(log, row)] == [log.trip_id]
    short = log.between(0.0, 60.0)
    assert list(drives_of(short, {**row, "as_logged": False})) == []
    assert segments_of(replace(Trip.from_log(log), observed_energy_wh=None), "vw_id3") is None
    with_charge = segments_of(Trip.from_log(log), "vw_id3")
    without = segments_of(Trip.from_log(log), "vw_id3", charge=False)
    assert with_charge.observed_w.tolist() == without.observed_w.tolist()
    assert np.isfinite(with_charge.charge).all()
    assert np.isnan(without.charge).all()


def test_executors_keep_few_tasks_waiting_and_pass_errors_on():
    running, most = [], []

    def work(task):
        running.append(task)
        most.append(len(running))
        time.sleep(0.005)
        running.remove(task)
        return task

    with ThreadPoolExecutor(2) as pool:
        assert sorted(map_bounded(pool, 2, work, list(range(40)))) == list(range(40))
    assert max(most) <= 2
    submitted = []

    class Counting(InProcess):
        def submit(self, fn, /, *args, **kwargs):
            submitted.append(args)
            return super().submit(fn, *args, **kwargs)

    results = map_bounded(Counting(), 1, abs, range(50))
    next(results)
    assert len(submitted) == AHEAD
    with pytest.raises(ZeroDivisionError):
        list(map_bounded(InProcess(), 1, lambda x: 1 / x, [1, 0]))
    assert list(map_bounded(InProcess(), 1, abs, [])) == []
    with pytest.raises(InvalidInput, match="n_jobs: got 0"), executor_for(0):
        pass


def test_a_cluster_that_is_not_there_is_one_error(monkeypatch):
    pytest.importorskip("distributed", reason="needs the extra tripwatt[fleet]")
    monkeypatch.setattr("tripwatt.fleet.executors.CLUSTER_WAIT_S", 1.0)
    with (
        pytest.raises(InvalidInput, match="no cluster"),
        executor_for(cluster="tcp://127.0.0.1:9"),
    ):
        pass


def test_the_core_imports_no_fleet_package():
    code = (
        "import sys, tripwatt.cli, tripwatt.forecasting, tripwatt.store, tripwatt.fleet.model, tripwatt.cli.fleets\n"
        "print(sorted({m.split('.')[0] for m in sys.modules} & {'dask', 'distributed', 'deltalake', 'duckdb', 'polars'}))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"
