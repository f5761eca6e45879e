"""Fit some of the rows, and leave groups out.

The crossproduct of a fold is summed over its rows; if rows are many, it is the total minus that of the rows held out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from tripwatt_gamm.arrays import BoolArray, FloatArray, Index
from tripwatt_gamm.covariates import EXACT_ROWS
from tripwatt_gamm.design import Design
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.families import Response
from tripwatt_gamm.fit import Solution
from tripwatt_gamm.identify import identify
from tripwatt_gamm.moments import NormalEquations
from tripwatt_gamm.solve import FitSettings, Problem, solve
from tripwatt_gamm.tables import previous_rows

DEAD = 1e-10
"""Share of a column's sum of squares up to which the rest after subtraction is only rounding: a choice, because sums of
millions of rows have relative errors of some 1e-13."""


@dataclass(frozen=True, eq=False)
class Work:
    """Rows from which models are fitted, all of them or some.

    Attributes
    ----------
    design : Design
    y : ndarray (n,)
        Values whose least squares a fit starts from.
    groups : ndarray (n,)
        Codes of the groups within which successive rows are correlated.
    lagged : bool
        Whether they are.
    response : Response or None
        Response of a family without additive errors.
    """

    design: Design
    y: FloatArray
    groups: Index
    lagged: bool
    response: Response | None

    def sums(self, rows: Index) -> NormalEquations:
        """Sum the normal equations over `rows`."""
        return NormalEquations.of_rows(self.design.rows.subset(rows), self.y[rows])

    def identified(self, sums: NormalEquations, rows: Index) -> tuple[Work, NormalEquations]:
        """Return the work without directions that nothing determines, and its sums; `sums` are those of `rows`."""
        reduced = replace(self, design=identify(self.design, sums.gram.corner))
        return reduced, sums if reduced.design.rows.p == self.design.rows.p else reduced.sums(rows)

    def fit(
        self, rows: Index, sums: NormalEquations, settings: FitSettings, where: str
    ) -> tuple[Design, Index, list[int], Solution]:
        """Fit some rows.

        Parameters
        ----------
        rows : ndarray
            Numbers of the rows.
        sums : NormalEquations
            Their sums.
        settings : FitSettings
        where : str
            Name of the data, for the message of an error.

        Returns
        -------
        design : Design
            Without directions that nothing determines.
        active : ndarray
            Numbers of the active coefficients.
        which : list of int
            Positions of their smoothing parameters.
        solution : Solution
        """
        work, sums = self.identified(sums, rows)
        active = work.design.active(sums.gram.diagonal)
        stack, which = work.design.penalty_stack(active)
        if len(rows) <= stack.null_dim:
            allowed = f"more than {stack.null_dim} unpenalised coefficients"
            raise InvalidInput.of("too few rows", where, f"{len(rows)} rows", allowed)
        if settings.rho is not None:
            settings = replace(settings, rho=settings.rho[which])
        previous = previous_rows(self.groups[rows]) if self.lagged else None
        distant = None if self.response is None else self.response.at(rows)
        table = work.design.rows.subset(rows, active)
        sums = sums.of_columns(active)
        problem = Problem(table, self.y[rows], sums, stack, settings, previous, distant)
        return work.design, active, which, solve(problem, where)


def _fold(
    work: Work, piece: pd.DataFrame, held: BoolArray, total: NormalEquations, settings: FitSettings
) -> tuple[FloatArray, dict[str, int | bool]]:
    """Fit without the rows held out; return predictions of the rows `piece` and a report of the fit."""
    held_rows, kept = np.flatnonzero(held).astype(np.intp), np.flatnonzero(~held).astype(np.intp)
    # in a difference the last digits would still depend on the held-out response
    exact = len(held) <= EXACT_ROWS
    sums = work.sums(kept) if exact else total - work.sums(held_rows)
    sums = sums.without(sums.gram.diagonal <= DEAD * total.gram.diagonal)
    # the notes and empty columns of this fold are not those of the whole
    design = replace(work.design, notes=[], empty=list(work.design.empty))
    where = f"without fold of row {held_rows[0]}"
    design, active, _, solution = replace(work, design=design).fit(kept, sums, settings, where)
    beta = np.zeros(design.rows.p)
    beta[active] = solution.beta
    training = design.coverage.training(~held)
    if design.terms[0].extrapolation == "clamp":
        piece = training.clamp_frame(piece)
    prediction = np.zeros(len(piece))
    for fitted in design.terms:
        if fitted.kind != "random" or beta[fitted.slice].any():
            prediction += replace(fitted, training=training).matrix(piece) @ beta[fitted.slice]
    end = solution.end
    return prediction, {"rows": len(held_rows), "converged": end.converged, "n_iter": end.n_iter}


def leave_out(
    work: Work, folds: Index, settings: FitSettings, at: pd.DataFrame, at_folds: Index
) -> tuple[FloatArray, pd.DataFrame]:
    """Predict each fold from all other rows.

    Parameters
    ----------
    work : Work
        All rows; the bases of the design depend on covariates only.
    folds : ndarray (n,)
        Codes of the units to leave out.
    settings : FitSettings
    at : DataFrame
        Rows to predict.
    at_folds : ndarray of int
        Fold of each row of `at`: the fit without this fold predicts the row.

    Returns
    -------
    predictions : ndarray
        Linear predictors of the rows of `at`, without their offset.
    report : DataFrame
        One row per fold: rows, converged, n_iter.

    Raises
    ------
    InvalidInput
        If there are fewer than two folds.
    """
    count, all_rows = int(folds.max()) + 1, np.arange(len(folds), dtype=np.intp)
    if count < 2:
        raise InvalidInput.of("only one group", "leave_groups_out", "1 fold", "two or more")
    work, total = work.identified(work.sums(all_rows), all_rows)
    predictions, reports = np.empty(len(at)), []
    for fold in range(count):
        rows = at_folds == fold
        predictions[rows], report = _fold(work, at[rows], folds == fold, total, settings)
        reports.append(report)
    return predictions, pd.DataFrame(reports)
