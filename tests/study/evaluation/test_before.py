"""The forecast before departure: nothing of the scored drive takes part, and the parts of its error add up."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from benchmarks import before as study
from benchmarks.before import SPLIT, evaluate_before
from tools.docs import pages
from tools.docs.before_page import DRIVEN, ELSEWHERE, PLANNED, text_of

from tripwatt.arrays import distance_driven
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import load_model
from tripwatt.population import adaptation, population
from tripwatt.population.adapting import with_travel_times
from tripwatt.study.evaluation.cars import CarTrips
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip
from tripwatt.vehicles import load_vehicle

TRIPS = 7


def with_limits(trip: Trip) -> Trip:
    """The trip on a road with limits that change every kilometre."""
    way = distance_driven(trip.array("time_s"), trip.array("speed_m_s"))
    limit = np.array([50.0, 80.0, 60.0, 100.0])[(way // 1000.0).astype(int) % 4] / 3.6
    return Trip.from_samples(trip.trip_id, trip.samples.assign(speed_limit_m_s=limit), trip.context)


def drive_altered(trip: Trip) -> Trip:
    """The same road, driven in another way: half as fast, with a standstill, other currents, charges and temperatures on the way."""
    time, samples = trip.array("time_s"), trip.samples
    slow = samples.assign(
        time_s=time[0] + 2.0 * (time - time[0]),
        speed_m_s=0.5 * trip.array("speed_m_s"),
        current_a=3.0 * trip.array("current_a") + 20.0,
    )
    later = slow.index > 0
    for name in ("soc", "displayed_soc"):
        slow.loc[later, name] = 0.5 * slow.loc[later, name]
    for name in ("ambient_temperature_degc", "battery_temperature_degc"):
        slow.loc[later, name] = slow.loc[later, name] + 7.0
    end = slow.iloc[[-1]].assign(time_s=slow["time_s"].iloc[-1] + 300.0, speed_m_s=0.0)
    return Trip.from_samples(trip.trip_id, pd.concat([slow, end], ignore_index=True), trip.context)


@pytest.fixture(scope="module")
def car() -> CarTrips:
    vehicle = load_vehicle("vw_id3")
    trips = synthetic_fleet(TRIPS, 5, vehicle=vehicle).trips
    return CarTrips("id3", "one", vehicle, tuple(map(with_limits, trips)))


@pytest.fixture(scope="module")
def run(car):
    return evaluate_before([car], seed=1)


def test_the_drive_that_is_scored_takes_no_part_in_its_forecast(car) -> None:
    k, others = 2, population()
    altered = replace(car, trips=tuple(drive_altered(t) if i == k else t for i, t in enumerate(car.trips)))
    rest = [i for i in range(TRIPS) if i != k]
    made, again = (study._Car.of(each, others).forecasts(k, rest) for each in (car, altered))
    for name in (PLANNED, ELSEWHERE):
        assert again[name].energy_wh == pytest.approx(made[name].energy_wh, rel=1e-6)
        assert again[name].interval(0.9) == pytest.approx(made[name].interval(0.9), rel=1e-6)
        assert again[name].plan.duration_s == pytest.approx(made[name].plan.duration_s)
    assert again[DRIVEN].energy_wh != pytest.approx(made[DRIVEN].energy_wh, rel=0.02)


def test_the_other_drives_take_part(car) -> None:
    slower = replace(car, trips=(car.trips[0], *map(drive_altered, car.trips[1:])))
    rest = range(1, TRIPS)
    made, again = (study._Car.of(each, population()).forecasts(0, rest) for each in (car, slower))
    assert again[PLANNED].plan.duration_s > 1.3 * made[PLANNED].plan.duration_s
    assert again[ELSEWHERE].plan.duration_s == pytest.approx(made[ELSEWHERE].plan.duration_s)


def test_the_parts_of_the_error_add_up(run) -> None:
    (car,) = run.results["cars"]
    *parts, whole = car["split"]
    assert [part["part"] for part in parts] == list(SPLIT)
    assert sum(part["mean"] for part in parts) == pytest.approx(whole["mean"])
    assert sum(part["share"] for part in parts) == pytest.approx(1.0)
    error = (run.trips[PLANNED] - run.trips["observed"]) / run.trips["observed"]
    assert whole["mean"] == pytest.approx(float(error.mean()))
    assert whole["size"] == pytest.approx(car["known"][PLANNED]["mape"])
    missed = (run.trips[PLANNED] - run.trips["observed"]).abs().sum()
    assert car["known"][PLANNED]["error"] == pytest.approx(missed / run.trips["observed"].sum())
    assert parts[-1]["size"] == pytest.approx(car["known"][DRIVEN]["mape"])


def test_scores_are_those_of_the_trips(run) -> None:
    (car,) = run.results["cars"]
    assert car["trips"] == len(run.trips) == TRIPS
    planned = car["known"][PLANNED]
    ratio = run.trips[f"duration_s, {PLANNED}"] / run.trips["duration_s"]
    assert planned["duration"]["mape"] == pytest.approx(float((ratio - 1.0).abs().mean()))
    assert planned["duration"]["bias"] == pytest.approx(float(ratio.mean()) - 1.0)
    assert "duration" not in car["known"][DRIVEN]
    hits = [chance["arrived"] for chance in planned["arrival"]]
    assert hits == sorted(hits)
    assert hits[0] >= TRIPS - int((run.trips["observed"] > run.trips[PLANNED]).sum()) - 1
    assert car["over_driven"] == pytest.approx(planned["mape"] / car["known"][DRIVEN]["mape"])


def test_trips_of_a_fold_are_left_out_together(run, car) -> None:
    """The second trip is driven in another way: a forecast of its fold does not change, one of another fold does."""
    pairs = {trip.trip_id: i // 2 for i, trip in enumerate(car.trips)}
    altered = replace(car, trips=(car.trips[0], drive_altered(car.trips[1]), *car.trips[2:]))
    made, again = (
        evaluate_before([each], fold=lambda trip: pairs[trip.trip_id]).trips[PLANNED]
        for each in (car, altered)
    )
    assert again[0] == pytest.approx(made[0])
    assert again[2] != pytest.approx(made[2])
    assert run.trips[PLANNED][0] != pytest.approx(made[0])


def test_too_few_trips_with_limits_are_refused(car) -> None:
    few = replace(car, trips=car.trips[:5])
    with pytest.raises(InvalidInput, match="too few trips with speed limits: cars: got id3") as caught:
        evaluate_before([few])
    (fault,) = caught.value.faults
    assert fault.allowed == "at least 6 of one car"


def test_an_adapted_model_has_the_travel_times_of_its_trips(car) -> None:
    base, slow = load_model(), [*map(drive_altered, car.trips[:5])]
    own, other = adaptation(base, car.trips[:5], car.vehicle).model, adaptation(base, slow, car.vehicle).model
    times = [model.uncertainty_.free_flow.factors for model in (own, other)]
    speed = np.array([50.0, 100.0]) / 3.6
    assert (times[1].at(speed) > 1.2 * times[0].at(speed)).all()
    assert own.uncertainty_.free_flow.trips == 5


def test_few_trips_and_trips_without_limits_leave_the_travel_times_of_the_base(car) -> None:
    base = load_model()
    bare = [replace(t, samples=t.samples.drop(columns="speed_limit_m_s")) for t in car.trips]
    for trips in (car.trips[:4], bare):
        assert with_travel_times(base, trips, car.vehicle, population()) is base


def test_the_published_forecast_before_departure_keeps_its_bars() -> None:
    """Those with the travel times of other trips; that times of another country are good enough is not claimed."""
    results = json.loads(study.RESULT.read_text(encoding="utf-8"))
    claimed = [row for row in study.rows_of(results) if ELSEWHERE not in row.name]
    assert len(claimed) == 2 * (2 + 2 * 2 + 2 * len(study.CHANCES))
    assert all(row.met for row in claimed), [row.name for row in claimed if not row.met]


def test_the_page_shows_what_was_measured() -> None:
    results = json.loads(study.RESULT.read_text(encoding="utf-8"))
    assert pages.of_page("explanation/results.md", "before") == text_of(results).strip(), "make results"
    results["cars"][0]["known"][PLANNED]["mape"] = 0.777
    assert "77.7" in text_of(results)
