"""Models of the forecast protocol: correctors of power, boosting without physics, and the forecast itself.

Everything that is fitted, tuned or calibrated is fitted inside the fold, also the uncertainty of the forecast. A model
sees of a held-out trip what was known at its departure; only the re-forecasts see measurements, and of these no sample
after the cut.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.evaluation.forecast_data import CHARGE_COLUMNS, ForecastData
from tripwatt.evaluation.forecast_scores import (
    ARRIVAL_STARTS,
    FRACTIONS,
    LEVELS,
    RESERVE_OFFSETS,
    UPDATE_LEVEL,
    UPDATES,
)
from tripwatt.evaluation.hold_outs import LEAVE_ONE_TRIP_OUT, TRAINING_ONLY, HoldOut
from tripwatt.evaluation.protocol import FoldResult
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.forecast import p_above
from tripwatt.hybrid import power_corrector
from tripwatt.hybrid.climate_log import TOLD_BY
from tripwatt.hybrid.familiarity import Familiarity
from tripwatt.hybrid.power import LearnerCorrector
from tripwatt.trips import Plan

FOLDS_PER_TASK: Final = 12
CURVE_SIZES: Final = (5, 10, 20, 40)
CURVE_DRAWS: Final = 6
CURVE_LEAST_TEST: Final = 8
"""Trips that have to be left to score a training size of the curve."""
CRPS_LEVELS: Final = 100

Predict = Callable[[IntArray], FloatArray]
"""Numbers of trips, ascending -> their energies [Wh]."""


def fit_power(corrector: str, seed: int, data: ForecastData, train: IntArray) -> Predict:
    """Fit a corrector of power on some trips."""
    segments = data.segments
    fitted = power_corrector(corrector, seed).fit(segments.take(train))

    def predict(test: IntArray) -> FloatArray:
        found = segments.take(test)
        return found.totals_wh(found.simulated_w + fitted.predict(found))

    return predict


def fit_without_physics(corrector: str, seed: int, data: ForecastData, train: IntArray) -> Predict:
    """Fit the learner of a corrector on the measured power of some trips."""
    segments, columns = data.segments, data.data_features
    learner = _learner(corrector, seed).model
    rows = np.isin(segments.groups, train)
    learner.fit(columns[rows], segments.take(np.sort(train)).observed_power_w, groups=segments.groups[rows])

    def predict(test: IntArray) -> FloatArray:
        chosen = np.isin(segments.groups, test)
        return segments.take(np.sort(test)).totals_wh(np.asarray(learner.predict(columns[chosen])))

    return predict


def _learner(corrector: str, seed: int) -> LearnerCorrector:
    found = power_corrector(corrector, seed)
    assert isinstance(found, LearnerCorrector)
    return found


@dataclass(frozen=True, slots=True)
class PowerModel:
    """A corrector of power in the protocol, or its learner without physics.

    Attributes
    ----------
    name, title : str
    corrector : str
        One of `tripwatt.hybrid.POWER_CORRECTORS`.
    simulation : str or None
        "physics", or None for the learner on the measured power itself.
    """

    name: str
    title: str
    corrector: str
    simulation: str | None = "physics"

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """All of them."""
        return hold_out.fold_numbers

    def tasks(self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int) -> Iterator[PowerTask]:
        """One task for a learner that gives all folds at once, else one for a few folds."""
        size = max(len(folds), 1) if self.gives_all_folds(seed) else FOLDS_PER_TASK
        data = hold_out.data.slim()
        for start in range(0, len(folds), size):
            yield PowerTask(index, self, data, hold_out.folds, tuple(folds[start : start + size]), seed)

    def gives_all_folds(self, seed: int) -> bool:
        """Whether the learner gives the held-out predictions of all folds at once."""
        return isinstance(power_corrector(self.corrector, seed), LearnerCorrector)

    def fit(self, seed: int, data: ForecastData, train: IntArray) -> Predict:
        """Fit on some trips."""
        fit = fit_power if self.simulation else fit_without_physics
        return fit(self.corrector, seed, data, train)

    def learned(self, seed: int, data: ForecastData) -> tuple[Any, Any, FloatArray, FloatArray]:
        """Learner, its columns, its target and the power that it adds to, over all rows [W]."""
        segments, found = data.segments, _learner(self.corrector, seed)
        if self.simulation is None:
            target = segments.observed_power_w
            return found.model, data.data_features, target, np.zeros(len(target))
        return found.model, found.columns(segments), segments.residual_w, segments.simulated_w


@dataclass(frozen=True)
class PowerTask:
    """Some folds of a model of power."""

    evaluation: int
    spec: PowerModel
    data: ForecastData
    folds: IntArray
    members: tuple[int, ...]
    seed: int

    @property
    def rank(self) -> int:
        """Learners of all folds take longest."""
        return 0 if self.spec.gives_all_folds(self.seed) else 3

    def run(self) -> list[FoldResult]:
        """Energies of the trips of each fold."""
        if self.spec.gives_all_folds(self.seed) and TRAINING_ONLY not in self.folds:
            return self._run_together()
        return [self._run_fold(fold) for fold in self.members]

    def _run_together(self) -> list[FoldResult]:
        """All folds at once; the times are those of one plain fit."""
        segments = self.data.segments
        learner, columns, target, start = self.spec.learned(self.seed, self.data)
        row_folds = self.folds[segments.groups]
        held_out = np.asarray(
            learner.leave_groups_out(columns, target, groups=segments.groups, folds=row_folds)
        )
        totals = segments.totals_wh(start + held_out * self._share(row_folds))
        began = time.perf_counter()
        learner.fit(columns, target, groups=segments.groups)
        fitted = time.perf_counter()
        learner.predict(columns)
        each_ms = 1000.0 * (time.perf_counter() - fitted) / len(segments)
        name = self.spec.name
        return [
            FoldResult(self.evaluation, name, fold, totals[self.folds == fold], fitted - began, each_ms)
            for fold in self.members
        ]

    def _share(self, row_folds: IntArray) -> FloatArray:
        """Share of a correction that counts in each row, as its fold was left out; 1 without physics."""
        features, share = self.data.segments.features, np.ones(len(row_folds))
        if self.spec.simulation is None:
            return share
        columns = _learner(self.spec.corrector, self.seed).features
        for fold in self.members:
            own = row_folds == fold
            share[own] = Familiarity.from_features(features[~own], columns).share(features[own])
        return share

    def _run_fold(self, fold: int) -> FoldResult:
        test = np.flatnonzero(self.folds == fold)
        began = time.perf_counter()
        predict = self.spec.fit(self.seed, self.data, np.flatnonzero(self.folds != fold))
        fitted = time.perf_counter()
        totals = predict(test)
        each_ms = 1000.0 * (time.perf_counter() - fitted) / len(test)
        return FoldResult(self.evaluation, self.spec.name, fold, totals, fitted - began, each_ms)


@dataclass(frozen=True, slots=True)
class IdentifiedModel:
    """Physics whose stages are identified on the training trips of each fold, alone or with a corrector of power.

    Attributes
    ----------
    name, title : str
    corrector : str or None
        One of `tripwatt.hybrid.POWER_CORRECTORS`; None for the physics alone.
    simulation : str
    """

    name: str
    title: str
    corrector: str | None
    simulation: str | None = "physics"

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """All of them."""
        return hold_out.fold_numbers

    def tasks(
        self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int
    ) -> Iterator[IdentifiedTask]:
        """One task for a few folds."""
        data: ForecastData = replace(hold_out.data, logs=())
        for start in range(0, len(folds), FOLDS_PER_TASK):
            yield IdentifiedTask(
                index, self, data, hold_out.folds, tuple(folds[start : start + FOLDS_PER_TASK]), seed
            )


@dataclass(frozen=True)
class IdentifiedTask:
    """Some folds of an identified model."""

    evaluation: int
    spec: IdentifiedModel
    data: ForecastData
    folds: IntArray
    members: tuple[int, ...]
    seed: int
    rank: int = 2

    def run(self) -> list[FoldResult]:
        """Energies of the trips of each fold."""
        return [self._run_fold(fold) for fold in self.members]

    def _run_fold(self, fold: int) -> FoldResult:
        train, test = np.flatnonzero(self.folds != fold), np.flatnonzero(self.folds == fold)
        began = time.perf_counter()
        _, segments = self.data.identified(train)
        found = segments.take(test)
        power = found.simulated_w
        if self.spec.corrector is not None:
            power = power + power_corrector(self.spec.corrector, self.seed).fit(segments.take(train)).predict(
                found
            )
        spent = time.perf_counter() - began
        return FoldResult(self.evaluation, self.spec.name, fold, found.totals_wh(power), spent, 0.0)


@dataclass(frozen=True, slots=True)
class ForecastSpec:
    """The forecast itself: its centre, its intervals and its updates, on a car that is identified in the fold.

    Attributes
    ----------
    name, title : str
    corrector : str
        One of `tripwatt.hybrid.POWER_CORRECTORS`.
    simulation : str
    """

    name: str
    title: str
    corrector: str
    simulation: str | None = "physics"

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """All of them."""
        return hold_out.fold_numbers

    def tasks(self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int) -> Iterator[ForecastTask]:
        """One task for each fold, with the logs of its held-out trips alone."""
        data: ForecastData = hold_out.data
        slim = replace(data, table=data.table.take([]), logs=())
        for fold in folds:
            own = np.flatnonzero(hold_out.folds == fold).tolist()
            logs = {i: data.logs[i] for i in own}
            yield ForecastTask(index, self, slim, hold_out.folds, fold, seed, logs)


@dataclass(frozen=True)
class ForecastTask:
    """One fold of the forecast."""

    evaluation: int
    spec: ForecastSpec
    data: ForecastData
    folds: IntArray
    fold: int
    seed: int
    logs: Mapping[int, pd.DataFrame]
    rank: int = 1

    @property
    def members(self) -> tuple[int, ...]:
        """The one fold."""
        return (self.fold,)

    def run(self) -> list[FoldResult]:
        """Identify the car, fit model and uncertainty without the fold; forecast and update its trips."""
        train, test = np.flatnonzero(self.folds != self.fold), np.flatnonzero(self.folds == self.fold)
        began = time.perf_counter()
        vehicle, segments = self.data.identified(train)
        model = ForecastModel(vehicle, self.spec.corrector, self.seed)
        training = self.data.take_stages(train)
        model.fit_segments(segments.take(train), again=lambda kept: training.identified(kept)[1])
        fitted = time.perf_counter()
        plans = [self.data.plans[int(i)] for i in test]
        forecasts = [model.forecast(plan) for plan in plans]
        energies = np.array([f.energy_wh for f in forecasts])
        each_ms = 1000.0 * (time.perf_counter() - fitted) / len(test)
        logs = [self.logs[int(i)] for i in test]
        extra = _kept(forecasts, logs) | _arrivals(model, plans, logs)
        return [
            FoldResult(self.evaluation, self.spec.name, self.fold, energies, fitted - began, each_ms, extra)
        ]


@dataclass(frozen=True, slots=True)
class LearningCurve:
    """Errors by the number of training trips, of random draws under leave-one-trip-out.

    Attributes
    ----------
    name, title : str
    curves : mapping of str to PowerModel
        Name in the results -> model.
    """

    name: str
    title: str
    curves: Mapping[str, PowerModel]
    simulation: str | None = None

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """Numbers of the draws: draw x 1000 + size."""
        if hold_out.scheme != LEAVE_ONE_TRIP_OUT:
            return frozenset()
        sizes = [size for size in CURVE_SIZES if size <= len(hold_out.table) - CURVE_LEAST_TEST]
        return frozenset(draw * 1000 + size for draw in range(CURVE_DRAWS) for size in sizes)

    def tasks(self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int) -> Iterator[CurveTask]:
        """One task for each draw; a smaller training set is part of the larger one of the same draw."""
        data = hold_out.data.slim()
        for fold in folds:
            yield CurveTask(index, self, data, fold, seed)


@dataclass(frozen=True)
class CurveTask:
    """One random draw of training trips; the models are scored on all others."""

    evaluation: int
    spec: LearningCurve
    data: ForecastData
    fold: int
    seed: int
    rank: int = 2

    @property
    def members(self) -> tuple[int, ...]:
        """The one result of the task."""
        return (self.fold,)

    def run(self) -> list[FoldResult]:
        """APE of each model over the trips that were not drawn."""
        draw, size = divmod(self.fold, 1000)
        segments = self.data.segments
        order = np.random.default_rng((self.seed, draw)).permutation(len(segments))
        train, test = np.sort(order[:size]), np.sort(order[size:])
        found = segments.take(test)
        observed = found.totals_wh(found.observed_power_w)
        extra: dict[str, npt.NDArray[Any]] = {"size": np.array(size), "draw": np.array(draw)}
        began = time.perf_counter()
        for name, model in self.spec.curves.items():
            predicted = model.fit(self.seed, self.data, train)(test)
            extra[name] = np.abs(predicted - observed) / np.abs(observed)
        spent = time.perf_counter() - began
        return [FoldResult(self.evaluation, self.spec.name, self.fold, observed, spent, 0.0, extra)]


def _kept(forecasts: Sequence[Forecast], logs: Sequence[pd.DataFrame]) -> dict[str, npt.NDArray[Any]]:
    """Everything that is scored or drawn of some forecasts, as plain arrays with one row per trip."""
    levels = (np.arange(CRPS_LEVELS) + 0.5) / CRPS_LEVELS
    bounds = np.array([[f.interval(level) for level in LEVELS] for f in forecasts])
    observed = [float(log["observed_energy_wh"].iloc[-1]) for log in logs]
    causes = [f.by_cause_wh for f in forecasts]
    series = [f.series() for f in forecasts]
    return {
        "sd": np.array([f.sd_wh for f in forecasts]),
        "low": bounds[:, :, 0],
        "high": bounds[:, :, 1],
        "factors": np.array([[f.uncertainty.scores.factor(level) for level in levels] for f in forecasts]),
        "pit": np.array([f.probability_below(o) for f, o in zip(forecasts, observed, strict=True)]),
        "flags": np.array([len(f.flags) for f in forecasts]),
        "cause_names": np.array(list(causes[0])),
        "causes": np.array([list(c.values()) for c in causes]),
        "updates": np.array(
            [[reforecast(f, log, x) for x in FRACTIONS] for f, log in zip(forecasts, logs, strict=True)]
        ),
        "series_names": np.array(list(series[0].columns)),
        "series_rows": np.array([len(s) for s in series]),
        "series": np.concatenate([s.to_numpy(dtype=np.float64) for s in series]),
    }


def _arrivals(
    model: ForecastModel, plans: Sequence[Plan], logs: Sequence[pd.DataFrame]
) -> dict[str, npt.NDArray[Any]]:
    """Displayed charge at arrival: observed, and as forecast from each start of `ARRIVAL_STARTS`."""
    rows, chances, observed = [], [], []
    for plan, log in zip(plans, logs, strict=True):
        shown = log["displayed_soc"].dropna() if "displayed_soc" in log else pd.Series(dtype=float)
        observed.append(float(shown.iloc[-1]) if len(shown) else np.nan)
        for start in ARRIVAL_STARTS:
            departure = plan.departure
            if getattr(departure, start) is None:
                rows.append([np.nan] * 3)
                chances.append([np.nan] * len(RESERVE_OFFSETS))
                continue
            other = "bms_soc" if start == "soc" else "soc"
            alone = replace(plan, departure=replace(departure, **{other: None}))
            found = model.forecast(alone)
            rows.append([found.soc_arrival, *found.soc_interval(UPDATE_LEVEL)])
            chances.append([p_above(found, found.soc_arrival + offset) for offset in RESERVE_OFFSETS])
    n = len(plans)
    return {
        "shown": np.array(observed),
        "arrival": np.array(rows).reshape(n, len(ARRIVAL_STARTS), 3),
        "arrival_chance": np.array(chances).reshape(n, len(ARRIVAL_STARTS), len(RESERVE_OFFSETS)),
    }


def reforecast(forecast: Forecast, log: pd.DataFrame, fraction: float) -> list[float]:
    """Energy of the whole trip after a fraction of its time, in the order of `UPDATES` [Wh].

    Parameters
    ----------
    forecast : Forecast
        Before departure.
    log : DataFrame
        From `measured_log`; rows after the cut are not used, except that the gauge needs the whole distance.
    fraction : float

    Returns
    -------
    list of float
        NaN where a measurement is missing. The gauge of a car that has not moved yet shows the departure forecast.
    """
    planned_series = forecast.series()
    cut = fraction * float(planned_series["time_s"].iloc[-1])
    so_far = log[log["time_s"] <= cut]
    if len(so_far) < 2:
        same = forecast.energy_wh
        return [same, float("nan"), same, same, *forecast.interval(UPDATE_LEVEL)]
    last = so_far.iloc[-1]
    measured = ["time_s", "observed_energy_wh", *(c for c in TOLD_BY if c in so_far)]
    updated = forecast.update_since_departure(so_far[measured])
    low, high = updated.interval(UPDATE_LEVEL)
    charge = [c for c in CHARGE_COLUMNS if c in so_far and so_far[c].notna().any()]
    by_charge = (
        forecast.update_since_departure(so_far[["time_s", *charge]]).energy_wh if charge else float("nan")
    )
    then = float(np.interp(last["time_s"], planned_series["time_s"], planned_series["energy_wh"]))
    metres, whole = float(last["distance_m"]), float(planned_series["distance_m"].iloc[-1])
    gauge = float(last["observed_energy_wh"]) * whole / metres if metres > 0.0 else forecast.energy_wh
    found = {
        "update": updated.energy_wh,
        "soc_only": by_charge,
        "no_update": float(last["observed_energy_wh"]) + forecast.energy_wh - then,
        "naive_gauge": gauge,
        "update_low": low,
        "update_high": high,
    }
    return [found[name] for name in UPDATES]
