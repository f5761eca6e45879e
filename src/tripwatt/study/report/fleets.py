"""HTML pages on a fleet: the accuracy of its forecasts and, for its manager, vehicles that changed and needs of planned trips."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import pandas as pd

from tripwatt.errors import Fault
from tripwatt.files import csv_text, shipped_toml, write_text
from tripwatt.fleet import nights
from tripwatt.fleet.batteries import battery_table, fades, route_ends
from tripwatt.fleet.changes import (
    BATTERY,
    FALSE_CHANGES,
    MIN_CHANGE,
    changes,
    need_notes,
    without_trips_before_changes,
)
from tripwatt.fleet.charging import Depot, Night
from tripwatt.fleet.deviations import PARTS, worst_month
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.registry import REPORT_FILES, REPORT_TABLES
from tripwatt.fleet.statistics import TripRows
from tripwatt.study.evaluation.fleets import FleetEvaluation
from tripwatt.study.report.html import page_text
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.tables import Column, Table, in_kwh, in_percent, in_words, make_table, number
from tripwatt.study.report.totals import ReportSettings, drivers_by_name, totals
from tripwatt.study.report.words import listed, percent
from tripwatt.trips.reading import group_by_kind

CLASSES: Final = {
    "car_model": "car model",
    "temperature": "outside temperature",
    "length": "length of the trip",
}
MIN_TRIPS: Final = 10
"""Smallest number of trips of a vehicle whose share inside the intervals is shown: a choice, since with fewer trips chance
alone gives 70 or 100 %."""


_TABLES: Final = shipped_toml("study/report/fleet.toml")
_TEMPLATES: Final = files("tripwatt.study.report").joinpath("templates")
_CHARTED: Final = 20
"""Largest number of vehicles in a chart: a choice, because more names are not read on a phone."""


def evaluation_page(title: str, evaluation: FleetEvaluation, rows: TripRows) -> str:
    """Render the page on the accuracy of a fleet's forecasts, as one HTML file without scripts."""
    tables = (
        *(accuracy_table(evaluation, by) for by in CLASSES),
        table_of("own_trips", evaluation.own),
        _coverage_table(evaluation),
    )
    facts = {"Trips": len(rows), "Vehicles": len(set(rows.texts("vehicle_id").tolist()))}
    errors = (evaluation.trips["predicted_wh"] / evaluation.trips["observed_wh"] - 1.0).abs()
    means = errors.groupby(evaluation.trips["protocol"]).mean()
    listed = ", ".join(f"{100.0 * mean:.1f} % on {name}" for name, mean in means.items())
    caption = f"Mean error of the linear model: {listed}."
    sections = {"": [Panel("accuracy", "Accuracy on held-out trips", caption, tables=tables)]}
    return page_text("fleet.html.jinja", sections, title=title, facts=facts.items(), files=(), foot=_ERROR)


def accuracy_table(evaluation: FleetEvaluation, by: str) -> Table:
    """Tabulate mean error and coverage by one of `CLASSES`."""
    kind = in_words(CLASSES[by], by)
    return table_of("accuracy", evaluation.table(by), caption=f"By {CLASSES[by]}", **{"class": [kind]})


def _coverage_table(evaluation: FleetEvaluation) -> Table:
    """Tabulate how much the share of trips inside the interval differs between vehicles."""
    table = evaluation.table("vehicle_id")
    shares = table[table["trips"] >= MIN_TRIPS].groupby("protocol")["inside"]
    tenth, nine_tenths = (lambda s: s.quantile(0.1)), (lambda s: s.quantile(0.9))
    spread = shares.agg(n="size", low=tenth, middle="median", high=nine_tenths).reset_index()
    caption = f"Trips inside the 90 % interval, by vehicle with {MIN_TRIPS} trips or more"
    return table_of("coverage", spread, caption=caption)


def table_of(name: str, frame: pd.DataFrame, caption: str = "", **more: Sequence[Column]) -> Table:
    """Tabulate a frame with the columns that `fleet.toml` describes; those that the frame does not have are left out.

    `more` has further columns by the names at which the description places them.
    """
    described = _TABLES[name]
    more = {"totals": [Column(**column) for column in _TABLES["totals"]["columns"]], **more}
    parts = (more[c] if isinstance(c, str) else [Column(**c)] for c in described["columns"])
    columns = (column for part in parts for column in part if column.value in frame)
    return make_table(caption or described["caption"], frame.to_dict("records"), *columns)


