"""Commands on a fleet: fit it on a trip store, update it every night, compare, promote, forecast, evaluate."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tripwatt.command import shared
from tripwatt.command.forecast import show_arrival
from tripwatt.command.options import Answer, argument, assignments, flag, make_group, option, require_effect
from tripwatt.command.printing import console, print_notes, print_table, progress, say
from tripwatt.command.stores import Store
from tripwatt.errors import or_none, percent, require_extras
from tripwatt.files import csv_text
from tripwatt.fleet import Warranty

if TYPE_CHECKING:
    from tripwatt.fleet import executors
    from tripwatt.fleet.registry import Registry
    from tripwatt.fleet.statistics import TripRows
    from tripwatt.study.report.fleets import ManagerReport


RegistryFolder = Annotated[Path, argument("REGISTRY", "Folder of the model's versions.")]
CLUSTER = "Scheduler of a Dask cluster, such as tcp://10.0.0.5:8786, in place of --jobs."
CHOICES = "A library car, a TOML file, or all cars of a body, such as van. Repeatable."
CLIMATE = "CSV with month, mean_degc, sd_k; or a store, whose trips have temperatures. Default: ROUTES."
CHOICE = {"route": "{route}", "vehicle": "{car}", "year": "{chance}", "worst month": "{worst_chance}", "month": "{month}",
          "charge": "{soc_needed}", "kWh/year": "{energy_wh:,.0f}", "€/year": "{cost:,.0f}", "smallest": "{smallest}"}  # fmt: skip
NEW_CARS = "N more vehicles of this car drive the routes, too, in turn. Repeatable."
NEW = "{vehicles} new vehicles take {kwh:,.0f} kWh and {cost:,.0f} € a year; in the worst month one charge is enough with at least {share}."
SMALLEST = "In 95 % of the nights {chargers} of {charger_w:g} W are enough if vehicles take turns, with a peak of {peak_w:,.0f} W. Each vehicle then has enough with {level:.3g} %, all of them with {share}."
NO_TRIPS = "a worst month in which no trip was driven has uncertain weather; --climate takes that of a CSV"
WARRANTY = "What is guaranteed of the batteries' energy, up to which age and distance; a choice."
WORK = "Folder of finished parts, which every worker reaches. Default: REGISTRY/work."


@dataclass(frozen=True, kw_only=True)
class Workers:
    """Processes or a cluster that work on the trips of a fleet."""

    jobs: Annotated[int, option("N", "Processes of this machine.", min=1)] = 1
    cluster: Annotated[str | None, option("ADDRESS", CLUSTER)] = None

    def running(self) -> AbstractContextManager[executors.Workers]:
        """Start processes or connect to a cluster; the context gives the executor and the number of its workers."""
        from tripwatt.fleet.executors import executor_for

        return executor_for(self.jobs, self.cluster)


@dataclass(frozen=True, kw_only=True)
class Fleet(Store, Workers):
    """A fleet: the store of its trips, the registry of its model's versions, and the workers."""

    registry: RegistryFolder
    work: Annotated[Path | None, option("FOLDER", WORK)] = None

    @property
    def place(self) -> Path:
        """Folder of finished parts."""
        return self.work or self.registry / "work"


def _registry(folder: Path) -> Registry:
    from tripwatt.fleet.registry import Registry

    return Registry(folder)


def fit(fleet: Fleet) -> Answer:
    """Fit a model on the trips of a store, and promote it if the registry has no version in use.

    An interrupted fit goes on with its finished parts.

    For example:

      # fit on all trips of the store fleet
      tripwatt fleet fit fleet models --jobs 4
      # fit on a Dask cluster
      tripwatt fleet fit fleet models --cluster tcp://10.0.0.5:8786
    """
    from tripwatt.fleet.model import fit_fleet

    source, target = fleet.opened(), _registry(fleet.registry)
    with progress(console()) as advance, fleet.running() as workers:
        model = fit_fleet(source, fleet.place, workers, progress=advance)
    version = target.add(model, f"fit on {model.trips} trips")
    first = or_none(target.current) is None
    if first:
        target.promote(version)
    return Answer(
        {"version": version, "in_use": first, "trips": model.trips, "vehicles": len(model.vehicles())},
        f"version {version}: {model!r}" + (", in use" if first else "; promote it to use it"),
    )


