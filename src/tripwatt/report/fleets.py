"""HTML pages on a fleet: how well it is forecast; and for its manager, which vehicles changed, and what planned trips need."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from tripwatt.evaluation.fleets import FleetEvaluation
from tripwatt.files import write_text
from tripwatt.fleet.changes import FALSE_CHANGES, LEAST_CHANGE, changes
from tripwatt.fleet.deviations import PARTS, deviations
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.registry import REPORT_FILES
from tripwatt.fleet.statistics import TripRows
from tripwatt.journey.nights import (
    QUANTILE,
    PlannedTrip,
    coldest_week,
    needs_by_car,
    needs_by_hour,
    night_document,
    records,
)
from tripwatt.report.html import page_text
from tripwatt.report.panel import Panel
from tripwatt.report.tables import Column, Table, in_kwh, in_percent, in_words, number, tabulated
from tripwatt.report.words import percent

CLASSES: Final = {
    "car_model": "car model",
    "temperature": "outside temperature",
    "length": "length of the trip",
}
LEAST_TRIPS: Final = 10
"""Trips of a vehicle whose share inside of the intervals is looked at."""

ISO: Final = "%Y-%m-%dT%H:%M:%S%z"


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
    return page_text("fleet.html.jinja", [panel], title=title, facts=facts.items(), foot=_ERROR)


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


@dataclass(frozen=True, eq=False)
class ManagerReport:
    """What the manager of a fleet asks: which vehicles changed, what the planned trips need, and which cars the routes need.

    Attributes
    ----------
    title : str
    quantile : float
        Probability with which a need suffices.
    changed, vehicles : DataFrame
        From `changes` and `deviations`.
    drivers : DataFrame or None
        From `deviations`; None where nobody asked for them.
    needs, by_car : DataFrame or None
        From `needs_by_hour` and `needs_by_car`; None without planned trips.
    week : tuple of date and float, or None
        Monday of the coldest week, and its temperature [°C].
    """

    title: str
    quantile: float
    changed: pd.DataFrame
    vehicles: pd.DataFrame
    drivers: pd.DataFrame | None = None
    needs: pd.DataFrame | None = None
    by_car: pd.DataFrame | None = None
    week: tuple[dt.date, float] | None = None

    @classmethod
    def of(
        cls, title: str, model: FleetModel, rows: TripRows, planned: Sequence[PlannedTrip] = (), *, quantile: float = QUANTILE,
        reserve: float = 0.0, drivers: bool = False,
    ) -> ManagerReport:  # fmt: skip
        """The report on the trips of a fleet.

        Parameters
        ----------
        title : str
        model : FleetModel
        rows : TripRows
            Of the trips that the model has seen.
        planned : sequence of PlannedTrip
        quantile, reserve : float
            As of `needs_by_hour`.
        drivers : bool
            Whether the drivers are compared.
        """
        week = coldest_week(rows)
        by_car = needs_by_car(model, planned, week[1], quantile=quantile) if planned and week else None
        return cls(
            title,
            quantile,
            changes(model.posterior, rows),
            deviations(model.posterior, rows),
            deviations(model.posterior, rows, drivers=True) if drivers else None,
            needs_by_hour(model, planned, quantile=quantile, reserve=reserve) if planned else None,
            by_car,
            week,
        )

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Its tables by name."""
        named = {
            "changes": self.changed,
            "vehicles": self.vehicles,
            "drivers": self.drivers,
            "needs": self.needs,
        }
        named["routes"] = None if self.by_car is None else self.by_car.reset_index()
        return {name: table for name, table in named.items() if table is not None}

    def to_dict(self, at: dt.datetime, charger_w: float) -> dict[str, Any]:
        """The report as data; `at` and `charger_w` as of `emhass`."""
        week = self.week and {"monday": f"{self.week[0]}", "ambient_temperature_degc": self.week[1]}
        night = {} if self.needs is None else night_document(self.needs, at, charger_w)
        tables = {name: records(table) for name, table in self.tables.items()}
        return {"quantile": self.quantile, "coldest_week": week, **tables, **night}

    def page(self) -> str:
        """The report as one HTML file without scripts."""
        facts = {
            "Trips": self.vehicles["trips"].sum(),
            "Vehicles": len(self.vehicles),
            "Vehicles that changed": self.changed["vehicle_id"].nunique(),
        }
        panels = [replace(panel, wide=True) for panel in self._panels()]
        return page_text("fleet.html.jinja", panels, title=self.title, facts=facts.items(), foot=_CHANGE)

    def said(self) -> Iterator[tuple[str, tuple[Table, ...]]]:
        """Sentence and tables of each panel that is not folded, for the terminal; the table of needs is long and stays in its file."""
        shown = (panel for panel in self._panels() if not panel.folded)
        return ((panel.sentence, () if panel.key == "need" else panel.tables) for panel in shown)

    def _panels(self) -> Iterator[Panel]:
        tables = (changes_table(self.changed),) if len(self.changed) else ()
        yield Panel(
            "changes", "Vehicles that changed", said_of_changes(self.changed, self.vehicles), tables=tables
        )
        if self.needs is not None:
            said = said_of_needs(self.needs, self.quantile)
            yield Panel(
                "need", "What the planned trips need", said, tables=(needs_table(self.needs, self.quantile),)
            )
        if self.by_car is not None and self.week is not None:
            said = said_of_routes(self.by_car, self.quantile, *self.week)
            yield Panel("routes", "Cars for the planned routes", said, tables=(routes_table(self.by_car),))
        for key, table in (("vehicle", self.vehicles), ("driver", self.drivers)):
            if table is not None:
                shares = (shares_table(table, key),)
                yield Panel(
                    f"{key}s", f"{key.title()}s beside others", _SHARES[key], tables=shares, folded=True
                )

    def write(self, folder: Path, at: dt.datetime, charger_w: float) -> dict[str, Any]:
        """Write the page, the data, each table as CSV and the files for EMHASS and evcc into a folder; return the data.

        Tables of an earlier report that this one lacks are removed.
        """
        document = self.to_dict(at, charger_w)
        folder.mkdir(parents=True, exist_ok=True)
        texts = {
            f"{name}.csv": table.to_csv(index=False, date_format=ISO) for name, table in self.tables.items()
        }
        if self.needs is not None:
            texts |= {"emhass.json": json.dumps(document["emhass"]), "evcc.txt": "\n".join(document["evcc"])}
        texts |= {"report.json": json.dumps(document, allow_nan=False), "report.html": self.page()}
        for name in REPORT_FILES:
            if name in texts:
                write_text(folder / name, texts[name])
            else:
                (folder / name).unlink(missing_ok=True)
        return document


