"""The inside of the learners, each fitted once on all trips of the main hold-out: curves, importances, the GAMM."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from tripwatt.gam import Autocorrelation, Diagnosis, RandomEffects, Summary, autocorrelation
from tripwatt.gam.effects import Effect
from tripwatt.hybrid.trip_table import EnergyModel, TripTable
from tripwatt.paper.models import HybridModel
from tripwatt.paper.table2 import TABLE2, Table2Corrector


@dataclass(frozen=True, eq=False)
class GammInsight:
    """A fitted GAMM on paper: tables, residuals, effects, and where a held-out trip leaves its data.

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
    full_step_s : float
        Median time between neighbouring rows of the trips [s].
    full_correlation : float
        Correlation of neighbouring residuals of a trip at `full_step_s`.
    outside : DataFrame
        `trip, covariate, share`: the trips that leave the training data of a fit without them, and with which share
        of their rows.
    left_out : tuple of str
        Terms of the formula whose covariates no trip has or that never vary.
    """

    summary: Summary
    diagnosis: Diagnosis
    effects: Mapping[str, Effect]
    autocorrelation: Autocorrelation
    row_step_s: float
    full_step_s: float
    full_correlation: float
    outside: pd.DataFrame
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Insight:
    """Learning curves, importances and the GAMM; None for what no learner of the run has.

    Attributes
    ----------
    learning_curves : DataFrame or None
        `model, fold, rounds, error`.
    importances : DataFrame or None
        `model, covariate, importance`.
    gamm : GammInsight or None
    """

    learning_curves: pd.DataFrame | None = None
    importances: pd.DataFrame | None = None
    gamm: GammInsight | None = None


def insight(table: TripTable, models: Mapping[str, EnergyModel], *, weathers: Sequence[str] = ()) -> Insight:
    """Fit each learner once on the whole table: learning curves, importances and the GAMM's tables.

    Parameters
    ----------
    table : TripTable
    models : mapping of str to EnergyModel
        Unfitted models by name.
    weathers : sequence of str
        Every weather of the data set. One without a row in the table is a level without data: 0.00 (0.00).
    """
    curves, importances, gamm = [], [], None
    for name, model in models.items():
        if not isinstance(model, HybridModel):
            continue
        if isinstance(model.corrector, Table2Corrector):
            gamm = gamm_insight(model, _with_levels(table, weathers))
            continue
        model.fit(table)
        curve = getattr(model.corrector, "learning_curve_", None)
        if curve is not None:
            curves.append(curve.rename(columns={"round": "rounds"}).assign(model=name))
        if hasattr(model.corrector, "permutation_importance"):
            importance = model.corrector.permutation_importance(*model.training_data(table))
            importances.append(importance.assign(model=name))
    return Insight(
        pd.concat(curves, ignore_index=True) if curves else None,
        pd.concat(importances, ignore_index=True) if importances else None,
        gamm,
    )


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
    corrector = model.corrector
    X, residual, groups = model.training_data(table)
    frame, rows = corrector.training_frame(X, groups)
    fitted = corrector.model_
    whole = np.asarray(fitted.predict(corrector.frame(X, groups)), dtype=np.float64)
    neighbours = autocorrelation(residual - whole, groups, max_lag=1)
    return GammInsight(
        summary=fitted.summary(),
        diagnosis=fitted.diagnosis(),
        effects={label: _named(effect, table.trip_ids) for label, effect in fitted.effects(frame).items()},
        autocorrelation=autocorrelation(fitted.residuals_, groups[rows]),
        row_step_s=_step_s(X["time_s"].to_numpy()[rows], groups[rows]),
        full_step_s=_step_s(X["time_s"].to_numpy(), groups),
        full_correlation=float(neighbours.correlation[0]),
        outside=outside_the_others(table, rows),
        left_out=corrector.left_out_,
    )


def _named(effect: Effect, trip_ids: Sequence[str]) -> Effect:
    """Random effects under the names of the trips; in the engine they are numbers."""
    if not isinstance(effect, RandomEffects):
        return effect
    return replace(effect, level=tuple(trip_ids[int(number)] for number in effect.level))


def _step_s(time_s: Any, groups: Any) -> float:
    return float(np.median(np.diff(time_s)[np.diff(groups) == 0]))


def outside_the_others(table: TripTable, rows: Any = None) -> pd.DataFrame:
    """Trips that leave what all the other trips have shown: the range of a number, or the levels of the weather.

    "time_s in winter" is a winter trip that leaves the range of the other winter trips, but not that of all trips.

    Parameters
    ----------
    table : TripTable
    rows : ndarray of int, optional
        Rows of a fit; all by default.

    Returns
    -------
    DataFrame
        `trip, covariate, share`, the last the fraction of the trip's rows, above 0.
    """
    groups, seen = table.groups, slice(None) if rows is None else rows
    listed: list[tuple[str, str, float]] = []

    def note(name: str, outside: Any) -> None:
        share = np.bincount(groups, weights=outside, minlength=len(table)) / np.diff(table.offsets)
        listed.extend((table.trip_ids[i], name, float(share[i])) for i in np.flatnonzero(share))

    winter = np.array([trip.context.season == "winter" for trip in table.trips])
    for name, column in table.covariates.items():
        if pd.api.types.is_numeric_dtype(column):
            values = column.to_numpy(dtype=np.float64)
            by_trip = pd.Series(values[seen]).groupby(groups[seen])
            ends = by_trip.agg(["min", "max"]).reindex(range(len(table)))
            outside = _beyond(values, groups, ends)
            note(str(name), outside)
            if f"s({name}, by=season)" in TABLE2 and winter.any():
                own = _beyond(values, groups, ends[winter].reindex(ends.index)) & winter[groups]
                note(f"{name} in winter", own & ~outside)
        elif name == "weather":
            trips = column.groupby(groups, observed=True).first()
            note("weather", (trips.map(trips.value_counts()).astype(int) < 2).to_numpy()[groups])
    return pd.DataFrame(listed, columns=["trip", "covariate", "share"])


def _beyond(values: Any, groups: Any, ends: pd.DataFrame) -> Any:
    """Rows outside of the range of all trips but their own; `ends` has the range of each trip, NaN to leave it out."""
    low, high = _without_each(ends["min"].to_numpy()), -_without_each(-ends["max"].to_numpy())
    return (values < low[groups]) | (values > high[groups])


def _without_each(values: Any) -> Any:
    """The smallest of all values but the own one; infinite where no other is known."""
    known = np.where(np.isfinite(values), values, np.inf)
    first = int(np.argmin(known))
    rest = np.full(len(known), known[first])
    rest[first] = np.min(np.delete(known, first), initial=np.inf)
    return rest
