"""What the planned trips of a fleet need: by vehicle and hour, by route and car model, and as chargers read it."""

import datetime as dt
import json
import math

import numpy as np
import pandas as pd
import pytest
from tests.fleet.rows import table_rows, year_of_rows

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.fleet.charging import EFFICIENCY, Depot, Night, emhass, evcc
from tripwatt.fleet.nights import Cold, coldest_week, needs_by_car, needs_by_hour, read_planned
from tripwatt.roads.journey import need

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

ZONE = dt.timezone(dt.timedelta(hours=1))
EVENING = dt.datetime(2026, 1, 11, 18, tzinfo=ZONE)
NIGHT = """vehicle_id,trip,departs_at,distance_km,kind,ambient_temperature_degc,soc
V00000,north,2026-01-12T07:10+01:00,20,country,-5,0.15
V00000,north,2026-01-12T07:50+01:00,20,country,-5,0.15
V00000,south,2026-01-12T14:00+01:00,60,motorway,-5,0.15
V00001,south,2026-01-12T08:00+01:00,60,motorway,-5,0.95
V00002,north,2026-01-12T09:00+01:00,20,country,-5,
"""


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    file = tmp_path_factory.mktemp("night") / "night.csv"
    file.write_text(NIGHT)
    return read_planned(file)


@pytest.fixture(scope="module")
def needs(fleet, planned):
    return needs_by_hour(fleet[2], planned, reserve=0.0)


def faults_of(call, *arguments, **more):
    with pytest.raises(InvalidInput) as caught:
        call(*arguments, **more)
    return [(fault.what, fault.where) for fault in caught.value.faults]


def test_a_need_is_the_quantile_of_the_vehicle_s_own_model(fleet, needs):
    own = fleet[2].of_vehicle("V00001", ambient_degc=-5.0)
    alone = need(60.0, "motorway", tw.Departure(ambient_temperature_degc=-5.0), model=own, probability=0.95)
    row = needs.set_index("vehicle_id").loc["V00001"]
    assert row["energy_wh"] == pytest.approx(alone.energy_wh, rel=0.02)
    assert row["energy_quantile_wh"] == pytest.approx(alone.energy_quantile_wh, rel=0.02)
    assert row["car_model"] == own.vehicle.name
    assert row["arrives_at"] > row["departs_at"] + dt.timedelta(minutes=20)


def test_trips_of_one_hour_are_one_row_and_the_hours_add_up(needs):
    first, later = needs[needs["vehicle_id"] == "V00000"].to_dict("records")
    assert (first["trips"], later["trips"]) == (2, 1)
    assert first["distance_m"] == pytest.approx(40_000.0, rel=1e-4)
    assert first["departs_at"] == dt.datetime(2026, 1, 12, 7, 10, tzinfo=ZONE)
    assert first["arrives_at"] > dt.datetime(2026, 1, 12, 8, 0, tzinfo=ZONE)
    assert first["soc_needed"] > later["soc_needed"] > 0.0
    alone = first["energy_quantile_wh"] / first["wh_per_soc"]
    assert first["charge_wh"] == pytest.approx((alone - 0.15) * first["wh_per_soc"])
    assert later["charge_wh"] == pytest.approx((first["soc_needed"] - alone) * later["wh_per_soc"])
    assert alone < first["soc_needed"] < alone + later["soc_needed"], "single trips err on their own"
    assert (needs["energy_quantile_wh"] > needs["energy_wh"]).all()


def test_what_is_in_the_battery_needs_no_charging_and_an_unknown_charge_is_not_guessed(needs):
    by_vehicle = needs.set_index("vehicle_id")
    assert by_vehicle.loc["V00001", "charge_wh"] == 0.0
    assert math.isnan(by_vehicle.loc["V00002", "charge_wh"])


def test_more_certainty_and_a_reserve_need_more(fleet, planned, needs):
    surer = needs_by_hour(fleet[2], planned, probability=0.99, reserve=0.1)
    assert (surer["energy_quantile_wh"] > needs["energy_quantile_wh"]).all()
    assert (surer["soc_needed"] > needs["soc_needed"] + 0.1).all()
    assert surer["energy_wh"].to_numpy() == pytest.approx(needs["energy_wh"].to_numpy())


