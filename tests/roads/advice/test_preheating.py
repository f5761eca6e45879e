"""Preheating: the optimum against plain loops, its laws, and what is handed to those who charge."""

from __future__ import annotations

import datetime as dt
import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.support.cars import some_cars

import tripwatt as tw
from tripwatt.physics import simulate_trip
from tripwatt.physics.cabin import CabinStart, CabinTask, condition_cabins
from tripwatt.roads.advice.preheating import (
    CHARGER,
    COMFORT_W_K,
    MIN_WH,
    PLUG_W,
    SCARCE,
    STEP_S,
    STEPS,
    TRIED_K,
    WORTH,
    Preheating,
    before_departure,
    need_before_departure,
    preheating,
)
from tripwatt.roads.journey.charging import ChargingCurve
from tripwatt.roads.journey.kinds import typical_road
from tripwatt.trips import Departure, Plan
from tripwatt.trips.messages import leave_in_words
from tripwatt.vehicles import Vehicle

CAR = "vw_id3"
COLD_TO_WARM = (-25.0, -15.0, -5.0, 0.0, 5.0, 12.0, 17.0, 20.0)


def road(km: float = 20.0, **known: Any) -> Plan:
    links = [{"length_m": 200.0 * km, "speed_m_s": 12.0}, {"length_m": 800.0 * km, "speed_m_s": 30.0}]
    return tw.read_route(links).with_departure(Departure(**known))


def costs_one_by_one(vehicle: Vehicle, plan: Plan, plug_w: float, worth: float) -> dict[Any, float]:
    """Cost of each way by plain loops: one cabin, one trip after the other; what costs the battery is left out."""
    ambient = plan.departure.ambient_temperature_degc or 0.0
    climate, minutes = vehicle.climate, range(STEPS + 1)
    assert climate is not None
    time, speed = plan.array("time_s"), plan.array("speed_m_s")
    cabins: dict[Any, tuple[np.ndarray, float, float]] = {}
    empty = replace(climate, occupant_heat_w=0.0)
    nearer = 1.0 if ambient > climate.setpoint_degc else -1.0
    for aim in (climate.setpoint_degc + nearer * kelvin for kelvin in TRIED_K):
        for minute in minutes:
            start, power = CabinStart(ambient, climate.setpoint_degc), np.zeros(STEPS)
            if minute:
                parked = CabinStart(ambient, aim, 0.0)
                stands = np.array([0.0, STEP_S * minute])
                (run,) = condition_cabins([CabinTask(empty, stands, np.zeros(2), ambient, parked)])
                power[-minute:] = (run.heat_w + run.fan_w).reshape(minute, -1).mean(axis=1)
                start = replace(
                    start,
                    temperature_degc=float(run.air_degc[-1]),
                    interior_degc=float(run.interior_degc[-1]),
                )
            (trip,) = condition_cabins([CabinTask(climate, time, speed, ambient, start)])
            energy_wh = float((trip.heat_w + trip.fan_w).sum()) * 10.0 / 3600.0
            felt = 0.5 * (trip.air_degc + trip.interior_degc)[1:]
            away = float(np.abs(felt - climate.setpoint_degc).sum()) * 10.0 / 3600.0
            cabins[aim if minute else None, minute] = power, energy_wh, COMFORT_W_K * away
    hours, costs = STEP_S / 3600.0, {}
    at_first = cabins[None, 0][1]
    for key, (power, trip_wh, away_wh) in cabins.items():
        from_plug = sum(min(w, plug_w * CHARGER) for w in power) * hours
        taken = float(power.sum()) * hours - from_plug + trip_wh
        if taken <= at_first + 1e-6:
            costs[key] = from_plug / CHARGER + worth * taken + away_wh
    return costs


def key_of(heat: Preheating | None) -> tuple[float | None, int]:
    return (None, 0) if heat is None else (heat.cabin_degc, round(heat.before_s / STEP_S))


@pytest.mark.parametrize(
    ("degc", "plug_w", "worth"),
    [
        (-25.0, PLUG_W, WORTH),
        (-15.0, 2300.0, WORTH),
        (0.0, 11_000.0, SCARCE),
        (35.0, PLUG_W, SCARCE),
        (20.0, PLUG_W, WORTH),
    ],
)
def test_the_optimum_is_that_of_plain_loops(degc: float, plug_w: float, worth: float) -> None:
    car = tw.load_vehicle("nissan_leaf_40")
    plan = road(12.0, ambient_temperature_degc=degc)
    costs = costs_one_by_one(car, plan, plug_w, worth)
    chosen = key_of(preheating(car, plan, plug_w=plug_w, worth=worth))
    nothing = costs[None, 0] - worth * MIN_WH
    assert min(nothing, costs[chosen]) == pytest.approx(min(nothing, *costs.values()), abs=1e-3)
    assert chosen == (None, 0) or costs[chosen] < nothing


