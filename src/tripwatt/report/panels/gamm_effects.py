"""Effects of the GAMM: smooths of one covariate, the surface, and the trips' random effects."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any, Final, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.gam.effects import CurveEffect, RandomEffects, SurfaceEffect
from tripwatt.gam.figures import RED
from tripwatt.report.covariates import axis_of, term_in_words
from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import INK, RULE, annotate, few_ticks, kept_points, new_figure, padded, plotted
from tripwatt.report.tables import Column, Table, tabulated
from tripwatt.report.view import View, plain
from tripwatt.report.words import listed, percent

E = TypeVar("E")

BAND_PER_RANGE: Final = 1.0
"""A smooth whose 95 % band is wider than so many ranges of the observed response is not determined by the data: every value
that was observed, added or subtracted, would lie within the band."""


@panel("gamm-smooths", "Effect of each covariate", draws=True)
def gamm_smooths(view: View) -> Content | None:
    """Every smooth of one covariate."""
    curves = _effects(view, CurveEffect)
    if not curves:
        return None
    observed_wh = _observed_wh(view)
    return Content(on_curves(curves, observed_wh), plot_curves(view, curves, observed_wh))


@panel("gamm-surface", "Joint effect of two covariates", draws=True)
def gamm_surface(view: View) -> Content | None:
    """The smooth of two covariates, of which the formula has at most one."""
    for surface in _effects(view, SurfaceEffect):
        return Content(on_surface(surface, _observed_wh(view)), plot_surface(view, surface))
    return None


@panel("gamm-random", "Random effects of the trips", draws=True, folded=True)
def gamm_random(view: View) -> Content | None:
    """The random effect of every trip, of which the formula has at most one."""
    for effect in _effects(view, RandomEffects):
        return Content(on_random(effect), plot_random(view, effect), (random_table(view, effect),))
    return None


def _effects(view: View, kind: type[E]) -> list[E]:
    """The effects of one kind; none without a GAMM."""
    return [e for e in view.gamm.effects.values() if isinstance(e, kind)] if view.gamm else []


def _observed_wh(view: View) -> float:
    """Largest less smallest observed value of the response [Wh]."""
    return float(np.ptp(view.gamm.diagnosis.response.response)) if view.gamm else 0.0


def band_width_wh(curve: CurveEffect) -> float:
    """Median width of the 95 % band of a smooth over the range of its data [Wh]."""
    inside = _on_data(curve)
    half = curve.multiplier * (curve.std_error[inside] if inside.any() else curve.std_error)
    return float(2.0 * np.median(half))


def is_determined(curve: CurveEffect, observed_wh: float) -> bool:
    """Whether the band of a smooth is narrower than `BAND_PER_RANGE` ranges of the observed response.

    Parameters
    ----------
    curve : CurveEffect
        In Wh.
    observed_wh : float
        Largest less smallest observed value of the response [Wh].
    """
    return band_width_wh(curve) <= BAND_PER_RANGE * observed_wh


def not_determined(curve: CurveEffect, observed_wh: float) -> str:
    """Why a smooth is not drawn."""
    return (
        f"not determined by these trips: its 95 % band is {band_width_wh(curve):,.0f} Wh wide, the observed values range over "
        f"{observed_wh:,.0f} Wh"
    )


def on_curves(curves: Sequence[CurveEffect], observed_wh: float) -> str:
    """The smooths with the largest effect over their data, and those that the data do not determine.

    Parameters
    ----------
    curves : sequence of CurveEffect
    observed_wh : float
        Largest less smallest observed value of the response [Wh].
    """
    known = [c for c in curves if is_determined(c, observed_wh)]
    spans = {term_in_words(c.label): _span_on_data(c) for c in known}
    first = sorted(spans, key=lambda name: -spans[name])[:2]
    text = "Each smooth is centred; its band covers 95 % pointwise; ticks are the data."
    if first:
        parts = [f"{name} ({spans[name]:,.0f} Wh)" for name in first]
        text += f" Over the range of the data, the largest effects are {listed(parts)}."
    for curve in curves:
        if curve not in known:
            text += f" {term_in_words(curve.label)} is not drawn: {not_determined(curve, observed_wh)}."
    return text


def _on_data(curve: CurveEffect) -> BoolArray:
    """Grid points between the first and the last row of a smooth's data."""
    low, high = (curve.rug.min(), curve.rug.max()) if curve.rug.size else (-np.inf, np.inf)
    return np.asarray((curve.x >= low) & (curve.x <= high))


def _span_on_data(curve: CurveEffect) -> float:
    """Range of a smooth between the first and the last row of its data."""
    shown = curve.effect[_on_data(curve)]
    return float(np.ptp(shown)) if shown.size else 0.0


def on_surface(surface: SurfaceEffect, observed_wh: float) -> str:
    """How far the surface reaches where there are data, and whether the data determine it."""
    low, high = float(np.nanmin(surface.effect)), float(np.nanmax(surface.effect))
    text = (
        f"{term_in_words(surface.label)} ranges from {low:,.0f} to {high:,.0f} Wh (EDF {surface.edf:.1f}); areas far from all data "
        "are blank; points are the data."
    )
    shown = np.isfinite(surface.effect)
    width = float(2.0 * 1.96 * np.median(surface.std_error[shown])) if shown.any() else 0.0
    if width > BAND_PER_RANGE * observed_wh:
        text += (
            f" These trips do not determine it: its 95 % band is {width:,.0f} Wh wide, the observed values range over "
            f"{observed_wh:,.0f} Wh."
        )
    return text.replace("-", "−")


