"""How near a trip is to the training of a correction, and so how much of the correction counts.

A correction is known within its training. Between the trips of its training it is interpolated; outside of them a share
``exp(-d² / 2)`` of it is kept, with `d` the distance from the range of each covariate in its standard deviations: the correlation of
the Gaussian process whose length scale is one standard deviation. The rest is as unknown as before any trip: it comes
back as variance. The duration of a trip is no such covariate, since the corrections are of power.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, raise_faults
from tripwatt.trips import TEMPERATURES

FADING: Final = (*TEMPERATURES, "speed_m_s", "trip_speed_m_s")
"""Covariates outside of whose training range a correction fades: those that make another kind of drive."""


@dataclass(frozen=True, slots=True)
class Range:
    """Range of a quantity over the training trips, and its standard deviation.

    Examples
    --------
    >>> Range(0.0, 10.0, 2.0).beyond([-4.0, 5.0, 11.0, np.nan]).tolist()
    [2.0, 0.0, 0.5, 0.0]
    """

    low: float
    high: float
    sd: float

    def beyond(self, values: npt.ArrayLike) -> FloatArray:
        """Distance outside the range, in standard deviations; 0 inside or when unknown."""
        values = np.asarray(values, dtype=np.float64)
        distance = np.fmax(np.maximum(self.low - values, values - self.high), 0.0) / self.sd
        return np.asarray(np.where(np.isfinite(values), distance, 0.0))

    @classmethod
    def from_values(cls, values: npt.ArrayLike) -> Range | None:
        """Range of the known values; None where there are none.

        Examples
        --------
        >>> Range.from_values([3.0, np.nan, 3.0]), Range.from_values([np.nan])
        (Range(low=3.0, high=3.0, sd=1.0), None)
        """
        values = np.asarray(values, dtype=np.float64)
        known = values[np.isfinite(values)]
        if not len(known):
            return None
        return cls(float(known.min()), float(known.max()), float(known.std()) or 1.0)


@dataclass(frozen=True, slots=True)
class Familiarity:
    """Ranges of the covariates outside of which a correction fades.

    Attributes
    ----------
    ranges : mapping of str to Range

    Raises
    ------
    InvalidInput
        When a range is not finite, or its standard deviation not positive.

    Examples
    --------
    >>> seen = Familiarity.from_features(pd.DataFrame({"ambient_temperature_degc": [10.0, 20.0]}), FADING)
    >>> seen.share(pd.DataFrame({"ambient_temperature_degc": [15.0, 25.0, 95.0]})).round(3).tolist()
    [1.0, 0.607, 0.0]
    """

    ranges: Mapping[str, Range] = field(default_factory=dict)

    def __post_init__(self) -> None:
        allowed = "finite, sd above 0"
        raise_faults(
            Fault(
                "no range", f"familiarity, {name}", f"{seen.low:g} to {seen.high:g}, sd {seen.sd:g}", allowed
            )
            for name, seen in self.ranges.items()
            if not (np.isfinite([seen.low, seen.high, seen.sd]).all() and seen.sd > 0.0)
        )

    @classmethod
    def from_features(cls, features: pd.DataFrame, columns: Iterable[str]) -> Familiarity:
        """Ranges of those of the columns that are in `FADING`.

        Parameters
        ----------
        features : DataFrame, (rows, columns)
            Of the training trips; NaN where unknown.
        columns : iterable of str
            What the correction depends on.
        """
        wanted = set(columns)
        ranges = {
            name: Range.from_values(features[name]) for name in FADING if name in wanted and name in features
        }
        return cls({name: seen for name, seen in ranges.items() if seen is not None})

    def distances(self, features: pd.DataFrame) -> dict[str, FloatArray]:
        """Distance of each row outside of each range, in standard deviations: covariate -> shape (rows,)."""
        return {name: seen.beyond(features[name]) for name, seen in self.ranges.items() if name in features}

    def share(self, features: pd.DataFrame) -> FloatArray:
        """Share of the correction that counts in each row: 1 inside the ranges, towards 0 far outside, shape (rows,).

        It is ``exp(-d² / 2)`` of the distances of all covariates together.
        """
        squared = np.zeros(len(features))
        for distance in self.distances(features).values():
            squared += distance**2
        return np.asarray(np.exp(-0.5 * squared))
