"""Read an uploaded route or log as fields of a request."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import orjson
import pandas as pd

from tripwatt.errors import InvalidInput
from tripwatt.routes import Track, is_links_table, parse_route
from tripwatt.routes.link_objects import fields_of_route
from tripwatt.server.http.schemas import BMS_SOC, require_duration
from tripwatt.server.http.settings import Limits
from tripwatt.sources.canonical import canonical_of_text
from tripwatt.trips import Flag, gap_flags, raise_faults, time_faults
from tripwatt.trips.messages import flag_to_dict
from tripwatt.trips.samples import columns_of

ROUTE_FIRST_BYTES: Final = (b"<", b"{", b"[", b"\xff", b"\xfe")
"""First bytes of XML, JSON and UTF-16."""


def road_fields(route: Any, speed_m_s: Any, limits: Limits) -> dict[str, Any]:
    """Return the road of the field `route` of a request as the fields `links` and `elevation`, or `samples`.

    Parameters
    ----------
    route : dict or str
        An answer with a road: of this service, of a router, or GeoJSON; or the text of a file.
    speed_m_s : float or None
        Mean speed [m/s] of parts of a track without times and speeds.
    limits : Limits

    Raises
    ------
    InvalidInput
        As `read_route`.
    """
    if isinstance(route, dict) and isinstance(route.get("roads"), list) and route["roads"]:
        route = route["roads"][0]  # the first of a journey is the one it proposes
    if not isinstance(route, dict) or not {"links", "samples"} & route.keys():
        body = route.encode() if isinstance(route, str) else orjson.dumps(route)
        route = read_route(body, speed_m_s, limits, "route")
    names = ("samples",) if route.get("links") is None else ("links", "elevation")
    return {name: route.get(name) for name in names}


def read_route(body: bytes, speed_m_s: float | None, limits: Limits, where: str = "upload") -> dict[str, Any]:
    """Read an upload and return it as fields of a `ForecastRequest`.

    Parameters
    ----------
    body : bytes
        GPX, GeoJSON, the response of a router, links as JSON or CSV, or CSV of samples. The content determines
        the format.
    speed_m_s : float or None
        Mean speed [m/s] of parts of a track without times and speeds.
    limits : Limits
    where : str
        Name of the upload in messages.

    Raises
    ------
    InvalidInput
        When the upload has none of these formats, or exceeds the limits.
    """
    if body.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] not in ROUTE_FIRST_BYTES and not is_links_table(body):
        return _response(canonical_of_text(body, where), limits, where)
    route = parse_route(body, where=where)
    if isinstance(route, Track):
        if route.is_log and route.time_s is not None:
            require_duration(float(route.time_s[-1]), where, limits)
            plan = route.plan()
            return _response(plan.samples, limits, where, plan.flags)
        route = route.links(speed_m_s)
    if len(route) > limits.links:
        raise InvalidInput.of("too many links", where, f"{len(route)}", f"at most {limits.links}")
    require_duration(route.duration_s, where, limits)
    plan = route.plan()
    return _response(plan.samples, limits, where, plan.flags) | fields_of_route(route)


def _response(
    samples: pd.DataFrame, limits: Limits, where: str, flags: tuple[Flag, ...] = ()
) -> dict[str, Any]:
    """Return the response to an upload, without links."""
    time, speed = samples["time_s"].to_numpy(), samples["speed_m_s"].to_numpy()
    if len(samples) > limits.samples:
        raise InvalidInput.of("too many samples", where, f"{len(samples)}", f"at most {limits.samples}")
    require_duration(float(time[-1] - time[0]), where, limits)
    raise_faults(time_faults(time, where))
    return {
        "samples": columns_of(samples.rename(columns=BMS_SOC)),
        "links": None,
        "elevation": None,
        "duration_s": float(time[-1] - time[0]),
        "distance_m": float(np.trapezoid(speed, time)),
        "notes": [flag_to_dict(flag) for flag in flags or gap_flags(time)],
    }