def update(fleet: Fleet) -> Answer:
    """Take new trips of a store into the model in use, as a new version, and report how they were forecast.

    Only the new trips are read. The sums of the linear part are those of a fit on all trips; trees, residual process and
    scores stay as they are until the next refit.

    For example:

      # take in the trips of last night
      tripwatt fleet update fleet models
    """
    from tripwatt.fleet.deviations import drift
    from tripwatt.fleet.model import update_fleet

    source, target = fleet.opened(), _registry(fleet.registry)
    before = target.load()
    with fleet.running() as workers:
        model, rows = update_fleet(before, source, fleet.place, workers)
    version = target.current()
    if not len(rows):
        return Answer({"version": version, "trips": 0}, f"version {version}: no new trips")
    change = drift(before.posterior, rows)
    version = target.add(model, f"update by {len(rows)} trips")
    target.promote(version)
    shown = partial(_show_update, f"version {version}: {model!r}", change)
    return Answer({"version": version, **change}, shown)


def _show_update(updated: str, change: Mapping[str, Any]) -> None:
    new = f"{change['trips']} new trips, bias {percent(change['bias'], 1, '+')}"
    say(f"{updated}; {new}, {percent(change['coverage'])} inside the 90 % interval")
    drifting = [
        (name, f"{v['trips']}", f"{100.0 * v['bias']:+.1f}", f"{v['z']:+.1f}")
        for name, v in change["vehicles"].items()
    ]
    if drifting:
        columns = ("vehicle", "new trips", "more than forecast [%]", "standard errors")
        print_table("Vehicles that drift", columns, drifting, numbers=columns[1:])


def refit(
    fleet: Fleet,
    weeks: Annotated[float, option("N", "Newest weeks, on which the new model is compared.", min=0.1)] = 4.0,
) -> Answer:
    """Fit anew on all but the newest weeks, compare with the model in use, and promote it unless it is worse.

    Worse means an error that is more than 5 % larger, beyond chance. Both models are compared on trips of the newest weeks, which
    neither has seen. A promoted model then takes them in. The exit code is 1 if the model in use stays.

    For example:

      # fit anew, and promote it if it is not worse
      tripwatt fleet refit fleet models --weeks 4
    """
    from tripwatt.fleet.life import refit_fleet

    source, target = fleet.opened(), _registry(fleet.registry)
    with progress(console()) as advance, fleet.running() as workers:
        done = refit_fleet(source, target, fleet.place, workers, weeks=weeks, progress=advance)
    version, comparison, promoted = done
    document = {"version": version, "in_use": promoted, "reason": f"{comparison}"}
    sentence = f"version {version} is {'' if promoted else 'not '}in use: {comparison}"
    return Answer(document | {"comparison": asdict(comparison)}, sentence, code=not promoted)


def versions(registry: RegistryFolder) -> Answer:
    """List the versions of a registry and what was done with them.

    For example:

      # list the versions and their history
      tripwatt fleet versions models
    """
    target = _registry(registry)
    history, in_use = target.history(), or_none(target.current)
    rows = [(h["time"], h["action"], h["version"], h["note"]) for h in history]
    title = f"{len(target.versions())} versions, {in_use or 'none'} in use"
    return Answer(
        {"versions": list(target.versions()), "in_use": in_use, "history": history},
        partial(print_table, title, ("time", "action", "version", "note"), rows, folding=("note",)),
    )


