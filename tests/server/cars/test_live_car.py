"""A car on the road: the same forecast as `update` on the same samples, through restarts, bad connections and full disks."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.server.cars.driving import LINKS, MODEL, NOW_S, ended, fed
from tests.server.cars.messages import NOON_S, measured, over_a_bad_connection, samples_of
from tests.support.drives import example_trip
from tests.support.plans import request_of_samples

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast
from tripwatt.routes import links_of_trip
from tripwatt.server.cars import live_car as module
from tripwatt.server.cars.car import AIR_S, Car
from tripwatt.server.cars.car_file import Database
from tripwatt.server.cars.live_trip import SILENCE_S
from tripwatt.server.cars.sender import LATE_S
from tripwatt.server.cars.telemetry import Sample
from tripwatt.server.cars.topics import TopicJoiner
from tripwatt.trips import Plan
from tripwatt.trips.messages import flag_to_dict

REPLAYED = ("TripA05", "TripB30")


@pytest.fixture(scope="module")
def forecast(drive: pd.DataFrame) -> Forecast:
    return tw.load_model().forecast(Plan.from_samples(example_trip().iloc[:700]))


def on_the_clock(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(time_s=table["time_s"] - table["time_s"].iloc[0])


def same(one: Forecast, other: Forecast) -> None:
    assert one.energy_wh == pytest.approx(other.energy_wh, abs=1e-6)
    assert one.interval(0.9) == pytest.approx(other.interval(0.9), abs=1e-6)
    assert one.arrival.quantile(0.05) == pytest.approx(other.arrival.quantile(0.05), abs=1e-9)


def test_the_forecast_is_that_of_update_at_every_moment(
    drive: pd.DataFrame, forecast: Forecast, folder: Path
) -> None:
    with Car.follow(folder) as car:
        assert car.update(forecast) is forecast, "before the trip it is the forecast at departure"
        for k, sample in enumerate(samples_of(drive), start=1):
            car.record(sample, now_s=NOW_S)
            if k % 120 == 0:
                same(car.update(forecast), forecast.update(on_the_clock(drive.iloc[:k])))
        pd.testing.assert_frame_equal(
            car.observed()[drive.columns], on_the_clock(drive), check_column_type=False
        )


@pytest.mark.parametrize("seed", range(2))
def test_late_and_doubled_messages_change_nothing(
    drive: pd.DataFrame, forecast: Forecast, folder: Path, seed: int
) -> None:
    sent = over_a_bad_connection(samples_of(drive), seed, late_s=LATE_S - 1.0)
    with Car.follow(folder) as car:
        car.set_plan({}, NOON_S)
        arrivals = fed(car, sent)
        left = sorted({sample.time_s - NOON_S for sample in sent})
        assert car.counts == {"new": len(left), "doubled": len(sent) - len(left), "late": 0, "faulty": 0}
        assert arrivals.count("new") == len(left)
        kept = on_the_clock(drive)
        same(car.update(forecast), forecast.update_since_departure(kept[kept["time_s"].isin(left)]))


def test_a_restart_at_any_moment_loses_and_doubles_nothing(
    drive: pd.DataFrame, forecast: Forecast, folder: Path
) -> None:
    samples = samples_of(drive)
    sent = over_a_bad_connection(samples, 7)
    for k in range(0, len(sent), 100):
        with Car.follow(folder) as car:
            fed(car, sent[max(0, k - 20) : k + 100])
    other = folder.with_name("other")
    with Car.follow(folder) as car, Car.follow(other) as straight:
        fed(straight, sent)
        pd.testing.assert_frame_equal(car.observed(), straight.observed())
        same(car.update(forecast), straight.update(forecast))


def test_a_finished_trip_is_a_log_and_leaves_no_samples_behind(drive: pd.DataFrame, folder: Path) -> None:
    moving = int(np.flatnonzero(drive["speed_m_s"] >= 1.0)[-1])
    with Car.follow(folder) as car:
        car.set_plan({"any": "thing"}, NOON_S)
        fed(car, samples_of(drive))
        assert len(car.file.messages()) == len(drive)
        ended(car, float(moving))
        assert (car.trip, car.plan) == (None, None)
        assert len(car.observed()) == 0
        assert len(car.file.messages()) < 50
        (log,) = car.logs()
    expected = on_the_clock(drive).iloc[: moving + 1]
    expected = expected[expected["time_s"] <= moving]
    assert log.trip_id.startswith("my-i3-20231114T")
    pd.testing.assert_frame_equal(log.samples[drive.columns], expected, check_column_type=False, atol=1e-9)
    assert log.context.started_at is not None
    assert log.context.started_at.timestamp() == NOON_S


def test_a_trip_that_has_ended_is_in_the_file_with_what_is_left_of_its_messages_or_not_at_all(
    drive: pd.DataFrame, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process is killed, or the disk is full, right before the transaction ends."""

    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    finished = list[str]()
    with Car.follow(folder) as car:
        car.finished = lambda: finished.append(car.name)
        car.set_plan({"to": "work"})
        fed(car, samples_of(drive))
        with monkeypatch.context() as patch:
            patch.setattr(Database, "put_messages", full)
            with pytest.raises(OSError, match="disk is full"):
                car.finish_trip()
        assert (car.logs(), finished) == ((), [])
        assert len(car.file.messages()) == len(drive)
        assert car.plan is not None
    with Car.follow(folder) as car:  # it was killed
        car.finished = lambda: finished.append(car.name)
        ended(car, 600.0)
        assert (len(car.logs()), car.trip, car.plan, finished) == (1, None, None, [car.name])
        late = samples_of(drive)[-20:]
        assert fed(car, late) == ["late"] * 20, "a sender that repeats itself starts no trip"


