"""A corrector of one car for a second car: a hierarchical model, conditioned on a few trips of the second car.

The corrector is a Gaussian process, linear in weights `w` of known features. Its posterior on the first car has mean
`m` and covariance `C`; its prior variances, estimated by marginal likelihood, are `V`. For another car

    w' = rho_s w + own,   own ~ N(0, tau^2 (1 - rho_s^2) V),   theta ~ N(0, kappa^2 W),
    residual energy of trip i = x_i' w' + s_i' theta + error_i,   error_i ~ N(0, lambda * n_i + m_i).

`rho_s` is the share of the correction of stage `s` that cars have in common: climate control is used alike in cars whose road loads
differ, so the stages of a corrector that keeps them apart have shares of their own. `theta` is the relative error of a few physical parameters
with published widths `W` (`tripwatt.hybrid.parameters`), `tau` and `kappa` how much cars differ in the one and the other,
`n_i` the variance of a trip as estimated from the first car's held-out trips, and `m_i` that of the measurement of its energy. One car carries no information about
how much cars differ, so `rho_s`, `tau`, `kappa` and `lambda` have flat priors on a grid and are integrated by their marginal likelihood on the second car's trips (empirical
Bayes without a choice: Gelman et al., Bayesian Data Analysis, section 5.4; Rasmussen and Williams 2006, section 5.2).
Without a trip half of the correction is taken. The absolute error is convex in the share, so half of a correction is
never worse than the mean of none and all of it.

Outside of what the first car has seen the share fades: `rho_s` of a segment is multiplied by exp(-d^2 / 2) with d the
distance from the range of each covariate in its standard deviations; what is lost comes back as variance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import InvalidInput
from tripwatt.hybrid.familiarity import kept_share
from tripwatt.hybrid.levels import Level, Mixture
from tripwatt.hybrid.parameters import PARAMETERS, Parameter
from tripwatt.hybrid.power import GPCorrector, PowerCorrector
from tripwatt.hybrid.segments import SegmentTable
from tripwatt.learners.gp import KernelTerm
from tripwatt.vehicles import Vehicle

SHARES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
STAGE_SHARES: Final = (0.0, 0.5, 1.0)
"""Shares of each stage where a corrector has several: the grid has every combination."""
OWN_SCALES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""At 1 both cars are alike before any trip: each correction is drawn from the same prior. More would mean that the published
values of the second car are worse than those of the first."""
PUBLISHED_SCALES: Final = (0.5, 1.0, 1.5)
"""Without 0: published values of a car always have errors."""
NOISE_SCALES: Final = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Variance of a trip's error over that of the first car's: before any trip, half is as likely as double."""
MODES: Final = ("effects", "parameters", "both")
"""What may differ between cars: terms of the corrector, physical parameters, or both."""

_DRIVING: Final = frozenset({"speed_m_s", "speed_change_m_s2", "trip_speed_m_s"})
_CLIMATE: Final = frozenset({"ambient_temperature_degc", "cabin_temperature_degc", "cabin_setpoint_degc"})


@dataclass(frozen=True, slots=True)
class Option:
    """One point of the grid: shares in common by stage, scales of what is own and of published values, of the error's variance."""

    shares: tuple[float, ...]
    own: float
    published: float
    noise: float

    @property
    def share(self) -> float:
        """Mean of the shares of all stages."""
        return sum(self.shares) / len(self.shares)

    @property
    def scales(self) -> tuple[float, ...]:
        """Scale of each level: in common by stage, own by stage, lost by stage, parameters."""
        own = (self.own * math.sqrt(1.0 - share**2) for share in self.shares)
        return (*self.shares, *own, *self.shares, self.published)


def grid(mode: str = "both", stages: int = 1) -> tuple[Option, ...]:
    """Every option of a mode, all of the same weight before any trip.

    Examples
    --------
    >>> len(grid("both")), len(grid("both", stages=2)), {o.published for o in grid("effects")}
    (375, 675, {0.0})
    """
    own = OWN_SCALES if mode != "parameters" else (0.0,)
    published = PUBLISHED_SCALES if mode != "effects" else (0.0,)
    shares = product(SHARES if stages == 1 else STAGE_SHARES, repeat=stages)
    return tuple(Option(r, t, b, n) for r, t, b, n in product(shares, own, published, NOISE_SCALES))


def require_mode(mode: str) -> None:
    """Raise `InvalidInput` for an unknown mode."""
    if mode not in MODES:
        raise InvalidInput.of("unknown adaptation mode", "mode", repr(mode), ", ".join(MODES))