def promote(
    registry: RegistryFolder,
    version: Annotated[str, argument("VERSION", "A version of `tripwatt fleet versions`.")],
) -> Answer:
    """Use a version from now on, a newer or an older one. Programs that follow the registry change without losing a request.

    For example:

      # use version 0003 from now on
      tripwatt fleet promote models 0003
    """
    _registry(registry).promote(version)
    return Answer({"in_use": version}, f"version {version} is in use")


def forecast(
    registry: RegistryFolder,
    trip: Annotated[Path, argument("TRIP", "A route or a speed trace, as for `tripwatt forecast`.")],
    vehicle_id: Annotated[str, option("ID", "The vehicle.")],
    departure: shared.DepartingNow,
    car_model: Annotated[str | None, option("NAME", "The car model of a vehicle without trips.")] = None,
    driver: Annotated[str | None, option("NAME", "The driver, if the store has trips of theirs.")] = None,
    reserve: shared.Reserve = 0.1,
) -> Answer:
    """Forecast a trip of one vehicle with the version in use. A vehicle without trips starts from its --car-model.

    For example:

      # forecast a trip of one vehicle
      tripwatt fleet forecast models trip.csv --vehicle-id V17 --soc 0.8
    """
    model = _registry(registry).load()
    plan = shared.read_plan(trip)
    with shared.options_named():
        known = departure()
    expected = model.forecast(plan, known, vehicle_id=vehicle_id, car_model=car_model, driver=driver)

    shown = partial(show_arrival, expected, vehicle_id, reserve)
    return Answer(lambda: {"vehicle_id": vehicle_id, **expected.to_dict(reserve)}, shown)


def batch(
    workers: Workers,
    registry: RegistryFolder,
    trips: Annotated[Path, argument("TRIPS.parquet", "One row a link; see docs/howto/fleet.md.")],
    out: shared.OutFile = Path("forecasts.parquet"),
    quantile: Annotated[list[float] | None, option("Q", "Repeatable. Default: 0.05, 0.5, 0.95.")] = None,
    reserve: shared.Reserve = 0.1,
) -> Answer:
    """Forecast many planned trips with the version in use, Parquet in and Parquet out.

    The exit code is 1 if a trip cannot be forecast; the column error of FILE has the reason. Repeat a batch that was stopped:
    it goes on with the parts that are finished, in FILE.unfinished.

    For example:

      # forecast many planned trips
      tripwatt fleet batch models tomorrow.parquet --out forecasts.parquet
    """
    with workers.running() as running:  # worker processes import modules while this process does
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

        from tripwatt.fleet.batch import QUANTILES, forecast_batch

        target, asked = _registry(registry), quantile or QUANTILES
        model = target.path(target.current())
        done = forecast_batch(model, trips, out, running, quantiles=asked, reserve=reserve)
    table = pq.read_table(out, columns=["energy_wh", "error"])
    failed = done - int(table["error"].null_count)
    total_wh = float(pc.sum(table["energy_wh"]).as_py() or 0.0)
    without = f"; {failed} cannot be forecast, see the column error" if failed else ""
    document = {"out": str(out), "trips": done, "failed": failed, "energy_wh": total_wh}
    sentence = f"{out}: {done} trips, {total_wh / 1000.0:.1f} kWh in all{without}"
    return Answer(document, sentence, code=failed > 0)