def test_silence_by_our_clock_ends_a_trip(drive: pd.DataFrame, folder: Path) -> None:
    with Car.follow(folder) as car:
        assert not car.end_when_silent(NOW_S)
        fed(car, samples_of(drive))
        assert not car.end_when_silent(NOW_S + SILENCE_S - 1.0)
        assert car.end_when_silent(NOW_S + SILENCE_S)
        assert not car.end_when_silent(NOW_S + SILENCE_S)
        assert len(car.logs()) == 1
    with Car.follow(folder) as car:
        assert fed(car, samples_of(drive)[-3:]) == ["late", "late", "doubled"]
        assert car.trip is None


def test_a_car_is_not_silent_while_nobody_listened(drive: pd.DataFrame, folder: Path) -> None:
    with Car.follow(folder) as car:
        fed(car, samples_of(drive))
    opened_s = time.time()
    with Car.follow(folder) as car:
        assert car.received_s == NOW_S
        assert not car.end_when_silent(opened_s + SILENCE_S - 1.0)
        assert car.trip is not None
        assert car.end_when_silent(time.time() + SILENCE_S)


def test_a_car_that_is_moved_a_little_is_on_no_trip(folder: Path) -> None:
    with Car.follow(folder) as car:
        car.set_plan({"to": "work"})
        fed(car, [Sample(NOON_S + k, {"speed_m_s": 2.0 if k < 50 else 0.0}) for k in range(400)])
        assert (car.trip, car.logs()) == (None, ())
        assert car.plan is not None, "it still waits for its trip"


def test_the_usual_trip_is_that_of_this_time_of_day(drive: pd.DataFrame, folder: Path) -> None:
    day_s = 86_400.0
    with Car.follow(folder) as car:
        assert car.present_plan is None
        fed(car, samples_of(drive))
        assert car.present_plan is None, "a trip is not its own"
        ended(car, 600.0)
        fed(car, samples_of(drive.iloc[:200], NOON_S + day_s + 600.0))
        usual = car.present_plan
        assert usual is not None
        assert usual.usual_trip == car.logs()[0].trip_id
        assert car.present_plan is usual, "it is read once"
        fed(car, [Sample(NOON_S + day_s + 1000.0 + k, {"speed_m_s": 30.0}) for k in range(400)])
        assert car.present_plan is None, "the car goes elsewhere"
        ended(car, day_s + 1400.0)
        fed(car, samples_of(drive.iloc[:200], NOON_S + day_s + 5.0 * 3600.0))
        assert car.trip is not None
        assert car.present_plan is None


