"""The service as an ASGI application: its endpoints, and the checks before a job runs in the worker pool."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import orjson
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.routing import Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Scope

import tripwatt
from tripwatt.errors import InvalidInput
from tripwatt.server.http import schemas
from tripwatt.server.http.car_endpoints import cars, live
from tripwatt.server.http.endpoints import forecasts, journeys, library, monitoring, routes
from tripwatt.server.http.fleet_endpoints import fleet
from tripwatt.server.http.middleware import ServiceMiddleware
from tripwatt.server.http.openapi import DESCRIPTION, describe_requests
from tripwatt.server.http.problems import Problem, problem_of
from tripwatt.server.http.service import Service, request_id
from tripwatt.server.http.settings import Settings

PAGE: Final = Path(__file__).with_name("page")
"""Folder of the built page."""

PROBLEM_KINDS: Final = {400: "bad-request", 404: "not-found", 405: "method-not-allowed"}
"""HTTP status of an error of the framework -> kind of problem."""

CORS_METHODS: Final = ("GET", "POST", "PUT", "DELETE")
CORS_HEADERS: Final = ("Authorization", "Content-Type", "If-None-Match", "X-Request-ID")
"""Methods and headers that a page of another origin may use in requests, beside those that a browser always allows."""

CORS_EXPOSED: Final = ("ETag", "Location", "Retry-After", "X-Request-ID")
"""Headers of a response that such a page may read, beside those that a browser always shows."""

Log = Callable[..., None]


class PageFiles(StaticFiles):
    """The files of the page. Names of assets contain a hash of the content, so that assets never change."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return the response with a file and its Cache-Control header."""
        response = await super().get_response(path, scope)
        is_asset = "/assets/" in scope["path"]
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable" if is_asset else "no-cache"
        return response


def create_app(settings: Settings | None = None, log: Log = lambda **record: None) -> ASGIApp:
    """Create the application; its workers start and stop with its lifespan.

    Parameters
    ----------
    settings : Settings, optional
    log : callable, optional
        Called with one record of the log as keywords; a record without `event` is that of a request.

    Raises
    ------
    InvalidInput
        When a model or a car on the road cannot be used.
    """
    settings = settings or Settings()
    service = Service(settings, log)
    # smaller bodies fit into one packet; higher levels take longer and hardly shrink series of numbers further
    packed = GZipMiddleware(_make_api(service), minimum_size=1000, compresslevel=4)
    app = ServiceMiddleware(packed, settings, service.metrics, log)
    if not settings.cors_origins:
        return app
    return CORSMiddleware(app, settings.cors_origins, CORS_METHODS, CORS_HEADERS, expose_headers=CORS_EXPOSED)


def _make_api(service: Service) -> FastAPI:
    """Make the application of a service, without the checks before it."""
    settings = service.settings
    routers = (forecasts, routes, journeys, library, monitoring, fleet, live, cars)
    app = FastAPI(
        title="tripwatt",
        version=tripwatt.__version__,
        summary="Forecasts the battery energy of an electric-car trip with a prediction interval.",
        description=DESCRIPTION,
        redirect_slashes=False,  # a redirect would name the host that the request names, without the path of a proxy
        openapi_url=None,  # an endpoint has it with its entity tag
        docs_url=None,  # the page of FastAPI loads scripts from another host
        redoc_url=None,
        servers=[{"url": settings.prefix}] if settings.prefix else None,
        lifespan=service.running,
        routes=[route for router in routers for route in router.routes],
    )
    app.state.service = service
    _add_handlers(app)
    describe_requests(app, with_token=bool(settings.token))
    _add_page(app)
    return app


def openapi_document() -> dict[str, Any]:
    """Return the OpenAPI document of a service with the model of the package."""
    return _make_api(Service(Settings(), lambda **record: None)).openapi()


def _add_page(app: FastAPI) -> None:
    """Add a route per file of the page; a mount at `/` would turn status 405 of other paths into 404."""
    files = PageFiles(directory=PAGE, check_dir=False)  # a page that is not built has no files

    async def respond(name: str, request: Request) -> Response:
        return await files.get_response(name, request.scope)

    for file in PAGE.glob("*.*"):
        path = "/" if file.name == "index.html" else f"/{file.name}"
        app.add_route(path, partial(respond, file.name), include_in_schema=False)
    app.mount("/assets", PageFiles(directory=PAGE / "assets", check_dir=False), name="assets")


def _add_handlers(app: FastAPI) -> None:
    """Answer every error with a problem document."""

    @app.exception_handler(Problem)
    @app.exception_handler(InvalidInput)
    async def on_problem(request: Request, error: Problem | InvalidInput) -> Response:
        return problem_of(error).response(request_id(request))

    @app.exception_handler(HTTPException)
    async def on_http(request: Request, error: HTTPException) -> Response:
        kind = PROBLEM_KINDS.get(error.status_code, "internal" if error.status_code >= 500 else "bad-request")
        headers = dict(error.headers or {})
        if error.status_code == 405:  # starlette names only the methods of a path's first route
            of_path = [r for r in app.routes if isinstance(r, Route) and r.path_regex.match(request.url.path)]
            methods = {method for route in of_path for method in route.methods or ()}
            headers["Allow"] = ", ".join(sorted(methods | ({"HEAD"} if "GET" in methods else set())))
        begun = f"{request.url.path.rstrip('/')}/{{"
        longer = [r.path for r in app.routes if isinstance(r, Route) and r.path.startswith(begun)]
        detail = f"the address goes on: {longer[0]}" if error.status_code == 404 and longer else ""
        return Problem(kind, detail, headers=headers).response(request_id(request))

    @app.exception_handler(RequestValidationError)
    async def on_parameters(request: Request, error: RequestValidationError) -> Response:
        described = app.openapi()["paths"][request.scope["route"].path][request.method.lower()]
        about = {row["name"]: row.get("description", "") for row in described["parameters"]}
        faults = [replace(fault, at=None) for fault in schemas.faults_of(error.errors(), about)]
        for k, fault in enumerate(faults):
            if fault.allowed.startswith("^"):  # a pattern, which the description has in words
                faults[k] = replace(fault, fix=about.get(fault.where.partition(".")[2], ""))
        return await on_problem(request, InvalidInput(faults))


if __name__ == "__main__":
    sys.stdout.buffer.write(orjson.dumps(openapi_document()))
