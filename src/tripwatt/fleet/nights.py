"""The charge that the planned trips of a fleet need: tonight by vehicle and hour, in the coldest week by route and car model.

A table of planned trips has one row per trip with `vehicle_id`, `trip`, `departs_at` and `distance_km`, or one row per link with `length_m`
and the other fields of a link. Further columns may give what is known at departure; `soc` is the displayed charge now.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from scipy import sparse
from scipy.special import ndtr, ndtri

from tripwatt.arrays import FloatArray, eigen
from tripwatt.errors import Check, Fault, InvalidInput, places_within
from tripwatt.fleet.batch import DEPARTURE_COLUMNS, flag_columns
from tripwatt.fleet.features import FEATURES, trip_features
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.statistics import TripRows
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.leaving import OF_CHARGE
from tripwatt.hybrid.groups import GroupPosterior
from tripwatt.roads.journey import ChargingCurve
from tripwatt.roads.journey.distances import DISTANCES_KM, KindForecaster, trip_quantiles
from tripwatt.roads.journey.kinds import UNKNOWN
from tripwatt.routes import route_from_links
from tripwatt.sources.columnar import open_table
from tripwatt.trips import LINK_COLUMNS, Departure, Plan, raise_faults
from tripwatt.trips.columns import require_fraction, require_number
from tripwatt.vehicles import Vehicle

_MIN_TRIPS: Final = 10
"""Smallest number of trips with which the mean temperature of a week counts: a choice, because a few trips may be on its coldest day."""

POWERS: Final = ("alternating_w", "direct_w")
"""Columns of the highest powers with which a car charges, with alternating and with direct current."""

_KEYS: Final = ("vehicle_id", "trip", "departs_at")
_TEXT_COLUMNS: Final = (*_KEYS, "car_model", "driver", "kind")
SD_LEVEL: Final = 0.9
"""Least level of the quantile from which a standard deviation is computed: a choice, because lower ones have little of the spread."""
_NIGHTS: Final = 4000
"""Simulated nights: a choice, because a chance of 95 % then has a standard error of 0.35 points."""

ERRORS: Final = tuple(f"error_{k}_wh" for k in range(3 * len(FEATURES) + 1))
"""Columns of the changes of an energy by independent errors of one standard deviation [Wh]: of the weights of the fleet, of those of the
car model, of those of the vehicle, and of the unknown outside temperature, which all vehicles share."""

OF_ERRORS: Final = (*ERRORS, "own_wh2", "soc_per_wh", "wh_per_soc", "spare")
"""Columns from which the chance of all vehicles together is computed."""

_SUMMED: Final = ("trips", "distance_m", "energy_wh", *ERRORS, "own_wh2", "soc_taken", "soc_sd", "sd_wh")
TRIP_COLUMNS: Final = (
    "vehicle_id",
    "hour",
    "car_model",
    "departs_at",
    "arrives_at",
    "soc",
    *POWERS,
    "flags",
    *_SUMMED,
)
_NEED_COLUMNS: Final = ("vehicle_id", "car_model", "departs_at", "arrives_at", "trips", "distance_m", "energy_wh", "energy_quantile_wh",
                "soc_needed", "soc", "p_enough", "charge_wh", *POWERS, "assumed", "reasons", *OF_ERRORS)  # fmt: skip


@dataclass(frozen=True, slots=True)
class PlannedTrip:
    """A trip that a vehicle is to drive.

    Attributes
    ----------
    name, vehicle_id : str
    departs_at : datetime
        Departure, with its time zone.
    road : Plan or float
        The planned road, or only its length [km].
    kind : str
        Kind of road, used if `road` is a length.
    departure : Departure
        What is known at departure; `soc` is the displayed charge now, which does not change the need.
    car_model, driver : str or None
    where : str
        Place of the trip in its table or request, which begins the place of every fault.
    """

    name: str
    vehicle_id: str
    departs_at: dt.datetime
    road: Plan | float
    kind: str
    departure: Departure
    car_model: str | None
    driver: str | None
    where: str = ""

    def in_air(self, degc: float, **known: Any) -> PlannedTrip:
        """Return the trip at another outside temperature [°C], which the battery has, too, and with other known values."""
        known |= {"ambient_temperature_degc": degc, "battery_temperature_degc": None}
        return replace(self, departure=replace(self.departure, **known))

    def forecast(self, model: ForecastModel) -> Forecast:
        """Forecast the trip by the model of a car; the faults name the trip."""
        with places_within(self.where):
            if isinstance(self.road, Plan):
                return model.forecast(self.road, replace(self.departure, soc=None))
            return KindForecaster.from_kind(model, self.departure, self.kind).forecast(1000.0 * self.road)

    def forecast_by(self, fleet: FleetModel) -> tuple[Vehicle, Forecast]:
        """Return the car and its forecast of the trip by the model of a fleet."""
        degc, car = self.departure.ambient_temperature_degc, self.car_model
        with places_within(self.where):
            model = fleet.of_vehicle(self.vehicle_id, car_model=car, driver=self.driver, ambient_degc=degc)
        return model.vehicle, self.forecast(model)


def read_planned(file: Path | str, ambient_degc: float | None = None) -> list[PlannedTrip]:
    """Read planned trips from CSV or Parquet.

    Parameters
    ----------
    file : path
    ambient_degc : float, optional
        Outside temperature of the trips for which the file gives none [°C].

    Raises
    ------
    InvalidInput
        If the file cannot be read, if columns are missing or unknown, or if trips cannot be planned.
    """
    read = open_table(Path(file))
    missing = [name for name in _KEYS if name not in read.names]
    missing += [] if {"distance_km", "length_m"} & {*read.names} else ["distance_km or length_m"]
    names = ", ".join(read.names)[:200]
    faults = [Fault("missing column", f"{file}", names, f"a column {name}") for name in missing]
    allowed = (*_TEXT_COLUMNS, "distance_km", *DEPARTURE_COLUMNS, *LINK_COLUMNS)
    unknown = (name for name in read.names if name not in allowed)
    raise_faults(faults + [Fault.unknown("unknown column", f"{file}", name, allowed) for name in unknown])
    numbers = [name for name in read.names if name not in _TEXT_COLUMNS]
    table = pd.DataFrame({name: read.texts(name) for name in read.names if name in _TEXT_COLUMNS})
    table[numbers] = np.transpose(read.numbers(numbers))
    # spreadsheets leave rows of empty cells
    table = table.where(table != "").dropna(how="all")
    if ambient_degc is not None:
        table = table.combine_first(pd.DataFrame({"ambient_temperature_degc": ambient_degc}, table.index))
    empty = sorted((row, name) for name in _KEYS for row in table.index[table[name].isna()])
    rows = (Fault("empty cell", f"{file} row {read.row(row)} column {name!r}") for row, name in empty)
    with Check() as check:
        check(raise_faults, [*read.faults, *rows])
        trips = [check(_trip_from_rows, rows) for _, rows in table.groupby([*_KEYS], sort=False)]
    return trips


def _trip_from_rows(rows: pd.DataFrame) -> PlannedTrip:
    """Make a planned trip from its rows."""
    links = [{str(k): v for k, v in row.items() if pd.notna(v)} for row in rows.to_dict("records")]
    first, where = links[0], f"trip {links[0]['trip']} of {links[0]['vehicle_id']}: "
    with places_within(where), Check() as check:
        if "length_m" in first:
            fields = [{k: v for k, v in link.items() if k in LINK_COLUMNS} for link in links]
            road: Plan | float = check(lambda: route_from_links(fields).plan(trip_id=first["trip"]))
        else:
            road = check(require_number, "distance_km", first.get("distance_km"), *DISTANCES_KM)
            allowed = "one row, or length_m in each for the links of a trip"
            check(raise_faults, [Fault("repeated trip", "rows", f"{len(links)}", allowed)][: len(links) - 1])
        known = check(Departure, **{name: first[name] for name in DEPARTURE_COLUMNS if name in first})
        departs_at = check(parse_time, first["departs_at"], "departs_at")
    named = first.get("kind", UNKNOWN), known, first.get("car_model"), first.get("driver"), where
    return PlannedTrip(first["trip"], first["vehicle_id"], departs_at, road, *named)


def parse_time(text: str, where: str) -> dt.datetime:
    """Read a time from its text; a text without a time zone is in the zone of this machine."""
    try:
        return dt.datetime.fromisoformat(text).astimezone()
    except ValueError as error:
        raise InvalidInput.of("not a time", where, text[:80], "such as 2026-01-12T07:30+01:00") from error


def needs_by_hour(
    model: FleetModel, trips: Sequence[PlannedTrip], *, probability: float = 0.95, reserve: float = 0.1,
    refused: list[Fault] | None = None,
) -> pd.DataFrame:  # fmt: skip
    """Compute the energy and charge that planned trips need, by vehicle and hour of departure. O(trips) forecasts.

    Errors by fleet, car model, unknown weather and vehicle are the same on all trips of a vehicle. The rest of the error of a trip is
    independent of that of others, as in the fleet's model.

    Parameters
    ----------
    model : FleetModel
    trips : sequence of PlannedTrip
    probability : float
        Probability that the energy suffices, 0.5 to 0.999.
    reserve : float
        Displayed charge to come back with.
    refused : list of Fault, optional
        List to which the faults of trips are added that cannot be forecast, or that depart in the first half of the median time of an
        earlier one of their vehicle. Such trips are then left out; without the list, a vehicle may have trips at the same time.

    Returns
    -------
    DataFrame
        Columns `vehicle_id`, `car_model`, `trips`, `distance_m` and

        - `departs_at` (first departure of the hour), `arrives_at` (last arrival);
        - `energy_wh` (median), `energy_quantile_wh`;
        - `soc_needed`: displayed charge to leave with for this hour and the later ones without charging in between. A value above 1
          means that a full battery does not suffice;
        - `soc`: displayed charge now;
        - `p_enough`: probability that the charge now suffices for this hour and those before; NaN if `soc` is not known;
        - `charge_wh`: energy to charge for this hour beyond the need of the hours before [Wh]; NaN if `soc` is not known;
        - `alternating_w`, `direct_w`: highest power with which the car charges [W];
        - `assumed`: names of the values that the trips do not give;
        - `reasons`: sentences on what was assumed and what limits the forecasts;
        - the columns `ERRORS`: changes of the energy by shared errors [Wh]; `own_wh2`: variance by the errors of single trips [Wh²];
        - `soc_per_wh`: displayed charge per energy of an error [1/Wh]; `wh_per_soc`: energy per displayed charge [Wh];
        - `spare`: expected displayed charge beyond the reserve after this hour if nothing is charged, for a vehicle that leaves with `soc`,
          or with `soc_needed` if `soc` is not known.

    Raises
    ------
    InvalidInput
        If `refused` is not given, and a vehicle is unknown and has no car model, or a trip cannot be forecast.
    """
    require_fraction("probability", probability, 0.5, 0.999)
    require_fraction("reserve", reserve)
    check, rows = Check(), []
    back: dict[str, dt.datetime] = {}
    for trip in sorted(trips, key=lambda trip: trip.departs_at):
        pair, since = check(trip.forecast_by, model), back.get(trip.vehicle_id, trip.departs_at)
        if refused is not None and trip.departs_at < since:
            got, allowed = (f"{time:%Y-%m-%d %H:%M %z}" for time in (trip.departs_at, since))
            fault = Fault("the vehicle is not back", f"{trip.where}departs_at", got, f"{allowed} or later")
            check(raise_faults, [fault])
        elif pair is not None:
            rows.append(_trip_need(model, trip, *pair, probability))
            # a drive of half the median time is possible; a choice
            back[trip.vehicle_id] = trip.departs_at + dt.timedelta(seconds=0.5 * pair[1].plan.duration_s)
    (raise_faults if refused is None else refused.extend)(check.faults)
    return add_up_needs(pd.DataFrame(rows, columns=TRIP_COLUMNS), probability, reserve)


def _trip_need(
    fleet: FleetModel, trip: PlannedTrip, car: Vehicle, forecast: Forecast, probability: float
) -> tuple[Any, ...]:
    """Return a row of `TRIP_COLUMNS`.

    The standard deviation is that of a normal distribution with the median and the quantile of the forecast. Its shared parts are in
    proportion to those of the forecast.
    """
    level = max(probability, SD_LEVEL)
    energies, (soc, soc_high), duration_s = trip_quantiles(forecast, (0.5, level))
    sd_wh = float(np.diff(energies)[0] / ndtri(level))
    is_air_unknown = any(flag.subject == "ambient_temperature_degc" for flag in forecast.flags)
    group = car.name, trip.vehicle_id, trip.driver
    weights = shared_errors(fleet.posterior, group, trip_features(forecast.drive.table)[0])
    weights *= forecast.uncertainty.scale.values[3]
    shared = np.append(weights, forecast.state_sd_wh * is_air_unknown)
    shared *= sd_wh / max(forecast.sd_wh, float(np.linalg.norm(shared)), 1e-9)
    own_wh2 = max(sd_wh**2 - float(shared @ shared), 0.0)
    errors = *shared.tolist(), own_wh2, float(soc), float((soc_high - soc) / ndtri(level)), sd_wh
    hour = trip.departs_at.replace(minute=0, second=0, microsecond=0)
    times = trip.departs_at, trip.departs_at + dt.timedelta(seconds=duration_s)
    flags = [flag for flag in forecast.flags if flag.code not in OF_CHARGE]
    most_w = ChargingCurve.from_vehicle(car, forecast.charge.wh_per_display).most_w
    known = trip.vehicle_id, hour, car.name, *times, trip.departure.soc, *most_w, flags
    return *known, 1, forecast.plan.distance_m, float(energies[0]), *errors


def shared_errors(posterior: GroupPosterior, group: tuple[str | None, ...], x: FloatArray) -> FloatArray:
    """Return the changes of ``x' w``, for the weights `w` of a vehicle, by independent errors of one standard deviation.

    Parameters
    ----------
    posterior : GroupPosterior
    group : tuple of str or None
        Car model, vehicle and driver; None for one that is not known.
    x : ndarray, shape (features,)
        Energy of the trip by each feature [Wh].

    Returns
    -------
    ndarray, shape (3 * features,)
        By the errors of the weights of the fleet, by those that a car model adds, and by those that the vehicle and its driver add [Wh].
    """
    levels = range(int(posterior.tree.level.max()) + 1)
    prior = [posterior.scales.variances(level) for level in levels]
    # without the deviations of the levels below
    total = [posterior.weights(*group[:k])[1] - np.diag(sum(prior[k + 1 :], 0.0 * x)) for k in levels]
    gains = [_gain(total[k], total[k - 1], prior[k]) for k in levels[1:]]
    of_vehicle = np.linalg.multi_dot([*gains[:0:-1], np.eye(len(x)), np.eye(len(x))])
    passed = (total[-1], of_vehicle), (total[1], gains[0]), (total[0], 0.0 * gains[0])
    errors = []
    for (covariance, gain), above in zip(passed, (total[1], total[0], total[0]), strict=True):
        values, vectors = eigen(covariance - gain @ above @ gain.T)
        errors.append(x @ vectors * np.sqrt(np.maximum(values, 0.0)))
        x = gain.T @ x
    return np.concatenate(errors[::-1])


def _gain(covariance: FloatArray, above: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the gain `G` with which the error of a node passes on to its child, given the trips.

    The child has an own error with a covariance `A` and, for the prior variances `D` of its deviation, ``G = A D^-1``. Its covariance is
    ``A + G above G'``, a quadratic equation for `A`.
    """
    root = np.sqrt(np.maximum(prior, 1e-12))
    scale = np.outer(root, root)
    values, vectors = eigen(above / scale)
    size = np.sqrt(np.maximum(values, 1e-12))
    squares, turned = eigen((size[:, None] * vectors.T) @ (covariance / scale) @ (vectors * size))
    half = (vectors / size) @ turned * np.sqrt(np.sqrt(np.maximum(squares, 0.0) + 0.25) - 0.5)
    return np.asarray(half @ half.T * np.outer(root, 1.0 / root))


