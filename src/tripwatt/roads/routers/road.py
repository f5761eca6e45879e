"""The protocol of a router, and its result: a road with links, its line on the map, headings and road classes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.routes.carried import driven_positions, pauses_of
from tripwatt.routes.links import FLAT_ROAD, SHORTEST_LINK_M, LinkRoute
from tripwatt.routes.places import Place, heading_along, with_heading
from tripwatt.routes.points import distances_m
from tripwatt.routes.web import as_remote
from tripwatt.trips import Pause, Plan

FARTHEST_START_M: Final = 5000.0
"""Largest distance from a place to the end of its road [m]; if the road ends farther away, the place is outside of the map. A choice."""

SAME_SPEED: Final = 0.03
SAME_TIME_S: Final = 0.06
"""Edges have the same speed if their times differ by less than these [1, s]: routers round times to 0.1 s and speeds to 1 km/h."""

_MIN_SIGNAL_STOP_S: Final = 2.0
"""Shorter delays at a signal are not counted as standstill: a choice, because a car still rolls."""

MAX_ROUTES: Final = 4
"""Largest number of roads in one answer: a choice, because nobody compares more, and each is forecast."""

KEY_NAME: Final = "TRIPWATT_ROUTER_KEY"
"""Environment variable with the key that a router's server expects."""


_COLUMNS: Final = ("length_m", "time_s", "speed_m_s", "limit_m_s", "signal", "carried")
"""Arrays of `Edges`."""


@dataclass(frozen=True, eq=False, slots=True)
class Edges:
    """The edges of a road as a router returns them. Arrays have shape (edges,).

    Attributes
    ----------
    length_m, time_s : ndarray
        Length and travel time; the time includes delays at the end of the edge.
    speed_m_s : ndarray
        Speed without any delay; NaN = length over time.
    limit_m_s : ndarray
        Speed limit, NaN = not known.
    road_class : tuple of str
        "motorway", "primary", ...; empty = not known.
    signal : ndarray of bool
        Whether a traffic signal is at the end of the edge.
    carried : ndarray of bool
        Whether a ferry or a train carries the car over the edge.
    """

    length_m: FloatArray
    time_s: FloatArray
    speed_m_s: FloatArray
    limit_m_s: FloatArray
    road_class: tuple[str, ...]
    signal: BoolArray
    carried: BoolArray

    @classmethod
    def from_speeds(
        cls, length_m: FloatArray, time_s: FloatArray, speed_m_s: FloatArray, carried: npt.ArrayLike = False
    ) -> Edges:
        """Make edges without limits, classes and signals; by default none is carried."""
        n = len(length_m)
        unknown = np.full(n, np.nan)
        return cls(length_m, time_s, speed_m_s, unknown, ("",) * n, np.full(n, False), np.full(n, carried))

    def only(self, mask: BoolArray) -> Edges:
        """Return the edges of a mask."""
        columns = {name: getattr(self, name)[mask] for name in _COLUMNS}
        return Edges(**columns, road_class=tuple(itertools.compress(self.road_class, mask.tolist())))


