"""HTML pages on a fleet: the accuracy of its forecasts and, for its manager, vehicles that changed and needs of planned trips."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

import pandas as pd

from tripwatt.errors import Fault
from tripwatt.files import csv_text, write_text
from tripwatt.fleet import nights
from tripwatt.fleet.changes import (
    FALSE_CHANGES,
    MIN_CHANGE,
    changes,
    need_notes,
    without_trips_before_changes,
)
from tripwatt.fleet.charging import Depot, Night
from tripwatt.fleet.deviations import PARTS, deviations
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.registry import REPORT_FILES, REPORT_TABLES
from tripwatt.fleet.statistics import TripRows
from tripwatt.study.evaluation.fleets import FleetEvaluation
from tripwatt.study.report.html import page_text
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.tables import Column, Table, in_kwh, in_percent, in_words, make_table, number
from tripwatt.study.report.words import percent
from tripwatt.trips.reading import group_by_kind

CLASSES: Final = {
    "car_model": "car model",
    "temperature": "outside temperature",
    "length": "length of the trip",
}
MIN_TRIPS: Final = 10
"""Smallest number of trips of a vehicle whose share inside the intervals is shown: a choice, since with fewer trips chance
alone gives 70 or 100 %."""


def evaluation_page(title: str, evaluation: FleetEvaluation, rows: TripRows) -> str:
    """Render the page on the accuracy of a fleet's forecasts, as one HTML file without scripts."""
    tables = (
        *(accuracy_table(evaluation, by) for by in CLASSES),
        _own_trips_table(evaluation),
        _coverage_table(evaluation),
    )
    facts = {"Trips": len(rows), "Vehicles": len(set(rows.texts("vehicle_id").tolist()))}
    errors = (evaluation.trips["predicted_wh"] / evaluation.trips["observed_wh"] - 1.0).abs()
    means = errors.groupby(evaluation.trips["protocol"]).mean()
    listed = ", ".join(f"{100.0 * mean:.1f} % on {name}" for name, mean in means.items())
    caption = f"Mean error of the linear model: {listed}."
    panel = Panel("accuracy", "Accuracy on held-out trips", caption, tables=tables)
    return page_text(
        "fleet.html.jinja", {"": [panel]}, title=title, facts=facts.items(), files=(), foot=_ERROR
    )


def accuracy_table(evaluation: FleetEvaluation, by: str) -> Table:
    """Tabulate mean error and coverage by one of `CLASSES`."""
    return make_table(
        f"By {CLASSES[by]}",
        evaluation.table(by).to_dict("records"),
        Column("trips forecast", "protocol"),
        in_words(CLASSES[by], by),
        Column("trips", "trips", digits=0),
        in_percent("mean error [%]", "error"),
        in_percent("inside the 90 % interval [%]", "inside", 0),
    )


def _own_trips_table(evaluation: FleetEvaluation) -> Table:
    """Tabulate the mean error by the number of the vehicle's own trips in the fit."""
    return make_table(
        "Mean error by number of own trips",
        evaluation.own.to_dict("records"),
        Column("own trips", "own_trips", digits=0),
        Column("vehicles", "vehicles", digits=0),
        in_percent("fleet and own trips [%]", "pooled"),
        in_percent("own trips only [%]", "own_only"),
        in_percent("fleet only [%]", "fleet_only"),
    )


def _coverage_table(evaluation: FleetEvaluation) -> Table:
    """Tabulate how much the share of trips inside the interval differs between vehicles."""
    table = evaluation.table("vehicle_id")
    shares = table[table["trips"] >= MIN_TRIPS].groupby("protocol")["inside"]
    tenth, nine_tenths = (lambda s: s.quantile(0.1)), (lambda s: s.quantile(0.9))
    spread = shares.agg(n="size", low=tenth, middle="median", high=nine_tenths)
    return make_table(
        f"Trips inside the 90 % interval, by vehicle with {MIN_TRIPS} trips or more",
        spread.reset_index().to_dict("records"),
        Column("trips forecast", "protocol"),
        Column("vehicles", "n", digits=0),
        in_percent("lowest tenth [%]", "low", 0),
        in_percent("median [%]", "middle", 0),
        in_percent("highest tenth [%]", "high", 0),
    )


