"""From the length and travel time of links to speed over time: where the car stops and how fast it is between.

A link's mean speed includes every standstill. The driver model therefore has two steps: the speed of this driver
without any disturbance (`LinkStyle.free_speed`), and the use of the time that is left over. A little of it is a place
at which the car slows down, more of it a stop, still more a longer stop or several. Links that are faster than the free
speed are driven faster. All of this follows from one number per link, its *delay*. Travel time grows with the delay, so
that the delays that reproduce the travel times of all links are found at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import BoolArray, FloatArray, IntArray, running_sum
from tripwatt.errors import Fault, raise_faults
from tripwatt.routes.driver import (
    DriverStyle,
    SpeedProfile,
    draw_dwell,
    profile_over_time,
    reachable_speed,
)

LONGEST_STREET_M: Final = 2000.0
"""The growth of the street speed with the link's length ends here: twice the longest links of its fit [m]. A longer link is
disturbed once in every such length at least, as a row of links of this length is."""

MOST_OVER_MEAN_M_S: Final = 8.0
"""The free speed is above the mean speed by this at most [m/s]. Like the next two from the schedules that were made of recorded
driving (`docs/decisions/forecast-11-even-links.md`)."""


CRUISE_M_S: Final = 25.0
"""From this mean speed on, nothing slows the car down: it cruises at the mean speed [m/s]."""


FIRMER: Final = 3.0
"""A driver who goes faster than the free speed by some share uses the pedals this many times that share more."""


TIME_TOLERANCE: Final = 0.005
"""Passes end when no link's travel time is further off than this share, or `TIME_TOLERANCE_S`."""

TIME_TOLERANCE_S: Final = 0.2
"""A choice, a fifth of the usual step between two samples."""

HURRY: Final = 1.6
"""A car that has to make up time goes at most this many times as fast as the link's mean speed."""


