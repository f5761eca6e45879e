"""Elevation that was interpolated in time: found, put over distance, and left alone where it was measured."""

import numpy as np

from tripwatt.trips.elevation import LEAST_BETWEEN_FIXES_S, elevation_over_distance


def stop_and_go(seconds: int = 1201, seed: int = 0):
    """Time and speed of a car that stands for a third of the time."""
    time = np.arange(float(seconds))
    speed = 12.0 * (np.sin(2 * np.pi * time / 240.0 + seed) > -0.5)
    return time, speed


def driven(time, speed):
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))))


def test_fixes_stay_and_heights_between_them_follow_the_distance():
    time, speed = stop_and_go()
    fixes, heights = np.array([0, 200, 420, 900, 1200]), np.array([500.0, 507.0, 501.5, 530.0, 530.0])
    logged = np.round(np.interp(time, time[fixes], heights), 2)
    found = elevation_over_distance(time, speed, logged)
    place = driven(time, speed)
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
    hills = 500.0 + 20.0 * np.sin(driven(time, speed) / 400.0) + np.random.default_rng(1).normal(0, 0.3, 1201)
    np.testing.assert_array_equal(elevation_over_distance(time, speed, hills), hills)


def test_fixes_nearer_than_the_least_time_are_a_measurement():
    time, speed = stop_and_go()
    for spacing, changes in ((LEAST_BETWEEN_FIXES_S - 10.0, False), (LEAST_BETWEEN_FIXES_S + 10.0, True)):
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
