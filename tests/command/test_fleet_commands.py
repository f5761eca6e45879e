"""The commands of stores and fleets, in this process: what they print and how they fail."""

import json
import shlex
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tests.fleet.store.test_store import drive
from tools import DOCS

import tripwatt as tw
from tripwatt.command import app
from tripwatt.command.stores import store_options
from tripwatt.errors import InvalidInput
from tripwatt.fleet.mapping import load_car
from tripwatt.study.synthetic import CHANGED, TRIPS_EACH, VEHICLES, example_fleet, synthetic_fleet
from tripwatt.vehicles import load_vehicle


def run(*arguments, code=0):
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == code, done.output + repr(done.exception)
    return done.stdout


def test_a_store_from_the_command_line(tmp_path):
    store = tmp_path / "s"
    assert "an empty trip store" in run("store", "create", store)
    for i in range(3):
        drive(start=0.3 * i).samples.to_csv(tmp_path / f"d{i}.csv", index=False)
    for i in range(2):
        run("store", "add", store, tmp_path / f"d{i}.csv", "--car", "vw_id3", "--vehicle-id", "V1")
    added = json.loads(
        run("store", "add", store, tmp_path / "d2.csv", "--car", "vw_id3", "--vehicle-id", "V2", "--json")
    )
    assert added == {"added": 1, "known": 0, "unusable": 0}
    again = run("store", "add", store, tmp_path / "d2.csv", "--car", "vw_id3", "--vehicle-id", "V2")
    assert "0 trips added, 1 known before" in again
    about = tw.open_store(store).about()
    assert (about["trips"], about["vehicles"], about["car_models"]) == (3, 2, {"vw_id3": 3})
    done = json.loads(run("store", "compact", store, "--json"))
    assert done["merged"] > done["made"]
    assert "files merged into" in run("store", "compact", store)
    assert "1 trips of V2 erased" in run("store", "forget", store, "--vehicle-id", "V2")
    assert json.loads(run("store", "forget", store, "--vehicle-id", "V1", "--json"))["erased"] == 2
    missing = CliRunner().invoke(app, ["store", "compact", str(tmp_path / "none")])
    assert isinstance(missing.exception, InvalidInput)
    unknown = CliRunner().invoke(
        app, ["store", "add", str(store), str(tmp_path / "d0.csv"), "--car", "vw_id33"]
    )
    assert isinstance(unknown.exception, InvalidInput)


def test_the_documented_commands_lead_from_nothing_to_the_report_of_a_fleet(tmp_path, monkeypatch):
    """It lists the one change that the example has, with its cause, and the truth lies in the interval of its first day."""
    section = (DOCS / "howto" / "fleet.md").read_text("utf-8").split("## Try it without data")[1]
    commands = section.split("```sh\n")[1].split("```")[0].splitlines()
    assert len(commands) == 3
    monkeypatch.chdir(tmp_path)
    for command in commands:
        run(*shlex.split(command)[1:])
    report = Path("example-models", "report")
    assert "V1" in (report / "report.html").read_text("utf-8")
    told = json.loads((report / "report.json").read_text("utf-8"))
    vehicle, since = CHANGED
    (change,) = told["changes"]
    assert (change["vehicle_id"], change["cause"]) == (vehicle, "road load")
    assert change["from_day"] <= f"{since:%Y-%m-%d}" <= change["to_day"]
    car_model, fleet = next(example_fleet())
    without = synthetic_fleet(TRIPS_EACH, 0, vehicle=load_vehicle(car_model))
    pairs = [
        pair for pair in zip(fleet.logs, without.logs, strict=True) if pair[0].context.started_at >= since
    ]
    changed_wh, unchanged_wh = (
        sum(log.observed_energy_wh for log in logs) for logs in zip(*pairs, strict=True)
    )
    assert change["change"] == pytest.approx(changed_wh / unchanged_wh - 1.0, abs=3.0 * change["sd"])
    assert len(told["vehicles"]) == VEHICLES


def test_store_options_are_pairs():
    assert store_options(None) == {}
    assert store_options(["A=1", "B=x=y"]) == {"A": "1", "B": "x=y"}
    with pytest.raises(InvalidInput) as error:
        store_options(["A", "=1"])
    assert len(error.value.faults) == 2


def test_a_car_of_a_file_is_kept_by_its_whole_path(tmp_path, monkeypatch):
    """Trips of an own car are simulated from any folder, and a file that is gone is named."""
    car = tmp_path / "evito.toml"
    figures = "--mass 2200 --battery 60 --consumption 26 --power 85 --body van --out"
    run("vehicles", "new", *figures.split(), car)
    drive().samples.to_csv(tmp_path / "d.csv", index=False)
    store = tmp_path / "s"
    run("store", "create", store)
    monkeypatch.chdir(tmp_path)
    run("store", "add", store, "d.csv", "--car", "./evito.toml", "--vehicle-id", "V1")
    assert tw.open_store(store).about()["car_models"] == {f"{car}": 1}
    other = tmp_path / "other"
    other.mkdir()
    monkeypatch.chdir(other)
    few = CliRunner().invoke(app, ["fleet", "fit", f"{store}", "m"])
    assert [fault.got for fault in few.exception.faults] == ["1"]
    car.unlink()
    load_car.cache_clear()
    gone = CliRunner().invoke(app, ["fleet", "fit", f"{store}", "n"])
    assert str(gone.exception).startswith(f"the file of a car model is missing: {car}: got no such file")


