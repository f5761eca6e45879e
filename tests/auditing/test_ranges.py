"""Rules on single columns, each threshold from both sides."""

import numpy as np
import pandas as pd
import pytest
from tests.auditing.findings import NO, told

import tripwatt as tw
from tripwatt.auditing.ranges import (
    ambient_findings,
    blank_fahrenheit,
    blank_impossible,
    blank_infinite,
    coarse_findings,
    drop_blank_speed,
    guessed_unit,
    mend_heights,
    missing_columns,
    speed_spikes,
)


def samples_of(n=200, start_s=10.0, **columns):
    return pd.DataFrame(
        {
            "time_s": start_s + np.arange(n),
            "speed_m_s": 10.0,
            "voltage_v": 380.0,
            "current_a": 20.0,
            **columns,
        }
    )


def test_missing_columns_set_aside_without_a_measured_energy():
    full = samples_of(elevation_m=5.0, ambient_temperature_degc=9.0)
    assert list(missing_columns(full, "t")) == []
    no_current = full.drop(columns="current_a")
    assert [f.consequence for f in missing_columns(no_current, "t")] == ["set aside"]
    counted = no_current.assign(observed_energy_wh=1.0)
    assert [f.consequence for f in missing_columns(counted, "t")] == ["noted"]
    assert list(missing_columns(full.assign(observed_energy_wh=1.0), "t")) == []
    assert [f.consequence for f in missing_columns(counted.assign(speed_m_s=NO), "t")] == ["set aside"]
    by_grade = full.drop(columns="elevation_m").assign(grade=0.0)
    assert list(missing_columns(by_grade, "t")) == []
    assert [f.what[:22] for f in missing_columns(by_grade.drop(columns="grade"), "t")] == [
        "no values of elevation"
    ]
    (cold,) = missing_columns(full.drop(columns="ambient_temperature_degc"), "t")
    assert cold.what.startswith("no values of outside temperature")


def test_infinite_values_are_blank():
    samples = samples_of(4, voltage_v=[380.0, np.inf, -np.inf, 381.0], remark=[np.inf] * 4)
    mended, (finding,) = blank_infinite(samples, "t")
    assert mended["voltage_v"].isna().tolist() == [False, True, True, False]
    assert finding.what == "battery voltage is infinite in 2 samples: these values are removed"
    assert blank_infinite(samples_of(4), "t")[1] == []


def changed(name, values, n=200, **columns):
    samples = samples_of(n, **columns)
    samples.loc[50 : 49 + len(values), name] = values
    return blank_impossible(samples, "t")


def test_an_impossible_hundredth_is_stray_and_more_is_another_thing():
    """Two of 200 samples are a hundredth."""
    mended, findings = changed("voltage_v", [10.0, 20.0])
    assert told(findings) == [
        (60.0, 61.0, "noted", "battery voltage of 10 to 20 V in 2 samples is impossible")
    ]
    assert np.flatnonzero(mended["voltage_v"].isna()).tolist() == [50, 51]
    mended, findings = changed("voltage_v", [10.0] * 3)
    assert told(findings) == [(60.0, 62.0, "set aside", "battery voltage of 10 V in 3 samples is impossible")]
    assert int(mended["voltage_v"].isna().sum()) == 3


def test_many_impossible_values_of_another_column_are_noted():
    _, findings = changed("elevation_m", [9001.0] * 30, elevation_m=5.0)
    assert [f.consequence for f in findings] == ["noted"]
    mended, findings = changed("soc", [50.0] * 30, soc=0.5)
    assert findings[0].what.endswith(": the unit appears to be percent; convert it to a fraction")
    assert mended["soc"].isna().all()  # the other values have the wrong unit too


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("voltage_v", 30.0, 1200.0),
        ("heating_power_w", -500.0, 12_000.0),
        ("requested_heating_power_w", -500.0, 12_000.0),
        ("aircon_power_w", -500.0, 30_000.0),
    ],
)
def test_values_at_the_bounds_are_possible(name, low, high):
    """A heater of more than 12 kW is none; an air conditioner has the bounds of its column."""
    usual = {name: 300.0}
    for value, bad in ((low, 0), (low - 1.0, 1), (high, 0), (high + 1.0, 1)):
        assert len(changed(name, [value], **usual)[1]) == bad


def test_slow_negative_speeds_are_reversing():
    mended, findings = changed("speed_m_s", [0.0, -5.0, -10.0], speed_m_s=3.0)
    assert told(findings) == [(61.0, 62.0, "noted", "2 samples of negative speed are treated as reversing")]
    assert mended["speed_m_s"][49:54].tolist() == [3.0, 0.0, 5.0, 10.0, 3.0]
    mended, findings = changed("speed_m_s", [-10.5], speed_m_s=3.0)
    assert [f.what for f in findings] == ["speed of -10.5 m/s in 1 samples is impossible"]
    assert np.isnan(mended["speed_m_s"][50])


