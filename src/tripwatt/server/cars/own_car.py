"""A user's car: a folder with its description, a store of its trips, the model adapted to them, and its diary.

Each new trip is forecast by a model that has not seen it, before the model is adapted to it: the scores of the diary are those of forecasts.
"""

from __future__ import annotations

import json
import re
import shutil
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

from tripwatt.auditing import Audit, audit
from tripwatt.errors import InvalidInput, damage, system_errors
from tripwatt.files import folder_lock, read_text_file, replace_folder, restore_folder, write_text
from tripwatt.fleet.store import TripStore, create_store, open_store
from tripwatt.fleet.store.rows import digest_of
from tripwatt.forecasting import ForecastModel, load_metadata, load_model, save_model
from tripwatt.forecasting.fitting import held_out_figures, provenance_of
from tripwatt.modelfile import FORMAT_VERSION
from tripwatt.population.adapting import PROTOCOL, Adaptation, about_adaptation, in_order, population_of
from tripwatt.population.cars import for_car
from tripwatt.server.cars.diary import Diary, entry
from tripwatt.trips import Trip, TripSet
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.writing import render_vehicle

if TYPE_CHECKING:
    from collections.abc import Iterable

    from tripwatt.trips import Log

FORMAT: Final = 1
ABOUT: Final = "car.json"
LEFT_OUT: Final = "left-out.json"
MOST_LEFT_OUT: Final = 100
"""Trips that are in no diary whose reasons are kept; the latest ones stay."""
LIVE: Final = "live"
"""Folder of what the car sends while it drives."""
JOURNAL: Final = "journal.ndjson"
TOKEN: Final = "token.json"
"""Files in `LIVE` of a car on the road, which may have no description."""
UPLOADS: Final = "uploads"
"""Folder of logs that were sent and are not learned yet."""
VEHICLE: Final = "car.toml"
STORE: Final = "trips"
LEARNED: Final = "learned"
MODEL: Final = "model"
DIARY: Final = "diary.parquet"
MOST_ABOUT_BYTES: Final = 1 << 16
VALID_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,63}")
"""Names of folders of cars: they are parts of paths and of URLs."""

Read = TypeVar("Read")


