"""The weather along a plan: wind against the car, the air's density, rain."""

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
    """The weather along a plan, beside the outside temperature of its departure.

    Attributes
    ----------
    headwind_m_s : ndarray, shape (samples of the plan,)
        Wind against the direction of travel at the car's height, negative from behind.
    air_density_kg_m3 : float or None
        None where the pressure is not known: that of the standard atmosphere.
    rain_mm_h : float
        Rain on the road.
    any_side_m_s : float
        Root mean square of the headwind where its direction is unknown; `headwind_m_s` is then the one with the expected drag.

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
        """The weather that a departure names, the same along the whole plan. What it leaves out is calm and dry.

        Wind from an unknown side, or on a road of unknown direction, comes from each side alike: with the car's speed `v` and the
        wind `w` at the car, the drag of head wind and tail wind of ``w / sqrt(2)`` has the mean and the variance of that of all
        directions, as long as the wind is slower than the car.

        Parameters
        ----------
        departure : Departure
            With wind, rain or air pressure.
        speed_m_s : ndarray, shape (samples,)
            Of the car.
        heading_deg : ndarray, shape (samples,), or None
            Direction of travel, clockwise from north; None where it is unknown.

        Returns
        -------
        PlanWeather
            Shape (samples,).

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
        """Head wind and tail wind all the way, of `any_side_m_s`.

        Returns
        -------
        tuple of PlanWeather
            Against the car, and from behind.

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
    """Density of the air [kg/m³] from pressure and outside temperature; None where one of them is unknown.

    Examples
    --------
    >>> round(air_density_at(Departure(ambient_temperature_degc=0.0, pressure_pa=101_325.0)), 3)
    1.292
    """
    ambient = departure.ambient_temperature_degc
    if departure.pressure_pa is None or ambient is None:
        return None
    return departure.pressure_pa / (DRY_AIR_GAS_CONSTANT_J_KG_K * (ambient + ZERO_CELSIUS_K))
