"""Vehicles that take more than their sisters, and trips that take more than their forecasts."""

import numpy as np
import pyarrow as pa
import pytest
from tests.fleet.rows import made_rows

from tripwatt.fleet.deviations import change_point, drift, sisters
from tripwatt.fleet.statistics import ROWS, TripRows
from tripwatt.hybrid.groups import group_posterior

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_vehicles_that_take_more_are_found_with_the_day_of_the_change():
    rows = made_rows(9, 40)
    frame = rows.table.to_pandas()
    thirsty = frame["vehicle_id"] == "v04"
    late = thirsty & (frame["started_at"] >= "2024-11")
    frame.loc[late, "observed_wh"] *= 1.12
    rows = TripRows.join([pa.Table.from_pandas(frame, schema=ROWS, preserve_index=False)])
    sums = rows.sums
    from tripwatt.fleet.features import START
    from tripwatt.hybrid.groups import fit_scales

    found = sisters(group_posterior(sums, fit_scales(sums, START)), rows).set_index("vehicle_id")
    assert found.loc["v04", "since"][:7] == "2024-11"
    assert found.loc["v04", "change"] == pytest.approx(0.12, abs=0.02)
    assert found["since"].drop("v04").isna().all()
    assert found["share"].is_monotonic_decreasing
    assert found["trips"].eq(40).all()
    assert (found["sd"] > 0.0).all()


def test_change_points_by_hand():
    flat = np.array([0.0, 1.0] * 8)
    assert change_point(flat) == (None, 0.0)
    assert change_point(np.r_[flat, flat + 9.0]) == (16, 9.0)
    assert change_point(np.r_[flat[:8], flat[:8] - 5.0]) == (8, -5.0)
    assert change_point(np.r_[flat[:8], flat[:7] - 5.0]) == (None, 0.0)
    assert change_point(np.r_[flat, flat + 0.2]) == (None, 0.0)


def test_drift_names_the_vehicles_that_take_more(rows, fleet):
    *_, model, _ = fleet
    calm = drift(model.posterior, rows)
    assert calm["trips"] == len(rows)
    assert calm["coverage"] > 0.8
    frame = rows.table.to_pandas()
    its = frame["vehicle_id"] == "V00003"
    frame.loc[its, "observed_wh"] *= 1.3
    changed = TripRows.join([pa.Table.from_pandas(frame, schema=ROWS, preserve_index=False)])
    found = drift(model.posterior, changed)
    assert list(found["vehicles"]) == ["V00003"]
    assert found["vehicles"]["V00003"]["trips"] == its.sum()
    assert found["vehicles"]["V00003"]["bias"] == pytest.approx(0.3, abs=0.06)
    assert found["vehicles"]["V00003"]["z"] > 3.0
    assert found["coverage"] < calm["coverage"]
    assert found["bias"] - calm["bias"] == pytest.approx(0.3 * its.mean(), rel=0.2)