@dataclass(frozen=True, eq=False)
class ManagerReport:
    """Report for the manager of a fleet: vehicles that changed, needs of planned trips, and cars for the planned routes.

    Attributes
    ----------
    probability : float
        Probability that the stated need suffices.
    changes : DataFrame
        From `changes`.
    vehicles : DataFrame
        From `deviations` and `total_by`, the largest gain first.
    groups, months : DataFrame or None
        From `total_by`.
    drivers : DataFrame or None
        From `drivers_by_name`; None if they were not requested or there are none.
    night : Night or None
        Needs of the planned trips and their schedule; None without planned trips.
    routes : DataFrame or None
        From `needs_by_car`; None without planned trips.
    batteries, route_ends : DataFrame or None
        From the functions `battery_table` and `route_ends`; None without readings of displays.
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
    groups: pd.DataFrame | None = None
    months: pd.DataFrame | None = None
    drivers: pd.DataFrame | None = None
    night: Night | None = None
    routes: pd.DataFrame | None = None
    batteries: pd.DataFrame | None = None
    route_ends: pd.DataFrame | None = None
    cold: nights.Cold | None = None
    refused: tuple[Fault, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(
        cls, about: Mapping[str, str], model: FleetModel, rows: TripRows,
        planned: tuple[Sequence[nights.PlannedTrip], Depot] | None = None, asked: ReportSettings | None = None,
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
        asked : ReportSettings, optional
        """
        asked = asked or ReportSettings()
        refused: list[Fault] = []
        settings: Any = {"probability": asked.probability, "reserve": asked.reserve, "refused": refused}
        changed = changes(rows)
        cold = nights.coldest_week(rows) if asked.coldest_degc is None else nights.Cold(asked.coldest_degc)
        compared = drivers_by_name(model.posterior, rows, asked.price) if asked.drivers else None
        known = fades(rows, changed)
        batteries = battery_table(known, rows, asked.warranty, asked.new_at) if known else None
        night, routes, ends = None, None, None
        if planned is not None:
            since_changes = without_trips_before_changes(model, rows, changed)
            needs = nights.needs_by_hour(since_changes, planned[0], **settings)
            of_changes = needs["vehicle_id"].map(need_notes(changed).get).fillna("")
            needs["reasons"] = (needs["reasons"].fillna("") + "; " + of_changes).str.strip("; ")
            night = Night(needs, planned[1], asked.probability)
        if planned is not None and cold is not None:
            routes = nights.needs_by_car(model, planned[0], cold.ambient_temperature_degc, **settings)
            of_route = {row["trip"]: row for row in routes.to_dict("records")}
            driven = [(trip.vehicle_id, of_route[trip.name]) for trip in planned[0] if trip.name in of_route]
            needed = [(v, r["trip"], r.get(known[v].car_model, math.nan)) for v, r in driven if v in known]
            ends = route_ends(known, needed, asked.reserve) if needed else None
        return cls(
            probability=asked.probability,
            changes=changed,
            **totals(model.posterior, rows, asked),
            drivers=None if compared is None or compared.empty else compared,
            night=night,
            routes=routes,
            batteries=batteries,
            route_ends=ends,
            cold=cold,
            refused=tuple(dict.fromkeys(refused)),
            about={**about, **worst_month(model.posterior, rows)},
        )

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Tables of the report by name; those that are None are left out."""
        of_night = {} if self.night is None else self.night.tables
        tables = {name: of_night.get(name, getattr(self, name, None)) for name in REPORT_TABLES}
        return {name: table for name, table in tables.items() if table is not None}

    @property
    def notes(self) -> list[str]:
        """Notes on assumptions and limits of the needs, and on planned trips that are left out; a vehicle is named where it is the only one."""
        rows = [] if self.night is None else self.night.needs[["vehicle_id", "reasons"]].to_numpy().tolist()
        reasons = (((r, car, 1, f"{car}: {r}") for r in listed.split("; ") if r) for car, listed in rows)
        # a departure may have several trips
        of_rows = zip(rows, map(group_by_kind, reasons), strict=True)
        kinds = group_by_kind(
            (kind.what, row[0], 1, kind.example) for row, found in of_rows for kind in found
        )
        notes = (
            f"{kind.example if kind.places == 1 else kind.what} (departures: {kind.count} of {len(rows)})"
            for kind in kinds
        )
        left_out = (f"left out: {fault}" for fault in self.refused)
        return [*left_out, *(re.sub(r"(?<!\S)-(?=\d)", "−", note) for note in notes)]

    def page(self) -> str:
        """Render the report as one HTML file, whose tables can be sorted and filtered without a server."""
        facts = {"Vehicles": len(self.vehicles), **self.about}
        names = {*self.tables, *(("emhass", "evcc") if self.night is not None else ())}
        script, style = (_TEMPLATES.joinpath(f"fleet.{kind}").read_text("utf-8") for kind in ("js", "css"))
        digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
        context: dict[str, Any] = {"files": [n for n in REPORT_FILES if n.partition(".")[0] in names]}
        context |= {"script": script, "style": style, "digest": digest, "sentences": self.sentences}
        context |= {"title": "Fleet report", "facts": facts.items(), "charts": [*_charts(self)]}
        return page_text("manager.html.jinja", {"Details": [*self.panels()]}, foot=_CHANGE, **context)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The first page: totals, gains, changes, batteries, and what the planned trips need."""
        battery = self.changes["cause"] == BATTERY
        return (
            _describe_totals(self.vehicles, self.months),
            _describe_gains(self.vehicles),
            _describe_changes(self.changes[~battery], "consumption"),
            _describe_changes(self.changes[battery], BATTERY) + _describe_batteries(self.batteries),
            _describe_tonight(self.night, self.probability),
        )

    def panels(self) -> Iterator[Panel]:
        """Yield the panels of all tables that there are."""
        if self.night is not None:
            notes = Table("What the needs assume and their limits", ("note",), tuple(zip(self.notes)))
            tables = needs_table(self.tables["needs"], self.probability), notes
            caption = _describe_needs(self.night.needs)
            yield Panel("needs", "What the planned trips need", caption, tables=tables)
        if self.routes is not None and self.cold is not None:
            caption = describe_routes(self.routes, self.probability, self.cold)
            yield Panel("routes", "Cars for the planned routes", caption, tables=(routes_table(self.routes),))
        for key, (title, caption) in _PANELS.items():
            if key in self.tables and len(self.tables[key]):
                yield Panel(key, title, caption, tables=(table_of(key, self.tables[key]),))

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
    "one. The right cause is the probability of the cause; the beginning lies between the earliest and the latest day with 95 %."
)
_PANELS: Final[Mapping[str, tuple[str, str]]] = _TABLES["panels"]


