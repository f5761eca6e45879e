"""A trip store: what goes in comes out, once, whoever writes at the same time, and nothing of it after forgetting."""

import datetime as dt
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from tests.support import ROOT
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.fleet.store.rows import (
    bucket_of,
    digest_of,
    log_from_rows,
    month_of,
    samples_table,
    stored_log,
)
from tripwatt.fleet.store.store import FINDINGS
from tripwatt.trips import Context, Log

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tripwatt.fleet.store import Added, add_files, create_store, open_store
from tripwatt.fleet.store.delta import DeltaFolder, is_url, join_place

CAR = "nissan_leaf_24"


def drive(n=400, *, start=0.0, trip="T1", vehicle="V1", day=1, month=5, **context):
    """A sound log of n seconds at 1 Hz; its power follows its acceleration."""
    t = np.arange(float(n))
    speed = 12.0 + 6.0 * np.sin(t / 15.0 + start)
    power = 1500.0 * speed * np.gradient(speed, t) + 250.0 * speed + 900.0
    table = pd.DataFrame(
        {"time_s": t, "speed_m_s": speed, "voltage_v": 360.0 - 0.01 * t, "current_a": power / 360.0}
    )
    when = dt.datetime(2024, month, day, 8, 30)
    return Log.from_samples(trip, table, Context(started_at=when, car=vehicle, **context))


@pytest.fixture
def store(tmp_path):
    return create_store(tmp_path / "fleet", buckets=4)


def same(a, b):
    return (
        set(a.samples.columns) == set(b.samples.columns)  # in canonical order
        and np.array_equal(a.samples.to_numpy(), b.samples[a.samples.columns].to_numpy(), equal_nan=True)
        and (a.trip_id, a.context, a.observed_energy_wh, a.observed_energy_std_wh)
        == (b.trip_id, b.context, b.observed_energy_wh, b.observed_energy_std_wh)
    )


def test_logs_come_back_as_they_were_logged(store):
    odd = drive(trip="odd", driver="Ada", season="winter", weather="rainy", payload_mass_kg=80.0, remarks="é")
    odd.samples.loc[3:6, "current_a"] = np.nan
    odd = Log.from_samples("odd", odd.samples.assign(elevation_m=np.nan), odd.context)
    back = Log.from_samples("back", drive().samples.iloc[::-1].reset_index(drop=True), Context(car="V2"))
    counted = drive(trip="soc", vehicle="V3").samples.drop(columns=["voltage_v", "current_a"])
    counted["observed_energy_wh"] = np.linspace(0.0, 900.0, len(counted))
    counter = Log.from_samples("counter", counted.assign(speed_m_s=9.0), Context(car="V3"))
    errors = {"observed_energy_std_wh": 40.0, "observed_energy_common_std": 0.02}
    by_soc = replace(Log.from_samples("soc", counted, Context(car="V3")), **errors)
    logs = [odd, back, by_soc, counter]
    assert store.add(logs, car_model=CAR) == Added(4, 0, 1)  # time that runs backwards is no drive
    found = {log.trip_id: log for log in store.logs()}
    assert all(same(log, found[log.trip_id]) for log in logs)
    rows = {row["trip_id"]: row for row in store.trip_rows()}
    assert rows["soc"]["energy_from"] == "state of charge"
    assert rows["counter"]["energy_from"] == "counter"
    assert rows["soc"]["energy_std_wh"] == 40.0
    assert rows["odd"]["energy_from"] == "voltage and current"
    assert rows["odd"]["energy_std_wh"] is None
    assert rows["back"]["energy_from"] == "unknown"
    assert rows["back"]["energy_wh"] is None
    assert "set aside" in {f["consequence"] for f in json.loads(rows["back"]["findings"])}
    counted = store.trips().set_index("trip_id")[[*FINDINGS]]
    for name, row in rows.items():
        said = [f["consequence"].replace(" ", "_") for f in json.loads(row["findings"])]
        assert counted.loc[name].to_dict() == {c: said.count(c) for c in FINDINGS}
    assert store.trips(car_model="none").empty


