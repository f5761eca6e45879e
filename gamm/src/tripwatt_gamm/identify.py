"""Find the directions that neither data nor penalties determine, remove them from a term and note it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from tripwatt_gamm.arrays import FloatArray, Index
from tripwatt_gamm.design import Design
from tripwatt_gamm.fitted_terms import FittedTerm
from tripwatt_gamm.tables import TableRows

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
