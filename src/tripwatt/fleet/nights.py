"""The charge that the planned trips of a fleet need: tonight by vehicle and hour, in the coldest week by route and car model.

A table of planned trips has one row per trip with `vehicle_id`, `trip`, `departs_at` and `distance_km`, or one row per link with `length_m`
and the other fields of a link. Further columns may give what is known at departure; `soc` is the displayed charge now.
"""

from __future__ import annotations

import datetime as dt
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import quote

import pandas as pd

from tripwatt.errors import Check, Fault, InvalidInput, places_within
from tripwatt.fleet.batch import DEPARTURE_COLUMNS, flag_columns
from tripwatt.fleet.model import COLD_DEGC, FleetModel
from tripwatt.fleet.statistics import TripRows
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.leaving import OF_CHARGE
from tripwatt.roads.journey import ChargingCurve
from tripwatt.roads.journey.distances import DISTANCES_KM, KindForecaster, trip_quantiles
from tripwatt.roads.journey.kinds import UNKNOWN
from tripwatt.roads.maps.stations import DIRECT_FROM_W
from tripwatt.routes import route_from_links
from tripwatt.sources.columnar import open_table
from tripwatt.trips import LINK_COLUMNS, Departure, Plan, raise_faults
from tripwatt.trips.columns import require_fraction, require_number
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

EFFICIENCY: Final = 0.9
"""Share of the energy from an alternating-current charger that reaches the battery: a choice, because chargers lose about a tenth."""

_MIN_TRIPS: Final = 10
"""Smallest number of trips with which the mean temperature of a week counts: a choice, because a few trips may be on its coldest day."""

POWERS: Final = ("alternating_w", "direct_w")
"""Columns of the highest powers with which a car charges, with alternating and with direct current."""

_TEXT_COLUMNS: Final = ("vehicle_id", "trip", "departs_at", "car_model", "driver", "kind")
_TRUTH_VALUES: Final = {"True": True, "False": False}
_TAKEN_COLUMNS: Final = ("distance_m", "energy_wh", "energy_quantile_wh", "soc_taken")
_NEED_COLUMNS: Final = ("vehicle_id", "car_model", "departs_at", "arrives_at", "trips", *_TAKEN_COLUMNS[:3], "soc_needed", "soc",
                "charge_wh", *POWERS, "assumed", "reasons")  # fmt: skip


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
        What is known at departure, without the charge.
    soc : float
        Displayed charge now; NaN if it is not known.
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
    soc: float
    car_model: str | None
    driver: str | None
    where: str = ""

    def forecast(self, model: ForecastModel, departure: Departure) -> Forecast:
        """Forecast the trip by the model of a car."""
        if isinstance(self.road, Plan):
            return model.forecast(self.road, departure)
        return KindForecaster.from_kind(model, departure, self.kind).forecast(1000.0 * self.road)

    def forecast_by(self, fleet: FleetModel) -> tuple[Vehicle, Forecast]:
        """Return the car and its forecast of the trip by the model of a fleet."""
        ambient = self.departure.ambient_temperature_degc
        cold = None if ambient is None else ambient < COLD_DEGC
        with places_within(self.where):
            model = fleet.of_vehicle(self.vehicle_id, car_model=self.car_model, driver=self.driver, cold=cold)
            return model.vehicle, self.forecast(model, self.departure)


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
    table = pd.DataFrame({name: _typed_column(name, read.texts(name)) for name in read.names})
    raise_faults(read.faults)
    missing = [name for name in _TEXT_COLUMNS[:3] if name not in table]
    missing += [] if {"distance_km", "length_m"} & set(table) else ["distance_km or length_m"]
    names = ", ".join(map(str, table))[:200]
    faults = [Fault("missing column", f"{file}", names, f"a column {name}") for name in missing]
    allowed = (*_TEXT_COLUMNS, "distance_km", *DEPARTURE_COLUMNS, *LINK_COLUMNS)
    unknown = (name for name in table if name not in allowed)
    raise_faults(faults + [Fault.unknown("unknown column", f"{file}", name, allowed) for name in unknown])
    if ambient_degc is not None:
        table = table.combine_first(pd.DataFrame({"ambient_temperature_degc": ambient_degc}, table.index))
    with Check() as check:
        trips = [check(_trip_from_rows, rows) for _, rows in table.groupby([*_TEXT_COLUMNS[:3]], sort=False)]
    return trips