def test_rows_sum_up_the_sound_drives(store):
    log = drive(n=601)
    store.add([log], car_model=CAR)
    (row,) = store.trip_rows()
    speed = log.array("speed_m_s")
    assert row["distance_m"] == pytest.approx(float((0.5 * (speed[1:] + speed[:-1])).sum()), rel=1e-12)
    assert row["duration_s"] == 600.0
    assert row["energy_wh"] == pytest.approx(log.observed_energy_wh, rel=1e-12)
    assert (row["drives"], row["samples"], row["month"], row["car_model"]) == (1, 601, "2024-05", CAR)
    assert json.loads(row["columns"]) == ["time_s", "speed_m_s", "voltage_v", "current_a"]
    assert row["started_at"] == "2024-05-01T08:30:00"
    assert row["ambient_temperature_degc"] is None
    warm = drive(trip="W", day=3)
    warm = Log.from_samples(
        "W", warm.samples.assign(ambient_temperature_degc=np.arange(400) / 40.0), warm.context
    )
    assert stored_log(warm, "V1", CAR, 4).row["ambient_temperature_degc"] == pytest.approx(4.9875)


def test_a_split_log_counts_its_drives_and_is_not_as_logged():
    first, second = drive(n=400).samples, drive(n=400, start=1.0).samples
    second = second.assign(time_s=second["time_s"] + 4000.0)
    split = Log.from_samples("two", pd.concat([first, second], ignore_index=True), Context(car="V1"))
    row = stored_log(split, "V1", CAR, 4).row
    assert (row["drives"], row["as_logged"]) == (2, False)
    assert row["duration_s"] == 798.0
    whole = drive()
    noted = Log.from_samples("T1", whole.samples.assign(elevation_m=50.0), whole.context)
    assert stored_log(noted, "V1", CAR, 4).row["as_logged"]
    assert not stored_log(drive(n=30), "V1", CAR, 4).row["as_logged"]  # too short: no drive at all


def test_digest_is_of_what_was_logged_by_whom_and_when():
    log = drive()
    base = digest_of("V1", log)
    assert digest_of("V1", replace(log, trip_id="other")) == base
    assert digest_of("V2", log) != base
    later = replace(log, context=replace(log.context, started_at=dt.datetime(2024, 5, 2)))
    assert digest_of("V1", later) != base
    moved = log.samples.copy()
    moved.loc[7, "current_a"] += 1e-9
    assert digest_of("V1", replace(log, samples=moved)) != base
    renamed = log.samples.rename(columns={"voltage_v": "heating_power_w"})
    assert digest_of("V1", replace(log, samples=renamed)) != base
    minus = log.samples.assign(current_a=log.samples["current_a"] * 0.0 * -1.0)
    assert digest_of("V1", replace(log, samples=minus)) == digest_of(
        "V1", replace(log, samples=minus.assign(current_a=0.0))
    )


def test_buckets_and_months():
    assert [bucket_of(f"V{i}", 16) for i in range(4)] == [3, 1, 4, 5]  # as in stores on disk
    assert len({bucket_of(f"V{i}", 16) for i in range(400)}) == 16
    assert month_of(dt.datetime(2024, 12, 31, 23, 59)) == "2024-12"
    assert month_of(None) == "unknown"


def test_rows_and_samples_make_a_log_without_a_store():
    log = drive(driver="Ada")
    stored = [stored_log(log, "V1", CAR, 4)]
    table, rows = samples_table(stored, "b"), [{**s.row, "batch": "b"} for s in stored]
    assert table["sample"].to_pylist() == list(range(len(log)))
    assert set(table["batch"].to_pylist()) == {"b"}
    assert table["soc"].null_count == len(log)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    assert same(log_from_rows(rows[0], columns), log)


