"""What a model is made of: parametric terms, smooths, tensor products, random effects.

Terms are frozen values without data. `tripwatt_gamm.design` turns them into columns, once it
has seen a frame; `tripwatt_gamm.formula` reads them from text.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

Basis: TypeAlias = Literal["tp", "ps", "cr"]


@dataclass(frozen=True, slots=True)
class Parametric:
    """A numeric column, or a factor with treatment contrasts.

    Attributes
    ----------
    name : str
        Column of the frame. A column of strings, booleans or categories is a factor.
        Its levels are the categories, or the values, sorted; the first is the reference. A level that no row has
        gets the coefficient 0 with standard error 0.

    Examples
    --------
    >>> Parametric("weather").label
    'weather'
    """

    name: str

    @property
    def label(self) -> str:
        """Name of the term in tables."""
        return self.name

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the frame that the term reads."""
        return (self.name,)


@dataclass(frozen=True, slots=True)
class Smooth:
    """An isotropic smooth function of one or more covariates.

    Attributes
    ----------
    names : tuple of str
        Covariates; several only with the thin plate basis.
    basis : {"tp", "ps", "cr"}
        Thin plate regression spline (Wood 2003), cubic P-spline (Eilers & Marx 1996) or cubic regression spline.
    k : int, optional
        Basis dimension before the identifiability constraint. Default: 10 for one covariate, 30 for two,
        110 for three.
    by : str, optional
        A numeric column multiplies the smooth. A factor gives one smooth per level. An ordered factor (a pandas
        categorical column with `ordered=True`) gives one centred difference smooth for each level but the lowest,
        which is the reference: next to a smooth of the same covariates it is that level's deviation from it.

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

    @property
    def label(self) -> str:
        """Name of the term in tables; a level of a by-factor is appended to it."""
        base = f"s({','.join(self.names)})"
        return f"{base}:{self.by}" if self.by is not None else base

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the frame that the term reads."""
        return self.names if self.by is None else (*self.names, self.by)


@dataclass(frozen=True, slots=True)
class Tensor:
    """A tensor product smooth: scale-free in each covariate, one penalty per covariate.

    Attributes
    ----------
    names : tuple of str
        Covariates, two or more.
    basis : {"ps", "cr", "tp"}
        Basis of every margin. Default "cr", as is usual.
    k : tuple of int, optional
        Basis dimension of each margin. Default 5 each.
    kind : {"ti", "te"}
        "te" holds the main effects, "ti" is the pure interaction (margins are centred).
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

    @property
    def label(self) -> str:
        """Name of the term in tables; a level of a by-factor is appended to it."""
        base = f"{self.kind}({','.join(self.names)})"
        return f"{base}:{self.by}" if self.by is not None else base

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the frame that the term reads."""
        return self.names if self.by is None else (*self.names, self.by)


@dataclass(frozen=True, slots=True)
class RandomEffect:
    """Normal effects of the levels of a group with mean 0: intercepts, slopes, or both with a covariance.

    Attributes
    ----------
    name : str
        Column of the levels.
    others : tuple of str
        Further columns. Numbers multiply the effect, which makes it a slope. Factors are crossed with the levels: one
        effect for each combination that occurs, e.g. of machine and worker. Beside a factor a numeric `name` is
        refused, since it may be meant as either.
    correlated : bool
        An intercept and one slope for each of `others`, which are then numbers, with a covariance matrix of their
        own: lme4's ``(1 + x | g)``. Otherwise all effects of the term are independent with one variance.

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
        return (
            f"({'+'.join(('1', *self.others))}|{self.name})"
            if self.correlated
            else f"s({','.join(self.columns)})"
        )

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
        Column of the response; None when `y` is given to `fit` apart.
    terms : tuple of terms
        In the order of the coefficients: parametric terms come first whatever the order here.
    intercept : bool
        Whether the model has a constant.

    Examples
    --------
    >>> Formula("y", (Parametric("weather"), Smooth(("time",)), RandomEffect("trip"))).columns
    ('weather', 'time', 'trip')
    """

    response: str | None
    terms: tuple[Term, ...] = field(default_factory=tuple)
    intercept: bool = True

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that the terms read, each once, in order."""
        return tuple(dict.fromkeys(name for term in self.terms for name in term.columns))
