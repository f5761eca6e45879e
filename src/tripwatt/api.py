"""The verbs of the library: read plans and trips, simulate, fit, adapt, forecast."""

from __future__ import annotations

import itertools
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt import population, routes
from tripwatt.errors import Check, Fault, InvalidInput, raise_faults, require_type
from tripwatt.forecasting.forecast import BAND, Forecast
from tripwatt.forecasting.model import DEFAULT_CORRECTOR, ForecastModel
from tripwatt.hybrid import Corrector
from tripwatt.physics import Simulation, simulate_trip
from tripwatt.physics.batch import trip_totals
from tripwatt.routes.links import LinkRoute
from tripwatt.sources import read_logs
from tripwatt.sources.canonical import Frames, canonical_samples, read_canonical
from tripwatt.trips import COLUMNS, LINK_COLUMNS, Departure, Plan, Trip, TripSet, structure_faults
from tripwatt.trips.departure import FIELDS, require_departure
from tripwatt.units import with_units
from tripwatt.vehicles import ALIASES, Vehicle, load_vehicle, vehicle_document, vehicle_from_document

Route = Path | str | bytes | pd.DataFrame | Sequence[Mapping[str, float | None]]
"""What `read_route` reads."""

Trips = TripSet | Sequence[Trip] | Frames
"""What `fit` and `adapt` take."""

Cars = Vehicle | str | Sequence[Vehicle | str]
"""One or several cars, each as a `Vehicle` or by its name in the library."""


def read_route(source: Route, *, speed_m_s: float | None = None, trip_id: str | None = None) -> Plan:
    """Read a planned drive from a file, its content or its links. O(bytes).

    Parameters
    ----------
    source : path, bytes, DataFrame or sequence of mapping
        A file or its content: links as CSV or JSON, GPX, GeoJSON, a saved response of OSRM, Valhalla,
        openrouteservice or GraphHopper; a driven speed trace as CSV or Parquet with canonical columns. The first sample
        of the other signals of a speed trace becomes the departure. Or links themselves, as `route_from_links` takes them. A DataFrame with `time_s` or other columns of a log is a speed trace, unless it has `length_m` and no `time_s`.
    speed_m_s : float, optional
        Mean speed [m/s] of a track without times and speeds.
    trip_id : str, optional
        Name of the plan; by default the name of the file, or "route".

    Returns
    -------
    Plan
        Its departure has the values that the file contains.

    Raises
    ------
    InvalidInput
        With every fault of the file; also when a track needs `speed_m_s`, or when `speed_m_s` has no effect.

    Examples
    --------
    >>> read_route([{"length_m": 5000.0, "speed_m_s": 20.0}], trip_id="commute")
    <Plan commute: 5.0 km in 4 min, links of 5000 m>
    """
    where = Path(source).name if isinstance(source, str | Path) else "route"
    named, route = trip_id or Path(where).stem, _read(source)
    needs_speed = getattr(route, "needs_speed", False)
    if needs_speed and speed_m_s is None:
        got, allowed = "points without times and speeds", "a mean speed for the track"
        fix = "give speed_m_s in Python, --speed KM/H on the command line"
        raise InvalidInput.of("speed is missing", where, got, allowed, fix)
    if speed_m_s is not None and not needs_speed:
        got, allowed = f"{where} contains times or speeds", "only for a track without times and speeds"
        raise InvalidInput.of("speed has no effect", "speed_m_s", got, allowed)
    if isinstance(route, pd.DataFrame):
        return Plan.from_samples(route, named)
    if isinstance(route, LinkRoute):
        return route.plan(trip_id=named)
    return route.plan(speed_m_s=speed_m_s, trip_id=named)


def _read(source: Route) -> LinkRoute | routes.Track | pd.DataFrame:
    """Read the links, the track or the samples of a source."""
    if isinstance(source, bytes) or (isinstance(source, str | Path) and routes.is_route(source)):
        return routes.parse_route(source)
    if isinstance(source, str | Path):
        return read_canonical(source)
    if isinstance(source, pd.DataFrame) and ("time_s" in source or not _is_of_links(source)):
        return canonical_samples(source)
    allowed = "a file or its content, a DataFrame, or a list of links"
    return routes.route_from_links(require_type("source", source, Iterable, allowed))


def _is_of_links(table: pd.DataFrame) -> bool:
    return "length_m" in table or (COLUMNS.keys() - LINK_COLUMNS.keys()).isdisjoint(table)


