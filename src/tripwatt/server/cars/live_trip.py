"""The trip that a car is on: detected from its motion, with its samples stored by column."""

from __future__ import annotations

import bisect
import itertools
import math
from array import array
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from tripwatt.arrays import hold_last
from tripwatt.forecasting.measured import Columns
from tripwatt.server.cars.telemetry import FIRST_TIME_S, LAST_TIME_S, Sample, shifted
from tripwatt.trips import MAX_DURATION_S

MOVING_M_S: Final = 1.0
"""Speed from which a car drives [m/s]; satellite positioning shows a parked car at up to about half of this speed."""

BEFORE_S: Final = 180.0
"""Longest standstill before the first motion that belongs to a trip [s]: the car is switched on. In the TUM set such
standstills take up to 154 s."""

STANDING_S: Final = 300.0
"""A standstill of this length ends a trip [s]: longer than a traffic light, a barrier or a short jam."""

PARKED_S: Final = 60.0
"""A standstill of this length ends a trip if the gear is in park [s]. A choice."""

SILENCE_S: Final = 600.0
"""A trip ends if the car sends nothing for this long [s]: a tunnel or a dead spot is shorter."""

MIN_M: Final = 200.0
"""A shorter drive is no trip [m]: the car was moved, or the positioning was wrong. A choice."""

HOLD_S: Final = 10.0
"""A speed is held for up to this long if later messages have none [s]. A choice."""

MAX_SAMPLES: Final = 40_000
"""Most stored samples of a trip: 11 h at 1 Hz. At this number every other sample is dropped, and later ones are thinned alike."""

GAP_STEPS: Final = 1.5
"""A late sample is used if its neighbours are at least this many median time steps of the trip apart; others are doubles or strays. A choice."""

_MAX_BEFORE: Final = 2000
"""Most samples of a standing car that are kept: 10 Hz for `BEFORE_S`."""


