"""`tripwatt transfer`: what a model of one car is worth on another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tripwatt.cli.options import (
    DatasetOption,
    JsonOption,
    MappingOption,
    SetOption,
    VehicleOption,
    add_command,
    car_of,
    gather,
    read_logs,
)
from tripwatt.cli.output import check_writable, unfinished_folder, write_whole
from tripwatt.cli.printing import console, print_json, print_notes, print_table, progress
from tripwatt.errors import InvalidInput
from tripwatt.files import folder_lock

if TYPE_CHECKING:
    from tripwatt.trips import Fleet
    from tripwatt.vehicles import Vehicle

DEFAULT_TRIPS = "0,1,2,5,10,20,50"


def add_commands(app: typer.Typer) -> None:
    """Add the commands of this file."""
    add_command(app, transfer)


def transfer(
    source: Annotated[
        Path, typer.Option("--from", metavar="DATA", help="Trips of the first car, for training.")
    ],
    target: Annotated[
        Path, typer.Option("--to", metavar="DATA", help="Trips of the second car, to forecast.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="FOLDER",
            help="Folder for the results. It is created when the run is complete.",
        ),
    ] = Path("transfer"),
    dataset: DatasetOption = None,
    mapping: MappingOption = None,
    vehicle: VehicleOption = None,
    overrides: SetOption = None,
    from_dataset: Annotated[
        str | None, typer.Option(metavar="NAME", help="As --dataset, for the first car.")
    ] = None,
    from_mapping: Annotated[
        str | None, typer.Option(metavar="FILE.toml|NAME", help="As --mapping, for the first car.")
    ] = None,
    from_vehicle: Annotated[
        str | None, typer.Option(metavar="NAME|FILE.toml", help="As --vehicle, for the first car.")
    ] = None,
    trips: Annotated[
        str, typer.Option(metavar="K,K", help="Numbers of trips of the second car to adapt to.")
    ] = DEFAULT_TRIPS,
    draws: Annotated[
        int, typer.Option(min=1, metavar="N", help="Random draws for each number of trips.")
    ] = 200,
    min_km: Annotated[float, typer.Option(metavar="KM", help="Shortest trip to use.")] = 2.0,
    seed: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Seed of the random numbers. The same seed gives the same results."
        ),
    ] = 0,
    as_json: JsonOption = False,
) -> None:
    """Train on one car, adapt to none or a few trips of a second car, and score the forecasts for it.

    The command adapts to trips of the first half of the second car's record and scores the second half. It writes
    results.json, trips.csv, report.html and the figures into OUT. --dataset, --mapping, --vehicle and --set describe the
    second car.

    For example:

      # forecast a Nissan Leaf with a model of a BMW i3
      tripwatt transfer --from data/tum --to data/ved
      # the other way round
      tripwatt transfer --from data/ved --to data/tum --out back
      # forecast a car from your own tables
      tripwatt transfer --from data/tum --to logs --dataset table --mapping my.toml --vehicle vw_id3
    """
    from tripwatt.vehicles import load_vehicle, parse_overrides

    shown = console()
    dataset, from_dataset = (
        dataset_of(target, dataset, mapping),
        dataset_of(source, from_dataset, from_mapping),
    )
    car, note = car_of(vehicle, target, dataset, mapping)
    from_car, from_note = car_of(from_vehicle, source, from_dataset, from_mapping)
    fleets: dict[str, Fleet] = {}
    vehicles: list[Vehicle] = []
    options: dict[str, Any] = {"draws": draws, "min_distance_m": 1000.0 * min_km, "seed": seed}

    def read(key: str, place: Path, of: str | None, columns: str | None) -> None:
        with shown.status(f"reading trips of {place}"):
            fleets[key] = read_logs(place, of, columns)

    gather(
        lambda: options.update(trips=numbers_of(trips)),
        lambda: vehicles.append(load_vehicle(from_car)),
        lambda: vehicles.append(load_vehicle(car, overrides=parse_overrides(overrides or []))),
        lambda: check_writable(out),
        lambda: read("source", source, from_dataset, from_mapping),
        lambda: read("target", target, dataset, mapping),
    )
    from tripwatt.evaluation.transfer import evaluate_transfer
    from tripwatt.report.transfer import write_transfer

    unfinished = unfinished_folder(out)
    with folder_lock(unfinished), progress(shown) as advance:
        run = evaluate_transfer(
            fleets["source"],
            fleets["target"],
            vehicles=(vehicles[0], vehicles[1]),
            **options,
            progress=advance,
        )
    from tripwatt.trips.messages import message

    notes = [message(flag) for flag in (*from_note, *note)]
    run.results["notes"] += notes
    with shown.status("writing the report"):
        write_whole(lambda folder: write_transfer(run, folder), out, unfinished)
    _show(run.results, out, as_json)


def dataset_of(place: Path, dataset: str | None, mapping: str | None) -> str | None:
    """The given data set, or the one that the names of a folder's files show.

    Examples
    --------
    >>> dataset_of(Path("anywhere"), "table", None)
    'table'
    """
    if dataset is None and mapping is None and place.is_dir() and any(place.glob("VED_*_week*.csv")):
        return "ved"
    return dataset


def numbers_of(text: str) -> list[int]:
    """Numbers of trips from a text with commas.

    Raises
    ------
    InvalidInput
        When it holds something else.

    Examples
    --------
    >>> numbers_of("0, 5,10")
    [0, 5, 10]
    """
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        numbers = [-1]
    if min(numbers) < 0:
        raise InvalidInput.of(
            "invalid numbers of trips", "--trips", text, "whole numbers of 0 or more, separated by commas"
        )
    return numbers


def _show(results: dict[str, Any], out: Path, as_json: bool) -> None:
    if as_json:
        print_json(results)
        return
    from tripwatt.report.transfer_panels import curve_table, models_table

    for car in results["cars"]:
        for table in (
            models_table(results, car),
            *([curve_table(results, car)] if car["trips_first"] else []),
        ):
            print_table(table.caption, table.columns, table.rows, numbers=table.columns[1:])
    print_notes(results["notes"])
    console().print(f"report: {out / 'report.html'}")