def test_a_trip_of_links_is_forecast_on_its_road(fleet, tmp_path):
    rows = [("V00000", "r", "2026-01-12T07:00+01:00", 1500.0, v, 4.0) for v in (12.0, 20.0, 15.0)]
    names = ["vehicle_id", "trip", "departs_at", "length_m", "speed_m_s", "ambient_temperature_degc"]
    pd.DataFrame(rows, columns=names).to_parquet(tmp_path / "links.parquet")
    (trip,) = read_planned(tmp_path / "links.parquet")
    table = needs_by_hour(fleet[2], [trip])
    road = tw.read_route([{"length_m": 1500.0, "speed_m_s": v} for v in (12.0, 20.0, 15.0)])
    own = fleet[2].forecast(road, tw.Departure(ambient_temperature_degc=4.0), vehicle_id="V00000")
    (row,) = needs_by_car(fleet[2], [trip], -20.0, probability=0.9, reserve=0.1).to_dict("records")
    for name in sorted(set(fleet[2].vehicles().values())):
        new = fleet[2].of_vehicle(None, car_model=name, ambient_degc=-5.0)
        charge = new.forecast(road, tw.Departure(ambient_temperature_degc=-20.0)).along.soc(0.9)
        assert row[name] == pytest.approx(0.1 + charge[0] - charge[-1], rel=1e-6)
    assert table["energy_quantile_wh"].item() == pytest.approx(own.quantile(0.95))
    assert table["distance_m"].item() == pytest.approx(4500.0, abs=1.0)


def test_every_trip_that_cannot_be_forecast_is_named(fleet, tmp_path):
    file = tmp_path / "night.csv"
    file.write_text(NIGHT.replace("V00001", "nobody").replace("V00002", "no one"))
    assert faults_of(needs_by_hour, fleet[2], read_planned(file)) == [
        ("unknown vehicle", "trip south of nobody: vehicle_id"),
        ("unknown vehicle", "trip north of no one: vehicle_id"),
    ]
    file.write_text(NIGHT.replace("07:10", "7h10"))
    assert faults_of(read_planned, file) == [("not a time", "trip north of V00000: departs_at")]
    file.write_text(NIGHT.replace(",60,", ",0,"))
    assert faults_of(read_planned, file)[0][1] == "trip south of V00000: distance_km"
    file.write_text(NIGHT.replace("07:10", "7h10").replace(",20,", ",0,").replace(",0.15", ",15"))
    assert faults_of(read_planned, file)[:3] == [
        (what, f"trip north of V00000: {name}")
        for what, name in (
            ("value out of range", "distance_km"),
            ("value out of range", "soc"),
            ("not a time", "departs_at"),
        )
    ]
    file.write_text(NIGHT.replace(",", ";").replace("0.15", "0,15").replace("07:10", "7h10"))
    comma = [("decimal comma", f"{file} row {row} column 'soc'") for row in (2, 3, 4)]
    assert faults_of(read_planned, file) == [*comma, ("not a time", "trip north of V00000: departs_at")]
    rows = "V1,a,,9\nV1,,2026-01-12T07:50,9\n,a,2026-01-12T07:50,9\n,,,\nV1,b,2026-01-12T07:50,9\n"
    file.write_text(f"vehicle_id,trip,departs_at,distance_km\n{rows}")
    assert faults_of(read_planned, file) == [
        ("empty cell", f"{file} row {row} column {name!r}")
        for row, name in ((2, "departs_at"), (3, "trip"), (4, "vehicle_id"))
    ]
    file.write_text(NIGHT + NIGHT.splitlines()[1].replace(",20,", ",90,"))
    assert faults_of(read_planned, file) == [("repeated trip", "trip north of V00000: rows")]
    file.write_text("trip,departs_at\nnorth,2026-01-12T07:30\n")
    assert [where for _, where in faults_of(read_planned, file)] == [f"{file}"] * 2
    assert faults_of(read_planned, tmp_path / "none.csv")[0][1] == f"{tmp_path / 'none.csv'}"


def loads(needs, at=EVENING, charger_w=7400.0, minutes=30):
    return emhass(Depot(at, charger_w).windows(needs), at, dt.timedelta(minutes=minutes))


