"""Advice on trips: laws of each action, what is least, and nothing absurd for any car."""

from __future__ import annotations

import datetime as dt
import itertools
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.support.cars import some_cars
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.physics import simulate_trip
from tripwatt.roads.advice import Advised
from tripwatt.roads.advice.actions import (
    MILD_DEGC,
    SPEEDS_KM_H,
    actions,
    cap_speed,
    limit_acceleration,
)
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Departure, Plan
from tripwatt.vehicles import Vehicle

LONG = (
    {"length_m": 8_000.0, "speed_m_s": 12.0, "stop_s": 20.0, "grade": 0.0},
    {"length_m": 60_000.0, "speed_m_s": 34.0, "grade": 0.0},
    {"length_m": 6_000.0, "speed_m_s": 10.0, "grade": 0.0},
)
JOURNEYS = tuple(itertools.product((-15.0, 5.0, 33.0), (1.0, 0.2)))
"""Temperature [°C] and share of the long road."""


def road(share: float = 1.0, **known: Any) -> Plan:
    links = [{**link, "length_m": share * link["length_m"]} for link in LONG]
    return tw.read_route(links).with_departure(Departure(**known))


def test_a_slower_drive_has_the_same_road_and_stands_as_long() -> None:
    for trip in synthetic_fleet(3).trips:
        plan = Plan.from_trip(trip)
        capped, calm = cap_speed(plan, 15.0), limit_acceleration(plan, 0.5)
        for other in (capped, calm):
            assert other.distance_m == pytest.approx(plan.distance_m, rel=0.01)
            assert other.duration_s >= plan.duration_s - 1e-6
            assert (other.array("speed_m_s") <= plan.array("speed_m_s") + 1e-9).all()
        assert capped.array("speed_m_s").max() <= 15.0
        rise = np.diff(calm.array("speed_m_s")) / np.diff(calm.array("time_s"))
        assert np.abs(rise).max() <= 0.51
        assert cap_speed(plan, 60.0).samples.equals(plan.samples)


def test_slower_saves_more_above_the_best_speed(model: ForecastModel) -> None:
    base = model.forecast(road(ambient_temperature_degc=15.0, soc=0.9))
    slower = [a for a in actions(base) if a.code == "slower"]
    assert [round(3.6 * (a.value or 0.0)) for a in slower] == [
        int(v) for v in SPEEDS_KM_H if v < 3.6 * 34.0 - 1.0
    ]
    saved = [model.forecast(a.apply_to(base.plan)).difference(base) for a in slower]
    energies = [one.energy_wh for one in saved]
    assert energies == sorted(energies, reverse=True)
    assert energies[0] < 0.0
    times = [one.duration_s for one in saved]
    assert times == sorted(times)


def test_speeds_to_keep_are_the_forecasts_of_the_plan_at_them(model: ForecastModel) -> None:
    """At the charging power of a cap, the time to drive and to charge what the drive takes is that of the plan."""
    advice = tw.advise(road(ambient_temperature_degc=15.0, soc=0.9), model=model)
    base = advice.forecast
    assert len(advice.speeds) >= 4
    for cap in advice.speeds:
        other = model.forecast(cap_speed(base.plan, cap.speed_m_s))
        assert cap.longer_s == pytest.approx(other.plan.duration_s - base.plan.duration_s)
        assert cap.saved_wh == pytest.approx(base.energy_wh - other.energy_wh)
        planned_s = base.plan.duration_s + 3600.0 * base.energy_wh / cap.charging_w
        slower_s = other.plan.duration_s + 3600.0 * other.energy_wh / cap.charging_w
        assert slower_s == pytest.approx(planned_s)
    # energy rises ever more with speed, so that each step down saves less for its time
    powers = [cap.charging_w for cap in advice.speeds]
    assert powers == sorted(powers, reverse=True)


def test_a_slow_road_has_no_speeds_to_keep() -> None:
    assert tw.advise(tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])).speeds == ()


def taken_wh(vehicle: Vehicle, plan: Plan) -> float:
    """What a trip takes from the charge, by simulation: energy at the terminals, and the heat in the battery."""
    run = simulate_trip(vehicle, plan)
    return float(np.diff(run.time_s) @ (run.battery_power_w + run.battery_loss_w)[1:]) / 3600.0


@pytest.mark.parametrize("degc", [-15.0, 0.0, 35.0])
def test_what_is_done_on_the_plug_takes_nothing_from_the_battery(model: ForecastModel, degc: float) -> None:
    base = model.forecast(road(ambient_temperature_degc=degc, soc=0.9))
    for action in actions(base):
        if action.wall_wh:
            changed = action.apply_to(base.plan)
            assert taken_wh(base.vehicle, changed) <= taken_wh(base.vehicle, base.plan) + 1e-6
            if action.code == "preheat_cabin":
                assert model.forecast(changed).energy_wh <= base.energy_wh
            assert action.before_s > 0.0


def test_a_difference_is_narrower_than_two_forecasts(model: ForecastModel) -> None:
    one, other = (model.forecast(road(ambient_temperature_degc=degc, soc=0.9)) for degc in (15.0, 5.0))
    ahead, back = one.difference(other), other.difference(one)
    assert ahead.energy_wh == pytest.approx(-back.energy_wh)
    assert ahead.sd_wh == pytest.approx(back.sd_wh)
    assert ahead.energy_wh == pytest.approx(one.energy_wh - other.energy_wh)
    assert sum(ahead.by_cause_wh.values()) == pytest.approx(ahead.energy_wh)
    assert ahead.sd_wh < 0.5 * np.hypot(one.sd_wh, other.sd_wh)
    assert ahead.p_less + back.p_less == pytest.approx(1.0)
    low, high = ahead.interval(0.9)
    assert low < ahead.energy_wh < high
    nothing = one.difference(one)
    assert (nothing.energy_wh, nothing.sd_wh) == (0.0, 0.0)


