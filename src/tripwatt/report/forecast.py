"""Panels of the forecast protocol, one per claim: what is said comes from the numbers of the run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from tripwatt.report import forecast_figures as figures
from tripwatt.report.forecast_figures import GIVEN, HYBRID, PLAIN, WARM
from tripwatt.report.panels import (
    Panel,
    Section,
    audit_panels,
    comparison_panels,
    errors_panels,
    result_panels,
    trips_panels,
)
from tripwatt.report.sentences import label, listed, percent
from tripwatt.report.tables import Table, number, span
from tripwatt.report.view import Record, View, of_evaluation, plain

if TYPE_CHECKING:
    from collections.abc import Sequence

FORECAST_KEYS: Final = (
    "coverage",
    "pit",
    "widths",
    "crps",
    "updates",
    "training-size",
    "strata",
    "waterfall",
    "example",
)
"""Stems of the figures of this protocol."""
NO_HYBRID: Final = "The model hybrid was not among the models of this run, so there is nothing to show."


def forecast_sections(view: View) -> list[Section]:
    """Every section of a report of the forecast protocol."""
    return [
        Section("result", "Result", _given(result_panels(view))),
        Section("sure", "How sure", (_coverage(view), _pit(view), _widths(view), _crps(view))),
        Section("during", "During the trip", (_updates(view),)),
        Section("learning", "How much data, and which trips", (_training_size(view), _strata(view))),
        Section("why", "Why so much", (_waterfall(view), _example(view))),
        Section("errors", "Errors of every model", _given(errors_panels(view))),
        Section("trips", "Trip by trip", _given(trips_panels(view))),
        Section("comparison", "Which differences are real", _given(comparison_panels(view))),
        Section("audit", "Which trips were used, and why others were not", audit_panels(view)),
    ]


def _given(panels: Sequence[Panel]) -> tuple[Panel, ...]:
    """Accuracy is never shown without what it presumes."""
    words = f"{GIVEN[:1].upper()}{GIVEN[1:]}."
    return tuple(p if GIVEN in p.sentence else replace(p, sentence=f"{p.sentence} {words}") for p in panels)


def _hybrid(view: View) -> Record:
    found: Record = (view.main.get("models") or {}).get("hybrid") or {}
    return found


def on_forecast_table(view: View) -> str:
    """The hybrid's error, and how it stands to the other models."""
    score = _hybrid(view)
    if not score:
        return NO_HYBRID
    low, high = score["mape_ci95"]
    text = (
        f"{label('hybrid')} is off by {percent(score['mape'])} in the mean (95 % interval {100 * low:.1f} to {100 * high:.1f} %), "
        f"RMSE {number(score['rmse_wh'], 1e-3)} kWh, {GIVEN} ({of_evaluation(view.main)})"
    )
    models = view.main["models"]
    lower = [m for m in view.models if m != "hybrid" and models[m]["mape"] < score["mape"]]
    if lower:
        still = [f"{label(m)} at {percent(models[m]['mape'])}" for m in lower]
        text += f"; lower still: {listed(still)}"
    told = [
        f"{label(other)} ({'significant' if pair['significant'] else 'not told apart'})"
        for other in ("physics4", "linear6")
        for pair in view.paired_of(view.main)
        if {pair["a"], pair["b"]} == {other, "hybrid"}
    ]
    return f"{text}. Paired with {listed(told)}." if told else f"{text}."


def forecast_sentences(results: Record) -> list[str]:
    """What the forecast protocol found, in sentences for the terminal; none for another protocol.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`.
    """
    view = View(results)
    if not has_forecast(view):
        return []
    widths = _hybrid(view)["interval_width_wh"]
    width = f"Mean width at 90 %: {number(widths['0.9'], 1e-3)} kWh. " if "0.9" in widths else ""
    return [on_forecast_table(view), f"Intervals: {on_coverage(view)} {width}", on_updates(view)]


def has_forecast(view: View) -> bool:
    """Whether these are results of the forecast protocol with the hybrid among the models."""
    return view.is_forecast and "coverage" in _hybrid(view)


