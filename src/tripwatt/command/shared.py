"""Options that commands share, and the objects that they select: logged trips, a car, a model, a map, a departure."""

from __future__ import annotations

import datetime as dt
import inspect
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

import tripwatt as tw
from tripwatt import files, trips
from tripwatt.command.options import Options, argument, assignments, flag, option, require_effect
from tripwatt.errors import Check, Fault, InvalidInput, and_more, or_none, places_named, system_errors
from tripwatt.trips.departure import ASKED, Departure
from tripwatt.trips.fields import Field

if TYPE_CHECKING:
    from tripwatt.roads.journey import AtlasSettings
    from tripwatt.vehicles import Vehicle

Data = Annotated[Path | None, argument("DATA", "Logged trips: folder or file. Default: real examples.")]
FORMATS: Final = "Format of DATA: tum, ved or table. Default: table for a file or with --mapping, else tum. Without DATA: tum, ved or synthetic trips."
Dataset = Annotated[str | None, option("NAME", FORMATS, "--dataset")]
COLUMNS: Final = "Columns and units of a table: a TOML file, or a name from `tripwatt mapping list`."
Columns = Annotated[str | None, option("FILE.toml|NAME", COLUMNS, "--mapping")]
STRICT: Final = "Refuse DATA that has faults, and list all of them. Default: leave out what has faults."
Strict = Annotated[bool, flag("--strict", STRICT)]
LOGGED: Final = "The car that was driven. Default: the car of the data set; for a table, the BMW i3."
LoggedCar = Annotated[str | None, option("NAME|FILE.toml", LOGGED, "--car")]
SET: Final = "Replace a value of the car: mass=1300; `tripwatt vehicles NAME` lists the keys. Repeatable."
Overrides = Annotated[list[str] | None, option("KEY=VALUE", SET, "--set")]
TripId = Annotated[str | None, option("ID", "Trip to use if DATA contains several.", "--trip")]
ANOTHER: Final = "Another car: a name from `tripwatt vehicles`, or a TOML file; the interval is wider. Or the folder of your own car."
Car = Annotated[str | None, option("NAME|FILE|FOLDER", ANOTHER, "--car")]
Model = Annotated[Path | None, option("FOLDER", "Folder of a model. Default: the bundled one.", "--model")]
Reserve = Annotated[float, option("0..1", "Charge to arrive with, as displayed.", "--reserve")]
Probability = Annotated[float, option("0.5..0.999", "Probability that it is enough.", "--probability")]
Plug = Annotated[float, option("W", "Power of the plug; 0: not plugged in.", "--plug", min=0.0)]
Cars = Annotated[Path | None, option("DIR", "Folder of cars that learn (see `tripwatt car`).", "--cars")]
Port = Annotated[int, option("PORT", "Port; 0 selects a free one.", "--port", min=0, max=65535)]
TextFile = Annotated[Path | None, option("FILE", "Write to this file instead of printing.", "--out", "-o")]
OutFolder = Annotated[Path, option("FOLDER", "Folder to write.", "--out", "-o")]
OutFile = Annotated[Path, option("FILE", "File to write.", "--out", "-o")]
Texts = list[str] | None
TILES: Final = "Elevation tiles: SRTM (N47E009.hgt, also .gz or .zip) or GeoTIFF."
Tiles = Annotated[Path | None, option("FOLDER", TILES, "--elevation")]
ROADS: Final = (
    "Folder of a map (see `tripwatt map build`), or a router's server: valhalla=URL, osrm=URL, graphhopper=URL or "
    "openrouteservice=URL. FOLDER@KIND=URL takes places from a map and roads from a server. Default: TRIPWATT_MAP."
)
Map = Annotated[str, option("FOLDER|KIND=URL", ROADS, "--map", envvar="TRIPWATT_MAP", show_envvar=False)]
PLACES: Final = "Server that finds places: photon=URL or nominatim=URL. Default: the index of the map."
Places = Annotated[str, option("KIND=URL", PLACES, "--places")]
WEATHER: Final = "Weather server with the interface of Open-Meteo. Default: no server is asked."
STATIONS: Final = "Charging stations, CSV: latitude_deg, longitude_deg, power_kw, name. Default: the map's."

