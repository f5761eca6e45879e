"""Resampled trips."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.trips.logs import log, steps

from tripwatt.trips import Trip, resample


@given(steps, st.floats(0.3, 7.0))
@settings(max_examples=60, deadline=None)
def test_resampling_keeps_the_measured_energy_to_the_last_bit(gaps, step_s):
    trip = Trip.from_samples("t", log(np.cumsum([0.0, *gaps])))
    blocks = resample(trip, step_s)
    assert blocks.array("observed_energy_wh")[-1] == trip.observed_energy_wh
    assert blocks.observed_energy_wh == trip.observed_energy_wh
    assert np.all(np.diff(blocks.array("time_s")) > 0)
    assert np.isfinite(blocks.array("speed_m_s")).all()
