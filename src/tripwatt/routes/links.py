"""Planned routes as links, plans of drives on them, and the links of a recorded trip."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import BoolArray, FloatArray, IntArray, distance_driven
from tripwatt.errors import Fault, InvalidInput, and_more
from tripwatt.routes.carried import pause_flags
from tripwatt.routes.profile import LinkStyle, link_profile
from tripwatt.trips import COLUMNS, LINK_COLUMNS, Flag, Pause, Plan, Recorded, raise_faults
from tripwatt.trips.gaps import MAX_DURATION_S, MAX_SAMPLES

MAX_LINKS: Final = 200_000
"""Largest number of links in one route; a router response may have one for each piece between two nodes of the map."""

FASTEST_LINK_M_S: Final = LINK_COLUMNS["speed_m_s"].maximum
"""Highest mean speed of a link [m/s]."""

SHORTEST_LINK_M: Final = LINK_COLUMNS["length_m"].minimum
"""Shortest link [m]: shorter pieces come from rounding."""

LONGEST_LINK_M: Final = LINK_COLUMNS["length_m"].maximum

SHORTEST_STRETCH_M: Final = 60.0
"""Shorter links are joined with the next ones before they are driven: a mean speed over a few metres means nothing. A choice."""

SAME_SPEED: Final = 0.01
"""Largest relative difference of the speeds of two links that count as equal, since times and lengths are rounded; a choice."""

FLAT_ROAD: Final = Flag("no_elevation", "road")


def first_of_several(what: str, number: int) -> tuple[Flag, ...]:
    """The flag that the first of several routes in a file is used; empty if the file has only one."""
    return (Flag("first_of_several", what, float(number), "1"),) if number > 1 else ()


@dataclass(frozen=True, eq=False, slots=True)
class LinkRoute:
    """A planned route. Arrays have shape (links,) unless said otherwise; they are not to be changed.

    Attributes
    ----------
    length_m : ndarray
        Length of each link [m].
    travel_time_s : ndarray
        Time on the link, every standstill included.
    stop_s : ndarray
        Standstill at the end of the link, part of its travel time; 0 = the car does not stop on this link, NaN = not known.
    moving_speed_m_s : ndarray
        Speed while nothing stands in the way, NaN = not known.
    elevation_position_m, elevation_m : ndarray, shape (heights,), or None
        Distances from the start, and heights above sea level there; in between the height is linear. None = not known.
    flags : tuple of Flag
        What had to be assumed.
    speed_limit_m_s : ndarray or None
        Highest allowed speed, NaN = not known; None = not known for any link.
    free_flow : bool
        Whether the travel times are those of an empty road.
    pauses : tuple of Pause
        Ferries and trains that carry the car; they are no part of the links.
    measured : bool
        Whether the travel times were driven: equal speeds of neighbours are then a coincidence.

    Raises
    ------
    InvalidInput
        With every fault of the links.

    Examples
    --------
    >>> route = LinkRoute(np.array([500.0, 1000.0]), np.array([50.0, 60.0]), np.zeros(2), np.full(2, np.nan),
    ...                   np.array([0.0, 1500.0]), np.array([500.0, 530.0]))
    >>> route.distance_m, route.duration_s
    (1500.0, 110.0)
    >>> route.elevation_at([750.0]).tolist()
    [515.0]
    """

    length_m: FloatArray
    travel_time_s: FloatArray
    stop_s: FloatArray
    moving_speed_m_s: FloatArray
    elevation_position_m: FloatArray | None = None
    elevation_m: FloatArray | None = None
    flags: tuple[Flag, ...] = ()
    speed_limit_m_s: FloatArray | None = None
    free_flow: bool = False
    pauses: tuple[Pause, ...] = ()
    measured: bool = False

    def __post_init__(self) -> None:
        raise_faults(_route_faults(self))

    def __len__(self) -> int:
        return len(self.length_m)

    @property
    def distance_m(self) -> float:
        """Length of the route [m]."""
        return float(self.length_m.sum())

    @property
    def duration_s(self) -> float:
        """Travel time of the route [s]."""
        return float(self.travel_time_s.sum())

    @property
    def elapsed_s(self) -> float:
        """Time from departure to arrival [s]: the links and the pauses."""
        return self.duration_s + sum(pause.duration_s for pause in self.pauses)

    def paused_s(self, position_m: FloatArray) -> FloatArray:
        """Add up the pauses before each position.

        Parameters
        ----------
        position_m : ndarray
            Distances from the start [m].

        Returns
        -------
        ndarray
            Time [s], in the shape of `position_m`, or 0 without a pause.

        Examples
        --------
        >>> from tripwatt.routes import route_from_links
        >>> route = route_from_links([{"length_m": 3000.0, "speed_m_s": 15.0}])
        >>> replace(route, pauses=(Pause(1000.0, 600.0),)).paused_s(np.array([500.0, 2000.0])).tolist()
        [0.0, 600.0]
        """
        parts = (pause.duration_s * (position_m > pause.position_m) for pause in self.pauses)
        return np.asarray(sum(parts, 0.0))

    @property
    def speed_m_s(self) -> FloatArray:
        """Mean speed of each link, length over travel time [m/s]."""
        return self.length_m / self.travel_time_s

    def elevation_at(self, position_m: npt.ArrayLike) -> FloatArray | None:
        """Height [m] at distances from the start; None if no height is known.

        Parameters
        ----------
        position_m : array_like
            Distances from the start [m]; before the first and after the last known height, that height is returned.

        Returns
        -------
        ndarray or None
            Heights above sea level [m], shape of `position_m`; None if no height is known.
        """
        if self.elevation_m is None or self.elevation_position_m is None:
            return None
        return np.asarray(np.interp(np.asarray(position_m), self.elevation_position_m, self.elevation_m))

    def plan(
        self,
        *,
        trip_id: str = "route",
        style: LinkStyle | None = None,
        rng: np.random.Generator | None = None,
        step_s: float = 1.0,
    ) -> Plan:
        """Plan the speed over time of a drive on a route, from standstill to standstill. O(length / 4 m + samples).

        Neighbouring links with equal values count as one, so that the plan does not depend on how a road is cut or its times are rounded. Links shorter
        than `SHORTEST_STRETCH_M` are joined with the next ones, up to a given stop. `link_profile` reproduces the travel time of
        every joined stretch.

        Parameters
        ----------
        trip_id : str
            Name of the plan.
        style : LinkStyle, optional
            How traffic and driver fill a link; the calibrated style by default.
        rng : numpy.random.Generator, optional
            Draws stops and speeds; without it the same route always gives the same plan.
        step_s : float
            Time between two samples [s].

        Returns
        -------
        Plan
            Columns `time_s`, `speed_m_s`, and `elevation_m` if it is known; `link_m` is the mean length of the links, weighted by length.

        Raises
        ------
        InvalidInput
            When the step is not positive or gives too many samples.

        Examples
        --------
        >>> from tripwatt.routes import route_from_links
        >>> plan = route_from_links([{"length_m": 1000.0, "speed_m_s": 12.5}]).plan()
        >>> plan.duration_s, round(plan.distance_m), plan.flags[0].code
        (80.0, 1000, 'no_elevation')
        """
        finest = max(self.duration_s / MAX_SAMPLES, 1e-3)
        if not (math.isfinite(step_s) and step_s >= finest):
            raise InvalidInput.of("step out of range", "step_s", f"{step_s}", f"{finest:g} s or more")
        route = _merge_equal_links(self)
        stretches = join_links(route, stretch_starts(route))
        profile = link_profile(**stretches, style=style, rng=rng, step_s=step_s)
        columns = {"time_s": profile.time_s, "speed_m_s": profile.speed_m_s}
        height = route.elevation_at(profile.position_m)
        if height is not None:
            columns["elevation_m"] = height
        length = stretches["length_m"]
        link_m = float(length @ length / length.sum())
        flags = (*route.flags, *pause_flags(route.pauses))
        plan = Plan.from_trace(trip_id, columns, link_m=link_m, flags=flags)
        return replace(plan, step_s=step_s, free_flow=route.free_flow, pauses=route.pauses)


def _route_faults(route: LinkRoute) -> Iterator[Fault]:
    """The faults of a route: its number of links, their values, the travel time and the heights."""
    n_links = len(route.length_m)
    if not 1 <= n_links <= MAX_LINKS:
        yield Fault("number of links out of range", "links", f"{n_links}", f"1 to {MAX_LINKS}")
        return
    for name, values, sound, allowed in _link_rules(route):
        if values.shape != route.length_m.shape:
            got, shape = f"shape {values.shape}", f"shape {route.length_m.shape} of length_m"
            yield Fault("wrong shape", name, got, shape)
        elif not sound.all():
            bad = np.flatnonzero(~sound)
            where, got = f"link {bad[0] + 1}, {name}", f"{values[bad[0]]:g}{and_more(bad, 'link')}"
            yield Fault("link out of range", where, got, allowed, at=(int(bad[0]), name))
    with np.errstate(over="ignore"):
        total = float(route.travel_time_s.sum())
    if total > MAX_DURATION_S:
        yield Fault("route takes too long", "links", f"{total:g} s", f"at most {MAX_DURATION_S:g} s")
    if route.elevation_m is not None:
        column = COLUMNS["elevation_m"]
        wrong = ~((route.elevation_m >= column.minimum) & (route.elevation_m <= column.maximum))
        if wrong.any():
            index = int(np.flatnonzero(wrong)[0])
            where, got = f"elevation {index + 1}", f"{route.elevation_m[index]:g} m"
            yield Fault("elevation out of range", where, got, f"{column.minimum:g} to {column.maximum:g} m")


def _link_rules(route: LinkRoute) -> Iterator[tuple[str, FloatArray, BoolArray, str]]:
    """For each column its name, its values, the mask of values in range, and the text of the allowed range."""
    length, time, stop, moving = route.length_m, route.travel_time_s, route.stop_s, route.moving_speed_m_s
    limit = np.full(length.shape, np.nan) if route.speed_limit_m_s is None else route.speed_limit_m_s
    with np.errstate(all="ignore"):
        speed = length / time
    fastest = FASTEST_LINK_M_S
    sound = (length >= SHORTEST_LINK_M) & (length <= LONGEST_LINK_M)
    yield "length_m", length, sound, f"{SHORTEST_LINK_M:g} to {LONGEST_LINK_M:g} m"
    sound = (time > 0) & (time <= MAX_DURATION_S)
    yield "travel_time_s", time, sound, f"more than 0, at most {MAX_DURATION_S:g} s"
    yield "speed_m_s", speed, ~(speed > fastest), f"at most {fastest:g} m/s"
    yield "stop_s", stop, ~((stop < 0) | (stop >= time)), "0 s to less than the travel time"
    for name, values in (("moving_speed_m_s", moving), ("speed_limit_m_s", limit)):
        yield name, values, ~((values <= 0) | (values > fastest)), f"more than 0, at most {fastest:g} m/s"


def links_of_trip(trip: Recorded, length_m: float = 250.0) -> LinkRoute:
    """Cut a recorded trip into links with their mean speed, as a router with perfect traffic data would give them. O(samples).

    The travel time of a link includes every standstill on it; a standstill at a border belongs to the link after the border.
    Elevation is kept only at the ends of the links; stops are unknown. The rest at the end of the trip is a link of its own
    if it is longer than half a link, else part of the last link.

    Parameters
    ----------
    trip : Trip
        Raw or resampled.
    length_m : float
        Length of a link [m].

    Returns
    -------
    LinkRoute
        Without moving speeds and speed limits.

    Raises
    ------
    InvalidInput
        When the trip does not move or the length is not positive.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt.trips import Trip
    >>> log = pd.DataFrame({"time_s": np.arange(61.0), "speed_m_s": np.full(61, 10.0)})
    >>> links_of_trip(Trip.from_samples("t", log), 250.0).travel_time_s
    array([25., 35.])
    """
    if not (math.isfinite(length_m) and length_m > 0):
        raise InvalidInput.of("length out of range", "length_m", f"{length_m}", "more than 0 m")
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    driven = distance_driven(time, speed)
    if not driven[-1] > 0:
        raise InvalidInput.of("trip without distance", trip.trip_id, f"{driven[-1]:g} m", "more than 0 m")
    number = max(1, round(driven[-1] / length_m))
    border = np.append(np.arange(number) * length_m, driven[-1])
    moves = np.concatenate(([True], np.diff(driven) > 0))
    passed = np.interp(border, driven[moves], time[moves])
    passed[0], passed[-1] = time[0], time[-1]
    position, height = None, None
    if trip.has("elevation_m"):
        logged = trip.array("elevation_m")
        known = moves & np.isfinite(logged)
        if known.any():
            position, height = border, np.interp(border, driven[known], logged[known])
    unknown = np.full(number, np.nan)
    flags = () if height is not None else (FLAT_ROAD,)
    return LinkRoute(
        np.diff(border), np.diff(passed), unknown, unknown, position, height, flags, measured=True
    )


def plan_on_links(trip: Recorded, length_m: float) -> Plan:
    """Plan of a recorded trip as if only the mean speeds of links of one length were known.

    Travel times of the links include every standstill; elevation is known only at their ends, stops are unknown.

    Parameters
    ----------
    trip : Trip
        Raw or resampled.
    length_m : float
        Length of a link [m].

    Returns
    -------
    Plan
        With the departure of the trip.

    Raises
    ------
    InvalidInput
        When the car does not move, or moves faster than a link allows.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> trip = synthetic_fleet(1).logs[0]
    >>> plan = plan_on_links(trip, 500.0)
    >>> plan.departure == trip.departure, abs(plan.distance_m / trip.distance_m - 1.0) < 0.01
    (True, True)
    """
    plan = links_of_trip(trip, length_m).plan(trip_id=trip.trip_id)
    return replace(plan.with_departure(trip.departure), start_s=float(trip.array("time_s")[0]))


def _merge_equal_links(route: LinkRoute) -> LinkRoute:
    """The route in which neighbours of equal speed, limit and moving speed are one link if the stops of both are unknown or 0.

    A speed is equal if the link takes the time that it would take at the speed of the merged link before it, but for `SAME_SPEED` and
    the rounding of both times. The route itself is returned if a merged link would be longer than a link may be, or if its speeds
    were measured.
    """
    stop, time = route.stop_s, route.travel_time_s
    alike = (np.isnan(stop[1:]) & np.isnan(stop[:-1])) | ((stop[1:] == 0.0) & (stop[:-1] == 0.0))
    for values in (route.moving_speed_m_s, route.speed_limit_m_s):
        if values is not None:
            alike &= np.isclose(values[:-1], values[1:], 1e-6, 0.0, equal_nan=True)
    if route.measured or not alike.any():
        return route
    half_s = next(
        (0.5 * unit for unit in (1.0, 0.1) if (np.abs(time - unit * np.rint(time / unit)) <= 1e-6).all()), 0.0
    )
    starts, driven_m, spent_s = [0], float(route.length_m[0]), float(time[0])
    links = zip(route.length_m[1:].tolist(), time[1:].tolist(), alike.tolist(), strict=True)
    for number, (link_m, link_s, joins) in enumerate(links, 1):
        late_s = abs(link_s - link_m * spent_s / driven_m)
        if not joins or late_s > SAME_SPEED * link_s + half_s * (1.0 + link_s / spent_s):
            starts.append(number)
            driven_m = spent_s = 0.0
        driven_m += link_m
        spent_s += link_s
    # equal moving speeds are kept to the last bit: a change by rounding could alter where the iteration of a drive ends
    merged = join_links(route, np.array(starts)) | {"moving_speed_m_s": route.moving_speed_m_s[starts]}
    return route if float(merged["length_m"].max()) > LONGEST_LINK_M else replace(route, **merged)


def link_ends(length_m: FloatArray, time_s: FloatArray, target_m: float, may_end: BoolArray) -> IntArray:
    """Index of the last piece of each link if pieces are joined in their order into links. O(pieces).

    A link takes time and is at least `target_m` long; `SHORTEST_LINK_M` is enough if the link ends at a piece that `may_end` marks.
    The pieces after the last end are too short for a link or take no time.
    """
    ends, driven_m, spent_s = [], 0.0, 0.0
    pieces = zip(length_m.tolist(), time_s.tolist(), may_end.tolist(), strict=True)
    for k, (piece_m, piece_s, is_end) in enumerate(pieces):
        driven_m += piece_m
        spent_s += piece_s
        if driven_m >= SHORTEST_LINK_M and spent_s > 0 and (is_end or driven_m >= target_m):
            ends.append(k)
            driven_m = spent_s = 0.0
    return np.array(ends, dtype=np.int64)


def stretch_starts(route: LinkRoute) -> IntArray:
    """Index of the first link of each stretch: a short link joins the links after it, a short last stretch the one before.

    No link joins across a stop.
    """
    stops = route.stop_s > 0
    stops[-1] = False
    ends = link_ends(route.length_m, route.travel_time_s, SHORTEST_STRETCH_M, stops)
    # the last start is the end of the route, or begins a short stretch, which is kept only after a stop
    return np.append(0, ends + 1 if len(ends) and stops[ends[-1]] else ends[:-1] + 1)


def join_links(route: LinkRoute, starts: IntArray) -> dict[str, Any]:
    """Columns of a route whose links are joined: each joined link begins at an index in `starts`.

    The standstill of a joined link is the one at its end. The moving speed is the length over the sum of the moving times, the
    limit the highest one. A value is unknown if it is unknown on one of the links; a standstill only if its end has no known stop.
    """
    length = np.add.reduceat(route.length_m, starts)
    end = route.stop_s[np.append(starts[1:], len(route)) - 1]
    unknown = np.logical_or.reduceat(np.isnan(route.stop_s), starts) & ~(end > 0)
    limit = route.speed_limit_m_s
    return {
        "length_m": length,
        "travel_time_s": np.add.reduceat(route.travel_time_s, starts),
        "stop_s": np.where(unknown, np.nan, np.nan_to_num(end, nan=0.0)),
        "moving_speed_m_s": length / np.add.reduceat(route.length_m / route.moving_speed_m_s, starts),
        "speed_limit_m_s": None if limit is None else np.maximum.reduceat(limit, starts),
    }
