"""`tripwatt evaluate --protocol cars`: each car of a file as one that nobody has seen, from all others."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.support.command import Run, answered
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.hybrid.factors import NAMES
from tripwatt.hybrid.learning import KINDS
from tripwatt.study.evaluation import cars as module
from tripwatt.study.evaluation.cars import CarTrips, evaluate_cars, read_cars
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip
from tripwatt.vehicles import render_vehicle

MAPPING = """
[columns]
time_s = { column = "time", unit = "epoch_s" }
speed_m_s = { column = "speed", unit = "m/s" }
voltage_v = { column = "volt", unit = "V" }
current_a = { column = "ampere", unit = "A" }
ambient_temperature_degc = { column = "outside", unit = "degC" }
elevation_m = { column = "height", unit = "m" }

[current]
positive = "discharge"

[trip]
column = "drive"
vehicle = "vin"
"""
NAMED = {
    "time_s": "time",
    "speed_m_s": "speed",
    "voltage_v": "volt",
    "current_a": "ampere",
    "ambient_temperature_degc": "outside",
    "elevation_m": "height",
}
FILE = """
[leaf]
logs = "leaf.csv"
mapping = "my.toml"
vehicle = "nissan_leaf_24"

[id3]
logs = "id3.csv"
dataset = "table"
mapping = "my.toml"
vehicle = "id3.toml"
"""
TRIPS = 7
LEARNERS = ["by cause", "constant", "one factor", "population"]
EPOCH = dt.datetime(1970, 1, 1)


def table(trips: Sequence[Trip], vehicle: str) -> pd.DataFrame:
    """Trips of a vehicle as a logger writes them, one below the other."""
    parts = []
    for trip in trips:
        start = trip.context.started_at
        assert start is not None
        named = trip.samples[list(NAMED)].rename(columns=NAMED)
        seconds = (start - EPOCH).total_seconds() + named["time"]
        parts.append(named.assign(time=seconds, drive=f"{vehicle}-{trip.trip_id}", vin=vehicle))
    return pd.concat(parts, ignore_index=True)


def driven(name: str, seed: int, count: int = TRIPS) -> tuple[Trip, ...]:
    return synthetic_fleet(count, seed=seed, vehicle=tw.load_vehicle(name)).trips


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Leaf of seven trips, and two ID.3 of six and five in one table, described by a file."""
    place = tmp_path_factory.mktemp("cars")
    table(driven("nissan_leaf_24", 1), "L").to_csv(place / "leaf.csv", index=False)
    two = [table(driven("vw_id3", seed, count), vin) for vin, seed, count in (("A", 2, 6), ("B", 3, 5))]
    pd.concat(two).to_csv(place / "id3.csv", index=False)
    (place / "my.toml").write_text(MAPPING)
    (place / "id3.toml").write_text(render_vehicle(tw.load_vehicle("vw_id3")))
    (place / "cars.toml").write_text(FILE)
    return place


@pytest.fixture(scope="module")
def results(folder: Path) -> dict[str, Any]:
    out = folder / "out"
    answer = answered("evaluate", folder / "cars.toml", "--protocol", "cars", "--out", out)
    assert answer.code == 0, answer.err
    assert {file.name for file in out.iterdir()} == {"figures", "report.html", "results.json", "trips.csv"}
    for words in ("Error [%] by the number of own trips", "In order of time", "leaf: population of cars"):
        assert words in answer.out
    assert answer.out.rstrip().endswith("report.html")
    found: dict[str, Any] = json.loads((out / "results.json").read_text())
    return found


def test_every_vehicle_that_the_logs_name_is_a_car_of_its_own(folder: Path) -> None:
    cars = read_cars(folder / "cars.toml")
    assert [(car.name, car.dataset, len(car.trips)) for car in cars] == [
        ("leaf", "leaf", TRIPS),
        ("id3-A", "id3", 6),
        ("id3-B", "id3", 5),
    ]
    assert [car.vehicle.name for car in cars] == ["nissan_leaf_24", "id3", "id3"]
    assert all(trip.observed_energy_wh for car in cars for trip in car.trips)


