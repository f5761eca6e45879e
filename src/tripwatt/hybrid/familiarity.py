"""Distance of a trip from the training of a correction, and the share of the correction that counts there.

Between its training trips a correction is interpolated. Outside of their ranges a share ``exp(-d² / 2)`` of it is kept, where `d` is
the distance from the range of each covariate in its standard deviations. The share is the correlation of a Gaussian process whose length
scale is one standard deviation. The lost part is as uncertain as before any trip and is added as variance. The duration of a trip is
not among the covariates, because the corrections are of power.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, raise_faults
from tripwatt.learners.gp import Table, float_columns
from tripwatt.trips import TEMPERATURES

FADING: Final = (*TEMPERATURES, "speed_m_s", "trip_speed_m_s")
"""Covariates outside of whose training range a correction fades: those that describe the kind of drive."""


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
        """Distance outside the range, in standard deviations; 0 inside the range or for an unknown value."""
        values = np.asarray(values, dtype=np.float64)
        return np.fmax(np.maximum(self.low - values, values - self.high), 0.0) / self.sd

    @classmethod
    def from_values(cls, values: npt.ArrayLike) -> Range | None:
        """Make the range of the known values; None if all values are unknown.

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
        Training range by name of the covariate.
    lost_w : float
        Standard deviation of the residual power where nothing of the correction is left [W].

    Raises
    ------
    InvalidInput
        If a range is not finite, or its standard deviation is not positive.

    Examples
    --------
    >>> seen = Familiarity.from_features(pd.DataFrame({"ambient_temperature_degc": [10.0, 20.0]}), FADING)
    >>> seen.share(pd.DataFrame({"ambient_temperature_degc": [15.0, 25.0, 95.0]})).round(3).tolist()
    [1.0, 0.607, 0.0]
    """

    ranges: Mapping[str, Range] = field(default_factory=dict)
    lost_w: float = 0.0

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
    def from_features(cls, features: pd.DataFrame, columns: Collection[str]) -> Familiarity:
        """Take the ranges of the given columns that are in `FADING`.

        Parameters
        ----------
        features : DataFrame, (rows, columns)
            Features of the training trips; NaN if unknown.
        columns : collection of str
            Columns that the correction depends on.
        """
        names = [name for name in FADING if name in columns and name in features]
        return cls({name: seen for name in names if (seen := Range.from_values(features[name])) is not None})

    def share(self, features: Table) -> FloatArray:
        """Share of the correction that counts in each row, shape (rows,): 1 inside the ranges, towards 0 far outside.

        It is ``exp(-d² / 2)``, where ``d²`` is the sum of the squared distances of all covariates.
        """
        columns = float_columns(features)
        squares = (seen.beyond(columns[n]) ** 2 for n, seen in self.ranges.items() if n in columns)
        return np.asarray(np.exp(-0.5 * sum(squares, start=np.zeros(len(next(iter(columns.values())))))))

    def lost_factor(self, features: Table) -> FloatArray:
        """Factor of the covariance of what is lost of the correction [W], shape (rows, 1): 0 inside the ranges, `lost_w` far outside.

        Examples
        --------
        >>> seen = Familiarity({"ambient_temperature_degc": Range(10.0, 20.0, 5.0)}, lost_w=300.0)
        >>> seen.lost_factor(pd.DataFrame({"ambient_temperature_degc": [15.0, 25.0, 95.0]})).round().ravel().tolist()
        [0.0, 239.0, 300.0]
        """
        return self.lost_w * np.sqrt(1.0 - self.share(features)[:, None] ** 2)