class LiveTrip:
    """The samples of one trip so far, in the order of their times.

    Parameters
    ----------
    samples : sequence of Sample
        The first samples.

    Attributes
    ----------
    start_s : float
        Time of the first sample [s since 1970].
    moved_s : float
        Time of the last sample in motion [s since 1970].
    stood_s : float
        Start of the present standstill, as far as samples show it [s since 1970]; infinite while the car drives.
    distance_m : float
        Distance driven so far [m].

    Examples
    --------
    >>> trip = LiveTrip([Sample(1.7e9, {"speed_m_s": 10.0})])
    >>> trip.append(Sample(1.7e9 + 1.0, {"speed_m_s": 12.0}))
    >>> trip.distance_m
    11.0
    >>> trip.columns()["speed_m_s"].tolist()
    [10.0, 12.0]
    >>> trip.append(Sample(1.7e9 + 4.0, {"speed_m_s": 12.0}))
    >>> trip.insert(Sample(1.7e9 + 2.0, {"speed_m_s": 12.0})), trip.has(Sample(1.7e9 + 2.0, {"speed_m_s": 12.0}))
    (True, True)
    >>> trip.shift_times(3600.0)
    >>> trip.start_s
    1700003600.0
    """

    def __init__(self, samples: Sequence[Sample]) -> None:
        self.start_s = samples[0].time_s
        self.moved_s = self.last_s = -math.inf
        self.stood_s = math.inf
        self.distance_m = 0.0
        self._speed_m_s = 0.0
        self._min_step_s = 0.0
        self._columns = {"time_s": array("d"), "speed_m_s": array("d")}
        for sample in samples:
            self.append(sample)

    def __len__(self) -> int:
        return len(self._columns["time_s"])

    def append(self, sample: Sample) -> None:
        """Add the next sample. O(1) amortised.

        Parameters
        ----------
        sample : Sample
            Sample that is later than all others.
        """
        speed = sample.values.get("speed_m_s")
        if speed is not None:
            if len(self):
                self.distance_m += 0.5 * (speed + self._speed_m_s) * min(sample.time_s - self.last_s, HOLD_S)
            self._speed_m_s = speed
            if speed >= MOVING_M_S:
                self.moved_s, self.stood_s = sample.time_s, math.inf
            else:
                self.stood_s = min(self.stood_s, max(self.moved_s, sample.time_s - HOLD_S))
        if not len(self) or sample.time_s - self._columns["time_s"][-1] >= self._min_step_s:
            if len(self) >= MAX_SAMPLES:
                self._min_step_s = 2.0 * float(np.ptp(self._columns["time_s"])) / len(self)
                self._columns = {name: values[::2] for name, values in self._columns.items()}
            _insert(self._columns, len(self), [sample])
        self.last_s = sample.time_s

    def has(self, sample: Sample) -> bool:
        """Return whether exactly this sample is part of the trip. O(log(samples)).

        Parameters
        ----------
        sample : Sample
            Sample that may have arrived before.

        Returns
        -------
        bool
            False also if the trip has a sample of this time with other values.
        """
        index = bisect.bisect_left(self._columns["time_s"], sample.time_s)
        given = {"time_s": sample.time_s, **sample.values}.items()
        return all(value in self._columns.get(name, ())[index : index + 1] for name, value in given)

    def insert(self, sample: Sample) -> bool:
        """Insert a late sample if the trip has a gap at its time. O(samples).

        Parameters
        ----------
        sample : Sample
            Sample that is earlier than the latest of the trip.

        Returns
        -------
        bool
            Whether the sample was inserted.
        """
        time = self._columns["time_s"]
        steps, index = np.diff(time), bisect.bisect_left(time, sample.time_s)
        between = 0 < index < len(self) < MAX_SAMPLES and time[index] > sample.time_s
        if not between or steps[index - 1] < GAP_STEPS * np.median(steps):
            return False
        before_m = self._driven_m()
        _insert(self._columns, index, [sample])
        self.distance_m += self._driven_m() - before_m
        if sample.values.get("speed_m_s", 0.0) >= MOVING_M_S and sample.time_s > self.moved_s:
            self.moved_s, self.stood_s = sample.time_s, max(sample.time_s, self.stood_s)
        return True

    def _driven_m(self) -> float:
        """Return the distance by the speeds of the stored samples [m]."""
        known = np.isfinite(self._columns["speed_m_s"])
        time, speed = (np.array(self._columns[name])[known] for name in ("time_s", "speed_m_s"))
        return float(0.5 * (speed[1:] + speed[:-1]) @ np.minimum(np.diff(time), HOLD_S))

    def shift_times(self, by_s: float) -> None:
        """Shift all times after the clock of the sender was set. O(samples).

        Parameters
        ----------
        by_s : float
            Time to add to all times [s].
        """
        time = np.array(self._columns["time_s"]) + by_s
        self._columns["time_s"] = array("d", np.clip(time, FIRST_TIME_S, LAST_TIME_S))
        for name in ("start_s", "moved_s", "last_s", "stood_s"):
            setattr(self, name, getattr(self, name) + by_s)

    def columns(
        self, more: Iterable[Sample] = (), *, since_s: float | None = None, until_s: float = math.inf
    ) -> Columns:
        """Return the samples by canonical column, timed from a departure. O(samples).

        A missing speed is filled with the last one for up to `HOLD_S`. A sample that still has no speed is left out.

        Parameters
        ----------
        more : iterable of Sample
            Samples after those of the trip; they are used up to the first one of a charging car.
        since_s, until_s : float, optional
            First and last time that are returned [s since 1970]. The first is the departure, by default the start of the trip.
            Other samples are left out.

        Returns
        -------
        mapping of str to ndarray, shape (samples,)
            Name of a column -> its values; a missing value is NaN.
        """
        since_s = self.start_s if since_s is None else since_s
        stored = {name: values[:] for name, values in self._columns.items()}
        _insert(stored, len(self), itertools.takewhile(lambda sample: not sample.charging, more))
        time, speed, *others = map(np.array, stored.values())
        speed = speed if np.isfinite(speed).all() else hold_last(time, speed, HOLD_S)
        is_used = np.isfinite(speed) & (time >= since_s) & (time <= until_s)
        used = slice(None) if is_used.all() else is_used
        return dict(zip(stored, (values[used] for values in (time - since_s, speed, *others)), strict=True))


