"""Which vehicle serves which route over a year of weather, and how many chargers the routes need."""

import datetime as dt
import itertools
import json
import math
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import linprog
from tests.fleet.depots import AT, UNIT_WH, needs_of
from tests.fleet.store.test_store import drive
from typer.testing import CliRunner

import tripwatt as tw
from tripwatt.command import app
from tripwatt.errors import InvalidInput
from tripwatt.fleet.charging import STEP, Depot
from tripwatt.fleet.choice import (
    NIGHTS,
    POWERS_W,
    Candidate,
    Climate,
    _chances,
    _day,
    assign,
    chargers,
    choices,
    choose,
    fleet_candidates,
    least_chargers,
    library_candidates,
    read_routes,
)
from tripwatt.population import for_car
from tripwatt.trips import Context, Log
from tripwatt.vehicles.catalogue import catalogue

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

TEMPERATE = Climate(6.0 - 8.0 * np.cos(2.0 * np.pi * np.arange(12) / 12.0), np.full(12, 4.0))
PLANNED = """vehicle_id,trip,departs_at,distance_km,kind
V00000,long,2026-01-12T07:10+01:00,170,country
V00000,long,2026-01-12T13:10+01:00,80,city
V00001,short,2026-01-13T08:00+01:00,30,motorway
"""


@pytest.fixture(scope="module")
def routes(tmp_path_factory):
    file = tmp_path_factory.mktemp("routes") / "routes.csv"
    file.write_text(PLANNED)
    return read_routes(file)


def batteries(*amp_hours):
    cars = (tw.load_vehicle("vw_id3", overrides={"battery.capacity_ah": ah}) for ah in amp_hours)
    return [Candidate(f"{ah}", for_car(None, car)) for ah, car in zip(amp_hours, cars, strict=True)]


def test_more_battery_never_lowers_a_chance_and_colder_weather_never_raises_it(routes):
    candidates = batteries(120.0, 140.0, 170.0, 220.0)
    colder = TEMPERATE._replace(mean_degc=TEMPERATE.mean_degc - 6.0)
    mild, cold = (choices(routes, candidates, air) for air in (TEMPERATE, colder))
    for name in ("chance", "worst_chance"):
        by_battery = mild[name].to_numpy().reshape(2, 4)
        assert (np.diff(by_battery, axis=1) >= -1e-12).all()
        assert (cold[name] <= mild[name] + 1e-12).all()
    assert (cold["soc_needed"] > mild["soc_needed"]).all()
    assert mild["chance"].min() < 0.9 < mild["chance"].max(), "the law is tried where a chance is between"
    assert (mild["worst_chance"] <= mild["chance"]).all()
    assert mild["worst_month"].tolist() == [1] * 8
    assert not mild["is_assigned"].any()


def test_a_year_of_one_temperature_is_the_forecast_at_it(routes):
    (candidate,) = batteries(170.0)
    table = choices(
        routes, [candidate], Climate(np.full(12, -7.0), np.zeros(12)), probability=0.9, reserve=0.2
    )
    (trip,) = routes["short"][0]
    forecast = trip.in_air(-7.0).forecast(candidate.model)
    row = table.set_index("route").loc["short"]
    soc = forecast.along.soc(0.9)
    assert row["soc_needed"] == pytest.approx(0.2 + soc[0] - soc[-1], rel=0.01)
    assert row["energy_wh"] == pytest.approx(250.0 * forecast.energy_wh, rel=1e-3)
    assert row["cost"] == pytest.approx(0.3 * row["energy_wh"] / 900.0)


def test_the_smallest_battery_is_the_first_that_serves_in_the_worst_month(routes):
    table = choices(routes, batteries(150.0, 400.0, 200.0), TEMPERATE, probability=0.95)
    for _, rows in table.groupby("route"):
        serve = rows["worst_chance"] >= 0.95
        assert ((rows["soc_needed"] <= 1.0) == serve).all(), "the charge and the chance agree"
        smallest = rows[serve].sort_values("battery_wh")["car_model"].head(1).tolist()
        assert rows["smallest"].dropna().unique().tolist() == smallest


