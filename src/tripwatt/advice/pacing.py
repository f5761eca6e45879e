"""What minutes cost on a road, and the speeds to keep: the front of time and energy of a forecast's road, with and without charging."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from tripwatt.advice.cruise import Cruise, Front, front, least_total_time
from tripwatt.advice.cruise_advice import CruiseAdvice, followable
from tripwatt.advice.cruise_problem import CruiseProblem
from tripwatt.forecasting import Forecast

POINTS: Final = 9
CHARGING_W: Final = (11_000.0, 50_000.0, 150_000.0)
"""Powers of charging that the least total time is given for: a wallbox, a usual and a strong fast charger."""


@dataclass(frozen=True, eq=False)
class Pace:
    """Speeds along a road that spend least energy for their time.

    Attributes
    ----------
    front : Front
        Minutes and energy, the fastest first.

    Examples
    --------
    >>> import tripwatt as tw
    >>> road = tw.read_route([{"length_m": 40_000.0, "speed_m_s": 33.0}])
    >>> pace = Pace.from_forecast(tw.forecast(road))
    >>> saved = [row["saved_wh"] for row in pace.to_dict()["front"]]
    >>> saved[0], saved == sorted(saved)
    (0.0, True)
    """

    front: Front

    @classmethod
    def from_forecast(cls, forecast: Forecast) -> Pace:
        """Find the front of a forecast's road, from its plan's speeds downwards. O(points x links x levels²).

        Parameters
        ----------
        forecast : Forecast
            Before departure. Its correction and an unknown climb are left out: they are about the same at all speeds.

        Returns
        -------
        Pace
            With the front.

        Examples
        --------
        >>> import tripwatt as tw
        >>> road = tw.read_route([{"length_m": 40_000.0, "speed_m_s": 33.0}])
        >>> len(Pace.from_forecast(tw.forecast(road)).front.cruises) > 3
        True
        """
        return cls(front(CruiseProblem.from_plan(forecast.plan, forecast.vehicle), POINTS))

    @property
    def fastest(self) -> Cruise:
        """At the speeds of the plan."""
        return self.front.cruises[0]

    @cached_property
    def knee(self) -> CruiseAdvice:
        """One speed for each class of road where minutes begin to bring less."""
        return followable(self.front.knee)

    def with_charging(self, charging_w: float) -> CruiseAdvice:
        """The speeds with which driving and charging together take least time.

        Parameters
        ----------
        charging_w : float
            Power at the end of the charge [W].

        Returns
        -------
        CruiseAdvice
            One speed for each class of road.

        Examples
        --------
        >>> import tripwatt as tw
        >>> road = tw.read_route([{"length_m": 40_000.0, "speed_m_s": 36.0}])
        >>> pace = Pace.from_forecast(tw.forecast(road))
        >>> slow, fast = (pace.with_charging(power).cruise.duration_s for power in (3e3, 300e3))
        >>> slow > fast
        True
        """
        return followable(least_total_time(self.fastest.problem, charging_w))

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values.

        Returns
        -------
        dict
            `front`, `knee`, and `with_charging` by power.

        Examples
        --------
        >>> import tripwatt as tw
        >>> road = tw.read_route([{"length_m": 40_000.0, "speed_m_s": 33.0}])
        >>> sorted(Pace.from_forecast(tw.forecast(road)).to_dict())
        ['front', 'knee', 'with_charging']
        """
        charging = [(power, self.with_charging(power)) for power in CHARGING_W]
        return {
            "front": [self._row(cruise) for cruise in self.front.cruises],
            "knee": self._speeds(self.knee),
            "with_charging": [
                {
                    "charging_w": power,
                    "won_s": self.fastest.total_s(power) - advice.cruise.total_s(power),
                    **self._speeds(advice),
                }
                for power, advice in charging
            ],
        }

    def _row(self, cruise: Cruise) -> dict[str, float]:
        longer_s = cruise.duration_s - self.fastest.duration_s
        return {"longer_s": longer_s, "saved_wh": self.fastest.energy_wh - cruise.energy_wh}

    def _speeds(self, advice: CruiseAdvice) -> dict[str, Any]:
        return {
            **self._row(advice.cruise),
            "speeds": [{"highest_m_s": most, "keep_m_s": kept} for most, kept in advice.kept_m_s],
            "lift_at_m": [float(at) for at in advice.cruise.lift_at_m],
            "lost_wh": advice.lost_wh,
            "lost_s": advice.lost_s,
        }
