"""The climb of a road from the heights of places: expected values and errors against fields whose heights are all known."""

import numpy as np
import pytest
from tests.support.height_field import KM_DEG, height_field

from tripwatt.roads.maps.heights import KnownHeights
from tripwatt.routes.terrain import GROWTH, REFERENCE_M
from tripwatt.trips.plan import KnownClimb


def field(rng, scale_m, places=80, points=13, size_km=20.0):
    """Heights of places of a square, and of a road through it."""
    road = np.column_stack((np.linspace(3.0, size_km - 3.0, points), np.full(points, 0.5 * size_km)))
    at_km = np.vstack((rng.uniform(0.0, size_km, (places, 2)), road))
    heights = height_field(rng, scale_m, at_km)
    latitude, longitude = (KM_DEG * at_km).T
    known = KnownHeights(latitude[:places], longitude[:places], heights[:places])
    return (
        known,
        (latitude[places:], longitude[places:], 1000.0 * (road[:, 0] - road[0, 0])),
        heights[places:],
    )


def test_errors_of_the_climb_are_as_large_as_stated():
    """Over 300 fields of scales from 20 to 600 m: a tenth of the climbs are outside of the 90 % interval at the middle and at the end."""
    rng = np.random.default_rng(3)
    scores, starts = [], []
    for scale_m in np.geomspace(20.0, 600.0, 300):
        known, road, height_m = field(rng, scale_m)
        climb = known.climb(*road)
        error = height_m - height_m[0] - climb.climb_m
        scores.append((error / np.maximum(climb.sd_m, 1e-9))[[6, -1]])
        starts.append((height_m[0] - climb.start_m) / scale_m)
    assert np.mean(starts) == pytest.approx(0.0, abs=0.05)
    assert np.std(starts) < 0.7
    assert np.mean(np.abs(scores) > 1.645, axis=0) == pytest.approx([0.1, 0.1], abs=0.05)
    assert np.std(scores, axis=0) == pytest.approx([1.0, 1.0], abs=0.15)


def test_places_beside_the_road_leave_a_small_error_and_far_ones_that_of_the_terrain():
    rng = np.random.default_rng(5)
    known, (latitude, longitude, position_m), _ = field(rng, 250.0)
    near = known.climb(latitude, longitude, position_m).sd_m[-1]
    far = known.climb(latitude + 1.0, longitude, position_m).sd_m[-1]
    alone = 250.0 * (position_m[-1] / REFERENCE_M) ** GROWTH
    assert near < 0.6 * alone < far < 2.0 * alone
    climb = known.climb(latitude, longitude, position_m)
    back = known.climb(latitude[::-1], longitude[::-1], position_m)
    assert back.climb_m[-1] == pytest.approx(-climb.climb_m[-1], abs=1e-6)
    assert back.sd_m[-1] == pytest.approx(climb.sd_m[-1], rel=1e-6)
    assert climb.climb_m[0] == climb.sd_m[0] == 0.0


def test_a_wrong_height_widens_all_errors():
    rng = np.random.default_rng(7)
    known, road, _ = field(rng, 100.0)
    nearest = np.argmin(np.hypot(known.latitude_deg - road[0][6], known.longitude_deg - road[1][6]))
    heights = np.where(np.arange(80) == nearest, 3000.0, known.height_m)
    wrong = KnownHeights(known.latitude_deg, known.longitude_deg, heights)
    assert wrong.climb(*road).sd_m[-1] > 2.0 * known.climb(*road).sd_m[-1]


def test_too_few_heights_show_nothing_and_the_shape_is_that_of_a_climb():
    rows = [(47.0 + 0.01 * k, 9.0, 400.0 + 10.0 * k) for k in range(10)]
    assert KnownHeights.from_rows(rows[:9]) is None
    heights = KnownHeights.from_rows(rows)
    climb = heights.climb(np.array([47.0, 48.0]), np.array([9.0, 9.0]), np.array([0.0, 150_000.0]))
    assert isinstance(climb, KnownClimb)
    assert climb.distance_m.shape == climb.climb_m.shape == climb.sd_m.shape == (61,)
