"""Held-out trips as the process takes them."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import SegmentTable
from tripwatt.uncertainty.held_out import held_out_residual, process_segments


def table(rows: int, **features) -> SegmentTable:
    columns = {
        "time_s": np.arange(float(rows)),
        "moved_w": 10.0,
        "climate_w": 300.0,
        "speed_m_s": 5.0,
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

    def predict_with_uncertainty(self, own):
        return self.predict(own), np.column_stack(
            [np.full(len(own.hours), 3.0), np.full(len(own.hours), 4.0)]
        )

    def outside_factor(self, own):
        return np.full((len(own.hours), 1), 2.0)

    def predict_climate(self, own):
        return None if self.climate is None else np.full(len(own.hours), self.climate)


class TestHeldOut:
    def test_segments(self) -> None:
        """Two segments of 1 and 2 h: 3 h of (3, 4) W are 15 Wh, of 2 W outside 6 Wh."""
        found = held_out_residual(Corrector(), table(2))
        assert found.segments.step_s.tolist() == [3600.0, 7200.0]
        assert found.segments.corrector_sd_wh == pytest.approx(15.0)
        assert found.segments.outside_sd_wh == pytest.approx(6.0)
        assert (found.segments.net_wh, found.segments.distance_m) == pytest.approx((300.0, 54_000.0))
        assert found.residual_w.tolist() == [25.0, 25.0]
        assert found.climate_w.tolist() == [12.0, 12.0]
        assert found.climate_expected_w.tolist() == [308.0, 308.0]
        assert found.error_wh == pytest.approx(75.0)
        assert process_segments(table(2), np.zeros((2, 1))).outside_sd_wh == 0.0

    def test_joint_or_not_logged_throughout(self) -> None:
        assert held_out_residual(Corrector(climate=None), table(2)).climate_w is None
        assert held_out_residual(Corrector(), table(2, climate_w=[300.0, np.nan])).climate_w is None
