"""Tracks of points, with or without times, and their conversion into links or into a plan."""

from __future__ import annotations

import calendar
import datetime as dt
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.errors import Fault, InvalidInput, and_more, excerpt, percent, raise_faults
from tripwatt.routes.carried import pause_flags
from tripwatt.routes.links import FASTEST_LINK_M_S, FLAT_ROAD, LinkRoute, link_ends
from tripwatt.routes.places import heading_along, with_heading
from tripwatt.routes.points import haversine_m, require_on_earth
from tripwatt.trips import COLUMNS, Departure, Flag, Pause, Plan
from tripwatt.trips.columns import is_number
from tripwatt.trips.gaps import MAX_DURATION_S, SHORTEST_GAP_S
from tripwatt.units import M_S_PER_KM_H

_WINDOW_S: Final = 2.0
"""Half of the time [s] over which the speed of a logged track is averaged, against the jitter of positions; a choice."""

_STANDING_M_S: Final = 0.5
"""Below this speed the positions of a logged track only jitter: the car stands. A choice, a slow walk."""

_TRACK_LINK_M: Final = 100.0
"""Points of a sparse or timeless track are joined until a link has this length [m]; a choice."""

_MIN_PAUSE_S: Final = 180.0
"""Shortest gap between two points without a movement that counts as a pause [s]; a choice, longer than a traffic light."""

_CLOCK_CHANGE_S: Final = 3600.0
_MAX_IN_GAPS: Final = 0.25
"""Largest share of the length of a logged track that may lie in gaps between its points; a choice."""

_MAX_WITHOUT_TIME: Final = 0.1
"""Largest share of the points of a track that may lack times at its ends; a choice."""

EARLIEST_YEAR, LATEST_YEAR = 1970, 2199
"""First and last year allowed for a time of a track: others come from a wrong clock."""

