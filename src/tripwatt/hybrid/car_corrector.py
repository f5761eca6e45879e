"""A corrector on another car than the one it was fitted on, ready to correct and to be stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from tripwatt.arrays import FloatArray, eigen
from tripwatt.hybrid.hierarchy import CarTransfer, Members, Posterior
from tripwatt.hybrid.power import PowerCorrector, less_trip_mean
from tripwatt.hybrid.segments import SegmentTable

_SMALLEST: Final = 1e-8
"""Directions of the covariance with less of the largest variance than this are dropped."""


@dataclass(frozen=True, eq=False)
class HierarchicalCorrector(PowerCorrector):
    """Correction of the second car: the common part, faded outside the training range, and the car's own part.

    Attributes
    ----------
    base : Members
        Of the first car.
    scales : ndarray, shape (features,)
        From `term_scales`.
    mean : ndarray, shape (3 x features,)
        Weights of (in common, own, lost).
    factor : ndarray, shape (3 x features, any)
        ``factor @ factor.T`` is their covariance.
    shares : tuple of float
        Shares in common by stage; the base's shape within a trip is taken by them.
    """

    refit: ClassVar[str] = "adapt the base again"

    base: Members
    scales: FloatArray
    mean: FloatArray
    factor: FloatArray
    shares: tuple[float, ...]

    @classmethod
    def from_posterior(
        cls, transfer: CarTransfer, posterior: Posterior, calibrated: frozenset[str]
    ) -> HierarchicalCorrector:
        """From the posterior of the second car.

        Parameters
        ----------
        transfer : CarTransfer
        posterior : Posterior
        calibrated : frozenset of str
            Parameters whose mean the car's values have taken. The mean of the others, and the uncertainty of all, becomes
            that of the causes that they multiply.
        """
        names = [term.columns[0] if term.kind == "line" else "" for term in transfer.members.terms]
        n = 3 * len(transfer.scales)
        starts = np.concatenate(([0], np.cumsum(transfer.members.sizes)))[:-1] + len(transfer.scales)
        onto = [  # rows of a parameter in the posterior, and of a cause that it multiplies
            (n + j, int(starts[names.index(f"{cause}_w")]), parameter.name in calibrated)
            for j, parameter in enumerate(transfer.parameters)
            for cause in parameter.causes
            if f"{cause}_w" in names
        ]
        mean, covariance = posterior.mean.copy(), posterior.covariance.copy()
        for parameter, cause, in_car in onto:
            mean[cause] += 0.0 if in_car else mean[parameter]
            covariance[cause] += covariance[parameter]
        for parameter, cause, _ in onto:
            covariance[:, cause] += covariance[:, parameter]
        mean, covariance = mean[:n], covariance[:n, :n]
        factor = factor_of(0.5 * (covariance + covariance.T))
        factor = np.asarray(factor, dtype=np.float32).astype(np.float64)  # as it is stored: half the size
        return cls(transfer.members, transfer.scales, mean, factor, posterior.shares)

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[FloatArray, FloatArray]:
        """Residual power [W], and its uncertainty by the posterior of the weights."""
        segments = CarTransfer(self.base, self.scales).rows(table)
        rows = np.hstack(segments)
        within = np.array(self.shares)[self.base.stage] * self.base.shape
        shape = less_trip_mean(segments[0] @ within[:, None], table)[:, 0]
        return rows @ self.mean + shape, rows @ self.factor


def factor_of(covariance: FloatArray) -> FloatArray:
    """`L` with ``L @ L.T`` a covariance, without what is negligible.

    Weights that are independent of each other, as all causes and terms are before the first trip, are factorised on their own:
    O(sum of the cubes of their numbers).
    """
    from scipy.sparse import csr_array  # scipy is slow to import
    from scipy.sparse.csgraph import connected_components

    number, block = connected_components(csr_array(covariance != 0.0), directed=False)
    parts = []
    for b in range(number):
        rows = np.flatnonzero(block == b)
        parts.append((rows, *eigen(covariance[np.ix_(rows, rows)])))
    largest = max(0.0, *(float(values[-1]) for _, values, _ in parts))
    columns = []
    for rows, values, vectors in parts:
        kept = values > _SMALLEST * largest
        column = np.zeros((len(covariance), int(kept.sum())))
        column[rows] = vectors[:, kept] * np.sqrt(values[kept])
        columns.append(column)
    return np.hstack(columns)
