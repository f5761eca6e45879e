"""The charging curve: times of a charge, by values worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from tests.journey.made import COLD, journey

from tripwatt.errors import InvalidInput
from tripwatt.journey import (
    ChargingCurve,
)
from tripwatt.journey.charging import EFFICIENCY
from tripwatt.routes.maps import Station
from tripwatt.vehicles import load_vehicle


def test_a_curve_of_ones_own_is_no_class_curve(model):
    curve = ChargingCurve((0.0, 1.0), (60_000.0, 60_000.0))
    found = journey(model, replace(COLD, soc=0.7), charging_curve=curve)
    assert found.flags == ()
    stop = found.charging
    wh = found.forecast.charge.wh_per_display
    seconds = (stop.soc_leave - stop.soc_arrival) * wh / (EFFICIENCY * 60_000.0) * 3600.0
    assert stop.charging_s == pytest.approx(300.0 + seconds, rel=1e-6)


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


def test_minutes_of_a_charge_follow_the_curve():
    curve = ChargingCurve((0.0, 1.0), (100_000.0, 100_000.0), alternating_w=7_000.0)
    direct, slow = Station(0.0, 0.0, "", 50_000.0, direct_current=True), Station(0.0, 0.0, "", 22_000.0)
    assert curve.seconds(0.2, 0.7, direct, 46_000.0) == pytest.approx(23_000.0 / (0.92 * 50_000.0) * 3600.0)
    assert curve.seconds(0.2, 0.7, slow, 46_000.0) == pytest.approx(23_000.0 / (0.92 * 7_000.0) * 3600.0)
    assert curve.seconds(0.7, 0.7, slow, 46_000.0) == 0.0
    falling = ChargingCurve((0.0, 1.0), (100_000.0, 50_000.0))
    # the integral of dx / (1 - x/2) from 0 to 1 is 2 ln 2
    fast = replace(direct, power_w=1e6)
    assert falling.seconds(0.0, 1.0, fast, 92_000.0) == pytest.approx(3600.0 * 2.0 * np.log(2.0), rel=1e-4)
