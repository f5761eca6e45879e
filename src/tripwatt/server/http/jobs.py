"""The jobs of a worker: pure functions from the body of a request to a document, without HTTP."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, Final, get_type_hints

from cachetools import LRUCache, cached

from tripwatt.certification import describe_car
from tripwatt.errors import Fault, InvalidInput, each_fault, places_named, require_one
from tripwatt.fleet.registry import FollowedModel, is_registry
from tripwatt.forecasting import Forecast, ForecastModel, load_model
from tripwatt.forecasting.leaving import leave_with
from tripwatt.forecasting.storage import DEFAULT_MODEL
from tripwatt.population.cars import for_car
from tripwatt.roads.advice import advise
from tripwatt.roads.advice.preheating import need_before_departure
from tripwatt.roads.journey import Atlas, range_km
from tripwatt.server.cars.documents import require_plausible
from tripwatt.server.http import journey_schemas as journey
from tripwatt.server.http import schemas
from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.car_schemas import LivePlanRequest, NewCarRequest
from tripwatt.server.http.fleets import (
    follow_registry,
    model_summary,
    night,
    vehicle_model,
)
from tripwatt.server.http.journeys import JourneyJobs
from tripwatt.server.http.library import describe_vehicle, example, example_summaries, vehicles
from tripwatt.server.http.route_uploads import read_route, road_fields
from tripwatt.server.http.settings import Limits
from tripwatt.sources.sample import sample_trips
from tripwatt.trips import Departure, Flag, Plan
from tripwatt.trips.messages import flag_to_dict
from tripwatt.vehicles import Vehicle, find_vehicles, require_vehicle

MAX_TRANSFERRED: Final = 64
"""Most models on other cars that a worker keeps; the least recently used is dropped first. A choice."""

PARAMETER_TYPES: Final = cached(LRUCache(256))(get_type_hints)
"""Types of the parameters of a job by name, which take a while to find."""

Known = Mapping[str, Any]
NOTHING: Final[Known] = {}
"""What the last messages of a car show, or nothing."""


@dataclass(frozen=True)
class Jobs:
    """The models of the service and the jobs that use them.

    Attributes
    ----------
    models : mapping of str to ForecastModel
        Models of one car that requests may name; the first is the default.
    limits : Limits
    journeys : JourneyJobs
        The atlas of the service.
    cars : CarJobs
        Cars whose models requests may name as well.
    fleets : mapping of str to FollowedModel
        Models of fleets that requests may name; without `models` the first is the default.
    folders : mapping of str to Path
        Folders of models and registries, by name.
    transferred : LRUCache
        Models transferred to other cars, made when first used, by model and car.
    """

    models: Mapping[str, ForecastModel]
    limits: Limits
    journeys: JourneyJobs = field(default_factory=JourneyJobs)
    cars: CarJobs = field(default_factory=CarJobs)
    fleets: Mapping[str, FollowedModel] = field(default_factory=dict)
    folders: Mapping[str, Path] = field(default_factory=dict)
    transferred: LRUCache[tuple[str, str | None], ForecastModel] = field(
        default_factory=lambda: LRUCache(MAX_TRANSFERRED)
    )

    @classmethod
    def from_folders(
        cls,
        folders: Mapping[str, Path],
        limits: Limits,
        atlas: Atlas | None = None,
        cars: Path | None = None,
        log: Callable[..., None] = lambda **record: None,
    ) -> Jobs:
        """Load the models.

        Parameters
        ----------
        folders : mapping of str to Path
            Name -> folder of a model or of a registry; empty for the model of the package.
        limits : Limits
        atlas : Atlas, optional
            The map of the service.
        cars : Path, optional
            Folder of the cars.
        log : callable, optional
            Called with what happened to the models of fleets as keywords.
        """
        fleets = {
            name: follow_registry(name, folder, log)
            for name, folder in folders.items()
            if is_registry(folder)
        }
        models = {name: load_model(folder) for name, folder in folders.items() if name not in fleets}
        if not folders:
            models = {DEFAULT_MODEL: load_model()}
        heights = None if atlas is None else atlas.heights
        return cls(models, limits, JourneyJobs(atlas), CarJobs(cars, heights), fleets, folders)

    def warm_up(self) -> None:
        """Compute one forecast per model, so that the first request takes no longer than the others."""
        plan = Plan.from_trip(sample_trips().trips[0])
        for name in (*self.models, *self.fleets):
            self.model_named({"model": name}).forecast(plan).to_dict()

    def run(self, kind: str, body: bytes = b"", **parameters: Any) -> dict[str, Any] | bytes:
        """Run a job.

        Parameters
        ----------
        kind : str
            Name of a method, such as `forecast` or `cars.show`. A method with a parameter `request` gets the checked body.
        body : bytes
            Body of the request.
        **parameters : object
            Parameters of the method; those that the method lacks are ignored.

        Returns
        -------
        dict or bytes
            The document of the response; the bytes of a tile.

        Raises
        ------
        InvalidInput, Problem
            When the body is wrong.
        """
        work: Callable[..., dict[str, Any] | bytes] = attrgetter(kind)(self)
        types = PARAMETER_TYPES(work)
        asked = types.get("request", LivePlanRequest if "document" in types else None)
        document = None if asked is None else schemas.parse_json(body)
        arguments = {**parameters, "body": body, "document": document}
        fields = {*getattr(asked, "model_fields", ()), *(document if isinstance(document, Mapping) else ())}
        in_query = asked in (journey.NeedQuery, journey.RangeQuery)  # parameters of a URL
        with each_fault(partial(schemas.placed, fields=fields, body=document, in_query=in_query)):
            if "request" in types:
                request = schemas.check_request(document, types["request"], self)
                arguments["request"] = _with_charge(request, parameters.get("last_message") or {})
            return work(**{name: arguments[name] for name in types if name in arguments})

    def forecast(self, request: schemas.ForecastRequest) -> dict[str, Any]:
        """Forecast a trip from a speed trace or from the links of a planned route."""
        forecast, probability = self._make_forecast(request), request.probability
        leave_document = None if probability is None else leave_with(forecast, request.reserve, probability)
        return require_finite(forecast.to_dict(request.reserve, leave_document))

    def update(self, request: schemas.UpdateRequest) -> dict[str, Any]:
        """Update the forecast of a trip with the samples measured so far."""
        return self.forecast(request)

    def route(self, body: bytes, speed_m_s: float | None) -> dict[str, Any]:
        """Return the response to the upload of a route."""
        return read_route(body, speed_m_s, self.limits)

    def with_road(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of a request with the road of its `route` as `links` with `elevation`, or as `samples`."""
        others = {name: value for name, value in given.items() if name not in ("route", "speed_m_s")}
        return others | road_fields(given["route"], given.get("speed_m_s"), self.limits)

    def live_plan(self, document: dict[str, Any]) -> dict[str, Any]:
        """Return a `LivePlanRequest` with its road as `with_road`, if it can be forecast; that of `stops` is the fastest one between them."""
        if document.get("stops") is not None:
            fields = {name: document[name] for name in journey.PlanRequest.model_fields if name in document}
            fields |= {"answers": False, "charge": False}
            route = self.plan(schemas.check_request(fields, journey.PlanRequest, self))
            document = {"destination": route["stops"][-1]["name"], **document, "stops": None, "route": route}
        self.forecast(schemas.check_request(document, LivePlanRequest, self))
        return document if document.get("route") is None else self.with_road(document)

    night = night

    def difference(self, request: schemas.DifferenceRequest) -> dict[str, Any]:
        """Compare two trips of one car: what both share cancels, and the difference has an interval of its own."""
        one, other = schemas.both(request, self._make_forecast)
        return one.difference(other).to_dict()

    def journey_difference(self, request: journey.JourneyDifferenceRequest) -> dict[str, Any]:
        """Compare two journeys of one car with the time and energy of their stops to charge, as `POST /v1/forecast/difference` does trips."""
        return self.journeys.difference(request, self.model_of)

    def advice(self, request: schemas.AdviceRequest) -> dict[str, Any]:
        """Return what to do about a trip: the least that helps, and what each action saves."""
        forecast, now = self._make_forecast(request), dt.datetime.now(dt.UTC)
        return advise(forecast, reserve=request.reserve, probability=request.probability, now=now).to_dict()

    def need(self, request: LivePlanRequest, options: Known, last_message: Known) -> dict[str, Any]:
        """Return what the next trip of a car on the road needs, as `NeedResponse`; `request` is its plan."""
        plan = request.plan(self.limits, measured=options["usual_trip"] is not None)
        departure = plan.departure.merge(schemas.departure_of(request))
        about = {"car": last_message["car"], "usual_trip": options["usual_trip"]}
        asked = {"model": self.model_of(request), "reserve": request.reserve, **options["asked"]}
        return _needed(plan, "trip", departure, last_message, about, **asked)

    def plan(self, request: journey.PlanRequest) -> dict[str, Any]:
        """Plan a journey: roads, their forecasts, the charge to leave with, a charging stop."""
        document = self.journeys.plan(request, self.model_of(request))
        for road in document["roads"]:
            require_finite(road["forecast"])
        return document

    def journey_advice(self, request: journey.JourneyAdviceRequest) -> dict[str, Any]:
        """Return what to do about a journey with its charging stops: the least that helps, what each action saves, and the time in all."""
        return self.journeys.advice(request, self.model_of(request))

    def reach(self, request: journey.ReachRequest) -> dict[str, Any]:
        """Return the area that the charge reaches with 95 % and with 50 %."""
        return self.journeys.reach(request, self.model_of(request))

    def distance(self, request: journey.NeedQuery, last_message: Known = NOTHING) -> dict[str, Any]:
        """Return the response to a `NeedQuery`."""
        trip, distance_km, car = request.trip, request.distance_km, request.named
        require_one("distance_km, trip", distance_km, trip)
        if trip is not None and car is None:
            raise InvalidInput.of("a trip without its car", "car", "none", "the car of the trip")
        ahead: Any = distance_km if trip is None else self.cars.car(f"{car}").usual_plan(trip)
        asked = request.model_dump(include={"probability", "trips", "reserve", "plug_w"})
        own = car if self.cars.model(car or "") else last_message.get("car")
        about = {"usual_trip": trip} | ({} if own is None else {"car": own})
        asked["model"] = self.model_of(request)
        return _needed(ahead, request.kind, schemas.departure_of(request), last_message, about, **asked)

    def range(self, request: journey.RangeQuery, last_message: Known = NOTHING) -> dict[str, Any]:
        """Return the response to a `RangeQuery`."""
        model = self.model_of(request)
        departure, flags = _with_last_message(schemas.departure_of(request), last_message, model.vehicle)
        range_ = range_km(None, request.kind, departure, reserve=request.reserve, model=model)
        return replace(range_, flags=(*flags, *range_.flags)).to_dict()

    def _make_forecast(self, request: schemas.ForecastRequest) -> Forecast:
        """Return the forecast of a request, updated with the observed samples of an `UpdateRequest`."""
        plan = request.plan(self.limits)
        departure = plan.departure.merge(schemas.departure_of(request))
        forecast = self.model_of(request).forecast(replace(plan, trip_id=request.trip), departure)
        return forecast.update(request.observed) if isinstance(request, schemas.UpdateRequest) else forecast

    def require_known(self, field: str, name: str) -> None:
        """Check that the `model` or the `car` of a request exists; a path of a file is no name of a car.

        Raises
        ------
        InvalidInput
            When there is no such model or car.
        """
        models = (*self.models, *self.fleets)
        if field == "model" and name not in models:
            raise InvalidInput(Fault.unknown("unknown model", "model", name, models))
        fitted = {model.vehicle.name for model in self.models.values()}
        if field == "car" and name not in fitted and not self.cars.model(name) and not self._fleet_with(name):
            with places_named({"vehicle": "car"}):
                require_vehicle(name, [folder.name for folder in self.cars.folders()])

    def _fleet_with(self, car: Any) -> str | None:
        """Return the first fleet that has a vehicle of this name; None if there is none."""
        fleets = self.fleets.items() if isinstance(car, str) else ()
        return next((name for name, fleet in fleets if car in fleet.get().vehicles()), None)

    def model_named(self, document: Mapping[str, Any]) -> ForecastModel:
        """Return the model for the car that a document names, as `model_of` for the fields of a `CarRequest`."""
        fields = {name: document[name] for name in schemas.CarRequest.model_fields if name in document}
        return self.model_of(schemas.check_request(fields, schemas.CarRequest, self))

    def model_of(self, request: schemas.CarRequest) -> ForecastModel:
        """Return the model of the car that a request names: its own, that of its fleet, or another one transferred to it.

        Raises
        ------
        InvalidInput
            When the request names a model beside a car that has its own, or a driver without a fleet.
        """
        car, name = request.car, request.model
        learned = self.cars.model(car) if isinstance(car, str) else None
        if learned is not None and (name, request.driver) != (None, None):
            got = f"{name or request.driver} beside {car}"
            raise InvalidInput.of("the car has its own model", "model, driver", got, "neither of them")
        if learned is not None:
            return learned
        name = name or self._fleet_with(car) or next(iter((*self.models, *self.fleets)))
        if name in self.fleets:
            return vehicle_model(self.fleets[name].get(), request)
        if request.driver is not None:
            raise InvalidInput.of("no fleet", "driver", f"a model of one car, {name}", "the model of a fleet")
        fitted = self.models[name]
        if car is None:
            return fitted
        key = name, car if isinstance(car, str) else car.model_dump_json()
        made = self.transferred.get(key) or for_car(fitted, described(car))
        if made is not fitted:
            self.transferred[key] = made
        return made

    def describe(self, request: schemas.VehicleFigures) -> dict[str, Any]:
        """Describe a car that the library does not have, by a few figures."""
        return describe_vehicle(describe_car(**request.model_dump()))

    def new_car(self, request: NewCarRequest) -> dict[str, Any]:
        """Make the car of a `NewCarRequest`, and return it."""
        if request.name in (*self.models, *self.fleets):
            raise InvalidInput.of("name is taken", "name", request.name, "a name that no model has")
        if isinstance(request.car, str):
            self.require_known("car", request.car)
        return self.cars.create(request.name, described(request.car))

    examples = staticmethod(example_summaries)
    example = staticmethod(example)

    def summaries(self) -> dict[str, Any]:
        """Return the models with their inputs, provenance and scores; the first is the default."""
        names, folders, fleets = (*self.models, *self.fleets), self.folders, self.fleets
        return {"models": [{"name": n, **model_summary(folders.get(n), fleets.get(n))} for n in names]}

    def vehicles(self, search: str | None = None) -> dict[str, Any]:
        """Return the cars of the library, or those that the words of `search` find, each with the models fitted on its trips."""
        cars = {name: {model.vehicle.name} for name, model in self.models.items()}
        cars |= {name: {*fleet.get().vehicles().values()} for name, fleet in self.fleets.items()}
        by_name = {row["name"]: row for row in vehicles()}
        names = tuple(by_name) if search is None else find_vehicles(search)
        rows = [{**by_name[n], "models": [model for model in cars if n in cars[model]]} for n in names]
        return {"vehicles": rows}


