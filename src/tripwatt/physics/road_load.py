"""Forces on the car from air, rolling, grade and inertia; and the grade from a logged elevation."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, PerTrip, Relaxation, running_sum
from tripwatt.trips import STEEPEST_GRADE
from tripwatt.trips.elevation import heights_of_a_road
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
    drag_area_m2: PerTrip,
    density_kg_m3: PerTrip,
    headwind_m_s: FloatArray | None = None,
) -> FloatArray:
    """Air drag ρ/2 · c_d A · (v + w) |v + w| [N], shape of `speed_m_s`; v is the speed of the car, w the headwind.

    Crosswind is neglected: it changes neither the force along the car nor the drag coefficient.

    Examples
    --------
    >>> aero_drag_force(np.array([10.0]), 0.6, 1.2), aero_drag_force(np.array([10.0]), 0.6, 1.2, np.array([-20.0]))
    (array([36.]), array([-36.]))
    """
    against = speed_m_s if headwind_m_s is None else speed_m_s + headwind_m_s
    return np.asarray(0.5 * density_kg_m3 * drag_area_m2 * against * np.abs(against), dtype=np.float64)


WET_ROAD: Final = 0.1
"""Relative rise of rolling resistance on a wet road; an estimate for a film of water of a few tenths of a millimetre."""


def wet_factor(rain_mm_h: PerTrip) -> PerTrip:
    """Rolling resistance on a road in the rain over that on a dry road [1].

    Examples
    --------
    >>> [float(wet_factor(rain)) for rain in (0.0, 0.5, 8.0)]
    [1.0, 1.05, 1.1]
    """
    # 1 mm/h keeps a road wet, less rain wets it in proportion; a choice
    return 1.0 + WET_ROAD * np.minimum(rain_mm_h, 1.0)


def rolling_resistance_force(
    speed_m_s: FloatArray,
    mass_kg: PerTrip,
    coefficients: tuple[FloatArray | float, float],
    cosine: FloatArray | float = 1.0,
) -> FloatArray:
    """Rolling and driveline drag m g cos(α) · (c0 + c1 v) [N], 0 at standstill; `coefficients` are (c0, c1). Shape of `speed_m_s`.

    Examples
    --------
    >>> rolling_resistance_force(np.array([0.0, 10.0]), 1000.0, (0.01, 0.0)).round(2)
    array([ 0.  , 98.07])
    """
    constant, linear = coefficients
    return np.asarray(mass_kg * GRAVITY_M_S2 * cosine * (constant + linear * speed_m_s) * (speed_m_s > 0.0))


def rolling_factor(
    speed_m_s: FloatArray,
    step_s: FloatArray,
    temperature_degc: PerTrip,
    tyres: Tyres,
    initial_warmth: PerTrip = 0.0,
) -> FloatArray:
    """Ratio of rolling and driveline drag to that of the warm car at the reference temperature. Shape of `speed_m_s`.

    The ratio is (1 + k (T_ref - T)) (1 + e (1 - w)), but at least 0.5. T is the air temperature, e the cold excess; the first
    factor, with its slope k, is `Tyres.weather_factor`. The warmth w is `initial_warmth` at departure, and relaxes with the tyres'
    time constant to the square root of speed over `Tyres.warm_up_speed_m_s`, but to no more than 1.

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
    weather = tyres.weather_factor(np.asarray(temperature_degc))
    return np.asarray(np.maximum(weather * (1.0 + tyres.cold_excess * (1.0 - warmth)), 0.5), dtype=np.float64)


def grade_force(grade: FloatArray, mass_kg: PerTrip) -> FloatArray:
    """Force of gravity m g sin(α) [N] against a car that climbs, with `grade` = tan(α). Shape of `grade`.

    Examples
    --------
    >>> grade_force(np.array([0.0, 0.75]), 1000.0).round(2)
    array([   0.  , 5883.99])
    """
    return np.asarray(mass_kg * GRAVITY_M_S2 * grade / np.sqrt(1.0 + grade * grade))


def inertia_force(acceleration_m_s2: FloatArray, mass_kg: PerTrip, rotating_mass_factor: float) -> FloatArray:
    """Force that accelerates the car and its rotating parts [N], shape of `acceleration_m_s2`.

    Examples
    --------
    >>> inertia_force(np.array([1.0]), 1000.0, 1.04)
    array([1040.])
    """
    return np.asarray(mass_kg * rotating_mass_factor * acceleration_m_s2)