def _typed_column(name: str, cells: list[str]) -> pd.Series:
    """Return a column as numbers if all cells are numbers, else as texts and truth values; empty cells are missing."""
    texts = pd.Series(cells, dtype=object).where(lambda cell: cell != "")
    numbers = pd.to_numeric(texts, errors="coerce")
    is_number = name not in _TEXT_COLUMNS and numbers.notna().equals(texts.notna())
    return numbers if is_number else texts.map(lambda cell: _TRUTH_VALUES.get(cell, cell))


def _trip_from_rows(rows: pd.DataFrame) -> PlannedTrip:
    """Make a planned trip from its rows."""
    links = [{str(k): v for k, v in row.items() if pd.notna(v)} for row in rows.to_dict("records")]
    first, where = links[0], f"trip {links[0]['trip']} of {links[0]['vehicle_id']}: "
    if "length_m" in first:
        fields = [{k: v for k, v in link.items() if k in LINK_COLUMNS} for link in links]
        road: Plan | float = route_from_links(fields).plan(trip_id=str(first["trip"]))
    else:
        road = require_number(f"{where}distance_km", first.get("distance_km"), *DISTANCES_KM)
    known = {name: first[name] for name in DEPARTURE_COLUMNS if name in first and name != "soc"}
    return PlannedTrip(
        str(first["trip"]),
        str(first["vehicle_id"]),
        _parse_time(str(first["departs_at"]), f"{where}departs_at"),
        road,
        str(first.get("kind", UNKNOWN)),
        Departure(**known),
        require_fraction(f"{where}soc", first["soc"]) if "soc" in first else float("nan"),
        first.get("car_model"),
        first.get("driver"),
        where,
    )


