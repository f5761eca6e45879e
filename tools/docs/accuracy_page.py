"""The page of accuracy, its figure, and the line of the README: from `outside.json` and the published scores of trips."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from tools import DOCS, ROOT
from tools.docs import pages
from tools.docs.before_page import DRIVEN, ELSEWHERE, PLANNED
from tools.docs.tables import markdown
from tripwatt.study.report.html import png_bytes
from tripwatt.study.report.style import INK, percent_axis, style_context
from tripwatt.study.report.tables import Column, Table, in_percent, make_table, number, span

Record = Mapping[str, Any]

PAGE: Final = "explanation/accuracy.md"
FIGURE: Final = DOCS / "images" / "accuracy.png"
BUILT_ON: Final = "tum"
"""The set whose logs the physics was built on: no unseen car."""
WITHOUT: Final = ("o", "none")
IN_TIME: Final = ("v", "#0f8797")
PLANNED_ROAD: Final = ("^", "#7d6bc6")
RULE: Final = "#d0d7de"
SETS: Final = {
    "tum": "BMW i3",
    "sedan": "Model 3",
    "twizy": "Twizy",
    "ved-10": "Leaf, VED 10",
    "ved-541": "Leaf, VED 541",
}
KNOWN: Final = {
    PLANNED: "Twizy, times of its other trips",
    ELSEWHERE: "Twizy, times of another car",
    DRIVEN: "Twizy, driven trace",
    "1000 m": "BMW i3, links of 1 km, driven times",
    "free flow": "BMW i3, links, speeds of free flow",
}
"""What is known of a trip -> its row; the BMW i3 with links cut from the scored drive."""


def published(name: str) -> Any:
    """A file of docs/results."""
    return json.loads((DOCS / "results" / f"{name}.json").read_text("utf-8"))


def without_trips(car: Record) -> Record:
    """Scores of all trips of a car, forecast without any trip of it."""
    scores: Record = car["without_trips"]
    return scores


def learned(car: Record) -> Record:
    """Scores of the same trips, each forecast from all earlier ones of the car."""
    scores: Record = car["in_time"][0]
    return scores


def line(cars: Record, before: Record) -> str:
    """The line of the README: the same trips of the same cars without and with own trips, and one kind of error throughout."""
    unseen = [car for car in cars["cars"] if car["car"] != BUILT_ON]
    (first,) = (car for car in cars["cars"] if car["car"] == BUILT_ON)
    both = [[of(car) for car in unseen] for of in (without_trips, learned)]
    errors = [[score["error"] for score in scores] for scores in both]
    means = [f"{number(np.mean(each), 100, 1)} %" for each in errors]
    by_car = " and ".join(span([min(each), max(each)]) for each in errors)
    held = " and ".join(number(np.mean([s["coverage"] for s in scores]), 100, 0) for scores in both)
    of_first = " and ".join(number(of(first)["error"], 100, 1) for of in (without_trips, learned))
    twizy = before["cars"][0]
    planned = number(twizy["known"][ELSEWHERE]["error"], 100, 1)
    return (
        f"**Unseen cars: {means[0]}, learning from their trips: {means[1]}, 90 % intervals hold {held} %**: development figures, "
        f"means of {len(unseen)} cars of the error over the energy (by car {by_car} %) and of trips inside. All {sum(car['trips'] for car in unseen)} trips are forecast twice, "
        f"given the driven trace: without trips of the car, then from its earlier trips. The {first['vehicle_title']}, whose logs the physics "
        f"was built on, is left out ({of_first} %). On a planned road with travel times of another car, {twizy['trips']} trips err by {planned} %."
    )


def checks_table(outside: Record) -> Table:
    """The simulation against outside measurements."""
    columns: tuple[tuple[str, Callable[[Any], float]], ...] = (
        ("Bias [%]", np.mean),
        ("Mean error [%]", lambda errors: np.mean(np.abs(errors))),
    )
    rows = [
        row | {head: float(of(row["errors"])) for head, of in columns} | {"n": len(row["errors"])}
        for row in outside["checks"]
    ]
    return make_table(
        "Simulated over measured consumption, less one; nothing is fitted",
        rows,
        Column("Check", lambda row: f"{row['group']}: {row['name']}"),
        Column("Rows", "n", digits=0),
        *(in_percent(head, head) for head, _ in columns),
    )


def trips_table(cars: Record) -> Table:
    """Trips of each car, without and with own trips."""
    return make_table(
        "All trips of each car, given the driven speed trace; none of its model and data set took part, but the physics was built on the BMW i3's",
        cars["cars"],
        Column("Car", lambda car: SETS[car["car"]]),
        Column("Trips", "trips", digits=0),
        *_scored("no own trips", without_trips),
        *_scored("from earlier trips", learned),
    )


def _scored(when: str, score: Callable[[Record], Record]) -> tuple[Column, ...]:
    """Error and 90 % interval of a score of each car."""
    error = in_percent(f"Error, {when} [%]", lambda car: score(car)["error"])
    return error, *_interval(when, score)


def _interval(when: str, score: Callable[[Record], Record]) -> tuple[Column, Column]:
    """The 90 % interval of a score: what it holds, and its width."""

    def inside(car: Record) -> str:
        return f"{number(score(car)['coverage'], 100, 0)} ({span(score(car)['coverage_ci95'], 0)})"

    return (
        Column(f"Inside 90 %, {when} [%]", inside),
        Column("Width over needed", lambda car: score(car)["width_over_needed"], digits=1),
    )


def planned_rows(before: Record, links: Record) -> list[dict[str, Any]]:
    """Scores by what is known of a trip."""
    found = {**before["cars"][0]["known"], **{k: links["known"][k] for k in ("1000 m", "free flow")}}
    return [
        {
            "name": name,
            "error": found[key]["mape"],
            "error_ci95": found[key]["mape_ci95"],
            "coverage": found[key]["coverage"]["0.9"],
            "coverage_ci95": found[key]["coverage_ci95"]["0.9"],
            "width_over_needed": found[key]["interval_width_wh"]["0.9"]
            / found[key]["needed_width_wh"]["0.9"],
        }
        for key, name in KNOWN.items()
    ]


def planned_table(rows: Sequence[Record]) -> Table:
    """Trips of which a planned road is known."""
    return make_table(
        "Trips on a planned road",
        rows,
        Column("Car, and what is known", "name"),
        in_percent("Error [%]", "error"),
        in_percent("95 % interval", "error_ci95"),
        *_interval("planned", lambda row: row),
    )


def figure(outside: Record, cars: Record, planned: Sequence[Record]) -> Figure:
    """Checks of the simulation above; below, errors and intervals of trips."""
    checks = outside["checks"]
    with style_context():
        drawn = Figure(figsize=(7.4, 10.4), layout="constrained")
        heights = len(checks) + 3, len(cars["cars"]) + len(planned) + 6
        cells = drawn.add_gridspec(2, 1, height_ratios=heights)
        above, below = drawn.add_subfigure(cells[0]), drawn.add_subfigure(cells[1])
        _draw_checks(above.subplots(), checks)
        error, inside, width = below.subplots(1, 3, sharey=True, width_ratios=(2, 1.6, 1.1))
        _draw_errors(error, cars["cars"], planned)
        _draw_intervals(inside, width, cars["cars"], planned)
        handles = [
            _handle("no own trips", *WITHOUT),
            _handle("each from the car's earlier trips", *IN_TIME),
            _handle("planned road, with 95 % intervals", *PLANNED_ROAD),
        ]
        below.legend(handles=handles, loc="outside lower left", ncols=3)
    return drawn


def _handle(label: str, marker: str, colour: str) -> Line2D:
    """An entry of the legend."""
    edge = INK if colour == "none" else colour
    return Line2D(
        [], [], linestyle="none", marker=marker, markerfacecolor=colour, markeredgecolor=edge, label=label
    )


def _name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Names from the top, and nothing else on the axis."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)


def _draw_checks(axes: Axes, checks: Sequence[Record]) -> None:
    """A point for each row of a check, and a line at their mean."""
    for place, check in enumerate(checks):
        errors = np.array(check["errors"])
        spread = np.linspace(-0.18, 0.18, errors.size) if errors.size > 1 else np.zeros(1)
        axes.plot(errors, place + spread, "o", color="#0f8797", alpha=0.55, markersize=3.5, markeredgewidth=0)
        axes.plot([errors.mean()] * 2, [place - 0.34, place + 0.34], color=INK, linewidth=1.8)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    groups = [check["group"] for check in checks]
    for place, group in enumerate(groups):
        if group not in groups[:place]:
            axes.axhline(place - 0.5, color=RULE, linewidth=0.8)
            axes.text(
                0.995,
                place,
                group,
                transform=axes.get_yaxis_transform(),
                ha="right",
                va="center",
                weight="bold",
            )
    _name_rows(axes, [f"{c['name']} ({len(c['errors'])})" for c in checks])
    axes.set_title("Simulation against road tests, certified rows and dynamometers")
    percent_axis(axes, "simulated over measured consumption, less one [%]; line: mean; brackets: rows")


def _draw_errors(axes: Axes, cars: Sequence[Record], planned: Sequence[Record]) -> None:
    """The error of the trips of each car without and with own trips, and on planned roads with its interval."""
    for score, (marker, colour), offset in ((without_trips, WITHOUT, -0.2), (learned, IN_TIME, 0.2)):
        errors, places = [score(car)["error"] for car in cars], offset + np.arange(len(cars))
        edge = INK if colour == "none" else colour
        axes.plot(errors, places, marker, markerfacecolor=colour, markeredgecolor=edge, markersize=5)
    for place, row in enumerate(planned, start=len(cars)):
        marker, colour = PLANNED_ROAD
        axes.plot(row["error_ci95"], [place] * 2, color=colour, linewidth=1.4)
        axes.plot(row["error"], place, marker, color=colour, markersize=5)
    axes.axhline(len(cars) - 0.5, color=RULE, linewidth=0.8)
    _name_rows(
        axes, [f"{SETS[car['car']]} ({car['trips']})" for car in cars] + [row["name"] for row in planned]
    )
    axes.set_xlim(0.0, None)
    axes.set_title("Trips")
    percent_axis(axes, "mean error [%]")


def _draw_intervals(inside: Axes, width: Axes, cars: Sequence[Record], planned: Sequence[Record]) -> None:
    """What the 90 % intervals hold, with its Clopper-Pearson interval, and how wide they are."""
    rows = [
        (place + offset, score, marker)
        for place, car in enumerate(cars)
        for offset, score, marker in (
            (-0.2, without_trips(car), WITHOUT),
            (0.2, learned(car), IN_TIME),
        )
    ]
    rows += [(place, row, PLANNED_ROAD) for place, row in enumerate(planned, start=len(cars))]
    for y, score, (marker, colour) in rows:
        edge = INK if colour == "none" else colour
        style: dict[str, Any] = {"color": edge, "markerfacecolor": colour, "markersize": 5}
        inside.plot(score["coverage_ci95"], [y] * 2, color=edge, linewidth=1.2)
        inside.plot(score["coverage"], y, marker, **style)
        width.plot(score["width_over_needed"], y, marker, **style)
    inside.axvline(0.9, color=INK, linewidth=0.8)
    width.axvline(1.0, color=INK, linewidth=0.8)
    for axes in (inside, width):
        axes.axhline(len(cars) - 0.5, color=RULE, linewidth=0.8)
        axes.tick_params(axis="y", length=0)
    inside.set_title("90 % interval")
    percent_axis(inside, "trips inside [%]")
    widest = max(score["width_over_needed"] for _, score, _ in rows)
    width.set(xlabel="width over\nneeded [1]", xlim=(0.0, 1.08 * widest))
    width.grid(axis="x")


def text_of(outside: Record, cars: Record, planned: Sequence[Record]) -> str:
    """The tables of the page."""
    tables = checks_table(outside), trips_table(cars), planned_table(planned)
    return "\n\n".join(map(markdown, tables))


def publish() -> None:
    """Write the page, its figure and the line of the README."""
    outside, cars, before, links = (published(name) for name in ("outside", "cars", "before", "links"))
    planned = planned_rows(before, links)
    with Image.open(io.BytesIO(png_bytes(figure(outside, cars, planned)))) as image:  # a third of the size
        image.convert("RGB").quantize(64).save(FIGURE, optimize=True)
    pages.renew(PAGE, "accuracy", text_of(outside, cars, planned))
    for page in (ROOT / "README.md", "index.md", PAGE):
        pages.renew(page, "line", line(cars, before))
