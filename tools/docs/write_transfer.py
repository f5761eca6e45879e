"""Publish transfers: ``python -m tools.docs.write_transfer [OUT ...]``.

Copies the results.json of folders that `tripwatt transfer` wrote to docs/results/ (scores, no trip data) and the figure
of the car with most trips to docs/images/, then renews the tables of docs/explanation/transfer.md from docs/results/.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tools import DOCS
from tools.docs import pages
from tripwatt.report.intervals import NOTE, OFF
from tripwatt.report.tables import Table, number, span
from tripwatt.report.transfer_panels import (
    coverage_table,
    curve_table,
    models_table,
    said_of_curve,
    said_of_models,
)

RESULTS, IMAGES, PAGE = DOCS / "results", DOCS / "images", DOCS / "explanation" / "transfer.md"
WAYS = ("tum-ved", "ved-tum")


def publish(out: Path) -> None:
    """Copy one run's results and figure."""
    results = json.loads((out / "results.json").read_text(encoding="utf-8"))
    way = f"{results['from']['dataset']}-{results['to']['dataset']}"
    results.pop("audit")
    text = json.dumps(results, indent=1, ensure_ascii=False) + "\n"
    (RESULTS / f"transfer-{way}.json").write_text(text, encoding="utf-8")
    name = results["cars"][0]["car"]
    stem = f"car-{name}-curve" if name else "curve"
    IMAGES.mkdir(exist_ok=True)
    shutil.copy(out / "figures" / f"{stem}.png", IMAGES / f"transfer-{way}.png")


def renewed(page: str, results: Path = RESULTS) -> str:
    """The page with its generated parts as the results say."""
    for way in WAYS:
        run = json.loads((results / f"transfer-{way}.json").read_text(encoding="utf-8"))
        page = pages.with_part(page, way, "\n\n".join(_told(run)))
    covariates = json.loads((results / "transfer-covariates.json").read_text(encoding="utf-8"))
    return pages.with_part(page, "covariates", "\n\n".join(markdown(t) for t in _covariates(covariates)))


def _told(results: Mapping[str, Any]) -> Iterable[str]:
    car = results["cars"][0]
    if left_out := results.get("without_target"):
        yield f"Without values from the logs of `{results['to']['dataset']}`: {', '.join(f'`{key}`' for key in left_out)}."
    yield f"{said_of_models(car)} {said_of_curve(car)}"
    yield _bars(car["bars"])
    yield markdown(models_table(results, car))
    yield markdown(curve_table(results, car))
    covered = coverage_table(results, car)
    if covered.rows:
        yield markdown(covered)
        yield f"\\{OFF} differs significantly from the level. {NOTE}"


def _bars(bars: Mapping[str, Any]) -> str:
    first = bars["zero_shot_better_than_physics"]
    low, high = first["diff_ci95"]
    text = (
        f"Better than physics without a trip of its own: **{'yes' if first['met'] else 'no'}** "
        f"({number(first['diff'], 100)} points, 95 % interval {number(low, 100)} to {number(high, 100)})."
    )
    ten = bars.get("ten_trips_within_15_percent_of_own")
    if ten:
        text += (
            f" With 10 trips within 15 % of the best model of its own: **{'yes' if ten['met'] else 'no'}** "
            f"({number(ten['ratio'])} times its error)."
        )
    return text


def _covariates(ways: Iterable[Mapping[str, Any]]) -> Iterable[Table]:
    for way in ways:
        rows = [("none: its physics alone", number(way["physics"][0], 100, 1), "", "", "")]
        rows += [
            (
                row["covariates"],
                number(row["half"][0], 100, 1),
                number(row["full"][0], 100, 1),
                number(row["half_minus_physics"]["diff"], 100),
                f"{number(row['half_minus_car_free']['diff'], 100)} ({span(row['half_minus_car_free']['diff_ci95'], 2)})",
            )
            for row in way["variants"]
        ]
        caption = f"{way['from']} → {way['to']}, {way['trips_scored']} trips"
        columns = ("Covariates", "Half [%]", "All [%]", "Half − physics", "Half − car-free (95 %)")
        yield Table(caption, columns, tuple(rows))


def markdown(table: Table) -> str:
    """A table as Markdown, under its caption."""
    lines = [
        table.caption,
        "",
        f"| {' | '.join(table.columns)} |",
        f"|---|{'---:|' * (len(table.columns) - 1)}",
    ]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in table.rows)])


if __name__ == "__main__":
    for folder in sys.argv[1:]:
        publish(Path(folder))
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
