"""The plan of a trip: kept until it has ended, and what is no road is a fault."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pandas as pd
import pytest
from tests.server.cars.driving import LINKS, MODEL, NOW_S, ended, fed
from tests.server.cars.messages import NOON_S, samples_of
from tests.support.drives import example_trip
from tests.support.plans import request_of_samples
from tests.support.refusals import refusal

from tripwatt.errors import Fault, InvalidInput
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.car_file import row_of_log
from tripwatt.server.cars.folder import create_car
from tripwatt.server.cars.live_trip import SILENCE_S, STANDING_S
from tripwatt.server.cars.plan import NEAR_S, LivePlan, usual_departure
from tripwatt.server.cars.telemetry import Sample
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Departure, Log, Plan


def test_a_plan_stays_until_its_trip_has_ended(drive: pd.DataFrame, folder: Path) -> None:
    samples = samples_of(drive)
    with Car.follow(folder) as car:
        car.set_plan({"to": "work"}, departure_s=NOON_S + 5.0)
        fed(car, samples)
        assert car.observed()["time_s"].iloc[0] == 0.0
        assert len(car.observed()) == len(drive) - 5
    with Car.follow(folder) as car:
        assert car.plan == LivePlan({"to": "work"}, NOON_S + 5.0, None)
        fed(car, [Sample(NOON_S + 600.0 + k, {"speed_m_s": 0.0}) for k in range(int(STANDING_S) - 100)])
        car.set_plan({"to": "home"})
        ended(car, 900.0)
        assert len(car.logs()) == 1
        assert car.plan is not None, "a plan that was given after the arrival is that of the next trip"
        assert car.plan.request == {"to": "home"}
        car.set_plan(None)
    with Car.follow(folder) as car:
        assert car.plan is None


def test_a_plan_that_cannot_be_forecast_is_a_fault(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise InvalidInput(Fault("no such road", "plan"))

    monkeypatch.setattr(type(MODEL), "forecast", refuse)
    with Car.follow(folder, lambda _: MODEL) as car:
        for request, what in (({"links": LINKS}, "no such road"), ({"to": "work"}, "no road")):
            car.set_plan(request)
            found = car.document(NOON_S)
            assert (found["plan"], found["usual_trip"], found["forecast"]) == ("given", None, None)
            assert [fault["what"] for fault in found["faults"]] == [what]


def test_the_plan_of_a_trip_that_has_ended_is_not_used_again(drive: pd.DataFrame, folder: Path) -> None:
    with Car.follow(folder, lambda _: MODEL) as car:
        car.set_plan(request_of_samples(example_trip()))
        fed(car, samples_of(drive))
        assert car.document(NOW_S)["forecast"] is not None
        assert car.end_when_silent(NOW_S + SILENCE_S)
        assert (car.trip, car.plan) == (None, None)
        assert car.document(NOW_S)["forecast"] is None


def test_a_plan_outlives_a_restart_with_its_figures(drive: pd.DataFrame, folder: Path) -> None:
    with Car.follow(folder, lambda _: MODEL) as car:
        car.set_plan({"links": LINKS, "reserve": 0.3})
        fed(car, samples_of(drive.iloc[:200]))
        before = car.document(NOW_S)
    with Car.follow(folder, lambda _: MODEL) as car:
        after = car.document(NOW_S)
        assert (after["plan"], after["forecast"]) == ("given", before["forecast"])


def test_a_trip_without_a_road_has_none() -> None:
    table = pd.DataFrame({"time_s": [0.0, 60.0, 120.0], "speed_m_s": [10.0, 10.0, 10.0]})
    plan = LivePlan.from_trip(Log.from_samples("there", table))
    assert plan is not None
    assert plan.usual_trip == "there"
    assert sum(link["length_m"] for link in plan.request["links"]) == pytest.approx(1200.0)
    assert LivePlan.from_trip(Log.from_samples("too fast", table.assign(speed_m_s=89.0))) is None


def at(day: int, hour: int, minute: int = 0) -> float:
    """Local time in November 2023; the 6th is a Monday."""
    return dt.datetime(2023, 11, day, hour, minute).timestamp()


@pytest.mark.parametrize(
    ("earlier", "departure", "expected"),
    [
        ([], at(7, 8), None),
        ([at(6, 8)], at(7, 8, 20), at(6, 8)),
        ([at(6, 8), at(6, 17)], at(7, 16, 30), at(6, 17)),
        ([at(6, 6, 30)], at(7, 8), at(6, 6, 30)),
        ([at(6, 6, 29)], at(7, 8), None),
        ([at(6, 23, 30)], at(8, 0, 30), at(6, 23, 30)),
        ([at(6, 8), at(7, 8)], at(8, 8), at(7, 8)),
        ([at(4, 8), at(6, 9)], at(7, 8), at(6, 9)),
        ([at(6, 8), at(5, 9)], at(11, 8), at(5, 9)),
        ([at(4, 8)], at(7, 8), at(4, 8)),
    ],
    ids=[
        "none",
        "same hour",
        "nearest",
        "an hour and a half",
        "further away",
        "over midnight",
        "latest",
        "working day before weekend",
        "weekend before working day",
        "other kind of day",
    ],
)
def test_the_nearest_departure_by_time_of_day(
    earlier: list[float], departure: float, expected: float | None
) -> None:
    assert usual_departure(earlier, departure) == expected
    assert usual_departure(iter(reversed(earlier)), departure) == expected


def test_the_bound_is_an_hour_and_a_half() -> None:
    assert NEAR_S == 5400.0


def test_a_trip_is_driven_again_by_its_name(tmp_path: Path) -> None:
    car = create_car(tmp_path / "leaf", "nissan_leaf_24")
    log = synthetic_fleet(1, seed=5).logs[0]
    with car.file.write() as db:
        db.put_logs([row_of_log(log)])
    plan = car.usual_plan(log.trip_id)
    assert (plan.trip_id, plan.departure) == (log.trip_id, Departure())
    assert plan.array("speed_m_s").tolist() == Plan.from_trip(log).array("speed_m_s").tolist()
    found = refusal(car.usual_plan, "nothing")
    assert found == "no such trip: trip: got nothing; allowed: a sound trip of the car leaf"
