"""Put samples that arrive late, twice or out of order into the order of their times."""

from __future__ import annotations

import bisect
import math
from operator import attrgetter
from typing import Final, Literal

from tripwatt.server.cars.telemetry import Sample, moved

LATE_S: Final = 30.0
"""A sample is still used if its time is at most this much before the latest time that arrived [s]."""

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
    newest_s, given_s : float
        Latest time of an arrived and of a released sample [s since 1970]; `after_s` before the first one.

    Examples
    --------
    >>> ordered = OrderedSamples()
    >>> for time_s in (1.7e9, 1.7e9 + 20.0, 1.7e9 + 10.0, 1.7e9 + 10.0, 1.7e9 + 50.0):
    ...     sample = Sample(time_s)
    ...     if ordered.arrival(sample) == "new":
    ...         ordered.insert(sample)
    >>> [sample.time_s - 1.7e9 for sample in ordered.ready()]
    [0.0, 10.0, 20.0]
    >>> ordered.arrival(Sample(1.7e9 + 15.0))
    'late'
    """

    def __init__(self, after_s: float = -math.inf) -> None:
        self.waiting: list[Sample] = []
        self.newest_s = self.given_s = after_s

    def arrival(self, sample: Sample) -> Place:
        """Return whether a sample is new, doubled (its time is there already) or too late. O(log(`MAX_WAITING`))."""
        if sample.time_s <= self.given_s:
            return "doubled" if sample.time_s == self.given_s else "late"
        at = bisect.bisect_left(self.waiting, sample.time_s, key=_time)
        there = at < len(self.waiting) and self.waiting[at].time_s == sample.time_s
        return "doubled" if there else "new"

    def insert(self, sample: Sample) -> None:
        """Insert a new sample into the window. O(`MAX_WAITING`), or O(1) for the latest sample."""
        bisect.insort(self.waiting, sample, key=_time)
        self.newest_s = max(self.newest_s, sample.time_s)

    def ready(self) -> list[Sample]:
        """Release and return, in the order of their times, the samples before which no other can arrive."""
        count = bisect.bisect_right(self.waiting, self.newest_s - LATE_S, key=_time)
        return self._give(max(count, len(self.waiting) - MAX_WAITING))

    def move(self, by_s: float) -> None:
        """Shift all times by `by_s` [s] after the clock of the sender was set."""
        self.waiting = [moved(sample, by_s) for sample in self.waiting]
        self.newest_s, self.given_s = self.newest_s + by_s, self.given_s + by_s

    def rest(self) -> list[Sample]:
        """Release and return all samples."""
        return self._give(len(self.waiting))

    def _give(self, count: int) -> list[Sample]:
        if not count:
            return []
        given, self.waiting = self.waiting[:count], self.waiting[count:]
        self.given_s = given[-1].time_s
        return given
