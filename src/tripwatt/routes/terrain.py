"""Net climb of a road without known heights: a heavy-tailed distribution by distance and terrain.

The net climb of a road scales with its length as ``(length / 10 km) ** GROWTH``. It has a normal distribution whose scale differs
from road to road of one terrain and is lognormal: most roads end near the height where they begin, a few climb far. Unknown
terrain is a mixture of all kinds of terrain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from statistics import NormalDist
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.trips.plan import KnownClimb

REFERENCE_M: Final = 10_000.0
"""Distance for which the scales of the net climb are given [m]; a choice."""
GROWTH: Final = 0.6
"""Exponent of the net climb over distance. In logs it falls from 0.8 over some km to 0.4 over tens of km (`python -m benchmarks.climb`)."""
STEEPEST: Final = 0.2
"""Largest mean grade of a road over its length, a choice: the steepest streets have up to 0.35, but only over some hundred metres."""
LOCAL_M: Final = 500.0
"""Length of the hills that a road goes up and down between its ends [m]; a choice."""
REGION_SCALE_M: Final[Mapping[str, float]] = {"tum": 22.0, "twizy": 82.4}
"""Scale of the net climb over 10 km of logs with heights [m]: around Munich (TUM data set) and around Rabat (RSK Twizy data set), from
``python -m benchmarks.unknown_climb``."""
_USUAL_SCALE_M: Final = 20.0
_REGION_SPREAD: Final = 0.9
"""`_USUAL_SCALE_M` is the prior median scale [m] of a region that is neither flat nor mountains; `_REGION_SPREAD` is the standard
deviation of the logarithm of the scale between regions. Choices; two regions with logs are too few to replace them."""


@dataclass(frozen=True, eq=False)
class NetClimbs:
    """Equally spaced quantiles of the net climb of a road, as scenarios with weights.

    Attributes
    ----------
    over_10_km_m : ndarray, shape (scenarios,)
        Net climb over 10 km [m], ascending.
    scale_m : ndarray, shape (scenarios,)
        Mean scale of the roads with this climb [m]: roads that end far above or below their start are in rougher country.
    weights : ndarray, shape (scenarios,)
        Probability of each scenario; the sum is 1.
    max_m : float
        Largest net climb of any road of this terrain [m].
    known : KnownClimb or None
        What is known of the climb of one road: the scenarios are then errors of this climb.

    Examples
    --------
    >>> flat, unknown = net_climbs("flat"), net_climbs("unknown")
    >>> float(flat.quantile(0.95, 10_000.0)) < 20.0 < float(unknown.quantile(0.95, 10_000.0)) < 100.0
    True
    >>> float(unknown.limit(4000.0)), float(unknown.limit(90_000.0))
    (800.0, 3000.0)
    """

    over_10_km_m: FloatArray
    scale_m: FloatArray
    weights: FloatArray
    max_m: float
    known: KnownClimb | None = None

    def given(self, known: KnownClimb | None) -> NetClimbs:
        """The distribution for a road whose climb is known in part.

        Examples
        --------
        >>> over_a_pass = KnownClimb(np.array([0.0, 5e3, 9e3]), np.array([0.0, 400.0, 100.0]), np.array([0.0, 80.0, 30.0]), 900.0)
        >>> [net_climbs("mountains").given(over_a_pass).quantile(0.5, m).round().item() for m in (5e3, 9e3)]
        [400.0, 100.0]
        """
        return replace(self, known=known)

    def steepest(self, p: float, distance_m: float) -> float:
        """Grade by which all but 1 - `p` of the roads do not leave the expected one over a distance, up or down [1]."""
        low, middle, high = (float(self.quantile(each, distance_m)) for each in (1.0 - p, 0.5, p))
        return max(high - middle, middle - low) / max(distance_m, 1.0)

    def limit(self, distance_m: FloatArray | float) -> FloatArray:
        """Largest net climb of a road of a given length [m]; places beside a road show climbs beyond those of the terrain."""
        most_m = self.max_m if self.known is None else np.inf
        return np.minimum(STEEPEST * np.asarray(distance_m, dtype=np.float64), most_m)

    def net_m(self, distance_m: FloatArray, from_m: float = 0.0) -> FloatArray:
        """Net climb of each scenario from `from_m` over each distance [m], shape (scenarios, distances)."""
        return self._climbs(self.over_10_km_m[:, None], distance_m, from_m)

    def expected_m(self, distance_m: FloatArray | float, from_m: float = 0.0) -> FloatArray:
        """Expected net climb from `from_m` over each distance [m], in the shape of `distance_m`; 0 if nothing is known."""
        if self.known is None:
            return np.zeros(np.shape(distance_m))
        return np.asarray(self.known.height(from_m + distance_m) - self.known.height(from_m))

    def _climbs(self, over_10_km_m: Any, distance_m: Any, from_m: float = 0.0) -> FloatArray:
        """Net climbs from `from_m` over distances [m], given those over 10 km of a road of which nothing is known."""
        factor = (distance_m / REFERENCE_M) ** GROWTH
        if self.known is not None:
            sd_m = partial(np.interp, xp=self.known.distance_m, fp=self.known.sd_m)
            usual_m = self.given(None).typical_m(REFERENCE_M)
            errors = np.hypot(sd_m(from_m + distance_m), sd_m(from_m)) / usual_m
            factor = np.minimum(errors, factor) if from_m > 0.0 else errors
        limit = self.limit(distance_m)
        return np.asarray(np.clip(self.expected_m(distance_m, from_m) + over_10_km_m * factor, -limit, limit))

    def local_grade(self) -> FloatArray:
        """Typical grade of the hills along the road in each scenario [1], shape (scenarios,)."""
        return np.asarray(
            np.minimum(self.scale_m * (LOCAL_M / REFERENCE_M) ** GROWTH / LOCAL_M, 0.5 * STEEPEST)
        )

    def quantile(self, p: float, distance_m: float) -> FloatArray:
        """Quantile `p` of the net climb over a distance [m]."""
        to_middle = np.cumsum(self.weights) - 0.5 * self.weights
        return self._climbs(np.interp(p, to_middle, self.over_10_km_m), distance_m)

    def typical_m(self, distance_m: float) -> float:
        """Half the width of the central 68 % of the net climb [m]: the standard deviation of its core, without the far tails."""
        return 0.5 * float(self.quantile(0.84, distance_m) - self.quantile(0.16, distance_m))


def _region_scale_m(regions: Sequence[float]) -> float:
    """Scale of an unseen region that is neither flat nor mountains [m], given the scales of regions with logs.

    The mean of the logarithms, shrunk to that of `_USUAL_SCALE_M`: the posterior mean under a normal prior.

    Examples
    --------
    >>> _region_scale_m([]), round(_region_scale_m([20.0]), 6), 25.0 < _region_scale_m([100.0]) < 40.0
    (20.0, 20.0, True)
    """
    # the usual scale is known within a factor of e^0.5; a choice
    prior_weight, region_weight = 0.5**-2, _REGION_SPREAD**-2
    logs = [math.log(scale / _USUAL_SCALE_M) for scale in regions]
    return _USUAL_SCALE_M * math.exp(region_weight * sum(logs) / (prior_weight + region_weight * len(logs)))


@lru_cache(maxsize=32)
def net_climbs(terrain: str = "unknown", without: str | None = None) -> NetClimbs:
    """Distribution of the net climb of a road.

    Parameters
    ----------
    terrain : {"unknown", "flat", "hilly", "mountains"}
        Kind of terrain.
    without : str, optional
        A data set of `REGION_SCALE_M` to leave out, so that scores on its trips do not depend on their own heights.

    Returns
    -------
    NetClimbs
        Scenarios of the net climb.

    Notes
    -----
    Flat is the country of plains and coasts. The share of mountains is half of the 13 % of people who live in mountain areas (FAO, Mapping the
    vulnerability of mountain peoples to food insecurity, 2015), because many of these drive along a valley. All other scales, shares and
    spreads are choices; no logs from mountains are at hand.

    Examples
    --------
    >>> [round(float(net_climbs(kind).quantile(0.95, 15_000.0)), -1) for kind in ("flat", "hilly", "mountains")]
    [10.0, 70.0, 690.0]
    """
    regions = [scale for name, scale in REGION_SCALE_M.items() if name != without]
    # by kind: the median over roads of the standard deviation of the net climb over 10 km [m]; the standard deviation of its
    # logarithm between roads; the largest net climb of any such road [m]; the share of the roads of unknown terrain
    kinds = {
        "flat": (5.0, 0.5, 100.0, 0.5),
        "hilly": (_region_scale_m(regions), 0.5, 800.0, 0.44),
        "mountains": (250.0, 0.6, 3000.0, 0.06),
    }
    chosen = list(kinds.values()) if terrain == "unknown" else [kinds[terrain]]
    nodes, hermite = np.polynomial.hermite_e.hermegauss(24)
    total = sum(share for *_, share in chosen)
    scales = np.concatenate([scale_m * np.exp(spread * nodes) for scale_m, spread, *_ in chosen])
    shares = np.concatenate([share / total * hermite / hermite.sum() for *_, share in chosen])
    grid = np.concatenate(([0.0], np.geomspace(0.1, 30_000.0, 600)))
    # 61 quantiles, spaced within 3.2 standard deviations, and 24 nodes above; choices
    edges = np.array([NormalDist().cdf(z) for z in np.linspace(-3.2, 3.2, 62)])
    edges[0], edges[-1] = 0.0, 1.0
    normal = np.vectorize(math.erf)(grid[:, None] / (scales * math.sqrt(2.0)))
    middle = 0.5 * (edges[1:] + edges[:-1])
    size = np.interp(np.abs(2.0 * middle - 1.0), normal @ shares, grid)
    density = shares / scales * np.exp(-0.5 * (size[:, None] / scales) ** 2)
    mean_scale = (density @ scales) / density.sum(axis=1)
    return NetClimbs(
        np.sign(middle - 0.5) * size, mean_scale, np.diff(edges), max(max_m for *_, max_m, _ in chosen)
    )
