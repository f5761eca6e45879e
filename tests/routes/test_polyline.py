"""Encoded polylines."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.routes.made import TO_ROUNDING, encode_polyline

from tripwatt.errors import InvalidInput
from tripwatt.routes import points, polyline
from tripwatt.routes.polyline import decode_polyline


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
    with pytest.raises(InvalidInput, match="not an encoded polyline"):
        decode_polyline(text, "t")


def test_lengths_of_polylines(monkeypatch):
    monkeypatch.setattr(polyline, "MAX_POINTS", 2)
    monkeypatch.setattr(points, "MAX_POINTS", 2)
    assert len(decode_polyline("?" * 4, "t")) == 2
    with pytest.raises(InvalidInput, match="too many points"):
        decode_polyline("?" * 6, "t")
    with pytest.raises(InvalidInput, match="too many points"):
        decode_polyline("?" * 64, "t")
    with pytest.raises(InvalidInput, match="polyline too long"):
        decode_polyline("?" * 65, "t")
