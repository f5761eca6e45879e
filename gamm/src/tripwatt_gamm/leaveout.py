"""Leave groups out.

The crossproduct of a fold is summed over its rows; if rows are many, it is the total minus that of the rows held out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from tripwatt_gamm.arrays import BoolArray, FloatArray
from tripwatt_gamm.covariates import EXACT_ROWS, Index
from tripwatt_gamm.design import Design
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.identify import identify, require_rows
from tripwatt_gamm.moments import Moments, moments
from tripwatt_gamm.solve import FitSettings, Problem, solve
from tripwatt_gamm.tables import previous_rows

DEAD = 1e-10
"""Share of a column's sum of squares up to which the rest after subtraction is only rounding: a choice, because sums of
millions of rows have relative errors of some 1e-13."""


def grouped_moments(design: Design, y: FloatArray, groups: Index, rows: Index, lagged: bool) -> Moments:
    """Compute the moments of `rows`; if `lagged`, group by group."""
    if not lagged:
        return moments(design.rows, y, rows, False)
    order = rows[np.argsort(groups[rows], kind="stable")]
    pieces = np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)
    total = moments(design.rows, y, pieces[0], True)
    for piece in pieces[1:]:
        total = total + moments(design.rows, y, piece, True)
    return total


def identified_moments(
    design: Design, sums: Moments, y: FloatArray, groups: Index, rows: Index
) -> tuple[Design, Moments]:
    """Return the design without directions that nothing determines, and its moments.

    Parameters
    ----------
    design : Design
    sums : Moments
        Moments of `rows`; they are computed again if columns of a term were removed.
    y : ndarray (n,)
    groups : ndarray (n,)
    rows : ndarray
        Numbers of the rows of the fit.
    """
    reduced = identify(design, sums.gram[0])
    if reduced.p != design.p:
        sums = grouped_moments(reduced, y, groups, rows, sums.lagged)
    return reduced, sums


def _fold(
    design: Design,
    frame: pd.DataFrame,
    y: FloatArray,
    groups: Index,
    held: BoolArray,
    total: Moments,
    settings: FitSettings,
    wanted: pd.DataFrame | None = None,
) -> tuple[FloatArray, dict[str, int | bool]]:
    """Fit without the rows held out; return predictions of these rows (or of `wanted`) and a report of the fit."""
    lagged = total.lagged
    held_rows, kept = np.flatnonzero(held).astype(np.intp), np.flatnonzero(~held).astype(np.intp)
    if len(y) <= EXACT_ROWS:  # in a difference the last digits would still depend on the held-out response
        sums = grouped_moments(design, y, groups, kept, lagged)
    else:
        sums = total - grouped_moments(design, y, groups, held_rows, lagged)
    dead = np.diag(sums.gram[0]) <= DEAD * np.diag(total.gram[0])
    sums.gram[:, dead], sums.gram[:, :, dead], sums.cross[:, dead] = 0.0, 0.0, 0.0
    # the notes and empty columns of this fold are not those of the whole
    copy = replace(design, notes=[], empty=list(design.empty))
    reduced, sums = identified_moments(copy, sums, y, groups, kept)
    active = reduced.active(np.diag(sums.gram[0]))
    stack, which = reduced.penalty_stack(active)
    where = f"without fold of row {held_rows[0]}"
    require_rows(len(kept), stack, where)
    if settings.rho is not None:
        settings = replace(settings, rho=settings.rho[which])
    previous = previous_rows(groups[kept]) if lagged else None
    rows = reduced.rows.subset(kept, active)
    solution = solve(Problem(rows, y[kept], sums, stack, active, settings, previous), where)
    beta = np.zeros(reduced.p)
    beta[active] = solution.beta
    training, piece = reduced.training_of(~held), frame.iloc[held_rows] if wanted is None else wanted
    if reduced.terms[0].extrapolation == "clamp":
        piece = training.clamp_frame(piece)
    prediction = np.zeros(len(piece))
    for fitted in reduced.terms:
        if fitted.kind != "random" or beta[fitted.slice].any():
            prediction += fitted.matrix(piece, training) @ beta[fitted.slice]
    return prediction, {"rows": len(held_rows), "converged": solution.converged, "n_iter": solution.n_iter}


def leave_out(
    design: Design,
    frame: pd.DataFrame,
    y: FloatArray,
    groups: Index,
    folds: Index,
    settings: FitSettings,
    at: tuple[pd.DataFrame, Index] | None = None,
) -> tuple[FloatArray, pd.DataFrame]:
    """Predict each fold from all other rows.

    Parameters
    ----------
    design : Design
        Design of all rows; its bases depend on covariates only.
    frame : DataFrame
    y : ndarray (n,)
    groups, folds : ndarray (n,)
        Codes of the groups, and of the units to leave out.
    settings : FitSettings
    at : (DataFrame, ndarray of int), optional
        Rows to predict instead of those of the fit, and the fold of each: the fit without this fold predicts the row.

    Returns
    -------
    predictions : ndarray (n,), or one for each row of `at`
    report : DataFrame
        One row per fold: rows, converged, n_iter.

    Raises
    ------
    InvalidInput
        If there are fewer than two folds.
    """
    count = int(folds.max()) + 1
    if count < 2:
        raise InvalidInput.of("only one group", "leave_groups_out", "1 fold", "two or more")
    all_rows = np.arange(len(y), dtype=np.intp)
    total = grouped_moments(design, y, groups, all_rows, settings.ar1_rho is not None)
    design, total = identified_moments(design, total, y, groups, all_rows)
    wanted_folds = folds if at is None else at[1]
    predictions, reports = np.empty(len(wanted_folds)), []
    for fold in range(count):
        rows = wanted_folds == fold
        wanted = None if at is None else at[0][rows]
        predictions[rows], report = _fold(design, frame, y, groups, folds == fold, total, settings, wanted)
        reports.append(report)
    return predictions, pd.DataFrame(reports)
