"""Options that commands share, and what they stand for: a fleet of trips, a car."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer

from tripwatt.command.printing import print_json
from tripwatt.errors import Fault, places_named, raise_faults

if TYPE_CHECKING:
    from tripwatt.forecasting import ForecastModel
    from tripwatt.trips import Flag, TripSet


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
        "Format of DATA: tum, ved or table. Default: table with --mapping or if DATA is a file, otherwise tum.",
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
TripOption = Annotated[str | None, option("ID", "Trip to use if DATA contains several.", "--trip")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]

CARS: Final[Mapping[str, str]] = {"synthetic": "bmw_i3_60ah", "tum": "bmw_i3_60ah", "ved": "nissan_leaf_24"}
"""Data set -> the car that drove it."""

UNKNOWN_CAR: Final = "bmw_i3_60ah"
"""The car that is assumed for a table without --vehicle; the commands note it."""


def require_effect(options: Mapping[str, Any], allowed: str) -> None:
    """Raise `InvalidInput` for each of some options that is given, where they have no effect."""
    given = {option: value for option, value in options.items() if value is not None}
    raise_faults(Fault("option has no effect", name, f"{value}", allowed) for name, value in given.items())


def read_logs(
    data: Path | None,
    dataset: str | None,
    mapping: str | None,
    *,
    built_in_trips: int = 32,
    lenient: bool = False,
    **more: Any,
) -> TripSet:
    """The trips that a user means by DATA, --dataset and --mapping.

    Without DATA it is the built-in fleet. A published set is read strictly unless `lenient`; `more` are the `strict`, `vehicle` and
    `progress` of the reader.

    Raises
    ------
    InvalidInput
        With every fault of the data.
    """
    if data is None:
        from tripwatt.study.synthetic import synthetic_fleet

        require_effect({"--dataset": dataset, "--mapping": mapping}, "only together with DATA")
        return synthetic_fleet(built_in_trips)
    from tripwatt.sources import read_logs as read

    dataset = dataset or dataset_of(data, mapping)
    if dataset != "table":  # a study of a published set has all of it
        more["strict"] = more.get("strict", False) or not lenient
    return read(data, dataset, mapping, **more)


def dataset_of(data: Path, mapping: str | None) -> str:
    """The format of DATA where --dataset does not name it.

    Examples
    --------
    >>> dataset_of(Path("logs"), None), dataset_of(Path("logs"), "torque")
    ('tum', 'table')
    """
    return "table" if mapping is not None or data.is_file() else "tum"


@dataclass(frozen=True)
class Logs:
    """The logged trips that a command reads."""

    data: DataArgument = None
    dataset: DatasetOption = None
    mapping: MappingOption = None
    strict: StrictOption = False

    def read(self, **more: Any) -> TripSet:
        """Read them; see `read_logs`."""
        return read_logs(self.data, self.dataset, self.mapping, strict=self.strict, **more)

    def car(self, vehicle: str | None) -> tuple[str, tuple[Flag, ...]]:
        """The car's name, and a flag where neither the user nor the data set names it.

        Examples
        --------
        >>> Logs(Path("logs"), "ved").car(None)
        ('nissan_leaf_24', ())
        """
        if vehicle is not None:
            return vehicle, ()
        dataset = "synthetic" if self.data is None else self.dataset or dataset_of(self.data, self.mapping)
        if dataset in CARS:
            return CARS[dataset], ()
        from tripwatt.trips import Flag  # pandas is slow to import

        return UNKNOWN_CAR, (Flag("car_assumed", UNKNOWN_CAR),)


@contextmanager
def options_named() -> Iterator[None]:
    """Faults of what options give, under the names of the options."""
    from tripwatt.trips.departure import ASKED

    more = {"vehicle": "--vehicle", "reserve": "--reserve", "speed_m_s": "--speed"}
    with places_named({name: field.option for name, field in ASKED.items()} | more):
        yield


class Answer(NamedTuple):
    """What a command gives: with `--json` a document, else what people read.

    Attributes
    ----------
    document : object
        The document, or a function that makes it.
    shown : str or callable
        A line, or a function that prints more.
    code : int
        Exit code.
    """

    document: Any
    shown: str | Callable[[], object]
    code: int = 0

    def print(self, as_json: bool) -> None:
        """Print one of the two, and end with the exit code."""
        if as_json:
            print_json(self.document() if callable(self.document) else self.document)
        elif callable(self.shown):
            self.shown()
        else:
            typer.echo(self.shown)
        if self.code:
            raise typer.Exit(int(self.code))


class Options(NamedTuple):
    """Options that are one parameter of a command: a dataclass of options, or these in its annotation.

    Attributes
    ----------
    make : callable
        What gives the parameter, from the values of the options by name.
    parameters : list of inspect.Parameter
        The options.
    """

    make: Callable[..., Any]
    parameters: list[inspect.Parameter]

    @classmethod
    def of(cls, kind: Any) -> Options | None:
        """Options of a type; None for that of a single option."""
        if is_dataclass(kind):
            return cls(typing.cast(type, kind), _parameters(kind))
        return next((each for each in getattr(kind, "__metadata__", ()) if isinstance(each, cls)), None)


def _parameters(made: Any) -> list[inspect.Parameter]:
    """The parameters of a function or of a class, with their types."""
    hints = typing.get_type_hints(made, include_extras=True)
    given = inspect.signature(made).parameters.values()
    return [p.replace(annotation=hints[p.name], kind=inspect.Parameter.KEYWORD_ONLY) for p in given]


AS_JSON: Final = inspect.Parameter(
    "as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=JsonOption
)


def spread(command: Callable[..., Any]) -> Callable[..., None]:
    """A function as typer takes it: each of its `Options` in place of the parameter, and `--json` where it gives an `Answer`.

    Examples
    --------
    >>> def audit(logs: Logs) -> Answer:
    ...     return Answer([], f"no findings in {logs.data}")
    >>> list(inspect.signature(spread(audit)).parameters)
    ['data', 'dataset', 'mapping', 'strict', 'as_json']
    >>> spread(audit)(data="logs")
    no findings in logs
    """
    groups: dict[str, Options] = {}
    parameters: list[inspect.Parameter] = []
    for parameter in _parameters(command):
        options = Options.of(parameter.annotation)
        parameters += [parameter] if options is None else options.parameters
        if options is not None:
            groups[parameter.name] = options
    answers = typing.get_type_hints(command).get("return") is Answer
    parameters += [AS_JSON] * answers

    @functools.wraps(command)
    def run(**given: Any) -> None:
        as_json = answers and given.pop(AS_JSON.name, False)
        for name, options in groups.items():
            values = {p.name: given.pop(p.name, p.default) for p in options.parameters}
            given[name] = options.make(**values)
        answer = command(**given)
        if answers:
            answer.print(as_json)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run


EXAMPLES: Final = "For example:"
"""Line of a command's docstring below which its examples are: what each does, then what to type."""


