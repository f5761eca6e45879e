"""From samples to trips, in memory: choose the samples that count, order them, and find their trip."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from tripwatt.errors import Fault
from tripwatt.forecasting.measured import Columns, measured_energy
from tripwatt.server.cars.documents import LiveMessages
from tripwatt.server.cars.live_trip import HOLD_S, SILENCE_S, LiveTrip, TripFinder
from tripwatt.server.cars.plan import LivePlan
from tripwatt.server.cars.sender import Arrival, OrderedSamples, Place, Sender
from tripwatt.server.cars.telemetry import CHARGES, Sample
from tripwatt.trips import Context, Departure
from tripwatt.trips.departure import FIRST_S
from tripwatt.trips.samples import Sampled, table_of

Charge = tuple[float, str, float]
"""Time [s since 1970], field of a departure (`soc` or `bms_soc`), and state of charge."""


class Recorder:
    """What the samples of one car show: its charge, and the trip that it is on.

    Parameters
    ----------
    name : str
        Name of the car.

    Attributes
    ----------
    counts : dict of str to int
        Number of samples that were `new`, `doubled`, `late` or `faulty` (no sample, or with a value that cannot be one); a sample whose time fits no clock of the sender counts as `late`.
    received_s : float or None
        Arrival of the last message by our clock [s since 1970]; None before the first one.
    ended : list of LiveTrip
        Trips that have ended and are not written yet.
    plan : LivePlan or None
        The plan that was given for the trip that the car is on, or for its next one.

    Examples
    --------
    >>> seen = Recorder("leaf")
    >>> for k in range(4):
    ...     sample = Sample(1.7e9 + 10.0 * k, {"speed_m_s": 10.0, "displayed_soc": 0.8})
    ...     seen._process(sample, seen._judge_arrival(sample))
    >>> seen.counts["new"], seen.observed().shape, seen.departure().soc
    (4, (4, 3), 0.8)
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.plan: LivePlan | None = None
        self.counts: LiveMessages = {"new": 0, "doubled": 0, "late": 0, "faulty": 0}
        self.received_s: float | None = None
        self.ended: list[LiveTrip] = []
        self._finder = TripFinder()
        # start and departure [s since 1970] of a trip, and what its first samples show of the departure
        self._departure_of_trip: tuple[tuple[float, float], Departure] | None = None
        self._restore({})

    def _restore(self, state: Mapping[str, Any]) -> None:
        """Restore what samples that are no longer kept have shown, from the result of `_state_before_samples`."""
        self._ordered = OrderedSamples(state.get("after_s", -math.inf))
        self._sender = Sender(state.get("offset_s"))
        # time, field of a departure and charge of the latest sample that has one, and of the latest one before the trip
        charge = state.get("charge")
        self._soc: Charge | None = None if charge is None else tuple(charge)
        self._parked: Charge | None = self._soc if state.get("parked") else None
        # time and value of the latest outside temperature
        self._air: tuple[float, float] = tuple(state.get("air", (math.nan, math.nan)))

    @property
    def trip(self) -> LiveTrip | None:
        """The trip that the car is on; its start is detected once no earlier sample can arrive."""
        return self._finder.trip

    def _judge_arrival(self, sample: Sample) -> Arrival:
        arrival = self._ordered.arrival(sample)
        late = arrival == "late"
        if late and self.trip is not None and self.trip.has(sample):
            return "doubled"
        return arrival if arrival == "doubled" or self._sender.fits(sample, is_late=late) else "held"

    def _process(self, sample: Sample, arrival: Arrival) -> None:
        sender = self._sender
        if arrival == "held":
            if not sender.can_hold(sample):
                self._release()
            sender.held.append(sample)
            if sender.clock_was_set:
                by_s, held = sender.adopt_clock(self._ordered.newest_s)
                self._shift_times(by_s)
                for held_sample in held:
                    self._use_sample(held_sample, self._ordered.arrival(held_sample))
            return
        if arrival == "new":
            sender.accept(sample)
        self._use_sample(sample, arrival)
        if sender.clock_was_kept:
            self._release()

    def _release(self) -> None:
        """Release the held samples; those that fit a gap in the trip, from a time without a network, count as new."""
        for sample in self._sender.release():
            arrival = self._ordered.arrival(sample)
            if arrival == "late" and self.trip is not None and self.trip.insert(sample):
                self.counts["new"] += 1
            else:
                self.counts["late"] += 1
                if arrival == "new" or self.trip is not None:  # else it is of a trip that has ended
                    self._sender.add_stray(sample)

    def _shift_times(self, by_s: float) -> None:
        """Shift all samples so far to the new clock of the sender."""
        self._ordered.shift_times(by_s)
        self._finder.shift_times(by_s)
        self._soc, self._parked = (old and (old[0] + by_s, *old[1:]) for old in (self._soc, self._parked))
        self._air = self._air[0] + by_s, self._air[1]
        self._departure_of_trip = None

    def _use_sample(self, sample: Sample, arrival: Place) -> None:
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
        self._find_trips(self._ordered.release_ready())

    def _find_trips(self, samples: list[Sample], *, to_end: bool = False) -> None:
        """Find trips in samples; `to_end` if no more samples arrive, which ends a trip."""
        found = [*map(self._finder.add, samples), self._finder.end() if to_end else None]
        for trip in (trip for trip in found if trip is not None):
            self.ended.append(trip)
            self._parked = self._soc if self._soc is not None and self._soc[0] >= trip.moved_s else None

    def _state_before_samples(self) -> dict[str, Any]:
        """Return what samples have shown that are dropped when the car is on no trip and only the samples before a trip are kept."""
        waiting = [*self._finder.before, *self._ordered.waiting]
        after_s = math.nextafter(waiting[0].time_s, -math.inf) if waiting else self._ordered.released_s
        return {
            "after_s": after_s,
            "offset_s": self._sender.offset_s,
            "charge": self._soc,
            "parked": self._parked is not None,
            "air": self._air,
        }

    def measured(self, start_s: float = 0.0) -> Columns:
        """Return what the car measured on its trip so far, including samples that wait for late ones. O(samples of the trip).

        Parameters
        ----------
        start_s : float
            Time of the departure in the result [s].

        Returns
        -------
        mapping of str to ndarray, shape (samples,)
            Canonical columns; no samples if the car is on no trip.
        """
        if self.trip is None:
            return {"time_s": np.empty(0), "speed_m_s": np.empty(0)}
        columns = self.trip.columns(self._ordered.waiting, since_s=self._since_s(self.trip))
        return {**columns, "time_s": columns["time_s"] + start_s}

    def observed(self, start_s: float = 0.0) -> pd.DataFrame:
        """Tabulate what `measured` returns, one row per sample."""
        return table_of(self.measured(start_s))

    def _since_s(self, trip: LiveTrip) -> float:
        """Return the departure of a trip [s since 1970]: that of its plan, else its start."""
        departure_s = None if self.plan is None else self.plan.departure_s
        return trip.start_s if departure_s is None else departure_s

    def departure(self) -> Departure:
        """Collect what the car's samples show of the departure.

        Returns
        -------
        Departure
            From the first values of a trip, or from the latest values before a trip. Payload and `follows_trip` are unknown.
            A charge stays valid as long as the car stands, because senders repeat only what changes.
        """
        trip = self.trip
        key = None if trip is None else (trip.start_s, self._since_s(trip))
        if self._departure_of_trip is not None and self._departure_of_trip[0] == key:
            return self._departure_of_trip[1]
        table = self.observed()
        if not len(table):
            standing = (*self._finder.before, *self._ordered.waiting)
            latest = dict(value for sample in standing for value in sample.values.items())
            table = pd.DataFrame([{"time_s": 0.0, "speed_m_s": 0.0, **latest}], dtype="float64")
        first_values = Departure.from_first_sample(Sampled(self.name, table), Context())
        departure = replace(first_values, payload_mass_kg=None, follows_trip=None)
        if departure.soc is None and departure.bms_soc is None and self._parked is not None:
            departure = departure.merge(Departure(**{self._parked[1]: self._parked[2]}))  # type: ignore[arg-type]
        settled_s = float(table["time_s"].iloc[0]) + FIRST_S
        if trip is not None and key is not None and trip.last_s - key[1] > settled_s:
            self._departure_of_trip = key, departure  # no sample that comes now can change it
        return departure

    def shown(self, now_s: float) -> dict[str, Any]:
        """Return what the messages of the car show.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        dict
            Fields of `LiveResponse` that need no forecast, as plain values; `trip` is None if the car is on no trip. O(samples of
            the trip).
        """
        trip = self.trip
        return {
            "car": self.name,
            "seconds_since_message": None if self.received_s is None else max(0.0, now_s - self.received_s),
            "messages": self.counts.copy(),
            "held": len(self._sender.held),
            "soc": self._soc[2] if self._soc is not None and self._soc[1] == "soc" else None,
            "soc_source": None if self._soc is None else self._soc[1],
            "trip": None if trip is None else self._about(trip),
        }

    def _about(self, trip: LiveTrip) -> dict[str, Any]:
        """Return the `LiveTripDocument` of a trip, including samples that wait for late ones."""
        measured = trip.columns(self._ordered.waiting)
        time_s, speed_m_s = measured["time_s"], measured["speed_m_s"]
        driven_m = 0.5 * (speed_m_s[1:] + speed_m_s[:-1]) @ np.minimum(np.diff(time_s), HOLD_S)
        power_w = measured["voltage_v"] * measured["current_a"] if "current_a" in measured else None
        found = {"energy_wh": measured_energy(measured), "power_w": power_w}
        known = {n: [] if v is None else v[np.isfinite(v)][-1:].tolist() for n, v in found.items()}
        return {
            "departs_at": dt.datetime.fromtimestamp(trip.start_s, dt.UTC).isoformat(),
            "duration_s": float(time_s[-1]),
            "distance_m": float(driven_m),
            "samples": len(time_s),
            **{name: values[-1] if values else None for name, values in known.items()},
        }

    def mixed(self, now_s: float) -> list[dict[str, str]]:
        """Return the fault of messages that seem to come from two senders, until `SILENCE_S` after the last of them.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        list of dict
            One fault; empty if the messages come from one sender.
        """
        if now_s - self._sender.mixed_s >= SILENCE_S:
            return []
        allowed, fix = "the messages of one sender", "make another token for the other one"
        return [Fault("two senders", "utc", self.name, allowed, fix).texts]
