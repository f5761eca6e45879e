"""Speed over time from the length and travel time of links: where the car stops and how fast it is in between.

A link's mean speed includes every standstill. The driver model therefore has two steps: the speed of this driver
without any disturbance (`LinkStyle.free_speed`), and the use of the time left over. A little time left over becomes a
place at which the car slows down; more becomes a stop; still more a longer stop or several. Links whose mean speed is
above the free speed are driven faster. All of this follows from one number per link, its *delay*. Travel time grows with
the delay; the delays that reproduce the travel times are found for all links at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import BoolArray, FloatArray, IntArray, changes, running_sum
from tripwatt.errors import Fault, raise_faults
from tripwatt.routes.driver import (
    DriverStyle,
    SpeedProfile,
    draw_dwell,
    profile_over_time,
    reachable_speed,
)

_LONGEST_STREET_M: Final = 2000.0
"""Link length [m] above which the street speed no longer grows: twice the longest links of its fit. A longer link has at least
one disturbance per such length, as several links of this length would have."""

_MAX_OVER_MEAN_M_S: Final = 8.0
"""Largest difference between free speed and mean speed [m/s]. This and the next two constants come from the driving schedules that
were made of recorded driving (`docs/decisions/forecast-11-even-links.md`)."""


_CRUISE_M_S: Final = 25.0
"""From this mean speed [m/s] on, nothing slows the car down: it cruises at the mean speed."""

_FIRMER: Final = 3.0
"""A driver who exceeds the free speed by a share s accelerates and brakes more firmly by the share `_FIRMER` times s."""

_TIME_TOLERANCE: Final = 0.005
"""The iteration ends when every link's travel time is right to this share or to `_TIME_TOLERANCE_S`, whichever is larger; a
choice."""

_TIME_TOLERANCE_S: Final = 0.2
"""Tolerance of a link's travel time [s]; a choice, a fifth of the usual step between two samples."""

_HURRY: Final = 1.6
"""A car that has to make up time drives at most this many times the link's mean speed, plus 2 m/s; a choice."""