@pytest.mark.parametrize("name", some_cars(5))
@pytest.mark.parametrize("degc", [-20.0, 8.0, 30.0])
@pytest.mark.parametrize("plug_w", [0.0, 1500.0])
def test_no_answer_costs_the_battery_anything(name: str, degc: float, plug_w: float) -> None:
    heat = preheating(tw.load_vehicle(name), road(ambient_temperature_degc=degc), plug_w=plug_w)
    if heat is not None:
        assert heat.saved_wh >= 0.0
        assert (heat.wall_wh > 0.0) == (plug_w > 0.0)


@pytest.mark.parametrize("name", some_cars(6))
def test_colder_air_means_no_later_start(name: str) -> None:
    car = tw.load_vehicle(name)
    found = [preheating(car, road(ambient_temperature_degc=degc)) for degc in COLD_TO_WARM]
    before = [0.0 if heat is None else heat.before_s for heat in found]
    assert all(colder >= warmer - STEP_S for colder, warmer in itertools.pairwise(before))  # within a step
    assert found[-1] is None  # nothing to do at 20 °C
    assert before[2] > 0.0  # at -5 °C there is


def test_off_the_plug_a_cabin_is_left_alone() -> None:
    for name, degc in itertools.product(some_cars(4), (-10.0, 0.0, 30.0)):
        plan = road(ambient_temperature_degc=degc)
        assert preheating(tw.load_vehicle(name), plan, plug_w=0.0) is None


def test_scarce_energy_begins_earlier_and_saves_more() -> None:
    plan = road(60.0, ambient_temperature_degc=-5.0)
    usual, scarce = (preheating(tw.load_vehicle(CAR), plan, worth=worth) for worth in (WORTH, SCARCE))
    assert usual is not None
    assert scarce is not None
    assert scarce.before_s > usual.before_s
    assert scarce.saved_wh > usual.saved_wh
    assert scarce.wall_wh > usual.wall_wh


def test_a_car_that_is_warm_or_without_climate_control_has_nothing_to_warm() -> None:
    car = tw.load_vehicle(CAR)
    warm = road(ambient_temperature_degc=0.0, cabin_temperature_degc=22.0, battery_temperature_degc=20.0)
    assert preheating(car, warm) is None
    cold = {"ambient_temperature_degc": 0.0, "battery_temperature_degc": 20.0}
    assert preheating(car, road(climate="off", **cold)) is None
    assert preheating(replace(car, climate=None), road(**cold)) is None


def test_the_heat_at_departure_goes_on_as_in_one_run() -> None:
    car = tw.load_vehicle("bmw_i3_60ah")
    assert car.climate is not None
    time, start = np.arange(0.0, 3001.0, 10.0), CabinStart(-10.0, 22.0)
    speed = np.where(time > 600.0, 20.0, 0.0)
    (whole,) = condition_cabins([CabinTask(car.climate, time, speed, -10.0, start)])
    rest = replace(
        start, temperature_degc=float(whole.air_degc[60]), interior_degc=float(whole.interior_degc[60])
    )
    (later,) = condition_cabins([CabinTask(car.climate, time[60:], speed[60:], -10.0, rest)])
    assert later.heat_w.sum() == pytest.approx(whole.heat_w[60:].sum(), rel=5e-3)  # fans start low
    light, heavy = car.climate.air_heat_capacity_j_k, car.climate.interior_heat_capacity_j_k
    assert rest.interior_degc is not None
    mixed = (light * rest.temperature_degc + heavy * rest.interior_degc) / (light + heavy)
    one = replace(start, temperature_degc=mixed)
    (stands_for,) = condition_cabins([CabinTask(car.climate, time[60:], speed[60:], -10.0, one)])
    assert stands_for.heat_w.sum() == pytest.approx(later.heat_w.sum(), rel=0.03)


def test_a_cabin_warmed_on_the_plug_stands_beside_cold_tyres() -> None:
    heat = preheating(tw.load_vehicle(CAR), road(ambient_temperature_degc=-5.0))
    assert heat is not None
    assert heat.changed["warmth"] == 0.0
    plans = [road(ambient_temperature_degc=-5.0, cabin_temperature_degc=15.0, warmth=w) for w in (0.0, None)]
    cold, as_from_a_trip = (simulate_trip(tw.load_vehicle(CAR), plan).by_cause_wh for plan in plans)
    assert cold["rolling"] > as_from_a_trip["rolling"]