_ERROR: Final = (
    "Error = |measured − forecast| / measured of a trip by the linear model of the fleet, which has not seen the trip, the vehicle or the car model that "
    "it is named after."
)
_CHANGE: Final = (
    f"A change is listed if it is {percent(LEAST_CHANGE, 0)} or more and beyond chance: in a fleet without changes, one of {1.0 / FALSE_CHANGES:.0f} reports lists "
    "one. The percentage after a cause is the probability that it is the right one; the beginning lies between the earliest and the latest day with 95 %."
)
_SHARES: Final = {
    "vehicle": "Energy beyond that of the car model on the usual trip of the car model, with one standard deviation.",
    "driver": "Energy beyond that of the vehicle's drivers together on the usual trip of the car model, with one standard deviation.",
}
NONE_CHANGED: Final = f"No vehicle changed by {percent(LEAST_CHANGE, 0)} or more beyond chance."


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
        in_words("cause", lambda row: f"{row['cause']} ({percent(row['probability'], 0)})"),
        in_words("since", "since"),
        in_words("earliest", "from_day"),
        in_words("latest", "to_day"),
        Column("more [%]", _more("change")),
        Column("trips before", "before", digits=0),
        Column("after", "after", digits=0),
        in_words("car model", "car_model"),
    )


def _more(name: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda row: f"{100.0 * row[name]:+.1f}\u00a0±\u00a0{100.0 * row['sd']:.1f}"


def said_of_needs(needs: pd.DataFrame, quantile: float) -> str:
    """The sums of the night."""
    known = needs["charge_wh"].dropna()
    charge = (
        f" {known.sum() / 1000.0:.0f} kWh are to be charged for the {len(known)} departures of vehicles whose charge is known."
        if len(known)
        else ""
    )
    energy = f"{needs['trips'].sum()} trips need {needs['energy_quantile_wh'].sum() / 1000.0:.0f} kWh"
    full = int((needs["soc_needed"] > 1.0).groupby(needs["vehicle_id"]).any().sum())
    between = (
        f" {full} vehicles have to charge between or on their trips: a full battery does not suffice for all of them."
        if full
        else ""
    )
    return f"{energy} if each gets what suffices with {percent(quantile, 0)}.{charge}{between}"


def needs_table(needs: pd.DataFrame, quantile: float) -> Table:
    """A row for each vehicle and hour of departure."""
    return tabulated(
        "By vehicle and hour of departure",
        needs.to_dict("records"),
        Column("vehicle", "vehicle_id"),
        in_words("first departure", lambda row: f"{row['departs_at']:%Y-%m-%d %H:%M}"),
        Column("trips", "trips", digits=0),
        Column("distance [km]", "distance_m", 1e-3, 0),
        in_kwh("energy, median [kWh]", "energy_wh", 1),
        in_kwh(f"suffices with {percent(quantile, 0)} [kWh]", "energy_quantile_wh", 1),
        in_percent("leave with [%]", "soc_needed", 0),
        in_percent("charge now [%]", "soc", 0),
        in_kwh("to charge [kWh]", "charge_wh", 1),
    )


def said_of_routes(by_car: pd.DataFrame, quantile: float, monday: dt.date, ambient_degc: float) -> str:
    """How many routes every car model can drive, some, and none."""
    able = (by_car <= 1.0).sum(axis=1)
    every, none = int((able == by_car.shape[1]).sum()), int((able == 0).sum())
    return (
        f"In the coldest week so far, from {monday} at {number(ambient_degc, 1.0, 0)} °C, a full battery of every car model suffices for {every} of "
        f"{len(able)} routes with {percent(quantile, 0)}; {len(able) - every - none} need some of the car models, and {none} need a charging stop in any of them. "
        "The columns have the displayed charge [%] that suffices with each car model, whichever vehicle it is; a dash is more than a full battery."
    )


def routes_table(by_car: pd.DataFrame) -> Table:
    """A row for each route and a column for each car model."""
    cars = [f"{car}" for car in by_car]

    def able(row: Mapping[str, Any]) -> str:
        names = [car for car in cars if row[car] <= 1.0]
        return "all" if len(names) == len(cars) else ", ".join(names) or "none"

    def within(car: str) -> Column:
        return in_percent(car, lambda row: row[car] if row[car] <= 1.0 else None, 0)

    rows = by_car.reset_index().to_dict("records")
    return tabulated(
        "Charge that suffices",
        rows,
        Column("route", "trip"),
        in_words("car models", able),
        *map(within, cars),
    )


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