def read_trips(
    path: Path | str | Frames,
    dataset: str = "tum",
    mapping: Path | str | None = None,
    *,
    strict: bool = False,
    car: Vehicle | str | None = None,
) -> tuple[Trip, ...]:
    """Read logs, audit them and return the sound drives: `read_logs`, then `audit`.

    Parameters
    ----------
    path : path or tables
        A folder or file of logs, or tables in memory, as for `read_logs`.
    dataset : str
        Kind of the logs, as for `read_logs`.
    mapping : path or str, optional
        Names of the columns of a table, as for `read_logs`.
    strict : bool
        Refuse what cannot be read as it stands, as for `read_logs`.
    car : Vehicle or str, optional
        The car of logs that have only the state of charge, as for `read_logs`.

    Returns
    -------
    tuple of Trip
        Drives that passed the audit.

    Raises
    ------
    InvalidInput
        When nothing can be used; with `strict`, with every fault of the data set.

    Examples
    --------
    >>> import tripwatt as tw
    >>> trips = tw.read_trips("exports", "table", "leaf_spy")  # doctest: +SKIP
    """
    return tuple(_sound(read_logs(path, dataset, mapping, strict=strict, car=car)))


def forecast(
    plan: Plan | Trip | Route,
    departure: Departure | None = None,
    *,
    model: ForecastModel | Path | str | None = None,
    car: Vehicle | str | None = None,
) -> Forecast:
    """Forecast the battery energy of a drive with a stored model, for its own car or for another one.

    Parameters
    ----------
    plan : Plan or Trip, or what `read_route` reads
        The planned drive. If it is a recorded trip, only its speed trace, its road and its first sample are used.
    departure : Departure, optional
        Its known fields replace those of the plan.
    model : ForecastModel or path, optional
        By default the model that comes with the package.
    car : Vehicle or str, optional
        A car other than the model's own. No trips of this car are known, so the interval is wider.

    Returns
    -------
    Forecast
        Energy, charge at arrival and their uncertainty.

    Raises
    ------
    InvalidInput
        As `read_route`, `load_model`, `load_vehicle` and `ForecastModel.forecast`; also if `departure` is no `Departure`.

    Examples
    --------
    >>> plan = read_route([{"length_m": 5000.0, "speed_m_s": 20.0}])
    >>> forecast(plan, Departure(soc=0.8, ambient_temperature_degc=-5)).plan.departure
    Departure(soc=0.8, ambient_temperature_degc=-5)
    """
    recorded = plan if isinstance(plan, Plan | Trip) else read_route(plan)
    return population.for_car(model, car).forecast(recorded, departure)


