"""A car on the road: samples are stored as they arrive, and a trip that ends is stored as a log. `Car` adds the forecasts.

A sample is written to the car's file before it is used. After a restart, taking the stored samples again gives the same state.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Self

from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput, or_none, system_errors
from tripwatt.files import folder_lock
from tripwatt.server.cars import older
from tripwatt.server.cars.car_file import CarFile, Database, MadeForecast, row_of_log
from tripwatt.server.cars.live_trip import MIN_M, SILENCE_S, LiveTrip
from tripwatt.server.cars.plan import LONGER, LivePlan, usual_departure
from tripwatt.server.cars.recording import Recorder
from tripwatt.server.cars.sender import Arrival, steady_clock
from tripwatt.server.cars.telemetry import Sample
from tripwatt.trips import Context, Departure, Log, Plan, TripSet, table_of
from tripwatt.units import SECONDS_PER_DAY

FAR_S: Final = 366.0 * SECONDS_PER_DAY
"""Most that our clock may be slow [s]; before the sender's clock is known, samples further ahead are refused. A choice."""

MIN_ROWS: Final = 3
"""Fewest samples from which a log is made: a speed trace needs as many."""

SLACK_MESSAGES: Final = 1000
"""Samples of a standing car that may stay in the file beyond twice those that are still needed. A choice."""

EVERY_S: Final = 120.0
"""Shortest time between two stored forecasts of a trip [s]. A choice."""

MAX_FORECASTS: Final = 400
"""Most stored forecasts of a trip: enough for 13 h, longer than the longest trip."""

CLOSE: Final = "end the service, or use its page"
"""What to do when a service follows a car that another process is to follow or erase."""

VALID_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,63}")
"""Valid names of car folders, which become parts of paths and URLs."""


