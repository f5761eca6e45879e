"""Ferries and trains on a route. They carry the car: their length is not driven, and their time is a pause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, running_sum
from tripwatt.routes.documents import Node, intervals, steps_of
from tripwatt.trips.flags import Flag
from tripwatt.trips.plan import Pause
from tripwatt.units import M_S_PER_KM_H

CARRIED: Final = frozenset(
    {"ferry", "rail-ferry", "rail_ferry", "train", "carShuttleTrain", "FERRY", "CAR_TRAIN"}
)
"""Words of routers for a ferry or a train: `mode` of OSRM and HERE, `use` of Valhalla's edges, `road_environment` of GraphHopper,
`sectionType` of TomTom."""


def carried_steps(steps: Sequence[Node]) -> BoolArray:
    """Return for each step of OSRM or Valhalla whether the car is carried on it, shape (steps,).

    Examples
    --------
    >>> carried_steps([Node({"mode": "ferry"}, "step"), Node({"type": 8}, "step")]).tolist()
    [True, False]
    """
    return np.array([_is_carried(step.members()) for step in steps], dtype=bool)


def _is_carried(step: dict[str, Any]) -> bool:
    words = {str(step.get(key)) for key in ("mode", "travel_mode", "travel_type")}
    # 28 is the type of Valhalla's manoeuvre on a ferry
    return bool(words & CARRIED) or step.get("type") == 28 or step.get("ferry") is True


def carried_pieces(leg: Node, length_m: FloatArray) -> BoolArray:
    """Return for each piece of a leg of OSRM whether its middle lies on a step that carries the car, shape of `length_m`.

    Examples
    --------
    >>> leg = Node({"steps": [{"distance": 100.0}, {"distance": 300.0, "mode": "ferry"}]}, "leg")
    >>> carried_pieces(leg, np.full(4, 100.0)).tolist()
    [False, True, True, True]
    """
    steps = steps_of(leg)
    carried = carried_steps(steps)
    if not carried.any() or not length_m.sum() > 0:
        return np.zeros(len(length_m), dtype=bool)
    ends = np.cumsum([step["distance"].number(minimum=0.0) for step in steps])
    middle = (np.cumsum(length_m) - 0.5 * length_m) * (ends[-1] / length_m.sum())
    return np.asarray(carried[np.minimum(np.searchsorted(ends, middle), len(carried) - 1)])


def ferry_steps(route: Node, steps: Sequence[Node]) -> BoolArray:
    """Return for each step of openrouteservice whether it begins on a ferry, shape (steps,); all False without way types.

    Examples
    --------
    >>> route = Node({"extras": {"waytypes": {"values": [[0, 4, 1], [4, 9, 9]]}}}, "route")
    >>> ferry_steps(route, [Node({"way_points": [k, k + 4]}, "step") for k in (0, 4)]).tolist()
    [False, True]
    """
    extras = route["extras"].value
    types = extras.get("waytypes") if isinstance(extras, dict) else None
    if not types:
        return np.zeros(len(steps), dtype=bool)
    rows = Node(types, f"{route.where}, waytypes")["values"].entries()
    # 9 is the way type of a ferry
    ferries = [row.numbers() for row in rows if row.entries(min_count=3)[2].value == 9]
    starts = [step["way_points"].entries(min_count=1)[0].number() for step in steps]
    return np.array([any(first <= at < last for first, last, _ in ferries) for at in starts], dtype=bool)


def carried_points(details: Node, n_points: int) -> BoolArray:
    """Return for each point of GraphHopper's path details whether a ferry begins or goes on there, shape (points,).

    Examples
    --------
    >>> carried_points(Node({"road_environment": [[0, 1, "road"], [1, 3, "ferry"]]}, "details"), 4).tolist()
    [False, True, True, False]
    """
    carried = np.zeros(n_points, dtype=bool)
    for start, end, environment in intervals(details["road_environment"], n_points):
        carried[start:end] = environment.value in CARRIED
    return carried


def driven_positions(position_m: FloatArray, length_m: FloatArray, carried: BoolArray) -> FloatArray:
    """Convert distances along a line with ferries into distances driven. O(positions log pieces).

    Examples
    --------
    >>> driven_positions(np.array([50.0, 200.0, 350.0]), np.full(4, 100.0), np.array([False, True, True, False])).tolist()
    [50.0, 100.0, 150.0]
    """
    if not carried.any():
        return position_m
    driven = running_sum(np.where(carried, 0.0, length_m))
    return np.asarray(np.interp(position_m, running_sum(length_m), driven))


def pauses_of(length_m: FloatArray, time_s: FloatArray, carried: BoolArray) -> tuple[Pause, ...]:
    """Return a pause for each ferry or train on the pieces of a line; an impossible time is replaced by the nearest possible one.

    Examples
    --------
    >>> pauses_of(np.array([1e3, 5e3, 1e3]), np.array([60.0, 1200.0, 60.0]), np.array([False, True, False]))
    (Pause(position_m=1000.0, duration_s=1200.0, carried_m=5000.0, cools=False),)
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], carried, [False])).astype(np.int8)))
    driven = running_sum(np.where(carried, 0.0, length_m))
    pauses = []
    for first, stop in edges.reshape(-1, 2):
        carried_m, seconds = float(length_m[first:stop].sum()), float(time_s[first:stop].sum())
        # choices: 140 km/h of a train through a tunnel; 5 km/h, and an hour of waiting
        shortest, longest = carried_m / (140.0 * M_S_PER_KM_H), carried_m / (5.0 * M_S_PER_KM_H) + 3600.0
        pauses.append(Pause(float(driven[first]), min(max(seconds, shortest), longest), carried_m))
    return tuple(pauses)


def pause_flags(pauses: Sequence[Pause]) -> tuple[Flag, ...]:
    """Return a flag for each ferry or train, and for each other pause, with its time [s]."""
    return tuple(Flag("carried" if p.carried_m else "pause", "road", p.duration_s, "s") for p in pauses)