def test_adding_twice_is_adding_once(store, monkeypatch):
    monkeypatch.setattr("tripwatt.fleet.store.store.BATCH", 2)
    logs = [drive(trip=f"T{i}", start=0.1 * i, day=i + 1) for i in range(5)]
    seen = []
    assert store.add(logs, car_model=CAR, progress=seen.append) == Added(5, 0, 0)
    assert [s.added for s in seen] == [2, 4, 5]
    assert store.add(logs, car_model=CAR) == Added(0, 5, 0)
    renamed = [replace(logs[0], trip_id="again"), logs[1], drive(trip="new", start=9.0)]
    assert store.add(renamed, car_model=CAR) == Added(1, 2, 0)
    assert store.add([drive(trip="x", start=3.0, day=9)] * 2, car_model=CAR) == Added(1, 1, 0)
    assert sorted(log.trip_id for log in store.logs()) == ["T0", "T1", "T2", "T3", "T4", "new", "x"]
    assert len(store.samples.read(["sample"])) == 7 * 400
    assert str(Added(2, 1, 0)) == "2 trips added, 1 known before; without a sound drive: 0"


def test_every_fault_of_the_logs_is_named_and_nothing_is_added(store):
    nameless = drive(vehicle=None, trip="N")
    means = replace(drive(trip="M"), step_s=1.0)
    with pytest.raises(InvalidInput) as error:
        store.add([nameless, means, drive(vehicle="a\nb")], car_model=CAR)
    assert [f.what for f in error.value.faults] == [
        "vehicle is missing",
        "not a raw log",
        "invalid name of a vehicle",
    ]
    assert store.about()["trips"] == 0
    store.add([drive(trip="T", vehicle="V1")], car_model=CAR)
    other = drive(trip="T", vehicle="V1", start=2.0)
    refuses("duplicate trip id: vehicle V1, trip T", store.add, [other], car_model=CAR)
    with pytest.raises(InvalidInput, match="duplicate trip id"):
        store.add([drive(trip="U", start=1.0), drive(trip="U", start=3.0)], car_model=CAR)
    assert store.add([replace(other, context=replace(other.context, car="V2"))], car_model=CAR).added == 1
    assert len(store.samples.read(["sample"])) == 800
    for bad in ("", "x" * 201, "a\tb"):
        refuses("invalid name of a car model", store.add, [], car_model=bad)


def test_the_vehicle_of_a_log_counts_before_the_one_that_is_given(store):
    store.add(
        [drive(vehicle=None, trip="A"), drive(vehicle="own", trip="B")], car_model=CAR, vehicle_id="given"
    )
    assert dict(store.trips()[["trip_id", "vehicle_id"]].to_numpy()) == {"A": "given", "B": "own"}


def test_trips_are_selected_and_ordered(store):
    logs = [
        drive(vehicle=v, trip=f"{v}{m}{d}", month=m, day=d, start=m + d)
        for v in ("b", "a")
        for m, d in ((6, 1), (5, 3), (5, 1))
    ]
    store.add(logs[:3], car_model=CAR)
    store.add(logs[3:], car_model="vw_id3")
    assert store.trips()["trip_id"].tolist() == ["a51", "a53", "a61", "b51", "b53", "b61"]
    assert store.trips(limit=2)["trip_id"].tolist() == ["a51", "a53"]
    assert store.trips(limit=9).shape[0] == 6
    assert store.trips(vehicle_id="b")["trip_id"].tolist() == ["b51", "b53", "b61"]
    assert set(store.trips(car_model="vw_id3")["vehicle_id"]) == {"a"}
    assert store.trips(since="2024-05-03", until="2024-06-01")["trip_id"].tolist() == ["a53", "b53"]
    assert store.trips(since=dt.date(2024, 5, 4))["trip_id"].tolist() == ["a61", "b61"]
    assert store.trips(since="2024-05-03T08:30:00", until=dt.datetime(2024, 5, 3, 8, 30)).empty
    assert store.trips(vehicle_id="nobody").empty
    assert list(store.trips(columns=["digest"]).columns) == ["digest"]
    assert [log.trip_id for log in store.logs(vehicle_id="a", since="2024-06-01")] == ["a61"]
    refuses("invalid time: since: got 'May'", store.trips, since="May")
    refuses("unknown column", store.trips, columns=["digest", "colour"])
    about = store.about()
    assert (about["trips"], about["vehicles"], about["usable"], about["with_energy"]) == (6, 2, 6, 6)
    assert about["car_models"] == {CAR: 3, "vw_id3": 3}
    assert (about["first"], about["last"]) == ("2024-05-01T08:30:00", "2024-06-01T08:30:00")
    assert about["distance_m"] == pytest.approx(store.trips()["distance_m"].sum())
    assert "6 trips of 2 vehicles" in repr(store)


