"""Ranges of the training trips: outside of them a forecast is flagged and its interval is wider."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from tripwatt.hybrid import SegmentTable
from tripwatt.trips import TEMPERATURES, Flag
from tripwatt.units import SECONDS_PER_HOUR

WATCHED: Final = (*TEMPERATURES, "trip_speed_m_s", "duration_s")
"""Quantities of a trip that are compared with the training trips."""


@dataclass(frozen=True, slots=True)
class Range:
    """Range of a quantity over the training trips, and its standard deviation."""

    low: float
    high: float
    sd: float

    def beyond(self, value: float) -> float:
        """Distance outside the range, in standard deviations; 0 inside or when unknown."""
        if not np.isfinite(value):
            return 0.0
        return max(self.low - value, value - self.high, 0.0) / self.sd


NEVER_KNOWN: Final = Range(-np.inf, np.inf, 1.0)
"""Range of a quantity that no training trip has."""


@dataclass(frozen=True, slots=True)
class Unfamiliar:
    """What a trip has outside the training ranges.

    Attributes
    ----------
    outside : mapping of str to float
        Quantity -> distance outside its range, in standard deviations.
    unknown : tuple of str
        Temperatures that training trips have and the departure has not.
    """

    outside: Mapping[str, float] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()

    @property
    def widening(self) -> float:
        """Factor of the standard deviation of the trip's energy."""
        beyond = sum(b**2 + 0.25 for b in self.outside.values())
        return float(np.sqrt(1.0 + beyond + 0.1 * len(self.unknown)))

    @property
    def flags(self) -> list[Flag]:
        """A flag for each of them."""
        outside = [Flag("outside_training", name, beyond, "sd") for name, beyond in self.outside.items()]
        return outside + [Flag("usual_value_assumed", name) for name in self.unknown]


def compare(table: SegmentTable, ranges: Mapping[str, Range]) -> Unfamiliar:
    """Compare a trip with the training ranges; `table` holds that one trip."""
    known = _watched(table)
    outside = {name: ranges[name].beyond(value) for name, value in known.items()}
    return Unfamiliar(
        {name: beyond for name, beyond in outside.items() if beyond > 0.0},
        tuple(
            name
            for name in TEMPERATURES
            # a temperature that no training trip has is none that the corrector uses
            if not np.isfinite(known[name]) and np.isfinite(ranges[name].low)
        ),
    )


def training_ranges(table: SegmentTable) -> dict[str, Range]:
    """Range of each of `WATCHED` over the trips of a table."""
    rows = [_watched(table.take([i])) for i in range(len(table))]
    ranges = {}
    for name in WATCHED:
        values = np.array([row[name] for row in rows])
        known = values[np.isfinite(values)]
        if not len(known):
            ranges[name] = NEVER_KNOWN
            continue
        sd = float(known.std())
        ranges[name] = Range(float(known.min()), float(known.max()), sd if sd > 0 else 1.0)
    return ranges


def _watched(table: SegmentTable) -> dict[str, float]:
    row = dict(zip(table.features.columns.tolist(), table.features.to_numpy()[0].tolist(), strict=True))
    first: dict[str, float] = {name: float(row[name]) for name in WATCHED if name in row}
    return first | {"duration_s": float(table.hours.sum() * SECONDS_PER_HOUR)}
