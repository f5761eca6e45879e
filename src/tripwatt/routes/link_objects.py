"""Links as a user writes them: objects or rows with a length, a speed or a time, and a slope."""

from __future__ import annotations

import difflib
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import NoneType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray
from tripwatt.errors import MOST_FAULTS, MOST_HINTS, Fault, InvalidInput, excerpt, first_faults
from tripwatt.routes.links import FLAT_ROAD, MOST_LINKS, LinkRoute
from tripwatt.trips import STEEPEST_GRADE, Flag, raise_faults

RELATIVE_ELEVATION: Final = Flag("elevation_relative", "road")

LINK_KEYS: Final = frozenset(
    {
        "length_m",
        "speed_m_s",
        "travel_time_s",
        "grade",
        "start_elevation_m",
        "end_elevation_m",
        "stop_s",
        "moving_speed_m_s",
        "speed_limit_m_s",
    }
)
"""Keys of a link, see `route_from_links`."""


def route_from_links(links: Iterable[Mapping[str, float | None]]) -> LinkRoute:
    """A route from links as a user writes them. O(links).

    Parameters
    ----------
    links : iterable of mapping
        Each with `length_m` [m] and either `speed_m_s`, the mean speed including every standstill [m/s], or
        `travel_time_s` [s]. Optional: `stop_s`, the standstill at the end of the link (part of the travel time; 0 means
        that the car does not stop), `moving_speed_m_s`, the speed while nothing stands in the way, `speed_limit_m_s`,
        and either `grade` or `start_elevation_m` and `end_elevation_m` [m]. None counts as not given.

    Returns
    -------
    LinkRoute
        In the order of the links.

    Raises
    ------
    InvalidInput
        With every fault of every link.

    Examples
    --------
    >>> route = route_from_links([{"length_m": 500.0, "speed_m_s": 10.0, "grade": 0.02},
    ...                           {"length_m": 1000.0, "travel_time_s": 60.0, "grade": -0.01}])
    >>> route.duration_s, route.elevation_at([500.0, 1500.0]), route.flags[0].code
    (110.0, array([10.,  0.]), 'elevation_relative')
    """
    given = list(itertools.islice(links, MOST_LINKS + 1))
    columns = columns_at_once(given)
    if columns is None:
        columns = columns_one_by_one(given)
    length = columns["length_m"]
    with np.errstate(over="ignore"):  # what is beyond all bounds is named below
        time = np.where(
            np.isnan(columns["travel_time_s"]), length / columns["speed_m_s"], columns["travel_time_s"]
        )
    position, height, flags = _elevation(columns)
    limit = columns["speed_limit_m_s"]
    return LinkRoute(
        length,
        time,
        columns["stop_s"],
        columns["moving_speed_m_s"],
        position,
        height,
        flags,
        limit if np.isfinite(limit).any() else None,
    )


def route_with_elevation(
    route: LinkRoute, position_m: npt.ArrayLike, elevation_m: npt.ArrayLike
) -> LinkRoute:
    """A route with heights [m] at distances from its start [m], both of shape (heights,), in place of what is known of them."""
    flags = tuple(flag for flag in route.flags if flag != FLAT_ROAD)
    position, height = (np.asarray(values, dtype=np.float64) for values in (position_m, elevation_m))
    return replace(route, elevation_position_m=position, elevation_m=height, flags=flags)


def fields_of_route(route: LinkRoute) -> dict[str, Any]:
    """A route as `links` and `elevation` of a request, the inverse of `route_from_links` and `route_with_elevation`.

    Examples
    --------
    >>> fields_of_route(route_from_links([{"length_m": 100.0, "speed_m_s": 10.0}]))
    {'links': [{'length_m': 100.0, 'travel_time_s': 10.0}], 'elevation': None}
    """
    columns = {
        "length_m": route.length_m,
        "travel_time_s": route.travel_time_s,
        "stop_s": route.stop_s,
        "moving_speed_m_s": route.moving_speed_m_s,
    }
    if route.speed_limit_m_s is not None:
        columns["speed_limit_m_s"] = route.speed_limit_m_s
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    links = [{n: v for n, v in zip(columns, row, strict=True) if v == v} for row in rows]
    if route.elevation_m is None or route.elevation_position_m is None:
        return {"links": links, "elevation": None}
    position_m, elevation_m = route.elevation_position_m.tolist(), route.elevation_m.tolist()
    return {"links": links, "elevation": {"position_m": position_m, "elevation_m": elevation_m}}


