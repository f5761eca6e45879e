"""The service as an ASGI application."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import orjson
from fastapi import FastAPI, Request, Response
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool

import tripwatt
from tripwatt.errors import InvalidInput
from tripwatt.service.requests import NotJson
from tripwatt.service.settings import Settings
from tripwatt.service.work import Work, example_list, examples, vehicles
from tripwatt.forecast import load_metadata

PAGE: Final = Path(__file__).with_name("page")


def create_app(settings: Settings | None = None) -> FastAPI:
    settings = settings or Settings()
    work = Work.of(settings.models, settings.limits)
    app = FastAPI(title="tripwatt", version=tripwatt.__version__)

    def done(call: Any, *arguments: Any) -> Response:
        try:
            return Response(orjson.dumps(call(*arguments)), media_type="application/json")
        except NotJson as error:
            problem = {"title": "not JSON", "status": 400, "detail": str(error)}
        except InvalidInput as error:
            problem = {
                "title": "input cannot be used",
                "status": 422,
                "detail": str(error),
                "faults": [
                    {"what": f.what, "where": f.where, "got": f.got, "allowed": f.allowed, "fix": f.fix}
                    for f in error.faults
                ],
            }
        return Response(orjson.dumps(problem), problem["status"], media_type="application/problem+json")

    @app.post("/v1/forecast")
    async def forecast(request: Request) -> Response:
        return await run_in_threadpool(done, work.forecast, await request.body())

    @app.post("/v1/forecast/update")
    async def update(request: Request) -> Response:
        return await run_in_threadpool(done, work.update, await request.body())

    @app.post("/v1/routes")
    async def routes(request: Request, speed_m_s: float | None = None) -> Response:
        kind = "csv" if "csv" in request.headers.get("content-type", "") else "route"
        return await run_in_threadpool(done, work.route, await request.body(), kind, speed_m_s)

    @app.get("/v1/vehicles")
    async def get_vehicles() -> Response:
        return await run_in_threadpool(done, vehicles)

    @app.get("/v1/examples")
    async def get_examples() -> Response:
        return await run_in_threadpool(done, example_list)

    @app.get("/v1/examples/{trip}")
    async def get_example(trip: str) -> Response:
        return await run_in_threadpool(done, lambda: examples()[trip])

    @app.get("/v1/models")
    async def get_models() -> Response:
        rows = [{"name": n, **load_metadata(settings.models.get(n))} for n in work.models]
        return await run_in_threadpool(done, lambda: {"models": rows})

    if PAGE.is_dir():
        app.mount("/", StaticFiles(directory=PAGE, html=True))
    return app