TIME_ALLOWED: Final = "ISO 8601, such as 2026-05-01T08:00:00Z"


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """Points in the order of travel. Arrays have shape (points,) unless said otherwise.

    Attributes
    ----------
    latitude_deg, longitude_deg : ndarray
        Place of each point in WGS 84 [°].
    elevation_m : ndarray
        NaN = not known; impossible heights, such as -9999 m, count as not known.
    time_s : ndarray or None
        Never decreasing, from 0; None if the track has no times.
    piece_speed_m_s : ndarray, shape (points - 1,)
        Mean speed between two points if the source has it, else NaN.
    started_at : datetime or None
        Time of the first point.
    flags : tuple of Flag
        What is assumed of the track.

    Raises
    ------
    InvalidInput
        When the track has fewer than two points, impossible coordinates, decreasing times, an impossible duration or no length.

    Examples
    --------
    >>> from tripwatt.routes import parse_route
    >>> track = parse_route(b'<gpx><rte><rtept lat="48" lon="11"/><rtept lat="48.01" lon="11"><ele>520</ele></rtept></rte></gpx>')
    >>> len(track), track.time_s is None
    (2, True)
    >>> position_m, elevation_m, flags = track.elevation()
    >>> elevation_m.tolist(), flags[0].code
    ([520.0], 'elevation_interpolated')
    """

    latitude_deg: FloatArray
    longitude_deg: FloatArray
    elevation_m: FloatArray
    time_s: FloatArray | None
    piece_speed_m_s: FloatArray
    started_at: dt.datetime | None = None
    flags: tuple[Flag, ...] = ()

    def __post_init__(self) -> None:
        if len(self.latitude_deg) < 2:
            raise InvalidInput.of("too few points", "track", f"{len(self.latitude_deg)}", "at least 2")
        require_on_earth(self.latitude_deg, self.longitude_deg, "track")
        raise_faults(self._faults())

    def _faults(self) -> Iterator[Fault]:
        if self.time_s is not None:
            step = np.diff(self.time_s)
            decreases = np.flatnonzero(step < 0)
            if len(decreases):
                got = f"{-step[decreases[0]]:g} s back{and_more(decreases, 'point')}"
                where = f"track, point {decreases[0] + 2}"
                yield Fault("time decreases", where, got, "times that never decrease")
            span = float(self.time_s[-1] - self.time_s[0])
            if not 0 < span <= MAX_DURATION_S:
                allowed = f"more than 0, at most {MAX_DURATION_S:g} s"
                longest = int(np.argmax(step))
                where = f"track, point {longest + 2}" if span > 0 else "track"
                got = f"{span:g} s, of which {step[longest]:g} s before this point" if span > 0 else "0 s"
                yield Fault("duration out of range", where, got, allowed)
        if not float(self.step_m.sum()) > 0:
            yield Fault("track has no length", "track", "0 m", "two different places")

    def __len__(self) -> int:
        return len(self.latitude_deg)

    @property
    def step_m(self) -> FloatArray:
        """Distance from each point to the next [m], shape (points - 1,)."""
        return haversine_m(self.latitude_deg, self.longitude_deg)

    @property
    def position_m(self) -> FloatArray:
        """Distance of each point from the first one [m]."""
        return running_sum(self.step_m)

    def without_pauses(self) -> tuple[FloatArray | None, tuple[Pause, ...]]:
        """Return the times without the pauses, and the pauses: gaps of `_MIN_PAUSE_S` or more in which the car hardly moves.

        The way in a gap is driven at the median speed of the other pieces; the rest of its time is the pause.

        Returns
        -------
        time_s : ndarray or None
            Times [s], shape (points,); None if the track has no times.
        pauses : tuple of Pause
            In their order.

        Examples
        --------
        >>> north = np.array([48.0, 48.001, 48.0011, 48.0021])
        >>> track = Track(north, np.full(4, 11.0), np.full(4, np.nan), np.array([0.0, 10.0, 3611.0, 3621.0]), np.full(3, np.nan))
        >>> time_s, pauses = track.without_pauses()
        >>> time_s.round(1).tolist(), round(pauses[0].duration_s)
        ([0.0, 10.0, 11.0, 21.0], 3600)
        """
        if self.time_s is None:
            return None, ()
        step_s, step_m = np.diff(self.time_s), self.step_m
        paused = (step_s >= _MIN_PAUSE_S) & (step_m < _STANDING_M_S * step_s)
        moving = (step_s > 0) & ~paused & (step_m >= _STANDING_M_S * step_s)
        if not paused.any() or not moving.any():
            return self.time_s, ()
        drive_s = np.where(paused, step_m / float(np.median(step_m[moving] / step_s[moving])), step_s)
        starts = self.position_m[:-1]
        pauses = [Pause(float(starts[k]), float(step_s[k] - drive_s[k])) for k in np.flatnonzero(paused)]
        return self.time_s[0] + running_sum(drive_s), tuple(pauses)

    @property
    def is_log(self) -> bool:
        """Whether the track is the log of a drive: it has times, with a median step of at most 5 s."""
        return self.time_s is not None and float(np.median(np.diff(self.time_s))) <= 5.0

    def elevation(self) -> tuple[FloatArray | None, FloatArray | None, tuple[Flag, ...]]:
        """The known heights with their distances from the start, and flags of what is assumed.

        Returns
        -------
        position_m : ndarray or None
            Distances from the start [m] of the points with a height; None if there are none.
        elevation_m : ndarray or None
            Heights of these points [m]; None if there are none.
        flags : tuple of Flag
            Says that the road is taken as flat or that heights are interpolated; empty if every point has a height.
        """
        column = COLUMNS["elevation_m"]
        known = (self.elevation_m >= column.minimum) & (self.elevation_m <= column.maximum)
        if not known.any():
            return None, None, (FLAT_ROAD,)
        flags = () if known.all() else (Flag("elevation_interpolated", "track"),)
        return self.position_m[known], self.elevation_m[known], flags

    @property
    def needs_speed(self) -> bool:
        """Whether a piece of the track has neither time nor speed, so that `plan` needs the argument `speed_m_s`."""
        return self.time_s is None and bool(np.isnan(self.piece_speed_m_s).any())

    def plan(
        self,
        *,
        speed_m_s: float | None = None,
        trip_id: str = "route",
    ) -> Plan:
        """Make a plan of the track. The log of a drive keeps its own speed; any other track is converted to links. O(length / 4 m + samples).

        Parameters
        ----------
        speed_m_s : float, optional
            Mean speed [m/s] of pieces without time and speed.
        trip_id : str
            Name of the plan.

        Returns
        -------
        Plan
            Speed over time, and elevation if it is known.

        Raises
        ------
        InvalidInput
            As `driven_plan`, `links` and `LinkRoute.plan`.

        Examples
        --------
        >>> from tripwatt.routes import parse_route
        >>> line = parse_route(b'{"type": "LineString", "coordinates": [[11.5, 48.1], [11.52, 48.1]]}')
        >>> round(line.plan(speed_m_s=14.0).duration_s)
        107
        """
        if self.is_log:
            return self.driven_plan(trip_id=trip_id)
        plan = self.links(speed_m_s).plan(trip_id=trip_id)
        position = self.position_m
        return with_heading(plan, self.latitude_deg, self.longitude_deg, position, float(position[-1]))

    def links(self, speed_m_s: float | None = None) -> LinkRoute:
        """Convert a track into links, with its times, else the speeds of its pieces, else a given speed. O(points).

        Points are joined until a link has the length `_TRACK_LINK_M`, or a given speed changes.

        Parameters
        ----------
        speed_m_s : float, optional
            Mean speed [m/s], standstill included, of pieces that have neither time nor speed.

        Returns
        -------
        LinkRoute
            With the known elevation of the track.

        Raises
        ------
        InvalidInput
            When a piece has neither time nor speed and `speed_m_s` is not given, or the times imply a speed that no car reaches.

        Examples
        --------
        >>> from tripwatt.routes import parse_route
        >>> track = parse_route(b'<gpx><rte><rtept lat="48" lon="11"/><rtept lat="48.01" lon="11"/></rte></gpx>')
        >>> track.links(20.0).travel_time_s.round(1)
        array([55.6])
        """
        step = self.step_m
        flags = self.flags
        time_s, pauses = self.without_pauses()
        if time_s is not None:
            time = np.diff(time_s)
        else:
            if speed_m_s is not None and not (is_number(speed_m_s) and 0 < speed_m_s <= FASTEST_LINK_M_S):
                allowed = f"more than 0, at most {FASTEST_LINK_M_S:g} m/s"
                raise InvalidInput.of("speed out of range", "speed_m_s", excerpt(speed_m_s), allowed)
            no_speed = np.isnan(self.piece_speed_m_s)
            if no_speed.any() and speed_m_s is None:
                got = f"{int(no_speed.sum())} pieces without time and speed"
                allowed = "a mean speed for the track"
                raise InvalidInput.of("speed is missing", "track", got, allowed, "give speed_m_s")
            if speed_m_s is not None and no_speed.any():
                flags = (*flags, Flag("speed_assumed", "track", speed_m_s, "m_s"))
            time = step / np.where(no_speed, speed_m_s or np.nan, self.piece_speed_m_s)
        speed = np.nan_to_num(self.piece_speed_m_s, nan=-1.0)
        changes = np.append((self.time_s is None) & (np.diff(speed) != 0.0), True)
        starts = np.append(0, link_ends(step, time, _TRACK_LINK_M, changes)[:-1] + 1)
        length, seconds = np.add.reduceat(step, starts), np.add.reduceat(time, starts)
        position, height, height_flags = self.elevation()
        unknown = np.full(len(length), np.nan)
        flags = (*flags, *height_flags)
        measured = self.time_s is not None
        return LinkRoute(
            length, seconds, unknown, unknown, position, height, flags, pauses=pauses, measured=measured
        )

    def driven_plan(self, *, trip_id: str = "track") -> Plan:
        """A plan with the speed over time of a logged track. O(points).

        The speed is the mean over `_WINDOW_S` before and after each sample; below `_STANDING_M_S` it is 0.

        Parameters
        ----------
        trip_id : str
            Name of the plan.

        Returns
        -------
        Plan
            Speed over time at every second from the first to the last point, and elevation if it is known.

        Raises
        ------
        InvalidInput
            When the track has no times, implies a speed that no car reaches, or has too many gaps.

        Examples
        --------
        >>> from tripwatt.routes import parse_route
        >>> text = "".join(f'<trkpt lat="{48 + k / 1e4:.4f}" lon="11"><time>2026-05-01T08:00:{k:02d}Z</time></trkpt>' for k in range(30))
        >>> plan = parse_route(f"<gpx><trk><trkseg>{text}</trkseg></trk></gpx>".encode()).driven_plan()
        >>> plan.array("speed_m_s")[10].round(2)
        np.float64(11.12)
        """
        time_s, pauses = self.without_pauses()
        if time_s is None:
            raise InvalidInput.of("no times", "track", "points without time", "a track with times")
        advances = np.concatenate(([True], np.diff(time_s) > 0))
        # if several points have the same time, the last position counts
        last = np.append(np.flatnonzero(advances)[1:], len(self)) - 1
        known_s, driven = time_s[advances], self.position_m[last]
        span = float(known_s[-1])
        time = np.arange(max(math.ceil(span - 1e-9), 1) + 1, dtype=np.float64)
        before, after = np.maximum(time - _WINDOW_S, 0.0), np.minimum(time + _WINDOW_S, span)
        speed = (np.interp(after, known_s, driven) - np.interp(before, known_s, driven)) / (after - before)
        speed = np.where(speed < _STANDING_M_S, 0.0, speed)
        fast = np.flatnonzero(speed > FASTEST_LINK_M_S)
        if len(fast):
            got = f"{speed[fast[0]] / M_S_PER_KM_H:.0f} km/h at {time[fast[0]]:g} s"
            allowed = f"at most {FASTEST_LINK_M_S / M_S_PER_KM_H:g} km/h"
            raise InvalidInput.of("implausible jump of the track", "track", got, allowed)
        position, height, flags = self.elevation()
        columns, at_m = {"time_s": time, "speed_m_s": speed}, np.interp(time, known_s, driven)
        if position is not None and height is not None:
            columns["elevation_m"] = np.interp(at_m, position, height)
        flags += (*_moving_gaps(known_s, driven), *pause_flags(pauses))
        departure = Departure(departs_at=self.started_at)
        plan = Plan.from_trace(trip_id, columns, departure, flags=(*self.flags, *flags))
        heading = heading_along(self.latitude_deg, self.longitude_deg, self.position_m, at_m)
        return replace(plan, step_s=1.0, heading_deg=heading, pauses=pauses)


