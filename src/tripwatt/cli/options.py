"""Options that commands share, and what they stand for: a fleet of trips, a car."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from tripwatt.errors import Check, Fault, InvalidInput, extras_faults, places_named, raise_faults

if TYPE_CHECKING:
    from tripwatt.forecasting import ForecastModel
    from tripwatt.trips import Flag, Fleet


def option(metavar: str, help: str, *names: str, **more: Any) -> Any:
    """An option of a command that takes a value; its name is that of the parameter where none is given."""
    return typer.Option(*names, metavar=metavar, help=help, **more)


def argument(metavar: str, help: str) -> Any:
    """An argument of a command."""
    return typer.Argument(metavar=metavar, help=help)


DataArgument = Annotated[
    Path | None, argument("DATA", "Folder or file of logged trips. Default: the built-in synthetic fleet.")
]
DatasetOption = Annotated[
    str | None,
    option(
        "NAME",
        "Format of DATA: tum, ved or table. Default: table with --mapping or if DATA is a single file that is not "
        "a TUM trip, otherwise tum.",
        "--dataset",
    ),
]
MappingOption = Annotated[
    str | None,
    option(
        "FILE.toml|NAME",
        "Columns and units of a table: a TOML file, or a name from `tripwatt mapping list`.",
        "--mapping",
    ),
]
VehicleOption = Annotated[
    str | None,
    option(
        "NAME|FILE.toml",
        "The car: a name from `tripwatt vehicles`, or a TOML file. Default: the car of the data set; for a table, "
        "the BMW i3.",
        "--vehicle",
    ),
]
SetOption = Annotated[
    list[str] | None,
    option(
        "KEY=VALUE",
        "Replace one value of the car, for example mass=1300. You can repeat the option. Keys: those that "
        "`tripwatt vehicles NAME` lists, or short names such as mass, payload, c_d, c_rr, base_load, setpoint.",
        "--set",
    ),
]
StrictOption = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Refuse DATA with a list of everything that cannot be read as it stands. Default: use the rest.",
    ),
]
NotesOption = Annotated[
    bool,
    typer.Option("--notes", help="List every fault and note one by one. Default: one line for each kind."),
]
TripOption = Annotated[str | None, option("ID", "Trip to use if DATA contains several.", "--trip")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]

CARS: Final[Mapping[str, str]] = {"synthetic": "bmw_i3_60ah", "tum": "bmw_i3_60ah", "ved": "nissan_leaf_24"}
"""Data set -> the car that drove it."""

BUILT_IN_TRIPS: Final = 24
"""Trips of the built-in fleet with planted faults: as many as a first run evaluates in little more than a minute."""

UNKNOWN_CAR: Final = "bmw_i3_60ah"
"""The car that is assumed for a table without --vehicle; the commands note it."""


def require_extras(needed: Mapping[str, str]) -> None:
    """Raise `InvalidInput` with every extra of a command that is not installed, before anything starts."""
    faults = extras_faults(needed)
    raise_faults(faults)


def read_logs(
    data: Path | None,
    dataset: str | None,
    mapping: str | None,
    *,
    built_in_faults: bool = False,
    lenient: bool = False,
    **more: Any,
) -> Fleet:
    """The trips that a user means by DATA, --dataset and --mapping.

    `built_in_faults` plants faults into the built-in trips, for commands that audit them; a published set is
    read strictly unless `lenient`; `more` are the `strict`, `vehicle` and
    `progress` of the reader.

    Raises
    ------
    InvalidInput
        With every fault of the data.
    """
    if data is None:
        from tripwatt.synthetic import synthetic_fleet

        unused = {"--dataset": dataset, "--mapping": mapping}
        faults = [
            Fault("option has no effect", k, v, "only together with DATA")
            for k, v in unused.items()
            if v is not None
        ]
        raise_faults(faults)
        return synthetic_fleet(BUILT_IN_TRIPS, faults=True) if built_in_faults else synthetic_fleet()
    from tripwatt.sources import read_logs as read

    if dataset in (None, "tum") and mapping is None and data.is_file():
        single = _single_tum_trip(data)
        if single is not None:
            return single
    if dataset is None:
        dataset = "table" if mapping is not None or data.is_file() else "tum"
    if dataset != "table":  # a study of a published set has all of it
        more["strict"] = more.get("strict", False) or not lenient
    return read(data, dataset, mapping, **more)


def _single_tum_trip(path: Path) -> Fleet | None:
    """A file of the TUM set as a fleet of one trip, with its line of the sheet beside it; None for another file."""
    from tripwatt.sources.tum import CITATION, OVERVIEW_NAME, REFERENCE_TRIPS, read_tum_file, trip_files
    from tripwatt.sources.tum_overview import read_overview
    from tripwatt.trips import Fleet

    try:
        files, _ = trip_files(path.parent)
    except InvalidInput:
        return None
    trip_id = next((name for name, file in files.items() if file.name == path.name), None)
    if trip_id is None:
        return None
    contexts, notes = read_overview(path.parent / OVERVIEW_NAME, (trip_id,))
    trip = read_tum_file(path, trip_id, contexts.get(trip_id))
    return Fleet("tum", (trip,), tuple(notes), REFERENCE_TRIPS, CITATION)


def car_of(
    vehicle: str | None, data: Path | None, dataset: str | None, mapping: str | None
) -> tuple[str, tuple[Flag, ...]]:
    """The car's name, and a flag where neither the user nor the data set names it.

    Examples
    --------
    >>> car_of(None, Path("logs"), "ved", None)
    ('nissan_leaf_24', ())
    """
    if vehicle is not None:
        return vehicle, ()
    if data is None:
        return CARS["synthetic"], ()
    if dataset is not None and dataset in CARS:
        return CARS[dataset], ()
    if dataset is None and mapping is None and (not data.is_file() or data.name.lower().startswith("trip")):
        return CARS["tum"], ()
    from tripwatt.trips import Flag  # pandas is slow to import

    return UNKNOWN_CAR, (Flag("car_assumed", UNKNOWN_CAR),)


def gather(*checks: Callable[[], object]) -> None:
    """Run all checks and raise one `InvalidInput` with the faults of all of them.

    Examples
    --------
    >>> gather(lambda: None)
    """
    with Check() as check:
        for each in checks:
            check(each)


@contextmanager
def options_named() -> Iterator[None]:
    """Faults of what options give, under the names of the options."""
    from tripwatt.trips.departure import ASKED

    more = {"vehicle": "--vehicle", "reserve": "--reserve", "speed_m_s": "--speed"}
    with places_named({name: field.option for name, field in ASKED.items()} | more):
        yield


EXAMPLES: Final = "For example:"
"""Line of a command's docstring below which its examples are: what each does, then what to type."""


