"""What a trip has that training did not."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

import tripwatt as tw
from tripwatt.forecasting.ranges import (
    Range,
    compare,
    training_ranges,
    unknown_state_sd_wh,
    unknown_wind_sd_wh,
)
from tripwatt.hybrid import segment_trips
from tripwatt.physics import simulate_trip
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan
from tripwatt.vehicles import load_vehicle


@pytest.mark.parametrize(
    ("given", "flagged"),
    [
        (tw.Departure(ambient_temperature_degc=9.9), ["cabin_temperature_degc"]),
        (tw.Departure(ambient_temperature_degc=10.0), []),
        (tw.Departure(ambient_temperature_degc=31.1), ["battery_temperature_degc", "cabin_temperature_degc"]),
        (
            tw.Departure(ambient_temperature_degc=31.1, battery_temperature_degc=30.0),
            ["cabin_temperature_degc"],
        ),
        (tw.Departure(soc=0.5), []),
        (None, []),
    ],
)
def test_temperatures_that_a_file_keeps_are_flagged(given, flagged):
    rows = {"time_s": np.arange(60.0), "speed_m_s": 10.0}
    known = tw.Departure(cabin_temperature_degc=20.0, battery_temperature_degc=19.0)
    plan = Plan.from_trace("trip", pd.DataFrame(rows), known)
    found = tw.load_model().forecast(plan, given)
    assert sorted(f.subject for f in found.flags if f.code == "file_value_kept") == flagged


def test_distance_outside_a_range_is_in_standard_deviations():
    seen = Range(10.0, 20.0, 4.0)
    assert [seen.beyond(v) for v in (4.0, 10.0, 15.0, 20.0, 22.0, float("nan"))] == [1.5, 0, 0, 0, 0.5, 0]


@pytest.mark.parametrize(
    ("unknown", "expected_wh"),
    [
        ((), 0.0),
        (("cabin_setpoint_degc",), 1.5 * 70.0 * 0.5 / 0.95),
        # no more than the heat of 12 kJ/K of air and 90 kJ/K of seats
        (("cabin_temperature_degc",), 6.0 * (102_000.0 / 3600.0) / 0.95),
        (("battery_temperature_degc",), 6.0 * 10.0 * 0.5),
    ],
)
def test_an_unknown_temperature_costs_heat(unknown, expected_wh):
    car = load_vehicle("bmw_i3_60ah")
    assert unknown_state_sd_wh(car, unknown, 0.5) == pytest.approx(expected_wh, rel=1e-9)


def test_unknown_temperatures_are_independent_and_a_heat_pump_saves():
    car, leaf = load_vehicle("bmw_i3_60ah"), load_vehicle("nissan_leaf_24")
    both = ("battery_temperature_degc", "cabin_setpoint_degc")
    parts = [unknown_state_sd_wh(car, (name,), 0.5) for name in both]
    assert unknown_state_sd_wh(car, both, 0.5) == pytest.approx(np.hypot(*parts))
    climate = leaf.climate
    heat_w_k = climate.shell_w_k + climate.fresh_air_low_w_k
    expected = 1.5 * heat_w_k * 0.5 / climate.heat_pump_cop_at_0_degc
    assert unknown_state_sd_wh(leaf, both[1:], 0.5) == pytest.approx(expected)


@pytest.mark.parametrize("name", ["bmw_i3_60ah", "hyundai_ioniq_5_lr_rwd"])
def test_an_unknown_outside_temperature_has_the_chances_of_a_year(name):
    """Trips of a year, each as forecast at its temperature, lie as often as stated in intervals that do not have it."""
    year_degc = 10.0 + 8.0 * norm.ppf((np.arange(20) + 0.5) / 20)
    road = tw.read_route([{"length_m": 60_000.0, "speed_m_s": 20.0, "grade": 0.0}])
    car = load_vehicle(name)
    unknown = tw.forecast(road, tw.Departure(soc=0.9), car=car)
    energies_wh = []
    for degc in year_degc:
        known = tw.forecast(road, tw.Departure(soc=0.9, ambient_temperature_degc=degc), car=car)
        energies_wh += [known.quantile(q) for q in (np.arange(20) + 0.5) / 20]
    assert unknown.energy_wh == pytest.approx(np.mean(energies_wh), rel=0.02)
    for coverage in (0.5, 0.8, 0.9):
        low_wh, high_wh = unknown.interval(coverage)
        inside = np.mean((np.array(energies_wh) >= low_wh) & (np.array(energies_wh) <= high_wh))
        assert coverage - 0.04 <= inside <= coverage + 0.1
    above = np.mean(np.array(energies_wh) > unknown.quantile(0.95))
    assert 0.02 <= above <= 0.08


def test_a_wind_from_an_unknown_side_is_half_of_what_head_and_tail_wind_differ():
    car, road = load_vehicle("vw_id3"), tw.read_route([{"length_m": 20_000.0, "speed_m_s": 25.0}])
    windy = road.with_departure(tw.Departure(wind_speed_m_s=8.0))
    side = windy.air.any_side_m_s
    still = replace(windy.air, any_side_m_s=0.0)
    along = [replace(still, headwind_m_s=np.full_like(still.headwind_m_s, wind)) for wind in (side, -side)]
    against, behind = (simulate_trip(car, windy.with_weather(air)).simulated_energy_wh for air in along)
    assert against > behind + 100.0
    assert unknown_wind_sd_wh(car, windy) == pytest.approx(0.5 * (against - behind))
    assert unknown_wind_sd_wh(car, road) == 0.0


def test_a_training_trip_has_nothing_outside_and_a_longer_one_its_distance():
    car, trips = load_vehicle("bmw_i3_60ah"), synthetic_fleet(8, seed=4).trips
    table = segment_trips(trips, car)
    ranges = training_ranges(table)
    longest = int(np.argmax([trip.duration_s for trip in trips]))
    one, departure = table.take([longest]), trips[longest].departure
    assert compare(one, ranges, car, departure)[0] == []
    seen = ranges["duration_s"]
    shorter = ranges | {"duration_s": replace(seen, high=seen.high - 2.0 * seen.sd)}
    (flag,) = compare(one, shorter, car, departure)[0]
    assert (flag.subject, flag.value) == ("duration_s", pytest.approx(2.0))
    assert flag.seen == (seen.low, seen.high - 2.0 * seen.sd)


def test_the_last_digit_is_the_same_in_each_process():
    """The order of a set of texts, and so that of a sum over it, differs between processes."""
    code = (
        "from tripwatt.forecasting.ranges import UNKNOWN_SD_K, unknown_state_sd_wh;"
        "from tripwatt.vehicles import load_vehicle;"
        "print(repr(unknown_state_sd_wh(load_vehicle('bmw_i3_60ah'), [*UNKNOWN_SD_K], 1.3)))"
    )
    command, known = [sys.executable, "-c", code], os.environ
    answers = [subprocess.check_output(command, env={**known, "PYTHONHASHSEED": seed}) for seed in ("0", "1")]
    assert answers[0] == answers[1]
