"""What each panel shows, in one sentence that is made from its numbers: nothing here is a typed result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from tripwatt.report.figures import curve_models, lowest_round, mean_importances
from tripwatt.report.models import PAPER, PAPER_CAR, PAPER_IMPROVED, PAPER_TRIPS, covariate_words, model_style
from tripwatt.report.view import Record, View, absolute_errors, named_evaluation, of_evaluation, plain


def percent(fraction: float | None, digits: int = 1) -> str:
    r"""A fraction as percent; a dash when unknown.

    Examples
    --------
    >>> percent(0.1034)
    '10.3\xa0%'
    """
    return "–" if fraction is None or not np.isfinite(fraction) else f"{100 * fraction:.{digits}f}\u00a0%"


def points(difference: float) -> str:
    """A difference of two fractions as signed percentage points.

    Examples
    --------
    >>> points(-0.0123)
    '−1.2 points'
    >>> points(-0.0004)
    '0.0 points'
    """
    sign = "" if abs(difference) < 0.0005 else "−" if difference < 0 else "+"
    return f"{sign}{abs(100 * difference):.1f} points"


def label(model: str) -> str:
    """A model's name inside a sentence."""
    return plain(model_style(model).label)


def listed(items: Sequence[str]) -> str:
    """Items in a row, with an `and`.

    Examples
    --------
    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else "none"


def interval(score: Record) -> str:
    """The 95 % interval of a mean APE in words, empty when there is none."""
    low, high = score.get("mape_ci95") or (None, None)
    return "" if low is None or high is None else f" (95 % interval {100 * low:.1f} to {100 * high:.1f} %)"


def on_main_table(view: View) -> str:
    """Best hybrid against physics alone in the main evaluation."""
    best = view.best
    if best is None:
        return "No model was evaluated."
    models = view.main["models"]
    text = "Of the hybrids, " if model_style(best).kind == "hybrid" else ""
    text += (
        f"{label(best)} has the lowest mean error: {percent(models[best]['mape'])}{interval(models[best])}"
    )
    if view.physics and view.physics != best:
        text += f". The mean error of {label(view.physics)} alone is {percent(models[view.physics]['mape'])}"
    lower = [m for m in view.models if m != best and (models[m].get("mape") or np.inf) < models[best]["mape"]]
    if lower:
        below = [f"{label(m)} ({percent(models[m]['mape'])})" for m in lower]
        text += f". Models of another kind with a lower mean error: {listed(below)}"
    return f"{text}. Folds and trips: {of_evaluation(view.main)}."


def on_paper(view: View) -> str:
    """Our means beside the paper's, or why they do not stand there."""
    paper = view.paper_mape
    if not paper:
        what = "made-up trips" if view.synthetic else "other trips"
        return (
            f"The paper's figures are those of its TUM trips; these are {what}, so its figures are not shown."
        )
    models = view.main.get("models") or {}
    parts = [
        f"{label(m)} {percent(models[m]['mape'])} ({percent(paper[m])} in the paper, {points(models[m]['mape'] - paper[m])})"
        for m in view.models
        if m in paper
    ]
    text = f"Beside {PAPER}: {'; '.join(parts)}." if parts else f"No model here has a figure in {PAPER}."
    shares = [
        f"{label(m)} {percent(models[m]['improved_share']['physics-paper'], 0)}"
        for m in view.models
        if m in paper
        and (models[m].get("improved_share") or {}).get("physics-paper") is not None
        and m != "physics-paper"
    ]
    if shares:
        text += f" Share of trips improved over the paper preset: {listed(shares)}; the paper says {PAPER_IMPROVED}."
    return text