_SAID: Final[Mapping[str, str]] = _TABLES["said"]
_CHANCE: Final = "drivers or chance"


def _in_kilo(values: Any) -> dict[str, Any]:
    """Energies in kWh, powers in kW and distances in km; other values stay as they are."""
    return {n: values[n] * 1e-3 if f"{n}".endswith(("_wh", "_w", "_m")) else values[n] for n in values}


def _describe_totals(vehicles: pd.DataFrame, months: pd.DataFrame | None) -> str:
    """Say what the fleet drove, took, paid and emitted, beside the expectation."""
    known = [] if months is None else months.to_dict("records")
    sums = vehicles[["trips", "distance_m", "energy_wh", "expected_wh", "cost", "co2_kg"]].sum().to_dict()
    excess = sums["energy_wh"] / sums["expected_wh"] - 1.0
    period = f"From {known[0]['month']} to {known[-1]['month']}" if known else "In all"
    last = _SAID["last_month"].format(**_in_kilo(known[-1])) if known else ""
    said: dict[str, Any] = {"period": period, "last": last, "vehicles": len(vehicles)}
    said["beside"] = f"{percent(abs(excess))} {'more' if excess > 0.0 else 'less'}"
    said |= {name: f"{value:,.0f}" for name, value in _in_kilo(sums).items()}
    return str(_SAID["totals"].format(**said))


