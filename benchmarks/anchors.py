"""Anchors of the library and how well its cars meet their certified consumption: `python -m benchmarks.anchors`.

`--write` computes the anchors again with the physics of the day, and renews `anchors.csv` and the bars in docs/reference/library.md. Run it
after every change of the physics or of the table of cars.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from tools.command import run
from tools.data.anchoring import anchored, certified_figures, most_probable, scaled, without_outliers
from tools.docs import pages

from benchmarks.measure import Row
from benchmarks.six_numbers import body_of, known_of
from tripwatt.arrays import FloatArray
from tripwatt.certification.consumption import FACTORS, ROAD_LOAD, CertifiedFigure, errors, with_road_load
from tripwatt.certification.describing import described
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_from_document, vehicle_names
from tripwatt.vehicles.anchors import CLASS, Anchor, anchors, class_of
from tripwatt.vehicles.catalogue import catalogue, table_names
from tripwatt.vehicles.loading import library_document
from tripwatt.vehicles.vehicle import FIELDS

ROOT: Final = Path(__file__).parents[1]
TABLE: Final = ROOT / "src" / "tripwatt" / "vehicles" / "data" / "table" / "anchors.csv"

NOT_ANCHORED: Final = ("bmw_i3_60ah", "bmw_i3_94ah", "nissan_leaf_24", "nissan_leaf_30")
"""Cars older than 2019: their trips and dynamometer tests check the physics, and their certified figures are labels."""

OWN_ROAD_LOAD: Final = ("nissan_leaf_40", "tesla_model_3_lr", "hyundai_kona_64", "chevrolet_bolt")
"""Cars with a file of their own that has the coast-down of the certification."""

CLASS_LEVEL: Final = "class"
"""Level of the anchor of cars without a certified figure."""

CLASS_LOSS: Final = "gear"
"""Loss that cars have in common: in proportion to the power, of all three the one that needs no speed or torque of a motor."""

REASONS: Final = MappingProxyType(
    {
        "renault_zoe_ze50_r135": (
            "the published consumption at the wall and the range disagree: together they say that charging takes 24 %, more than "
            "twice what the certificates of other cars say. The anchor meets their mean"
        ),
    }
)
"""Cars with a row that stays more than 8 % off, and why."""

BARS: Final = MappingProxyType(
    {
        "cars of 2019 or later": 60,
        "median error before, measured coast-down": 0.08,
        "mean of a car after": 0.02,
        "share of rows within 4 % after": 0.85,
        "largest row after without a reason": 0.08,
        "mean error of certificates before": 0.05,
        "largest row of certificates before": 0.08,
    }
)
AT_LEAST: Final = ("cars of 2019 or later", "share of rows within 4 % after")


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """A car before and after its anchor."""

    name: str
    title: str
    anchor: Anchor
    figures: tuple[CertifiedFigure, ...]
    before: FloatArray
    after: FloatArray

    @property
    def measured(self) -> bool:
        return self.anchor.level == "road_load"

    def rows(self, values: FloatArray, *, outliers: bool = False) -> FloatArray:
        """Errors at the wall and of the cycle at the battery, without marked rows."""
        return values[[outliers or not figure.outlier for figure in self.figures]]


def unanchored(name: str) -> Vehicle:
    """A car of the library with published and class values alone."""
    return vehicle_from_document(library_document(name), name, f"{name}.toml")


def level_of(name: str) -> str:
    row = catalogue().get(name, {})
    return "road_load" if "coastdown_a" in row or name in OWN_ROAD_LOAD else "certification"


def last_year(name: str) -> int:
    """Last model year of a car; those with a file of their own that are anchored were all made in 2019."""
    row = catalogue().get(name, {})
    return int(row["year_last"][0].value) if "year_last" in row else 2018 if name in NOT_ANCHORED else 2019


def compute() -> tuple[dict[str, Anchor], list[Outcome]]:
    """Anchors of all cars, the class's among them, and the errors before and after."""
    names = [name for name in vehicle_names() if name not in NOT_ANCHORED]
    cars = {name: unanchored(name) for name in names}
    figures = {name: certified_figures(name, cars[name]) for name in names}
    new: dict[str, Anchor] = {}
    outcomes: dict[str, Outcome] = {}
    common, misses = [], []
    for name in names:
        if not figures[name] or level_of(name) != "road_load":
            continue
        done = most_probable(cars[name], figures[name])
        new[name] = done.anchor("road_load")
        outcomes[name] = outcome(name, cars[name], done.vehicle, new[name], figures[name])
        common.append(anchored(cars[name], figures[name], CLASS_LOSS).factor)
        misses.append(new[name].before)
    middle = float(np.median(common))
    efficiency = scaled(cars["vw_id4_pro"], CLASS_LOSS, middle).drivetrain.gearbox_efficiency
    entries = MappingProxyType({"drivetrain.gearbox_efficiency": efficiency})
    new[CLASS] = Anchor(CLASS_LEVEL, CLASS_LOSS, entries, float(np.median(misses)))
    new |= class_anchors(cars, figures, new[CLASS])
    for name in names:
        if not figures[name]:
            new[name] = new[CLASS]
        if not figures[name] or level_of(name) == "road_load":
            continue
        own = scaled(cars[name], CLASS_LOSS, middle)
        done = anchored(own, figures[name], ROAD_LOAD)
        before = errors(cars[name], figures[name])
        road = done.anchor("certification")
        new[name] = Anchor("certification", ROAD_LOAD, road.entries, float(before.mean()))
        outcomes[name] = outcome(name, cars[name], done.vehicle, new[name], figures[name])
    return new, [outcomes[name] for name in names if name in outcomes]


