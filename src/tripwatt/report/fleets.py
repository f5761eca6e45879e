"""One HTML page on a fleet: how well it is forecast, and which vehicles take more than their sisters, and since when."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, Final

import pandas as pd

from tripwatt.evaluation.fleets import FleetEvaluation

_STYLE: Final = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem; color: #1b1b1b; background: #fff }
table { border-collapse: collapse; margin: 1rem 0 }
caption { text-align: left; font-weight: 600; padding: .3rem 0 }
th, td { padding: .2rem .8rem .2rem 0; border-bottom: 1px solid #ccc; text-align: left }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums }
svg { vertical-align: middle }
@media (prefers-color-scheme: dark) { body { color: #eee; background: #161616 } th, td { border-color: #444 } }
"""


def report_page(title: str, evaluation: FleetEvaluation, vehicles: pd.DataFrame, most: int = 40) -> str:
    """The page as one file without scripts.

    Parameters
    ----------
    title : str
    evaluation : FleetEvaluation
    vehicles : DataFrame
        From `sisters`.
    most : int
        Vehicles that are listed.
    """
    parts = [f"<h1>{escape(title)}</h1>", _summary(evaluation, vehicles)]
    parts.append("<h2>Vehicles that take more or less than others of their car model</h2>")
    parts.append(
        "<p>Share of energy on the usual trip of the car model, with one standard deviation. A day is given where the mean "
        "consumption before and after it differs clearly.</p>"
    )
    parts.append(_vehicles(vehicles, most))
    parts.append("<h2>Accuracy on held-out trips</h2>")
    for by, caption in (
        ("car_model", "By car model"),
        ("temperature", "By outside temperature"),
        ("length", "By length of the trip"),
    ):
        frame = evaluation.table(by)
        rows: list[tuple[str, ...]] = [
            (f"{r[0]}", f"{r[1]}", f"{r[2]}", f"{100.0 * r[3]:.1f}", f"{100.0 * r[4]:.0f}")
            for r in frame.itertuples(index=False)
        ]
        heads = (
            "trips forecast",
            caption.removeprefix("By "),
            "trips",
            "mean error [%]",
            "inside the 90 % interval [%]",
        )
        parts.append(_table(caption, heads, rows, numbers=(2, 3, 4)))
    rows = [
        (f"{int(r[0])}", f"{int(r[1])}", *(f"{100.0 * v:.1f}" for v in r[2:]))
        for r in evaluation.own.itertuples(index=False)
    ]
    heads = ("own trips", "vehicles", "fleet and own trips [%]", "own trips only [%]", "fleet only [%]")
    parts.append(_table("Mean error by number of own trips", heads, rows, numbers=(0, 1, 2, 3, 4)))
    parts.append(_calibration(evaluation))
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n'
    )


def _summary(evaluation: FleetEvaluation, vehicles: pd.DataFrame) -> str:
    frame = evaluation.trips.assign(
        error=(evaluation.trips["predicted_wh"] / evaluation.trips["observed_wh"] - 1.0).abs()
    )
    errors = frame.groupby("protocol")["error"].mean()
    said = ", ".join(f"{100.0 * value:.1f} % on {name}" for name, value in errors.items())
    changed = int(vehicles["since"].notna().sum())
    return (
        f"<p>{int(vehicles['trips'].sum())} trips of {len(vehicles)} vehicles. Mean error of the linear model: {escape(said)}. "
        f"The consumption of {changed} vehicles has changed.</p>"
    )


def _vehicles(vehicles: pd.DataFrame, most: int) -> str:
    chosen = vehicles.reindex(vehicles["share"].abs().sort_values(ascending=False).index[:most])
    chosen = chosen.sort_values("share", ascending=False)
    widest = max(float(vehicles["share"].abs().max()), 1e-6)
    rows = []
    for row in chosen.to_dict("records"):
        change = (
            ""
            if row["since"] is None or row["since"] != row["since"]
            else f"{100.0 * row['change']:+.1f} % since {row['since']}"
        )
        rows.append(
            (
                row["vehicle_id"],
                row["car_model"],
                f"{row['trips']}",
                f"{100.0 * row['share']:+.1f} ± {100.0 * row['sd']:.1f}",
                _Bar(row["share"] / widest),
                change,
            )
        )
    heads = ("vehicle", "car model", "trips", "more [%]", "", "change")
    return _table("Vehicles, by deviation", heads, rows, numbers=(2, 3))


class _Bar(str):
    """A bar to the right or left of a middle line, of a share of -1 to 1."""

    html: str

    def __new__(cls, share: float) -> _Bar:
        made = super().__new__(cls, "")
        width = 50.0 * min(abs(share), 1.0)
        x = 50.0 if share >= 0.0 else 50.0 - width
        colour = "#b3401f" if share >= 0.0 else "#1f6fb3"
        made.html = (
            f'<svg width="104" height="12" role="img" aria-hidden="true"><rect x="{x:.1f}" y="1" width="{width:.1f}" '
            f'height="10" fill="{colour}"/><line x1="50" x2="50" y1="0" y2="12" stroke="currentColor"/></svg>'
        )
        return made


def _calibration(evaluation: FleetEvaluation) -> str:
    table = evaluation.table("vehicle_id")
    rows = []
    for protocol, its in table.groupby("protocol", sort=True):
        shares = its.loc[its["trips"] >= 10, "inside"]
        if len(shares):
            low, middle, high = (100.0 * float(shares.quantile(q)) for q in (0.1, 0.5, 0.9))
            rows.append((f"{protocol}", f"{len(shares)}", f"{low:.0f}", f"{middle:.0f}", f"{high:.0f}"))
    heads = ("trips forecast", "vehicles", "lowest tenth [%]", "median [%]", "highest tenth [%]")
    return _table(
        "Trips inside the 90 % interval, by vehicle with 10 trips or more", heads, rows, numbers=(1, 2, 3, 4)
    )


def _table(
    caption: str, heads: Sequence[str], rows: Iterable[Sequence[Any]], *, numbers: Sequence[int] = ()
) -> str:
    def cell(tag: str, k: int, value: str) -> str:
        shown = value.html if isinstance(value, _Bar) else escape(str(value))
        return f"<{tag}{' class=n' if k in numbers else ''}>{shown}</{tag}>"

    head = "".join(cell("th", k, value) for k, value in enumerate(heads))
    body = "".join(
        f"<tr>{''.join(cell('td', k, value) for k, value in enumerate(row))}</tr>\n" for row in rows
    )
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table>"