@dataclass(frozen=True, slots=True)
class Learned:
    """What adding logs brought.

    Attributes
    ----------
    added, known : int
        Logs that are new in the store, and that were there before.
    entries : int
        New trips of the diary.
    left_out : tuple of str
        Given drives that are not in the diary, with the reason.
    flat : int
        New trips of the diary without heights: their climb is unknown.

    Examples
    --------
    >>> Learned(added=12, known=0, entries=11, left_out=("A: no sound drive",)).entries
    11
    """

    added: int
    known: int
    entries: int
    left_out: tuple[str, ...] = ()
    flat: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class Car:
    """A car with its trips; made by `create_car`, opened by `open_car`.

    Attributes
    ----------
    folder : Path
        Of the car, whose name is that of the folder.
    vehicle : Vehicle
        With its published values.
    base : Path or None
        Model that is adapted to the trips; None for the bundled one.
    label : str
        As its owner calls it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     car = create_car(Path(folder, "my-leaf"), "nissan_leaf_24")
    ...     print(car.about()["trips"], car.model().vehicle.name, len(car.state()))
    0 nissan_leaf_24 2
    >>> car.add(tw.read_logs("exports", mapping="leaf_spy"))  # doctest: +SKIP
    Learned(added=12, known=0, entries=11, left_out=(), flat=0)
    """

    folder: Path
    vehicle: Vehicle
    base: Path | None = None
    label: str = ""

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.name

    @property
    def store(self) -> TripStore:
        """Its logs as they came."""
        return open_store(self.folder / STORE)

    @property
    def diary(self) -> Diary:
        """Its trips, each forecast before it was learned."""
        return self._read(DIARY, Diary.read, Diary.empty)

    def model(self) -> ForecastModel:
        """Load the model of the car.

        Returns
        -------
        ForecastModel
            Adapted to its trips, or that of its published values before the first one.
        """
        return self._read(MODEL, self._model_of, lambda: for_car(self.base, self.vehicle))

    def _model_of(self, place: Path) -> ForecastModel:
        older = load_metadata(place, check_parts=False)["format_version"] < FORMAT_VERSION
        return self._known(load_model(self.base)).model if older else load_model(place)

    def add(
        self, logs: TripSet | Iterable[Log], *, progress: Callable[[int, int], None] | None = None
    ) -> Learned:
        """Keep logs, forecast their trips one after the other, and learn from them.

        A log that is there already is not added again. O(samples of all logs).

        Parameters
        ----------
        logs : TripSet or iterable of Log
            As a reader gave them.
        progress : callable, optional
            Called with the trips that were forecast and their number.

        Returns
        -------
        Learned
            What is new in the store and in the diary.

        Raises
        ------
        InvalidInput
            When two of the logs have one id, or another process adds logs at this moment.
        """
        with folder_lock(self.folder):
            alone = [
                replace(log, context=replace(log.context, car=None))
                for log in (logs.logs if isinstance(logs, TripSet) else logs)
            ]
            rows = self.store.trips(columns=["trip_id", "digest"])
            there = dict(zip(rows["trip_id"], rows["digest"], strict=True))
            other = [
                log for log in alone if there.get(log.trip_id, "") not in ("", digest_of(self.name, log))
            ]
            ids = {log.trip_id for log in other}
            alone = [log for log in alone if log.trip_id not in ids]
            done = self.store.add(alone, car_model=self.vehicle.name, vehicle_id=self.name)
            given = frozenset(log.trip_id for log in alone)
            entries, refused, flat = self._learn(given, progress or (lambda done, total: None))
            changed = [f"{log.trip_id}: another log of this name was added before" for log in other]
            left_out = (*refused, *changed)
            if left_out:
                reasons = {**self.left_out, **dict(text.partition(": ")[::2] for text in left_out)}
                kept = dict([*reasons.items()][-MOST_LEFT_OUT:])
                write_text(self.folder / LEFT_OUT, json.dumps(kept, indent=2) + "\n")
        return Learned(done.added, done.known, entries, left_out, flat)

    @property
    def left_out(self) -> dict[str, str]:
        """Trips that did not enter the diary, and why: the audit set them aside, or they cannot be forecast."""
        path = self.folder / LEFT_OUT
        return dict(json.loads(read_text_file(path, MOST_ABOUT_BYTES))) if path.is_file() else {}

    def state(self) -> tuple[int, ...]:
        """Identify what the car has learned: the value changes whenever it learns.

        Returns
        -------
        tuple of int
            File number and time of its model [ns]; of its description before the first trip.
        """
        restore_folder(self.folder / LEARNED)
        return state_of(self.folder)

    def about(self, diary: Diary | None = None) -> dict[str, Any]:
        """Describe the car, its trips, what was learned, and its scores.

        Parameters
        ----------
        diary : Diary, optional
            Its diary, where it was read already.

        Returns
        -------
        dict
            Plain values.
        """
        diary = self.diary if diary is None else diary
        latest, by_book = diary.latest()
        adapted = self._adapted()
        return {
            "car": self.name,
            "label": self.label,
            "folder": f"{self.folder}",
            "vehicle": self.vehicle.name,
            "title": self.vehicle.title,
            "trips": self.store.about()["trips"],
            "in_diary": len(diary),
            "left_out": self.left_out,
            "learned": {
                name: {**value, "seen_degc": diary.seen_degc(name)}
                for name, value in adapted.get("parameters", {}).items()
            },
            "experts": adapted.get("experts", {}),
            "score": diary.score.to_dict(),
            "latest": latest.to_dict(),
            "latest_by_book": by_book.to_dict(),
            "by_temperature": {name: score.to_dict() for name, score in diary.by_temperature().items()},
            "by_season": diary.by_season(),
            "by_cause_wh": diary.by_cause_wh(),
        }

    def __repr__(self) -> str:
        return f"<Car {self.name}: {self.vehicle.title}, {len(self.diary)} trips in its diary>"

    def _read(self, name: str, read: Callable[[Path], Read], missing: Callable[[], Read]) -> Read:
        """A part of the folder `learned`, which is read again where a writer exchanged the folder meanwhile."""
        learned = self.folder / LEARNED
        while True:
            restore_folder(learned)
            before = _file_number(learned)
            try:
                result = read(learned / name) if (learned / name).exists() else missing()
            except (OSError, InvalidInput):
                if _file_number(learned) == before:
                    raise
            else:
                if _file_number(learned) == before:
                    return result

    def _adapted(self) -> dict[str, Any]:
        """What the metadata of the model hold of the car; nothing before the first trip or from an older version."""
        about: dict[str, Any] = self._read(MODEL, partial(load_metadata, check_parts=False), dict)
        current = about.get("format_version") == FORMAT_VERSION
        return cast(dict[str, Any], about["provenance"]["adapted"]) if current else {}

    def _learn(
        self, given: frozenset[str], progress: Callable[[int, int], None]
    ) -> tuple[int, tuple[str, ...], int]:
        fleet = TripSet(self.name, tuple(self.store.logs()))
        diary = self.diary
        judged = audit(fleet)
        left_out = [f"{trip}: {why}" for trip, why in judged.set_aside.items() if trip in given]
        ahead = [trip for trip in _by_date(judged.trips) if trip.trip_id not in diary.trip_ids]
        if not ahead:
            return 0, tuple(left_out), 0
        base, published = load_model(self.base), for_car(self.base, self.vehicle)
        known, model, entries = self._known(base), self.model(), []
        flat = 0
        for number, trip in enumerate(ahead, start=1):
            try:
                entries.append(
                    entry(trip, model.forecast(trip), published.forecast(trip), len(known.evidence))
                )
                known = known.with_trips([trip])
                model = known.model
                flat += not (trip.has("elevation_m") or trip.has("grade"))
            except InvalidInput as error:
                left_out.append(f"{trip.trip_id}: {error}")
            progress(number, len(ahead))
        if entries:
            self._keep(known, fleet, judged, diary.with_entries(entries))
        return len(entries), tuple(left_out), flat

    def _known(self, base: ForecastModel) -> Adaptation:
        """What the car has learned; from its trips again where an older version of tripwatt learned them."""
        new = Adaptation.before_trips(base, self.vehicle, population_of(base))
        place = self.folder / LEARNED / MODEL
        if not place.is_dir():
            return new
        if load_metadata(place, check_parts=False)["format_version"] == FORMAT_VERSION:
            stored = load_model(place)
            if stored.evidence_ is not None and stored.evidence_.is_current and stored.roads_ is not None:
                return new.with_evidence(stored.evidence_, stored.ranges_, stored.roads_)
        seen = self.diary.trip_ids
        trips = audit(TripSet(self.name, tuple(self.store.logs()))).trips
        return new.with_trips([trip for trip in _by_date(trips) if trip.trip_id in seen])

    def _keep(self, known: Adaptation, fleet: TripSet, judged: Audit, diary: Diary) -> None:
        """Write model and diary together: no reader gets one of them without the other."""
        model, base = known.model, load_metadata(self.base, check_parts=False)
        provenance = {**provenance_of(fleet, judged, model, []), **about_adaptation(known, base)}
        figures = {**held_out_figures(model.held_out_), "protocol": PROTOCOL}

        def write(made: Path) -> None:
            save_model(model, made / MODEL, provenance=provenance, evaluation=figures)
            diary.table.to_parquet(made / DIARY, index=False)

        replace_folder(self.folder / LEARNED, write)


