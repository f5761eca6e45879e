"""The command line: parse, call, print. Each command is the thin twin of a public function.

Exit codes: 0 done, 1 done but something needs a look (a data set with missing trips, a mapping with gaps), 2 the
input cannot be used, 130 interrupted.
"""

from __future__ import annotations

from typing import Annotated

import typer

import tripwatt
from tripwatt.cli import (
    cars,
    evaluate,
    export,
    fit,
    fleets,
    forecast,
    inspect,
    journey,
    logs,
    maps,
    serve,
    stores,
    transfer,
)
from tripwatt.errors import TripwattError

__all__ = ["app", "main"]

app = typer.Typer(
    help="Forecast the battery energy of an electric-car trip with a prediction interval.",
    epilog="Exit codes: 0 success, 1 success with warnings, 2 invalid input, 130 interrupted.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # examples keep their lines
)


def _version(show: bool) -> None:
    if show:
        typer.echo(f"tripwatt {tripwatt.__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


evaluate.add_commands(app)
fit.add_commands(app)
forecast.add_commands(app)
journey.add_commands(app)
maps.add_commands(app)
inspect.add_commands(app)
transfer.add_commands(app)
logs.add_commands(app)
cars.add_commands(app)
export.add_commands(app)
serve.add_commands(app)
stores.add_commands(app)
fleets.add_commands(app)


def main() -> None:
    """Run the command line; translate the library's errors into one message and exit code 2."""
    try:
        app(prog_name="tripwatt")
    except TripwattError as error:
        lines = str(error).splitlines()
        count = f"{len(lines)} faults:\n" if len(lines) > 1 else ""
        typer.echo(f"error: {count}" + "\n".join(lines), err=True)
        raise SystemExit(2) from None
