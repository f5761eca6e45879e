"""Elevation that was interpolated in time: found, put over distance, left alone where it was measured; and heights that no road can have."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.arrays import distance_driven
from tripwatt.physics import simulate
from tripwatt.trips.elevation import (
    MIN_BETWEEN_FIXES_S,
    MIN_FAULT_M,
    elevation_over_distance,
    heights_of_a_road,
)
from tripwatt.vehicles import load_vehicle


def stop_and_go(seconds: int = 1201, seed: int = 0):
    """Time and speed of a car that stands for a third of the time."""
    time = np.arange(float(seconds))
    speed = 12.0 * (np.sin(2 * np.pi * time / 240.0 + seed) > -0.5)
    return time, speed


def test_fixes_stay_and_heights_between_them_follow_the_distance():
    time, speed = stop_and_go()
    fixes, heights = np.array([0, 200, 420, 900, 1200]), np.array([500.0, 507.0, 501.5, 530.0, 530.0])
    logged = np.round(np.interp(time, time[fixes], heights), 2)
    found = elevation_over_distance(time, speed, logged)
    place = distance_driven(time, speed)
    np.testing.assert_allclose(found, np.interp(place, place[fixes], heights), atol=0.02)
    assert np.ptp(found[speed == 0.0][:40]) < np.ptp(logged[speed == 0.0][:40])


def test_nothing_climbs_at_a_standstill():
    time, speed = stop_and_go()
    found = elevation_over_distance(time, speed, np.round(450.0 + 0.05 * time, 2))
    stands = (speed[1:] == 0.0) & (speed[:-1] == 0.0)
    assert np.abs(np.diff(found))[stands].max() == 0.0
    assert abs(found[-1] - 510.0) < 0.02


def test_measured_heights_stay_as_they_are():
    time, speed = stop_and_go()
    hills = (
        500.0
        + 20.0 * np.sin(distance_driven(time, speed) / 400.0)
        + np.random.default_rng(1).normal(0, 0.3, 1201)
    )
    np.testing.assert_array_equal(elevation_over_distance(time, speed, hills), hills)


def test_fixes_nearer_than_the_least_time_are_a_measurement():
    time, speed = stop_and_go()
    for spacing, changes in ((MIN_BETWEEN_FIXES_S - 10.0, False), (MIN_BETWEEN_FIXES_S + 10.0, True)):
        fixes = np.arange(0.0, 1201.0, spacing)
        heights = 500.0 + 5.0 * (np.arange(len(fixes)) % 2)
        logged = np.interp(time, fixes, heights)
        assert (elevation_over_distance(time, speed, logged) != logged).any() == changes


def test_missing_heights_stay_missing():
    time, speed = stop_and_go()
    logged = 450.0 + 0.05 * time
    logged[[0, 300, 301, 1200]] = np.nan
    found = elevation_over_distance(time, speed, logged)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(logged))
    nothing = np.full(1201, np.nan)
    np.testing.assert_array_equal(elevation_over_distance(time, speed, nothing), nothing)


@st.composite
def sound_roads(draw):
    """Time, distance and height of a drive of some 14 km: hills, a pass of up to 18 %, steps of a metre, a drift at a stop."""
    step_s = draw(st.sampled_from([0.1, 1.0]))
    time = step_s * np.arange(round(900.0 / step_s) + 1)
    speed = np.clip(16.0 + 6.0 * np.sin(time / 40.0) + 4.0 * np.sin(time / 13.0), 3.0, None)
    stop = (time > 300.0) & (time < 340.0)
    speed[stop] = 0.0
    way = distance_driven(time, speed)
    pass_grade, hill = draw(st.sampled_from([0.0, 0.05, 0.18])), draw(st.sampled_from([0.0, 8.0, 20.0]))
    height = pass_grade * np.minimum(way, way[-1] - way) + hill * np.sin(way / 500.0)
    height += 20.0 * np.interp(time, [300.0, 340.0, 600.0], [0.0, draw(st.sampled_from([0.0, 0.4])), 0.0])
    resolution = draw(st.sampled_from([0.01, 1.0]))
    return time, speed, way, resolution * np.round((100.0 + height - height.min()) / resolution)


def climb_of(time, way, height):
    return float(np.diff(heights_of_a_road(time, way, height)).sum())


@settings(max_examples=20, deadline=None)
@given(sound_roads())
def test_a_sound_road_stays_as_it_is(road):
    time, _, way, height = road
    assert heights_of_a_road(time, way, height) is height
    with_gaps = np.where((time > 100.0) & (time < 150.0), np.nan, height)
    assert heights_of_a_road(time, way, with_gaps) is with_gaps


@settings(max_examples=20, deadline=None)
@given(
    sound_roads(),
    st.lists(st.tuples(st.floats(30.0, 840.0), st.floats(1.0, 60.0)), min_size=1, max_size=4),
    st.sampled_from([0.0, 6000.0, -400.0, 2500.0]),
)
def test_voids_on_the_way_climb_nothing(road, voids, value):
    """The climb stays, and so does every height outside of the voids; a step of 1 m beside one may count to its jump."""
    time, _, way, height = road
    logged = height.copy()
    for start, long in voids:
        logged[(time >= start) & (time < start + long)] = value
    sound = heights_of_a_road(time, way, logged)
    known = logged == height
    assert sound[known] == pytest.approx(height[known], abs=1.5)
    between = np.interp(way, way[known], height[known])
    assert sound[~known] == pytest.approx(between[~known], abs=1.5)


@settings(max_examples=20, deadline=None)
@given(sound_roads(), st.floats(1.0, 60.0), st.booleans(), st.sampled_from([0.0, 6000.0, -450.0]))
def test_a_void_at_an_end_is_level(road, seconds, at_start, value):
    time, _, way, height = road
    unknown = time < seconds if at_start else time > time[-1] - seconds
    sound = heights_of_a_road(time, way, np.where(unknown, value, height))
    nearest = height[~unknown][0 if at_start else -1]
    assert sound == pytest.approx(np.where(unknown, nearest, height), abs=1.5)


@settings(max_examples=20, deadline=None)
@given(sound_roads(), st.floats(1.0, 60.0), st.sampled_from([250.0, -1000.0, 6000.0]))
def test_an_offset_at_the_end_keeps_the_slopes(road, seconds, offset):
    """The rise of one sample is unknown."""
    time, _, way, height = road
    logged = height + np.where(time > time[-1] - seconds, offset, 0.0)
    assert climb_of(time, way, logged) == pytest.approx(height[-1] - height[0], abs=6.0)


@pytest.mark.parametrize("drift", [150.0, 300.0, -300.0])
@pytest.mark.parametrize("back_at_once", [True, False])
def test_a_drift_in_a_tunnel_that_jumps_back_is_left_out(drift, back_at_once):
    time = np.arange(900.0)
    way = 18.0 * time
    height = 500.0 + 15.0 * np.sin(way / 2000.0)
    part = np.interp(way, [6000.0, 8000.0], [0.0, 1.0])
    off = np.where((way > 6000.0) & (way < 8000.0), drift * (part if back_at_once else 1.0 - part), 0.0)
    sound = heights_of_a_road(time, way, height + off)
    assert np.abs(sound - height).max() < 45.0
    assert sound[[0, -1]] == pytest.approx(height[[0, -1]])


def test_zeros_in_the_middle_and_at_the_ends_take_the_energy_of_the_road():
    car = load_vehicle("bmw_i3_60ah")
    time = np.arange(1000.0)
    speed = np.full(1000, 18.0)
    height = 420.0 + 25.0 * np.sin(time / 60.0)
    expected = simulate(car, time, speed, elevation_m=height).simulated_energy_wh
    for first, last in ((0, 1), (0, 6), (0, 20), (300, 360), (300, 301), (994, 1000), (999, 1000)):
        for value in (0.0, 6000.0):
            logged = height.copy()
            logged[first:last] = value
            energy = simulate(car, time, speed, elevation_m=logged).simulated_energy_wh
            assert energy == pytest.approx(expected, rel=0.03)


def test_a_jump_between_two_sample_heights_that_a_held_sensor_catches_up_with_stays():
    """At 200 m of base; beside 0 m at an end every jump is that of the first fix."""
    time = np.arange(400.0)
    for size in (MIN_FAULT_M, -MIN_FAULT_M, 25.0):
        logged = np.where(time < 100.0, 200.0, 200.0 + size)
        assert heights_of_a_road(time, 15.0 * time, logged) is logged
    logged = np.where(time < 20.0, 0.0, 30.0 + 0.1 * time)
    assert heights_of_a_road(time, 15.0 * time, logged)[0] == 32.0
    logged = np.where(time < 100.0, 200.0, 201.0 + MIN_FAULT_M)
    assert heights_of_a_road(time, 15.0 * time, logged) == pytest.approx(np.full(400, 201.0 + MIN_FAULT_M))


def test_what_is_left_out_needs_no_known_height_beside_it():
    time = np.arange(3.0)
    for heights in ([np.nan] * 3, [np.nan, 5.0, np.nan], [0.0, 500.0, 0.0], [0.0, 0.0, 500.0]):
        sound = heights_of_a_road(time, 20.0 * time, np.array(heights))
        assert np.isfinite(sound).tolist() == np.isfinite(heights).tolist()
        assert np.nanmax(sound, initial=0.0) - np.nanmin(sound, initial=9000.0) <= 0.0


def test_jumps_at_every_sample_take_linear_time():
    rng = np.random.default_rng(4)
    time = np.arange(20_000.0)
    logged = rng.uniform(-500.0, 9000.0, 20_000)
    before = logged.copy()
    sound = heights_of_a_road(time, 20.0 * time, logged)
    assert (logged == before).all()
    assert np.isfinite(sound).all()