def spiky(values, step_s=1.0):
    speed = np.array(values, dtype=float)
    return np.flatnonzero(speed_spikes(step_s * np.arange(len(speed)), speed)).tolist()


def test_a_spike_is_eight_metres_a_second_from_both_neighbours_within_two_seconds():
    assert spiky([10.0, 18.0, 10.0]) == []
    assert spiky([10.0, 18.5, 10.0]) == [1]
    assert spiky([10.0, 18.5, 11.0]) == []
    assert spiky([10.0, 18.5, 9.0]) == [1]
    assert spiky([20.0, 11.0, 20.0]) == [1]
    assert spiky([0.0, 9.0, 18.5, 9.0]) == [2]
    assert spiky([0.0, 20.0, 40.0]) == []
    assert spiky([10.0, 30.0, 10.0], 1.25) == []
    assert spiky([10.0, 30.0]) == []
    assert spiky([10.0, 10.0, 10.0, 30.0, 10.0, 10.0, 1.0]) == [3]


@pytest.mark.parametrize(
    ("name", "inside", "outside", "unit"),
    [
        ("cabin_temperature_degc", (213.0, 343.0), (212.0, 344.0), "K"),
        ("ambient_temperature_degc", (58.0, 134.6), (57.0, 135.0), "°F"),
        ("soc", (1.5, 100.0), (1.0, 101.0), "percent"),
        ("displayed_soc", (1.5, 100.0), (1.0, 101.0), "percent"),
        ("voltage_v", (9.0, 16.0), (8.0, 17.0), "12 V"),
        ("voltage_v", (30_000.0, 1_200_000.0), (29_999.0, 1_200_001.0), "mV"),
        ("current_a", (3001.0, -3001.0), (3000.0, -3000.0), "mA"),
        ("speed_m_s", (91.0, 300.0), (90.0, 10.0), "km/h"),
    ],
)
def test_a_unit_is_guessed_from_the_middle_or_the_largest_value(name, inside, outside, unit):
    """Temperatures of -60 to 70 °C in K; up to 57 °C, the highest on record, in °F; a car's 12 V grid has 9 to 16 V."""
    assert all(unit in guessed_unit(name, np.array([value, NO])) for value in inside)
    assert all(guessed_unit(name, np.array([value, NO])) == "" for value in outside)


def test_a_guess_needs_the_column_and_the_value():
    assert guessed_unit("elevation_m", np.array([300.0])) == ""
    assert guessed_unit("cabin_temperature_degc", np.array([100.0])) == ""
    assert guessed_unit("voltage_v", np.array([1.0, 12.0, 900.0])) != ""


def test_air_is_never_hotter_than_57_degrees_in_the_mean():
    samples = samples_of(4, ambient_temperature_degc=[50.0, 64.0, NO, 57.0])
    assert blank_fahrenheit(samples, "t")[1] == []
    mended, (finding,) = blank_fahrenheit(
        samples.assign(ambient_temperature_degc=[51.0, 64.0, NO, 57.0]), "t"
    )
    assert mended["ambient_temperature_degc"].isna().all()
    assert finding.what.startswith("mean outside temperature of 57.3 °C is impossible")
    assert blank_fahrenheit(samples.drop(columns="ambient_temperature_degc"), "t")[1] == []


def test_samples_without_a_speed_are_left_out():
    samples = samples_of(4, speed_m_s=[1.0, NO, 3.0, NO])
    assert drop_blank_speed(samples)["time_s"].tolist() == [10.0, 12.0]
    assert drop_blank_speed(samples_of(4))["time_s"].tolist() == [10.0, 11.0, 12.0, 13.0]


def road(height, speed=20.0, step_s=1.0):
    n = len(height)
    columns = {"time_s": 100.0 + step_s * np.arange(n), "speed_m_s": speed, "elevation_m": height}
    return told(mend_heights(pd.DataFrame(columns), "t")[1])


def test_no_road_keeps_its_height_for_two_kilometres():
    assert road([582.0] * 101) == []
    words = "elevation stays at 582 m over 2.0 km: the road is treated as flat"
    assert road([582.0] * 102) == [(100.0, 201.0, "noted", words)]
    assert road([582.0] * 101 + [583.0]) == []
    assert [f[:2] for f in road([582.0, 582.0], step_s=101.0)] == [(100.0, 201.0)]
    assert road([582.0, NO], step_s=101.0) == []
    assert road([NO, NO]) == []


