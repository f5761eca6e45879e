"""HTML pages on a fleet: how well it is forecast; and for its manager, which vehicles changed, and what planned trips need."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

import pandas as pd

from tripwatt.evaluation.fleets import FleetEvaluation
from tripwatt.fleet.deviations import PARTS
from tripwatt.fleet.statistics import TripRows
from tripwatt.report.html import page_text
from tripwatt.report.panel import Panel
from tripwatt.report.tables import Column, Table, in_kwh, in_percent, in_words, tabulated

CLASSES: Final = {
    "car_model": "car model",
    "temperature": "outside temperature",
    "length": "length of the trip",
}
LEAST_TRIPS: Final = 10
"""Trips of a vehicle whose share inside of the intervals is looked at."""


def evaluation_page(title: str, evaluation: FleetEvaluation, rows: TripRows) -> str:
    """The page on how well a fleet is forecast as one file without scripts."""
    tables = (
        *(accuracy_table(evaluation, by) for by in CLASSES),
        own_table(evaluation),
        inside_table(evaluation),
    )
    facts = {"Trips": len(rows), "Vehicles": len(set(rows.texts("vehicle_id").tolist()))}
    panel = Panel(
        "accuracy", "Accuracy on held-out trips", said_of_errors(evaluation), tables=tables, wide=True
    )
    return page_text("fleet.html.jinja", [panel], title=title, facts=facts.items())


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


def manager_page(
    title: str,
    changed: pd.DataFrame,
    vehicles: pd.DataFrame,
    needs: pd.DataFrame | None = None,
    by_car: pd.DataFrame | None = None,
    week: str = "",
    drivers: pd.DataFrame | None = None,
) -> str:
    """The fleet manager's page as one file without scripts.

    Parameters
    ----------
    title : str
    changed, vehicles, drivers : DataFrame
        From `changes` and `deviations`; `drivers` None where nobody asked for them.
    needs, by_car : DataFrame, optional
        From `needs_by_hour` and `needs_by_car`; None without planned trips.
    week : str
        The coldest week in words.
    """
    panels = [
        Panel("changes", "Vehicles that changed", said_of_changes(changed, vehicles), tables=(changes_table(changed),) if len(changed) else ())
    ]  # fmt: skip
    if needs is not None:
        panels.append(
            Panel("need", "What the planned trips need", said_of_needs(needs), tables=(needs_table(needs),))
        )
    if by_car is not None:
        panels.append(
            Panel("routes", f"Cars for the planned routes, {week}", _ROUTES, tables=(routes_table(by_car),))
        )
    for key, table in (("vehicle", vehicles), ("driver", drivers)):
        if table is not None:
            panels.append(
                Panel(
                    f"{key}s",
                    f"{key.title()}s beside others",
                    _SHARES[key],
                    tables=(shares_table(table, key),),
                    folded=True,
                )
            )
    facts = {
        "Trips": vehicles["trips"].sum(),
        "Vehicles": len(vehicles),
        "Vehicles that changed": changed["vehicle_id"].nunique(),
    }
    return page_text(
        "fleet.html.jinja", [replace(p, wide=True) for p in panels], title=title, facts=facts.items()
    )


_SHARES: Final = {
    "vehicle": "Energy beyond that of the car model on the usual trip of the car model, with one standard deviation.",
    "driver": "Energy beyond that of the vehicle's drivers together on the usual trip of the car model, with one standard deviation.",
}
_ROUTES: Final = "Displayed charge [%] that suffices in 19 of 20 trips with each car model, whichever vehicle it is. A dash: more than a full battery."
NONE_CHANGED: Final = "No vehicle changed by 2 % or more beyond chance."


def said_of_changes(changed: pd.DataFrame, vehicles: pd.DataFrame) -> str:
    """How many vehicles changed, and by which causes."""
    if not len(changed):
        return NONE_CHANGED
    causes = ", ".join(f"{n} by {cause}" for cause, n in changed["cause"].value_counts().items())
    return (
        f"{changed['vehicle_id'].nunique()} of {len(vehicles)} vehicles: {causes}. A change of the consumption is a share of it; one of the battery is a "
        "share of the displayed charge that an energy takes. What all vehicles of a car model share in a month does not count."
    )


def changes_table(changed: pd.DataFrame) -> Table:
    """A row for each change."""
    return tabulated(
        "Every change, the largest first",
        changed.to_dict("records"),
        Column("vehicle", "vehicle_id"),
        in_words("car model", "car_model"),
        in_words("cause", lambda row: f"{row['cause']} ({row['probability']:.0%})"),
        in_words("since", "since"),
        in_words("95 % interval", lambda row: f"{row['from_day']} to {row['to_day']}"),
        Column("more [%]", _more("change")),
        Column("trips before", "before", digits=0),
        Column("after", "after", digits=0),
    )


def _more(name: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda row: f"{100.0 * row[name]:+.1f} ± {100.0 * row['sd']:.1f}"


def said_of_needs(needs: pd.DataFrame) -> str:
    """The sums of the night."""
    known = needs["charge_wh"].dropna()
    charge = (
        f" {known.sum() / 1000.0:.0f} kWh are to be charged for {len(known)} departures whose charge now is known."
        if len(known)
        else ""
    )
    return f"{needs['trips'].sum()} trips need {needs['energy_quantile_wh'].sum() / 1000.0:.0f} kWh at most in 19 of 20 cases each.{charge}"


def needs_table(needs: pd.DataFrame) -> Table:
    """A row for each vehicle and hour of departure."""
    return tabulated(
        "By vehicle and hour of departure",
        needs.to_dict("records"),
        Column("vehicle", "vehicle_id"),
        in_words("first departure", lambda row: f"{row['departs_at']:%Y-%m-%d %H:%M}"),
        Column("trips", "trips", digits=0),
        Column("distance [km]", "distance_m", 1e-3, 0),
        in_kwh("energy, median [kWh]", "energy_wh", 1),
        in_kwh("suffices in 19 of 20 [kWh]", "energy_quantile_wh", 1),
        in_percent("leave with [%]", "soc_needed", 0),
        in_percent("charge now [%]", "soc", 0),
        in_kwh("to charge [kWh]", "charge_wh", 1),
    )


def routes_table(by_car: pd.DataFrame) -> Table:
    """A row for each route and a column for each car model."""
    columns = (
        in_percent(car, lambda row, car=car: row[car] if row[car] <= 1.0 else None, 0) for car in by_car
    )
    rows = by_car.reset_index().to_dict("records")
    return tabulated("Charge that suffices", rows, Column("route", "trip"), *columns)


def shares_table(table: pd.DataFrame, key: str) -> Table:
    """A row for each vehicle or driver."""
    return tabulated(
        f"Every {key}, by deviation",
        table.to_dict("records"),
        Column(key, "driver" if key == "driver" else "vehicle_id"),
        in_words("car model", "car_model"),
        Column("trips", "trips", digits=0),
        Column("more [%]", _more("share")),
        *(in_percent(f"{part.replace('_', ' ')} [%]", part) for part in PARTS),
    )