def test_forecasts_of_two_cars_have_no_difference(model: ForecastModel) -> None:
    refuses("of two cars", model.forecast(road()).difference, tw.for_car(model, "vw_id3").forecast(road()))


def charged_for(model: ForecastModel, plan: Plan, chance: float, reserve: float = 0.1) -> Forecast:
    soc = soc_needed(model.forecast(plan), reserve, chance)
    return model.forecast(plan, Departure(soc=min(soc, 1.0)))


def test_the_least_reaches_the_chance_and_costs_least_first(model: ForecastModel) -> None:
    plan = road(0.6, ambient_temperature_degc=5.0, extras=("roof_box",))
    advice = tw.advise(charged_for(model, plan, 0.75))
    assert advice.p_arrive == pytest.approx(0.75, abs=0.01)
    assert advice.least
    assert all(one.p_arrive >= 0.95 for one in advice.least)
    costs = [one.cost_min for one in advice.least]
    assert costs == sorted(costs)
    for one in advice.least:
        again = one.forecast.plan
        assert model.forecast(again).p_arrive(0.1) == pytest.approx(one.p_arrive)


def test_who_arrives_is_told_what_saves_and_nothing_has_to_be_done(model: ForecastModel) -> None:
    advice = tw.advise(model.forecast(road(0.2, soc=1.0, ambient_temperature_degc=-5.0)))
    assert advice.p_arrive >= 0.95
    assert advice.least == ()
    assert advice.singly
    saved = [one.difference.energy_wh for one in advice.singly]
    assert saved == sorted(saved)


def test_an_interval_that_includes_nothing_is_no_advice(model: ForecastModel) -> None:
    for one in tw.advise(model.forecast(road(soc=0.8, ambient_temperature_degc=20.0))).singly:
        assert one.difference.interval(0.9)[1] < 0.0


@pytest.mark.parametrize("name", some_cars(4))
def test_no_car_gets_absurd_advice(model: ForecastModel, name: str) -> None:
    own = tw.for_car(model, name)
    for degc, share in JOURNEYS:
        plan = road(share, ambient_temperature_degc=degc, extras=("roof_box", "winter_tyres"))
        advice = tw.advise(charged_for(own, plan, 0.6))
        given = [action for one in (*advice.least, *advice.singly) for action in one.actions]
        for action in given:
            if action.code == "slower":
                assert (action.value or 0.0) * 3.6 >= 79.9
            if action.code == "climate_off":
                assert MILD_DEGC[0] <= degc <= MILD_DEGC[1]
            if action.code == "setpoint":
                assert 16.0 <= (action.value or 0.0) <= 28.0
            if action.code == "summer_tyres":
                assert degc > 7.0
        least_wh = max(200.0, 0.02 * advice.forecast.energy_wh)
        assert all(one.difference.energy_wh <= -least_wh for one in advice.singly)
        assert all((one.saves == "energy") >= (one.wall_wh == 0.0) for one in advice.singly)
        for one in advice.least:
            assert len({action.group for action in one.actions}) == len(one.actions)
            assert one.difference.energy_wh < 0.0


def test_tyres_are_pumped_up_where_their_pressure_is_low(
    model: ForecastModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("_MIN_SAVED_SHARE", "_MIN_SAVED_WH"):
        monkeypatch.setattr(sys.modules["tripwatt.roads.advice.advise"], name, 0.0)

    def given(**known: Any) -> tuple[tw.Advice, dict[str, Advised]]:
        advice = tw.advise(model.forecast(road(0.6, soc=0.8, ambient_temperature_degc=15.0, **known)))
        return advice, {one.actions[0].code: one for one in advice.singly}

    low_advice, low = given(tyre_pressure=0.9)
    assert low["pump_up"].p_arrive > low_advice.p_arrive
    assert low["pump_up"].effort == "some"
    for known in ({}, {"tyre_pressure": 1.0}, {"tyre_pressure": 1.1}):
        assert "pump_up" not in given(**known)[1]


def test_what_has_to_begin_before_now_is_not_advised(model: ForecastModel) -> None:
    now = dt.datetime(2026, 1, 5, 7, 30, tzinfo=dt.UTC)
    forecast = model.forecast(road(0.6, soc=0.8, ambient_temperature_degc=-10.0))
    in_two_hours = Departure(departs_at=now + dt.timedelta(hours=2))
    later = model.forecast(forecast.plan.with_departure(in_two_hours))
    codes = [{one.actions[0].code for one in tw.advise(one, now=now).singly} for one in (forecast, later)]
    assert codes[1] - codes[0] == {"preheat_cabin"}
    (heat,) = (one for one in tw.advise(later, now=now).singly if one.actions[0].code == "preheat_cabin")
    assert heat.wall_wh > -heat.difference.energy_wh / 0.9
    assert (heat.saves, replace(heat, actions=()).saves) == ("range", "energy")


def test_what_cannot_be_advised_is_refused(model: ForecastModel) -> None:
    forecast = model.forecast(road())
    refuses("given twice", tw.advise, forecast, Departure(soc=0.5))
    refuses("no advice", tw.advise, replace(forecast, model=None))
    with pytest.raises(InvalidInput):
        tw.advise(forecast, probability=0.2)
