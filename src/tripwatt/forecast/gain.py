"""How far to trust what a started trip says of its rest: learned from held-out trips, never more than the process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.forecast.process import EXACT_W2, Belief, HeldOutResidual, ResidualProcess
from tripwatt.trips import FloatArray

BoolArray = npt.NDArray[np.bool_]

FRACTIONS: Final = (0.1, 0.25, 0.375, 0.5, 0.75, 0.9)
SURE: Final = 1.645
"""Standard errors to the lower end of a one-sided confidence interval of 95 %."""
LEAST: Final = 0.1
"""A smaller share is no reason to change a forecast."""
CHANNELS: Final = ("climate", "drive", "whole")


@dataclass(frozen=True, eq=False)
class Gain:
    """Share of the process's update of the rest that is taken, by the fraction of the trip that was measured.

    The share is the one that explains the standardised errors of the rest over held-out trips best, at the lower
    end of its confidence interval: an update has to show that it helps. It lies between 0 (the departure forecast of the rest stands) and 1 (the process
    is right), and never falls as more is measured. Climate control, which is measured
    by itself, comes first; driving explains what is then left. `whole` is for samples that do not tell the two apart.

    Attributes
    ----------
    climate, drive, whole : ndarray, shape (len(FRACTIONS),)

    Examples
    --------
    >>> half = np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0])
    >>> Gain(half, half, half).at("drive", 0.3125)
    0.25
    """

    climate: FloatArray
    drive: FloatArray
    whole: FloatArray

    @classmethod
    def of(cls, process: ResidualProcess, trips: Sequence[HeldOutResidual], scale_wh: FloatArray) -> Gain:
        """Learn from held-out trips. O(trips x blocks^3)."""
        shares = np.zeros((len(FRACTIONS), len(CHANNELS)))
        split = np.array([process.apart and trip.climate_w is not None for trip in trips])
        for row, fraction in enumerate(FRACTIONS):
            rests = np.array([_rest(process, trip, fraction) for trip in trips])
            truth, climate, drive, whole = rests.T
            shares[row, 2] = _best_share(truth, whole, scale_wh)
            if split.any():
                shares[row, 0] = _best_share(truth[split], climate[split], scale_wh[split])
                left = truth - shares[row, 0] * climate
                shares[row, 1] = _best_share(left[split], drive[split], scale_wh[split])
        return cls(*np.maximum.accumulate(shares, axis=0).T)

    def at(self, channel: str, fraction: float) -> float:
        """Share of a channel at a measured fraction of the trip."""
        values: FloatArray = getattr(self, channel)
        return float(np.interp(fraction, (0.0, *FRACTIONS), np.concatenate(([0.0], values))))

    def applied(self, channel: str, belief: Belief, ahead: BoolArray, fraction: float) -> Belief:
        """The belief with the mean of every block of which a part is still to come taken by the share."""
        kept = np.where(ahead, self.at(channel, fraction), 1.0)
        return Belief(belief.mean_w * kept, belief.covariance_w2)


def _rest(
    process: ResidualProcess, trip: HeldOutResidual, fraction: float
) -> tuple[float, float, float, float]:
    """Energy of the rest beyond the departure forecast [Wh]: as it was; as climate, driving and the whole expect it."""
    blocks, left = trip.blocks, trip.residual_w
    share = np.cumsum(blocks.step_s) / blocks.step_s.sum()
    seen = np.flatnonzero(share <= fraction + 1e-9)
    weights, exact = np.eye(len(blocks))[seen], np.full(len(seen), EXACT_W2)
    hours = np.where(share > fraction + 1e-9, blocks.hours, 0.0)

    def expected(covariance: FloatArray, residual_w: FloatArray) -> float:
        return float(hours @ Belief.of(covariance).given(weights, residual_w[seen], exact).mean_w)

    climate_covariance, drive_covariance = (
        process.climate_covariance(blocks),
        process.drive_covariance(blocks),
    )
    whole = expected(climate_covariance + drive_covariance, left)
    climate = drive = 0.0
    if process.apart and trip.climate_w is not None:
        climate = expected(climate_covariance, process.limited(trip.climate_w))
        drive = expected(drive_covariance, left - trip.climate_w)
    return float(hours @ left), climate, drive, whole


def _best_share(truth: FloatArray, expected: FloatArray, scale_wh: FloatArray) -> float:
    """Share of `expected` that explains `truth`, held in 0..1.

    Regression of standardised errors through the origin: the lower end of the slope's one-sided confidence interval.
    """
    t, x = truth / scale_wh, expected / scale_wh
    size = float(x @ x)
    if size <= 0.0:
        return 0.0
    slope = float(x @ t) / size
    error = float(np.sqrt(np.mean((t - slope * x) ** 2) / size))
    share = float(np.clip(slope - SURE * error, 0.0, 1.0))
    return share if share >= LEAST else 0.0
