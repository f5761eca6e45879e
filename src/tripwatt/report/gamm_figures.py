"""Figures of the GAMM, drawn from the numbers of its diagnosis and effects in the report's own style and units."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.gam.figures import RED
from tripwatt.report.gamm import axis_of, in_words, is_determined, not_determined
from tripwatt.report.models import model_style
from tripwatt.report.style import INK, RULE, new_figure, styled
from tripwatt.report.view import plain
from tripwatt.units import SECONDS_PER_MINUTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tripwatt.gam.dependence import Autocorrelation
    from tripwatt.gam.diagnosis import Diagnosis
    from tripwatt.gam.effects import CurveEffect, RandomEffects, SurfaceEffect

MOST_POINTS: Final = 700
"""Points of one scatter; the extremes are always among them."""


def _kept(values: FloatArray) -> IntArray:
    """Row numbers of at most `MOST_POINTS` values, evenly spread, with the ten lowest and highest."""
    n = len(values)
    even = np.linspace(0, n - 1, min(n, MOST_POINTS)).round().astype(np.int64)
    order = np.argsort(values, kind="stable")
    return np.unique(np.concatenate([even, order[:10], order[-10:]]))


def _dots(axes: Axes, x: FloatArray, y: FloatArray, gid: str) -> None:
    kept = _kept(y)
    axes.scatter(x[kept], y[kept], s=5, color=model_style("gamm").colour, alpha=0.45, lw=0, gid=gid)


@styled
def plot_diagnosis(diagnosis: Diagnosis, *, synthetic: bool = False) -> Figure:
    """Q-Q plot against the fitted distribution with its line, residuals, histogram, response against fitted.

    Parameters
    ----------
    diagnosis : Diagnosis
        In Wh.
    synthetic : bool
        Whether the trips are made up.
    """
    figure = new_figure(
        5.6, "Residuals of the GAMM [Wh]", "solid line: what the fitted model expects", synthetic
    )
    axes = figure.subplots(2, 2)
    qq, colour = diagnosis.qq, model_style("gamm").colour
    kept = _kept(qq.residual)
    low, high = qq.band(kept)
    axes[0, 0].fill_between(qq.theoretical[kept], low, high, color=INK, alpha=0.15, lw=0)
    _dots(axes[0, 0], qq.theoretical, qq.residual, "qq")
    ends = qq.theoretical[[0, -1]]
    axes[0, 0].plot(ends, ends, color=RED, lw=1.4, gid="qq-line")
    axes[0, 0].set_ylim(*_padded(np.concatenate([qq.residual, ends])))
    axes[0, 0].set(title="Q-Q plot", xlabel=f"quantiles of {qq.distribution.name}", ylabel="residual")
    scatter = diagnosis.predictor
    _dots(axes[0, 1], scatter.linear_predictor, scatter.residual, "predictor")
    axes[0, 1].axhline(0.0, color=RED, lw=1.4)
    axes[0, 1].set(title="Residual and predictor", xlabel="linear predictor", ylabel="residual")
    bars = diagnosis.histogram
    middle = (bars.edges[1:] + bars.edges[:-1]) / 2
    axes[1, 0].bar(middle, bars.count, width=np.diff(bars.edges), color=colour, alpha=0.6)
    axes[1, 0].plot(middle, bars.expected, color=RED, lw=1.4)
    beyond = f" ({bars.below + bars.above} beyond)" if bars.below + bars.above else ""
    axes[1, 0].set(title="Histogram", xlabel=f"residual{beyond}", ylabel="rows")
    response = diagnosis.response
    _dots(axes[1, 1], response.fitted, response.response, "response")
    ends = np.array([response.fitted.min(), response.fitted.max()])
    axes[1, 1].plot(ends, ends, color=RED, lw=1.4)
    axes[1, 1].set(title="Response and fitted", xlabel="fitted value", ylabel="response")
    for one in axes.ravel():
        _few_ticks(one)
    return figure


def _padded(values: FloatArray) -> tuple[float, float]:
    pad = 0.04 * float(np.ptp(values)) or 1.0
    return float(values.min()) - pad, float(values.max()) + pad


def _few_ticks(axes: Axes) -> None:
    """Room for numbers of five digits side by side."""
    axes.xaxis.get_major_locator().set_params(nbins=4)  # type: ignore[call-arg]  # that of MaxNLocator, which it is
    axes.tick_params(labelsize=7.5)


@styled
def plot_curves(
    curves: Sequence[CurveEffect], observed_wh: float = np.inf, *, synthetic: bool = False
) -> Figure:
    """Every smooth of one covariate with its band and the rug of the data, two in a row.

    The axis shows the whole effect and the band where the middle nine tenths of the data are; a band that runs away at the
    ends is cut. A smooth that the data do not determine leaves its place to the reason.

    Parameters
    ----------
    curves : sequence of CurveEffect
        In Wh.
    observed_wh : float
        Largest less smallest observed value of the response [Wh]; with the default every smooth is drawn.
    synthetic : bool
        Whether the trips are made up.
    """
    drawn = [is_determined(curve, observed_wh) for curve in curves]
    heights = [2.1 if any(drawn[row : row + 2]) else 1.0 for row in range(0, len(curves), 2)]
    figure = new_figure(
        0.9 + sum(heights), "Smooth effects of the GAMM", "band: 95 %, pointwise; ticks: data", synthetic
    )
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    for place, curve in enumerate(curves):
        last_alone = place == len(curves) - 1 and place % 2 == 0
        one = figure.add_subplot(grid[place // 2, :] if last_alone else grid[place // 2, place % 2])
        one.set_title(f"{in_words(curve.label)}\nEDF {curve.edf:.2f}", fontsize=7.5)
        if drawn[place]:
            _draw_curve(one, curve, place)
        else:
            _say_why(one, not_determined(curve, observed_wh), place)
    return figure


def _draw_curve(one: Axes, curve: CurveEffect, place: int) -> None:
    label, factor = axis_of(curve.covariate)
    table, colour = curve.frame(), model_style("gamm").colour
    x = curve.x * factor
    one.fill_between(x, table["lower"], table["upper"], color=colour, alpha=0.25, lw=0)
    one.axhline(0.0, color=RULE, lw=0.9, zorder=0)
    one.plot(x, curve.effect, color=colour, lw=1.8, gid=f"smooth-{place}")
    rug = np.unique(curve.rug) * factor
    rug = rug[np.unique(np.linspace(0, len(rug) - 1, min(len(rug), 250)).round().astype(np.int64))]
    one.plot(
        rug, np.zeros(len(rug)), "|", color=INK, ms=5, mew=0.5, alpha=0.6, transform=one.get_xaxis_transform()
    )
    one.set_ylim(*_padded(_in_view(curve)))
    one.set_xlabel(label)
    if place % 2 == 0:
        one.set_ylabel("effect [Wh]")
    _few_ticks(one)


def _in_view(curve: CurveEffect) -> FloatArray:
    """Values [Wh] that the axis has to show."""
    half = curve.multiplier * curve.std_error
    low, high = np.quantile(curve.rug, [0.05, 0.95]) if curve.rug.size else (-np.inf, np.inf)
    inside = (curve.x >= low) & (curve.x <= high)
    return np.concatenate([curve.effect, (curve.effect - half)[inside], (curve.effect + half)[inside]])


def _say_why(one: Axes, reason: str, place: int) -> None:
    """The reason in place of a smooth."""
    one.set_axis_off()
    one.set(xticks=[], yticks=[])
    one.text(
        0.0,
        0.95,
        textwrap.fill(reason, 34),
        transform=one.transAxes,
        va="top",
        fontsize=8,
        gid=f"reason-{place}",
    )


@styled
def plot_surface(surface: SurfaceEffect, *, synthetic: bool = False) -> Figure:
    """The smooth of two covariates as a map, blank far from all data.

    Parameters
    ----------
    surface : SurfaceEffect
        In Wh.
    synthetic : bool
        Whether the trips are made up.
    """
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(
        4.3, "Surface of the GAMM", f"{in_words(surface.label)}, EDF {surface.edf:.2f}", synthetic
    )
    axes = figure.add_subplot()
    (across, first), (along, second) = (axis_of(name) for name in surface.covariates)
    x, y, shown = surface.x * first, surface.y * second, np.ma.masked_invalid(surface.effect)
    if shown.count() and float(np.ma.ptp(shown)) > 0:
        # a spline's runaway corner must not take all the colours
        low, high = np.quantile(shown.compressed(), [0.02, 0.98])
        levels = np.asarray(MaxNLocator(11).tick_values(low, high))
        filled = axes.contourf(x, y, shown, levels=levels.tolist(), cmap="cividis", extend="both")
        figure.colorbar(filled, ax=axes, label="effect [Wh]")
    kept = _kept(surface.points[:, 0]) if len(surface.points) else np.zeros(0, np.int64)
    points = surface.points[kept]
    axes.scatter(
        points[:, 0] * first, points[:, 1] * second, s=2, color=RED, alpha=0.6, lw=0, gid="surface-data"
    )
    axes.set(xlabel=across, ylabel=along)
    return figure


@styled
def plot_random(effect: RandomEffects, *, synthetic: bool = False) -> Figure:
    """Random effects of the trips against Gaussian quantiles, with the line on which they lie if they are normal.

    Parameters
    ----------
    effect : RandomEffects
        In Wh.
    synthetic : bool
        Whether the trips are made up.
    """
    figure = new_figure(
        3.6,
        "Random effects of the trips",
        f"EDF {effect.edf:.2f}, standard deviation {effect.sd:,.0f} Wh",
        synthetic,
    )
    axes, colour = figure.add_subplot(), model_style("gamm").colour
    ends = effect.theoretical[[0, -1]]
    axes.plot(ends, ends, color=RED, lw=1.4)
    axes.vlines(
        effect.theoretical,
        effect.effect - 1.96 * effect.std_error,
        effect.effect + 1.96 * effect.std_error,
        color=RULE,
        lw=1.0,
        zorder=1,
    )
    axes.plot(effect.theoretical, effect.effect, "o", color=colour, ms=4, gid="random")
    axes.margins(0.08)
    for place, (offset, side) in ((0, ((6, -14), "left")), (-1, ((-6, 5), "right"))):
        axes.annotate(
            plain(effect.level[place], 18),
            (effect.theoretical[place], effect.effect[place]),
            offset,
            textcoords="offset points",
            fontsize=7.5,
            ha=side,
        )
    axes.set(xlabel="Gaussian quantiles [Wh]", ylabel="random effect [Wh];  bars: 95 %")
    return figure


@styled
def plot_dependence(found: Autocorrelation, step_s: float, *, synthetic: bool = False) -> Figure:
    """Autocorrelation of the residuals within trips, with the band of independent rows.

    Parameters
    ----------
    found : Autocorrelation
    step_s : float
        Time between neighbouring rows [s].
    synthetic : bool
        Whether the trips are made up.
    """
    figure = new_figure(
        2.9,
        "Autocorrelation of the residuals within trips",
        "grey band: 95 % for independent rows",
        synthetic,
    )
    axes = figure.add_subplot()
    minutes = found.lag * step_s / SECONDS_PER_MINUTE
    axes.fill_between(minutes, -found.bound, found.bound, color=INK, alpha=0.15, lw=0)
    axes.vlines(minutes, 0.0, found.correlation, color=model_style("gamm").colour, lw=2.2)
    axes.plot(minutes, found.correlation, "o", color=model_style("gamm").colour, ms=3, gid="autocorrelation")
    axes.axhline(0.0, color=INK, lw=0.9)
    axes.set_ylim(max(-1.02, min(-0.2, 1.1 * float(found.correlation.min()))), 1.02)
    axes.set(xlabel="lag [min]", ylabel="correlation")
    axes.grid(axis="y")
    return figure