def test_the_departure_is_what_the_first_samples_show(drive: pd.DataFrame, folder: Path) -> None:
    with Car.follow(folder) as car:
        assert car.departure() == tw.Departure()
        car.record(
            Sample(NOON_S - 900.0, {"displayed_soc": 0.9, "ambient_temperature_degc": 3.0}), now_s=NOW_S
        )
        assert car.departure() == tw.Departure(soc=0.9, ambient_temperature_degc=3.0)
        fed(car, samples_of(drive.assign(displayed_soc=np.linspace(0.8, 0.7, len(drive)), soc=np.nan)))
        found = car.departure()
        assert (found.soc, found.payload_mass_kg) == (0.8, None)


def test_a_standing_car_needs_no_more_memory_or_disk_however_long_it_stands(folder: Path) -> None:
    with Car.follow(folder) as car:
        for k in range(5000):
            car.record(Sample(NOON_S + k, {"speed_m_s": 0.0}), now_s=NOW_S)
        assert len(car._finder.before) <= 181
        assert len(car._ordered.waiting) <= 31
        assert len(car.file.messages()) <= module.SLACK_MESSAGES + 2 * 212 + 2


def test_a_time_ahead_of_our_clock_counts(folder: Path) -> None:
    """Our clock may be slow: that of the sender orders its samples."""
    with Car.follow(folder) as car:
        assert car.record(Sample(NOON_S + 1e5), now_s=NOON_S) == "new"
        assert (car.counts["new"], car.received_s) == (1, NOON_S)
        with pytest.raises(InvalidInput, match="time in the future"):
            car.record(Sample(NOON_S + module.FAR_S + 1.0), now_s=NOON_S)


def test_one_process_has_a_car_open(folder: Path) -> None:
    with Car.follow(folder), pytest.raises(InvalidInput, match="another run"):
        Car.follow(folder)
    Car.follow(folder).close()


