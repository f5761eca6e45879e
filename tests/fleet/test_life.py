"""Registry, comparison, batch, evaluation and page of a fleet."""

import json
import threading
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from benchmarks.many_vehicles import many_vehicles

from tripwatt.errors import InvalidInput
from tripwatt.evaluation.fleets import LENGTHS, FleetEvaluation, classes, evaluate_rows
from tripwatt.fleet.batch import _name, forecast_batch, schema_of
from tripwatt.fleet.deviations import change_point, drift, sisters
from tripwatt.fleet.executors import InProcess
from tripwatt.fleet.life import refit_fleet
from tripwatt.fleet.mapping import SampledTrips, map_store, read_rows, sample_of, tasks_of
from tripwatt.fleet.registry import Comparison, FollowedModel, Registry, compare, predict_sample, unseen
from tripwatt.fleet.statistics import NUMBERS, ROWS, TripRows
from tripwatt.fleet.storage import save_fleet
from tripwatt.hybrid.groups import group_posterior
from tripwatt.report.fleets import report_page
from tripwatt.trips import Departure, Trip, plan_from_trip

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


@pytest.fixture(scope="module")
def sample(fleet):
    _, store, _, folder = fleet
    rows = store.trip_rows()
    chosen = sample_of(rows, 2, 9, seed=7)
    results = map_store(tasks_of(store, rows, folder / "life", chosen), InProcess(), 1)
    return SampledTrips.read([r.segments for r in results if r.segments])


@pytest.fixture(scope="module")
def rows(fleet):
    _, store, _, folder = fleet
    return read_rows(map_store(tasks_of(store, store.trip_rows(), folder / "rows"), InProcess(), 1))


def test_versions_are_added_promoted_and_rolled_back(fleet, tmp_path):
    *_, model, _ = fleet
    registry = Registry(tmp_path / "reg")
    assert registry.versions() == ()
    assert registry.history() == []
    with pytest.raises(InvalidInput, match="no version in use"):
        registry.current()
    assert [registry.add(model, "a"), registry.add(model), registry.add(model)] == ["0001", "0002", "0003"]
    with pytest.raises(InvalidInput, match="no version in use"):
        registry.load()
    registry.promote("0001")
    with pytest.raises(InvalidInput, match="nothing to roll back"):
        registry.roll_back()
    registry.promote("0002")
    assert registry.roll_back() == "0001" == registry.current()
    registry.promote("0003")
    assert registry.roll_back() == "0001"
    with pytest.raises(InvalidInput, match="nothing to roll back"):
        registry.roll_back()
    assert [(h["action"], h["version"]) for h in registry.history()] == [
        *(("add", v) for v in ("0001", "0002", "0003")),
        ("promote", "0001"),
        ("promote", "0002"),
        ("roll back", "0001"),
        ("promote", "0003"),
        ("roll back", "0001"),
    ]
    assert registry.history()[0]["note"] == "a"
    with (registry.folder / "history.jsonl").open("a") as file:
        file.write('{"action": "pro')
    assert len(registry.history()) == 8
    with pytest.raises(InvalidInput, match="unknown version"):
        registry.promote("0009")
    part = registry.path("0002") / "fleet.npz"
    part.write_bytes(part.read_bytes()[:-1])
    with pytest.raises(InvalidInput, match=r"fleet\.npz"):
        registry.promote("0002")
    assert registry.current() == "0001"
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInput, match="registry cannot be written"):
        Registry(tmp_path / "file").add(model)


def test_a_worse_challenger_is_refused():
    worse = Comparison(10, 5, 0.05, 0.07, 0.02, 0.01, 0.03)
    assert worse.worse
    assert not replace(worse, low=0.0).worse
    assert not replace(worse, low=-0.01).worse
    assert str(worse) == (
        "mean error 7.00% against 5.00% on 10 trips of 5 vehicles; difference +2.00% (+1.00% to +3.00%)"
    )


