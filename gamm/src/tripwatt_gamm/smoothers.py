"""Identifiable, scaled smooths: a basis with its constraint built in and its penalties on a common scale."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.bases import CubicRegression, PSpline, ThinPlate, thin_plate
from tripwatt_gamm.covariates import Points
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.penalties import PenaltyBlock
from tripwatt_gamm.terms import Smooth, Tensor

Basis: TypeAlias = PSpline | CubicRegression | ThinPlate


@dataclass(frozen=True)
class Margin:
    """A basis and a linear map of its columns.

    Attributes
    ----------
    basis : Basis
    transform : ndarray (basis.k, q)
    """

    basis: Basis
    transform: FloatArray

    def matrix(self, x: FloatArray) -> FloatArray:
        """Compute the columns at `x` (n, d), as (n, q)."""
        return np.asarray(self.basis.matrix(x) @ self.transform)


@dataclass(frozen=True)
class TensorProduct:
    """Row-wise products of the columns of margins, and a linear map of these products.

    Attributes
    ----------
    margins : tuple of Margin
    transform : ndarray (product of q, r)
    """

    margins: tuple[Margin, ...]
    transform: FloatArray

    def matrix(self, x: FloatArray) -> FloatArray:
        """Compute the columns at `x` (n, d), as (n, r)."""
        products = self.margins[0].matrix(x[:, :1])
        for j, margin in enumerate(self.margins[1:], start=1):
            products = (products[:, :, None] * margin.matrix(x[:, j : j + 1])[:, None, :]).reshape(len(x), -1)
        return np.asarray(products @ self.transform)


Smoother = Margin | TensorProduct


@dataclass(frozen=True)
class Built:
    """A smoother with its table over the distinct points, and its penalties.

    Attributes
    ----------
    smoother : Smoother
    table : ndarray (m, q)
    penalties : list of ndarray (q, q)
    notes : list of str
        Reductions of `k`.
    """

    smoother: Smoother
    table: FloatArray
    penalties: list[FloatArray]
    notes: list[str]


def _sum_to_zero(means: FloatArray) -> FloatArray:
    """Return an orthonormal Z (k, k - 1) with means' Z = 0, by one Householder reflection."""
    Q, _ = np.linalg.qr(means[:, None], mode="complete")
    return np.asarray(Q[:, 1:])


def _scale(S: FloatArray, table: FloatArray) -> FloatArray:
    """Scale a penalty to the squared norm of the columns, so that smoothing parameters are comparable."""
    size = float(np.abs(table).sum(axis=1).max()) ** 2
    return np.asarray(S * (size / float(np.abs(S).sum(axis=0).max())))


def _usable(k: int, smallest: int, points: Points, label: str, what: str) -> tuple[int, list[str]]:
    """Return a basis dimension that the data allow, and a note if `k` was reduced; raise if `k` or the number of points is too small."""
    distinct, where = len(points.values), f"{what} in {label}"
    if distinct < 2:
        raise InvalidInput.of("constant covariate", where, "one distinct value", "at least two")
    if distinct < smallest:
        allowed, fix = f"at least {smallest}", "use a factor or a straight line"
        raise InvalidInput.of("too few distinct values", where, str(distinct), allowed, fix)
    if k < smallest:
        raise InvalidInput.of("k too small", label, f"k={k}", f"at least {smallest}")
    if distinct < k:
        return distinct, [f"{label}: {what} has {distinct} distinct values, k reduced from {k} to {distinct}"]
    return k, []


def _basis(
    kind: str, points: Points, k: int, label: str, what: str, knots: tuple[float, ...] = ()
) -> tuple[Basis, list[str]]:
    """Build one basis over distinct points (count, d); return it with notes on a reduced `k`."""
    if knots:
        low, high = float(points.values.min()), float(points.values.max())
        increasing = (np.diff(knots) > 0).all() and knots[0] <= low and high <= knots[-1]
        if kind != "cc" or len(knots) not in (2, k) or not increasing:
            got = f"{len(knots)} knots from {knots[0]:g} to {knots[-1]:g} of basis {kind}, k={k}"
            allowed = (
                f"increasing: the ends of a period that holds {low:g} to {high:g}, or k knots, of basis cc"
            )
            raise InvalidInput.of("invalid knots", label, got, allowed)
    d = points.values.shape[1]
    order = 2 if d == 1 else (d + 1) // 2 + 1
    # polynomials in d variables whose total degree is below the order are not penalised
    smallest = {"ps": 4, "cr": 3, "cc": 4, "tp": math.comb(d + order - 1, d) + 1}
    if kind not in smallest:
        raise InvalidInput.of("unknown basis", label, repr(kind), "tp, ps, cr or cc")
    k, notes = _usable(k, smallest[kind], points, label, what)
    if kind == "ps":
        return PSpline(float(points.values[0, 0]), float(points.values[-1, 0]), k), notes
    if kind in ("cr", "cc"):
        # two knots are the ends of a period, and count as distinct values
        even = np.quantile(np.union1d(points.values[:, 0], knots), np.linspace(0, 1, k))
        return CubicRegression(np.array(knots) if len(knots) > 2 else even, kind == "cc"), notes
    centred = points.values - points.values.mean(axis=0)
    centred = centred / np.maximum(np.abs(centred).max(axis=0), 1e-300)
    if np.linalg.matrix_rank(centred, tol=1e-9 * len(centred)) < d:
        allowed = "covariates that are not collinear"
        raise InvalidInput.of("collinear covariates", label, "all points on a line", allowed)
    return thin_plate(points.values, points.counts, k, order), notes


