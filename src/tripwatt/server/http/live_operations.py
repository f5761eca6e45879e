"""The endpoints of cars on the road."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Awaitable, Callable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Annotated, Any, Final
from urllib.parse import parse_qsl

import orjson
from fastapi import Path as PathValue
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from tripwatt.errors import Fault, excerpt
from tripwatt.server.cars import sample_from_abrp
from tripwatt.server.cars.documents import LiveResponse
from tripwatt.server.cars.live_car import VALID_NAME
from tripwatt.server.http import openapi
from tripwatt.server.http.answering import answer, json_response
from tripwatt.server.http.journey_schemas import NeedQuery, RangeQuery
from tripwatt.server.http.live import CAR_FIELDS, LiveCars
from tripwatt.server.http.live_schemas import (
    LiveCarsResponse,
    LiveDeparture,
    LivePlanRequest,
    TelemetryRequest,
    TelemetryResponse,
)
from tripwatt.server.http.over_mqtt import OverMqtt
from tripwatt.server.http.pool import WorkerPool
from tripwatt.server.http.problems import Problem, invalid_input
from tripwatt.server.http.receiving import media_type
from tripwatt.server.http.schemas import check_request, parse_json
from tripwatt.server.http.settings import Settings

MAX_MESSAGE_BYTES: Final = 65_536
"""Largest message of a car; those of senders have less than 2 kB."""

MAX_FORM_FIELDS: Final = 20

LIVE_EVENTS: Final = {
    "schema": {"type": "string", "description": "events `live`; the data of each is a LiveResponse"}
}

ReadBody = Callable[..., Awaitable[bytes]]
Name = Annotated[str, PathValue(pattern=f"^{VALID_NAME.pattern}$", description="name of the car's folder")]


class LiveOperations:
    """The endpoints of cars on the road; each raises the problem `no-live` if the service has no folder of cars.

    Parameters
    ----------
    settings : Settings
    pool : WorkerPool
    read_body : callable
        Reads the body of a request: `(request, media_types, max_bytes)`.
    log : callable

    Raises
    ------
    InvalidInput
        As `LiveCars`.
    """

    def __init__(
        self, settings: Settings, pool: WorkerPool, read_body: ReadBody, log: Callable[..., None]
    ) -> None:
        self.read_body = read_body
        self._cars = None if settings.cars is None else LiveCars(settings, pool, log)
        mqtt = settings.mqtt
        self._over_mqtt = None if self._cars is None or mqtt is None else OverMqtt(self._cars, mqtt)

    def running(self) -> AbstractAsyncContextManager[None]:
        """Watch the cars while the service runs, and follow them over MQTT."""
        over_mqtt = [] if self._over_mqtt is None else [self._over_mqtt.follower.follow()]
        return contextlib.nullcontext() if self._cars is None else self._cars.running(*over_mqtt)

    @property
    def cars(self) -> LiveCars:
        """The cars on the road.

        Raises
        ------
        Problem
            `no-live`.
        """
        if self._cars is None:
            raise Problem("no-live", "start the service with --cars")
        return self._cars

    @openapi.operation(
        "POST /v1/telemetry",
        "live",
        TelemetryResponse,
        {openapi.JSON: TelemetryRequest, openapi.FORM: TelemetryRequest},
        more={"security": [{"car": []}, {}]},  # or the token is part of the message
    )
    async def telemetry(
        self, request: Request, token: Annotated[str | None, Query(description="token of the car")] = None
    ) -> Response:
        """Take a message of a car in the format of A Better Routeplanner's live data."""
        cars = self.cars
        body = await self.read_body(request, (openapi.JSON, openapi.FORM), MAX_MESSAGE_BYTES)
        message = message_of(body, media_type(request))
        car = cars.by_token(given_token(message, request, token))
        return json_response(await cars.take(car, sample_from_abrp(telemetry_of(message))))

    @openapi.operation("GET /v1/live", "live", LiveCarsResponse)
    async def list_live(self, request: Request) -> Response:
        """List the cars on the road: those with a token."""
        return json_response(self.cars.summary())

    @openapi.operation("GET /v1/live/{car}", "live", LiveResponse)
    async def get_live(self, request: Request, car: Name) -> Response:
        """Return the state of a car on the road and the latest forecast of its trip."""
        return json_response(await self.cars.document(self.cars.by_name(car)))

    @openapi.operation("PUT /v1/live/{car}/plan", "live", LiveResponse, LivePlanRequest)
    async def put_plan(self, request: Request, car: Name) -> Response:
        """Give the plan of the trip that a car is on, or of its next one; it is kept until that trip has ended."""
        followed = self.cars.by_name(car)
        plan = _parsed(await self.read_body(request, (openapi.JSON,)))
        leaves = check_request({"departs_at": plan.pop("departs_at", None)}, LiveDeparture)
        result = await self.cars.set_plan(followed, plan, leaves.departure_s)
        if result.status == 200:
            return json_response(await self.cars.document(followed))
        return answer(request, result)

    async def job_of(self, query: RangeQuery) -> dict[str, Any]:
        """Return the parameters of a query's job: `body`, and `seen` if the query is about a car on the road."""
        given = query.model_dump(mode="json", exclude_unset=True)
        if self._cars is None or query.car not in self._cars.cars or any(map(given.get, CAR_FIELDS)):
            return {"body": orjson.dumps(given)}
        if given.get("trip") is None:  # else the car is that of the trip
            del given["car"]
        return await self._cars.job_without_road(self._cars.cars[query.car], given)

    async def next_need(self, request: Request, car: str, query: NeedQuery) -> Response:
        """Return what the next trip of a car needs: energy at a quantile, charge to leave with, energy to charge."""
        leaves = time.time() if query.departs_at is None else query.departs_at.timestamp()
        needed = await self.cars.need(
            self.cars.by_name(car),
            {"probability": query.probability, "departure_s": leaves, "plug_w": query.plug_w},
            query.model_dump(include={"reserve", "ambient_temperature_degc"}, exclude_none=True),
        )
        return answer(request, needed)

    @openapi.operation(
        "GET /v1/live/{car}/events",
        "live",
        {openapi.EVENTS: LIVE_EVENTS},
        description="A stream of server-sent events",
    )
    async def get_events(self, request: Request, car: Name) -> Response:
        """Stream the state of a car on the road and the forecasts of its trip as server-sent events."""
        followed = self.cars.by_name(car)
        if request.scope.get("was_head"):
            return Response(media_type=openapi.EVENTS)  # a stream without a body would never end
        return self.cars.stream(followed)