def mixed_logs(folder, vehicles):
    """A file of a trip of each vehicle, and the mapping that names the vehicle's column."""
    folder.mkdir()
    for i, vehicle in enumerate(vehicles):
        drive(start=0.3 * i).samples.assign(vin=vehicle).to_csv(folder / f"d{i}.csv", index=False)
    names = ("time_s", "speed_m_s", "voltage_v", "current_a")
    columns = "".join(f'{name} = {{ column = "{name}" }}\n' for name in names)
    (folder / "m.toml").write_text(f'[columns]\n{columns}[trip]\nvehicle = "vin"\n')
    return folder, "--mapping", folder / "m.toml"


def test_a_mixed_fleet_is_added_by_a_table_of_its_cars(tmp_path):
    """A row with a fault and a vehicle without a row are named together; the others are added, and the rest after a repair."""
    logs = mixed_logs(tmp_path / "logs", ["V1", "V2", "V3", "V4", "V1"])
    figures = "--mass 2200 --battery 60 --consumption 26 --power 85 --body van --out"
    run("vehicles", "new", *figures.split(), tmp_path / "van.toml")
    cars, store = tmp_path / "cars.csv", tmp_path / "s"
    cars.write_text("vehicle_id,car\nV1,vw_id3\nV2,van.toml\nV3,vw_id33\n")
    run("store", "create", store)
    done = CliRunner().invoke(app, ["store", "add", *map(str, (store, *logs, "--cars", cars))])
    faults = {fault.what: fault for fault in done.exception.faults}
    assert faults["vehicle without a car"].got == "V4"
    (wrong,) = (fault for fault in faults.values() if "vw_id33" in fault.got)
    assert wrong.where.startswith(f"{cars}: V3: ")
    assert len(faults) == 2
    added = tw.open_store(store).trips()[["vehicle_id", "car_model"]].drop_duplicates()
    assert [*map(tuple, added.to_numpy())] == [("V1", "vw_id3"), ("V2", f"{tmp_path / 'van.toml'}")]
    cars.write_text("vehicle_id,car\nV1,vw_id3\nV2,van.toml\nV3,vw_id3\nV4,vw_id3\n")
    assert "2 trips added, 3 known before" in run("store", "add", store, *logs, "--cars", cars)
    for asked in ((), ("--cars", cars, "--car", "vw_id3")):
        refused = CliRunner().invoke(app, ["store", "add", *map(str, (store, *logs, *asked))])
        assert "one of them is needed: --car, --cars" in str(refused.exception)


def test_a_log_without_a_date_gets_that_of_its_name_or_is_named(tmp_path):
    folder, *mapping = mixed_logs(tmp_path / "logs", ["V1", "V1"])
    (folder / "d0.csv").rename(folder / "van 2024-05-31 0815.csv")
    store, car = tmp_path / "s", ("--car", "vw_id3")
    run("store", "create", store)
    add = ["store", "add", *map(str, (store, folder, *mapping, *car))]
    done = CliRunner().invoke(app, [*add, "--started", "van %Y-%m-%d %H%M"])
    assert [(f.what, f.where) for f in done.exception.faults] == [("no departure", "d1.csv")]
    assert [*tw.open_store(store).trips()["started_at"]] == ["2024-05-31T08:15:00"]
    (folder / "van 2024-05-31 0815.csv").unlink()
    undated = CliRunner().invoke(app, add)
    assert "1 trips of the store have no date and count in no month: d1" in undated.output
    assert tw.open_store(store).trips(columns=["month"])["month"].tolist() == ["2024-05", "unknown"]
    run("store", "forget", store, "--vehicle-id", "V1")
    run(*add, "--started", "2024-05-30T07:00")
    assert [*tw.open_store(store).trips()["started_at"]] == ["2024-05-30T07:00:00"]


def test_adding_in_parts_is_adding_at_once(tmp_path):
    folder, *mapping = mixed_logs(tmp_path / "logs", ["V1", "V2", "V2"])
    cars = tmp_path / "cars.csv"
    cars.write_text("vehicle_id,car\nV1,vw_id3\nV2,bmw_i3_60ah\n")
    parts = {"once": [folder], "parts": sorted(folder.glob("*.csv"), reverse=True)}
    rows = {}
    for name, places in parts.items():
        run("store", "create", tmp_path / name)
        for place in places:
            run("store", "add", tmp_path / name, place, *mapping, "--cars", cars)
        rows[name] = tw.open_store(tmp_path / name).trips()
    pd.testing.assert_frame_equal(rows["once"], rows["parts"])
    assert len(rows["once"]) == 3


def test_a_fault_of_many_files_is_listed_once(tmp_path):
    for i in range(3):
        drive(start=0.3 * i).samples.to_csv(tmp_path / f"d{i}.csv", index=False)
    run("store", "create", tmp_path / "s")
    done = CliRunner().invoke(
        app, ["store", "add", f"{tmp_path / 's'}", f"{tmp_path}", "--dataset", "table", "--car", "vw_id3"]
    )
    (fault,) = done.exception.faults
    assert (fault.what, fault.where) == ("vehicle is missing", "d0 (and 2 more places)")


def test_the_car_model_of_a_forecast_is_not_a_filter():
    shown = " ".join(run("fleet", "forecast", "--help").split())
    assert "The car model of a vehicle without trips." in shown
    assert "Trips of this car model only" not in shown
