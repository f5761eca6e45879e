"""Commands on a user's own car: create it, add trips, show what was learned and the diary, issue a token, erase it."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, flag, make_group, option
from tripwatt.command.printing import console, kwh, print_notes, print_reading, print_table, progress, say
from tripwatt.command.sentences import by_cause, change
from tripwatt.errors import counted, percent, raise_faults, system_errors

if TYPE_CHECKING:
    import pandas as pd

    from tripwatt.server.cars.car import Car
    from tripwatt.server.cars.learning import Learned


CarArgument = Annotated[Path, argument("CAR", "Folder of the car, made by `tripwatt car new`.")]

WORDS = {
    "everything": "the whole consumption",
    "climb": "energy of a climb, by the mass",
    "rolling": "rolling resistance",
    "air": "air drag",
    "drivetrain": "losses of the drivetrain",
    "cold": "driving losses for each 10 K below 15 °C",
    "transients": "braking and accelerating",
    "frost": "load for each 10 K below freezing",
    "warm_up": "load at departure at 0 °C",
}
"""Factor of a car -> words for it, where its name alone does not say it; factors of a season have their temperature."""


def new(
    car: Annotated[Path, argument("CAR", "New folder. Its name is that of the car.")],
    vehicle: Annotated[str, option("NAME|FILE", "A name from `tripwatt vehicles`, or a TOML file.", "--car")],
    base: Annotated[Path | None, option("MODEL", "Model to adapt. Default: the bundled model.")] = None,
) -> Answer:
    """Make the folder of a car that learns from its trips.

    For example:

      # a car of the library
      tripwatt car new cars/my-leaf --car nissan_leaf_40
      # a car of `tripwatt vehicles new`
      tripwatt car new cars/my-car --car my-car.toml
    """
    created = tw.create_car(car, vehicle, base=base)
    made_of = f"{created.folder}: {created.label}, {created.vehicle.title}, no trips yet"
    return Answer(created.about, made_of)


def add(
    car: CarArgument,
    data: Annotated[Path, argument("DATA", "Logged trips: tables, workbooks, ZIP archives, or a folder.")],
    mapping: shared.Columns = None,
    elevation: shared.Tiles = None,
    strict: shared.Strict = False,
    implausible: Annotated[bool, flag("--implausible", "Learn also from an implausible energy.")] = False,
) -> Answer:
    """Add trips: each is forecast before the car learns from it; forecast and trip go into the diary.

    The command keeps the logs as they are, audits them, and adapts the model to the sound trips. A trip that is there
    already is not added again, so you can repeat the command with a growing folder. Without --mapping, header and values of
    the files tell what each column is. What cannot be read is left out and reported. If most trips took far more or less
    energy than the car can take, nothing is added.

    For example:

      # add the files of a logger
      tripwatt car add cars/my-leaf exports
      # by a mapping of your own
      tripwatt car add cars/my-leaf exports --mapping my.toml
      # add one trip
      tripwatt car add cars/my-leaf drive.csv
      # take the heights of the road from a map
      tripwatt car add cars/my-leaf exports --elevation map
    """
    opened, shown = tw.open_car(car), console()
    options: dict[str, Any] = {"car": opened.vehicle}
    if elevation is not None:
        from tripwatt.roads.maps.elevation import Elevation

        options["heights"] = Elevation.from_folder(elevation).at
    with progress(shown, "files") as advance:
        fleet = shared.Logs(data, "table", mapping, strict).read(progress=advance, **options)
    audited = tw.audit(fleet)
    print_reading(fleet, audited)
    if not implausible:
        from tripwatt.forecasting.plausible import absurd_energy  # its modules are slow to import

        raise_faults(absurd_energy(opened.vehicle, audited.trips, f"{data}"))
    with progress(shown, "trips") as advance:
        done = opened.add(fleet, progress=advance)
    return _done(car, opened, done)


def show(
    car: CarArgument, trips: Annotated[int, option("N", "Last trips of the diary to list.", min=0)] = 10
) -> Answer:
    """Show what a car learned, how good its forecasts are, where its energy went, and the last trips of its diary.

    For example:

      # what it learned, its errors, the last trips
      tripwatt car show cars/my-leaf
      # forecast with what it learned
      tripwatt forecast cars/my-leaf route.gpx --soc 0.8
    """
    opened = tw.open_car(car)
    about, table = opened.about(), opened.diary.table.tail(trips)
    rows = table.astype(object).where(table.notna(), None).to_dict("records")
    return Answer({**about, "diary": rows}, partial(_show, about, table))


def _show(about: Mapping[str, Any], table: pd.DataFrame) -> None:
    say(_in_short(about, about["label"]))
    print_notes(f"not in the diary: {trip}: {why}" for trip, why in about["left_out"].items())
    if not about["in_diary"]:
        say("Add trips with `tripwatt car add`.")
        return
    _show_learned(about)
    _show_scores(about)
    total = sum(about["by_cause_wh"].values())
    causes = by_cause(about["by_cause_wh"]) | {"in all": total}
    spent = [(cause, kwh(wh), percent(wh / total if total else None, 1)) for cause, wh in causes.items()]
    print_table("Where the energy went", ("cause", "energy", "share"), spent, numbers=("energy", "share"))
    columns = ("trip", "departure", "distance", "forecast", "90 % interval", "took", "error")
    listed = [_entry(row) for row in table.to_dict("records")]
    print_table(f"Last {counted(len(listed), 'trip')}", columns, listed, numbers=columns[2:])


def _entry(row: Mapping[Hashable, Any]) -> tuple[str, ...]:
    """Write an entry of the diary; its error is the difference of the energies as they are written."""
    forecast, took = (round(row[name] / 1000.0, 2) for name in ("forecast_wh", "energy_wh"))
    return (
        row["trip_id"],
        row["started_at"][:16].replace("T", " "),
        f"{row['distance_m'] / 1000.0:.1f} km",
        f"{forecast:.2f} kWh",
        f"{row['low_wh'] / 1000.0:.2f} to {row['high_wh'] / 1000.0:.2f}",
        f"{took:.2f} kWh",
        f"{forecast - took:+z.2f} kWh",
    )


def list_(folder: Annotated[Path, argument("CARS", "Folder with the folders of cars.")]) -> Answer:
    """List the cars of a folder. A damaged one is listed with its fault beside the others, and the exit code is then 1.

    For example:

      # the cars of `tripwatt serve --cars cars`
      tripwatt car list cars
    """
    from tripwatt.server.cars.folder import describe_cars, holds_car

    with system_errors("cannot read the folder", f"{folder}", "a folder with folders of cars"):
        cars, damaged = describe_cars(filter(holds_car, sorted(folder.iterdir())))
    lines = [_in_short(about, about["car"]) for about in cars]
    lines += [f"{place.name}: {error}" for place, error in damaged.items()]
    faults = {place.name: [fault.texts for fault in error.faults] for place, error in damaged.items()}
    return Answer({"cars": cars, "damaged": faults}, partial(say, *lines), code=len(damaged) > 0)


def _in_short(about: Mapping[str, Any], name: str) -> str:
    return f"{name}: {about['title']}, {counted(about['trips'], 'trip')}, {about['in_diary']} in the diary"


def token(car: Annotated[Path, argument("CAR", "Folder of the car; made where it is missing.")]) -> Answer:
    """Print a new token with which a car sends its messages to `tripwatt serve --cars`.

    An earlier token of the car is no longer accepted once the service is started again. The folder holds a digest of the
    token, so that it cannot be printed a second time.

    For example:

      # print a new token for the sender in the car
      tripwatt car token cars/my-leaf
      # follow the cars of the folder
      tripwatt serve --cars cars
    """
    from tripwatt.server.cars.folder import issue_token

    issued = issue_token(car)
    return Answer({"car": f"{car}", "token": issued}, issued)


def forget(car: CarArgument) -> Answer:
    """Erase a car: its trips, its model and its diary. Files of yours in its folder stay.

    For example:

      # erase everything of it
      tripwatt car forget cars/my-leaf
    """
    from tripwatt.server.cars.folder import forget_car

    forget_car(car)
    return Answer({"forgotten": f"{car}"}, f"{car}: erased")


def _done(car: Path, own: Car, done: Learned) -> Answer:
    about = own.about()

    def shown() -> None:
        counts = f"trips added: {done.added}, {done.entries} of them in the diary; known: {done.known}"
        say(f"{car}: {counts}; left out: {len(done.left_out)}")
        print_notes(f"left out: {why}" for why in done.left_out[: shared.MAX_NAMES])
        if done.flat:
            say(
                f"{done.flat} of {done.entries} new trips have no heights. Heights narrow the forecasts most: switch on the altitude "
                "in the app that logs them, or give --elevation for logs with positions."
            )
        _show_learned(about)

    return Answer({**asdict(done), "car": about}, shown)


def _show_learned(about: Mapping[str, Any]) -> None:
    latest, published = about["latest"], about["latest_by_book"]
    if latest["trips"]:
        say(
            f"Last {counted(latest['trips'], 'trip')}: mean error {percent(published['weighted_error'], 1)} with published values, "
            f"{percent(latest['weighted_error'], 1)} with own trips; width of the 90 % interval {percent(published['width'], 1)} and "
            f"{percent(latest['width'], 1)} of the energy, {percent(latest['needed_width'], 1)} would have been enough."
        )
        if (latest["weighted_error"] or 0.0) > (published["weighted_error"] or 0.0):
            say("What was learned did not help on these trips.")
    rows = [(_in_words(name), *_learned(value)) for name, value in about["learned"].items()]
    if rows:
        columns = ("what", "change", "uncertainty (sd)", "seen at")
        print_table(f"Learned from {counted(about['in_diary'], 'trip')}", columns, rows, numbers=columns[1:3])


def _show_scores(about: Mapping[str, Any]) -> None:
    rows = [
        (
            name,
            f"{score['trips']}",
            percent(score["weighted_error"], 1),
            "" if score["bias"] is None else percent(score["bias"], 1, "+"),
            f"{score['inside']}",
            percent(score["width"], 1),
            percent(score["needed_width"], 1),
        )
        for name, score in {"all": about["score"], **about["by_temperature"]}.items()
    ]
    columns = ("outside air", "trips", "error", "bias", "within 90 %", "its width", "would have been enough")
    print_table("Forecasts, each before its trip was learned", columns, rows, numbers=columns[1:])


def _in_words(factor: str) -> str:
    from tripwatt.hybrid.factors import SEASONS

    if factor in SEASONS:
        return f"the whole consumption around {SEASONS[factor]:.0f} °C"
    return WORDS.get(factor, factor.replace("_", " "))


def _learned(value: Mapping[str, Any]) -> tuple[str, str, str]:
    """Write the change of a factor, its uncertainty and the outside temperatures at which trips show it; no number if none does."""
    if not value["seen_degc"]:
        return "–", "–", "not measurable yet"
    degc = dict.fromkeys(f"{d:z.0f}" for d in value["seen_degc"])
    return change(value, "change"), change(value, "sd", sign=""), f"{' to '.join(degc)} °C"


CAR = make_group(
    "Your own car: its trips, the model that is adapted to them, and its diary.",
    (new, add, list_, show, token, forget),
)