CARS: Final[Mapping[str, str]] = {"synthetic": "bmw_i3_60ah", "tum": "bmw_i3_60ah", "ved": "nissan_leaf_24"}
"""Data set -> name of the car that was driven."""

UNKNOWN_CAR: Final = "bmw_i3_60ah"
"""Car that is assumed for a table without --car; commands print a note about this."""

MAX_NAMES: Final = 12
"""Largest number of trips that a message lists."""


@dataclass(frozen=True)
class Logs:
    """The logged trips that a command reads."""

    data: Data = None
    dataset: Dataset = None
    mapping: Columns = None
    strict: Strict = False

    @property
    def format(self) -> str:
        """The format of DATA, or the trips of the package that replace it.

        Examples
        --------
        >>> Logs(Path("logs")).format, Logs(Path("logs"), mapping="torque").format, Logs(dataset="ved").format
        ('tum', 'table', 'ved')
        """
        return self.dataset or ("table" if self.mapping or (self.data and self.data.is_file()) else "tum")

    def read(self, *, lenient: bool = False, **more: Any) -> trips.TripSet:
        """Read the trips of DATA; without DATA, return trips of the package.

        A published data set is read strictly unless `lenient`, because a study should use all of it. `more` are
        further arguments of `read_logs`, such as `vehicle` and `progress`.

        Raises
        ------
        InvalidInput
            With all faults of the data.
        """
        if self.data is None:
            require_effect({"--mapping": self.mapping}, "only together with DATA")
            if self.format not in CARS:
                raise InvalidInput(Fault.unknown("no trips in the package", "--dataset", self.format, CARS))
            from tripwatt.study.synthetic import synthetic_fleet  # only where it is asked for

            return synthetic_fleet() if self.format == "synthetic" else tw.sample_trips(self.format)
        strict = self.strict or not (lenient or self.format == "table")
        return tw.read_logs(self.data, self.format, self.mapping, strict=strict, **more)


@dataclass(frozen=True)
class LogsOfCar(Logs):
    """Logged trips and the car that drove them."""

    vehicle: LoggedCar = None
    overrides: Overrides = None

    def named(self) -> tuple[str, tuple[trips.Flag, ...]]:
        """Return the name of the car, and a flag if neither the user nor the data set gives it.

        Examples
        --------
        >>> LogsOfCar(Path("logs"), "ved").named()
        ('nissan_leaf_24', ())
        """
        known = self.vehicle or CARS.get(self.format)
        return (known, ()) if known else (UNKNOWN_CAR, (trips.Flag("car_assumed", UNKNOWN_CAR),))

    def car(self) -> Vehicle:
        """Load the car, with the values of --set."""
        return tw.load_vehicle(self.named()[0], overrides=assignments(self.overrides or [], "--set"))


@dataclass(frozen=True)
class OnMap:
    """The map of a command, and the servers that the command may use."""

    map_: Map = ""
    places: Places = ""
    weather: Annotated[str, option("URL", WEATHER)] = ""
    stations: Annotated[Path | None, option("FILE", STATIONS)] = None

    def settings(self) -> AtlasSettings:
        """Return the settings of the atlas."""
        from tripwatt.roads.journey import AtlasSettings

        return AtlasSettings(self.map_, self.places, self.weather, f"{self.stations or ''}")


def one_trip(candidates: Sequence[tw.Trip], wanted: str | None, why_not: str = "") -> tw.Trip:
    """Return the trip with the id `wanted` or, if it is None, the only trip.

    Raises
    ------
    InvalidInput
        If there is no such trip, or there are several and `wanted` is None.
    """
    chosen = [trip for trip in candidates if wanted in (None, trip.trip_id)]
    if len(chosen) == 1:
        return chosen[0]
    names = ", ".join(trip.trip_id for trip in candidates[:MAX_NAMES]) or "a trip that the audit uses"
    got = why_not or wanted or f"{len(candidates)} trips"
    allowed = names + and_more(candidates[MAX_NAMES - 1 :], "trip")
    raise InvalidInput.of("no single trip", "--trip", got, allowed)


