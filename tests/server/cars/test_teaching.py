"""Trips of the road enter the diary once, whatever was killed in between, with the forecasts that were made on the way."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.server.cars.messages import NOON_S, measured, samples_of

pytest.importorskip("deltalake", reason="the extra tripwatt[fleet] is not installed")

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.fleet.store import TripStore
from tripwatt.server.cars import RoadCar, create_car, has_news, learn_finished, open_car
from tripwatt.server.cars import own_car as own_module
from tripwatt.server.cars.folder import finished_names, forecasts_of
from tripwatt.server.cars.live_trip import STANDING_S
from tripwatt.server.cars.teaching import TAUGHT
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


def drive(car: RoadCar, number: int, *, ends: bool = True) -> None:
    """One of three trips, a day apart; with what follows it until it has ended."""
    start_s = NOON_S + DAY_S * number
    samples = samples_of(table(number), start_s)
    last = samples[-1]
    for sample in samples:
        car.add(sample, now_s=last.time_s)
    for late_s in (1.0, STANDING_S + 60.0, STANDING_S + 120.0) if ends else ():
        later = type(last)(last.time_s + late_s, {"speed_m_s": 0.0})
        car.add(later, now_s=later.time_s)


def made(energy_wh: float, low_wh: float, high_wh: float) -> Any:
    """The part of a forecast that a diary keeps."""
    return {"energy_wh": energy_wh, "quantiles_wh": {"0.05": low_wh, "0.95": high_wh}}


def test_a_finished_trip_is_forecast_then_learned_and_counts_once(folder: Path) -> None:
    with RoadCar(folder) as car:
        assert not has_news(folder)
        drive(car, 0)
        assert has_news(folder)
        done = learn_finished(folder)  # while the car is followed
        assert (done.added, done.known, done.entries) == (1, 0, 1)
        assert not has_news(folder)
        drive(car, 1)
        done = learn_finished(folder)
        assert (done.added, done.known, done.entries) == (1, 1, 1)
    own = open_car(folder)
    rows = own.diary.table
    assert rows["trips_learned"].tolist() == [0, 1]
    assert rows["trip_id"].tolist() == [f"leaf-{name}" for name in finished_names(folder)]
    for number in (0, 1):
        samples = table(number)
        wh = (samples["voltage_v"] * samples["current_a"]).to_numpy()
        seconds = samples["time_s"].to_numpy()
        energy = float(((wh[1:] + wh[:-1]) / 2.0 * (seconds[1:] - seconds[:-1])).sum() / 3600.0)
        assert rows["energy_wh"][number] == pytest.approx(energy, rel=0.02)
    assert len(own.model().trip_ids_) == 2
    assert learn_finished(folder).entries == 0


@pytest.mark.parametrize("killed", ["store", "model", "note"])
def test_a_process_that_is_killed_while_it_learns_counts_no_trip_twice(
    folder: Path, monkeypatch: pytest.MonkeyPatch, killed: str
) -> None:
    """Killed before the store has the trip, before model and diary have it, and before it is noted as done."""
    with RoadCar(folder) as car:
        drive(car, 0)

    class Killed(BaseException):
        pass

    def stop(*_: object, **__: object) -> None:
        raise Killed

    place, name = {
        "store": (TripStore, "add"),
        "model": (own_module.Car, "_keep"),
        "note": (learn_finished.__globals__, "write_text"),
    }[killed]
    with monkeypatch.context() as patched:
        if isinstance(place, dict):
            patched.setitem(place, name, stop)
        else:
            patched.setattr(place, name, stop)
        with pytest.raises(Killed):
            learn_finished(folder)
    assert has_news(folder)
    assert learn_finished(folder).entries == (0 if killed == "note" else 1)
    own = open_car(folder)
    assert (own.store.about()["trips"], len(own.diary), len(own.model().trip_ids_)) == (1, 1, 1)
    assert not has_news(folder)


def test_a_damaged_file_of_a_trip_does_not_hold_up_the_others(folder: Path) -> None:
    with RoadCar(folder) as car:
        drive(car, 0)
        drive(car, 1)
    first, second = finished_names(folder)
    (folder / "live" / "trips" / f"{first}.csv").write_text("no,table\n1,2\n")
    done = learn_finished(folder)
    assert (done.added, done.entries) == (1, 1)
    assert [text.partition(":")[0] for text in done.left_out] == [f"leaf-{first}"]
    assert open_car(folder).diary.trip_ids == {f"leaf-{second}"}


def test_a_damaged_note_only_costs_work(folder: Path) -> None:
    with RoadCar(folder) as car:
        drive(car, 0)
    learn_finished(folder)
    for content in ("{", "[]", '{"trips": 1}'):
        (folder / "live" / TAUGHT).write_text(content)
        assert has_news(folder)
    assert learn_finished(folder).entries == 0


def test_a_folder_that_is_no_car_has_no_news_and_learns_nothing(tmp_path: Path) -> None:
    with RoadCar(tmp_path / "zoe") as car:
        drive(car, 0)
        assert len(car.logs()) == 1
    assert not has_news(tmp_path / "zoe")
    with pytest.raises(InvalidInput, match="not a car"):
        learn_finished(tmp_path / "zoe")


def test_forecasts_of_the_way_stay_with_their_trip_through_a_restart(folder: Path) -> None:
    with RoadCar(folder) as car:
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
    with RoadCar(folder) as car:  # the trip is found again in the journal
        assert [asdict(row) for row in car.forecasts] == way
        drive(car, 0)
        assert car.trip is None
        assert car.forecasts == ()
    (name,) = finished_names(folder)
    assert [asdict(row) for row in forecasts_of(folder, f"leaf-{name}")] == way
    assert forecasts_of(folder, "leaf-other") == ()
    assert forecasts_of(folder, "../../leaf") == ()
