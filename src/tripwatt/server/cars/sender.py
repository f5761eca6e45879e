"""The order of samples, and the clock of their sender: its offset from ours, whether it was set, and whether there are two senders.

Samples are ordered by the sender's time stamps, so its clock need not be right: only jumps matter. A sample whose stamp does not
fit the order or the clock is held until later samples confirm or contradict that the clock was set.
"""

from __future__ import annotations

import bisect
import math
import statistics
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from operator import attrgetter
from typing import Final, Literal

from tripwatt.server.cars.live_trip import HOLD_S
from tripwatt.server.cars.telemetry import Sample, shifted

LATE_S: Final = 30.0
"""A sample is still used if its time is at most this much before the latest time that arrived [s]. A choice."""

MAX_WAITING: Final = 600
"""Most samples that wait for late ones: 20 Hz for `LATE_S`. If there are more, the oldest are released."""

Place = Literal["new", "doubled", "late"]
Arrival = Place | Literal["held"]

_time = attrgetter("time_s")


class OrderedSamples:
    """A bounded window in which samples wait until no earlier one can arrive.

    Parameters
    ----------
    after_s : float
        Samples up to this time were released before [s since 1970].

    Attributes
    ----------
    waiting : list of Sample
        Samples in the window by time, at most `MAX_WAITING`.
    newest_s, released_s : float
        Latest time of an arrived and of a released sample [s since 1970]; `after_s` before the first one.

    Examples
    --------
    >>> ordered = OrderedSamples()
    >>> for time_s in (1.7e9, 1.7e9 + 20.0, 1.7e9 + 10.0, 1.7e9 + 10.0, 1.7e9 + 50.0):
    ...     sample = Sample(time_s)
    ...     if ordered.arrival(sample) == "new":
    ...         ordered.insert(sample)
    >>> [sample.time_s - 1.7e9 for sample in ordered.release_ready()]
    [0.0, 10.0, 20.0]
    >>> ordered.arrival(Sample(1.7e9 + 15.0))
    'late'
    """

    def __init__(self, after_s: float = -math.inf) -> None:
        self.waiting: list[Sample] = []
        self.newest_s = self.released_s = after_s

    def arrival(self, sample: Sample) -> Place:
        """Return whether a sample is new, doubled (its time is there already) or too late. O(log(`MAX_WAITING`))."""
        if sample.time_s <= self.released_s:
            return "doubled" if sample.time_s == self.released_s else "late"
        index = bisect.bisect_left(self.waiting, sample.time_s, key=_time)
        is_stored = index < len(self.waiting) and self.waiting[index].time_s == sample.time_s
        return "doubled" if is_stored else "new"

    def insert(self, sample: Sample) -> None:
        """Insert a new sample into the window. O(`MAX_WAITING`), or O(1) for the latest sample."""
        bisect.insort(self.waiting, sample, key=_time)
        self.newest_s = max(self.newest_s, sample.time_s)

    def release_ready(self) -> list[Sample]:
        """Release and return, in the order of their times, the samples before which no other can arrive."""
        return self.release(self.newest_s - LATE_S)

    def shift_times(self, by_s: float) -> None:
        """Shift all times by `by_s` [s] after the clock of the sender was set."""
        self.waiting = [shifted(sample, by_s) for sample in self.waiting]
        self.newest_s, self.released_s = self.newest_s + by_s, self.released_s + by_s

    def release(self, until_s: float = math.inf) -> list[Sample]:
        """Release and return the samples up to a time [s since 1970], and the oldest of more than `MAX_WAITING`; by default all."""
        count = bisect.bisect_right(self.waiting, until_s, key=_time)
        count = max(count, len(self.waiting) - MAX_WAITING)
        released, self.waiting = self.waiting[:count], self.waiting[count:]
        self.released_s = max([self.released_s, *(sample.time_s for sample in released)])
        return released


FUTURE_S: Final = 120.0
"""A stamp may be this much ahead of the sender's known clock [s]; a sample that is further ahead is held. A choice."""

STEADY: Final = (3, 5.0, 10.0)
"""Messages that show a clock: fewest of them, shortest time from first to last arrival [s], largest spread of their offsets [s]. Choices; `python -m benchmarks.clocks` tries them."""

RECENT: Final = 15
"""Number of latest messages from which the clock is estimated. A choice."""

MAX_HELD: Final = 600
"""Most samples that are held: as many as wait, `MAX_WAITING`."""

MIN_ACCEPTED: Final = 3
"""Number of messages by the earlier clock that show that it was not set. A choice: two may come by chance."""

POSSIBLE: Final = {"speed_m_s": (5.0, 6.0), "displayed_soc": (0.02, 1e-3), "soc": (0.02, 1e-3)}
"""Column -> largest difference between two samples of one car: at the same time, and for each second between them."""

APART: Final = (1.0, -0.1, 10.0)
"""Score of a sample that cannot come from the same car as the one before, score of any other sample, and sum that shows two cars. Choices."""


def steady_clock() -> Callable[[], float]:
    """Return a clock that starts at the present time [s since 1970] and is steady even if the machine's clock is set."""
    began_s = time.time() - time.monotonic()
    return lambda: began_s + time.monotonic()


