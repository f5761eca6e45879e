"""Ways to hold trips out: leave one trip out, leave one day out, leave a regime out, and a split by time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tripwatt.arrays import IntArray
from tripwatt.hybrid import TripTable

TRAINING_ONLY: Final = -1
"""Fold of a trip that is only trained on."""

LEAVE_ONE_TRIP_OUT: Final = "leave_one_trip_out"
LEAVE_ONE_DAY_OUT: Final = "leave_one_day_out"
OTHER_TRIPS: Final = "other_trips"
LEAVE_REGIME_OUT: Final = "leave_regime_out"
TIME_SPLIT: Final = "time_split"


@dataclass(frozen=True, eq=False)
class HoldOut:
    """One way to hold trips out: the scheme, the set of trips, and the fold of each trip.

    Attributes
    ----------
    scheme : {"leave_one_trip_out", "leave_one_day_out", "other_trips", "leave_regime_out", "time_split"}
    trips : str
        "reference", "audited" or "all"; where a regime is held out, its name.
    table : TripTable
    folds : ndarray of int, shape (trips,)
        `TRAINING_ONLY` for a trip that is not scored.
    data : object
        What the models of a protocol need beside the table.
    """

    scheme: str
    trips: str
    table: TripTable
    folds: IntArray
    data: Any = None

    @property
    def scored(self) -> IntArray:
        """Numbers of the trips that are scored."""
        return np.flatnonzero(self.folds != TRAINING_ONLY)

    @property
    def fold_numbers(self) -> frozenset[int]:
        """Numbers of the folds."""
        return frozenset(self.folds[self.scored].tolist())