def test_emhass_charges_between_the_trips(needs):
    load = loads(needs)
    assert load["vehicles"] == ["V00000", "V00000"]
    assert load["end_timesteps_of_each_deferrable_load"] == [26, 40]
    arrives = needs.loc[0, "arrives_at"]
    assert load["start_timesteps_of_each_deferrable_load"] == [
        0,
        math.ceil((arrives - EVENING).total_seconds() / 1800.0),
    ]
    hours = np.array(load["operating_hours_of_each_deferrable_load"])
    charge_wh = needs.loc[needs["vehicle_id"] == "V00000", "charge_wh"]
    power_w = np.array(load["nominal_power_of_deferrable_loads"])
    wanted = charge_wh.to_numpy() / (EFFICIENCY * power_w)
    assert (power_w == np.minimum(needs.loc[needs["vehicle_id"] == "V00000", "alternating_w"], 7400.0)).all()
    assert (hours % 0.5 == 0.0).all()
    assert ((hours >= wanted) & (hours < wanted + 0.5)).all()
    assert load["begins_at"] == "2026-01-11T18:00:00+01:00"
    assert load["prediction_horizon"] == 40
    assert faults_of(loads, needs, EVENING + dt.timedelta(hours=15)) == [
        ("departs before the charging begins", "V00000")
    ]


@pytest.mark.parametrize(
    ("charger_w", "power_w"), [(3700.0, 3700.0), (7400.0, 6600.0), (22e3, 6600.0), (150e3, 50e3)]
)
def test_a_load_has_the_smaller_power_of_charger_and_car(charger_w, power_w):
    """A car that takes 6.6 kW from a socket and 50 kW with direct current."""
    row = {"vehicle_id": "V1", "departs_at": EVENING + dt.timedelta(hours=9), "arrives_at": EVENING}
    table = pd.DataFrame([row | {"charge_wh": 9000.0, "alternating_w": 6600.0, "direct_w": 50e3}])
    load = loads(table, EVENING, charger_w, 1)
    assert load["nominal_power_of_deferrable_loads"] == [power_w]
    hours = 9000.0 / (EFFICIENCY * power_w)
    assert 0.0 <= load["operating_hours_of_each_deferrable_load"][0] - hours < 1.0 / 60.0


def test_the_powers_of_a_need_are_those_of_its_car(fleet, needs):
    for row in needs.to_dict("records"):
        charging = fleet[2].of_vehicle(row["vehicle_id"]).vehicle.charging
        if charging is not None:
            expected = charging.alternating_power_w, max(charging.power_w)
            assert (row["alternating_w"], row["direct_w"]) == expected
        assert 2000.0 < row["alternating_w"] <= 43_000.0
        assert row["direct_w"] > row["alternating_w"]


def test_a_load_of_emhass_by_hand():
    """A step is half an hour; the second load of V1 begins in the first whole step after its return."""
    hour = dt.timedelta(hours=1)
    rows = [
        ("V1", EVENING, EVENING + 1.2 * hour, 12_345.0),
        ("V1", EVENING + 5 * hour, EVENING + 6 * hour, 6660.0),
        ("V2", EVENING + 9 * hour, EVENING + 9.5 * hour, 0.0),
        ("V3", EVENING + 9 * hour, EVENING + 9.5 * hour, math.nan),
    ]
    table = pd.DataFrame(rows, columns=["vehicle_id", "departs_at", "arrives_at", "charge_wh"])
    table[["alternating_w", "direct_w"]] = 11_000.0, 50_000.0
    assert loads(table) == {
        "begins_at": "2026-01-11T18:00:00+01:00",
        "optimization_time_step": 30,
        "prediction_horizon": 10,
        "number_of_deferrable_loads": 2,
        "nominal_power_of_deferrable_loads": [7400.0, 7400.0],
        "operating_hours_of_each_deferrable_load": [2.0, 1.0],
        "start_timesteps_of_each_deferrable_load": [0, 3],
        "end_timesteps_of_each_deferrable_load": [0, 10],
        "vehicles": ["V1", "V1"],
    }
    hourly = loads(table[1:], EVENING + hour, minutes=60)
    assert hourly["start_timesteps_of_each_deferrable_load"] == [0]
    assert hourly["end_timesteps_of_each_deferrable_load"] == [4]
    nothing = loads(table[2:])
    assert (nothing["prediction_horizon"], nothing["vehicles"]) == (1, [])
    late = EVENING + dt.timedelta(seconds=1)
    assert faults_of(loads, table, late) == [("departs before the charging begins", "V1")]