def test_both_data_sets_have_curves_and_scores(results: dict[str, Any]) -> None:
    assert (results["kind"], results["draws"], results["seed"]) == ("cars", 100, 0)
    assert [car["car"] for car in results["cars"]] == ["leaf", "id3-A", "id3-B"]
    assert [row["factor"] for row in results["factors"]] == list(NAMES)
    for car, counts in zip(results["cars"], ([0, 1, 2], [0, 1], [0]), strict=True):
        assert sorted(car["curves"]) == LEARNERS
        for name, rows in car["curves"].items():
            assert [row["k"] for row in rows] == (counts if name == "population" else counts[1:])
            for row in rows:
                assert 0.0 < row["error"] < 1.0
                assert abs(row["bias"]) <= row["error"] + 1e-12
                low, middle, high = row["error_of_draws"]
                assert low <= middle <= high
                assert row["draws"] == (100 if row["k"] else 1)
        (score,) = car["in_time"][:1]
        assert score["from"] == 0
        assert score["trips"] == car["trips"]
        assert 0.0 <= score["coverage"] <= 1.0
        assert car["scored"] == "trips that were not drawn"
    leaf, *id3 = results["cars"]
    assert "tum" in leaf["others"]
    assert {"ved-10", "ved-541"} & set(leaf["others"]) == set(), "no car of its model takes part"
    for car in id3:
        assert not {"id3-A", "id3-B"} & set(car["others"]), "nor one of its data set"
        assert "leaf" in car["others"]


def test_the_table_of_trips_has_each_trip_before_and_after_it_was_learned(
    folder: Path, results: dict[str, Any]
) -> None:
    trips = pd.read_csv(folder / "out" / "trips.csv")
    assert trips.groupby("car", sort=False).size().to_dict() == {"leaf": TRIPS, "id3-A": 6, "id3-B": 5}
    assert (trips["low_wh"] < trips["forecast_wh"]).all()
    assert (trips["forecast_wh"] < trips["high_wh"]).all()
    first = trips.groupby("car").first()
    assert first["forecast_wh"].tolist() == first["zero_forecast_wh"].tolist()
    later = trips[trips.groupby("car").cumcount() > 0]
    assert (later["forecast_wh"] != later["zero_forecast_wh"]).all()
    weights = trips.filter(like="weight_")
    assert weights.shape[1] == len(KINDS)
    assert weights.sum(axis=1).to_numpy() == pytest.approx(1.0)
    error = (trips["zero_forecast_wh"] - trips["observed_energy_wh"]).abs()
    for car in results["cars"]:
        own = trips["car"] == car["car"]
        by_hand = error[own].sum() / trips.loc[own, "observed_energy_wh"].sum()
        assert car["without_trips"]["error"] == pytest.approx(by_hand, rel=1e-9)
        assert car["curves"]["population"][0]["error"] == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["no cars", "an empty file"]),
        ("a = 1\n[b]\nlogs = 'x'\n", ["not a table", "[a]", "missing entry", "[b]", "vehicle = a text"]),
        (
            "[a]\nlog = 'x'\n[b]\nlogs = 1\nvehicle = 'vw_id3'\nvehicles = 'y'\n",
            ["unknown key", "got 'log';", "got 'vehicles';", "logs = a text", "vehicle = a text"],
        ),
        ("[a\n", ["not a TOML file"]),
        ("[a]\nlogs = 'nowhere'\nvehicle = 'vw_id3'\n", ["no such folder", "nowhere"]),
        ("[a]\nlogs = 'nowhere'\nvehicle = 'vw_id33'\n", ["unknown car", "vw_id33"]),
    ],
)
def test_a_file_with_faults_is_refused_with_every_one(
    run: Run, tmp_path: Path, text: str, words: list[str]
) -> None:
    path = tmp_path / "cars.toml"
    path.write_text(text)
    answer = run("evaluate", path, "--protocol", "cars", "--out", tmp_path / "out")
    assert answer.code == 2
    said = " ".join(answer.err.split())
    for word in words:
        assert word in said
    assert "Traceback" not in answer.err
    assert not (tmp_path / "out").exists()


