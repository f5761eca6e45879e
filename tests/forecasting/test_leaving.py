"""The charge to leave with, and trips at the ends of the battery: laws that hold for every car and road."""

import itertools
import math
from dataclasses import replace

import pandas as pd
import pytest
from benchmarks.leave_with import CHARGES, RESERVE, ROADS, WORST, answers, plan_of
from tests.support.cars import KEPT, some_cars
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.forecasting import Forecast
from tripwatt.forecasting.forecast import with_empty_flag
from tripwatt.forecasting.leaving import charge_with_spare, leave_with, leaving_with, soc_needed
from tripwatt.population import for_car
from tripwatt.trips import Departure
from tripwatt.trips.messages import leave_in_words, message


@pytest.fixture(scope="module")
def found():
    return list(answers(some_cars(3)))


def test_who_leaves_with_the_charge_arrives_with_the_probability_asked_for(found):
    assert len(found) == 3 * len(ROADS) * len(CHARGES) * 3
    assert [one for one in found if one.off > WORST] == []
    assert any(one.exception == "not even full" for one in found)
    assert sum(not one.exception for one in found) > 0.8 * len(found)


def test_the_charge_to_leave_with_does_not_depend_on_that_of_the_plan(found):
    by_question = {}
    for one in found:
        by_question.setdefault((one.car, one.road, one.probability), []).append(one.soc)
    assert max(max(values) - min(values) for values in by_question.values()) < 1e-5


@pytest.fixture(scope="module", params=KEPT)
def model(request):
    return for_car(None, request.param)


def asked(model, road: str = "country", soc: float | None = 0.5, **known) -> Forecast:
    return model.forecast(plan_of(road), Departure(soc=soc, **known))


def test_the_charge_to_leave_with_rises_with_probability_reserve_and_distance(model):
    trip = asked(model)
    by_probability = [soc_needed(trip, 0.1, p) for p in (0.5, 0.7, 0.9, 0.95, 0.99)]
    assert by_probability == sorted(by_probability)
    by_reserve = [soc_needed(trip, r) for r in (0.0, 0.05, 0.1, 0.2, 0.3)]
    assert by_reserve == sorted(by_reserve)
    roads = [
        tw.read_route([{"length_m": metres, "speed_m_s": 20.0}]) for metres in (5e3, 2e4, 6e4, 1.5e5, 4e5)
    ]
    by_distance = [soc_needed(model.forecast(road)) for road in roads]
    assert by_distance == sorted(by_distance)
    assert by_distance[-1] > 1.0


def test_a_descent_needs_less_than_its_reserve_and_may_need_nothing(model):
    assert soc_needed(asked(model, "descent"), 0.1, 0.5) < 0.1
    nothing = soc_needed(asked(model, "descent"), 0.0, 0.5)
    assert nothing < 0.02
    words = leave_in_words(0.0, 0.0, 0.5)
    assert words == "Any charge is enough to arrive in 1 of 2 trips."


def test_a_pass_is_not_crossed_with_an_empty_battery(model):
    """The way down would bring back what the way up takes; a car that stops on the way up does not get it."""
    trip = asked(model, "pass")
    needed, surely = soc_needed(trip, 0.0, 0.5), soc_needed(trip, 0.0, 0.9)
    low = leaving_with(
        trip, max(needed - max(0.03, 1.5 * (surely - needed)), 0.0)
    )  # short by more than its spread
    assert min(low.along.soc(0.5)) < 0.0
    assert low.along.soc(0.5)[-1] > min(low.along.soc(0.5))
    assert low.p_arrive(0.0) < 0.1
    assert "battery_empty" in [flag.code for flag in low.flags]


def test_energy_does_not_fall_where_the_battery_is_empty(model):
    """What a trip takes is not what the battery holds; a lower voltage costs a little more."""
    energy = [asked(model, "motorway", soc).energy_wh for soc in (1.0, 0.5, 0.2, 0.05, 0.01)]
    assert min(energy) > 0.995 * energy[0]
    assert max(energy) < 1.02 * energy[0]


def test_an_empty_battery_is_told_by_what_it_lacks_and_where(model):
    short, plenty = asked(model, "motorway", 0.1), asked(model, "town", 0.9)
    assert plenty.along.missing_wh == (0.0, 0.0, 0.0)
    assert "battery_empty" not in [flag.code for flag in plenty.flags]
    least, expected, most = short.along.missing_wh
    assert 0.0 < least < expected < most
    held = 0.1 * short.charge.wh_per_display
    assert expected == pytest.approx(short.energy_wh - held, rel=0.01)
    early, middle, late = short.along.empty_at_m
    assert early < middle < late < short.drive.distance_m[-1]
    (flag,) = [flag for flag in short.flags if flag.code == "battery_empty"]
    assert (flag.value, flag.unit) == (expected, "wh")
    without = model.expect(short.plan)
    assert without.energy_wh == short.energy_wh
    assert flag not in without.flags
    assert with_empty_flag(plenty) is plenty, "its cached values are kept"
    assert with_empty_flag(replace(plenty, flags=(*plenty.flags, flag))).flags == plenty.flags
    assert "more than is in the battery" in message(flag)
    assert 0.0 <= short.p_arrive(RESERVE) <= short.p_arrive(0.0) < 0.5
    document = short.to_dict()
    assert document["missing_wh"] == {"least": least, "expected": expected, "most": most}
    # energy that is added to the battery is all that lacks
    needed = soc_needed(short, 0.0, 0.5)
    lacks = (needed - 0.1) * short.charge.wh_per_display
    assert lacks == pytest.approx(expected, rel=0.15)