def test_promote_refuses_what_is_worse(fleet, tmp_path):
    *_, model, _ = fleet
    registry = Registry(tmp_path)
    registry.add(model)
    with pytest.raises(InvalidInput, match="challenger is worse"):
        registry.promote("0001", Comparison(10, 5, 0.05, 0.07, 0.02, 0.01, 0.03))
    assert registry.history()[-1]["action"] == "add"
    registry.promote("0001", Comparison(10, 5, 0.05, 0.04, -0.01, -0.02, 0.0))
    assert registry.history()[-1]["comparison"]["difference"] == -0.01


def test_models_are_compared_on_trips_that_neither_has_seen(fleet, sample):
    *_, model, _ = fleet
    left = unseen(model, sample)
    assert left.trips == model.trips - len(sample)
    assert unseen(left, replace(sample, digests=("x",) * len(sample))) is left
    own = predict_sample(model, sample)
    observed = sample.table.totals_wh(sample.table.observed_power_w)
    assert np.mean(np.abs(own - observed)) < np.mean(np.abs(predict_sample(left, sample) - observed))
    group = sample.groups[0]
    table = sample.table.take([0])
    corrector = model.of_vehicle(group[1], driver=group[2]).corrector_
    assert own[0] == pytest.approx(table.totals_wh(table.simulated_w + corrector.predict(table))[0])
    same = compare(model, model, sample)
    assert (same.difference, same.low, same.high, same.trips, same.vehicles) == (
        0.0,
        0.0,
        0.0,
        len(sample),
        8,
    )
    moved = replace(
        model, posterior=replace(model.posterior, mean=model.posterior.mean + 5.0), digests=frozenset()
    )
    against = compare(replace(model, digests=frozenset()), moved, sample)
    assert against.worse
    assert against.difference == pytest.approx(against.challenger - against.champion)
    assert against.low <= against.difference <= against.high
    back = compare(moved, replace(model, digests=frozenset()), sample)
    assert back.difference == pytest.approx(-against.difference)
    assert not back.worse


def test_a_follower_changes_versions_without_losing_a_request(fleet, tmp_path):
    *_, model, _ = fleet
    registry = Registry(tmp_path)
    other = replace(model, about={"other": True})
    registry.add(model)
    registry.add(other)
    registry.promote("0001")
    followed = FollowedModel(registry)
    assert followed.version == "0001"
    failed, seen, stop = [], set(), threading.Event()

    def ask():
        while not stop.is_set():
            try:
                seen.add("other" in followed.get().about)
            except Exception as error:
                failed.append(error)
            time.sleep(0.001)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for _ in range(3):
        registry.promote("0002")
        registry.roll_back()
    registry.promote("0002")
    deadline = time.monotonic() + 30.0
    while followed.version != "0002" and time.monotonic() < deadline:
        time.sleep(0.01)
    stop.set()
    for thread in threads:
        thread.join()
    assert failed == []
    assert seen == {True, False}
    assert "other" in followed.get().about  # a thread may have been reading the version before
    assert followed.version == "0002"
    (registry.path("0001") / "metadata.json").write_text("{}")
    registry._point("0001")
    assert "other" in followed.get().about  # a damaged version is not taken
    (tmp_path / "current").unlink()
    assert "other" in followed.get().about


def test_a_caller_that_read_the_pointer_long_ago_does_not_turn_it_back(fleet, tmp_path, monkeypatch):
    *_, model, _ = fleet
    registry = Registry(tmp_path)
    for version in ("0001", "0002"):
        registry.add(model)
        registry.promote(version)
    followed = FollowedModel(registry)
    answers = ["0001", "0002"]  # what the caller read before it waited, and what is there now
    monkeypatch.setattr(Registry, "current", lambda self: answers.pop(0))
    followed.get()
    assert (followed.version, answers) == ("0002", [])


