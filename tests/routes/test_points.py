"""Points on the earth."""

import numpy as np
import pytest
from tests.routes.made import TO_ROUNDING

from tripwatt.errors import InvalidInput
from tripwatt.routes.points import haversine_m, require_on_earth


def test_distances_on_the_sphere():
    """The mean radius of the earth is 6371.0088 km."""
    quarter = np.pi / 2.0 * 6_371_008.8
    np.testing.assert_allclose(haversine_m([0.0, 90.0], [0.0, 0.0]), quarter, **TO_ROUNDING)
    np.testing.assert_allclose(
        haversine_m([0.0, 0.0, 0.0], [-45.0, 45.0, 46.0]), [quarter, quarter / 90.0], rtol=1e-9
    )
    np.testing.assert_allclose(haversine_m([90.0, -90.0], [0.0, 77.0]), 2.0 * quarter, **TO_ROUNDING)
    # at 60 degrees a degree of longitude: sin(d / 2R) = cos 60 sin 0.5
    degree = 2.0 * 6_371_008.8 * np.arcsin(0.5 * np.sin(np.radians(0.5)))
    np.testing.assert_allclose(haversine_m([60.0, 60.0], [10.0, 11.0]), degree, rtol=1e-9)
    # from the equator to 60 degrees, a quarter turn away: the central angle has a cosine of 0
    np.testing.assert_allclose(haversine_m([0.0, 60.0], [0.0, 90.0]), quarter, rtol=1e-9)


def test_places_on_earth():
    require_on_earth(np.array([90.0, -90.0]), np.array([180.0, -180.0]), "t")
    for lat, lon, words in ((90.1, 0.0, "point 2, latitude"), (0.0, -180.1, "point 2, longitude")):
        with pytest.raises(InvalidInput, match=words):
            require_on_earth(np.array([0.0, lat]), np.array([0.0, lon]), "t")
    with pytest.raises(InvalidInput, match=r"91° \(and 1 more points\)"):
        require_on_earth(np.array([0.0, 91.0, 92.0]), np.zeros(3), "t")