@dataclass(frozen=True, eq=False)
class ManagerReport:
    """Report for the manager of a fleet: vehicles that changed, needs of planned trips, and cars for the planned routes.

    Attributes
    ----------
    probability : float
        Probability that the stated need suffices.
    changes, vehicles : DataFrame
        From `changes` and `deviations`.
    drivers : DataFrame or None
        From `deviations`; None if they were not requested or there are none.
    night : Night or None
        Needs of the planned trips and their schedule; None without planned trips.
    routes : DataFrame or None
        From `needs_by_car`; None without planned trips.
    cold : Cold or None
        Temperature of the coldest week, or the given temperature.
    refused : tuple of Fault
        Planned trips that cannot be forecast.
    about : mapping of str to str
        Facts for the head of the report, such as the version of the model.
    """

    probability: float
    changes: pd.DataFrame
    vehicles: pd.DataFrame
    drivers: pd.DataFrame | None = None
    night: Night | None = None
    routes: pd.DataFrame | None = None
    cold: nights.Cold | None = None
    refused: tuple[Fault, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(
        cls, about: Mapping[str, str], model: FleetModel, rows: TripRows,
        planned: tuple[Sequence[nights.PlannedTrip], Depot] | None = None, *, probability: float = 0.95, reserve: float = 0.1, drivers: bool = False, coldest_degc: float | None = None,
    ) -> ManagerReport:  # fmt: skip
        """Build the report on the trips of a fleet.

        Parameters
        ----------
        about : mapping of str to str
            Facts for the head of the report, such as the version of the model.
        model : FleetModel
        rows : TripRows
            Rows of the trips that the model was fitted to.
        planned : (sequence of PlannedTrip, Depot), optional
            Planned trips, and where their vehicles are charged.
        probability, reserve : float
            As for `needs_by_hour`.
        drivers : bool
            Whether to compare the drivers.
        coldest_degc : float, optional
            Outside temperature instead of that of the coldest week [°C].
        """
        settings = {"probability": probability, "reserve": reserve}
        vehicles, changed = deviations(model.posterior, rows), changes(model.posterior, rows)
        cold = nights.coldest_week(rows) if coldest_degc is None else nights.Cold(coldest_degc)
        compared = deviations(model.posterior, rows, drivers=True) if drivers else pd.DataFrame()
        night, routes = None, None
        refused: list[Fault] = []
        if planned is not None:
            since_changes = without_trips_before_changes(model, rows, changed)
            needs = nights.needs_by_hour(since_changes, planned[0], **settings, refused=refused)
            reasons = need_notes(changed)
            of_changes = needs["vehicle_id"].map(lambda car: reasons.get(car, ""))
            needs["reasons"] = (needs["reasons"].fillna("") + "; " + of_changes).str.strip("; ")
            night = Night(needs, planned[1], probability)
        if planned is not None and cold is not None:
            routes = nights.needs_by_car(model, planned[0], cold.ambient_temperature_degc, **settings)
        named = None if compared.empty else compared
        return cls(probability, changed, vehicles, named, night, routes, cold, tuple(refused), about)

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Tables of the report by name; those that are None are left out."""
        of_night = {} if self.night is None else self.night.tables
        tables = {name: of_night.get(name, getattr(self, name, None)) for name in REPORT_TABLES}
        return {name: table for name, table in tables.items() if table is not None}

    @property
    def notes(self) -> list[str]:
        """Notes on assumptions and limits of the needs, and on planned trips that are left out."""
        if self.night is None:
            return []
        rows = self.night.needs[["vehicle_id", "reasons"]].itertuples(index=False)
        reasons = ((car, reason) for car, listed in rows for reason in listed.split("; ") if reason)
        kinds = group_by_kind((reason, car, 1, f"{car}: {reason}") for car, reason in reasons)
        notes = (f"{kind.example} (departures: {kind.count} of {len(self.night.needs)})" for kind in kinds)
        left_out = (f"left out: {fault}" for fault in self.refused)
        return [*left_out, *(re.sub(r"(?<!\S)-(?=\d)", "−", note) for note in notes)]

    def page(self) -> str:
        """Render the report as one HTML file without scripts."""
        counts = {"Trips": self.vehicles["trips"].sum(), "Vehicles": len(self.vehicles)}
        facts = {**counts, "That changed": self.changes["vehicle_id"].nunique(), **self.about}
        names = {*self.tables, *(("emhass", "evcc") if self.night is not None else ())}
        context = {"files": [n for n in REPORT_FILES if n.partition(".")[0] in names], "foot": _CHANGE}
        sections = {"": [*self.panels()]}
        return page_text("fleet.html.jinja", sections, title="Fleet report", facts=facts.items(), **context)

    def panels(self) -> Iterator[Panel]:
        """Yield the panels of changes, needs, routes, vehicles and drivers; all but the first only if there is a table."""
        tables: tuple[Table, ...] = (_changes_table(self.changes),) if len(self.changes) else ()
        caption = _describe_changes(self.changes, len(self.vehicles))
        yield Panel("changes", "Vehicles that changed", caption, tables=tables)
        if self.night is not None:
            notes = Table("What the needs assume and their limits", ("note",), tuple(zip(self.notes)))
            tables = needs_table(self.tables["needs"], self.probability), notes
            yield Panel("needs", "What the planned trips need", _describe_needs(self.night), tables=tables)
        if self.routes is not None and self.cold is not None:
            caption = describe_routes(self.routes, self.probability, self.cold)
            yield Panel("routes", "Cars for the planned routes", caption, tables=(routes_table(self.routes),))
        for key, title in (("vehicles", "Vehicles beside others"), ("drivers", "Drivers beside others")):
            if key in self.tables:
                shares = _shares_table(self.tables[key], key[:-1])
                yield Panel(key, title, _SHARES[key], tables=(shares,), folded=True)

    def write(self, folder: Path) -> dict[str, Any]:
        """Write the page, the data, each table as CSV and the files for EMHASS and evcc into a folder; return the data.

        Files of an earlier report that this report does not have are removed.
        """
        document: dict[str, Any] = {"about": {**self.about}, "probability": self.probability}
        document["refused"] = [fault.texts for fault in self.refused]
        document["coldest_week"] = self.cold and self.cold._asdict()
        document |= {name: nights.records(table) for name, table in self.tables.items()}
        texts = {f"{name}.csv": _csv_text(table) for name, table in self.tables.items()}
        if self.night is not None:
            document |= self.night.document
            lines = "".join(f"{path}\n" for path in document["evcc"])
            texts |= {"emhass.json": f"{json.dumps(document['emhass'])}\n", "evcc.txt": lines}
        texts |= {"report.json": f"{json.dumps(document, allow_nan=False)}\n", "report.html": self.page()}
        folder.mkdir(parents=True, exist_ok=True)
        for name in {*REPORT_FILES} - {*texts}:
            (folder / name).unlink(missing_ok=True)
        for name, text in texts.items():
            write_text(folder / name, text)
        return document


def _csv_text(table: pd.DataFrame) -> str:
    """Write a table as CSV, with times in ISO 8601 and their offset."""
    times = table.filter(regex="_at$").map(lambda time: time.isoformat(timespec="seconds"))
    return csv_text(table.assign(**{f"{name}": times[name] for name in times}))


_ERROR: Final = (
    "Error = |measured − forecast| / measured of a trip by the linear model of the fleet, which has not seen the trip, the vehicle or the car model that "
    "it is named after."
)
_CHANGE: Final = (
    f"A change is listed if it is {percent(MIN_CHANGE, 0)} or more and beyond chance: in a fleet without changes, one of {1.0 / FALSE_CHANGES:.0f} reports lists "
    "one. The percentage after a cause is the probability that it is the right one; the beginning lies between the earliest and the latest day with 95 %."
)
_SHARES: Final = {
    "vehicles": "Energy beyond that of the car model on the usual trip of the car model, with one standard deviation.",
    "drivers": "Energy beyond that of the vehicle's drivers together on the usual trip of the car model, with one standard deviation.",
}


def _describe_changes(changed: pd.DataFrame, vehicles: int) -> str:
    """Say how many vehicles changed, and by which causes."""
    if not len(changed):
        return f"No vehicle changed by {percent(MIN_CHANGE, 0)} or more beyond chance."
    causes = ", ".join(f"{n} by {cause}" for cause, n in changed["cause"].value_counts().items())
    return (
        f"{changed['vehicle_id'].nunique()} of {vehicles} vehicles: {causes}. A change of the consumption is a share of it; one of the battery is a "
        "share of the displayed charge that an energy takes. What all vehicles of a car model share in a month does not count."
    )


def _changes_table(changed: pd.DataFrame) -> Table:
    """Tabulate the changes, one row for each."""
    return make_table(
        "Every change, the largest first",
        changed.to_dict("records"),
        Column("vehicle", "vehicle_id"),
        in_words("cause", lambda row: f"{row['cause']} ({percent(row['probability'], 0)})"),
        in_words("since", "since"),
        in_words("earliest", "from_day"),
        in_words("latest", "to_day"),
        Column("more [%]", partial(_with_sd, "change")),
        Column("trips before", "before", digits=0),
        Column("after", "after", digits=0),
        in_words("car model", "car_model"),
    )


def _with_sd(name: str, row: Mapping[str, Any]) -> str:
    """Format a signed fraction of a row in percent, with its standard deviation."""
    return f"{100.0 * row[name]:+.1f}\u00a0±\u00a0{100.0 * row['sd']:.1f}".replace("-", "−")


def _describe_needs(night: Night) -> str:
    """Say how much energy the planned trips need and how sure it is, how much has to be charged, and what is planned."""
    needs, sums = night.needs, night.summary
    full = needs["vehicle_id"][needs["soc_needed"] > 1.0].nunique()
    cost = f" and costs {sums['cost']:.2f}" if "cost" in sums else ""
    peak = f" The schedule has a peak of {sums['peak_w'] / 1e3:.1f} kW{cost}." if "peak_w" in sums else ""
    fails = " First {vehicle_id} lacks {missing_wh:.0f} Wh at {departs_at:.16} UTC."
    peak += fails.format(**sums["fails_first"]) if sums.get("fails_first") else ""
    return (
        f"Planned trips: {needs['trips'].sum()}. Together they take {sums['energy_wh'] / 1e3:.0f} kWh (median) and with {percent(night.probability, 0)} at most "
        f"{sums['energy_quantile_wh'] / 1e3:.0f} kWh. Charged as listed, all have enough with {percent(sums['chance'], 1)}.{peak} To be charged, for "
        f"departures of vehicles whose charge now is known ({needs['charge_wh'].count()} of {len(needs)}): {needs['charge_wh'].sum() / 1e3:.0f} kWh. "
        f"Vehicles that have to charge between or on their trips, because a full battery does not suffice: {full}. What to leave with counts without "
        "charging between the trips; what to charge is the part of each hour. A vehicle that charges between its trips has a load for each part in "
        "emhass.json, and one plan for all of them, before its first departure, in evcc.txt."
    )


def needs_table(needs: pd.DataFrame, probability: float) -> Table:
    """Tabulate needs by vehicle and hour of departure; first rows with something to charge or a need of more than a full battery."""
    urgent = (needs["charge_wh"] > 0.0) | (needs["soc_needed"] > 1.0)
    return make_table(
        "By vehicle and hour of departure",
        [*needs[urgent].to_dict("records"), *needs[~urgent].to_dict("records")],
        Column("vehicle", "vehicle_id"),
        in_percent("leave with [%]", "soc_needed", 0),
        in_kwh("to charge [kWh]", "charge_wh", 1),
        in_percent("charge now [%]", "soc", 0),
        in_percent("suffices now with [%]", "chance", 0),
        in_kwh("missing [kWh]", lambda row: row.get("missing_wh"), 1),
        in_words("first departure", lambda row: f"{row['departs_at']:%Y-%m-%d %H:%M}"),
        in_kwh(f"suffices with {percent(probability, 0)} [kWh]", "energy_quantile_wh", 1),
        in_kwh("energy, median [kWh]", "energy_wh", 1),
        Column("trips", "trips", digits=0),
        Column("distance [km]", "distance_m", 1e-3, 0),
    )


def describe_routes(routes: pd.DataFrame, probability: float, cold: nights.Cold) -> str:
    """Say how many routes all car models can drive, how many only some, and how many none."""
    share = (routes.iloc[:, 1:] <= 1.0).mean(axis=1)  # of the car models that can drive a route
    by_all, by_none = int((share == 1.0).sum()), int((share == 0.0).sum())
    at = f"at {number(cold.ambient_temperature_degc, 1.0, 0)} °C"
    week = f"in the coldest week so far with {cold.min_trips} trips or more, from {cold.monday} {at}"
    when = at if cold.monday is None else week
    colder = ", ".join(f"{day} ({number(degc, 1.0, 0)} °C, {n} trips)" for day, degc, n in cold.colder)
    return (
        f"{when[0].upper()}{when[1:]}, a full battery of every car model suffices for {by_all} of {len(share)} routes with "
        f"{percent(probability, 0)}; {len(share) - by_all - by_none} more with some of the car models, {by_none} with none of them. "
        "The columns have the displayed charge [%] that suffices with each car model, whichever vehicle it is; a dash is more than a full battery."
        + (f" Colder weeks with fewer trips do not count: {colder}." if colder else "")
    )


def routes_table(routes: pd.DataFrame) -> Table:
    """Tabulate the charge that suffices: one row for each route, one column for each car model."""
    cars = [f"{car}" for car in routes.columns[1:]]

    def suitable(row: Mapping[str, Any]) -> str:
        names = [car for car in cars if row[car] <= 1.0]
        return "all" if len(names) == len(cars) else ", ".join(names) or "none"

    def charge_column(car: str) -> Column:
        return in_percent(car, lambda row: row[car] if row[car] <= 1.0 else None, 0)

    columns = Column("route", "trip"), in_words("car models", suitable), *map(charge_column, cars)
    return make_table("Charge that suffices", routes.to_dict("records"), *columns)


def _shares_table(table: pd.DataFrame, key: str) -> Table:
    """Tabulate the deviations, one row for each vehicle or driver."""
    return make_table(
        f"Every {key}, by deviation",
        table.to_dict("records"),
        Column(key, "driver" if key == "driver" else "vehicle_id"),
        in_words("car model", "car_model"),
        Column("trips", "trips", digits=0),
        Column("more [%]", partial(_with_sd, "share")),
        *(in_percent(f"{part.replace('_', ' ')} [%]", part) for part in PARTS),
    )
