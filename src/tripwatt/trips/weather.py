"""Weather along a plan: headwind, air density and rain."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.trips.departure import Departure
from tripwatt.units import DRY_AIR_GAS_CONSTANT_J_KG_K, ZERO_CELSIUS_K

ROUGHNESS_M: Final = 0.1
"""Roughness length of open country with hedges and single houses (European Wind Atlas, class 2)."""

CAR_HEIGHT_M: Final = 1.0
WIND_AT_CAR: Final = math.log(CAR_HEIGHT_M / ROUGHNESS_M) / math.log(10.0 / ROUGHNESS_M)
"""Wind at the car over that at 10 m, by the logarithmic profile: 0.5."""


@dataclass(frozen=True, eq=False, slots=True)
class PlanWeather:
    """Weather along a plan, except the outside temperature, which belongs to the departure.

    Attributes
    ----------
    headwind_m_s : ndarray, shape (samples of the plan,)
        Wind against the direction of travel at the car's height, negative from behind.
    air_density_kg_m3 : float or None
        Density of the air [kg/m³]; None means that of the standard atmosphere, as the pressure is unknown.
    rain_mm_h : float
        Rain on the road [mm/h].
    any_side_m_s : float
        Root mean square of the headwind [m/s] if its direction is unknown; `headwind_m_s` is then the headwind with the expected
        drag. Otherwise 0.

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
    any_side_m_s: float = 0.0

    @classmethod
    def from_departure(
        cls, departure: Departure, speed_m_s: FloatArray, heading_deg: FloatArray | None
    ) -> PlanWeather:
        """Make the weather from the fields of a departure, constant along the plan; without these fields it is calm and dry.

        If the direction of the wind or of the road is unknown, all directions of the wind are equally likely. The drag with head
        wind or tail wind of ``w / sqrt(2)``, where `w` is the wind at the car, then has the same mean and variance as the drag over
        all directions, as long as the wind is slower than the car.

        Parameters
        ----------
        departure : Departure
            A departure with wind, rain or air pressure.
        speed_m_s : ndarray, shape (samples,)
            Speed of the car [m/s].
        heading_deg : ndarray, shape (samples,), or None
            Direction of travel, clockwise from north [°]; None if unknown.

        Returns
        -------
        PlanWeather
            Weather with a headwind of shape (samples,).

        Examples
        --------
        >>> north, east = np.array([0.0]), np.array([90.0])
        >>> known = Departure(wind_speed_m_s=8.0, wind_from_deg=0.0)
        >>> PlanWeather.from_departure(known, np.array([20.0]), north).headwind_m_s
        array([4.])
        >>> PlanWeather.from_departure(known, np.array([20.0]), None).headwind_m_s.round(2)
        array([0.2])
        """
        wind, origin = departure.wind_speed_m_s or 0.0, departure.wind_from_deg
        any_side = 0.0
        if heading_deg is not None and origin is not None:
            east, north = wind * math.sin(math.radians(origin)), wind * math.cos(math.radians(origin))
            heading = np.radians(heading_deg)
            headwind = WIND_AT_CAR * (east * np.sin(heading) + north * np.cos(heading))
        else:
            any_side = WIND_AT_CAR * wind / math.sqrt(2.0)
            mean = np.concatenate((speed_m_s[:1], 0.5 * (speed_m_s[1:] + speed_m_s[:-1])))
            drag = np.where(mean > any_side, mean**2 + any_side**2, 2.0 * mean * any_side)
            headwind = np.sqrt(drag) - mean
        return cls(headwind, air_density_at(departure), departure.rain_mm_h or 0.0, any_side)

    def sides(self) -> tuple[PlanWeather, PlanWeather]:
        """Return two weathers, with a head wind and with a tail wind of `any_side_m_s` along the whole plan.

        Returns
        -------
        tuple of PlanWeather
            Wind against the car, and wind from behind.

        Examples
        --------
        >>> [side.headwind_m_s.tolist() for side in PlanWeather(np.array([0.1]), any_side_m_s=2.0).sides()]
        [[2.0], [-2.0]]
        """
        against = np.full_like(self.headwind_m_s, self.any_side_m_s)
        return replace(self, headwind_m_s=against), replace(self, headwind_m_s=-against)

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
        return replace(self, headwind_m_s=np.zeros_like(self.headwind_m_s), any_side_m_s=0.0)


def air_density_at(departure: Departure) -> float | None:
    """Density of the air [kg/m³] from pressure and outside temperature; None if one of them is unknown.

    Examples
    --------
    >>> round(air_density_at(Departure(ambient_temperature_degc=0.0, pressure_pa=101_325.0)), 3)
    1.292
    """
    ambient = departure.ambient_temperature_degc
    if departure.pressure_pa is None or ambient is None:
        return None
    return departure.pressure_pa / (DRY_AIR_GAS_CONSTANT_J_KG_K * (ambient + ZERO_CELSIUS_K))
