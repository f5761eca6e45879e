"""What commands print for people: a forecast in words from its own numbers, and progress without a terminal."""

import io
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from tests.roads.journey.made import A, journey
from tests.support.drives import example_trip

from tripwatt.command import printing
from tripwatt.command.sentences import (
    by_cause,
    chance_to_arrive,
    change,
    forecast_in_words,
    journey_in_words,
    unknown_climb_in_words,
)
from tripwatt.errors import percent
from tripwatt.forecasting import load_model
from tripwatt.routes.places import Place
from tripwatt.trips import Departure, Plan


def made(
    soc: tuple[float, float, float, float], energy_wh: float = 2120.0, time_s: float = 1440.0, **more: Any
) -> Any:
    """A forecast with these charges at departure and at arrival (expected, low, high)."""
    start, end, low, high = soc
    series = pd.DataFrame(
        {
            "time_s": [0.0, time_s],
            "distance_m": [0.0, 12_340.0],
            "displayed_soc": [start, end],
            "displayed_soc_low": [start, low],
            "displayed_soc_high": [start, high],
        }
    )
    plan = SimpleNamespace(departure=Departure(ambient_temperature_degc=-0.3))
    given = {
        "measured_until_s": 0.0,
        "p_arrive": lambda reserve=0.0: 1.0 if low > 0.0 else 0.42,
        "climb_to": lambda reserve=0.0: None,
        "plan": plan,
        "along": SimpleNamespace(missing_wh=(0.0, 0.0, 0.0)),
    } | more
    return SimpleNamespace(
        energy_wh=energy_wh,
        interval=lambda level: (energy_wh - 300.0, energy_wh + 400.0) if level == 0.9 else None,
        to_frame=lambda: series,
        **given,
    )


def test_the_sentence_holds_the_numbers_of_the_forecast() -> None:
    said = forecast_in_words(made((0.8, 0.69, 0.66, 0.71)), "Example trip")
    assert said == (
        "Example trip, 12.3 km in 24 min at 0 °C: 2.1 kWh; 9 in 10 such trips take 1.8 to 2.5 kWh. "
        "Leaving with 80 % you arrive with 69 % (66 to 71 %)."
    )


def test_a_charge_is_told_as_it_was_given() -> None:
    """A display of 99 % stands for the whole battery in the sum, not in the sentence."""
    plan = SimpleNamespace(departure=Departure(soc=0.99))
    assert "Leaving with 99 % you arrive" in forecast_in_words(made((1.0, 0.78, 0.75, 0.81), plan=plan))
    halves = forecast_in_words(made((0.145, 0.125, 0.105, 0.135)))
    assert "Leaving with 15 % you arrive with 13 % (11 to 14 %)" in halves


def test_causes_and_changes_have_words() -> None:
    causes = {"air": 2.0, "acceleration": 1.0, "base_load": 3.0, "shortfall": 0.0, "not_forecast": -1.0}
    assert list(by_cause(causes)) == ["air drag", "change of speed", "base load", "not forecast"]
    assert list(by_cause({"shortfall": -1.0})) == ["not delivered"]
    assert change({"change": -0.0001, "unit": "1"}, "change") == "+0.0 %"


def test_a_battery_that_may_not_last_is_told_with_its_probability() -> None:
    perhaps = forecast_in_words(made((0.12, 0.03, 0.0, 0.07)))
    assert "you arrive with 3 % (0 to 7 %). The probability to arrive is 42.0 %." in perhaps
    empty = SimpleNamespace(missing_wh=(0.0, 350.0, 1260.0), empty_at_m=(7_400.0, 9_600.0, None))
    not_enough = forecast_in_words(made((0.05, 0.0, 0.0, 0.02), along=empty))
    assert (
        "Leaving with 5 % the battery is empty after 10 km (7 km or later): the trip takes 0.35 kWh (0.00 to 1.3 kWh) more "
        "than it holds. The probability to arrive is 42.0 %. At best you arrive with 2 %."
    ) in not_enough
    beyond_a_pass = forecast_in_words(made((0.15, 0.06, 0.03, 0.08), p_arrive=lambda reserve=0.0: 0.667))
    assert beyond_a_pass.endswith("you arrive with 6 % (3 to 8 %). The probability to arrive is 66.7 %.")
    certain = SimpleNamespace(missing_wh=(200.0, 350.0, 500.0), empty_at_m=(7_400.0, 9_600.0, 11_200.0))
    never = forecast_in_words(made((0.05, 0.0, 0.0, 0.0), p_arrive=lambda reserve=0.0: 1e-5, along=certain))
    assert "is empty after 10 km (7 to 11 km)" in never
    assert never.endswith("The probability to arrive is under 0.1 %.")