def columns_at_once(links: Sequence[object]) -> dict[str, FloatArray] | None:
    """Columns of links, NaN where not given, checked all at once; None where a link has a fault or another type.

    Examples
    --------
    >>> columns_at_once([{"length_m": 5.0, "speed_m_s": 1.0}])["length_m"], columns_at_once([{"length_m": -5.0}])
    (array([5.]), None)
    """
    if not 0 < len(links) <= MOST_LINKS:
        return None
    rows = [link for link in links if type(link) is dict and link.keys() <= LINK_KEYS]
    if len(rows) < len(links):
        return None
    lists = {name: [row.get(name) for row in rows] for name in LINK_KEYS}
    if not all(set(map(type, values)) <= {float, int, NoneType} for values in lists.values()):
        return None
    try:
        columns = {name: np.array(values, dtype=np.float64) for name, values in lists.items()}
    except OverflowError:
        return None
    there = {name: ~np.isnan(values) for name, values in columns.items()}
    heights = there["end_elevation_m"]
    with np.errstate(invalid="ignore"):
        sound = (
            there["length_m"].all()
            and (there["speed_m_s"] != there["travel_time_s"]).all()
            and (there["start_elevation_m"] == heights).all()
            and not (there["grade"] & heights).any()
            and not any((columns[name] <= 0).any() for name in ("length_m", "speed_m_s", "travel_time_s"))
            and not (np.abs(columns["grade"]) > STEEPEST_GRADE).any()
            and not any(np.isinf(values).any() for values in columns.values())
            # a NaN that was given is a fault, unlike the NaN of a missing key
            and all(there[name].sum() == len(rows) - lists[name].count(None) for name in LINK_KEYS)
        )
    return columns if sound else None


def columns_one_by_one(links: Sequence[Mapping[str, float | None]]) -> dict[str, FloatArray]:
    """Columns of links, NaN where not given, checked link by link.

    Slower than `columns_at_once`, with the same columns for links without a fault.

    Raises
    ------
    InvalidInput
        With the faults of all links.

    Examples
    --------
    >>> columns_one_by_one([{"length_m": 5.0, "speed_m_s": 1.0}])["length_m"]
    array([5.])
    """
    faults: list[Fault] = []
    rows = [_row(link, f"link {k}", faults) for k, link in enumerate(links[:MOST_LINKS], start=1)]
    if len(links) > MOST_LINKS:
        faults.append(Fault("too many links", "links", f"more than {MOST_LINKS}", f"at most {MOST_LINKS}"))
    raise_faults(first_faults(faults, "links"))
    if not rows:
        raise InvalidInput(Fault("no links", "links", "0", "at least one link"))
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in LINK_KEYS}


ALLOWED_KEYS: Final = ", ".join(sorted(LINK_KEYS))


def unit_hint(key: object) -> str:
    """Our name of the same quantity, whatever the unit of the key; empty where there is none.

    Examples
    --------
    >>> unit_hint("speed_km_h"), unit_hint("length_km"), unit_hint("colour")
    ('did you mean speed_m_s?', 'did you mean length_m?', '')
    """
    name = str(key).lower()[:60]
    same = [ours for ours in sorted(LINK_KEYS) if _stem(ours) == _stem(name)]
    near = same or difflib.get_close_matches(name, LINK_KEYS, n=1, cutoff=0.8)
    return f"did you mean {near[0]}?" if near else ""


def _stem(name: str) -> str:
    for ending in ("_m_s", "_km_h", "_kmh", "_kph", "_mph", "_km", "_m", "_ft", "_s", "_min", "_h"):
        if name.endswith(ending):
            return name.removesuffix(ending)
    return name