def described(car: schemas.VehicleFigures | str) -> Vehicle | str:
    """Return the vehicle that the figures of a request describe; the name of a car stays as it is."""
    return car if isinstance(car, str) else describe_car(**car.model_dump())


def require_finite(forecast: Mapping[str, Any]) -> dict[str, Any]:
    """Check that all values of a forecast are finite, because JSON has no other numbers.

    Parameters
    ----------
    forecast : mapping
        A forecast as `Forecast.to_dict` returns it.

    Returns
    -------
    dict
        The same values.

    Raises
    ------
    InvalidInput
        When a value is not finite: no car can drive the trip.
    """
    scalars = [forecast["energy_wh"], forecast["soc_arrival"], forecast["battery_loss_wh"]]
    by_name = (forecast[name].values() for name in ("quantiles_wh", "p_arrive_by_soc"))
    require_plausible(*(sum(values) for values in (scalars, *by_name, *forecast["series"].values())))
    return dict(forecast)


def _needed(
    ahead: Any, kind: str, departure: Departure, last_message: Known, about: dict[str, Any], **asked: Any
) -> dict[str, Any]:
    """Return the `NeedResponse` of a distance or a trip; `asked` are further arguments of `need_before_departure`."""
    departure, flags = _with_last_message(departure, last_message, asked["model"].vehicle)
    needed, document = need_before_departure(ahead, kind, departure, **asked)
    require_plausible(needed.energy_wh, needed.energy_quantile_wh, needed.soc_needed)
    return {**document, **about, "flags": [*map(flag_to_dict, flags), *document["flags"]]}