def read_plan(trip: Path, speed_m_s: float | None = None) -> tw.Plan:
    """Read the trip of a forecast; the table of a logger with one trip and its energy is read as `tripwatt simulate` reads it.

    Raises
    ------
    InvalidInput
        As `tw.read_route`, also if a table has some of our columns, because a misspelled one is not guessed.
    """
    try:
        return tw.read_route(trip, speed_m_s=speed_m_s)
    except InvalidInput as error:
        missing = [f for f in error.faults if f.what == "missing column" and speed_m_s is None]
        logs = or_none(Logs(trip).read) if len(missing) == len(trips.REQUIRED_COLUMNS) else None
        if logs is None or len(logs) > 1 or logs.trips[0].observed_energy_wh is None:
            raise
    (log,) = logs.trips
    plan = tw.Plan.from_samples(log.samples[[c for c in trips.COLUMNS if c in log]], log.trip_id)
    return replace(plan, flags=(*plan.flags, *logs.notes))


def write_text(text: str, path: Path) -> None:
    """Write the file of the option --out, completely or not at all; its folder is made if there is none.

    Raises
    ------
    InvalidInput
        If the file cannot be written; an existing file is then unchanged.
    """
    with system_errors("cannot write the file", "--out", "", path):
        if path.exists() and not path.is_file():
            raise OSError(f"{'a folder' if path.is_dir() else 'no regular file'}")
        path.parent.mkdir(parents=True, exist_ok=True)
        files.write_text(path, text)


def options_named(**more: str) -> AbstractContextManager[None]:
    """Name faults by the options of the command instead of the arguments of the library, within a `with` block."""
    others = {"vehicle": "--car", "car": "--car", "reserve": "--reserve", "speed_m_s": "--speed"} | more
    return places_named({name: field.option for name, field in ASKED.items()} | others)


def checked(check: Check, car: str | None, departure: DepartureOf, model: Path | None) -> Any:
    """Return a car, a departure and a model; both are None for the bundled model and its car."""
    given, known = check(model_and_car, model, car) or {}, check(departure)
    name = given.get("car")
    return name and check(tw.load_vehicle, name), known, given.get("model")


def model_and_car(model: Path | None, car: str | None) -> dict[str, Any]:
    """Return the model of --model and the name of --car as arguments; the folder of a user's own car gives its model and no name."""
    if car is None or not Path(car).is_dir() or or_none(tw.load_vehicle, car) is not None:
        return {"model": model and _model_of(model), "car": car}
    require_effect({"--model": model}, "only without the folder of a car")
    return {"model": tw.open_car(car).model(), "car": None}


def _model_of(folder: Path) -> tw.ForecastModel:
    """Load the model of a folder: a stored model, or the adapted model of a car.

    Raises
    ------
    InvalidInput
        If the folder holds neither.
    """
    # car.json is from an older version
    if any((folder / name).is_file() for name in ("car.sqlite", "car.json")):
        from tripwatt.server.cars.folder import is_car  # slow to import, and most folders are models

        if is_car(folder):
            return tw.open_car(folder).model()
    return tw.load_model(folder)


DepartureOf = Callable[[], Departure]
"""Parameter of a command with the options of a departure: a function that makes the departure, or raises their faults."""


