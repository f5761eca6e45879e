"""Energy of the unknown climb of a road: scenarios of net climb and of hills on the way, combined with the other errors."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.routes.terrain import NetClimbs
from tripwatt.uncertainty.conformal import ConformalScores

PLACES: Final = 13
"""Number of places along the way at which quantiles are solved; between the places they are interpolated linearly."""


@dataclass(frozen=True, eq=False)
class ClimbingEnergy:
    """Energy of one drive if its road climbed more or less than expected, and if its road went up and down.

    Attributes
    ----------
    grade : ndarray, shape (grades,)
        Constant grades in addition to that of the expected climb, ascending [1].
    even_wh : ndarray, shape (grades, places)
        Energy beyond that of the expected climb up to each place along the way, at these grades [Wh].
    hill : ndarray, shape (hills,)
        Grades of roads that go up and down in turn, ascending from 0 [1].
    hill_wh : ndarray, shape (hills, places)
        Energy that hills add to that of the expected climb [Wh].
    distance_m : ndarray, shape (places,)
        Distance driven up to each place [m].
    net : NetClimbs
        Distribution of the climb of such a road.

    Examples
    --------
    >>> from tripwatt.routes.terrain import net_climbs
    >>> grade, hill, way = np.array([-0.05, 0.0, 0.05]), np.array([0.0, 0.05]), np.array([0.0, 5e3, 1e4])
    >>> even_wh, hill_wh = np.outer([-1300.0, 0.0, 2600.0], way / 1e4), np.outer([0.0, 500.0], way / 1e4)
    >>> drive = ClimbingEnergy(grade, even_wh, hill, hill_wh, way, net_climbs())
    >>> float(drive.more_wh(100.0)), round(drive.climb_for(520.0), 6), drive.climb_for(9e9)
    (520.0, 100.0, None)
    """

    grade: FloatArray
    even_wh: FloatArray
    hill: FloatArray
    hill_wh: FloatArray
    distance_m: FloatArray
    net: NetClimbs

    def more_wh(self, climb_m: Any, from_m: float = 0.0) -> Any:
        """Energy that a net climb of `climb_m` from `from_m` to the end adds to that of the expected one [Wh]; numbers or arrays."""
        even, ahead_m = self._energy_from(self.even_wh, from_m)[:, -1:], float(self.distance_m[-1]) - from_m
        grade = (np.asarray(climb_m)[..., None] - self.net.expected_m(ahead_m, from_m)) / max(ahead_m, 1e-9)
        return _interpolated(self.grade, even, grade)[..., 0]

    def climb_for(self, energy_wh: float, from_m: float = 0.0) -> float | None:
        """Net climb from `from_m` to the end that adds an energy [m]: inverse of `more_wh`; None if no road climbs that much."""
        ahead = float(self.distance_m[-1]) - from_m
        most = float(self.net.limit(max(ahead, 0.0)))
        if ahead <= 0.0 or self.more_wh(most, from_m) < energy_wh:
            return None
        climbs = np.linspace(0.0, most, 65)
        return float(np.interp(energy_wh, self.more_wh(climbs, from_m), climbs))

    @cached_property
    def whole(self) -> UnknownClimb:
        """Energies that the unknown climb of the whole road may add."""
        return self.ahead()

    def ahead(self, from_m: float = 0.0) -> UnknownClimb:
        """Energies that the unknown climb from `from_m` on may add; 0 up to `from_m`."""
        distance = np.maximum(self.distance_m - from_m, 0.0)
        beyond = self.net.net_m(distance, from_m) - self.net.expected_m(distance, from_m)
        even_wh = self._energy_from(self.even_wh, from_m)
        if self.net.known is None:
            added_wh = _interpolated(self.grade, even_wh, beyond / np.maximum(distance, 1e-9))
        else:  # the error differs along the way
            steps = np.diff(beyond, axis=1, prepend=0.0) / np.maximum(np.diff(distance, prepend=0.0), 1e-9)
            each_wh = _interpolated(self.grade, np.diff(even_wh, axis=1, prepend=0.0), steps)
            added_wh = np.cumsum(each_wh, axis=1)
        hills_wh = self._energy_from(self.hill_wh, from_m)
        added_wh += _interpolated(self.hill, hills_wh, self.net.local_grade()[:, None])
        return UnknownClimb(added_wh, self.net.weights)

    def _energy_from(self, energy_wh: FloatArray, from_m: float) -> FloatArray:
        start = [np.interp(from_m, self.distance_m, row) for row in energy_wh]
        return np.where(self.distance_m > from_m, energy_wh - np.array(start)[:, None], 0.0)


def _interpolated(nodes: FloatArray, rows: FloatArray, at: FloatArray) -> FloatArray:
    """Interpolate rows of values at nodes linearly, and extrapolate beyond; `at` has shape (scenarios, places or 1)."""
    slopes = np.diff(rows, axis=0) / np.diff(nodes)[:, None]
    start = min(int(np.searchsorted(nodes, 0.0)), len(nodes) - 2)  # from the flat road, where they are exact
    values = rows[start] + slopes[start] * (at - nodes[start])
    for k, bend in enumerate(np.diff(slopes, axis=0), start=1):
        beyond = at - nodes[k] if k > start else nodes[k] - at
        values += bend * np.maximum(beyond, 0.0)
    return np.asarray(values)


@dataclass(frozen=True, eq=False)
class UnknownClimb:
    """Weighted scenarios of the energy that the climb of a road may add.

    Climb plus an independent error of known scale has a mixture distribution: that of the error around each scenario.

    Attributes
    ----------
    offsets_wh : ndarray, shape (scenarios, places)
        Energy beyond that of a flat road up to each place [Wh].
    weights : ndarray, shape (scenarios,)
        Probabilities of the scenarios; they add up to 1.

    Examples
    --------
    >>> scores = ConformalScores.from_errors([0.2, 0.5, 1.0, 2.0])
    >>> level = UnknownClimb(np.zeros((1, 2)), np.ones(1))
    >>> float(level.quantile(scores, np.array([0.9]), np.full(2, 100.0))[0, -1].round(3))
    200.0
    >>> two = UnknownClimb(np.array([[0.0, -400.0], [0.0, 400.0]]), np.array([0.5, 0.5]))
    >>> middle = float(two.quantile(scores, np.array([0.5]), np.full(2, 100.0))[0, -1])
    >>> abs(middle) < 1e-3, round(float(two.probability_below(scores, np.full(2, 400.0), np.full(2, 100.0))[-1]), 3)
    (True, 0.749)
    """

    offsets_wh: FloatArray
    weights: FloatArray
    _solved: dict[tuple[ConformalScores, bytes, bytes], FloatArray] = field(default_factory=dict, init=False)

    @cached_property
    def core_sd_wh(self) -> FloatArray:
        """Half the width of the central 68 % interval of the climb's energy at each place [Wh], shape (places,)."""
        return np.asarray(0.5 * (self._climb_quantiles(0.84) - self._climb_quantiles(0.16)))

    def quantile(self, scores: ConformalScores, p: FloatArray, sd_wh: FloatArray) -> FloatArray:
        """Quantiles of the sum of climb and error at each place [Wh], shape (probabilities, places). O(scenarios x probabilities x `PLACES`).

        Solved once for the same arguments: forecasts from several charges ask for the same medians.

        Parameters
        ----------
        scores : ConformalScores
            Distribution of the standardised error.
        p : ndarray, shape (probabilities,)
            Probabilities, above 0 and below 1.
        sd_wh : ndarray, shape (places,)
            Standard deviation of the error [Wh].
        """
        key = scores, p.tobytes(), sd_wh.tobytes()
        if key not in self._solved:
            places = np.linspace(0, len(sd_wh) - 1, min(len(sd_wh), PLACES)).round().astype(np.int64)
            some = UnknownClimb(np.tile(self.offsets_wh[:, places], len(p)), self.weights)
            solved_wh = some.quantiles(scores, np.repeat(p, len(places)), np.tile(sd_wh[places], len(p)))
            rows = solved_wh.reshape(len(p), -1)
            self._solved[key] = np.array([np.interp(np.arange(len(sd_wh)), places, row) for row in rows])
        return self._solved[key]

    def quantiles(self, scores: ConformalScores, p: FloatArray, sd_wh: FloatArray) -> FloatArray:
        """Quantiles of the sum of climb and error [Wh], in the broadcast shape of `p`, `sd_wh` and the places (or the only place).

        Solved by secant steps, with bisection if a step leaves the bracket: Dekker (1969), Finding a zero by means of
        successive linear interpolation.
        """
        # probabilities of 0 and 1 are moved inside by this much, as for the scores alone
        offsets, sd, p = self.offsets_wh, np.maximum(sd_wh, 1e-9), np.clip(p, 5e-10, 1.0 - 5e-10)
        alone = _error_quantiles_wh(scores, p, sd)
        least, most = self._ascending[0] + alone, self._ascending[-1] + alone + 1e-9
        middle = self._climb_quantiles(0.5)
        # that of a normal distribution in its middle
        slope = 1.6 * p * (1.0 - p) / np.hypot(self.core_sd_wh, sd)
        energy_wh = middle + np.sign(alone) * np.hypot(alone, self._climb_quantiles(p) - middle)
        energy_wh = np.minimum(np.maximum(energy_wh, least), most)
        miss = self.weights @ scores.probabilities((energy_wh - offsets) / sd) - p
        # bounds the time: the last 40 steps halve the bracket
        for step in range(60):
            # tolerance of the probability; smaller differences are rounding of the sum
            unsolved = np.abs(miss) >= 1e-12
            if not unsolved.any():
                break
            least, most = np.where(miss < 0.0, energy_wh, least), np.where(miss < 0.0, most, energy_wh)
            to = energy_wh - miss / slope
            # bisection after 20 secant steps without convergence; a choice
            outside = (to < least) | (to > most) | (step >= 20)
            to = np.where(outside, 0.5 * (least + most), to)
            before_wh, energy_wh = energy_wh, np.where(unsolved, to, energy_wh)
            before, miss = miss, self.weights @ scores.probabilities((energy_wh - offsets) / sd) - p
            gained, moved = miss - before, energy_wh - before_wh
            slope = np.divide(gained, moved, out=slope, where=gained * moved > 0.0)
        return np.asarray(energy_wh)

    def probability_below(
        self, scores: ConformalScores, energy_wh: FloatArray, sd_wh: FloatArray
    ) -> FloatArray:
        """Probability that the sum of climb and error stays below an energy [Wh] at each place, shape (places,): inverse of `quantile`."""
        ways = (energy_wh - self.offsets_wh) / np.maximum(sd_wh, 1e-9)
        return np.asarray(self.weights @ scores.probabilities(ways))

    def _climb_quantiles(self, p: FloatArray | float) -> FloatArray:
        """Quantiles of the climb alone [Wh], in the broadcast shape of `p` and the places."""
        k = np.minimum(np.searchsorted(np.cumsum(self.weights), p), len(self.weights) - 1)
        return np.asarray(self._ascending[k, np.arange(self.offsets_wh.shape[1])])

    @cached_property
    def _ascending(self) -> FloatArray:
        return np.sort(self.offsets_wh, axis=0)


