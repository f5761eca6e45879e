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
from tripwatt.report.sentences import compared, label, listed, percent
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
        Section("sure", "Uncertainty", (_coverage(view), _pit(view), _widths(view), _crps(view))),
        Section("during", "During the trip", (_updates(view),)),
        Section(
            "learning", "Amount of training data, and kinds of trips", (_training_size(view), _strata(view))
        ),
        Section("why", "Energy by cause", (_waterfall(view), _example(view))),
        Section("errors", "Errors of every model", _given(errors_panels(view))),
        Section("trips", "Trip by trip", _given(trips_panels(view))),
        Section("comparison", "Differences between the models", _given(comparison_panels(view))),
        Section("audit", "Trips that were used, and reasons why others were not", audit_panels(view)),
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
        f"The mean error of the {label('hybrid').lower()} is {percent(score['mape'])} (95 % interval {100 * low:.1f} to "
        f"{100 * high:.1f} %), its RMSE {number(score['rmse_wh'], 1e-3)} kWh ({of_evaluation(view.main)}, {GIVEN})."
    )
    models = view.main["models"]
    lower = [m for m in view.models if m != "hybrid" and models[m]["mape"] < score["mape"]]
    if lower:
        below = [f"{label(m)} ({percent(models[m]['mape'])})" for m in lower]
        text += f" Models with a lower mean error: {listed(below)}."
    return " ".join(
        filter(None, [text, compared(view.paired_of(view.main), "hybrid", ("physics4", "linear6"))])
    )


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
    width = (
        f" The mean width of the 90 % interval is {number(widths['0.9'], 1e-3)} kWh."
        if "0.9" in widths
        else ""
    )
    return [on_forecast_table(view), f"{on_coverage(view)}{width}", on_updates(view)]


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
    levels = listed([f"{100 * float(key):g}" for key in score["coverage"]])
    shares = listed([f"{100 * covered:.0f}" for covered in score["coverage"].values()])
    verdict = (
        f"the share differs significantly from the nominal level at {listed(outside)}"
        if outside
        else "no share differs significantly from its nominal level"
    )
    return (
        f"The intervals of {levels} % contain the measured energy of {shares} % of the trips; {verdict} (Clopper-Pearson, 95 %; {of_evaluation(view.main)}, "
        f"{GIVEN})."
    )


def _coverage(view: View) -> Panel:
    title, score = "Coverage of the intervals", _hybrid(view)
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
    title = "Calibration of the whole distribution"
    if view.forecast is None:
        return Panel("pit", title, NO_HYBRID)
    from scipy.stats import kstest

    pit = view.forecast.trips["pit"].to_numpy(dtype=np.float64)
    found = kstest(pit, "uniform")
    verdict = "do not differ" if found.pvalue >= 0.05 else "differ"
    said = (
        f"Of {len(pit)} trips, {percent(float(np.mean(pit > 0.5)), 0)} took more energy than the median of their forecast. The "
        f"values {verdict} significantly from a uniform distribution (Kolmogorov-Smirnov, p = {found.pvalue:.2f}), {GIVEN}."
    )
    return Panel(
        "pit", title, said, figures.plot_pit(pit, note=of_evaluation(view.main), synthetic=view.synthetic)
    )


def _widths(view: View) -> Panel:
    title = "Width of the intervals"
    if view.forecast is None:
        return Panel("widths", title, NO_HYBRID)
    trips = view.forecast.trips
    width = (trips["high_90"] - trips["low_90"]).to_numpy(dtype=np.float64)
    short = trips["distance_m"].to_numpy() <= np.median(trips["distance_m"])
    said = f"The mean width of the 90 % interval is {number(float(width.mean()), 1e-3)} kWh"
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
    title, score = "Gain from an interval width for each trip", _hybrid(view)
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
    word = "lower" if gain > 0 else "higher"
    said = (
        f"The mean CRPS is {number(score['crps_wh'], 1.0, 0)} Wh with a width for each trip, "
        f"{percent(abs(gain) / score['crps_same_width_wh'])} {word} than with the mean width for every trip "
        f"({number(score['crps_same_width_wh'], 1.0, 0)} Wh). The CRPS of a forecast without an interval is its mean absolute "
        f"error; all {GIVEN}."
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
    said = f"The mean error of the trip's total is {listed(parts)} of its time, {GIVEN}. "
    said += (
        f"It is significantly lower than without an update after {listed(better)}. "
        if better
        else "At no time is it significantly lower than without an update. "
    )
    said += (
        f"It is higher than that of a baseline after {listed(worse)}."
        if worse
        else "At no time is it higher than that of a baseline."
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
    title, update = "Error of the forecast during the trip", _hybrid(view).get("update")
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
    title, curve = "Error by the number of training trips", view.results.get("learning_curve") or []
    if not curve:
        said = "No learning curve: too few trips, or hybrid or boosting-only was not among the models."
        return Panel("training-size", title, said)
    least, most = curve[0], curve[-1]
    later = (
        f"; with {most['n_trips']} they are {percent(most['hybrid'])} and {percent(most['boosting-only'])}"
        if len(curve) > 1
        else ""
    )
    said = (
        f"With {least['n_trips']} training trips the mean error of {label('hybrid')} is {percent(least['hybrid'])} and that of "
        f"{label('boosting-only')} {percent(least['boosting-only'])}{later} (means of {most['draws']} random draws, scored on all other trips, {GIVEN}). "
    )
    enough = [row["n_trips"] for row in curve if row["hybrid"] <= most["boosting-only"]]
    said += (
        f"The hybrid needs {enough[0]} trips for the error that {label('boosting-only')} has with {most['n_trips']}."
        if enough
        else f"At no number of trips is the error of the hybrid as low as that of {label('boosting-only')} with {most['n_trips']}."
    )
    return Panel(
        "training-size",
        title,
        said,
        figures.plot_training_size(curve, note=of_evaluation(view.main), synthetic=view.synthetic),
    )


def _strata(view: View) -> Panel:
    title, strata = "Error by kind of trip", view.results.get("strata") or []
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
    )


def _waterfall(view: View) -> Panel:
    title, kept, selected = "Energy by cause", view.forecast, view.selected_trips()
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
