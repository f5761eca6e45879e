"""The difference of two forecasts of one car: what both have in common cancels, and the rest has an interval of its own."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.scale import TotalScale

SAME_ROAD: Final = 0.002
"""Two roads whose lengths differ by less than this share are one: its climb and its traffic are those of both."""
LEAST_SHARE: Final = 0.2
"""Standard deviation of a difference over the norm of its causes, at least: root mean square of those between the schedules that Argonne drove with
a warm BMW i3, `python -m benchmarks.savings`. A sample of one car."""
OTHER_SPEEDS: Final = 0.54
"""Error of what other speeds on a planned road change, over the error that its links cause: root mean square over trips of TUM, driven and on their
links, `python -m benchmarks.savings --only links`. The car drives another trace than the plan has, at both speeds."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Energy of a forecast less that of another one of the same car, driver and day; `Forecast.difference` makes it.

    Attributes
    ----------
    energy_wh, sd_wh : float
        Expected difference and its standard deviation [Wh]; below 0 where the other forecast takes more.
    duration_s : float
        Difference of the durations [s].
    soc_arrival : float
        Difference of the displayed charge at arrival.
    by_cause_wh : dict of str to float
        The expected difference by cause [Wh].
    scores : ConformalScores
        Distribution of the errors of the car's model over their standard deviations.

    Examples
    --------
    >>> import tripwatt as tw
    >>> fast, slow = (tw.read_route([{"length_m": 50_000.0, "speed_m_s": v}]) for v in (33.0, 28.0))
    >>> saved = tw.forecast(slow).difference(tw.forecast(fast))
    >>> low, high = saved.interval(0.9)
    >>> low < saved.energy_wh < high < 0.0 < saved.duration_s
    True
    """

    energy_wh: float
    sd_wh: float
    duration_s: float
    soc_arrival: float
    by_cause_wh: dict[str, float]
    scores: ConformalScores

    def quantile(self, p: float) -> float:
        """Quantile of the difference.

        Parameters
        ----------
        p : float
            Probability, 0 to 1.

        Returns
        -------
        float
            Energy [Wh] that the difference stays below with this probability.

        Examples
        --------
        >>> scores = ConformalScores.from_errors([0.5, 1.0, 2.0])
        >>> Difference(-100.0, 40.0, 60.0, 0.01, {}, scores).quantile(0.75)
        -60.0
        """
        half = self.scores.factor(abs(2.0 * p - 1.0)) * self.sd_wh
        return self.energy_wh + math.copysign(half, p - 0.5)

    def interval(self, coverage: float = 0.9) -> tuple[float, float]:
        """Compute the ends of the central interval.

        Parameters
        ----------
        coverage : float
            Probability of the interval, 0 to 1.

        Returns
        -------
        tuple of float
            Lower and upper end [Wh].

        Examples
        --------
        >>> scores = ConformalScores.from_errors([0.5, 1.0, 2.0])
        >>> Difference(-100.0, 40.0, 60.0, 0.01, {}, scores).interval(0.5)
        (-140.0, -60.0)
        """
        return self.quantile(0.5 - 0.5 * coverage), self.quantile(0.5 + 0.5 * coverage)

    @property
    def p_less(self) -> float:
        """Probability that the forecast takes less than the other one."""
        if self.sd_wh <= 0.0:
            return float(self.energy_wh < 0.0)
        return self.scores.probability(-self.energy_wh / self.sd_wh)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values, with the ends of the central 90 %.

        Returns
        -------
        dict
            Numbers, and the energy by cause.

        Examples
        --------
        >>> scores = ConformalScores.from_errors([0.5, 1.0, 2.0])
        >>> Difference(-100.0, 40.0, 60.0, 0.01, {}, scores).to_dict()["energy_wh"]
        -100.0
        """
        return {
            "energy_wh": self.energy_wh,
            "interval_wh": list(self.interval(0.9)),
            "duration_s": self.duration_s,
            "soc_arrival": self.soc_arrival,
            "p_less": self.p_less,
            "by_cause_wh": self.by_cause_wh,
        }


@dataclass(frozen=True, slots=True)
class Shared:
    """What two forecasts of one car may share of their errors.

    Attributes
    ----------
    hours, moved_wh, net_wh : float
        For which an error of power adds up [h], energy moved at the wheels and energy of the trip [Wh].
    weights_wh : ndarray, shape (weights,)
        Energy of the trip by one standard deviation of each of the corrector's weights [Wh].
    outside_wh, state_wh, route_wh, links_wh, climb_wh : float
        Standard deviations by what is outside of the training, the state at departure, the travel times, the links alone and an unknown climb [Wh].
    climate_wh : float
        Expected energy of climate control, through which the state at departure and the weather act [Wh].
    distance_m : float
    """

    hours: float
    moved_wh: float
    net_wh: float
    weights_wh: FloatArray
    outside_wh: float
    state_wh: float
    route_wh: float
    links_wh: float
    climb_wh: float
    climate_wh: float
    distance_m: float


def sd_between(one: Shared, other: Shared, scale: TotalScale, causes_wh: Iterable[float]) -> float:
    """Standard deviation of the difference of two forecasts [Wh].

    It has the parts of `TotalScale` of a trip that takes the difference alone: the error of every trip cancels, that of every hour counts for
    the hours by which they differ, a share of the energy moved for the difference of it. The corrector's own uncertainty is linear in the weights
    that both share; it is at least `LEAST_SHARE` of what changes. Climb, traffic and the state at departure are the same for both on one
    road; on two roads the first two are independent. What is unknown of the state and of the weather counts at least in the share by which climate
    control changes. At other speeds on a planned road the errors of its links cancel in part.
    """
    hours, moved_wh = abs(one.hours - other.hours), abs(one.moved_wh - other.moved_wh)
    growing = math.hypot(
        scale.values[1] * hours,
        scale.values[2] * moved_wh,
        scale.net_sd_wh(one.net_wh - other.net_wh, moved_wh, min(one.distance_m, other.distance_m)),
    )
    weights = scale.values[3] * float(np.linalg.norm(one.weights_wh - other.weights_wh))
    heat = abs(one.climate_wh - other.climate_wh) / max(abs(one.climate_wh), abs(other.climate_wh), 1.0)
    is_one = abs(one.distance_m / other.distance_m - 1.0) < SAME_ROAD
    return math.hypot(
        max(growing, scale.least_share * moved_wh),
        max(weights, LEAST_SHARE * math.hypot(*causes_wh)),
        math.sqrt(abs(one.outside_wh**2 - other.outside_wh**2)),
        max(abs(one.state_wh - other.state_wh), heat * max(one.state_wh, other.state_wh)),
        OTHER_SPEEDS * max(one.links_wh, other.links_wh) * (is_one and hours > 0.0),
        *(
            a - b if is_one else math.hypot(a, b)
            for a, b in ((one.route_wh, other.route_wh), (one.climb_wh, other.climb_wh))
        ),
    )
