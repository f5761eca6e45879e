"""The command line: parse, call, print. Each command is the thin twin of a public function.

Exit codes: 0 done, 1 done but something needs a look (`fetch` with missing trips), 2 the input cannot be used.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tripwatt
from tripwatt.errors import Fault, InvalidInput, TripwattError

if TYPE_CHECKING:
    from rich.console import Console

    from tripwatt.evaluation import EvaluationRun
    from tripwatt.trips import Fleet

app = typer.Typer(
    help="Forecast the battery energy of an electric-car trip, and say how sure the forecast is.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

DataArgument = Annotated[
    Path | None, typer.Argument(help="Folder of logged trips. Left out: the synthetic fleet.")
]
DatasetOption = Annotated[str, typer.Option("--dataset", help="How DATA is laid out.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines instead of a table.")]


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


@app.command()
def evaluate(
    data: DataArgument = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    dataset: DatasetOption = "tum",
    protocol: Annotated[str, typer.Option(help="Which comparison: paper, forecast.")] = "paper",
    models: Annotated[str | None, typer.Option(help="Only these models, separated by commas.")] = None,
    vehicle: Annotated[str, typer.Option(help="Bundled vehicle or a TOML file.")] = "bmw_i3_60ah",
    test: Annotated[
        Path | None, typer.Option("--test", help="Fit on DATA, score on these trips (protocol forecast).")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Makes the run identical.")] = 0,
    jobs: Annotated[int, typer.Option(help="Processes; -1 takes all cores.")] = -1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the finished folds of an interrupted run.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Train and score every model on trips it has not seen, and write a table and a report.

    Reads the trips, audits them, simulates the car, trains the correctors with one trip (and one day) left out at a
    time, and writes results.json, folds.csv, report.html and its figures into OUT.

    Examples
    --------
        tripwatt evaluate                        the built-in synthetic fleet

        tripwatt evaluate data/tum --out out     your copy of the TUM trips
    """
    from tripwatt.evaluation import evaluate as run_evaluation

    _refuse_file(out)
    console = _console()
    with console.status("reading trips"):
        fleet = _fleet(data, dataset)
        other = None if test is None else _fleet(test, dataset)
    console.print(f"{len(fleet.trips)} trips read ({fleet.name})")
    names = None if models is None else [name.strip() for name in models.split(",") if name.strip()]
    work = out / ".folds"
    with _progress(console) as report_progress:
        run = run_evaluation(
            fleet,
            protocol=protocol,
            models=names,
            vehicle=vehicle,
            seed=seed,
            n_jobs=jobs,
            work_dir=work,
            resume=resume,
            progress=report_progress,
            test_fleet=other,
        )
    with console.status("writing the report"):
        _write_whole(run, out)
    shutil.rmtree(work, ignore_errors=True)
    _show(run, out, console, as_json)


@app.command()
def audit(
    data: DataArgument = None,
    dataset: DatasetOption = "tum",
    as_json: JsonOption = False,
) -> None:
    """Say what is wrong with logged trips, and what is done about it.

    Nothing is changed on disk. Each finding names the trip, from when to when, what was found, and the consequence:
    trimmed, split, set aside or noted.
    """
    from tripwatt.audit import audit as run_audit

    fleet = _fleet(data, dataset)
    found = run_audit(fleet)
    if as_json:
        records = found.frame().astype(object).where(found.frame().notna(), None).to_dict("records")
        typer.echo(
            json.dumps(
                {"read": len(fleet.trips), "used": [t.trip_id for t in found.trips], "findings": records}
            )
        )
        return
    from rich.table import Table

    console = _console(sys.stdout)
    table = Table(title=f"{len(fleet.trips)} trips read, {len(found.trips)} trips used ({fleet.name})")
    for column in ("trip", "from [s]", "to [s]", "consequence", "what"):
        table.add_column(column, justify="right" if "[s]" in column else "left")
    for finding in found.findings:
        span = [f"{value:.1f}" for value in (finding.from_s, finding.to_s)]
        table.add_row(finding.trip, *span, finding.consequence, finding.what)
    console.print(table if found.findings else "no findings")
    for note in fleet.notes:
        console.print(f"note: {note}")


@app.command()
def fetch(
    dataset: Annotated[str, typer.Argument(help="Data set: tum.")] = "tum",
    folder: Annotated[Path | None, typer.Argument(help="Folder to check.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Say where to get a data set, and check what is already in FOLDER."""
    from tripwatt.sources import check_folder, where_to_get

    if folder is None:
        typer.echo(json.dumps({"where": where_to_get(dataset)}) if as_json else where_to_get(dataset))
        return
    report = check_folder(folder, dataset)
    typer.echo(json.dumps(asdict(report)) if as_json else str(report))
    if not report.complete:
        raise typer.Exit(1)


def _fleet(data: Path | None, dataset: str) -> Fleet:
    if data is None:
        from tripwatt.synthetic import synthetic_fleet

        return synthetic_fleet()
    from tripwatt.sources import read_fleet

    return read_fleet(data, dataset)


def _refuse_file(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise InvalidInput(Fault("output is not a folder", "--out", str(out), "a folder, new or existing"))


def _write_whole(run: EvaluationRun, out: Path) -> None:
    """Write everything beside `out` first, then move it in: outputs appear whole or not at all."""
    from tripwatt.evaluation import write_results
    from tripwatt.report import write_report

    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".writing-") as half:
        made = Path(half)
        write_results(run, made)
        write_report(run, made)
        for path in sorted(made.iterdir()):
            target = out / path.name
            if target.is_dir():
                shutil.rmtree(target)
            path.replace(target)


def _show(run: EvaluationRun, out: Path, console: Console, as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(run.results))
        return
    from tripwatt.report import render_table

    _console(sys.stdout).print(render_table(run.results))
    for note in run.results["notes"]:
        console.print(f"note: {note}")
    console.print(f"report: {out / 'report.html'}")


def _console(stream: object = None) -> Console:
    from rich.console import Console

    return Console(file=stream or sys.stderr, highlight=False)  # type: ignore[arg-type]


@contextmanager
def _progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("folds", total=None)

        def advance(finished: int, total: int) -> None:
            bar.update(task, completed=finished, total=total)

        yield advance


def main() -> None:
    """Run the command line; translate the library's errors into one message and exit code 2."""
    try:
        app()
    except TripwattError as error:
        lines = str(error).splitlines()
        count = f"{len(lines)} faults:\n" if len(lines) > 1 else ""
        typer.echo(f"error: {count}" + "\n".join(lines), err=True)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        typer.echo("interrupted: finished folds are kept, go on with --resume", err=True)
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
