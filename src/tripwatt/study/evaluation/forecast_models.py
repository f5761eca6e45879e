"""Models of the forecast protocol: correctors of power, boosting without physics, and the forecast itself.

Everything that is fitted, tuned or calibrated is fitted inside the fold, also the uncertainty of the forecast. To
predict a held-out trip, a model uses its speed trace, its road and what was known at departure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.forecasting import ForecastModel
from tripwatt.hybrid import Corrector, power_corrector
from tripwatt.hybrid.familiarity import Familiarity
from tripwatt.hybrid.power import LearnerCorrector
from tripwatt.study.evaluation.forecast_data import ForecastData
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecast
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.tasks import Fitted, Method


@dataclass(frozen=True, slots=True)
class PowerMethod(Method[ForecastData]):
    """A corrector of power on the physics.

    Attributes
    ----------
    corrector : str or None
        One of `tripwatt.hybrid.POWER_CORRECTORS`; None for the physics alone.
    identified : bool
        Whether the stages of the car are identified on the trips of the fit.
    """

    corrector: str | None
    identified: bool = False

    def fit(self, data: ForecastData, train: IntArray, seed: int) -> Fitted:
        """Fit the corrector to the residual: measured minus simulated power."""
        segments = data.identified([train])[0][1] if self.identified else data.segments
        corrector = self.corrector and power_corrector(self.corrector, seed).fit(segments.take(train))

        def predict(test: IntArray) -> FloatArray:
            scored = segments.take(test)
            correction = corrector.predict(scored) if corrector else 0.0
            return scored.totals_wh(scored.simulated_w + correction)

        return Fitted(predict)

    def shares_folds(self, seed: int) -> bool:
        """Whether the corrector is a learner and the car is not identified in each fold."""
        if self.corrector is None or self.identified:
            return False
        return isinstance(power_corrector(self.corrector, seed), LearnerCorrector)

    def fit_all_folds(self, data: ForecastData, folds: IntArray, seed: int, *, inner_errors: bool) -> Fitted:
        """Correct the power of each trip by its familiarity with trips of the other folds."""
        learner, segments = self._learner(seed), data.segments
        correction = _left_out(learner, learner.columns(segments), segments.residual_w, data, folds)
        share, features, row_folds = np.ones(len(correction)), segments.features, folds[segments.groups]
        for fold in np.unique(folds):
            rows = row_folds == fold
            share[rows] = Familiarity.from_features(features[~rows], learner.features).share(features[rows])
        return Fitted(segments.totals_wh(segments.simulated_w + correction * share).__getitem__)

    def required_data(self, hold_out: HoldOut[ForecastData], scored: IntArray) -> ForecastData:
        """Return the segments, and if the stages are identified the plans and the evidence of the signals."""
        return replace(hold_out.data, logs=(), trips=()) if self.identified else hold_out.data.slim()

    def _learner(self, seed: int) -> LearnerCorrector:
        """Make a corrector whose learner predicts all folds, each held out, at once."""
        built = power_corrector(self.corrector or "", seed)
        assert isinstance(built, LearnerCorrector)
        return built


class DataMethod(PowerMethod):
    """The learner of a corrector on the measured power itself, without physics."""

    def fit(self, data: ForecastData, train: IntArray, seed: int) -> Fitted:
        """Fit the learner."""
        segments, columns = data.segments, data.data_features
        learner = self._learner(seed)
        rows = np.isin(segments.groups, train)
        learner.model.fit(columns[rows], segments.observed_power_w[rows], groups=segments.groups[rows])

        def predict(test: IntArray) -> FloatArray:
            power = learner.model.predict(columns[np.isin(segments.groups, test)])
            return segments.take(np.sort(test)).totals_wh(np.asarray(power))

        return Fitted(predict)

    def fit_all_folds(self, data: ForecastData, folds: IntArray, seed: int, *, inner_errors: bool) -> Fitted:
        """Predict the power of each trip."""
        learner, segments = self._learner(seed), data.segments
        power = _left_out(learner, data.data_features, segments.observed_power_w, data, folds)
        return Fitted(segments.totals_wh(power).__getitem__)


def _left_out(
    learner: LearnerCorrector, columns: object, target: FloatArray, data: ForecastData, folds: IntArray
) -> FloatArray:
    """Predict each segment by a learner fitted without the segment's fold."""
    groups = data.segments.groups
    return np.asarray(learner.model.leave_groups_out(columns, target, groups=groups, folds=folds[groups]))


@dataclass(frozen=True, slots=True)
class ForecastMethod(Method[ForecastData]):
    """The forecast itself: its centre, its intervals and its updates, on a car that is identified in the fold.

    Attributes
    ----------
    corrector : str or Corrector
        One of `tripwatt.hybrid.POWER_CORRECTORS`, or an object from outside.
    """

    corrector: str | Corrector
    rank: ClassVar[int] = 1
    splits_per_task: ClassVar[int] = 1

    def fit(self, data: ForecastData, train: IntArray, seed: int) -> Fitted:
        """Identify the car, fit model and uncertainty."""
        ((vehicle, segments),) = data.identified([train])
        model = ForecastModel(vehicle, self.corrector, seed)
        model.fit_segments(
            segments.take(train),
            again=lambda several: [t.take(train) for _, t in data.identified([train[s] for s in several])],
        )
        forecast = cache(lambda trip: model.forecast(data.plans[trip]))

        def held_out(trip: int) -> HeldOutForecast:
            return HeldOutForecast.from_forecast(model, data.plans[trip], forecast(trip), data.logs[trip])

        return Fitted(
            lambda test: np.array([forecast(trip).energy_wh for trip in test.tolist()]),
            lambda test: [held_out(trip) for trip in test.tolist()],
        )

    def required_data(self, hold_out: HoldOut[ForecastData], scored: IntArray) -> ForecastData:
        """Return everything but the table, the recorded trips, and the logs of trips that are not scored."""
        data, scored_trips = hold_out.data, set(scored.tolist())
        logs = tuple(log if i in scored_trips else log.iloc[:0] for i, log in enumerate(data.logs))
        return replace(data, table=data.table.take([]), logs=logs, trips=())
