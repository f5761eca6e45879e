"""Effects of the terms of a fitted model: curves with bands, surfaces, random effects, coefficients.

Every effect is tabulated by `frame` and drawn by `plot`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
import pandas as pd
from scipy import stats

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.covariates import missing_columns
from tripwatt_gamm.errors import Fault, raise_faults
from tripwatt_gamm.inference import variance_components
from tripwatt_gamm.terms import RandomEffect, Smooth, Tensor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tripwatt_gamm.estimator import Estimator
    from tripwatt_gamm.fitted_terms import FittedTerm

TOO_FAR: Final = 0.1
"""Share of each range: a surface farther than this from every row of the data is not shown (the default of mgcv's plots)."""


def _banded(name: str, at: FloatArray | tuple[str, ...], of: CurveEffect | FactorEffect) -> pd.DataFrame:
    """Tabulate an effect with the ends of its intervals."""
    table = pd.DataFrame({name: at, "effect": of.effect, "std_error": of.std_error})
    half = of.multiplier * of.std_error
    return table.assign(lower=of.effect - half, upper=of.effect + half)


@dataclass(frozen=True, slots=True)
class CurveEffect:
    """A smooth of one covariate with its confidence band.

    Attributes
    ----------
    label, covariate : str
        Label of the term, and its covariate.
    x, effect, std_error : ndarray (m,)
        Grid over the range of the data (for a by-smooth, of its own rows), centred effect and its standard error.
    multiplier : float
        Half width of the band in standard errors.
    edf : float
        Effective degrees of freedom.
    rug : ndarray
        Values of the covariate in the data.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> curve = GAMM("y ~ s(x, k=8)").fit(frame).effects(frame)["s(x)"]
    >>> list(curve.frame().columns)
    ['x', 'effect', 'std_error', 'lower', 'upper']
    >>> curve.plot().axes[0].get_xlabel()
    'x'
    """

    label: str
    covariate: str
    x: FloatArray
    effect: FloatArray
    std_error: FloatArray
    multiplier: float
    edf: float
    rug: FloatArray = field(default_factory=lambda: np.zeros(0))

    def frame(self) -> pd.DataFrame:
        """Tabulate the curve and its band.

        Returns
        -------
        DataFrame
            One row per point of the grid: the covariate, ``effect``, ``std_error``, ``lower``, ``upper``.
        """
        return _banded(self.covariate, self.x, self)

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the curve with its band.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; new ones by default.

        Returns
        -------
        matplotlib Figure
            The figure that was drawn on.
        """
        from tripwatt_gamm import figures

        ax = figures.axes_or_new(ax)
        table = self.frame()
        ax.fill_between(self.x, table["lower"], table["upper"], color=figures.BLUE, alpha=0.2, linewidth=0)
        ax.axhline(0.0, color=figures.GREY, linewidth=0.8)
        ax.plot(self.x, self.effect, color=figures.BLUE, linewidth=1.8)
        if self.rug.size:
            rug = np.unique(self.rug)
            rug = rug[:: max(1, len(rug) // 400)]  # more lines would only be a black bar
            place = ax.get_xaxis_transform()
            ax.vlines(rug, 0.0, 0.03, color="black", alpha=0.35, linewidth=0.6, transform=place)
        ax.set(title=f"{self.label}, EDF {self.edf:.2f}", xlabel=self.covariate, ylabel="Effect")
        return figures.figure_of(ax)


@dataclass(frozen=True, slots=True)
class SurfaceEffect:
    """A smooth of two covariates, or a section through a smooth of more, at fixed values of the others.

    Attributes
    ----------
    label : str
        Label of the term.
    covariates : tuple of str
        The two covariates that span the surface.
    x, y : ndarray (m,)
        Grid.
    effect, std_error : ndarray (m, m)
        Centred effect, rows along y; NaN far from all data.
    edf : float
        Effective degrees of freedom.
    points : ndarray (n, 2)
        Covariates of the data.
    at : dict
        Values at which further covariates are held.

    Examples
    --------
    >>> grid = np.linspace(0.0, 1.0, 5)
    >>> effect = SurfaceEffect("te(x,z)", ("x", "z"), grid, grid, np.outer(grid, grid), np.ones((5, 5)), edf=3.0)
    >>> effect.frame().shape
    (25, 4)
    >>> effect.plot().axes[0].get_ylabel()
    'z'
    """

    label: str
    covariates: tuple[str, str]
    x: FloatArray
    y: FloatArray
    effect: FloatArray
    std_error: FloatArray
    edf: float
    points: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    at: Mapping[str, float] = field(default_factory=dict)

    def frame(self) -> pd.DataFrame:
        """Tabulate the surface.

        Returns
        -------
        DataFrame
            One row per point of the grid: both covariates, ``effect``, ``std_error``.
        """
        x, y = np.meshgrid(self.x, self.y)
        columns = {self.covariates[0]: x.ravel(), self.covariates[1]: y.ravel()}
        return pd.DataFrame({**columns, "effect": self.effect.ravel(), "std_error": self.std_error.ravel()})

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the surface as filled contours.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; new ones by default.

        Returns
        -------
        matplotlib Figure
            The figure that was drawn on.
        """
        from tripwatt_gamm import figures

        ax = figures.axes_or_new(ax)
        shown = np.ma.masked_invalid(self.effect)
        if shown.count() and float(np.ma.ptp(shown)) > 0:
            from matplotlib.ticker import MaxNLocator

            # levels from inner quantiles: an extreme corner of a spline must not use up all colours
            low, high = np.quantile(shown.compressed(), [0.02, 0.98])
            levels = np.asarray(MaxNLocator(12).tick_values(low, high))
            filled = ax.contourf(self.x, self.y, shown, levels=levels, cmap="cividis", extend="both")
            lines = ax.contour(self.x, self.y, shown, levels=levels[::2], colors="white", linewidths=0.6)
            ax.clabel(lines, fontsize=7)
            ax.figure.colorbar(filled, ax=ax, label="Effect")
        if self.points.size:
            x, y = self.points[figures.shown_rows(self.points[:, 0])].T
            ax.scatter(x, y, s=2, color="black", alpha=0.35, linewidths=0, rasterized=True)
        held = "".join(f"\nat {name} {value:.3g}" for name, value in self.at.items())
        ax.set(
            title=f"{self.label}, EDF {self.edf:.2f}{held}",
            xlabel=self.covariates[0],
            ylabel=self.covariates[1],
        )
        return figures.figure_of(ax)


@dataclass(frozen=True, slots=True)
class RandomEffects:
    """Predicted random effects and Gaussian quantiles; nearly equal if the effects are normal.

    Attributes
    ----------
    label : str
        Label of the term.
    level : tuple of str
        Sorted by effect.
    effect, std_error, theoretical : ndarray (m,)
        Predicted effects, their standard errors, and normal quantiles with the standard deviation of the model.
    edf, sd : float
        Effective degrees of freedom and standard deviation of the effect in the model.

    Examples
    --------
    >>> effect = RandomEffects(
    ...     "s(trip)", ("b", "a"), np.array([-1.0, 1.0]), np.array([0.2, 0.2]), np.array([-0.9, 0.9]), edf=1.8, sd=1.3
    ... )
    >>> effect.frame().shape
    (2, 4)
    >>> effect.plot().axes[0].get_ylabel()
    'Random effect'
    """

    label: str
    level: tuple[str, ...]
    effect: FloatArray
    std_error: FloatArray
    theoretical: FloatArray
    edf: float
    sd: float

    def frame(self) -> pd.DataFrame:
        """Tabulate the random effects.

        Returns
        -------
        DataFrame
            One row per level: ``level``, ``effect``, ``std_error``, ``theoretical``.
        """
        columns = {"effect": self.effect, "std_error": self.std_error, "theoretical": self.theoretical}
        return pd.DataFrame({"level": self.level, **columns})

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the random effects against Gaussian quantiles.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; new ones by default.

        Returns
        -------
        matplotlib Figure
            The figure that was drawn on.
        """
        from tripwatt_gamm import figures

        ax = figures.axes_or_new(ax)
        ends = self.theoretical[[0, -1]]
        ax.plot(ends, ends, color=figures.RED, linewidth=1.5)
        figures.dots(ax, self.theoretical, self.effect, yerr=1.96 * self.std_error)
        title = f"{self.label}, EDF {self.edf:.2f}, sd {self.sd:.3g}"
        ax.set(title=title, xlabel="Gaussian quantiles", ylabel="Random effect")
        return figures.figure_of(ax)


@dataclass(frozen=True, slots=True)
class FactorEffect:
    """Coefficients of a parametric term with their confidence intervals.

    Attributes
    ----------
    label : str
        Label of the term.
    level : tuple of str
        Level of each row.
    effect, std_error : ndarray (m,)
        0 with standard error 0 for a level without data.
    multiplier : float
        Half width of the interval in standard errors.
    reference : str
        Reference level of a factor; empty for a numeric column.

    Examples
    --------
    >>> effect = FactorEffect("season", ("winter",), np.array([2.0]), np.array([0.5]), 1.96, reference="summer")
    >>> effect.frame()[["lower", "upper"]].round(2).to_numpy().tolist()
    [[1.02, 2.98]]
    >>> effect.plot().axes[0].get_xlabel()
    'Difference from summer'
    """

    label: str
    level: tuple[str, ...]
    effect: FloatArray
    std_error: FloatArray
    multiplier: float
    reference: str = ""

    def frame(self) -> pd.DataFrame:
        """Tabulate the coefficients.

        Returns
        -------
        DataFrame
            One row per level: ``level``, ``effect``, ``std_error``, ``lower``, ``upper``.
        """
        return _banded("level", self.level, self)

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the coefficients with their intervals.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; new ones by default.

        Returns
        -------
        matplotlib Figure
            The figure that was drawn on.
        """
        from tripwatt_gamm import figures

        ax = figures.axes_or_new(ax)
        rows = np.arange(float(len(self.level)))
        ax.axvline(0.0, color=figures.GREY, linewidth=0.8)
        figures.dots(ax, self.effect, rows, xerr=self.multiplier * self.std_error)
        ax.set_yticks(rows, self.level)
        ax.set_ylim(len(self.level) - 0.5, -0.5)
        against = f"Difference from {self.reference}" if self.reference else "Coefficient"
        ax.set(title=self.label, xlabel=against)
        return figures.figure_of(ax)


Effect: TypeAlias = CurveEffect | SurfaceEffect | RandomEffects | FactorEffect


def term_effects(
    model: Estimator, frame: pd.DataFrame | None = None, level: float = 0.95, points: int | None = None
) -> dict[str, Effect]:
    """Compute the effects of all terms of a fitted model.

    Parameters
    ----------
    model : GAMM
        A fitted model.
    frame : pandas.DataFrame, optional
        The data. Needed for rugs and points, and to leave out the parts of a surface that are far from all data.
    level : float
        Coverage of the bands, between 0 and 1.
    points : int, optional
        Points of the grid per covariate. Default 200 for curves, 60 for surfaces.

    Returns
    -------
    dict
        Effects by the label of their term, in the order of the model.

    Raises
    ------
    InvalidInput
        If `level` is not between 0 and 1, `points` is below 2, or `frame` lacks a column of the model.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> model = GAMM("y ~ s(x, k=8)").fit(frame)
    >>> curve = term_effects(model, frame, points=3)["s(x)"]
    >>> curve.frame().columns.tolist(), curve.rug.size
    (['x', 'effect', 'std_error', 'lower', 'upper'], 60)
    """
    faults = []
    if not 0 < level < 1:
        faults.append(Fault("value out of range", "effects(level=)", str(level), "between 0 and 1"))
    if points is not None and points < 2:
        faults.append(Fault("grid too coarse", "effects(points=)", str(points), "2 or more"))
    raise_faults(faults)
    if frame is not None:
        raise_faults(missing_columns(frame, model.formula_.columns))
    multiplier = float(stats.norm.ppf((1 + level) / 2))
    by_term: dict[str, Effect] = {}
    for fitted in model.terms_:
        if fitted.term is None:
            continue
        if isinstance(fitted.term, RandomEffect):
            by_term |= _random(model, fitted)
        elif not isinstance(fitted.term, Smooth | Tensor):
            by_term[fitted.label] = _factor(model, fitted, multiplier)
        elif fitted.term.basis == "fs":
            for name in model.levels_[str(fitted.by)]:
                one = replace(fitted, level=name, label=f"{fitted.label} {name}")
                by_term[one.label] = _curve(model, one, frame, multiplier, points or 200)
        elif len(fitted.term.names) == 1:
            by_term[fitted.label] = _curve(model, fitted, frame, multiplier, points or 200)
        else:
            by_term[fitted.label] = _surface(model, fitted, frame, points or 60)
    return by_term


def _evaluate(model: Estimator, fitted: FittedTerm, grid: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """Return the effect of a fitted term and its standard error at these values of its covariates; a numeric by-variable is 1."""
    if fitted.by is not None:
        grid[fitted.by] = 1.0 if fitted.level is None else fitted.level
    at = fitted.slice
    matrix = fitted.matrix(grid)
    variance = np.einsum("ij,jk,ik->i", matrix, model.Vp_[at, at], matrix, optimize=True)
    return matrix @ model.coef_[at], np.sqrt(np.clip(variance, 0.0, None))


def _rows(fitted: FittedTerm, frame: pd.DataFrame, names: tuple[str, ...]) -> FloatArray:
    """Covariates of the rows on which a fitted term has an effect."""
    if fitted.by is not None:
        by = frame[fitted.by]
        frame = frame[by != 0] if fitted.level is None else frame[by.astype(str) == fitted.level]
    return frame[list(names)].to_numpy(dtype=float)


def _curve(
    model: Estimator, fitted: FittedTerm, frame: pd.DataFrame | None, multiplier: float, points: int
) -> CurveEffect:
    """Curve over the range of its covariate or, for a by-smooth, over that of its own rows."""
    assert isinstance(fitted.term, Smooth | Tensor)
    name = fitted.term.names[0]
    # the range of a by-smooth is that of its own rows: beyond it the model holds the curve constant
    own = model.training_.within.get((fitted.term.names, fitted.by, fitted.level))
    low, high = model.ranges_[name] if own is None else (own.low[0], own.high[0])
    x = np.linspace(low, high, points)
    effect, error = _evaluate(model, fitted, pd.DataFrame({name: x}))
    rug = np.zeros(0) if frame is None else _rows(fitted, frame, (name,))[:, 0]
    return CurveEffect(
        fitted.label, name, x, effect, error, multiplier, float(model.edf_[fitted.slice].sum()), rug
    )


def _surface(model: Estimator, fitted: FittedTerm, frame: pd.DataFrame | None, points: int) -> SurfaceEffect:
    """Surface over the ranges of two covariates; others are held at their median or, without data, at the middle of their range."""
    assert isinstance(fitted.term, Smooth | Tensor)
    first, second, *rest = fitted.term.names
    x, y = (np.linspace(low, high, points) for low, high in (model.ranges_[first], model.ranges_[second]))
    fixed = {
        name: float(np.mean(model.ranges_[name]) if frame is None else frame[name].median()) for name in rest
    }
    across, along = np.meshgrid(x, y)
    grid = pd.DataFrame({first: across.ravel(), second: along.ravel(), **fixed})
    effect, error = _evaluate(model, fitted, grid)
    data = np.zeros((0, 2)) if frame is None else _rows(fitted, frame, (first, second))
    if len(data):
        from scipy.spatial import cKDTree

        span = np.array([np.ptp(x), np.ptp(y)])
        distance, _ = cKDTree(data / span).query(np.c_[across.ravel(), along.ravel()] / span)
        effect, error = (np.where(distance > TOO_FAR, np.nan, v) for v in (effect, error))
    square, edf = (points, points), float(model.edf_[fitted.slice].sum())
    return SurfaceEffect(
        fitted.label, (first, second), x, y, effect.reshape(square), error.reshape(square), edf, data, fixed
    )


def _random(model: Estimator, fitted: FittedTerm) -> dict[str, Effect]:
    """Return one `RandomEffects` for each effect of a term, by label; correlated effects have their name in the label."""
    table = variance_components(model)
    sds = table["std_dev"][table["term"] == fitted.label]
    names = [str(text) for text in model.levels_[":".join(fitted.groups)]]
    effects: dict[str, Effect] = {}
    for j, (name, sd) in enumerate(zip(fitted.effects, sds, strict=True)):
        at = slice(fitted.start + j * len(names), fitted.start + (j + 1) * len(names))
        effect, error = model.coef_[at], np.sqrt(np.clip(np.diag(model.Vp_)[at], 0.0, None))
        order = np.argsort(effect, kind="stable")
        theoretical = float(sd) * stats.norm.ppf((np.arange(effect.size) + 0.5) / effect.size)
        label = fitted.label if len(sds) == 1 else f"{fitted.label} {name}"
        level, edf = tuple(names[i] for i in order), float(model.edf_[at].sum())
        effects[label] = RandomEffects(label, level, effect[order], error[order], theoretical, edf, float(sd))
    return effects


def _factor(model: Estimator, fitted: FittedTerm, multiplier: float) -> FactorEffect:
    """Coefficients of a parametric term; those of a factor are named by its levels."""
    at = fitted.slice
    error = np.sqrt(np.clip(np.diag(model.Vp_)[at], 0.0, None))
    levels = [str(name) for name in model.levels_.get(fitted.label, ())]
    shown = tuple(str(name).removeprefix(fitted.label) if levels else str(name) for name in fitted.names)
    reference = next((name for name in levels if name not in shown), "")
    effect = np.asarray(model.coef_[at], dtype=float)
    return FactorEffect(fitted.label, shown, effect, error, multiplier, reference)


def plot_effects(effects: Mapping[str, Effect], figure: Figure | None = None, columns: int = 3) -> Figure:
    """Draw effects on one figure.

    Parameters
    ----------
    effects : mapping
        Effects by label: all or some of those from `GAMM.effects`.
    figure : matplotlib Figure, optional
        Empty figure to draw on; a new one by default.
    columns : int
        Largest number of panels in a row.

    Returns
    -------
    matplotlib Figure
        The figure that was drawn on, with one panel for each effect, in their order.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> model = GAMM("y ~ s(x, k=8)").fit(frame)
    >>> figure = plot_effects(model.effects(frame))
    >>> [ax.get_xlabel() for ax in figure.axes]
    ['x']
    """
    from tripwatt_gamm import figures

    columns = max(1, min(columns, len(effects)))
    rows = max(1, -(-len(effects) // columns))
    figure = figures.new_figure(4.6 * columns, 3.6 * rows) if figure is None else figure
    for number, effect in enumerate(effects.values(), start=1):
        effect.plot(figure.add_subplot(rows, columns, number))
    return figure
