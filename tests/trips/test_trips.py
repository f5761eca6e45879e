"""Laws of trips: energy is additive and survives resampling; every fault is named at once."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.trips import Fleet, Log, Trip, is_sound, observed_energy, resample, validate_samples


def log(time: np.ndarray, seed: int = 0) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "time_s": time,
            "speed_m_s": rng.uniform(0, 30, len(time)),
            "voltage_v": rng.uniform(340, 400, len(time)),
            "current_a": rng.normal(20, 40, len(time)),
        }
    )


steps = st.lists(st.floats(0.05, 3.0), min_size=3, max_size=200)


@given(steps, st.floats(0.3, 7.0))
@settings(max_examples=60, deadline=None)
def test_resampling_keeps_the_measured_energy_to_the_last_bit(gaps, step_s):
    trip = Trip.from_samples("t", log(np.cumsum([0.0, *gaps])))
    blocks = resample(trip, step_s)
    assert blocks.array("observed_energy_wh")[-1] == trip.observed_energy_wh
    assert blocks.observed_energy_wh == trip.observed_energy_wh
    assert np.all(np.diff(blocks.array("time_s")) > 0)
    assert np.isfinite(blocks.array("speed_m_s")).all()


@given(steps, st.data())
@settings(max_examples=60, deadline=None)
def test_energy_adds_up_over_a_cut(gaps, data):
    samples = log(np.cumsum([0.0, *gaps]))
    cut = data.draw(st.integers(1, len(samples) - 2))
    parts = observed_energy(samples.iloc[: cut + 1]) + observed_energy(samples.iloc[cut:])
    assert parts == pytest.approx(observed_energy(samples), rel=1e-9, abs=1e-9)


def test_energy_bridges_missing_current():
    samples = log(np.arange(5.0))
    samples["voltage_v"], samples["current_a"] = 360.0, 10.0
    samples.loc[2, "current_a"] = np.nan
    assert observed_energy(samples) == pytest.approx(360 * 10 * 4 / 3600)


def test_discharge_is_positive():
    samples = log(np.arange(3.0)).assign(voltage_v=400.0, current_a=9.0)
    assert Trip.from_samples("t", samples).observed_energy_wh == pytest.approx(2.0)


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
    with pytest.raises(InvalidInput, match="missing column"):
        Log.from_samples("t", pd.DataFrame({"time_s": [0.0, 1.0]}))
    with pytest.raises(InvalidInput, match="not a number"):
        Log.from_samples("t", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": ["a", "b"]}))
    with pytest.raises(InvalidInput, match="at least 2"):
        Log.from_samples("t", log(np.arange(1.0)))


def test_reference_trips_end_where_the_reference_says():
    trips = tuple(Trip.from_samples(name, log(np.arange(100.0))) for name in ("A", "B", "C"))
    fleet = Fleet("x", trips, reference={"A": None, "C": 49.5})
    reference = fleet.reference_trips()
    assert [t.trip_id for t in reference] == ["A", "C"]
    assert [t.duration_s for t in reference] == [99.0, 49.0]
    assert reference[1].observed_energy_wh == observed_energy(reference[1].samples)


def test_energy_is_the_trapezoid_of_voltage_times_current():
    samples = pd.DataFrame(
        {
            "time_s": [0.0, 10.0, 40.0],
            "speed_m_s": 0.0,
            "voltage_v": [400.0, 380.0, 360.0],
            "current_a": [0.0, 20.0, -10.0],
        }
    )
    by_hand = (0.5 * (0 + 7600) * 10 + 0.5 * (7600 - 3600) * 30) / 3600
    assert observed_energy(samples) == pytest.approx(by_hand, rel=1e-12)


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
def test_a_quick_look_sees_every_fault(column: str, row: int, value: float) -> None:
    sound = pd.DataFrame(
        {"time_s": np.arange(4.0), "speed_m_s": np.ones(4), "elevation_m": [1.0, np.nan, 3.0, 4.0]}
    )
    assert is_sound(sound)
    wrong = sound.copy()
    wrong.loc[row, column] = value
    assert not is_sound(wrong)
    with pytest.raises(InvalidInput):
        validate_samples(wrong, "t")