@dataclass(frozen=True, eq=False)
class Members:
    """The Gaussian processes of a corrector, side by side: one, or one for each channel.

    Attributes
    ----------
    correctors : tuple of GPCorrector
    """

    correctors: tuple[GPCorrector, ...]

    @classmethod
    def from_corrector(cls, corrector: PowerCorrector) -> Members:
        """Those of any corrector.

        Raises
        ------
        InvalidInput
            When there is none.
        """
        if not corrector.processes:
            got, allowed = type(corrector).__name__, "linear, gp, ensemble or split"
            raise InvalidInput.of("corrector cannot be transferred", "corrector", got, allowed)
        return cls(corrector.processes)

    @property
    def terms(self) -> tuple[KernelTerm, ...]:
        """Terms of all of them."""
        return tuple(term for corrector in self.correctors for term in corrector.terms)

    @property
    def sizes(self) -> list[int]:
        """Number of features of each term."""
        return [
            1 if term.kind == "line" else corrector.model.whiteners_[i].shape[1]
            for corrector in self.correctors
            for i, term in enumerate(corrector.terms)
        ]

    @property
    def stage(self) -> IntArray:
        """Which of them each feature belongs to, shape (features,)."""
        counts = [len(c.model.weights_) for c in self.correctors]
        return np.repeat(np.arange(len(counts)), counts)

    @property
    def weights(self) -> FloatArray:
        """Posterior mean of the weights, shape (features,)."""
        return np.concatenate([c.model.weights_ for c in self.correctors])

    @property
    def variances(self) -> FloatArray:
        """Variance of each weight before any trip, shape (features,)."""
        by_term = [c.model.variances_[: len(c.terms)] for c in self.correctors]
        return np.repeat(np.concatenate(by_term), self.sizes)

    @property
    def shape(self) -> FloatArray:
        """Weights of the shape within a trip, shape (features,)."""
        return np.concatenate([c.shape for c in self.correctors])

    def features(self, table: SegmentTable) -> FloatArray:
        """Features of each row [W], shape (rows, features)."""
        return np.hstack([c.model.features(table.features)[0] for c in self.correctors])

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W] of the first car's correction, as it is."""
        return np.asarray(np.sum([c.predict(table) for c in self.correctors], axis=0))

    def familiarity(self, table: SegmentTable) -> FloatArray:
        """How near each row is to the training: 1 inside, towards 0 far outside, shape (rows,)."""
        distances: dict[str, FloatArray] = {}
        for corrector in self.correctors:
            for name, beyond in corrector.familiarity.distances(table.features).items():
                distances[name] = np.minimum(beyond, distances.get(name, np.inf))
        return kept_share(len(table.hours), distances)


def term_scales(members: Members, source: Vehicle, target: Vehicle) -> FloatArray:
    """Factor of each weight's feature from one car to the other, shape (features,).

    A line multiplies a simulated cause and needs no scale. A smooth term is in watts: one of speed is scaled by the
    mass of the car, one of the climate's temperatures by the heat loss of the cabin at standstill.
    """
    mass = target.body.test_mass_kg / source.body.test_mass_kg
    heat = 1.0
    if source.climate is not None and target.climate is not None:
        heat = (target.climate.shell_w_k + target.climate.fresh_air_low_w_k) / (
            source.climate.shell_w_k + source.climate.fresh_air_low_w_k
        )
    factors = []
    for term in members.terms:
        columns = set(term.columns)
        factor = 1.0
        if term.kind == "smooth" and columns & _CLIMATE:
            factor = heat
        elif term.kind == "smooth" and columns & _DRIVING:
            factor = mass
        factors.append(factor)
    return np.repeat(np.array(factors), members.sizes)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Trips of the second car: their energies, linear in the weights.

    Attributes
    ----------
    world, own, lost : ndarray, shape (trips, features)
        Features of the common part (faded outside the training range), of the car's own part, of what faded [Wh].
    physical : ndarray, shape (trips, parameters)
        Energy by a relative change of 1 of each parameter [Wh].
    noise_wh2 : ndarray, shape (trips,)
        Variance of a trip that the first car's held-out trips let expect.
    residual_wh : ndarray, shape (trips,)
        Observed minus simulated; NaN where nothing was measured.
    measured_wh2 : ndarray or None, shape (trips,)
        Variance of the measurement of each trip's energy; None where all are exact.
    """

    world: FloatArray
    own: FloatArray
    lost: FloatArray
    physical: FloatArray
    noise_wh2: FloatArray
    residual_wh: FloatArray
    measured_wh2: FloatArray | None = None

    @property
    def measured(self) -> FloatArray:
        """Variance of the measurement of each trip's energy [Wh²], shape (trips,)."""
        return np.zeros(len(self.noise_wh2)) if self.measured_wh2 is None else self.measured_wh2

    def error_wh2(self, scale: float) -> FloatArray:
        """Variance of each trip's measured energy [Wh²] where the errors of the model have this scale, shape (trips,)."""
        return np.asarray(scale * self.noise_wh2 + self.measured)

    def take(self, members: Sequence[int] | IntArray) -> Evidence:
        """Some of the trips."""
        index = np.asarray(members, dtype=np.int64)
        parts = (
            self.world,
            self.own,
            self.lost,
            self.physical,
            self.noise_wh2,
            self.residual_wh,
            self.measured,
        )
        return Evidence(*(part[index] for part in parts))