def test_a_chance_is_that_of_drawn_days():
    rng = np.random.default_rng(61)
    soc = rng.uniform(0.5, 0.9, (3, 12, 5)) - 0.1 * np.cos(np.arange(12) / 6.0 * np.pi)[:, None]
    stated = _chances(soc, np.full(soc.shape, 0.08), 0.1, 0.95)
    drawn = soc + 0.08 * rng.standard_normal((40_000, *soc.shape))
    enough = (drawn <= 0.9).mean(axis=(0, 1, 3))
    assert stated["chance"] == pytest.approx(enough.mean(), abs=0.002)
    assert stated["worst_month"] == 1 + int(np.argmin(enough))
    worst = drawn[:, :, stated["worst_month"] - 1]
    assert (worst <= stated["soc_needed"] - 0.1).mean() == pytest.approx(0.95, abs=0.002)


def test_a_vehicle_of_the_fleet_takes_what_its_own_model_forecasts(fleet, routes):
    model, (trip,) = fleet[2], routes["short"][0]
    candidate = next(iter(fleet_candidates(model)))
    known_trip = trip.in_air(-5.0)
    own = known_trip.forecast(model.of_vehicle(candidate.name))
    usual = known_trip.forecast(candidate.model)
    energy_wh, soc, sd = candidate.amounts(_day(candidate.model, [trip], np.array([-5.0]), 0.95)[None])[
        :, 0, 0
    ]
    assert abs(own.energy_wh / usual.energy_wh - 1.0) > 0.01, "the vehicle differs from its car model"
    assert energy_wh == pytest.approx(own.quantile(0.5), rel=0.002)
    charge = own.along.soc(0.5), own.along.soc(0.95)
    assert soc == pytest.approx(charge[0][0] - charge[0][-1], rel=0.005)
    assert sd == pytest.approx((charge[0][-1] - charge[1][-1]) / 1.645, rel=0.05)


def test_an_assignment_is_the_best_of_all():
    rng = np.random.default_rng(7)
    for _ in range(200):
        shape = tuple(rng.integers(1, 5, 2).tolist())
        chance, cost = rng.integers(0, 6, shape) / 5.0, rng.uniform(1.0, 9.0, shape)
        pairs = list(zip(*assign(chance, cost), strict=True))
        n = min(shape)
        every = [
            list(zip(rows, columns, strict=True))
            for rows in itertools.combinations(range(shape[0]), n)
            for columns in itertools.permutations(range(shape[1]), n)
        ]

        def worth(chosen, chance=chance, cost=cost):
            return min(chance[pair] for pair in chosen), -sum(cost[pair] for pair in chosen)

        assert len(pairs) == n
        assert worth(pairs) == pytest.approx(max(map(worth, every)))


def test_the_number_of_chargers_is_the_smallest_with_which_all_are_charged():
    """Vehicles that may be swapped need the sum of their times on a charger over the night, rounded up (McNaughton 1959)."""
    rng = np.random.default_rng(3)
    for _ in range(12):
        quarters, power = int(rng.integers(4, 12)), rng.choice([4.0, 11.0], 6)
        times = rng.integers(0, quarters + 1, 6)
        rows = [
            (k, quarters, quarters, min(w, 8.0) * n, 0, 900, w)
            for k, (w, n) in enumerate(zip(power, times, strict=True))
        ]
        stated = least_chargers(needs_of(rows), Depot(AT, 8000.0))
        assert (stated["chargers"], stated["fails"]) == (math.ceil(times.sum() / quarters), "")
        assert stated["peak_w"] <= np.sort(np.minimum(power, 8.0))[-stated["chargers"] :].sum() * 1e3 + 1e-3
    short = needs_of([(0, 4, 4, 8.0 * 5, 0, 900, 11.0), (1, 4, 4, 8.0, 0, 900, 11.0)])
    stated = least_chargers(short, Depot(AT, 8000.0))
    assert (stated["chargers"], stated["fails"]) == (2, "V0")
    assert pytest.approx(STEP.total_seconds() / 3600.0 * 900.0) == UNIT_WH