@dataclass(frozen=True, slots=True)
class LinkStyle:
    """Parameters of the speed over time on a link of which only the mean speed is known.

    The defaults of `street_speed_m_s`, `length_exponent` and `comfort` are fitted by `benchmarks/link_style.py` to the electric
    cars of the Vehicle Energy Dataset and rounded; the other values are a choice (method: `docs/reference/routes.md`).

    Attributes
    ----------
    driver : DriverStyle
        Its acceleration and deceleration are never exceeded; `speed_share` and `fluctuation` are not used.
    comfort : float
        Share of the driver's acceleration and deceleration that is used if the travel time allows, in (0, 1].
    street_speed_m_s : float
        Speed [m/s] between two stops on a link of 250 m, however slow the link is on the whole.
    length_exponent : float
        Exponent with which this speed grows with the length of the link.
    sharpness : float
        Exponent of the power mean of this speed and the link's mean speed, at least 1; a high value gives the larger of the two.
    stop_place : float
        Place at which the car slows down or stops, as a share of its part of the link: 0 = start, 1 = end.

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
        """Speed between two disturbances [m/s] on each link, shape of `length_m`.

        This is the power mean of the mean speed and a street speed that grows with the length, but at most
        `_MAX_OVER_MEAN_M_S` above the mean speed, and nearer to the mean speed on fast roads (`undisturbed_speed`).

        Parameters
        ----------
        length_m : ndarray, shape (links,)
            Length of each link [m]; above `_LONGEST_STREET_M` the speed no longer grows with the length.
        speed_m_s : ndarray, shape (links,)
            Mean speed on each link [m/s].

        Returns
        -------
        ndarray, shape (links,)
            Speed [m/s], at least the mean speed.

        Examples
        --------
        >>> LinkStyle(street_speed_m_s=10.0, sharpness=2.0).free_speed(np.array([250.0]), np.array([10.0])).round(2)
        array([14.14])
        """
        # `street_speed_m_s` is that of a link of 250 m
        reach = np.minimum(length_m, _LONGEST_STREET_M) / 250.0
        street = self.street_speed_m_s * reach**self.length_exponent
        free = (street**self.sharpness + speed_m_s**self.sharpness) ** (1.0 / self.sharpness)
        return undisturbed_speed(speed_m_s, np.minimum(free, speed_m_s + _MAX_OVER_MEAN_M_S))


def undisturbed_speed(mean_m_s: FloatArray, free_m_s: FloatArray) -> FloatArray:
    """Speed between two disturbances: `free_m_s` on a slow road, the mean speed on a fast road, in between a blend of the two.

    Parameters
    ----------
    mean_m_s, free_m_s : ndarray, shape (links,)
        Mean speed, and the speed between two disturbances on a slow road [m/s].

    Returns
    -------
    ndarray, shape (links,)
        From the mean speed to the larger of the two [m/s].

    Examples
    --------
    >>> undisturbed_speed(np.array([10.0, 19.5, 25.0]), np.array([18.0, 30.0, 36.0])).tolist()
    [18.0, 24.75, 25.0]
    """
    share = np.clip((_CRUISE_M_S - mean_m_s) / (_CRUISE_M_S - 14.0), 0.0, 1.0)
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
    """Speed over time of a drive on links in their travel times, from standstill to standstill. O(length / 4 m + samples).

    Speed is continuous and changes no faster than `style.driver` allows. If the travel time of a link cannot be reproduced
    within these limits, the link takes longer; every other link takes its travel time to within 5 per mille or 0.2 s (see
    `docs/reference/routes.md` for the measured share).

    Parameters
    ----------
    length_m, travel_time_s : array_like, shape (links,)
        Length of each link [m] and time on it including every standstill [s].
    stop_s : array_like, shape (links,), optional
        Standstill at the end of each link [s], part of its travel time: 0 = the car does not stop on this link, NaN =
        not known, so that stops are placed where the travel time needs them. By default all are unknown.
    moving_speed_m_s : array_like, shape (links,), optional
        Speed while nothing stands in the way [m/s], NaN = not known. On a fast road the car stays below this speed, so that less
        time is left over for stops.
    speed_limit_m_s : array_like, shape (links,), optional
        Highest speed [m/s], NaN = not known. If the mean speed of a link is above its limit, the mean speed is the highest speed.
    style : LinkStyle, optional
        How traffic and driver fill a link; the calibrated style by default.
    rng : numpy.random.Generator, optional
        Draws stops, their lengths and the speeds in between; without it the profile is the same every time.
    step_s : float
        Time between two samples [s].

    Returns
    -------
    SpeedProfile
        Samples of time, speed, position and link.

    Examples
    --------
    >>> profile = link_profile([250.0, 250.0, 250.0], [30.0, 60.0, 30.0])
    >>> float(profile.position_m[-1]), bool(abs(profile.time_s[-1] - 120.0) <= 1.0)
    (750.0, True)
    """
    style = style or LinkStyle()
    length = np.asarray(length_m, dtype=np.float64)
    others = (
        np.full(length.shape, np.nan) if values is None else np.asarray(values, dtype=np.float64)
        for values in (travel_time_s, stop_s, moving_speed_m_s, speed_limit_m_s)
    )
    course = Course((length, *others), style, rng)
    speed, driving_s = course.solve()
    waiting_s = course.waiting(speed, driving_s, rng)
    return profile_over_time(course.position, speed, driving_s, waiting_s, step_s)


class Course:
    """The grid of cells over the links, and the solver for the delays of the links.

    Per link: `limit` is the speed limit (infinite if unknown), `free` the speed without disturbance, `time` the travel time
    without the given stops, `fastest` the highest speed that is tried, `ends` the last node, `cells` the number of its cells, and
    `nodes` that of its nodes: one more on the first link. Per cell: `link` is the index of its link, `cell_m` its length. Per node:
    `node_link` is the index of its link, `ramp` a speed that is allowed in any case because a neighbouring link is faster. The car
    stands at the nodes `stops`. A dip is a place at which the car slows down or stops; each has a node (`dip_node`) and a link (`dip_link`).
    """

    def __init__(
        self, columns: Iterable[FloatArray], style: LinkStyle, rng: np.random.Generator | None
    ) -> None:
        length, time, stop, moving, limit = columns
        n = len(length)
        self.length, self.stop, self.style = length, np.nan_to_num(stop, nan=0.0), style
        self.time = time - self.stop
        mean = length / self.time
        free = np.where(np.isnan(moving), style.free_speed(length, mean), undisturbed_speed(mean, moving))
        # on a link whose stops are given the car drives at the mean speed
        free = np.where(np.isnan(stop) | ~np.isnan(moving), free, mean)
        if rng is not None:
            # a random variation of 5 % from link to link; a choice
            free = free * np.exp(0.05 * rng.standard_normal(free.shape))
        self.limit = np.where(np.isnan(limit), np.inf, np.maximum(limit, mean))
        self.free = np.minimum(free, self.limit)
        dips = number_of_dips(length, self.time, self.free, np.isnan(stop), style)
        # cells of 4 m; longer ones on long routes, so that memory and time stay bounded
        spacing = max(4.0, float(length.sum()) / 400_000)
        # twelve cells a dip let the car move between two stops and between a stop and the link's end
        cells = np.maximum(np.maximum(np.ceil(length / spacing), 4), 12 * dips).astype(np.int64)
        self.ends = np.cumsum(cells)
        self.stops = np.concatenate(([0], self.ends[self.stop > 0], self.ends[-1:]))
        self.position = running_sum(np.repeat(length / cells, cells))
        self.position[self.ends] = np.cumsum(length)
        self.cells, self.nodes = cells, cells + (np.arange(n) == 0)
        self.cell_m, self.node_link = changes(self.position)[1:], np.arange(n).repeat(self.nodes)
        self.link = self.node_link[1:]
        self.dip_link = np.repeat(np.arange(n), dips)
        index = np.arange(len(self.dip_link)) - np.repeat(np.cumsum(dips) - dips, dips)
        place = style.stop_place if rng is None else rng.uniform(0.2, 0.8, len(self.dip_link))
        cells_of_link = cells[self.dip_link]
        within = np.rint((index + place) / dips[self.dip_link] * cells_of_link).astype(np.int64)
        self.dip_node = (self.ends - cells)[self.dip_link] + np.clip(within, 2, cells_of_link - 2)
        # at both ends of the route the car stands anyway: the time left over is spent there
        at_rest = np.zeros(n, dtype=bool)
        at_rest[[0, -1]] = np.isnan(stop[[0, -1]])
        self.has_dip = dips > 0
        # without a place to stop, the speed is lowered to no less than a twentieth of the free speed
        self.max_delay = np.where(self.has_dip, 1.0, np.where(at_rest, 0.0, 0.95))
        self.can_wait = self.has_dip | at_rest
        in_time = _HURRY * mean + 2.0
        self.fastest = np.minimum(np.maximum(self.free, in_time), self.limit)
        self.ramp = ramp_speeds(self.position, self.ends, np.minimum(self.free, in_time), style)
        np.minimum(self.ramp, self.of_neighbours(self.limit), out=self.ramp)

    def drive(self, delay: FloatArray, before: FloatArray, new: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Speed at the nodes [m/s] and driving time between them [s], given the delay of each link, and the speed before the delays of some links changed.

        A negative delay means more speed and firmer acceleration and braking. A positive delay slows the car down at the dips
        of the link; on a link without dips it lowers the speed throughout. Only the changed links and their neighbours are driven
        again; all links are if the speed then changes at the far ends of the neighbours.
        """
        hurry = np.minimum(delay, 0.0)
        share = 1.0 - np.where(self.has_dip, hurry, delay)
        effort = np.minimum(self.style.comfort * (1.0 - _FIRMER * hurry), 1.0)
        aim = self.of_neighbours(np.minimum(self.free * share, self.fastest))
        np.maximum(aim, self.ramp * np.minimum(share, 1.0).repeat(self.nodes), out=aim)
        slow = self.free * (1.0 - np.maximum(delay, 0.0))
        aim[self.dip_node] = np.minimum(aim[self.dip_node], slow[self.dip_link])
        near = np.convolve(new, np.ones(3))[1:-1] > 0.0
        is_driven, end = near.repeat(self.nodes), self.ends[:-1][near[1:] != near[:-1]]
        aim[self.stops], aim[end], is_driven[end] = 0.0, before[end], True
        part, speed = is_driven.nonzero()[0], before.copy()
        link = self.node_link[part]
        start_m = (effort * self.length).cumsum() - effort * self.position[self.ends]
        weighted_m = effort[link] * self.position[part] + start_m[link]
        speed[part] = reachable_speed(weighted_m, aim[part], self.style.driver)
        beside = np.array([end - 1, end, end + 1])
        if (np.abs(speed[beside] - before[beside]) > 1e-9).any():
            return self.drive(delay, before, np.ones_like(new))
        return speed, self.cell_m * 2.0 / (speed[1:] + speed[:-1])

    def of_neighbours(self, values: FloatArray) -> FloatArray:
        """The lower of the values of the two cells at each node, given a value of each link."""
        lowest = values.repeat(self.nodes)
        lowest[self.ends[:-1]] = np.minimum(values[:-1], values[1:])
        return lowest

    def solve(self) -> tuple[FloatArray, FloatArray]:
        """Find the delays that reproduce the travel times, for all links at once; return the result of `drive` for them.

        The secant method is used. Neighbouring links influence each other, so a secant may mislead: a delay changes at most by
        a step, which grows while the sign of the link's error is the same and is halved when the sign changes.
        """
        delay = np.where(self.has_dip, 0.4, 0.0)
        min_delay = np.minimum(1.0 - self.fastest / self.free, (1.0 - 1.0 / self.style.comfort) / _FIRMER)
        # a choice: links of 250 m and of 1 km then take the fewest passes
        step = np.full(delay.shape, 0.12)
        previous_late_s, slope = np.zeros(delay.shape), np.zeros(delay.shape)
        tolerance = np.maximum(_TIME_TOLERANCE * self.time, _TIME_TOLERANCE_S)
        waits_from = np.where(self.can_wait, self.max_delay, np.inf)
        change, speed = np.full(delay.shape, np.inf), np.zeros(self.position.shape)
        # a bound of the time; a choice
        for _ in range(30):
            speed, driving_s = self.drive(delay, speed, change != 0.0)
            late_s = np.add.reduceat(driving_s, self.ends - self.cells) - self.time
            off_s = np.abs(late_s)
            np.divide(late_s - previous_late_s, change, out=slope, where=change != 0.0)
            # settled: in tolerance, or early with a stop in which the car can wait, or late and as fast as possible
            settled = (off_s <= tolerance) | np.where(late_s < 0, delay >= waits_from, delay <= min_delay)
            if settled.all():
                break
            step = np.where(late_s * previous_late_s < 0, 0.5 * step, np.minimum(1.5 * step, 0.5))
            size = np.minimum(np.divide(off_s, slope, out=step.copy(), where=slope > 0), step)
            wanted = delay - np.where(settled, 0.0, np.copysign(size, late_s))
            new_delay = np.minimum(np.maximum(wanted, min_delay), self.max_delay)
            change, previous_late_s, delay = new_delay - delay, late_s, new_delay
        return speed, driving_s

    def waiting(
        self, speed: FloatArray, driving_s: FloatArray, rng: np.random.Generator | None
    ) -> FloatArray:
        """Standstill at each node [s]: the given stops, and the time that driving leaves over."""
        n = len(self.length)
        spare_s = np.maximum(self.time - np.bincount(self.link, driving_s), 0.0)
        # a car that has slowed down to half a metre per second counts as stopped; a choice
        stands = speed[self.dip_node] < 0.5
        # start and end of the route count as stops of the first and the last link
        nodes = np.concatenate((self.dip_node[stands], [0, self.ends[-1]]))
        link = np.concatenate((self.dip_link[stands], [0, n - 1]))
        share = np.ones(len(nodes))
        if rng is not None:
            share = draw_dwell(share, self.style.driver, rng)
        wait = np.zeros(len(self.position))
        wait[nodes] = spare_s[link] * share / np.bincount(link, share, n)[link]
        wait[self.ends] += self.stop
        return wait


