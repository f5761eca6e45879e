"""Cars on the road: their messages, the plan of their trip, its forecast, and a stream of forecasts for listeners.

This process keeps the messages; the worker pool forecasts, as for any other request.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import orjson
import pandas as pd
from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from tripwatt.errors import Fault, InvalidInput
from tripwatt.live import LiveCar, Sample, is_car, is_live_car, open_live_car
from tripwatt.live.live_car import digest_of, token_digest
from tripwatt.live.usual import road_of
from tripwatt.service.library import fields_of
from tripwatt.service.openapi import EVENTS
from tripwatt.service.pool import JobResult, WorkerPool
from tripwatt.service.problems import Problem, fault_document, invalid_input
from tripwatt.service.settings import Limits
from tripwatt.trips.departure import SIGNALS, TEMPERATURES

SILENCE_CHECK_S: Final = 30.0
"""Time between two looks for cars that became silent."""

KEEP_ALIVE_S: Final = 15.0
"""A stream without news sends a comment after so long, so that no proxy closes it."""

SHOWN: Final = ("0.05", "0.5", "0.95")
"""Probabilities of the quantiles of a live forecast."""

LOW, HIGH = SHOWN[0], SHOWN[-1]
"""Ends of the 90 % interval."""

DEFAULT_RESERVE: Final = 0.1

CAR_FIELDS: Final = ("model", "vehicle", "vehicle_figures")
"""Fields of a request that name a car or a model."""

FROM_MESSAGES: Final = ("soc", *TEMPERATURES)
"""Fields of a departure that a car's messages fill in where the plan lacks them."""


