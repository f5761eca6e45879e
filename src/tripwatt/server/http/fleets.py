"""Models of fleets: a registry whose version in use is followed, the model of one of its vehicles, and what its planned trips need."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AwareDatetime, Field, WrapValidator

from tripwatt.errors import Check, InvalidInput, places_within, require_one
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.registry import FollowedModel, Registry
from tripwatt.forecasting import ForecastModel, load_metadata
from tripwatt.roads.advice.preheating import PLUG_W
from tripwatt.server.cars.documents import TimeText
from tripwatt.server.http import schemas
from tripwatt.server.http.settings import Limits
from tripwatt.vehicles import load_vehicle

Named = TypeVar("Named")


def follow_registry(name: str, folder: Path, log: Callable[..., None]) -> FollowedModel:
    """Return the model that a registry has in use, and follow it; each change or refusal is logged with `name`."""

    def on_change(version: str, error: InvalidInput | None) -> None:
        refused = {} if error is None else {"reason": f"{error}"}
        log(event="model refused" if refused else "model changed", model=name, version=version, **refused)

    return FollowedModel(Registry(folder), on_change)


def model_summary(folder: Path | None, fleet: FollowedModel | None) -> dict[str, Any]:
    """Return the entry of a model in `/v1/models`, without its name."""
    if fleet is None:
        metadata = load_metadata(folder)
        own = {key.replace("vehicle", "car"): value for key, value in metadata["model"].items()}
        return {**metadata, "model": own}
    fleet.get()  # the version in use, if the pointer has moved
    metadata = load_metadata(fleet.folder)
    description = metadata.pop("fleet")
    provenance = {name: metadata[name] for name in ("tripwatt", "packages")}
    name = description["car_models"][0]
    model = {"car": name, "car_title": load_vehicle(name).title, "version": fleet.version, **description}
    return {"model": model, "contract": {}, "provenance": provenance, "evaluation": {}}


def vehicle_model(fleet: FleetModel, request: schemas.CarRequest) -> ForecastModel:
    """Return the model of the vehicle that a request names; by default, of a new vehicle of the fleet's first car model.

    Raises
    ------
    InvalidInput
        When the vehicle is not known, or is of another car model.
    """
    if isinstance(request.car, schemas.VehicleFigures):
        got, allowed = "figures of a car", "a vehicle of the fleet, or a car of the library for a new one"
        raise InvalidInput.of("not for a fleet", "car", got, allowed)
    car, known = request.car, fleet.vehicles()
    new = None if car in known else car or min(known.values())
    degc = getattr(request, "ambient_temperature_degc", None)
    return fleet.of_vehicle(car, car_model=new, driver=request.driver, ambient_degc=degc)


class PlannedTripRequest(schemas.RoadRequest, schemas.TripRequest):
    """A trip that a vehicle of a fleet is to drive: its distance and kind of road, or its road; `soc` is the charge now."""

    car: str = Field(min_length=1, max_length=100)
    """vehicle of the fleet, or a new name"""
    trip: str = Field("trip", min_length=1, max_length=100)
    departs_at: AwareDatetime = Field(strict=False)
    """with its time zone"""
    distance_km: float | None = Field(None, ge=0.5, le=2000.0)
    kind: schemas.RoadKind = "mixed"
    """kind of road of a distance; mixed: nothing is known of it"""
    car_model: str | None = Field(None, max_length=100)
    """one of /v1/vehicles, for a vehicle without trips"""
    driver: str | None = Field(None, max_length=100)
    """who drives"""

    def planned(self, number: int, limits: Limits) -> Any:
        """Return the planned trip; `number` is its position in the request, from 0."""
        from tripwatt.fleet.nights import PlannedTrip  # scipy is slow to import

        road: Any = self.samples if self.links is None else self.links
        require_one("distance_km, links", self.distance_km, road)
        road = self.distance_km if road is None else self.plan(limits)
        known = schemas.departure_of(self), self.car_model, self.driver, f"trips[{number}]."
        return PlannedTrip(self.trip, self.car, self.departs_at, road, self.kind, *known)


def _planned(row: Any, number: int, jobs: Any) -> Any:
    with places_within(f"trips[{number}]."):
        return schemas.check_request(row, PlannedTripRequest, jobs).planned(number, jobs.limits)


Row = Annotated[PlannedTripRequest, WrapValidator(lambda row, check: row)]
"""A planned trip, which is checked by itself when it is forecast."""


class NightRequest(schemas.StrictModel):
    """The planned trips of a fleet, such as those of tomorrow."""

    model: str | None = Field(None, max_length=100)
    """a fleet of /v1/models; default: the first one"""
    trips: list[Row] = Field(min_length=1, max_length=500)
    probability: float = Field(0.95, ge=0.5, le=0.999)
    """probability with which the energy of a trip suffices"""
    reserve: schemas.Reserve = 0.1
    plug_w: float = Field(PLUG_W, gt=0.0, le=400_000.0)
    """power of a charger [W]"""
    begins_at: AwareDatetime | None = Field(None, strict=False)
    """when charging may begin; default: now"""
    grid_w: float | None = Field(None, ge=0.0, le=1e9)
    """largest power of all chargers together [W]"""
    tariff: dict[Annotated[AwareDatetime, Field(strict=False)], float] = Field({}, max_length=1000)
    """price per kWh by its beginning; it holds until the next begins"""


class HourNeed(schemas.ResponseModel):
    """What the trips of a vehicle need that depart in one hour."""

    car: str
    car_model: str
    departs_at: TimeText
    """departure of the first trip"""
    arrives_at: TimeText
    """arrival of the last trip"""
    trips: int
    distance_m: float
    energy_wh: float | None
    """median [Wh]"""
    energy_quantile_wh: float | None
    """not exceeded with `probability` [Wh]"""
    soc_needed: float | None
    """displayed charge to leave with for this hour and the later ones, without charging in between; above 1: more than a full battery"""
    soc: float | None
    """displayed charge now"""
    p_enough: float | None
    """probability that the charge now suffices for this hour and those before; null where it is not known"""
    charge_wh: float | None
    """to be charged for this hour beyond what the hours before need [Wh]; null where the charge now is not known"""
    missing_wh: float | None = None
    """what the schedule cannot charge before the departure [Wh]"""
    alternating_w: float
    """highest power with which the car charges, with alternating current [W]"""
    direct_w: float
    """the same with direct current [W]"""
    assumed: str | None
    """what was not given, as names of fields"""
    reasons: str | None
    """what was assumed and what limits the forecasts, as sentences"""


class NightResponse(schemas.ResponseModel):
    """What the planned trips of a fleet need, by vehicle and hour of departure."""

    needs: list[HourNeed]
    depot: dict[str, Any]
    """median and quantile of the energy of all vehicles together [Wh], chance that all have enough, peak [W] and cost of the schedule, and what fails first"""
    schedule: list[dict[str, Any]] | None = None
    """power of each vehicle in each quarter of an hour [W], for a limit or a tariff"""
    refused: list[dict[str, Any]]
    """faults of the trips that are left out"""
    emhass: dict[str, Any]
    """payload of EMHASS's action naive-mpc-optim: a load for each hour of a vehicle with something to charge, in the order of its `vehicles`"""
    evcc: list[str]
    """paths to post to evcc: the plan of each vehicle"""