def fit(
    trips: Trips,
    car: Vehicle | str,
    *,
    corrector: str | Corrector = DEFAULT_CORRECTOR,
    seed: int = 0,
    identified: bool = True,
    covariates: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> ForecastModel:
    """Fit a forecasting model on the trips of one car.

    Parameters
    ----------
    trips : TripSet, sequence of Trip, or tables as for `read_logs`
        A `TripSet` and tables are audited first.
    car : Vehicle or str
        The car, or its name in the library.
    corrector : str or Corrector
        One of `tripwatt.hybrid.POWER_CORRECTORS`, the name of a corrector of an installed package, or an object: a regressor
        with the interface of scikit-learn, or an object with ``fit(table)`` and ``predict(table)`` on a `SegmentTable`.
    seed : int
        The same seed gives the same model.
    identified : bool
        Whether values of the car are first identified from the signals that the trips have: motor torque, heater and air
        conditioner, power of the standing car, voltage at rest. If False, the published values are kept.
    covariates : sequence of str
        Columns of the logs beside their signals, numbers or words, that the corrector uses: the mean over a trip, or the most
        frequent word. Name only what a plan will know. `Departure.covariates` gives the values for a forecast; an unknown one
        is integrated over its values in the trips.
    progress : callable, optional
        Called with (number of finished fits, number of all fits).

    Returns
    -------
    ForecastModel
        Fitted on the sound trips.

    Raises
    ------
    InvalidInput
        With fewer than eight trips, or trips without measured energy.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.fit(tw.sample_trips(), "bmw_i3_60ah", corrector="linear")
    <ForecastModel BMW i3 60 Ah, linear corrector, 15 trips>
    >>> from sklearn.ensemble import HistGradientBoostingRegressor
    >>> tw.fit(tw.sample_trips(), "bmw_i3_60ah", corrector=HistGradientBoostingRegressor())
    <ForecastModel BMW i3 60 Ah, HistGradientBoostingRegressor corrector, 15 trips>
    """
    from tripwatt.forecasting.fitting import fit_car  # a forecast does not need it

    car, sound = _car(car), _sound(trips)
    require_type("covariates", covariates, list | tuple | pd.Index, "a list of names")
    model, _ = fit_car(
        sound, car, corrector, seed, identified=identified, covariates=covariates, progress=progress
    )
    return model


def adapt(base: ForecastModel, trips: Trips, car: Vehicle | str) -> ForecastModel:
    """Adapt a model of one car to another car, with a few trips of the new car.

    Parameters
    ----------
    base : ForecastModel
        A fitted model.
    trips : TripSet, sequence of Trip, or tables as for `read_logs`
        At least one trip with measured energy; a `TripSet` and tables are audited first.
    car : Vehicle or str
        The new car, or its name in the library.

    Returns
    -------
    ForecastModel
        The model of the new car.

    Raises
    ------
    InvalidInput
        When the base is not fitted, or a trip has no measured energy.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.adapt(tw.load_model(), tw.sample_trips("ved").trips[:3], "nissan_leaf_24")
    <ForecastModel Nissan Leaf 24 kWh, population corrector, 3 trips>
    """
    return population.adaptation(base, _sound(trips), _car(car)).model


def simulate(trip: Plan | Trip | Route, car: Vehicle | str, departure: Departure | None = None) -> Simulation:
    """Simulate one drive with one car: physics alone, without a correction. O(samples). For many drives and cars, see `sweep`.

    Parameters
    ----------
    trip : Plan or Trip, or what `read_route` reads
        The drive. If it is a recorded trip, only what was known at its departure is used.
    car : Vehicle or str
        The car, or its name in the library.
    departure : Departure, optional
        Its known fields replace those of the plan.

    Returns
    -------
    Simulation
        Power by cause, charge and temperatures at every step.

    Raises
    ------
    InvalidInput
        When the drive cannot be simulated.

    Examples
    --------
    >>> run = simulate(read_route([{"length_m": 5000.0, "speed_m_s": 20.0}]), "vw_id3")
    >>> bool(run.simulated_energy_wh > 0.0)
    True
    """
    return simulate_trip(_car(car), _plan(trip, departure))


def sweep(
    trip: Plan | Trip | Route | Iterable[Plan | Trip],
    car: Cars,
    values: Mapping[str, npt.ArrayLike] = types.MappingProxyType({}),
    departure: Departure | None = None,
    *,
    model: ForecastModel | Path | str | None = None,
) -> pd.DataFrame:
    """Simulate or forecast drives with cars and every combination of some values: one table. O(samples x combinations).

    Many drives are simulated side by side, a few times faster than one by one; the energies of a drive are the same either way.
    The memory depends on the number of rows of the table, so drives may come from a generator.

    Parameters
    ----------
    trip : Plan or Trip, or an iterable of them, or what `read_route` reads
        The drives, as for `simulate`.
    car : Vehicle or str, or a sequence of them
        The cars, or their names in the library.
    values : mapping of str to (float or str), or to a sequence of these
        Values to try: of a field of the departure, ``{"ambient_temperature_degc": [-10.0, 20.0], "season": ["winter"]}``, or of an
        entry of the car, by its key or short name as in `load_vehicle`, ``{"mass": [1300.0, 1500.0]}``.
    departure : Departure, optional
        Its known fields replace those of the plans; those of `values` replace its own.
    model : ForecastModel or path, optional
        Forecasts each drive with this model, as `forecast` does, instead of the simulation.

    Returns
    -------
    DataFrame
        One row for each drive with each car and combination, the last key of `values` fastest: `trip`, `car`, a column for each key,
        `duration_s`, `distance_m`, `energy_wh` and `flags`, the codes of the flags. A simulation has `energy_<cause>_wh` by cause and
        `soc` of the battery management at the end [1]; a forecast has its interval of 90 %, `energy_low_wh` and `energy_high_wh`,
        the displayed charge at the end, `displayed_soc` [1], and the probability to arrive, `p_arrive` [1]. ``attrs["units"]`` has
        the units. With xarray, ``table.set_index(["trip", *values]).to_xarray()`` has an axis for each.

    Raises
    ------
    InvalidInput
        With every unknown key, every value out of its bounds and every impossible combination; also when a drive cannot be simulated.

    Examples
    --------
    >>> roads = [read_route([{"length_m": 5000.0, "speed_m_s": speed}]) for speed in (15.0, 30.0)]
    >>> table = sweep(roads, ["vw_id3", "bmw_i3_60ah"], {"payload_mass_kg": [0.0, 300.0]}, Departure(soc=0.8))
    >>> len(table), table["payload_mass_kg"].tolist()[:3], table.attrs["units"]["energy_air_wh"]
    (8, [0.0, 300.0, 0.0], 'Wh')
    >>> table = sweep(roads[0], "vw_id3", {"mass": [1700.0, 1900.0], "battery.capacity_ah": [150.0, 170.0]})
    >>> len(table), table.attrs["units"]["mass"], bool(table["energy_wh"][3] > table["energy_wh"][1])
    (4, 'kg', True)
    """
    cars = [_car(each) for each in (car if isinstance(car, Iterable) and not isinstance(car, str) else [car])]
    require_type("values", values, Mapping, "an object of values by name")
    tried = [np.ravel(np.array(given, dtype=object)).tolist() for given in values.values()]
    names, rows, document = list(values), list(itertools.product(*tried)), cache(vehicle_document)

    def variant(car: Vehicle, row: Sequence[Any]) -> tuple[Vehicle, Departure | None]:
        given = dict(zip(names, row, strict=True))
        of_departure = {name: given.pop(name) for name in names if name in FIELDS}
        if given:
            made = vehicle_from_document(document(car), car.name, car.name, overrides=given)
            car = replace(made, entries=car.entries)
        return car, Departure(**of_departure) if of_departure else None

    with Check() as check:
        empty = [name for name, given in zip(names, tried, strict=True) if not given]
        check(raise_faults, [Fault("no values", name, "none", "at least one") for name in empty])
        variants = [check(variant, car, row) for car in cars for row in rows]
    plans = (_plan(each, departure) for each in _drives(trip))
    pairs = ((car, plan.with_departure(known)) for plan in plans for car, known in variants)
    table = pd.DataFrame(
        trip_totals(pairs) if model is None else _forecasts(population.for_car(model), pairs)
    )
    if table.empty:
        raise InvalidInput.of("no drives", "trip", "none", "at least one")
    table["flags"] = [", ".join(flag.code for flag in flags) for flags in table["flags"]]
    columns = zip(names, zip(*rows, strict=True), strict=True)
    axes = pd.DataFrame({name: np.resize(np.array(column), len(table)) for name, column in columns})
    table = pd.concat([table.iloc[:, :2], axes, table.iloc[:, 2:]], axis=1)
    known = {name: car.entries.get(ALIASES.get(name, name)) for car in cars for name in names}
    with_units(table).attrs["units"] |= {name: entry.unit for name, entry in known.items() if entry}
    return table


def _drives(trip: Any) -> Iterable[Plan | Trip | Route]:
    """One drive, or several: a list of links is one, a list of plans is not."""
    of_links = isinstance(trip, Sequence) and any(isinstance(link, Mapping) for link in trip)
    is_one = of_links or isinstance(trip, str | bytes | pd.DataFrame) or not isinstance(trip, Iterable)
    return [trip] if is_one else trip


def _forecasts(model: ForecastModel, pairs: Iterable[tuple[Vehicle, Plan]]) -> Iterator[dict[str, Any]]:
    of_car: dict[int, tuple[Vehicle, ForecastModel]] = {}
    for car, plan in pairs:
        made = of_car.setdefault(id(car), (car, population.for_car(model, car)))[1].forecast(plan)
        low, high = made.interval(BAND)
        yield {
            "trip": plan.trip_id,
            "car": car.name,
            "duration_s": plan.duration_s,
            "distance_m": plan.distance_m,
            "energy_wh": made.energy_wh,
            "energy_low_wh": low,
            "energy_high_wh": high,
            "displayed_soc": made.soc_arrival,
            "p_arrive": made.p_arrive(),
            "flags": made.flags,
        }


def _plan(trip: Plan | Trip | Route, departure: Departure | None) -> Plan:
    require_departure(departure)
    recorded = trip if isinstance(trip, Plan | Trip) else read_route(trip)
    return (recorded if isinstance(recorded, Plan) else Plan.from_trip(recorded)).with_departure(departure)


def _car(car: Vehicle | str) -> Vehicle:
    return car if isinstance(car, Vehicle) else load_vehicle(car)


def _sound(trips: Any) -> Sequence[Trip]:
    if not isinstance(trips, TripSet | pd.DataFrame | Mapping | str):
        trips = tuple(require_type("trips", trips, Iterable, "a list of trips, a TripSet, or tables"))
        if all(isinstance(trip, Trip) for trip in trips):
            raise_faults(fault for trip in trips for fault in structure_faults(trip.samples, trip.trip_id))
            return tuple(trips)
    from tripwatt.auditing import audit  # a forecast does not need it

    return audit(trips if isinstance(trips, TripSet) else read_logs(trips)).trips
