"""The SQLite file of a car. Related changes are one transaction, so that a killed process or a full disk leaves the file intact.

The file is in WAL mode: readers do not wait, and writers of several processes wait for each other. When a commit returns, the
operating system has the data; the next checkpoint, after a finished trip or after learning, brings them to the disk.
"""

from __future__ import annotations

import errno
import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext, suppress
from dataclasses import astuple, dataclass
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final
from urllib.parse import quote

import numpy as np

from tripwatt.errors import InvalidInput, damage
from tripwatt.files import move_new
from tripwatt.fleet.store.rows import context_values, digest_of, kept_columns, log_from_rows
from tripwatt.server.cars.telemetry import Sample
from tripwatt.trips import Log, Recorded

FILE: Final = "car.sqlite"
ALLOWED: Final = "a file of tripwatt, on a disk with space"
FORGET: Final = "erase it: tripwatt car forget"
"""What to do with a car that cannot be read."""

FORMAT: Final = 1
"""Number of the format, the `user_version` of the file."""

BUSY_S: Final = 60.0
"""Longest wait of a writer for another one [s]: the longest transaction reads the folder of an older version."""

SCHEMA: Final = (
    "CREATE TABLE settings (name TEXT PRIMARY KEY, value TEXT NOT NULL)",
    # `start_s` is the departure of a trip that was followed on the road [s since 1970]; of other logs it is null
    """CREATE TABLE trips (trip_id TEXT PRIMARY KEY, digest TEXT NOT NULL UNIQUE, started_at TEXT, driver TEXT, context TEXT NOT NULL,
    columns TEXT NOT NULL, samples BLOB NOT NULL, start_s REAL, is_learned INTEGER NOT NULL DEFAULT 0)""",
    "CREATE TABLE diary (trip_id TEXT PRIMARY KEY, entry TEXT NOT NULL)",
    "CREATE TABLE model (part TEXT PRIMARY KEY, content BLOB NOT NULL)",
    """CREATE TABLE forecasts (start_s REAL NOT NULL, at_s REAL NOT NULL, distance_m REAL NOT NULL, energy_wh REAL NOT NULL,
    low_wh REAL NOT NULL, high_wh REAL NOT NULL)""",
    # samples that no finished trip holds, in the order of their arrival
    "CREATE TABLE messages (sample TEXT NOT NULL)",
)

FLAGS: Final = ("charging", "parked")


@dataclass(frozen=True, slots=True)
class MadeForecast:
    """A forecast of the whole trip, made on the way.

    Attributes
    ----------
    at_s : float
        Time since the start of the trip [s]; 0 for the forecast at departure.
    distance_m : float
        Driven by then.
    energy_wh, low_wh, high_wh : float
        Energy of the whole trip, and the ends of its 90 % interval.
    """

    at_s: float
    distance_m: float
    energy_wh: float
    low_wh: float
    high_wh: float


class Database(sqlite3.Connection):
    """A connection to the file of a car."""

    def put_settings(self, settings: Mapping[str, Any]) -> None:
        """Write settings; one whose value is None is as one that is missing."""
        rows = [(name, json.dumps(value)) for name, value in settings.items()]
        self.executemany("INSERT OR REPLACE INTO settings VALUES (?, ?)", rows)

    def put_logs(
        self,
        rows: Iterable[tuple[object, ...]],
        *,
        start_s: float | None = None,
        is_learned: bool = False,
    ) -> int:
        """Add rows of `row_of_log`, except logs whose name or content is stored already; return the number of added rows."""
        changes_before = self.total_changes
        statement = "INSERT OR IGNORE INTO trips VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"
        self.executemany(statement, [(*row, start_s, is_learned) for row in rows])
        return self.total_changes - changes_before

    def put_forecasts(self, start_s: float, forecasts: Iterable[MadeForecast]) -> None:
        """Add forecasts of the trip that started at `start_s` [s since 1970]."""
        rows = [(start_s, *astuple(forecast)) for forecast in forecasts]
        self.executemany("INSERT INTO forecasts VALUES (?, ?, ?, ?, ?, ?)", rows)

    def put_messages(self, samples: Iterable[Sample]) -> None:
        """Append samples to those that are stored."""
        self.executemany("INSERT INTO messages VALUES (?)", [(text_of(sample),) for sample in samples])

    @property
    def is_finished(self) -> bool:
        """Whether the file has its tables: a process that was killed may leave a file without."""
        return bool(self.execute("PRAGMA user_version").fetchone() != (0,))