def message_of(body: bytes, kind: str) -> dict[str, Any]:
    """Return the object of a body: JSON, or the fields of a form.

    Raises
    ------
    Problem
        `not-json`, or `invalid-input` for JSON that is not an object and for a form that is not valid.

    Examples
    --------
    >>> message_of(b"token=abc&tlm=%7B%22utc%22%3A1%7D", "application/x-www-form-urlencoded")
    {'token': 'abc', 'tlm': '{"utc":1}'}
    """
    if kind != openapi.FORM:
        return _parsed(body)
    try:
        return dict(parse_qsl(body.decode("utf-8"), max_num_fields=MAX_FORM_FIELDS))
    except ValueError as error:
        fault = Fault("not a form", "body", f"{error}"[:80], "the fields token and tlm")
        raise invalid_input([fault]) from error


def given_token(message: Mapping[str, Any], request: Request, of_query: str | None) -> str:
    """Return the token of a request: a bearer token, else a field of its message, else a parameter of its URL; empty if none."""
    kind, _, bearer = request.headers.get("authorization", "").partition(" ")
    candidates = (bearer.strip() if kind.lower() == "bearer" else "", message.get("token"), of_query)
    return next((token for token in candidates if isinstance(token, str) and token), "")


def telemetry_of(message: Mapping[str, Any]) -> Any:
    """Return the object `tlm` of a message, which may be JSON text; without `tlm`, the message itself if it has a `utc`.

    Raises
    ------
    Problem
        `not-json` if the text is not JSON.
    """
    given = message.get("tlm", message if "utc" in message else None)
    return parse_json(given.encode(), "tlm: ") if isinstance(given, str) else given


def _parsed(body: bytes) -> dict[str, Any]:
    document = parse_json(body)
    if not isinstance(document, dict):
        raise invalid_input([Fault("not an object", "body", excerpt(document), "an object")])
    return document
