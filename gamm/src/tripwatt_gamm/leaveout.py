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
"""Share of a column's sum of squares up to which the rest after subtraction is only rounding."""


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
    lagged = len(total.gram) > 1
    out, kept = np.flatnonzero(held).astype(np.intp), np.flatnonzero(~held).astype(np.intp)
    if len(y) <= EXACT_ROWS:  # in a difference the last digits would still depend on the held-out response
        sums = grouped_moments(design, y, groups, kept, lagged)
    else:
        sums = total - grouped_moments(design, y, groups, out, lagged)
    dead = np.diag(sums.gram[0]) <= DEAD * np.diag(total.gram[0])
    sums.gram[:, dead], sums.gram[:, :, dead], sums.cross[:, dead] = 0.0, 0.0, 0.0
    own, gram = identify(replace(design, notes=[], empty=list(design.empty)), sums.gram[0])
    if own.p != design.p:
        sums = grouped_moments(own, y, groups, kept, lagged)
        gram = sums.gram[0]
    active = own.active(np.diag(gram))
    stack, which = own.penalty_stack(active)
    require_rows(len(kept), stack, f"without fold of row {out[0]}")
    if settings.rho is not None:
        settings = replace(settings, rho=settings.rho[which])
    previous = previous_rows(groups[kept]) if lagged else None
    rows = own.rows.subset(kept, active)
    solution = solve(Problem(rows, y[kept], sums, stack, active, settings, previous))
    if solution is None:
        where = f"without fold of row {out[0]}"
        raise InvalidInput.of(
            "model not identifiable", where, "singular system", "linearly independent terms"
        )
    beta = np.zeros(own.p)
    beta[active] = solution.beta
    training, piece = own.training_of(~held), frame.iloc[out] if wanted is None else wanted
    if own.terms[0].extrapolation == "clamp":
        piece = training.clamp_frame(piece)
    prediction = np.zeros(len(piece))
    for fitted in own.terms:
        if fitted.kind != "random" or beta[fitted.slice].any():
            prediction += fitted.matrix(piece, training) @ beta[fitted.slice]
    return prediction, {"rows": len(out), "converged": solution.converged, "n_iter": solution.n_iter}


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
    lagged = settings.ar1_rho is not None
    total = grouped_moments(design, y, groups, np.arange(len(y), dtype=np.intp), lagged)
    design, gram = identify(design, total.gram[0])
    if gram.shape != total.gram[0].shape:
        total = grouped_moments(design, y, groups, np.arange(len(y), dtype=np.intp), lagged)
    where = folds if at is None else at[1]
    predictions, reports = np.empty(len(where)), []
    for fold in range(count):
        own = where == fold
        wanted = None if at is None else at[0][own]
        predictions[own], report = _fold(design, frame, y, groups, folds == fold, total, settings, wanted)
        reports.append(report)
    return predictions, pd.DataFrame(reports)