def state_of(folder: Path) -> tuple[int, ...]:
    """What a car has learned, as `Car.state`, without opening it."""
    try:
        file = (folder / LEARNED / MODEL).stat()
    except FileNotFoundError:
        file = (folder / ABOUT).stat()
    return file.st_ino, file.st_mtime_ns


def _file_number(folder: Path) -> int | None:
    try:
        return folder.stat().st_ino
    except FileNotFoundError:
        return None


def _by_date(trips: Iterable[Trip]) -> list[Trip]:
    """Trips with measured energy by their departure; those without a date come last, by name."""
    dated = in_order(trip for trip in trips if trip.context.started_at is not None)
    others = (trip for trip in trips if trip.context.started_at is None)
    return [*dated, *sorted(in_order(others), key=lambda trip: trip.trip_id)]


def folder_name(label: str) -> str:
    """A name for the folder of a car, from what its owner calls it.

    Examples
    --------
    >>> folder_name("My Model 3"), folder_name("Zoé"), folder_name("my-leaf"), folder_name("???")
    ('My-Model-3', 'Zoe', 'my-leaf', 'car')
    """
    folded = unicodedata.normalize("NFKD", label.replace("ß", "ss")).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9._]+", "-", folded).strip("-.")[:64] or "car"


def create_car(
    folder: Path | str, vehicle: Vehicle | str | Path, *, base: Path | str | None = None, label: str = ""
) -> Car:
    """Make the folder of a car whose model will be adapted to its trips.

    Parameters
    ----------
    folder : path
        New or empty, or that of a car on the road, which gets a description so. A name that cannot be part of a URL, such as "My Model 3", becomes the label of the car, and the folder is
        called after it: "My-Model-3".
    vehicle : Vehicle, str or path
        A car, the name of one of the library, or a TOML file.
    base : path, optional
        A stored model to adapt; the bundled one by default.
    label : str
        As its owner calls the car; the name of the folder by default.

    Returns
    -------
    Car
        Without trips.

    Raises
    ------
    InvalidInput
        When there is no such vehicle or base, the folder is in use, or the package `deltalake` is missing.

    Examples
    --------
    >>> import tripwatt as tw
    >>> car = tw.create_car("my-leaf", "nissan_leaf_24")  # doctest: +SKIP
    """
    wanted = Path(folder)
    place = _place(wanted)
    car = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    there = {entry.name for entry in place.iterdir()} if place.is_dir() else set[str]()
    if there - {LIVE} or (place.exists() and not place.is_dir()):
        got, allowed = "not empty", "a new or empty folder, or that of a car on the road"
        raise InvalidInput.of("folder in use", f"{place}", got, allowed)
    root = None if base is None else Path(base).resolve()
    for_car(root, car)

    def write(made: Path) -> None:
        create_store(made / STORE, buckets=1)
        (made / VEHICLE).write_text(render_vehicle(car), encoding="utf-8")
        about = {
            "tripwatt_car": FORMAT,
            "vehicle": car.name,
            "base": None if root is None else f"{root}",
            "label": label or wanted.name,
        }
        (made / ABOUT).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")

    with system_errors("cannot write the folder", f"{place}", "a writable folder"):
        # what follows the car on the road has its folder open: it stays where it is
        write(place) if there else replace_folder(place, write)
    return open_car(place)