class Sender:
    """The sender of a car's messages, judged by their time stamps and times of arrival.

    Parameters
    ----------
    offset_s : float, optional
        Offset as it was known before [s].

    Attributes
    ----------
    offset_s : float or None
        Our clock less that of the sender, including the delay of messages [s]: the median of recent messages. None while unknown.
    held : list of Sample
        Samples whose stamps are neither confirmed nor contradicted.
    mixed_s : float
        When messages last looked like those of two senders [s since 1970].

    Examples
    --------
    >>> sender = Sender()
    >>> for k in range(10):
    ...     sender.accept(Sample(1.7e9 + k, received_s=1.7e9 + k + 3600.0))
    >>> sender.offset_s, sender.fits(Sample(1.7e9 + 86400.0, received_s=1.7e9 + 3610.0))
    (3600.0, False)
    """

    def __init__(self, offset_s: float | None = None) -> None:
        self.offset_s = offset_s
        self.held: list[Sample] = []
        self.mixed_s = -math.inf
        self._recent: deque[Sample] = deque(maxlen=RECENT)
        self._strays: deque[Sample] = deque(maxlen=RECENT)
        self._accepted_since = 0
        self._apart_score = 0.0

    def fits(self, sample: Sample, *, is_late: bool = False) -> bool:
        """Whether a sample fits the known clock; true while no clock is known.

        A sample fits if the caller does not say that it is late, and if it is not far ahead of the clock or follows the last sample.
        """
        if self.offset_s is None or sample.received_s is None:
            return True
        ahead = self.offset_s - _offset_s(sample) > FUTURE_S and not self._follows(self._recent, sample)
        return not (is_late or ahead)

    def _follows(self, before: Sequence[Sample], sample: Sample) -> bool:
        """Whether the stamp of a sample is later than that of the last one before by no more than its arrival, within tolerances."""
        if not before or before[-1].received_s is None or sample.received_s is None:
            return False
        max_s = FUTURE_S + max(sample.received_s - before[-1].received_s, 0.0)
        return -LATE_S <= sample.time_s - before[-1].time_s <= max_s

    def accept(self, sample: Sample) -> None:
        """Take a sample that fits the known clock, and update this clock. O(1)."""
        if self._recent:
            odd = _differ(self._recent[-1], sample)
            self._apart_score = min(max(self._apart_score + APART[not odd], 0.0), APART[2])
            if odd and self._apart_score >= APART[2] and sample.received_s is not None:
                self.mixed_s = sample.received_s
        self._accepted_since += bool(self.held)
        if sample.received_s is not None:
            self._recent.append(sample)
        if _steady(self._recent):
            self.offset_s = statistics.median(map(_offset_s, self._recent))

    def can_hold(self, sample: Sample) -> bool:
        """Whether a sample can be held together with those already held."""
        return not self.held or (len(self.held) < MAX_HELD and self._follows(self.held, sample))

    @property
    def clock_was_set(self) -> bool:
        """Whether the held samples show another clock, and fewer than `MIN_ACCEPTED` - 1 samples came by the known one."""
        return self._accepted_since < MIN_ACCEPTED - 1 and _steady(self.held)

    @property
    def clock_was_kept(self) -> bool:
        """Whether enough samples by the known clock came beside the held samples: one less if these show another clock."""
        return self._accepted_since + _steady(self.held) >= MIN_ACCEPTED

    def adopt_clock(self, newest_s: float) -> tuple[float, list[Sample]]:
        """Adopt the clock of the held samples; return the shift for all samples before them [s], and the held samples."""
        before_s = 0.0 if self.offset_s is None else self.offset_s
        self._recent = deque(self.held, RECENT)
        self.offset_s = statistics.median(map(_offset_s, self._recent))
        held = self.release()
        # samples that arrived before the held ones were sent before them
        return min(before_s - self.offset_s, min(sample.time_s for sample in held) - newest_s - 1e-3), held

    def release(self) -> list[Sample]:
        """Return the held samples, and hold them no longer."""
        held, self.held, self._accepted_since = self.held, [], 0
        return held

    def add_stray(self, sample: Sample) -> None:
        """Note a sample that does not count; if several share a clock of their own, there is another sender."""
        self._strays.append(sample)
        if _steady(self._strays) and sample.received_s is not None:
            self.mixed_s = sample.received_s


def _offset_s(sample: Sample) -> float:
    return (sample.time_s if sample.received_s is None else sample.received_s) - sample.time_s


def _steady(samples: Collection[Sample]) -> bool:
    min_messages, min_s, max_s = STEADY
    if len(samples) < min_messages:
        return False
    offsets = [_offset_s(sample) for sample in samples]
    came = [sample.received_s or 0.0 for sample in samples]
    return max(offsets) - min(offsets) <= max_s and max(came) - min(came) >= min_s


def _differ(earlier: Sample, later: Sample) -> bool:
    """Whether two samples of about the same time cannot come from one car."""
    apart_s = abs(later.time_s - earlier.time_s)
    return apart_s <= HOLD_S and any(
        abs(earlier.values[name] - later.values[name]) > at_once + rate * apart_s
        for name, (at_once, rate) in POSSIBLE.items()
        if name in earlier.values and name in later.values
    )
