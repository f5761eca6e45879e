"""How far to trust what a started trip says of its rest: learned from held-out trips, never more than the process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.forecasting.process import EXACT_W2, Belief, HeldOutResidual, ResidualProcess
from tripwatt.forecasting.scores import Scores
from tripwatt.trips import FloatArray

BoolArray = npt.NDArray[np.bool_]

FRACTIONS: Final = (0.1, 0.25, 0.375, 0.5, 0.75, 0.9)
SURE: Final = 1.645
"""Standard errors to the lower end of a one-sided confidence interval of 95 %."""
LEAST: Final = 0.1
"""A smaller share is no reason to change a forecast."""
CHANNELS: Final = ("climate", "drive", "whole")
_POINT: Final = 0.9
_LEAST_TRIPS: Final = 5


@dataclass(frozen=True, eq=False)
class Gain:
    """Share of the process's update of the rest that is taken, by the fraction of the trip that was measured.

    The share is the one that explains the standardised errors of the rest over held-out trips best, at the lower
    end of its confidence interval: an update has to show that it helps. It lies between 0 (the departure forecast of the
    rest stands) and 1 (the process is right), and never falls as more is measured. Climate control, which is measured
    by itself, comes first; driving explains what is then left. `whole` is for samples that do not tell the two apart.

    What is then left of the rest is larger than the process says, or smaller: the factor by which the 90 % point of its
    standardised errors exceeds that of the errors before departure stretches the intervals on the way.

    Attributes
    ----------
    climate, drive, whole : ndarray, shape (len(FRACTIONS),)
    apart_spread, whole_spread : ndarray, shape (len(FRACTIONS),)
        Factor of the standard deviation of the rest, where climate control is told apart and where not.

    Examples
    --------
    >>> half, same = np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0]), np.ones(6)
    >>> Gain(half, half, half, same, same).at("drive", 0.3125)
    0.25
    """

    climate: FloatArray
    drive: FloatArray
    whole: FloatArray
    apart_spread: FloatArray
    whole_spread: FloatArray

    @classmethod
    def of(cls, process: ResidualProcess, trips: Sequence[HeldOutResidual], scale_wh: FloatArray) -> Gain:
        """Learn from held-out trips; `scale_wh` is the standard deviation of each total. O(trips x blocks^3)."""
        shares = np.zeros((len(FRACTIONS), len(CHANNELS)))
        spreads = np.ones((len(FRACTIONS), 2))
        split = np.array([process.apart and trip.climate_w is not None for trip in trips])
        own = np.array([process.sd_wh(trip.blocks) for trip in trips])
        before = _point(np.array([trip.error_wh for trip in trips]) / scale_wh)
        for row, fraction in enumerate(FRACTIONS):
            truth, climate, drive, whole, apart_sd, whole_sd = np.array(
                [_rest(process, trip, fraction) for trip in trips]
            ).T
            shares[row, 2] = _best_share(truth, whole, scale_wh)
            if split.any():
                shares[row, 0] = _best_share(truth[split], climate[split], scale_wh[split])
                left = truth - shares[row, 0] * climate
                shares[row, 1] = _best_share(left[split], drive[split], scale_wh[split])
            shares[: row + 1] = np.maximum.accumulate(shares[: row + 1], axis=0)
            errors = (
                truth - climate * shares[row, 0] - drive * shares[row, 1],
                truth - whole * shares[row, 2],
            )
            for column, (left, sd) in enumerate(zip(errors, (apart_sd, whole_sd), strict=True)):
                known = (sd > 0.0) & (split if column == 0 else True)
                if known.sum() >= _LEAST_TRIPS and before > 0.0:
                    spreads[row, column] = _point((left * own)[known] / (sd * scale_wh)[known]) / before
        return cls(*shares.T, *spreads.T)

    def at(self, channel: str, fraction: float) -> float:
        """Share of a channel at a measured fraction of the trip."""
        values: FloatArray = getattr(self, channel)
        return float(np.interp(fraction, (0.0, *FRACTIONS), np.concatenate(([0.0], values))))

    def spread(self, apart: bool, fraction: float) -> float:
        """Factor of the standard deviation of the rest at a measured fraction of the trip."""
        values = self.apart_spread if apart else self.whole_spread
        return float(np.interp(fraction, (0.0, *FRACTIONS), np.concatenate(([1.0], values))))

    def applied(self, channel: str, belief: Belief, ahead: BoolArray, fraction: float) -> Belief:
        """The belief with the mean of every block of which a part is still to come taken by the share."""
        kept = np.where(ahead, self.at(channel, fraction), 1.0)
        return Belief(belief.mean_w * kept, belief.covariance_w2)


def _rest(
    process: ResidualProcess, trip: HeldOutResidual, fraction: float
) -> tuple[float, float, float, float, float, float]:
    """Energy of the rest beyond the departure forecast [Wh].

    As it was; as climate, driving and the whole expect it; and its standard deviation, apart and as a whole.
    """
    blocks, left = trip.blocks, trip.residual_w
    share = np.cumsum(blocks.step_s) / blocks.step_s.sum()
    seen = np.flatnonzero(share <= fraction + 1e-9)
    weights, exact = np.eye(len(blocks))[seen], np.full(len(seen), EXACT_W2)
    hours = np.where(share > fraction + 1e-9, blocks.hours, 0.0)

    def expected(covariance: FloatArray, residual_w: FloatArray) -> tuple[float, float]:
        belief = Belief.of(covariance).given(weights, residual_w[seen], exact)
        return float(hours @ belief.mean_w), float(hours @ belief.covariance_w2 @ hours)

    climate_covariance, drive_covariance = (
        process.climate_covariance(blocks),
        process.drive_covariance(blocks),
    )
    whole = expected(climate_covariance + drive_covariance, left)
    climate = drive = (0.0, 0.0)
    if process.apart and trip.climate_w is not None:
        climate = expected(climate_covariance, process.limited(trip.climate_w))
        drive = expected(drive_covariance, left - trip.climate_w)
    apart_sd, whole_sd = np.sqrt(np.maximum([climate[1] + drive[1], whole[1]], 0.0))
    return float(hours @ left), climate[0], drive[0], whole[0], float(apart_sd), float(whole_sd)


def _point(errors: FloatArray) -> float:
    """Half width of the central 90 % interval of standardised errors."""
    return Scores.of(errors.tolist()).factor(_POINT)


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