def report(
    fleet: Fleet,
    planned: Annotated[Path | None, option("FILE", "Planned trips, CSV or Parquet: what they need.")] = None,
    out: Annotated[Path | None, option("FOLDER", "Default: REGISTRY/report.", "--out", "-o")] = None,
    ambient: Annotated[float | None, option("DEGC", "Outside temperature of trips that have none.")] = None,
    cold: Annotated[float | None, option("DEGC", "Outside temperature of all planned trips.")] = None,
    coldest: Annotated[float | None, option("DEGC", "Temperature in place of the coldest week's.")] = None,
    drivers: Annotated[bool, flag("--drivers", "Drivers by name, for all who open the report.")] = False,
    groups: Annotated[Path | None, option("FILE", "CSV: vehicle_id and group, such as the depot.")] = None,
    new: Annotated[Path | None, option("FILE", "CSV: vehicle_id, new_at (first day; else of logs).")] = None,
    warranty: Annotated[tuple[float, float, float], option("SHARE YEARS KM", WARRANTY)] = Warranty(),
    price: Annotated[float, option("EUR", "Price of a kWh from the plug; 0.30 is a choice.", min=0.0)] = 0.3,
    co2: Annotated[float, option("G", "CO2 of a kWh from the plug; 250 is a choice.", min=0.0)] = 250.0,
    probability: shared.Probability = 0.95,
    reserve: shared.Reserve = 0.1,
    plug: Annotated[float, option("W", "Power of a charger.", min=1.0)] = 7400.0,
    begins: Annotated[str | None, option("TIME", "When charging may begin, such as 18:00; else now.")] = None,
    grid: Annotated[float | None, option("KW", "Largest power of all chargers.", min=0.0)] = None,
    tariff: Annotated[Path | None, option("FILE", "Prices a kWh: begins_at, price.")] = None,
) -> Answer:
    """Report energy, cost and CO2 beside expectation, changes of vehicles, and what planned trips need, as HTML, CSV and JSON.

    With --planned the folder has needs.csv, emhass.json and evcc.txt as well, for the management of charging; with --grid or --tariff
    also schedule.csv, the cheapest schedule. The exit code is 1 if a planned trip cannot be forecast; the report has its reason and the needs of the others.

    For example:

      # what the vehicles took and which changed
      tripwatt fleet report fleet models --price 0.25
      # and what the trips of tomorrow need
      tripwatt fleet report fleet models --planned tomorrow.csv --plug 11000 --grid 60
      # and if it freezes hard
      tripwatt fleet report fleet models --planned tomorrow.csv --plug 11000 --grid 60 --cold -15
    """
    from tripwatt.fleet.charging import Depot, read_tariff
    from tripwatt.fleet.nights import parse_time, read_planned
    from tripwatt.fleet.store import read_by_vehicle
    from tripwatt.study.report.fleets import ManagerReport
    from tripwatt.study.report.totals import ReportSettings

    now = dt.datetime.now().astimezone()
    at = now if begins is None else shared.time_of(begins, "--begins")
    versions, folder = _registry(fleet.registry), out or fleet.registry / "report"
    about = {"Price": f"{price:g} €/kWh", "CO₂": f"{co2:g} g/kWh"}
    about |= {"Store": fleet.store, "Written": f"{now:%Y-%m-%d %H:%M}", "Model version": versions.current()}
    if planned is not None:
        about |= {"A need is enough with": f"{100 * probability:g} %", "Reserve": f"{100 * reserve:g} %"}
        about |= {"Charger": f"{plug / 1e3:g} kW", "Charging begins": f"{at:%Y-%m-%d %H:%M %z}"}
    trips = read_planned(planned, ambient) if planned is not None else []
    if cold is not None:
        trips, about["Planned trips at"] = [trip.in_air(cold) for trip in trips], f"{cold:g} °C"
    ahead = [trip for trip in trips if trip.departs_at >= min(now, at)]
    rows = _rows(fleet, fleet.place, fleet)
    depot = Depot(at, plug, grid and 1e3 * grid, {} if tariff is None else read_tariff(tariff))
    named = {} if groups is None else read_by_vehicle(groups, "group")
    days = {} if new is None else read_by_vehicle(new, "new_at")
    new_at = {v: f"{parse_time(day, f'{new}: new_at'):%Y-%m-%d}" for v, day in days.items() if day}
    held = Warranty(*warranty)
    asked = ReportSettings(probability, reserve, drivers, coldest, price, co2, named, new_at, held)
    result = ManagerReport.of(about, versions.load(), rows, (ahead, depot) if ahead else None, asked)
    document = result.write(folder)
    if drivers and result.drivers is None:
        print_notes(["no trip of the store names its driver, so that drivers cannot be compared"])
    if len(ahead) < len(trips):
        past = f"left out: {len(trips) - len(ahead)} of {len(trips)} planned trips, which departed before"
        print_notes([f"{past} {min(now, at):%Y-%m-%d %H:%M}"])
    shown = partial(_show_report, result, folder)
    return Answer({"out": f"{folder}", **document}, shown, code=len(result.refused) > 0)