def test_short_trips_have_two_digits_and_the_way_behind_is_told() -> None:
    plan = SimpleNamespace(departure=Departure())
    said = forecast_in_words(made((0.8, 0.79, 0.78, 0.8), 640.0, measured_until_s=600.0, plan=plan))
    long = made((0.8, 0.79, 0.78, 0.8), time_s=12_060.0, measured_until_s=3900.0, plan=plan)
    assert "12.3 km in 3 h 21 min, 1 h 05 min of it driven: " in forecast_in_words(long)
    assert "12.3 km in 24 min, 10 min of it driven: 0.64 kWh; 9 in 10 such trips take 0.34 to 1.0 kWh" in said


def test_the_packages_model_and_the_example_trip() -> None:
    found = load_model(None).forecast(Plan.from_samples(example_trip(), "example"))
    said = forecast_in_words(found)
    numbers = [float(n) for n in re.findall(r"\d+\.?\d*", said)]
    km, minutes, degc, energy, _, _, low, high, *_ = numbers
    last = found.to_frame().iloc[-1]
    assert km == pytest.approx(last["distance_m"] / 1e3, abs=0.05)
    assert minutes == pytest.approx(last["time_s"] / 60, abs=0.5)
    assert degc == pytest.approx(found.plan.departure.ambient_temperature_degc, abs=0.5)
    expected = np.array([found.energy_wh, *found.interval(0.9)]) / 1e3
    np.testing.assert_allclose([energy, low, high], expected, atol=0.05)


def test_a_round_trip_tells_the_charge_at_its_places() -> None:
    found = journey(
        load_model(None), stops=(A, Place(47.0, 9.1, "Inn"), Place(47.0, 9.2, "Top")), round_trip=True
    )
    (road, *_), said = found.roads, journey_in_words(found)
    inn, top = (percent(road.soc_at(at_m)) for at_m in road.road.stop_position_m)
    assert float(inn[:-2]) > float(top[:-2])
    at = said.index(f"At Inn you have {inn}.")
    assert said[at + 1 :] == [f"At Top you have {top}.", found.leave]


def test_progress_without_a_terminal_is_few_plain_lines(monkeypatch) -> None:
    now = [0.0]
    monkeypatch.setattr(printing.time, "monotonic", lambda: now[0])
    stream = io.StringIO()
    with printing.progress(Console(file=stream)) as advance:
        for finished in range(101):
            now[0] = 0.2 * finished  # 20 s in all
            advance(finished, 100)
    lines = stream.getvalue().splitlines()
    assert lines[0] == "0 of 100 folds finished after 0 s"
    assert lines[-1] == "100 of 100 folds finished after 20 s"
    assert 4 <= len(lines) <= 6


def test_nothing_near_certainty_is_told_where_an_unknown_climb_would_change_it() -> None:
    for climb, shown in ((None, "over 99.9 %"), (900.0, "over 99 %, unless it climbs far")):
        told = SimpleNamespace(p_arrive=lambda reserve: 0.9999, climb_to=lambda reserve, climb=climb: climb)
        assert chance_to_arrive(told, 0.1) == shown
    unlikely = SimpleNamespace(p_arrive=lambda reserve: 0.42, climb_to=lambda reserve: 900.0)
    assert chance_to_arrive(unlikely) == "42.0 %"
    plan = SimpleNamespace(climb=None)
    flat = SimpleNamespace(soc_per_climb_m=0.0002, climb_to=lambda reserve: 0.0, plan=plan)
    assert unknown_climb_in_words(flat, 0.1) == [
        "The heights of the road are unknown. Each 100 m of climb takes 2.0 points."
    ]
    high = SimpleNamespace(soc_per_climb_m=0.0002, climb_to=lambda reserve: 1234.4, plan=plan)
    (sentence,) = unknown_climb_in_words(high, 0.1)
    assert sentence.endswith("takes 2.0 points; with 1,234 m of climb you arrive with 10 %.")
    high.plan.climb = SimpleNamespace(climb_m=np.array([0.0, 1139.2, -0.2]))
    assert unknown_climb_in_words(high, 0.1) == [
        "The heights of the road are unknown. By places beside it, it rises to +1,139 m and ends at +0 m, seen from the start. "
        "Each 100 m of climb beyond these heights takes 2.0 points; with 1,234 m of climb beyond these heights you arrive "
        "with 10 %."
    ]