@dataclass(frozen=True, eq=False, slots=True)
class Road:
    """A road from place to place.

    Attributes
    ----------
    links : LinkRoute
        Links with free-flow travel times, without traffic.
    road_class : tuple of str
        Class of each link.
    latitude_deg, longitude_deg : ndarray, shape (points,)
        The line on the map.
    position_m : ndarray, shape (points,)
        Distance of each point from the start, on the scale of the links: all points of a ferry have that of its start.
    stop_position_m : tuple of float
        Distance of each intermediate stop from the start.
    """

    links: LinkRoute
    road_class: tuple[str, ...]
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    position_m: FloatArray
    stop_position_m: tuple[float, ...] = ()

    @classmethod
    def from_legs(cls, legs: Sequence[Leg], stops: Sequence[Place]) -> Road:
        """Join legs to a road.

        Raises
        ------
        InvalidInput
            If an end of the road is farther than `FARTHEST_START_M` from its place.
        RemoteError
            If links of the road are impossible.
        """
        legs_m = [float(leg.edges.length_m.sum()) for leg in legs]
        points = np.concatenate([leg.points for leg in legs])
        _require_near_stops(points, stops)
        with as_remote():
            edges = _concatenate_edges([leg.edges for leg in legs])
            links, kinds = join_edges(edges.only(~edges.carried))
            links = replace(links, pauses=pauses_of(edges.length_m, edges.time_s, edges.carried))
            heights = [leg.heights for leg in legs if leg.heights is not None]
            if len(heights) == len(legs):
                starts = np.cumsum([0.0, *legs_m[:-1]])
                at = np.concatenate([start + leg[0] for start, leg in zip(starts, heights, strict=True)])
                at = driven_positions(at, edges.length_m, edges.carried)
                height_m = np.concatenate([leg[1] for leg in heights])
                links = replace(links, elevation_position_m=at, elevation_m=height_m, flags=())
        positions = distances_m(points, sum(legs_m)), np.cumsum(legs_m)[:-1]
        position, ends = (driven_positions(at, edges.length_m, edges.carried) for at in positions)
        return cls(links, kinds, points[:, 0], points[:, 1], position, tuple(ends.tolist()))

    @property
    def distance_m(self) -> float:
        """Length [m]."""
        return self.links.distance_m

    @property
    def duration_s(self) -> float:
        """Travel time of the links, and of ferries and trains [s]."""
        return self.links.elapsed_s

    def place_at(self, position_m: float) -> Place:
        """Return the point of the road at a distance from its start."""
        latitude = float(np.interp(position_m, self.position_m, self.latitude_deg))
        return Place(latitude, float(np.interp(position_m, self.position_m, self.longitude_deg)))

    def heading_at(self, position_m: FloatArray) -> FloatArray:
        """Return the direction of travel at distances from the start, clockwise from north [°], shape of `position_m`."""
        return heading_along(self.latitude_deg, self.longitude_deg, self.position_m, position_m)

    def plan(self, trip_id: str = "route") -> Plan:
        """Return the road as a plan with its direction of travel, see `LinkRoute.plan`."""
        plan = self.links.plan(trip_id=trip_id)
        return with_heading(plan, self.latitude_deg, self.longitude_deg, self.position_m, self.distance_m)

    def with_pause(self, pause_s: float) -> Road:
        """Return the road with a pause at its last place on the way [s], or half of the way if its position is unknown."""
        turn_m = self.stop_position_m[-1] if self.stop_position_m else 0.5 * self.distance_m
        pauses = sorted(
            (*self.links.pauses, Pause(turn_m, pause_s, cools=True)), key=lambda pause: pause.position_m
        )
        return self.with_links(replace(self.links, pauses=tuple(pauses)))

    def with_links(self, links: LinkRoute) -> Road:
        """Return the road with other speeds or times of its links, on the same line."""
        return replace(self, links=links)


class Router(Protocol):
    """A finder of roads between places."""

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        """Find roads through places in order; the fastest road is the first.

        Parameters
        ----------
        stops : sequence of Place
            At least two places.
        alternatives : int
            Number of other roads that are wanted; a router may find fewer.

        Raises
        ------
        InvalidInput
            If there is no road, or a place is outside of the map.
        RemoteError
            If the router does not answer, or its answer is wrong.
        """
        ...

    def outline(self, start: Place, minutes: float) -> tuple[Place, ...]:
        """Return places at the edge of the area reached within a time, in any order; empty if the router has no isochrones."""
        ...


def join_edges(edges: Edges) -> tuple[LinkRoute, tuple[str, ...]]:
    """Join edges into links, and return the links and their road classes. O(edges).

    Neighbouring edges of the same speed, class and limit become one link, up to a signal. A link shorter than
    `SHORTEST_LINK_M` is joined with the next edge in any case. The travel time of a link includes its delays. The delay of a link that ends
    at a signal becomes a standstill at its end.

    Examples
    --------
    >>> links, kinds = join_edges(Edges.from_speeds(np.array([100.0, 50.0, 300.0]), np.array([10.0, 5.0, 15.0]), np.full(3, np.nan)))
    >>> links.length_m.tolist(), links.moving_speed_m_s.tolist(), kinds
    ([150.0, 300.0], [10.0, 20.0], ('', ''))
    """
    length, time = edges.length_m, edges.time_s
    with np.errstate(all="ignore"):
        moving_s = np.where(np.isnan(edges.speed_m_s), time, length / edges.speed_m_s)
    starts = _link_starts(edges, moving_s)
    total_m, total_s, driving_s = (np.add.reduceat(values, starts) for values in (length, time, moving_s))
    total_s = np.maximum(total_s, driving_s)
    ends = np.append(starts[1:], len(length)) - 1
    delay_s = total_s - driving_s
    stop = np.where(edges.signal[ends] & (delay_s >= _MIN_SIGNAL_STOP_S), delay_s, np.nan)
    limit = edges.limit_m_s[starts]
    with np.errstate(all="ignore"):  # `LinkRoute` names a link without time
        moving = total_m / driving_s
    limits = limit if np.isfinite(limit).any() else None
    links = LinkRoute(total_m, total_s, stop, moving, None, None, (FLAT_ROAD,), limits, free_flow=True)
    return links, tuple(edges.road_class[int(k)] for k in starts)


