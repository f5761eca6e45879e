"""Build the model matrix X from the terms of a formula and a frame.

Each term is stored as a table over the distinct (or discretised) values of its covariates, with an index per row;
a row of X joins one row of each table.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pandas as pd

from tripwatt_gamm.arrays import FloatArray, Index
from tripwatt_gamm.covariates import (
    EXACT_ROWS,
    Coverage,
    Levels,
    Points,
    Training,
    crossed,
    grid_limit,
    is_factor,
    missing_columns,
    missing_levels,
    numbers,
)
from tripwatt_gamm.errors import Fault, InvalidInput, raise_faults
from tripwatt_gamm.fitted_terms import Extrapolation, FittedTerm
from tripwatt_gamm.penalties import PenaltyBlock, PenaltyStack, correlated_penalties
from tripwatt_gamm.smoothers import Built, build, build_factor_smooth
from tripwatt_gamm.tables import IndexedColumns, TableRows
from tripwatt_gamm.terms import Formula, Parametric, RandomEffect, Smooth, Tensor

MAX_VALUES = 1000
"""Largest number of distinct values of a discretised covariate: that of mgcv's `bam(discrete=TRUE)`."""

MAX_SIZE_RATIO = 1e4
"""Largest ratio of the root mean squares of two correlated effects' columns: beyond its square, 1e8, their penalties are
parallel to working precision."""

MANY_LEVELS = 24
"""Levels from which a random effect is eliminated level by level: a choice, because below it one dense matrix is as fast."""


@dataclass
class Design:
    """Terms of a formula, built for the rows of a frame.

    Attributes
    ----------
    formula : Formula
    terms : list of FittedTerm
    rows : TableRows
    training : Training
    notes : list of str
        Changes to the model that the data forced, such as columns removed.
    empty : list of int
        Coefficients without data, kept at zero.
    coverage : Coverage
    """

    formula: Formula
    terms: list[FittedTerm]
    rows: TableRows
    training: Training
    notes: list[str]
    empty: list[int] = field(default_factory=list)
    coverage: Coverage = field(default_factory=Coverage)

    def active(self, gram_diagonal: FloatArray) -> Index:
        """Indices of the coefficients that data or penalties determine."""
        determined = gram_diagonal > 0
        determined[self.empty] = False
        for fitted in self.terms:
            if fitted.kind == "random" or (fitted.matrices and determined[fitted.slice].any()):
                determined[fitted.slice] = True
        return np.flatnonzero(determined).astype(np.intp)

    def penalty_stack(self, active: Index) -> tuple[PenaltyStack, list[int]]:
        """Return the penalties of the active coefficients, and the positions of their smoothing parameters in the model."""
        blocks: list[PenaltyBlock] = []
        which: list[int] = []
        parameter = 0
        position = {int(column): i for i, column in enumerate(active)}
        for fitted in self.terms:
            if fitted.matrices and fitted.start in position:
                first = position[fitted.start]
                own = PenaltyBlock.from_matrices(first, fitted.matrices, fitted.copies, fitted.scales)
                blocks.append(own)
                which += range(parameter, parameter + len(fitted.matrices))
            parameter += len(fitted.matrices)
        return PenaltyStack(len(active), blocks), which

    @property
    def penalty_names(self) -> list[str]:
        """Names of the smoothing parameters: the label of the term, numbered if the term has several."""
        return [
            fitted.label + (str(j + 1) if len(fitted.matrices) > 1 else "")
            for fitted in self.terms
            for j in range(len(fitted.matrices))
        ]


def _check_columns(formula: Formula, frame: pd.DataFrame) -> None:
    """Check the columns of a formula in a frame; raise one error with all faults.

    Faults are columns that are unknown, not numeric, not finite or have missing levels, terms given twice, and a frame
    without rows.
    """
    faults = missing_columns(frame, formula.columns)
    for name in (name for name in formula.columns if name in frame.columns):
        term = next(term for term in formula.terms if name in term.columns)
        if isinstance(term, RandomEffect):
            factor = name == term.name or (is_factor(frame[name]) and not term.correlated)
        else:
            plain = isinstance(term, Parametric)
            factor = is_factor(frame[name]) and (plain or name == getattr(term, "by", None))
        faults += missing_levels(frame, name, term.label) if factor else numbers(frame, name, term.label)[1]
    labels = [term.label for term in formula.terms]
    for label in sorted({label for label in labels if labels.count(label) > 1}):
        faults.append(Fault("term given twice", label, f"{labels.count(label)} times", "once"))
    if len(frame) == 0:
        faults.append(Fault("no rows", "frame", "0 rows", "at least one"))
    raise_faults(faults)


