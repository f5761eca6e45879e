"""Sequential estimation of a car's factors: several experts forecast each trip before they are updated by it.

An expert is a prior of the factors of a car and of the scale of its errors. The kinds are: the published values, one factor for
everything, a line by cause, the population of cars with wider or narrower spreads, and the car's own trips alone. Each expert is a Kalman
filter of the factors `w` and of a slow drift `g` of the consumption

    y_i = x_i' w + s_i g_i + e_i,   e_i ~ t(lambda n_i + m_i),   g_i = g_(i-1) exp(-dt / tau) + ...

with the residual energy `y_i` of a trip, its energies `x_i` by factor, its simulated energy `s_i`, its usual variance `n_i` and the
variance `m_i` of its measurement. The weight of an expert follows the likelihood of its forecasts so far under a t distribution; old
forecasts count less (Raftery, Karny and Ettler 2010, Technometrics 52). An outlying trip changes the factors less: its variance grows
with its own standardised error (Lange, Little and Taylor 1989). The estimate for the car is the mixture of all experts.
O(trips x experts x factors^2), the next trip O(experts x factors^2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, covariance_factor
from tripwatt.hybrid.factors import (
    EVERYTHING,
    NAMES,
    SDS,
    TAIL_DF,
    FactorCorrector,
    TripEvidence,
    drift_kept,
)
from tripwatt.hybrid.rows import Records
from tripwatt.vehicles import Vehicle

KINDS: Final = ("published", "one factor", "line by cause", "population", "own trips")
"""Kinds of experts."""

KIND_WEIGHTS: Final = (0.2, 0.02, 0.005, 0.77, 0.005)
"""Weight of each kind before any trip."""

SPREADS: Final = ((0.5, 1.0), (1.0, 1.0), (2.0, 0.2))
"""Scales of the population's spread, and their weights before any trip: together a prior with heavy tails. The factor `everything`
and the other factors have separate scales."""

CLIMATE_USE: Final = ((1.0, 1.0, 0.7), (0.5, 0.75, 0.2), (0.0, 1.0, 0.05), (0.0, 0.0, 0.05))
"""Share of the simulated climate control that a driver uses in mild and hot air, share of the heating in the cold, and their weight before
any trip: an assumption, since a log without climate control does not show it. Half of those who do without it in spring heat in winter."""

NOISES: Final = (0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Variances of a car's errors relative to the usual variance; a choice, in steps of two."""

DRIFTS: Final = ((0.03, 0.6), (0.07, 0.4))
"""Standard deviations of a slow drift of the consumption by season, tyres and ageing, as a share, and their weights before any trip;
choices. The residuals of the first and the second half of the logs differ by 3 to 12 % of the consumption, in the mean over the cars
about as much as this drift."""

MEMORY: Final = 0.98
"""Share of the experts' earlier evidence that is kept at each trip."""