def add_up_needs(trips: pd.DataFrame, probability: float, reserve: float) -> pd.DataFrame:
    """Add up the needs of trips by vehicle and hour: a row for each trip with the columns `TRIP_COLUMNS`, as in `needs_by_hour`."""
    how = dict.fromkeys(("flags", *_SUMMED), "sum")
    how |= {"car_model": "first", "departs_at": "min", "arrives_at": "max", **dict.fromkeys(POWERS, "min")}
    trips = trips.astype(dict.fromkeys((*_SUMMED[1:], "soc"), float))
    needs = trips.groupby(["vehicle_id", "hour"]).agg(how)
    flags = [flag_columns(listed) for listed in needs["flags"]]
    needs = needs.join(pd.DataFrame(flags, needs.index, ["assumed", "reasons"])).reset_index()
    vehicle, z = needs["vehicle_id"], float(ndtri(probability))
    needs["soc"] = vehicle.map(trips.groupby("vehicle_id")["soc"].first())
    shared = list(ERRORS)
    needs["energy_quantile_wh"] = needs["energy_wh"] + z * _sd(needs[shared], needs["own_wh2"])
    ratio = needs["soc_per_wh"] = needs["soc_sd"] / needs["sd_wh"].clip(lower=1e-9)
    parts = needs[shared].mul(ratio, axis=0).assign(own=needs["own_wh2"] * ratio**2, soc=needs["soc_taken"])
    so_far = parts.groupby(vehicle).cumsum()
    ahead = parts.groupby(vehicle).transform("sum") - so_far + parts
    taken, sd = so_far["soc"], _sd(so_far[shared], so_far["own"])
    needs["soc_needed"] = ahead["soc"] + z * _sd(ahead[shared], ahead["own"]) + reserve
    leaves = needs["soc"].fillna(needs.groupby("vehicle_id")["soc_needed"].transform("first"))
    needs["spare"] = leaves - reserve - taken
    needs["p_enough"] = ndtr(needs["spare"] / sd.clip(lower=1e-9)).where(needs["soc"].notna())
    missing = (taken + z * sd + reserve - needs["soc"]).clip(lower=0.0)
    before = missing.groupby(vehicle).shift(fill_value=0.0)
    soc_quantile = parts["soc"] + z * _sd(parts[shared], parts["own"])
    needs["wh_per_soc"] = needs["energy_quantile_wh"] / soc_quantile.clip(lower=1e-6)
    needs["charge_wh"] = (missing - before) * needs["wh_per_soc"]
    return needs[list(_NEED_COLUMNS)]


