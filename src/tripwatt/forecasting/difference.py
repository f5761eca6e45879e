"""The difference of two forecasts of one car, with an interval: errors that both forecasts share cancel."""

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
"""Share by which the lengths of two roads may differ to count as one road, with the same climb and traffic."""
MIN_SHARE: Final = 0.2
"""Least ratio of the standard deviation of a difference to the norm of its causes: root mean square between the schedules that
Argonne drove with a warm BMW i3, `python -m benchmarks.savings`. A sample of one car."""
OTHER_SPEEDS: Final = 0.54
"""Ratio of the error of an energy change by other speeds on a planned road to the error that its links cause.

Root mean square over trips of TUM, driven and on their links, `python -m benchmarks.savings --only links`. At both speeds the car
drives another trace than the plan has."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Energy of a forecast minus that of another one for the same car, driver and day; made by `Forecast.difference`.

    Attributes
    ----------
    energy_wh, sd_wh : float
        Expected difference and its standard deviation [Wh]; the difference is below 0 if the other forecast takes more.
    duration_s : float
        Difference of the durations [s].
    soc_arrival : float
        Difference of the displayed charge at arrival.
    by_cause_wh : dict of str to float
        The expected difference by cause [Wh].
    scores : ConformalScores
        Distribution of the standardised errors of the car's model.

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
        """Compute the ends of the central interval of the difference.

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
        """Probability that the forecast trip takes less energy than the other one."""
        if self.sd_wh <= 0.0:
            return float(self.energy_wh < 0.0)
        return self.scores.probability(-self.energy_wh / self.sd_wh)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values, with the ends of the central 90 % interval.

        Returns
        -------
        dict
            The difference of energy, its interval, the other differences, and the energy by cause.

        Examples
        --------
        >>> scores = ConformalScores.from_errors([0.5, 1.0, 2.0])
        >>> Difference(-100.0, 40.0, 60.0, 0.01, {}, scores).to_dict()["energy_wh"]
        -100.0
        """
        names = "energy_wh", "duration_s", "soc_arrival", "p_less", "by_cause_wh"
        return {name: getattr(self, name) for name in names} | {"interval_wh": list(self.interval(0.9))}


@dataclass(frozen=True, slots=True)
class Shared:
    """Quantities of one forecast that determine which errors cancel in a difference.

    Attributes
    ----------
    hours, moved_wh, net_wh : float
        Time over which an error of power adds up [h], energy moved at the wheels [Wh], and energy of the trip without the
        potential energy of its climb [Wh].
    weights_wh : ndarray, shape (weights,)
        Change of the trip's energy by one standard deviation of each of the corrector's weights [Wh].
    outside_wh, state_wh, route_wh, links_wh, climb_wh : float
        Standard deviations due to values outside the training ranges, the state at departure, the planned route with its travel
        times, its links alone, and an unknown climb [Wh].
    climate_wh : float
        Expected energy of climate control [Wh]: the state at departure and the weather act through it.
    distance_m : float
        Length of the trip [m].
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

    The parts of `TotalScale` are those of a trip that consists of the difference only. The error per trip cancels. The error per hour
    counts for the difference of the hours, the share of the energy moved for the difference of that energy. The uncertainty of the
    corrector is linear in its weights, which both forecasts share; it is at least `MIN_SHARE` of the energy that changes.

    On one road, climb and traffic are the same for both forecasts; on two roads they are independent. The error by the unknown state
    and weather is at least the share by which climate control changes. At other speeds on one planned road, the errors of its links
    cancel in part.
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
        max(weights, MIN_SHARE * math.hypot(*causes_wh)),
        math.sqrt(abs(one.outside_wh**2 - other.outside_wh**2)),
        max(abs(one.state_wh - other.state_wh), heat * max(one.state_wh, other.state_wh)),
        OTHER_SPEEDS * max(one.links_wh, other.links_wh) * (is_one and hours > 0.0),
        *(
            a - b if is_one else math.hypot(a, b)
            for a, b in ((one.route_wh, other.route_wh), (one.climb_wh, other.climb_wh))
        ),
    )