def _parse_time(text: str, where: str) -> dt.datetime:
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

    The trips of a vehicle share the errors of the car, so that their quantiles are added.

    Parameters
    ----------
    model : FleetModel
    trips : sequence of PlannedTrip
    probability : float
        Probability that the energy suffices, 0.5 to 1.
    reserve : float
        Displayed charge to come back with.
    refused : list of Fault, optional
        List to which the faults of trips that cannot be forecast are added. Such trips are then left out.

    Returns
    -------
    DataFrame
        Columns `vehicle_id`, `car_model`, `trips`, `distance_m` and

        - `departs_at` (first departure of the hour), `arrives_at` (last arrival);
        - `energy_wh` (median), `energy_quantile_wh`;
        - `soc_needed`: displayed charge to leave with for this hour and the later ones without charging in between. A value above 1
          means that a full battery does not suffice;
        - `soc`: displayed charge now;
        - `charge_wh`: energy to charge for this hour beyond the need of the hours before [Wh]; NaN if `soc` is not known;
        - `alternating_w`, `direct_w`: highest power with which the car charges [W];
        - `assumed`: names of the values that the trips do not give;
        - `reasons`: sentences on what was assumed and what limits the forecasts.

    Raises
    ------
    InvalidInput
        If `refused` is not given, and a vehicle is unknown and has no car model, or a trip cannot be forecast.
    """
    require_fraction("probability", probability, 0.5)
    require_fraction("reserve", reserve)
    check = Check()
    forecasts = [(trip, check(trip.forecast_by, model)) for trip in trips]
    (raise_faults if refused is None else refused.extend)(check.faults)
    rows = []
    for trip, (car, forecast) in (pair for pair in forecasts if pair[1] is not None):
        (median_wh, quantile_wh), (_, soc_taken), duration_s = trip_quantiles(forecast, (0.5, probability))
        times = trip.departs_at, trip.departs_at + dt.timedelta(seconds=duration_s)
        taken = forecast.plan.distance_m, median_wh, quantile_wh, max(soc_taken, 1e-6)
        hour = trip.departs_at.replace(minute=0, second=0, microsecond=0)
        flags = [flag for flag in forecast.flags if flag.code not in OF_CHARGE]
        most_w = ChargingCurve.from_vehicle(car, forecast.charge.wh_per_display).most_w
        rows.append((trip.vehicle_id, car.name, hour, *times, trip.soc, *taken, *most_w, flags))
    known = "vehicle_id", "car_model", "hour", "departs_at", "arrives_at", "soc"
    columns = [*known, *_TAKEN_COLUMNS, *POWERS, "flags"]
    table = pd.DataFrame(rows, columns=columns).astype(dict.fromkeys((*_TAKEN_COLUMNS, "soc"), float))
    grouped = table.groupby(["vehicle_id", "hour"])
    needs = grouped[list(_TAKEN_COLUMNS)].sum()
    needs["trips"] = grouped.size()
    lowest = ["car_model", "departs_at", *POWERS]
    needs[lowest] = grouped[lowest].min()
    needs["arrives_at"] = grouped["arrives_at"].max()
    hourly_flags = [flag_columns(chain.from_iterable(flags)) for _, flags in grouped["flags"]]
    needs = needs.join(pd.DataFrame(hourly_flags, needs.index, ["assumed", "reasons"])).reset_index()
    soc_taken = needs.groupby("vehicle_id")["soc_taken"]
    needs["soc"] = needs["vehicle_id"].map(table.groupby("vehicle_id")["soc"].first())
    taken_so_far = soc_taken.cumsum()
    needs["soc_needed"] = soc_taken.transform("sum") - taken_so_far + needs["soc_taken"] + reserve
    missing = (taken_so_far + reserve - needs["soc"]).clip(lower=0.0)
    before = missing.groupby(needs["vehicle_id"]).shift(fill_value=0.0)
    needs["charge_wh"] = (missing - before) * needs["energy_quantile_wh"] / needs["soc_taken"]
    return needs[list(_NEED_COLUMNS)]


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
    order, day = rows.chronological
    degc = rows.numbers("ambient_temperature_degc")[order]
    ambient = pd.Series(degc, pd.DatetimeIndex(day[order])).dropna()
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
) -> pd.DataFrame:
    """Forecast the charge that each planned route needs with each car model of a fleet at an outside temperature.

    Parameters
    ----------
    model : FleetModel
    trips : sequence of PlannedTrip
        Trips of the same name are one route, forecast by the last of them.
    ambient_degc : float
        Outside temperature [°C].
    probability, reserve : float
        As in `needs_by_hour`.

    Returns
    -------
    DataFrame
        Displayed charge to leave with: one row per route, named in the column `trip`, and one column per car model.
    """
    cold = ambient_degc < COLD_DEGC
    names = sorted(set(model.vehicles().values()))
    models = {name: model.of_vehicle(None, car_model=name, cold=cold) for name in names}
    needs = {}
    for name, trip in {trip.name: trip for trip in trips}.items():
        known = replace(trip.departure, ambient_temperature_degc=ambient_degc, battery_temperature_degc=None)
        taken = ((car, trip_quantiles(trip.forecast(m, known), (probability,))) for car, m in models.items())
        needs[name] = {car: reserve + float(charge[0]) for car, (_, charge, _) in taken}
    return pd.DataFrame.from_dict(needs, orient="index", columns=names).rename_axis("trip").reset_index()


def emhass(needs: pd.DataFrame, at: dt.datetime, charger_w: float, step_s: float = 1800.0) -> dict[str, Any]:
    """Return the payload for EMHASS's `naive-mpc-optim`: one deferrable load per row with a positive `charge_wh`.

    A load begins after the vehicle's trips of the hours before, and ends at its departure. `vehicles` names the vehicle of each load.
    EMHASS counts steps from the time of the request, so the payload is to be posted at `begins_at`. EMHASS switches a load for whole
    steps only, so the operating hours are rounded up to whole steps.

    Parameters
    ----------
    needs : DataFrame
        Result of `needs_by_hour`.
    at : datetime
        Beginning of the first step, with its time zone.
    charger_w : float
        Power of a charger [W]; that of a load is the smaller one of charger and car, of which the share `EFFICIENCY` reaches the battery. A
        charger of more than 43 kW has direct current.
    step_s : float
        Length of a step [s].

    Raises
    ------
    InvalidInput
        If a vehicle that has to charge departs before `at`.

    Examples
    --------
    >>> leaves = dt.datetime(2026, 1, 12, 7, 30, tzinfo=dt.UTC)
    >>> powers = {"alternating_w": 11000.0, "direct_w": 50000.0}
    >>> row = {"vehicle_id": "V1", "departs_at": leaves, "arrives_at": leaves, "charge_wh": 13320.0, **powers}
    >>> load = emhass(pd.DataFrame([row]), leaves - dt.timedelta(hours=10), 7400.0)
    >>> load["operating_hours_of_each_deferrable_load"], load["end_timesteps_of_each_deferrable_load"]
    ([2.0], [20])
    """
    needs = needs.assign(after=needs.groupby("vehicle_id")["arrives_at"].shift(fill_value=at))
    loads = needs[needs["charge_wh"] > 0.0]
    rows = loads.to_dict("records")
    departed = ((row["vehicle_id"], f"{row['departs_at']}") for row in rows if row["departs_at"] < at)
    what = "departs before the charging begins"
    fix = "let the charging begin earlier, or leave out what is driven already"
    raise_faults(Fault(what, *row, f"later than {at}", fix) for row in departed)
    steps = [[(row[name] - at).total_seconds() / step_s for name in ("after", "departs_at")] for row in rows]
    last = [int(end) for _, end in steps]
    step_h = step_s / SECONDS_PER_HOUR
    power_w = loads[POWERS[charger_w >= DIRECT_FROM_W]].clip(upper=charger_w)
    steps_needed = loads["charge_wh"] / (EFFICIENCY * power_w * step_h)
    return {
        "begins_at": at.isoformat(timespec="seconds"),
        "prediction_horizon": max([*last, 1]),
        "number_of_deferrable_loads": len(loads),
        "nominal_power_of_deferrable_loads": power_w.tolist(),
        "operating_hours_of_each_deferrable_load": [math.ceil(n - 1e-9) * step_h for n in steps_needed],
        "start_timesteps_of_each_deferrable_load": [math.ceil(max(begin, 0.0)) for begin, _ in steps],
        "end_timesteps_of_each_deferrable_load": last,
        "vehicles": loads["vehicle_id"].tolist(),
    }


def evcc(needs: pd.DataFrame) -> list[str]:
    """Return paths to post to evcc: one charging plan per vehicle, with the charge needed at its first departure.

    Examples
    --------
    >>> leaves = dt.datetime(2026, 1, 12, 7, 30, tzinfo=dt.UTC)
    >>> evcc(pd.DataFrame({"vehicle_id": ["V1"] * 2, "departs_at": [leaves] * 2, "soc_needed": [0.551, 0.3]}))
    ['/api/vehicles/V1/plan/soc/56/2026-01-12T07:30:00Z']
    """
    return [
        f"/api/vehicles/{quote(str(row['vehicle_id']), safe='')}/plan/soc/{min(math.ceil(100.0 * row['soc_needed'] - 1e-9), 100)}/"
        f"{row['departs_at'].astimezone(dt.UTC):%Y-%m-%dT%H:%M:%SZ}"
        for row in needs.drop_duplicates("vehicle_id").to_dict("records")
    ]


def night_document(needs: pd.DataFrame, at: dt.datetime, charger_w: float) -> dict[str, Any]:
    """Return the needs of a night as data: the rows of `needs_by_hour`, the payload of `emhass`, and the paths of `evcc`."""
    return {"needs": records(needs), "emhass": emhass(needs, at, charger_w), "evcc": evcc(needs)}


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as data, with times as text in UTC and None for unknown values."""
    text = table.to_json(orient="records", date_format="iso", double_precision=15)
    rows: list[dict[str, Any]] = json.loads(text)
    return rows