def on_coverage(view: View) -> str:
    """How many held-out trips lie in their intervals."""
    score = _hybrid(view)
    outside = [
        f"{100 * float(key):g} %"
        for key, (low, high) in score["coverage_ci95"].items()
        if not low <= float(key) <= high
    ]
    said = listed(
        [
            f"{percent(covered, 0)} inside at {100 * float(key):g} %"
            for key, covered in score["coverage"].items()
        ]
    )
    verdict = (
        f"the Clopper-Pearson interval leaves out the nominal level at {listed(outside)}"
        if outside
        else "every Clopper-Pearson interval holds its nominal level"
    )
    return f"{said}; {verdict}, {GIVEN} ({of_evaluation(view.main)})."


def _coverage(view: View) -> Panel:
    title, score = "Do the intervals hold what they promise?", _hybrid(view)
    if "coverage" not in score:
        return Panel("coverage", title, NO_HYBRID)
    rows = tuple(
        (
            f"{100 * float(key):g} %",
            number(covered, 100, 1),
            span(score["coverage_ci95"][key]),
            span(score["coverage_bootstrap95"][key]),
            number(score["interval_width_wh"][key], 1e-3),
        )
        for key, covered in score["coverage"].items()
    )
    columns = ("Level", "Inside [%]", "Clopper-Pearson 95 %", "Bootstrap 95 %", "Mean width [kWh]")
    return Panel(
        "coverage",
        title,
        on_coverage(view),
        figures.plot_coverage(score, note=of_evaluation(view.main), synthetic=view.synthetic),
        tables=(Table(_caption(view, "Intervals of held-out trips"), columns, rows),),
    )


def _pit(view: View) -> Panel:
    title = "Is the whole distribution honest?"
    if view.forecast is None:
        return Panel("pit", title, NO_HYBRID)
    from scipy.stats import kstest

    pit = view.forecast.trips["pit"].to_numpy(dtype=np.float64)
    found = kstest(pit, "uniform")
    verdict = "not told apart from an even spread" if found.pvalue >= 0.05 else "uneven beyond chance"
    said = (
        f"Of {len(pit)} trips {percent(float(np.mean(pit > 0.5)), 0)} took more than the median forecast; the probabilities "
        f"are {verdict} (Kolmogorov-Smirnov p = {found.pvalue:.2f}), {GIVEN}."
    )
    return Panel(
        "pit", title, said, figures.plot_pit(pit, note=of_evaluation(view.main), synthetic=view.synthetic)
    )


def _widths(view: View) -> Panel:
    title = "How wide is an interval?"
    if view.forecast is None:
        return Panel("widths", title, NO_HYBRID)
    trips = view.forecast.trips
    width = (trips["high_90"] - trips["low_90"]).to_numpy(dtype=np.float64)
    short = trips["distance_m"].to_numpy() <= np.median(trips["distance_m"])
    said = f"The 90 % interval is {number(float(width.mean()), 1e-3)} kWh wide in the mean"
    if short.any() and not short.all():
        said += (
            f": {number(float(width[short].mean()), 1e-3)} kWh on the shorter half of the trips, "
            f"{number(float(width[~short].mean()), 1e-3)} kWh on the longer"
        )
    return Panel(
        "widths",
        title,
        f"{said}, {GIVEN}.",
        figures.plot_widths(trips, note=of_evaluation(view.main), synthetic=view.synthetic),
    )