def _link_starts(edges: Edges, moving_s: FloatArray) -> IntArray:
    """Return the index of the first edge of each link."""
    length, limit = edges.length_m.tolist(), np.nan_to_num(edges.limit_m_s, nan=-1.0).tolist()
    seconds, signal, kind = moving_s.tolist(), edges.signal.tolist(), edges.road_class
    starts, link_m, link_s = [0], length[0], seconds[0]
    for k in range(1, len(length)):
        expected_s = link_s / link_m * length[k] if link_m > 0 else seconds[k]
        same_speed = abs(seconds[k] - expected_s) <= SAME_TIME_S + SAME_SPEED * seconds[k]
        is_short_end = k == len(length) - 1 and length[k] < SHORTEST_LINK_M
        short = link_m < SHORTEST_LINK_M or link_s <= 0.0 or is_short_end
        same_class = kind[k] == kind[k - 1] and limit[k] == limit[k - 1]
        if short or (same_speed and same_class and not signal[k - 1]):
            link_m, link_s = link_m + length[k], link_s + seconds[k]
        else:
            starts.append(k)
            link_m, link_s = length[k], seconds[k]
    return np.array(starts, dtype=np.int64)


class Leg(NamedTuple):
    """A leg of a road in the answer of a router: its edges, its line (latitude, longitude), and distances from its start with heights."""

    edges: Edges
    points: FloatArray
    heights: tuple[FloatArray, FloatArray] | None

    @classmethod
    def from_points(cls, edges: Edges, points: FloatArray, position_m: FloatArray) -> Leg:
        """Make a leg of points with columns latitude, longitude and, if known, height, at distances `position_m` from the start."""
        heights = None
        if points.shape[1] > 2 and (has_height := np.isfinite(points[:, 2])).any():
            heights = position_m[has_height], points[has_height, 2]
        return cls(edges, points[:, :2], heights)


def _concatenate_edges(parts: Sequence[Edges]) -> Edges:
    """Join the edges of all legs; raise `InvalidInput` if a length, a time or a speed is impossible."""
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS}
    edges = Edges(**columns, road_class=tuple(kind for part in parts for kind in part.road_class))
    valid = ~(edges.speed_m_s <= 0.0)
    for values in (edges.length_m, edges.time_s):
        valid &= np.isfinite(values) & (values >= 0)
    driven = edges.only(~edges.carried)
    # all at one point of a road
    if len(driven.length_m) and not driven.length_m.any() and not driven.time_s.any():
        edges = replace(edges, length_m=edges.length_m + 1.0, time_s=edges.time_s + 1.0)
        driven = edges.only(~edges.carried)
    if not valid.all() or not driven.length_m.sum() > 0 or not driven.time_s.sum() > 0:
        invalid = np.flatnonzero(~valid)
        where = f"edge {invalid[0] + 1}" if len(invalid) else "edges"
        raise InvalidInput.of("impossible edge of the road", where, "", "length and time above 0")
    return edges


def _require_near_stops(points: FloatArray, stops: Sequence[Place]) -> None:
    """Raise `InvalidInput` if an end of the line is farther than `FARTHEST_START_M` from its place."""
    faults = []
    for place, (latitude, longitude) in ((stops[0], points[0]), (stops[-1], points[-1])):
        distance_m = place.distance_m(Place(float(latitude), float(longitude)))
        if distance_m > FARTHEST_START_M:
            got = f"{distance_m / 1000.0:.1f} km from the nearest road of the map"
            allowed = f"at most {FARTHEST_START_M / 1000.0:g} km"
            faults.append(Fault("place outside of the map", place.title, got, allowed))
    raise_faults(faults)


def require_stops(stops: Sequence[Place]) -> None:
    """Raise `InvalidInput` if a journey does not have two different places."""
    if len(stops) < 2:
        raise InvalidInput.of("too few places", "stops", f"{len(stops)}", "a start and a destination")
    if all(stops[0].distance_m(place) < 1.0 for place in stops):
        raise InvalidInput.of("no way to drive", "stops", f"{stops[0].title} only", "two different places")


def no_road(stops: Sequence[Place], got: str) -> InvalidInput:
    """Return the error for places that no road connects."""
    title = " to ".join(place.title for place in stops)
    return InvalidInput.of("no road found", title, got[:120], "places that a road connects")
