"""The endpoints of users' cars, made, shown, given logs, erased; and of cars on the road. Without a folder of cars each is `no-live`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Final
from urllib.parse import parse_qsl

import orjson
from fastapi import Path as PathValue
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from tripwatt.errors import InvalidInput, each_fault
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.documents import LiveResponse
from tripwatt.server.cars.live_car import VALID_NAME
from tripwatt.server.cars.telemetry import FORMATS, in_message, with_places
from tripwatt.server.http import car_schemas as schemas
from tripwatt.server.http.car_jobs import car_folder
from tripwatt.server.http.learning import Learning
from tripwatt.server.http.openapi import (
    BINARY,
    BYTES,
    EVENTS,
    FORM,
    JSON,
    TEXT,
    new_router,
    request_body,
    request_content,
    response_content,
)
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.schemas import json_object, parse_json
from tripwatt.server.http.service import Called, json_response, media_type

MAX_MESSAGE_BYTES: Final = 65_536
"""Largest message of a car; those of senders have less than 2 kB."""

MAX_FORM_FIELDS: Final = 20
"""Most fields of a form (a choice): a message has two."""

LIVE_EVENTS: Final = response_content(
    {EVENTS: TEXT}, "A stream of server-sent events `live`; the data of each is a LiveResponse"
)
UPLOAD: Final = "/v1/cars/{car}/uploads/{upload}"

CarName = Annotated[str, PathValue(pattern=f"^{VALID_NAME.pattern}$", description="name of the car")]
UploadName = Annotated[
    str,
    PathValue(
        pattern="^[a-z0-9]{8,32}$", description="8 to 32 small letters and digits, chosen by the client"
    ),
]
Entries = Annotated[int, Query(ge=0, le=1000, description="most entries of the answer")]
Trip = Annotated[
    str | None,
    Query(max_length=200, description="only entries before this trip: the last one of the answer before"),
]
FileName = Annotated[str, PathValue(min_length=1, max_length=200, description="name of the file")]
MessageText = Annotated[str, Query(max_length=4000, description="the message as JSON text")]
EventToken = Annotated[
    str | None, Query(description="token of the service; a browser's EventSource sends no header")
]
Include = Annotated[
    str | None,
    Query(
        pattern="^(need|range|next)(,(need|range|next))*$",
        description="what is ahead, with commas: need, range, next",
    ),
]
CarToken = Annotated[str | None, Query(description="token of the car")]

cars, live = new_router("cars"), new_router("live")


@cars.get("/v1/cars", response_model=schemas.CarsResponse)
async def list_cars(call: Called) -> Response:
    """List the cars."""
    return await call.job("cars.list")


@cars.post("/v1/cars", response_model=schemas.CarResponse, **request_body(schemas.NewCarRequest))
async def new_car(call: Called) -> Response:
    """Make a car."""
    response = _with_learning(await call.body_job("new_car"), None)
    if response.status_code == 200:
        name = orjson.loads(response.body)["car"]
        response.headers["Location"] = f"{call.service.settings.prefix}/v1/cars/{name}"
    return response


@cars.get("/v1/cars/{car}", response_model=schemas.CarResponse)
async def get_car(call: Called, car: CarName, limit: Entries = 200, before: Trip = None) -> Response:
    """Return a car, what it learned, and its diary, the newest entries first."""
    learning = call.service.learning.document(car)  # before: what is done by then is shown
    return _with_learning(await call.job("cars.show", name=car, limit=limit, before=before), learning)


@cars.delete("/v1/cars/{car}", response_model=schemas.Forgotten)
async def forget_car(call: Called, car: CarName) -> Response:
    """Erase a car: its trips, its model, its diary, and what it sent."""
    call.service.learning.require_idle(car)
    await call.service.live.drop(car)
    response = await call.job("cars.forget", name=car)
    call.service.learning.by_car.pop(car, None)
    return response


@cars.post("/v1/cars/{car}/token", response_model=schemas.TokenResponse)
async def new_token(call: Called, car: CarName) -> Response:
    """Make a token with which a car sends its messages; an earlier one is no longer accepted."""
    response = await call.job("cars.token", name=car)
    if response.status_code == 200:
        await call.service.live.follow(car_folder(call.service.settings.cars, car))
    return response


@cars.put(f"{UPLOAD}/{{file}}", response_model=schemas.UploadResponse, **request_content({BYTES: BINARY}))
async def put_file(call: Called, car: CarName, upload: UploadName, file: FileName) -> Response:
    """Add a file of logs to an upload: a table, a workbook, or an archive of them."""
    service, limits = call.service, call.service.settings.limits
    car_folder(service.settings.cars, car)  # before the file arrives
    if service.uploads.locked():
        raise Problem("busy", "too many files are unpacked", headers={"Retry-After": "2"})
    async with service.uploads:
        content = await call.read((BYTES,), limits.upload_bytes)
        async with service.unpacking:
            target = {"name": car, "upload": upload, "file": file}
            return await call.job("cars.store", content, **target, max_bytes=limits.car_bytes)


@cars.post(UPLOAD, response_model=schemas.LogsResponse, **request_body(schemas.LogsRequest))
async def read_logs(call: Called, car: CarName, upload: UploadName) -> Response:
    """Return how the tables of an upload are read, and what the audit says of them; nothing is learned."""
    return await call.body_job("cars.logs", name=car, upload=upload)


@cars.post(f"{UPLOAD}/learn", response_model=schemas.CarResponse, **request_body(schemas.LogsRequest))
async def learn(call: Called, car: CarName, upload: UploadName) -> Response:
    """Learn the trips of an upload: the response comes at once, and the car shows the progress."""
    body, job = await call.read(), {"name": car, "upload": upload}
    checked = await call.job("cars.logs", body, **job, strict=True)
    if checked.status_code != 200:
        return checked
    call.service.learning.require_idle(car)
    call.service.learning.start(Learning(upload), {"kind": "cars.learn", **job}, body)
    return await get_car(call, car)


def _with_learning(response: Response, learning: Mapping[str, Any] | None) -> Response:
    """Return the response with a car's document, completed by what the car learns."""
    if response.status_code != 200:
        return response
    return json_response({**orjson.loads(response.body), "learning": learning})


