"""Net climb of a road of which places beside it tell something."""

import numpy as np
import pytest

from tripwatt.routes.terrain import KnownClimb, net_climbs

KNOWN = KnownClimb(np.array([0.0, 5e3, 2e4]), np.array([0.0, 40.0, 10.0]), np.array([0.0, 8.0, 200.0]), 500.0)


@pytest.mark.parametrize("from_m", [0.0, 3000.0])
def test_a_known_climb_is_exact_within_its_error_and_on_the_way_within_that_of_unknown_terrain(from_m):
    unknown, ahead = net_climbs("flat"), np.array([2e3, 5e3, 1.2e4, 1.7e4])
    at, ends = from_m + ahead, np.array([from_m])
    expected = np.interp(at, KNOWN.distance_m, KNOWN.climb_m) - np.interp(
        ends, KNOWN.distance_m, KNOWN.climb_m
    )
    sd = np.hypot(*(np.interp(x, KNOWN.distance_m, KNOWN.sd_m) for x in (at, ends)))
    typical = np.array([float(unknown.typical_m(m)) for m in ahead])
    share = np.minimum(sd / typical, 1.0) if from_m else sd / typical
    found, free = unknown.given(KNOWN).net_m(ahead, from_m), unknown.net_m(ahead)
    inner = np.abs(unknown.over_10_km_m) < 20.0  # the limits of the terrain are far away
    assert (found - expected)[inner] == pytest.approx((share * free)[inner], rel=0.01)
