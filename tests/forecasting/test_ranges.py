"""What a trip has that training did not."""

import numpy as np
import pandas as pd
import pytest

import tripwatt as tw
from tripwatt.trips import Plan


@pytest.mark.parametrize(
    ("given", "flagged"),
    [
        (tw.Departure(ambient_temperature_degc=9.9), ["cabin_temperature_degc"]),
        (tw.Departure(ambient_temperature_degc=10.0), []),
        (tw.Departure(ambient_temperature_degc=31.1), ["battery_temperature_degc", "cabin_temperature_degc"]),
        (
            tw.Departure(ambient_temperature_degc=31.1, battery_temperature_degc=30.0),
            ["cabin_temperature_degc"],
        ),
        (tw.Departure(soc=0.5), []),
        (None, []),
    ],
)
def test_temperatures_that_a_file_keeps_are_flagged(given, flagged):
    rows = {"time_s": np.arange(60.0), "speed_m_s": 10.0}
    known = tw.Departure(cabin_temperature_degc=20.0, battery_temperature_degc=19.0)
    plan = Plan.from_samples("trip", pd.DataFrame(rows), known)
    found = tw.load_model().forecast(plan, given)
    assert sorted(f.subject for f in found.flags if f.code == "file_value_kept") == flagged
