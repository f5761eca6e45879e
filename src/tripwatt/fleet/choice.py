"""Which vehicle serves which route over a year of weather, and how many chargers the routes need.

A route is what a vehicle drives on one charge, on one day or several: planned trips, or the recorded days of a vehicle of any kind. Each
of its trips is forecast at some temperatures, between which energy and charge are linear.
"""

from __future__ import annotations

import datetime as dt
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq, linear_sum_assignment
from scipy.special import ndtr, ndtri

from tripwatt.arrays import FloatArray, IntArray, by_key
from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.fleet.charging import EFFICIENCY, Depot, schedule
from tripwatt.fleet.features import FEATURES, trip_features
from tripwatt.fleet.mapping import load_car
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.nights import SD_LEVEL, PlannedTrip, needs_by_hour, read_planned, records, sum_up_depot
from tripwatt.fleet.store import TripStore, open_store
from tripwatt.forecasting import ForecastModel
from tripwatt.hybrid.segments import day_of
from tripwatt.population import for_car
from tripwatt.roads.journey.distances import trip_quantiles
from tripwatt.roads.journey.kinds import UNKNOWN, usual_air
from tripwatt.routes import parse_route
from tripwatt.sources.columnar import open_table
from tripwatt.trips import Departure, Plan, raise_faults
from tripwatt.trips.columns import require_number
from tripwatt.vehicles.catalogue import BODIES, catalogue, table_names

POWERS_W: Final = (3700.0, 7400.0, 11000.0, 22000.0)
"""Powers of usual chargers with alternating current [W]."""
NIGHTS: Final = (0.5, 0.9, 0.95, 0.99)
"""Shares of the nights of a year for which chargers are counted."""
_NODES: Final = 7
_AIRS: Final = 15
"""Temperatures at which trips are forecast, and temperatures of a month: choices, with which chances differ by less than a point from those
of twice as many."""
_MAX_DAYS: Final = 12
"""Largest number of days of a route that are forecast, one of each twelfth of the days by distance: a choice, because forecasts take long."""
_BEFORE: Final = dt.timedelta(hours=12)
"""Time before the first departure at which charging begins: a choice, a night."""

MOST_NEW: Final = 500
"""Largest number of new vehicles of a car: a choice, far above what a depot takes."""

Routes = Mapping[str, Sequence[Sequence[PlannedTrip]]]
"""Name of a route -> its days -> trips of a day on one charge."""

Driven = tuple[str, str, str | None]
"""A route, the vehicle that drives it, and the car model of a vehicle without trips."""


