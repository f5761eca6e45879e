"""Rows of trips and their sums."""

import numpy as np
import pyarrow as pa
import pytest

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tripwatt.fleet.statistics import TripRows


def test_sums_do_not_depend_on_the_parts(fleet, rows):
    model = fleet[2]
    whole = rows.sums
    X, y, w = rows.X, rows.residual_wh, 1.0 / rows.numbers("variance_wh2")
    assert whole.xx.sum(axis=0) == pytest.approx(X.T @ (X * w[:, None]), rel=1e-10)
    assert whole.xy.sum(axis=0) == pytest.approx(X.T @ (y * w), rel=1e-8, abs=1e-8)
    assert whole.yy.sum() == pytest.approx(y @ (y * w), rel=1e-12)
    assert whole.log_variance.sum() == pytest.approx(-np.log(w).sum(), rel=1e-12)
    assert whole.count.sum() == len(rows)
    assert all(np.array_equal(getattr(whole, n), getattr(model.sums, n)) for n in ("xx", "xy", "yy", "count"))
    half = np.arange(len(rows)) % 3 == 0
    merged = rows.where(half).sums + rows.where(~half).sums
    for name in ("xx", "xy", "yy"):
        scale = np.abs(getattr(whole, name)).max()
        assert np.abs(getattr(merged, name) - getattr(whole, name)).max() < 1e-10 * scale
    assert rows.where(np.zeros(len(rows), dtype=bool)).sums.groups == ()


@pytest.mark.parametrize(
    "texts",
    [
        ["2024-03-30T23:00:00", "2024-03-31T00:30:00", "2024-03-31T08:00:00"],
        ["2024-03-30T23:00+01:00", "2024-03-31T00:30+01:00", "2024-03-31T08:00+01:00"],
        ["2024-03-31T01:30+01:00", "2024-03-31T03:10+02:00", "2024-03-31T08:00+02:00"],
        ["2024-03-30T23:00:00", "2024-03-31T01:30+01:00", "2024-03-31T10:00+02:00"],
    ],
)
def test_trips_are_in_order_across_offsets_and_a_change_to_summer_time(rows, texts):
    table = rows.table.slice(0, 4)
    at = pa.array([texts[2], texts[0], None, texts[1]], pa.string())
    order, day = TripRows(
        table.set_column(table.column_names.index("started_at"), "started_at", at)
    ).chronological
    assert order.tolist() == [1, 3, 0]
    assert np.isnat(day).tolist() == [False, False, True, False]
    assert day[0] == np.datetime64("2024-03-31")
