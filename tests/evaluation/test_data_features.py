"""What boosting without physics sees of the road, against differences that are worked out by hand."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.evaluation.forecast_data import _data_features
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.segments import SEGMENT_S
from tripwatt.trips import Plan

SPEED = np.concatenate([np.linspace(0.0, 15.0, 31), np.full(60, 15.0)])
TIME = np.arange(91.0)


def table_for(features) -> SegmentTable:
    frame = pd.DataFrame(dict.fromkeys(features, np.zeros(3)))
    return SegmentTable(("t",), np.array([0, 3]), frame, np.full(3, SEGMENT_S / 3600.0), np.zeros(3))


def features_of(**road):
    from tripwatt.evaluation.forecast_data import DATA_FEATURES

    plan = Plan.from_samples("t", pd.DataFrame({"time_s": TIME, "speed_m_s": SPEED, **road}))
    own = ("climb_m_s", "kinetic_m2_s3")
    return _data_features(table_for([n for n in DATA_FEATURES if n not in own]), [plan])


def test_climb_from_a_grade():
    climb = features_of(grade=0.04)["climb_m_s"]
    # 4 % of the distance, each second at its own speed
    distance = np.concatenate(([0.0], np.cumsum(SPEED[1:])))
    expected = 0.04 * np.diff(distance[[0, 30, 60, 90]]) / SEGMENT_S
    np.testing.assert_allclose(climb, expected, rtol=1e-9)


def test_climb_from_heights_and_without_a_road():
    np.testing.assert_allclose(features_of(elevation_m=100.0 + 0.5 * TIME)["climb_m_s"], 0.5, rtol=1e-9)
    assert features_of()["climb_m_s"].isna().all()


def test_kinetic_energy_of_a_start():
    kinetic = features_of()["kinetic_m2_s3"]
    assert kinetic[0] == pytest.approx(0.5 * 15.0**2 / SEGMENT_S, rel=1e-9)
    assert kinetic[1:].tolist() == pytest.approx([0.0, 0.0], abs=1e-12)
