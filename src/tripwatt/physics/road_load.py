"""Forces on the car: air, rolling, grade, inertia; and the grade of a logged elevation."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.physics.relaxation import Relaxation
from tripwatt.units import (
    DRY_AIR_GAS_CONSTANT_J_KG_K,
    GRAVITY_M_S2,
    SEA_LEVEL_PRESSURE_PA,
    SEA_LEVEL_TEMPERATURE_K,
    TEMPERATURE_LAPSE_K_M,
    ZERO_CELSIUS_K,
)
from tripwatt.vehicles import Tyres

GRADE_BIN_M: Final = 20.0
"""Length of the pieces of road over which a logged elevation is averaged [m]."""

GRADE_WINDOW_M: Final = 200.0
"""Full width at half height of the triangular weight that smooths the grade [m]."""

GRADE_JUMP: Final = 0.25
"""A rise per distance between neighbouring pieces above this is a jump of the sensor: no public road is steeper."""

_HALF: Final = int(GRADE_WINDOW_M / GRADE_BIN_M)
GRADE_WEIGHT: Final = np.minimum(np.arange(1.0, 2 * _HALF), np.arange(2 * _HALF - 1.0, 0.0, -1.0)) / _HALF**2
"""Triangular weight of the pieces of road, sum 1."""


def air_density(temperature_degc: float, elevation_m: float = 0.0) -> float:
    """Density of dry air [kg/m³] at the pressure of the ICAO standard atmosphere.

    Examples
    --------
    >>> round(air_density(15.0), 3)
    1.225
    """
    pressure = SEA_LEVEL_PRESSURE_PA * (
        1.0 - TEMPERATURE_LAPSE_K_M * elevation_m / SEA_LEVEL_TEMPERATURE_K
    ) ** (GRAVITY_M_S2 / (DRY_AIR_GAS_CONSTANT_J_KG_K * TEMPERATURE_LAPSE_K_M))
    return float(pressure / (DRY_AIR_GAS_CONSTANT_J_KG_K * (temperature_degc + ZERO_CELSIUS_K)))


def aero_drag_force(
    speed_m_s: FloatArray,
    drag_area_m2: float,
    density_kg_m3: float,
    headwind_m_s: FloatArray | None = None,
) -> FloatArray:
    """Air drag ρ/2 · c_d A · (v + w) |v + w| [N], shape of `speed_m_s`; w is the wind against the car.

    Wind from the side changes neither the force along the car nor its drag coefficient here.

    Examples
    --------
    >>> aero_drag_force(np.array([10.0]), 0.6, 1.2), aero_drag_force(np.array([10.0]), 0.6, 1.2, np.array([-20.0]))
    (array([36.]), array([-36.]))
    """
    if headwind_m_s is None:
        return 0.5 * density_kg_m3 * drag_area_m2 * speed_m_s * speed_m_s
    against = speed_m_s + headwind_m_s
    return np.asarray(0.5 * density_kg_m3 * drag_area_m2 * against * np.abs(against), dtype=np.float64)


WET_ROAD: Final = 0.1
"""Relative rise of rolling resistance on a wet road; an estimate for a film of water of a few tenths of a millimetre."""

WET_FROM_MM_H: Final = 1.0
"""Rain that keeps a road wet; less rain wets it in proportion. A choice."""


def wet_factor(rain_mm_h: float) -> float:
    """Rolling resistance on a road in the rain over that on a dry one.

    Examples
    --------
    >>> wet_factor(0.0), wet_factor(0.5), wet_factor(8.0)
    (1.0, 1.05, 1.1)
    """
    return 1.0 + WET_ROAD * min(rain_mm_h / WET_FROM_MM_H, 1.0)


def rolling_resistance_force(
    speed_m_s: FloatArray, mass_kg: float, coefficients: tuple[float, float], cosine: FloatArray | float = 1.0
) -> FloatArray:
    """Rolling and driveline drag m g cos(α) · (c0 + c1 v) [N]; zero at standstill. Shape of `speed_m_s`.

    Examples
    --------
    >>> rolling_resistance_force(np.array([0.0, 10.0]), 1000.0, (0.01, 0.0)).round(2)
    array([ 0.  , 98.07])
    """
    constant, linear = coefficients
    force = mass_kg * GRAVITY_M_S2 * cosine * (constant + linear * speed_m_s)
    return np.asarray(np.where(speed_m_s > 0.0, force, 0.0), dtype=np.float64)


def rolling_factor(
    speed_m_s: FloatArray,
    step_s: FloatArray,
    temperature_degc: float,
    tyres: Tyres,
    initial_warmth: float = 0.0,
) -> FloatArray:
    """Rolling and driveline drag over that of the warm car at the reference temperature. Shape of `speed_m_s`.

    The factor is (1 + k (T_ref - T)) (1 + e (1 - w)), never below half; above T_ref the slope k is the published one, if that is
    smaller (`Tyres.weather_factor`). The warmth w, `initial_warmth` at departure,
    relaxes with the tyres' time constant to the square root of speed over the speed that warms up fully.

    Notes
    -----
    k after SAE J1263; the transient after Mars and Luchini, Tire Science and Technology 27 (1999).

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> tyres = load_vehicle("bmw_i3_60ah").tyres
    >>> rolling_factor(np.full(3, 22.2), np.array([0.0, 900.0, 1e5]), 20.0, tyres).round(2)
    array([1.3 , 1.11, 1.  ])
    """
    settled = np.sqrt(np.minimum(speed_m_s / tyres.warm_up_speed_m_s, 1.0))
    warmth = Relaxation(step_s / tyres.warm_up_time_s).solve(initial_warmth, settled)
    weather = tyres.weather_factor(temperature_degc)
    return np.asarray(np.maximum(weather * (1.0 + tyres.cold_excess * (1.0 - warmth)), 0.5), dtype=np.float64)


def grade_force(grade: FloatArray, mass_kg: float) -> FloatArray:
    """Downhill force m g sin(α) [N] for `grade` = tan(α), shape of `grade`.

    Examples
    --------
    >>> grade_force(np.array([0.0, 0.75]), 1000.0).round(2)
    array([   0.  , 5883.99])
    """
    return mass_kg * GRAVITY_M_S2 * grade / np.sqrt(1.0 + grade * grade)


def inertia_force(acceleration_m_s2: FloatArray, mass_kg: float, rotating_mass_factor: float) -> FloatArray:
    """Force that accelerates the car and its rotating parts [N], shape of `acceleration_m_s2`.

    Examples
    --------
    >>> inertia_force(np.array([1.0]), 1000.0, 1.04)
    array([1040.])
    """
    return mass_kg * rotating_mass_factor * acceleration_m_s2


def grade_from_elevation(time_s: FloatArray, speed_m_s: FloatArray, elevation_m: FloatArray) -> FloatArray:
    """Road grade over each interval from a logged elevation, cleaned over distance. O(samples + distance).

    Elevations are averaged over pieces of road of `GRADE_BIN_M`, so that neither the 1 m steps of a log nor a
    standstill make a slope. Rises that no road has (`GRADE_JUMP`) are jumps of the sensor and count as flat. The
    slopes are smoothed with a triangular weight over distance that keeps the total climb.

    Parameters
    ----------
    time_s, speed_m_s, elevation_m : ndarray, shape (samples,)
        Missing elevations (NaN) are bridged; an elevation that is missing throughout gives a flat road.

    Returns
    -------
    ndarray, shape (samples,)
        Grade (rise over distance) of the interval that ends at the sample.

    Examples
    --------
    >>> time = np.arange(0.0, 200.0)
    >>> speed = np.full(200, 15.0)
    >>> grade_from_elevation(time, speed, np.round(0.02 * 15.0 * time))[100].round(2)
    np.float64(0.02)
    """
    flat = np.zeros(len(time_s))
    known = np.isfinite(elevation_m)
    if not known.any():
        return flat
    step = np.diff(time_s) * (0.5 * (speed_m_s[1:] + speed_m_s[:-1]))
    distance = np.zeros_like(time_s)
    np.cumsum(step, out=distance[1:])
    n_bins = int(distance[-1] / GRADE_BIN_M) + 1
    if n_bins < 3:
        return flat
    place = (distance / GRADE_BIN_M).astype(np.int64)
    if known.all():
        count = np.bincount(place, minlength=n_bins)
        total = np.bincount(place, weights=elevation_m, minlength=n_bins)
    else:
        count = np.bincount(place[known], minlength=n_bins)
        total = np.bincount(place[known], weights=elevation_m[known], minlength=n_bins)
    filled = np.flatnonzero(count)
    height = np.interp(np.arange(n_bins), filled, total[filled] / count[filled])
    slope = np.diff(height) / GRADE_BIN_M
    slope[np.abs(slope) > GRADE_JUMP] = 0.0
    half = (len(GRADE_WEIGHT) + 1) // 2
    # Mirrored ends let the smoothed slopes climb exactly as high as the unsmoothed ones.
    smooth = np.convolve(np.pad(slope, half - 1, mode="symmetric"), GRADE_WEIGHT, mode="valid")
    middle = distance.copy()
    middle[1:] -= 0.5 * step
    return np.asarray(
        np.interp(middle, (np.arange(n_bins - 1) + 1.0) * GRADE_BIN_M, smooth), dtype=np.float64
    )
