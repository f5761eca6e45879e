"""Commands as functions: options that are one parameter, and answers that are a document or text."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from typing import Annotated, Any, Final, NamedTuple

import typer

from tripwatt.command.printing import print_json
from tripwatt.errors import Fault, raise_faults


def option(metavar: str, help: str, *names: str, **more: Any) -> Any:
    """An option of a command that takes a value; its name is that of the parameter where none is given."""
    return typer.Option(*names, metavar=metavar, help=help, **more)


def flag(name: str, help: str) -> Any:
    """An option of a command without a value."""
    return typer.Option(name, help=help)


def argument(metavar: str, help: str, **more: Any) -> Any:
    """An argument of a command."""
    return typer.Argument(metavar=metavar, help=help, **more)


def require_effect(options: Mapping[str, Any], allowed: str) -> None:
    """Raise `InvalidInput` for each of some options that is given, where they have no effect."""
    given = {option: value for option, value in options.items() if value is not None}
    raise_faults(Fault("option has no effect", name, f"{value}", allowed) for name, value in given.items())


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


JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]

AS_JSON: Final = inspect.Parameter(
    "as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=JsonOption
)


def spread(command: Callable[..., Any]) -> Callable[..., None]:
    """A function as typer takes it: each of its `Options` in place of the parameter, and `--json` where it gives an `Answer`.

    Examples
    --------
    >>> def audit(data: str) -> Answer:
    ...     return Answer([], f"no findings in {data}")
    >>> list(inspect.signature(spread(audit)).parameters)
    ['data', 'as_json']
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
    ('require-effect', None)
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