def class_anchors(
    cars: Mapping[str, Vehicle], figures: Mapping[str, Sequence[CertifiedFigure]], common: Anchor
) -> dict[str, Anchor]:
    """Of each class, what is left of the certified consumption of its cars if only their few figures are known.

    Each maker has one vote, in the mean and in the scatter, since cars of one maker are alike. A car's own coast-down takes no part.
    """
    known: dict[str, list[tuple[str, Vehicle, list[CertifiedFigure]]]] = {}
    for name in table_names():
        if figures.get(name):
            body, maker = body_of(name), cars[name].title.split()[0]
            car = described(known_of(name), body, without=(name,), anchor=common)
            known.setdefault(class_of(body), []).append((maker, car, without_outliers(figures[name])))
    new = {}
    for group, members in sorted(known.items()):

        def logs(
            factor: float, members: Sequence[tuple[str, Vehicle, list[CertifiedFigure]]] = members
        ) -> pd.Series:
            each = [np.log1p(errors(with_road_load(car, factor), own)).mean() for _, car, own in members]
            return pd.Series(each, index=[maker for maker, _, _ in members])

        factor = brentq(lambda factor: logs(factor).groupby(level=0).mean().mean(), *FACTORS, xtol=1e-4)
        votes = (logs(factor) ** 2).groupby(level=0).mean()
        scatter = float(np.sqrt(votes.sum() / (len(votes) - 1.0)))
        before = float(np.expm1(logs(1.0).groupby(level=0).mean().mean()))
        entries = {"factor": factor, "scatter": scatter, "makers": float(len(votes))}
        new[group] = Anchor(CLASS_LEVEL, ROAD_LOAD, MappingProxyType(entries), before)
    return new


def outcome(
    name: str, before: Vehicle, after: Vehicle, anchor: Anchor, figures: Sequence[CertifiedFigure]
) -> Outcome:
    rows = tuple(figures)
    return Outcome(name, before.title, anchor, rows, errors(before, rows), errors(after, rows))


def committed() -> list[Outcome]:
    """The errors before and after the anchors of the package."""
    outcomes = []
    for name, anchor in anchors().items():
        if anchor.level == CLASS_LEVEL:
            continue
        before, after = unanchored(name), load_vehicle(name)
        outcomes.append(outcome(name, before, after, anchor, certified_figures(name, before)))
    return outcomes