def test_files_are_found_by_place_and_batch(store):
    store.add([drive(trip="A", day=1)], car_model=CAR)
    store.add([drive(trip="B", day=2, start=1.0), drive(trip="C", month=6, start=2.0)], car_model=CAR)
    rows = {row["trip_id"]: row for row in store.trip_rows()}
    ((path, of_file),) = store.file_trips([rows["B"]]).items()
    assert [row["trip_id"] for row in of_file] == ["B"]
    assert "month=2024-05" in path
    assert len(store.file_trips(rows.values())) == 3
    assert store.file_trips([]) == {}


def test_compacting_keeps_every_trip_and_orphans_wait(store, monkeypatch):
    logs = [drive(trip=f"T{i}", start=0.1 * i, day=i + 1) for i in range(8)]
    for log in logs:
        store.add([log], car_model=CAR)
    done = store.compact(keep_hours=0)
    assert done == {"merged": 16, "made": 2, "orphans": 0, "removed": 16}
    assert len(list(store.samples.data_files())) == 1
    found = {log.trip_id: log for log in store.logs()}
    assert all(same(log, found[log.trip_id]) for log in logs)
    lost = [stored_log(drive(trip="lost", start=5.0), "V1", CAR, 4)]
    store.samples.append(samples_table(lost, f"{time.time_ns():020d}-x"))
    assert sum(1 for _ in store.logs()) == 8  # samples without a row belong to nobody
    assert store.compact()["orphans"] == 0
    two_days = time.time_ns() - 2 * 86_400 * 10**9
    store.samples.append(samples_table(lost, f"{two_days:020d}-y"))
    assert store.compact()["orphans"] == 400
    assert sum(1 for _ in store.logs()) == 8


def test_many_small_commits_leave_few_files_of_rows(store, monkeypatch):
    # with four buckets, files are merged beyond eight
    monkeypatch.setattr("tripwatt.fleet.store.store.FILES_A_BUCKET", 2)
    most = 0
    for day in range(1, 9):
        trips = [drive(trip=f"T{day}", vehicle=f"V{k}", day=day, start=k) for k in range(3)]
        assert store.add(trips, car_model=CAR) == Added(3, 0, 0)
        most = max(most, len(store.rows.open().file_uris()))
    assert most <= 8 + 2 * 3  # each commit adds a file for each vehicle, and the files are counted before it
    assert store.add([drive(trip="T1", vehicle="V2", start=2)], car_model=CAR) == Added(0, 1, 0)
    assert [len(list(store.logs(vehicle_id=f"V{k}"))) for k in range(3)] == [8, 8, 8]


def test_merging_gives_way_to_a_writer_that_commits_first(store, monkeypatch):
    store.add([drive()], car_model=CAR)
    store.add([drive(trip="T2", day=2)], car_model=CAR)
    stale = store.rows.open()
    store.rows.delete("trip_id = 'T1'")
    monkeypatch.setattr("tripwatt.fleet.store.delta.DeltaFolder.open", lambda self: stale)
    store.rows.try_to_compact(1 << 20)
    monkeypatch.undo()
    assert list(store.trips()["trip_id"]) == ["T2"]
    store.add([drive(trip="T3", day=3)], car_model=CAR)
    store.rows.try_to_compact(1 << 20)
    assert len(store.rows.open().file_uris()) == 1


