"""The speeds that a car may keep on the links of a road, and what each step from link to link takes.

A link is driven at one of a few speeds and takes what the chain of `tripwatt.physics` gives at steady speed. A change of speed is made on the faster of
two links, within half of it: by a ramp at the pace of the calibrated driver, or by lifting, in which the car rolls with the motor off until it has the lower
speed. It costs what it takes beyond the faster speed on the same way, so that times and energies add up over the road.

Climate control has a constant power beside what it takes on any such drive: that of the simulated plan towards its end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, IntArray, distance_driven, running_sum
from tripwatt.errors import InvalidInput
from tripwatt.physics import DriveConditions, simulate_trip
from tripwatt.physics.chain import Trace, drive_chain
from tripwatt.physics.road_load import air_density, inertia_force
from tripwatt.physics.simulate import drive_of_trip
from tripwatt.routes import LinkRoute, LinkStyle
from tripwatt.trips import Plan
from tripwatt.units import M_S_PER_KM_H, WH_PER_J
from tripwatt.vehicles import Vehicle

FLOOR: Final = 0.7
"""Lowest speed over the highest of a link: a slower car is in the way of others. A choice."""

STEP_KM_H: Final = 5.0
"""Step between two speeds that are tried, and that a driver is told."""

PIECE_M: Final = 1000.0
"""Links of about this length: grade and wind are even over each."""

SHORTEST_M: Final = 150.0
"""A border that lies closer to the one before is left out."""

PLACES: Final = 20
"""Places between two borders whose median speed is the highest there: half of the way is driven at that speed or a higher one."""

STANDS_M_S: Final = 1.0
"""Slower intervals of a plan are standstill."""

SETTLED: Final = 0.75
"""Share of the plan's time from which on the power of climate control counts as that of a longer or shorter drive."""

RAMP_SPEEDS: Final = 64
LIFT_SPEEDS: Final = 24
LEAST_LIFT_M_S2: Final = 0.05
"""A road on which the car hardly slows down without its motor has no place to lift."""

SHORTFALL: Final = 0.01
"""Share of the power that a car may lack at a speed which it can hold."""

SAME: Final = 1e-9
"""Relative difference of two values that are one."""


@dataclass(frozen=True, eq=False, slots=True)
class CruiseRoad:
    """What road and traffic allow. Arrays have shape (links,).

    Attributes
    ----------
    length_m, highest_m_s : ndarray
        Length, and highest speed that limits and traffic allow.
    grade, headwind_m_s : ndarray
        Rise over distance, and wind against the car at its height.
    wait_s : ndarray
        Standstill at the end of the link; 0 = the car drives on. The road begins and ends at standstill anyway.

    Examples
    --------
    >>> calm, highest = np.zeros(2), np.array([27.8, 36.1])
    >>> CruiseRoad(np.array([5000.0, 20_000.0]), highest, calm, calm, calm).length_m.sum()
    np.float64(25000.0)
    """

    length_m: FloatArray
    highest_m_s: FloatArray
    grade: FloatArray
    headwind_m_s: FloatArray
    wait_s: FloatArray


def _road_of(plan: Plan, grade: FloatArray, links: LinkRoute | None) -> CruiseRoad:
    """The road of a plan, whose speeds are what limits and traffic allow, cut into links. O(samples + links)."""
    time, speed = plan.array("time_s"), plan.array("speed_m_s")
    at = distance_driven(time, speed)
    step, weather = np.diff(at), plan.air
    stands = np.diff(time) * (step < STANDS_M_S * np.diff(time))
    stands[(at[1:] < SHORTEST_M) | (at[1:] > at[-1] - SHORTEST_M)] = 0.0
    known = np.arange(PIECE_M, at[-1], PIECE_M)
    if links is not None:
        known = np.cumsum(links.length_m) * (at[-1] / links.distance_m)
    border = [0.0]
    for place in np.sort(np.concatenate((known, at[1:][stands > 0.0]))).tolist():
        if place - border[-1] >= SHORTEST_M and at[-1] - place >= SHORTEST_M:
            border.append(place)
    start, stretch = np.array(border), np.diff([*border, at[-1]])
    moves = np.concatenate(([True], step > 0.0))
    places = start[:, None] + stretch[:, None] * (np.arange(PLACES) + 0.5) / PLACES
    highest = np.maximum(np.median(np.interp(places, at[moves], speed[moves]), axis=1), STANDS_M_S)
    count = np.maximum(np.round(stretch / PIECE_M), 1.0).astype(np.int64)
    length = np.repeat(stretch / count, count)
    edges = running_sum(length)

    def mean(rate: FloatArray) -> FloatArray:
        return np.asarray(np.diff(np.interp(edges, at, running_sum(rate[1:] * step))) / length)

    wait = np.zeros(len(length))
    if len(length) > 1:
        nearest = np.abs(edges[1:-1] - at[1:, None][stands > 0.0]).argmin(axis=1)
        wait = np.bincount(nearest, stands[stands > 0.0], len(length)).astype(np.float64)
    wind = np.zeros(len(at)) if weather is None else weather.headwind_m_s
    return CruiseRoad(length, np.repeat(highest, count), mean(grade), mean(wind), wait)