def test_a_refit_is_compared_and_then_takes_the_newest_weeks_in(fleet, tmp_path):
    _, store, model, folder = fleet
    registry = Registry(tmp_path / "reg")
    registry.promote(registry.add(model))
    version, comparison, promoted = refit_fleet(store, registry, folder / "refit", InProcess(), weeks=1.0)
    assert (version, promoted) == ("0002", True)
    newest = store.trips(since="2023-01-14")
    assert 0 < comparison.trips <= len(newest)
    assert registry.current() == "0002"
    assert registry.load().trips == model.trips
    assert np.abs(registry.load().sums.xx - model.sums.xx).max() < 1e-10 * np.abs(model.sums.xx).max()


def links(trip, vehicle, **more):
    return [
        {"trip": trip, "vehicle_id": vehicle, "length_m": 1500.0, "speed_m_s": v, **more}
        for v in (12.0, 20.0, 15.0)
    ]


def test_a_batch_is_the_forecasts_of_its_trips(fleet, tmp_path):
    import tripwatt as tw

    *_, model, _ = fleet
    save_fleet(model, tmp_path / "m")
    known = {"soc": 0.8, "ambient_temperature_degc": 4.0, "car_model": None}
    table = [
        *links("b", "V00001", **known),
        *links("a", "V00000", **known),
        *links("c", "new", **{**known, "car_model": "vw_id3"}),
        *links("d", "nobody", **known),
        *links("e", "V00000", **{**known, "ambient_temperature_degc": 99.0}),
        *links("f", "V00000", soc=None, ambient_temperature_degc=None, car_model=None),
    ]
    pq.write_table(pa.Table.from_pylist(table), tmp_path / "in.parquet")
    count = forecast_batch(
        tmp_path / "m",
        tmp_path / "in.parquet",
        tmp_path / "out.parquet",
        InProcess(),
        quantiles=(0.1, 0.975),
        reserve=0.1,
    )
    assert count == 6
    found = pq.read_table(tmp_path / "out.parquet")
    assert found.schema.names == schema_of((0.1, 0.975)).names
    out = {row["trip"]: row for row in found.to_pylist()}
    assert list(out) == ["a", "e", "f", "b", "c", "d"]  # by vehicle and trip
    plan = tw.read_route([{"length_m": 1500.0, "speed_m_s": v} for v in (12.0, 20.0, 15.0)], trip_id="a")
    departure = Departure(soc=0.8, ambient_temperature_degc=4.0)
    own = model.forecast(plan, departure, vehicle_id="V00000")
    assert out["a"]["energy_wh"] == pytest.approx(own.energy_wh, rel=1e-12)
    assert out["a"]["energy_wh_q10"] == pytest.approx(own.quantile(0.1), rel=1e-12)
    assert out["a"]["energy_wh_q97_5"] == pytest.approx(own.quantile(0.975), rel=1e-12)
    assert out["a"]["soc_arrival"] == pytest.approx(own.soc_arrival, rel=1e-12)
    assert out["a"]["p_arrive"] == pytest.approx(own.p_arrive(0.1), rel=1e-12)
    assert (out["a"]["distance_m"], out["a"]["sd_wh"]) == (
        pytest.approx(4500.0, rel=1e-4),
        pytest.approx(own.sd_wh),
    )
    assert out["c"]["energy_wh"] > 0.0
    assert out["f"]["error"] is None
    usual = "ambient_temperature_degc, cabin_temperature_degc, cabin_setpoint_degc, battery_temperature_degc"
    assert out["f"]["assumed"] == f"{usual}, soc"
    assert out["a"]["assumed"] == usual.partition(", ")[2]
    assert out["d"]["assumed"] is None
    assert "such as 'V00000'" in out["d"]["error"]
    assert "unknown vehicle" in out["d"]["error"]
    assert "ambient_temperature_degc" in out["e"]["error"]
    assert out["e"]["energy_wh"] is None


