"""The pages on a fleet: how well it is forecast, and what its manager asks."""

import datetime as dt
import json
import math
from dataclasses import replace

import pandas as pd
import pyarrow as pa
import pytest

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tests.fleet.rows import year_of_rows

from tripwatt.errors import InvalidInput
from tripwatt.fleet.charging import Depot, Night
from tripwatt.fleet.features import START
from tripwatt.fleet.nights import OF_ERRORS, Cold, PlannedTrip, needs_by_hour
from tripwatt.fleet.registry import REPORT_FILES
from tripwatt.fleet.statistics import ROWS, TripRows
from tripwatt.fleet.store import read_by_vehicle
from tripwatt.hybrid.groups import fit_scales, group_posterior
from tripwatt.study.evaluation.fleets import FleetEvaluation
from tripwatt.study.report.fleets import (
    ManagerReport,
    describe_routes,
    evaluation_page,
    needs_table,
    routes_table,
)
from tripwatt.study.report.totals import ReportSettings, drivers_by_name, totals
from tripwatt.trips import Departure

AT = dt.datetime(2026, 1, 11, 18, tzinfo=dt.UTC)
LEAVES = dt.datetime(2026, 1, 12, 7, 30, tzinfo=dt.UTC)


def test_the_page_has_every_table_and_escapes_names():
    trips = pd.DataFrame(
        {
            "protocol": "later trips",
            "car_model": "<b>",
            "vehicle_id": ["v&1"] * 12,
            "distance_m": 12e3,
            "ambient_temperature_degc": 5.0,
            "observed_wh": 1000.0,
            "predicted_wh": 1100.0,
            "low_wh": 900.0,
            "high_wh": [1200.0] * 9 + [950.0] * 3,
        }
    )
    own = pd.DataFrame(
        [(0, 3, 0.05, 0.2, 0.05)], columns=["own_trips", "vehicles", "pooled", "own_only", "fleet_only"]
    )
    rows = year_of_rows(0, vehicles=3, trips=4)
    page = evaluation_page("Fleet <1>", FleetEvaluation(trips, own), rows)
    assert "<h1>Fleet &lt;1&gt;</h1>" in page
    assert "<b>" not in page
    assert "<script" not in page
    for text in (
        "<dt>Trips</dt><dd>12</dd>",
        "<dt>Vehicles</dt><dd>3</dd>",
        "10.0 % on later trips",
        "By outside temperature",
        "0 to 10 °C",
        "10 to 25 km",
        "<td>10.0</td>\n<td>75</td>",
        "<td>5.0</td>\n<td>20.0</td>\n<td>5.0</td>",
    ):
        assert text in page, text


def report(changes=60, **more):
    """A report of made tables, with many changes."""
    changed = pd.DataFrame(
        {
            "vehicle_id": [f"<v{k}>" for k in range(changes)],
            "car_model": "m",
            "cause": "road load",
            "probability": 0.987,
            "since": "2025-06-01",
            "from_day": "2025-05-20",
            "to_day": "2025-06-03",
            "change": 0.051,
            "sd": 0.004,
            "z": 12.0,
            "before": 40,
            "after": 60,
        }
    )
    sums = {
        "distance_m": 2e6,
        "energy_wh": 4.5e5,
        "expected_wh": 4e5,
        "excess": 0.125,
        "wh_per_km": 225.0,
        "cost": 150.0,
        "co2_kg": 125.0,
        "gain": 16.7,
    }
    parts = {**sums, "share": 0.1, "sd": 0.02, "driving": 0.08, "climate": 0.03, "base_load": -0.01}
    vehicles = pd.DataFrame(
        [{"car_model": "m", "vehicle_id": f"<v{k}>", "trips": 100, **parts} for k in range(80)]
    )
    return ManagerReport(0.95, changed, vehicles, **more)