@dataclass(frozen=True, eq=False)
class Innovations(Records):
    """Forecasts of trips, each made before the experts were updated by the trip.

    Attributes
    ----------
    mean_wh, sd_wh : ndarray, shape (trips,)
        Mean and standard deviation of the measured residual energy [Wh].
    weights : ndarray, shape (trips, kinds)
        Weight of each kind of expert before the trip.
    """

    mean_wh: FloatArray
    sd_wh: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Experts:
    """Distributions of one car's factors and drift by several experts, in usual standard deviations of the factors.

    Attributes
    ----------
    mean : ndarray, shape (experts, factors + 1)
        Mean of the factors and, last, of the drift.
    covariance : ndarray, shape (experts, factors + 1, factors + 1)
        Covariance of the factors and the drift.
    noise : ndarray, shape (experts,)
        Variance of the errors relative to the usual variance.
    drift : ndarray, shape (experts,)
        Variance of the drift before any trip.
    kind : ndarray of int, shape (experts,)
        Index in `KINDS`.
    log_prior, log_weight : ndarray, shape (experts,)
        Logarithms of the weights before any trip and now, up to a constant.
    day : float
        Day of the last trip, in days since 1970; NaN if unknown or before the first trip.
    trips : int
        Number of trips so far.
    """

    mean: FloatArray
    covariance: FloatArray
    noise: FloatArray
    drift: FloatArray
    kind: IntArray
    log_prior: FloatArray
    log_weight: FloatArray
    day: float = float("nan")
    trips: int = 0

    @classmethod
    def from_prior(
        cls,
        mean: FloatArray,
        covariance: FloatArray,
        shift: FloatArray | float = 0.0,
        own: FloatArray | float = 0.0,
    ) -> Experts:
        """Make the experts of a car before its first trip.

        Parameters
        ----------
        mean : ndarray, shape (factors,)
            Mean of the population.
        covariance : ndarray, shape (factors, factors)
            Covariance of the factors of a car of the population.
        shift : ndarray, shape (factors,)
            Expected factors in addition to those of the population, for a car unlike those with published values.
        own : ndarray, shape (factors,)
            Variances added for every expert, for a car unlike those of the population.
        """
        p = len(NAMES)
        zero, one = np.zeros(p) + shift, np.zeros((p, p))
        mean = mean + shift
        one[0, 0] = 1.0
        # published values are right within 3 %, or all wrong by some 20 %; choices
        # the deviations of a car that is like no other are three times as large; a choice
        beliefs = [
            (0, 1.0, zero, one * (0.03 / SDS[0]) ** 2),
            (1, 1.0, zero, one * (0.2 / SDS[0]) ** 2),
            (2, 1.0, zero, np.eye(p)),
            (4, 1.0, mean, covariance * 9.0),
        ]
        total = sum(weight for _, weight in SPREADS) ** 2
        for all_scale, all_weight in SPREADS:
            for scale, weight in SPREADS:
                scales = np.array([all_scale if name == EVERYTHING else scale for name in NAMES])
                beliefs.append((3, all_weight * weight / total, mean, covariance * np.outer(scales, scales)))
        climate = np.equal.outer(("heating", "mild_heating", "cooling"), NAMES) / SDS
        uses = [([cold - 1.0, mild - cold, mild - 1.0] @ climate, share) for mild, cold, share in CLIMATE_USE]
        noise = np.array(NOISES)
        # log-normal with a median of 0.75, and so a mean near 1
        by_noise = np.exp(-0.5 * np.log(noise / 0.75) ** 2)
        by_noise /= by_noise.sum()
        every = [
            (kind, KIND_WEIGHTS[kind] * weight * share * part, centre + use, spread, sd)
            for kind, weight, centre, spread in beliefs
            for use, share in uses
            for sd, part in DRIFTS
        ]
        full = np.zeros((len(every), p + 1, p + 1))
        full[:, :p, :p] = np.array([belief[3] for belief in every]) + np.diag(np.broadcast_to(own, p))
        drift = (np.array([belief[4] for belief in every]) / SDS[0]) ** 2
        full[:, p, p] = drift
        centres = np.column_stack([np.array([belief[2] for belief in every]), np.zeros(len(every))])
        logs = np.log(np.outer([belief[1] for belief in every], by_noise)).ravel()
        times = len(noise)
        return cls(
            np.repeat(centres, times, axis=0),
            np.repeat(full, times, axis=0),
            np.tile(noise, len(every)),
            np.repeat(drift, times),
            np.repeat(np.array([belief[0] for belief in every]), times),
            logs,
            logs,
        )

    @property
    def weights(self) -> FloatArray:
        """Probability of each expert, shape (experts,)."""
        weights = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weights / weights.sum())

    @property
    def kind_weights(self) -> FloatArray:
        """Probability of each kind, shape (kinds,)."""
        return np.asarray(np.bincount(self.kind, self.weights, len(KINDS)), dtype=np.float64)

    @property
    def noise_scale(self) -> float:
        """Expected variance of the errors relative to the usual variance."""
        return float(self.weights @ self.noise)

    def collapsed(self) -> tuple[FloatArray, FloatArray]:
        """Mean and covariance of the factors and the drift in the mixture of all experts."""
        weights = self.weights
        centre = weights @ self.mean
        apart = self.mean - centre
        return centre, np.tensordot(weights, self.covariance, 1) + (apart.T * weights) @ apart

    def corrector(self, vehicle: Vehicle) -> FactorCorrector:
        """Make the corrector of the car from the mixture of all experts."""
        mean, covariance = self.collapsed()
        drift_sd = float(np.sqrt(self.weights @ self.drift))
        day = self.day if np.isfinite(self.day) else None
        return FactorCorrector(vehicle.body.test_mass_kg, mean, covariance_factor(covariance), day, drift_sd)

    def at(self, day: float) -> Experts:
        """Move the experts to another day: the drift fades towards its prior. An unknown day counts as `USUAL_DAYS` later."""
        if not self.trips:
            return replace(self, day=day)
        kept = np.ones(self.mean.shape[1])
        kept[-1] = drift_kept(np.array([day]), self.day)[0]
        covariance = self.covariance * np.outer(kept, kept)
        covariance[:, -1, -1] += self.drift * (1.0 - kept[-1] ** 2)
        return replace(self, mean=self.mean * kept, covariance=covariance, day=day)

    def on_the_road(self) -> Experts:
        """Carry estimates from runs on a dynamometer over to the road: noise weights and drift return to their priors."""
        by_belief = self.weights.reshape(-1, len(NOISES)).sum(axis=1)
        usual = np.exp(self.log_prior.reshape(-1, len(NOISES)))
        share = usual / usual.sum(axis=1, keepdims=True)
        # no logarithm of zero
        logs = np.log(np.maximum(by_belief[:, None] * share, 1e-300)).ravel()
        mean, covariance = self.mean.copy(), self.covariance.copy()
        mean[:, -1] = 0.0
        covariance[:, -1, :] = covariance[:, :, -1] = 0.0
        covariance[:, -1, -1] = self.drift
        return replace(self, mean=mean, covariance=covariance, log_weight=logs, day=float("nan"), trips=0)

    def predict(self, evidence: TripEvidence) -> tuple[FloatArray, FloatArray]:
        """Forecast mean and standard deviation of the measured residual energy of trips [Wh], without updating the experts."""
        kept = drift_kept(evidence.day, self.day) if self.trips else np.ones(len(evidence))
        x = _with_drift(evidence.factors_wh) * np.column_stack([np.ones((len(kept), len(NAMES))), kept])
        each = self.mean @ x.T
        variance = np.einsum("oij,ni,nj->on", self.covariance, x, x)
        variance += np.outer(self.noise, evidence.usual_wh2) + evidence.measured_wh2
        variance += np.outer(self.drift, (1.0 - kept**2) * evidence.factors_wh[:, 0] ** 2)
        mean = self.weights @ each
        return mean, np.sqrt(self.weights @ (variance + (each - mean) ** 2))

    def learn(self, evidence: TripEvidence) -> tuple[Experts, Innovations]:
        """Forecast trips one after the other and update the experts by each; returns the updated experts and the forecasts."""
        now, mean, sd, weights = self, [], [], []
        for i, x in enumerate(_with_drift(evidence.factors_wh)):
            now = now.at(float(evidence.day[i]))
            weight = now.weights
            weights.append(now.kind_weights)
            spread = now.covariance @ x
            known = spread @ x
            noise = now.noise * evidence.usual_wh2[i] + evidence.measured_wh2[i]
            each, variance = now.mean @ x, known + noise
            mean.append(float(weight @ each))
            total = float(weight @ (variance + (each - mean[-1]) ** 2))
            sd.append(total**0.5)
            error = evidence.residual_wh[i] - each
            tail = np.log1p(error**2 / variance / (TAIL_DF - 2.0))
            density = -0.5 * ((TAIL_DF + 1.0) * tail + np.log(variance))
            unusual = (TAIL_DF + (evidence.residual_wh[i] - mean[-1]) ** 2 / total) / (TAIL_DF + 1.0)
            # a trip that fits well counts as two at most; a choice
            gain = spread / (known + noise * max(0.5, unusual))[:, None]
            now = replace(
                now,
                mean=now.mean + gain * error[:, None],
                covariance=now.covariance - gain[:, :, None] * spread[:, None, :],
                log_weight=MEMORY * now.log_weight + (1.0 - MEMORY) * now.log_prior + density,
                trips=now.trips + 1,
            )
        return now, Innovations(np.array(mean), np.array(sd), np.reshape(weights, (-1, len(KINDS))))


def _with_drift(factors_wh: FloatArray) -> FloatArray:
    """Energies by factor and, in the last column, by the drift, which acts on everything."""
    return np.column_stack([factors_wh, factors_wh[:, 0]])
