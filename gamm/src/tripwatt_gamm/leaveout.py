"""Fit some of the rows, without the directions that neither data nor penalties determine, and leave groups out.

The crossproduct of a fold is summed over its rows; if rows are many, it is the total minus that of the rows held out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.linalg import block_diag

from tripwatt_gamm.arrays import BoolArray, FloatArray, Index
from tripwatt_gamm.covariates import EXACT_ROWS
from tripwatt_gamm.design import Design
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.families import Response
from tripwatt_gamm.fit import Solution
from tripwatt_gamm.fitted_terms import FittedTerm
from tripwatt_gamm.moments import NormalEquations
from tripwatt_gamm.solve import FitSettings, Problem, solve
from tripwatt_gamm.tables import TableRows, previous_rows

NULL_TOLERANCE = 1e-12
"""Relative size of an eigenvalue of the scaled penalised crossproduct below which its direction is undetermined: a choice, some
thousand times the working precision, since the crossproduct of many rows carries that much rounding."""

MIN_PART = 1e-4
"""Norm of a term's part of the undetermined directions up to which the term has no part in them: a choice, far above rounding."""


def _null_space(design: Design, gram: FloatArray, active: Index) -> tuple[FloatArray, FloatArray]:
    """Return an orthonormal basis (p, r) of what the scaled penalised crossproduct leaves undetermined, and the scale (p,).

    A penalty of full rank determines its term: the levels that are eliminated have no part in these directions.
    """
    total, active = gram.copy(), active[active < len(gram)]
    for fitted in design.terms:
        if fitted.start >= len(gram):
            continue
        where = fitted.slice
        weight = max(float(np.trace(gram[where, where])), 1e-300)
        for S in fitted.penalties:
            total[where, where] += S * (weight / float(np.trace(S)))
    d = np.zeros(design.rows.p)
    d[active] = 1 / np.sqrt(np.diag(total)[active])
    values, vectors = np.linalg.eigh(total[np.ix_(active, active)] * d[active] * d[active, None])
    null = values < NULL_TOLERANCE * values.max(initial=0.0)
    basis = np.zeros((design.rows.p, int(null.sum())))
    basis[active] = vectors[:, null]
    return basis, d


def identify(design: Design, gram: FloatArray) -> Design:
    """Remove from a design the directions that neither data nor penalty determine.

    A direction that several terms share is removed from a surface rather than a curve, from a curve rather than a
    parametric term, and then from the later term. If only parametric terms share it, their last column is held at zero.
    Every reduction is noted.

    Parameters
    ----------
    design : Design
    gram : ndarray (d, d)
        X'X without the columns of eliminated levels.

    Returns
    -------
    Design
        A reduced copy; the given design if no term was reduced. Its `notes` and `empty` may be extended.
    """
    for _ in range(20):  # each pass removes one term's part; far fewer are needed
        active = design.active(np.append(np.diag(gram), np.ones(design.rows.p - len(gram))))
        null, scale = _null_space(design, gram, active)
        if not null.shape[1]:
            return design
        involved = [b for b in design.terms if np.linalg.norm(null[b.slice]) > MIN_PART]
        # parametric terms are the last to be reduced, smooths of several covariates the first
        ranks = [(b.kind != "parametric", len(getattr(b.term, "names", ())) > 1, b.start) for b in involved]
        reduced = involved[ranks.index(max(ranks))]
        other_labels = ", ".join(b.label for b in involved if b is not reduced) or "itself"
        if reduced.kind == "parametric":
            last = int(np.flatnonzero(np.abs(null[reduced.slice]).max(axis=1) > MIN_PART)[-1])
            design.empty.append(reduced.start + last)
            design.notes.append(f"{reduced.names[last]} is a linear combination of {other_labels}: held at 0")
            continue
        directions = null[reduced.slice] * scale[reduced.slice, None]
        U, sizes, _ = np.linalg.svd(directions)
        rank = int((sizes > 1e-6 * sizes[0]).sum())
        design.notes.append(f"{reduced.label} repeats {other_labels}: {rank} of its columns removed")
        design, gram = _reduce(design, gram, reduced, U[:, rank:])
    return design


def _reduce(design: Design, gram: FloatArray, fitted: FittedTerm, Z: FloatArray) -> tuple[Design, FloatArray]:
    """Replace the columns of one smooth by their products with Z (q, r), in the design and its crossproduct."""
    first, last = fitted.slice.start, fitted.slice.stop
    map_columns = block_diag(np.eye(first), Z, np.eye(len(gram) - last))
    gone = Z.shape[0] - Z.shape[1]
    assert fitted.smoother is not None
    smaller = replace(
        fitted,
        names=[f"{fitted.label}.{i + 1}" for i in range(Z.shape[1])],
        matrices=[Z.T @ S @ Z for S in fitted.matrices],
        smoother=replace(fitted.smoother, transform=fitted.smoother.transform @ Z),
    )
    terms = [
        smaller if other is fitted else replace(other, start=other.start - gone * (other.start >= last))
        for other in design.terms
    ]
    parts = []
    for part in design.rows.parts:
        columns, table = part.columns - gone * (part.columns >= last), part.table
        # the columns of a smooth are a part of their own
        if table is not None and first <= part.columns[0] < last:
            columns, table = np.arange(first, first + Z.shape[1], dtype=np.intp), table @ Z
        parts.append(replace(part, columns=columns, table=table))
    rows = TableRows(parts, design.rows.n, design.rows.p - gone)
    empty = [c - gone * (c >= last) for c in design.empty]
    return replace(design, terms=terms, rows=rows, empty=empty), map_columns.T @ gram @ map_columns


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
