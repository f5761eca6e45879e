"""`tripwatt evaluate`: score models on held-out trips and write a report."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from tripwatt import trips
from tripwatt.command import shared
from tripwatt.command.options import Answer, assignments, flag, option, require_effect
from tripwatt.command.printing import console, print_notes, print_table, progress, say
from tripwatt.errors import Check, Fault, InvalidInput, counted, raise_faults, require_extras, system_errors
from tripwatt.files import folder_lock, replace_folder

if TYPE_CHECKING:
    from tripwatt.study.evaluation import CarChoice, EvaluationRun

FOLDS = "folds/*/*.fold"
"""Finished folds of all runs in the folder of unfinished results."""

SAME = "the same trips, options and version of tripwatt"
"""What a resumed run has to share with the run that was interrupted."""

CARS = "cars"
"""Name of the protocol for several cars, each forecast from the others."""


def evaluate(
    logs: shared.LogsOfCar,
    out: shared.OutFolder = Path("out"),
    protocol: Annotated[str, option("NAME", "Comparison: paper, forecast or cars.")] = "paper",
    test: Annotated[Path | None, option("DATA", "Score on these trips; only with forecast.")] = None,
    models: Annotated[shared.Texts, option("NAME,NAME", "Models. Default: all.")] = None,
    hold_outs: Annotated[shared.Texts, option("NAME,NAME", "Hold-outs. Default: all.")] = None,
    jobs: Annotated[int, option("N", "Number of processes; -1 uses all cores.")] = -1,
    resume: Annotated[bool, flag("--resume", "Continue an interrupted run with its finished folds.")] = False,
) -> Answer:
    """Fit every model, score it on held-out trips, and write a report.

    The command reads and audits the trips, simulates the car, and fits each model with one trip (and with one day)
    left out at a time. It writes results.json, folds.csv, report.html and the figures into FOLDER.

    For example:

      # evaluate on the sample of real trips in the package; results in ./out
      tripwatt evaluate
      # evaluate on your copy of the TUM trips
      tripwatt evaluate data/tum --out tum-results
      # evaluate on the Nissan Leafs of the Vehicle Energy Dataset
      tripwatt evaluate data/ved --dataset ved
      # evaluate on tables of one car; `tripwatt mapping suggest` writes my.toml
      tripwatt evaluate logs --mapping my.toml --car vw_id3 --set mass=1900
      # score forecasts before departure and during the trip
      tripwatt evaluate data/tum --protocol forecast
      # forecast each car of a file as one that nobody has seen, from all others
      tripwatt evaluate cars.toml --protocol cars
      # the paper's Table 3 alone
      tripwatt evaluate data/tum --models physics-paper,gamm,forest,boosting --hold-outs leave_one_trip_out:reference
      # continue an interrupted run
      tripwatt evaluate data/tum --resume
    """
    require_extras({"study": "tripwatt evaluate"})
    from tripwatt.modelfile import require_place

    shown = console()
    if protocol == CARS:
        without_effect = {
            "--dataset": logs.dataset,
            "--mapping": logs.mapping,
            "--test": test,
            "--models": models and ",".join(models),
            "--hold-outs": hold_outs and ",".join(hold_outs),
            "--car": logs.vehicle,
            "--set": logs.overrides,
            "--resume": resume or None,
        }
        require_effect(without_effect, "only with another --protocol: the file names data and cars")
        return _evaluate_cars(logs.data, out)
    car, note = logs.named()
    options: dict[str, Any] = {"protocol": protocol, "models": _names(models), "hold_outs": _names(hold_outs)}
    with Check() as check:
        options["car"] = check(_checked_car, options, car, logs.overrides or [], jobs)
        check(require_place, out, None)
        with shown.status("reading trips"):
            fleet = check(logs.read)
            options["test_fleet"] = test and check(replace(logs, data=test).read)
    fleet = replace(fleet, notes=(*fleet.notes, *note))
    say(f"{counted(len(fleet), 'trip')} read ({fleet.name})", err=True)
    print_notes(flag for flag in fleet.notes if flag in note or flag.code == "sample")
    unfinished = unfinished_folder(out)
    with folder_lock(unfinished):
        run = _run(fleet, options, jobs, unfinished, resume)
        with shown.status("writing the report"):
            write_whole(lambda folder: _write(run, folder), out, unfinished)
    from tripwatt.study.report import View, short_table

    view = View(run.results)
    failed = [note for note in run.results["notes"] if " trips scored; " in note]
    if view.published:
        failed.append("Hybrids are the paper's; `--protocol forecast` scores what `tripwatt forecast` gives.")
    last = (*failed, f"Report, with all models and the notes of the run: {out / 'report.html'}")
    return Answer(run.results, partial(_show, (short_table(view, whole=bool(models)),), *last))


def _names(options: list[str] | None) -> list[str] | None:
    """Split the values of a repeatable option, each with one or more names; returns None if it is not given."""
    return [name.strip() for name in ",".join(options).split(",") if name.strip()] if options else None


def _evaluate_cars(data: Path | None, out: Path) -> Answer:
    from tripwatt.modelfile import require_place
    from tripwatt.study.evaluation.cars import evaluate_cars, read_cars
    from tripwatt.study.report.cars import cars_tables, write_cars

    if data is None:
        allowed, fix = "a TOML file with a table for each car", "see docs/explanation/cars.md"
        raise InvalidInput.of("no cars", "DATA", "nothing", allowed, fix)
    shown = console()
    with Check() as check:
        with shown.status("reading trips"):
            cars = check(read_cars, data)
        check(require_place, out, None)
    unfinished = unfinished_folder(out)
    with folder_lock(unfinished), progress(shown) as advance:
        run = evaluate_cars(cars, progress=advance)
        write_whole(lambda folder: write_cars(run, folder), out, unfinished)
    return Answer(run.results, partial(_show, cars_tables(run.results), f"Report: {out / 'report.html'}"))


def _checked_car(options: dict[str, Any], car: str, overrides: list[str], n_jobs: int) -> CarChoice:
    """Return the choice of car after checking all options, so that faults are found before hours of work."""
    from tripwatt.study.evaluation import CarChoice, choose_models, find_protocol

    faults = []
    if options["models"] == []:
        faults.append(Fault("no models", "--models", "an empty list", "names separated by commas"))
    if n_jobs < -1 or n_jobs == 0:
        faults.append(Fault("value out of range", "--jobs", str(n_jobs), "-1, or 1 or more"))
    with Check() as check:
        check(raise_faults, faults)
        check(lambda: choose_models(find_protocol(options["protocol"]), options["models"]))
        choice = CarChoice(car, check(assignments, overrides, "--set"))
        check(choice.load)
    return choice


def _run(
    fleet: trips.TripSet, options: dict[str, Any], jobs: int, unfinished: Path, resume: bool
) -> EvaluationRun:
    from tripwatt.study import evaluation

    try:
        with progress(console()) as advance:

            def report(finished: int, total: int) -> None:
                nonlocal resume
                if resume:
                    say(f"--resume: {finished} of {total} folds of this run were finished before", err=True)
                    if not finished and any(unfinished.glob(FOLDS)):
                        fix = "repeat that run with --resume; without --resume its folds are lost"
                        raise InvalidInput.of(
                            "nothing to resume", "--resume", "folds of another run", SAME, fix
                        )
                resume = False
                advance(finished, total)

            execution = evaluation.Execution(jobs, unfinished / "folds", resume, report)
            return evaluation.evaluate(fleet, **options, execution=execution)
    except (KeyboardInterrupt, SystemExit):
        say("interrupted: the finished folds are kept; continue with the same command and --resume", err=True)
        raise
    except OSError as error:  # such as a full disk while a fold is written
        got = f"{unfinished}: {error.strerror or error}"
        fix = "make room and continue with the same command and --resume"
        raise InvalidInput.of("cannot keep the finished folds", "--out", got, fix=fix) from error
    except InvalidInput:
        if not any(unfinished.glob(FOLDS)):
            shutil.rmtree(unfinished, ignore_errors=True)
        raise


def _write(run: EvaluationRun, folder: Path) -> None:
    from tripwatt.study.evaluation import write_results
    from tripwatt.study.report import write_report

    write_results(run, folder)
    write_report(run, folder)


def _show(tables: tuple[Any, ...], *last: str) -> None:
    """Print the short tables, and where the report is."""
    for table in tables:
        numbers, folding = table.columns[1:], table.columns[3:]
        print_table(table.caption, table.columns, table.rows, numbers=numbers, folding=folding)
    say(*last)


UNWRITABLE: Final = ("cannot write the results", "--out", "a writable folder")


def unfinished_folder(out: Path) -> Path:
    """Create the folder beside `out` in which a run keeps unfinished results.

    Raises
    ------
    InvalidInput
        If the folder cannot be created.
    """
    place = out.resolve()
    folder = place.with_name(f"{place.name}.unfinished")
    with system_errors(*UNWRITABLE, out):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def write_whole(write: Callable[[Path], None], out: Path, unfinished: Path) -> None:
    """Call `write` to fill a new folder, replace `out` by it in one step, and remove `unfinished`.

    Files of an older `out` that `write` does not make are kept.

    Raises
    ------
    InvalidInput
        If something cannot be written; `out` is then unchanged.
    """

    def fill(made: Path) -> None:
        write(made)
        if out.is_dir():
            names = set(os.listdir(made))
            shutil.copytree(
                out,
                made,
                symlinks=True,
                dirs_exist_ok=True,
                ignore=lambda place, _: names if Path(place) == out else (),
            )

    with system_errors(*UNWRITABLE, out):
        replace_folder(out, fill)
    shutil.rmtree(unfinished, ignore_errors=True)
