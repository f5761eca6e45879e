"""Saved responses of routers as links.

Each reader follows the public documentation of one router's JSON; `docs/reference/routes.md` names the pages. All readers
take the first route. The times of a router include the traffic lights and turns that it counts, so they are travel times
with standstill.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.errors import InvalidInput, excerpt, or_none
from tripwatt.routes.carried import (
    carried_pieces,
    carried_points,
    carried_steps,
    driven_positions,
    ferry_steps,
    pauses_of,
)
from tripwatt.routes.documents import (
    Node,
    edge_pieces,
    intervals,
    parse_json,
    read_content,
    speeds_at_points,
    step_pieces,
    steps_of,
)
from tripwatt.routes.link_objects import LINK_KEYS, is_links_table, route_from_links, route_from_table
from tripwatt.routes.links import FLAT_ROAD, SHORTEST_LINK_M, LinkRoute, first_of_several, link_ends
from tripwatt.routes.points import decode_polyline, distances_m, haversine_m, heights_along
from tripwatt.routes.services import Part, google_route, here_route, tomtom_route
from tripwatt.routes.track_files import track_from_geojson, track_from_xml
from tripwatt.routes.tracks import Track
from tripwatt.trips import Flag
from tripwatt.units import M_PER_FOOT, M_PER_MILE

_ORS_UNITS_M: Final[Mapping[str, float]] = {"m": 1.0, "km": 1000.0, "mi": M_PER_MILE}
"""Units of length in which openrouteservice answers."""
_ZIP: Final = b"PK\x03\x04"
"""First bytes of a ZIP archive."""


def route_from_parts(parts: Sequence[Part], where: str, *flags: Flag) -> LinkRoute:
    """Links of the parts of a route, such as its legs. A piece that is too short or takes no time joins the next ones, at the end the last link.

    Parameters
    ----------
    parts : sequence of Part
        A link has the speed of its last piece. The heights of a part are spread over its length; they count if all parts have some.
    where : str
        Name of the response for messages.
    *flags : Flag
        What is assumed of the route.

    Raises
    ------
    InvalidInput
        When no piece has a length and a time.
    """
    pieces, carried = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    length, time, _ = pieces.T
    known = [(float(part.pieces[:, 0].sum()), *part.heights) for part in parts if part.heights is not None]
    flags = (*flags, *(Flag("times_of_truck", "route"),) * any(part.of_truck for part in parts))
    position, height = None, None
    if len(known) == len(parts):
        begins = running_sum(np.array([length_m for length_m, _, _ in known]))
        places = [at + m * x / max(x[-1], 1e-9) for at, (m, x, _) in zip(begins, known, strict=False)]
        position = driven_positions(np.concatenate(places), length, carried)
        height = np.concatenate([h for *_, h in known])
    else:
        flags = (*flags, FLAT_ROAD)
    pauses = pauses_of(length, time, carried)
    length, time, moving = pieces[~carried].T
    ends = link_ends(length, time, SHORTEST_LINK_M, np.zeros(len(length), dtype=bool))
    if not len(ends):
        got, allowed = "no step with a length and a duration", "a route with steps"
        raise InvalidInput.of("no route", where, got, allowed)
    starts = np.append(0, ends[:-1] + 1)
    length, time = np.add.reduceat(length, starts), np.add.reduceat(time, starts)
    unknown = np.full(len(length), np.nan)
    return LinkRoute(length, time, unknown, moving[ends], position, height, flags, pauses=pauses)


def _first_route(routes: Node) -> tuple[Node, tuple[Flag, ...]]:
    """The first route of a response, and a flag if there are others."""
    entries = routes.entries(min_count=1)
    return entries[0], first_of_several("routes", len(entries))


def _no_route(where: str, got: str, allowed: str) -> InvalidInput:
    return InvalidInput.of("the router found no route", where, got, allowed)


def route_from_osrm(response: Mapping[str, Any], where: str = "OSRM response") -> LinkRoute:
    """Links of an OSRM route response: one for each annotated edge, else for each step, else for each leg.

    An annotation gives the speed between two nodes of the map without turns and lights. If the leg takes longer than all its
    edges, their times are scaled to its duration; the moving speed stays that of the annotation, length over time.

    Raises
    ------
    InvalidInput
        When the response is not valid, or OSRM found no route.
    """
    if response.get("code", "Ok") != "Ok":
        raise _no_route(where, excerpt(response.get("code")), "code Ok")
    route, flags = _first_route(Node(response, where)["routes"])
    parts = []
    for leg in route["legs"].entries(min_count=1):
        leg["duration"].number(minimum=0.0)
        annotation = leg["annotation"].value
        has_edges = isinstance(annotation, dict) and annotation.get("duration") and annotation.get("distance")
        pieces = edge_pieces(leg) if has_edges else step_pieces(steps_of(leg))
        parts.append(Part(pieces, carried_pieces(leg, pieces[:, 0])))
    return route_from_parts(parts, where, *flags)


def route_from_valhalla(response: Mapping[str, Any], where: str = "Valhalla response") -> LinkRoute:
    """Links of a Valhalla trip: one for each manoeuvre, with the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When the response is not valid, or Valhalla found no route.
    """
    trip = Node(response, where)["trip"]
    if trip.members().get("status", 0) != 0:
        raise _no_route(where, excerpt(trip["status_message"].value, 80), "status 0")
    units = trip.members().get("units", "kilometers")
    if units not in ("kilometers", "miles"):
        raise InvalidInput.of("unknown unit", f"{where}, units", excerpt(units, 40), "kilometers or miles")
    metres, height_unit = (1000.0, 1.0) if units == "kilometers" else (M_PER_MILE, M_PER_FOOT)
    parts = []
    for leg in trip["legs"].entries(min_count=1):
        manoeuvres = leg["maneuvers"].entries(min_count=1)
        pieces = step_pieces(manoeuvres, "length", "time") * (metres, 1.0, 1.0)
        # the last interval differs a little from the others: the heights are spread evenly over the leg
        height = height_unit * Node(leg["elevation"].value or [], leg["elevation"].where).numbers()
        heights = (np.linspace(0.0, 1.0, len(height)), height) if len(height) else None
        parts.append(Part(pieces, carried_steps(manoeuvres), heights))
    return route_from_parts(parts, where)


def route_from_openrouteservice(
    response: Mapping[str, Any], where: str = "openrouteservice response"
) -> LinkRoute:
    """Links of an openrouteservice response in JSON or GeoJSON: one for each step, with the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When the response is not valid, or is an error message.
    """
    if "error" in response:
        raise _no_route(where, excerpt(response["error"], 120), "routes")
    heights = None
    answer = Node(response, where)
    metres = _openrouteservice_unit(response, where)
    if "features" in response:
        feature, flags = _first_route(answer["features"])
        route = feature["properties"]
        heights = heights_along(feature["geometry"]["coordinates"].coordinates())
    else:
        route, flags = _first_route(answer["routes"])
        summary, line = route["summary"].value, route["geometry"]
        has_heights = isinstance(summary, dict) and ("ascent" in summary or "descent" in summary)
        if has_heights and isinstance(line.value, str):
            heights = heights_along(decode_polyline(line.value, line.where, dimensions=3))
    steps = [step for segment in route["segments"].entries(min_count=1) for step in steps_of(segment)]
    pieces = step_pieces(steps) * (metres, 1.0, 1.0)
    return route_from_parts([Part(pieces, ferry_steps(route, steps), heights)], where, *flags)


def _openrouteservice_unit(response: Mapping[str, Any], where: str) -> float:
    """Metres per unit of length in the response: the unit that the response repeats from the request, by default the metre."""
    metadata = response.get("metadata")
    query = metadata.get("query") if isinstance(metadata, dict) else None
    units = query.get("units", "m") if isinstance(query, dict) else "m"
    if not isinstance(units, str) or units.lower() not in _ORS_UNITS_M:
        place = f"{where}, metadata, query, units"
        raise InvalidInput.of("unknown unit", place, excerpt(units, 40), ", ".join(_ORS_UNITS_M))
    return _ORS_UNITS_M[units.lower()]


def route_from_graphhopper(response: Mapping[str, Any], where: str = "GraphHopper response") -> LinkRoute:
    """Links of a GraphHopper response: one for each entry of the path detail `time`, else for each instruction.

    The links have the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When the response is not valid, or is an error message.
    """
    if "paths" not in response and "message" in response:
        raise _no_route(where, excerpt(response["message"], 120), "paths")
    path, flags = _first_route(Node(response, where)["paths"])
    points = _graphhopper_points(path)
    details = path["details"] if isinstance(path["details"].value, dict) else Node({}, where)
    if points is not None and details["time"].value:
        length = path["distance"]
        position = distances_m(points, None if length.value is None else length.number(minimum=0.0))
        moving = speeds_at_points(details["average_speed"], len(points))
        times = intervals(details["time"], len(points))
        milliseconds = [0.0 if value.value is None else value.number(minimum=0.0) for _, _, value in times]
        start, end = np.array([row[:2] for row in times], dtype=np.int64).reshape(-1, 2).T
        pieces = np.column_stack((position[end] - position[start], milliseconds, moving[start]))
        carried = carried_points(details, len(points))[start]
    else:
        pieces = step_pieces(steps_of(path, "instructions"), time_key="time")
        carried = np.zeros(len(pieces), dtype=bool)
    heights = None if points is None else heights_along(points)
    return route_from_parts([Part(pieces * (1.0, 1e-3, 1.0), carried, heights)], where, *flags)


def _graphhopper_points(path: Node) -> FloatArray | None:
    """The points of a path, shape (points, 2 or 3); None if the path has no points.

    An encoded polyline has heights or none; the decoding that fits the length of the path is returned.
    """
    points = path["points"]
    if points.value is None:
        return None
    if not isinstance(points.value, str):
        return points["coordinates"].coordinates()
    multiplier = path["points_encoded_multiplier"]
    precision = 1e5 if multiplier.value is None else multiplier.number(minimum=1.0)
    decode = partial(decode_polyline, points.value, points.where, precision=precision)
    lines = [line for n in (2, 3) if (line := or_none(decode, dimensions=n)) is not None]
    if len(lines) < 2:
        return lines[0] if lines else decode()  # which names the fault
    length_m = path["distance"].number(minimum=0.0)
    return min(lines, key=lambda line: abs(float(haversine_m(line[:, 0], line[:, 1]).sum()) - length_m))


def _from_service(read: Callable[[Node], list[Part]], response: Mapping[str, Any], where: str) -> LinkRoute:
    """Links of the parts that a reader of a service finds in the first route."""
    route, flags = _first_route(Node(response, where)["routes"])
    return route_from_parts(read(route), where, *flags)


ROUTERS: Final[Mapping[str, Callable[[Mapping[str, Any], str], LinkRoute]]] = {
    "osrm": route_from_osrm,
    "valhalla": route_from_valhalla,
    "openrouteservice": route_from_openrouteservice,
    "graphhopper": route_from_graphhopper,
    "google": partial(_from_service, google_route),
    "here": partial(_from_service, here_route),
    "tomtom": partial(_from_service, tomtom_route),
}
"""Reader of each router's response."""

