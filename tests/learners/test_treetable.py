"""Trees evaluated from plain arrays give what LightGBM gives, to the last bit, also for missing values."""

import lightgbm
import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.learners.treetable import TreeTable


@pytest.mark.parametrize("zero_as_missing", [False, True])
@pytest.mark.parametrize("missing_in_training", [False, True])
def test_sum_is_that_of_the_library(zero_as_missing: bool, missing_in_training: bool) -> None:
    rng = np.random.default_rng(3)
    X = rng.normal(size=(400, 5))
    X[rng.random(X.shape) < 0.1] = 0.0
    if missing_in_training:
        X[rng.random(X.shape) < 0.1] = np.nan
    y = np.nan_to_num(X[:, 0] * X[:, 1]) + rng.normal(size=400)
    settings = {"num_leaves": 9, "verbosity": -1, "num_threads": 1, "zero_as_missing": zero_as_missing}
    booster = lightgbm.train(settings, lightgbm.Dataset(X, y), num_boost_round=40)
    fresh = rng.normal(size=(300, 5))
    fresh[rng.random(fresh.shape) < 0.2] = np.nan
    fresh[rng.random(fresh.shape) < 0.2] = 0.0
    fresh[0] = [1e-40, -1e-36, np.inf, -np.inf, 1e-34]
    trees = TreeTable.from_text(booster.model_to_string(), 40)
    for rows in (X, fresh):
        assert np.array_equal(trees.sum(rows), booster.predict(rows, raw_score=True))


def test_no_tree_and_levels() -> None:
    assert TreeTable.from_text("", 0).sum(np.ones((3, 2))).tolist() == [0.0, 0.0, 0.0]
    rng = np.random.default_rng(0)
    X = rng.integers(0, 5, (300, 1)).astype(float)
    data = lightgbm.Dataset(X, np.isin(X[:, 0], [1, 3]).astype(float), categorical_feature=[0])
    booster = lightgbm.train({"verbosity": -1, "min_data_per_group": 1}, data, num_boost_round=1)
    with pytest.raises(InvalidInput, match="cannot be stored"):
        TreeTable.from_text(booster.model_to_string(), 1)
