"""The map over a store."""

import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from benchmarks.many_vehicles import many_vehicles
from tests.fleet.rows import mapped

from tripwatt.fleet.executors import Workers
from tripwatt.fleet.features import FEATURES, trip_features
from tripwatt.fleet.mapping import (
    drive_row,
    drive_segments,
    file_tasks,
    map_store,
    read_rows,
    run_task,
    sample_digests,
    sound_drives,
    store_rows,
    usable_trips,
)
from tripwatt.fleet.statistics import ROWS, TripRows
from tripwatt.fleet.store import create_store, open_store
from tripwatt.hybrid import segment_trips
from tripwatt.trips import Trip
from tripwatt.vehicles import load_vehicle

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_the_map_sums_every_sound_drive_up_once(fleet, rows):
    plan, store, model, folder = fleet
    results = mapped(store, folder / "rows")
    assert len(rows) == sum(pq.read_metadata(r.rows).num_rows for r in results) == model.trips
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
    assert sorted(r.rows for r in mapped(store, folder / "rows")) == sorted(r.rows for r in results)
    assert TripRows.join([rows.table, rows.table]).table.equals(rows.table)  # a drive counts once
    assert TripRows.join([]).table.schema.equals(ROWS)


def test_rows_of_nights_are_the_rows_of_all_trips_and_only_new_trips_are_read(
    fleet, rows, tmp_path, monkeypatch
):
    """Also after the files were merged, from another folder, and for trips without a row; a trip that was erased and added again counts anew."""
    plan, *_ = fleet
    store = create_store(tmp_path / "s", buckets=2)
    work, read = tmp_path / "work", []

    class Counting(ThreadPoolExecutor):
        def submit(self, call, task):
            read.extend(row["digest"] for row in task.rows)
            return super().submit(call, task)

    def now():
        read.clear()
        return store_rows(store, usable_trips(store), work, Workers(Counting(1)))[0]

    logs = list(many_vehicles(plan))
    for part in (logs[::3], logs[1::3], logs[2::3]):
        for log in part:
            its = plan.car_models[int(log.context.car[1:]) % len(plan.car_models)]
            store.add([log], car_model=its)
        got = now()
        assert len(read) == len(part)
    assert got.table.equals(rows.table)
    store.compact()
    assert now().table.equals(rows.table)
    monkeypatch.chdir(tmp_path)
    store = open_store("s")
    assert now().table.equals(rows.table)
    assert not read
    vehicle = logs[0].context.car
    store.forget(vehicle)
    store.add([log for log in logs if log.context.car == vehicle], car_model="vw_id3")
    again = now()
    assert set(read) == set(store.trips(vehicle_id=vehicle)["digest"])
    assert set(again.texts("car_model")[again.texts("vehicle_id") == vehicle]) == {"vw_id3"}
    assert len(again) == len(rows)


