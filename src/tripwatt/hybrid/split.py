"""Climate control and driving corrected separately.

A log with the power of heater and air conditioner splits the residual in two. The power of climate control depends on
temperatures and time, the power of driving on road and speed. If both are fitted separately, neither is disturbed by the noise
of the other, and each is updated on the way by its own measurements. If too few trips log climate control, one corrector
corrects both jointly.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Self

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid.power import (
    LINES,
    TREE_FEATURES,
    EnsembleCorrector,
    GPCorrector,
    PowerCorrector,
    boosting_corrector,
    smooth_terms,
)
from tripwatt.hybrid.segments import SegmentTable
from tripwatt.learners.gp import KernelTerm

CLIMATE_TERMS: Final = (KernelTerm(("climate_w",), "line", 0.3), *smooth_terms("climate"))
"""Terms of the climate correction: a share of the simulated power (sd 30 %) and smooth functions of the state."""

DRIVE_TERMS: Final = (*(term for term in LINES if term.columns != ("climate_w",)), *smooth_terms("drive"))
"""Terms of the driving correction: those of the joint corrector without the cabin's."""

DRIVE_TREE_FEATURES: Final = tuple(
    n for n in TREE_FEATURES if n != "climate_w" and not n.startswith("cabin_")
)


class SplitCorrector(PowerCorrector):
    """One corrector for climate control and one for driving, or a joint one if too few trips log climate control.

    Parameters
    ----------
    climate, drive, joint : PowerCorrector
        Correctors of climate control, of driving, and of the undivided residual.
    split : bool or None
        Whether to correct separately; None decides by the trips of `fit`.

    Attributes
    ----------
    split_ : bool
        Whether climate control and driving are corrected separately.
    """

    def __init__(
        self,
        climate: PowerCorrector,
        drive: PowerCorrector,
        joint: PowerCorrector,
        split: bool | None = None,
    ) -> None:
        self.climate = climate
        self.drive = drive
        self.joint = joint
        self.split = split
        self.split_ = bool(split)

    def fit(self, table: SegmentTable) -> Self:
        """Fit climate control to the trips that log it, then driving to the remaining residual of all trips."""
        logged = climate_logged(table)
        # eight trips and half of all with logged climate control: a separate correction from fewer is worse; a choice
        enough = int(logged.sum()) >= 8 and float(logged.mean()) >= 0.5
        self.split_ = enough if self.split is None else self.split
        if not self.split_:
            self.joint.fit(table)
            return self
        own = replace(
            table,
            simulated_w=table.features["climate_w"].to_numpy(),
            observed_w=table.observed_climate_w,
            errors=None,
        )
        self.climate.fit(own.take(np.flatnonzero(logged)))
        residual = table.climate_residual_w
        residual = np.where(logged[table.groups], residual, self.climate.predict(table))
        self.drive.fit(replace(table, observed_w=table.observed_power_w - residual))
        return self

    def clone_tuned(self) -> SplitCorrector:
        """Unfitted copies with the settings that `fit` chose."""
        if self.split_:
            return SplitCorrector(self.climate.clone_tuned(), self.drive.clone_tuned(), self.joint, True)
        return SplitCorrector(self.climate, self.drive, self.joint.clone_tuned(), False)

    @property
    def _parts(self) -> tuple[PowerCorrector, ...]:
        return (self.climate, self.drive) if self.split_ else (self.joint,)

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]."""
        return np.asarray(sum(part.predict(table) for part in self._parts))

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Factors of the parts side by side, since the covariances of independent corrections add up."""
        return np.hstack([part.outside_factor(table) for part in self._parts])

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[FloatArray, FloatArray]:
        """Sum of the parts' residual powers, and their factors side by side."""
        powers, factors = zip(*(part.predict_with_uncertainty(table) for part in self._parts), strict=True)
        return np.asarray(sum(powers)), np.hstack(factors)

    def predict_climate(self, table: SegmentTable) -> FloatArray | None:
        """Correction of climate control [W]; None if climate control and driving are corrected jointly."""
        return self.climate.predict(table) if self.split_ else None


def climate_logged(table: SegmentTable) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether a trip logs the power of its climate control in every segment, shape (trips,)."""
    known = np.isfinite(table.climate_residual_w).astype(np.int64)
    return np.asarray(np.minimum.reduceat(known, table.offsets[:-1]) == 1)


def split_corrector(seed: int) -> SplitCorrector:
    """Make the default corrector.

    Climate control is corrected by an additive Gaussian process, driving and both jointly by the mean of such a process and boosting.
    """
    return SplitCorrector(
        GPCorrector(CLIMATE_TERMS, share_column="climate_w"),
        EnsembleCorrector([GPCorrector(DRIVE_TERMS), boosting_corrector(seed, DRIVE_TREE_FEATURES)]),
        EnsembleCorrector([GPCorrector(), boosting_corrector(seed)]),
    )
