"""The protocol of cars that nobody has seen: nothing of the scored car takes part, and scores are those of forecasts."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.worlds import changed
from tests.support.refusals import refusal

from tripwatt.population.prior import population
from tripwatt.study.evaluation import cars as protocol
from tripwatt.study.evaluation.cars import CarTrips, evaluate_cars, evidence_of
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip
from tripwatt.vehicles import load_vehicle


def made(name: str, dataset: str, vehicle: str, n: int, seed: int, **truth: float) -> CarTrips:
    book = load_vehicle(vehicle)
    fleet = synthetic_fleet(n, seed, vehicle=changed(book, truth))
    return CarTrips(name, dataset, book, fleet.trips)


def louder(trip: Trip, factor: float) -> Trip:
    """The trip with another current, and so another energy."""
    samples = trip.samples.assign(current_a=factor * trip.samples["current_a"])
    return Trip.from_samples(trip.trip_id, samples, trip.context)


@pytest.fixture(scope="module")
def cars() -> list[CarTrips]:
    return [
        made("a", "one", "vw_id3", 44, 1, base_load=0.5),
        made("b", "two", "hyundai_kona_64", 12, 2, rolling=0.2),
        made("c", "two", "nissan_leaf_40", 12, 3),
    ]


@pytest.fixture(scope="module")
def run(cars):
    done = []
    found = evaluate_cars(cars, trips=(0, 1, 5), draws=4, own_model=False, progress=lambda *n: done.append(n))
    assert done == [(1, 3), (2, 3), (3, 3)]
    return found


def test_every_car_has_its_scores(run, cars) -> None:
    assert [car["car"] for car in run.results["cars"]] == ["a", "b", "c"]
    first, second, _ = run.results["cars"]
    assert [row["k"] for row in first["curves"]["population"]] == [0, 1, 5, 22]
    assert [row["k"] for row in second["curves"]["population"]] == [0, 1, 5]
    assert [row["k"] for row in second["curves"]["constant"]] == [1, 5]
    assert first["others"][:2] == ["b", "c"]
    assert len(run.trips) == sum(len(car.trips) for car in cars)
    assert 0.0 < first["in_time"][0]["error"] < 0.3
    assert first["curves"]["population"][-1]["error"] < first["curves"]["constant"][-1]["error"]


def test_nothing_of_the_scored_data_set_takes_part(cars) -> None:
    """Energies of the scored set seven times as high leave what is known of the other cars as it was."""
    scored = cars[1]
    rest = population().without({"one", "two"})
    loud = [
        replace(car, trips=tuple(louder(trip, 7.0) for trip in car.trips)) if car.dataset == "two" else car
        for car in cars
    ]
    quiet, strange = (protocol.population_without(every, scored, rest) for every in (cars, loud))
    alone = protocol.population_without(cars[:1], scored, rest)
    vehicle = scored.vehicle
    expected = alone.experts(vehicle).collapsed()
    for others in (quiet, strange):
        assert [source.dataset for source in others.sources] == [source.dataset for source in alone.sources]
        for a, b in zip(expected, others.experts(vehicle).collapsed(), strict=True):
            assert a == pytest.approx(b)


def test_a_car_of_the_same_model_takes_no_part(cars) -> None:
    sibling = replace(cars[0], name="d", dataset="three")
    others = protocol.population_without([*cars, sibling], cars[0], population().without({"one"}))
    assert "d" not in [source.vehicle for source in others.sources]
    assert cars[0].vehicle.name not in [source.car_model for source in others.sources]


def test_values_of_the_library_from_the_scored_logs_are_replaced() -> None:
    """Three values of the i3 come from the TUM logs."""
    book = load_vehicle("bmw_i3_60ah")
    trips = synthetic_fleet(2, vehicle=book).trips
    tum = evidence_of(CarTrips("i3", "tum", book, trips), "tum")[0]
    other = evidence_of(CarTrips("i3", "other", book, trips), "other")[0]
    assert tum.climate != other.climate


def test_scores_in_time_are_those_of_forecasts_before_learning(run, cars) -> None:
    """The last trip changed: only its own score changes."""
    last = max(cars[1].trips, key=lambda trip: str(trip.context.started_at))
    more = louder(last, 2.0)
    trips = tuple(more if trip is last else trip for trip in cars[1].trips)
    again = evaluate_cars(
        [cars[0], replace(cars[1], trips=trips), cars[2]], trips=(0,), draws=1, own_model=False
    )
    rows, before = (one.trips[one.trips["car"] == "b"] for one in (again, run))
    assert rows["forecast_wh"].to_numpy() == pytest.approx(before["forecast_wh"].to_numpy())
    assert rows["observed_energy_wh"].iloc[-1] > 1.5 * before["observed_energy_wh"].iloc[-1]


def test_what_cannot_be_scored_is_refused_with_every_fault(cars) -> None:
    assert refusal(evaluate_cars, [], trips=(-1,), draws=0).splitlines() == [
        "value out of range: trips: got [-1]; allowed: whole numbers of 0 or more",
        "value out of range: draws: got 0; allowed: a whole number of 1 or more",
        "value out of range: cars: got 0; allowed: at least 1",
    ]
    assert refusal(evaluate_cars, cars, trips=()).startswith("value out of range: trips: got []")
    assert refusal(evaluate_cars, cars, draws=1.5).startswith("value out of range: draws: got 1.5")


def test_a_file_of_cars_is_refused_with_every_fault(tmp_path) -> None:
    file = tmp_path / "cars.toml"
    file.write_text("")
    table = f"no cars: {file}: got an empty file; allowed: a table [NAME] for each data set"
    assert refusal(protocol.read_cars, file) == table
    file.write_text('a = 3\n[b]\nlogs = "x"\nvehicles = "y"\ndataset = 5\n')
    assert refusal(protocol.read_cars, file).splitlines() == [
        f"not a table: {file}, [a]: got 3; allowed: a table with logs and vehicle",
        f"missing entry: {file}, [b]: got nothing; allowed: vehicle = a text",
        f"unknown key: {file}, [b]: got 'vehicles'; allowed: logs, vehicle, dataset, mapping; did you mean 'vehicle'?",
        f"not a text: {file}, [b], dataset: got 5; allowed: dataset = a text",
    ]


def test_a_public_set_is_known_by_its_own_name(data_dir, tmp_path) -> None:
    """So that values of the library from its logs, and its sums in the package, are left out."""
    folder = tmp_path / "mine"
    folder.mkdir()
    for name in ("TripA08.csv", "TripB20.csv"):
        shutil.copy(data_dir / "tum" / name, folder / name)
    file = tmp_path / "cars.toml"
    file.write_text('[i3]\nlogs = "mine"\nvehicle = "bmw_i3_60ah"\n', encoding="utf-8")
    (car,) = protocol.read_cars(file)
    assert (car.name, car.dataset, len(car.trips)) == ("i3", "tum", 2)


def test_drawn_trips_are_learned_in_the_order_of_their_dates(cars) -> None:
    _, evidence, _ = evidence_of(cars[0], cars[0].dataset)
    dated = replace(evidence, day=np.arange(len(evidence), dtype=float))
    seen = []

    def learner(known, asked):
        seen.append(known.day)
        return np.zeros(len(asked))

    protocol._curve(learner, dated, [3], 5, 0)
    drawn = [day for day in seen if len(day) == 3]
    assert len(drawn) == 5
    assert all((np.diff(day) > 0.0).all() for day in drawn)
    assert len({tuple(day) for day in drawn}) > 1
