"""Forecasts stay possible from 1 to 900 km, in every car: energies, charge, and how the chance to arrive moves."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from tests.support.cars import some_cars

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting.along import distance_below, possible_energy
from tripwatt.forecasting.document import QUANTILES
from tripwatt.population import for_car
from tripwatt.trips import Departure

KM = (1, 20, 60, 160, 400, 900)
MIN_CHANGE = 1e-9


def flat(km: float, speed_km_h: float = 90.0) -> tw.Plan:
    pieces = max(int(km / 5), 1)
    return tw.read_route(
        [{"length_m": 1000.0 * km / pieces, "speed_m_s": speed_km_h / 3.6, "grade": 0.0}] * pieces
    )


def departing(**known: float) -> Departure:
    usual = {"soc": 0.9, "ambient_temperature_degc": 20.0, "battery_temperature_degc": 20.0}
    return Departure(**{**usual, "cabin_temperature_degc": 20.0, "cabin_setpoint_degc": 21.0, **known})


def at(degc: float) -> dict[str, float]:
    return {f"{what}_temperature_degc": degc for what in ("ambient", "battery", "cabin")}


@cache
def model_of(vehicle: str) -> tw.ForecastModel:
    return for_car(None, vehicle)


@pytest.mark.parametrize("vehicle", some_cars())
def test_long_drives_are_possible(vehicle):
    chances = []
    for km in KM:
        found = model_of(vehicle).forecast(flat(km), departing())
        quantiles = [found.quantile(p) for p in QUANTILES]
        charges = [found.arrival.quantile(p) for p in QUANTILES]
        series = found.to_frame()
        assert np.all(np.diff(quantiles) > 0.0)
        assert quantiles[0] > 0.0
        assert found.quantile(1e-6) > 0.0
        assert np.all(np.diff(charges) >= 0.0)
        for name in ("displayed_soc", "displayed_soc_low", "displayed_soc_high"):
            assert series[name].between(0.0, 1.0).all()
        assert (series["energy_low_wh"] >= 0.0).all()
        low, high = found.interval(0.9)
        assert high - low <= 0.7 * found.energy_wh or km < 20
        early, expected, late = found.along.empty_at_m
        reached = [m for m in (early, expected, late) if m is not None]
        assert reached == sorted(reached)
        assert (expected is not None) == (found.soc_arrival == 0.0)
        chances.append([found.p_arrive(reserve) for reserve in (0.0, 0.1, 0.3)])
    assert np.all(np.diff(chances, axis=0) <= MIN_CHANGE)  # falls with the distance
    assert np.all(np.diff(chances, axis=1) <= MIN_CHANGE)  # and with the reserve
    assert chances[-1][0] < 0.05


@pytest.mark.parametrize("vehicle", ["bmw_i3_60ah", "vw_id3", "nissan_leaf_24", "tesla_model_3_lr"])
def test_the_chance_to_arrive_falls_with_cold_and_load_and_rises_with_charge(vehicle):
    for km in (30, 90, 200):
        plan = flat(km)

        def chances(*departures, plan=plan):
            return [model_of(vehicle).forecast(plan, d).p_arrive(0.1) for d in departures]

        cold = chances(*(departing(**at(degc)) for degc in (15.0, 5.0, -5.0, -15.0)))
        # colder is also less certain, which lifts the chance of a hopeless trip by less than half a point
        hopeless = np.where(np.array(cold[1:]) < 0.02, 0.005, MIN_CHANGE)
        assert np.all(np.diff(cold) <= hopeless), cold
        load = chances(*(departing(payload_mass_kg=kg) for kg in (0.0, 150.0, 400.0)))
        assert np.all(np.diff(load) <= MIN_CHANGE), load
        charge = chances(*(departing(soc=soc) for soc in (0.2, 0.5, 0.8, 1.0)))
        assert np.all(np.diff(charge) >= -MIN_CHANGE), charge


def test_an_hour_at_a_standstill_costs_energy():
    samples = pd.DataFrame({"time_s": np.arange(3601.0), "speed_m_s": 0.0})
    parked = tw.Plan.from_trace("parked", samples)
    found = tw.forecast(parked, departing())
    low, high = found.interval(0.95)
    assert 0.0 < low < found.energy_wh < high < 2000.0


def test_the_least_energy_bounds_from_below_and_is_reversible():
    for least in (-50.0, 0.0, 700.0):
        halves = np.linspace(0.0, 5000.0, 200)
        found = possible_energy(np.full(200, 1000.0), halves, np.full(200, least))
        assert np.all(np.diff(found) <= 0.0)
        assert np.all(np.diff(found[:80]) < 0.0)
        assert np.all(found >= least)
        for half, energy in zip(halves[:80], found[:80], strict=True):
            assert distance_below(1000.0, float(energy), least) == pytest.approx(half, rel=1e-6, abs=1e-6)
    assert distance_below(1000.0, -60.0, -50.0) == np.inf
    # a drive that gives energy back has no floor above its expectation
    assert possible_energy(-300.0, 100.0, -200.0) == -400.0
    assert distance_below(-300.0, -400.0, -200.0) == 100.0


@pytest.mark.parametrize("trip", [None, "route.gpx", 12.0, [{"length_m": 5000.0, "speed_m_s": 15.0}]])
def test_what_is_no_trip_is_refused_with_what_makes_one(trip):
    with pytest.raises(
        InvalidInput, match=r"unknown type: trip: got .*allowed: a Plan or a Trip; make a plan with"
    ):
        tw.load_model().forecast(trip)


def test_what_is_no_departure_is_quoted_in_short():
    road = tw.read_route([{"length_m": 5000.0, "speed_m_s": 15.0}])
    with pytest.raises(InvalidInput) as caught:
        tw.load_model().forecast(road, "x" * 100)
    assert caught.value.faults[0].got == "'" + "x" * 39
