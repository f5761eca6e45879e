"""Shrinkage of an update on the way: the share of the process's update that held-out trips support."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.process import EXACT_W2, HeldOutResidual, ResidualProcess
from tripwatt.uncertainty.residual_power import PowerPrior, PowerSum, ResidualPower, own_mean_w

FRACTIONS: Final = (0.1, 0.25, 0.375, 0.5, 0.75, 0.9)
"""Measured fractions of a trip for which shares are estimated; a choice. Between the fractions shares are linear."""
SURE: Final = 1.645
"""Number of standard errors to the lower end of a one-sided confidence interval of 95 %."""
COMPONENTS: Final = ("climate", "drive", "joint", "off")


@dataclass(frozen=True, eq=False)
class UpdateShrinkage:
    """Share of the process's update that is applied to the rest of a trip, by the measured fraction of the trip.

    The share is the one that best explains the standardised errors of the rest over held-out trips, at the lower end of its
    confidence interval: only an improvement beyond chance counts. The share lies between 0 (the departure forecast of the rest
    stands) and 1 (the update is applied in full), and never falls as more is measured. Climate control, which is measured
    separately, is fitted first; driving explains the remainder. `joint` is for samples without the power of climate control.

    If climate control was off so far, it mostly stays off. `off` is the share of its expected power that the rest then saves, by
    least absolute errors over all fractions; it is used instead of `climate`.

    The intervals on the way are scaled by a factor: the 90 % point of the standardised errors of the rest over that of the errors
    before departure. The factor is limited so that the mean width over the held-out trips never grows on the way: larger chance
    errors of few trips at a later fraction do not widen the intervals.

    Attributes
    ----------
    climate, drive, joint : ndarray, shape (len(FRACTIONS),)
        Share of each component at the fractions `FRACTIONS` of a trip.
    split_sd_factor, joint_sd_factor : ndarray, shape (len(FRACTIONS),)
        Factor of the standard deviation of the rest, with separate and with joint components.
    off : ndarray, shape (len(FRACTIONS),)
        Share of the expected power of climate control that the rest saves if it was off so far.

    Examples
    --------
    >>> half, same = np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0]), np.ones(6)
    >>> shrinkage = UpdateShrinkage(half, half, half, same, same)
    >>> shrinkage.at("drive", 0.3125), shrinkage.sd_factor(split=True, fraction=0.5)
    (0.25, 1.0)
    """

    climate: FloatArray
    drive: FloatArray
    joint: FloatArray
    split_sd_factor: FloatArray
    joint_sd_factor: FloatArray
    off: FloatArray = field(default_factory=lambda: np.zeros(len(FRACTIONS)))

    @classmethod
    def from_trips(
        cls, process: ResidualProcess, trips: Sequence[HeldOutResidual], scale_wh: FloatArray
    ) -> UpdateShrinkage:
        """Estimate the shares from held-out trips. O(segments of all trips).

        Parameters
        ----------
        process : ResidualProcess
            Process of the residual power.
        trips : sequence of HeldOutResidual
            Trips that the corrector was not fitted on; if there are none, all shares are 0.
        scale_wh : ndarray, shape (trips,)
            Standard deviation of each trip's energy before departure [Wh].

        Returns
        -------
        UpdateShrinkage
            Shares and factors at the fractions `FRACTIONS`.

        Examples
        --------
        >>> from tripwatt.uncertainty.process import HeldOutResidual, Segments, fit_process
        >>> segments = Segments(np.arange(12) * 60.0, np.full(12, 60.0), np.full(12, 4000.0), np.zeros(12))
        >>> trips = [HeldOutResidual(segments, np.full(12, power)) for power in (-80.0, 60.0, 20.0, -30.0, 90.0)]
        >>> shrinkage = UpdateShrinkage.from_trips(fit_process(trips), trips, np.full(5, 15.0))
        >>> 0.0 <= shrinkage.at("joint", 0.25) <= shrinkage.at("joint", 0.75) <= 1.0
        True
        """
        shares = np.zeros((len(FRACTIONS), len(COMPONENTS)))
        sd_factors = np.ones((len(FRACTIONS), 2))
        if not trips:
            return cls(*np.vstack((shares.T[:3], sd_factors.T, shares.T[3:])))
        split = np.array([process.split and trip.climate_w is not None for trip in trips])
        process_sd_wh = np.array([process.prior(t.segments).sd_wh(t.segments.hours)[-1] for t in trips])
        before = _point(np.array([trip.error_wh for trip in trips]) / scale_wh)
        widths = np.ones(2)
        rests = np.array([_rests(process, trip) for trip in trips]).transpose(1, 0, 2)
        shares[:, 3] = _off_share(rests[:, :, 6], rests[:, :, 7], scale_wh)
        for row in range(len(FRACTIONS)):
            truth, climate, drive, joint, split_sd, joint_sd, off, _ = rests[row].T
            shares[row, 2] = _best_share(truth, joint, scale_wh)
            stays, on = off != 0.0, split & (off == 0.0)
            if on.any():
                shares[row, 0] = _best_share(truth[on], climate[on], scale_wh[on])
                left = truth - shares[row, 0] * climate
                shares[row, 1] = _best_share(left[on], drive[on], scale_wh[on])
            shares[: row + 1] = np.maximum.accumulate(shares[: row + 1], axis=0)
            climate = np.where(stays, off * shares[row, 3], climate * shares[row, 0])
            errors = truth - climate - drive * shares[row, 1], truth - joint * shares[row, 2]
            for column, (left, sd) in enumerate(zip(errors, (split_sd, joint_sd), strict=True)):
                known = (sd > 0.0) & (split if column == 0 else True)
                # a width from fewer trips would be chance; a choice
                if known.sum() >= 5 and before > 0.0:
                    factor = _point((left * process_sd_wh)[known] / (sd * scale_wh)[known]) / before
                    unscaled = float(np.sum((sd * scale_wh / process_sd_wh)[known]) / np.sum(scale_wh[known]))
                    sd_factors[row, column] = min(factor, widths[column] / unscaled)
                    widths[column] = sd_factors[row, column] * unscaled
        return cls(*np.vstack((shares.T[:3], sd_factors.T, shares.T[3:])))

    def at(self, component: str, fraction: float) -> float:
        """Share of a component at a measured fraction of the trip.

        Parameters
        ----------
        component : {"climate", "drive", "joint", "off"}
            Which share.
        fraction : float
            Part of the trip that was measured, 0 to 1.

        Returns
        -------
        float
            Share, 0 to 1; 0 before departure.
        """
        values: FloatArray = getattr(self, component)
        return float(np.interp(fraction, (0.0, *FRACTIONS), np.concatenate(([0.0], values))))

    def sd_factor(self, split: bool, fraction: float) -> float:
        """Factor of the standard deviation of the rest at a measured fraction of the trip.

        Parameters
        ----------
        split : bool
            Whether climate control was measured separately.
        fraction : float
            Part of the trip that was measured, 0 to 1.

        Returns
        -------
        float
            Factor; 1 before departure.
        """
        values = self.split_sd_factor if split else self.joint_sd_factor
        return float(np.interp(fraction, (0.0, *FRACTIONS), np.concatenate(([1.0], values))))

    def applied(
        self, component: str, posterior: ResidualPower, ahead: BoolArray, fraction: float
    ) -> ResidualPower:
        """Shrink the mean of every segment that is at least partly still to come, but for what was learned of the car.

        Parameters
        ----------
        component : {"climate", "drive", "joint", "off"}
            Component whose share is applied.
        posterior : ResidualPower
            The residual power after the measurements.
        ahead : ndarray of bool, shape (segments,)
            Whether a part of the segment is still to come.
        fraction : float
            Part of the trip that was measured, 0 to 1.

        Returns
        -------
        ResidualPower
            The posterior with shrunk means and the same covariance.

        Examples
        --------
        >>> from tripwatt.uncertainty import PowerPrior
        >>> half, same = np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0]), np.ones(6)
        >>> prior = PowerPrior(np.array([30.0, 90.0]), np.full((2, 1), 100.0), (), np.full(2, 400.0))
        >>> after = prior.measured(np.array([0]), np.array([50.0]), np.array([25.0]))
        >>> shrunk = UpdateShrinkage(half, half, half, same, same).applied("joint", after, np.array([False, True]), 0.4)
        >>> (shrunk.mean_w / after.mean_w).round(3).tolist()
        [1.0, 0.5]
        """
        kept, own_w = np.where(ahead, self.at(component, fraction), 1.0), own_mean_w(posterior)
        return PowerSum((posterior,), own_w + (posterior.mean_w - own_w) * kept)


def _off_share(off: FloatArray, not_drawn: FloatArray, scale_wh: FloatArray) -> float:
    """Share of the expected power that climate control saves after it was off, by least absolute error.

    `off` and `not_drawn` are energies of the rest, shape (fractions, trips): see `_rest`; `off` is 0 if climate control was not off.
    A driver leaves it off or turns it on, so the estimate is a weighted median. Returns 0 if there are too few trips.
    """
    stays = off != 0.0
    # a share of fewer trips would be chance; a choice
    if int(stays.any(axis=0).sum()) < 3:
        return 0.0
    share, weight = (not_drawn[stays] / off[stays]), (np.abs(off) / scale_wh)[stays]
    return float(np.clip(np.quantile(share, 0.5, weights=weight, method="inverted_cdf"), 0.0, 1.0))


def _rests(process: ResidualProcess, trip: HeldOutResidual) -> list[tuple[float, ...]]:
    """Return `_rest` for each of `FRACTIONS`."""
    split = process.split and trip.climate_w is not None
    names = ("joint", "climate", "drive") if split else ("joint",)
    priors = {name: process.prior(trip.segments, name) for name in names}
    return [_rest(process, trip, priors, fraction) for fraction in FRACTIONS]


def _rest(
    process: ResidualProcess, trip: HeldOutResidual, priors: Mapping[str, PowerPrior], fraction: float
) -> tuple[float, ...]:
    """Energy of the rest beyond the departure forecast [Wh], as eight numbers.

    1: observed. 2 to 4: expected by climate, by driving and by both jointly. 5 and 6: standard deviation, split and joint.
    7 and 8, only if climate control was off so far, else 0: the change if it stays off, and the observed change by climate control.
    """
    segments, left = trip.segments, trip.residual_w
    share = np.cumsum(segments.step_s) / segments.step_s.sum()
    seen = np.flatnonzero(share <= fraction + 1e-9)
    exact = np.full(len(seen), EXACT_W2)
    hours = np.where(share > fraction + 1e-9, segments.hours, 0.0)

    def expected(component: str, residual_w: FloatArray) -> tuple[float, float]:
        prior = priors[component]
        posterior = prior.measured(seen, residual_w[seen], exact) if len(seen) else prior
        mean_wh = np.cumsum(posterior.mean_w * hours)
        return float(mean_wh[-1]), float(posterior.sd_wh(hours)[-1] ** 2)

    joint = expected("joint", left)
    climate = drive = (0.0, 0.0)
    off = not_drawn = 0.0
    if trip.climate_w is not None and "climate" in priors:
        climate = expected("climate", process.limited(trip.climate_w))
        drive = expected("drive", left - trip.climate_w)
        if trip.climate_expected_w is not None and is_off(
            (trip.climate_w + trip.climate_expected_w)[seen], segments.step_s[seen]
        ):
            off, not_drawn = -float(hours @ trip.climate_expected_w), float(hours @ trip.climate_w)
    split_sd, joint_sd = np.sqrt(np.maximum([climate[1] + drive[1], joint[1]], 0.0))
    expected_wh = climate[0], drive[0], joint[0]
    return float(hours @ left), *expected_wh, float(split_sd), float(joint_sd), off, not_drawn


def is_off(climate_w: FloatArray, step_s: FloatArray) -> bool:
    """Whether measured climate control was off in every segment, for at least two minutes.

    Examples
    --------
    >>> is_off(np.array([0.0, 20.0]), np.array([60.0, 60.0])), is_off(np.array([0.0, 800.0]), np.array([60.0, 60.0]))
    (True, False)
    """
    # fans and valves take less than 50 W; heaters and compressors start within the first two minutes
    return bool(step_s.sum() >= 120.0 and np.all(climate_w <= 50.0))


def _point(errors: FloatArray) -> float:
    """Half width of the central 90 % interval of standardised errors."""
    return ConformalScores.from_errors(errors.tolist()).factor(0.9)


def _best_share(truth: FloatArray, expected: FloatArray, scale_wh: FloatArray) -> float:
    """Share of `expected` that explains `truth`, 0 to 1.

    It is the lower end of the one-sided confidence interval of the slope, in a regression of standardised errors through the origin.
    """
    t, x = truth / scale_wh, expected / scale_wh
    size = float(x @ x)
    if size <= 0.0:
        return 0.0
    slope = float(x @ t) / size
    error = float(np.sqrt(np.mean((t - slope * x) ** 2) / size))
    share = float(np.clip(slope - SURE * error, 0.0, 1.0))
    # a smaller share is no reason to change a forecast; a choice
    return share if share >= 0.1 else 0.0