def parse_times(
    texts: list[str], where: str, step_m: FloatArray | None = None
) -> tuple[FloatArray | None, dt.datetime | None, tuple[Flag, ...]]:
    """Times of points as seconds from the first point, the time of the first point, and flags.

    A missing time is interpolated between its neighbours, as is one that repeats that of the point before; at an end it continues with the
    mean step. Returns None for both times if more than `_MAX_WITHOUT_TIME` of the points are at an end without one.
    In times without zone, the hour by which clocks change to or from summer time is taken out. Whole seconds count as cut if the
    distances `step_m` between the points show it.
    """
    given = np.flatnonzero([*map(bool, texts)])
    if not len(given):
        return None, None, ()
    if given[-1] - given[0] < (1.0 - _MAX_WITHOUT_TIME) * (len(texts) - 1):
        return None, None, (Flag("times_ignored", "track"),)
    times = [
        _parse_time(text, f"{where}, point {k}") if text else None for k, text in enumerate(texts, start=1)
    ]
    values = np.array([math.nan if moment is None else moment.timestamp() for moment in times])
    flags = () if len(given) == len(values) else (Flag("times_interpolated", "track"),)
    values[given[1:][np.diff(values[given]) == 0.0]] = np.nan
    known = np.flatnonzero(np.isfinite(values))
    at, step_s = np.arange(len(values)), (values[known[-1]] - values[known[0]]) / max(known[-1] - known[0], 1)
    beyond = np.minimum(at - known[0], 0) + np.maximum(at - known[-1], 0)
    values = np.interp(at, known, values[known]) + step_s * beyond
    if dt.datetime.fromisoformat(texts[given[0]]).tzinfo is None:
        values = values - _clock_change(values)
    are_whole = not any(moment.microsecond for moment in times if moment)
    if step_m is not None and are_whole and (np.diff(values) >= 0.0).all():
        values = _even_times(values, step_m)
    started = times[given[0]]
    return values - values[0], started and started - dt.timedelta(seconds=step_s * given[0]), flags


