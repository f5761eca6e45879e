"""A function as a command: options from its arguments, exit code from its result."""

from __future__ import annotations

import functools
from collections.abc import Callable

import typer


def run(main: Callable[..., int | None]) -> None:
    """Run a function with the words of the command line, and exit with the code that it returns.

    Parameters
    ----------
    main : callable
        Arguments with a default are options, those without are words that have to be given. Its docstring is the help.
    """

    @functools.wraps(main)
    def command(*args: object, **kwargs: object) -> None:
        raise typer.Exit(main(*args, **kwargs) or 0)

    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    app.command()(command)
    app()
