"""Covariates of a user's own: columns of a log beside its signals, such as traffic, humidity or the driver, as inputs of a corrector.

A covariate has one value for a trip, which the plan of a forecast knows: of a log the mean, or the most frequent word. A number enters a corrector as it is, the words of a category as one column
of 0 and 1 for each word of the training trips. Correctors with terms get one smooth term, of the scale of the training trips, for each
covariate; other learners get the columns as further features. A value that is unknown at departure is integrated out: the correction is
the mean over the values of the training trips, and the variance of the energy over these values is a variance of the forecast.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput
from tripwatt.hybrid.power import PowerCorrector, TunedCorrector, Uncertain, Way
from tripwatt.hybrid.segments import SegmentTable

MOST_VALUES: Final = 30
"""Most values over which an unknown covariate is integrated; with more training trips they are evenly chosen. A choice: thirty values
give a standard deviation within 13 %."""


@dataclass(eq=False)
class CovariateCorrector(TunedCorrector):
    """A corrector that also uses covariates.

    Parameters
    ----------
    base : PowerCorrector
        The corrector.
    names : tuple of str
        Names of the covariates.
    levels : dict of str to tuple of str
        Category -> its words in the training trips.
    seen : ndarray, shape (trips, columns)
        Columns of the covariates in the training trips; an unknown value is the mean of the column.

    Examples
    --------
    >>> from tripwatt.hybrid import power_corrector, segment_trips
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = segment_trips(synthetic_fleet(4).trips, load_vehicle(VEHICLE))
    >>> table = replace(table, covariates=pd.DataFrame({"driver": ["anna", "ben", "anna", "ben"]}))
    >>> corrector = CovariateCorrector(power_corrector("linear"), ("driver",)).fit(table)
    >>> corrector.columns, corrector.unknown(table.take([0]))
    ({'driver': ('driver=anna', 'driver=ben')}, ((), 0.0))
    """

    base: PowerCorrector
    names: tuple[str, ...]
    levels: dict[str, tuple[str, ...]] = field(default_factory=dict)
    seen: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def columns(self) -> dict[str, tuple[str, ...]]:
        """Covariate -> names of its columns among the features."""
        return {
            n: tuple(f"{n}={w}" for w in self.levels[n]) if n in self.levels else (n,) for n in self.names
        }

    def _each(self, table: SegmentTable, way: Way) -> None:
        """Fit the corrector with the covariates of the trips; their words and scales are those of these trips."""
        given = pd.DataFrame() if table.covariates is None else table.covariates
        for name in self.names:
            if name not in given or given[name].isna().all():
                raise InvalidInput(Fault.unknown("unknown covariate", "covariates", name, given.columns))
            if name in table.features:
                raise InvalidInput.of("name is taken", "covariates", name, "another name of the column")
        texts = [name for name in self.names if not pd.api.types.is_numeric_dtype(given[name])]
        self.levels = {name: tuple(sorted(map(str, given[name].dropna().unique()))) for name in texts}
        known = self._encode(table)
        self.seen = np.where(np.isfinite(known), known, np.nanmean(known, axis=0))
        getattr(self.base, way)(self._with(table, known))

    def clone_tuned(self) -> CovariateCorrector:
        """Return an unfitted copy with the settings that `fit` chose."""
        return CovariateCorrector(self.base.clone_tuned(), self.names)

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Mean over the values of unknown covariates, and the factor of the covariance of this mean."""
        pairs = (self.base.predict_with_uncertainty(each, hours) for each in self._completed(table))
        powers, factors = zip(*pairs, strict=True)
        return np.mean(powers, axis=0), np.mean(factors, axis=0)

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Factor of the corrector, for the mean over the values of unknown covariates."""
        return np.asarray(np.mean([*map(self.base.outside_factor, self._completed(table))], axis=0))

    def predict_climate(self, table: SegmentTable) -> FloatArray | None:
        """Part of the prediction that is climate control [W]; None for a joint corrector."""
        parts = [p for p in map(self.base.predict_climate, self._completed(table)) if p is not None]
        return np.asarray(np.mean(parts, axis=0)) if parts else None

    def unknown(self, table: SegmentTable) -> tuple[tuple[str, ...], float]:
        """Unknown covariates of one trip, and the standard deviation of its energy due to them [Wh]."""
        columns = [column for columns in self.columns.values() for column in columns]
        known = dict(zip(columns, np.isfinite(self._encode(table)[0]), strict=True))
        names = tuple(name for name, of_name in self.columns.items() if not known[of_name[0]])
        return names, float(np.std([t.totals_wh(self.base.predict(t)) for t in self._completed(table)]))

    def _completed(self, table: SegmentTable) -> Iterator[SegmentTable]:
        """Yield the table with each of the values that its unknown covariates may have."""
        known = self._encode(table)
        is_known = np.isfinite(known)
        values = known[:1]
        if not is_known.all():
            places = np.linspace(0, len(self.seen) - 1, min(len(self.seen), MOST_VALUES)).round()
            values = self.seen[np.lexsort(self.seen.T)[places.astype(np.int64)]]
        for value in values:
            yield self._with(table, np.where(is_known, known, value))

    def _encode(self, table: SegmentTable) -> FloatArray:
        """Columns of the covariates, shape (trips, columns); NaN if unknown, as is a word that no training trip has."""
        given = pd.DataFrame(index=range(len(table))) if table.covariates is None else table.covariates
        encoded = []
        for name, columns in self.columns.items():
            values = given[name] if name in given else pd.Series(np.nan, range(len(table)))
            if name in self.levels:
                codes = pd.Index(self.levels[name]).get_indexer(pd.Index(values.astype(str)))
                encoded.append(np.where(codes[:, None] < 0, np.nan, np.eye(len(columns))[codes]))
            else:
                encoded.append(pd.to_numeric(values, errors="coerce").to_numpy(np.float64)[:, None])
        return np.hstack(encoded)

    def _with(self, table: SegmentTable, values: FloatArray) -> SegmentTable:
        """The table with the columns of the covariates among its features."""
        names = [column for columns in self.columns.values() for column in columns]
        added = pd.DataFrame(values[table.groups], columns=names)
        return replace(table, features=pd.concat([table.features, added], axis=1), added=self.columns)