class CarFile:
    """The file of the car in a folder.

    Parameters
    ----------
    folder : Path
        Folder of the car.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE
        self._kept: Database | None = None

    def prepare(self, fill: Callable[[Database], None], settings: Mapping[str, Any] | None = None) -> bool:
        """Create the tables of a new file and fill them, or leave those that it has, and write settings, all in one transaction.

        Returns
        -------
        bool
            False if another process wrote settings of a description first; nothing is written then.

        Raises
        ------
        InvalidInput
            When the file is of a newer format or damaged.
        OSError
            When the file cannot be written.
        """
        if not self.path.exists():
            self._create()
        with self.read() as db:
            (number,) = db.execute("PRAGMA user_version").fetchone()
        if number > FORMAT:
            got, allowed, fix = f"format {number}", f"format {FORMAT}", "install a newer tripwatt"
            raise InvalidInput.of("car of a newer format", f"{self.path.parent}", got, allowed, fix)
        if number == 0 or settings:
            with self.write() as db:
                if not db.is_finished:  # no other process was faster
                    for statement in SCHEMA:
                        db.execute(statement)
                    fill(db)
                    db.execute(f"PRAGMA user_version = {FORMAT}")
                if settings and self.setting("state", db) is not None:
                    return False
                db.put_settings(settings or {})
        return True

    def _create(self) -> None:
        # under another name: SQLite does not wait for other connections to enter WAL mode
        with TemporaryDirectory(prefix=f"{FILE}-", dir=self.path.parent) as folder, suppress(FileExistsError):
            new = CarFile(Path(folder))
            new.path.touch(0o600)
            with new.read() as db:
                db.execute("PRAGMA journal_mode = WAL")
            move_new(new.path, self.path)

    def keep_open(self) -> None:
        """Use one connection from now on, in one thread at a time, until `close`."""
        self._kept = _connect(self.path)

    def close(self) -> None:
        """Close the connection that is kept."""
        if self._kept is not None:
            self._kept.close()
            self._kept = None

    def _opened(self) -> AbstractContextManager[Database]:
        return closing(_connect(self.path)) if self._kept is None else nullcontext(self._kept)

    @contextmanager
    def read(self) -> Iterator[Database]:
        """Open a connection for reading.

        Raises
        ------
        InvalidInput
            When the file cannot be read, or the block finds a value that is not one of ours.
        """
        try:
            with damage(self.path, ALLOWED, FORGET), self._opened() as db:
                yield db
        except sqlite3.Error as error:
            # a full disk or a missing permission is no damage
            problem = "cannot use the car" if isinstance(error, sqlite3.OperationalError) else "damaged file"
            raise InvalidInput.of(problem, f"{self.path}", f"{error}"[:200], ALLOWED) from error

    @contextmanager
    def write(self) -> Iterator[Database]:
        """Open a transaction: either all of its changes are written, or none.

        Raises
        ------
        OSError
            When the file cannot be written.
        """
        try:
            with self._opened() as db, db:
                db.execute("BEGIN IMMEDIATE")
                if not self.path.exists():
                    raise sqlite3.OperationalError("the car was erased")
                yield db
        except sqlite3.Error as error:
            raise OSError(errno.EIO, f"cannot write the car: {error}", f"{self.path}") from error

    def checkpoint(self) -> None:
        """Write committed data to the disk, and overwrite deleted data there; on a full disk SQLite does so later."""
        with suppress(InvalidInput), self.read() as db:
            db.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()

    @property
    def is_finished(self) -> bool:
        """Whether the file has its tables: a process that was killed may leave a file without."""
        with self.read() as db:
            return db.is_finished

    def setting(self, name: str, transaction: Database | None = None) -> Any:
        """Return a setting, as in a transaction if one is given; None if it is missing, or the file has no tables."""
        with self.read() if transaction is None else nullcontext(transaction) as db:
            if not db.is_finished:
                return None
            row = db.execute("SELECT value FROM settings WHERE name = ?", (name,)).fetchone()
            return None if row is None else json.loads(row[0])

    def logs(self, where: str = "TRUE", *values: object) -> tuple[Log, ...]:
        """Return the trips that meet an SQL condition, by departure; those without a departure come last. O(samples)."""
        columns = ("trip_id", "started_at", "driver", "context", "columns", "samples")
        order = "ORDER BY started_at IS NULL, started_at, trip_id"
        with self.read() as db:
            rows = db.execute(f"SELECT {', '.join(columns)} FROM trips WHERE {where} {order}", values)
            return tuple(_log(dict(zip(columns, row, strict=True))) for row in rows)

    def rows(self, query: str, *values: object) -> list[Any]:
        """Return the rows that an SQL query finds."""
        with self.read() as db:
            return db.execute(query, values).fetchall()

    def departures(self, before_s: float) -> list[float]:
        """Return the departures of finished trips on the road before `before_s` [s since 1970]."""
        return [start_s for (start_s,) in self.rows("SELECT start_s FROM trips WHERE start_s < ?", before_s)]

    def forecasts(self, start: str, value: object) -> tuple[MadeForecast, ...]:
        """Return the forecasts made on the trip whose start [s since 1970] an SQL expression of a value gives."""
        names = ", ".join(MadeForecast.__slots__)
        query = f"SELECT {names} FROM forecasts WHERE start_s = {start} ORDER BY rowid"
        return tuple(MadeForecast(*row) for row in self.rows(query, value))

    def messages(self) -> list[Sample]:
        """Return the samples that belong to no finished trip, in the order of their arrival."""
        with self.read() as db:
            rows = db.execute("SELECT sample FROM messages ORDER BY rowid")
            return [sample_of_text(text) for (text,) in rows]


def row_of_log(log: Recorded) -> tuple[object, ...]:
    """Return a log as a row of the table `trips`, without its last two columns. O(samples)."""
    samples, started, names = BytesIO(), log.context.started_at, kept_columns(log)
    np.savez_compressed(samples, **{name: log.array(name) for name in names})  # type: ignore[arg-type]
    return (
        log.trip_id,
        digest_of("", log),
        None if started is None else started.isoformat(),
        log.context.driver,
        json.dumps(context_values(log)),
        json.dumps(names),
        samples.getvalue(),
    )


def text_of(sample: Sample) -> str:
    """Return a sample as JSON text, without its faults.

    Examples
    --------
    >>> text_of(Sample(1.7e9, {"speed_m_s": 20.0}, parked=True))
    '{"time_s": 1700000000.0, "speed_m_s": 20.0, "parked": true}'
    """
    flags = {name: True for name in FLAGS if getattr(sample, name)}
    received = {} if sample.received_s is None else {"received_s": sample.received_s}
    return json.dumps({"time_s": sample.time_s, **sample.values, **flags, **received}, allow_nan=False)


def sample_of_text(text: str | bytes) -> Sample:
    """Return the sample of a text that `text_of` made.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError, InvalidInput
        When `text_of` cannot have made the text.
    """
    fields = json.loads(text)
    charging, parked = (bool(fields.pop(name, False)) for name in FLAGS)
    time_s, received_s = float(fields.pop("time_s")), fields.pop("received_s", None)
    values = {name: float(value) for name, value in fields.items()}
    return Sample(time_s, values, charging, parked, received_s=received_s and float(received_s))


def _log(row: Mapping[str, Any]) -> Log:
    with np.load(BytesIO(row["samples"]), allow_pickle=False) as arrays:
        return log_from_rows(row, dict(arrays))


def _connect(path: Path) -> Database:
    db: Database = sqlite3.connect(
        f"file:{quote(f'{path}')}?mode=rw",
        uri=True,
        factory=Database,
        timeout=BUSY_S,
        isolation_level=None,
        check_same_thread=False,
    )
    db.execute("PRAGMA synchronous = NORMAL")
    db.execute("PRAGMA secure_delete = ON")
    return db