def on_physics_gap(view: View) -> str:
    """Why our simulation of the paper's car is not at the paper's error; empty on other trips or another car."""
    ours = (view.main.get("models") or {}).get("physics-paper")
    its_car = str(view.results.get("vehicle") or PAPER_CAR) == PAPER_CAR
    if not ours or not its_car or "physics-paper" not in view.paper_mape:
        return ""
    return (
        f"Why the mean error of {label('physics-paper')} is {percent(ours['mape'])} and that of the paper's physics "
        f"{percent(view.paper_mape['physics-paper'])}: the paper names no parameter of its MATLAB car (mass, drag, rolling "
        "resistance, efficiencies, auxiliaries), so ours takes measured coast-down values and a drivetrain from named sources. "
        "Both leave out the climate and take back 50 % of the braking energy. "
        f"The paper scored {PAPER_TRIPS} trips, this table {view.main.get('n_trips', 'another number')}."
    )


def on_intervals(view: View) -> str:
    """Which models' intervals lie wholly above the best hybrid's."""
    models = view.main.get("models") or {}
    best = view.best
    bounds = {m: models[m]["mape_ci95"] for m in view.models if models[m].get("mape_ci95")}
    if best not in bounds:
        return "No interval is known."
    top = bounds[best][1]
    above = [label(m) for m in bounds if m != best and bounds[m][0] > top]
    rest = len(bounds) - 1 - len(above)
    text = f"The 95 % interval of {label(str(best))} ends at {percent(top)}. "
    text += f"Entirely above it: {listed(above)}" if above else "No other interval lies entirely above it"
    return (
        f"{text}; {rest} of the other {len(bounds) - 1} intervals overlap it. The paired differences below compare the "
        "models trip by trip and detect smaller differences."
    )


def on_sets(view: View) -> str:
    """How the best model's error moves with the choice of trips and with days left out whole."""
    best = view.best
    found = [e for e in view.evaluations if best in (e.get("models") or {})]
    if best is None or not found:
        return "No model was evaluated."
    parts = [f"{percent(e['models'][best]['mape'])} ({named_evaluation(e)})" for e in found]
    return f"{label(best)}: {'; '.join(parts)}."


def without_days(view: View) -> str:
    """Why there is no leave-one-day-out evaluation; empty when there is one."""
    if any(e.get("scheme") == "leave_one_day_out" for e in view.evaluations):
        return ""
    said = _reason(view.results.get("skipped"), "leave_one_day_out")
    noted = next((str(n) for n in view.results.get("notes") or () if "leave-one-day-out" in str(n)), "")
    reason = said or noted.partition(":")[2].strip().rstrip(".") or "the run does not say why"
    return f"Leave one day out was not run: {reason}."


def _reason(skipped: object, key: str) -> str:
    """What `results['skipped']` says of `key`, whichever shape it has."""
    if isinstance(skipped, Mapping):
        return str(skipped.get(key) or "").rstrip(".")
    if isinstance(skipped, Sequence) and not isinstance(skipped, str):
        for item in skipped:
            if isinstance(item, Mapping) and key in map(str, item.values()):
                return str(item.get("reason") or item.get("why") or "").rstrip(".")
            if isinstance(item, str) and key in item:
                return item.rstrip(".")
    return ""


def on_distribution(view: View) -> str:
    """Half of the trips lie within what, how many are off by more than a fifth."""
    wide = absolute_errors(view.folds_of(view.main))
    if view.best is None or view.best not in wide:
        return "No fold is known."
    errors = wide[view.best].dropna()
    far = int((errors > 0.2).sum())
    text = (
        f"With {label(view.best)}, half of the trips have an error below {percent(float(errors.median()))}, "
        f"and {far} of {len(errors)} have an error above 20 %"
    )
    if view.physics in wide and view.physics != view.best:
        text += f"; with {label(str(view.physics))}, {int((wide[view.physics] > 0.2).sum())} have"
    return f"{text}."


def on_boxes(view: View) -> str:
    """Where the middle half of the errors lies."""
    wide = absolute_errors(view.folds_of(view.main))
    names = [m for m in (view.best, view.physics) if m is not None and m in wide]
    parts = []
    for model in dict.fromkeys(names):
        low, high = wide[model].quantile([0.25, 0.75])
        parts.append(f"{100 * low:.1f} to {100 * high:.1f}\u00a0% with {label(model)}")
    return f"The middle half of the errors is {listed(parts)}." if parts else "No fold is known."