class LiveCar(Recorder):
    """A car that sends samples on the road; its file stores them.

    Parameters
    ----------
    folder : Path or str
        Folder of the car; its name is the car's name. A folder of tripwatt 0.2 or 0.3.0.dev0 is read once into the file.

    Attributes
    ----------
    now_s : callable
        Returns the time by our clock [s since 1970], which goes on steadily when that of the machine is set.
    finished : callable
        Called after a trip has ended and was written.
    keep_days : float
        Days for which finished trips, and samples of a silent car, stay on disk.

    Raises
    ------
    InvalidInput
        When the file cannot be made, is damaged, or is of a newer format.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder).absolute()
        self.file = CarFile(self.folder)
        with system_errors("cannot write the folder", f"{self.folder}", "a writable folder"):
            self.file.prepare(partial(older.read_into, self.folder))
        with suppress(OSError):  # the next opening goes on; the description is removed last
            for part in older.older_parts(self.folder):
                older.remove(part)
        super().__init__(self.folder.name)
        self.keep_days = math.inf
        self.now_s = steady_clock()
        self.finished: Callable[[], None] = lambda: None
        self._open = ExitStack()
        self._listening_s = self._erased_s = -math.inf
        self._messages = self._plans = 0
        # departure of a trip, and the road of its usual trip
        self._usual: tuple[float, LivePlan | None] | None = None

    def _resume(self) -> None:
        """Lock the folder, and take the stored samples again that belong to no finished trip."""
        with ExitStack() as stack:
            stack.enter_context(folder_lock(self.folder, CLOSE))
            self.file.keep_open()
            stack.callback(self.file.close)
            self._restore(self.file.setting("live") or {})
            # without a plan, or one that is damaged
            with suppress(InvalidInput, TypeError, ValueError):
                self.plan = LivePlan(**self.file.setting("plan"))
            for sample in self.file.messages():
                self._process(sample, self._judge_arrival(sample))
                self._messages += 1
                self.received_s = sample.received_s
            if self._messages:
                self._listening_s = self.now_s()
            self.counts = {"new": 0, "doubled": 0, "late": 0, "faulty": 0}
            self._store_ended_trips()
            self.erase_old(self.now_s())
            self._open = stack.pop_all()

    def record(self, sample: Sample, *, now_s: float | None = None) -> Arrival:
        """Take a sample; a new or held one is in the file when this returns. O(1) amortised.

        Parameters
        ----------
        sample : Sample
            What the car sent.
        now_s : float, optional
            The time by our clock [s since 1970].

        Returns
        -------
        {"new", "doubled", "late", "held"}
            Only a new sample is used. A held one is used once later samples confirm that the clock of the sender was set.

        Raises
        ------
        InvalidInput
            When the clock of the sender is not known yet, and the sample's time is ahead of our clock by more than `FAR_S`.
        OSError
            When the sample cannot be written; send it again.
        """
        now_s = self.now_s() if now_s is None else now_s
        if self._sender.offset_s is None and sample.time_s > now_s + FAR_S:
            got = f"{sample.time_s - now_s:.0f} s ahead"
            allowed, fix = f"at most {FAR_S:g} s ahead of our clock", "set the clock of the sender"
            raise InvalidInput.of("time in the future", "utc", got, allowed, fix)
        sample = replace(sample, received_s=now_s)
        arrival = self._judge_arrival(sample)
        self.counts["faulty"] += bool(sample.faults)
        if arrival in ("new", "held"):
            with self.file.write() as db:
                db.put_messages([sample])
            self._messages += 1
        self._process(sample, arrival)
        self.received_s = now_s
        self._store_ended_trips()
        return "new" if arrival == "held" and not self._sender.held else arrival

    def count_faulty(self) -> None:
        """Count a message that is no sample."""
        self.counts["faulty"] += 1

    def _shift_times(self, by_s: float) -> None:
        trip = self.trip
        before_s = math.nan if trip is None else trip.start_s
        super()._shift_times(by_s)
        self._usual = None
        if trip is not None:
            with self.file.write() as db:
                db.execute("UPDATE forecasts SET start_s = ? WHERE start_s = ?", (trip.start_s, before_s))

    def end_when_silent(self, now_s: float) -> bool:
        """End the trip if the car sent nothing for `SILENCE_S` by our clock while this process listened; erase old data hourly.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        bool
            Whether a trip has ended.

        Raises
        ------
        OSError
            As in `finish_trip`.
        """
        if now_s - self._erased_s > 3600.0:
            self._erased_s = now_s
            self.erase_old(now_s)
        if self.received_s is None or now_s - max(self.received_s, self._listening_s) < SILENCE_S:
            return False
        return self.finish_trip()

    def finish_trip(self) -> bool:
        """End the trip that the car is on, and store it as a log.

        Returns
        -------
        bool
            Whether a trip has ended.

        Raises
        ------
        OSError
            When the trip cannot be written; the next sample tries again.
        """
        self._release()
        self._find_trips(self._ordered.release(), to_end=True)
        has_ended = bool(self.ended)
        self._store_ended_trips()
        return has_ended

    def _store_ended_trips(self) -> None:
        """Write ended trips, and forget their plan and their samples, in one transaction."""
        has_ended = bool(self.ended)
        needed = [*self._finder.before, *self._ordered.waiting, *self._sender.held]
        # while the car is on a trip again, its samples are needed to find it after a restart
        shorten = self.trip is None and (has_ended or self._messages > 2 * len(needed) + SLACK_MESSAGES)
        if not has_ended and not shorten:
            return
        with self.file.write() as db:
            stored = [trip for trip in self.ended if self._store_trip(db, trip)]
            plan = self.plan
            if plan is not None and any((plan.given_s or 0.0) <= trip.moved_s for trip in stored):
                db.put_settings({"plan": None})
                plan = None
            if shorten:
                db.execute("DELETE FROM messages")
                db.put_messages(needed)
                db.put_settings({"live": self._state_before_samples()})
        self.ended.clear()
        self._plans += plan is not self.plan
        self.plan = plan
        self._messages = len(needed) if shorten else self._messages
        if has_ended:
            self.file.checkpoint()
            self.finished()

    def _store_trip(self, db: Database, trip: LiveTrip) -> bool:
        """Write an ended trip as a log and return True; if it is too short, delete its forecasts and return False."""
        table = table_of(trip.columns(until_s=trip.moved_s))
        started = dt.datetime.fromtimestamp(int(trip.start_s), dt.UTC)
        context = Context(started_at=started.astimezone().replace(tzinfo=None))
        log = None
        if trip.distance_m >= MIN_M and len(table) >= MIN_ROWS:
            log = or_none(Log.from_samples, f"{self.name}-{started:%Y%m%dT%H%M%SZ}", table, context)
        if log is None:
            db.execute("DELETE FROM forecasts WHERE start_s = ?", (trip.start_s,))
            return False
        db.put_logs([row_of_log(log)], start_s=trip.start_s)
        return True

    def erase_old(self, now_s: float) -> int:
        """Erase data older than `keep_days`: finished trips by their departure, and the samples of a car that fell silent.

        The trip that the car is on stays, and so does the log of a finished trip that was learned. O(finished trips).

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        int
            Number of trips that were erased.

        Examples
        --------
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder, LiveCar(folder) as car:
        ...     car.erase_old(1.8e9)
        0
        """
        before_s = now_s - self.keep_days * SECONDS_PER_DAY
        is_silent = self.received_s is not None and self.received_s < before_s and self.trip is None
        old = len(self.file.departures(before_s))
        if not old and not (is_silent and self._messages):
            return 0
        with self.file.write() as db:
            db.execute(
                "DELETE FROM forecasts WHERE start_s IN (SELECT start_s FROM trips WHERE start_s < ?)",
                (before_s,),
            )
            db.execute("DELETE FROM trips WHERE start_s < ? AND NOT is_learned", (before_s,))
            db.execute("UPDATE trips SET start_s = NULL WHERE start_s < ?", (before_s,))
            if is_silent:
                db.execute("DELETE FROM messages")
                self._soc = self._parked = None
                known = {**self._state_before_samples(), "after_s": self._ordered.newest_s}
                db.put_settings({"live": known})
                self._messages = 0
        self.file.checkpoint()
        self._usual = None
        return old

    @property
    def present_plan(self) -> LivePlan | None:
        """The plan that was given, else the road of the usual trip; O(finished trips) when it is first read on a trip.

        None without either, and if the car has driven further than `LONGER` allows.
        """
        trip = self.trip
        if self.plan is not None or trip is None:
            return self.plan
        if self._usual is None or self._usual[0] != trip.start_s:
            self._usual = trip.start_s, self.plan_at(trip.start_s)
        plan = self._usual[1]
        return None if plan is None or trip.distance_m > LONGER * plan.road.distance_m else plan

    def usual_trip_at(self, start_s: float) -> Log | None:
        """Find the finished trip whose departure is nearest by time of day to another departure. O(finished trips).

        Parameters
        ----------
        start_s : float
            The departure [s since 1970].

        Returns
        -------
        Log or None
            None if no departure is within `NEAR_S`.
        """
        usual_s = usual_departure(self.file.departures(start_s), start_s)
        return None if usual_s is None else self.file.logs("start_s = ?", usual_s)[0]

    def plan_at(self, departure_s: float) -> LivePlan | None:
        """Return the plan of a trip that departs at `departure_s` [s since 1970]: the given one, else that of the usual trip."""
        trip = None if self.plan is not None else self.usual_trip_at(departure_s)
        return self.plan if trip is None else LivePlan.from_trip(trip)

    def usual_plan(self, trip_id: str) -> Plan:
        """Return the plan to drive a trip again: its road and its speeds, without what was known at its departure.

        Parameters
        ----------
        trip_id : str
            Name of one of the trips.

        Returns
        -------
        Plan
            For `need` or `ForecastModel.forecast`.

        Raises
        ------
        InvalidInput
            When the car has no sound trip of this name.
        """
        logs = self.file.logs("trip_id = ?", trip_id)
        trips = audit(TripSet(self.name, logs)).trips if logs else ()
        if not trips:
            raise InvalidInput.of(
                "no such trip", "trip", trip_id[:60], f"a sound trip of the car {self.name}"
            )
        return replace(Plan.from_trip(trips[0]), departure=Departure())

    def set_plan(self, request: Mapping[str, Any] | None, departure_s: float | None = None) -> None:
        """Set the plan of the trip that the car is on, or else of its next trip; None removes the plan.

        The plan is kept until its trip has ended.

        Parameters
        ----------
        request : mapping or None
            Fields of a request for a forecast, see `LivePlan`.
        departure_s : float, optional
            Departure on the clock of the plan [s since 1970]. Earlier samples are ignored.

        Raises
        ------
        OSError
            When the plan cannot be written.
        """
        given_s = self._ordered.newest_s if self._ordered.newest_s > 0.0 else None
        plan = None if request is None else LivePlan(request, departure_s, given_s)
        with self.file.write() as db:
            db.put_settings({"plan": None if plan is None else asdict(plan)})
        self.plan, self._plans = plan, self._plans + 1

    def forecasts_of(self, trip_id: str) -> tuple[MadeForecast, ...]:
        """Return the forecasts made during a finished trip on the road, by the name of its log; none for another name."""
        return self.file.forecasts("(SELECT start_s FROM trips WHERE trip_id = ?)", trip_id)

    @property
    def forecasts(self) -> tuple[MadeForecast, ...]:
        """Stored forecasts of the trip that the car is on; empty without a trip."""
        return () if self.trip is None else self.file.forecasts("?", self.trip.start_s)

    @property
    def wants_forecast(self) -> bool:
        """Whether a forecast made now is due to be stored with the trip."""
        trip, forecasts = self.trip, self.forecasts
        if trip is None or not forecasts:
            return trip is not None
        return trip.last_s - trip.start_s - forecasts[-1].at_s >= EVERY_S and len(forecasts) < MAX_FORECASTS

    def close(self) -> None:
        """Close the car's file and unlock its folder, so that another process can follow the car."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def require_valid_name(folder: Path) -> None:
    """Check the name of the folder of a car.

    Raises
    ------
    InvalidInput
        When the folder's name is not a valid car name.
    """
    if VALID_NAME.fullmatch(folder.name) is None:
        allowed = "up to 64 letters, digits, '.', '_' and '-'"
        raise InvalidInput.of("name cannot be used", f"{folder}", folder.name, allowed)


def make_car_folder(folder: Path) -> None:
    """Create the folder of a car if it is missing.

    Raises
    ------
    InvalidInput
        When the folder's name is not a valid car name, or the folder cannot be created.
    """
    require_valid_name(folder)
    with system_errors("cannot write the folder", f"{folder}", "a writable folder"):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
