"""What answers of routers have in common."""

import numpy as np
import pytest
from tests.routes.made import NO, TO_ROUNDING

from tripwatt.errors import InvalidInput
from tripwatt.routes.answers import intervals, speeds_at_points
from tripwatt.routes.documents import Node


def test_intervals_of_points():
    found = intervals(Node([[0, 2, 5.0], [2, 2, None]], "t"), 3)
    assert [(start, end, value.value) for start, end, value in found] == [(0, 2, 5.0), (2, 2, None)]
    for wrong in ([0, 3, 5.0], [2, 1, 5.0], [0.5, 1, 5.0], [0, 1.5, 5.0]):
        with pytest.raises(InvalidInput, match="point index out of range"):
            [v.number(minimum=0.0) for _, _, v in intervals(Node([wrong], "t"), 3)]
    for wrong in ([0, 1], [-1, 1, 5.0], [0, 1, -5.0]):
        with pytest.raises(InvalidInput):
            [v.number(minimum=0.0) for _, _, v in intervals(Node([wrong], "t"), 3)]


def test_speeds_of_intervals():
    found = speeds_at_points(Node([[0, 2, 36.0], [2, 2, 72.0], [3, 4, 0.0]], "t"), 5)
    np.testing.assert_allclose(found, [10.0, 10.0, 20.0, NO, NO], **TO_ROUNDING)
    assert np.isnan(speeds_at_points(Node(None, "t"), 2)).all()
