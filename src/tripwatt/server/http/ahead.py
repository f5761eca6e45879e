"""What is ahead of a car on the road: what its next trip needs, how far its charge carries, and the next kilometres."""

from __future__ import annotations

import contextlib
import datetime as dt
import time
from collections.abc import Awaitable, Mapping
from typing import Any, Final
from weakref import WeakKeyDictionary

import orjson

from tripwatt.errors import InvalidInput
from tripwatt.server.cars.car import Car
from tripwatt.server.http.journey_schemas import NeedQuery
from tripwatt.server.http.live import CAR_FIELDS, LiveCars, names_car
from tripwatt.server.http.pool import JobResult
from tripwatt.server.http.problems import Problem

NEED_S: Final = 600.0
"""Need and range are computed again after this time [s], because usual trips depend on the time of day. A choice."""

NEXT_KM: Final = (10.0, 50.0)
"""Distances ahead whose need is shown on a trip without a plan [km]. A choice: a town away, and the way to the next charging park."""


class Ahead:
    """What is ahead of the cars on the road, which are published with it.

    Parameters
    ----------
    cars : LiveCars

    Attributes
    ----------
    known : mapping of Car to tuple
        A car -> the state of which its need, its range and the next kilometres were computed, and these.
    """

    def __init__(self, cars: LiveCars) -> None:
        self.cars = cars
        self.known: WeakKeyDictionary[Car, tuple[tuple[Any, ...], dict[str, Any]]] = WeakKeyDictionary()
        cars.shown = self.document

    async def need(self, car: Car, query: NeedQuery) -> JobResult:
        """Return what the next trip of a car needs, as `NeedResponse`; reserve and temperature of the query replace those of the plan.

        Raises
        ------
        Problem
            `no-plan` if there is neither a plan nor a usual trip.
        """
        departs_at = query.departs_at or dt.datetime.fromtimestamp(time.time(), dt.UTC)
        plan = await self.cars.run(car.plan_at, departs_at.timestamp())
        if plan is None:
            raise Problem("no-plan", "no plan, and no earlier trip at this time of day")
        changed = query.model_dump(include={"reserve", "ambient_temperature_degc"}, exclude_unset=True)
        job = await self._job_about(car, {**plan.request, **changed, "departs_at": departs_at})
        # only the charge of the plan is that of the departure
        soc, job["last_message"]["soc"] = job["last_message"]["soc"], None
        asked = query.model_dump(include={"probability", "plug_w"})
        asked["soc"] = None if car.trip is not None else soc
        options = {"asked": asked, "usual_trip": plan.usual_trip}
        body = job.pop("body")
        return await self.cars.pool.run({"kind": "need", "options": options, **job}, body)

    async def _job_about(self, car: Car, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters of a job about a car: `body` is the request with the own model, `last_message` what the last messages show."""
        request = self.cars.with_own_model(car, request)
        shown = await self.cars.last_message(car)
        if not names_car(request):
            shown["last_message"]["undescribed"] = car.name
        return {"body": orjson.dumps(request), **shown}

    async def job_without_road(self, car: Car, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters of a job for the range of a car or the need of a distance.

        A car that the plan names replaces the model of the car.
        """
        request = {} if car.plan is None else {name: car.plan.request.get(name) for name in CAR_FIELDS}
        if isinstance(request.get("car"), Mapping):
            request["car"] = orjson.dumps(request["car"]).decode()
        return await self._job_about(car, {**request, **fields})

    async def _without_road(self, car: Car, kind: str, **fields: Any) -> dict[str, Any] | None:
        """Return the answer of a job about a car without a road; None if the job fails or refuses its input."""
        job = {"kind": kind, **await self.job_without_road(car, fields)}
        return await _or_none(self.cars.pool.run(job, job.pop("body")))

    async def document(self, car: Car) -> dict[str, Any]:
        """Return the document of a car with what is ahead of it, as `LiveCarDocument` with all of its fields."""
        document = await self.cars.document(car)
        state = (*car.live_state[1:], document["soc"], time.time() // NEED_S)
        if car not in self.known or self.known[car][0] != state:
            next_km = NEXT_KM * (car.trip is not None and document["forecast"] is None)
            ahead = [await self._without_road(car, "distance", distance_km=km) for km in next_km]
            needed = None if car.trip else await _or_none(self.need(car, NeedQuery.model_validate({})))
            range_ = None if document["soc"] is None else await self._without_road(car, "range")
            self.known[car] = state, {"need": needed, "range": range_, "next": [one for one in ahead if one]}
        return {**document, **self.known[car][1]}

    async def shown(self, car: Car, include: str | None) -> dict[str, Any]:
        """Return the document of a car with the fields of `include`, names with commas, of what is ahead of it."""
        if include is None:
            return await self.cars.document(car)
        left_out = {"need", "range", "next"} - {*include.split(",")}
        return {name: value for name, value in (await self.document(car)).items() if name not in left_out}


async def _or_none(result: Awaitable[JobResult]) -> dict[str, Any] | None:
    """Return the document of a job; None if the job fails or refuses its input."""
    with contextlib.suppress(Problem, InvalidInput):
        finished = await result
        return orjson.loads(finished.content) if finished.status == 200 else None
    return None