@live.post(
    "/v1/telemetry",
    response_model=schemas.TelemetryResponse,
    # a message that has the token needs no other security
    **request_body(schemas.TelemetryRequest, JSON, FORM, security=[{"car": []}, {}]),
)
async def telemetry(call: Called, token: CarToken = None) -> Response:
    """Take a message of a car in the format of A Better Routeplanner's live data."""
    body = await call.read((JSON, FORM), MAX_MESSAGE_BYTES)
    return await _take(call, message_of(body, media_type(call.request)), token)


@live.get("/v1/telemetry", response_model=schemas.TelemetryResponse)
async def telemetry_by_query(call: Called, tlm: MessageText, token: CarToken = None) -> Response:
    """Take a message of a car as a parameter of the URL, as A Better Routeplanner's live data do, too."""
    return await _take(call, {"tlm": tlm}, token, "query", "tlm")


@live.get("/v1/live", response_model=schemas.LiveCarsResponse)
async def list_live(call: Called, include: Include = None) -> Response:
    """Return the cars on the road, those with a token, with the latest forecasts of their trips."""
    cars, ahead = call.service.live.cars, call.service.ahead
    return json_response({"cars": [await ahead.shown(car, include) for _, car in sorted(cars.items())]})


@live.get("/v1/events", **LIVE_EVENTS)
async def get_all_events(call: Called, token: EventToken = None) -> Response:
    """Stream the states of all cars on the road as server-sent events."""
    return _stream(call, None)


@live.get("/v1/live/{car}", response_model=schemas.LiveCarDocument)
async def get_live(call: Called, car: CarName, include: Include = None) -> Response:
    """Return the state of a car on the road and the latest forecast of its trip."""
    followed = call.service.live.by_name(car)
    return json_response(await call.service.ahead.shown(followed, include))