def test_evcc_rounds_up_to_a_percent_and_at_most_to_a_full_battery():
    needed = {"A b": 0.56, "B": 0.5601, "C": 1.3, "D/E": 0.001}
    rows = [(name, EVENING, soc) for name, soc in needed.items()]
    plans = evcc(pd.DataFrame(rows, columns=["vehicle_id", "departs_at", "soc_needed"]))
    assert [plan.split("/")[3] for plan in plans] == ["A%20b", "B", "C", "D%2FE"]
    assert [plan.split("/")[6] for plan in plans] == ["56", "57", "100", "1"]


def test_evcc_has_a_plan_for_the_first_departure_of_each_vehicle(needs):
    plans = evcc(needs)
    assert len(plans) == 3
    whole = min(math.ceil(100.0 * needs.loc[0, "soc_needed"]), 100)
    assert plans[0] == f"/api/vehicles/V00000/plan/soc/{whole}/2026-01-12T06:10:00Z"


def test_the_document_is_json_with_null_for_what_is_not_known(needs):
    document = Night(needs, Depot(EVENING, 7400.0)).document
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    unknown = document["needs"][-1]
    assert (unknown["vehicle_id"], unknown["soc"], unknown["charge_wh"]) == ("V00002", None, None)
    assert dt.datetime.fromisoformat(unknown["departs_at"]) == dt.datetime(2026, 1, 12, 9, tzinfo=ZONE)


def test_a_colder_week_needs_more_and_a_longer_route_more_of_a_smaller_battery(fleet, planned):
    cold, mild = (needs_by_car(fleet[2], planned, degc).set_index("trip") for degc in (-10.0, 15.0))
    assert list(cold.index) == ["north", "south"]
    assert set(cold) == set(fleet[2].vehicles().values())
    assert (cold > mild).all().all()
    kept = needs_by_car(fleet[2], planned, -10.0, reserve=0.2).set_index("trip")
    assert (kept - cold).to_numpy() == pytest.approx(0.1)
    assert (cold.loc["south"] > cold.loc["north"]).all()


def test_the_coldest_week_is_a_mean_of_its_trips():
    rows = year_of_rows(5, vehicles=4, trips=60)
    frame = rows.table.to_pandas()
    week = pd.to_datetime(frame["started_at"]).dt.to_period("W-SUN").dt.start_time.dt.date
    means = frame.groupby(week)["ambient_temperature_degc"].agg(["mean", "size"])
    most = means["size"].max()
    means = means[means["size"] >= min(10, most)]
    cold = coldest_week(rows)
    assert (cold.monday, cold.ambient_temperature_degc) == (
        f"{means['mean'].idxmin()}",
        pytest.approx(means["mean"].min()),
    )
    assert coldest_week(rows.where(np.zeros(len(rows), dtype=bool))) is None


def test_the_coldest_week_has_at_least_ten_trips_where_any_has():
    """A Monday to Sunday of ten trips, a colder one of nine, a warmer one of eleven."""
    temperatures = {"2025-01-12": [-2.0] * 5, "2025-01-06": [-4.0] * 5, "2025-01-13": [-9.0] * 9, "2025-01-20": [1.0] * 11}  # fmt: skip
    days = [day for day, degc in temperatures.items() for _ in degc]
    degc = np.concatenate([*temperatures.values()])
    rows = year_of_rows(5, vehicles=1, trips=len(days))
    frame = rows.table.to_pandas().assign(started_at=[f"{day}T08:00:00" for day in days])
    few = table_rows(frame.assign(ambient_temperature_degc=degc))
    cold = Cold(-3.0, "2025-01-06", 10, [("2025-01-13", -9.0, 9)])
    assert coldest_week(few) == (pytest.approx(-3.0), *cold[1:])
    nine = few.where(few.texts("started_at") == "2025-01-13T08:00:00")
    assert coldest_week(nine) == Cold(-9.0, "2025-01-13", 9, [])