def grade_from_elevation(time_s: FloatArray, speed_m_s: FloatArray, elevation_m: FloatArray) -> FloatArray:
    """Compute the road grade of each interval from a logged elevation, smoothed over distance. O(samples + distance).

    Heights that no road can have are left out before (`tripwatt.trips.elevation.heights_of_a_road`). The road climbs as much as the
    others: from the first to the last of them. They are averaged over pieces of road of
    `GRADE_BIN_M`, so that neither the 1 m steps of a log nor a standstill make a slope. A small jump, or a drift at standstill,
    is spread over the road beside it, which is nowhere steeper than the steepest street (`STEEPEST_GRADE`). The slopes are smoothed with
    a triangular weight over distance, which keeps the climb.

    Parameters
    ----------
    time_s, speed_m_s, elevation_m : ndarray, shape (samples,)
        Missing elevations (NaN) are bridged; without any elevation the road is flat. The road is level before the first and
        after the last known elevation.

    Returns
    -------
    ndarray, shape (samples,)
        Grade of the interval that ends at the sample, rise over horizontal distance: the sum of
        ``step * sin(arctan(grade))`` is the climb. If the log rises more steeply than `STEEPEST_GRADE` over its whole length,
        the grade is that one.

    Examples
    --------
    >>> time = np.arange(0.0, 200.0)
    >>> speed = np.full(200, 15.0)
    >>> grade_from_elevation(time, speed, np.round(0.02 * 15.0 * time))[100].round(2)
    np.float64(0.02)
    """
    known = np.isfinite(elevation_m)
    step = (time_s[1:] - time_s[:-1]) * (0.5 * (speed_m_s[1:] + speed_m_s[:-1]))
    distance = running_sum(step)
    if not known.any() or not distance[-1] > 0.0:
        return np.zeros(len(time_s))
    sound = heights_of_a_road(time_s, distance, elevation_m)
    border, height = _height_over_distance(distance, sound, known)
    steepest = STEEPEST_GRADE * border[1]
    rise, reach = height[1:] - height[:-1], len(GRADE_WEIGHT) // 2
    if (np.abs(rise) > steepest).any():
        rise = np.diff(_with_slope_at_most(steepest, height))
    # Mirrored ends let the smoothed slopes climb exactly as high as the unsmoothed ones.
    place = np.arange(-reach, len(rise) + reach) % (2 * len(rise))
    rise = np.convolve(rise[np.minimum(place, 2 * len(rise) - 1 - place)], GRADE_WEIGHT, mode="valid")
    climb = np.interp(distance, border, running_sum(rise))
    piece = np.minimum((distance / border[1]).astype(np.int64), len(rise) - 1)
    slope = rise[piece] / border[1]
    # At standstill and in very short steps, the slope is that of the piece of road.
    moves = np.flatnonzero(step > 1e-3) + 1
    slope[moves] = (climb[moves] - climb[moves - 1]) / step[moves - 1]
    return np.asarray(slope / np.sqrt(1.0 - slope * slope), dtype=np.float64)


def _height_over_distance(
    distance: FloatArray, elevation_m: FloatArray, known: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return the borders of equal pieces of road of about `GRADE_BIN_M`, and the height at each; both ends keep the logged height."""
    place = (distance[known] / GRADE_BIN_M).astype(np.int64)
    count = np.bincount(place)
    filled = np.flatnonzero(count)
    where, height = (
        np.bincount(place, weights=values)[filled] / count[filled]
        for values in (distance[known], elevation_m[known])
    )
    border = np.linspace(0.0, distance[-1], max(round(distance[-1] / GRADE_BIN_M), 1) + 1)
    smooth = np.interp(border, where, height)
    smooth[0], smooth[-1] = elevation_m[known][[0, -1]]
    return border, smooth


def _with_slope_at_most(steepest: float, height: FloatArray) -> FloatArray:
    """Change heights so that neighbours differ by at most `steepest`, with the smallest possible largest change; both ends stay.

    The result is the mean of the largest such heights below and the smallest above (McShane 1934), within limits through the
    two ends. If the ends differ too much, the last one is changed.
    """
    ramp = np.asarray(steepest * np.arange(len(height)), dtype=np.float64)
    first = height[0]
    last = first + np.clip(height[-1] - first, -ramp[-1], ramp[-1])
    least = np.maximum(first - ramp, last - ramp[::-1])
    most = np.minimum(first + ramp, last + ramp[::-1])
    nearest = 0.5 * (_largest_below(height, ramp) - _largest_below(-height, ramp))
    return np.asarray(np.clip(nearest, least, most), dtype=np.float64)


def _largest_below(height: FloatArray, ramp: FloatArray) -> FloatArray:
    """Return the largest heights below the given ones that rise and fall by at most the steps of a ramp."""
    after = np.minimum.accumulate((height + ramp)[::-1])[::-1] - ramp
    return np.minimum(np.minimum.accumulate(height - ramp) + ramp, after)
