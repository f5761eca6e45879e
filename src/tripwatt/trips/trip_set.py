"""Logs that were read together, and the notes of their source."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tripwatt.trips.flags import Flag
from tripwatt.trips.reading import ReadingReport
from tripwatt.trips.trip import Recorded, Trip


@dataclass(frozen=True, slots=True, repr=False)
class TripSet:
    """Logs that were read together, and the notes of their source.

    Attributes
    ----------
    name : str
        The data set, e.g. "tum"; "TUM sample" for the trips of the package.
    logs : tuple of Log
        Logs before any audit.
    notes : tuple of Flag
        Notes of a reader, e.g. that season and weather are unknown.
    reference : mapping of str to (float or None), or None
        Reference trips of the data set: id -> time [s] at which the trip is cut off, or None if it is not cut. None if the
        data set defines no reference trips.
    citation : str
        Attribution that the licence of the data requires; empty if there is none.
    report : ReadingReport or None
        What was read from each file; None for logs that were not read from files.

    Examples
    --------
    >>> import tripwatt as tw
    >>> sample = tw.sample_trips()
    >>> sample.name, len(sample.logs), sample.reference_trips()
    ('TUM sample', 15, ())
    """

    name: str
    logs: tuple[Recorded, ...]
    notes: tuple[Flag, ...] = ()
    reference: Mapping[str, float | None] | None = None
    citation: str = ""
    report: ReadingReport | None = None

    @property
    def trips(self) -> tuple[Trip, ...]:
        """The logs as trips, without an audit."""
        return tuple(map(Trip.from_log, self.logs))

    def reference_trips(self) -> tuple[Trip, ...]:
        """Return the reference trips among the logs, cut off where the reference ends; empty without a reference.

        Returns
        -------
        tuple of Trip
            Trips in the order of the logs.
        """
        ends = self.reference or {}
        return tuple(
            t if ends[t.trip_id] is None else t.between(-math.inf, ends[t.trip_id] or math.inf)
            for t in self.trips
            if t.trip_id in ends
        )

    def __len__(self) -> int:
        return len(self.logs)

    def __repr__(self) -> str:
        read = "" if self.report is None else f" from {self.report}"
        return f"<TripSet {self.name}: {len(self)} logs{read}>"
