"""Examples of the OpenAPI document: requests and uploads that a reader may copy, put together from `example_requests.toml`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pydantic import BaseModel

from tripwatt.files import shipped_toml
from tripwatt.server.http import schemas
from tripwatt.server.http.car_schemas import LivePlanRequest, LogsRequest, NewCarRequest, TelemetryRequest
from tripwatt.server.http.fleets import NightRequest
from tripwatt.server.http.journey_schemas import (
    JourneyAdviceRequest,
    JourneyDifferenceRequest,
    PlanRequest,
    ReachRequest,
)

PARTS: Final[Mapping[str, Any]] = shipped_toml("server/http/example_requests.toml")
PLANNED_REQUEST: Final[Mapping[str, Any]] = PARTS["planned"]
DRIVEN_REQUEST: Final = {"samples": PARTS["samples"], **PARTS["driven"]}
JOURNEY: Final[Mapping[str, Any]] = PARTS["journey"]
GPX: Final[str] = PARTS["uploads"]["gpx"]


def _warmer(request: Mapping[str, Any], **warmer: float) -> dict[str, Any]:
    return {"warmer": {"one": {**request, **warmer}, "other": request}}


EXAMPLES: Final[Mapping[type[BaseModel], Mapping[str, Any]]] = {
    schemas.ForecastRequest: {"planned road": PLANNED_REQUEST, "speed trace": DRIVEN_REQUEST},
    schemas.UpdateRequest: {"after 20 s": {**DRIVEN_REQUEST, "observed": PARTS["observed"]}},
    LivePlanRequest: {"planned road": PLANNED_REQUEST},
    TelemetryRequest: {"a message": {"token": "the-token-of-the-car", "tlm": PARTS["message"]}},
    NewCarRequest: {"a car": {"name": "my-leaf", "car": "nissan_leaf_24"}},
    LogsRequest: {"as proposed": {}},
    PlanRequest: {"a journey": JOURNEY},
    JourneyAdviceRequest: {"a journey": {**JOURNEY, "probability": 0.95}},
    JourneyDifferenceRequest: _warmer(JOURNEY, ambient_temperature_degc=10.0),
    schemas.AdviceRequest: {"planned road": {**PLANNED_REQUEST, "probability": 0.95, "extras": ["roof_box"]}},
    schemas.DifferenceRequest: _warmer(PLANNED_REQUEST, cabin_setpoint_degc=18.0),
    NightRequest: {"tomorrow": PARTS["night"]},
    ReachRequest: {"a start": {"start": JOURNEY["stops"][0], "soc": 0.2}},
    schemas.VehicleFigures: {"compact car": PARTS["figures"]},
}
"""Examples of each request, by name."""

BINARY: Final = {"type": "string", "format": "binary"}
ROUTE: Final = {"type": "object", "description": "of a router, GeoJSON, or `links`; a list of links, too"}
UPLOADS: Final[dict[str, dict[str, Any]]] = {
    "application/gpx+xml": {"schema": BINARY, "example": GPX},
    "application/xml": {"schema": BINARY, "example": GPX},
    "text/xml": {"schema": BINARY, "example": GPX},
    "application/vnd.google-earth.kml+xml": {"schema": BINARY, "example": PARTS["uploads"]["kml"]},
    "text/csv": {"schema": BINARY, "example": PARTS["uploads"]["csv"]},
    "application/octet-stream": {"schema": BINARY},
    "application/geo+json": {"schema": {"type": "object"}, "example": PARTS["uploads"]["geojson"]},
    "application/json": {"schema": ROUTE, "example": {"links": PLANNED_REQUEST["links"]}},
}
"""Media type of the upload of a route -> its media type object."""
