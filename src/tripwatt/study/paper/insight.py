"""The GAMM, fitted once on all trips of the main hold-out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tripwatt.hybrid.trip_table import EnergyModel, TripTable
from tripwatt.study.paper.models import HybridModel
from tripwatt.study.paper.table2 import Table2Corrector

if TYPE_CHECKING:
    from tripwatt_gamm import Autocorrelation, Diagnosis, Summary
    from tripwatt_gamm.effects import Effect


@dataclass(frozen=True, eq=False)
class GammInsight:
    """Tables, residuals and effects of a fitted GAMM.

    Attributes
    ----------
    summary : Summary
        Estimates in Wh.
    diagnosis : Diagnosis
        Residuals in Wh.
    effects : mapping of str to Effect
        Effects in Wh by the label of the term; levels of random effects are the ids of the trips.
    autocorrelation : Autocorrelation
        Autocorrelation of the residuals of the fitted rows.
    row_step_s : float
        Median time between neighbouring rows of the fit [s].
    left_out : tuple of str
        Terms of the formula that were left out, because no trip has their covariates or these never vary.
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
    """Fit the GAMM once on the whole table; returns None if it is not among the models.

    Parameters
    ----------
    table : TripTable
    models : mapping of str to EnergyModel
        Unfitted models by name.
    weathers : sequence of str
        Every weather of the data set. One without a row in the table is a level without data: 0.00 (0.00).
    """
    hybrids = (model for model in models.values() if isinstance(model, HybridModel))
    model = next((hybrid for hybrid in hybrids if isinstance(hybrid.corrector, Table2Corrector)), None)
    if model is None:
        return None
    table = _with_levels(table, weathers)
    model.fit(table)
    from tripwatt_gamm import autocorrelation  # an extra, which the fit has found

    corrector = model.corrector
    X, _, groups = model.training_data(table)
    frame, rows = corrector.training_frame(X, groups)
    fitted, step_s = corrector.model_, np.diff(X["time_s"].to_numpy()[rows])
    return GammInsight(
        summary=fitted.summary(),
        diagnosis=fitted.diagnosis(),
        effects={label: _named(effect, table.trip_ids) for label, effect in fitted.effects(frame).items()},
        autocorrelation=autocorrelation(fitted.residuals_, groups[rows]),
        row_step_s=float(np.median(step_s[np.diff(groups[rows]) == 0])),
        left_out=corrector.left_out_,
    )


def _with_levels(table: TripTable, weathers: Sequence[str]) -> TripTable:
    """Return the table with these levels of the weather declared beside its own."""
    if "weather" not in table.covariates:
        return table
    weather = table.covariates["weather"]
    levels = sorted({*weather.cat.categories, *weathers})
    return replace(table, covariates=table.covariates.assign(weather=weather.cat.set_categories(levels)))


def _named(effect: Effect, trip_ids: Sequence[str]) -> Effect:
    """Name the levels of random effects by the ids of the trips instead of their numbers; return other effects unchanged."""
    from tripwatt_gamm import RandomEffects

    if not isinstance(effect, RandomEffects):
        return effect
    return replace(effect, level=tuple(trip_ids[int(number)] for number in effect.level))