def test_a_full_battery_keeps_its_charge_on_the_way_down(model):
    for soc in (1.0, 0.95, 0.8):
        down = asked(model, "descent", soc)
        assert down.soc_arrival <= 1.0
        assert down.drive.simulation.soc.max() <= model.vehicle.battery.displayed_full_soc + 1e-9
    full, half = asked(model, "descent", 1.0), asked(model, "descent", 0.5)
    lost = {flag.code: flag.value for flag in full.flags}["battery_full"]
    assert full.energy_wh - half.energy_wh == pytest.approx(lost, rel=0.05)
    assert full.by_cause_wh["friction_brakes"] > half.by_cause_wh["friction_brakes"] + 0.9 * lost
    assert sum(full.by_cause_wh.values()) == pytest.approx(full.energy_wh)


def test_on_the_way_the_charge_is_that_of_the_last_reading(model):
    before = asked(model, soc=0.6)
    half = 0.5 * before.plan.duration_s
    times = {"time_s": [0.0, half], "speed_m_s": 20.0}
    shown = 0.6 - 0.5 * before.energy_wh / before.charge.wh_per_display
    seen = before.update(pd.DataFrame({**times, "displayed_soc": [0.6, shown]}))
    now = soc_needed(seen, 0.1, 0.9)
    assert leaving_with(seen, now).p_arrive(0.1) == pytest.approx(0.9, abs=1e-3)
    assert leaving_with(seen, now).measured_until_s == seen.measured_until_s
    assert 0.3 < (now - 0.1) / (soc_needed(before, 0.1, 0.9) - 0.1) < 0.75


def test_a_charge_that_no_display_shows_is_refused(model):
    before = asked(model)
    seen = before.update(
        pd.DataFrame({"time_s": [0.0, 600.0], "speed_m_s": 20.0, "displayed_soc": [0.5, 0.47]})
    )
    for trip, soc in itertools.product((before, seen), (-0.1, 1.1, float("nan"))):
        refuses("out of range", leaving_with, trip, soc)


def test_a_plan_is_forecast_again_as_it_was_forecast(model):
    cold = asked(model, soc=0.5, payload_mass_kg=200.0)
    again = leaving_with(cold, 0.5)
    assert again.energy_wh == cold.energy_wh
    assert again.sd_wh == cold.sd_wh
    assert set(again.flags) == set(cold.flags)
    unknown = asked(model, soc=None)
    assert "soc_assumed" in [flag.code for flag in unknown.flags]
    assert "soc_assumed" not in [flag.code for flag in leaving_with(unknown, 0.5).flags]


def test_the_document_has_the_charge_to_leave_with_by_its_reserve(model):
    trip = asked(model, "descent")
    for reserve in (None, 0.3):
        leave = trip.to_dict(reserve, leave_with(trip, reserve or 0.0, 0.9))["leave_with"]
        assert leave["reserve"] == (reserve or 0.0)
        assert leave["soc_needed"] == pytest.approx(soc_needed(trip, reserve or 0.0, 0.9), abs=1e-12)
    assert trip.to_dict(0.3)["leave_with"] is None


@pytest.mark.parametrize(
    ("spare", "needed", "most"),
    [
        (lambda soc: soc - 0.3, 0.3, 2),
        (lambda soc: 1.2 * (soc - 0.31), 0.31, 3),
        (lambda soc: math.sqrt(soc) - 0.9, 0.81, 6),
        (lambda soc: soc + 0.05 * math.sin(3.0 * soc) - 0.7, 0.65376, 4),
        (lambda soc: 0.9 * soc - 1.1, 1.2, 2),
        (lambda soc: soc + 0.1, 0.0, 2),
    ],
)
def test_few_forecasts_find_the_charge_to_leave_with(spare, needed, most):
    """Each costs a forecast: a charge more leaves about as much more, and the secant does the rest."""
    tried = []
    assert charge_with_spare(lambda soc: tried.append(soc) or spare(soc)) == pytest.approx(needed, abs=1e-5)
    assert len(tried) <= most


def test_a_charge_to_leave_with_is_for_a_probability_of_a_half_or_more(model):
    trip = asked(model, "descent")
    refuses(r"probability: got 0\.49; allowed: 0\.5 ", soc_needed, trip, 0.1, 0.49)


def test_what_was_added_for_an_unknown_state_stays_with_another_charge(model):
    trip = asked(model)
    wider = replace(trip, state_sd_wh=3.0 * trip.state_sd_wh + 100.0)
    assert leaving_with(wider, 0.5).state_sd_wh == wider.state_sd_wh


def test_after_the_last_reading_the_end_counts(model):
    along = asked(model).along
    done = replace(along, read_s=float(along.time_s[-1]))
    assert done.spare(0.1, 0.5) == pytest.approx(float(along.soc(0.5)[-1]) - 0.1, abs=1e-12)
    assert done.missing_at(done.expected_soc) == pytest.approx(
        max(-float(along.soc(0.5)[-1]), 0.0) * along.wh_per_display
    )