@dataclass(eq=False)
class LiveVehicle:
    """A car and the last forecast of its trip.

    Attributes
    ----------
    car : LiveCar
    of : tuple
        What the forecast was made of: number of messages, of plans, and the start of the trip.
    forecast : dict or None
        As `LiveForecastDocument`.
    faults : tuple of dict
        Why the last messages are not in it.
    usual : tuple of str and mapping
        Name of the usual trip, and its road as fields of a request.
    dropped : bool
        Whether the service follows it no longer.
    """

    car: LiveCar
    lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    plans: int = 0
    of: tuple[Any, ...] = ()
    forecast: dict[str, Any] | None = None
    faults: tuple[dict[str, Any], ...] = ()
    usual: tuple[str, Mapping[str, Any]] = ("", MappingProxyType({}))
    dropped: bool = False

    @property
    def plan(self) -> Mapping[str, Any] | None:
        """The request of the plan that was given, else of the road of the usual trip."""
        if self.car.plan is not None:
            return self.car.plan.request
        trip = self.car.usual_trip()
        if trip is None:
            return None
        if self.usual[0] != trip.trip_id:
            road = road_of(trip)
            self.usual = trip.trip_id, {} if road is None else fields_of(road)
        return self.usual[1] or None

    def by_own_model(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """A request with the model that the car's own trips teach, unless the request names a car or a model."""
        named = any(request.get(name) is not None for name in CAR_FIELDS)
        return (
            dict(request)
            if named or not is_car(self.car.folder.parent)
            else {**request, "model": self.car.name}
        )

    @property
    def state(self) -> tuple[Any, ...]:
        """What a forecast depends on."""
        trip = self.car.trip
        return self.car.counts["new"], self.plans, trip is not None and trip.start_s, self.car.plan is None


class LiveCars:
    """The cars of a folder and the forecasts of their trips.

    Parameters
    ----------
    folder : Path
        Its sub-folders are cars with a token.
    pool : WorkerPool
    limits : Limits
    log : callable
        Called with one record of the log as keywords.
    keep_days : float, optional
        As of `open_live_car`.

    Raises
    ------
    InvalidInput
        When there is no such folder, or a car with a token cannot be opened.
    """

    def __init__(
        self,
        folder: Path,
        pool: WorkerPool,
        limits: Limits,
        log: Callable[..., None],
        keep_days: float = math.inf,
    ) -> None:
        self.pool, self.limits, self.log, self.keep_days = pool, limits, log, keep_days
        self.vehicles: dict[str, LiveVehicle] = {}
        self._by_digest: dict[str, LiveVehicle] = {}
        self.listeners = 0
        self._ending = asyncio.Event()
        if not folder.is_dir():
            fix = "make it; cars are made in it on the page or by `tripwatt car new`"
            raise InvalidInput(Fault("no folder of cars", "--cars", f"{folder}", "a folder", fix))
        for place in sorted(place for place in folder.iterdir() if is_live_car(place)):
            self.open(place)

    def open(self, place: Path) -> None:
        """Follow the car of a folder; of one that is followed already, only its token is read again.

        Raises
        ------
        InvalidInput
            When the car cannot be opened.
        """
        found = self.vehicles.get(place.name) or LiveVehicle(open_live_car(place, keep_days=self.keep_days))
        self.vehicles[place.name] = found
        self._by_digest = {digest: car for digest, car in self._by_digest.items() if car is not found}
        self._by_digest[token_digest(place) or ""] = found

    def drop(self, name: str) -> None:
        """Follow a car no longer."""
        found = self.vehicles.pop(name, None)
        if found is not None:
            self._by_digest = {digest: car for digest, car in self._by_digest.items() if car is not found}
            found.dropped = True
            found.car.close()

    def by_name(self, name: str) -> LiveVehicle:
        """The car of this name.

        Raises
        ------
        Problem
            `not-found`.
        """
        if name not in self.vehicles:
            raise Problem("not-found", "no such car")
        return self.vehicles[name]

    def by_token(self, token: str) -> LiveVehicle:
        """The car whose token this is. What is looked up is a digest, so that the time tells nothing of the token.

        Raises
        ------
        Problem
            `token-needed`.
        """
        found = self._by_digest.get(digest_of(token)) if token else None
        if found is None:
            challenge = {"WWW-Authenticate": 'Bearer realm="tripwatt"'}
            raise Problem("token-needed", "the token of a car: `token`, or a bearer token", headers=challenge)
        return found

    def take(self, vehicle: LiveVehicle, sample: Sample) -> dict[str, Any]:
        """Store a message of a car.

        Returns
        -------
        dict
            As `TelemetryResponse`.

        Raises
        ------
        Problem
            `invalid-input` for a time in the future, `busy` where it cannot be stored.
        """
        try:
            arrival = vehicle.car.add(sample)
        except InvalidInput as error:
            raise invalid_input(error.faults) from error
        except OSError as error:
            raise self._not_stored("message", vehicle, error) from error
        ignored = [fault_document(fault) for fault in sample.faults]
        return {"status": "ok", "vehicle": vehicle.car.name, "arrival": arrival, "ignored": ignored}

    async def set_plan(self, vehicle: LiveVehicle, request: dict[str, Any]) -> JobResult:
        """Give a car the plan of its trip, if it can be forecast.

        Parameters
        ----------
        vehicle : LiveVehicle
        request : dict
            A `ForecastRequest`, and `departure_utc` within its bounds.

        Returns
        -------
        JobResult
            Of the forecast at departure; the plan is taken when its status is 200.
        """
        plan = {name: value for name, value in request.items() if name != "departure_utc"}
        result = await self.pool.run({"kind": "forecast"}, orjson.dumps(vehicle.by_own_model(plan)))
        if result.status == 200:
            try:
                vehicle.car.set_plan(plan, request.get("departure_utc"))
            except OSError as error:
                raise self._not_stored("plan", vehicle, error) from error
            vehicle.plans += 1
        return result

    def _not_stored(self, what: str, vehicle: LiveVehicle, error: OSError) -> Problem:
        self.log(event=f"{what} not stored", vehicle=vehicle.car.name, error=f"{error}"[:200])
        return Problem("busy", f"the {what} cannot be stored; send it again", headers={"Retry-After": "10"})

    async def document(self, vehicle: LiveVehicle) -> dict[str, Any]:
        """A car and the latest forecast of its trip, as `LiveResponse`. One forecast of a car is made at a time."""
        async with vehicle.lock:
            if vehicle.of != vehicle.state:
                await self._forecast(vehicle)
        return {
            **vehicle.car.about(time.time()),
            "plan": "given" if vehicle.car.plan is not None else "usual" if vehicle.forecast else None,
            "usual_trip": vehicle.usual[0] if vehicle.car.plan is None and vehicle.forecast else None,
            "forecast": vehicle.forecast,
            "faults": list(vehicle.faults),
        }

    async def _forecast(self, vehicle: LiveVehicle) -> None:
        """Forecast the trip of a car; of messages that are refused, the forecast before them stays."""
        state, plan = vehicle.state, vehicle.plan
        if plan is None:
            vehicle.of, vehicle.forecast, vehicle.faults = state, None, ()
            return
        request = vehicle.by_own_model(with_departure(plan, vehicle.car))
        observed = vehicle.car.observed()
        kind = "forecast" if len(observed) < 2 else "update"
        if kind == "update":
            request["observed"] = observed_columns(observed, plan)
        result = await self.pool.run({"kind": kind}, orjson.dumps(request, option=orjson.OPT_SERIALIZE_NUMPY))
        found = orjson.loads(result.content)
        if result.status == 200:
            new = shown(found, request.get("reserve", DEFAULT_RESERVE))
            self._keep_on_the_way(vehicle, state, new)
            vehicle.forecast, vehicle.faults = new, ()
        else:
            if vehicle.of[1:] != state[1:]:  # the last forecast is of another trip or plan
                vehicle.forecast = None
            vehicle.faults = tuple(found.get("faults", [{"what": found["title"], "where": "forecast"}]))
        vehicle.of = state

    def _keep_on_the_way(self, vehicle: LiveVehicle, state: tuple[Any, ...], new: Mapping[str, Any]) -> None:
        """Keep forecasts for the diary: the one before the trip as that of its departure, and the new one."""
        car, before = vehicle.car, vehicle.forecast
        try:
            # of the same plan, when the car was on no trip
            if before is not None and vehicle.of[1:3] == (state[1], False):
                car.keep_forecast(before["energy_wh"], *ends_of(before), departing=True)
            car.keep_forecast(new["energy_wh"], *ends_of(new))
        except OSError as error:
            self._not_stored("forecast", vehicle, error)

    async def need(
        self, vehicle: LiveVehicle, probability: float, departure_s: float, known: Mapping[str, float]
    ) -> JobResult | dict[str, Any]:
        """What the next trip of a car needs, as `NeedResponse`; the result of a job that was refused.

        Parameters
        ----------
        vehicle : LiveVehicle
        probability : float
            0.5 to 1.
        departure_s : float
            When it leaves, for a trip without a plan [s since 1970].
        known : mapping of str to float
            Fields of the request that take the place of those of the plan.

        Raises
        ------
        Problem
            `not-found` without a plan and a usual trip.
        """
        car, usual = vehicle.car, None
        if car.plan is not None:
            request = dict(car.plan.request)
        else:
            usual = car.usual_trip_at(departure_s)
            road = None if usual is None else road_of(usual)
            if road is None:
                raise Problem("not-found", "no plan, and no earlier trip at this time of day")
            request = fields_of(road)
        soc = car.departure().soc if car.trip is None else None
        job = {"kind": "need", "probability": probability}
        result = await self.pool.run(job, orjson.dumps(vehicle.by_own_model({**request, **known})))
        if result.status != 200:
            return result
        found = orjson.loads(result.content)
        missing_wh = (
            None if soc is None else max(0.0, min(found["soc_needed"], 1.0) - soc) * found["wh_per_display"]
        )
        return {
            "vehicle": car.name,
            "plan": "given" if usual is None else "usual",
            "usual_trip": None if usual is None else usual.trip_id,
            "probability": probability,
            **found,
            "soc": soc,
            "charge_wh": missing_wh,
        }

    def list(self) -> dict[str, Any]:
        """The cars, as `LiveCarsResponse`."""
        now_s = time.time()
        rows = [found.car.about(now_s) for _, found in sorted(self.vehicles.items())]
        names = ("vehicle", "seconds_since_message")
        return {
            "vehicles": [{**{n: row[n] for n in names}, "on_trip": row["trip"] is not None} for row in rows]
        }

    def listen(self) -> None:
        """Take a place for a listener.

        Raises
        ------
        Problem
            `busy` when all are taken.
        """
        if self.listeners >= self.limits.listeners:
            raise Problem("busy", "too many listeners", headers={"Retry-After": "30"})
        self.listeners += 1

    def leave(self) -> None:
        """Free the place of a listener."""
        self.listeners -= 1

    async def events(self, vehicle: LiveVehicle) -> AsyncIterator[bytes]:
        """The forecasts of a car as server-sent events: at once, and then after new messages.

        Yields
        ------
        bytes
            An event `live` whose data is a `LiveResponse`, or a comment.
        """
        sent: tuple[Any, ...] | None = None
        idle_s = 0.0
        while not (self._ending.is_set() or vehicle.dropped):
            if sent != vehicle.state:
                sent, idle_s = vehicle.state, 0.0
                try:
                    yield event(await self.document(vehicle))
                except Problem as problem:
                    sent = None
                    yield b": " + problem.kind.encode() + b"\n\n"
            elif idle_s >= KEEP_ALIVE_S:
                idle_s = 0.0
                yield b": no news\n\n"
            await self._pause(self.limits.live_every_s)
            idle_s += self.limits.live_every_s

    async def _pause(self, seconds: float) -> None:
        try:
            async with asyncio.timeout(seconds):
                await self._ending.wait()
        except TimeoutError:
            return

    def end_streams(self) -> None:
        """End all streams of events: a shutdown does not wait for listeners."""
        self._ending.set()

    async def watch(self) -> None:
        """End the trips of cars that became silent, and make the forecasts that diaries keep, until this is cancelled."""
        while True:
            for vehicle in self.vehicles.values():
                try:
                    vehicle.car.end_when_silent(time.time())
                except OSError as error:
                    self._not_stored("trip", vehicle, error)
            for vehicle in [*self.vehicles.values()]:
                if vehicle.car.wants_forecast and not vehicle.dropped:
                    with contextlib.suppress(Problem):  # the next look comes soon
                        await self.document(vehicle)
            await asyncio.sleep(SILENCE_CHECK_S)

    def close(self) -> None:
        """Leave the cars to another process."""
        for vehicle in self.vehicles.values():
            vehicle.car.close()


class EventResponse(StreamingResponse):
    """A stream of server-sent events.

    Parameters
    ----------
    events : async iterator of bytes
    on_end : callable
        Called once, when the stream has ended or the client has gone.
    """

    def __init__(self, events: AsyncIterator[bytes], on_end: Callable[[], None]) -> None:
        # identity: a compressed stream would wait for more
        headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no", "Content-Encoding": "identity"}
        super().__init__(events, media_type=EVENTS, headers=headers)
        self.on_end = on_end

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the response."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self.on_end()


def event(document: Mapping[str, Any]) -> bytes:
    r"""A server-sent event.

    Examples
    --------
    >>> event({"vehicle": "leaf"})
    b'event: live\ndata: {"vehicle":"leaf"}\n\n'
    """
    return b"event: live\ndata: " + orjson.dumps(document) + b"\n\n"


def with_departure(request: Mapping[str, Any], car: LiveCar) -> dict[str, Any]:
    """A request for a forecast; what it leaves unknown of the departure is what the car's messages show."""
    found, shown_by = dict(request), car.departure()
    logged = request.get("samples") or {}
    if found.get("displayed_soc") is None:
        found.pop("displayed_soc", None)
    for name in FROM_MESSAGES:
        given = found.get(name) is not None or (name == "soc" and "displayed_soc" in found)
        if not given and SIGNALS[name] not in logged and not (name == "soc" and "soc" in logged):
            value = getattr(shown_by, name)
            if value is not None:
                found[name] = value
    return found


def observed_columns(observed: pd.DataFrame, request: Mapping[str, Any]) -> dict[str, Any]:
    """The measurements of an update, on the clock of the request's samples."""
    columns = {name: np.ascontiguousarray(observed[name].to_numpy()) for name in observed.columns}
    samples = request.get("samples")
    if samples is not None:
        columns["time_s"] = columns["time_s"] + float(samples["time_s"][0])
    return columns


def shown(forecast: Mapping[str, Any], reserve: float) -> dict[str, Any]:
    """What of a forecast a listener gets, as `LiveForecastDocument`."""
    return {
        "energy_wh": forecast["energy_wh"],
        "quantiles_wh": {name: forecast["quantiles_wh"][name] for name in SHOWN},
        "soc_arrival": forecast["soc_arrival"],
        "soc_quantiles": {name: forecast["soc_quantiles"][name] for name in SHOWN},
        "reserve": reserve,
        "p_arrive": forecast["p_arrive"][f"{reserve:g}"],
        "p_arrive_at_all": forecast["p_arrive"]["0"],
        "measured_until_s": forecast["measured_until_s"],
        "distance_m": forecast["series"]["distance_m"][-1],
    }


def ends_of(forecast: Mapping[str, Any]) -> tuple[float, float]:
    """The ends of the 90 % interval of a forecast that is shown [Wh]."""
    return forecast["quantiles_wh"][LOW], forecast["quantiles_wh"][HIGH]