def test_a_batch_that_cannot_be_read_is_one_error(fleet, tmp_path):
    pq.write_table(pa.table({"trip": ["a"]}), tmp_path / "in.parquet")
    with pytest.raises(InvalidInput) as error:
        forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", InProcess())
    assert [f.allowed for f in error.value.faults] == ["a column 'vehicle_id'", "a column 'length_m'"]
    with pytest.raises(InvalidInput, match=r"unreadable Parquet file.*to_parquet"):
        forecast_batch(tmp_path, tmp_path / "none", tmp_path / "o", InProcess())
    for bad in (0.0, 1.0):
        with pytest.raises(InvalidInput, match="quantiles"):
            forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", InProcess(), quantiles=(bad,))
    for bad in (-0.1, 1.0):
        with pytest.raises(InvalidInput, match="reserve"):
            forecast_batch(tmp_path, tmp_path / "in.parquet", tmp_path / "o", InProcess(), reserve=bad)
    assert [_name(q) for q in (0.05, 0.5, 0.999)] == ["energy_wh_q05", "energy_wh_q50", "energy_wh_q99_9"]


def made_rows(n_vehicles=12, per_vehicle=14, seed=0):
    """Rows of a fleet whose residual is linear in two features, by vehicle."""
    rng = np.random.default_rng(seed)
    table = []
    for v in range(n_vehicles):
        own = rng.normal(0.0, 0.4)
        for k in range(per_vehicle):
            simulated = float(rng.uniform(1500.0, 3000.0))
            x = {f"x_{name.removeprefix('x_')}": 0.0 for name in ROWS.names if name.startswith("x_")}
            x["x_rolling"] = 0.04 * simulated
            error = float(rng.normal(0.0, 15.0))
            table.append(
                {
                    "car_model": f"m{v % 3}",
                    "vehicle_id": f"v{v:02d}",
                    "driver": "",
                    "digest": f"{v:02d}-{k:02d}",
                    "drive": f"{v}-{k}",
                    "started_at": f"2024-{1 + k // 2:02d}-{1 + k % 28:02d}T08:00:00",
                    **dict.fromkeys(NUMBERS, 1.0),
                    "distance_m": 5000.0 * (1 + k % 6),
                    "ambient_temperature_degc": -5.0 + 4.0 * (k % 8),
                    "simulated_wh": simulated,
                    "observed_wh": simulated + (1.0 + own) * x["x_rolling"] + error,
                    "variance_wh2": 225.0,
                    **x,
                }
            )
    return TripRows.join([pa.Table.from_pylist(table, schema=ROWS)])


def test_evaluation_holds_out_what_it_scores():
    rows = made_rows()
    found = evaluate_rows(rows)
    table = found.table("car_model")
    assert set(table["protocol"]) == {"later trips", "new vehicles", "new car models"}
    assert table.loc[table["protocol"] == "new vehicles", "trips"].sum() == 168
    later = table[table["protocol"] == "later trips"]
    assert later["trips"].sum() == pytest.approx(0.2 * 168, abs=12)
    assert later["error"].max() < table.loc[table["protocol"] == "new vehicles", "error"].min()
    own = found.own.set_index("own_trips")
    assert own.index.tolist() == [0, 1, 3]
    assert own.loc[0, "pooled"] == pytest.approx(own.loc[0, "fleet_only"])
    assert (own["pooled"] <= own[["own_only", "fleet_only"]].min(axis=1) * 1.02).all()
    assert own.loc[3, "pooled"] < own.loc[0, "pooled"]
    # by hand: the forecast of a vehicle without its trips
    sums = rows.sums
    from tripwatt.fleet.features import START
    from tripwatt.hybrid.groups import fit_scales

    scales = fit_scales(sums, START)
    again = evaluate_rows(rows, scales)
    its = rows.texts("vehicle_id") == "v05"
    vehicles = sorted(set(rows.texts("vehicle_id").tolist()))
    fold = np.random.default_rng(0).permutation(12) % 10
    together = [v for v, f in zip(vehicles, fold, strict=True) if f == fold[5]]
    left = group_posterior(rows.where([v not in together for v in rows.texts("vehicle_id")]).sums, scales)
    expected = rows.numbers("simulated_wh")[its] + rows.X[its] @ left.weights("m2", "v05")[0]
    frame = again.trips[(again.trips["protocol"] == "new vehicles") & (again.trips["vehicle_id"] == "v05")]
    assert frame["predicted_wh"].to_numpy() == pytest.approx(expected, rel=1e-9)
    inside = (frame["observed_wh"] >= frame["low_wh"]) & (frame["observed_wh"] <= frame["high_wh"])
    counted = again.table("vehicle_id")
    row = counted[(counted["vehicle_id"] == "v05") & (counted["protocol"] == "new vehicles")].iloc[0]
    assert row["inside"] == pytest.approx(inside.mean())
    error = np.abs(frame["predicted_wh"] - frame["observed_wh"]) / frame["observed_wh"]
    assert row["error"] == pytest.approx(error.mean())
    assert set(again.table("temperature")["temperature"]) == {
        "below 0 °C",
        "0 to 10 °C",
        "10 to 20 °C",
        "above 20 °C",
    }
    assert set(again.table("length")["length"]) == {name for *_, name in LENGTHS}
    one = rows.where(rows.texts("vehicle_id") == "v00")
    with pytest.raises(InvalidInput, match="too few vehicles"):
        evaluate_rows(one)


