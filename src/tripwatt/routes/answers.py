"""Common parts of live and saved answers of routers: steps, annotations of OSRM, path details of GraphHopper."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput
from tripwatt.routes.documents import Node
from tripwatt.units import M_S_PER_KM_H


def steps_of(part: Node, key: str = "steps") -> Sequence[Node]:
    """The steps of a leg, segment or path; the part itself if it has no steps.

    Examples
    --------
    >>> [step.where for step in steps_of(Node({"steps": [{}, {}]}, "leg"))], steps_of(Node({}, "leg"))[0].where
    (['leg, steps[0]', 'leg, steps[1]'], 'leg')
    """
    return part[key].entries() if part[key].value else (part,)


def step_pieces(
    steps: Sequence[Node], length_key: str = "distance", time_key: str = "duration"
) -> FloatArray:
    """Length and time of each step in the units of the answer, and NaN for its unknown speed, shape (steps, 3).

    Examples
    --------
    >>> step_pieces([Node({"distance": 900, "duration": 60.5}, "step")]).tolist()
    [[900.0, 60.5, nan]]
    """
    rows = [
        (step[length_key].number(minimum=0.0), step[time_key].number(minimum=0.0), math.nan) for step in steps
    ]
    return np.array(rows).reshape(-1, 3)


def edge_pieces(leg: Node, *, annotated_speed: bool = False) -> FloatArray:
    """Length, time and speed of each edge from the annotation of an OSRM leg, shape (edges, 3).

    The times of an annotation leave out turns and lights. If the leg takes longer than their sum, these times are scaled
    to the duration of the leg.

    Parameters
    ----------
    leg : Node
    annotated_speed : bool
        Whether to take the annotated speed if there is one. Otherwise the speed is the annotated length over time, NaN if either
        is 0.

    Raises
    ------
    InvalidInput
        When the annotation does not have a length and a time for each edge.
    """
    length = leg["annotation"]["distance"].numbers(minimum=0.0)
    time = leg["annotation"]["duration"].numbers(minimum=0.0)
    node = leg["annotation"]["speed"]
    speed = node.numbers(minimum=0.0) if annotated_speed and node.value is not None else None
    if not 0 < len(time) == len(length) == len(time if speed is None else speed):
        got = f"{len(length)} and {len(time)}"
        raise InvalidInput.of("annotations of different lengths", leg.where, got, "one for each edge")
    if speed is None:
        speed = np.divide(length, time, out=np.full(len(time), np.nan), where=(time > 0) & (length > 0))
    total = float(time.sum())
    scale = max(leg["duration"].number(minimum=0.0) / total, 1.0) if total > 0 else 1.0
    return np.column_stack((length, time * scale, speed))


def intervals(detail: Node, n_points: int) -> list[tuple[int, int, Node]]:
    """First point, last point and value of each entry of a path detail of GraphHopper; empty if the detail is not given.

    Raises
    ------
    InvalidInput
        When the points of an entry are not indices of the path in ascending order.

    Examples
    --------
    >>> intervals(Node([[0, 2, 5.0]], "time"), 3)[0][:2], intervals(Node(None, "time"), 3)
    ((0, 2), [])
    """
    rows = []
    for entry in detail.entries() if detail.value else ():
        start, end, value = entry.entries(min_count=3)[:3]
        first, last = start.number(minimum=0.0), end.number(minimum=0.0)
        if first % 1 or last % 1 or not first <= last < n_points:
            got, allowed = f"{first:g} to {last:g}", f"0 to {n_points - 1}, ascending"
            raise InvalidInput.of("point index out of range", entry.where, got, allowed)
        rows.append((int(first), int(last), value))
    return rows


def speeds_at_points(detail: Node, n_points: int) -> FloatArray:
    """Speed after each point [m/s] from a path detail in km/h; NaN where the speed is unknown or 0.

    Examples
    --------
    >>> speeds_at_points(Node([[0, 2, 36.0], [2, 3, None]], "max_speed"), 4)
    array([10., 10., nan, nan])
    """
    speed = np.full(n_points, np.nan)
    for start, end, value in intervals(detail, n_points):
        if value.value is not None:
            speed[start : max(end, start + 1)] = M_S_PER_KM_H * value.number(minimum=0.0)
    return np.where(speed > 0.0, speed, np.nan)
