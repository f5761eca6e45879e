"""The weather along a plan: wind against the car, the air's density, rain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tripwatt.arrays import FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class PlanWeather:
    """The weather along a plan, beside the outside temperature of its departure.

    Attributes
    ----------
    headwind_m_s : ndarray, shape (samples of the plan,)
        Wind against the direction of travel at the car's height, negative from behind.
    air_density_kg_m3 : float or None
        None where the pressure is not known: that of the standard atmosphere.
    rain_mm_h : float
        Rain on the road.

    Examples
    --------
    >>> weather = PlanWeather(np.array([2.0, -1.0]), rain_mm_h=0.5)
    >>> weather.with_more_wind(1.0).headwind_m_s
    array([3., 0.])
    >>> weather.calm().headwind_m_s
    array([0., 0.])
    """

    headwind_m_s: FloatArray
    air_density_kg_m3: float | None = None
    rain_mm_h: float = 0.0

    def with_more_wind(self, headwind_m_s: float) -> PlanWeather:
        """Add wind against the car.

        Parameters
        ----------
        headwind_m_s : float
            Additional wind against the direction of travel [m/s], the same at every sample.

        Returns
        -------
        PlanWeather
            A copy with more wind.
        """
        return replace(self, headwind_m_s=self.headwind_m_s + headwind_m_s)

    def calm(self) -> PlanWeather:
        """Remove the wind.

        Returns
        -------
        PlanWeather
            A copy with a headwind of 0 m/s at every sample.
        """
        return replace(self, headwind_m_s=np.zeros_like(self.headwind_m_s))
