"""The correction of one vehicle of a fleet: its posterior weights, and the fleet's trees on top."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.files import shipped_toml
from tripwatt.fleet.features import segment_features
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.power import TREE_FEATURES, PowerCorrector, Uncertain, summed

_TREE_SETTINGS: Final = shipped_toml("fleet/trees.toml")
_MAX_ROUNDS: Final = 120
"""A choice that bounds the time of a fit."""
_ROUND_STEP: Final = 20
"""A choice: the held-out error changes slowly with the number of rounds."""
_MIN_GAIN: Final = 0.01
"""Trees are used only if they lower the held-out error of trips by at least this share: a choice, because less is within chance."""


def _tree_columns(table: SegmentTable) -> FloatArray:
    """Return the features of the trees from a table, shape (segments, columns); NaN if unknown."""
    return np.asarray(table.features[list(TREE_FEATURES)].to_numpy(dtype=np.float64))


@dataclass(frozen=True, eq=False)
class FleetTrees:
    """Boosted trees that predict the residual power of segments after the linear part.

    Attributes
    ----------
    text : str
        The trees in LightGBM's text format; empty if there are no trees.
    """

    text: str = ""

    def predict(self, table: SegmentTable) -> FloatArray:
        """Predict the residual power [W], shape (segments,)."""
        if not self.text:
            return np.zeros(len(table.hours))
        return np.asarray(_booster(self.text).predict(_tree_columns(table), num_threads=1), dtype=np.float64)

    @classmethod
    def fit(cls, table: SegmentTable, residual_w: FloatArray, rounds: int, seed: int) -> FleetTrees:
        """Fit trees on the rows of a table, with the same weight for each trip; the same rows and seed give the same trees.

        Parameters
        ----------
        table : SegmentTable
        residual_w : ndarray, shape (segments,)
        rounds : int
            0 for no trees.
        seed : int
        """
        if not rounds:
            return cls()
        return cls(_trained(table, residual_w, rounds, seed).model_to_string())


def _trained(
    table: SegmentTable, residual_w: FloatArray, rounds: int, seed: int, chosen: Any = slice(None)
) -> Any:
    """Return a booster of chosen rows of a table, with the same weight for each trip."""
    import lightgbm

    weight = (1.0 / np.diff(table.offsets)[table.groups])[chosen]
    data = lightgbm.Dataset(_tree_columns(table)[chosen], residual_w[chosen], weight=weight / weight.mean())
    return lightgbm.train({**_TREE_SETTINGS, "seed": seed}, data, num_boost_round=rounds)


@lru_cache(maxsize=8)
def _booster(text: str) -> Any:
    """Return the booster of a text. The last few are cached, since reading a booster takes longer than a forecast."""
    import lightgbm

    return lightgbm.Booster(model_str=text)


def choose_rounds(
    table: SegmentTable, residual_w: FloatArray, folds: IntArray, seed: int
) -> tuple[int, FloatArray]:
    """Return the number of boosting rounds with the smallest energy error of held-out trips, and its held-out prediction [W].

    Numbers of rounds are tried in steps of `_ROUND_STEP`. The result is 0 if trees lower the error by less than `_MIN_GAIN`.

    Parameters
    ----------
    table : SegmentTable
    residual_w : ndarray, shape (segments,)
    folds : ndarray of int, shape (trips,)
    seed : int
    """
    counts = list(range(_ROUND_STEP, _MAX_ROUNDS + 1, _ROUND_STEP))
    predictions = np.zeros((len(counts), len(residual_w)))
    row_folds = folds[table.groups]
    X = _tree_columns(table)
    for fold in np.unique(folds):
        train, held_out = row_folds != fold, row_folds == fold
        if not train.any():
            continue
        booster = _trained(table, residual_w, _MAX_ROUNDS, seed, train)
        for i, count in enumerate(counts):
            predictions[i, held_out] = booster.predict(X[held_out], num_iteration=count, num_threads=1)
    before = float(np.mean(np.abs(table.totals_wh(residual_w))))
    errors = [float(np.mean(np.abs(table.totals_wh(residual_w - prediction)))) for prediction in predictions]
    best = int(np.argmin(errors))
    if errors[best] > (1.0 - _MIN_GAIN) * before:
        return 0, np.zeros(len(residual_w))
    return counts[best], predictions[best]


@dataclass(frozen=True, eq=False)
class FleetCorrector(PowerCorrector):
    """The correction of one vehicle.

    Attributes
    ----------
    mean : ndarray, shape (features,)
        Posterior mean of the vehicle's weights.
    factor : ndarray, shape (features, features)
        Factor of the covariance of these weights, which is ``factor @ factor.T``.
    trees : FleetTrees
    """

    refit: ClassVar[str] = "fit the fleet again"

    mean: FloatArray
    factor: FloatArray
    trees: FleetTrees = FleetTrees()

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Predict the residual power [W], and its uncertainty [W] from that of the weights; the trees add none."""
        features = segment_features(table)
        return features @ self.mean + self.trees.predict(table), summed(features, hours) @ self.factor
