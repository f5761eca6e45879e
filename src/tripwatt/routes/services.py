"""Routes in the answers of Google Routes, HERE Routing v8 and TomTom Routing v1; each part that is missing is named with the request for it."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, number_in
from tripwatt.errors import InvalidInput
from tripwatt.routes.carried import CARRIED
from tripwatt.routes.documents import Node, step_pieces
from tripwatt.routes.points import decode_flexible_polyline, heights_along

_GOOGLE: Final = "routes.legs.duration, routes.legs.steps (X-Goog-FieldMask)"
_HERE: Final = "return=polyline,elevation,summary&spans=length,duration"
_TOMTOM: Final = "extendedRouteRepresentation=distance&extendedRouteRepresentation=travelTime"


class Part(NamedTuple):
    """A part of a route: its pieces, as of `step_pieces`, which of them a ferry or a train carries, and places along it with their heights [m].

    Its times may be those of a truck.
    """

    pieces: FloatArray
    carried: BoolArray
    heights: tuple[FloatArray, FloatArray] | None = None
    of_truck: bool = False


def _asked(part: Node, request: str) -> list[Node]:
    """The entries of a list that an answer has only if they are asked for."""
    if not part.value:
        raise InvalidInput.of("incomplete answer of a router", part.where, fix=f"ask for {request}")
    return part.entries()


def _seconds(node: Node) -> float:
    """The seconds of a duration of Google, such as "12.5s"."""
    number = number_in(str(node.value).removesuffix("s"))
    return Node(node.value if number != number else number, node.where).number(minimum=0.0)


def google_route(route: Node) -> list[Part]:
    """The legs of a route of Google: one piece for each step, in the traffic of its leg.

    Examples
    --------
    >>> step = {"distanceMeters": 900, "staticDuration": "60s"}
    >>> google_route(Node({"legs": [{"duration": "90s", "steps": [step]}]}, "route"))[0].pieces.tolist()
    [[900.0, 90.0, nan]]
    """
    parts = []
    for leg in _asked(route["legs"], _GOOGLE):
        # a step has its time on an empty road, and no length of 0
        steps = [Node({"distanceMeters": 0} | s.members(), s.where) for s in _asked(leg["steps"], _GOOGLE)]
        times = np.array([_seconds(step["staticDuration"]) for step in steps])
        lengths = [step["distanceMeters"].number(minimum=0.0) for step in steps]
        times *= _seconds(leg["duration"]) / max(times.sum(), 1e-9)
        instructions = [str(step["navigationInstruction"].value) for step in steps]
        carried = np.array(["'maneuver': 'FERRY" in text for text in instructions])
        parts.append(Part(np.column_stack((lengths, times, np.full(len(steps), np.nan))), carried))
    return parts


def here_route(route: Node) -> list[Part]:
    """The sections of a route of HERE: one piece for each span, with the heights of the polyline.

    Examples
    --------
    >>> section = {"spans": [{"length": 900, "duration": 60}], "transport": {"mode": "ferry"}, "polyline": "BFoz5xJ67i1B1B7PzIhaxL7Y"}
    >>> here_route(Node({"sections": [section]}, "route"))[0].carried.tolist()
    [True]
    """
    parts = []
    for section in route["sections"].entries(min_count=1):
        spans, line = _asked(section["spans"], _HERE), section["polyline"]
        mode = str(section["transport"]["mode"].value)
        heights = heights_along(decode_flexible_polyline(str(line.value), line.where)) if line.value else None
        carried = np.full(len(spans), mode in CARRIED)
        parts.append(Part(step_pieces(spans, "length"), carried, heights, mode == "truck"))
    return parts


def tomtom_route(route: Node) -> list[Part]:
    """A route of TomTom as one part: a piece from each entry of its progress to the next.

    Examples
    --------
    >>> ends = [{"pointIndex": k, "distanceInMeters": 900 * k, "travelTimeInSeconds": 60 * k} for k in (0, 1)]
    >>> tomtom_route(Node({"progress": ends}, "route"))[0].pieces.tolist()
    [[900.0, 60.0, nan]]
    """
    keys = "distanceInMeters", "travelTimeInSeconds", "pointIndex"
    entries = _asked(route["progress"], _TOMTOM)
    table = np.array([[entry[key].number(minimum=0.0) for key in keys] for entry in entries])
    differences = zip(entries[1:], np.diff(table, axis=0).tolist(), strict=True)
    steps = [Node({"distance": m, "duration": s}, entry.where) for entry, (m, s, _) in differences]
    middle, carried = 0.5 * (table[1:, 2] + table[:-1, 2]), np.zeros(len(steps), dtype=bool)
    sections = Node(route["sections"].value or [], route["sections"].where).entries()
    for section in sections:
        if str(section["sectionType"].value) in CARRIED:
            first, last = section["startPointIndex"].number(), section["endPointIndex"].number()
            carried |= (first <= middle) & (middle <= last)
    of_truck = any(section["travelMode"].value == "truck" for section in sections)
    return [Part(step_pieces(steps), carried, None, of_truck)]