def test_no_road_climbs_more_than_four_tenths_beside_ten_metres_of_noise():
    """On 20 m a road of 40 % rises by 8 m."""
    level = [500.0] * 5
    assert road([*level, 518.0, 518.0]) == []
    words = "elevation jumps 1 times, by up to 18.5 m"
    assert road([*level, 518.5, 518.5]) == [(104.0, 105.0, "noted", words)]
    words = "elevation jumps 2 times, by up to 19.0 m"
    assert road([*level, 518.5, 518.5, 499.5])[0] == (104.0, 107.0, "noted", words)
    faster = np.array([10.0, 30.0, 10.0])  # 40 m in 2 s rise by 16 m
    assert road([500.0, 525.5, 525.5], faster, step_s=2.0) == []
    assert len(road([500.0, 526.5, 526.5], faster, step_s=2.0)) == 1
    parked = np.array([0.0, 0.0, NO, 0.0])
    assert [f[:2] for f in road([500.0, 500.0, 505.0, 510.5], parked)] == [(101.0, 103.0)]


def test_heights_that_no_road_can_have_are_replaced_and_told():
    height = 500.0 + 0.5 * np.arange(120.0)
    logged = np.where(np.arange(120) < 6, 0.0, height)
    logged[60:70] = 6000.0
    samples = pd.DataFrame({"time_s": np.arange(120.0), "speed_m_s": 20.0, "elevation_m": logged})
    mended, findings = mend_heights(samples, "t")
    assert mended["elevation_m"].to_numpy() == pytest.approx(np.where(np.arange(120) < 6, 503.0, height))
    words = "elevation of 0 in 16 samples is a jump: these values are removed"
    assert told(findings)[-1] == (0.0, 69.0, "noted", words)
    assert "jumps 3 times, by up to 5500" not in told(findings)[0][3]
    assert samples["elevation_m"][0] == 0.0
    again, findings = mend_heights(mended, "t")
    assert again is mended
    assert findings == []


def ambient(values, step_s=1.0):
    n = len(values)
    columns = {"time_s": 100.0 + step_s * np.arange(n), "ambient_temperature_degc": values}
    return told(ambient_findings(pd.DataFrame(columns), "t"))


def test_air_that_stays_the_same_for_an_hour_is_not_measured():
    assert ambient([9.0] * 2, 3600.0) == []
    words = "outside temperature stays at 9 °C: it may not be measured"
    assert ambient([9.0] * 2, 3601.0) == [(100.0, 3701.0, "noted", words)]
    assert ambient([9.0, 9.5], 3601.0) == []
    assert ambient([NO, NO], 3601.0) == []
    assert len(ambient([9.0, NO, 9.0], 2000.0)) == 1


@pytest.mark.parametrize("value", [-40.0, 85.0, 127.0, 127.5, 215.0])
def test_the_ends_of_the_usual_codings_are_not_measured(value):
    assert len(ambient([value] * 3)) == 1
    assert ambient([value + 0.25] * 3) == []


def coarse(speed, time):
    return told(coarse_findings(pd.DataFrame({"time_s": time, "speed_m_s": speed}), "t"))


def test_a_speed_that_is_new_every_five_seconds_is_coarse():
    time = np.arange(0.0, 1200.0)
    speed = 12.0 + 8.0 * np.sin(time / 20.0)
    words = "speed is a new value every {} s: accelerations between are unknown, "
    words += "the simulated energy may be off by several percent"
    assert coarse(speed, time) == []
    assert coarse(speed[4 * (np.arange(1200) // 4)], time) == []
    assert coarse(speed[5 * (np.arange(1200) // 5)], time) == [(0.0, 1199.0, "noted", words.format("5.0"))]
    assert coarse(speed[::4], time[::4]) == []
    assert coarse(speed[::5], time[::5]) == [(0.0, 1195.0, "noted", words.format("5.0"))]
    assert coarse(speed[::30], time[::30]) == [(0.0, 1170.0, "noted", words.format("30.0"))]


def test_a_speed_every_half_minute_is_no_drive():
    time = np.arange(0.0, 4000.0)
    speed = 12.0 + 8.0 * np.sin(time / 20.0)
    words = "speed is a new value every 31.0 s: the drive cannot be simulated"
    assert coarse(speed[::31], time[::31]) == [(0.0, 3999.0, "set aside", words)]
    assert coarse(speed[31 * (np.arange(4000) // 31)], time) == [(0.0, 3999.0, "set aside", words)]


def test_a_car_that_stands_may_be_logged_seldom():
    time = np.append(np.arange(0.0, 100.0), 100.0 + 60.0 * np.arange(1, 200))
    speed = np.where(time < 100.0, 10.0 + np.sin(time), 0.0)
    assert coarse(speed, time) == []
    assert coarse([0.0, 0.0], [0.0, 60.0]) == []
    assert coarse([NO], [0.0]) == []


def test_no_log_of_the_public_sets_is_coarse(data_dir):
    for name in ("tum", "ved"):
        logs = tw.read_logs(data_dir / name, name).logs
        assert [f for log in logs for f in coarse_findings(log.samples, log.trip_id)] == []