def on_benchmark(view: View, models: Sequence[str]) -> str:
    """What the simulation is worth to boosting."""
    wide = absolute_errors(view.folds_of(view.main))
    if not {"boosting", "boosting-only"} <= set(models):
        return "The benchmark needs boosting with and without physics; this run lacks one of them."
    both = wide[["boosting", "boosting-only"]].dropna()
    closer = float((both["boosting"] < both["boosting-only"]).mean())
    means = both.mean()
    gap = means["boosting-only"] - means["boosting"]
    word = "higher" if gap > 0 else "lower"
    return (
        f"Without the simulation, the mean error of the same boosting is {percent(means['boosting-only'])} instead of "
        f"{percent(means['boosting'])}, {abs(100 * gap):.1f} percentage points {word}. With the simulation the error is smaller "
        f"on {percent(closer, 0)} of the trips."
    )


def on_trip_energy(selected: Sequence[tuple[str, str, float]], model: str) -> str:
    """The trips shown and their errors."""
    parts = [f"{percent(ape)} on the {role.lower()} trip ({plain(trip)})" for role, trip, ape in selected]
    return f"The error of {label(model)} at the end of the trip is {listed(parts)}."


def on_trip_errors(view: View) -> str:
    """On how many trips the best model is closer than the physics, and where it is worst."""
    wide = absolute_errors(view.folds_of(view.main))
    if view.best is None or view.best not in wide:
        return "No fold is known."
    worst = wide[view.best].idxmax()
    largest = f"{percent(float(wide[view.best].max()))}, on trip {plain(worst)}"
    if view.physics in wide and view.physics != view.best:
        both = wide[[view.best, view.physics]].dropna()
        closer = int((both[view.best] < both[view.physics]).sum())
        return (
            f"{label(view.best)} has a smaller error than {label(str(view.physics))} on {closer} of {len(both)} trips "
            f"({percent(closer / len(both), 0)}). Its largest error is {largest}."
        )
    return f"The largest error of {label(view.best)} is {largest}."


def in_words(pair: Record) -> str:
    """The result of one paired comparison.

    Examples
    --------
    >>> in_words({"a": "forest", "b": "boosting", "diff": 0.01, "ci95": [-0.01, 0.02]})
    'no significant difference'
    """
    low, high = pair["ci95"]
    if low > 0 or high < 0:
        better, worse = (pair["b"], pair["a"]) if pair["diff"] > 0 else (pair["a"], pair["b"])
        return f"{label(str(better))} has a significantly lower error than {label(str(worse))}"
    return "no significant difference"


def compared(pairs: Sequence[Record], model: str, others: Sequence[str]) -> str:
    """How the mean error of a model compares with that of others, from paired differences; empty without any.

    Examples
    --------
    >>> pair = {"a": "physics4", "b": "hybrid", "diff": 0.0149, "ci95": [0.004, 0.026]}
    >>> compared([pair], "hybrid", ["physics4"])
    'Its mean error is 1.5 percentage points lower than that of Physics + 4 coefficients (95 % interval 0.4 to 2.6).'
    """
    parts = [
        _difference(pair, model, other)
        for other in others
        for pair in pairs
        if {pair["a"], pair["b"]} == {model, other}
    ]
    return f"Its mean error {listed(parts)}." if parts else ""


def _difference(pair: Record, model: str, other: str) -> str:
    """The end of a sentence on one pair, as seen from `model`."""
    sign = 1.0 if pair["a"] == model else -1.0
    low, high = sorted(sign * float(end) for end in pair["ci95"])
    difference = sign * float(pair["diff"])
    if low <= 0.0 <= high:
        bounds = f"{points(difference)}, 95 % interval {points(low)} to {points(high)}".replace(
            " points to", " to"
        )
        return f"is not significantly different from that of {label(other)} ({bounds})"
    word = "lower" if difference < 0 else "higher"
    ends = sorted((abs(low), abs(high)))
    return (
        f"is {abs(100 * difference):.1f} percentage points {word} than that of {label(other)} "
        f"(95 % interval {100 * ends[0]:.1f} to {100 * ends[1]:.1f})"
    )


