"""Speed from coarse logs: true to every measurement, smooth between, and untouched where the log is fine."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.coarse_speed import LOGGERS, errors, held, rounded
from hypothesis import given, settings
from hypothesis import strategies as st

import tripwatt as tw
from tripwatt.sources.mapping import parse_mapping
from tripwatt.sources.table import read_table
from tripwatt.trips.coarse_speed import LONGEST_HOLD_S, rebuild_speed, refresh_time
from tripwatt.trips.messages import message
from tripwatt.units import M_S_PER_KM_H

SEEDS = st.integers(0, 10_000)
STEPS = st.sampled_from([0.2, M_S_PER_KM_H, 0.44704])


def drive(seed, seconds=900, step_s=1.0):
    """A drive with standstills: accelerations with the correlation of traffic."""
    rng = np.random.default_rng(seed)
    time = step_s * np.arange(round(seconds / step_s))
    knots = np.arange(0.0, seconds + 30.0, 15.0)
    wanted = np.maximum(rng.normal(9.0, 8.0, len(knots)), 0.0)
    wanted[::7] = 0.0
    speed = np.interp(time, knots, wanted)
    kernel = np.hanning(max(round(8 / step_s), 3))
    speed = np.convolve(speed, kernel / kernel.sum(), mode="same")
    return time, np.where(speed < 0.05, 0.0, speed)


def changes(values):
    return np.flatnonzero(np.append(True, np.diff(values) != 0.0))


@settings(max_examples=30, deadline=None)
@given(SEEDS, STEPS)
def test_a_rounded_speed_stays_within_half_a_step_and_stands_where_it_stood(seed, step):
    time, true = drive(seed)
    coarse = rounded(true, step)
    rebuilt = rebuild_speed(time, coarse)
    assert rebuilt.held_s == 0.0
    assert rebuilt.step_m_s == pytest.approx(step)
    assert np.abs(rebuilt.speed_m_s - coarse).max() <= step / 2 + 1e-9
    assert (rebuilt.speed_m_s[coarse == 0.0] == 0.0).all()
    assert (rebuilt.speed_m_s >= 0.0).all()
    assert np.abs(rebuilt.speed_m_s - true).mean() < np.abs(coarse - true).mean()
    assert np.trapezoid(rebuilt.speed_m_s, time) == pytest.approx(
        np.trapezoid(true, time), abs=step / 2 * time[-1]
    )
    jerk, jerk_before = (np.square(np.diff(v, 2)).sum() for v in (rebuilt.speed_m_s, coarse))
    assert jerk < jerk_before


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.integers(2, 12), st.sampled_from([0.0, M_S_PER_KM_H]))
def test_a_held_speed_goes_through_its_refreshed_values(seed, rows, step):
    time, true = drive(seed)
    coarse = held(rounded(true, step) if step else true, rows)
    rebuilt = rebuild_speed(time, coarse)
    assert rebuilt.held_s == rows
    fresh = changes(coarse)
    assert np.abs(rebuilt.speed_m_s - coarse)[fresh].max() <= rebuilt.step_m_s / 2 + 1e-9
    assert (rebuilt.speed_m_s[fresh][coarse[fresh] == 0.0] == 0.0).all()
    assert (rebuilt.speed_m_s >= 0.0).all()
    assert rebuilt.speed_m_s.max() <= coarse.max() + rebuilt.step_m_s / 2 + 1e-9
    assert np.abs(rebuilt.speed_m_s - true).mean() < 0.75 * np.abs(coarse - true).mean()
    assert np.trapezoid(rebuilt.speed_m_s, time) == pytest.approx(np.trapezoid(true, time), rel=0.04, abs=100)


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.sampled_from([0.0, 0.01, 0.1]), st.sampled_from([0.1, 1.0, 5.0]))
def test_a_fine_speed_is_the_same_array(seed, step, step_s):
    time, speed = drive(seed, step_s=step_s)
    speed = rounded(speed, step) if step else speed
    rebuilt = rebuild_speed(time, speed)
    assert rebuilt.speed_m_s is speed
    assert (rebuilt.held_s, rebuilt.step_m_s) == (0.0, 0.0)


def test_a_rounded_cruise_is_not_held():
    """A motorway in whole km/h: the value stands for half a minute and moves on by one step."""
    time = np.arange(0.0, 3600.0)
    speed = 30.0 + 2.0 * np.sin(time / 120.0)
    speed[:40] *= np.arange(40) / 40.0
    assert refresh_time(time, rounded(speed, M_S_PER_KM_H)) == 0.0


def test_a_standstill_lasts_until_one_refresh_before_the_start():
    time, true = drive(3)
    true[400:460] = 0.0
    rebuilt = rebuild_speed(time, held(true, 5)).speed_m_s
    assert (rebuilt[400:456] == 0.0).all()


def test_values_that_are_older_than_half_a_minute_stay_as_they_are():
    time, true = drive(4, 7200)
    coarse = held(true, 40)
    assert refresh_time(time, coarse) == 40.0 > LONGEST_HOLD_S
    assert rebuild_speed(time, coarse).speed_m_s is coarse


@pytest.mark.parametrize("speed", [[], [3.0], [np.nan] * 3, [0.0] * 40, [0.0, 20.0] * 20, [5.0] * 40])
def test_few_and_missing_values_stay_as_they_are(speed):
    speed = np.array(speed, dtype=float)
    rebuilt = rebuild_speed(np.arange(len(speed), dtype=float), speed)
    assert np.array_equal(rebuilt.speed_m_s, speed, equal_nan=True)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_missing_values_stay_missing_and_bad_times_keep_their_value(seed):
    rng = np.random.default_rng(seed)
    time, true = drive(seed)
    coarse = held(rounded(true, M_S_PER_KM_H), 3)
    coarse[rng.random(len(time)) < 0.05] = np.nan
    coarse[499] = 5.0
    time[500] = time[499]
    time[600] = 0.0
    time[700] = np.nan
    rebuilt = rebuild_speed(time, coarse)
    assert np.array_equal(np.isnan(rebuilt.speed_m_s), np.isnan(coarse))
    assert np.array_equal(rebuilt.speed_m_s[[500, 600, 700]], coarse[[500, 600, 700]], equal_nan=True)
    assert rebuilt.held_s > 0.0


def test_missing_values_that_may_be_filled_are_lines_and_zero_after_a_standstill():
    nan = np.nan
    speed = np.array([nan, 4.0, nan, 6.0, 0.0, nan, nan, 2.0, nan, nan, nan])
    filled = np.array([nan, 4.0, 4.0, 6.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0, nan])
    found = rebuild_speed(np.arange(11.0), speed, filled).speed_m_s
    assert np.array_equal(found, [nan, 4.0, 5.0, 6.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0, nan], equal_nan=True)


def test_the_reader_of_tables_rebuilds_and_notes_it(tmp_path):
    time, true = drive(5)
    coarse = np.round(held(true, 5) / M_S_PER_KM_H)
    table = pd.DataFrame({"t": time, "v": coarse, "u": 380.0 + np.sin(time), "i": 20.0 + np.cos(time)})
    table.to_csv(tmp_path / "a.csv", index=False)
    columns = 'time_s = {column = "t"}\nspeed_m_s = {column = "v", unit = "km/h"}\n'
    columns += 'voltage_v = {column = "u"}\ncurrent_a = {column = "i"}\n'
    fleet = read_table(tmp_path / "a.csv", parse_mapping("[columns]\n" + columns, "my.toml"))
    (log,) = fleet.logs
    assert np.array_equal(log.array("speed_m_s"), rebuild_speed(time, coarse * M_S_PER_KM_H).speed_m_s)
    assert np.array_equal(log.array("current_a"), table["i"])
    (note,) = [n for n in fleet.notes if n.code == "speed_rebuilt"]
    assert (note.subject, note.value, note.unit) == ("trip a", 5.0, "s")
    assert message(note).startswith("trip a: the speed is logged only every 5 s")


@pytest.mark.parametrize(
    "name", ["every 1 s, whole mph", "every 1 s, held 3 to 10 s", "every 1 s, held 10 s, whole km/h"]
)
def test_the_error_of_real_drives_falls(data_dir, name):
    trips = tw.read_trips(data_dir / "tum", "tum")[4:6]
    stands, rebuilt = errors(trips, LOGGERS[name])[:, :, 0].mean(axis=0)
    assert rebuilt < 0.6 * stands
