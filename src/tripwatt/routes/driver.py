"""The driver model: from a route to speed over time, with limits, comfort, stops and fluctuation.

A route is a sequence of links, each with a length, a speed that is allowed or expected on it, and a standstill at its
end. The speed over *distance* is found first, by one pass forwards (how fast can the car have become?) and one backwards
(how fast may it be to keep the next limit?). Both are running minima of a potential, so that no loop over samples is
needed. Only then is distance converted to time.

These are pure functions of arrays, independent of cars and trips. The physics decides whether a car can follow the profile.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.errors import Fault, raise_faults


@dataclass(frozen=True, slots=True)
class DriverStyle:
    """Parameters of a driver.

    The acceleration of a driver falls with speed as `acceleration_m_s2 / (1 + (v / v_half)²)`, with
    `v_half = half_acceleration_speed_m_s`; braking is equally firm at every speed. The defaults are a choice, near the
    1.48 m/s² that are the largest acceleration and deceleration of EPA's urban schedule (UDDS), and far from the 3.8 and
    3.1 m/s² of its aggressive schedule (US06).

    Attributes
    ----------
    acceleration_m_s2 : float
        Acceleration from standstill [m/s²], the largest of this driver.
    deceleration_m_s2 : float
        Deceleration when braking [m/s²], positive.
    half_acceleration_speed_m_s : float
        Speed [m/s] at which half of the acceleration is left.
    speed_share : float
        Share of a link's speed that the driver aims at, in (0, 1].
    fluctuation : float
        Standard deviation of the logarithm of the aimed speed; it also scales how much the pressure on the pedals varies.
        0 is a perfectly steady foot.
    fluctuation_time_s : float
        Time constant [s] of the fluctuation at the links' speed.
    dwell_mean_s : float
        Mean standstill at a stop [s].
    """

    acceleration_m_s2: float = 1.6
    deceleration_m_s2: float = 1.5
    half_acceleration_speed_m_s: float = 20.0
    speed_share: float = 0.97
    fluctuation: float = 0.06
    fluctuation_time_s: float = 10.0
    dwell_mean_s: float = 20.0

    def __post_init__(self) -> None:
        raise_faults(self._faults())

    def _faults(self) -> Iterator[Fault]:
        for name in (f.name for f in fields(self)):
            value = getattr(self, name)
            zero_allowed = name in {"fluctuation", "dwell_mean_s"}
            if not (math.isfinite(value) and (value > 0 or (zero_allowed and value == 0))):
                allowed = "0 or more" if zero_allowed else "more than 0"
                yield Fault("driver style out of range", name, f"{value}", allowed)
        if self.speed_share > 1:
            yield Fault("driver style out of range", "speed_share", f"{self.speed_share}", "at most 1")


@dataclass(frozen=True, eq=False, slots=True)
class SpeedProfile:
    """Speed over time along a route, in equal steps, from standstill to standstill.

    Attributes
    ----------
    time_s : ndarray, shape (samples,)
        0, step, 2 step, ... [s]; the last sample is the first one at which the car has arrived.
    speed_m_s : ndarray, shape (samples,)
        Speed at each time [m/s].
    position_m : ndarray, shape (samples,)
        Distance driven until each time [m]; the last is the length of the route.
    """

    time_s: FloatArray
    speed_m_s: FloatArray
    position_m: FloatArray


def draw_dwell(stop_probability: npt.ArrayLike, style: DriverStyle, rng: np.random.Generator) -> FloatArray:
    """Draw at random whether the car stops at the end of each link, and for how long. O(links).

    Parameters
    ----------
    stop_probability : array_like, shape (links,)
        Chance in [0, 1] that the car has to stop at the end of the link.
    style : DriverStyle
        Its `dwell_mean_s` is the mean standstill if it is above the shortest one of 2 s; the rest is exponentially distributed.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (links,)
        Standstill [s], 0 if the car does not stop.

    Examples
    --------
    >>> draw_dwell([0.0, 1.0], DriverStyle(dwell_mean_s=0.0), np.random.default_rng(1))
    array([0., 2.])
    """
    probability = np.asarray(stop_probability, dtype=np.float64)
    stops = rng.random(probability.shape) < probability
    shortest_s = 2.0  # a choice: a car that stops stands for a moment
    extra_s = rng.exponential(1.0, probability.shape) * max(style.dwell_mean_s - shortest_s, 0.0)
    return np.where(stops, shortest_s + extra_s, 0.0)


def speed_profile(
    length_m: npt.ArrayLike,
    speed_m_s: npt.ArrayLike,
    *,
    dwell_s: npt.ArrayLike | None = None,
    style: DriverStyle | None = None,
    rng: np.random.Generator | None = None,
    step_s: float = 1.0,
) -> SpeedProfile:
    """Drive a route from standstill to standstill. O(length / 4 m + samples).

    Speed never exceeds the speed of a link, never rises faster than the style's acceleration at standstill nor falls
    faster than its deceleration, and is 0 at both ends of the route and at every stop. Between two points of the
    distance grid the acceleration is constant.

    Parameters
    ----------
    length_m : array_like, shape (links,)
        Length of each link [m].
    speed_m_s : array_like, shape (links,)
        Speed allowed or expected on each link while moving [m/s].
    dwell_s : array_like, shape (links,), optional
        Standstill at the end of each link [s], 0 = the car does not stop there; by default there are no stops. A stop
        shorter than `step_s` may fall between two samples.
    style : DriverStyle, optional
    rng : numpy.random.Generator, optional
        Source of the fluctuation. By default the foot is steady and the result has no randomness. The draws do not depend
        on `step_s`.
    step_s : float
        Time between two samples [s].

    Returns
    -------
    SpeedProfile

    Examples
    --------
    >>> profile = speed_profile([100.0, 400.0], [8.0, 14.0], dwell_s=[5.0, 0.0])
    >>> round(float(profile.position_m[-1]), 6), float(profile.speed_m_s.max()) <= 14.0
    (500.0, True)
    """
    style = style or DriverStyle()
    length, speed = np.asarray(length_m, dtype=np.float64), np.asarray(speed_m_s, dtype=np.float64)
    dwell = np.zeros_like(length) if dwell_s is None else np.asarray(dwell_s, dtype=np.float64)
    # two cells at least: a link between two stops needs a point at which the car moves
    # cells of 4 m resolve one metre per second at walking pace; memory stays small
    cells = np.maximum(np.ceil(length / 4.0), 2).astype(np.int64)
    ends = np.cumsum(cells)
    position = running_sum(np.repeat(length / cells, cells))
    cell_speed = np.repeat(speed, cells)
    # where two cells meet the lower of their speeds is allowed
    allowed = np.minimum(np.append(cell_speed[0], cell_speed), np.append(cell_speed, cell_speed[-1]))
    at_speed_s = running_sum(np.repeat(length / cells / speed, cells))
    steadiness, weighted_m = np.ones_like(position), position
    if rng is not None:
        steadiness = np.exp(style.fluctuation * smooth_noise(at_speed_s, style.fluctuation_time_s, rng))
        # the pressure on a pedal changes over 1.5 s, and is three tenths of comfort at least; choices
        pressure = 1.0 - 2.0 * style.fluctuation * (1.0 + smooth_noise(at_speed_s, 1.5, rng))
        weighted_m = running_sum(np.clip(pressure[1:], 0.3, 1.0) * np.diff(position))
    share = style.speed_share * steadiness
    # mirrored at the limit: with clipping, the car would cruise exactly at the limit
    share = np.where(share > 1.0, 2.0 - share, share)
    # stops come from the route, not from fluctuation
    aimed = allowed * np.maximum(share, 0.4 * style.speed_share)
    stops = ends[dwell > 0]
    aimed[0] = aimed[-1] = 0.0
    aimed[stops] = 0.0

    node_speed = reachable_speed(weighted_m, aimed, style)
    driving_s = np.diff(position) * 2.0 / (node_speed[1:] + node_speed[:-1])
    waiting_s = np.zeros_like(position)
    waiting_s[ends] = dwell
    return profile_over_time(position, node_speed, driving_s, waiting_s, step_s)


def reachable_speed(weighted_m: FloatArray, aimed_m_s: FloatArray, style: DriverStyle) -> FloatArray:
    """Highest speed at each point that keeps to the aimed speeds and to the driver's acceleration and deceleration. O(n).

    With an acceleration `a(v)` the potential `u(v) = ∫ v / a(v) dv` grows by at most one metre per metre driven, so
    the highest `u` at `s` is the minimum over all earlier points `s'` of `u(s') + s - s'`: a running minimum. The
    same holds backwards for braking.

    Parameters
    ----------
    weighted_m : ndarray, shape (n,)
        Distance from the start [m], increasing. A piece on which only a share of the style's acceleration and deceleration is used
        counts as that share of its length.
    aimed_m_s : ndarray, shape (n,)
        Highest speed that the driver aims at, at each point [m/s].
    style : DriverStyle

    Returns
    -------
    ndarray, shape (n,)
        Speed [m/s].

    Examples
    --------
    >>> style = DriverStyle(acceleration_m_s2=2.0, deceleration_m_s2=1.0, half_acceleration_speed_m_s=1e9)
    >>> reachable_speed(np.array([0.0, 4.0, 8.0]), np.array([0.0, 9.0, 0.0]), style)
    array([0.        , 2.82842712, 0.        ])
    """
    # a(v) = a0 / (1 + v²/h²) gives a0 u = v²/2 + v⁴/(4 h²), which inverts in closed form
    half_squared = style.half_acceleration_speed_m_s**2
    up, down = style.acceleration_m_s2, style.deceleration_m_s2
    squared = aimed_m_s * aimed_m_s
    potential_m = (squared * squared / (4.0 * half_squared) + squared * 0.5) / up
    # `fmin` does not look for missing values and takes two thirds of the time
    forward = np.fmin.accumulate(potential_m - weighted_m) + weighted_m
    # the rationalised root of the quadratic, exact also where v << h
    scaled = np.maximum(forward, 0.0) * (4.0 * up)
    squared = np.minimum(squared, scaled / (np.sqrt(scaled / half_squared + 1.0) + 1.0))
    after = squared / (2.0 * down) + weighted_m
    backward = np.fmin.accumulate(after[::-1])[::-1] - weighted_m
    return np.sqrt(np.minimum(squared, np.maximum(backward, 0.0) * (2.0 * down)))


def smooth_noise(at: FloatArray, memory: float, rng: np.random.Generator) -> FloatArray:
    """Values of a smooth random function at ascending places, see `smooth_field`."""
    return np.interp(at, *smooth_field(float(at[-1]), memory, rng))


def smooth_field(extent: float, memory: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """A smooth random function of distance or time, mean 0 and variance 1, on a regular grid. O(extent / memory).

    A stationary Gaussian process with the once differentiable covariance `(1 + d/l) exp(-d/l)` (Matérn 3/2), as an
    autoregression of order two on ten points per correlation length.

    Parameters
    ----------
    extent : float
        The grid reaches at least this far.
    memory : float
        Correlation length `l`, in the unit of `extent`.
    rng : numpy.random.Generator

    Returns
    -------
    position, value : ndarrays of equal shape
        Grid from 0, and the values of the function on it.
    """
    points_per_length, burn_in = 10, 80
    n = math.ceil(extent / memory * points_per_length) + 2
    pole = math.exp(-1.0 / points_per_length)
    # variance of 1 / (1 - p z)² driven by white noise of variance 1
    variance = (1.0 + pole**2) / (1.0 - pole**2) ** 3
    raw = autoregression(rng.standard_normal(n + burn_in), 2.0 * pole, -(pole**2))[burn_in:]
    position = np.arange(n, dtype=np.float64) * (memory / points_per_length)
    return position, raw / math.sqrt(variance)


def autoregression(shocks: FloatArray, *weights: float) -> FloatArray:
    """Values of an autoregression: each is its shock plus the weighted values before it, 0 before the first. O(shocks).

    This is a triangular system with few diagonals, which LAPACK solves. `scipy.signal.lfilter` gives the same values, but
    takes a second to import.

    Parameters
    ----------
    shocks : ndarray, shape (n,)
    *weights : float
        Weight of the previous value, of the value before that, and so on.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> autoregression(np.array([1.0, 0.0, 0.0, 4.0]), 0.5, 0.25).tolist()
    [1.0, 0.5, 0.5, 4.375]
    """
    from scipy.linalg.lapack import dtbtrs

    diagonals = np.tile(np.array([[1.0], *([-weight] for weight in weights)]), len(shocks))
    values, _ = dtbtrs(diagonals, shocks, uplo="L", diag="U")
    return np.asarray(values, dtype=np.float64)


def profile_over_time(
    position: FloatArray, node_speed: FloatArray, driving_s: FloatArray, waiting_s: FloatArray, step_s: float
) -> SpeedProfile:
    """Convert speed over distance to speed over time. Each node has an arrival and, after its standstill, a departure.

    Between two nodes the speed is linear in time.

    Parameters
    ----------
    position, node_speed : ndarray, shape (nodes,)
        Distance from the start [m] and speed there [m/s].
    driving_s : ndarray, shape (nodes - 1,)
        Time from each node to the next [s].
    waiting_s : ndarray, shape (nodes,)
        Standstill at each node [s]; 0 wherever the speed is not 0.
    step_s : float
        Time between two samples [s].

    Examples
    --------
    >>> at, speed = np.array([0.0, 4.0, 8.0]), np.array([0.0, 4.0, 0.0])
    >>> profile_over_time(at, speed, np.array([2.0, 2.0]), np.array([1.0, 0.0, 0.0]), 1.0).speed_m_s
    array([0., 0., 2., 4., 2., 0.])
    """
    arrival = running_sum(driving_s + waiting_s[:-1])
    departure = arrival + waiting_s
    n_steps = math.ceil(float(departure[-1]) / step_s - 1e-9)
    time = np.arange(n_steps + 1, dtype=np.float64) * step_s
    cell = np.clip(np.searchsorted(departure, time, side="right") - 1, 0, len(driving_s) - 1)
    # a sample between the arrival at the next node and the departure from it is at that node
    into_s = np.minimum(np.maximum(time - departure[cell], 0.0), driving_s[cell])
    slope = (node_speed[cell + 1] - node_speed[cell]) / driving_s[cell]
    is_at_node = into_s >= driving_s[cell]
    is_at_node[-1] = True  # the last sample has arrived, whatever the rounding of its time
    speed = np.where(is_at_node, node_speed[cell + 1], node_speed[cell] + slope * into_s)
    driven = position[cell] + into_s * (node_speed[cell] + 0.5 * slope * into_s)
    driven = np.where(is_at_node, position[cell + 1], driven)
    return SpeedProfile(time, speed, driven)