def add_commands(app: typer.Typer, *commands: Callable[..., Any], **more: Any) -> None:
    r"""Add commands to an application: their help is their docstrings, with the examples at the end of the page.

    Parameters
    ----------
    app : typer.Typer
        The application.
    *commands : callable
        Functions under the names of the commands; their docstrings have examples below the line `EXAMPLES`.
    **more
        Further arguments of `Typer.command`.

    Examples
    --------
    >>> app = typer.Typer()
    >>> add_commands(app, require_effect)
    >>> app.registered_commands[0].name, app.registered_commands[0].epilog
    ('require-extras', None)
    """
    for command in commands:
        text, _, shown = inspect.getdoc(command).partition(f"\n\n{EXAMPLES}\n\n")  # type: ignore[union-attr]
        epilog = f"\b\nExamples:\n{shown}" if shown else None  # \b: click keeps the lines of the paragraph
        name = command.__name__.rstrip("_").replace("_", "-")
        app.command(name, help=text, epilog=epilog, **more)(spread(command))


def add_group(app: typer.Typer, name: str, help: str, *commands: Callable[..., Any]) -> None:
    """Add a group of commands to an application."""
    group = typer.Typer(help=help, no_args_is_help=True, rich_markup_mode=None)
    add_commands(group, *commands)
    app.add_typer(group, name=name)


def model_of(folder: Path | None) -> ForecastModel:
    """The model that a user means by a folder: a stored model, or a car with what it learned; without one the bundled model.

    Raises
    ------
    InvalidInput
        When the folder holds neither.
    """
    from tripwatt.forecasting import load_model

    # an older version wrote a car.json
    if folder is not None and any((folder / name).is_file() for name in ("car.sqlite", "car.json")):
        from tripwatt.server.cars import is_car, open_car  # slow to import, and most folders are models

        if is_car(folder):
            return open_car(folder).model()
    return load_model(folder)
