"""Products with a model matrix that is not formed."""

import numpy as np
import pytest

from tripwatt_gamm.tables import IndexedColumns, TableRows, Whitening, previous_rows


def test_whitened_rows_are_the_whitened_matrix() -> None:
    rng = np.random.default_rng(2)
    groups = rng.integers(0, 3, 40)
    index = rng.integers(0, 7, 40)
    parts = [
        IndexedColumns(np.array([0, 2]), rng.normal(size=(7, 2)), index, rng.normal(size=40)),
        IndexedColumns(np.array([1]), rng.normal(size=(40, 1)), np.arange(40)),
    ]
    rows = TableRows(parts, 40, 3)
    white = Whitening(previous_rows(groups), 0.6)
    X = rows.dense(np.arange(40))
    expected = X.copy()
    for group in range(3):
        own = np.flatnonzero(groups == group)
        expected[own[1:]] = (X[own[1:]] - 0.6 * X[own[:-1]]) / 0.8
    found, weights = white.rows(rows), rng.uniform(1, 2, 40)
    np.testing.assert_allclose(found.dense(np.arange(40)), expected)
    np.testing.assert_allclose(white.values(X[:, 1]), expected[:, 1])
    np.testing.assert_allclose(found.gram(weights).corner, expected.T @ (weights[:, None] * expected))
    np.testing.assert_allclose(found.rmatvec(weights), expected.T @ weights)
    np.testing.assert_allclose(found.predictor(np.ones(3)), expected.sum(axis=1))
    assert white.log_jacobian == pytest.approx(-37 * np.log(0.8))
