"""Measured energy: it is additive; its standard error by rounding, seldom samples, a state of charge."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.trips.logs import log, steps

import tripwatt as tw
from tripwatt.sources.mapping import parse_mapping
from tripwatt.sources.table import read_table
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip, observed_energy
from tripwatt.trips.energy import POWER_TIME_S, _of_sampling, observed_energy_std, resolution


def power_of(seed, seconds=1800, mean=12_000.0, sd=14_000.0):
    """A power with the correlation of a car's, every 0.1 s."""
    rng, keep = np.random.default_rng(seed), np.exp(-0.1 / POWER_TIME_S)
    noise = rng.normal(0.0, sd * np.sqrt(1.0 - keep**2), 10 * seconds)
    power = np.empty(len(noise))
    power[0] = rng.normal(0.0, sd)
    for i in range(1, len(noise)):
        power[i] = keep * power[i - 1] + noise[i]
    return np.arange(len(noise)) * 0.1, mean + power


def std_of(time, voltage_v, current_a):
    return observed_energy_std(pd.DataFrame({"time_s": time, "voltage_v": voltage_v, "current_a": current_a}))


def poorly_logged(time, power, step_w, every_s):
    """Measured energy [Wh] and its standard error of a log with whole steps, now and then."""
    rows = np.arange(0, len(time), round(10 * every_s))
    rows = rows if rows[-1] == len(time) - 1 else np.append(rows, len(time) - 1)
    seen = step_w * np.round(power[rows] / step_w)
    std = std_of(time[rows], 400.0, seen / 400.0)
    return np.trapezoid(seen, time[rows]) / 3600.0, std or 0.0


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 1000), factor=st.integers(2, 10), step=st.sampled_from([100.0, 500.0, 1000.0]))
def test_a_coarser_log_is_not_better_known(seed, factor, step):
    time, power = power_of(seed, 300, mean=3000.0, sd=6000.0)
    fine, coarse = (poorly_logged(time, power, step * k, 1.0)[1] for k in (1, factor))
    assert coarse >= 0.97 * fine  # the variance of the power is itself read from what was rounded
    fine, coarse = (poorly_logged(time, power, step, every)[1] for every in (1.0, 5.0))
    assert coarse >= fine


@pytest.mark.parametrize(("step_w", "every_s"), [(1000.0, 5.0), (1.0, 5.0), (1.0, 20.0), (1000.0, 60.0)])
def test_errors_have_the_standard_deviation_that_the_log_carries(step_w, every_s):
    scores = []
    for seed in range(80):
        time, power = power_of(seed, 1200)
        energy, std = poorly_logged(time, power, step_w, every_s)
        scores.append((energy - np.trapezoid(power, time) / 3600.0) / std)
    assert 0.7 < np.std(scores) < 1.3


def test_the_error_of_rounding_alone():
    """A power that crosses many steps between two samples: r / sqrt(12) each, T d of them."""
    rng = np.random.default_rng(0)
    time, scores = np.arange(1200.0), []
    for _ in range(200):
        power = rng.uniform(-20_000.0, 40_000.0, len(time))
        seen = 1000.0 * np.round(power / 1000.0)
        scores.append(np.trapezoid(seen - power, time))
    expected = 1000.0 / np.sqrt(12.0) * np.sqrt(1200.0)
    assert np.std(scores) == pytest.approx(expected, rel=0.15)


def test_the_error_between_samples_against_its_double_integral():
    time, sd = np.array([0.0, 3.0, 4.0, 24.0]), 2.0
    fine = np.linspace(0.0, 24.0, 2401)
    weight = np.full(len(fine), 0.01)
    weight[[0, -1]] = 0.005
    by_hand = np.zeros(len(fine))
    gaps = np.diff(time)
    for place, w in zip(time, 0.5 * (np.append(gaps, 0.0) + np.append(0.0, gaps)), strict=True):
        by_hand[np.searchsorted(fine, place - 1e-9)] -= w
    both = weight + by_hand
    covariance = sd**2 * np.exp(-np.abs(fine[:, None] - fine[None, :]) / POWER_TIME_S)
    assert _of_sampling(time, sd**2) == pytest.approx(both @ covariance @ both, rel=0.01)


def test_a_well_measured_energy_carries_nothing():
    time, power = power_of(1)
    assert std_of(time, 400.0, power / 400.0) is None
    assert std_of(time[:1], time[:1], time[:1]) is None
    assert std_of([0.0, 9.0, 5.0], 1.0, 1.0) is None


