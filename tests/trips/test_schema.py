"""Faults of a table of samples: every one is named at once, structure before values."""

import numpy as np
import pandas as pd
import pytest
from tests.support.refusals import refuses
from tests.trips.logs import log

from tripwatt.errors import InvalidInput
from tripwatt.trips import Log, Trip, validate_samples


def test_all_faults_are_named_at_once():
    samples = log(np.arange(6.0))
    samples.loc[1, "speed_m_s"] = 912.0
    samples.loc[2, "voltage_v"] = 12.0
    samples.loc[4, "time_s"] = 0.5
    with pytest.raises(InvalidInput) as caught:
        Trip.from_samples("TripX", samples)
    message = str(caught.value)
    assert len(caught.value.faults) == 3
    for part in ("TripX", "row 2", "'speed_m_s'", "912", "'voltage_v'", "12 V", "row 5", "0.5 s after 3 s"):
        assert part in message


def test_structure_faults_come_before_values():
    refuses("missing column", Log.from_samples, "t", pd.DataFrame({"time_s": [0.0, 1.0]}))
    with pytest.raises(InvalidInput, match="not a number"):
        Log.from_samples("t", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": ["a", "b"]}))
    refuses("at least 2", Log.from_samples, "t", log(np.arange(1.0)))


@pytest.mark.parametrize(
    ("column", "row", "value"),
    [
        ("speed_m_s", 1, -0.1),
        ("speed_m_s", 2, np.nan),
        ("speed_m_s", 0, np.inf),
        ("time_s", 1, 0.0),
        ("time_s", 3, np.nan),
        ("elevation_m", 2, 9000.1),
        ("elevation_m", 2, -np.inf),
    ],
)
def test_every_fault_of_a_value_is_seen(column: str, row: int, value: float) -> None:
    sound = pd.DataFrame(
        {"time_s": np.arange(4.0), "speed_m_s": np.ones(4), "elevation_m": [1.0, np.nan, 3.0, 4.0]}
    )
    validate_samples(sound, "t")
    wrong = sound.copy()
    wrong.loc[row, column] = value
    with pytest.raises(InvalidInput):
        validate_samples(wrong, "t")
