"""A car that learns: forecasts before they are learned, scores by hand, and a folder that is whole at every moment."""

from __future__ import annotations

import datetime as dt
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.hybrid.factors import NAMES, UNITS
from tripwatt.hybrid.learning import KINDS
from tripwatt.population import adaptation, for_car
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import create_car, forget_car, is_car, issue_token, open_car
from tripwatt.server.cars.learning import Learned
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Log, TripSet

FIRST = dt.datetime(2024, 3, 1, 8, 0)


@pytest.fixture(scope="module")
def logs() -> tuple[Log, ...]:
    """Seven trips of a car, a day apart."""
    return tuple(
        replace(log, context=replace(log.context, started_at=FIRST + dt.timedelta(days=k)))
        for k, log in enumerate(synthetic_fleet(7, seed=5).logs)
    )


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small model, which adapts quickly."""
    folder = tmp_path_factory.mktemp("base") / "model"
    trips = synthetic_fleet(9, seed=1).trips
    fitted = tw.ForecastModel(tw.load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips)
    tw.save_model(fitted, folder)
    return folder


@pytest.fixture(scope="module")
def learned(logs: tuple[Log, ...], base: Path, tmp_path_factory: pytest.TempPathFactory) -> Car:
    car = create_car(tmp_path_factory.mktemp("cars") / "leaf", "nissan_leaf_24", base=base)
    assert car.add(TripSet("first", logs[:4])) == Learned(added=4, known=0, entries=4)
    return car


def test_each_forecast_is_of_a_model_that_has_not_seen_the_trip(
    learned: Car, logs: tuple[Log, ...], base: Path, tmp_path: Path
) -> None:
    table = learned.diary.table
    assert table["trip_id"].tolist() == [log.trip_id for log in logs[:4]]
    assert table["trips_learned"].tolist() == [0, 1, 2, 3]
    first = table.iloc[0]
    assert first["forecast_wh"] == first["book_forecast_wh"], (
        "before the first trip there are the published values alone"
    )
    assert (table["forecast_wh"].to_numpy()[1:] != table["book_forecast_wh"].to_numpy()[1:]).all()

    louder = logs[3].samples.assign(current_a=1.5 * logs[3].samples["current_a"])
    last = Log.from_samples(logs[3].trip_id, louder, logs[3].context)
    other = create_car(tmp_path / "other", "nissan_leaf_24", base=base)
    other.add([*logs[:3], last])
    own = other.diary.table
    assert own["forecast_wh"].tolist() == table["forecast_wh"].tolist(), (
        "a trip's energy moves no forecast of it"
    )
    assert own["energy_wh"].iloc[3] == pytest.approx(1.5 * table["energy_wh"].iloc[3])


def test_the_last_model_has_learned_every_trip_and_forecasts_like_one_adapted_to_them(
    learned: Car, logs: tuple[Log, ...], base: Path
) -> None:
    from tripwatt.api import adapt

    model = learned.model()
    assert set(model.trip_ids_) == {log.trip_id for log in logs[:4]}
    adapted = adapt(tw.load_model(base), TripSet("same", logs[:4]), tw.load_vehicle("nissan_leaf_24"))
    trip = synthetic_fleet(1, seed=9).trips[0]
    assert model.forecast(trip).energy_wh == pytest.approx(adapted.forecast(trip).energy_wh, rel=1e-9)
    about = learned.about()
    assert (about["trips"], about["in_diary"], about["vehicle"]) == (4, 4, "nissan_leaf_24")
    assert list(about["learned"]) == list(NAMES)
    for name, factor in about["learned"].items():
        assert (sorted(factor), factor["unit"]) == (["change", "sd", "seen_degc", "unit"], UNITS[name])
        assert factor["sd"] > 0.0
    assert list(about["experts"]) == list(KINDS)
    assert sum(about["experts"].values()) == pytest.approx(1.0)


def test_trips_are_learned_by_departure_once_and_later_ones_go_on(
    logs: tuple[Log, ...], learned: Car, base: Path, tmp_path: Path
) -> None:
    car = create_car(tmp_path / "leaf", "nissan_leaf_24", base=base)
    seen: list[tuple[int, int]] = []
    car.add([logs[2], logs[0], logs[1]], progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert car.add(logs[:3]) == Learned(added=0, known=3, entries=0)
    done = car.add(TripSet("all", logs[:4]))
    assert (done.added, done.known, done.entries) == (1, 3, 1)
    pd.testing.assert_frame_equal(car.diary.table, learned.diary.table)
    assert f"{car!r}".endswith("4 trips in its diary>")


def test_each_forecast_of_the_diary_is_that_of_a_model_adapted_to_the_trips_before_it(
    learned: Car, logs: tuple[Log, ...], base: Path
) -> None:
    table, fitted = learned.diary.table, tw.load_model(base)
    published = for_car(fitted, tw.load_vehicle("nissan_leaf_24"))
    trips = audit(TripSet("same", logs[:4])).trips
    for k, trip in enumerate(trips):
        known = adaptation(fitted, trips[:k], learned.vehicle).model if k else published
        forecast, row = known.forecast(trip), table.iloc[k]
        assert row["trips_learned"] == k
        assert row["forecast_wh"] == pytest.approx(forecast.energy_wh, rel=1e-9)
        low, high = forecast.interval(0.9)
        assert (row["low_wh"], row["high_wh"]) == (
            pytest.approx(low, rel=1e-9),
            pytest.approx(high, rel=1e-9),
        )
        assert row["book_forecast_wh"] == pytest.approx(published.forecast(trip).energy_wh, rel=1e-9)


def test_trips_are_learned_after_each_other_in_one_go_or_in_several(
    logs: tuple[Log, ...], base: Path, tmp_path: Path
) -> None:
    """What was learned is kept with the model and taken up again."""
    at_once = create_car(tmp_path / "once", "nissan_leaf_24", base=base)
    at_once.add(logs[:6])
    by_and_by = create_car(tmp_path / "more", "nissan_leaf_24", base=base)
    for part in (logs[:1], logs[1:4], logs[4:6]):
        by_and_by.add(part)
    pd.testing.assert_frame_equal(by_and_by.diary.table, at_once.diary.table, rtol=1e-9)
    assert by_and_by.about()["experts"] == pytest.approx(at_once.about()["experts"], rel=1e-9)
    trip = synthetic_fleet(1, seed=9).trips[0]
    one, other = (car.model().forecast(trip) for car in (at_once, by_and_by))
    assert one.energy_wh == pytest.approx(other.energy_wh, rel=1e-9)
    assert one.sd_wh == pytest.approx(other.sd_wh, rel=1e-9)


def test_a_car_that_an_older_version_learned_learns_its_trips_again(
    learned: Car, logs: tuple[Log, ...], tmp_path: Path
) -> None:
    """Its model of format 1 is not read; logs and diary are what they were."""
    folder = tmp_path / "leaf"
    shutil.copytree(learned.folder, folder)
    car = open_car(folder)
    with car.file.write() as db:
        (text,) = db.execute("SELECT content FROM model WHERE part = 'metadata.json'").fetchone()
        older = json.dumps({**json.loads(text), "format_version": 1}).encode()
        db.execute("UPDATE model SET content = ? WHERE part = 'metadata.json'", (older,))
    trip = synthetic_fleet(1, seed=9).trips[0]
    expected, again = learned.model().forecast(trip), car.model().forecast(trip)
    assert again.energy_wh == pytest.approx(expected.energy_wh, rel=1e-9)
    assert again.sd_wh == pytest.approx(expected.sd_wh, rel=1e-9)
    assert car.model().trip_ids_ == learned.model().trip_ids_
    about = car.about()
    assert about["learned"] == about["experts"] == {}, "nothing that the older version wrote is shown"
    assert (about["trips"], about["in_diary"]) == (4, 4)
    before = car.diary.table
    done = car.add(logs[4:5])
    assert (done.added, done.entries, done.left_out) == (1, 1, ())
    pd.testing.assert_frame_equal(car.diary.table.iloc[:4], before)
    assert car.diary.table["trips_learned"].tolist() == [0, 1, 2, 3, 4]
    assert list(car.about()["learned"]) == list(NAMES)
    assert len(car.model().trip_ids_) == 5


def test_two_processes_that_add_at_once_both_teach_the_car(
    logs: tuple[Log, ...], learned: Car, base: Path, tmp_path: Path
) -> None:
    """The faster one learns what both have added, and the slower one finds nothing left to learn."""
    car, seen = create_car(tmp_path / "leaf", "nissan_leaf_24", base=base), list[tuple[int, int]]()

    def meanwhile(done: int, total: int) -> None:
        if not seen:
            seen.append((done, total))
            assert open_car(car.folder).add(logs[:2]).entries == 4

    done = car.add(logs[2:4], progress=meanwhile)
    assert (seen, done.added, done.entries) == ([(1, 2)], 2, 0)
    pd.testing.assert_frame_equal(car.diary.table, learned.diary.table)


def test_a_crash_between_store_and_model_is_caught_up(
    logs: tuple[Log, ...], learned: Car, base: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    car = create_car(tmp_path / "leaf", "nissan_leaf_24", base=base)
    with monkeypatch.context() as patch:

        def crash(*_: object) -> None:
            raise KeyboardInterrupt

        patch.setattr(Car, "_store_lesson", crash)
        with pytest.raises(KeyboardInterrupt):
            car.add(logs[:4])
    assert len(car.diary) == 0
    assert len(car.logs()) == 4
    done = car.add(logs[:4])
    assert (done.added, done.known, done.entries) == (0, 4, 4)
    pd.testing.assert_frame_equal(car.diary.table, learned.diary.table)


def test_a_described_car_keeps_its_description(tmp_path: Path) -> None:
    mine = tw.load_vehicle("vw_id3", overrides={"mass": 1900.0})
    car = create_car(tmp_path / "mine", mine)
    again = open_car(tmp_path / "mine")
    assert again.vehicle.body.curb_mass_kg == 1900.0
    assert again.vehicle.title == mine.title
    assert again.vehicle.name == "vw_id3"
    assert len(car.diary) == 0
    trip = synthetic_fleet(1, seed=9).trips[0]
    assert again.model().forecast(trip).energy_wh == pytest.approx(
        for_car(None, mine).forecast(trip).energy_wh, rel=1e-9
    )


def test_what_is_no_car_is_refused_and_files_of_others_stay(
    learned: Car, logs: tuple[Log, ...], tmp_path: Path
) -> None:
    refuses(r"not a car.*no such folder", open_car, tmp_path / "nowhere")
    refuses("folder in use", create_car, learned.folder, "vw_id3")
    refuses("unknown car", create_car, tmp_path / "x", "no such car")
    assert not (tmp_path / "x").exists()
    car = create_car(tmp_path / "x", "bmw_i3_60ah")
    assert is_car(tmp_path / "x")
    (car.folder / "notes.txt").write_text("mine")
    issue_token(car.folder)
    forget_car(car.folder)
    assert [path.name for path in car.folder.iterdir()] == ["notes.txt"]
    refuses("not a car", forget_car, car.folder)


def test_the_commands_are_the_library(
    base: Path, logs: tuple[Log, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from typer.testing import CliRunner

    from tripwatt.command import app
    from tripwatt.command.own_cars import _entry, _learned, _show_learned

    def run(*words: object) -> str:
        answer = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
        assert answer.exit_code == 0, answer.output
        return answer.stdout

    folder, files = tmp_path / "leaf", tmp_path / "files"
    files.mkdir()
    for log in logs[:2]:
        log.samples.to_csv(files / f"{log.trip_id}.csv", index=False)
    assert "no trips yet" in run("car", "new", folder, "--car", "nissan_leaf_24", "--base", base)
    assert "Add trips" in run("car", "show", folder)
    text = run("car", "add", folder, files)
    assert "trips added: 2, 2 of them in the diary; known: 0" in text
    assert "rolling resistance" in text
    shown = json.loads(run("car", "show", folder, "--json"))
    assert [row["trip_id"] for row in shown["diary"]] == [log.trip_id for log in logs[:2]]
    assert shown["score"] == open_car(folder).diary.score.to_dict()
    plain = run("car", "show", folder, "--trips", 1)
    assert "Last 1 trip\n" in plain
    assert "Where the energy went" in plain
    seen = (None, (17.8, 18.3), (-0.4, 6.0))
    assert [_learned({"change": 0.05, "sd": 0.1, "unit": "1", "seen_degc": degc}) for degc in seen] == [
        ("–", "–", "not measurable yet"),
        ("+5.0 %", "10.0 %", "18 °C"),
        ("+5.0 %", "10.0 %", "0 to 6 °C"),
    ]
    assert re.search(r"in all +\d+\.\d\d kWh +100\.0 %", plain)
    for error, said in ((0.2, True), (0.1, False)):
        scores = {name: shown[name] | {"weighted_error": 0.1} for name in ("latest", "latest_by_book")}
        _show_learned(shown | scores | {"latest": shown["latest"] | {"weighted_error": error}})
        assert ("What was learned did not help" in capsys.readouterr().out) == said
    (entry,) = open_car(folder).diary.table.tail(1).to_dict("records")
    rounded = entry | {
        "forecast_wh": 475.1,
        "energy_wh": 594.9,
    }  # differ by 0.12 kWh, and as shown by 0.11 kWh
    assert _entry(rounded)[3::3] == ("0.48 kWh", "-0.11 kWh")
    assert _entry(rounded)[5] == "0.59 kWh"
    said = json.loads(run("forecast", folder, files / f"{logs[0].trip_id}.csv", "--json"))
    own = open_car(folder).model().forecast(tw.read_route(files / f"{logs[0].trip_id}.csv"))
    assert said["energy_wh"] == pytest.approx(own.energy_wh, rel=1e-9)
    assert np.isfinite(said["energy_wh"])
    assert "erased" in run("car", "forget", folder)
    assert not folder.exists()


def test_a_trip_without_measured_energy_is_kept_and_told(
    logs: tuple[Log, ...], base: Path, tmp_path: Path
) -> None:
    from typer.testing import CliRunner

    from tripwatt.command import app

    bare = logs[1].samples.drop(columns=["voltage_v", "current_a"])
    silent = Log.from_samples(logs[1].trip_id, bare, logs[1].context)
    car = create_car(tmp_path / "leaf", "nissan_leaf_24", base=base)
    done = car.add([logs[0], silent])
    assert (done.added, done.entries) == (2, 1)
    (reason,) = done.left_out
    assert reason.startswith(f"{logs[1].trip_id}: no values of battery voltage, battery current")
    assert car.diary.trip_ids == {logs[0].trip_id}
    assert car.add([silent]).left_out == done.left_out
    assert car.add([logs[0]]).left_out == ()
    # a trip that cannot be forecast costs no later one
    wrong = InvalidInput.of("no such road", "plan")
    forecast = tw.ForecastModel.forecast

    def refuse(model: tw.ForecastModel, trip: Log, *more: object) -> tw.Forecast:
        if trip.trip_id == logs[2].trip_id:
            raise wrong
        return forecast(model, trip, *more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tw.ForecastModel, "forecast", refuse)
        other = create_car(tmp_path / "other", "nissan_leaf_24", base=base)
        assert other.add([logs[2], logs[3]]).left_out == (f"{logs[2].trip_id}: {wrong}",)
        assert other.diary.trip_ids == {logs[3].trip_id}
    # the reason is kept with the car, and is shown
    why = reason.partition(": ")[2]
    assert open_car(car.folder).left_out == car.about()["left_out"] == {logs[1].trip_id: why}
    shown = CliRunner().invoke(app, ["car", "show", str(car.folder)]).output
    assert f"not in the diary: {logs[1].trip_id}: {why}" in " ".join(shown.split())
    forget_car(car.folder)
    assert not car.folder.exists()


def test_a_log_that_was_added_before_with_other_samples_costs_no_other_log(
    base: Path, logs: tuple[Log, ...], tmp_path: Path
) -> None:
    car = create_car(tmp_path / "leaf", "nissan_leaf_24", base=base)
    assert car.add(logs[:1]).added == 1
    longer = logs[1].with_samples(logs[1].samples)
    again = replace(longer, trip_id=logs[0].trip_id)
    done = car.add([again, logs[2]])
    assert (done.added, done.entries) == (1, 1)
    assert done.left_out == (f"{logs[0].trip_id}: another log of this name was added before",)
    assert car.left_out == {}  # the log of this name that was added first is in the diary


@pytest.mark.parametrize("value", [[1], 7])
def test_a_setting_of_another_kind_is_damage(
    base: Path, logs: tuple[Log, ...], tmp_path: Path, value: object
) -> None:
    car = create_car(tmp_path / "leaf", "nissan_leaf_24", base=base)
    for name, call in {
        "left_out": lambda: car.left_out,
        "base": lambda: car.add(TripSet("one", logs)),
    }.items():
        with car.file.write() as db:
            db.put_settings({name: value})
        refuses("damaged file", call)