def test_missing_samples_are_an_error_and_no_shorter_trip(store):
    store.add([drive()], car_model=CAR)
    (row,) = store.trip_rows()
    store.samples.delete("sample = 17")
    refuses(r"samples are missing.*got 399 samples; allowed: 400", list, store.logs([row]))


def test_forgetting_leaves_nothing(store, tmp_path):
    name = "WVWZZZ-O'Neill-17"
    store.add([drive(vehicle=name, trip="A"), drive(vehicle="V2", trip="B")], car_model=CAR)
    store.add([drive(vehicle=name, trip="C", start=1.0)], car_model=CAR)
    assert store.forget(name) == 2
    assert [log.trip_id for log in store.logs()] == ["B"]
    files = [path for path in (tmp_path / "fleet").rglob("*") if path.is_file()]
    assert files
    assert not [path for path in files if b"WVWZZZ" in path.read_bytes()]
    assert store.samples.read(["vehicle_id"])["vehicle_id"].unique().to_pylist() == ["V2"]
    refuses("unknown vehicle", store.forget, name)
    store.samples.append(samples_table([stored_log(drive(trip="D"), "ghost", CAR, 4)], "b"))
    assert store.forget("ghost") == 0  # what a crash left behind is erased as well
    assert len(store.samples.read(["sample"])) == 400


