"""What a forecast loses when only a planned route is known, as Markdown: from a results file of the protocol `links`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from tools.docs.tables import intervals_side_by_side, markdown
from tripwatt.study.report.intervals import intervals_table
from tripwatt.study.report.tables import DASH, Table, number, span

NAMES: Final[Mapping[str, str]] = {
    "driven trace": "the driven speed trace itself: the best case",
    "250 m": "links of 250 m",
    "1000 m": "links of 1 km",
    "free flow": "free flow by a proxy from the held-out drive",
}


def render_links(results: Mapping[str, Any]) -> str:
    """The figures beside each other as Markdown: errors, coverage and width by what is known of the speed.

    Parameters
    ----------
    results : mapping
        What `benchmarks.planned` writes.
    """
    by_knowledge = results["known"]
    rows = tuple(_row(NAMES.get(name, name), row) for name, row in by_knowledge.items())
    trips = int(results["n_trips"])
    intervals = [(NAMES.get(name, name), row, trips) for name, row in by_knowledge.items()]
    columns = (
        "Known of the speed",
        "Mean error [%]",
        "95 % interval",
        "More than with the trace [points]",
        "After half of the time [%]",
        "Bias [%]",
        "RMSE [kWh]",
        "90 % interval holds [% of trips]",
        "Its width [% of energy]",
    )
    caption = f"The forecast by what is known of the speed, leave one trip out, {results['n_trips']} reference trips"
    return "\n\n".join(
        (
            markdown(Table(caption, columns, rows)),
            markdown(intervals_side_by_side(intervals_table("Their intervals", intervals))),
            "Cells as above. No row is a forecast before departure: each takes something from the drive that it forecasts. A link "
            "has its length, its mean speed on this drive with every standstill, and the elevation at its ends; where the car stops "
            "is unknown. Free flow takes the 90th percentile of the moving speed of this drive on each link, rounded up to a usual "
            "limit, so it has seen a jam; a router's speeds have not. What widens the interval was learned on the other trips.",
        )
    )


def _row(name: str, row: Mapping[str, Any]) -> tuple[str, ...]:
    more_than_driven = (
        f"{number(row['mape_more_than_driven'], 100, 1)} ({span(row['mape_more_than_driven_ci95'])})"
    )
    return (
        name,
        number(row["mape"], 100, 1),
        span(row["mape_ci95"]),
        DASH if name == NAMES["driven trace"] else more_than_driven,
        number(row["mape_after_half"], 100, 1),
        number(row["bias"], 100, 1),
        number(row["rmse_wh"], 1e-3, 2),
        number(row["coverage"]["0.9"], 100, 0),
        number(row["relative_width"]["0.9"], 100, 0),
    )
