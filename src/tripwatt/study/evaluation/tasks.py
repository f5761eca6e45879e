"""Models of a protocol, tasks for their splits, and results; the same for every model and every hold-out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Final, Generic, TypeVar

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import InvalidInput
from tripwatt.learners.folds import Split
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecast
from tripwatt.study.evaluation.hold_outs import HoldOut

D = TypeVar("D")
"""Data of a hold-out that a method needs."""

TIMED_TRIPS: Final = 8
"""Number of trips over which the time of a prediction is averaged, if all folds are predicted at once: a choice."""

FAILURES: Final = (InvalidInput, ValueError, ArithmeticError)
"""What fails a trip or a fold and not the run: data that a model refuses, and a computation without a result."""

NO_PREDICTION: Final[dict[str, Any]] = {"predicted_wh": np.empty(0), "fit_s": np.nan, "predict_ms": np.nan}
"""Values of a `FoldResult` without a scored trip."""

Predict = Callable[[IntArray], FloatArray]
"""Function from numbers of trips, ascending, to the energy of each trip [Wh]."""


@dataclass(frozen=True, eq=False)
class FoldResult:
    """Held-out predictions of one model in one split.

    Attributes
    ----------
    model : str
    split : Split
        Its test trips are those with a prediction.
    predicted_wh : ndarray, shape (scored trips,)
        Energy of each scored trip [Wh].
    fit_s, predict_ms : float
        Time of the fit, and of the prediction of one trip.
    inner_error : float
        Error by which settings are compared inside the fold; NaN if they are not compared.
    forecasts : list of HeldOutForecast or None
        Forecasts of the scored trips; None if the model makes none.
    failed : dict of int to str
        Number of each test trip without a prediction, and the reason.
    """

    model: str
    split: Split
    predicted_wh: FloatArray
    fit_s: float
    predict_ms: float
    inner_error: float = np.nan
    forecasts: list[HeldOutForecast] | None = None
    failed: dict[int, str] = field(default_factory=dict)

    def without(self, trips: IntArray) -> FoldResult:
        """Return the result without some trips."""
        kept = ~np.isin(self.split.test, trips)
        forecasts = self.forecasts and [f for f, keep in zip(self.forecasts, kept, strict=True) if keep]
        split = replace(self.split, test=self.split.test[kept])
        return replace(self, split=split, predicted_wh=self.predicted_wh[kept], forecasts=forecasts)


@dataclass(frozen=True, slots=True)
class Fitted:
    """Result of `Method.fit` and `Method.fit_all_folds`.

    Attributes
    ----------
    predict : callable
        See `Predict`.
    forecasts : callable or None
        Function from numbers of predicted trips to everything that is scored of their forecasts.
    inner_errors : ndarray or None, shape (folds,)
        From `Method.fit_all_folds`: error of each fold by which settings are compared, in the order of the folds' numbers.
    """

    predict: Predict
    forecasts: Callable[[IntArray], list[HeldOutForecast]] | None = None
    inner_errors: FloatArray | None = None


class Method(Generic[D]):
    """How a model of a protocol is fitted and predicts."""

    rank: ClassVar[int] = 3
    """Tasks of a lower rank take longer and start first, so that no core waits at the end."""
    splits_per_task: ClassVar[int] = 12

    def fit(self, data: D, train: IntArray, seed: int) -> Fitted:
        """Fit, tune and calibrate on the training trips."""
        raise NotImplementedError

    def shares_folds(self, seed: int) -> bool:
        """Whether `fit_all_folds` predicts all folds at once, each held out."""
        return False

    def fit_all_folds(self, data: D, folds: IntArray, seed: int, *, inner_errors: bool) -> Fitted:
        """Predict each trip by a model fitted without its fold; with `inner_errors` also the errors inside the folds."""
        raise NotImplementedError

    def required_data(self, hold_out: HoldOut[Any], scored: IntArray) -> D:
        """Return the data that `fit` and the prediction of the scored trips need; they are sent to another process."""
        raise NotImplementedError


@dataclass(frozen=True)
class ModelSpec:
    """A model of a protocol.

    Attributes
    ----------
    name : str
        Name in every table and file.
    title : str
        A short description.
    method : Method
    simulation : str or None
        Name of the simulated energy that the model corrects; None without physics.
    digest : str
        Digest of a model from outside, which its name does not identify.
    """

    name: str
    title: str
    method: Method[Any]
    simulation: str | None = None
    digest: str = ""

    def tasks(
        self,
        comparison: int,
        hold_out: HoldOut[Any],
        splits: Sequence[Split],
        seed: int,
        *,
        inner_errors: bool = False,
    ) -> Iterator[Task]:
        """Yield the tasks for some splits of a hold-out.

        One task if the method predicts all folds at once, otherwise one for every few splits.
        """
        folds = hold_out.folds if self.method.shares_folds(seed) else None
        size = self.method.splits_per_task if folds is None else max(len(splits), 1)
        for start in range(0, len(splits), size):
            part = tuple(splits[start : start + size])
            data = self.method.required_data(hold_out, np.concatenate([split.test for split in part]))
            yield Task(comparison, self, data, part, seed, folds, inner_errors)


@dataclass(frozen=True, eq=False)
class Task:
    """Some splits of one model, to be run in any process.

    Attributes
    ----------
    comparison : int
        Number of the comparison.
    spec : ModelSpec
    data : object
        See `Method.required_data`.
    splits : tuple of Split
    seed : int
    folds : ndarray of int or None, shape (trips,)
        Fold of each trip if all folds are predicted at once; otherwise None.
    inner_errors : bool
        Whether to compute the errors inside the folds, by which settings are compared.
    """

    comparison: int
    spec: ModelSpec
    data: Any
    splits: tuple[Split, ...]
    seed: int
    folds: IntArray | None = None
    inner_errors: bool = False

    @property
    def rank(self) -> tuple[int, int]:
        """Key that sorts tasks in the order in which they start."""
        return (self.spec.method.rank if self.folds is None else 0, -len(self.splits))

    def run(self) -> list[FoldResult]:
        """Fit and predict; return the result of each split."""
        if self.folds is None:
            return [self._split_result(split) for split in self.splits]
        return self._run_together(self.folds)

    def _split_result(self, split: Split) -> FoldResult:
        """Fit and predict one split; if that fails, each of its trips alone shows which of them have no prediction."""
        try:
            predict = self._fit(split.train)
        except FAILURES as error:
            failed = dict.fromkeys(split.test.tolist(), _reason(error))
        else:
            try:
                return FoldResult(self.spec.name, split, **predict(split.test))
            except FAILURES:
                failed = _failures(predict, split.test)
        rest = replace(split, test=split.test[~np.isin(split.test, list(failed))])
        values = predict(rest.test) if len(rest.test) else NO_PREDICTION
        return FoldResult(self.spec.name, rest, **values, failed=failed)

    def _run_together(self, folds: IntArray) -> list[FoldResult]:
        """Predict all folds at once; the times of fit and prediction are those of one ordinary fit to all trips."""
        fitted = self.spec.method.fit_all_folds(self.data, folds, self.seed, inner_errors=self.inner_errors)
        trips, fold_numbers = np.arange(len(folds)), np.unique(folds)
        ordinary_fit = self._fit(trips)(trips[:TIMED_TRIPS])
        inner = np.full(len(fold_numbers), np.nan) if fitted.inner_errors is None else fitted.inner_errors
        errors = dict(zip(fold_numbers.tolist(), inner.tolist(), strict=True))
        results = []
        for split in self.splits:
            found = {"predicted_wh": fitted.predict(split.test), "inner_error": errors[split.number]}
            results.append(FoldResult(self.spec.name, split, **ordinary_fit | found))
        return results

    def _fit(self, train: IntArray) -> Callable[[IntArray], dict[str, Any]]:
        """Fit to trips; return a function that predicts others, with the times of fit and prediction."""
        began = time.perf_counter()
        fitted = self.spec.method.fit(self.data, train, self.seed)
        fit_s = time.perf_counter() - began

        def predict(test: IntArray) -> dict[str, Any]:
            began = time.perf_counter()
            values = {"predicted_wh": fitted.predict(test), "fit_s": fit_s}
            each_ms = 1000.0 * (time.perf_counter() - began) / len(test)
            forecasts = None if fitted.forecasts is None else fitted.forecasts(test)
            return values | {"predict_ms": each_ms, "forecasts": forecasts}

        return predict


def _failures(predict: Callable[[IntArray], object], trips: IntArray) -> dict[int, str]:
    """Return the reason of each trip that has no prediction alone."""
    failed = {}
    for trip in trips.tolist():
        try:
            predict(np.array([trip]))
        except FAILURES as error:
            failed[trip] = _reason(error)
    return failed


def _reason(error: Exception) -> str:
    """Return what failed, in one line; an error of another package with its type."""
    text = "; ".join(str(error).splitlines())
    return text if isinstance(error, InvalidInput) else f"{type(error).__name__}: {text}"