def test_fewest_chargers_under_a_limit_are_those_of_a_program_for_each_number():
    """The least missing energy with so many chargers, by a linear program of its own"""
    rng = np.random.default_rng(61)
    for _ in range(25):
        quarters, n = int(rng.integers(3, 9)), int(rng.integers(2, 6))
        power, leaves = rng.choice([3.0, 8.0, 11.0], n), rng.integers(1, quarters + 1, n)
        wanted = rng.uniform(0.0, 1.2, n) * power * leaves
        limit = float(rng.uniform(0.4, 1.0) * power.sum())
        rows = [(k, leaves[k], leaves[k], wanted[k], 0, 900, power[k]) for k in range(n)]
        stated = least_chargers(needs_of(rows), Depot(AT, 11e3, 1000.0 * limit))
        of, at = np.array([(k, t) for k in range(n) for t in range(leaves[k])]).T
        of, at = of == np.arange(n)[:, None], at == np.arange(quarters)[:, None]

        def charged(number, of=of, at=at, each=power @ of, wanted=wanted, limit=limit):
            bounds = [np.full(len(at), number), np.full(len(at), limit), wanted]
            A, b = np.concatenate([at, at * each, of * each]), np.concatenate(bounds)
            return -linprog(-each, A, b, bounds=(0.0, 1.0)).fun

        least = next(number for number in range(n + 1) if charged(number) > charged(n) - 1e-3)
        assert stated["chargers"] == least
        assert stated["peak_w"] <= 1000.0 * limit
        assert (stated["fails"] == "") == (charged(n) > wanted.sum() - 1.0 / UNIT_WH)


def test_more_power_and_milder_nights_never_need_more_chargers(fleet, routes):
    nights = {
        name: [[replace(trip, road=60.0) for trip in day] for day in days] for name, days in routes.items()
    }
    driven = [("long", "V00000", None), ("short", "V00001", None)]
    table = chargers(fleet[2], nights, driven, TEMPERATE)
    counts = table["chargers"].to_numpy().reshape(len(NIGHTS), len(POWERS_W))
    assert (np.diff(counts, axis=1) <= 0).all()
    assert (np.diff(counts, axis=0) >= 0).all()
    assert counts.min() == 1
    assert table["ambient_temperature_degc"].is_monotonic_decreasing
    assert chargers(fleet[2], routes, [], TEMPERATE).empty
    served = table[table["fails"] == ""]
    best = served.sort_values(["nights", "chargers", "charger_w"]).drop_duplicates("nights")
    assert table.index[table["is_smallest"]].tolist() == best.index.tolist() != []
    assert (table["peak_w"] <= table["chargers"] * table["charger_w"] + 1e-3).all()
    assert served["p_enough"].between(0.85, 0.97).all(), "each of two vehicles has enough with 95 %"
    limited = chargers(fleet[2], nights, driven, TEMPERATE, grid_w=200.0)
    assert limited["peak_w"].max() <= 200.0
    assert (limited["fails"] != "").all()
    assert not limited["is_smallest"].any()
    assert (limited["p_enough"] < table["p_enough"]).all()


