"""The charging curve: times of a charge, by values worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from tests.roads.journey.made import COLD, journey

from tripwatt.errors import InvalidInput
from tripwatt.roads.journey import ChargingCurve, Place
from tripwatt.roads.journey.charging import AMERICAN, EFFICIENCY, EUROPEAN, cold_factor, plugs_of
from tripwatt.roads.maps.stations import Station
from tripwatt.vehicles import load_vehicle


def test_a_curve_of_ones_own_is_no_class_curve(model):
    curve = ChargingCurve((0.0, 1.0), (60_000.0, 60_000.0))
    found = journey(model, replace(COLD, soc=0.7), charging_curve=curve)
    assert [flag.code for flag in found.flags] == ["plugs_unknown", "cold_charging_assumed"]
    (stop,) = found.charging.stops
    wh = found.forecast.charge.wh_per_display
    warm_s = (stop.soc_leave - stop.soc_arrival) * wh / (EFFICIENCY * 60_000.0) * 3600.0
    assert cold_factor(0.0) < warm_s / stop.charging_s < cold_factor(15.0)
    assert stop.energy_wh == pytest.approx((stop.soc_leave - stop.soc_arrival) * wh)


def test_a_car_has_its_own_curve_or_that_of_its_class():
    kona = ChargingCurve.from_vehicle(load_vehicle("hyundai_kona_64"), 64_000.0)
    own = load_vehicle("hyundai_kona_64").charging
    assert (kona.soc, kona.power_w, kona.is_class) == (own.displayed_soc, own.power_w, False)
    assert kona.alternating_w == own.alternating_power_w == 11_000.0
    assert ChargingCurve.from_vehicle(load_vehicle("nissan_leaf_40"), 38_000.0).alternating_w == 6_600.0
    i3 = ChargingCurve.from_vehicle(load_vehicle("bmw_i3_60ah"), 20_000.0)
    assert i3 == ChargingCurve.from_class(20_000.0)
    assert (i3.is_class, i3.power_w[0], i3.power_w[-1]) == (True, 24_000.0, 2_000.0)


@pytest.mark.parametrize(
    ("soc", "power"),
    [
        ((0.0, 0.5), (1.0, 1.0)),
        ((0.1, 1.0), (1.0, 1.0)),
        ((0.0, 1.0), (1.0, 0.0)),
        ((0.0, 1.0), (1.0,)),
        ((0.0, 0.0, 1.0), (1.0, 1.0, 1.0)),
    ],
)
def test_what_is_no_charging_curve_is_refused(soc, power):
    with pytest.raises(InvalidInput, match="no charging curve"):
        ChargingCurve(soc, power)


def seconds(curve, start, end, station, **more):
    return float(curve.seconds(np.linspace(start, end, 201), station, 46_000.0, **more)[-1])


def test_minutes_of_a_charge_follow_the_curve():
    curve = ChargingCurve((0.0, 1.0), (100_000.0, 100_000.0), alternating_w=7_000.0)
    direct, slow = Station(0.0, 0.0, "", 50_000.0, direct_current=True), Station(0.0, 0.0, "", 22_000.0)
    assert seconds(curve, 0.2, 0.7, direct) == pytest.approx(23_000.0 / (0.92 * 50_000.0) * 3600.0)
    assert seconds(curve, 0.2, 0.7, slow) == pytest.approx(23_000.0 / (0.92 * 7_000.0) * 3600.0)
    falling = ChargingCurve((0.0, 1.0), (50_000.0, 25_000.0))
    # the integral of dx / (1 - x/2) from 0 to 1 is 2 ln 2
    fast = replace(direct, power_w=1e6)
    assert seconds(falling, 0.0, 1.0, fast) == pytest.approx(3600.0 * 2.0 * np.log(2.0), rel=1e-4)


def test_cold_cells_take_less_direct_current_and_no_less_alternating():
    curve = ChargingCurve((0.0, 1.0), (100_000.0, 100_000.0), alternating_w=7_000.0)
    fast = Station(0.0, 0.0, "", 150_000.0, direct_current=True)
    times = [seconds(curve, 0.1, 0.8, fast, cell_degc=degc) for degc in (-30.0, -10.0, 0.0, 10.0, 25.0, 40.0)]
    assert times == sorted(times, reverse=True)
    assert times[2] == pytest.approx(times[4] / 0.64)
    assert times[4] == times[5]
    weak = replace(fast, power_w=50_000.0)  # the station, not the cells, sets the power
    assert seconds(curve, 0.1, 0.8, weak, cell_degc=0.0) == seconds(curve, 0.1, 0.8, weak)
    slow = replace(fast, direct_current=False)
    assert seconds(curve, 0.1, 0.8, slow, cell_degc=-10.0) == seconds(curve, 0.1, 0.8, slow)


def test_plugs_are_those_of_the_region_and_of_the_car():
    vaduz, boston, kyoto = Place(47.0, 9.5), Place(42.4, -71.1), Place(35.0, 135.8)
    assert plugs_of("vw_id3", vaduz) == EUROPEAN | {"tesla_supercharger_ccs"}
    assert plugs_of("vw_id4", boston) == AMERICAN | {"tesla_supercharger_ccs"}
    assert plugs_of("nissan_leaf_40", vaduz) == EUROPEAN - {"type2_combo"} | {"chademo"}
    assert {"tesla_supercharger", "nacs", "type1_combo"} <= plugs_of("tesla_model_3_lr", boston)
    assert "type2_combo" in plugs_of("fiat_500e_2020_24", vaduz)
    assert plugs_of("fiat_500e", vaduz) == plugs_of("smart_eq_fortwo", vaduz) == EUROPEAN - {"type2_combo"}
    for power_w, fits in ((22e3, True), (150e3, False)):  # stations of which only the power is known
        station = Station.without_plugs(47.0, 9.5, "", power_w)
        assert (station.usable_with(plugs_of("fiat_500e", vaduz)) is not None) == fits
        assert station.usable_with(plugs_of("fiat_500e", kyoto)) is station
    assert plugs_of("vw_id3", kyoto) == frozenset()