def test_a_forecast_that_was_not_stored_is_not_that_of_the_departure(
    drive: pd.DataFrame, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full when the trip begins; what is kept later counts from where the car was."""

    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    sent = samples_of(drive)
    with Car.follow(folder, lambda _: MODEL) as car:
        car.set_plan(request_of_samples(example_trip().iloc[:700]), NOON_S)
        for until in (0, 100, 200):
            fed(car, sent[len(car.observed()) : until])
            with monkeypatch.context() as patch:
                if until < 200:
                    patch.setattr(Database, "put_forecasts", full)
                assert car.document(NOW_S)["forecast"] is not None
        (kept,) = car.forecasts
        assert car.trip is not None
        assert kept.at_s == car.trip.last_s - car.trip.start_s > 0.0


def test_a_document_is_that_of_update_for_every_message(
    drive: pd.DataFrame, forecast: Forecast, folder: Path
) -> None:
    """What is kept of the departure and of the trip changes no figure: to 1e-9, after each of the messages."""
    with Car.follow(folder, lambda _: MODEL) as car:
        car.set_plan({**request_of_samples(example_trip().iloc[:700]), "reserve": 0.2}, NOON_S)
        for k, sample in enumerate(samples_of(drive), start=1):
            car.record(sample, now_s=NOW_S)
            if k < 40 or k % 37:
                continue
            found = car.document(NOW_S)
            known = car.departure().merge(forecast.plan.departure)
            own = MODEL.forecast(replace(forecast.plan, departure=known)).update(on_the_clock(drive.iloc[:k]))
            assert found["faults"] == []
            assert found["forecast"] == {
                "energy_wh": pytest.approx(own.energy_wh, rel=1e-9),
                "quantiles_wh": {
                    f"{p:g}": pytest.approx(own.quantile(p), rel=1e-9) for p in (0.05, 0.5, 0.95)
                },
                "soc_arrival": pytest.approx(own.soc_arrival, rel=1e-9),
                "soc_quantiles": {
                    f"{p:g}": pytest.approx(own.arrival.quantile(p), rel=1e-9) for p in (0.05, 0.5, 0.95)
                },
                "reserve": 0.2,
                "p_arrive": pytest.approx(own.p_arrive(0.2), rel=1e-9),
                "p_arrive_at_all": pytest.approx(own.p_arrive(), rel=1e-9),
                "measured_until_s": own.measured_until_s,
                "duration_s": own.plan.duration_s,
                "distance_m": pytest.approx(own.drive.distance_m[-1], rel=1e-9),
                "course": found["forecast"]["course"],
                "flags": [flag_to_dict(flag) for flag in own.flags],
            }
            assert car.document(NOW_S)["forecast"] is found["forecast"], "it is made once"


def test_samples_that_do_not_fit_leave_the_forecast_of_the_same_trip_and_drop_that_of_another(
    drive: pd.DataFrame, folder: Path
) -> None:
    sent = samples_of(drive)
    absurd = {"speed_m_s": 10.0, "voltage_v": 450.0, "current_a": 2900.0}
    with Car.follow(folder, lambda _: MODEL) as car:
        plan = request_of_samples(example_trip().iloc[:700])
        car.set_plan(plan, NOON_S)
        departing = car.document(NOW_S)["forecast"]
        fed(car, sent[:300])
        before = car.document(NOW_S)["forecast"]
        assert before is not None
        assert before["measured_until_s"] == pytest.approx(299.0, abs=5.0)
        fed(car, [replace(sent[k], values=absurd) for k in range(300, 400)])
        found = car.document(NOW_S)
        assert "battery" in found["faults"][0]["what"]
        assert found["forecast"] is before
        car.set_plan(plan, NOON_S)
        found = car.document(NOW_S)
        assert found["faults"]
        assert found["forecast"] is not None
        assert found["forecast"]["measured_until_s"] == departing["measured_until_s"]


def test_a_forecast_is_of_what_is_known_of_the_departure(folder: Path) -> None:
    with Car.follow(folder, lambda _: MODEL) as car:
        assert car.at_departure() is None
        car.set_plan({"links": LINKS, "soc": 0.5})
        unknown = car.at_departure()
        assert unknown is not None
        assert car.at_departure() is unknown
        car.record(Sample(NOON_S, {"displayed_soc": 0.9, "ambient_temperature_degc": -8.0}))
        known = car.at_departure()
        assert known is not None
        assert known.plan.departure == tw.Departure(soc=0.5, ambient_temperature_degc=-8.0)
        assert known.energy_wh > unknown.energy_wh


def ovms_after_a_night(car: Car, soc: float | None, *, drives_s: int = 100) -> None:
    """OVMS sends the charge once, the time for an hour, and then drives: senders repeat only what changes."""
    joiner = TopicJoiner("ovms", "car")
    for k in [*range(0, 3600, 60), *range(3600, 3600 + drives_s)]:
        drives = k >= 3600
        sent = {"m/time/utc": NOON_S + k, "v/p/speed": 50 if drives else 0}
        sent |= {"v/b/voltage": 360, "v/b/current": 15 if drives else 0, "v/e/temp": 20}
        sent |= {"v/b/soc": 100.0 * soc} if k == 0 and soc is not None else {}
        for metric, value in sent.items():
            sample = joiner.take(f"car/{metric}", f"{value}".encode(), NOON_S + k)
            if sample is not None:
                fed(car, [sample])


@pytest.mark.parametrize("soc", [0.69, 0.78])
def test_a_charge_holds_while_the_car_stands(folder: Path, soc: float) -> None:
    with Car.follow(folder, lambda _: MODEL) as car:
        car.set_plan({"links": LINKS})
        ovms_after_a_night(car, soc)
        assert car.trip is not None
        assert car.departure().soc == pytest.approx(soc)
        found = car.document(NOW_S)
        assert (found["soc"], found["soc_source"]) == (pytest.approx(soc), "soc")
        assert found["forecast"] is not None
        assert soc - 0.1 < found["forecast"]["soc_arrival"] < soc
        assert "soc_assumed" not in {flag["code"] for flag in found["forecast"]["flags"]}


def test_an_unknown_charge_is_assumed_with_a_flag(folder: Path) -> None:
    with Car.follow(folder, lambda _: MODEL) as car:
        car.set_plan({"links": LINKS})
        ovms_after_a_night(car, None)
        found = car.document(NOW_S)
        assert (found["soc"], found["soc_source"]) == (None, None)
        assert found["forecast"] is not None
        assert "soc_assumed" in {flag["code"] for flag in found["forecast"]["flags"]}
        fed(car, [Sample(NOON_S + 3700.0, {"speed_m_s": 14.0, "displayed_soc": 0.5})])
        found = car.document(NOW_S)
        assert found["forecast"] is not None
        assert "soc_assumed" not in {flag["code"] for flag in found["forecast"]["flags"]}, "it is read now"


def test_a_charge_of_before_the_last_trip_does_not_hold(folder: Path) -> None:
    with Car.follow(folder) as car:
        fed(car, [Sample(NOON_S, {"speed_m_s": 0.0, "displayed_soc": 0.8})])
        fed(car, [Sample(NOON_S + 10.0 * k, {"speed_m_s": 20.0}) for k in range(1, 60)])
        ended(car, 600.0)
        assert len(car.logs()) == 1
        assert car.departure().soc is None
        fed(car, [Sample(NOON_S + 2000.0, {"speed_m_s": 0.0, "displayed_soc": 0.7})])
        fed(car, [Sample(NOON_S + 9000.0 + k, {"speed_m_s": 20.0}) for k in range(100)])
        assert car.departure().soc == 0.7


def test_a_charge_of_the_battery_management_is_shown_as_the_display_shows_it(folder: Path) -> None:
    asked: list[object] = []
    with Car.follow(folder, lambda request: asked.append(request) or MODEL) as car:
        fed(car, [Sample(NOON_S + k, {"speed_m_s": 0.0, "soc": 0.6}) for k in range(5)])
        before, request = car.shown_soc(), {"links": LINKS}
        car.set_plan(request)
        assert (car.shown_soc(), asked[0], asked[-1]) == (before, {}, request)
        found = car.document(NOW_S)
        assert found["soc_source"] == "bms_soc"
        departing = car.at_departure()
        assert departing is not None
        assert found["soc"] == pytest.approx(float(departing.charge.displayed(0.6)))
        assert abs(found["soc"] - 0.6) > 1e-3
    with Car.follow(folder) as car:
        found = car.document(NOW_S)
        assert (found["soc"], found["soc_source"]) == (None, "bms_soc"), "without a model"


@pytest.mark.parametrize(("beyond", "counts"), [(0.05, True), (0.2, False)])
def test_a_charge_of_the_battery_management_counts_from_the_display_of_the_plan(
    beyond: float, counts: bool, folder: Path
) -> None:
    arrivals = []
    for more in (0.0, beyond):
        with Car.follow(folder / f"{more}", lambda _: MODEL) as car:
            charge = MODEL.forecast(tw.read_route(LINKS)).charge
            car.set_plan({"links": LINKS, "soc": float(charge.displayed(0.6)) + more})
            values = {"speed_m_s": 15.0, "voltage_v": 360.0, "current_a": 30.0}
            fed(car, [Sample(NOON_S + k, {**values, "soc": 0.6 - 5e-5 * k}) for k in range(200)])
            departing = car.at_departure()
            assert departing is not None
            arrivals.append(car.update(departing).soc_arrival)
    assert arrivals[1] - arrivals[0] == pytest.approx(beyond if counts else 0.0, abs=0.004)


def test_without_a_plan_the_road_is_that_of_the_usual_trip(drive: pd.DataFrame, folder: Path) -> None:
    with Car.follow(folder, lambda _: MODEL) as car:
        fed(car, samples_of(drive))
        found = car.document(NOW_S)
        assert (found["plan"], found["usual_trip"], found["forecast"], found["faults"]) == (
            None,
            None,
            None,
            [],
        )
        car.end_when_silent(NOW_S + SILENCE_S)
        (log,) = car.logs()
        fed(car, samples_of(drive.iloc[:150], NOON_S + 86_400.0))
        found = car.document(NOW_S)
        plan = links_of_trip(log).plan().with_departure(car.departure())
        own = car.update(MODEL.forecast(plan))
        assert (found["plan"], found["usual_trip"]) == ("usual", log.trip_id)
        assert found["forecast"] is not None
        assert found["forecast"]["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
        assert found["forecast"]["measured_until_s"] > 100.0
        assert car.document(NOW_S) == found


KILLED = """
import sys
from pathlib import Path
from tests.server.cars.messages import measured, samples_of
from tripwatt.server.cars.car import Car
from tests.support.drives import example_trip
car = Car.follow(sys.argv[1])
for sample in samples_of(measured(example_trip())):
    sys.stdin.readline()
    car.record(sample)
    print(sample.time_s, flush=True)
"""


def test_a_killed_process_loses_nothing_that_it_acknowledged(folder: Path) -> None:
    for number in (150,):
        command = [sys.executable, "-c", KILLED, f"{folder}"]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write("\n" * number)
            process.stdin.flush()
            last = max(float(process.stdout.readline()) for _ in range(number - 30))
            os.kill(process.pid, signal.SIGKILL)
            last = max([last, *map(float, process.stdout.read().splitlines())])
        with Car.follow(folder) as car:
            observed = car.observed()
            assert int(last - NOON_S) + 1 <= len(observed) <= number
            assert observed["time_s"].tolist() == [float(k) for k in range(len(observed))]


def test_trips_of_the_tum_set_end_with_the_forecast_of_update(data_dir: Path, tmp_path: Path) -> None:
    fleet = tw.read_logs(data_dir / "tum", "tum")
    model = tw.load_model()
    for trip in (trip for trip in tw.audit(fleet).trips if trip.trip_id in REPLAYED):
        table, at_departure = measured(trip.samples), model.forecast(trip)
        table = table.assign(time_s=table["time_s"] - at_departure.plan.start_s)
        with Car.follow(tmp_path / trip.trip_id) as car:
            fed(car, samples_of(table, NOON_S + float(table["time_s"].iloc[0])))
            car.set_plan({}, NOON_S)
            same(car.update(at_departure), at_departure.update_since_departure(table))


def test_the_outside_temperature_stays_after_a_trip_and_a_restart_for_a_day(folder: Path) -> None:
    air = {"ambient_temperature_degc": -3.0}
    with Car.follow(folder) as car:
        for k in range(400):
            car.record(Sample(NOON_S + k, {"speed_m_s": 10.0, **(air if k < 100 else {})}), now_s=NOON_S + k)
        car.record(Sample(NOON_S + 401.0, {"speed_m_s": 0.0}), now_s=NOON_S + 401.0)
        car.end_when_silent(NOON_S + 401.0 + 1200.0)
        assert len(car.logs()) == 1
        assert car.last_air_degc(car.received_s or 0.0) == -3.0
    with Car.follow(folder) as again:
        again.record(Sample(NOON_S + 2000.0, {"speed_m_s": 0.0}), now_s=NOON_S + 2000.0)
        assert again.last_air_degc(NOON_S + 2000.0) == -3.0
        assert again.last_air_degc(NOON_S + AIR_S + 3000.0) is None