def write_anchors(own: dict[str, Anchor]) -> None:
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["car", "level", "loss", "entry", "value", "unit", "before"])
        for name, anchor in sorted(own.items()):
            for key, value in anchor.entries.items():
                figures = (
                    f"{value:.6g}",
                    FIELDS[key].metadata["unit"] if key in FIELDS else "1",
                    f"{anchor.before:.4f}",
                )
                out.writerow([name, anchor.level, anchor.loss, key, *figures])


def figures_of_bars(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """The figure of each bar of `BARS`."""
    measured = np.concatenate([np.abs(o.rows(o.before)) for o in outcomes if o.measured])
    sound = np.concatenate([np.abs(o.rows(o.after)) for o in outcomes])
    every = np.concatenate([np.abs(o.after) for o in outcomes if o.name not in REASONS])
    certificates = np.concatenate(
        [np.abs(o.before[[not f.at_wall and f.cycle != "wltc" for f in o.figures]]) for o in outcomes]
    )
    return {
        "cars of 2019 or later": float(sum(last_year(name) >= 2019 for name in vehicle_names())),
        "median error before, measured coast-down": float(np.median(measured)),
        "mean of a car after": float(
            max(abs(o.rows(o.after).mean()) for o in outcomes if len(o.rows(o.after)))
        ),
        "share of rows within 4 % after": float((sound <= 0.04).mean()),
        "largest row after without a reason": float(every.max()),
        "mean error of certificates before": float(certificates.mean()),
        "largest row of certificates before": float(certificates.max()),
    }


def met(bar: str, figure: float) -> bool:
    """Whether a figure meets its bar."""
    return figure >= BARS[bar] if bar in AT_LEAST else figure <= BARS[bar]


def bars() -> Iterator[Row]:
    """The bars on the anchors of the package."""
    for name, figure in figures_of_bars(committed()).items():
        least, most = (BARS[name], math.inf) if name in AT_LEAST else (-math.inf, BARS[name])
        yield Row(f"library: {name}", figure, "", least, most)


def render(outcomes: Sequence[Outcome]) -> str:
    """Markdown: the bars, and what explains a car that misses them."""
    lines = ["| bar | limit | figure | met |", "|---|---:|---:|---|"]
    for bar, figure in figures_of_bars(outcomes).items():
        shown = f"{figure:.0f}" if bar.startswith("cars") else f"{100 * figure:.1f} %"
        limit = f"{BARS[bar]:g}" if bar.startswith("cars") else f"{100 * BARS[bar]:g} %"
        lines.append(f"| {bar} | {limit} | {shown} | {'yes' if met(bar, figure) else 'no'} |")
    titles = {o.name: o.title for o in outcomes}
    lines += ["", *(f"- {titles[name]}: {reason}." for name, reason in REASONS.items() if name in titles)]
    return "\n".join(lines)


def render_cars(outcomes: Sequence[Outcome]) -> str:
    """Markdown: every car with its errors before and after."""
    lines = [
        "| car | name | held against | before | loss | after | rows |",
        "|---|---|---|---:|---|---:|---|",
    ]
    for o in outcomes:
        rows = ", ".join(
            f"{figure.cycle.upper()}{'' if figure.at_wall else ' at the battery'} {100 * b:+.1f} → {100 * a:+.1f}"
            + (" (outlier)" if figure.outlier else "")
            for figure, b, a in zip(o.figures, o.before, o.after, strict=True)
        )
        what = "coast-down and certification" if o.measured else "certification"
        lines.append(
            f"| {o.title} | `{o.name}` | {what} | {100 * o.before.mean():+.1f} % | {o.anchor.loss} "
            f"| {100 * o.after.mean():+.1f} % | {rows} |"
        )
    return "\n".join(lines)


def main(write: bool = False) -> None:
    """Print the bars and the cars. `--write` computes the anchors again and renews their file and the page."""
    if write:
        own, outcomes = compute()
        write_anchors(own)
    else:
        outcomes = committed()
    print(f"{render(outcomes)}\n\n{render_cars(outcomes)}")
    if write:
        pages.renew("reference/library.md", "anchors", render(outcomes))


if __name__ == "__main__":
    run(main)
