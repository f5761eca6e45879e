"""Rules on single columns, each threshold from both sides."""

import numpy as np
import pandas as pd
import pytest
from tests.auditing.findings import NO, told

from tripwatt.auditing.ranges import (
    blank_fahrenheit,
    blank_impossible,
    blank_infinite,
    drop_blank_speed,
    guessed_unit,
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
