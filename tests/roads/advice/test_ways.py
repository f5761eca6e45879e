"""Other ways to make a trip: another road, another hour."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.roads.journey.made import COLD, MADE, A, B, MadeRouter, journey, straight
from tests.roads.journey.test_stops import FAR, row

import tripwatt as tw
from tripwatt.forecasting.leaving import forecasts_like
from tripwatt.roads.advice import leaving_later
from tripwatt.roads.advice.actions import ALONE, Action, actions, replan_with
from tripwatt.roads.journey import Place, RoadForecaster
from tripwatt.roads.maps.stations import Station
from tripwatt.roads.routers import Road
from tripwatt.roads.weather import Weather

NOON = dt.datetime(2026, 1, 15, 12, 0, tzinfo=dt.UTC)


class Warming:
    """Weather that warms by 3 K each hour from noon on."""

    def at(self, places: Sequence[Place], when: Sequence[dt.datetime]) -> tuple[Weather, ...]:
        return tuple(Weather(-5.0 + 3.0 * (time - NOON).total_seconds() / 3600.0) for time in when)


def test_the_slower_road_of_a_journey_is_a_way_to_arrive(model: tw.ForecastModel) -> None:
    found = journey(model, replace(COLD, soc=0.93), alternatives=1, charge=False)
    advice = tw.advise(found)
    (other,) = (one for one in advice.singly if one.actions[0].code == "other_road")
    slower = found.roads[1].forecast
    assert other.difference.energy_wh == pytest.approx(slower.energy_wh - found.forecast.energy_wh)
    assert other.difference.duration_s == pytest.approx(
        slower.plan.duration_s - found.forecast.plan.duration_s
    )
    assert other.p_arrive == slower.p_arrive(0.1)
    for one in advice.least:
        assert len(one.actions) == 1 or not {action.group for action in one.actions} & {*ALONE}


@pytest.fixture(scope="module")
def with_stops(model: tw.ForecastModel) -> tuple[tw.Journey, tw.Advice]:
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=12.0, extras=("roof_box",))
    found = journey(model, departure, (A, FAR), replace(MADE, stations=row(14)), alternatives=1)
    return found, tw.advise(found)


def test_the_stops_of_a_plan_are_named_once_as_its_whole(with_stops: tuple[tw.Journey, tw.Advice]) -> None:
    found, advice = with_stops
    plan = found.charging
    assert plan is not None
    assert advice.p_arrive < 0.95 <= plan.p_reserve
    assert "stop" not in {action.code for one in advice.least for action in one.actions}
    assert advice.to_dict()["whole"]["charges"] == len(plan.stops)


def test_an_action_has_the_time_of_the_journey_with_the_stops_that_it_then_needs(
    with_stops: tuple[tw.Journey, tw.Advice], model: tw.ForecastModel
) -> None:
    found, advice = with_stops
    assert found.charging is not None
    by_code = {one.actions[0].code: one.whole for one in advice.singly}
    lighter, slower = (by_code[code] for code in ("no_roof_box", "slower"))
    assert lighter is not None
    assert slower is not None
    # its legs between stops lead back to the motorway, so the other road saves nothing
    assert "other_road" not in by_code
    # the same journey, planned without the box
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=12.0, extras=())
    again = journey(model, departure, (A, FAR), replace(MADE, stations=row(14))).charging
    assert again is not None
    assert lighter.duration_s == pytest.approx(again.duration_s, rel=0.01)
    assert lighter.duration_s < found.charging.duration_s
    assert lighter.driving_s == pytest.approx(found.charging.driving_s, rel=0.01)
    # what is driven longer is charged shorter
    assert slower.driving_s > found.charging.driving_s + 120.0
    assert slower.charging_s < found.charging.charging_s - 120.0
    for plan in (lighter, slower):
        assert plan.p_reserve >= 0.95
    for one in advice.singly:
        assert one.whole is not None
        assert one.difference.duration_s == pytest.approx(one.whole.duration_s - found.charging.duration_s)
        assert one.difference.energy_wh <= -200.0
        assert one.difference.energy_wh == pytest.approx(one.whole.energy_wh - found.charging.energy_wh)


@pytest.mark.parametrize("soc", [0.02, 0.08, 0.3, 0.6, 0.95])
@pytest.mark.parametrize("stations", [(), row(14)])
def test_no_advice_leads_to_a_smaller_chance_than_that_of_the_road_as_it_is(
    model: tw.ForecastModel, soc: float, stations: tuple[Station, ...]
) -> None:
    departure = replace(COLD, soc=soc, extras=("roof_box",))
    found = journey(model, departure, (A, FAR), replace(MADE, stations=stations), alternatives=1)
    shown = found.verdict.p_reserve
    for one in tw.advise(found).singly:
        assert one.p_arrive >= 0.05
        assert one.soc_arrival == (one.whole.soc_arrival if one.whole else one.forecast.soc_arrival)
        if one.actions[0].code == "other_road":
            whole = found.roads[int(one.actions[0].value or 0)].whole(0.1)
            assert (one.p_arrive, one.whole or whole) == (whole.p_reserve, whole)
            assert one.p_arrive >= shown - 0.01
        if found.charging is not None:
            assert one.whole is not None
            assert one.difference.duration_s == pytest.approx(
                one.whole.duration_s - found.charging.duration_s
            )


def test_a_road_without_a_station_is_no_advice_for_an_almost_empty_battery(model: tw.ForecastModel) -> None:
    """The shorter road takes less energy, but the only station is far from it."""

    class Apart(MadeRouter):
        def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
            fast, *_ = super().roads(stops)
            return (fast, straight(A, B, 80.0, factor=0.9, south_deg=0.6))[: 1 + alternatives]

    atlas = replace(MADE, router=Apart(), stations=(replace(MADE.stations[0], longitude_deg=9.3),))
    found = journey(model, replace(COLD, soc=0.6), atlas=atlas, alternatives=1)
    assert found.arrives
    assert found.roads[1].whole(0.1).p_reserve < 0.2
    assert "other_road" not in [one.actions[0].code for one in tw.advise(found).singly]


def test_what_is_warmed_on_the_plug_is_warm_on_the_first_leg_alone(model: tw.ForecastModel) -> None:
    cold = replace(COLD, soc=0.8, ambient_temperature_degc=-8.0, cabin_temperature_degc=-8.0)
    found = journey(model, cold, (A, FAR), replace(MADE, stations=row(14)))
    assert found.corridor is not None
    warm = next(action for action in actions(found.forecast) if action.code == "preheat_cabin")
    forecast = forecasts_like(found.forecast)(warm.apply_to(found.forecast.plan))
    plan = replan_with(found.corridor, warm, forecast)
    assert plan is not None
    degc = [leg.forecast.plan.departure.cabin_temperature_degc for leg in plan.legs]
    assert degc[0] == pytest.approx(warm.changed["cabin_temperature_degc"])
    assert degc[0] > 15.0
    assert {*degc[1:]} == {-8.0}


def test_a_trip_without_stops_has_no_whole(model: tw.ForecastModel) -> None:
    advice = tw.advise(journey(model, replace(COLD, soc=0.93), alternatives=1, charge=False))
    assert advice.to_dict()["whole"] is None
    assert {one.whole for one in (*advice.singly, *advice.least)} == {None}


def test_two_roads_share_neither_climb_nor_traffic(model: tw.ForecastModel) -> None:
    forecaster = RoadForecaster(model, COLD)
    road, longer = straight(A, B, 100.0), straight(A, B, 100.0, factor=1.1)
    slower = straight(A, B, 90.0)
    base = forecaster.forecast(road)
    of_one_road, of_two = (forecaster.forecast(other).difference(base) for other in (slower, longer))
    assert of_one_road.sd_wh < 0.5 * of_two.sd_wh


def test_leaving_later_has_the_weather_of_its_hour(model: tw.ForecastModel) -> None:
    departure = tw.Departure(soc=0.9, departs_at=NOON)
    road = straight(A, B, 100.0)
    forecaster = RoadForecaster(model, departure, Warming())
    ways = leaving_later(forecaster, road, NOON)
    assert [action.value for action, _ in ways] == [3600.0, 7200.0, 10_800.0]
    energies = [forecaster.forecast(road).energy_wh, *(forecast.energy_wh for _, forecast in ways)]
    assert energies == sorted(energies, reverse=True)
    advice = tw.advise(forecaster.forecast(road), others=ways)
    assert "leave_later" in [one.actions[0].code for one in advice.singly]
    assert leaving_later(replace(forecaster, weather=None), road, NOON) == []
    windy = replace(forecaster, departure=replace(departure, wind_speed_m_s=3.0))
    assert leaving_later(windy, road, NOON) == []


def test_the_error_of_the_weather_stays_in_what_is_advised(model: tw.ForecastModel) -> None:
    road = straight(A, B, 130.0, "motorway")
    departure = tw.Departure(soc=0.9, departs_at=NOON, cabin_temperature_degc=5.0)
    forecast = RoadForecaster(model, departure).forecast(road)
    unsure = replace(forecast, state_sd_wh=float(np.hypot(forecast.state_sd_wh, 800.0)))
    sure, wide = (tw.advise(one).singly[0] for one in (forecast, unsure))
    assert wide.forecast.sd_wh > 1.05 * sure.forecast.sd_wh
    assert wide.difference.sd_wh == pytest.approx(sure.difference.sd_wh, rel=0.3)


def test_a_saving_is_not_known_better_than_to_a_fifth_of_what_changes(model: tw.ForecastModel) -> None:
    forecaster = RoadForecaster(model, COLD)
    fast, slow = (forecaster.forecast(straight(A, B, speed, level=True)) for speed in (120.0, 90.0))
    saved = slow.difference(fast)
    causes = [wh for cause, wh in saved.by_cause_wh.items() if cause != "correction"]
    assert saved.sd_wh >= 0.2 * float(np.linalg.norm(causes)) > 0.0


def test_extras_that_several_actions_change_are_all_changed(model: tw.ForecastModel) -> None:
    departure = replace(COLD, extras=("roof_box", "winter_tyres", "headlights"))
    plan = RoadForecaster(model, departure).forecast(straight(A, B, 80.0)).plan
    for action in (
        Action("no_roof_box", "roof", "some", {}, removed="roof_box"),
        Action("seats", "climate", "some", {}, fitted="heated_seats"),
        Action("summer_tyres", "tyres", "much", {}, removed="winter_tyres"),
    ):
        plan = action.apply_to(plan)
    assert plan.departure.extras == ("headlights", "heated_seats")


def test_heated_seats_are_part_of_the_energy_and_of_the_charge(model: tw.ForecastModel) -> None:
    base = RoadForecaster(model, replace(COLD, ambient_temperature_degc=-10.0)).forecast(straight(A, B, 80.0))
    seats = next(action for action in actions(base) if action.code == "seats")
    heated = forecasts_like(base)(seats.apply_to(base.plan))
    difference = heated.difference(base)
    assert difference.energy_wh == pytest.approx(sum(difference.by_cause_wh.values()))
    hours = base.plan.duration_s / 3600.0
    warm_air = replace(base.plan, departure=replace(base.plan.departure, cabin_setpoint_degc=16.0))
    without_seats = forecasts_like(base)(warm_air)
    taken = heated.by_cause_wh["base_load"] - without_seats.by_cause_wh["base_load"]
    assert taken == pytest.approx(100.0 * hours, rel=0.01)
    assert difference.energy_wh == pytest.approx(heated.energy_wh - base.energy_wh)
    assert heated.soc_arrival - base.soc_arrival == pytest.approx(difference.soc_arrival)


def test_who_reaches_no_station_is_told_with_which_action_one_is_reached(model: tw.ForecastModel) -> None:
    """With this charge no station is reached as planned, and one is with an action."""
    departure = replace(COLD, soc=0.06, ambient_temperature_degc=-5.0)
    found = journey(model, departure, (A, FAR), replace(MADE, stations=row(60)))
    assert found.charging is None
    helped = [one for one in tw.advise(found).singly if one.whole is not None and one.whole.stops]
    assert {one.actions[0].code for one in helped} >= {"slower"}
    for one in helped:
        assert one.whole is not None
        assert one.p_arrive == one.whole.p_reserve >= 0.05
        assert one.whole.p_arrive >= 0.5