def test_every_change_is_listed_with_its_cause_and_its_beginning():
    page = report().page()
    for k in range(60):
        assert f'<th scope="row">&lt;v{k}&gt;</th>' in page
    for text in (
        ">99</td>",
        ">2025-05-20<",
        ">2025-06-03<",
        ">5.1</td>\n<td>0.4</td>",
        "Vehicles whose consumption changed: &lt;v0&gt; by 5 % (road load) since 2025-06",
        "displayed percent changed: none.",
    ):
        assert text in page, text


def test_drivers_are_shown_only_where_they_are_asked_for():
    drivers = report().vehicles.assign(driver="anna")
    assert "anna" not in report().page()
    assert "anna" in report(drivers=drivers).page()


def night_of(needs, probability=0.95, **depot):
    return Night(needs, Depot(AT, 7400.0, **depot), probability)


def needs_of(soc):
    row = {"vehicle_id": "V1", "car_model": "m", "departs_at": LEAVES, "arrives_at": LEAVES, "trips": 2}
    wh = {"distance_m": 6e4, "energy_wh": 9e3, "energy_quantile_wh": 12e3}
    powers = {"alternating_w": 11e3, "direct_w": 50e3}
    return pd.DataFrame(
        [
            {
                **row,
                **wh,
                **powers,
                "soc_needed": 0.5,
                "soc": math.nan if soc is None else soc,
                "p_enough": 0.4 if soc is not None else None,
                **dict.fromkeys(OF_ERRORS, 0.0),
                "wh_per_soc": 30e3,
                "charge_wh": 6e3 if soc is not None else math.nan,
                "assumed": "soc",
                "reasons": "a; b",
            }
        ]
    )