@pytest.mark.parametrize(
    ("values", "step"),
    [
        ([0.0, 1000.0, 5000.0], 1000.0),
        ([4.0, 10.0, 19.0], 3.0),
        ([0.81, 0.8, 0.78], 0.01),
        (np.sqrt(np.arange(40.0)), 0.0),
        ([5.0, 5.0], 0.0),
        ([np.nan, 2.0, 2.5], 0.5),
    ],
)
def test_the_step_of_values(values, step):
    assert resolution(np.array(values)) == pytest.approx(step, rel=1e-6)


def by_charge(tmp_path, percent, more=""):
    table = pd.DataFrame({"t": np.arange(len(percent)) * 60.0, "v": 50.0, "soc": percent})
    table.to_csv(tmp_path / "log.csv", index=False)
    text = f"""
    [columns]
    time_s = {{ column = "t" }}
    speed_m_s = {{ column = "v", unit = "km/h" }}
    soc = {{ column = "soc", unit = "%" }}
    [battery]
    usable_capacity_kwh = 21.6
    usable_capacity_uncertainty = 0.0
    {more}
    """
    (log,) = read_table(tmp_path / "log.csv", parse_mapping(text, "my.toml")).logs
    return log


def test_errors_of_an_energy_from_whole_percents(tmp_path):
    rng, scores = np.random.default_rng(0), []
    for _ in range(60):
        soc = np.linspace(rng.uniform(60.0, 90.0), rng.uniform(30.0, 50.0), 20)
        log = by_charge(tmp_path, np.round(soc))
        scores.append((log.observed_energy_wh - 216.0 * (soc[0] - soc[-1])) / log.observed_energy_std_wh)
    assert 0.7 < np.std(scores) < 1.3
    assert log.observed_energy_std_wh == pytest.approx(216.0 / np.sqrt(6.0), rel=1e-6)


def test_a_full_battery_gives_more_energy_with_each_percent(tmp_path):
    car = 'vehicle = "bmw_i3_60ah"'
    plain = by_charge(tmp_path, [90.0, 80.0]).observed_energy_wh
    full = by_charge(tmp_path, [90.0, 80.0], car).observed_energy_wh
    empty = by_charge(tmp_path, [30.0, 20.0], car).observed_energy_wh
    battery = tw.load_vehicle("bmw_i3_60ah").battery
    parts = np.linspace(0.0, 1.0, 20_001)
    voltage = np.interp(parts, battery.ocv_soc, battery.ocv_v)
    expected = 2160.0 * voltage[(parts >= 0.8) & (parts <= 0.9)].mean() / voltage.mean()
    assert full == pytest.approx(expected, rel=1e-4)
    assert empty < plain < full
    with pytest.raises(tw.InvalidInput, match="unknown vehicle"):
        by_charge(tmp_path, [90.0, 80.0], 'vehicle = "../secret"')


def test_the_common_part_is_no_error_of_a_single_trip():
    trip = synthetic_fleet(1).trips[0]
    vague = replace(
        trip, observed_energy_wh=2000.0, observed_energy_std_wh=130.0, observed_energy_common_std=0.025
    )
    assert vague.observed_energy_own_std_wh == pytest.approx(120.0)
    assert trip.observed_energy_own_std_wh == (trip.observed_energy_std_wh or 0.0)


@given(steps, st.data())
@settings(max_examples=60, deadline=None)
def test_energy_adds_up_over_a_cut(gaps, data):
    samples = log(np.cumsum([0.0, *gaps]))
    cut = data.draw(st.integers(1, len(samples) - 2))
    parts = observed_energy(samples.iloc[: cut + 1]) + observed_energy(samples.iloc[cut:])
    assert parts == pytest.approx(observed_energy(samples), rel=1e-9, abs=1e-9)


def test_energy_bridges_missing_current():
    samples = log(np.arange(5.0))
    samples["voltage_v"], samples["current_a"] = 360.0, 10.0
    samples.loc[2, "current_a"] = np.nan
    assert observed_energy(samples) == pytest.approx(360 * 10 * 4 / 3600)


def test_discharge_is_positive():
    samples = log(np.arange(3.0)).assign(voltage_v=400.0, current_a=9.0)
    assert Trip.from_samples("t", samples).observed_energy_wh == pytest.approx(2.0)


def test_energy_is_the_trapezoid_of_voltage_times_current():
    samples = pd.DataFrame(
        {
            "time_s": [0.0, 10.0, 40.0],
            "speed_m_s": 0.0,
            "voltage_v": [400.0, 380.0, 360.0],
            "current_a": [0.0, 20.0, -10.0],
        }
    )
    by_hand = (0.5 * (0 + 7600) * 10 + 0.5 * (7600 - 3600) * 30) / 3600
    assert observed_energy(samples) == pytest.approx(by_hand, rel=1e-12)