def _describe_gains(vehicles: pd.DataFrame) -> str:
    """Say what is gained if no vehicle takes more than expected."""
    first = vehicles[vehicles["gain"] > 0.0]
    sure = int((first["share"] > 2.0 * first["sd"]).sum())
    rows = ({**row, _CHANCE: 0.0} for row in first[:5].to_dict("records"))
    why = ((row, max((*PARTS, _CHANCE), key=row.__getitem__).replace("_", " ")) for row in rows)
    named = listed([f"{row['vehicle_id']} ({row['gain']:,.0f} €, {part})" for row, part in why])
    return str(_SAID["gains"].format(vehicles=len(first), gain=first["gain"].sum(), named=named, sure=sure))


def _describe_changes(changed: pd.DataFrame, what: str) -> str:
    """Say which vehicles changed, by which cause and since which month."""
    of = "{vehicle_id} by {share} % ({cause}) since {since:.7}"
    share = [number(value, 100.0, 0) for value in changed["change"]]
    rows = changed.assign(share=share)[:5].to_dict("records")
    count = changed["vehicle_id"].nunique()
    named = listed([of.format_map(row).replace(f" ({what})", "") for row in rows])
    in_all = f"; {count} in all" if count > len(rows) else ""
    return str(_SAID["changes"].format(what=what, named=named, in_all=in_all))


def _describe_batteries(batteries: pd.DataFrame | None) -> str:
    """Say which batteries fall below their warranty, and when."""
    if batteries is None:
        return ""
    first = batteries.dropna(subset="month").sort_values("month")[:5]
    named = listed((first["vehicle_id"] + " in " + first["month"]).tolist())
    return f" {_SAID['batteries']}".format(named=named)


def _describe_tonight(night: Night | None, probability: float) -> str:
    """Say what the planned trips need together, and what the schedule of charging costs and lacks."""
    if night is None:
        return str(_SAID["nothing_planned"])
    needs, sums = night.needs, night.summary
    said = {**sums, "vehicles": needs["vehicle_id"].nunique(), "charge_wh": needs["charge_wh"].sum()}
    said |= {"level": percent(probability, 0), "chance": percent(sums["p_enough"], 1)}
    said["more"] = "" if said["chance"] == percent(1.0, 1) else _SAID["more"]
    parts = [_SAID["tonight"].format(**_in_kilo(said))]
    if "peak_w" in sums:
        said["cost"] = f" and costs {sums['cost']:.2f} €" if "cost" in sums else ""
        # a departure lacks what one before lacked, too
        said["missing_wh"] = night.tables["needs"].groupby("vehicle_id")["missing_wh"].max().sum()
        said["in_time_wh"] = said["charge_wh"] - said["missing_wh"]
        parts.append(_SAID["schedule"].format(**_in_kilo(said)))
    if sums.get("fails_first"):
        parts.append(_SAID["fails_first"].format(**_in_kilo(sums["fails_first"])))
    return " ".join(parts)


def _charts(report: ManagerReport) -> Iterator[dict[str, Any]]:
    """Yield the charts of the first page: names on the x axis, and label and values of each series."""
    months, first = report.months, report.vehicles.head(_CHARTED)
    for title, name, table, series in (
        ("Energy by month [kWh]", "month", months, {"measured": "energy_wh", "expected": "expected_wh"}),
        ("Cost above expectation by vehicle [€]", "vehicle_id", first, {"above expectation": "gain"}),
    ):
        if table is not None:
            values = [[label, _in_kilo(table)[key].round(1).tolist()] for label, key in series.items()]
            yield {"title": title, "names": table[name].tolist(), "series": values}


def _describe_needs(needs: pd.DataFrame) -> str:
    """Say how the needs of the planned trips count."""
    full = needs["vehicle_id"][needs["soc_needed"] > 1.0].nunique()
    return (
        f"Planned trips: {needs['trips'].sum()}. The charge now is known for {needs['charge_wh'].count()} of {len(needs)} departures. "
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
        in_percent("suffices now with [%]", "p_enough", 0),
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
