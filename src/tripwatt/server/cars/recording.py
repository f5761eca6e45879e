"""What a car sends is kept: its samples as they arrive, the trip that it is on, its plan, and the trips that it has finished."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Self

import pandas as pd

from tripwatt.errors import Fault, InvalidInput, or_none
from tripwatt.files import folder_lock
from tripwatt.server.cars.documents import LiveMessages
from tripwatt.server.cars.folder import (
    FORECASTS,
    erase_trips,
    finished_logs,
    finished_names,
    keep_trip,
    live_folder,
    started_at,
)
from tripwatt.server.cars.journal import Charge, Journal, charge_of
from tripwatt.server.cars.live_trip import LEAST_M, SILENCE_S, LiveTrip, TripFinder
from tripwatt.server.cars.on_the_way import OnTheWay
from tripwatt.server.cars.ordering import Arrival, OrderedSamples, Place
from tripwatt.server.cars.own_car import JOURNAL, LIVE
from tripwatt.server.cars.plan import PLAN, LivePlan
from tripwatt.server.cars.sender import Sender, steady_clock
from tripwatt.server.cars.telemetry import CHARGES, Sample, number_of
from tripwatt.server.cars.usual import LONGER, usual_departure
from tripwatt.trips import Context, Departure, Log
from tripwatt.trips.departure import FIRST_S
from tripwatt.trips.samples import Sampled
from tripwatt.units import SECONDS_PER_DAY

FAR_S: Final = 366.0 * SECONDS_PER_DAY
"""No clock of ours is slow by more [s]."""

LEAST_ROWS: Final = 3
"""Fewest samples of a table that can be read again."""

AIR: Final = ("air_s", "air_degc")

ERASE_EVERY_S: Final = 3600.0

SLACK_LINES: Final = 1000
"""Lines that the journal of a standing car may hold beyond those that count."""


class Recorder:
    """From samples to trips: what a car sends is written before it counts, and a trip that has ended becomes a table.

    Parameters
    ----------
    folder : Path or str
        Of the car, whose name is that of the folder.
    keep_days : float
        Days that finished trips, and samples of a car that is silent, stay on disk; older ones are erased now and every hour.

    Attributes
    ----------
    counts : dict of str to int
        Samples since the car was opened: `new`, `doubled` and `late`, which are also those whose time fits no clock of the sender.
    now_s : callable
        Returns the time by our clock [s since 1970], which goes on steadily when that of the machine is set.
    received_s : float or None
        When the last message came [s since 1970, by our clock].
    plan : LivePlan or None
        The plan that was given for the trip that the car is on, or for its next one.

    Raises
    ------
    InvalidInput
        When its name cannot be one, it cannot be written, its plan is damaged, or another process has it open.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder, Recorder(f"{folder}/leaf") as car:
    ...     print(car.name, car.trip, car.counts)
    leaf None {'new': 0, 'doubled': 0, 'late': 0}
    """

    def __init__(self, folder: Path | str, *, keep_days: float = math.inf) -> None:
        self.folder = Path(folder).absolute()
        self.name = self.folder.name
        self.keep_days = keep_days
        self.counts: LiveMessages = {"new": 0, "doubled": 0, "late": 0}
        self._finder = TripFinder()
        self._ended: list[LiveTrip] = []
        # departure of a trip, its usual trip, and the road of that
        self._usual: tuple[float, Log | None, LivePlan | None] | None = None
        # time, field of a departure and charge of the latest sample that has one, and of the latest one before the trip
        self._soc: Charge | None = None
        self._parked: Charge | None = None
        self._erased_s = -math.inf
        self._plans = 0
        self.now_s = steady_clock()
        # start and departure of a trip, and what its first samples show
        self._first: tuple[tuple[float, float], Departure] | None = None
        with ExitStack() as stack:
            live = live_folder(self.folder)
            stack.enter_context(folder_lock(live))
            self._journal = Journal(live / JOURNAL)
            stack.callback(self._journal.close)
            self._ordered = OrderedSamples(self._journal.after_s)
            offset_s = number_of(self._journal.more.get("offset_s"))
            self._sender = Sender(None if math.isnan(offset_s) else offset_s)
            self._soc, self._parked = charge_of(self._journal.more.get("charge"))
            # time and value of the latest outside temperature
            self._air = tuple(number_of(self._journal.more.get(name)) for name in AIR)
            self.plan = LivePlan.read(live)
            self._on_the_way = OnTheWay(live / FORECASTS)
            for sample in self._journal.read():
                self._take(sample, self._arrival(sample))
            self.counts = {"new": 0, "doubled": 0, "late": 0}
            self.received_s = self._journal.written_s if self._journal.lines else None
            self._listening_s = self.now_s() if self._journal.lines else -math.inf
            self._finish()
            self.erase_old(self.now_s())
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
        {"new", "doubled", "late", "held"}
            Only a new sample counts. One that is held counts when later ones confirm that the clock of the sender was set.

        Raises
        ------
        InvalidInput
            When the clock of the sender is not known yet, and the time is ahead of ours by more than `FAR_S`.
        OSError
            When it cannot be written; send it again.
        """
        now_s = self.now_s() if now_s is None else now_s
        if self._sender.offset_s is None and sample.time_s > now_s + FAR_S:
            got = f"{sample.time_s - now_s:.0f} s ahead"
            allowed, fix = f"at most {FAR_S:g} s ahead of our clock", "set the clock of the sender"
            raise InvalidInput.of("time in the future", "utc", got, allowed, fix)
        sample = replace(sample, received_s=now_s)
        arrival = self._arrival(sample)
        if arrival in ("new", "held"):
            self._journal.append(sample)
        self._take(sample, arrival)
        self.received_s = now_s
        self._finish()
        return "new" if arrival == "held" and not self._sender.held else arrival

    def _arrival(self, sample: Sample) -> Arrival:
        arrival = self._ordered.arrival(sample)
        late = arrival == "late"
        if late and self.trip is not None and self.trip.has(sample):
            return "doubled"
        return arrival if arrival == "doubled" or self._sender.fits(sample, late=late) else "held"

    def _take(self, sample: Sample, arrival: Arrival) -> None:
        sender = self._sender
        if arrival == "held":
            if not sender.takes(sample):
                self._release()
            sender.held.append(sample)
            if sender.was_set:
                by_s, held = sender.set_clock(self._ordered.newest_s)
                self._move(by_s)
                for one in held:
                    self._count(one, self._ordered.arrival(one))
            return
        if arrival == "new":
            sender.go_on(sample)
        self._count(sample, arrival)
        if sender.was_not_set:
            self._release()

    def _release(self) -> None:
        """Count the samples that were held, for which there is a gap in the trip: they come from a time without a network."""
        for sample in self._sender.release():
            arrival = self._ordered.arrival(sample)
            if arrival == "late" and self.trip is not None and self.trip.insert(sample):
                self.counts["new"] += 1
            else:
                self.counts["late"] += 1
                if arrival == "new" or self.trip is not None:  # else it is of a trip that has ended
                    self._sender.contradict(sample)

    def _move(self, by_s: float) -> None:
        """Give all samples so far the times that the clock of the sender has now."""
        trip = self.trip
        before_s = None if trip is None else trip.start_s
        self._ordered.move(by_s)
        self._finder.move(by_s)
        if trip is not None and before_s is not None:
            self._on_the_way.move(before_s, trip.start_s)
        self._soc, self._parked = (one and (one[0] + by_s, *one[1:]) for one in (self._soc, self._parked))
        self._air = self._air[0] + by_s, self._air[1]
        self._usual = self._first = None

    def _count(self, sample: Sample, arrival: Place) -> None:
        self.counts[arrival] += 1
        if arrival != "new":
            return
        field = next((name for name, column in CHARGES.items() if column in sample.values), None)
        if field is not None and (self._soc is None or sample.time_s >= self._soc[0]):
            self._soc = sample.time_s, field, sample.values[CHARGES[field]]
            self._parked = self._soc if self.trip is None else self._parked
        air_degc = sample.values.get("ambient_temperature_degc")
        if air_degc is not None and not sample.time_s < self._air[0]:
            self._air = sample.time_s, air_degc
        self._ordered.insert(sample)
        self._follow(self._ordered.ready())

    def _follow(self, samples: list[Sample]) -> None:
        for sample in samples:
            self._end(self._finder.add(sample))

    def _end(self, trip: LiveTrip | None) -> None:
        if trip is not None:
            self._ended.append(trip)
            self._parked = self._soc if self._soc is not None and self._soc[0] >= trip.moved_s else None

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
        self._release()
        self._follow(self._ordered.rest())
        self._end(self._finder.end())
        done = bool(self._ended)
        self._finish()
        return done

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
        >>> with tempfile.TemporaryDirectory() as folder, Recorder(f"{folder}/leaf", keep_days=90.0) as car:
        ...     car.erase_old(1.8e9)
        0
        """
        before_s = now_s - self.keep_days * SECONDS_PER_DAY
        if before_s == -math.inf:
            return 0
        erased = erase_trips(self.folder, before_s)
        silent = self.received_s is not None and self.received_s < before_s
        if silent and self.trip is None and self._journal.lines:
            self._soc = self._parked = None
            self._rewrite([], self._ordered.newest_s)
        if erased:
            self._usual = None
        return erased

    def _finish(self) -> None:
        """Write ended trips, forget their plan and their samples. Whatever a killed process left undone is done again."""
        done = bool(self._ended)
        while self._ended:
            self._keep(self._ended[0])
            del self._ended[0]
        if self.trip is not None:
            return  # a trip has begun already: the journal is shortened after it
        waiting = len(self._finder.before) + len(self._ordered.waiting) + len(self._sender.held)
        if done or self._journal.lines > 2 * waiting + SLACK_LINES:
            rest = [*self._finder.before, *self._ordered.waiting]
            after_s = math.nextafter(rest[0].time_s, -math.inf) if rest else self._ordered.given_s
            self._rewrite([*rest, *self._sender.held], after_s)

    def _rewrite(self, samples: list[Sample], after_s: float) -> None:
        charge = None if self._soc is None else [*self._soc, self._parked is not None]
        more = {"offset_s": self._sender.offset_s, "charge": charge, **dict(zip(AIR, self._air, strict=True))}
        self._journal.rewrite(samples, after_s, more)

    def _keep(self, trip: LiveTrip) -> None:
        table = trip.table(until_s=trip.moved_s)
        if trip.distance_m < LEAST_M or len(table) < LEAST_ROWS:
            return
        keep_trip(self.folder, trip.start_s, table, self._on_the_way.of(trip.start_s))
        plan = self.plan
        if plan is not None and (plan.given_s is None or plan.given_s <= trip.moved_s):
            self.set_plan(None)

    def observed(self, start_s: float = 0.0) -> pd.DataFrame:
        """Tabulate what the car measured on its trip so far, also what waits for late samples. O(samples of the trip).

        Parameters
        ----------
        start_s : float
            Time of the departure in the table [s].

        Returns
        -------
        DataFrame
            Canonical columns; without rows where the car is on no trip.
        """
        if self.trip is None:
            return pd.DataFrame({"time_s": [], "speed_m_s": []}, dtype="float64")
        return self.trip.table(self._ordered.waiting, since_s=self._since_s(self.trip), start_s=start_s)

    def _since_s(self, trip: LiveTrip) -> float:
        """Departure of a trip: that of its plan, else its start [s since 1970]."""
        given = None if self.plan is None else self.plan.departure_s
        return trip.start_s if given is None else given

    def departure(self) -> Departure:
        """Collect what the car's samples show of the departure.

        Returns
        -------
        Departure
            Of the first values on a trip, of the latest ones before it; without payload and without whether it follows a trip.
            A charge holds while the car stands, however long: senders repeat only what changes.
        """
        trip = self.trip
        of = None if trip is None else (trip.start_s, self._since_s(trip))
        if self._first is not None and self._first[0] == of:
            return self._first[1]
        table = self.observed()
        if not len(table):
            latest: dict[str, float] = {}
            for sample in (*self._finder.before, *self._ordered.waiting):
                latest |= sample.values
            table = pd.DataFrame([{"time_s": 0.0, "speed_m_s": 0.0, **latest}], dtype="float64")
        seen = Departure.from_first_sample(Sampled(self.name, table), Context())
        departure = replace(seen, payload_mass_kg=None, follows_trip=None)
        if departure.soc is None and departure.bms_soc is None and self._parked is not None:
            departure = departure.merge(Departure(**{self._parked[1]: self._parked[2]}))  # type: ignore[arg-type]
        settled_s = float(table["time_s"].iloc[0]) + FIRST_S
        if trip is not None and of is not None and trip.last_s - of[1] > settled_s:
            self._first = of, departure  # no sample that comes now can change it
        return departure

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
            log = self.usual_trip_at(trip.start_s)
            self._usual = trip.start_s, log, None if log is None else LivePlan.from_trip(log)
        log = self._usual[1]
        return None if log is None or trip.distance_m > LONGER * log.distance_m else log

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
        names = {started_at(name).timestamp(): name for name in finished_names(self.folder)}
        usual = usual_departure((other for other in names if other < start_s), start_s)
        logs = None if usual is None else or_none(finished_logs, self.folder, [names[usual]])
        return None if logs is None else logs[0]

    def plan_at(self, departure_s: float) -> LivePlan | None:
        """The plan of a trip that departs at a time [s since 1970]: the one that was given, else the road of the usual trip."""
        trip = None if self.plan is not None else self.usual_trip_at(departure_s)
        return self.plan if trip is None else LivePlan.from_trip(trip)

    def set_plan(self, request: Mapping[str, Any] | None, departure_s: float | None = None) -> None:
        """Give the plan of the trip that the car is on, or of its next one; None takes it away.

        It is kept until its trip has ended.

        Parameters
        ----------
        request : mapping or None
            Fields of a request for a forecast, see `LivePlan`.
        departure_s : float, optional
            Departure on the clock of the plan [s since 1970]. Earlier samples do not count.
        """
        plan = None
        if request is None:
            (self.folder / LIVE / PLAN).unlink(missing_ok=True)
        else:
            newest_s = self._ordered.newest_s
            plan = LivePlan(request, departure_s, newest_s if newest_s > 0.0 else None)
            plan.write(self.folder / LIVE)
        self.plan, self._plans = plan, self._plans + 1

    def logs(self) -> tuple[Log, ...]:
        """Read the finished trips.

        Returns
        -------
        tuple of Log
            In the order of their departure, as `Car.add` takes them.
        """
        return finished_logs(self.folder)

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
            "car": self.name,
            "seconds_since_message": None if self.received_s is None else max(0.0, now_s - self.received_s),
            "messages": self.counts.copy(),
            "held": len(self._sender.held),
            "soc": self._soc[2] if self._soc is not None and self._soc[1] == "soc" else None,
            "soc_source": None if self._soc is None else self._soc[1],
            "trip": None
            if trip is None
            else {
                "departs_at": dt.datetime.fromtimestamp(trip.start_s, dt.UTC).isoformat(),
                "duration_s": trip.last_s - trip.start_s,
                "distance_m": trip.distance_m,
                "samples": len(trip),
            },
        }

    def mixed(self, now_s: float) -> list[dict[str, str]]:
        """Fault of messages that look like those of two senders, for `SILENCE_S` after the last of them.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        list of dict
            Empty where there is one sender.
        """
        if now_s - self._sender.mixed_s >= SILENCE_S:
            return []
        allowed, fix = "the messages of one sender", "make another token for the other one"
        return [Fault("two senders", "utc", self.name, allowed, fix).texts]

    def close(self) -> None:
        """Leave the car to another process."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
