"""Trips of the road enter the diary once, whatever was killed in between, with the forecasts that were made on the way."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.server.cars.messages import NOON_S, measured, samples_of

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.car_file import Database
from tripwatt.server.cars.folder import create_car, is_car, open_car
from tripwatt.server.cars.live_trip import STANDING_S
from tripwatt.study.synthetic import synthetic_fleet

DAY_S = 86_400.0


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small model, which adapts quickly."""
    folder = tmp_path_factory.mktemp("base") / "model"
    trips = synthetic_fleet(9, seed=1).trips
    tw.save_model(tw.ForecastModel(tw.load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips), folder)
    return folder


@pytest.fixture
def folder(tmp_path: Path, base: Path) -> Path:
    return create_car(tmp_path / "leaf", "nissan_leaf_24", base=base).folder


def table(number: int) -> pd.DataFrame:
    return measured(synthetic_fleet(3, seed=5).logs[number].samples)


def drive(car: Car, number: int, *, ends: bool = True) -> None:
    """One of three trips, a day apart; with what follows it until it has ended."""
    start_s = NOON_S + DAY_S * number
    samples = samples_of(table(number), start_s)
    last = samples[-1]
    for sample in samples:
        car.record(sample, now_s=last.time_s)
    for late_s in (1.0, STANDING_S + 60.0, STANDING_S + 120.0) if ends else ():
        later = type(last)(last.time_s + late_s, {"speed_m_s": 0.0})
        car.record(later, now_s=later.time_s)


def made(energy_wh: float, low_wh: float, high_wh: float) -> Any:
    """The part of a forecast that a diary keeps."""
    return {"energy_wh": energy_wh, "quantiles_wh": {"0.05": low_wh, "0.95": high_wh}}


def test_a_finished_trip_is_forecast_then_learned_and_counts_once(folder: Path) -> None:
    with Car.follow(folder) as car:
        assert not open_car(folder).has_news
        drive(car, 0)
        assert open_car(folder).has_news
        done = open_car(folder).learn()  # while the car is followed
        assert (done.added, done.known, done.entries) == (1, 0, 1)
        assert not open_car(folder).has_news
        drive(car, 1)
        done = open_car(folder).learn()
        assert (done.added, done.known, done.entries) == (1, 1, 1)
    own = open_car(folder)
    rows = own.diary.table
    assert rows["trips_learned"].tolist() == [0, 1]
    assert rows["trip_id"].tolist() == [log.trip_id for log in own.logs()]
    for number in (0, 1):
        samples = table(number)
        wh = (samples["voltage_v"] * samples["current_a"]).to_numpy()
        seconds = samples["time_s"].to_numpy()
        energy = float(((wh[1:] + wh[:-1]) / 2.0 * (seconds[1:] - seconds[:-1])).sum() / 3600.0)
        assert rows["energy_wh"][number] == pytest.approx(energy, rel=0.02)
    assert len(own.model().trip_ids_) == 2
    assert open_car(folder).learn().entries == 0


def test_a_process_that_is_killed_while_it_learns_counts_no_trip_twice(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Car.follow(folder) as car:
        drive(car, 0)

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Database, "put_settings", stop)  # the last statement of the transaction
        with pytest.raises(KeyboardInterrupt):
            open_car(folder).learn()
    own = open_car(folder)
    assert (own.has_news, len(own.diary)) == (True, 0)
    assert own.learn().entries == 1
    assert (len(own.logs()), len(own.diary), len(own.model().trip_ids_)) == (1, 1, 1)
    assert not own.has_news


def test_a_car_that_nothing_describes_has_no_news_until_it_is_described(tmp_path: Path, base: Path) -> None:
    place = tmp_path / "zoe"
    with Car.follow(place) as car:
        drive(car, 0)
        assert len(car.logs()) == 1
        assert (is_car(place), car.has_news) == (False, False)
        with pytest.raises(InvalidInput, match=r"not a car.*no description"):
            car.learn()
        create_car(place, "nissan_leaf_24", base=base)
        assert (is_car(place), car.has_news) == (True, True)
        assert car.learn().entries == 1


def test_a_trip_that_was_learned_stays_learned_when_it_is_erased_on_the_road(folder: Path) -> None:
    with Car.follow(folder) as car:
        drive(car, 0)
        assert car.learn().entries == 1
        drive(car, 1)
        car.keep_days = 1.0
        assert car.erase_old(NOON_S + 10.0 * DAY_S) == 2
        assert car.usual_trip_at(NOON_S + 11.0 * DAY_S) is None
    own = open_car(folder)
    assert [log.trip_id for log in own.logs()] == [*own.diary.trip_ids], "the other one was not learned"


def test_forecasts_of_the_way_stay_with_their_trip_through_a_restart(folder: Path) -> None:
    with Car.follow(folder) as car:
        assert not car.keep_forecast(made(1.0, 0.5, 1.5)), "the car is on no trip"
        drive(car, 0, ends=False)
        assert car.trip is not None
        assert car.keep_forecast(made(2000.0, 1500.0, 2500.0), departing=True)
        assert not car.keep_forecast(made(2010.0, 1500.0, 2500.0), departing=True), (
            "there is one of the departure"
        )
        assert car.wants_forecast
        assert car.keep_forecast(made(2100.0, 1700.0, 2400.0))
        assert not car.keep_forecast(made(2101.0, 1700.0, 2400.0)), "too soon"
        assert not car.wants_forecast
        way = [asdict(row) for row in car.forecasts]
        at_s, distance_m = car.trip.last_s - car.trip.start_s, car.trip.distance_m
    assert [row["energy_wh"] for row in way] == [2000.0, 2100.0]
    assert (way[0]["at_s"], way[0]["distance_m"]) == (0.0, 0.0)
    assert (way[1]["at_s"], way[1]["distance_m"]) == pytest.approx((at_s, distance_m))
    with Car.follow(folder) as car:  # the trip is found again in the journal
        assert [asdict(row) for row in car.forecasts] == way
        drive(car, 0)
        assert car.trip is None
        assert car.forecasts == ()
    own = open_car(folder)
    (log,) = own.logs()
    assert [asdict(row) for row in own.forecasts_of(log.trip_id)] == way
    assert own.forecasts_of("leaf-other") == ()
