"""Commands on a trip store: make, fill, show, audit, compact it, and forget a vehicle."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, flag, make_group, option
from tripwatt.command.printing import print_notes, say
from tripwatt.errors import Fault, InvalidInput, grouped, raise_faults, require_one

if TYPE_CHECKING:
    from tripwatt.fleet.store import TripStore


PAIRS = "What an object store needs, such as AWS_REGION=eu-central-1; environment variables count too. Repeatable."

CAR = "The car of all logs: a name of `tripwatt vehicles`, or a TOML file."
CARS = "The car of each vehicle, in place of --car: a CSV file with the columns vehicle_id and car."

STARTED = "Departure of logs without a date: ISO 8601, or a pattern of file names, such as log_%Y-%m-%d."


@dataclass(frozen=True, kw_only=True)
class Store:
    """The trip store of the arguments STORE and --store-option."""

    store: Annotated[str, argument("STORE", "Folder of the store, or its URL, such as s3://bucket/fleet.")]
    options: Annotated[list[str] | None, option("KEY=VALUE", PAIRS, "--store-option")] = None

    def opened(self) -> TripStore:
        """Open the store."""
        return tw.open_store(self.store, options=store_options(self.options))


def store_options(options: list[str] | None) -> dict[str, str]:
    """Parse pairs KEY=VALUE.

    Examples
    --------
    >>> store_options(["AWS_REGION=eu-central-1"])
    {'AWS_REGION': 'eu-central-1'}
    """
    pairs = [option.partition("=") for option in options or []]
    bad = [key for key, sign, _ in pairs if not (sign and key)]
    raise_faults(Fault("not a pair", "--store-option", key, "KEY=VALUE") for key in bad)
    return {key: value for key, _, value in pairs}


def create(
    store: Store,
    example: Annotated[bool, flag("--example", "Add computed trips of eight vehicles, to try it.")] = False,
) -> Answer:
    """Make an empty trip store: the Delta tables samples and trips. With `--example` it has trips to try the commands.

    For example:

      # create an empty store in the folder fleet
      tripwatt store create fleet
      # create a store with an example fleet
      tripwatt store create fleet --example
    """
    from tripwatt.fleet.store import Added
    from tripwatt.study.synthetic import example_fleet

    created = tw.create_store(store.store, options=store_options(store.options))
    done = Added()
    for car_model, fleet in example_fleet() if example else ():
        done += created.add(fleet, car_model=car_model)
    if example:
        print_notes([f"{store.store} has computed trips; they do not describe real cars"])
    return Answer(created.about, f"{store.store}: {done if example else 'an empty trip store'}")


def add(
    store: Store,
    data: Annotated[Path, argument("DATA", "Folder or file of logged trips.")],
    vehicle: Annotated[str | None, option("NAME|FILE", CAR, "--car")] = None,
    cars: Annotated[Path | None, option("FILE", CARS)] = None,
    vehicle_id: Annotated[str | None, option("ID", "The vehicle of logs that do not name theirs.")] = None,
    started: Annotated[str | None, option("TIME|PATTERN", STARTED)] = None,
    dataset: shared.Dataset = None,
    mapping: shared.Columns = None,
) -> Answer:
    """Add logs to a store. A trip that is in the store is not added again, so you can repeat the command.

    The command audits every log and keeps it as it was logged. Several commands may add to one store at once. If some
    files have faults, the command adds the others, lists the faults, and exits with code 2.

    For example:

      # add tables
      tripwatt store add fleet logs --mapping my.toml --car nissan_leaf_40
      # add a trip of one vehicle
      tripwatt store add fleet drive.csv --car vw_id3 --vehicle-id V17
      # add the trips of a mixed fleet
      tripwatt store add fleet logs --mapping my.toml --cars cars.csv
    """
    from tripwatt.fleet.store import add_files

    require_one("--car, --cars", vehicle, cars)
    if vehicle is not None:
        tw.load_vehicle(vehicle)
        vehicle = f"{Path(vehicle).resolve()}" if vehicle.endswith(".toml") else vehicle
    target = store.opened()
    try:
        done = add_files(
            target,
            data,
            car_model=cars or vehicle or "",
            vehicle_id=vehicle_id,
            started=started,
            dataset=shared.Logs(data, dataset, mapping).format,
            mapping=mapping,
            progress=lambda sums: say(f"{sums}", err=True),
        )
    except InvalidInput as error:
        raise InvalidInput(grouped(error.faults)) from error
    dates = target.trips(columns=["trip_id", "started_at"])
    undated = dates["trip_id"][dates["started_at"].isna()].tolist()
    if undated:
        named = ", ".join(undated[:5])
        print_notes([f"{len(undated)} trips of the store have no date and count in no month: {named}"])
    return Answer(asdict(done), f"{store.store}: {done}")


def compact(store: Store) -> Answer:
    """Merge small data files and remove files that no version of the last seven days needs.

    For example:

      # merge the small files of many nights
      tripwatt store compact fleet
    """
    done = store.opened().compact()
    return Answer(
        done,
        f"{store.store}: {done['merged']} files merged into {done['made']}, {done['orphans']} samples without a trip dropped, "
        f"{done['removed']} old files removed",
    )


def forget(
    store: Store,
    vehicle_id: Annotated[str | None, option("ID", "The vehicle to erase.")] = None,
    driver: Annotated[str | None, option("NAME", "The driver to erase, in place of a vehicle.")] = None,
) -> Answer:
    """Erase a vehicle or a driver: all trips, their samples and the files that held them. Finished parts, models and reports remain.

    For example:

      # erase one vehicle
      tripwatt store forget fleet --vehicle-id V17
      # erase one driver
      tripwatt store forget fleet --driver "Ada L."
    """
    erased = store.opened().forget(vehicle_id, driver=driver)
    remain = "still there: REGISTRY/work, fleet.work, the version in use and older ones, and reports; docs/howto/fleet.md erases them"
    about = {"vehicle_id": vehicle_id, "driver": driver, "erased": erased}
    return Answer(about, f"{store.store}: {erased} trips of {vehicle_id or driver} erased; {remain}")


STORE = make_group(
    "Trip stores: logs of many vehicles in Delta tables, in a folder or an object store. They need the extra "
    "tripwatt[fleet].",
    (create, add, compact, forget),
)