class FleetRows(schemas.ResponseModel):
    """Some rows of a table of a fleet."""

    version: str
    """version of the model in use"""
    about: dict[str, str]
    """what the last report is of, such as when it was written; empty without a report"""
    rows: list[dict[str, Any]]
    next: int | None
    """cursor of the rows that follow; null at the end"""


def fleet_named(fleets: Mapping[str, Named], name: str | None) -> Named:
    """Return the fleet of a name, by default the first one.

    Raises
    ------
    InvalidInput
        When there is no such fleet.
    """
    name = name or next(iter(fleets), "")
    if name not in fleets:
        raise InvalidInput.of("no fleet", "model", name or "none", ", ".join(fleets) or "serve a registry")
    return fleets[name]


def night(jobs: Any, request: NightRequest) -> dict[str, Any]:
    """Return the response to a `NightRequest`; `jobs` has the fleets and the limits of the service.

    Raises
    ------
    InvalidInput
        When there is no such fleet.
    """
    from tripwatt.fleet import charging, nights  # scipy is slow to import

    model = fleet_named(jobs.fleets, request.model).get()
    check = Check()
    planned = [check(_planned, row, number, jobs) for number, row in enumerate(request.trips)]
    trips, refused = [trip for trip in planned if trip is not None], [*check.faults]
    asked = request.model_dump(include={"probability", "reserve"})
    needs = nights.needs_by_hour(model, trips, **asked, refused=refused)
    begins = request.begins_at or dt.datetime.now(dt.UTC)
    depot = charging.Depot(begins, request.plug_w, request.grid_w, request.tariff)
    document = charging.Night(needs, depot, request.probability).document
    faults = [{**fault.texts, "where": fault.where.replace("vehicle_id", "car")} for fault in refused]
    rows = [{"car": row.pop("vehicle_id"), **row} for row in document["needs"]]
    return document | {"needs": rows, "refused": faults}