def on_random(effect: RandomEffects) -> str:
    """How much trips differ beyond all covariates."""
    beyond = float(np.mean(np.abs(effect.effect) > 1.96 * effect.sd))
    return (
        f"The standard deviation of the trips' effects, beyond all covariates, is {effect.sd:,.0f} Wh. The smallest effect is that "
        f"of {plain(effect.level[0])}, the largest that of {plain(effect.level[-1])}; {percent(beyond, 0)} of the effects lie beyond "
        "1.96 standard deviations (5 % for a normal distribution). The effect of a new trip is 0."
    )


def random_table(view: View, effect: RandomEffects) -> Table:
    """The random effect of every trip, the smallest first."""
    return tabulated(
        view.captioned("Random effect of every trip"),
        zip(effect.level, effect.effect.tolist(), effect.std_error.tolist(), strict=True),
        Column("Trip", lambda row: plain(row[0])),
        Column("Random effect [Wh]", lambda row: row[1], digits=0),
        Column("Std. error [Wh]", lambda row: row[2], digits=0),
    )


def plot_curves(view: View, curves: Sequence[CurveEffect], observed_wh: float = np.inf) -> Figure:
    """Every smooth of one covariate with its band and the rug of the data, two in a row.

    The axis shows the whole effect and the band where the middle nine tenths of the data are; a band that runs away at the
    ends is cut. A smooth that the data do not determine leaves its place to the reason.

    Parameters
    ----------
    view : View
    curves : sequence of CurveEffect
        In Wh.
    observed_wh : float
        Largest less smallest observed value of the response [Wh]; with the default every smooth is drawn.
    """
    drawn = [is_determined(curve, observed_wh) for curve in curves]
    heights = [2.1 if any(drawn[row : row + 2]) else 1.0 for row in range(0, len(curves), 2)]
    head = ("Smooth effects of the GAMM", "band: 95 %, pointwise; ticks: data")
    figure = new_figure(0.9 + sum(heights), *head, view.synthetic)
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    for place, curve in enumerate(curves):
        last_alone = place == len(curves) - 1 and place % 2 == 0
        one = figure.add_subplot(grid[place // 2, :] if last_alone else grid[place // 2, place % 2])
        one.set_title(f"{term_in_words(curve.label)}\nEDF {curve.edf:.2f}", fontsize=7.5)
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
    look: dict[str, Any] = {"ms": 5, "mew": 0.5, "alpha": 0.6, "transform": one.get_xaxis_transform()}
    one.plot(rug, np.zeros(len(rug)), "|", color=INK, **look)
    one.set(ylim=padded(_in_view(curve)), xlabel=label)
    if place % 2 == 0:
        one.set_ylabel("effect [Wh]")
    few_ticks(one)


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
    look: dict[str, Any] = {"transform": one.transAxes, "va": "top", "fontsize": 8}
    one.text(0.0, 0.95, textwrap.fill(reason, 34), gid=f"reason-{place}", **look)


def plot_surface(view: View, surface: SurfaceEffect) -> Figure:
    """The smooth of two covariates [Wh] as a map, blank far from all data."""
    note = f"{term_in_words(surface.label)}, EDF {surface.edf:.2f}"
    figure, axes = plotted(view, 4.3, "Surface of the GAMM", note)
    (across, first), (along, second) = (axis_of(name) for name in surface.covariates)
    x, y, shown = surface.x * first, surface.y * second, np.ma.masked_invalid(surface.effect)
    if shown.count() and float(np.ma.ptp(shown)) > 0:
        # a spline's runaway corner must not take all the colours
        low, high = np.quantile(shown.compressed(), [0.02, 0.98])
        levels = np.asarray(MaxNLocator(11).tick_values(low, high))
        filled = axes.contourf(x, y, shown, levels=levels.tolist(), cmap="cividis", extend="both")
        figure.colorbar(filled, ax=axes, label="effect [Wh]")
    kept = kept_points(surface.points[:, 0]) if len(surface.points) else np.zeros(0, np.int64)
    across_points, along_points = (surface.points[kept] * (first, second)).T
    axes.scatter(across_points, along_points, s=2, color=RED, alpha=0.6, lw=0, gid="surface-data")
    axes.set(xlabel=across, ylabel=along)
    return figure


def plot_random(view: View, effect: RandomEffects) -> Figure:
    """Random effects of the trips [Wh] against Gaussian quantiles, with the line on which they lie if they are normal."""
    note = f"EDF {effect.edf:.2f}, standard deviation {effect.sd:,.0f} Wh"
    figure, axes = plotted(view, 3.6, "Random effects of the trips", note)
    colour, ends, half = model_style("gamm").colour, effect.theoretical[[0, -1]], 1.96 * effect.std_error
    axes.plot(ends, ends, color=RED, lw=1.4)
    bars = effect.effect - half, effect.effect + half
    axes.vlines(effect.theoretical, *bars, color=RULE, lw=1.0, zorder=1)
    axes.plot(effect.theoretical, effect.effect, "o", color=colour, ms=4, gid="random")
    axes.margins(0.08)
    for place, (offset, side) in ((0, ((6, -14), "left")), (-1, ((-6, 5), "right"))):
        at = (effect.theoretical[place], effect.effect[place])
        annotate(axes, plain(effect.level[place], 18), at, offset, ha=side)
    axes.set(xlabel="Gaussian quantiles [Wh]", ylabel="random effect [Wh];  bars: 95 %")
    return figure
