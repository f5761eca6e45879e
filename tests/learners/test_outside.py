"""Regressors from outside on tables of features."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tripwatt.errors import InvalidInput
from tripwatt.learners.outside import OutsideRegressor, checked

X = pd.DataFrame({"a": np.arange(12.0), "kind": pd.Categorical(list("xy") * 6)})
Y = 3.0 * X["a"].to_numpy() + np.where(X["kind"] == "x", 10.0, 0.0)


class Watching(RegressorMixin, BaseEstimator):
    """Keeps what it was fitted to; its prediction is the first column."""

    def fit(self, X, y, groups=None):
        self.seen_, self.groups_ = X, groups
        return self

    def predict(self, X):
        return X.iloc[:, 0].to_numpy()


@pytest.mark.parametrize("made", [LinearRegression(), make_pipeline(StandardScaler(), LinearRegression())])
def test_levels_become_columns_of_which_an_unknown_one_is_none(made):
    model = OutsideRegressor(made).fit(X, Y)
    assert model.predict(X) == pytest.approx(Y)
    other = X.assign(kind=pd.Categorical(["x"] * 12, categories=["x", "z"]))
    assert model.predict(other) == pytest.approx(3.0 * X["a"] + 10.0)


def test_what_is_missing_is_the_median_of_the_fit_unless_the_regressor_takes_it():
    holes = X.assign(a=X["a"].where(X["a"] != 4.0))
    model = OutsideRegressor(Watching()).fit(holes, Y)
    median = float(holes["a"].median())
    assert model.regressor_.seen_["a"].tolist()[4] == median == model.predict(holes.iloc[[4]])[0]
    trees = OutsideRegressor(HistGradientBoostingRegressor(min_samples_leaf=1)).fit(holes, Y)
    filled = trees.predict(holes.fillna({"a": 100.0}))
    assert trees.predict(holes)[4] == pytest.approx(Y[4], abs=1.5)
    assert abs(filled[4] - Y[4]) > 5.0


def test_a_clone_is_fitted_with_the_seed_for_each_random_state():
    forest = RandomForestRegressor(5)
    one, two, other = (OutsideRegressor(forest, seed).fit(X, Y).predict(X) for seed in (1, 1, 2))
    assert not hasattr(forest, "estimators_")
    assert one.tolist() == two.tolist() != other.tolist()
    chosen = OutsideRegressor(make_pipeline(RandomForestRegressor(5, random_state=9)), 1).fit(X, Y)
    assert chosen.regressor_[-1].random_state == 9


def test_clusters_reach_those_that_take_them():
    groups = np.repeat(np.arange(4), 3)
    assert OutsideRegressor(Watching()).fit(X, Y, groups).regressor_.groups_.tolist() == groups.tolist()
    search = GridSearchCV(Ridge(), {"alpha": [1e-6, 1e6]}, cv=GroupKFold(4))
    model = OutsideRegressor(search).fit(X, Y, groups)
    assert model.regressor_.best_params_ == {"alpha": 1e-6}
    assert OutsideRegressor(Ridge(1e-9)).fit(X, Y, groups).predict(X) == pytest.approx(Y)


@pytest.mark.parametrize(
    ("predicted", "message"),
    [
        ([1.0, 2.0], r"got shape \(2,\); allowed: shape \(3,\)"),
        ([[1.0], [2.0], [3.0]], r"got shape \(3, 1\)"),
        ([1.0, np.nan, np.inf], "got 2 values that are not finite"),
        (["a", "b", "c"], "got list; allowed: numbers"),
        (None, "not finite|got shape"),
    ],
)
def test_a_prediction_is_a_finite_number_for_each_row(predicted, message):
    with pytest.raises(InvalidInput, match=message):
        checked(predicted, 3, Ridge())
    assert checked([1, 2, 3], 3, Ridge()).tolist() == [1.0, 2.0, 3.0]
