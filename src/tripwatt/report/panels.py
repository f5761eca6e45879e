"""The panels of the report: a heading, a sentence from the numbers, and a figure, tables, or why there are none."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tripwatt.gam.effects import CurveEffect, RandomEffects, SurfaceEffect
from tripwatt.report import figures, gamm, gamm_figures, running_time, sentences, tables
from tripwatt.report.models import model_style
from tripwatt.report.tables import Table
from tripwatt.report.view import Record, View, of_evaluation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tripwatt.paper.insight import GammInsight


@dataclass(frozen=True)
class Panel:
    """One panel.

    Attributes
    ----------
    key : str
        Anchor in the page and stem of the figure's files.
    title : str
    sentence : str
        What it shows, from the numbers; in an empty panel, why there is nothing to show.
    figure : Figure or None
    tables : tuple of Table
    folded : bool
        Whether the tables start closed.
    wide : bool
        Whether it takes the full width of a desktop page; the others stand in two balanced columns.
    """

    key: str
    title: str
    sentence: str
    figure: Figure | None = None
    tables: tuple[Table, ...] = ()
    folded: bool = False
    wide: bool = False


@dataclass(frozen=True)
class Section:
    """Panels under one heading."""

    key: str
    title: str
    panels: tuple[Panel, ...]


def build_sections(view: View) -> list[Section]:
    """Every section of the report; a panel without data stays and gives the reason."""
    if view.is_forecast:
        from tripwatt.report.forecast import forecast_sections

        sections = forecast_sections(view)
    else:
        sections = _paper_sections(view)
    return [replace(section, panels=filled_rows(section.panels)) for section in sections]


def filled_rows(panels: Sequence[Panel]) -> tuple[Panel, ...]:
    """The panels, with one that would stand alone beside an empty half of the page made wide.

    Examples
    --------
    >>> [p.wide for p in filled_rows([Panel("a", "", "", wide=True), Panel("b", "", "")])]
    [True, True]
    >>> [p.wide for p in filled_rows([Panel("a", "", ""), Panel("b", "", "")])]
    [False, False]
    """
    laid_out: list[Panel] = []
    for wide, run in itertools.groupby(panels, key=lambda panel: panel.wide):
        together = list(run)
        alone = len(together) == 1 and not wide
        laid_out += [replace(panel, wide=True) for panel in together] if alone else together
    return tuple(laid_out)


def _paper_sections(view: View) -> list[Section]:
    return [
        Section("result", "Result", result_panels(view)),
        Section("errors", "Errors of every model", errors_panels(view)),
        Section("trips", "Trip by trip", trips_panels(view)),
        Section("comparison", "Differences between the models", comparison_panels(view)),
        Section("audit", "Trips that were used, and reasons why others were not", audit_panels(view)),
        Section("gamm", "The GAMM", _gamm(view)),
        Section("inside", "Inside the models", (*_inside(view), _running_time(view))),
    ]


def result_panels(view: View) -> tuple[Panel, ...]:
    """The main table and its companions."""
    evaluations = view.evaluations
    if not evaluations:
        return (Panel("table", "The table", "No evaluation was run: no trip could be used, see the audit."),)
    notes = [sentences.on_main_table(view), sentences.on_paper(view), sentences.on_physics_gap(view)]
    if view.is_forecast:
        from tripwatt.report.forecast import on_forecast_table

        notes = [on_forecast_table(view)]
    mean = figures.plot_mean_errors(evaluations, paper=view.paper_mape, synthetic=view.synthetic)
    others = [tables.results_table(view, e) for e in evaluations[1:]]
    sets = " ".join(filter(None, [sentences.on_sets(view), sentences.without_days(view)]))
    return (
        Panel(
            "table",
            "The table",
            " ".join(filter(None, notes)),
            tables=(tables.results_table(view, view.main),),
            wide=True,
        ),
        Panel("mean-errors", "Mean error and its interval", sentences.on_intervals(view), mean),
        Panel(
            "legend",
            "What the models are",
            f"{len(view.models)} models, the same trips for each.",
            tables=(tables.legend_table(view),),
        ),
        Panel("sets", "Other trips, other folds", sets, tables=(tables.sets_table(view),), wide=True),
        *(
            [
                Panel(
                    "full-tables",
                    "The other evaluations in full",
                    f"{len(others)} more.",
                    tables=tuple(others),
                    folded=True,
                    wide=True,
                )
            ]
            if others
            else []
        ),
    )


def errors_panels(view: View) -> tuple[Panel, ...]:
    """Distributions of the errors."""
    folds, note, made_up = view.folds_of(view.main), of_evaluation(view.main), view.synthetic
    if folds.empty:
        return (
            Panel(
                "error-distribution", "Error distribution", "No fold is known, so there is no distribution."
            ),
        )
    distribution = figures.plot_error_distribution(folds, note=note, synthetic=made_up)
    boxes = figures.plot_error_boxes(folds, paper=view.paper_mape, note=note, synthetic=made_up)
    return (
        Panel(
            "error-distribution",
            "Error distribution over the folds",
            sentences.on_distribution(view),
            distribution,
        ),
        Panel("error-boxes", "Box plot of all models", sentences.on_boxes(view), boxes),
        *(() if view.is_forecast else (_benchmark(view),)),
    )


def _benchmark(view: View) -> Panel:
    folds = view.folds_of(view.main)
    models = [m for m in ("physics-paper", "boosting", "boosting-only") if m in set(folds["model"])]
    title = "Physics alone, hybrid, and boosting alone"
    sentence = sentences.on_benchmark(view, models)
    if not models:
        return Panel("benchmark-boxes", title, sentence)
    figure = figures.plot_error_boxes(
        folds,
        models=models,
        paper=view.paper_mape,
        title="Physics, hybrid boosting, boosting without physics",
        note=of_evaluation(view.main),
        synthetic=view.synthetic,
    )
    return Panel("benchmark-boxes", title, sentence, figure)


def trips_panels(view: View) -> tuple[Panel, ...]:
    """Errors by trip."""
    folds, best = view.folds_of(view.main), view.best
    if best is None or best not in set(folds["model"]):
        return (
            Panel("trip-errors", "Error by trip", "No fold is known, so there is nothing to show by trip."),
        )
    selected = view.selected_trips()
    along = Panel("trip-energy", "Energy along the trip", "No predictions along the trips were kept.")
    if selected:
        said = sentences.on_trip_energy(selected, best)
        simulated = model_style(best).stands_on
        if any(simulated not in view.series[trip] for _, trip, _ in selected):
            simulated = None
        along = Panel(
            "trip-energy",
            "Energy along the best, the median and the worst trip",
            said,
            figures.plot_trip_energy(
                view.series, selected, best, simulated=simulated, synthetic=view.synthetic
            ),
        )
    against = view.physics if view.physics != best else None
    by_trip = figures.plot_trip_errors(
        folds, best, against, note=of_evaluation(view.main), synthetic=view.synthetic
    )
    return (
        along,
        Panel("trip-errors", "Error by trip", sentences.on_trip_errors(view), by_trip),
        Panel(
            "all-trips",
            "Every trip and model",
            f"{folds['trip'].nunique()} trips.",
            tables=(tables.trips_table(view),),
            folded=True,
            wide=True,
        ),
    )


def comparison_panels(view: View) -> tuple[Panel, ...]:
    """Paired differences."""
    pairs, best = view.paired_of(view.main), view.best
    if not pairs:
        return (Panel("paired-differences", "Paired differences", "No pair of models was compared."),)
    shown = paired_with(pairs, best) or pairs
    figure = figures.plot_paired_differences(shown, note=of_evaluation(view.main), synthetic=view.synthetic)
    table = tables.paired_table(view)
    return (
        Panel(
            "paired-differences",
            "Paired differences",
            f"{sentences.on_paired(pairs, best)} A difference is significant if its interval does not contain 0; the table "
            f"has all {len(table.rows)} pairs.",
            figure,
            tables=(table,),
            folded=True,
        ),
    )


def paired_with(pairs: Sequence[Record], best: str | None) -> list[Record]:
    """The pairs that hold `best`, turned so that `best` is always `b`: a positive difference says that it is closer.

    Examples
    --------
    >>> paired_with([{"a": "boosting", "b": "forest", "diff": -0.01, "ci95": [-0.02, 0.005]}], "boosting")
    [{'a': 'forest', 'b': 'boosting', 'diff': 0.01, 'ci95': [-0.005, 0.02]}]
    """
    turned: list[Record] = []
    for pair in pairs:
        if pair["b"] == best:
            turned.append(pair)
        elif pair["a"] == best:
            low, high = pair["ci95"]
            turned.append({**pair, "a": pair["b"], "b": best, "diff": -pair["diff"], "ci95": [-high, -low]})
    return turned


def audit_panels(view: View) -> tuple[Panel, ...]:
    """Findings and sets of trips."""
    table = tables.audit_table(view)
    empty = "" if table.rows else " Every trip was used as it was logged."
    used = tables.used_table(view)
    return (
        Panel(
            "audit-findings",
            "What the audit found and did",
            f"{sentences.on_audit(view)}{empty}",
            tables=(table,) if table.rows else (),
            wide=True,
        ),
        *(
            [
                Panel(
                    "trips-used",
                    "Trips in each set",
                    "The trips of each row of the result.",
                    tables=(used,),
                    folded=True,
                    wide=True,
                )
            ]
            if used.rows
            else []
        ),
    )


def _inside(view: View) -> tuple[Panel, ...]:
    curves, importances = view.learning_curves, view.importances
    signals = tables.signals_table(view)
    made_up = view.synthetic

    def drawn(plot: Callable[..., Figure], data: object) -> Figure | None:
        return None if data is None else plot(data, synthetic=made_up)

    return (
        Panel(
            "importances",
            "Importance of the covariates",
            sentences.on_importances(importances),
            drawn(figures.plot_importances, importances),
        ),
        Panel(
            "learning-curve",
            "Learning curve",
            sentences.on_learning_curves(curves),
            drawn(figures.plot_learning_curves, curves),
        ),
        Panel(
            "signals",
            "Simulated signals against measured ones (default preset)",
            sentences.on_signals(view.signals),
            tables=(signals,) if signals else (),
            folded=True,
        ),
    )


def _running_time(view: View) -> Panel:
    title, sentence = "Running time of the correctors", running_time.on_running_time(view)
    if not running_time.timed_models(view):
        return Panel("running-time", title, sentence)
    table = running_time.running_time_table(view)
    return Panel(
        "running-time",
        title,
        sentence,
        running_time.plot_running_time(view),
        tables=(table,),
        folded=True,
    )


def _gamm(view: View) -> tuple[Panel, ...]:
    found = view.gamm
    if found is None:
        said = (
            "The model gamm was not among the models of this run, so there is no table and no figure of it."
        )
        return (Panel("gamm-summary", "Summary of the GAMM", said),)
    paper, label = bool(view.paper_mape), " (synthetic trips)" if view.synthetic else ""
    return (
        Panel(
            "gamm-summary",
            "Summary of the GAMM",
            gamm.on_summary(found, paper=paper),
            tables=(
                gamm.summary_table(found, paper=paper, label=label),
                gamm.scores_table(found, label=label),
            ),
            wide=True,
        ),
        Panel(
            "gamm-diagnosis",
            "Residuals against the fitted distribution",
            gamm.on_diagnosis(found),
            gamm_figures.plot_diagnosis(found.diagnosis, synthetic=view.synthetic),
        ),
        Panel(
            "gamm-autocorrelation",
            "Autocorrelation of the residuals",
            gamm.on_dependence(found),
            gamm_figures.plot_dependence(found.autocorrelation, found.row_step_s, synthetic=view.synthetic),
        ),
        _gamm_extrapolation(view, found, label),
        *_gamm_effects(view, found, label),
    )


def _gamm_effects(view: View, found: GammInsight, label: str) -> Iterator[Panel]:
    effects, observed_wh = found.effects, float(np.ptp(found.diagnosis.response.response))
    curves = [e for e in effects.values() if isinstance(e, CurveEffect)]
    if curves:
        drawn = gamm_figures.plot_curves(curves, observed_wh, synthetic=view.synthetic)
        yield Panel("gamm-smooths", "Effect of each covariate", gamm.on_curves(curves, observed_wh), drawn)
    # the formula has at most one surface and one random effect; each has its own file
    for surface in (e for e in effects.values() if isinstance(e, SurfaceEffect)):
        drawn = gamm_figures.plot_surface(surface, synthetic=view.synthetic)
        said = gamm.on_surface(surface, observed_wh)
        yield Panel("gamm-surface", "Joint effect of two covariates", said, drawn)
    for effect in (e for e in effects.values() if isinstance(e, RandomEffects)):
        drawn = gamm_figures.plot_random(effect, synthetic=view.synthetic)
        table = gamm.random_table(effect, label=label)
        said = gamm.on_random(effect)
        yield Panel("gamm-random", "Random effects of the trips", said, drawn, tables=(table,), folded=True)


def _gamm_extrapolation(view: View, found: GammInsight, label: str) -> Panel:
    table = gamm.outside_table(found, label=label)
    said = gamm.on_extrapolation(found, view.main.get("n_trips"))
    title = "Outside of the training data"
    return Panel("gamm-extrapolation", title, said, tables=(table,) if table.rows else (), folded=True)
