"""One HTML page on a fleet: how well it is forecast, and which vehicles take more than their sisters, and since when."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import pandas as pd
from matplotlib.figure import Figure

from tripwatt.evaluation.fleets import FleetEvaluation
from tripwatt.report.html import page_text
from tripwatt.report.panel import Panel
from tripwatt.report.style import PLAIN_COLOUR, WARM_COLOUR, new_figure, row_names, style_context
from tripwatt.report.tables import Column, Table, in_percent, in_words, tabulated
from tripwatt.report.view import plain

CLASSES: Final = {
    "car_model": "car model",
    "temperature": "outside temperature",
    "length": "length of the trip",
}
LEAST_TRIPS: Final = 10
"""Trips of a vehicle whose share inside of the intervals is looked at."""

_SHARES: Final = (
    "Share of energy on the usual trip of the car model, with one standard deviation. A day is given where the mean consumption before and "
    "after it differs clearly."
)


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
    listed = vehicles.reindex(vehicles["share"].abs().sort_values(ascending=False).index[:most])
    listed = listed.sort_values("share", ascending=False)
    tables = (
        *(accuracy_table(evaluation, by) for by in CLASSES),
        own_table(evaluation),
        inside_table(evaluation),
    )
    with style_context():
        figure, shares = plot_shares(listed), (shares_table(listed),)
    facts = {
        "Trips": vehicles["trips"].sum(),
        "Vehicles": len(vehicles),
        "With a change": vehicles["since"].notna().sum(),
    }
    panels = [
        Panel(
            "vehicles",
            "Vehicles that take more or less than others of their car model",
            _SHARES,
            figure,
            shares,
            wide=True,
        ),
        Panel("accuracy", "Accuracy on held-out trips", said_of_errors(evaluation), tables=tables, wide=True),
    ]
    return page_text("fleet.html.jinja", panels, title=title, facts=facts.items())


def said_of_errors(evaluation: FleetEvaluation) -> str:
    """The mean error of each set of held-out trips."""
    errors = (evaluation.trips["predicted_wh"] / evaluation.trips["observed_wh"] - 1.0).abs()
    means = errors.groupby(evaluation.trips["protocol"]).mean()
    return f"Mean error of the linear model: {', '.join(f'{100.0 * mean:.1f} % on {name}' for name, mean in means.items())}."


def accuracy_table(evaluation: FleetEvaluation, by: str) -> Table:
    """Mean error and coverage by one of `CLASSES`."""
    return tabulated(
        f"By {CLASSES[by]}",
        evaluation.table(by).to_dict("records"),
        Column("trips forecast", "protocol"),
        in_words(CLASSES[by], by),
        Column("trips", "trips", digits=0),
        in_percent("mean error [%]", "error"),
        in_percent("inside the 90 % interval [%]", "inside", 0),
    )


def own_table(evaluation: FleetEvaluation) -> Table:
    """Mean error by the number of trips of the vehicle that the model has learned."""
    return tabulated(
        "Mean error by number of own trips",
        evaluation.own.to_dict("records"),
        Column("own trips", "own_trips", digits=0),
        Column("vehicles", "vehicles", digits=0),
        in_percent("fleet and own trips [%]", "pooled"),
        in_percent("own trips only [%]", "own_only"),
        in_percent("fleet only [%]", "fleet_only"),
    )


def inside_table(evaluation: FleetEvaluation) -> Table:
    """How much the share of trips inside of the interval differs between vehicles."""
    table = evaluation.table("vehicle_id")

    def spread() -> Iterator[dict[str, Any]]:
        for protocol, shares in table[table["trips"] >= LEAST_TRIPS].groupby("protocol")["inside"]:
            low, middle, high = shares.quantile([0.1, 0.5, 0.9])
            yield {"protocol": protocol, "n": len(shares), "low": low, "middle": middle, "high": high}

    return tabulated(
        f"Trips inside the 90 % interval, by vehicle with {LEAST_TRIPS} trips or more",
        spread(),
        Column("trips forecast", "protocol"),
        Column("vehicles", "n", digits=0),
        in_percent("lowest tenth [%]", "low", 0),
        in_percent("median [%]", "middle", 0),
        in_percent("highest tenth [%]", "high", 0),
    )


def shares_table(vehicles: pd.DataFrame) -> Table:
    """A row for each vehicle that is listed."""
    return tabulated(
        "Vehicles, by deviation",
        vehicles.to_dict("records"),
        Column("vehicle", "vehicle_id"),
        in_words("car model", "car_model"),
        Column("trips", "trips", digits=0),
        Column("more [%]", lambda row: f"{100.0 * row['share']:+.1f} ± {100.0 * row['sd']:.1f}"),
        in_words("change", _change),
    )


def _change(row: Mapping[str, Any]) -> str:
    return "" if pd.isna(row["since"]) else f"{100.0 * row['change']:+.1f} % since {row['since']}"


def plot_shares(vehicles: pd.DataFrame) -> Figure:
    """What each vehicle takes beyond others of its car model, with one standard deviation."""
    figure = new_figure(1.0 + 0.22 * len(vehicles), "More energy than others of the car model", "", False)
    axes, shares = figure.add_subplot(), 100.0 * vehicles["share"]
    colours = [WARM_COLOUR if share >= 0.0 else PLAIN_COLOUR for share in shares]
    axes.barh(range(len(vehicles)), shares, xerr=100.0 * vehicles["sd"], color=colours)
    row_names(axes, [plain(name, 28) for name in vehicles["vehicle_id"]])
    axes.set_xlabel("more energy [%]")
    return figure
