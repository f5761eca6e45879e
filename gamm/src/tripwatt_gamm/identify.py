"""Directions that neither data nor penalties determine: found, removed from the right term, reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.covariates import Index
from tripwatt_gamm.design import Design
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.fitted_terms import FittedTerm
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.tables import IndexedColumns, TableRows
from tripwatt_gamm.terms import Smooth, Tensor

NULL_TOLERANCE = 1e-12
"""Eigenvalue, relative to the largest, below which a direction of the scaled penalised crossproduct is nil."""

INVOLVED = 1e-4
"""Share of a nil direction below which a term has no part in it."""


def _nil_directions(design: Design, gram: FloatArray, active: Index) -> tuple[FloatArray, FloatArray]:
    """Orthonormal nil directions (p, r) of the scaled crossproduct, and the scale (p,)."""
    total = gram.copy()
    for fitted in design.terms:
        where = fitted.slice
        weight = max(float(np.trace(gram[where, where])), 1e-300)
        for S in fitted.penalties:
            total[where, where] += S * (weight / float(np.trace(S)))
    d = np.zeros(design.p)
    d[active] = 1 / np.sqrt(np.diag(total)[active])
    values, vectors = np.linalg.eigh((total * d * d[:, None])[np.ix_(active, active)])
    nil = values < NULL_TOLERANCE * values[-1]
    out = np.zeros((design.p, int(nil.sum())))
    out[active] = vectors[:, nil]
    return out, d


def _place(fitted: FittedTerm) -> int:
    """Order in which terms lose a direction that several share: surfaces first, then curves, then factors."""
    if fitted.kind == "parametric":
        return 0
    return (
        2
        if isinstance(fitted.term, Tensor) or (isinstance(fitted.term, Smooth) and len(fitted.term.names) > 1)
        else 1
    )


def identify(design: Design, gram: FloatArray) -> tuple[Design, FloatArray]:
    """The design without the directions that nothing determines, and its crossproduct.

    A direction shared by several terms is taken from the one with most covariates, then from the later one; of
    parametric columns the last one is held at zero. Every reduction is a note.

    Parameters
    ----------
    design : Design
    gram : ndarray (p, p)
        X'X.

    Returns
    -------
    Design, ndarray
    """
    for _ in range(20):
        active = design.active(np.diag(gram))
        nil, scale = _nil_directions(design, gram, active)
        if not nil.shape[1]:
            return design, gram
        involved = [b for b in design.terms if np.linalg.norm(nil[b.slice]) > INVOLVED]
        fitted = max(involved, key=lambda b: (_place(b), b.start))
        others = ", ".join(b.label for b in involved if b is not fitted) or "itself"
        if fitted.kind == "parametric":
            column = fitted.start + int(np.flatnonzero(np.abs(nil[fitted.slice]).max(axis=1) > INVOLVED)[-1])
            design.empty.append(column)
            name = fitted.names[column - fitted.start]
            design.notes.append(f"{name} is a linear combination of {others}: held at 0")
            continue
        directions = nil[fitted.slice] * scale[fitted.slice, None]
        U, sizes, _ = np.linalg.svd(directions)
        rank = int((sizes > 1e-6 * sizes[0]).sum())
        design.notes.append(f"{fitted.label} repeats {others}: {rank} of its columns removed")
        design, gram = _reduce(design, gram, fitted, U[:, rank:])
    return design, gram


def _reduce(design: Design, gram: FloatArray, fitted: FittedTerm, Z: FloatArray) -> tuple[Design, FloatArray]:
    """Map the columns of one term by Z (q, r) throughout the design."""
    where = fitted.slice
    before, after = np.arange(where.start), np.arange(where.stop, design.p)
    middle = gram[:, where] @ Z
    columns = np.hstack([gram[:, before], middle, gram[:, after]])
    gram = np.vstack([columns[before], Z.T @ columns[where], columns[after]])
    gone = Z.shape[0] - Z.shape[1]
    first, last = where.start, where.stop
    terms = []
    for other in design.terms:
        if other is fitted:
            assert fitted.smoother is not None
            terms.append(
                replace(
                    fitted,
                    names=[f"{fitted.label}.{i + 1}" for i in range(Z.shape[1])],
                    penalties=[Z.T @ S @ Z for S in fitted.penalties],
                    smoother=fitted.smoother.reduce(Z),
                )
            )
        else:
            terms.append(replace(other, start=other.start - (gone if other.start >= last else 0)))
    parts = [_reduced_part(part, first, last, gone, Z) for part in design.rows.parts]
    rows = TableRows(parts, design.rows.n, design.p - gone)
    empty = [c - (gone if c >= last else 0) for c in design.empty]
    return replace(design, terms=terms, rows=rows, empty=empty), gram


def _reduced_part(part: IndexedColumns, first: int, last: int, gone: int, Z: FloatArray) -> IndexedColumns:
    inside = (part.columns >= first) & (part.columns < last)
    outside = part.columns[~inside]
    moved = outside - np.where(outside >= last, gone, 0)
    if not inside.any():
        return replace(part, columns=moved)
    table = np.hstack([part.table[:, ~inside], part.table[:, inside] @ Z])
    columns = np.concatenate([moved, np.arange(first, first + Z.shape[1])])
    order = np.argsort(columns)
    return replace(part, columns=columns[order], table=np.ascontiguousarray(table[:, order]))


def require_rows(rows: int, stack: PenaltyStack, where: str) -> None:
    """Check that there are more rows than coefficients that no penalty holds.

    Parameters
    ----------
    rows : int
        Of the fit.
    stack : PenaltyStack
        Of the active coefficients.
    where : str
        What has these rows.

    Raises
    ------
    InvalidInput
        `too few rows`.
    """
    if rows <= stack.null_dim:
        raise InvalidInput.of(
            "too few rows", where, f"{rows} rows", f"more than {stack.null_dim} unpenalised coefficients"
        )