@dataclass(frozen=True, eq=False)
class Excess:
    """Distribution of a trip's energy beyond the expected one up to each place: an error of known scale and an unknown climb.

    Attributes
    ----------
    scores : ConformalScores
        Distribution of the standardised error.
    climb : UnknownClimb or None
        Energy of the unknown climb; None if the heights of the road are known.
    expected_wh : ndarray, shape (places,)
        Median of climb and error together [Wh], which belongs to the expected energy: hills on the way cost energy whatever the net
        climb.
    """

    scores: ConformalScores
    climb: UnknownClimb | None
    expected_wh: FloatArray

    def quantile(self, p: FloatArray, sd_wh: FloatArray) -> FloatArray:
        """Quantiles of the excess at each place [Wh], shape (probabilities, places)."""
        if self.climb is None:
            return _error_quantiles_wh(self.scores, p[:, None], sd_wh)
        return self.climb.quantile(self.scores, p, sd_wh) - self.expected_wh

    def draws(self, normal: FloatArray, sd_wh: FloatArray, scenario: FloatArray) -> FloatArray:
        """Draws of the excess at each place [Wh], shape (draws, places).

        Parameters
        ----------
        normal : ndarray, shape (draws, places)
            Error of each draw as a value of a standard normal distribution [1].
        sd_wh : ndarray, shape (places,)
            Standard deviation of the error [Wh].
        scenario : ndarray, shape (draws,)
            Uniform values from 0 to less than 1 that choose the climb of each draw.
        """
        error_wh = self.scores.errors(normal) * sd_wh - self.expected_wh
        if self.climb is None:
            return error_wh
        chosen = np.searchsorted(np.cumsum(self.climb.weights[:-1]), scenario, side="right")
        return np.asarray(error_wh + self.climb.offsets_wh[chosen])

    def at(self, *places: int) -> Excess:
        """The distribution at the places of some indices only, -1 for the end of the trip."""
        there = self.climb and UnknownClimb(self.climb.offsets_wh[:, places], self.climb.weights)
        return Excess(self.scores, there, self.expected_wh[[*places]])

    def quantiles(self, p: FloatArray, sd_wh: FloatArray) -> FloatArray:
        """Quantiles of a distribution at one place for all probabilities, such as `at(-1)`, or at one for each [Wh], shape (probabilities,)."""
        if self.climb is None:
            return _error_quantiles_wh(self.scores, p, sd_wh)
        return self.climb.quantiles(self.scores, p, sd_wh) - self.expected_wh

    def probability_below(self, more_wh: FloatArray, sd_wh: FloatArray) -> FloatArray:
        """Probability that the excess is at most an energy [Wh] at each place, shape (places,): the inverse of `quantile`."""
        if self.climb is not None:
            return self.climb.probability_below(self.scores, more_wh + self.expected_wh, sd_wh)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = np.where(sd_wh > 0.0, more_wh / sd_wh, np.where(more_wh >= 0.0, np.inf, -np.inf))
        return self.scores.probabilities(scaled)


def _error_quantiles_wh(scores: ConformalScores, p: FloatArray, sd_wh: FloatArray) -> FloatArray:
    """Quantiles of the error alone [Wh], in the broadcast shape of `p` and `sd_wh`."""
    return np.asarray(np.sign(p - 0.5) * scores.factors(np.abs(2.0 * p - 1.0)) * sd_wh)