def departure_options(
    *, without: tuple[str, ...] = (), default: Mapping[str, float] | None = None
) -> Options:
    """Build the options of a departure, to annotate a command's parameter of type `DepartureOf`.

    Parameters
    ----------
    without : tuple of str
        Fields without effect on the command, which get no option.
    default : mapping of str to float, optional
        Default values of fields that the command does not leave unknown.

    Returns
    -------
    Options
        One option for each field, or for several fields that are given together.

    Examples
    --------
    >>> options = departure_options(without=("terrain",))
    >>> names = [parameter.name for parameter in options.parameters]
    >>> "soc" in names, "terrain" in names
    (True, False)
    >>> options.make(soc=0.8, wind="8@270")()
    Departure(soc=0.8, wind_speed_m_s=8.0, wind_from_deg=270.0)
    """
    grouped: dict[str, dict[str, Field]] = {}
    for name, field in ASKED.items():
        if name not in without:
            grouped.setdefault(field.option.removeprefix("--").replace("-", "_"), {})[name] = field
    usual = default or {}
    parameters = [
        inspect.Parameter(
            option,
            inspect.Parameter.KEYWORD_ONLY,
            default=usual.get(next(iter(fields))),
            annotation=_annotation(fields, shows_default=next(iter(fields)) in usual),
        )
        for option, fields in grouped.items()
    ]
    return Options(lambda **asked: partial(_departure, grouped, asked), parameters)


def _annotation(fields: Mapping[str, Field], *, shows_default: bool) -> Any:
    """Build type and help of the option for one field, or for several fields that are given as `A@B`."""
    field = next(iter(fields.values()))
    spoken = " ".join(field.help for field in fields.values())
    kind: Any = str | None
    if field.several or field.type == "values":
        kind, spoken = list[str] | None, f"{spoken} You can repeat the option."
    elif field.type == "time":
        spoken = f"{spoken} Local time, today without a date."
    elif field.column is not None and len(fields) == 1:
        kind = float | None
    metavar = "@".join(field.metavar for field in fields.values())
    option = typer.Option(field.option, metavar=metavar, help=spoken, show_default=shows_default)
    return Annotated[kind, option]


def _departure(grouped: Mapping[str, Mapping[str, Field]], asked: Mapping[str, Any]) -> Departure:
    known: dict[str, Any] = {}
    with Check() as check:
        for option, fields in grouped.items():
            if asked.get(option) is not None:
                known |= check(_values, fields, asked[option]) or {}
        return check(lambda: Departure(**known))


def _values(fields: Mapping[str, Field], value: Any) -> dict[str, Any]:
    """Parse the value of one option into the values of its fields."""
    name, field = next(iter(fields.items()))
    if field.several:
        return {name: tuple(value)}
    if field.type == "values":
        return {name: assignments(value, field.option)}
    if field.type == "time":
        return {name: time_of(value, field.option)}
    if len(fields) == 1:
        return {name: value}
    parts = str(value).split("@", len(fields) - 1)
    try:
        return {
            name: float(part) % 360.0 if field.unit == "°" else float(part)
            for (name, field), part in zip(fields.items(), parts, strict=False)
        }
    except ValueError as error:
        allowed = "@".join(field.metavar for field in fields.values())
        raise InvalidInput.of("not numbers", field.option, str(value)[:40], allowed) from error


def time_of(text: str, option: str = "--depart") -> dt.datetime:
    """Parse a local time: a time of today, or a date and a time.

    Raises
    ------
    InvalidInput
        If the text is neither.

    Examples
    --------
    >>> time_of("2026-02-01 07:30").hour, time_of("7:30").minute
    (7, 30)
    """
    today = dt.datetime.now().astimezone()
    try:
        if len(text) <= 5:
            clock = dt.time.fromisoformat(text.zfill(5))
            return today.replace(hour=clock.hour, minute=clock.minute, second=0, microsecond=0)
        return dt.datetime.fromisoformat(text).astimezone()
    except ValueError as error:
        raise InvalidInput.of("not a time", option, text[:40], "07:30, or 2026-02-01 07:30") from error


Departing = Annotated[DepartureOf, departure_options()]
DepartingNow = Annotated[DepartureOf, departure_options(without=("departs_at",))]
"""Types of the parameter for all options of a departure, and for those without the time of departure."""