def test_new_vehicles_drive_the_routes_in_turn_beside_the_others(fleet, routes):
    """Their energy is that of their car on these routes; the vehicles that there are keep theirs, and chargers are counted for both."""
    nights = {
        name: [[replace(trip, road=40.0) for trip in day] for day in days] for name, days in routes.items()
    }
    library = [*library_candidates(["vw_id3"])]
    alone = choose(fleet[2], nights, [], TEMPERATE, days=100.0)
    more = choose(fleet[2], nights, library, TEMPERATE, new={"vw_id3": 3.0, "renault_r5_52": 1}, days=100.0)
    kept = [row for row in more["choices"] if row["car"].startswith("V0")]
    of_fleet = ("chance", "soc_needed", "energy_wh", "is_assigned")
    assert [[r[n] for n in of_fleet] for r in kept] == [[r[n] for n in of_fleet] for r in alone["choices"]]
    energy = {(row["route"], row["car"]): row["energy_wh"] for row in more["choices"]}
    driven = [("long", "vw_id3"), ("short", "vw_id3"), ("long", "vw_id3"), ("short", "renault_r5_52")]
    assert more["new"]["vehicles"] == 4
    assert more["new"]["energy_wh"] == pytest.approx(
        sum(energy[route, f"new {car}"] for route, car in driven)
    )
    assert more["new"]["cost"] == pytest.approx(0.3 * more["new"]["energy_wh"] / 900.0)
    assert alone["new"] is None
    now, later = (more["chargers"][k * 16 : (k + 1) * 16] for k in (0, 1))
    assert now == alone["chargers"]
    assert {row["vehicles"] for row in now} == {2}
    assert {row["vehicles"] for row in later} == {6}
    assert all(a["chargers"] <= b["chargers"] for a, b in zip(now, later, strict=True))
    assert choose(None, nights, library, TEMPERATE)["chargers"] == []
    for new, where in (
        ({"nobody": 1}, "nobody"),
        ({"vw_id3": 0}, "new vw_id3"),
        ({"vw_id3": "x"}, "new vw_id3"),
    ):
        with pytest.raises(InvalidInput, match=where):
            choose(fleet[2], nights, [], TEMPERATE, new=new)