def test_charge_time_and_start_are_handed_over() -> None:
    leaves = dt.datetime(2026, 1, 12, 7, 30, tzinfo=dt.UTC)
    known = Departure(soc=0.3, ambient_temperature_degc=-5.0, departs_at=leaves)
    needed, until = need_before_departure(
        60.0, "mixed", known, 3700.0, probability=0.95, reserve=0.1, car=CAR
    )
    same = tw.need(60.0, "mixed", known, car=CAR, probability=0.95, reserve=0.1)
    assert replace(needed, flags=same.flags).to_dict() == same.to_dict()
    assert until["target_soc"] == same.soc_needed
    assert until["message"] == leave_in_words(same.soc_needed, 0.1, 0.95)
    plan = typical_road(60_000.0, "mixed")
    per_display = tw.for_car(None, CAR).forecast(plan, known).charge.wh_per_display
    assert until["charge_wh"] == pytest.approx((same.soc_needed - 0.3) * per_display)
    assert until["wall_wh"] == pytest.approx(until["charge_wh"] / CHARGER)
    assert until["charging_w"] == 3700.0
    assert until["charging_s"] == pytest.approx(until["wall_wh"] / 3700.0 * 3600.0)
    assert until["departs_at"] == leaves.isoformat()
    begins = dt.datetime.fromisoformat(until["preheat"]["starts_at"])
    assert (leaves - begins).total_seconds() == until["preheat"]["before_s"] > 0.0


def test_what_is_unknown_is_not_handed_over() -> None:
    plan = road(5.0).with_departure(Departure(ambient_temperature_degc=20.0))
    until = before_departure(tw.load_model(), plan, 1.4, 0.0, Departure())
    assert until == {
        "target_soc": 1.0,
        "departs_at": None,
        "soc": None,
        "charge_wh": None,
        "wall_wh": None,
        "charging_w": None,
        "charging_s": None,
        "preheat": None,
    }
    done = before_departure(tw.load_model(), plan, 0.4, 3700.0, Departure(soc=0.6))
    assert (done["charge_wh"], done["charging_s"]) == (0.0, 0.0)


def charged(vehicle: str, plug_w: float, soc: float = 0.2, to: float = 0.7, degc: float = 20.0) -> Any:
    plan = road(5.0).with_departure(Departure(ambient_temperature_degc=degc))
    return before_departure(tw.for_car(None, vehicle), plan, to, plug_w, Departure(soc=soc))


@pytest.mark.parametrize("name", ["nissan_leaf_40", "hyundai_kona_64", "vw_id3", "bmw_i3_60ah"])
def test_a_car_charges_with_the_smaller_of_plug_and_car(name: str) -> None:
    """No time is below that of either power, more power never takes longer, and none helps beyond that of the car."""
    curve = ChargingCurve.from_vehicle(tw.load_vehicle(name), charged(name, 3700.0)["charge_wh"] / 0.5)
    found = [charged(name, watt) for watt in (2300.0, 3700.0, 7400.0, 11_000.0, 22_000.0, 43_000.0)]
    times = [one["charging_s"] for one in found]
    for one, watt in zip(found, (2300.0, 3700.0, 7400.0, 11_000.0, 22_000.0, 43_000.0), strict=True):
        assert one["charging_w"] == pytest.approx(min(watt, curve.alternating_w))
        assert one["charging_s"] >= one["wall_wh"] / one["charging_w"] * 3600.0 - 1e-6
    assert times == sorted(times, reverse=True)
    assert times[-1] == times[-2]


def test_a_leaf_at_22_kw_takes_its_own_6_6_kw_and_less_when_it_is_almost_full() -> None:
    half = charged("nissan_leaf_40", 22_000.0)
    assert half["charging_s"] == pytest.approx(half["wall_wh"] / 6600.0 * 3600.0)
    full = charged("bmw_i3_60ah", 11_000.0, 0.5, 1.0)
    assert full["charging_s"] > 1.05 * full["wall_wh"] / full["charging_w"] * 3600.0


def test_a_rapid_charger_is_slower_with_a_cold_battery() -> None:
    cold, warm = (charged("nissan_leaf_40", 50_000.0, degc=degc) for degc in (-10.0, 25.0))
    assert cold["charging_w"] == warm["charging_w"] == 45_000.0
    assert cold["charging_s"] > 1.5 * warm["charging_s"]


@pytest.mark.parametrize(
    ("name", "assumed"), [("nissan_leaf_40", []), ("bmw_i3_60ah", ["class_charging_curve"])]
)
def test_an_assumed_charging_curve_is_named(name: str, assumed: list[str]) -> None:
    for soc, expected in ((0.3, assumed), (None, [])):
        known = Departure(soc=soc, ambient_temperature_degc=20.0)
        needed, _ = need_before_departure(50.0, "mixed", known, 7400.0, car=name, reserve=0.1)
        assert [flag.code for flag in needed.flags if flag.subject == "charging"] == expected