def _crps(view: View) -> Panel:
    title, score = "Is a width of its own worth it?", _hybrid(view)
    if "crps_same_width_wh" not in score:
        return Panel("crps", title, NO_HYBRID)
    models = view.main["models"]
    rows = [
        (label("hybrid"), score["crps_wh"], HYBRID),
        ("same, one width for all trips", score["crps_same_width_wh"], WARM),
        ("same, best one width in hindsight", score["crps_best_same_width_wh"], WARM),
        *(
            (f"{label(m)}, no interval", models[m]["crps_wh"], PLAIN)
            for m in ("physics4", "linear6", "boosting-only")
            if m in models
        ),
    ]
    gain = score["crps_same_width_wh"] - score["crps_wh"]
    word = "better" if gain > 0 else "worse"
    said = (
        f"CRPS {number(score['crps_wh'], 1.0, 0)} Wh; with the same mean width for every trip "
        f"{number(score['crps_same_width_wh'], 1.0, 0)} Wh, so a width of its own is {word} by "
        f"{percent(abs(gain) / score['crps_same_width_wh'])}. A forecast without an interval scores its mean absolute error; "
        f"all {GIVEN}."
    )
    return Panel(
        "crps", title, said, figures.plot_crps(rows, note=of_evaluation(view.main), synthetic=view.synthetic)
    )


def on_updates(view: View) -> str:
    """How the error of the total falls on the way, beside the baselines."""
    update = _hybrid(view)["update"]
    parts = [f"{percent(row['mape'])} after {100 * float(key):g} %" for key, row in update.items()]
    better = [f"{100 * float(k):g} %" for k, r in update.items() if r["significant"] and r["diff"] < 0]
    worse = [
        f"{100 * float(k):g} %"
        for k, r in update.items()
        if r["mape"] > min(r["no_update"], r["naive_gauge"])
    ]
    said = f"Mean error of the trip's total {listed(parts)} of its time, {GIVEN}. "
    said += (
        f"Significantly better than no update at {listed(better)}. "
        if better
        else "At no fraction significantly better than no update. "
    )
    said += (
        f"Above a baseline's mean at {listed(worse)}." if worse else "At no fraction above a baseline's mean."
    )
    return said


def updates_table(view: View) -> Table:
    """Errors and intervals of the re-forecast by the part that was driven, beside the baselines."""
    update = _hybrid(view)["update"]
    told = all("coverage" in row for row in update.values())
    rows = tuple(
        (
            f"{100 * float(key):g} %",
            number(row["mape"], 100, 1),
            span(row["mape_ci95"]),
            number(row["no_update"], 100, 1),
            number(row["diff"], 100, 2),
            span(row["diff_ci95"], 2),
            number(row["soc_only"], 100, 1),
            number(row["naive_gauge"], 100, 1),
            *((number(row["coverage"], 100, 1), number(row["interval_width_wh"], 1e-3)) if told else ()),
        )
        for key, row in update.items()
    )
    columns: tuple[str, ...] = (
        "Part driven",
        "Re-forecast [%]",
        "95 % interval",
        "No update [%]",
        "Difference [points]",
        "Its 95 % interval",
        "SoC alone [%]",
        "Gauge [%]",
        *(("Inside 90 % [%]", "Its width [kWh]") if told else ()),
    )
    return Table(_caption(view, "Mean error of the re-forecast total"), columns, rows)


def _updates(view: View) -> Panel:
    title, update = "Does a re-forecast get better on the way?", _hybrid(view).get("update")
    if not update:
        return Panel("updates", title, NO_HYBRID)
    return Panel(
        "updates",
        title,
        on_updates(view),
        figures.plot_updates(update, note=of_evaluation(view.main), synthetic=view.synthetic),
        tables=(updates_table(view),),
        wide=True,
    )


def _training_size(view: View) -> Panel:
    title, curve = "Does physics save training trips?", view.results.get("learning_curve") or []
    if not curve:
        said = "No learning curve: too few trips, or hybrid or boosting-only was not among the models."
        return Panel("training-size", title, said)
    least, most = curve[0], curve[-1]
    later = (
        f"; with {most['n_trips']} by {percent(most['hybrid'])} and {percent(most['boosting-only'])}"
        if len(curve) > 1
        else ""
    )
    said = (
        f"With {least['n_trips']} training trips {label('hybrid')} is off by {percent(least['hybrid'])} and "
        f"{label('boosting-only')} by {percent(least['boosting-only'])}{later} (means of {most['draws']} random draws, scored on all other trips, {GIVEN}). "
    )
    enough = [row["n_trips"] for row in curve if row["hybrid"] <= most["boosting-only"]]
    said += (
        f"{enough[0]} trips are enough for the hybrid to match what {label('boosting-only')} reaches with {most['n_trips']}."
        if enough
        else f"At no size does the hybrid reach what {label('boosting-only')} reaches with {most['n_trips']}."
    )
    return Panel(
        "training-size",
        title,
        said,
        figures.plot_training_size(curve, note=of_evaluation(view.main), synthetic=view.synthetic),
    )


