"""A fleet and its reference trips."""

import numpy as np
from tests.trips.logs import log

from tripwatt.trips import Trip, TripSet, observed_energy


def test_reference_trips_end_where_the_reference_says():
    trips = tuple(Trip.from_samples(name, log(np.arange(100.0))) for name in ("A", "B", "C"))
    fleet = TripSet("x", trips, reference={"A": None, "C": 49.5})
    reference = fleet.reference_trips()
    assert [t.trip_id for t in reference] == ["A", "C"]
    assert [t.duration_s for t in reference] == [99.0, 49.0]
    assert reference[1].observed_energy_wh == observed_energy(reference[1].samples)
