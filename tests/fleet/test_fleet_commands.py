"""The commands of a fleet, in this process: what they print, and what they leave."""

import json
import shutil

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import tripwatt as tw
from tripwatt.command import app, fleets
from tripwatt.fleet.executors import executor_for
from tripwatt.fleet.model import fit_fleet
from tripwatt.fleet.registry import Registry
from tripwatt.fleet.statistics import TripRows

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def run(*arguments, code=0):
    done = CliRunner().invoke(app, ["fleet", *map(str, arguments)])
    assert done.exit_code == code, done.output + repr(done.exception)
    return done.stdout


@pytest.fixture
def registry(fleet, tmp_path):
    *_, model, _ = fleet
    made = Registry(tmp_path / "models")
    made.promote(made.add(model))
    return made


def test_fit_promotes_the_first_version_only(fleet, tmp_path):
    _, store, *_ = fleet
    arguments = ("fit", store.place, tmp_path / "m")
    first = json.loads(run(*arguments, "--json"))
    assert (first["version"], first["in_use"], first["vehicles"]) == ("0001", True, 8)
    assert first["trips"] == len(store.trips().query("drives > 0"))
    assert "promote it to use it" in run(*arguments)
    assert Registry(tmp_path / "m").current() == "0001"
    assert "no new trips" in run("update", store.place, tmp_path / "m")


def test_an_update_takes_in_new_trips(fleet, tmp_path):
    _, store, *_ = fleet
    target = Registry(tmp_path / "m")
    with executor_for(1) as workers:
        older = fit_fleet(store, tmp_path / "work", workers, which={"until": "2023-01-10"})
    target.promote(target.add(older))
    updated = json.loads(run("update", store.place, target.folder, "--json"))
    assert updated["version"] == target.current() == "0002"
    assert updated["trips"] == len(store.trips(since="2023-01-10").query("drives > 0"))
    assert 0.0 <= updated["coverage"] <= 1.0


def test_an_update_calls_the_signed_error_a_bias(capsys):
    fleets._show_update("version 0002", {"trips": 12, "bias": -0.009, "coverage": 0.92, "vehicles": {}})
    assert (
        capsys.readouterr().out == "version 0002; 12 new trips, bias -0.9 %, 92 % inside the 90 % interval\n"
    )


def test_versions_are_promoted_forth_and_back(fleet, registry):
    *_, model, _ = fleet
    registry.add(model)
    assert "version 0002 is in use" in run("promote", registry.folder, "0002")
    assert json.loads(run("promote", registry.folder, "0001", "--json")) == {"in_use": "0001"}
    shown = json.loads(run("versions", registry.folder, "--json"))
    assert (shown["versions"], shown["in_use"]) == (["0001", "0002"], "0001")
    assert "2 versions, 0001 in use" in run("versions", registry.folder)


def test_the_documented_steps_erase_a_driver(fleet, tmp_path):
    store, models = tmp_path / "store", tmp_path / "models"
    shutil.copytree(fleet[1].place, store)
    run("fit", store, models)
    name = fleet[2].sums.groups[0][2]
    told = CliRunner().invoke(app, ["store", "forget", f"{store}", "--driver", name]).stdout
    assert all(place in told for place in ("REGISTRY/work", "fleet.work", "the version in use", "reports"))

    def holds():
        """Whether finished parts and versions have trips of the driver."""
        target = Registry(models)
        parts = (pq.read_table(file) for file in models.glob("work/*.parquet"))
        drivers = [part["driver"].to_pylist() for part in parts if "driver" in part.column_names]
        groups = (target.load(version).sums.groups for version in target.versions())
        return any(name in of_part for of_part in drivers), any(
            name in group for all_ in groups for group in all_
        )

    assert holds() == (True, True)
    shutil.rmtree(models / "work")
    run("fit", store, models)
    run("promote", models, "0002")
    shutil.rmtree(models / "versions" / "0001")
    assert holds() == (False, False)
    assert "1 versions, 0002 in use" in run("versions", models)
    shutil.rmtree(models / "versions" / "0002")
    assert "0 versions, none in use" in run("versions", models)
    again = json.loads(run("fit", store, models, "--json"))
    assert (again["version"], again["in_use"]) == ("0003", True)