def test_recorded_days_of_a_combustion_vehicle_are_a_route(tmp_path):
    """Its logs have neither charge nor energy; tracks are read as well."""
    logs = []
    for day, trip in ((1, "a"), (1, "b"), (2, "c")):
        table = drive().samples[["time_s", "speed_m_s"]]
        started = dt.datetime(2024, 5, day, 8 + (trip == "b"))
        logs.append(Log.from_samples(trip, table, Context(started_at=started, car="old van")))
    store = tw.create_store(tmp_path / "s")
    store.add(logs, car_model="vw_id3")
    (days,) = read_routes(tmp_path / "s").values()
    assert [len(day) for day in days] == [2, 1]
    assert days[0][0].name == "old van"
    assert days[0][0].road.distance_m == pytest.approx(4800.0, rel=0.02)
    with pytest.raises(InvalidInput, match="no temperatures"):
        Climate.read(tmp_path / "s")
    tracks = tmp_path / "van 7"
    tracks.mkdir()
    point = '<trkpt lat="{:.5f}" lon="11.5"><ele>500</ele><time>2026-05-0{}T08:{:02d}:{:02d}Z</time></trkpt>'
    for day in (1, 2):
        points = "".join(point.format(48 + k / 3e3, day, k // 30, 2 * k % 60) for k in range(90))
        (tracks / f"{day}.gpx").write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>")
    driven = read_routes(tracks)
    assert [len(day) for day in driven["van 7"]] == [1, 1]
    van = list(library_candidates(["van", "vw_id3"]))
    assert {"vw_id_buzz", "vw_id3"} <= {candidate.name for candidate in van}
    assert choices(driven, van, TEMPERATE)["chance"].min() > 0.99
    (tmp_path / "empty").mkdir()
    with pytest.raises(InvalidInput):
        read_routes(tmp_path / "empty")


def test_the_days_of_a_route_that_are_forecast_are_spread_over_its_distances(tmp_path):
    rng = np.random.default_rng(5)
    km = rng.lognormal(3.5, 0.6, 300)
    rows = [("V", "r", dt.date(2026, 1, 1) + dt.timedelta(k), one) for k, one in enumerate(km)]
    table = pd.DataFrame(rows, columns=["vehicle_id", "trip", "departs_at", "distance_km"])
    table.to_csv(tmp_path / "days.csv", index=False)
    (days,) = read_routes(tmp_path / "days.csv").values()
    chosen = np.sort([trip.road for (trip,) in days])
    assert len(chosen) == 12
    share = np.searchsorted(np.sort(km), chosen) / len(km)
    assert share == pytest.approx((np.arange(12) + 0.5) / 12.0, abs=0.01)
    table[:5].to_csv(tmp_path / "few.csv", index=False)
    assert len(read_routes(tmp_path / "few.csv")["r"]) == 5


def test_months_are_of_a_table_or_of_the_trips_of_a_store(fleet, tmp_path):
    file = tmp_path / "climate.csv"
    months = pd.DataFrame({"month": np.arange(12, 0, -1), "mean_degc": np.arange(12.0), "sd_k": 2.0})
    months.to_csv(file, index=False)
    read = Climate.read(file)
    assert read.mean_degc.tolist() == list(np.arange(11.0, -1.0, -1.0))
    assert read.air_degc.std(axis=1) == pytest.approx(2.0, rel=0.1)
    for rows, got in ((slice(0, 10), "no month 1, 2"), ([*range(12), 0], "no month is missing")):
        months.iloc[rows].to_csv(file, index=False)
        with pytest.raises(InvalidInput, match=f"not the months of a year: .*: got {got};"):
            Climate.read(file)
    of_trips, trips = Climate.read(fleet[1].place), fleet[1].trips(columns=["started_at"])
    driven = pd.to_datetime(trips["started_at"]).dt.month.unique() - 1
    others = np.setdiff1d(np.arange(12), driven)
    assert of_trips.unknown == {int(k) + 1 for k in others}
    assert read.unknown == frozenset()
    assert of_trips.sd_k[others].mean() > 1.2 * of_trips.sd_k[driven].mean(), "what is unknown is a variance"


def test_the_command_chooses_vehicles_and_counts_chargers(fleet, tmp_path):
    from tripwatt.fleet.registry import Registry

    target, planned = Registry(tmp_path / "models"), tmp_path / "routes.csv"
    target.promote(target.add(fleet[2]))
    planned.write_text(PLANNED.replace(",80,", ",8,").replace(",170,", ",25,"))
    asked = [
        "fleet",
        "choose",
        f"{planned}",
        "--climate",
        f"{fleet[1].place}",
        "--registry",
        f"{target.folder}",
    ]
    out = tmp_path / "choices.csv"
    done = CliRunner().invoke(app, [*asked, "--car", "van", "--out", f"{out}", "--json"])
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert sum(row["is_assigned"] for row in answer["choices"]) == 2
    vans = sum(row["body"][0].value == "van" for row in catalogue().values() if "body" in row)
    assert len(answer["choices"]) == len(pd.read_csv(out)) == 2 * (len(fleet[2].vehicles()) + vans)
    assert {row["chargers"] for row in answer["chargers"]} <= {1, 2}
    shown = CliRunner().invoke(app, asked).stdout
    assert "Chargers for 2 vehicles" in shown
    assert re.search(r"\d %", shown)
    assert not re.search(r"\d%", shown)
    unknown = Climate.read(fleet[1].place).unknown
    assert all(row["has_trips"] == (row["worst_month"] not in unknown) for row in answer["choices"])
    assert ("(no trips)" in shown) == any(
        row["is_assigned"] and not row["has_trips"] for row in answer["choices"]
    )
    assert "In 95 % of the nights 1 of 3700 W are enough if vehicles take turns, with a peak of " in shown
    assert "Each vehicle then has enough with 95 %, all of them with " in shown
    more = CliRunner().invoke(app, [*asked, "--new", "vw_id3=3", "--grid", "0.5"])
    assert more.exit_code == 0, more.output
    assert "3 new vehicles take " in more.stdout
    assert "Chargers for 5 vehicles" in more.stdout
    assert "short with a charger of its own: V0000" in more.stderr
    planned.write_text(PLANNED.replace("170", "900"))
    far = CliRunner().invoke(app, [*asked[:5], "--car", "vw_id3"])
    assert far.exit_code == 1
    assert "none" in far.stdout
    none = CliRunner().invoke(app, asked[:5])
    assert none.exception.faults[0].what == "no vehicles"
    without = CliRunner().invoke(app, [*asked[:5], "--car", "van", "--new", "van=3", "--grid", "3"])
    assert [fault.where for fault in without.exception.faults] == ["--new", "--grid"]
