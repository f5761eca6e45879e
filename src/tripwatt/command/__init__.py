"""The command line: parse, call, print. Each command is a thin layer over a public function.

Exit codes: 0 success; 1 success in part (a mapping with gaps, a damaged car among others); 2 the input cannot be used or
the output cannot be written; 70 an error of tripwatt itself; 130 interrupted; 143 terminated.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import traceback
from collections import UserDict
from collections.abc import Mapping
from importlib import import_module
from typing import Annotated, Any, Final, NoReturn

import typer
from typer.core import TyperGroup

import tripwatt
from tripwatt.command.options import make_group
from tripwatt.command.printing import say
from tripwatt.errors import TripwattError

__all__ = ["app", "main"]

MAX_LINES: Final = 200
"""Largest number of faults that an error lists; further faults are counted."""

UNEXPECTED: Final = 70
"""Exit code of an unexpected error: `EX_SOFTWARE` of sysexits.h."""

TRACEBACK: Final = "TRIPWATT_TRACEBACK"
"""Environment variable; if it is set, an unexpected error prints its traceback."""

TERMINATED: Final = 128 + signal.SIGTERM
"""Exit code of a command that was ended by SIGTERM."""

COMMANDS: Final[Mapping[str, tuple[str, str]]] = {
    "evaluate": ("evaluate.evaluate", "Fit models, score them on held-out trips, write a report."),
    "fit": ("models.fit", "Fit a model on logged trips and write it as a folder."),
    "forecast": ("forecast.forecast", "Forecast the energy of a trip with its interval."),
    "example-trip": ("forecast.example_trip", "Write a real trip of the package as a CSV table."),
    "plan": ("journey.plan", "Plan a journey from place to place, with stops to charge."),
    "reach": ("journey.reach", "Show how far a charge carries in every direction."),
    "places": ("journey.places", "Find places by the start of their names."),
    "advise": ("forecast.advise", "Say what to do about a trip, and what each action saves."),
    "need": ("forecast.need", "Forecast what a distance takes, without a road."),
    "range": ("forecast.range_", "Forecast how far a charge carries, without a road."),
    "inspect": ("models.inspect", "Show provenance and scores of a model, and verify it."),
    "audit": ("logs.audit", "List the faults of logged trips and their consequences."),
    "vehicles": ("cars.vehicles", "List or search the cars of the library, or show one."),
    "simulate": ("cars.simulate", "Simulate one logged trip with a car."),
    "export": ("cars.export", "Print the consumption curve of a car for a router."),
    "serve": ("serve.serve", "Serve the HTTP API and the web page."),
    "mcp": ("serve.mcp", "Serve an assistant over standard input and output."),
    "demo": ("serve.demo", "Serve the page with example data."),
    "map": ("journey.MAP", "Maps of a region on this machine."),
    "mapping": ("logs.MAPPING", "Columns of your tables and what they hold."),
    "store": ("stores.STORE", "Trip stores: logs of many vehicles in Delta tables."),
    "fleet": ("fleets.FLEET", "Many vehicles: one model of a trip store."),
    "car": ("own_cars.CAR", "Your own car: its trips, its model and its diary."),
}
"""Name of a command or of a group of commands -> its place, and its line in the list of commands.

The place is a module of this package, and a function or a `typer.Typer` there. The line stands here so that the list imports no command.
"""


class _Commands(UserDict[str, Any]):
    """Commands by name, each imported on its first use: to import all of them takes longer than a forecast."""

    def __getitem__(self, name: str) -> Any:
        if isinstance(place := self.data[name], str):
            module, _, attribute = place.partition(".")
            command = getattr(import_module(f"tripwatt.command.{module}"), attribute)
            is_group = isinstance(command, typer.Typer)
            group = typer.main.get_group(command if is_group else make_group("", [command]))
            self.data[name] = group if is_group else group.commands[name]
        return self.data[name]


class _LazyGroup(TyperGroup):
    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _Commands({name: place for name, (place, _) in COMMANDS.items()})

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])


app = typer.Typer(
    cls=_LazyGroup,
    help="Forecast the battery energy of an electric-car trip with a prediction interval.",
    epilog="Exit codes: 0 success, 1 success in part, 2 invalid input, 70 error of tripwatt, 130 interrupted, 143 terminated.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # examples keep their lines
)


def _version(show: bool) -> None:
    if show:
        say(f"tripwatt {tripwatt.__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line; translate the library's errors into one message and exit code 2.

    Examples
    --------
    >>> main()  # doctest: +SKIP
    """
    # what is imported stays: a search of it for reference cycles, also the one at the exit, takes a fifth of a short command
    gc.set_threshold(200_000)
    atexit.register(gc.freeze)
    # SIGTERM raises SystemExit, so that worker processes and temporary files are removed.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    try:
        app(prog_name="tripwatt")
    except TripwattError as error:
        lines = str(error).splitlines()
        count = [f"{len(lines)} faults:"] if len(lines) > 1 else []
        shown = lines[:MAX_LINES] + ([f"{len(lines) - MAX_LINES} more"] if len(lines) > MAX_LINES else [])
        _fail(*count, *shown)
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
        got = f"an error of tripwatt, not of your input: {type(error).__name__}: {error}"[:250]
        fix = f"report it with what the same command prints with {TRACEBACK}=1"
        _fail(f"{got}; files that were written before are complete; {fix}", code=UNEXPECTED)


def _fail(first: str, *more: str, code: int = 2) -> NoReturn:
    say(f"error: {first}", *more, err=True)
    raise SystemExit(code) from None