def test_a_vehicle_is_forecast(fleet, registry, tmp_path):
    *_, model, _ = fleet
    links = tmp_path / "links.csv"
    links.write_text("length_m,speed_m_s\n3000,15\n4000,20\n")
    asked = ("forecast", registry.folder, links, "--vehicle-id")
    shown = json.loads(run(*asked, "V00001", "--soc", 0.8, "--ambient", 4, "--json"))
    own = model.forecast(
        tw.read_route(links), tw.Departure(soc=0.8, ambient_temperature_degc=4.0), vehicle_id="V00001"
    )
    assert shown["vehicle_id"] == "V00001"
    assert shown["energy_wh"] == pytest.approx(own.energy_wh)
    text = run(*asked, "new", "--car-model", "vw_id3", "--reserve", 0.1)
    assert "probability to arrive with 10 % or more" in text
    rows = [{"trip": "a", "vehicle_id": "V00001", "length_m": 3000.0, "speed_m_s": 15.0, "soc": 0.8}]
    pq.write_table(pa.Table.from_pylist(rows), tmp_path / "in.parquet")
    done = run(
        "batch", registry.folder, tmp_path / "in.parquet", "--out", tmp_path / "o.parquet", "--quantile", 0.2
    )
    found = pq.read_table(tmp_path / "o.parquet")
    assert np.isfinite(found["energy_wh_q20"].to_numpy()).all()
    assert f"1 trips, {found['energy_wh'][0].as_py() / 1000.0:.1f} kWh in all\n" in done


def test_a_batch_counts_trips_that_cannot_be_forecast(registry, tmp_path):
    rows = [
        {"trip": trip, "vehicle_id": vehicle, "length_m": 3000.0, "speed_m_s": 15.0, "soc": 0.8}
        for trip, vehicle in (("a", "V00001"), ("b", "V00002"), ("c", "nobody"))
    ]
    pq.write_table(pa.Table.from_pylist(rows), tmp_path / "in.parquet")
    asked = ("batch", registry.folder, tmp_path / "in.parquet", "--out", tmp_path / "o.parquet")
    assert "3 trips, " in (shown := run(*asked, code=1))
    assert "; 1 cannot be forecast, see the column error" in shown
    energy_wh = pq.read_table(tmp_path / "o.parquet")["energy_wh"].to_pylist()
    counted = json.loads(run(*asked, "--json", code=1))
    assert (counted["trips"], counted["failed"]) == (3, 1)
    assert counted["energy_wh"] == pytest.approx(sum(e for e in energy_wh if e is not None), rel=1e-12)


def test_evaluate_writes_the_page(fleet, tmp_path):
    _, store, _, folder = fleet
    out = tmp_path / "fleet.html"
    shown = json.loads(run("evaluate", store.place, "--out", out, "--work", folder / "rows", "--json"))
    assert {row["protocol"] for row in shown["by_car_model"]} == {
        "later trips",
        "new vehicles",
        "new car models",
    }
    assert shown["own_trips"][0]["own_trips"] == 0
    assert out.read_text("utf-8").startswith("<!DOCTYPE html>")


def test_the_report_is_a_folder_of_the_registry(fleet, registry, tmp_path):
    _, store, _, folder = fleet
    asked = ("report", store.place, registry.folder, "--work", folder / "rows")
    shown = json.loads(run(*asked, "--json"))
    assert len(shown["vehicles"]) == 8
    assert "drivers" not in shown
    assert "needs" not in shown
    assert shown["changes"] == []
    assert (
        json.loads((registry.folder / "report" / "report.json").read_text("utf-8")) | {"out": shown["out"]}
        == shown
    )
    night = tmp_path / "night.csv"
    night.write_text(
        "vehicle_id,trip,departs_at,distance_km,soc\nV00001,a,2030-01-12T07:30+01:00,30,0.1\nV00002,b,2030-01-12T08:30+01:00,30,\n"
    )
    out = tmp_path / "out"
    begins = ("--begins", "2030-01-11 18:00", "--plug", 11000, "--probability", 0.9)
    text = run(*asked, "--planned", night, "--drivers", "--out", out, *begins)
    assert "Vehicles whose consumption changed: none." in text
    assert "Vehicles with planned trips: 2. They take" in text
    assert text.endswith(f"{out / 'report.html'}\n")
    written = json.loads((out / "report.json").read_text("utf-8"))
    assert [row["vehicle_id"] for row in written["needs"]] == ["V00001", "V00002"]
    assert written["emhass"]["nominal_power_of_deferrable_loads"] == [6600.0], "the car takes less"
    assert {row["trip"] for row in written["routes"]} == {"a", "b"}
    assert {row["driver"].partition("/")[0] for row in written["drivers"]} <= {
        row["vehicle_id"] for row in written["vehicles"]
    }
    page = (out / "report.html").read_text("utf-8")
    assert "suffices with 90\u00a0%" in page
    facts = {"Model version": "0001", "Charger": "11 kW", "Reserve": "10 %", "A need is enough with": "90 %"}
    assert facts.items() <= written["about"].items()
    assert written["about"]["Charging begins"].startswith("2030-01-11 18:00 ")
    assert "<h1>Fleet report</h1>" in page


