"""The paper's hybrid models, ready to fit: each corrects the cumulative energy of the simulation `physics-paper`."""

from __future__ import annotations

from typing import Any

from tripwatt.learners.boosting import ClusteredBoosting
from tripwatt.learners.correlation import Correlation
from tripwatt.learners.forest import ClusteredForest
from tripwatt.learners.outside import OutsideRegressor
from tripwatt.study.paper.models import HybridModel
from tripwatt.study.paper.table2 import Table2Corrector

SIMULATION = "physics-paper"
"""Name of the simulated energy that is corrected."""


def gamm(seed: int = 0, simulation: str = SIMULATION, **settings: Any) -> HybridModel:
    """Make the GAMM of Table 2 with Student's t errors, which draws no random numbers; `settings` are those of `Table2Corrector`."""
    return HybridModel(Table2Corrector(**settings), simulation, shares_folds=True)


def forest(seed: int = 0, simulation: str = SIMULATION) -> HybridModel:
    """Make the forest with subject-level bootstrap, scored by the absolute error at the end of the trip."""
    learner = ClusteredForest(random_state=seed, score_rows="last", loss="absolute")
    return HybridModel(learner, simulation, shares_folds=True)


def boosting(
    seed: int = 0, simulation: str | None = SIMULATION, correlation: Correlation = "independence"
) -> HybridModel:
    """Make boosting as a marginal model, scored by the absolute error at the end of the trip.

    Examples
    --------
    >>> from tripwatt.hybrid import build_table
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah", preset="paper")
    >>> table = build_table(synthetic_fleet(6, seed=3).trips, {"physics-paper": car}, step_s=10.0)
    >>> model = boosting().fit(table.take(range(5)))
    >>> held_out = table.take([5])
    >>> model.predict(held_out).shape == held_out.observed_wh.shape
    True
    """
    learner = ClusteredBoosting(
        random_state=seed, correlation=correlation, score_rows="last", loss="absolute"
    )
    return HybridModel(learner, simulation, shares_folds=True)


def boosting_without_physics(seed: int = 0) -> HybridModel:
    """Make the same boosting, fitted to the observed energy without physics."""
    return boosting(seed, None)


def outside(regressor: Any, seed: int = 0) -> HybridModel:
    """Make a hybrid whose learner is a regressor with scikit-learn's interface."""
    return HybridModel(OutsideRegressor(regressor, seed), SIMULATION)