def harmless(key: str) -> float:
    """What stands in for a value that is no number, so that it is not called missing or out of range as well."""
    return 0.0 if key in ("grade", "stop_s") else 1.0


def _row(link: Mapping[str, float | None], where: str, faults: list[Fault]) -> dict[str, float]:
    if not isinstance(link, Mapping):
        faults.append(Fault("not a link", where, excerpt(link), "an object with length_m and speed_m_s"))
        return {}
    row: dict[str, float] = {}
    unknown = [key for key in link if key not in LINK_KEYS]
    for key in unknown[:MOST_FAULTS]:
        hint = unit_hint(key) if len(faults) < MOST_HINTS else ""
        faults.append(Fault("unknown key", where, excerpt(key), ALLOWED_KEYS, hint))
    if len(unknown) > MOST_FAULTS:
        faults.append(Fault("unknown key", where, f"{len(unknown) - MOST_FAULTS} more", ALLOWED_KEYS))
    for key, value in link.items():
        if key not in LINK_KEYS:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float | None):
            faults.append(Fault("not a number", f"{where}, {key}", excerpt(value), "a number"))
            row[key] = harmless(key)
        elif value is not None:
            row[key] = _finite(value, f"{where}, {key}", faults)
    if "length_m" not in row:
        faults.append(Fault("missing key", where, f"{sorted(row)}", "length_m"))
    if ("speed_m_s" in row) == ("travel_time_s" in row):
        what = "speed and travel time mixed" if "speed_m_s" in row else "speed is missing"
        faults.append(Fault(what, where, f"{sorted(row)}", "either speed_m_s or travel_time_s"))
    if ("start_elevation_m" in row) != ("end_elevation_m" in row) or (
        "grade" in row and "end_elevation_m" in row
    ):
        what = "grade and elevation mixed" if "grade" in row else "elevation at one end only"
        allowed = "either grade or start_elevation_m and end_elevation_m"
        faults.append(Fault(what, where, f"{sorted(row)}", allowed))
    for key, low in (("length_m", 0.0), ("speed_m_s", 0.0), ("travel_time_s", 0.0)):
        if row.get(key, 1.0) <= low:
            faults.append(Fault("link out of range", f"{where}, {key}", f"{row[key]:g}", "more than 0"))
    if abs(row.get("grade", 0.0)) > STEEPEST_GRADE:
        faults.append(
            Fault(
                "grade out of range",
                f"{where}, grade",
                f"{row['grade']:g}",
                f"-{STEEPEST_GRADE} to {STEEPEST_GRADE}",
            )
        )
    return row


def _finite(value: float, where: str, faults: list[Fault]) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        faults.append(Fault("not a finite number", where, excerpt(value), "a finite number"))
        return harmless(where.rpartition(", ")[2])
    return number


def _elevation(
    columns: Mapping[str, FloatArray],
) -> tuple[FloatArray | None, FloatArray | None, tuple[Flag, ...]]:
    """Heights at the ends of the links, from grades or from heights; a link without either is level or joins its neighbours."""
    border = np.concatenate(([0.0], np.cumsum(columns["length_m"])))
    start, end, grade = columns["start_elevation_m"], columns["end_elevation_m"], columns["grade"]
    known = np.isfinite(start)
    if known.any():
        # links may disagree by a step where they meet, so that each keeps its own two heights
        position = np.column_stack((border[:-1], border[1:])).ravel()
        height = np.column_stack((start, end)).ravel()
        if np.isfinite(grade).any():
            message = "grade on some links and elevation on others"
            raise InvalidInput(
                Fault("grade and elevation mixed", "links", message, "the same one of the two on all links")
            )
        there = np.isfinite(height)
        flags = () if there.all() else (Flag("elevation_interpolated", "links"),)
        return position[there], height[there], flags
    if np.isfinite(grade).any():
        rise = np.nan_to_num(grade, nan=0.0) * columns["length_m"]
        height = np.concatenate(([0.0], np.cumsum(rise)))
        return border, height - height.min(), (RELATIVE_ELEVATION,)
    return None, None, (FLAT_ROAD,)