@live.put("/v1/live/{car}/plan", response_model=LiveResponse, **request_body(schemas.LivePlanRequest))
async def put_plan(call: Called, car: CarName) -> Response:
    """Give the plan of the trip that a car is on, or of its next one; it is kept until that trip has ended."""
    followed = call.service.live.by_name(car)
    result = await call.service.live.set_plan(followed, json_object(await call.read()))
    if result.status != 200:
        return call.answer(result)
    return json_response(await call.service.live.document(followed))


@live.get("/v1/live/{car}/plan", response_model=schemas.LivePlanRequest)
async def get_plan(call: Called, car: CarName) -> Response:
    """Return the plan that was given, as `PUT` takes it, with its road as links or samples."""
    plan = call.service.live.by_name(car).plan
    if plan is None:
        raise Problem("no-plan", "none was given")
    return json_response(plan.request)


@live.delete("/v1/live/{car}/plan", response_model=LiveResponse)
async def delete_plan(call: Called, car: CarName) -> Response:
    """Remove the plan that was given."""
    followed = call.service.live.by_name(car)
    await call.service.live.run(followed.set_plan, None)
    return json_response(await call.service.live.document(followed))


@live.get("/v1/live/{car}/events", **LIVE_EVENTS)
async def get_events(call: Called, car: CarName, token: EventToken = None) -> Response:
    """Stream the state of a car on the road and the forecasts of its trip as server-sent events."""
    return _stream(call, call.service.live.by_name(car))


def _stream(call: Called, car: Car | None) -> Response:
    """Return the events of a car, or of all; nothing if the request asks for no body, since a stream would never end then."""
    return Response(media_type=EVENTS) if "was_head" in call.request.scope else call.service.live.stream(car)


async def _take(call: Called, message: Mapping[str, Any], token: str | None, *at: str) -> Response:
    """Store a message of a car; one without a time counts as of now, as over MQTT. `at` is the place of the whole message."""
    car = call.service.live.by_token(given_token(message, call.request, token))
    place = partial(in_message, message, at=at)
    read = partial(FORMATS["abrp"].sample, telemetry_of(message), time.time())
    with each_fault(place):
        return json_response(await call.service.live.take(car, partial(with_places, read, place)))


def message_of(body: bytes, kind: str) -> dict[str, Any]:
    """Return the object of a body: JSON, or the fields of a form.

    Raises
    ------
    Problem
        `not-json`.
    InvalidInput
        For JSON that is not an object, and for a form that is not valid.

    Examples
    --------
    >>> message_of(b"token=abc&tlm=%7B%22utc%22%3A1%7D", "application/x-www-form-urlencoded")
    {'token': 'abc', 'tlm': '{"utc":1}'}
    """
    if kind != FORM:
        return json_object(body)
    try:
        return dict(parse_qsl(body.decode("utf-8"), max_num_fields=MAX_FORM_FIELDS))
    except ValueError as error:
        raise InvalidInput.of("not a form", "body", f"{error}"[:80], "the fields token and tlm") from error


def given_token(message: Mapping[str, Any], request: Request, of_query: str | None) -> str:
    """Return the token of a request: a bearer token, else a field of its message, else a parameter of its URL; empty if none."""
    kind, _, bearer = request.headers.get("authorization", "").partition(" ")
    candidates = (bearer.strip() if kind.lower() == "bearer" else "", message.get("token"), of_query)
    return next((token for token in candidates if isinstance(token, str) and token), "")


def telemetry_of(message: Mapping[str, Any]) -> Any:
    """Return the object `tlm` of a message, which may be JSON text; without `tlm`, the message itself.

    Raises
    ------
    Problem
        `not-json` if the text is not JSON.
    """
    message_part = message.get("tlm", message)
    return parse_json(message_part.encode(), "tlm: ") if isinstance(message_part, str) else message_part
