"""OSRM, GraphHopper and openrouteservice as routers, each by the URL of a server.

Requests and answers follow the public documentation of each API; `docs/journeys.md` names the pages.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.routes.places import Place
from tripwatt.routes.points import a_list, a_number, an_object, coordinates, haversine_m, numbers
from tripwatt.routes.routers.road import MOST_ROUTES, Edges, Road, RoadParts, require_stops
from tripwatt.routes.web import WebClient
from tripwatt.units import M_S_PER_KM_H

NO_ROUTE: Final = frozenset({"NoRoute", "NoSegment", "InvalidValue", "InvalidQuery", "TooBig"})
"""Codes of OSRM for places that no road connects, or that are none."""

KEY: Final = "TRIPWATT_ROUTER_KEY"


class _ServerRouter:
    """What the three have in common: the line of the road is known, isochrones are not used."""

    name: str

    def outline(self, start: Place, minutes: float) -> tuple[Place, ...]:
        """See `Router.outline`: none."""
        return ()


@dataclass(frozen=True)
class OsrmRouter(_ServerRouter):
    """Roads by an OSRM server, from the annotations of its routes where it gives them, else from their steps."""

    client: WebClient
    name: str = "osrm"

    @classmethod
    def from_url(cls, url: str) -> OsrmRouter:
        """An OSRM server."""
        client = WebClient(url, "the router", KEY, "query:api_key")
        return cls(client, f"osrm at {client.host}")

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        """See `Router.roads`. With intermediate stops OSRM has no alternatives."""
        require_stops(stops)
        line = ";".join(f"{p.longitude_deg:.6f},{p.latitude_deg:.6f}" for p in stops)
        query = {
            "alternatives": str(min(alternatives, MOST_ROUTES - 1))
            if alternatives and len(stops) == 2
            else "false",
            "geometries": "geojson",
            "overview": "full",
            "steps": "true",
            "annotations": "duration,distance,speed",
        }
        answer = an_object_of(self.client.get_json(f"/route/v1/driving/{line}", query), "route")
        code = answer.get("code")
        if isinstance(code, str) and code in NO_ROUTE:
            raise no_road(stops, str(answer.get("message") or code))
        if code != "Ok":
            raise RemoteError.of("the router failed", self.client.host, repr(code)[:60], "code Ok")
        return _roads(answer.get("routes"), stops, self.name, osrm_leg)


def osrm_leg(route: dict[str, Any], where: str) -> RoadParts:
    """The legs of a route of OSRM; the whole line belongs to one leg."""
    tables = []
    for k, entry in enumerate(a_list(route.get("legs"), f"{where}, legs", least=1)):
        leg = an_object(entry, f"{where}, legs[{k}]")
        given = leg.get("annotation")
        duration = a_number(leg.get("duration"), f"{where}, legs[{k}], duration", least=0.0)
        tables.append(_annotated(given, duration, where) if isinstance(given, dict) else _stepped(leg, where))
    table = np.concatenate(tables)
    geometry = an_object(route.get("geometry"), f"{where}, geometry")
    points = coordinates(geometry.get("coordinates"), f"{where}, geometry")
    parts = RoadParts()
    parts.add(Edges.from_speeds(table[:, 0], table[:, 1], table[:, 2]), points[:, :2], None)
    return parts


def _annotated(annotation: Mapping[str, Any], duration_s: float, where: str) -> FloatArray:
    """Length, time and free speed of each edge; what the leg takes longer is turns, shared out by time."""
    length = numbers(annotation.get("distance"), f"{where}, annotation, distance", least=0.0)
    time = numbers(annotation.get("duration"), f"{where}, annotation, duration", least=0.0)
    if len(length) != len(time) or not len(time):
        raise InvalidInput.of(
            "annotations of different lengths", where, f"{len(length)} and {len(time)}", "one for each edge"
        )
    if annotation.get("speed") is not None:
        speed = numbers(annotation["speed"], f"{where}, annotation, speed", least=0.0)
        if len(speed) != len(time):
            raise InvalidInput.of("annotations of different lengths", where, f"{len(speed)}", f"{len(time)}")
    else:
        speed = np.divide(length, time, out=np.full(len(time), np.nan), where=time > 0)
    speed = np.where(speed > 0.0, speed, np.nan)
    total = float(time.sum())
    if total > 0:
        time = time * max(duration_s / total, 1.0)
    return np.column_stack((length, time, speed))


def _stepped(leg: Mapping[str, Any], where: str) -> FloatArray:
    rows = []
    for k, entry in enumerate(a_list(leg.get("steps") or [leg], f"{where}, steps")):
        step = an_object(entry, f"{where}, steps[{k}]")
        length = a_number(step.get("distance"), f"{where}, steps[{k}], distance", least=0.0)
        rows.append(
            (length, a_number(step.get("duration"), f"{where}, steps[{k}], duration", least=0.0), np.nan)
        )
    return np.array(rows)


@dataclass(frozen=True)
class GraphHopperRouter(_ServerRouter):
    """Roads by a GraphHopper server, with its path details and heights."""

    client: WebClient
    name: str = "graphhopper"

    @classmethod
    def from_url(cls, url: str) -> GraphHopperRouter:
        """A GraphHopper server; its key, if any, is that of the environment."""
        client = WebClient(url, "the router", KEY, "query:key")
        return cls(client, f"graphhopper at {client.host}")

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        """See `Router.roads`. With intermediate stops GraphHopper has no alternatives."""
        require_stops(stops)
        body: dict[str, Any] = {
            "points": [[p.longitude_deg, p.latitude_deg] for p in stops],
            "profile": "car",
            "points_encoded": False,
            "elevation": True,
            "instructions": False,
            "details": ["time", "distance", "average_speed", "max_speed", "road_class"],
        }
        if alternatives and len(stops) == 2:
            body |= {
                "algorithm": "alternative_route",
                "alternative_route.max_paths": min(alternatives + 1, MOST_ROUTES),
            }
        answer = an_object_of(self.client.post_json("/route", body), "route")
        if "paths" not in answer:
            raise no_road(stops, str(answer.get("message") or "no paths"))
        return _roads(answer["paths"], stops, self.name, graphhopper_path)


def graphhopper_path(path: dict[str, Any], where: str) -> RoadParts:
    """The legs of a path of GraphHopper as one leg."""
    geometry = an_object(path.get("points"), f"{where}, points")
    points = coordinates(geometry.get("coordinates"), f"{where}, points")
    details = an_object(path.get("details"), f"{where}, details")
    driven = np.concatenate(([0.0], np.cumsum(haversine_m(points[:, 0], points[:, 1]))))
    total = a_number(path.get("distance"), f"{where}, distance", least=0.0)
    if driven[-1] > 0:
        driven *= total / driven[-1]
    time = _intervals(details, "time", len(points), where)
    speed = _over_points(details, "average_speed", len(points), where) * M_S_PER_KM_H
    limit = _over_points(details, "max_speed", len(points), where) * M_S_PER_KM_H
    kinds = {start: kind for start, _, kind in _entries(details, "road_class", len(points), where)}
    begin = np.array([start for start, _, _ in time])
    border = driven[np.append(begin, time[-1][1])]
    length, seconds = np.diff(border), np.array([ms / 1000.0 for _, _, ms in time])
    edges = Edges(
        length,
        seconds,
        np.where(speed[begin] > 0.0, speed[begin], np.nan),
        np.where(limit[begin] > 0.0, limit[begin], np.nan),
        _kinds_at(begin.tolist(), kinds),
        np.zeros(len(length), dtype=bool),
    )
    known = np.isfinite(points[:, 2])
    parts = RoadParts()
    parts.add(edges, points[:, :2], (driven[known], points[known, 2]) if known.any() else None)
    return parts


def _kinds_at(begin: list[int], kinds: Mapping[int, Any]) -> tuple[str, ...]:
    found, now, starts = [], "", sorted(kinds)
    for point in begin:
        while starts and starts[0] <= point:
            now = str(kinds[starts.pop(0)] or "")
        found.append(now)
    return tuple(found)


def _entries(details: Mapping[str, Any], name: str, points: int, where: str) -> list[tuple[int, int, Any]]:
    rows = []
    for k, entry in enumerate(a_list(details.get(name) or [], f"{where}, details, {name}")):
        place = f"{where}, details, {name}[{k}]"
        start, end, value = a_list(entry, place, least=3)[:3]
        first, last = a_number(start, place, least=0.0), a_number(end, place, least=0.0)
        if first != int(first) or last != int(last) or not first <= last < points:
            raise InvalidInput.of(
                "point index out of range", place, f"{first:g} to {last:g}", f"0 to {points - 1}"
            )
        rows.append((int(first), int(last), value))
    return rows


def _intervals(
    details: Mapping[str, Any], name: str, points: int, where: str
) -> list[tuple[int, int, float]]:
    rows = [
        (s, e, a_number(v, f"{where}, details, {name}", least=0.0))
        for s, e, v in _entries(details, name, points, where)
    ]
    if not rows or any(a[1] != b[0] for a, b in itertools.pairwise(rows)):
        raise InvalidInput.of(
            "incomplete path details", f"{where}, details, {name}", f"{len(rows)}", "one for each edge"
        )
    return rows


def _over_points(details: Mapping[str, Any], name: str, points: int, where: str) -> FloatArray:
    values = np.full(points, np.nan)
    for start, end, value in _entries(details, name, points, where):
        if value is not None:
            values[start : max(end, start + 1)] = a_number(value, f"{where}, details, {name}", least=0.0)
    return values


@dataclass(frozen=True)
class OpenRouteServiceRouter(_ServerRouter):
    """Roads by an openrouteservice server, from the steps of its routes, with heights."""

    client: WebClient
    name: str = "openrouteservice"

    @classmethod
    def from_url(cls, url: str) -> OpenRouteServiceRouter:
        """An openrouteservice server; its key, if any, is that of the environment."""
        client = WebClient(url, "the router", KEY, "header:Authorization")
        return cls(client, f"openrouteservice at {client.host}")

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        """See `Router.roads`. With intermediate stops openrouteservice has no alternatives."""
        require_stops(stops)
        body: dict[str, Any] = {
            "coordinates": [[p.longitude_deg, p.latitude_deg] for p in stops],
            "elevation": True,
            "units": "m",
            "instructions": True,
        }
        if alternatives and len(stops) == 2:
            body["alternative_routes"] = {"target_count": min(alternatives + 1, 3)}
        answer = an_object_of(self.client.post_json("/v2/directions/driving-car/geojson", body), "directions")
        if "error" in answer:
            raise no_road(stops, str(answer["error"]))
        return _roads(answer.get("features"), stops, self.name, openrouteservice_feature)


def openrouteservice_feature(feature: dict[str, Any], where: str) -> RoadParts:
    """The segments of a route of openrouteservice as one leg."""
    properties = an_object(feature.get("properties"), f"{where}, properties")
    geometry = an_object(feature.get("geometry"), f"{where}, geometry")
    points = coordinates(geometry.get("coordinates"), f"{where}, geometry")
    segments = a_list(properties.get("segments"), f"{where}, segments", least=1)
    table = np.concatenate(
        [_stepped(an_object(segment, f"{where}, segments[{k}]"), where) for k, segment in enumerate(segments)]
    )
    driven = np.concatenate(([0.0], np.cumsum(haversine_m(points[:, 0], points[:, 1]))))
    if driven[-1] > 0:
        driven *= float(table[:, 0].sum()) / driven[-1]
    known = np.isfinite(points[:, 2])
    parts = RoadParts()
    heights = (driven[known], points[known, 2]) if known.any() else None
    parts.add(Edges.from_speeds(table[:, 0], table[:, 1], table[:, 2]), points[:, :2], heights)
    return parts


def an_object_of(value: Any, where: str) -> dict[str, Any]:
    """The JSON object of a server's answer.

    Raises
    ------
    RemoteError
        When it is none.
    """
    try:
        return an_object(value, where)
    except InvalidInput as error:
        raise RemoteError(error.faults) from error


def no_road(stops: Sequence[Place], got: str) -> InvalidInput:
    """The error of places that no road connects."""
    title = " to ".join(place.title for place in stops)
    return InvalidInput.of("no road found", title, got[:120], "places that a road connects")


def _roads(value: Any, stops: Sequence[Place], where: str, legs: Any) -> tuple[Road, ...]:
    """Roads of the routes of an answer; `legs` reads one of them."""
    try:
        routes = [an_object(entry, where) for entry in a_list(value, where, least=1)[:MOST_ROUTES]]
        parts = [legs(route, where) for route in routes]
    except InvalidInput as error:
        raise RemoteError(error.faults) from error
    return tuple(part.road(stops, where) for part in parts)