def _strata(view: View) -> Panel:
    title, strata = "Does it hold in rare cases?", view.results.get("strata") or []
    if not strata:
        return Panel("strata", title, NO_HYBRID)
    compared = [s for s in strata if s.get("boosting-only") is not None]
    worst = max(strata, key=lambda s: s["hybrid"])
    behind = [f"{s['by']} {s['stratum']}" for s in compared if s["hybrid"] > s["boosting-only"]]
    said = f"Highest mean error of the hybrid: {percent(worst['hybrid'])} ({worst['by']} {worst['stratum']}, trips: {worst['n_trips']}). "
    if compared:
        said += (
            f"It is below {label('boosting-only')} in {len(compared) - len(behind)} of {len(compared)} strata"
        )
        said += f", not in {listed(behind)}" if behind else ""
    said += f"; {GIVEN}."
    rows = tuple(
        (
            f"{s['by']}: {s['stratum']}",
            str(s["n_trips"]),
            number(s["hybrid"], 100, 1),
            number(s.get("boosting-only"), 100, 1),
            number(s.get("diff"), 100, 1),
            span(s.get("diff_ci95")),
        )
        for s in strata
    )
    columns = ("Stratum", "Trips", "Hybrid [%]", "Data only [%]", "Difference [points]", "95 % interval")
    return Panel(
        "strata",
        title,
        said,
        figures.plot_strata(strata, note=of_evaluation(view.main), synthetic=view.synthetic),
        tables=(Table(_caption(view, "Mean error by stratum"), columns, rows),),
        folded=True,
        tall=True,
    )


def _waterfall(view: View) -> Panel:
    title, kept, selected = "What takes the energy", view.forecast, view.selected_trips()
    if kept is None or not selected:
        return Panel("waterfall", title, NO_HYBRID)
    parts = []
    for role, trip, _ in selected:
        largest = str(kept.causes.loc[trip].drop("learned_correction", errors="ignore").idxmax())
        parts.append(f"{largest.replace('_', ' ')} on the {role.lower()} trip {plain(trip)}")
    return Panel(
        "waterfall",
        title,
        f"The largest cause is {listed(parts)}. Each bar starts where the one above it ends; forecasts before departure, {GIVEN}.",
        figures.plot_waterfall(kept.causes, kept.trips, selected, synthetic=view.synthetic),
        tall=True,
    )


def _example(view: View) -> Panel:
    title, kept, selected = "One forecast along its route", view.forecast, view.selected_trips()
    if kept is None or not selected:
        return Panel("example", title, NO_HYBRID)
    role, trip, ape = next((s for s in selected if s[0] == "Median"), selected[0])
    series, log = kept.series[trip], kept.logs[trip]
    last = series.iloc[-1]
    measured = float(log["observed_energy_wh"].iloc[-1])
    inside = last["energy_low_wh"] <= measured <= last["energy_high_wh"]
    said = (
        f"The {role.lower()} trip {plain(trip)}: {number(last['energy_wh'], 1e-3)} kWh forecast before departure "
        f"({number(last['energy_low_wh'], 1e-3)} to {number(last['energy_high_wh'], 1e-3)} at 90 %), {number(measured, 1e-3)} measured, "
        f"{'inside' if inside else 'outside'} the interval, error {percent(ape)}, {GIVEN}; charge on arrival "
        f"{percent(float(last['displayed_soc']), 0)}."
    )
    return Panel("example", title, said, figures.plot_example(series, log, trip, synthetic=view.synthetic))


def _caption(view: View, text: str) -> str:
    return f"{text}, {GIVEN}{' (synthetic trips)' if view.synthetic else ''}"
