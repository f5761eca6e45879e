"""Commands as functions: groups of options as one parameter, and answers as a document or text."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import is_dataclass
from typing import Annotated, Any, Final, NamedTuple

import typer

from tripwatt.command.printing import print_json, say
from tripwatt.errors import Fault, raise_faults


def option(metavar: str, help: str, *names: str, **more: Any) -> Any:
    """Make an option that takes a value; without `names` it has the name of the parameter."""
    return typer.Option(*names, metavar=metavar, help=help, **more)


def flag(name: str, help: str) -> Any:
    """Make an option without a value."""
    return typer.Option(name, help=help)


def argument(metavar: str, help: str, **more: Any) -> Any:
    """Make a positional argument of a command."""
    return typer.Argument(metavar=metavar, help=help, **more)


def require_effect(options: Mapping[str, Any], allowed: str) -> None:
    """Raise `InvalidInput` with a fault for each of these options that is given: they have no effect in this case."""
    given = {option: value for option, value in options.items() if value is not None}
    raise_faults(Fault("option has no effect", name, f"{value}", allowed) for name, value in given.items())


def assignments(texts: Iterable[str], option: str) -> dict[str, float | str]:
    """Parse texts such as "mass=1300", the values of a repeatable option.

    Parameters
    ----------
    texts : iterable of str
        Texts `NAME=VALUE`.
    option : str
        The option, for messages.

    Returns
    -------
    dict of str to (float or str)
        Name -> value; a text if the value is not a number.

    Raises
    ------
    InvalidInput
        With every text that is not `NAME=VALUE`, and every repeated name.

    Examples
    --------
    >>> assignments(["mass=1300", "driver=anna"], "--set")
    {'mass': 1300.0, 'driver': 'anna'}
    """
    result: dict[str, float | str] = {}
    faults: list[Fault] = []
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            faults.append(Fault("not NAME=VALUE", option, text[:60], "a name and a value, such as mass=1300"))
        elif name in result:
            faults.append(Fault("name given twice", option, text[:60], f"one value for {name}"))
        else:
            try:
                result[name] = float(value)
            except ValueError:
                result[name] = value
    raise_faults(faults)
    return result


class Answer(NamedTuple):
    """Result of a command: a document for `--json`, and text for people.

    Attributes
    ----------
    document : object
        The document, or a function that makes it.
    shown : str or callable
        A line to print, or a function that prints the text.
    code : int
        Exit code.
    """

    document: Any
    shown: str | Callable[[], object]
    code: int = 0

    def print(self, as_json: bool) -> None:
        """Print the document if `as_json`, otherwise the text; then exit if the code is not 0."""
        if as_json:
            print_json(self.document() if callable(self.document) else self.document)
        elif callable(self.shown):
            self.shown()
        else:
            say(self.shown)
        if self.code:
            raise typer.Exit(int(self.code))


class Options(NamedTuple):
    """Options that form one parameter of a command; its type is a dataclass of options, or its annotation holds them.

    Attributes
    ----------
    make : callable
        Function from the values of the options, by name, to the value of the parameter.
    parameters : list of inspect.Parameter
        The options.
    """

    make: Callable[..., Any]
    parameters: list[inspect.Parameter]

    @classmethod
    def of(cls, kind: Any) -> Options | None:
        """Find the options of a parameter's type; returns None if the parameter is a single option."""
        if is_dataclass(kind):
            return cls(typing.cast(type, kind), _parameters(kind))
        return next((each for each in getattr(kind, "__metadata__", ()) if isinstance(each, cls)), None)


def _parameters(function: Any) -> list[inspect.Parameter]:
    """Return the parameters of a function or a class, with their types, as keyword-only parameters."""
    hints = typing.get_type_hints(function, include_extras=True)
    given = inspect.signature(function).parameters.values()
    return [p.replace(annotation=hints[p.name], kind=inspect.Parameter.KEYWORD_ONLY) for p in given]


JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]

AS_JSON: Final = inspect.Parameter(
    "as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=JsonOption
)


def spread(command: Callable[..., Any]) -> Callable[..., None]:
    """Convert a command to a function for typer.

    Parameters with `Options` are replaced by these options; `--json` is added if the command returns an `Answer`.

    Examples
    --------
    >>> def audit(data: str) -> Answer:
    ...     return Answer([], f"no findings in {data}")
    >>> list(inspect.signature(spread(audit)).parameters)
    ['data', 'as_json']
    >>> spread(audit)(data="logs")
    no findings in logs
    """
    own = _parameters(command)
    groups = {p.name: options for p in own if (options := Options.of(p.annotation))}
    answers = typing.get_type_hints(command).get("return") is Answer
    parameters = [option for p in own for option in (groups[p.name].parameters if p.name in groups else [p])]
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
"""Line of a command's docstring above its examples; each example is a comment on what it does, then the command."""


def make_group(help: str, commands: Iterable[Callable[..., Any]]) -> typer.Typer:
    r"""Make a group of commands; their docstrings become their help texts, with the examples at the end.

    Parameters
    ----------
    help : str
        Help text of the group.
    commands : iterable of callable
        Functions with the names of the commands; examples follow the line `EXAMPLES` in their docstrings. The attribute
        `context_settings` of a function is that of its command.

    Examples
    --------
    >>> group = make_group("Checks.", [require_effect])
    >>> group.registered_commands[0].name, group.registered_commands[0].epilog
    ('require-effect', None)
    """
    group = typer.Typer(help=help, no_args_is_help=True, rich_markup_mode=None)
    for command in commands:
        text, _, shown = inspect.getdoc(command).partition(f"\n\n{EXAMPLES}\n\n")  # type: ignore[union-attr]
        epilog = f"\b\nExamples:\n{shown}" if shown else None  # \b: click keeps the lines of the paragraph
        name = command.__name__.rstrip("_").replace("_", "-")
        settings = getattr(command, "context_settings", None)
        group.command(name, help=text, epilog=epilog, context_settings=settings)(spread(command))
    return group
