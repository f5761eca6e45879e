"""The benchmark of half-known energies, on a few synthetic trips."""

import numpy as np
import pytest
from benchmarks import half_known

from tripwatt.study.synthetic import synthetic_fleet


@pytest.fixture(scope="module")
def trips():
    return synthetic_fleet(24).trips


@pytest.mark.parametrize("what", ["soc", "power"])
def test_poor_loggers_measure_what_they_say(trips, what):
    found = {trip.trip_id: trip for trip in half_known.half_known(trips, what)}
    true = {trip.trip_id: trip.observed_energy_wh for trip in trips}
    assert len(found) >= 16
    errors = [
        (t.observed_energy_wh - true[n]) / t.observed_energy_std_wh
        for n, t in found.items()
        if t.observed_energy_std_wh
    ]
    assert len(errors) >= 16
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) < 1.6
    rows = half_known.forecast_split(true, found, seed=0, fitted=16, corrector="linear")
    energy, forecast, low, high = rows.T
    assert np.mean(np.abs(forecast / energy - 1.0)) < 0.15
    assert np.mean((low <= energy) & (energy <= high)) >= 0.6


def test_a_poor_logger_writes_whole_numbers(trips):
    charge, power = (half_known.logged(trips[0], what) for what in ("soc", "power"))
    assert (charge["soc"] % 1.0 == 0.0).all()
    assert (power["power"] % 1.0 == 0.0).all()
    assert np.diff(power["time_s"]) == pytest.approx(5.0, abs=0.51)