def test_a_driver_is_forgotten_in_every_vehicle(store, tmp_path, monkeypatch):
    for k, (vehicle, driver) in enumerate([("V1", "Ada"), ("V2", "Ada"), ("V2", "Bo"), ("V3", None)]):
        store.add([drive(vehicle=vehicle, trip=f"T{k}", start=float(k), driver=driver)], car_model=CAR)
    with monkeypatch.context() as patch:
        patch.setattr(DeltaFolder, "drop_old_files", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            store.forget(driver="Ada")
    refuses("unknown driver", store.forget, driver="Ada")  # which removes the files that the killed call left
    assert [log.trip_id for log in store.logs()] == ["T2", "T3"]
    assert len(store.samples.read(["sample"])) == 800
    assert not [path for path in tmp_path.rglob("*.parquet") if b"Ada" in path.read_bytes()]
    assert store.forget(driver="Bo") == 1
    for given in ({}, {"vehicle_id": "V3", "driver": "Ada"}):
        refuses("one of them is needed", store.forget, **given)


def test_the_others_of_a_bucket_are_listed_and_added_after_forgetting(tmp_path):
    """A deletion writes the rows of the others again, with another type of texts."""
    made = create_store(tmp_path / "s", buckets=1)
    made.add([drive(trip=v, vehicle=v, start=float(v)) for v in "123"], car_model=CAR)
    made.forget("2")
    assert [*made.trips(vehicle_id="1", since="2024-01-01")["trip_id"]] == ["1"]
    assert [*made.trips(car_model=CAR)["trip_id"]] == ["1", "3"]
    assert made.add([drive(trip="2", vehicle="2", start=2.0)], car_model=CAR) == Added(1, 0, 0)
    assert [log.trip_id for log in made.logs(vehicle_id="3")] == ["3"]
    assert made.forget("3") == 1


def test_forgetting_that_was_killed_before_the_files_is_repeated(store, tmp_path, monkeypatch):
    store.add([drive(vehicle="WVWZZZ17", trip="A"), drive(vehicle="V2", trip="B")], car_model=CAR)

    def stop(*_):
        raise KeyboardInterrupt

    def left():
        return [p for p in (tmp_path / "fleet").rglob("*.parquet") if b"WVWZZZ17" in p.read_bytes()]

    with monkeypatch.context() as patch:
        patch.setattr(DeltaFolder, "drop_old_files", stop)
        with pytest.raises(KeyboardInterrupt):
            store.forget("WVWZZZ17")
    store.compact()
    assert left(), "the rows are gone, the files are not"
    refuses("unknown vehicle", store.forget, "WVWZZZ17")
    assert not left()
    assert [log.trip_id for log in store.logs()] == ["B"]


def test_the_audit_judges_the_logs_of_a_vehicle_together(store):
    store.add([drive(trip=f"T{i}", start=0.1 * i, day=i + 1) for i in range(3)], car_model=CAR)
    store.add([drive(n=40, trip="short", vehicle="V2")], car_model=CAR)
    found = [f for v in ("V1", "V2") for f in tw.audit([*store.logs(vehicle_id=v)]).findings]
    assert [f.trip for f in found if f.consequence == "set aside"] == ["short"]
    assert {f.trip for f in found} <= {"all logs", "short"}


def test_places_that_are_no_store(tmp_path):
    refuses("no trip store", open_store, tmp_path)
    create_store(tmp_path / "s", buckets=1)
    assert open_store(tmp_path / "s").buckets == 1
    refuses("trip store exists", create_store, tmp_path / "s")
    for buckets in (0, 1025):
        refuses("1 to 1024", create_store, tmp_path / "t", buckets=buckets)
    (tmp_path / "file").write_text("x")
    refuses(r"cannot be used|no trip store", create_store, tmp_path / "file" / "s")
    import deltalake
    import pyarrow as pa

    deltalake.write_deltalake(tmp_path / "u" / "trips", pa.table({"a": [1]}))
    refuses("another kind", open_store, tmp_path / "u")
    deltalake.write_deltalake(
        tmp_path / "v" / "trips", pa.table({"a": [1]}), description='{"tripwatt_store": 3, "buckets": 1}'
    )
    refuses("newer format", open_store, tmp_path / "v")
    assert join_place("s3://b/x/", "trips") == "s3://b/x/trips"
    assert is_url("gs://b")
    assert not is_url(str(tmp_path))


WRITER = """
import os
import sys
sys.path[:0] = sys.argv[4:]
import tripwatt.fleet.store.store
from tests.fleet.store.test_store import drive
from tripwatt.fleet.store import open_store
tripwatt.fleet.store.store.BATCH = 4
store = open_store(sys.argv[1])
first, last = int(sys.argv[2]), int(sys.argv[3])
logs = (drive(trip=f"T{i}", start=0.01 * i, day=1 + i % 28, vehicle=f"V{i % 5}") for i in range(first, last))
store.add(logs, car_model="nissan_leaf_24", progress=lambda a: print(a.added + a.known, flush=True))
os._exit(0)  # without the interpreter's end, at which threads of the store's library may abort a finished process
"""


def test_writers_at_once_and_one_killed_lose_and_double_nothing(store):
    root = str(ROOT)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([root, *sys.path])}
    spans = [(0, 12), (6, 18), (12, 24), (0, 400)]  # they overlap; the last one is killed
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, store.place, *map(str, span), root],
            stdout=subprocess.PIPE,
            text=True,
            env=env,
        )
        for span in spans
    ]
    victim = writers[3]
    acknowledged = [int(victim.stdout.readline()) for _ in range(3)][-1]
    victim.send_signal(signal.SIGKILL)
    acknowledged = max([acknowledged, *(int(line) for line in victim.stdout.read().split())])
    for writer in writers[:3]:
        assert writer.wait(timeout=240) == 0
        writer.stdout.close()
    victim.wait(timeout=60)
    victim.stdout.close()
    found = [log.trip_id for log in store.logs()]
    assert len(found) == len(set(found))
    assert {f"T{i}" for i in range(max(24, acknowledged))} <= set(found)
    assert len(store.trips()) == len(found)