def _with_charge(request: Any, last_message: Mapping[str, Any]) -> Any:
    """Return a request with the charge that its car showed last, unless the request has one or names another car."""
    named, given = getattr(request, "car", None), (getattr(request, n, None) for n in ("soc", "bms_soc"))
    if named is None or named != last_message.get("car") or any(soc is not None for soc in given):
        return request
    return request.model_copy(update={"soc": last_message["soc"]})


def _with_last_message(
    given: Departure, last_message: Known, vehicle: Vehicle
) -> tuple[Departure, tuple[Flag, ...]]:
    """Fill temperature and charge that a departure leaves out from the car's last messages; return the departure and flags.

    A temperature that was filled in gets a flag, and so does a car without a description. A charge gets none, because the answer
    shows it. A charge of the battery management counts as given.
    """
    departure = given if given.bms_soc is None else replace(given, soc=given.bms_soc)
    air = "ambient_temperature_degc"
    used = {n: last_message.get(n) for n in ("soc", air) if getattr(departure, n) is None}
    flags = [] if used.get(air) is None else [Flag("of_last_message", air, used[air], "degc")]
    if last_message.get("undescribed"):
        flags.append(no_description_flag(last_message["undescribed"], vehicle))
    return given.merge(Departure(**used)), tuple(flags)


def no_description_flag(car: str, assumed: Vehicle) -> Flag:
    """Return the flag of a car on the road without a description."""
    return Flag("no_description", assumed.title, car)