@dataclass(frozen=True, eq=False)
class _Piece:
    """Columns of a term, or the `part` of these columns, as a table with an index and a multiplier for each row."""

    fitted: FittedTerm
    table: FloatArray
    index: Index
    scale: FloatArray | None = None
    part: slice = field(default_factory=lambda: slice(None))

    def indexed(self, eliminated: bool = False) -> IndexedColumns:
        """Return the piece as columns of X, once the first coefficient of its term is known."""
        first, table = self.fitted.start, None if eliminated else self.table
        columns = np.arange(first, first + self.fitted.size, dtype=np.intp)[self.part]
        return IndexedColumns(columns, table, self.index, self.scale)


@dataclass
class _Builder:
    """Collects fitted terms and parts of the matrix while the terms of a formula are built."""

    formula: Formula
    frame: pd.DataFrame
    limit: int | None
    extrapolation: Extrapolation
    select: bool
    eliminate: bool
    terms: list[FittedTerm] = field(default_factory=list)
    pieces: list[_Piece] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    coverage: Coverage = field(default_factory=Coverage)

    def _covariates(self, names: tuple[str, ...]) -> FloatArray:
        return self.frame[list(names)].to_numpy(dtype=np.float64)

    @cached_property
    def grids(self) -> dict[str, int]:
        """Largest number of values for each covariate: the same in curves and surfaces, so that nested terms stay nested."""
        grids: dict[str, int] = {}
        if self.limit is None:
            return grids
        for term in self.formula.terms:
            if isinstance(term, Smooth | Tensor):
                several = len(term.names) > 1
                limit = grid_limit(self._covariates(term.names), self.limit) if several else self.limit
                grids |= {name: min(limit, grids.get(name, limit)) for name in term.names}
        return grids

    def points(self, names: tuple[str, ...]) -> Points:
        joint = self.coverage.joint
        if names not in joint:
            limits = tuple(self.grids.get(name, self.limit) for name in names)
            joint[names] = Points.from_values(self._covariates(names), limits)
        return joint[names]

    def factor(self, names: tuple[str, ...]) -> tuple[Levels, Index]:
        name, codes = ":".join(names), self.coverage.codes
        if name not in codes:
            column = crossed(self.frame, names)
            levels = Levels.from_column(column)
            codes[name] = levels, levels.codes(column)
        return codes[name]

    def parametric(self, term: Parametric) -> None:
        """Add a numeric column, the indicators of a factor's levels, or the products of such columns."""
        numbers = [name for name in term.columns if not is_factor(self.frame[name])]
        points = [self.points((name,)) for name in numbers]
        if min((len(at.values) for at in points), default=2) < 2 and self.formula.intercept:
            raise InvalidInput.of("constant covariate", term.label, "one value", "at least two")
        fitted = FittedTerm(term.label, term, "parametric", [term.label], [])
        self.terms.append(fitted)
        if term.columns == tuple(numbers[:1]):
            self.pieces.append(_Piece(fitted, points[0].values, points[0].index))
            return
        table: FloatArray = np.ones((1, 1))
        index, names = np.zeros(len(self.frame), dtype=np.intp), [""]
        for name in term.columns:
            shown = [name]
            if name not in numbers:
                levels, codes = self.factor((name,))
                kept = self._levels_with_coefficients(term, name, levels)
                shown = [name + levels.names[i] for i in kept]
                contrast = fitted.contrasts[name] = np.eye(len(levels.names))[:, kept]
                table = np.kron(table, contrast).astype(np.float64)
                index = index * len(levels.names) + codes
            names = [f"{left}:{right}" for left in names for right in shown]
        fitted.names = [name.removeprefix(":") for name in names]
        scale = np.prod([at.values[at.index, 0] for at in points], axis=0) if points else None
        self.pieces.append(_Piece(fitted, table, index, scale))

    def _levels_with_coefficients(self, term: Parametric, name: str, levels: Levels) -> list[int]:
        """Levels of a factor in a term: without the first one that has rows if the term of the other columns is in the model."""
        every, others = list(range(len(levels.names))), set(term.columns) - {name}
        terms = [set(other.columns) for other in self.formula.terms if isinstance(other, Parametric)]
        if not (others in terms if others else self.formula.intercept):
            return every
        reference = int(np.argmax(levels.share > 0))
        note = f"{name}: the first levels have no rows, the reference is {levels.names[reference]!r}"
        self.notes += [note] if reference > 0 and note not in self.notes else []
        if (levels.share > 0).sum() < 2:
            got = levels.names[reference]
            raise InvalidInput.of("factor with one level", term.label, got, "at least two levels")
        return [i for i in every if i != reference]

    def random(self, term: RandomEffect) -> None:
        """Add a random effect: the indicators of its levels, times each of its effects."""
        groups = (term.name, *(name for name in term.others if is_factor(self.frame[name])))
        if len(groups) > 1 and not is_factor(self.frame[term.name]):
            allowed, fix = "a factor first", "put it last to multiply, make it text for levels"
            raise InvalidInput.of("a number before a factor", term.label, repr(term.name), allowed, fix)
        levels, codes = self.factor(groups)
        size = len(levels.names)
        if size < 2:
            got, fix = f"level {levels.names[0]!r}", "leave the random effect out"
            raise InvalidInput.of("only one group", term.label, got, "two or more levels", fix)
        fitted = FittedTerm(term.label, term, "random", [], [np.eye(1)], groups=groups, copies=size)
        points = [self.points((name,)) for name in fitted.needed]
        effects = fitted.multipliers([at.values[at.index, 0] for at in points])
        fitted.names = [f"{term.label}.{i + 1}" for i in range(size * len(effects))]
        if term.correlated:
            self._correlate(fitted, effects)
        self.terms.append(fitted)
        for j, scale in enumerate(effects):
            part = slice(j * size, (j + 1) * size)
            self.pieces.append(_Piece(fitted, np.eye(size), codes, scale, part))

    def _correlate(self, fitted: FittedTerm, effects: list[FloatArray | None]) -> None:
        """Set the penalties, at zero correlation, and the root mean squares of the columns, the units of the loadings."""
        sizes = np.array([1.0 if effect is None else np.sqrt(np.mean(effect**2)) for effect in effects])
        if sizes.max() > MAX_SIZE_RATIO * sizes.min():
            got = ", ".join(f"{name} {size:.3g}" for name, size in zip(fitted.effects, sizes, strict=True))
            fix = "give the columns units in which their values are near 1"
            allowed = f"root mean squares within a factor of {MAX_SIZE_RATIO:g}"
            raise InvalidInput.of("correlated effects of unlike size", fitted.label, got, allowed, fix)
        fitted.scales = sizes
        fitted.matrices = correlated_penalties(np.zeros(len(sizes) ** 2), sizes)[0]

    def smooth(self, term: Smooth | Tensor) -> None:
        """Add a smooth, or one for each level of a by-factor; the reference level of an ordered factor has none."""
        points = self.points(term.names)
        by_factor = term.by is not None and is_factor(self.frame[term.by])
        by = None if term.by is None or by_factor else self.frame[term.by].to_numpy(dtype=np.float64)
        centred = by is None or bool(np.ptp(by) == 0)
        built = build(term, points, centred, self.select)
        self.notes += built.notes
        if not by_factor:
            fitted = self._fitted_term(term, built, term.label)
            if by is not None and term.by is not None:
                self.coverage.members[term.names, term.by, None] = by != 0
            self.terms.append(fitted)
            self.pieces.append(_Piece(fitted, built.table, points.index, by))
            return
        assert term.by is not None
        levels, codes = self.factor((term.by,))
        # the lowest level of an ordered factor is the reference
        first = int(getattr(self.frame[term.by].dtype, "ordered", None) or 0)
        if len(levels.names) <= first:
            allowed, fix = "at least two levels", "leave the term out"
            raise InvalidInput.of("factor with one level", term.label, levels.names[0], allowed, fix)
        padded = np.pad(built.table, ((0, 1), (0, 0)))  # the last row is that of other levels
        for i in range(first, len(levels.names)):
            name, own = levels.names[i], codes == i
            self.terms.append(replace(self._fitted_term(term, built, term.label + name), level=name))
            self.coverage.members[term.names, term.by, name] = own
            self.pieces.append(_Piece(self.terms[-1], padded, np.where(own, points.index, len(built.table))))

    def factor_smooth(self, term: Smooth) -> None:
        """Add a random curve for each level of a factor."""
        points, by = self.points(term.names), str(term.by)
        if not is_factor(self.frame[by]):
            fix = "put the factor last, make numbers text"
            raise InvalidInput.of("a number for a factor", term.label, repr(by), "a factor", fix)
        (levels, codes), built = self.factor((by,)), build_factor_smooth(term, points)
        self.notes += built.notes
        count = len(levels.names)
        self.terms.append(self._fitted_term(term, built, term.label, count))
        padded = np.pad(built.table, ((0, 1), (0, 0)))
        for i in range(count):
            own, part = np.where(codes == i, points.index, len(built.table)), slice(i, None, count)
            self.pieces.append(_Piece(self.terms[-1], padded, own, part=part))

    def _fitted_term(self, term: Smooth | Tensor, built: Built, label: str, copies: int = 1) -> FittedTerm:
        names, matrices = [f"{label}.{i + 1}" for i in range(built.table.shape[1] * copies)], built.penalties
        return FittedTerm(
            label, term, "smooth", names, matrices, smoother=built.smoother, by=term.by, copies=copies
        )

    def design(self) -> Design:
        """Order the terms, parametric ones first, number their coefficients, and build the model matrix."""
        if self.formula.intercept:
            fitted = FittedTerm("(Intercept)", None, "parametric", ["(Intercept)"], [])
            self.terms.insert(0, fitted)
            self.pieces.insert(0, _Piece(fitted, np.ones((1, 1)), np.zeros(len(self.frame), dtype=np.intp)))
        # large random effects come last, those of the same levels side by side
        self.terms.sort(key=lambda fitted: (fitted.kind != "parametric", *self._large(fitted)))
        training = self.coverage.training(np.ones(len(self.frame), dtype=bool))
        start = 0
        for fitted in self.terms:
            fitted.start, fitted.training, fitted.extrapolation = start, training, self.extrapolation
            start += fitted.size
        eliminated = self._large(self.terms[-1]) if self.terms else ()
        parts = [piece.indexed(self._large(piece.fitted) == eliminated != ()) for piece in self.pieces]
        rows = TableRows(parts, len(self.frame), start)
        return Design(self.formula, self.terms, rows, training, self.notes, [], self.coverage)

    def _large(self, fitted: FittedTerm) -> tuple[object, ...]:
        """Number and columns of the levels of a random effect that has so many that they may be eliminated."""
        large = fitted.kind == "random" and fitted.copies >= MANY_LEVELS and self.eliminate
        return (fitted.copies, fitted.groups) if large else ()


