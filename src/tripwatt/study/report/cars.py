"""The report of the protocol `cars`: one page, its figure, and the files beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from matplotlib.figure import Figure

from tripwatt.files import csv_text, write_text
from tripwatt.study.report.html import write_page
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.style import legend_below, new_figure, style_context
from tripwatt.study.report.tables import Column, Table, in_percent, in_words, make_table

if TYPE_CHECKING:
    from tripwatt.study.evaluation.cars import CarsRun

Record = Mapping[str, Any]

LEARNERS: Final = {
    "population": ("Population of cars", "#0f8797", "-", 2.4),
    "one factor": ("One factor on the physics", "#d55e00", "--", 1.4),
    "by cause": ("Line by cause", "#7d6bc6", ":", 1.6),
    "constant": ("Constant Wh/km", "#7c7c7c", "-.", 1.4),
}
"""Learner -> its name on the page, and colour, line style and line width of its curve."""

SHOWN_WHOLE: Final = ("population", "one factor", "by cause")
"""Learners whose curves fit into the figure; the curve of a constant may leave it at the top."""

MAX_LETTERS: Final = 32
"""Largest number of characters in the title of a small figure: what fits above half a page."""


def write_cars(run: CarsRun, out: Path) -> None:
    """Write `results.json`, `trips.csv`, `report.html` and `figures/` into a folder, `results.json` last."""
    results = run.results
    facts = [
        ("Cars", f"{len(results['cars'])}"),
        ("Trips", f"{sum(car['trips'] for car in results['cars'])}"),
        ("Draws, seed", f"{results['draws']}, {results['seed']}"),
    ]
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    page_title, panels = "cars that nobody has seen, each from all others", cars_panels(results)
    write_page(out, "cars.html.jinja", {"": panels}, title=page_title, facts=facts, versions=versions)
    write_text(out / "trips.csv", csv_text(run.trips))
    write_text(out / "results.json", json.dumps(results, indent=1, allow_nan=False))


def cars_panels(results: Record) -> list[Panel]:
    """Return the panels of the page."""
    with style_context():
        drawn = _plot_curves(results) if any(map(_has_curve, results["cars"])) else None
    curves, *in_time = cars_tables(results)
    factors = (factors_table(results),)
    return [
        Panel("cars-curves", "Error by the number of own trips", "", drawn, (curves,)),
        Panel("cars-time", "In order of time", _ORDER, tables=(*in_time,)),
        Panel("cars-factors", "What cars have in common", _FACTORS, tables=factors),
    ]


_ORDER: Final = "Each trip is forecast before it is learned. The width that was needed is twice the 90 % quantile of the relative error."
_FACTORS: Final = (
    "Mean over cars and spread between cars of each factor by which a car differs from its simulation, from the cars of the package. "
    "The assumed spread counts as the given degrees of freedom."
)


def cars_tables(results: Record) -> tuple[Table, ...]:
    """Return the tables of the page."""
    return curves_table(results), time_table(results), means_table(results)


def curves_table(results: Record) -> Table:
    """Tabulate the error by the number of own trips, one row for each car and learner."""
    counts = sorted({row["k"] for car in results["cars"] for row in car["curves"]["population"]})
    rows = [
        {
            "label": f"{car['car']}: {label[:1].lower()}{label[1:]}",
            **{f"{row['k']}": row["error"] for row in car["curves"][name]},
        }
        for car in results["cars"]
        for name, (label, *_) in LEARNERS.items()
        if car["curves"][name]
    ]
    columns = (in_percent(f"{k}", f"{k}") for k in counts)
    return make_table(
        "Error [%] by the number of own trips", rows, Column("Car and model", "label"), *columns
    )


def time_table(results: Record) -> Table:
    """Tabulate error, coverage and width of the forecasts in order of time."""
    rows = [
        {"label": f"{car['car']}, from trip {score['from'] + 1}", **score}
        for car in results["cars"]
        for score in car["in_time"]
    ]
    return make_table(
        "In order of time, each trip forecast before it is learned",
        rows,
        Column("Car", "label"),
        Column("Trips", "trips", digits=0),
        in_percent("Error [%]", "error"),
        in_percent("Bias [%]", "bias"),
        in_percent("Inside 90 % [%]", "coverage", 0),
        in_percent("Clopper-Pearson 95 %", "coverage_ci95", 0),
        in_percent("Power at 75 % [%]", "power", 0),
        in_percent("Width [%]", "width", 0),
        in_percent("Width needed [%]", "needed", 0),
    )


def means_table(results: Record) -> Table:
    """Tabulate the errors of each car without own trips, with its own model, and from the dynamometer."""
    return make_table(
        "Each car without own trips, and its own model fitted to the first half of its trips",
        results["cars"],
        Column("Car", lambda car: f"{car['car']}: {car['vehicle_title']}"),
        Column("Trips", "trips", digits=0),
        in_percent("Physics [%]", lambda car: car["physics"]["error"]),
        in_percent("No own trip [%]", lambda car: car["curves"]["population"][0]["error"]),
        in_percent("Inside 90 % [%]", lambda car: car["without_trips"]["coverage"], 0),
        Column("Mean error over its sd", "mean_error_over_sd"),
        in_percent("Own model [%]", lambda car: (car.get("own_model") or {}).get("error")),
        in_percent("From the dynamometer [%]", lambda car: car.get("lab_to_road", {}).get("error")),
    )


def factors_table(results: Record) -> Table:
    """Tabulate mean and spread of each factor over the cars of the package."""
    return make_table(
        "Factors by which cars differ from their simulation",
        results["factors"],
        Column("Factor", lambda row: row["factor"].replace("_", " ")),
        in_words("Unit", "unit"),
        Column("Mean", "mean"),
        Column("± mean", "mean_sd"),
        Column("Spread between cars", "car_sd"),
        Column("Between models before", "models_sd", digits=3),
        Column("Degrees of freedom", "models_df", digits=0),
        Column("Between vehicles before", "vehicles_sd", digits=3),
        Column("Degrees of freedom", "vehicles_df", digits=0),
        in_words("Source", "source"),
    )


def _plot_curves(results: Record) -> Figure:
    """Draw the error by the number of own trips, one panel for each car."""
    cars = [car for car in results["cars"] if _has_curve(car)]
    rows = (len(cars) + 1) // 2
    figure = new_figure(2.6 * rows, "Error by own trips", "given the driven speed trace", False)
    for number, car in enumerate(cars):
        axes = figure.add_subplot(rows, 2, number + 1)
        counts = [row["k"] for row in car["curves"]["population"]]
        for name, (label, colour, line, width) in reversed(LEARNERS.items()):
            style: dict[str, Any] = {"color": colour, "ls": line, "lw": width, "marker": "o", "ms": 4}
            points = [(counts.index(row["k"]), 100.0 * row["error"]) for row in car["curves"][name]]
            axes.plot(*zip(*points, strict=True), label=label, gid=f"{car['car']}-{name}", **style)
        if car.get("own_model"):
            own_error = 100.0 * car["own_model"]["error"]
            axes.axhline(own_error, color="#7c7c7c", lw=1.0, label="Own model, all trips of the first half")
        axes.set_title(f"{car['car']}: {car['vehicle_title']}"[:MAX_LETTERS], fontsize=8.0)
        axes.set_xticks(range(len(counts)), [f"{k}" for k in counts])
        largest = max(row["error"] for name in SHOWN_WHOLE for row in car["curves"][name])
        ends = {"xlim": (-0.3, len(counts) - 0.7), "ylim": (0.0, 115.0 * float(largest))}
        axes.set(xlabel="own trips", ylabel="error [%]", **ends)
        axes.grid(axis="y")
    labelled = (zip(*axes.get_legend_handles_labels(), strict=True) for axes in figure.axes)
    lines = {text: handle for pairs in labelled for handle, text in pairs}
    return legend_below(figure, 2, handles=list(lines.values()), labels=list(lines))


def _has_curve(car: Record) -> bool:
    return len(car["curves"]["population"]) > 1
