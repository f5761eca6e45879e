"""A car on the road: its samples as they arrive, the trip that it is on, and forecasts from what it measured so far.

Everything is in the folder `live` of the car: the journal of samples that no finished trip holds, the plan of its trip, the
finished trips as tables, and the digest of its token.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import math
import re
import secrets
import time
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.files import folder_lock, read_file, read_text_file, write_file
from tripwatt.forecasting import Forecast
from tripwatt.live.journal import Journal
from tripwatt.live.live_trip import LEAST_M, SILENCE_S, LiveTrip, TripFinder
from tripwatt.live.on_the_way import MadeForecast, OnTheWay, read_forecasts, write_forecasts
from tripwatt.live.ordering import Arrival, OrderedSamples
from tripwatt.live.own_car import LIVE
from tripwatt.live.telemetry import Sample
from tripwatt.live.usual import LONGER, usual_departure
from tripwatt.sources.canonical import read_canonical
from tripwatt.trips import Context, Departure, Drive, Log

JOURNAL: Final = "journal.ndjson"
PLAN: Final = "plan.json"
TOKEN: Final = "token.json"
TRIPS: Final = "trips"
FORECASTS: Final = "forecasts.json"
"""Forecasts of the trip that the car is on; of a finished trip, the end of the name of its file."""
NAMES: Final = re.compile(r"\d{8}T\d{6}Z")
NAMED: Final = "%Y%m%dT%H%M%SZ"
"""Name of a finished trip: its departure in UTC."""

FUTURE_S: Final = 120.0
"""A time may be this much ahead of our clock [s]: one that is further ahead would make all that follow late."""

LEAST_ROWS: Final = 3
"""Fewest samples of a table that can be read again."""

SECONDS_PER_DAY: Final = 86_400.0
ERASE_EVERY_S: Final = 3600.0

SLACK_LINES: Final = 1000
"""Lines that the journal of a standing car may hold beyond those that count."""

MOST_PLAN_BYTES: Final = 1 << 24
MOST_TOKEN_BYTES: Final = 1 << 12
VALID_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,63}")
"""Names of cars: they are parts of paths and of URLs."""


@dataclass(frozen=True, slots=True)
class LivePlan:
    """The plan of a trip, as it was given.

    Attributes
    ----------
    request : mapping
        Whatever JSON can hold: the service keeps a request for a forecast here.
    departure_s : float or None
        Departure on the plan's clock [s since 1970]; None for the start of the trip.
    given_s : float or None
        Time of the car's latest sample when the plan was given [s since 1970].

    Examples
    --------
    >>> LivePlan({"links": []}).departure_s is None
    True
    """

    request: Mapping[str, Any]
    departure_s: float | None = None
    given_s: float | None = None


class LiveCar:
    """A car that sends samples; made by `open_live_car`. One process at a time has it open.

    Parameters
    ----------
    folder : Path
        Of the car. Its name is that of the car.
    keep_days : float, optional
        Days that finished trips, and samples of a car that is silent, stay on disk; for ever by default.

    Attributes
    ----------
    counts : dict of str to int
        Samples since the car was opened: `new`, `doubled` and `late`.
    received_s : float or None
        When the last message came [s since 1970, by our clock].

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     car = open_live_car(Path(folder, "my-leaf"))
    ...     print([car.add(Sample(1.7e9 + 10.0 * k, {"speed_m_s": 10.0, "displayed_soc": 0.8})) for k in range(4)])
    ...     print(car.observed().shape, car.departure().soc, car.about(1.7e9 + 60.0)["seconds_since_message"] is None)
    ...     print(car.usual_trip(), car.usual_trip_at(1.7e9), car.accepts("a token"))
    ...     car.set_plan({"links": []})
    ...     print(car.plan.request)
    ...     print(car.end_when_silent(1.7e9), car.logs())
    ...     car.close()
    ['new', 'new', 'new', 'new']
    (4, 3) 0.8 False
    None None False
    {'links': []}
    False ()
    >>> car.update(model.forecast(plan)).soc_interval(0.9)  # doctest: +SKIP
    (0.51, 0.56)
    """

    def __init__(self, folder: Path, keep_days: float = math.inf) -> None:
        self.folder = folder / LIVE
        self.keep_days = keep_days
        self.name = folder.name
        self.counts = {"new": 0, "doubled": 0, "late": 0}
        self._finder = TripFinder()
        self._ended: list[LiveTrip] = []
        self._usual: tuple[float, Log | None] | None = None
        # time and displayed charge of the latest sample that has one
        self._shown: tuple[float, float] | None = None
        self._erased_s = -math.inf
        with ExitStack() as stack:
            stack.enter_context(folder_lock(self.folder))
            self._journal = Journal(self.folder / JOURNAL)
            stack.callback(self._journal.close)
            self._ordered = OrderedSamples(self._journal.after_s)
            self.plan = _read_plan(self.folder / PLAN)
            self._on_the_way = OnTheWay(self.folder / FORECASTS)
            for sample in self._journal.read():
                if self._ordered.arrival(sample) == "new":
                    self._take(sample)
            self.received_s = self._journal.written_s if self._journal.lines else None
            self._listening_s = time.time() if self._journal.lines else -math.inf
            self._finish()
            self.erase_old(time.time())
            self._open = stack.pop_all()

    @property
    def trip(self) -> LiveTrip | None:
        """The trip that the car is on; its start is seen when no earlier sample can come."""
        return self._finder.trip

    def add(self, sample: Sample, *, now_s: float | None = None) -> Arrival:
        """Take a sample; it is on disk when this returns. O(1) amortised.

        Parameters
        ----------
        sample : Sample
            What the car sent.
        now_s : float, optional
            The time by our clock [s since 1970].

        Returns
        -------
        {"new", "doubled", "late"}
            Only a new sample counts.

        Raises
        ------
        InvalidInput
            When its time is ahead of our clock by more than `FUTURE_S`.
        OSError
            When it cannot be written; send it again.
        """
        now_s = time.time() if now_s is None else now_s
        if sample.time_s > now_s + FUTURE_S:
            got, allowed = (
                f"{sample.time_s - now_s:.0f} s ahead",
                f"at most {FUTURE_S:g} s ahead of our clock",
            )
            raise InvalidInput(
                Fault("time in the future", "utc", got, allowed, "set the clock of the sender")
            )
        arrival = self._ordered.arrival(sample)
        if arrival == "new":
            self._journal.append(sample)
            self._take(sample)
        self.counts[arrival] += 1
        self.received_s = now_s
        self._finish()
        return arrival

    def erase_old(self, now_s: float) -> int:
        """Erase what is older than `keep_days`: finished trips by their departure, and the samples of a car that sends no more.

        A trip that the car is on stays. O(finished trips).

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        int
            Trips that were erased.

        Examples
        --------
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder, open_live_car(f"{folder}/leaf", keep_days=90.0) as car:
        ...     car.erase_old(1.8e9)
        0
        """
        before_s = now_s - self.keep_days * SECONDS_PER_DAY
        if before_s == -math.inf:
            return 0
        old = [name for name in finished_names(self.folder.parent) if _started(name).timestamp() < before_s]
        for name in old:
            for end in (FORECASTS, "csv"):
                (self.folder / TRIPS / f"{name}.{end}").unlink(missing_ok=True)
        silent = self.received_s is not None and self.received_s < before_s
        if silent and self.trip is None and self._journal.lines:
            self._journal.rewrite([], self._ordered.newest_s)
        if old:
            self._usual = None
        return len(old)

    def _take(self, sample: Sample) -> None:
        soc = sample.values.get("displayed_soc")
        if soc is not None and (self._shown is None or sample.time_s >= self._shown[0]):
            self._shown = sample.time_s, soc
        self._ordered.insert(sample)
        self._follow(self._ordered.ready())

    def _follow(self, samples: list[Sample]) -> None:
        for sample in samples:
            ended = self._finder.add(sample)
            if ended is not None:
                self._ended.append(ended)

    def end_when_silent(self, now_s: float) -> bool:
        """End the trip of a car that sent nothing for `SILENCE_S` by our clock, while this process listened.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        bool
            Whether a trip has ended.
        """
        if now_s - self._erased_s > ERASE_EVERY_S:
            self._erased_s = now_s
            self.erase_old(now_s)
        if self.received_s is None or now_s - max(self.received_s, self._listening_s) < SILENCE_S:
            return False
        self._follow(self._ordered.rest())
        ended = self._finder.end()
        if ended is not None:
            self._ended.append(ended)
        done = bool(self._ended)
        self._finish()
        return done

    def _finish(self) -> None:
        """Write ended trips, forget their plan and their samples. Whatever a killed process left undone is done again."""
        done = bool(self._ended)
        while self._ended:
            self._keep(self._ended[0])
            del self._ended[0]
        rest = len(self._finder.before) + len(self._ordered.waiting)
        if done or (self.trip is None and self._journal.lines > 2 * rest + SLACK_LINES):
            self._rewrite()

    def _rewrite(self) -> None:
        """Shorten the journal to what no finished trip holds."""
        if self.trip is not None:
            return  # it has begun already: the journal is shortened after it
        rest = [*self._finder.before, *self._ordered.waiting]
        after_s = math.nextafter(rest[0].time_s, -math.inf) if rest else self._ordered.given_s
        self._journal.rewrite(rest, after_s)

    def _keep(self, trip: LiveTrip) -> None:
        table = trip.table(until_s=trip.moved_s)
        if trip.distance_m < LEAST_M or len(table) < LEAST_ROWS:
            return
        started = dt.datetime.fromtimestamp(trip.start_s, dt.UTC)
        folder = self.folder / TRIPS
        folder.mkdir(mode=0o700, exist_ok=True)
        made = self._on_the_way.of(trip.start_s)
        if made:  # before the trip itself: whoever finds it finds its forecasts
            write_forecasts(folder / f"{started:{NAMED}}.{FORECASTS}", trip.start_s, made)
        write_file(folder / f"{started:{NAMED}}.csv", lambda part: table.to_csv(part, index=False))
        plan = self.plan
        if plan is not None and (plan.given_s is None or plan.given_s <= trip.moved_s):
            self.set_plan(None)

    def observed(self) -> pd.DataFrame:
        """Tabulate what the car measured on its trip so far, timed from the departure; also what waits for late samples. O(samples of the trip).

        Returns
        -------
        DataFrame
            Canonical columns; without rows where the car is on no trip.
        """
        if self.trip is None:
            return pd.DataFrame({"time_s": [], "speed_m_s": []}, dtype="float64")
        since_s = None if self.plan is None else self.plan.departure_s
        return self.trip.table(self._ordered.waiting, since_s=since_s)

    def usual_trip(self) -> Log | None:
        """Find the finished trip that began nearest by time of day to the one that the car is on.

        O(finished trips), once for a trip.

        Returns
        -------
        Log or None
            None where there is none within `NEAR_S`, or the car has driven further than that trip.
        """
        trip = self.trip
        if trip is None:
            return None
        if self._usual is None or self._usual[0] != trip.start_s:
            self._usual = trip.start_s, self.usual_trip_at(trip.start_s)
        found = self._usual[1]
        return None if found is None or trip.distance_m > LONGER * found.distance_m else found

    def usual_trip_at(self, start_s: float) -> Log | None:
        """Find the finished trip that began nearest by time of day to a departure. O(finished trips).

        Parameters
        ----------
        start_s : float
            The departure [s since 1970].

        Returns
        -------
        Log or None
            None where there is none within `NEAR_S`, or its file was changed.
        """
        paths = {_started(name).timestamp(): name for name in finished_names(self.folder.parent)}
        earlier = (other for other in paths if other < start_s)
        found = usual_departure(earlier, start_s)
        try:
            return None if found is None else _read_trip(self.folder.parent, paths[found])
        except InvalidInput:  # somebody changed the file
            return None

    @property
    def forecasts(self) -> tuple[MadeForecast, ...]:
        """Forecasts that were kept of the trip that the car is on."""
        return () if self.trip is None else self._on_the_way.of(self.trip.start_s)

    @property
    def wants_forecast(self) -> bool:
        """Whether a forecast that is made now is kept with the trip."""
        trip = self.trip
        return trip is not None and self._on_the_way.is_due(trip.start_s, trip.last_s - trip.start_s)

    def keep_forecast(
        self, energy_wh: float, low_wh: float, high_wh: float, *, departing: bool = False
    ) -> bool:
        """Keep a forecast of the trip that the car is on for its diary, if one is due.

        Parameters
        ----------
        energy_wh, low_wh, high_wh : float
            Energy of the whole trip, and the ends of its 90 % interval.
        departing : bool
            Whether it was made before anything was measured.

        Returns
        -------
        bool
            Whether it was kept.

        Raises
        ------
        OSError
            When it cannot be written.

        Examples
        --------
        >>> car.keep_forecast(forecast.energy_wh, *forecast.interval(0.9))  # doctest: +SKIP
        True
        """
        trip = self.trip
        if trip is None or (departing and self.forecasts):
            return False
        at_s, distance_m = (0.0, 0.0) if departing else (trip.last_s - trip.start_s, trip.distance_m)
        return self._on_the_way.add(trip.start_s, MadeForecast(at_s, distance_m, energy_wh, low_wh, high_wh))

    def update(self, forecast: Forecast) -> Forecast:
        """Update a forecast of the trip made at its departure by what was measured so far. O(samples of the trip).

        Parameters
        ----------
        forecast : Forecast
            Its clock is that of `observed`.

        Returns
        -------
        Forecast
            The same where fewer than two samples were measured.

        Raises
        ------
        InvalidInput
            As `Forecast.update`: when the samples are not those of this trip.
        """
        observed = self.observed()
        return forecast if len(observed) < 2 else forecast.update_since_departure(observed)

    def departure(self) -> Departure:
        """Collect what the car's samples show of the departure.

        Returns
        -------
        Departure
            Of the first values on a trip, of the latest ones before it; without payload and without whether it follows a trip.
        """
        table = self.observed()
        if not len(table):
            latest: dict[str, float] = {}
            for sample in (*self._finder.before, *self._ordered.waiting):
                latest |= sample.values
            table = pd.DataFrame([{"time_s": 0.0, "speed_m_s": 0.0, **latest}], dtype="float64")
        found = Departure.from_drive(Drive(self.name, table), Context())
        return replace(found, payload_mass_kg=None, follows_trip=None)

    def about(self, now_s: float) -> dict[str, Any]:
        """Describe the car: seconds since its last message, messages since it was opened, and its trip.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        dict
            Plain values; `trip` is None where the car is on none.
        """
        trip = self.trip
        return {
            "vehicle": self.name,
            "seconds_since_message": None if self.received_s is None else max(0.0, now_s - self.received_s),
            "messages": dict(self.counts),
            "soc": None if self._shown is None else self._shown[1],
            "trip": None
            if trip is None
            else {
                "departure_utc": trip.start_s,
                "duration_s": trip.last_s - trip.start_s,
                "distance_m": trip.distance_m,
                "samples": len(trip),
            },
        }

    def set_plan(self, request: Mapping[str, Any] | None, departure_s: float | None = None) -> None:
        """Give the plan of the trip that the car is on, or of its next one; None takes it away.

        It is kept until its trip has ended.

        Parameters
        ----------
        request : mapping or None
            Whatever JSON can hold.
        departure_s : float, optional
            Departure on the clock of the plan [s since 1970]. Earlier samples do not count.
        """
        path = self.folder / PLAN
        if request is None:
            path.unlink(missing_ok=True)
            self.plan = None
            return
        newest_s = self._ordered.newest_s
        plan = LivePlan(request, departure_s, newest_s if newest_s > 0.0 else None)
        about = {"given_s": plan.given_s, "departure_s": departure_s, "request": request}
        write_file(path, lambda made: _write_json(made, about))
        self.plan = plan

    def logs(self) -> tuple[Log, ...]:
        """Read the finished trips.

        Returns
        -------
        tuple of Log
            In the order of their departure, as `OwnCar.add` takes them.
        """
        return finished_logs(self.folder.parent)

    def accepts(self, token: str) -> bool:
        """Tell whether a token is that of this car.

        Parameters
        ----------
        token : str
            As a sender gave it.

        Returns
        -------
        bool
            Compared in constant time; False where the car has no token.
        """
        return secrets.compare_digest(digest_of(token), token_digest(self.folder.parent) or "")

    def close(self) -> None:
        """Leave the car to another process."""
        self._open.close()

    def __enter__(self) -> LiveCar:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        trip = self.trip
        return f"<LiveCar {self.name}: {'on no trip' if trip is None else f'{trip.distance_m / 1000.0:.1f} km driven'}>"


def open_live_car(folder: Path | str, *, keep_days: float = math.inf) -> LiveCar:
    """Open a car that sends samples: a new folder, or one that may be a car of `create_car` beside.

    Parameters
    ----------
    folder : Path or str
        Of the car, whose name is that of the folder.
    keep_days : float, optional
        Days that finished trips stay on disk; older ones are erased now and every hour. For ever by default.

    Returns
    -------
    LiveCar
        Locked against other processes until its `close`.

    Raises
    ------
    InvalidInput
        When its name cannot be one, it cannot be written, its plan is damaged, or another process has it open.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     car = open_live_car(Path(folder, "my-leaf"))
    ...     print(car.name, car.trip)
    ...     car.close()
    my-leaf None
    """
    place = Path(folder).absolute()
    _live_folder(place)
    return LiveCar(place, keep_days)


def is_live_car(folder: Path | str) -> bool:
    """Tell whether a folder is that of a car with a token.

    Parameters
    ----------
    folder : Path or str
        Of a car.

    Returns
    -------
    bool
        Without opening the car.

    Examples
    --------
    >>> is_live_car("no-such-folder")
    False
    """
    return (Path(folder) / LIVE / TOKEN).is_file()


def issue_token(folder: Path | str) -> str:
    """Make the token with which a car sends its samples; an earlier one is no longer accepted.

    The folder holds a digest of the token, from which it cannot be found.

    Parameters
    ----------
    folder : Path or str
        Of a car; made where it is missing.

    Returns
    -------
    str
        The token; it cannot be read again.

    Raises
    ------
    InvalidInput
        As `open_live_car`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     token = issue_token(Path(folder, "my-leaf"))
    ...     print(len(token), is_live_car(Path(folder, "my-leaf")))
    32 True
    """
    token = secrets.token_urlsafe(24)
    path = _live_folder(Path(folder).absolute()) / TOKEN
    write_file(path, lambda made: _write_json(made, {"sha256": digest_of(token)}))
    return token


def digest_of(token: str) -> str:
    """SHA-256 of a token; tokens are random, so that a digest needs no salt."""
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()


def token_digest(folder: Path) -> str | None:
    """The digest of a car's token; None where it has none.

    Raises
    ------
    InvalidInput
        When the file is damaged.
    """
    path = folder / LIVE / TOKEN
    if not path.is_file():
        return None
    try:
        found = json.loads(read_text_file(path, MOST_TOKEN_BYTES))["sha256"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InvalidInput(
            Fault("damaged file", f"{path}", f"{error}"[:200], "the digest of a token")
        ) from error
    return f"{found}"


def finished_names(folder: Path) -> list[str]:
    """Names of the trips that a car has finished, in the order of their departure; files that others put there are left out."""
    found = (folder / LIVE / TRIPS).glob("*.csv")
    return sorted(path.stem for path in found if NAMES.fullmatch(path.stem))


def finished_logs(folder: Path, names: Iterable[str] | None = None) -> tuple[Log, ...]:
    """Trips that a car has finished, all or those of some names. Another process may follow the car meanwhile.

    Raises
    ------
    InvalidInput
        When one of them cannot be read.
    """
    return tuple(_read_trip(folder, name) for name in (finished_names(folder) if names is None else names))


def log_name(car: str, name: str) -> str:
    """Name of the log of a finished trip.

    Examples
    --------
    >>> log_name("leaf", "20240501T080000Z")
    'leaf-20240501T080000Z'
    """
    return f"{car}-{name}"


def forecasts_of(folder: Path, trip_id: str) -> tuple[MadeForecast, ...]:
    """Forecasts that were made during a finished trip, by the name of its log; none where none were made."""
    name = trip_id.removeprefix(log_name(folder.name, ""))
    if NAMES.fullmatch(name) is None:
        return ()
    return read_forecasts(folder / LIVE / TRIPS / f"{name}.{FORECASTS}")


def _live_folder(place: Path) -> Path:
    """The folder `live` of a car, made where it is missing."""
    if VALID_NAME.fullmatch(place.name) is None:
        allowed = "up to 64 letters, digits, '.', '_' and '-'"
        raise InvalidInput(Fault("name cannot be used", f"{place}", place.name, allowed))
    try:
        (place / LIVE).mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        got = error.strerror or f"{error}"
        raise InvalidInput(Fault("cannot write the folder", f"{place}", got, "a writable folder")) from error
    return place / LIVE


def _read_plan(path: Path) -> LivePlan | None:
    if not path.is_file():
        return None
    try:
        found = json.loads(read_file(path, MOST_PLAN_BYTES))
        return LivePlan(dict(found["request"]), found["departure_s"], found["given_s"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InvalidInput(
            Fault("damaged file", f"{path}", f"{error}"[:200], "a plan", "remove it")
        ) from error


def _started(name: str) -> dt.datetime:
    """Departure of a finished trip, by its name."""
    return dt.datetime.strptime(name, NAMED).replace(tzinfo=dt.UTC)


def _read_trip(folder: Path, name: str) -> Log:
    local = _started(name).astimezone().replace(tzinfo=None)
    table = read_canonical(folder / LIVE / TRIPS / f"{name}.csv")
    return Log.from_samples(log_name(folder.name, name), table, Context(started_at=local))


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content) + "\n", encoding="utf-8")