_SIGNS: Final[Mapping[str, frozenset[str]]] = {
    "valhalla": frozenset({"trip"}),
    "graphhopper": frozenset({"paths"}),
    "tomtom": frozenset({"formatVersion", "progress"}),
    "google": frozenset({"distanceMeters", "staticDuration"}),
    "here": frozenset({"sections", "notices"}),
    "osrm": frozenset({"code", "legs"}),
    "openrouteservice": frozenset({"segments", "summary", "error"}),
}
"""Names in the response of each router, at the top or in the first route, leg or step; the first router with one of them counts."""


def recognise_router(response: Mapping[str, Any]) -> str | None:
    """The name in `ROUTERS` of the router whose response this looks like; None if it looks like none.

    Examples
    --------
    >>> recognise_router({"code": "Ok", "routes": []}), recognise_router({"paths": []}), recognise_router({"type": "LineString"})
    ('osrm', 'graphhopper', None)
    """
    features = response.get("features")
    if isinstance(features, list) and features and isinstance(features[0], dict):
        properties = features[0].get("properties")
        return "openrouteservice" if isinstance(properties, dict) and "segments" in properties else None
    names, level = set(response), response
    for key in ("routes", "legs", "steps"):
        entries = level.get(key)
        level = entries[0] if isinstance(entries, list) and entries and isinstance(entries[0], dict) else {}
        names |= set(level)
    return next((router for router, signs in _SIGNS.items() if names & signs), None)