def _sd(shared: pd.DataFrame, variance: pd.Series) -> pd.Series:
    """Return the standard deviation of rows by shared errors, which are independent of each other, and an own variance."""
    return ((shared**2).sum(axis=1) + variance) ** 0.5


def up_to_each(needs: pd.DataFrame) -> sparse.csr_matrix:
    """Return the matrix that adds up the rows of a vehicle up to each row, shape (rows, rows)."""
    ids = needs["vehicle_id"].to_numpy()
    return sparse.csr_matrix(np.tril(ids[:, None] == ids).astype(float))


def sum_up_depot(needs: pd.DataFrame, probability: float, charged_wh: FloatArray) -> dict[str, float]:
    """Return the energy of all vehicles together, and the chance that all have enough, from `_NIGHTS` simulated nights.

    Parameters
    ----------
    needs : DataFrame
        Result of `needs_by_hour`.
    probability : float
    charged_wh : ndarray, shape (rows,)
        Energy that the battery of each row's vehicle gets before the departure of the row [Wh].

    Returns
    -------
    dict
        `energy_wh` (median) and `energy_quantile_wh` of the sum [Wh], not the sum of quantiles; `p_enough` that every vehicle comes back
        with the reserve each hour.
    """
    rng, shared = np.random.default_rng(0), needs[list(ERRORS)].to_numpy().T
    error_wh = rng.standard_normal((_NIGHTS, len(needs))) * np.sqrt(needs["own_wh2"].to_numpy())
    error_wh += rng.standard_normal((_NIGHTS, 1)) * shared[-1]
    groups = pd.Series(0, needs.index), needs["car_model"], needs["vehicle_id"]
    for group, loads in zip(groups, np.split(shared[:-1], 3), strict=True):
        for rows in needs.groupby(group).indices.values():
            error_wh[:, rows] += rng.standard_normal((_NIGHTS, len(loads))) @ loads[:, rows]
    energy = needs["energy_wh"].sum() + np.quantile(error_wh.sum(axis=1), (0.5, probability))
    more = up_to_each(needs) @ (error_wh * needs["soc_per_wh"].to_numpy()).T
    left = (needs["spare"] + charged_wh / needs["wh_per_soc"]).to_numpy()[:, None] - more
    names = "energy_wh", "energy_quantile_wh", "p_enough"
    return dict(zip(names, (*energy.tolist(), float((left >= 0.0).all(axis=0).mean())), strict=True))


