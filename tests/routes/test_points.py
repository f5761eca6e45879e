"""Points on the earth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.routes.made import TO_ROUNDING, encode_polyline
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.routes import points
from tripwatt.routes.points import decode_polyline, haversine_m, require_on_earth


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
    refuses(r"91° \(and 1 more point\)", require_on_earth, np.array([0.0, 91.0, 92.0]), np.zeros(3), "t")


@settings(max_examples=100)
@given(
    st.lists(
        st.tuples(st.floats(-90, 90), st.floats(-180, 180), st.floats(-400, 8000)), min_size=2, max_size=30
    )
)
def test_polylines_round_trip(points):
    flat = [p[:2] for p in points]
    np.testing.assert_allclose(
        decode_polyline(encode_polyline(flat, [1e6, 1e6]), "t", precision=1e6), flat, atol=1e-6
    )
    np.testing.assert_allclose(
        decode_polyline(encode_polyline(points, [1e5, 1e5, 100]), "t", dimensions=3), points, atol=0.006
    )


def test_polylines_by_hand():
    """Five bits to a character, the lowest first, 63 added, 32 where more follow; the sign is the lowest bit."""
    np.testing.assert_allclose(decode_polyline("A@A@", "t"), [[1e-5, -1e-5], [2e-5, -2e-5]], **TO_ROUNDING)
    np.testing.assert_allclose(
        decode_polyline("_AC??", "t", precision=10.0), [[3.2, 0.2], [3.2, 0.2]], **TO_ROUNDING
    )
    three = decode_polyline("AC" + "_A" + "??" + "@", "t", dimensions=3)
    np.testing.assert_allclose(three, [[1e-5, 2e-5, 0.32], [1e-5, 2e-5, 0.31]], **TO_ROUNDING)
    assert not decode_polyline("_" * 9 + "????", "t").any()
    np.testing.assert_allclose(decode_polyline("~@???", "t", precision=10.0)[0], [-3.2, 0.0], **TO_ROUNDING)


@pytest.mark.parametrize("text", ["", "AA", "AAA", "AAA_", "AA>A", "AA\x7fA", "_" * 10 + "????"])
def test_broken_polylines(text):
    refuses("not an encoded polyline", decode_polyline, text, "t")


def test_lengths_of_polylines(monkeypatch):
    monkeypatch.setattr(points, "MAX_POINTS", 2)
    assert len(decode_polyline("?" * 4, "t")) == 2
    refuses("too many points", decode_polyline, "?" * 6, "t")
    refuses("too many points", decode_polyline, "?" * 64, "t")
    refuses("polyline too long", decode_polyline, "?" * 65, "t")