def test_what_a_trip_does_not_give_is_named(fleet, tmp_path):
    file = tmp_path / "night.csv"
    file.write_text(
        "vehicle_id,trip,departs_at,distance_km,ambient_temperature_degc\n"
        "V00000,a,2026-01-12T07:30+01:00,30,-5\nV00001,b,2026-01-12T07:30+01:00,30,\n"
    )
    given, unknown = needs_by_hour(fleet[2], read_planned(file)).to_dict("records")
    assert "ambient_temperature_degc" not in given["assumed"]
    assert unknown["assumed"].startswith("ambient_temperature_degc, ")
    assert "outside temperature is unknown: " in unknown["reasons"]
    assert "state of charge" not in unknown["reasons"]
    for trip in read_planned(file, -9.0):
        assert trip.departure.ambient_temperature_degc == {"a": -5.0, "b": -9.0}[trip.name]
    file.write_text("vehicle_id,trip,departs_at,distance_km\nV00001,b,2026-01-12T07:30+01:00,30\n")
    (cold,) = needs_by_hour(fleet[2], read_planned(file, -9.0)).to_dict("records")
    assert "ambient_temperature_degc" not in cold["assumed"]
    assert cold["energy_wh"] > unknown["energy_wh"]


def test_the_limits_of_a_forecast_are_told(fleet, tmp_path):
    """The model of a fleet has no error of planned links: its interval is too narrow on them."""
    file = tmp_path / "links.csv"
    file.write_text(
        "vehicle_id,trip,departs_at,length_m,speed_m_s\nV00001,b,2026-01-12T07:30+01:00,5000,15\n"
    )
    (row,) = needs_by_hour(fleet[2], read_planned(file)).to_dict("records")
    assert (
        "the error of planned routes was not measured for this model: the interval is too narrow"
        in row["reasons"]
    )


def test_an_unknown_column_is_refused_with_the_one_that_is_meant(tmp_path):
    file = tmp_path / "night.csv"
    file.write_text(
        NIGHT.replace("ambient_temperature_degc", "ambient_temperature").replace("kind", "sort of road")
    )
    with pytest.raises(InvalidInput) as caught:
        read_planned(file)
    kind, ambient = caught.value.faults
    assert (kind.what, kind.got) == ("unknown column", "'sort of road'")
    assert ambient.fix == "did you mean 'ambient_temperature_degc'?"


def test_a_trip_that_cannot_be_forecast_leaves_the_others(fleet, planned, needs, tmp_path):
    file = tmp_path / "night.csv"
    file.write_text(NIGHT.replace("V00001", "nobody"))
    refused = []
    left = needs_by_hour(fleet[2], read_planned(file), reserve=0.0, refused=refused)
    assert [fault.where for fault in refused] == ["trip south of nobody: vehicle_id"]
    pd.testing.assert_frame_equal(left, needs[needs["vehicle_id"] != "V00001"].reset_index(drop=True))
    nobody = [trip for trip in read_planned(file) if trip.vehicle_id == "nobody"]
    nothing = needs_by_hour(fleet[2], nobody, refused=refused)
    assert (len(nothing), list(nothing), len(refused)) == (0, list(needs), 2)
    assert Night(nothing, Depot(EVENING, 7400.0)).document["evcc"] == []


def test_a_trip_before_its_vehicle_is_back_is_left_out(fleet, planned, tmp_path):
    """40 km from 07:00 on: 07:10 is too early, also for a repeated trip; a refused trip keeps no later one from driving."""
    file, header = tmp_path / "night.csv", NIGHT.splitlines()[0]
    rows = [("b", "07:10", 90), ("a", "07:00", 40), ("c", "08:15", 20), ("d", "08:15", 20)]
    lines = [f"V00000,{trip},2026-01-12T{at}+01:00,{km},country,-5,0.5" for trip, at, km in rows]
    file.write_text("\n".join([header, *lines, ""]))
    refused = []
    left = needs_by_hour(fleet[2], read_planned(file), refused=refused)
    late = [(fault.what, fault.where) for fault in refused]
    assert late == [("the vehicle is not back", f"trip {trip} of V00000: departs_at") for trip in "bd"]
    assert left["trips"].tolist() == [1, 1]
    assert left["distance_m"].tolist() == pytest.approx([40e3, 20e3], rel=1e-4)
    none = []
    needs_by_hour(fleet[2], planned, refused=none)
    assert none == []
