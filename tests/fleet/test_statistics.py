"""Rows of trips and their sums."""

import numpy as np
import pytest

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


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