def _even_times(time_s: FloatArray, step_m: FloatArray) -> FloatArray:
    """Return the times of points that were cut to whole seconds, as even as the cut allows; exact times stay as they are. O(points).

    Either the times are exact, or they were cut and the steps between them are even. The distances tell: the share of the changes
    of the steps that they follow is 1 or 0. From 0.75 on the times stay, up to 0.25 they are even, in between they are mixed.
    """
    step_s = np.diff(time_s)
    usual_s = float(np.median(step_s))
    # a gap counts as one usual step, at its speed
    scale = np.where(step_s > 2.0 * usual_s + 1.0, usual_s / np.maximum(step_s, 1.0), 1.0)
    time = even = running_sum(step_s * scale)
    for _ in range(3):
        even = np.clip(_mean_of_near(even), time - 0.5, time + 0.5)
    near_m, near_s = (np.diff(_mean_of_near(values)) for values in (running_sum(step_m * scale), even))
    speed = near_m / np.maximum(near_s, 1e-9)
    # second differences hardly contain the changes of the speed
    uneven = np.diff(speed * np.diff(time - even), 2)
    left = np.diff(step_m * scale - speed * np.diff(even), 2)
    # 1.0 m²: changes of less show nothing, and the times stay
    share = (uneven @ left + 1.0) / (uneven @ uneven + 1.0)
    return time_s + np.clip(1.5 - 2.0 * share, 0.0, 1.0) * (even - time)