def _show_report(result: ManagerReport, folder: Path) -> None:
    worst = result.about.get("Worst month")
    say(*result.sentences, *([f"Worst month: {worst}."] if worst else ()))
    for panel in result.panels():
        if panel.key in ("needs", "routes"):
            say(panel.caption)
    print_notes(result.notes)
    say(f"{folder / 'report.html'}")


def choose(
    routes: Annotated[str, argument("ROUTES", "Planned trips (CSV, Parquet), GPX tracks, or a trip store.")],
    registry: Annotated[Path | None, option("REGISTRY", "Choose from the vehicles of this model.")] = None,
    car: Annotated[list[str] | None, option("NAME|FILE|BODY", CHOICES)] = None,
    climate: Annotated[str | None, option("FILE|STORE", CLIMATE)] = None,
    days: Annotated[float, option("N", "Days of a year on which a route is driven.", min=1, max=366)] = 250,
    price: Annotated[float, option("EUR", "Price of a kWh from the plug; 0.30 is a choice.", min=0.0)] = 0.3,
    new: Annotated[shared.Texts, option("CAR=N", NEW_CARS)] = None,
    grid: Annotated[float | None, option("KW", "Largest power of all chargers.", min=0.0)] = None,
    probability: shared.Probability = 0.95,
    reserve: shared.Reserve = 0.1,
    out: Annotated[Path | None, option("FILE", "Every route and vehicle, CSV.", "--out", "-o")] = None,
) -> Answer:
    """Choose a vehicle for each route over a year of weather, and count the chargers.

    A vehicle serves a route if one charge is enough in the worst month; `smallest` is the car with the smallest battery that does. --registry assigns vehicles to routes, one each, and counts the fewest chargers,
    with --new also for more vehicles, with --grid below a power limit; --car compares cars that you do not have. The days of a route are planned (columns as for `tripwatt fleet report --planned`), tracks, or recorded in a store,
    also by combustion vehicles. The exit code is 1 if no vehicle serves a route.

    For example:

      # which vehicle for which route, and how many chargers
      tripwatt fleet choose routes.csv --registry models --climate fleet
      # what 30 more vans need, if all chargers together have 60 kW
      tripwatt fleet choose routes.csv --registry models --climate fleet --new vw_id_buzz=30 --grid 60
      # replace combustion vans, whose tracks or logs there are, by electric ones
      tripwatt fleet choose tracks-of-van-7 --car van --car vans/evito.toml --climate climate.csv
    """
    import pandas as pd

    from tripwatt.fleet import choice

    if registry is None:
        require_effect({"--new": new or None, "--grid": grid}, "only together with --registry")
    fleet = None if registry is None else _registry(registry).load()
    library = [*choice.library_candidates(car or [], fleet is not None)]
    of_year, driven = choice.Climate.read(climate or routes), choice.read_routes(routes)
    asked: dict[str, Any] = {"probability": probability, "reserve": reserve, "days": days, "price": price}
    asked |= {"grid_w": grid and 1e3 * grid, "new": assignments(new or [], "--new")}
    document = choice.choose(fleet, driven, library, of_year, **asked)
    if out is not None:
        shared.write_text(csv_text(pd.DataFrame(document["choices"])), out)
    unserved = any(row["smallest"] is None for row in document["choices"])
    return Answer(document, partial(_show_choices, document, 100.0 * probability), code=unserved)