def ramp_speeds(position: FloatArray, ends: IntArray, free: FloatArray, style: LinkStyle) -> FloatArray:
    """Speed that is allowed at each node [m/s] because a border of two links is near; 0 far from all borders.

    A change of speed lies on both sides of the point at which two links meet. The car passes this point at the mean of the two
    speeds; on the slower link it accelerates to this mean, or slows down from it, at a comfortable rate.
    """
    border = position[ends[:-1]]
    speed = 0.5 * (free[1:] + free[:-1])
    gentle = style.comfort * style.driver.acceleration_m_s2
    pace = gentle / (1.0 + (speed / style.driver.half_acceleration_speed_m_s) ** 2)
    # zeros stand for the border that the first link lacks before it, and the last one behind it
    borders = np.zeros((3, len(ends) + 1))
    borders[:, 1:-1] = border, speed**2, 2.0 * pace
    ramp = np.zeros_like(position)
    for beside in (borders[:, :-1], borders[:, 1:]):
        place, squared, change = np.repeat(beside, np.diff(ends, prepend=-1), axis=1)
        np.maximum(ramp, squared - change * np.abs(position - place), out=ramp)
    return np.sqrt(ramp)


def number_of_dips(
    length: FloatArray, time: FloatArray, free: FloatArray, unknown: BoolArray, style: LinkStyle
) -> IntArray:
    """Number of places on each link at which the car slows down or stops.

    There is none if hardly any time is left over or the stops of the link are known. Otherwise there is at least one, except on the first
    and the last link, and more on a long link or with much time left over. Standing at an end of the route counts as half a stop.
    """
    up = style.comfort * style.driver.acceleration_m_s2
    down = style.comfort * style.driver.deceleration_m_s2
    half_squared = style.driver.half_acceleration_speed_m_s**2
    # time that a stop costs against driving on: v/2a braking; ∫ (1 - u/v) du / a(u) speeding up
    stop_s = free / (2.0 * down) + free / (2.0 * up) * (1.0 + free**2 / (6.0 * half_squared))
    spare = time - length / free
    ends = np.bincount([0, len(length) - 1], minlength=len(length))
    number_wanted = np.maximum(spare / (stop_s + style.driver.dwell_mean_s), length / _LONGEST_STREET_M)
    number = np.rint(number_wanted - 0.5 * ends)
    # 25 m are about four cars in a queue; a choice
    number = np.clip(number, np.where(ends > 0, 0, 1), np.maximum(length // 25.0, 1))
    return np.asarray(np.where(unknown & (spare > _TIME_TOLERANCE * time), number, 0), dtype=np.int64)