class Climate(NamedTuple):
    """Outside temperature of the days of each month.

    Attributes
    ----------
    mean_degc, sd_k : ndarray, shape (12,)
        Mean [°C] and standard deviation [K], from January on.
    unknown : frozenset of int
        Months, 1 to 12, without a trip that has a temperature: theirs is that of trips of the months around, and uncertain.
    """

    mean_degc: FloatArray
    sd_k: FloatArray
    unknown: frozenset[int] = frozenset()

    @classmethod
    def read(cls, place: Path | str) -> Climate:
        """Read the columns `month` (1 to 12), `mean_degc` and `sd_k` of a CSV file, or take the temperatures of a store's trips.

        With a store, a month is as `usual_air` has it: one with few trips is uncertain.

        Raises
        ------
        InvalidInput
            If a month is missing, or no trip of the store has a temperature.
        """
        if Path(place).is_file():
            table = open_table(Path(place))
            numbers = np.array(table.numbers(["month", "mean_degc", "sd_k"]))
            raise_faults(table.faults)
            month, mean, sd = numbers[:, np.argsort(numbers[0])]
            if month.tolist() != list(range(1, 13)) or not (sd >= 0.0).all():
                got = f"no month {', '.join(str(k) for k in range(1, 13) if k not in month) or 'is missing'}"
                allowed = "month, each of 1 to 12 once, mean_degc, sd_k (>= 0)"
                fix = "give --climate: such a CSV, or a store whose trips have temperatures"
                raise InvalidInput.of("not the months of a year", f"{place}", got, allowed, fix)
            return cls(mean, sd)
        trips = open_store(place).trips(columns=["started_at", "ambient_temperature_degc"]).dropna()
        if trips.empty:
            fix = "give a CSV with month, mean_degc, sd_k"
            raise InvalidInput.of("no temperatures", f"{place}", "trips without any", "some with one", fix)
        day = [day_of(dt.datetime.fromisoformat(f"{at}")) for at in trips["started_at"]]
        air = np.column_stack([trips["ambient_temperature_degc"], day])
        usual = np.array([usual_air(air, 365.25 * (k + 0.5) / 12.0) for k in range(12)])
        driven = {int(f"{at}"[5:7]) for at in trips["started_at"]}
        return cls(usual[:, 0], usual[:, 1], frozenset(range(1, 13)) - driven)

    @property
    def air_degc(self) -> FloatArray:
        """Equally likely temperatures of each month [°C], shape (12, temperatures)."""
        z = ndtri((np.arange(_AIRS) + 0.5) / _AIRS)
        return np.asarray(self.mean_degc[:, None] + self.sd_k[:, None] * z)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A vehicle that may drive a route.

    Attributes
    ----------
    name : str
    model : ForecastModel
        Model of its car model.
    is_owned : bool
        Whether it is one vehicle of the fleet, which can drive one route only.
    weights, covariance : ndarray, shape (features,) and (features, features)
        Weights of the vehicle minus those of its car model, and the same of their covariance; 0 for a car that is not of the fleet.
    """

    name: str
    model: ForecastModel
    is_owned: bool = False
    weights: FloatArray | float = 0.0
    covariance: FloatArray | float = 0.0

    def amounts(self, taken: FloatArray) -> FloatArray:
        """Add the deviation of the vehicle to what its car model takes, from `_day` with the shape (days, temperatures, ...).

        Returns
        -------
        ndarray, shape (3, days, temperatures)
            Median of the energy [Wh], and of the displayed charge, and the standard deviation of the latter.
        """
        energy_wh, soc, sd_wh, sd = np.moveaxis(taken[..., :4], -1, 0)
        x, (_, uncertainty) = taken[..., 5:], self.model.fitted_parts("choices")
        ratio = 1.0 + (x * self.weights).sum(axis=-1) / energy_wh
        more = (x[..., None] * self.covariance * x[..., None, :]).sum(axis=(-2, -1))
        more *= uncertainty.scale.values[3] ** 2
        wider = np.sqrt(np.maximum(1.0 + more / sd_wh**2, 0.01))
        return np.stack([energy_wh * ratio, soc * ratio, sd * wider])


def fleet_candidates(fleet: FleetModel, new: Sequence[str] = ()) -> Iterator[Candidate]:
    """Yield the vehicles of a fleet, and new ones of cars of the library as "new CAR"."""
    vehicles = sorted(fleet.vehicles().items())
    models = {name: fleet.of_vehicle(None, car_model=name) for name in dict(vehicles).values()}
    for vehicle, name in vehicles:
        own, usual = (fleet.posterior.weights(name, each) for each in (vehicle, None))
        yield Candidate(vehicle, models[name], True, own[0] - usual[0], own[1] - usual[1])
    yield from (Candidate(f"new {car}", fleet.of_vehicle(None, car_model=car)) for car in new)


def library_candidates(names: Sequence[str], has_fleet: bool = False) -> Iterator[Candidate]:
    """Yield cars of the library, of TOML files, and of a kind of body, such as "van", by the model that comes with the package.

    Without a fleet, at least one name has to be given.
    """
    if not (names or has_fleet):
        raise InvalidInput.of("no vehicles", "--registry, --car", "neither", "one of them", "--car van")
    for name in names:
        bodies = ((car, cell.value) for car in table_names() for cell in catalogue()[car].get("body", ()))
        of_body = [car for car, body in bodies if body == name] if name in BODIES else [name]
        yield from (Candidate(car, for_car(None, load_car(car))) for car in of_body)


def read_routes(place: Path | str) -> Routes:
    """Read routes: a table of planned trips, a GPX track or a folder of tracks, or the recorded trips of a store.

    Trips of the same name, vehicle and date are one day of a route. A route of tracks has the name of their folder, one of a store that of its
    vehicle; their logs need neither charge nor energy.

    Raises
    ------
    InvalidInput
        If there is no such file or store, or it has no trips.
    """
    path = Path(place)
    tracks = sorted(path.glob("*.gpx")) if path.is_dir() else [path] * (path.suffix == ".gpx")
    if tracks:
        name = tracks[0].absolute().parent.name
        trips = [_recorded(name, k, parse_route(track).plan()) for k, track in enumerate(tracks)]
    else:
        trips = read_planned(path) if path.is_file() else list(_stored(open_store(place)))
    if not trips:
        raise InvalidInput.of("no trips", f"{place}", "none", "planned trips, tracks or a store with trips")
    return routes_of(trips)


def routes_of(trips: Sequence[PlannedTrip]) -> Routes:
    """Group planned trips into routes and their days, as `read_routes` does."""
    days = by_key(trips, lambda trip: (trip.name, trip.departs_at.date(), trip.vehicle_id))
    routes = by_key(sorted(days), lambda day: day[0])
    return {name: _spread([days[day] for day in of_route], _length_m) for name, of_route in routes.items()}


def _spread(days: Sequence[Any], length_m: Callable[[Any], float]) -> list[Any]:
    """Return at most `_MAX_DAYS` days, evenly spread over their lengths."""
    chosen = np.unique(((np.arange(_MAX_DAYS) + 0.5) * len(days) / _MAX_DAYS).astype(int))
    ordered = sorted(range(len(days)), key=lambda i: length_m(days[i]))
    return [days[i] for i in sorted(ordered[k] for k in chosen)]


def _length_m(day: Sequence[PlannedTrip]) -> float:
    return sum(trip.road.distance_m if isinstance(trip.road, Plan) else 1000.0 * trip.road for trip in day)


def _stored(store: TripStore) -> Iterator[PlannedTrip]:
    """Yield the trips of a store, of some days of each vehicle; a log without sound drives, such as one without energy, is one trip."""
    rows = by_key(store.trip_rows(), lambda row: row["vehicle_id"])
    for vehicle, of_vehicle in rows.items():
        days = by_key(enumerate(of_vehicle), lambda item: f"{item[1]['started_at'] or item[0]}"[:10])
        spread = _spread([*days.values()], lambda day: sum(row["distance_m"] or 0.0 for _, row in day))
        chosen = [row for day in spread for _, row in day]
        trips = (trip for log in store.logs(chosen) for trip in audit([log]).trips or (log,))
        yield from (_recorded(vehicle, k, Plan.from_trip(trip)) for k, trip in enumerate(trips))


def _recorded(vehicle: str, number: int, road: Plan) -> PlannedTrip:
    """Make a planned trip of a recorded one, without what its log knows of the vehicle; one without a date is a day of its own."""
    at = road.departure.departs_at or dt.datetime(1970, 1, 1) + dt.timedelta(days=number)
    road = replace(road, departure=Departure())
    known = UNKNOWN, Departure(), None, None, f"{vehicle}: "
    return PlannedTrip(vehicle, vehicle, at.astimezone(), road, *known)


def choices(
    routes: Routes, candidates: Sequence[Candidate], climate: Climate, *, probability: float = 0.95, reserve: float = 0.1,
    days: float = 250.0, price: float = 0.3,
) -> pd.DataFrame:  # fmt: skip
    """Compute the chance that one charge is enough for each route with each vehicle, by month. O(trips x car models) forecasts.

    Errors of the trips of a day are the same, as in `need`. Every day of a route may fall on any day of the year.

    Parameters
    ----------
    routes : Routes
    candidates : sequence of Candidate
    climate : Climate
    probability : float
        Probability with which a vehicle has to serve a route in its worst month.
    reserve : float
        Displayed charge to come back with.
    days : float
        Days of a year on which a route is driven.
    price : float
        Price of a kWh from the plug.

    Returns
    -------
    DataFrame
        A row for each route and candidate: `route`, `car` (name of the candidate), `car_model`; `battery_wh`, energy of a full battery as displayed [Wh];
        `chance` that one charge is enough, with the reserve, over the days of a year, `worst_chance` in `worst_month` (1 to 12), which `has_trips` or uncertain weather without;
        `soc_needed` to leave with in that month, enough with `probability`; a value above 1 means that the route needs a battery larger by
        that factor. `energy_wh` of a year from the battery [Wh] and its `cost`. `is_assigned`: whether the vehicle drives the route by
        `assign`, with the chances of the worst month; `smallest`: car model with the smallest battery that serves the route, NaN if none does.
    """
    air_degc = climate.air_degc
    degc = np.linspace(air_degc.min() - 0.1, air_degc.max() + 0.1, _NODES)  # also without any spread
    models, rows = {id(c.model): c.model for c in candidates}, []
    level = max(probability, SD_LEVEL)
    for route, trips in routes.items():
        taken = {key: np.array([_day(m, day, degc, level) for day in trips]) for key, m in models.items()}
        for c in candidates:
            of_model = taken[id(c.model)]
            year_wh, soc, sd = make_interp_spline(degc, c.amounts(of_model), k=1, axis=-1)(air_degc)
            energy_wh = days * float(year_wh.mean())
            row: dict[str, Any] = {"route": route, "car": c.name, "car_model": c.model.vehicle.name}
            row |= {"battery_wh": float(of_model[0, 0, 4]), **_chances(soc, sd, reserve, probability)}
            row["has_trips"] = row["worst_month"] not in climate.unknown
            rows.append(row | {"energy_wh": energy_wh, "cost": price * energy_wh / (1000.0 * EFFICIENCY)})
    table = pd.DataFrame(rows)
    served = table[table["worst_chance"] >= probability].sort_values("battery_wh", kind="stable")
    table["smallest"] = table["route"].map(served.drop_duplicates("route").set_index("route")["car_model"])
    owned = table[table["car"].isin([c.name for c in candidates if c.is_owned])]
    chance, cost = (owned[name].to_numpy().reshape(len(routes), -1) for name in ("worst_chance", "cost"))
    route_number, vehicle_number = assign(chance, cost)
    chosen = owned.index[route_number * chance.shape[1] + vehicle_number]
    return table.assign(is_assigned=table.index.isin(chosen))


def _day(model: ForecastModel, trips: Sequence[PlannedTrip], degc: FloatArray, level: float) -> FloatArray:
    """Return what the trips of a day take at each temperature, shape (temperatures, 5 + features).

    Median of the energy [Wh] and of the displayed charge, their standard deviations from the quantile `level`, the energy of a full battery as displayed [Wh], and
    the energies by feature [Wh].
    """
    rows = []
    for at in degc.tolist():
        sums = np.zeros(5 + len(FEATURES))
        for trip in trips:
            forecast = trip.in_air(at, soc=None).forecast(model)
            energy, charge, _ = trip_quantiles(forecast, (0.5, level))
            spread = [np.diff(values)[0] / ndtri(level) for values in (energy, charge)]
            sums += [energy[0], charge[0], *spread, 0.0, *trip_features(forecast.drive.table)[0]]
            sums[4] = forecast.charge.wh_per_display
        rows.append(sums)
    return np.array(rows)


def _chances(soc: FloatArray, sd: FloatArray, reserve: float, probability: float) -> dict[str, Any]:
    """Return the columns of `choices` on the chance that one charge is enough.

    Parameters
    ----------
    soc, sd : ndarray, shape (days, 12, temperatures)
        Displayed charge that is taken, and its standard deviation.
    reserve, probability : float
    """
    by_month = ndtr((1.0 - reserve - soc) / sd).mean(axis=(0, 2))
    worst = int(np.lexsort((-soc.mean(axis=(0, 2)), by_month))[0])
    soc, sd = soc[:, worst], sd[:, worst]
    ends = float((soc - 9.0 * sd).min()), float((soc + 9.0 * sd).max())
    needed = brentq(lambda level: float(ndtr((level - soc) / sd).mean()) - probability, *ends)
    of_worst = {"worst_month": worst + 1, "worst_chance": float(by_month[worst])}
    return {"chance": float(by_month.mean()), **of_worst, "soc_needed": needed + reserve}


def assign(chance: FloatArray, cost: FloatArray) -> tuple[IntArray, IntArray]:
    """Assign vehicles to routes, one each: first the largest smallest chance, in tenths of a percent, then the least cost.

    If there are more routes than vehicles, the routes that are hardest to serve are left out.

    Parameters
    ----------
    chance, cost : ndarray, shape (routes, vehicles)

    Returns
    -------
    tuple of ndarray
        Numbers of the assigned routes, and of their vehicles.

    Examples
    --------
    >>> assign(np.array([[0.99, 0.9], [0.95, 0.1]]), np.ones((2, 2)))[1].tolist()
    [1, 0]
    """
    chance, (rows, columns) = np.round(chance, 3), linear_sum_assignment(cost)
    for level in np.unique(chance)[::-1]:
        below = chance < level
        rows, columns = linear_sum_assignment(np.where(below, cost.sum() + 1.0, cost))
        if not below[rows, columns].any():
            break
    return rows, columns


def chargers(
    fleet: FleetModel, routes: Routes, driven: Sequence[Driven], climate: Climate, *, probability: float = 0.95, reserve: float = 0.1,
    grid_w: float | None = None,
) -> pd.DataFrame:  # fmt: skip
    """Count the chargers that the vehicles of routes need under a grid limit, by power and share of the nights of a year.

    In a night, each vehicle charges what the longest day of its route takes, so that it leaves with enough with `probability`: it comes back
    with the reserve. A charger charges one vehicle after the other, as `schedule` plans it, from `_BEFORE` the first departure on.

    Parameters
    ----------
    fleet : FleetModel
    routes : Routes
    driven : sequence of Driven
    climate : Climate
    probability, reserve : float
    grid_w : float, optional
        Largest power of all chargers together, as the mean of a quarter of an hour [W].

    Returns
    -------
    DataFrame
        A row for each of `NIGHTS` and `POWERS_W`: the number of `vehicles`; `nights`, the share of the nights that are not colder than
        `ambient_temperature_degc`; the values of `least_chargers`; and `is_smallest`: whether it is the least number of chargers with which
        no vehicle fails in these nights, of the least power.
    """
    days = [(vehicle, model, max(routes[name], key=_length_m)) for name, vehicle, model in driven]
    first = min((trip.departs_at.date() for *_, day in days for trip in day), default=dt.date.min)
    table: list[dict[str, Any]] = []
    for share in NIGHTS if days else ():
        degc = float(np.quantile(climate.air_degc, 1.0 - share))
        night = [
            replace(trip.in_air(degc, soc=reserve), vehicle_id=vehicle, car_model=model,
                    departs_at=dt.datetime.combine(first, trip.departs_at.timetz()))
            for vehicle, model, day in days for trip in day
        ]  # fmt: skip
        needs = needs_by_hour(fleet, night, probability=probability, reserve=reserve)
        known = {"vehicles": len(days), "nights": share, "ambient_temperature_degc": degc}
        depots = (Depot(needs["departs_at"].min() - _BEFORE, charger_w, grid_w) for charger_w in POWERS_W)
        rows = [least_chargers(needs, depot) for depot in depots]
        enough = (row for row in rows if not row["fails"])
        smallest = min(enough, key=lambda row: row["chargers"], default=None)
        table += [known | row | {"is_smallest": row is smallest} for row in rows]
    return pd.DataFrame(table)


def least_chargers(needs: pd.DataFrame, depot: Depot) -> dict[str, Any]:
    """Count the chargers for the needs of a night.

    Returns
    -------
    dict
        `charger_w`; `chargers`, the least number with which no departure lacks more than with a charger for each vehicle; `peak_w` of all
        together [W]; `p_enough`, the chance that all vehicles come back with the reserve; and `fails`, the vehicles that lack energy even
        with a charger each.
    """
    plan = schedule(needs, depot, shared=True)
    fails = ", ".join(needs["vehicle_id"][plan.missing_wh > 0.0].unique())
    chance = sum_up_depot(needs, 0.5, plan.charged_wh)["p_enough"]
    known = {"charger_w": depot.charger_w, "chargers": math.ceil(plan.chargers - 1e-4)}
    return known | {"peak_w": plan.peak_w, "p_enough": chance, "fails": fails}


def choose(
    fleet: FleetModel | None, routes: Routes, library: Sequence[Candidate], climate: Climate, *, new: Mapping[str, Any] | None = None,
    grid_w: float | None = None, days: float = 250.0, price: float = 0.3, **asked: float,
) -> dict[str, Any]:  # fmt: skip
    """Choose vehicles for routes and count their chargers, as data.

    Parameters
    ----------
    fleet : FleetModel or None
        Without a fleet, no chargers are counted and there are no new vehicles.
    routes : Routes
    library : sequence of Candidate
        From `library_candidates`; with at least one if there is no fleet.
    climate : Climate
    new : mapping of str to number, optional
        Car of the library -> number, 1 to `MOST_NEW`, of more vehicles of the fleet, which drive the routes in turn, beside the others.
    grid_w, days, price : float
        As for `chargers` and `choices`.
    **asked : float
        `probability` and `reserve`.

    Returns
    -------
    dict
        `choices`; `chargers`, first those of the vehicles that there are, then
        those together with the new ones; and `new`: number of `vehicles`, their `energy_wh` of a year from the battery [Wh] and its `cost`,
        and their `worst_chance`; None without new vehicles.

    Raises
    ------
    InvalidInput
        If a car is not known, or a number is out of range.
    """
    by_car = [(car, int(require_number(f"new {car}", n, 1, MOST_NEW))) for car, n in (new or {}).items()]
    of_fleet = [] if fleet is None else fleet_candidates(fleet, [car for car, _ in by_car])
    table = choices(routes, [*library, *of_fleet], climate, days=days, price=price, **asked)
    if fleet is None:
        return {"choices": records(table), "chargers": [], "new": None}
    driven: list[Driven] = [(row["route"], row["car"], None) for row in records(table[table["is_assigned"]])]
    turns = itertools.cycle(routes)
    added = [(next(turns), f"new {car} {k + 1}", car) for car, number in by_car for k in range(number)]
    pairs = pd.DataFrame([(route, f"new {car}") for route, _, car in added], columns=["route", "car"])
    figures = pairs.merge(table).agg({"energy_wh": "sum", "cost": "sum", "worst_chance": "min"}).to_dict()
    crews = [driven, [*driven, *added]][: 1 + bool(added)]
    power = pd.concat([chargers(fleet, routes, crew, climate, grid_w=grid_w, **asked) for crew in crews])
    of_new = {"vehicles": len(added), **figures} if added else None
    return {"choices": records(table), "chargers": records(power), "new": of_new}