def is_car(folder: Path | str) -> bool:
    """Tell whether a folder is that of a car.

    Parameters
    ----------
    folder : Path or str
        Any folder.

    Returns
    -------
    bool
        Without opening the car.

    Examples
    --------
    >>> is_car("no-such-folder")
    False
    """
    return (Path(folder) / ABOUT).is_file()


def open_car(folder: Path | str) -> Car:
    """Open the folder of a car that `create_car` or `tripwatt car new` made.

    Parameters
    ----------
    folder : path
        Where the car was made.

    Returns
    -------
    Car
        With its trips, its model and its diary.

    Raises
    ------
    InvalidInput
        When it is none, or of a newer format.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.open_car("my-leaf").diary.score  # doctest: +SKIP
    Score(trips=12, error=0.09, weighted_error=0.08, bias=0.01, coverage=0.92, width=0.4)
    """
    place = _place(Path(folder))
    if not is_car(place):
        got = "a folder" if place.is_dir() else "a file" if place.exists() else "no such folder"
        fix = "make one: tripwatt car new"
        raise InvalidInput.of("not a car", f"{place}", got, "a folder of `tripwatt car new`", fix)
    with damage(place / ABOUT, "the description of a car"):
        about = json.loads(read_text_file(place / ABOUT, MOST_ABOUT_BYTES))
        number, name, base = about["tripwatt_car"], about["vehicle"], about["base"]
        label = f"{about.get('label', place.name)}"
    if not isinstance(number, int) or number > FORMAT:
        got, allowed, fix = f"format {number}"[:80], f"format {FORMAT}", "install a newer tripwatt"
        raise InvalidInput.of("car of a newer format", f"{place}", got, allowed, fix)
    car = replace(load_vehicle(place / VEHICLE), name=f"{name}")
    return Car(place.absolute(), car, None if base is None else Path(f"{base}"), label)


def _place(folder: Path) -> Path:
    """The folder of a car by its name or its label."""
    usual = folder.name == "" or VALID_NAME.fullmatch(folder.name) is not None or is_car(folder)
    return folder if usual else folder.with_name(folder_name(folder.name))


def forget_car(folder: Path | str) -> None:
    """Erase a car: its trips, its model, its diary and what it sent while it drove; files that others put into the folder stay.

    Parameters
    ----------
    folder : Path or str
        Of the car.

    Raises
    ------
    InvalidInput
        When it is no car, and none on the road.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     place = create_car(Path(folder, "my-leaf"), "nissan_leaf_24").folder
    ...     forget_car(place)
    ...     print(place.exists())
    False
    """
    place = _place(Path(folder))
    if not any((place / LIVE / name).is_file() for name in (JOURNAL, TOKEN)):
        place = open_car(folder).folder
    with folder_lock(place):
        for name in (STORE, LEARNED, LIVE, UPLOADS):
            shutil.rmtree(place / name, ignore_errors=True)
        for name in (VEHICLE, ABOUT, LEFT_OUT):
            (place / name).unlink(missing_ok=True)
        if not any(place.iterdir()):
            place.rmdir()