def test_a_folder_has_a_file_for_each_program_and_none_of_an_earlier_report(tmp_path):
    routes = pd.DataFrame({"trip": ["north"], "a": [0.5]})
    cold = Cold(-7.4, "2025-01-06", 10, (("2025-01-13", -9.0, 3),))
    full = report(night=night_of(needs_of(0.2)), routes=routes, cold=cold)
    document = full.write(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == set(REPORT_FILES) - {
        f"{name}.csv" for name in ("drivers", "groups", "months", "schedule", "batteries", "route_ends")
    }
    assert json.loads((tmp_path / "report.json").read_text("utf-8")) == json.loads(json.dumps(document))
    assert json.loads((tmp_path / "emhass.json").read_text("utf-8")) == document["emhass"]
    assert (tmp_path / "evcc.txt").read_text("utf-8") == "/api/vehicles/V1/plan/soc/50/2026-01-12T07:30:00Z\n"
    assert (
        (tmp_path / "emhass.json").read_bytes()[-2:] == (tmp_path / "report.json").read_bytes()[-2:] == b"}\n"
    )
    needs = pd.read_csv(tmp_path / "needs.csv")
    assert needs["departs_at"].item() == "2026-01-12T07:30:00+00:00"
    assert needs["charge_wh"].item() == 6000.0
    assert len(pd.read_csv(tmp_path / "changes.csv")) == 60
    assert document["coldest_week"] == {
        "monday": "2025-01-06",
        "ambient_temperature_degc": -7.4,
        "min_trips": 10,
        "colder": (("2025-01-13", -9.0, 3),),
    }
    report().write(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {
        "changes.csv",
        "vehicles.csv",
        "report.json",
        "report.html",
    }


def test_the_need_of_the_night_is_summed():
    page = report(night=night_of(needs_of(0.2))).page()
    assert (
        "Vehicles with planned trips: 1. They take 9 kWh (median), and with 95\u00a0% at most 9 kWh." in page
    )
    assert "6 kWh are to be charged" in page
    assert "Planned trips: 2. The charge now is known for 1 of 1 departures." in page
    assert "does not suffice: 0." in page
    sure, unsure = (
        report(night=night_of(needs_of(0.2).assign(spare=spare, own_wh2=1e6, soc_per_wh=1e-4))).sentences[-1]
        for spare in (0.3, -0.2)
    )
    assert sure.endswith("the chance that all have enough then is 100.0\u00a0%."), "it cannot be higher"
    assert unsure.endswith("\u00a0%, more with a higher --probability.")
    unknown = report(night=night_of(needs_of(None).assign(soc_needed=1.2))).page()
    assert "does not suffice: 1." in unknown
    assert "known for 0 of 1 departures" in unknown


def test_what_is_charged_in_time_and_what_is_missing_add_up_to_what_is_to_be_charged():
    """Two hours at 7.4 kW before the first departure, and a quarter of an hour before the second."""
    two = pd.concat([needs_of(0.2).assign(charge_wh=wh) for wh in (30e3, 5e3)], ignore_index=True)
    two["arrives_at"] = [LEAVES + dt.timedelta(hours=1), LEAVES + dt.timedelta(hours=3)]
    two["departs_at"] = [LEAVES, LEAVES + dt.timedelta(hours=1.25)]
    night = Night(two, Depot(LEAVES - dt.timedelta(hours=2), 7400.0, 50e3))
    assert night.tables["needs"]["missing_wh"].tolist() == pytest.approx([16_680.0, 20_015.0])
    said = report(night=night).sentences[-1]
    assert "35 kWh are to be charged" in said
    assert "peak of 7.4 kW; 15.0 kWh are charged in time, 20.0 kWh are missing." in said
    assert "First V1 lacks 16.7 kWh at" in said


def test_a_departure_of_several_trips_counts_once_in_a_note():
    two = needs_of(0.2).assign(reasons="45 min is longer than 40 min; 50 min is longer than 40 min")
    (note,) = report(night=night_of(two)).notes
    assert note == "V1: 45 min is longer than 40 min (departures: 1 of 1)"


def test_routes_name_the_cars_that_can_drive_them():
    routes = pd.DataFrame({"trip": ["a", "b", "c"], "small": [0.5, 1.2, 1.4], "large": [0.2, 0.6, 1.1]})
    assert routes_table(routes).rows == (
        ("a", "all", "50", "20"),
        ("b", "large", "–", "60"),
        ("c", "none", "–", "–"),
    )
    said = describe_routes(routes, 0.95, Cold(-7.4, "2025-01-06", 4, (("2025-01-13", -9.2, 3),)))
    assert said.startswith(
        "In the coldest week so far with 4 trips or more, from 2025-01-06 at −7 °C, a full"
    )
    assert said.endswith("Colder weeks with fewer trips do not count: 2025-01-13 (−9 °C, 3 trips).")
    given = describe_routes(routes, 0.95, Cold(-15.0))
    assert given.startswith("At −15 °C, a full battery")
    assert "week" not in given
    assert (
        "suffices for 1 of 3 routes with 95\u00a0%; 1 more with some of the car models, 1 with none of them."
        in said
    )


def test_the_need_of_a_changed_vehicle_is_that_of_its_trips_since_then(fleet):
    """The road load of one vehicle rises by 18 % of its consumption in July; the model averages over the year."""
    made = year_of_rows(4711, changes=[(2, "road load", 190, 0.18)]).table.to_pandas()
    cars = made["car_model"].map({"m0": "bmw_i3_60ah", "m1": "nissan_leaf_24"})
    rows = TripRows.join([pa.Table.from_pandas(made.assign(car_model=cars), schema=ROWS)])
    sums, digests = rows.sums, frozenset(rows.texts("digest").tolist())
    model = replace(
        fleet[2], sums=sums, posterior=group_posterior(sums, fit_scales(sums, START)), digests=digests
    )
    known = Departure(ambient_temperature_degc=10.0)
    trips = [PlannedTrip("a", car, LEAVES, 30.0, "country", known, None, None) for car in ("v02", "v04")]
    report = ManagerReport.of({}, model, rows, (trips, Depot(AT, 7400.0)))
    assert list(report.changes["vehicle_id"]) == ["v02"]
    changed, same = (report.tables["needs"]["energy_wh"] / needs_by_hour(model, trips)["energy_wh"]).tolist()
    assert 1.05 < changed < 1.15
    assert same == pytest.approx(1.0, abs=5e-3)
    assert ["change of +" in reasons for reasons in report.tables["needs"]["reasons"]] == [True, False]
    page = report.page()
    assert "v02: the need is that of its trips after its change of +" in page
    assert len(report.tables["batteries"]) == 24
    assert set(report.tables["route_ends"]["vehicle_id"]) == {"v02", "v04"}
    assert "Until when routes are possible" in page


def test_the_page_has_need_and_charge_first_and_links_to_its_files():
    rows = [("calm", 0.3, 0.0), ("short", 0.6, 5e3), ("far", 1.4, math.nan)]
    needs = pd.concat(
        [needs_of(0.2).assign(vehicle_id=car, soc_needed=soc, charge_wh=wh) for car, soc, wh in rows]
    )
    needs["reasons"] = "battery temperature at departure is unknown: -5 °C is assumed since 2025-06-01"
    made = report(night=night_of(needs, 0.9), about={"Model version": "0007", "Reserve": "10 %"})
    table = needs_table(needs, 0.9)
    assert table.columns[:3] == ("vehicle", "leave with [%]", "to charge [kWh]")
    assert [row[:3] for row in table.rows] == [
        ("short", "60", "5.0"),
        ("far", "140", "–"),
        ("calm", "30", "0.0"),
    ]
    page = made.page()
    for name in ("changes.csv", "vehicles.csv", "needs.csv", "emhass.json", "evcc.txt"):
        assert f'<a href="{name}">{name}</a>' in page
    assert "drivers.csv" not in page
    assert "evcc.txt" not in report().page()
    assert "<dt>Model version</dt><dd>0007</dd>" in page
    assert "unknown: −5 °C is assumed since 2025-06-01 (departures: 3 of 3)" in page


def test_less_has_the_sign_of_the_other_numbers():
    made = report()
    less = replace(made, changes=made.changes.assign(change=-0.051)).page()
    assert "−5.1" in less
    assert "-5.1" not in less.partition("<script")[0]


def test_a_note_names_a_vehicle_only_where_it_is_about_it():
    needs = pd.concat([needs_of(0.2).assign(vehicle_id=car, reasons="time is unknown") for car in ("a", "b")])
    needs.iloc[1, needs.columns.get_loc("reasons")] += "; the car model is new"
    assert report(night=night_of(needs)).notes == [
        "time is unknown (departures: 2 of 2)",
        "b: the car model is new (departures: 1 of 2)",
    ]


def test_the_first_page_has_five_sentences_and_what_is_gained():
    made = report()
    assert len(made.sentences) == 5
    assert made.sentences[0].startswith(
        "In all, 80 vehicles drove 160,000 km on 8,000 trips and took 36,000 kWh, 12.5"
    )
    assert "more than expected" in made.sentences[0]
    assert "12,000 € and 10,000 kg of CO₂" in made.sentences[0]
    assert made.sentences[1].startswith(
        "Vehicles that took more than expected: 80, for 1,336 € together, first <v0> (17 €, driving), <v1>"
    )
    assert (
        replace(made, vehicles=made.vehicles.assign(driving=-0.1, climate=-0.1)).sentences[1].count("chance)")
        == 5
    )
    months = made.vehicles[:1].assign(month="2025-02")
    assert (
        "kg of CO₂; in 2025-02, 150 € and 125 kg for 2,000 km." in replace(made, months=months).sentences[0]
    )
    batteries = pd.DataFrame({"vehicle_id": ["a", "b", "c"], "month": ["2031-02", None, "2029-01"]})
    assert (
        "within ten years: c in 2029-01 and a in 2031-02." in replace(made, batteries=batteries).sentences[3]
    )
    less = replace(made, vehicles=made.vehicles.assign(energy_wh=3.6e5, gain=-10.0))
    assert "less than expected" in less.sentences[0]
    assert "expected: 0, for 0 € together, first none" in less.sentences[1]


def planted():
    """Rows of 40 vehicles of two car models, of which one takes a fifth more than it simulates, and the posterior."""
    rows = year_of_rows(61, vehicles=40)
    table = rows.table.to_pandas()
    table.loc[table["vehicle_id"] == "v03", "observed_wh"] *= 1.2
    rows = TripRows.join([pa.Table.from_pandas(table, schema=ROWS)])
    return table, rows, group_posterior(rows.sums, fit_scales(rows.sums, START))


def test_energy_cost_and_gain_are_those_that_were_planted():
    table, rows, posterior = planted()
    asked = ReportSettings(price=0.4, co2_g=100.0, groups={"v03": "north", "v04": "north"})
    made = totals(posterior, rows, asked)
    wh = table["observed_wh"].sum()
    for name in ("vehicles", "months"):
        assert made[name]["energy_wh"].sum() == pytest.approx(wh)
        assert made[name]["distance_m"].sum() == pytest.approx(table["distance_m"].sum())
        assert made[name]["cost"].sum() == pytest.approx(0.4 * wh / 900.0)
        assert made[name]["co2_kg"].sum() == pytest.approx(0.1 * wh / 900.0)
        per_km = 1000.0 * made[name]["cost"] / made[name]["distance_m"]
        assert made[name]["cost_per_km"].to_numpy() == pytest.approx(per_km.to_numpy())
    own = table[table["vehicle_id"] == "v03"]
    first = made["vehicles"].iloc[0]
    assert first["vehicle_id"] == "v03"
    assert first["excess"] > 0.1
    assert made["vehicles"]["gain"].is_monotonic_decreasing
    # the others of the car model take what is expected, within what the one vehicle adds to its car model
    assert made["vehicles"]["expected_wh"].sum() == pytest.approx(table["observed_wh"].sum(), rel=0.01)
    assert first["gain"] == pytest.approx(0.4 * (own["observed_wh"].sum() - first["expected_wh"]) / 900.0)
    groups = made["groups"].set_index("name")
    assert groups.loc["north", "trips"] == 280
    assert set(groups["by"]) == {"car model", "group"}
    assert list(made["months"]["month"]) == sorted(made["months"]["month"])
    undated = table.assign(started_at=table["started_at"].where(table["vehicle_id"] != "v03"))
    made = totals(posterior, TripRows.join([pa.Table.from_pandas(undated, schema=ROWS)]), asked)
    assert made["vehicles"]["energy_wh"].sum() == pytest.approx(wh)
    assert made["months"]["energy_wh"].sum() == pytest.approx(wh - own["observed_wh"].sum())


def test_drivers_are_in_the_order_of_names_with_the_chance_of_no_difference():
    table, _, _ = planted()
    table["driver"] = [("zoe", "anna")[k % 2] for k in range(len(table))]
    careful = table["driver"] == "anna"
    table.loc[careful, "observed_wh"] *= 0.9
    rows = TripRows.join([pa.Table.from_pandas(table, schema=ROWS)])
    drivers = drivers_by_name(group_posterior(rows.sums, fit_scales(rows.sums, START)), rows)
    assert list(drivers["driver"]) == sorted(drivers["driver"])
    assert (drivers["none"] <= 0.5).all()
    assert drivers["none"].median() < 0.05
    dear = drivers.groupby("driver")["cost"].sum()
    assert dear["zoe"] - dear["anna"] == pytest.approx(
        0.05 * 0.3 / 900.0 * rows.numbers("observed_wh").sum(), rel=0.3
    )
    halves = drivers.groupby("driver")[["earlier", "later"]].mean()
    assert (halves.loc["anna"] < halves.loc["zoe"] - 0.05).all()


def test_groups_are_read_from_a_table_and_a_missing_column_is_named(tmp_path):
    file = tmp_path / "groups.csv"
    file.write_text("vehicle_id,group\nv1,north\n", "utf-8")
    assert read_by_vehicle(file, "group") == {"v1": "north"}
    file.write_text("vehicle_id,depot\nv1,north\n", "utf-8")
    with pytest.raises(InvalidInput, match=r"missing column: .*vehicle_id, depot; allowed: a column group"):
        read_by_vehicle(file, "group")
    file.write_text("vehicle_id,group\nv1,north\nv1,south\n", "utf-8")
    with pytest.raises(InvalidInput, match=r"several rows: .*: got v1"):
        read_by_vehicle(file, "group")
