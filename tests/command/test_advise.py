"""`advise` on the command line and `POST /v1/advice`: the numbers of Python."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest
from tests.support.command import Run

import tripwatt as tw
from tripwatt.command.forecast import WORDS, in_words
from tripwatt.roads.advice.actions import actions

LINKS = [{"length_m": 80_000.0, "speed_m_s": 33.0, "grade": 0.0}]
KNOWN = tw.Departure(soc=0.5, ambient_temperature_degc=-5.0, extras=("roof_box",))


@pytest.fixture
def route(tmp_path: Path) -> Path:
    path = tmp_path / "route.json"
    path.write_text(json.dumps(LINKS), "utf-8")
    return path


OPTIONS = ("--soc", 0.5, "--ambient", -5, "--extra", "roof_box", "--car", "vw_id3", "--chance", 0.9)


def test_advice_has_the_numbers_of_python(run: Run, route: Path) -> None:
    printed = run("advise", route, *OPTIONS, "--json")
    same = tw.advise(tw.read_route(route), KNOWN, "vw_id3", probability=0.9)
    assert json.loads(printed.out) == json.loads(json.dumps(same.to_dict()))


def test_the_table_has_units_and_words(run: Run, route: Path) -> None:
    shown = run("advise", route, *OPTIONS).out
    assert re.search(r"Leaving with 50 % you arrive with \d+ % \(\d+ to \d+ %\)\.\n", shown)
    assert "The probability to arrive with 10 % or more is " in shown
    assert "take off the roof box" in shown
    assert "saves kWh" in shown
    empty = run("advise", route, "--soc", 0.05, "--ambient", -5)
    assert (empty.code, "warning: the trip takes" in empty.err) == (
        0,
        True,
    )  # as the page of the command line says
    assert "more than is in the battery" in empty.err
    assert "Leaving with 5 % the battery is empty after " in empty.out
    assert "arrive with 0 %" not in empty.out
    assert "What saves energy" not in empty.out  # nothing helps on the way: no table without rows
    assert "fewer than 1 in 20 such trips there is not listed: give a higher --soc." in empty.out
    assert "faster overall if you charge below kW" in " ".join(shown.split())
    assert "km/h at most" in shown


def test_what_no_action_mends_is_charged_for_or_needs_a_stop(run: Run, tmp_path: Path) -> None:
    for length_m in (70_000.0, 180_000.0):
        path = tmp_path / "far.json"
        path.write_text(json.dumps([{"length_m": length_m, "speed_m_s": 25.0, "grade": 0.0}]), "utf-8")
        shown = run("advise", path, "--soc", 0.1, "--ambient", 5).out
        advice = tw.advise(tw.read_route(path), tw.Departure(soc=0.1, ambient_temperature_degc=5.0))
        charged = f"Charge to {math.ceil(100.0 * advice.charge_to)} %"
        assert (charged if length_m < 1e5 else "plan a stop to charge") in shown


def test_every_action_has_words() -> None:
    known = tw.Departure(
        ambient_temperature_degc=12.0, payload_mass_kg=200.0, extras=("roof_box", "winter_tyres")
    )
    cold = tw.Departure(ambient_temperature_degc=-5.0, tyre_pressure=0.8)
    made = [a for k in (known, cold) for a in actions(tw.forecast(tw.read_route(LINKS), k))]
    assert {action.code for action in made} == set(WORDS)
    assert all("{" not in in_words(action) for action in made)