def test_intervals_cover_their_share_of_new_vehicles():
    found = evaluate_rows(made_rows(40, 8, seed=2)).trips
    inside = (found["observed_wh"] >= found["low_wh"]) & (found["observed_wh"] <= found["high_wh"])
    share = inside[found["protocol"] == "new vehicles"].mean()
    assert share == pytest.approx(0.9, abs=0.04)


def test_classes_have_a_lower_bound_inside_and_an_upper_outside():
    names = classes(np.array([0.0, 9999.9, 10e3, 25e3, np.nan]), LENGTHS).tolist()
    assert names == ["below 10 km", "below 10 km", "10 to 25 km", "above 25 km", "unknown"]


def test_vehicles_that_take_more_are_found_with_the_day_of_the_change():
    rows = made_rows(9, 40)
    frame = rows.table.to_pandas()
    thirsty = frame["vehicle_id"] == "v04"
    late = thirsty & (frame["started_at"] >= "2024-11")
    frame.loc[late, "observed_wh"] *= 1.12
    rows = TripRows.join([pa.Table.from_pandas(frame, schema=ROWS, preserve_index=False)])
    sums = rows.sums
    from tripwatt.fleet.features import START
    from tripwatt.hybrid.groups import fit_scales

    found = sisters(group_posterior(sums, fit_scales(sums, START)), rows).set_index("vehicle_id")
    assert found.loc["v04", "since"][:7] == "2024-11"
    assert found.loc["v04", "change"] == pytest.approx(0.12, abs=0.02)
    assert found["since"].drop("v04").isna().all()
    assert found["share"].is_monotonic_decreasing
    assert found["trips"].eq(40).all()
    assert (found["sd"] > 0.0).all()


def test_change_points_by_hand():
    flat = np.array([0.0, 1.0] * 8)
    assert change_point(flat) == (None, 0.0)
    assert change_point(np.r_[flat, flat + 9.0]) == (16, 9.0)
    assert change_point(np.r_[flat[:8], flat[:8] - 5.0]) == (8, -5.0)
    assert change_point(np.r_[flat[:8], flat[:7] - 5.0]) == (None, 0.0)
    assert change_point(np.r_[flat, flat + 0.2]) == (None, 0.0)


def test_drift_names_the_vehicles_that_take_more(rows, fleet):
    *_, model, _ = fleet
    calm = drift(model.posterior, rows)
    assert calm["trips"] == len(rows)
    assert calm["coverage"] > 0.8
    frame = rows.table.to_pandas()
    its = frame["vehicle_id"] == "V00003"
    frame.loc[its, "observed_wh"] *= 1.3
    changed = TripRows.join([pa.Table.from_pandas(frame, schema=ROWS, preserve_index=False)])
    found = drift(model.posterior, changed)
    assert list(found["vehicles"]) == ["V00003"]
    assert found["vehicles"]["V00003"]["trips"] == its.sum()
    assert found["vehicles"]["V00003"]["bias"] == pytest.approx(0.3, abs=0.06)
    assert found["vehicles"]["V00003"]["z"] > 3.0
    assert found["coverage"] < calm["coverage"]
    assert found["bias"] - calm["bias"] == pytest.approx(0.3 * its.mean(), rel=0.2)


