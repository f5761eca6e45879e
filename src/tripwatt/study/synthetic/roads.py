"""Random roads: links with limits and stops, hills that are correlated over distance, and the drive over them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.routes.driver import SpeedProfile, draw_dwell, smooth_noise, speed_profile
from tripwatt.study.synthetic.scenario import ROADS, WHEEL, Scenario, stream
from tripwatt.units import M_S_PER_KM_H


@dataclass(frozen=True, slots=True)
class RoadKind:
    """How the links of one kind of road are drawn.

    Attributes
    ----------
    limits_m_s : tuple of float
        Speed limits [m/s], equally likely.
    length_m : tuple of float
        Shortest and longest link [m].
    traffic : tuple of float
        Lowest and highest speed in traffic, as a share of the limit.
    stop_probability : float
        Chance of a stop at the end of a link.
    bend_probability : float
        Chance that a link ends in a bend or a turn.
    bend_m_s : tuple of float
        Slowest and fastest bend [m/s].
    """

    limits_m_s: tuple[float, ...]
    length_m: tuple[float, float]
    traffic: tuple[float, float]
    stop_probability: float
    bend_probability: float
    bend_m_s: tuple[float, float]


def _to_m_s(*speeds_km_h: float) -> tuple[float, ...]:
    return tuple(v * M_S_PER_KM_H for v in speeds_km_h)


# the kinds of road define the synthetic world and describe no real one
CITY: Final = RoadKind(_to_m_s(30, 50, 50, 60), (90, 500), (0.7, 1.0), 0.28, 0.25, (4.0, 8.0))
RURAL: Final = RoadKind(_to_m_s(50, 70, 80, 100), (300, 1800), (0.75, 1.0), 0.15, 0.45, (9.0, 17.0))
HIGHWAY: Final = RoadKind(_to_m_s(80, 100, 120, 130), (500, 2500), (0.75, 1.0), 0.0, 0.1, (16.0, 22.0))

PHASES: Final = {
    "city": ((CITY, 1.0),),
    "rural": ((CITY, 0.15), (RURAL, 0.75), (CITY, 0.1)),
    "highway": ((CITY, 0.12), (RURAL, 0.13), (HIGHWAY, 0.6), (CITY, 0.15)),
    "mixed": ((CITY, 0.3), (RURAL, 0.25), (HIGHWAY, 0.2), (CITY, 0.25)),
}
"""Route -> its kinds of road in order, each with its share of the driving time."""


@dataclass(frozen=True, eq=False, slots=True)
class RoadDrive:
    """A drive with the true road under it.

    Attributes
    ----------
    profile : SpeedProfile
    elevation_m, grade, heading_rad : ndarray, shape (samples,)
        True height [m], inclination and direction of travel [rad] at each sample.
    """

    profile: SpeedProfile
    elevation_m: FloatArray
    grade: FloatArray
    heading_rad: FloatArray


def _draw_links(scenario: Scenario, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Draw length [m], speed [m/s] and standstill at the end [s] of each link of a planned trip. O(links)."""
    lengths, speeds, dwells = [], [], []
    for kind, share in PHASES[scenario.route]:
        budget_s = share * scenario.duration_s
        n = math.ceil(budget_s * max(kind.limits_m_s) / kind.length_m[0]) + 1
        length = rng.uniform(*kind.length_m, n)
        speed = rng.choice(np.array(kind.limits_m_s), n) * rng.uniform(*kind.traffic, n)
        dwell = draw_dwell(np.full(n, kind.stop_probability), scenario.driver.style, rng)
        bend = rng.random(n) < kind.bend_probability
        bend_speed = np.minimum(rng.uniform(*kind.bend_m_s, n), speed)
        # a link takes its time at speed, its standstill, and the time to slow down and to speed up again
        takes_s = length / speed + dwell + (1.0 - (bend_speed / speed) * ~(dwell > 0)) * bend * speed / 2.5
        takes_s += (dwell > 0) * ~bend * speed / 2.5
        n_used = max(int(np.searchsorted(np.cumsum(takes_s), budget_s)), 1)
        # a bend is a short slow link before the stop
        rows = np.arange(n_used).repeat(1 + bend[:n_used])
        last = np.append(np.diff(rows) > 0, True)
        is_bend = last & bend[rows]
        lengths.append(np.where(is_bend, 25.0, length[rows]))
        speeds.append(np.where(is_bend, bend_speed[rows], speed[rows]))
        dwells.append(np.where(last, dwell[rows], 0.0))
    dwells[-1][-1] = rng.uniform(3.0, 15.0)  # from arrival to the end of the log
    return np.concatenate(lengths), np.concatenate(speeds), np.concatenate(dwells)


def _draw_elevation(distance_m: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw position and height [m] every 25 m: hills on two scales around a height above sea level."""
    position = np.arange(0.0, distance_m + 25.0, 25.0)
    hills = rng.uniform(3.0, 12.0) * smooth_noise(position, 600.0, rng)
    valleys = rng.uniform(8.0, 25.0) * smooth_noise(position, 4000.0, rng)
    slope = np.diff(hills + valleys) / 25.0
    climbs = 25.0 * np.cumsum(np.clip(slope, -0.09, 0.09))  # about the steepest grade of public roads
    return position, rng.uniform(450.0, 620.0) + np.concatenate(([0.0], climbs))


def drive_route(scenario: Scenario, seed: int, step_s: float) -> RoadDrive:
    """Draw a road for a scenario and drive it. O(samples)."""
    rng = stream(seed, ROADS, *scenario.key)
    length, speed, dwell = _draw_links(scenario, rng)
    wheel = stream(seed, WHEEL, *scenario.key)
    profile = speed_profile(
        length, speed, dwell_s=dwell, style=scenario.driver.style, rng=wheel, step_s=step_s
    )
    position, height = _draw_elevation(float(profile.position_m[-1]), rng)
    heading = rng.uniform(0.0, 2.0 * math.pi) + 1.2 * smooth_noise(profile.position_m, 2000.0, rng)
    return RoadDrive(
        profile=profile,
        elevation_m=np.interp(profile.position_m, position, height),
        grade=np.interp(profile.position_m, position, np.gradient(height, position)),
        heading_rad=heading,
    )
