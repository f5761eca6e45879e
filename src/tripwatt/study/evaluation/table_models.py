"""Models of the cumulative energy along a trip, and the baselines that every protocol has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.hybrid import EnergyModel, EnergyRegression, PhysicsOnly, TripTable
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.tasks import Fitted, Method, ModelSpec
from tripwatt.study.paper import HybridModel

FOUR = ("distance_km", "duration_h", "cold_h", "hot_h")
SIX = (*FOUR, "cubed_speed", "acceleration_work")


@dataclass(frozen=True, slots=True)
class TableMethod(Method[TripTable]):
    """A model of cumulative energy.

    Attributes
    ----------
    make : callable
        Function from a seed to a new, unfitted model.
    """

    make: Callable[[int], EnergyModel]

    def fit(self, data: TripTable, train: IntArray, seed: int) -> Fitted:
        """Fit a model to the rows of the training trips."""
        model = self.make(seed).fit(data.take(train))

        def predict(test: IntArray) -> FloatArray:
            scored = data.take(test)
            return model.predict(scored)[scored.last_rows]

        return Fitted(predict)

    def shares_folds(self, seed: int) -> bool:
        """Whether the model is a hybrid whose corrector predicts all folds at once."""
        model = self.make(seed)
        return isinstance(model, HybridModel) and model.shares_folds

    def fit_all_folds(self, data: TripTable, folds: IntArray, seed: int, *, inner_errors: bool) -> Fitted:
        """Predict each trip without its fold."""
        model = self.make(seed)
        assert isinstance(model, HybridModel)
        predicted = model.predict_held_out(data, folds)
        inner = model.inner_errors(data, folds, seed) if inner_errors else None
        return Fitted(lambda test: predicted[data.last_rows[test]], inner_errors=inner)

    def required_data(self, hold_out: HoldOut[Any], scored: IntArray) -> TripTable:
        """Return the table without the samples of its trips."""
        return hold_out.table.without_samples()


def table_model(
    name: str, title: str, make: Callable[[int], EnergyModel], simulation: str | None = None
) -> ModelSpec:
    """Make a model of a protocol from a function that makes a model of cumulative energy from a seed."""
    return ModelSpec(name, title, TableMethod(make), simulation)


def regression(seed: int, *, sums: tuple[str, ...], simulation: str | None = None) -> EnergyModel:
    """Make a regression on sums along the trip; `seed` is not used, since the fit draws no random numbers."""
    return EnergyRegression(sums, simulation=simulation)


def physics(seed: int, *, simulation: str) -> EnergyModel:
    """Make a model that is a simulation alone; `seed` is not used, since nothing is fitted."""
    return PhysicsOnly(simulation)


CONSTANT = table_model("constant", "constant energy per km", partial(regression, sums=FOUR[:1]))
LINEAR4 = table_model("linear4", "regression, 4 coefficients", partial(regression, sums=FOUR))
LINEAR6 = table_model("linear6", "regression, 6 coefficients", partial(regression, sums=SIX))
PHYSICS_PAPER = table_model(
    "physics-paper", "physics as in the paper", partial(physics, simulation="physics-paper"), "physics-paper"
)
PHYSICS = table_model("physics", "physics, default preset", partial(physics, simulation="physics"), "physics")
PHYSICS4 = table_model(
    "physics4",
    "default physics + 4 coefficients",
    partial(regression, sums=FOUR[1:], simulation="physics"),
    "physics",
)
