"""The command line: parse, call, print. Each command is a thin layer over a public function.

Exit codes: 0 success; 1 success with something to look at (a data set with missing trips, a mapping with gaps); 2 the
input cannot be used or the output cannot be written; 70 an error of tripwatt itself; 130 interrupted; 143 terminated.
"""

from __future__ import annotations

import os
import signal
import sys
import traceback
from typing import Annotated, Final, NoReturn

import typer

import tripwatt
from tripwatt.command import (
    advise,
    cars,
    demo,
    distances,
    evaluate,
    export,
    fit,
    fleets,
    forecast,
    inspect,
    journey,
    logs,
    maps,
    mcp,
    own_cars,
    serve,
    stores,
)
from tripwatt.command.options import add_commands, add_group
from tripwatt.errors import TripwattError, printable

__all__ = ["app", "main"]

MAX_LINES: Final = 200
"""Largest number of faults that an error lists; further faults are counted."""

UNEXPECTED: Final = 70
"""Exit code of an unexpected error: `EX_SOFTWARE` of sysexits.h."""

TRACEBACK: Final = "TRIPWATT_TRACEBACK"
"""Environment variable; if it is set, an unexpected error prints its traceback."""

TERMINATED: Final = 128 + signal.SIGTERM
"""Exit code of a command that was ended by SIGTERM."""

app = typer.Typer(
    help="Forecast the battery energy of an electric-car trip with a prediction interval.",
    epilog="Exit codes: 0 success, 1 success with warnings, 2 invalid input, 70 error of tripwatt, 130 interrupted, 143 terminated.",
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


add_commands(app, evaluate.evaluate, fit.fit, forecast.forecast, forecast.example_trip)
add_commands(app, journey.plan, journey.reach, journey.places, advise.advise)
add_commands(app, distances.need, distances.range_, inspect.inspect, logs.audit)
add_commands(app, cars.vehicles, cars.simulate, export.export)
add_commands(app, serve.serve, context_settings={"auto_envvar_prefix": "TRIPWATT"})
add_commands(app, mcp.mcp, demo.demo)
add_group(app, "map", maps.GROUP, maps.build, maps.info)
add_group(app, "mapping", logs.MAPPINGS, logs.list_, logs.show, logs.suggest, logs.apply)
add_group(app, "logs", logs.LOGS, logs.anonymise)
add_group(app, "store", stores.GROUP, *stores.COMMANDS)
add_group(app, "fleet", fleets.GROUP, *fleets.COMMANDS)
add_group(app, "car", own_cars.GROUP, *own_cars.COMMANDS)


def main() -> None:
    """Run the command line; translate the library's errors into one message and exit code 2.

    Examples
    --------
    >>> main()  # doctest: +SKIP
    """
    # SIGTERM raises SystemExit, so that worker processes and temporary files are removed.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    try:
        app(prog_name="tripwatt")
    except TripwattError as error:
        lines = str(error).splitlines()
        count = f"{len(lines)} faults:\n" if len(lines) > 1 else ""
        shown = lines[:MAX_LINES] + ([f"{len(lines) - MAX_LINES} more"] if len(lines) > MAX_LINES else [])
        _fail(count + "\n".join(shown))
    except BrokenPipeError:  # the program that read the output has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None
    except OSError as error:  # such as a full disk or a file that vanished: errors that no command handles
        name = f": {error.filename}" if error.filename else ""
        _fail(f"the system reports {error.strerror or error}{name}")
    except MemoryError:
        _fail("not enough memory for this input")
    except Exception as error:
        if str(error).startswith("Symlink loop"):  # before Python 3.13 this is no OSError
            _fail(f"the system reports {error}")
        if os.environ.get(TRACEBACK):
            traceback.print_exc()
        got = printable(f"an error of tripwatt, not of your input: {type(error).__name__}: {error}")[:250]
        fix = f"report it with what the same command prints with {TRACEBACK}=1"
        _fail(f"{got}; files that were written before are complete; {fix}", UNEXPECTED)


def _fail(text: str, code: int = 2) -> NoReturn:
    typer.echo(f"error: {text}", err=True)
    raise SystemExit(code) from None
