"""What links add to the uncertainty of a route."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import SegmentTable
from tripwatt.uncertainty import route
from tripwatt.uncertainty.route import LENGTHS_M, LinkedTrips, RouteUncertainty, linked_trips

EXACT = {"rel": 1e-9, "abs": 1e-9}


def table(rows: int, **features) -> SegmentTable:
    columns = {
        "time_s": np.arange(float(rows)),
        "moved_w": 10.0,
        "climate_w": 300.0,
        "climb_w": 5.0,
    } | features
    watts = np.full(rows, 100.0)
    hours = np.arange(1.0, rows + 1.0)
    frame = pd.DataFrame(columns, index=range(rows))
    return SegmentTable(("t",), np.array([0, rows]), frame, hours, watts, watts + 30.0, np.full(rows, 320.0))


class Corrector:
    def __init__(self, watts=5.0, climate=8.0) -> None:
        self.watts, self.climate = watts, climate

    def predict(self, own):
        return np.full(len(own.hours), self.watts)

    def predict_with_uncertainty(self, own, hours):
        return self.predict(own), hours.sum() * np.array([3.0, 4.0])

    def outside_factor(self, own):
        return np.full((len(own.hours), 1), 2.0)

    def predict_climate(self, own):
        return None if self.climate is None else np.full(len(own.hours), self.climate)


class TestLinks:
    def test_relative_differences(self) -> None:
        """105 W, 5 W of it for the climb, on the driven trace of 1 h; 100, 110 and 130 W and the correction on links; one trip was not cut."""

        def one(watts):
            own = table(1)
            return SegmentTable(("t",), own.offsets, own.features, own.hours, np.array([watts]))

        driven = SegmentTable.join([one(100.0), one(50.0), one(200.0)])
        tables = tuple(one(w) for w in (100.0, 110.0, 130.0))
        linked = LinkedTrips((tables, (), tuple(one(w) for w in (190.0, 200.0, 210.0))))
        found = linked.differences(Corrector(), driven, np.array([2, 1, 0]))
        assert found[0] == pytest.approx([-10 / 200, 0.0, 10 / 200], **EXACT)
        assert np.isnan(found[1]).all()
        assert found[2] == pytest.approx([0.0, 10 / 100, 30 / 100], **EXACT)
        assert np.isnan(linked.differences(Corrector(), driven, np.array([1]))).all()

    def test_at_most_two_hundred_trips_evenly(self, monkeypatch) -> None:
        monkeypatch.setattr(route, "_on_links", lambda trip, vehicle: (trip,))
        assert all(linked_trips(range(200), None).tables)
        cut = [i for i, t in enumerate(linked_trips(range(399), None).tables) if t]
        assert len(cut) == 200
        assert (cut[0], cut[1], cut[-1]) == (0, 2, 398)
        assert LENGTHS_M == (250.0, 1000.0, 4000.0)


def test_differences_of_links_become_variances():
    differences = np.array([[0.01, 0.03, 0.02], [-0.03, 0.01, 0.04], [0.02, np.nan, 0.01]] * 3)
    found = RouteUncertainty.from_differences(differences)
    assert found.trips == 6
    first, second, third = (1e-4 + 9e-4) / 2, (9e-4 + 1e-4) / 2, (4e-4 + 16e-4) / 2
    np.testing.assert_allclose(found.variance, [first, max(first, second), third], rtol=1e-12)
    assert found.share(4000.0) ** 2 == pytest.approx(third)
    assert found.share(2500.0) ** 2 == pytest.approx((second + third) / 2)
    assert found.share(125.0) ** 2 == pytest.approx(first / 2)
    assert RouteUncertainty.from_differences(differences[:6]) is None  # four whole rows