def _mean_of_near(values: FloatArray) -> FloatArray:
    """Mean of the values from 5 points before to 5 after each one, a choice; a straight line stays."""
    return np.convolve(np.pad(values, 5, "reflect", reflect_type="odd"), np.full(11, 1.0 / 11.0), "valid")


def _clock_change(seconds: FloatArray) -> FloatArray:
    """Return by how much the clock of each time without zone was put forward or back before, shape of `seconds` [s]."""
    step = np.diff(seconds)
    change = np.zeros(len(seconds))
    for k in np.flatnonzero(np.abs(np.abs(step) - _CLOCK_CHANGE_S) <= 60.0):
        moment = dt.datetime.fromtimestamp(float(seconds[k]), dt.UTC)
        # summer time begins and ends in a Sunday night of these months, in both hemispheres
        if moment.weekday() == calendar.SUNDAY and moment.hour < 4 and moment.month in (3, 4, 9, 10, 11):
            change[k + 1 :] += np.copysign(_CLOCK_CHANGE_S, step[k])
    return change


def _parse_time(text: str, where: str) -> dt.datetime:
    """The time that a text writes, in UTC if the text has no zone."""
    try:
        moment = dt.datetime.fromisoformat(text)
    except ValueError as error:
        raise InvalidInput.of("invalid time", where, repr(text[:40]), TIME_ALLOWED) from error
    if not EARLIEST_YEAR <= moment.year <= LATEST_YEAR:
        allowed = f"{EARLIEST_YEAR} to {LATEST_YEAR}"
        raise InvalidInput.of("invalid time", where, f"year {moment.year}", allowed)
    return moment if moment.tzinfo is not None else moment.replace(tzinfo=dt.UTC)


def _moving_gaps(time_s: FloatArray, driven_m: FloatArray) -> tuple[Flag, ...]:
    """A flag if a logged track has gaps in which the car moved, such as tunnels; the mean speed fills such a gap.

    Raises
    ------
    InvalidInput
        When more than the share `_MAX_IN_GAPS` of the distance lies in gaps.
    """
    step, driven = np.diff(time_s), np.diff(driven_m)
    gaps = (step > SHORTEST_GAP_S) & (driven >= _STANDING_M_S * step)
    if not gaps.any():
        return ()
    share = float(driven[gaps].sum() / driven_m[-1])
    if share > _MAX_IN_GAPS:
        got = f"{percent(share)} of the way in gaps of up to {step[gaps].max():g} s"
        allowed = f"at most {percent(_MAX_IN_GAPS)} in gaps over {SHORTEST_GAP_S:g} s"
        raise InvalidInput.of("gaps in the track", "track", got, allowed, "give the whole track")
    return (Flag("gap_bridged", "speed_m_s", float(step[gaps].sum()), "s"),)