class Cold(NamedTuple):
    """The cold weather for which the cars of routes are chosen.

    Attributes
    ----------
    ambient_temperature_degc : float
        Outside temperature [°C].
    monday : str or None
        Monday of the week with this mean temperature; None if the temperature was given.
    min_trips : int
        Smallest number of trips with which the mean of a week counts.
    colder : sequence of (str, float, int)
        Monday, mean temperature [°C] and number of trips of the colder weeks with fewer trips.
    """

    ambient_temperature_degc: float
    monday: str | None = None
    min_trips: int = _MIN_TRIPS
    colder: Sequence[tuple[str, float, int]] = ()


def coldest_week(rows: TripRows) -> Cold | None:
    """Find the week of a fleet's trips with the lowest mean outside temperature.

    Only weeks with at least `_MIN_TRIPS` trips count. If there is no such week, only those with the largest number of trips count.
    Returns None if no trip has a time and a temperature.
    """
    degc, day = rows.numbers("ambient_temperature_degc"), pd.DatetimeIndex(rows.chronological[1])
    ambient = pd.Series(degc, day)[day.notna()].dropna()
    weeks = ambient.groupby(pd.Grouper(freq="W-MON", label="left", closed="left")).agg(["mean", "size"])
    if weeks.empty:
        return None
    min_trips = min(_MIN_TRIPS, int(weeks["size"].max()))
    enough = weeks.loc[weeks["size"] >= min_trips, "mean"]
    colder = weeks[weeks["mean"] < enough.min()].sort_values("mean")
    skipped = colder.index.strftime("%Y-%m-%d"), colder["mean"].tolist(), colder["size"].tolist()
    return Cold(float(enough.min()), str(enough.idxmin())[:10], min_trips, list(zip(*skipped, strict=True)))