def test_other_programs_read_the_tables(store):
    duckdb = pytest.importorskip("duckdb", reason="needs duckdb")
    polars = pytest.importorskip("polars", reason="needs polars")
    import deltalake

    later = drive(trip="B", vehicle="V2", start=1.0)
    zoned = later.context.started_at.replace(tzinfo=dt.timezone(dt.timedelta(hours=2)))
    later = replace(later, context=replace(later.context, started_at=zoned))
    store.add([drive(trip="A"), later], car_model=CAR)
    samples = deltalake.DeltaTable(store.samples.place).to_pyarrow_dataset()
    trips = deltalake.DeltaTable(store.rows.place).to_pyarrow_dataset()
    with duckdb.connect() as db:
        db.register("samples", samples)
        db.register("trips", trips)
        rows = db.sql(
            "SELECT trip_id, count(*), max(voltage_v) FROM samples JOIN trips USING (batch, digest) "
            "GROUP BY trip_id ORDER BY trip_id"
        ).fetchall()
        instants = db.sql("SELECT epoch(started_at_utc) FROM trips ORDER BY trip_id").fetchall()
    assert rows == [("A", 400, 360.0), ("B", 400, 360.0)]
    assert instants == [(None,), (zoned.timestamp(),)]
    frame = polars.scan_delta(store.rows.place).select("trip_id", "energy_wh").sort("trip_id").collect()
    expected = store.trips().sort_values("trip_id")["energy_wh"].tolist()
    assert frame["energy_wh"].to_list() == pytest.approx(expected, rel=1e-15)


def test_a_folder_of_tables_is_added_file_by_file(store, tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    for i in range(3):
        drive(start=0.3 * i).samples.to_csv(folder / f"d{i}.csv", index=False)
    seen = []
    done = add_files(store, folder, car_model=CAR, vehicle_id="V9", progress=seen.append)
    assert done == Added(3, 0, 0)
    assert seen[-1] == done
    (folder / "bad.csv").write_text("time_s,speed_m_s\n0,1\nx,2\n")
    drive(start=2.0).samples.to_csv(folder / "d9.csv", index=False)
    refuses(r"bad.csv", add_files, store, folder, car_model=CAR, vehicle_id="V9")
    assert sorted(store.trips()["trip_id"]) == ["d0", "d1", "d2", "d9"]


def test_a_mapping_names_the_vehicle(store, tmp_path):
    table = pd.concat(
        [
            drive(start=s).samples.assign(drive=name, vin=vin)
            for s, name, vin in ((0.0, 1, "X"), (1.0, 2, "X"), (2.0, 1, "Y"))
        ]
    )
    table.to_csv(tmp_path / "all.csv", index=False)
    columns = "".join(
        f'{n} = {{ column = "{n}" }}\n' for n in ("time_s", "speed_m_s", "voltage_v", "current_a")
    )
    mapping = tmp_path / "m.toml"
    mapping.write_text(f'[columns]\n{columns}[trip]\ncolumn = "drive"\nvehicle = "vin"\n')
    assert add_files(store, tmp_path / "all.csv", car_model=CAR, mapping=mapping).added == 3
    assert sorted(map(tuple, store.trips()[["vehicle_id", "trip_id"]].to_numpy())) == [
        ("X", "X-1"),
        ("X", "X-2"),
        ("Y", "Y-1"),
    ]
    mapping.write_text(f'[columns]\n{columns}[trip]\nvehicle = "vin"\n')
    with pytest.raises(InvalidInput, match=r"no single vehicle.*'X', 'Y'"):
        add_files(store, tmp_path / "all.csv", car_model=CAR, mapping=mapping)
    table[table["vin"] == "Y"].to_csv(tmp_path / "one.csv", index=False)
    assert add_files(store, tmp_path / "one.csv", car_model=CAR, mapping=mapping).known == 1
    mapping.write_text(f"[columns]\n{columns}[trip]\n")
    with pytest.raises(InvalidInput, match=r"missing key: .*\[trip\] column"):
        add_files(store, tmp_path / "one.csv", car_model=CAR, mapping=mapping)
    mapping.write_text(f'[columns]\n{columns}[trip]\ncolumn = "drive"\nvehicle = 3\n')
    with pytest.raises(InvalidInput, match=r"\[trip\] vehicle: got 3"):
        add_files(store, tmp_path / "one.csv", car_model=CAR, mapping=mapping)