def build_smooth(term: Smooth, points: Points, centred: bool) -> Built:
    """Build the columns of an isotropic smooth over its distinct points.

    Parameters
    ----------
    term : Smooth
    points : Points
        Distinct points of all rows.
    centred : bool
        Whether the smooth sums to zero over the rows.

    Returns
    -------
    Built
    """
    d = len(term.names)
    if d > 1 and term.basis != "tp":
        allowed = "tp, or a tensor product"
        raise InvalidInput.of("basis for one covariate only", term.label, term.basis, allowed)
    k = term.k if term.k is not None else {1: 10, 2: 30}.get(d, 110)
    basis, notes = _basis(term.basis, points, k, term.label, ", ".join(term.names), term.knots)
    table = basis.matrix(points.values)
    S = _scale(basis.penalty, table)
    Z = _sum_to_zero(np.average(table, axis=0, weights=points.counts)) if centred else np.eye(basis.k)
    return Built(Margin(basis, Z), table @ Z, [Z.T @ S @ Z], notes)


def build_factor_smooth(term: Smooth, points: Points) -> Built:
    """Build the columns of one level of a factor-smooth, with penalties of its bends, of its constant and of its slope.

    A level has the natural parameters of a thin plate spline, whose penalty is the identity (Wood 2017, section 5.4.2);
    what this penalty does not reach, the straight lines, is split into a constant and a centred slope.

    Parameters
    ----------
    term : Smooth
    points : Points
        Distinct points of all rows.

    Returns
    -------
    Built
    """
    basis, notes = _basis("tp", points, term.k or 10, term.label, term.names[0])
    table, x = basis.matrix(points.values), points.values[:, 0]
    values, vectors = np.linalg.eigh(basis.penalty)
    lines = np.stack([np.ones(len(x)), x - np.average(x, weights=points.counts)], axis=1)
    straight = np.linalg.lstsq(table, lines, rcond=None)[0]
    T = np.hstack([vectors[:, 2:] / np.sqrt(values[2:]), straight])
    parts = np.repeat(np.eye(3), [basis.k - 2, 1, 1], axis=0)
    table = table @ T
    return Built(Margin(basis, T), table, [_scale(np.diag(part), table) for part in parts.T], notes)


def _margin(term: Tensor, points: Points, column: int, k: int) -> tuple[Margin, FloatArray, list[str]]:
    """Build a margin, parametrised by its values at even points if they determine it (Wood 2006), with its penalty and notes.

    The margin is centred for a pure interaction ("ti").
    """
    values, index = np.unique(points.values[:, column], return_inverse=True)
    counts: FloatArray = np.bincount(index, weights=points.counts).astype(np.float64)
    axis = Points(values[:, None], index.astype(np.intp), counts)
    basis, notes = _basis(term.basis, axis, k, term.label, term.names[column])
    T = np.eye(basis.k)
    if term.kind == "ti":
        T = _sum_to_zero(np.average(basis.matrix(axis.values), axis=0, weights=counts))
    even = np.linspace(values[0], values[-1], T.shape[1])[:, None]
    at_even = basis.matrix(even) @ T
    # the columns of a cubic regression spline are values at its knots already
    if term.basis not in ("cr", "cc") and np.linalg.cond(at_even) < 1e10:
        T = T @ np.linalg.inv(at_even)
    S = T.T @ basis.penalty @ T
    return Margin(basis, T), (S + S.T) / (2 * float(np.linalg.eigvalsh(S)[-1])), notes


def build_tensor(term: Tensor, points: Points, centred: bool) -> Built:
    """Build the columns of a tensor product smooth over its distinct points, with one penalty per margin.

    Parameters
    ----------
    term : Tensor
    points : Points
        Distinct points of all rows.
    centred : bool
        Whether a full tensor product sums to zero over the rows.

    Returns
    -------
    Built
    """
    dimensions = term.k if term.k is not None else (5,) * len(term.names)
    if len(dimensions) != len(term.names) or len(dimensions) < 2:
        raise InvalidInput.of(
            "wrong number of k", term.label, f"k={dimensions}", "one for each of two or more covariates"
        )
    parts = [_margin(term, points, j, k) for j, k in enumerate(dimensions)]
    margins = tuple(part[0] for part in parts)
    sizes = [margin.transform.shape[1] for margin in margins]
    product = TensorProduct(margins, np.eye(int(np.prod(sizes))))
    table = product.matrix(points.values)
    penalties = []
    for j, part in enumerate(parts):
        before, after = np.eye(math.prod(sizes[:j])), np.eye(math.prod(sizes[j + 1 :]))
        S = np.asarray(np.kron(np.kron(before, part[1]), after), dtype=np.float64)
        penalties.append(_scale(S, table))
    notes = [note for part in parts for note in part[2]]
    if term.kind == "te" and centred:
        Z = _sum_to_zero(np.average(table, axis=0, weights=points.counts))
        return Built(TensorProduct(margins, Z), table @ Z, [Z.T @ S @ Z for S in penalties], notes)
    return Built(product, table, penalties, notes)


def build(term: Smooth | Tensor, points: Points, centred: bool, select: bool) -> Built:
    """Build a smooth or a tensor product; `select` adds a penalty of the functions that no penalty reaches.

    With it the term can vanish (Marra & Wood 2011).
    """
    make: Callable[[Any, Points, bool], Built] = build_tensor if isinstance(term, Tensor) else build_smooth
    built = make(term, points, centred)
    block = PenaltyBlock.from_matrices(0, built.penalties)
    null = block.rotation[:, block.rank :]
    extra = [_scale(null @ null.T, built.table)] if select and null.size else []
    return replace(built, penalties=[*built.penalties, *extra])
