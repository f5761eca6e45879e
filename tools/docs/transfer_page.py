"""The paper's correctors on another vehicle: tables and figure from the results of `python -m benchmarks.transfer`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from tools.docs.tables import markdown
from tripwatt.study.report.style import legend_below, new_figure, style_context
from tripwatt.study.report.tables import DASH, Column, Table, in_percent, make_table, number

Record = Mapping[str, Any]
OWN: Final = (0, 5, 20)
CORRECTORS: Final = {"gamm": "GAMM", "forest": "forest", "boosting": "boosting"}
WITHOUT: Final = tuple(f"{name}-without-physics" for name in CORRECTORS)
KINDS: Final = {
    "physics": ("Physics alone", ("physics",), False, "#7c7c7c"),
    "population": ("Population", ("population",), False, "#0f8797"),
    "transferred": ("Corrector of another vehicle", tuple(CORRECTORS), True, "#d55e00"),
    "own": ("Corrector of own trips", tuple(CORRECTORS), False, "#2f6fb5"),
    "without": ("Without physics", WITHOUT, True, "#7d6bc6"),
}
"""Kind -> its name, its models, whether they have a source, and the colour of its line."""


def rows_of(results: Record, models: Sequence[str], own: int, transferred: bool) -> list[Record]:
    """The rows of some models with so many own trips, with a source or without one."""
    return [
        row
        for row in results["rows"]
        if row["model"] in models and row["own"] == own and bool(row["source"]) == transferred
    ]


def text_of(results: Record) -> str:
    """The part of the page."""
    return "\n\n".join((sentences(results), *map(markdown, (median_table(results), pairs_table(results)))))


def against_physics(rows: Sequence[Record]) -> str:
    """How many rows are better and worse than the physics alone beyond chance, and how many there are."""
    better = sum(row["differs"] and row["less_physics"] < 0.0 for row in rows)
    worse = sum(row["differs"] and row["less_physics"] > 0.0 for row in rows)
    return f"{better}/{worse}/{len(rows)}"


def median(rows: Sequence[Record]) -> float | None:
    """The median of the mean errors; None for no rows."""
    return float(np.median([row["mape"] for row in rows])) if rows else None


def sentences(results: Record) -> str:
    """What the figures show."""

    def median_of(kind: str, own: int) -> str:
        _, models, transferred, _ = KINDS[kind]
        return number(median(rows_of(results, models, own, transferred)), 100, 1)

    transferred = rows_of(results, tuple(CORRECTORS), 0, True)
    lower = sum(row["less_physics"] < 0.0 for row in transferred)
    worst = max(transferred, key=lambda row: row["mape"])
    better_alone = [target for target in targets_of(results) if not gains(results, target)]
    return (
        f"Without own trips a transferred corrector errs by {median_of('transferred', 0)} % in the median, the physics of the target alone by "
        f"{median_of('physics', 0)} %, the population by {median_of('population', 0)} %, and the learners without physics by {median_of('without', 0)} %. "
        f"It is better than the physics alone in {lower} of {len(transferred)} cases; the worst is the {CORRECTORS[worst['model']]} of "
        f"{worst['source']} on {worst['target']}, {number(worst['mape'], 100, 1)} %. With 20 own trips the medians are "
        f"{median_of('transferred', 20)}, {median_of('physics', 20)}, {median_of('population', 20)} and {median_of('without', 20)} %, and "
        f"{median_of('own', 20)} % for correctors of own trips alone. The physics alone beats the median corrector at every number of "
        f"own trips on: {', '.join(better_alone) or 'no target'}."
    )


def targets_of(results: Record) -> list[str]:
    """The scored vehicles."""
    return sorted({row["target"] for row in results["rows"]})


def gains(results: Record, target: str) -> bool:
    """Whether the median transferred corrector has a lower error than the physics alone with some number of own trips."""
    differences = (
        [r["less_physics"] for r in rows_of(results, tuple(CORRECTORS), own, True) if r["target"] == target]
        for own in OWN
    )
    return any(np.median(values) < 0.0 for values in differences if values)


def median_table(results: Record) -> Table:
    """The median over pairs, or over targets, of each model."""
    rows = []
    for name, models, transferred, _ in KINDS.values():
        for model in models:
            by_own = {own: rows_of(results, (model,), own, transferred) for own in OWN}
            label = name if len(models) == 1 else f"{name}: {CORRECTORS[model.partition('-')[0]]}"
            medians = {f"{own}": median(rows_of_own) for own, rows_of_own in by_own.items()}
            counts = {f"n{own}": against_physics(by_own[own]) for own in (0, 20) if by_own[own]}
            rows.append({"label": label, **medians, **({} if model == "physics" else counts)})
    return make_table(
        "Mean absolute percentage error by own trips, median over pairs or targets; 20: without the Twizy. Better and worse than the physics: by the 95 % interval, not corrected for their number",
        rows,
        Column("Model", "label"),
        *(in_percent(f"{own}", f"{own}") for own in OWN),
        Column("0: better/worse/all", lambda row: row.get("n0", DASH)),
        Column("20", lambda row: row.get("n20", DASH)),
    )


def pairs_table(results: Record) -> Table:
    """Each pair: the errors of the physics and of the three correctors, without own trips with their intervals."""
    pairs = sorted({(row["target"], row["source"]) for row in results["rows"] if row["source"]})
    by_key = {(r["target"], r["source"], r["own"], r["model"]): r for r in results["rows"]}

    def cells(pair: tuple[str, str]) -> Iterator[tuple[str, str]]:
        for model in CORRECTORS:
            first, *later = (by_key.get((*pair, own, model), {}) for own in OWN)
            low, high = (number(end, 100, 1) for end in first.get("mape_ci95", (None, None)))
            rest = "/".join(number(row.get("mape"), 100, 1) for row in later)
            yield model, f"{number(first.get('mape'), 100, 1)} ({low}–{high}) {rest}"

    rows = [
        {
            "pair": f"{pair[1]}→{pair[0]}",
            "physics": number(by_key[(*pair, 0, "physics")]["mape"], 100, 1),
            **dict(cells(pair)),
        }
        for pair in pairs
    ]
    heads = (("Physics", "physics"), *((f"{name}: 0 (95 %) 5/20", key) for key, name in CORRECTORS.items()))
    return make_table(
        "Each pair, error [%] by own trips; intervals draw days, or trips without a date",
        rows,
        Column("Source→target", "pair"),
        *(Column(head, key) for head, key in heads),
    )


def figure_of(results: Record) -> Figure:
    """Error against own trips by kind of model, a panel for each target."""
    targets = targets_of(results)
    with style_context():
        figure = new_figure(
            2.7 * ((len(targets) + 1) // 2),
            "The correctors of another vehicle",
            "median over learners and sources; the band is from the lowest to the highest",
            False,
        )
        for number_of_panel, target in enumerate(targets, start=1):
            axes = figure.add_subplot((len(targets) + 1) // 2, 2, number_of_panel)
            for name, models, transferred, colour in KINDS.values():
                errors = {
                    place: [
                        100.0 * r["mape"]
                        for r in rows_of(results, models, own, transferred)
                        if r["target"] == target
                    ]
                    for place, own in enumerate(OWN)
                }
                places = [place for place, values in errors.items() if values]
                low, middle, high = np.transpose([np.quantile(errors[p], (0.0, 0.5, 1.0)) for p in places])
                axes.plot(places, middle, "o-", color=colour, label=name, ms=4)
                axes.fill_between(places, low, high, color=colour, alpha=0.18, lw=0.0)
            axes.set_title(f"{target}: {results['cars'][target]}"[:32], fontsize=8.0)
            axes.set(yscale="log", ylabel="mean error [%]", xlabel="own trips [number]", xlim=(-0.2, 2.2))
            axes.set_xticks(range(len(OWN)), [f"{own}" for own in OWN])
            axes.yaxis.set_major_locator(FixedLocator([5, 10, 20, 50, 100, 200, 500]))
            axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.yaxis.set_minor_locator(NullLocator())
            axes.grid(axis="y")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        return legend_below(figure, 1, handles=handles, labels=labels)
