"""The GAMM, fitted once on all trips of the main hold-out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tripwatt.hybrid.trip_table import EnergyModel, TripTable
from tripwatt.study.paper.models import HybridModel
from tripwatt.study.paper.table2 import Table2Corrector

if TYPE_CHECKING:
    from tripwatt_gamm import Autocorrelation, Diagnosis, Summary
    from tripwatt_gamm.effects import Effect


@dataclass(frozen=True, eq=False)
class GammInsight:
    """A fitted GAMM on paper: tables, residuals and effects.

    Attributes
    ----------
    summary : Summary
        Estimates in Wh.
    diagnosis : Diagnosis
        Residuals in Wh.
    effects : mapping of str to Effect
        By the label of the term, in Wh; random effects bear the names of the trips.
    autocorrelation : Autocorrelation
        Of the residuals of the rows that were fitted.
    row_step_s : float
        Median time between neighbouring rows of the fit [s].
    left_out : tuple of str
        Terms of the formula whose covariates no trip has or that never vary.
    """

    summary: Summary
    diagnosis: Diagnosis
    effects: Mapping[str, Effect]
    autocorrelation: Autocorrelation
    row_step_s: float
    left_out: tuple[str, ...] = ()


def insight(
    table: TripTable, models: Mapping[str, EnergyModel], *, weathers: Sequence[str] = ()
) -> GammInsight | None:
    """Fit the GAMM once on the whole table; None where it is not among the models.

    Parameters
    ----------
    table : TripTable
    models : mapping of str to EnergyModel
        Unfitted models by name.
    weathers : sequence of str
        Every weather of the data set. One without a row in the table is a level without data: 0.00 (0.00).
    """
    for model in models.values():
        if isinstance(model, HybridModel) and isinstance(model.corrector, Table2Corrector):
            return gamm_insight(model, _with_levels(table, weathers))
    return None


def _with_levels(table: TripTable, weathers: Sequence[str]) -> TripTable:
    """The table whose weather declares these levels beside its own."""
    if "weather" not in table.covariates:
        return table
    weather = table.covariates["weather"]
    levels = sorted({*weather.cat.categories, *weathers})
    return replace(table, covariates=table.covariates.assign(weather=weather.cat.set_categories(levels)))


def gamm_insight(model: HybridModel, table: TripTable) -> GammInsight:
    """Fit a hybrid with the GAMM on a table, and keep its tables, residuals and effects.

    Parameters
    ----------
    model : HybridModel
        Its corrector is a `Table2Corrector`.
    table : TripTable
    """
    model.fit(table)
    from tripwatt_gamm import autocorrelation  # an extra, which the fit has found

    corrector = model.corrector
    X, _, groups = model.training_data(table)
    frame, rows = corrector.training_frame(X, groups)
    fitted = corrector.model_
    return GammInsight(
        summary=fitted.summary(),
        diagnosis=fitted.diagnosis(),
        effects={label: _named(effect, table.trip_ids) for label, effect in fitted.effects(frame).items()},
        autocorrelation=autocorrelation(fitted.residuals_, groups[rows]),
        row_step_s=_step_s(X["time_s"].to_numpy()[rows], groups[rows]),
        left_out=corrector.left_out_,
    )


def _named(effect: Effect, trip_ids: Sequence[str]) -> Effect:
    """Random effects under the names of the trips; in the engine they are numbers."""
    from tripwatt_gamm import RandomEffects

    if not isinstance(effect, RandomEffects):
        return effect
    return replace(effect, level=tuple(trip_ids[int(number)] for number in effect.level))


def _step_s(time_s: Any, groups: Any) -> float:
    return float(np.median(np.diff(time_s)[np.diff(groups) == 0]))