def on_paired(pairs: Sequence[Record], best: str | None) -> str:
    """Which models the best one beats beyond chance, and which it does not."""
    beaten: list[str] = []
    equal: list[str] = []
    above: list[str] = []
    for pair in pairs:
        if best not in (pair["a"], pair["b"]):
            continue
        other = str(pair["b"] if pair["a"] == best else pair["a"])
        low, high = pair["ci95"]
        side = 1.0 if pair["b"] == best else -1.0
        (equal if low <= 0 <= high else beaten if side * pair["diff"] > 0 else above).append(label(other))
    if best is None or not (beaten or equal or above):
        return "No pair of models was compared."
    parts = []
    if beaten:
        parts.append(f"significantly lower than that of {listed(beaten)}")
    if equal:
        parts.append(f"not significantly different from that of {listed(equal)}")
    if above:
        parts.append(f"significantly higher than that of {listed(above)}")
    return f"The mean error of {label(best)} is {'; '.join(parts)}."


def on_signals(signals: pd.DataFrame | None) -> str:
    """Median root mean square errors of the simulated signals."""
    if signals is None:
        return "No comparison of signals: none of these trips has a measured current, voltage, battery temperature or SoC."
    units = {
        "current_rmse_a": ("current", 1.0, "A"),
        "voltage_rmse_v": ("voltage", 1.0, "V"),
        "battery_temperature_rmse_degc": ("battery temperature", 1.0, "°C"),
        "soc_rmse": ("SoC", 100.0, "points"),
    }
    parts = [
        f"{name} {factor * float(signals[column].median()):.2g} {unit}"
        for column, (name, factor, unit) in units.items()
        if column in signals and signals[column].notna().any()
    ]
    return f"Median RMSE of {len(signals)} trips, simulated against measured: {listed(parts)}."


def on_importances(importances: pd.DataFrame | None) -> str:
    """The two most important covariates of each corrector."""
    if importances is None:
        return "No importances: this run has no corrector that reports them."
    mean = mean_importances(importances)
    parts = []
    for model, rows in mean.groupby("model", sort=False, observed=True):
        first = rows.sort_values("importance", ascending=False, kind="stable")["covariate"].head(2)
        parts.append(f"{listed([plain(covariate_words(str(c))) for c in first])} for {label(str(model))}")
    return f"The most important covariates are {'; '.join(parts)}."


def on_learning_curves(curves: pd.DataFrame | None) -> str:
    """Where the mean curve of each model is lowest."""
    if curves is None:
        return "No learning curve: this run has no boosting with a curve."
    parts = []
    for model, part in curve_models(curves).items():
        lowest = lowest_round(part)
        each = part.loc[part.groupby("fold", observed=True)["error"].idxmin(), "rounds"]
        parts.append(
            f"at {lowest} rounds for {label(model)} (mean of {part['fold'].nunique()} folds; in the single folds between "
            f"{int(each.min())} and {int(each.max())})"
        )
    return f"The error on left-out training trips is lowest {' and '.join(parts)}."


def on_audit(view: View) -> str:
    """How many trips were read, how many each set uses, what the audit did."""
    used = view.results.get("trips_used") or {}
    counts = {
        e["trips"]: e.get("n_trips") for e in view.evaluations if e.get("scheme") == "leave_one_trip_out"
    }
    counts.update({name: len(ids) for name, ids in used.items()})
    words = {"reference": "the reference set", "audited": "the audited set", "all": "the unaudited set"}
    parts = [f"{words.get(name, name)} has {number} trips" for name, number in counts.items()]
    audit = view.results.get("audit") or ()
    done: dict[str, set[str]] = {}
    for finding in audit:
        done.setdefault(str(finding.get("consequence") or "noted"), set()).add(str(finding.get("trip")))
    tally = listed([f"{len(trips)} {what}" for what, trips in sorted(done.items())])
    found = f"the audit has {len(audit)} findings (trips: {tally})" if audit else "the audit has no findings"
    read = view.results.get("trips_read")
    texts = [*([f"{len(read)} trips were read"] if read else []), found, *([listed(parts)] if parts else [])]
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in texts)