def _show_choices(document: Mapping[str, Any], level: float) -> None:
    import pandas as pd

    from tripwatt.fleet.nights import records

    table, power, new = pd.DataFrame(document["choices"]), pd.DataFrame(document["chargers"]), document["new"]
    kwh = table.assign(energy_wh=table["energy_wh"] / 1000.0).fillna({"smallest": "none"})
    kwh["month"] = kwh["worst_month"].astype(str) + kwh["has_trips"].map({True: "", False: " (no trips)"})
    first = kwh.sort_values(["is_assigned", "worst_chance"], ascending=False, kind="stable")
    best = first.drop_duplicates("route").sort_values("route")
    best["car"] = best["car"].where(best["is_assigned"] | (not table["is_assigned"].any()), "none left")
    shares = {name: best[name].map(percent) for name in ("chance", "worst_chance", "soc_needed")}
    cells = [[form.format(**row) for form in CHOICE.values()] for row in records(best.assign(**shares))]
    print_table("Enough with one charge", [*CHOICE], cells, numbers=[*CHOICE][2:-1])
    if not best["has_trips"].all():
        print_notes([NO_TRIPS])
    if new is not None:
        say(NEW.format(**new, kwh=new["energy_wh"] / 1000.0, share=percent(new["worst_chance"])))
    for vehicles, rows in power.groupby("vehicles") if len(power) else ():
        heads = ["charger [W]", *(f"{percent(share)} of nights" for share in rows["nights"].unique())]
        shown = rows["chargers"].where(rows["fails"] == "", "–").astype(str)
        counts = shown.groupby(rows["charger_w"]).agg(list).items()
        print_table(f"Chargers for {vehicles} vehicles", heads, [[f"{w:g}", *row] for w, row in counts])
        least = rows[rows["is_smallest"] & (rows["nights"] == 0.95)]
        say(*(SMALLEST.format(**row, level=level, share=percent(row["p_enough"])) for row in records(least)))
        print_notes(f"short with a charger of its own: {name}" for name in rows["fails"].unique() if name)


def _rows(store: Store, work: Path, on: Workers) -> TripRows:
    """Read the rows of the trips of a store."""
    from tripwatt.fleet.mapping import store_rows, usable_trips

    source = store.opened()
    with progress(console()) as advance, on.running() as workers:
        return store_rows(source, usable_trips(source), work, workers, progress=advance)[0]


def evaluate(
    store: Store,
    workers: Workers,
    out: shared.OutFile = Path("fleet.html"),
    work: Annotated[Path, option("FOLDER", "Folder of finished parts.")] = Path("fleet.work"),
) -> Answer:
    """Score the linear model of a fleet on later trips, new vehicles and new car models, and write one HTML page.

    The page shows errors by car model, temperature, length and number of own trips, and the calibration by vehicle.

    For example:

      # score a fleet and write its page
      tripwatt fleet evaluate fleet --out fleet.html
    """
    require_extras({"study": "tripwatt fleet evaluate"})
    from tripwatt.fleet.features import START
    from tripwatt.hybrid.groups import fit_scales
    from tripwatt.study.evaluation.fleets import evaluate_rows
    from tripwatt.study.report.fleets import accuracy_table, evaluation_page

    rows = _rows(store, work, workers)
    scores = evaluate_rows(rows, fit_scales(rows.sums, START))
    shared.write_text(evaluation_page(f"Fleet {store.store}", scores, rows), out)
    by_car_model, by_own_trips = (t.to_dict("records") for t in (scores.table("car_model"), scores.own))
    table = accuracy_table(scores, "car_model")
    return Answer(
        {"out": str(out), "by_car_model": by_car_model, "own_trips": by_own_trips},
        partial(print_table, f"{out}", table.columns, table.rows, numbers=table.columns[2:]),
    )


FLEET = make_group(
    "Many vehicles: one model of a trip store, with the deviations of each car model, vehicle and driver. It needs the "
    "extra tripwatt[fleet].",
    (fit, update, refit, versions, promote, forecast, batch, report, choose, evaluate),
)