def test_no_file_and_no_folder_for_the_results_are_one_message(run: Run, tmp_path: Path) -> None:
    answer = run("evaluate", "--protocol", "cars", "--out", tmp_path / "out")
    assert answer.code == 2
    assert "no cars: DATA" in answer.err
    (tmp_path / "out").write_text("mine")
    missing = run("evaluate", tmp_path / "none.toml", "--protocol", "cars", "--out", tmp_path / "out")
    assert missing.code == 2
    said = " ".join(missing.err.split())
    assert "cannot read the file" in said
    assert "none.toml" in said
    assert "output is not a folder: --out" in said
    assert (tmp_path / "out").read_text() == "mine"


@pytest.fixture(scope="module")
def pair() -> list[CarTrips]:
    return [
        CarTrips("leaf", "one", tw.load_vehicle("nissan_leaf_24"), driven("nissan_leaf_24", 1, 5)),
        CarTrips("id3", "two", tw.load_vehicle("vw_id3"), driven("vw_id3", 2, 5)),
    ]


def test_arguments_that_cannot_be_used_are_refused_at_once(pair: list[CarTrips]) -> None:
    with pytest.raises(InvalidInput) as caught:
        evaluate_cars([], trips=(), draws=0)
    assert [fault.where for fault in caught.value.faults] == ["trips", "draws", "cars"]
    refuses("trips", evaluate_cars, pair, trips=(0, -1))
    refuses("draws", evaluate_cars, pair, draws=-3)


def test_a_car_with_many_trips_scores_its_second_half_alone(
    pair: list[CarTrips], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "FEW", 16)
    seen: list[tuple[int, int]] = []
    car = CarTrips("id3", "two", tw.load_vehicle("vw_id3"), driven("vw_id3", 4, 16))
    run = evaluate_cars(
        [car, pair[0]], trips=(0, 2, 8, 20), draws=3, progress=lambda done, total: seen.append((done, total))
    )
    assert seen == [(1, 2), (2, 2)]
    many, few = run.results["cars"]
    assert many["scored"] == "second half"
    assert [row["k"] for row in many["curves"]["population"]] == [0, 2, 8], "8 is the whole first half"
    assert many["curves"]["population"][-1]["draws"] == 1
    assert 0.0 < many["own_model"]["error"] < 0.5
    assert "own_model" not in few
    assert f"{run!r}" == "<CarsRun of 2 cars, 21 trips>"
    # of the second half every trip counts once, whatever was drawn
    ordered = sorted(car.trips, key=lambda trip: f"{trip.context.started_at}")
    second = run.trips[run.trips["trip"].isin([trip.trip_id for trip in ordered[8:]])]
    second = second[second["car"] == "id3"]
    error = (second["zero_forecast_wh"] - second["observed_energy_wh"]).abs().sum()
    by_hand = error / second["observed_energy_wh"].sum()
    assert many["curves"]["population"][0]["error"] == pytest.approx(by_hand, rel=1e-9)


def test_runs_on_a_dynamometer_are_learned_for_the_road(pair: list[CarTrips]) -> None:
    leaf, id3 = pair
    asked: list[str] = []

    def lab(vehicle: tw.Vehicle) -> Any:
        asked.append(vehicle.name)
        return module.evidence_of(leaf, leaf.dataset)[1]

    run = evaluate_cars([replace(leaf, lab=lab), id3], trips=(0,), draws=1)
    with_lab, without = run.results["cars"]
    assert asked == ["nissan_leaf_24"]
    assert with_lab["lab_to_road"]["error"] < with_lab["curves"]["population"][0]["error"]
    assert "lab_to_road" not in without