def _levels(
    fastest_m_s: FloatArray, slowest_m_s: FloatArray, step_m_s: float
) -> tuple[FloatArray, BoolArray]:
    """Speeds of nodes, the fastest first, and which are tried; shape (nodes, levels). A standstill has one."""
    top = np.ceil(fastest_m_s / step_m_s - SAME)[:, None]
    speed = np.maximum((top - np.arange(int(top.max()) + 1)) * step_m_s, 0.0)
    speed[:, 0] = fastest_m_s
    tried = (speed > 0.0) & (speed >= slowest_m_s[:, None] * (1.0 - SAME))
    tried[:, 0] = True
    count = int(tried.sum(axis=1).max())
    return np.where(tried, speed, fastest_m_s[:, None])[:, :count], tried[:, :count]


@dataclass(frozen=True, eq=False, slots=True)
class _Ramps:
    """A change of speed on a level road at the calibrated driver's pace. Arrays have shape (speeds,), sums from 0 up to each speed.

    Row 0 of the sums is speeding up, row 1 slowing down.
    """

    speed_m_s: FloatArray
    way_m: FloatArray
    time_s: FloatArray
    energy_wh: FloatArray
    steady_wh_m: FloatArray

    @classmethod
    def of_car(cls, vehicle: Vehicle, conditions: DriveConditions, highest_m_s: float) -> Self:
        """Ramps of a warm car up to a speed."""
        style, speed = LinkStyle(), np.linspace(0.0, highest_m_s, RAMP_SPEEDS + 1)
        mean, driver = 0.5 * (speed[1:] + speed[:-1]), style.driver
        up = driver.acceleration_m_s2 / (1.0 + (mean / driver.half_acceleration_speed_m_s) ** 2)
        pace = style.comfort * np.stack((up, np.full(len(mean), -driver.deceleration_m_s2), up))
        step = np.diff(speed) / np.abs(pace)
        pace[2] = 0.0  # the third row keeps each speed
        trace = Trace(step.cumsum(axis=1), step, np.tile(mean, (3, 1)), pace, np.zeros(len(mean)), None)
        warm = replace(conditions, initial_warmth=1.0)
        power = drive_chain(vehicle, trace, warm, np.zeros(step.shape))[0]["battery_power_w"]
        rows = mean * step, step, power * step * WH_PER_J
        way, time, energy = (np.stack([running_sum(row) for row in each[:2]]) for each in rows)
        return cls(speed, way, time, energy, np.interp(speed, mean, power[2] / mean) * WH_PER_J)

    def reachable(self, length_m: FloatArray, highest_m_s: FloatArray) -> FloatArray:
        """Highest speeds such that each ramp fits into half of the faster link, shape of `length_m`. O(links)."""
        for way, order in zip(self.way_m, (1, -1), strict=True):
            half = np.cumsum(0.5 * length_m[::order])
            room = np.interp(highest_m_s, self.speed_m_s, way)[::order]
            room = np.minimum.accumulate(room - half) + half
            highest_m_s = np.minimum(highest_m_s, np.interp(room[::order], way, self.speed_m_s))
        return highest_m_s

    def between(self, before: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Way [m] of a change of speed, and its time [s] and energy [Wh] beyond those of the faster speed; shape (steps, before, after)."""

        def change(rows: FloatArray) -> FloatArray:
            at_before, at_after = (
                [np.interp(v, self.speed_m_s, row) for row in rows] for v in (before, after)
            )
            up, down = (b - a for a, b in zip(at_before, at_after, strict=True))
            return np.asarray(np.where(after > before, up, -down))

        way, time, energy = map(change, (self.way_m, self.time_s, self.energy_wh))
        faster = np.maximum(before, after)
        steady = np.interp(faster, self.speed_m_s, self.steady_wh_m)
        return way, time - way / np.maximum(faster, SAME), energy - steady * way


@dataclass(frozen=True, eq=False, slots=True)
class _Steady:
    """The car at the levels of nodes: energy of each [Wh], and way [m] and time [s] in which it rolls from one to one of the next node."""

    energy_wh: FloatArray
    holds: BoolArray
    lift_m: FloatArray
    lift_s: FloatArray
    base_w: float

    @classmethod
    def of_car(
        cls, vehicle: Vehicle, conditions: DriveConditions, road: CruiseRoad, levels: FloatArray
    ) -> Self:
        """One pass of the chain over drives that keep to one level each, and over drives at the speeds of lifting."""
        edges = np.linspace(0.0, float(levels.max()), LIFT_SPEEDS + 1)
        lifting = np.tile(0.5 * (edges[1:] + edges[:-1])[:, None], (1, len(road.length_m)))
        speed, count = np.vstack((levels.T, lifting)), levels.shape[1]
        pace = np.vstack(
            (levels.T, np.tile(levels[:, 0], (LIFT_SPEEDS, 1)))
        )  # forces alone are asked of the last rows
        step = np.where(pace > 0.0, road.length_m / np.maximum(pace, SAME), road.wait_s)
        trace = Trace(step.cumsum(axis=1), step, speed, np.zeros(speed.shape), road.grade, road.headwind_m_s)
        arrays, _ = drive_chain(vehicle, trace, conditions, np.zeros(speed.shape))
        power = arrays["battery_power_w"]
        lacks = -arrays["power_by_cause_w"]["shortfall"][:count]
        force = arrays["wheel_power_w"][count:] / lifting
        mass = vehicle.body.test_mass_kg + conditions.payload_mass_kg
        slows = force / inertia_force(np.ones(1), mass, vehicle.body.rotating_mass_factor)
        time = np.diff(edges)[:, None] / np.where(slows > LEAST_LIFT_M_S2, slows, SAME)

        def rolled(rows: FloatArray) -> FloatArray:
            sums = np.cumsum(np.vstack((np.zeros(rows.shape[1]), rows)), axis=0).T
            before, after = (
                np.stack([np.interp(speed, edges, own) for speed, own in zip(some, sums, strict=False)])
                for some in (levels[:-1], levels[1:])
            )
            return np.asarray(before[:, :, None] - after[:, None, :])

        return cls(
            (power * step * WH_PER_J)[:count].T,
            (lacks <= SHORTFALL * np.abs(power[:count])).T,
            rolled(time * lifting),
            rolled(time),
            float(arrays["auxiliary_power_w"][-1, -1]),
        )


@dataclass(frozen=True, eq=False, slots=True)
class CruiseProblem:
    """A road in nodes (links, and standstills as nodes without length), the speeds of each, and what each step takes.

    A step leads from a level of one node to one of the next: change of speed and the whole next node. Its last axis has the levels twice, first with a
    ramp, then with lifting.

    Attributes
    ----------
    road : CruiseRoad
        The nodes.
    speed_m_s : ndarray, shape (nodes, levels)
        The highest first.
    step_s, step_wh : ndarray, shape (nodes - 1, levels, 2 levels)
        Time, and energy at the battery terminals without climate control; infinite where there is no such step.
    lift_m : ndarray, shape (nodes - 1, levels, levels)
        Way over which the car rolls from one level to the other without its motor.
    climate_w, fixed_wh : float
        Power of climate control, and what it takes beside that on any such drive.

    Examples
    --------
    >>> from tripwatt.physics import DriveConditions
    >>> from tripwatt.vehicles import load_vehicle
    >>> calm, highest = np.zeros(3), np.full(3, 36.0)
    >>> road = CruiseRoad(np.full(3, 5000.0), highest, calm, calm, calm)
    >>> problem = CruiseProblem.from_road(road, load_vehicle("vw_id3"), DriveConditions())
    >>> (problem.speed_m_s[1] * 3.6).round().tolist(), problem.step_s.shape
    ([130.0, 125.0, 120.0, 115.0, 110.0, 105.0, 100.0, 95.0], (4, 8, 16))
    >>> fastest = np.zeros((1, 5), dtype=np.int64)
    >>> time_s, energy_wh = problem.totals(fastest, np.zeros((1, 4), dtype=bool))
    >>> round(float(time_s[0]))
    466
    """

    road: CruiseRoad
    speed_m_s: FloatArray
    step_s: FloatArray
    step_wh: FloatArray
    lift_m: FloatArray
    climate_w: float = 0.0
    fixed_wh: float = 0.0

    @classmethod
    def from_plan(
        cls,
        plan: Plan,
        vehicle: Vehicle,
        links: LinkRoute | None = None,
        *,
        floor: float = FLOOR,
        step_m_s: float = STEP_KM_H * M_S_PER_KM_H,
    ) -> Self:
        """The speeds of a plan's road. O(samples + links x levels²).

        Parameters
        ----------
        plan : Plan
            With its departure and weather. Its speeds are the highest ones: what limits and traffic allow. It stands where the car has to.
        vehicle : Vehicle
            The car, without the extras of the departure.
        links : LinkRoute, optional
            Those of the plan, each with one highest speed; pieces of `PIECE_M` without them.
        floor : float
            Lowest speed over the highest of a link.
        step_m_s : float
            Step between two speeds; the highest speed of a link is always among them.

        Returns
        -------
        CruiseProblem
            Level where the plan has no heights, calm where it has no wind.

        Raises
        ------
        InvalidInput
            As `simulate_trip`, or when floor or step are out of their bounds.

        Examples
        --------
        >>> from tripwatt.routes import plan_from_links, route_from_links
        >>> from tripwatt.vehicles import load_vehicle
        >>> links = route_from_links([{"length_m": 9000.0, "speed_m_s": 30.0, "stop_s": 0.0}])
        >>> problem = CruiseProblem.from_plan(plan_from_links(links), load_vehicle("vw_id3"), links)
        >>> round(problem.road.length_m.sum()), problem.speed_m_s.shape
        (9000, (11, 9))
        """
        drive, run = drive_of_trip(vehicle, plan), simulate_trip(vehicle, plan)
        step = np.diff(run.time_s, prepend=run.time_s[:1])
        late = step * (run.time_s - run.time_s[0] >= SETTLED * plan.duration_s)
        climate_w = float(run.climate_power_w @ late / late.sum())
        fixed_wh = (float(run.climate_power_w @ step) - climate_w * plan.duration_s) * WH_PER_J
        road = _road_of(plan, run.grade, links)
        problem = cls.from_road(road, drive.vehicle, drive.conditions, floor=floor, step_m_s=step_m_s)
        return replace(problem, climate_w=climate_w, fixed_wh=fixed_wh)

    @classmethod
    def from_road(
        cls,
        road: CruiseRoad,
        vehicle: Vehicle,
        conditions: DriveConditions,
        *,
        floor: float = FLOOR,
        step_m_s: float = STEP_KM_H * M_S_PER_KM_H,
    ) -> Self:
        """The speeds of a road, without climate control. O(links x levels²).

        Parameters
        ----------
        road : CruiseRoad
            Its links.
        vehicle : Vehicle
            The car.
        conditions : DriveConditions
            With an air density, else that of sea level.
        floor : float
            Lowest speed over the highest of a link.
        step_m_s : float
            Step between two speeds; the highest speed of a link is always among them.

        Returns
        -------
        CruiseProblem
            Where highest speed or floor cannot be reached on half of a link, they are lowered to what can.

        Raises
        ------
        InvalidInput
            When floor or step are out of their bounds.
        """
        if not (0.1 <= floor <= 1.0 and 0.1 <= step_m_s <= 10.0):
            got, allowed = f"{floor:g}, {step_m_s:g} m/s", "a floor of 0.1 to 1, a step of 0.1 to 10 m/s"
            raise InvalidInput.of("rule of speeds out of range", "floor, step_m_s", got, allowed)
        if conditions.air_density_kg_m3 is None:
            density = air_density(conditions.ambient_temperature_degc)
            conditions = replace(conditions, air_density_kg_m3=density)
        nodes = _with_standstills(road)
        ramps = _Ramps.of_car(vehicle, conditions, float(road.highest_m_s.max()))
        fastest = ramps.reachable(nodes.length_m, nodes.highest_m_s)
        # the slowest level, which lies at the floor or less than a step above it
        lowest = np.minimum(np.ceil(floor * nodes.highest_m_s / step_m_s - SAME) * step_m_s, fastest)
        slowest = ramps.reachable(nodes.length_m, lowest)
        # a step more, where even that is not reached
        slowest = np.where(slowest < lowest * (1.0 - SAME), np.maximum(slowest - step_m_s, 0.0), lowest)
        speed, tried = _levels(fastest, slowest, step_m_s)
        steady = _Steady.of_car(vehicle, conditions, nodes, speed)
        length, wait = nodes.length_m[:, None], nodes.wait_s[:, None]
        link_s = np.where(speed > 0.0, length / np.maximum(speed, SAME), wait)
        before, after = speed[:-1, :, None], speed[1:, None, :]
        half = 0.5 * np.where(after > before, length[1:, :, None], length[:-1, :, None])
        way, time, energy = ramps.between(before, after)
        lift_m, lift_s = steady.lift_m, steady.lift_s
        per_m = (steady.energy_wh / np.maximum(length, SAME))[:-1]
        rolled_s = lift_s - lift_m / np.maximum(before, SAME)
        rolled_wh = steady.base_w * WH_PER_J * lift_s - per_m[:, :, None] * lift_m
        possible = tried & steady.holds
        both = possible[:-1, :, None] & possible[1:, None, :]
        ramp, roll = both & (way <= half * (1.0 + SAME)), both & (before > after) & (lift_m <= half)
        then_s, then_wh = link_s[1:, None, :], steady.energy_wh[1:, None, :]
        changes_s = np.where(ramp, time, 0.0) + then_s, np.where(roll, rolled_s, 0.0) + then_s
        changes_wh = np.where(ramp, energy, np.inf) + then_wh, np.where(roll, rolled_wh, np.inf) + then_wh
        step_s, step_wh = np.concatenate(changes_s, axis=2), np.concatenate(changes_wh, axis=2)
        return cls(nodes, speed, step_s, step_wh, lift_m)

    def totals(self, levels: IntArray, lifted: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Time [s] and energy [Wh] of ways along the road.

        Parameters
        ----------
        levels : ndarray of int, shape (ways, nodes)
            Level on each node.
        lifted : ndarray of bool, shape (ways, nodes - 1)
            Whether the car rolls to the next node's speed.

        Returns
        -------
        tuple of ndarray, shape (ways,)
            Infinite energy where a step is not possible.
        """
        where = np.arange(len(self.step_s)), levels[:, :-1], levels[:, 1:] + lifted * self.speed_m_s.shape[1]
        time, energy = self.step_s[where].sum(axis=1), self.step_wh[where].sum(axis=1)
        return time, energy + self.fixed_wh + self.climate_w * WH_PER_J * time


def _with_standstills(road: CruiseRoad) -> CruiseRoad:
    """The road as nodes: one without length at both ends and after each link with a standstill at its end."""
    stands = np.concatenate(([True], road.wait_s[:-1] > 0.0, [True]))
    places = np.flatnonzero(stands)
    waits = np.concatenate(([0.0], road.wait_s[:-1], [0.0]))[places]
    length, highest, grade, wind = (
        np.insert(row, places, 0.0)
        for row in (road.length_m, road.highest_m_s, road.grade, road.headwind_m_s)
    )
    return CruiseRoad(length, highest, grade, wind, np.insert(np.zeros(len(road.length_m)), places, waits))