def needs_by_car(
    model: FleetModel,
    trips: Sequence[PlannedTrip],
    ambient_degc: float,
    *,
    probability: float = 0.95,
    reserve: float = 0.1,
    refused: list[Fault] | None = None,
) -> pd.DataFrame:
    """Forecast the charge that each planned route needs with each car model of a fleet at an outside temperature.

    Parameters
    ----------
    model : FleetModel
    trips : sequence of PlannedTrip
        Trips of the same name are one route, forecast by the last of them.
    ambient_degc : float
        Outside temperature [°C].
    probability, reserve, refused
        As in `needs_by_hour`.

    Returns
    -------
    DataFrame
        Displayed charge to leave with: one row per route, named in the column `trip`, and one column per car model.
    """
    names = sorted(set(model.vehicles().values()))
    models = {name: model.of_vehicle(None, car_model=name, ambient_degc=ambient_degc) for name in names}
    check, needs = Check(), {}
    for name, trip in {trip.name: trip for trip in trips}.items():
        cold_trip = trip.in_air(ambient_degc)
        forecasts = {car: check(cold_trip.forecast, m) for car, m in models.items()}
        taken = {car: trip_quantiles(f, (probability,))[1] for car, f in forecasts.items() if f is not None}
        if len(taken) == len(models):
            needs[name] = {car: reserve + float(charge[0]) for car, charge in taken.items()}
    (raise_faults if refused is None else refused.extend)(check.faults)
    return pd.DataFrame.from_dict(needs, orient="index", columns=names).rename_axis("trip").reset_index()


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as data, with times as text in UTC and None for unknown values."""
    text = table.to_json(orient="records", date_format="iso", double_precision=15)
    rows: list[dict[str, Any]] = json.loads(text)
    return rows