def test_the_report_schedules_the_night_under_a_limit_and_a_tariff(fleet, registry, tmp_path):
    _, store, _, folder = fleet
    night, prices, out = tmp_path / "night.csv", tmp_path / "prices.csv", tmp_path / "out"
    row = "V0000{0},a,2030-01-12T07:30+01:00,30,0.1\n"
    night.write_text("vehicle_id,trip,departs_at,distance_km,soc\n" + row.format(1) + row.format(2))
    prices.write_text("begins_at,price\n2030-01-11T18:00+01:00,0.4\n2030-01-12T05:00+01:00,0.1\n")
    asked = ("report", store.place, registry.folder, "--work", folder / "rows", "--planned", night)
    limits = ("--grid", 2.5, "--tariff", prices, "--begins", "2030-01-11T18:00+01:00", "--out", out)
    text = run(*asked, *limits)
    written = json.loads((out / "report.json").read_text("utf-8"))
    table = pd.read_csv(out / "schedule.csv")
    assert len(table) == len(written["schedule"])
    assert table.groupby("begins_at")["power_w"].sum().max() <= 2500.0
    assert f"The schedule has a peak of 2.5 kW and costs {written['depot']['cost']:.2f}" in text
    lacking = pd.read_csv(out / "needs.csv")["missing_wh"].sum()
    assert (written["depot"]["fails_first"] is None) == (lacking == 0.0)


def test_the_report_names_what_it_leaves_out_and_assumes(fleet, registry, tmp_path):
    _, store, _, folder = fleet
    night, header = tmp_path / "night.csv", "vehicle_id,trip,departs_at,distance_km\n"
    rows = "V00001,a,2030-01-12T07:30+01:00,30\nnobody,b,2030-01-12T08:30+01:00,30\nV00002,c,2020-01-12T08:30+01:00,30\n"
    night.write_text(header + rows)
    asked = ["fleet", "report", store.place, registry.folder, "--work", folder / "rows", "--planned", night]
    done = CliRunner().invoke(app, [*map(str, asked), "--coldest", "-15"])
    assert done.exit_code == 1
    for text in (
        "left out: 1 of 3 planned trips, which departed before 20",
        "note: left out: unknown vehicle: trip b of nobody: vehicle_id",
        "note: V00001: outside temperature is unknown: ",
        " is assumed (departures: 1 of 1)",
    ):
        assert text in done.stderr, text
    assert "Planned trips: 1. The charge" in done.stdout
    assert "At −15 °C, a full battery" in done.stdout
    page = (registry.folder / "report" / "report.html").read_text("utf-8")
    assert "left out: unknown vehicle: trip b of nobody: vehicle_id" in page
    assert "V00001: outside temperature is unknown: " in page
    written = json.loads((registry.folder / "report" / "report.json").read_text("utf-8"))
    assert [fault["what"] for fault in written["refused"]] == ["unknown vehicle"]
    assert written["coldest_week"]["ambient_temperature_degc"] == -15.0
    of_kinds = f"{header[:-1]},kind\nV00001,a,2030-01-12T07:30,30,Autobahn\nV00002,b,2030-01-12T07:30,30,\n"
    night.write_text(of_kinds)
    kind = CliRunner().invoke(app, [*map(str, asked)])
    assert kind.exit_code == 1, kind.output
    assert kind.stderr.count("left out: unknown kind of road: trip a of V00001: kind: got Autobahn") == 1
    assert "Planned trips: 1. The charge" in kind.stdout
    written = json.loads((registry.folder / "report" / "report.json").read_text("utf-8"))
    assert [route["trip"] for route in written["routes"]] == ["b"]
    night.write_text(header + rows.splitlines()[1] + "\n")
    nobody = CliRunner().invoke(app, [*map(str, asked)])
    assert nobody.exit_code == 1, nobody.output
    assert "Planned trips: 0. The charge" in nobody.stdout
    night.write_text(header + rows.splitlines()[0] + "\n")
    warm = CliRunner().invoke(app, [*map(str, asked), "--ambient", "30"])
    assert warm.exit_code == 0, warm.output
    mild = json.loads((registry.folder / "report" / "report.json").read_text("utf-8"))["needs"][0]
    assert "outside temperature is unknown" not in warm.stderr
    frost = CliRunner().invoke(app, [*map(str, asked), "--ambient", "30", "--cold", "-15", "--json"])
    (cold,) = json.loads(frost.stdout)["needs"]
    assert cold["energy_wh"] > 1.1 * mild["energy_wh"]
    assert json.loads(frost.stdout)["about"]["Planned trips at"] == "-15 °C"


def test_drivers_that_nobody_named_are_a_note(fleet, registry, monkeypatch):
    _, store, _, folder = fleet
    read = fleets._rows

    def nameless(*asked):
        table = read(*asked).table
        return TripRows(
            table.set_column(table.column_names.index("driver"), "driver", pa.array([""] * len(table)))
        )

    monkeypatch.setattr(fleets, "_rows", nameless)
    asked = ["fleet", "report", store.place, registry.folder, "--work", folder / "rows", "--drivers"]
    done = CliRunner().invoke(app, list(map(str, asked)))
    assert done.exit_code == 0
    assert "note: no trip of the store names its driver" in done.stderr
    assert not (registry.folder / "report" / "drivers.csv").exists()