def build_design(
    formula: Formula,
    frame: pd.DataFrame,
    discretise: bool = True,
    extrapolation: Extrapolation = "clamp",
    select: bool = False,
    eliminate: bool = True,
) -> Design:
    """Build the terms of a formula as columns over the rows of a frame.

    Parameters
    ----------
    formula : Formula
    frame : DataFrame
        All columns that the terms read.
    discretise : bool
        Whether covariates of many rows are rounded to an even grid.
    extrapolation : {"clamp", "linear"}
        Rule for smooths of one covariate outside its training range.
    select : bool
        Whether every smooth gets a penalty of the functions that its penalties do not reach.
    eliminate : bool
        Whether the largest random effect is eliminated level by level; rows that are correlated connect levels.

    Returns
    -------
    Design

    Raises
    ------
    InvalidInput
        Names the term that cannot be built, or all faulty columns.
    """
    _check_columns(formula, frame)
    limit = MAX_VALUES if discretise and len(frame) > EXACT_ROWS else None
    builder = _Builder(formula, frame, limit, extrapolation, select, eliminate)
    for term in formula.terms:
        if isinstance(term, Parametric):
            builder.parametric(term)
        elif isinstance(term, RandomEffect):
            builder.random(term)
        elif isinstance(term, Smooth) and term.basis == "fs":
            builder.factor_smooth(term)
        else:
            builder.smooth(term)
    return builder.design()