def parse_route(source: bytes | str | Path, *, where: str | None = None) -> LinkRoute | Track:
    """Read a route in any of the formats: GPX, KML, GeoJSON, a router's response, or links as JSON or CSV. O(bytes).

    The format is recognised from the content. Links are a JSON array of the objects that `route_from_links` reads, an object
    with such an array under the key `links`, or a CSV table with the same names as columns (`route_from_table`).

    Parameters
    ----------
    source : bytes, str or path
        The text itself as bytes, or the path of a file.
    where : str, optional
        Name for messages.

    Returns
    -------
    LinkRoute or Track
        A track for GPX, KML and GeoJSON, links for everything else.

    Raises
    ------
    InvalidInput
        When the source has none of these formats; else with the faults that the reader of its format finds.

    Examples
    --------
    >>> parse_route(b'[{"length_m": 500, "speed_m_s": 10}]').duration_s
    50.0
    """
    data, name = read_content(source, where)
    head = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
    if head.startswith((b"<", b"\xff\xfe", b"\xfe\xff")):
        return track_from_xml(data, name)
    if head.startswith(_ZIP):
        fix = "unpack it, for example with unzip, and give the file doc.kml"
        raise InvalidInput.of("packed file", name, "a ZIP archive, such as KMZ", "KML", fix)
    if is_links_table(data):
        return route_from_table(data, name)
    document = parse_json(data, name)
    if isinstance(document, list):
        return route_from_links(document)
    response = Node(document, name).members()
    if "links" in response:
        return route_from_links([link.value for link in Node(document, name)["links"].entries()])
    router = recognise_router(response)
    if router is not None:
        return ROUTERS[router](response, f"{name} ({router})")
    if "type" in response:
        return track_from_geojson(Node(response, name))
    got = f"an object with {sorted(response)[:6]}"
    allowed = (
        f"GPX, KML, GeoJSON, a response of {', '.join(ROUTERS)}, or links with {', '.join(sorted(LINK_KEYS))}"
    )
    raise InvalidInput.of("unknown format", name, got[:120], allowed)
