"""The fit of the GAMM: its table beside the paper's, its residuals, and its rule outside of the training data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tripwatt.arrays import FloatArray
from tripwatt.files import shipped_toml
from tripwatt.gam.covariates import REACH
from tripwatt.gam.dependence import Autocorrelation
from tripwatt.gam.diagnosis import Diagnosis
from tripwatt.gam.effects import Effect, FactorEffect
from tripwatt.gam.figures import RED
from tripwatt.paper.insight import GammInsight
from tripwatt.report.covariates import term_in_words
from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import INK, few_ticks, kept_points, new_figure, padded, plotted
from tripwatt.report.tables import DASH, Column, Table, in_percent, in_words, tabulated
from tripwatt.report.view import View, natural_key, plain
from tripwatt.report.words import percent
from tripwatt.units import SECONDS_PER_MINUTE

PAPER_TABLE2_SOURCE: Final = "arXiv:2405.10984, Table 2"


PAPER_TABLE2: Final[Mapping[str, str]] = shipped_toml("report/paper_table2.toml")
"""What the paper prints for its GAMM (`PAPER_TABLE2_SOURCE`), by our names of the terms."""


@panel("gamm-summary", "Summary of the GAMM", wide=True)
def gamm_summary(view: View) -> Content:
    """Terms and scores of the fit."""
    gamm, paper = view.gamm, bool(view.published)
    if gamm is None:
        return Content(
            "The model gamm was not among the models of this run, so there is no table and no figure of it."
        )
    tables = (summary_table(view, gamm, paper=paper), scores_table(view, gamm))
    return Content(on_summary(gamm, paper=paper), tables=tables)


@panel("gamm-extrapolation", "Outside of the training data", folded=True)
def gamm_extrapolation(view: View) -> Content | None:
    """The rule outside of the training data, and the trips to which it applies."""
    if view.gamm is None:
        return None
    table = outside_table(view, view.gamm)
    said = on_extrapolation(view.gamm, view.main.get("n_trips"))
    return Content(said, tables=(table,) if table.rows else ())


def on_summary(gamm: GammInsight, *, paper: bool) -> str:
    """What was fitted, how well, and what the table can be compared with."""
    page = gamm.summary
    text = (
        f"{page.distribution()} Wh; on {page.n} rows, one every {gamm.row_step_s:g} s of a trip and its last, it explains "
        f"{percent(page.deviance_explained)} of the deviance. A level without data is 0.00 (0.00)."
    )
    if not page.converged:
        text = f"The fit did not converge, its figures are not to be trusted. {page.message} {text}"
    if paper:
        text += (
            " The paper's values stand beside ours where the terms match; they need not agree: its GAMM "
            "explains what another simulation leaves, on more trips, and its reference weather is not named."
        )
    return text


def on_extrapolation(gamm: GammInsight, trips: int | None) -> str:
    """The rule outside of the training data, and for how many held-out trips it matters."""
    outside = gamm.outside["trip"].nunique()
    of = f" of {trips}" if trips else ""
    return (
        "Outside of the training data no effect grows: a row is moved to where training rows lie before any term is evaluated, each "
        "covariate to the nearer end of its range (in winter, that of the winter trips), those of a surface to within "
        f"{percent(REACH, 0)} of their ranges from the nearest training point. A weather that no training trip had counts as the mean "
        f"over the training rows; a new trip's random effect is 0. Held out, {outside}{of} trips leave, in some row, the range that the "
        "others have shown, or have a weather of their own."
    )


def summary_table(view: View, gamm: GammInsight, *, paper: bool) -> Table:
    """Every coefficient with its standard error and every smooth with its EDF, as the paper prints them.

    Parameters
    ----------
    view : View
    gamm : GammInsight
    paper : bool
        Whether the paper's own table may stand beside it.
    """
    coefficients = _coefficient_names(gamm.effects)
    tests = gamm.summary.frame()["p_value"].tolist()
    rows: list[tuple[str, str, str]] = []
    for (term, value, mark), p_value in zip(gamm.summary.rows(), tests, strict=True):
        name = term.removeprefix("EDF: ")
        shown = coefficients.get(name) or term_in_words(name)
        text = f"{value}{mark}".replace("-", "−").replace(" ", "\u00a0")
        rows.append((shown, text, _p_text(p_value)))
    for factor in (e for e in gamm.effects.values() if isinstance(e, FactorEffect) and e.reference):
        first = next((i for i, row in enumerate(rows) if row[0].startswith(f"{factor.label}: ")), len(rows))
        rows.insert(first, (f"{factor.label}: {plain(factor.reference)}", "reference", DASH))
    columns = ["Term", "Ours", "p"]
    cells: list[tuple[str, ...]] = list(rows)
    if paper:
        columns.append(f"The paper ({PAPER_TABLE2_SOURCE})")
        printed = {name: text.replace(" ", "\u00a0") for name, text in PAPER_TABLE2.items()}
        absent = [name for name in PAPER_TABLE2 if name not in {row[0] for row in rows}]
        cells = [(*row, printed.get(row[0], DASH)) for row in rows]
        cells += [(name, DASH, DASH, printed[name]) for name in absent]
    caption = (
        f"{view.captioned('Terms of the GAMM')}: estimate (standard error) in Wh, EDF (reference df) of a smooth s(); "
        "*** p < 0.001, ** p < 0.01, * p < 0.05"
    )
    return Table(caption, tuple(columns), tuple(cells))


def _coefficient_names(effects: Mapping[str, Effect]) -> dict[str, str]:
    """Coefficient of the engine -> factor and level as they are shown."""
    return {
        f"{effect.label}{level}": f"{effect.label}: {plain(level)}"
        for effect in effects.values()
        if isinstance(effect, FactorEffect) and effect.reference
        for level in effect.level
    }


def _p_text(p_value: float) -> str:
    if not np.isfinite(p_value):
        return "no\u00a0data"
    return "<\u00a00.0001" if p_value < 1e-4 else f"{p_value:.4f}"


def scores_table(view: View, gamm: GammInsight) -> Table:
    """Scores of the fit, and the reductions that the data forced."""
    page = gamm.summary
    scores = [(name, value.replace("-", "−")) for name, value in page.scores().items()]
    rows = [("Errors", page.distribution()), ("Formula", term_in_words(page.formula)), *scores]
    rows += [("Note", plain(term_in_words(note), 400)) for note in page.notes]
    left_out = [f"{term_in_words(term)}: its covariates never vary here" for term in gamm.left_out]
    rows += [("Term left out", reason) for reason in left_out]
    caption = view.captioned("The fit of the GAMM")
    return Table(caption, ("What", "Value"), tuple(rows), frozenset({0, 1}))


def outside_table(view: View, gamm: GammInsight) -> Table:
    """Trips that leave what all other trips have shown, with the share of their rows."""
    return tabulated(
        view.captioned("Where the extrapolation rule applies to a held-out trip"),
        sorted(gamm.outside.to_dict("records"), key=lambda row: natural_key(row["trip"])),
        Column("Trip", lambda row: plain(row["trip"])),
        in_words("What no other trip has shown", lambda row: term_in_words(str(row["covariate"]))),
        in_percent("Share of its rows [%]", "share"),
    )


@panel("gamm-diagnosis", "Residuals against the fitted distribution", draws=True)
def gamm_diagnosis(view: View) -> Content | None:
    """Whether the residuals follow the fitted distribution."""
    if view.gamm is None:
        return None
    return Content(on_diagnosis(view.gamm), plot_diagnosis(view, view.gamm.diagnosis))


@panel("gamm-autocorrelation", "Autocorrelation of the residuals", draws=True)
def gamm_autocorrelation(view: View) -> Content | None:
    """Whether neighbouring rows of a trip are independent."""
    if view.gamm is None:
        return None
    drawn = plot_dependence(view, view.gamm.autocorrelation, view.gamm.row_step_s)
    return Content(on_dependence(view.gamm), drawn)


def on_diagnosis(gamm: GammInsight) -> str:
    """Whether the residuals follow the fitted distribution."""
    residual, line = gamm.diagnosis.qq.residual, gamm.diagnosis.qq.theoretical
    off = float(np.max(np.abs(residual - line)[_middle(len(line))]))
    half = float(np.quantile(np.abs(residual), 0.5))
    far = float(np.max(np.abs(residual)))
    return (
        f"Half of the residuals are within {half:,.0f} Wh, the largest is {far:,.0f} Wh. Between the 5 % and the 95 % quantile "
        f"the ordered residuals stay within {off:,.0f} Wh of the line, the quantiles of the fitted {gamm.diagnosis.qq.distribution.name}."
    )


def _middle(n: int) -> slice:
    return slice(n // 20, max(n - n // 20, n // 20 + 1))


def on_dependence(gamm: GammInsight) -> str:
    """The autocorrelation warning in plain words, and why rows are thinned."""
    first = gamm.autocorrelation.correlation[0] if gamm.autocorrelation.lag.size else float("nan")
    text = gamm.autocorrelation.warning or (
        f"The correlation of neighbouring residuals of a trip is {first:.2f}; the rows can be treated as independent."
    )
    return (
        f"{text} The fit takes one row every {gamm.row_step_s:g} s; with a row every {gamm.full_step_s:g} s, as in the data, the "
        f"correlation would be {gamm.full_correlation:.3f}."
    )


def plot_diagnosis(view: View, diagnosis: Diagnosis) -> Figure:
    """Q-Q plot against the fitted distribution with its line, residuals, histogram, response against fitted, in Wh."""
    head = ("Residuals of the GAMM [Wh]", "solid line: what the fitted model expects")
    figure = new_figure(5.6, *head, view.synthetic)
    axes = figure.subplots(2, 2)
    qq, colour = diagnosis.qq, model_style("gamm").colour
    kept = kept_points(qq.residual)
    low, high = qq.band(kept)
    axes[0, 0].fill_between(qq.theoretical[kept], low, high, color=INK, alpha=0.15, lw=0)
    _dots(axes[0, 0], qq.theoretical, qq.residual, "qq")
    ends = qq.theoretical[[0, -1]]
    axes[0, 0].plot(ends, ends, color=RED, lw=1.4, gid="qq-line")
    axes[0, 0].set(title="Q-Q plot", xlabel=f"quantiles of {qq.distribution.name}", ylabel="residual")
    axes[0, 0].set(ylim=padded(np.concatenate([qq.residual, ends])))
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
        few_ticks(one)
    return figure


def _dots(axes: Axes, x: FloatArray, y: FloatArray, gid: str) -> None:
    kept = kept_points(y)
    axes.scatter(x[kept], y[kept], s=5, color=model_style("gamm").colour, alpha=0.45, lw=0, gid=gid)


def plot_dependence(view: View, residuals: Autocorrelation, step_s: float) -> Figure:
    """Autocorrelation of the residuals within trips, with the band of independent rows; `step_s` between two rows."""
    title, note = "Autocorrelation of the residuals within trips", "grey band: 95 % for independent rows"
    figure, axes = plotted(view, 2.9, title, note)
    minutes = residuals.lag * step_s / SECONDS_PER_MINUTE
    axes.fill_between(minutes, -residuals.bound, residuals.bound, color=INK, alpha=0.15, lw=0)
    axes.vlines(minutes, 0.0, residuals.correlation, color=model_style("gamm").colour, lw=2.2)
    axes.plot(
        minutes, residuals.correlation, "o", color=model_style("gamm").colour, ms=3, gid="autocorrelation"
    )
    axes.axhline(0.0, color=INK, lw=0.9)
    axes.set_ylim(max(-1.02, min(-0.2, 1.1 * float(residuals.correlation.min()))), 1.02)
    axes.set(xlabel="lag [min]", ylabel="correlation")
    axes.grid(axis="y")
    return figure