def add_command(app: typer.Typer, command: Callable[..., None], name: str | None = None, **more: Any) -> None:
    r"""Add a command to an application: its help is its docstring, with the examples at the end of the page.

    Parameters
    ----------
    app : typer.Typer
        The application.
    command : callable
        Its docstring has examples below the line `EXAMPLES`.
    name : str, optional
        That of the function when not given.
    **more
        Further arguments of `Typer.command`.

    Examples
    --------
    >>> app = typer.Typer()
    >>> add_command(app, gather)
    >>> app.registered_commands[0].name, app.registered_commands[0].epilog
    ('gather', None)
    """
    text, _, shown = inspect.getdoc(command).partition(f"\n\n{EXAMPLES}\n\n")  # type: ignore[union-attr]
    epilog = f"\b\nExamples:\n{shown}" if shown else None  # \b: click keeps the lines of the paragraph
    app.command(name or command.__name__.replace("_", "-"), help=text, epilog=epilog, **more)(command)


def group_of(help: str) -> typer.Typer:
    """A group of commands."""
    return typer.Typer(help=help, no_args_is_help=True, rich_markup_mode=None)


def model_of(folder: Path | None) -> ForecastModel:
    """The model that a user means by a folder: a stored model, or a car with what it learned; without one the bundled model.

    Raises
    ------
    InvalidInput
        When the folder holds neither.
    """
    from tripwatt.forecasting import load_model

    if folder is not None and (folder / "car.json").is_file():
        from tripwatt.live import is_car, open_car  # slow to import, and most folders are models

        if is_car(folder):
            return open_car(folder).model()
    return load_model(folder)
