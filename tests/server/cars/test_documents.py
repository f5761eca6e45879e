"""Documents of cars on the road hold numbers that JSON has."""

from __future__ import annotations

import math

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.server.cars.documents import require_plausible


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_one_value_that_is_not_finite_refuses_a_forecast(bad: float, place: int) -> None:
    values = [1200.0, 0.4, -3.0]
    require_plausible(*values)
    values[place] = bad
    with pytest.raises(InvalidInput, match="no forecast: trip: got implausible results"):
        require_plausible(*values)