def test_the_page_has_every_table_and_escapes_names():
    trips = pd.DataFrame(
        {
            "protocol": "later trips",
            "car_model": "<b>",
            "vehicle_id": ["v&1"] * 12,
            "distance_m": 12e3,
            "ambient_temperature_degc": 5.0,
            "observed_wh": 1000.0,
            "predicted_wh": 1100.0,
            "low_wh": 900.0,
            "high_wh": [1200.0] * 9 + [950.0] * 3,
        }
    )
    own = pd.DataFrame(
        [(0, 3, 0.05, 0.2, 0.05)], columns=["own_trips", "vehicles", "pooled", "own_only", "fleet_only"]
    )
    vehicles = pd.DataFrame(
        [("v&1", "<b>", 12, 0.1, 0.02, "2024-06-01", 0.08), ("v2", "<b>", 9, -0.05, 0.02, None, 0.0)],
        columns=["vehicle_id", "car_model", "trips", "share", "sd", "since", "change"],
    )
    page = report_page("Fleet <1>", FleetEvaluation(trips, own), vehicles)
    assert "<h1>Fleet &lt;1&gt;</h1>" in page
    assert "<b>" not in page
    assert "<script" not in page
    for text in (
        "21 trips of 2 vehicles",
        "10.0 % on later trips",
        "consumption of 1 vehicles has changed",
        "v&amp;1",
        "+10.0 ± 2.0",
        "+8.0 % since 2024-06-01",
        "By outside temperature",
        "0 to 10 °C",
        "10 to 25 km",
        "<td class=n>10.0</td><td class=n>75</td>",
        "<td class=n>5.0</td><td class=n>20.0</td><td class=n>5.0</td>",
    ):
        assert text in page, text
    assert '<rect x="50.0" y="1" width="50.0"' in page
    assert '<rect x="25.0" y="1" width="25.0"' in page
    assert "v2" not in report_page("F", FleetEvaluation(trips, own), vehicles, most=1)


def test_a_forecast_needs_no_driver_and_knows_the_temperature_class(fleet):
    plan, _, model, _ = fleet
    own = plan_from_trip(Trip.from_log(next(many_vehicles(plan))))
    cold = replace(model.uncertainty.scores, values=model.uncertainty.scores.values * 3.0)
    wide = replace(model, scores={"cold": cold})
    narrow, wider = (
        m.forecast(own, Departure(ambient_temperature_degc=5.0), vehicle_id="V00000")
        for m in (replace(model, scores={}), wide)
    )
    assert wider.interval(0.9)[1] - wider.energy_wh > 1.5 * (narrow.interval(0.9)[1] - narrow.energy_wh)
    mild = [
        m.forecast(own, Departure(ambient_temperature_degc=8.0), vehicle_id="V00000").interval(0.9)
        for m in (replace(model, scores={}), wide)
    ]
    assert mild[0] == mild[1]
    by_model = replace(model, scores={"cold": cold, "bmw_i3_60ah": model.uncertainty.scores})
    assert by_model.uncertainty_of("bmw_i3_60ah", True).scores is model.uncertainty.scores
    assert by_model.uncertainty_of("nissan_leaf_24", True).scores is cold
    assert by_model.uncertainty_of("nissan_leaf_24").scores is model.uncertainty.scores


def test_history_is_json_lines(fleet, tmp_path):
    *_, model, _ = fleet
    registry = Registry(tmp_path)
    registry.promote(registry.add(model, "é"), note="first")
    lines = (tmp_path / "history.jsonl").read_text("utf-8").splitlines()
    assert [json.loads(line)["note"] for line in lines] == ["é", "first"]
