"""The terms of a model: parametric terms, smooths, tensor products, random effects.

Terms are frozen values without data. `tripwatt_gamm.design` builds their columns from a frame;
`tripwatt_gamm.formula` reads them from text.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

Basis: TypeAlias = Literal["tp", "ps", "cr", "cc", "fs"]


@dataclass(frozen=True, slots=True)
class Parametric:
    """A numeric column, a factor with treatment contrasts, or a product of such columns.

    Attributes
    ----------
    name : str
        Column of the frame. A column of strings or categories is a factor; booleans count as the numbers 0 and 1.
        Levels of a factor are its categories or its sorted values; the first level with rows is the reference. A level
        without rows has the coefficient 0 with standard error 0.
    others : tuple of str
        Further columns of an interaction. A factor in it has a reference level if the term of all other columns (for
        a single factor: the intercept) is in the model too; otherwise each level has its coefficients, as in R.

    Examples
    --------
    >>> Parametric("weather").label, Parametric("weather", ("speed",)).label
    ('weather', 'weather:speed')
    """

    name: str
    others: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Name of the term in tables."""
        return ":".join(self.columns)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the frame that the term reads."""
        return (self.name, *self.others)


class _Smoothed:
    """What smooths and tensor products share."""

    __slots__ = ()
    names: tuple[str, ...]
    basis: Basis
    by: str | None

    @property
    def label(self) -> str:
        """Name of the term in tables; a level of a by-factor is appended to it."""
        kind = getattr(self, "kind", "s")
        if self.by is None or self.basis == "fs":
            return f"{kind}({','.join(self.columns)})"
        return f"{kind}({','.join(self.names)}):{self.by}"

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the frame that the term reads."""
        return self.names if self.by is None else (*self.names, self.by)


@dataclass(frozen=True, slots=True)
class Smooth(_Smoothed):
    """An isotropic smooth function of one or more covariates.

    Attributes
    ----------
    names : tuple of str
        Covariates; several only with the thin plate basis.
    basis : {"tp", "ps", "cr", "cc", "fs"}
        Thin plate regression spline (Wood 2003), cubic P-spline (Eilers & Marx 1996), cubic regression spline; "cc" is
        the cyclic one, whose period is the range of the data or of `knots`; "fs" a thin plate curve for each level of the factor
        `by`, drawn from one distribution: bends, constants and slopes have a variance each.
    k : int, optional
        Basis dimension before the identifiability constraint. Default: 10 for one covariate, 30 for two,
        110 for three.
    by : str, optional
        A numeric column multiplies the smooth. A factor gives one smooth per level. An ordered factor (a pandas
        categorical column with `ordered=True`) gives one centred difference smooth for each level but the lowest, which
        is the reference. Beside a smooth of the same covariates, a difference smooth is its level's deviation from it.
    knots : tuple of float, optional
        For "cc" the two ends of the period, such as 0 and 24 hours, or all `k` knots, the first and last of which are one.

    Examples
    --------
    >>> Smooth(("time",), by="season").label
    's(time):season'
    >>> Smooth(("tamb", "delev"), k=30).label
    's(tamb,delev)'
    """

    names: tuple[str, ...]
    basis: Basis = "tp"
    k: int | None = None
    by: str | None = None
    knots: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Tensor(_Smoothed):
    """A tensor product smooth with one penalty per covariate, independent of the covariates' units.

    Attributes
    ----------
    names : tuple of str
        Covariates, two or more.
    basis : {"ps", "cr", "tp"}
        Basis of every margin. Default "cr", as is usual.
    k : tuple of int, optional
        Basis dimension of each margin. Default 5 each.
    kind : {"ti", "te"}
        "te" includes the main effects; "ti" is the pure interaction (margins are centred).
    by
        As in `Smooth`.

    Examples
    --------
    >>> Tensor(("tamb", "delev"), basis="ps", k=(6, 6)).label
    'ti(tamb,delev)'
    """

    names: tuple[str, ...]
    basis: Basis = "cr"
    k: tuple[int, ...] | None = None
    kind: Literal["ti", "te"] = "ti"
    by: str | None = None


@dataclass(frozen=True, slots=True)
class RandomEffect:
    """Normal effects of the levels of a group with mean 0: intercepts, slopes, or both with a covariance.

    Attributes
    ----------
    name : str
        Column of the levels.
    others : tuple of str
        Further columns. A numeric column multiplies the effect, which makes it a slope. Factors are crossed with the
        levels: one effect for each combination that occurs, e.g. of machine and worker. A numeric `name` beside a
        factor raises an error, since it may be meant as a multiplier or as levels.
    correlated : bool
        If true, each level has an intercept and one slope for each of `others` (numeric columns), with a covariance
        matrix:
        lme4's ``(1 + x | g)``. Otherwise all effects of the term are independent with one variance.

    Examples
    --------
    >>> RandomEffect("trip").label, RandomEffect("trip", ("speed",)).label
    ('s(trip)', 's(trip,speed)')
    >>> RandomEffect("trip", ("speed",), correlated=True).label
    '(1+speed|trip)'
    """

    name: str
    others: tuple[str, ...] = ()
    correlated: bool = False

    @property
    def label(self) -> str:
        """Name of the term in tables."""
        if self.correlated:
            return f"({'+'.join(('1', *self.others))}|{self.name})"
        return f"s({','.join(self.columns)})"

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the frame that the term reads."""
        return (self.name, *self.others)


Term: TypeAlias = Parametric | Smooth | Tensor | RandomEffect


@dataclass(frozen=True, slots=True)
class Formula:
    """A response and the terms that explain it.

    Attributes
    ----------
    response : str or None
        Column of the response; None if `y` is an argument of `fit`.
    terms : tuple of terms
        The terms. In the order of the coefficients, parametric terms always come first.
    intercept : bool
        Whether the model has a constant.
    offset : str, optional
        Column of a known part of the linear predictor, which predictions read too.

    Examples
    --------
    >>> Formula("y", (Parametric("weather"), Smooth(("time",)), RandomEffect("trip"))).columns
    ('weather', 'time', 'trip')
    """

    response: str | None
    terms: tuple[Term, ...] = field(default_factory=tuple)
    intercept: bool = True
    offset: str | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that the terms read, each once, in order."""
        return tuple(dict.fromkeys(name for term in self.terms for name in term.columns))

    def __str__(self) -> str:
        """Write the response and the labels of the terms."""
        known = [] if self.offset is None else [f"offset({self.offset})"]
        parts = [*(term.label for term in self.terms), *known, *([] if self.intercept else ["0"])]
        return f"{self.response or ''} ~ {' + '.join(parts) or '1'}".strip()
