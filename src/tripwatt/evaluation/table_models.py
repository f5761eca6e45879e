"""Models of the cumulative energy along a trip, one refit for each fold or all folds at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tripwatt.arrays import IntArray
from tripwatt.evaluation.hold_outs import HoldOut
from tripwatt.evaluation.protocol import FoldResult
from tripwatt.hybrid import EnergyModel, EnergyRegression, PhysicsOnly, TripTable
from tripwatt.paper import HybridModel

FOLDS_PER_TASK = 4

REFERENCE = "reference"
"""The set of trips on which a protocol compares settings inside the folds."""

FOUR = ("distance_km", "duration_h", "cold_h", "hot_h")
SIX = (*FOUR, "cubed_speed", "acceleration_work")


@dataclass(frozen=True, slots=True)
class TableModel:
    """A model of cumulative energy in a protocol.

    Attributes
    ----------
    name, title : str
    make : callable
        A fresh, unfitted model from a seed.
    simulation : str or None
        Name of the simulated energy that the model corrects.
    """

    name: str
    title: str
    make: Callable[[int], EnergyModel]
    simulation: str | None = None

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """All of them."""
        return hold_out.fold_numbers

    def tasks(self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int) -> Iterator[TableTask]:
        """One task for a model that is quick or gives all folds at once, else one for a few folds."""
        model = self.make(seed)
        slow = isinstance(model, HybridModel) and not model.shares_folds
        size = FOLDS_PER_TASK if slow else max(len(folds), 1)
        table = hold_out.table.without_samples()
        for start in range(0, len(folds), size):
            members = tuple(folds[start : start + size])
            yield TableTask(index, self, table, hold_out.folds, members, seed, hold_out.trips == REFERENCE)


@dataclass(frozen=True)
class TableTask:
    """Some folds of a model of cumulative energy."""

    evaluation: int
    spec: TableModel
    table: TripTable
    folds: IntArray
    members: tuple[int, ...]
    seed: int
    compares: bool = False
    """Whether the errors inside the folds are wanted, by which settings can be compared."""

    @property
    def rank(self) -> int:
        """Tasks of many folds first."""
        return -len(self.members)

    def run(self) -> list[FoldResult]:
        """Predictions at every row of the trips of each fold."""
        model = self.spec.make(self.seed)
        if isinstance(model, HybridModel) and model.shares_folds:
            return self._run_together(model)
        return [self._run_fold(fold) for fold in self.members]

    def _run_fold(self, fold: int) -> FoldResult:
        model = self.spec.make(self.seed)
        test = np.flatnonzero(self.folds == fold)
        started = time.perf_counter()
        model.fit(self.table.take(np.flatnonzero(self.folds != fold)))
        fitted = time.perf_counter()
        predicted = model.predict(self.table.take(test))
        each_ms = 1000.0 * (time.perf_counter() - fitted) / len(test)
        return FoldResult(self.evaluation, self.spec.name, fold, predicted, fitted - started, each_ms)

    def _run_together(self, model: HybridModel) -> list[FoldResult]:
        """All folds at once; the times are those of one plain fit."""
        predicted = model.predict_held_out(self.table, self.folds)
        inner = model.inner_errors(self.table, self.folds, self.seed) if self.compares else None
        numbers = np.unique(self.folds)
        started = time.perf_counter()
        plain = self.spec.make(self.seed).fit(self.table)
        fitted = time.perf_counter()
        plain.predict(self.table)
        each_ms = 1000.0 * (time.perf_counter() - fitted) / len(self.table)
        return [
            FoldResult(
                self.evaluation,
                self.spec.name,
                fold,
                predicted[self.table.rows_of(np.flatnonzero(self.folds == fold))],
                fitted - started,
                each_ms,
                {} if inner is None else {"inner_error": inner[np.searchsorted(numbers, fold)]},
            )
            for fold in self.members
        ]


@dataclass(frozen=True, slots=True)
class TotalModel:
    """A `TableModel` in a protocol that scores totals alone: its predictions are the energies of the trips."""

    model: TableModel

    @property
    def name(self) -> str:
        """Of the model."""
        return self.model.name

    @property
    def title(self) -> str:
        """Of the model."""
        return self.model.title

    @property
    def simulation(self) -> str | None:
        """Of the model."""
        return self.model.simulation

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """All of them."""
        return hold_out.fold_numbers

    def tasks(self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int) -> Iterator[TotalTask]:
        """One task."""
        if folds:
            table = hold_out.table.without_samples()
            yield TotalTask(TableTask(index, self.model, table, hold_out.folds, tuple(folds), seed))


@dataclass(frozen=True)
class TotalTask:
    """A `TableTask` of which the last row of each trip counts."""

    task: TableTask
    rank: int = 3

    @property
    def evaluation(self) -> int:
        """Number of the hold-out."""
        return self.task.evaluation

    @property
    def members(self) -> tuple[int, ...]:
        """Numbers of the folds."""
        return self.task.members

    def run(self) -> list[FoldResult]:
        """Energies of the trips of each fold."""
        task, found = self.task, []
        for result in task.run():
            trips = np.flatnonzero(task.folds == result.fold)
            last = np.cumsum(np.diff(task.table.offsets)[trips]) - 1
            found.append(
                FoldResult(
                    result.evaluation,
                    result.model,
                    result.fold,
                    result.predicted_wh[last],
                    result.fit_s,
                    result.predict_ms,
                )
            )
        return found


def constant(seed: int = 0) -> EnergyModel:
    """Constant energy per distance."""
    return EnergyRegression(("distance_km",))


def linear4(seed: int = 0) -> EnergyModel:
    """Regression on distance, time, cold and hot hours."""
    return EnergyRegression(FOUR)


def linear6(seed: int = 0) -> EnergyModel:
    """The same with sums for air drag and acceleration."""
    return EnergyRegression(SIX)


def physics_paper(seed: int = 0) -> EnergyModel:
    """The simulation as in the paper."""
    return PhysicsOnly("physics-paper")


def physics(seed: int = 0) -> EnergyModel:
    """The simulation with the default preset."""
    return PhysicsOnly("physics")


def physics4(seed: int = 0) -> EnergyModel:
    """Regression on the default simulation in place of distance."""
    return EnergyRegression(FOUR[1:], simulation="physics")


CONSTANT = TableModel("constant", "constant energy per km", constant)
LINEAR4 = TableModel("linear4", "regression, 4 coefficients", linear4)
LINEAR6 = TableModel("linear6", "regression, 6 coefficients", linear6)
PHYSICS_PAPER = TableModel("physics-paper", "physics as in the paper", physics_paper, "physics-paper")
PHYSICS = TableModel("physics", "physics, default preset", physics, "physics")
PHYSICS4 = TableModel("physics4", "default physics + 4 coefficients", physics4, "physics")
