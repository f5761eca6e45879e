"""`need` and `range` on the command line: the numbers of Python, usual trips, faults."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from tests.support.command import Run

import tripwatt as tw
from tripwatt.roads.journey import need, range_km
from tripwatt.server.cars.folder import create_car
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet

COLD = tw.Departure(ambient_temperature_degc=-5.0)


def test_need_has_the_numbers_of_python(run: Run) -> None:
    printed = run("need", "50", "km", "--ambient", -5, "--kind", "country", "--probability", 0.95, "--json")
    expected = need(50, "country", COLD, probability=0.95).to_dict()
    printed_need = json.loads(printed.out)
    assert {name: printed_need[name] for name in expected} == expected
    same = run("need", "50km", "--ambient", -5, "--kind", "country", "--probability", 0.95, "--json")
    assert same.out == printed.out


def test_the_reserve_is_part_of_the_charge_and_few_notes_follow(run: Run) -> None:
    asked = ("need", "60", "--ambient", -5, "--soc", 0.8)
    kept = json.loads(run(*asked, "--reserve", 0.1, "--json").out)
    without = json.loads(run(*asked, "--reserve", 0, "--json").out)
    assert kept["soc_needed"] == pytest.approx(without["soc_needed"] + 0.1)
    assert kept["reserve"] == 0.1
    printed = run(*asked, "--reserve", 0.1)
    assert kept["message"] in printed.out
    assert "arrive with 10 % left" in kept["message"]
    assert "soc_assumed" not in [flag["code"] for flag in kept["flags"]]
    few = printed.err.count("note:") + printed.err.count("warning:")
    assert 1 < few < len(kept["flags"])
    assert f"{len(kept['flags']) - few + 1} more" in printed.err
    assert "Range from 80 % down to 10 %" in run("range", "--soc", 0.8, "--reserve", 0.1).out


@pytest.mark.parametrize("soc", [0.05, 0.1])
def test_a_charge_that_is_not_above_the_reserve_is_one_sentence(run: Run, soc: float) -> None:
    asked = ("range", "--soc", soc, "--reserve", 0.1)
    printed = run(*asked)
    assert (printed.code, printed.err) == (0, "")
    percent = f"{100 * soc:g}"
    assert printed.out == f"No range is left: the charge of {percent} % is not above the reserve of 10 %.\n"
    answer = json.loads(run(*asked, "--json").out)
    assert {kind["range_m"] for kind in answer["by_kind"]} == {0.0}
    assert (answer["doubt"]["narrows"], answer["doubt"]["narrower"]) == (None, 0.0)
    assert "Range from 11 % down to 10 %" in run("range", "--soc", 0.11, "--reserve", 0.1).out


def test_range_has_the_numbers_of_python(run: Run) -> None:
    printed = run("range", "--soc", 0.35, "--ambient", -5, "--reserve", 0.1, "--car", "vw_id3", "--json")
    same = range_km(0.35, departure=COLD, reserve=0.1, car="vw_id3")
    assert json.loads(printed.out) == same.to_dict()


def test_tables_have_units_and_every_kind_of_road(run: Run) -> None:
    table = run("need", "20", "--ambient", 10).out
    assert "20.0 km, mixed" in table
    assert "2 trips of 10.0 km, mixed" in run("need", "10", "--trips", 2).out
    assert re.search(r"likely +\d+\.\d\d kWh", table)
    assert re.search(r"middle half +\d+\.\d\d to \d+\.\d\d kWh", table)
    assert "cautious (95 %)" in table
    charges = [line for line in table.splitlines() if "%" in line and not re.match(" cautious|Shares", line)]
    assert re.fullmatch(r"\d+ % is enough to arrive with 10 % left in 19 of 20 trips\.", "\n".join(charges))
    assert "Shares of the uncertainty, mixed: car " in table
    far = run("range", "--soc", 0.5, "--ambient", 10, "--kind", "motorway").out
    assert "Shares of the uncertainty, motorway: car " in far
    assert all(kind in far for kind in ("city", "country", "motorway", "mixed"))
    assert ("--kind" in table, "--kind" in far) == (True, False)  # a range already has every kind


def test_a_usual_trip_of_my_car(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")
    car, logs = create_car(tmp_path / "car", VEHICLE), synthetic_fleet(2).logs
    car.add(logs)
    name = logs[0].trip_id
    printed = run("need", "--car", car.folder, "--trip", name, "--ambient", -5, "--json")
    found = json.loads(printed.out)
    expected = need(car.usual_plan(name), departure=COLD, model=car.model()).to_dict()
    assert {name: found[name] for name in expected} == {**expected, "car": car.folder.name}
    assert found["usual_trip"] == name
    assert (found["kind"], found["distance_m"]) == ("trip", pytest.approx(logs[0].distance_m, rel=0.01))
    refused = run("need", "--car", car.folder, "--trip", "moon")
    assert refused.code != 0
    assert "no such trip" in refused.err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("50", "--trip", "x"), "both"),
        ((), "neither"),
        (("--trip", "x"), "a trip without its own car"),
        (("fifty",), "not a distance"),
        (("50", "--kind", "moon"), "unknown kind of road"),
        (("50", "--car", "moon"), "moon"),
        (("50", "--plug", "3.7", "--soc", "0.2"), "the value is in watts: --plug 3700"),
    ],
)
def test_what_cannot_be_asked_is_refused(run: Run, arguments: tuple[str, ...], told: str) -> None:
    printed = run("need", *arguments)
    assert printed.code != 0
    assert told in printed.err
    assert not printed.out
