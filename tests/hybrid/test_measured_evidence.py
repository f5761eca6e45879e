"""An energy that is not well known teaches a second car less."""

import numpy as np
import pytest

from tripwatt.hybrid.hierarchy import Evidence


def test_the_error_of_a_measurement_does_not_scale_with_that_of_the_model():
    flat = np.ones((3, 2))
    noise, measured = np.array([100.0, 400.0, 900.0]), np.array([0.0, 50.0, 70.0])
    told = Evidence(flat, flat, flat, flat, noise, np.zeros(3), measured)
    exact = Evidence(flat, flat, flat, flat, noise, np.zeros(3))
    for scale in (0.25, 1.0, 4.0):
        assert told.error_wh2(scale) == pytest.approx(exact.error_wh2(scale) + measured)
        assert exact.error_wh2(scale) == pytest.approx(scale * noise)
    part = told.take([2, 0])
    assert part.error_wh2(2.0) == pytest.approx([1870.0, 200.0])
    assert exact.take([1]).measured.tolist() == [0.0]
