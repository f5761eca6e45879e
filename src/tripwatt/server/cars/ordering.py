"""Samples that arrive late, twice or in another order, given on in the order of their times."""

from __future__ import annotations

import bisect
import math
from operator import attrgetter
from typing import Final, Literal

from tripwatt.server.cars.telemetry import Sample, moved

LATE_S: Final = 30.0
"""A sample may arrive this much later than one that was sent after it [s of its own time]."""

MOST_WAITING: Final = 600
"""Most samples that wait for late ones: 20 Hz for `LATE_S`. Of more, the oldest waits no longer."""

Place = Literal["new", "doubled", "late"]
Arrival = Place | Literal["held"]

_time = attrgetter("time_s")


class OrderedSamples:
    """A bounded window in which samples wait until none can come before them.

    Parameters
    ----------
    after_s : float
        Samples up to this time were given on before.

    Attributes
    ----------
    waiting : list of Sample
        By time, at most `MOST_WAITING`.
    newest_s, given_s : float
        Latest time that arrived, and that was given on; `after_s` before the first one.

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
        """Whether a sample is new, is there already by its time, or is too late. O(log(`MOST_WAITING`))."""
        if sample.time_s <= self.given_s:
            return "doubled" if sample.time_s == self.given_s else "late"
        at = bisect.bisect_left(self.waiting, sample.time_s, key=_time)
        there = at < len(self.waiting) and self.waiting[at].time_s == sample.time_s
        return "doubled" if there else "new"

    def insert(self, sample: Sample) -> None:
        """Take a new sample into the window. O(`MOST_WAITING`), and O(1) for one that is the latest."""
        bisect.insort(self.waiting, sample, key=_time)
        self.newest_s = max(self.newest_s, sample.time_s)

    def ready(self) -> list[Sample]:
        """Give the samples on before which no other can come, in the order of their times."""
        count = bisect.bisect_right(self.waiting, self.newest_s - LATE_S, key=_time)
        return self._give(max(count, len(self.waiting) - MOST_WAITING))

    def move(self, by_s: float) -> None:
        """Move all times: the clock of the sender was set."""
        self.waiting = [moved(sample, by_s) for sample in self.waiting]
        self.newest_s, self.given_s = self.newest_s + by_s, self.given_s + by_s

    def rest(self) -> list[Sample]:
        """Give all samples on; nothing is awaited any more."""
        return self._give(len(self.waiting))

    def _give(self, count: int) -> list[Sample]:
        if not count:
            return []
        given, self.waiting = self.waiting[:count], self.waiting[count:]
        self.given_s = given[-1].time_s
        return given