def _insert(columns: dict[str, array[float]], index: int, samples: Iterable[Sample]) -> None:
    """Insert samples before that of an index; a missing value is NaN."""
    rows, before = [{"time_s": s.time_s, **s.values} for s in samples], len(columns["time_s"])
    columns |= {name: array("d", [math.nan]) * before for row in rows for name in row if name not in columns}
    for name, values in columns.items():
        values[index:index] = array("d", [row.get(name, math.nan) for row in rows])


class TripFinder:
    """Finds start and end of the trips of one car in samples that come in the order of their times.

    A trip starts with the first sample faster than `MOVING_M_S` and has up to `BEFORE_S` of standstill before it. It ends
    after a standstill of `STANDING_S` (`PARKED_S` with the gear in park), after `SILENCE_S` without a sample, when the car is
    charged, or after the longest duration of a trip. Samples after its last motion are no part of a trip.

    Attributes
    ----------
    trip : LiveTrip or None
        The trip that the car is on.
    before : deque of Sample
        Latest samples of a standing car that is on no trip.

    Examples
    --------
    >>> finder = TripFinder()
    >>> [finder.add(Sample(1.7e9 + k, {"speed_m_s": 10.0})) for k in range(3)]
    [None, None, None]
    >>> finder.shift_times(3600.0)
    >>> finder.end().distance_m
    20.0
    >>> finder.trip is None
    True
    """

    def __init__(self) -> None:
        self.trip: LiveTrip | None = None
        self.before: deque[Sample] = deque(maxlen=_MAX_BEFORE)

    def add(self, sample: Sample) -> LiveTrip | None:
        """Take the next sample. O(1) amortised.

        Parameters
        ----------
        sample : Sample
            Sample that is later than all others.

        Returns
        -------
        LiveTrip or None
            The trip that this sample has ended; None if no trip has ended.
        """
        ended = self.end() if self.trip is not None and self._ends(self.trip, sample) else None
        if self.trip is not None:
            self.trip.append(sample)
        else:
            self._add_before_trip(sample)
        return ended

    def end(self) -> LiveTrip | None:
        """End the trip that the car is on, if it is on one.

        Returns
        -------
        LiveTrip or None
            The trip that has ended; None if the car was on no trip.
        """
        ended, self.trip = self.trip, None
        return ended

    def shift_times(self, by_s: float) -> None:
        """Shift all times after the clock of the sender was set. O(samples).

        Parameters
        ----------
        by_s : float
            Time to add to all times [s].
        """
        self.before = deque((shifted(sample, by_s) for sample in self.before), _MAX_BEFORE)
        if self.trip is not None:
            self.trip.shift_times(by_s)

    def _ends(self, trip: LiveTrip, sample: Sample) -> bool:
        """Return whether a sample ends the trip."""
        if sample.charging or sample.time_s - trip.last_s >= SILENCE_S:
            return True
        if sample.time_s - trip.start_s >= MAX_DURATION_S:
            return True
        if sample.values.get("speed_m_s", MOVING_M_S) >= MOVING_M_S:
            return False
        stood_s = min(trip.stood_s, max(trip.moved_s, sample.time_s - HOLD_S))  # a gap is no standstill
        return sample.time_s - stood_s >= (PARKED_S if sample.parked else STANDING_S)

    def _add_before_trip(self, sample: Sample) -> None:
        """Keep a sample of a car that is on no trip; a sample in motion starts a trip."""
        if sample.charging:
            self.before.clear()
            return
        while self.before and sample.time_s - self.before[0].time_s > BEFORE_S:
            self.before.popleft()
        self.before.append(sample)
        if sample.values.get("speed_m_s", 0.0) >= MOVING_M_S:
            self.trip = LiveTrip(self.before)
            self.before.clear()
