"""The fit of the GAMM: its terms and scores, its residuals, and its effects."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import matplotlib
from matplotlib.figure import Figure

from tripwatt.study.paper.insight import GammInsight
from tripwatt.study.report.covariates import term_in_words
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.style import new_figure
from tripwatt.study.report.tables import Table, number
from tripwatt.study.report.view import View, printable

if TYPE_CHECKING:
    from tripwatt_gamm.effects import Effect


def panels(view: View) -> list[Panel]:
    """Return the panels of the fit; none if the GAMM was not among the models."""
    gamm = view.gamm
    if gamm is None:
        return []
    from tripwatt_gamm import CurveEffect, RandomEffects, SurfaceEffect, plot_effects  # an extra

    curves = {name: effect for name, effect in gamm.effects.items() if isinstance(effect, CurveEffect)}

    def panel(
        key: str, title: str, caption: str, height_in: float, head: str, draw: Callable[[Figure], object]
    ) -> Panel:
        figure = new_figure(height_in, head, "", view.synthetic)
        with matplotlib.rc_context({"axes.titlesize": 7.5}):
            draw(figure)
        return Panel(f"gamm-{key}", title, caption, figure)

    shown = [
        Panel("gamm-summary", "Summary of the GAMM", tables=(terms_table(view, gamm), fit_table(view, gamm))),
        panel(
            "diagnosis",
            "Residuals against the fitted distribution",
            "Residuals in Wh; red: what the fitted model expects.",
            6.0,
            "Residuals of the GAMM [Wh]",
            gamm.diagnosis.plot,
        ),
        panel(
            "smooths",
            "Effect of each covariate",
            "Centred smooths in Wh, with pointwise bands of 95 %; ticks are the data.",
            0.5 + 2.2 * len(curves),
            "Smooth effects of the GAMM [Wh]",
            lambda figure: plot_effects(curves, figure, columns=1),
        ),
    ]
    for effect in gamm.effects.values():

        def draw(figure: Figure, effect: Effect = effect) -> None:
            effect.plot(figure.add_subplot())

        if isinstance(effect, SurfaceEffect):
            caption = "In Wh; blank far from all data; points are the data."
            head = "Surface of the GAMM [Wh]"
            shown.append(panel("surface", "Joint effect of two covariates", caption, 4.3, head, draw))
        elif isinstance(effect, RandomEffects):
            caption = "In Wh, with 95 % intervals; on the line if they are normally distributed. That of a new trip is 0."
            head = "Random effects of the trips [Wh]"
            shown.append(panel("random", "Random effects of the trips", caption, 3.6, head, draw))
    return shown


def terms_table(view: View, gamm: GammInsight) -> Table:
    """Tabulate every coefficient with its standard error and every smooth with its EDF."""
    rows = [
        (term_in_words(term.removeprefix("EDF: ")), f"{value}{mark}".replace("-", "−"))
        for term, value, mark in gamm.summary.rows()
    ]
    caption = (
        f"{view.captioned('Terms of the GAMM')}: estimate (standard error) in Wh, EDF (reference df) of a smooth s(); "
        "*** p < 0.001, ** p < 0.01, * p < 0.05"
    )
    return Table(caption, ("Term", "Value"), tuple(rows))


def fit_table(view: View, gamm: GammInsight) -> Table:
    """Tabulate the scores of the fit, the correlation of its residuals, and the reductions that the data forced."""
    page = gamm.summary
    neighbours = number(float(gamm.autocorrelation.correlation[0]))
    rows = [
        ("Converged", "yes" if page.converged else f"no, the figures are not to be trusted. {page.message}"),
        ("Errors", page.distribution()),
        ("Formula", term_in_words(page.formula)),
        *((name, value.replace("-", "−")) for name, value in page.scores().items()),
        (f"Correlation of residuals {gamm.row_step_s:g} s apart", neighbours),
        *(
            ("Note", printable(term_in_words(note), 400))
            for note in (gamm.autocorrelation.warning, *page.notes)
            if note
        ),
        *(
            ("Term left out", f"{term_in_words(term)}: its covariates never vary here")
            for term in gamm.left_out
        ),
    ]
    return Table(view.captioned("The fit of the GAMM"), ("What", "Value"), tuple(rows), frozenset({0, 1}))