DRIVER = """
import sys
sys.path[:0] = sys.argv[3:]
from concurrent.futures import ThreadPoolExecutor
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.mapping import map_store, file_tasks
from tripwatt.fleet.store import open_store
store = open_store(sys.argv[1])
for result in map_store(file_tasks(store, store.trip_rows(), sys.argv[2]), Workers()):
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
    tasks = file_tasks(store, store.trip_rows(), out)
    seen = []
    rows = read_rows(map_store(tasks, Workers(), lambda done, total: seen.append(done)))
    assert {path: Path(path).stat().st_mtime_ns for path in first} == before
    assert len(seen) <= len(tasks) - 2  # progress is of what was left
    assert np.array_equal(rows.sums.xx, model.sums.xx)
    assert not [
        p for p in out.iterdir() if p.name.startswith(".") and p.stat().st_mtime_ns > max(before.values())
    ]


def test_a_task_is_named_by_all_that_its_result_depends_on(fleet):
    _, store, _, folder = fleet
    rows = store.trip_rows()
    task = file_tasks(store, rows, folder / "names")[0]
    digest = task.rows[0]["digest"]
    names = {
        task.name,
        replace(task, path="other").name,
        replace(task, rows=task.rows[1:]).name,
        replace(task, sampled=frozenset({digest})).name,
        replace(task, samples=replace(task.samples, place="elsewhere")).name,
    }
    assert len(names) == 5
    assert (
        replace(task, rows=tuple(reversed(task.rows)), out="x", sampled=frozenset({"not here"})).name
        == task.name
    )
    unusable = [{**rows[0], "drives": 0}, {**rows[1], "energy_wh": None}]
    assert file_tasks(store, unusable, folder) == []
    result = run_task(replace(task, sampled=frozenset({digest})))
    assert pq.read_table(result.segments)["digest"].unique().to_pylist() == [digest]
    assert result == run_task(replace(task, sampled=frozenset({digest})))


def test_the_sample_depends_on_names_and_digests_alone():
    rows = [
        {"drives": 1, "energy_wh": 1.0, "car_model": f"m{v % 2}", "vehicle_id": f"v{v}", "digest": f"{v}-{k}"}
        for v in range(6)
        for k in range(5)
    ]
    chosen = sample_digests(rows, 2, 2)
    assert len(chosen) == 8
    assert sample_digests(rows[::-1], 2, 2) == chosen
    assert sample_digests(rows, 2, 2, seed=1) != chosen
    by_vehicle = [d.split("-")[0] for d in chosen]
    assert {by_vehicle.count(v) for v in set(by_vehicle)} == {2}
    assert chosen <= sample_digests(rows, 3, 3)
    assert sample_digests([{**rows[0], "drives": 0}, {**rows[1], "energy_wh": None}], 9, 9) == frozenset()


def test_drives_that_cannot_be_used_give_no_row(fleet):
    plan, store, *_ = fleet
    log = next(many_vehicles(plan))
    row = next(r for r in store.trip_rows() if r["trip_id"] == log.trip_id)
    assert [d.trip_id for d in sound_drives(log, row)] == [log.trip_id]
    short = log.between(0.0, 60.0)
    assert list(sound_drives(short, {**row, "as_logged": False})) == []
    assert drive_segments(replace(Trip.from_log(log), observed_energy_wh=None), "vw_id3") is None


def test_a_row_has_the_displayed_charge_or_else_that_of_the_battery(fleet):
    plan, *_ = fleet
    log = next(many_vehicles(plan))
    for names, column in ((("displayed_soc",), "displayed_soc"), ((), "soc")):
        kept = log.samples.drop(columns=[n for n in ("displayed_soc", "soc") if n != column])
        trip = Trip.from_log(replace(log, samples=kept))
        table = drive_segments(trip, "vw_id3")
        row = drive_row(
            trip, table, {"car_model": "vw_id3", "vehicle_id": "V", "driver": None, "digest": "d"}
        )
        ends = kept[column].to_numpy()[[0, -1]]
        assert [row["displayed_start"], row["displayed_end"]] == pytest.approx(ends, abs=0.006), names
    bare = Trip.from_log(replace(log, samples=log.samples.drop(columns=["soc", "displayed_soc"])))
    row = drive_row(
        bare, drive_segments(bare, "vw_id3"), {"car_model": "", "vehicle_id": "", "driver": "", "digest": ""}
    )
    assert np.isnan([row["displayed_start"], row["displayed_end"]]).all()


@pytest.mark.parametrize("step", [0.02, 0.01, 0.001])
def test_the_charge_of_a_row_has_no_rounding_where_the_display_falls(step):
    """A constant power takes 8.3 % of the charge, shown in steps; a display that is read at the ends has no more than these."""
    time = np.arange(1201.0)
    true = 0.7163 - 0.083 * time / time[-1]
    shown = np.round(true / step) * step
    made = {"time_s": time, "speed_m_s": 15.0, "voltage_v": 400.0, "current_a": 40.0}
    about = {"car_model": "vw_id3", "vehicle_id": "V", "driver": None, "digest": "d"}
    for display, ends in ((shown, true), (np.where(np.isin(time, time[[0, -1]]), shown, np.nan), shown)):
        trip = Trip.from_samples("t", pd.DataFrame(made | {"displayed_soc": display}))
        row = drive_row(trip, drive_segments(trip, "vw_id3"), about)
        assert [row["displayed_start"], row["displayed_end"]] == pytest.approx(ends[[0, -1]], abs=1e-4)