@dataclass(frozen=True, slots=True)
class LinkStyle:
    """How traffic and driver fill a link of which only the mean speed is known.

    The defaults of `street_speed_m_s`, `length_exponent` and `comfort` are what `benchmarks/link_style.py` finds on the electric
    cars of the Vehicle Energy Dataset, rounded; the other values are a choice (method: `docs/reference/routes.md`).

    Attributes
    ----------
    driver : DriverStyle
        Its acceleration and deceleration are never exceeded; `speed_share` and `fluctuation` are not used.
    comfort : float
        Share of these accelerations that the driver uses where the travel time allows, in (0, 1].
    street_speed_m_s : float
        Speed [m/s] between two stops on a link of 250 m, however slow the link is on the whole.
    length_exponent : float
        How this speed grows with the length of the link: over a longer link the faster pieces count.
    sharpness : float
        Exponent of the mean between this speed and the link's own, at least 1: high where the larger of the two wins.
    stop_place : float
        Where in its share of the link the car slows down or stops: 0 at the start, 1 at the end.

    Examples
    --------
    >>> style = LinkStyle(comfort=0.5)
    >>> short, long = style.free_speed(np.array([100.0, 800.0]), np.array([12.0, 12.0]))
    >>> bool(short < long)
    True
    """

    driver: DriverStyle = field(
        default_factory=lambda: DriverStyle(
            acceleration_m_s2=2.5, deceleration_m_s2=2.5, half_acceleration_speed_m_s=35.0, dwell_mean_s=20.0
        )
    )
    comfort: float = 0.32
    street_speed_m_s: float = 8.2
    length_exponent: float = 0.53
    sharpness: float = 3.5
    stop_place: float = 0.5

    def __post_init__(self) -> None:
        bounds = {
            "comfort": (0.05, 1.0),
            "street_speed_m_s": (1.0, 40.0),
            "length_exponent": (0.0, 1.0),
            "sharpness": (1.0, 50.0),
            "stop_place": (0.1, 0.9),
        }
        raise_faults(
            Fault("link style out of range", name, f"{getattr(self, name)}", f"{low:g} to {high:g}")
            for name, (low, high) in bounds.items()
            if not low <= getattr(self, name) <= high
        )

    def free_speed(self, length_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Speed between two disturbances [m/s] on links of a mean speed, shape of `length_m`.

        It is the power mean of the mean speed and a street speed that grows with the length, but no more than
        `MOST_OVER_MEAN_M_S` above the mean speed, and nearer to it on fast roads (`undisturbed_speed`).

        Parameters
        ----------
        length_m : ndarray, shape (links,)
            Length of each link [m]; beyond `LONGEST_STREET_M` it has no effect.
        speed_m_s : ndarray, shape (links,)
            Mean speed on each link [m/s].

        Returns
        -------
        ndarray, shape (links,)
            At least the mean speed.

        Examples
        --------
        >>> LinkStyle(street_speed_m_s=10.0, sharpness=2.0).free_speed(np.array([250.0]), np.array([10.0])).round(2)
        array([14.14])
        """
        # `street_speed_m_s` is that of a link of 250 m
        reach = np.minimum(length_m, LONGEST_STREET_M) / 250.0
        street = self.street_speed_m_s * reach**self.length_exponent
        free = (street**self.sharpness + speed_m_s**self.sharpness) ** (1.0 / self.sharpness)
        return undisturbed_speed(speed_m_s, np.minimum(free, speed_m_s + MOST_OVER_MEAN_M_S))


def undisturbed_speed(mean_m_s: FloatArray, free_m_s: FloatArray) -> FloatArray:
    """Speed between two disturbances, given that of a road with all of them: the faster the road, the nearer to its mean speed.

    Parameters
    ----------
    mean_m_s, free_m_s : ndarray, shape (links,)
        Mean speed, and speed between two disturbances were the road slow [m/s].

    Returns
    -------
    ndarray, shape (links,)
        From the mean speed to the larger of the two [m/s].

    Examples
    --------
    >>> undisturbed_speed(np.array([10.0, 19.5, 25.0]), np.array([18.0, 30.0, 36.0])).tolist()
    [18.0, 24.75, 25.0]
    """
    share = np.clip((CRUISE_M_S - mean_m_s) / (CRUISE_M_S - 14.0), 0.0, 1.0)
    return np.asarray(mean_m_s + share * np.maximum(free_m_s - mean_m_s, 0.0), dtype=np.float64)


def link_profile(
    length_m: npt.ArrayLike,
    travel_time_s: npt.ArrayLike,
    *,
    stop_s: npt.ArrayLike | None = None,
    moving_speed_m_s: npt.ArrayLike | None = None,
    speed_limit_m_s: npt.ArrayLike | None = None,
    style: LinkStyle | None = None,
    rng: np.random.Generator | None = None,
    step_s: float = 1.0,
) -> SpeedProfile:
    """Drive links in their travel times, from standstill to standstill. O(length / 4 m + samples).

    Speed is continuous and changes no faster than `style.driver` allows. Where the travel time of a link cannot be
    reproduced within these limits, the link takes longer; everywhere else it takes its travel time, to
    5 per mille or 0.2 s (see `docs/reference/routes.md` for the measured share).

    Parameters
    ----------
    length_m, travel_time_s : array_like, shape (links,)
        Length of each link [m] and time on it including every standstill [s].
    stop_s : array_like, shape (links,), optional
        Standstill at the end of each link [s], part of its travel time: 0 = the car does not stop on this link, NaN =
        not known, so that stops are placed where the travel time needs them. All unknown without it.
    moving_speed_m_s : array_like, shape (links,), optional
        Speed while nothing stands in the way [m/s], NaN = not known. On a fast road it is not reached: there the time left over
        is that of a slower drive.
    speed_limit_m_s : array_like, shape (links,), optional
        Highest speed [m/s], NaN = not known. It is kept except on a link whose mean speed is higher; then that one is.
    style : LinkStyle, optional
        How traffic and driver fill a link; the calibrated style by default.
    rng : numpy.random.Generator, optional
        Without it the profile is the same every time; with it stops, their lengths and the speeds in between are drawn.
    step_s : float
        Time between two samples [s].

    Returns
    -------
    SpeedProfile
        Samples of time, speed and position, and the travel times of the links as driven.

    Examples
    --------
    >>> profile = link_profile([250.0, 250.0, 250.0], [30.0, 60.0, 30.0])
    >>> float(profile.position_m[-1]), bool(abs(profile.time_s[-1] - 120.0) <= 1.0)
    (750.0, True)
    """
    style = style or LinkStyle()
    length = np.asarray(length_m, dtype=np.float64)
    time, stop, moving, limit = (
        np.full(length.shape, np.nan) if values is None else np.asarray(values, dtype=np.float64)
        for values in (travel_time_s, stop_s, moving_speed_m_s, speed_limit_m_s)
    )
    course = Course(length, time, stop, moving, limit, style, rng)
    speed, driving_s = course.solve()
    waiting_s = course.waiting(speed, driving_s, rng)
    return profile_over_time(course.position, speed, driving_s, waiting_s, course.ends, step_s)


class Course:
    """The grid over the links and what is known before the delays are.

    `limit` is infinite where there is none, `free` the speed without disturbance, `time` the time to drive and to wait in
    invented stops, without the stops that were given. `link` is that of each cell, `ends` the last node of each link,
    `ramp` the speed that a node may have at least because the neighbouring link is faster, within the limits.
    """

    def __init__(
        self,
        length: FloatArray,
        time: FloatArray,
        stop: FloatArray,
        moving: FloatArray,
        limit: FloatArray,
        style: LinkStyle,
        rng: np.random.Generator | None,
    ) -> None:
        n = len(length)
        self.length, self.stop, self.style = length, np.nan_to_num(stop, nan=0.0), style
        self.time = time - self.stop
        mean = length / self.time
        free = np.where(np.isnan(moving), style.free_speed(length, mean), undisturbed_speed(mean, moving))
        # a link whose stops are given has no reason to go faster than its own speed
        free = np.where(np.isnan(stop) | ~np.isnan(moving), free, mean)
        if rng is not None:
            # 5 % from link to link where it is drawn; a choice
            free = free * np.exp(0.05 * rng.standard_normal(free.shape))
        self.limit = np.where(np.isnan(limit), np.inf, np.maximum(limit, mean))
        self.free = np.minimum(free, self.limit)
        dips = number_of_dips(length, self.time, self.free, np.isnan(stop), style)
        # cells of 4 m; longer ones on long routes, so that memory and time stay bounded
        spacing = max(4.0, float(length.sum()) / 400_000)
        # twelve cells a dip let the car move between two stops and between a stop and the link's end
        cells = np.maximum(np.maximum(np.ceil(length / spacing), 4), 12 * dips).astype(np.int64)
        self.ends = np.cumsum(cells)
        self.link = np.repeat(np.arange(n), cells)
        self.position = running_sum((length / cells)[self.link])
        self.position[self.ends] = np.cumsum(length)
        self.dip_link = np.repeat(np.arange(n), dips)
        order = np.arange(len(self.dip_link)) - np.repeat(np.cumsum(dips) - dips, dips)
        drawn = None if rng is None else rng.uniform(0.2, 0.8, len(self.dip_link))
        place = style.stop_place if drawn is None else drawn
        around = cells[self.dip_link]
        within = np.rint((order + place) / dips[self.dip_link] * around).astype(np.int64)
        self.dip_node = (self.ends - cells)[self.dip_link] + np.clip(within, 2, around - 2)
        # without a place to stop the speed is lowered to a twentieth of the free speed at most
        most = np.where(dips > 0, 1.0, 0.95)
        # at both ends of the route the car stands anyway: time to spare is spent there
        at_rest = np.zeros(n, dtype=bool)
        at_rest[[0, -1]] = np.isnan(stop[[0, -1]])
        self.most_delay = np.where(at_rest & (dips == 0), 0.0, most)
        self.ramp = ramp_speeds(self.position, self.ends, np.minimum(self.free, HURRY * mean + 2.0), style)
        for side in (self.ramp[1:], self.ramp[:-1]):
            np.minimum(side, self.limit[self.link], out=side)

    def drive(self, delay: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Speed at the nodes [m/s] and time between them [s] for a delay of each link, without waiting.

        A negative delay is more speed and firmer pedals. A positive one slows the car down at the dips; on a
        link without any it lowers the speed throughout.
        """
        has_dip = self.most_delay == 1.0
        share = np.where(has_dip, 1.0 - np.minimum(delay, 0.0), 1.0 - delay)
        cruise = np.minimum(self.free * share, self.fastest)
        effort = np.minimum(self.style.comfort * (1.0 + FIRMER * np.maximum(-delay, 0.0)), 1.0)
        cell = cruise[self.link]
        aim = np.zeros(len(self.position))
        np.minimum(cell[1:], cell[:-1], out=aim[1:-1])
        np.maximum(aim[1:], self.ramp[1:] * np.minimum(share, 1.0)[self.link], out=aim[1:])
        aim[[0, -1]] = 0.0
        slow = self.free[self.dip_link] * (1.0 - np.clip(delay[self.dip_link], 0.0, 1.0))
        aim[self.dip_node] = np.minimum(aim[self.dip_node], slow)
        aim[self.ends[self.stop > 0]] = 0.0
        speed = reachable_speed(self.position, aim, self.style.driver, effort[self.link])
        return speed, np.diff(self.position) * 2.0 / (speed[1:] + speed[:-1])

    def solve(self) -> tuple[FloatArray, FloatArray]:
        """Find the delays that reproduce the travel times, all links at once by the secant method.

        Neighbours move each other, so that a secant may mislead: a delay never changes by more than its step, which
        grows while the sign of the link's error stays and is halved when it changes.
        """
        delay = np.where(self.most_delay == 1.0, 0.4, 0.0)
        least = np.minimum(1.0 - self.fastest / self.free, (1.0 - 1.0 / self.style.comfort) / FIRMER)
        # a choice, because links of 250 m and 1 km then take the fewest passes
        step = np.full(delay.shape, 0.12)
        before, slope = np.zeros(delay.shape), np.zeros(delay.shape)
        tolerance = np.maximum(TIME_TOLERANCE * self.time, TIME_TOLERANCE_S)
        change = np.zeros(delay.shape)
        # a bound of the time; a choice
        for _ in range(30):
            speed, driving_s = self.drive(delay)
            late = np.bincount(self.link, driving_s, len(delay)) - self.time
            with np.errstate(divide="ignore", invalid="ignore"):
                slope = np.where(change != 0.0, (late - before) / change, slope)
            # a link that stops can wait for what is left, one that hurries all it can will not get faster
            settled = (
                (np.abs(late) <= tolerance)
                | ((late < 0) & (delay >= self.most_delay) & self.can_wait)
                | ((late > 0) & (delay <= least))
            )
            if settled.all():
                break
            step = np.where(late * before < 0, 0.5 * step, np.minimum(1.5 * step, 0.5))
            with np.errstate(divide="ignore", invalid="ignore"):
                wanted = np.where(slope > 0, np.abs(late) / slope, step)
            wanted = np.where(settled, 0.0, -np.sign(late) * np.minimum(wanted, step))
            new = np.clip(delay + wanted, least, self.most_delay)
            change, before, delay = new - delay, late, new
        return speed, driving_s

    @property
    def can_wait(self) -> BoolArray:
        """Whether a link has a place at which time to spare is spent standing."""
        can = np.equal(self.most_delay, 1.0)
        can[[0, -1]] |= self.most_delay[[0, -1]] == 0.0
        return can

    @property
    def fastest(self) -> FloatArray:
        """Highest speed that is tried on each link [m/s]."""
        return np.minimum(np.maximum(self.free, HURRY * self.length / self.time + 2.0), self.limit)

    def waiting(
        self, speed: FloatArray, driving_s: FloatArray, rng: np.random.Generator | None
    ) -> FloatArray:
        """Standstill at each node [s]: what was given, and the time that driving leaves over."""
        n = len(self.length)
        left = np.maximum(self.time - np.bincount(self.link, driving_s, n), 0.0)
        # a car that has slowed down to half a metre per second can as well wait; a choice
        stands = speed[self.dip_node] < 0.5
        # start and end of the route count as stops of the first and the last link
        nodes = np.concatenate((self.dip_node[stands], [0, self.ends[-1]]))
        owner = np.concatenate((self.dip_link[stands], [0, n - 1]))
        share = np.ones(len(nodes))
        if rng is not None:
            share = draw_dwell(share, self.style.driver, rng)
        wait = np.zeros(len(self.position))
        wait[nodes] = left[owner] * share / np.bincount(owner, share, n)[owner]
        wait[self.ends] += self.stop
        return wait


def ramp_speeds(position: FloatArray, ends: IntArray, free: FloatArray, style: LinkStyle) -> FloatArray:
    """Speed that is allowed at each node [m/s] because a faster link is near, 0 where none is.

    A change of speed lies on both sides of the point at which two links meet: the car passes it at the mean of the
    two speeds, and on the slower link it speeds up to that, or has come from it, at a comfortable pace.
    """
    border = position[ends[:-1]]
    speed = 0.5 * (free[1:] + free[:-1])
    gentle = style.comfort * style.driver.acceleration_m_s2
    pace = gentle / (1.0 + (speed / style.driver.half_acceleration_speed_m_s) ** 2)
    link = np.searchsorted(position[ends], position, side="left")
    ramp = np.zeros_like(position)
    for neighbour in (link - 1, link):  # the border before the node and the one behind it
        near = np.clip(neighbour, 0, max(len(border) - 1, 0))
        known = (neighbour >= 0) & (neighbour < len(border))
        if known.any():
            squared = speed[near] ** 2 - 2.0 * pace[near] * np.abs(position - border[near])
            ramp = np.maximum(ramp, np.where(known, np.sqrt(np.maximum(squared, 0.0)), 0.0))
    return ramp


def number_of_dips(
    length: FloatArray, time: FloatArray, free: FloatArray, unknown: BoolArray, style: LinkStyle
) -> IntArray:
    """How often the car slows down or stops on each link: once, more often on a long link or with time left over, never without any.

    Standing at an end of the route is half a stop.
    """
    up = style.comfort * style.driver.acceleration_m_s2
    down = style.comfort * style.driver.deceleration_m_s2
    half_squared = style.driver.half_acceleration_speed_m_s**2
    # time that a stop costs against driving on: v/2a braking; ∫ (1 - u/v) du / a(u) speeding up
    stop_s = free / (2.0 * down) + free / (2.0 * up) * (1.0 + free**2 / (6.0 * half_squared))
    spare = time - length / free
    ends = np.bincount([0, len(length) - 1], minlength=len(length))
    fitting = np.maximum(spare / (stop_s + style.driver.dwell_mean_s), length / LONGEST_STREET_M)
    number = np.rint(fitting - 0.5 * ends)
    # 25 m are about four cars in a queue; a choice
    number = np.clip(number, np.where(ends > 0, 0, 1), np.maximum(length // 25.0, 1))
    return np.asarray(np.where(unknown & (spare > TIME_TOLERANCE * time), number, 0), dtype=np.int64)