@dataclass(frozen=True, eq=False)
class CarTransfer:
    """A corrector of one car, transferred to another.

    Attributes
    ----------
    members : Members
        Fitted on the first car.
    scales : ndarray, shape (features,)
        From `term_scales`.
    parameters : tuple of Parameter
    mode : str
        One of `MODES`.
    """

    members: Members
    scales: FloatArray
    parameters: tuple[Parameter, ...] = PARAMETERS
    mode: str = "both"

    @cached_property
    def options(self) -> tuple[Option, ...]:
        """The grid."""
        return grid(self.mode, len(self.members.correctors))

    def evidence(self, table: SegmentTable, physical_w: FloatArray, noise_wh2: FloatArray) -> Evidence:
        """Trips of the second car. O(rows x features).

        Parameters
        ----------
        table : SegmentTable
        physical_w : ndarray, shape (rows, parameters)
            From `sensitivities`.
        noise_wh2 : ndarray, shape (trips,)
        """
        rows = self.rows(table)
        residual = np.full(len(table), np.nan)
        if table.observed_w is not None:
            residual = table.totals_wh(table.residual_w)
        world, own, lost, physical = (_totals(table, segment) for segment in (*rows, physical_w))
        measured = table.energy_errors.own_wh**2
        return Evidence(world, own, lost, physical, noise_wh2, residual, measured)

    def rows(self, table: SegmentTable) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Features of segments [W]: in common, own, lost; each of shape (rows, features)."""
        features = self.members.features(table) * self.scales
        trust = self.members.familiarity(table)[:, None]
        return features * trust, features, features * np.sqrt(1.0 - trust**2)

    def given(self, evidence: Evidence) -> Mixture:
        """The levels of the second car's weights, given its trips: in common, own, lost, each by stage; then the parameters."""
        correctors, its = self.members.correctors, self.members.stage
        stages = [np.flatnonzero(its == k) for k in range(len(correctors))]
        before = self.members.variances
        common = [
            Level(evidence.world[:, stage], corrector.model.factor_, corrector.model.weights_)
            for stage, corrector in zip(stages, correctors, strict=True)
        ]
        independent = [
            Level(part[:, stage], before[stage]) for part in (evidence.own, evidence.lost) for stage in stages
        ]
        widths = np.array([parameter.width**2 for parameter in self.parameters])
        return Mixture(
            (*common, *independent, Level(evidence.physical, widths)),
            np.array([option.scales for option in self.options]),
            np.array([option.noise for option in self.options]),
            evidence.noise_wh2,
            evidence.measured,
            evidence.residual_wh,
        )

    def posterior(self, evidence: Evidence) -> Posterior:
        """Posterior of the second car's weights given its trips, integrated over the grid: see `Mixture.posterior`."""
        given = self.given(evidence)
        return Posterior(*given.posterior(), self.options, given.weights, float(given.noise @ given.weights))

    def left_out(self, evidence: Evidence) -> tuple[FloatArray, FloatArray]:
        """Mean and variance [Wh, Wh²] of each trip's residual energy given all others: see `Mixture.left_out`."""
        return self.given(evidence).left_out()

    def predict_draws(self, evidence: Evidence, draws: IntArray, score: IntArray) -> DrawsForecast:
        """Residual energy of some trips, given each of many draws of other trips: see `Mixture.given_draws`."""
        mean, variance, weights = self.given(evidence).given_draws(draws, score)
        share = weights.T @ np.array([option.share for option in self.options])
        return DrawsForecast(mean, np.sqrt(variance), share)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of a car's weights and parameters after some of its trips.

    Attributes
    ----------
    mean, covariance : ndarray, shapes (3 x features + parameters,) and its square
        Of the weights in common, the car's own, those of what faded, and the parameters' relative changes.
    options, weights : tuple of Option, ndarray
        The grid and its posterior probabilities.
    noise_scale : float
        Mean of the error's variance over that of the first car.
    """

    mean: FloatArray
    covariance: FloatArray
    options: tuple[Option, ...]
    weights: FloatArray
    noise_scale: float

    @property
    def shares(self) -> tuple[float, ...]:
        """Means of the shares in common, by stage."""
        return tuple((self.weights @ np.array([option.shares for option in self.options])).tolist())

    @property
    def share(self) -> float:
        """Mean of the shares of all stages."""
        return sum(self.shares) / len(self.shares)

    def parameters(self, names: Sequence[str]) -> Mapping[str, tuple[float, float]]:
        """Relative change of each parameter and its standard deviation."""
        n = len(names)
        if not n:
            return MappingProxyType({})
        sd = np.sqrt(np.maximum(np.diag(self.covariance)[-n:], 0.0))
        return MappingProxyType(
            {k: (float(m), float(s)) for k, m, s in zip(names, self.mean[-n:], sd, strict=True)}
        )


@dataclass(frozen=True, eq=False)
class DrawsForecast:
    """Residual energies [Wh] given each draw: mean and standard deviation of shape (draws, trips), and the share."""

    mean_wh: FloatArray
    sd_wh: FloatArray
    share: FloatArray


def _totals(table: SegmentTable, rows_w: FloatArray) -> FloatArray:
    """Energy of each trip [Wh] of every column."""
    return np.asarray(np.add.reduceat(rows_w * table.hours[:, None], table.offsets[:-1], axis=0))
