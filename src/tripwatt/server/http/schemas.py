"""Schemas of requests and responses, and the checks that turn a request into trips."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self, TypeVar

import numpy as np
import orjson
import pandas as pd
from pydantic import (
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    create_model,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError, PydanticKnownError

from tripwatt.arrays import FloatArray
from tripwatt.errors import MAX_HINTS, Fault, InvalidInput, did_you_mean, each_fault, excerpt, raise_faults
from tripwatt.forecasting.document import FlagDocument
from tripwatt.routes import LinkRoute, route_from_links
from tripwatt.routes.link_objects import route_with_elevation
from tripwatt.server.cars.documents import ROAD_FIELDS, ProblemFault, place_in
from tripwatt.server.cars.telemetry import FIRST_TIME_S, LAST_TIME_S
from tripwatt.server.http.problems import TITLES, WORDS, Problem
from tripwatt.server.http.settings import Limits
from tripwatt.sources.canonical import MIN_SAMPLES, canonical_samples
from tripwatt.trips import ASKED, COLUMNS, LINK_COLUMNS, QUANTITIES, Column, Departure, Plan
from tripwatt.trips import Field as DepartureField
from tripwatt.vehicles.vehicle import ANCHORS

MIN_OBSERVED: Final = 2
"""Fewest measured samples of an update: one interval."""

MIN_DURATION_S: Final = 1.0
"""Shortest trip: the simulation has steps of one second."""

BMS_SOC: Final = {"soc": "bms_soc"}
"""Column of the battery management's state of charge in a table -> its name over HTTP, where `soc` is the displayed charge."""

PROBLEM_KINDS: Final[dict[str, Any]] = {
    "enum": [f"/problems/{kind}" for kind in TITLES],
    "x-enum-varnames": [kind.upper().replace("-", "_") for kind in TITLES],
}
"""Types of problems, and their names in generated clients."""

STEPS: Final = re.compile(r"\w+(?!\w*\))")
"""Words of the place of a fault, without those in brackets; the first ones may lead into a request."""

FAULTS: Final = "tripwatt_faults"
"""Type of the errors of pydantic that hold faults."""

TRACE: Final = "Speed trace and road, one list per column. Of other signals only the first sample is used."
MEASURED: Final = """Samples measured so far, on the clock of the trip: voltage_v with current_a (positive when the battery \
discharges), or bms_soc or displayed_soc."""
"""Descriptions of the tables of a request."""

NUMBER_TYPES: Final = frozenset({float, int, NoneType})
"""Types of JSON numbers and of null. `bool` is excluded, although it is a subclass of `int`."""


def _columns_type(required: list[str], min_items: int, meaning: str) -> Any:
    """Return the documented type of a table: an object with a list of numbers per column."""
    properties = {}
    for name, column in COLUMNS.items():
        bounds = {"minimum": column.minimum, "maximum": column.maximum}
        kind = {"type": "number" if name in required else ["number", "null"]}
        item = kind | ({"minimum": 0.0} if name == "time_s" else bounds)
        of_list = {"minItems": min_items, "description": f"{column.meaning} [{column.unit}]"}
        properties[BMS_SOC.get(name, name)] = {"type": "array", "items": item, **of_list}
    schema = {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
    return Annotated[Any, WithJsonSchema({**schema, "description": meaning})]


def _checked_by(check: Callable[[Any, Limits], Any], documented: Any) -> PlainValidator:
    """Return a validator that replaces a value by the result of `check`; its faults are collected with those of pydantic.

    The context of the validation is a `Jobs`, which has the limits. `documented` is the type with the schema of the value.
    """

    def validate(value: Any, info: ValidationInfo) -> Any:
        jobs: Any = info.context
        with _collect_faults():
            return check(value, jobs.limits)

    return PlainValidator(validate, documented)


@contextmanager
def _collect_faults(*, whole: bool = False) -> Iterator[None]:
    """Raise faults as an error of pydantic, which collects them with its own for `faults_of`; `whole`: of a whole model, not of a field."""
    try:
        yield
    except InvalidInput as error:
        raise PydanticCustomError(FAULTS, "faults", {"faults": error.faults, "whole": whole}) from error


def parse_samples(value: Any, limits: Limits) -> pd.DataFrame:
    """Check the field `samples` of a request, and return it as a table.

    Parameters
    ----------
    value : object
        A mapping from column names to lists of numbers.
    limits : Limits

    Raises
    ------
    InvalidInput
        With the positions of wrong values.
    """
    samples = _checked_table(value, "samples", limits)
    require_duration(float(np.ptp(samples["time_s"])), "samples", limits)
    return samples


def parse_observed(value: Any, limits: Limits) -> pd.DataFrame:
    """Check the field `observed` of an update, and return it as a table; parameters and errors are those of `parse_samples`."""
    return _checked_table(value, "observed", limits, required=("time_s",), minimum=MIN_OBSERVED)


def parse_links(links: Any, limits: Limits) -> LinkRoute:
    """Check the field `links` of a request, and return it as a route.

    Parameters
    ----------
    links : object
        A list of mappings.
    limits : Limits

    Raises
    ------
    InvalidInput
        When the links are wrong.
    """
    if not isinstance(links, list):
        raise InvalidInput.of("not a list", "links", excerpt(links), "a list of objects")
    if len(links) > limits.links:
        raise InvalidInput.of("too many links", "links", f"{len(links)}", f"at most {limits.links}")
    with each_fault(lambda fault: replace(fault, at=("links", *(fault.at or ())))):
        route = route_from_links(links)
    require_duration(route.duration_s, "links", limits)
    return route


def require_duration(duration_s: float, where: str, limits: Limits) -> None:
    """Check the duration of a trip.

    Raises
    ------
    InvalidInput
        When the duration is below `MIN_DURATION_S` or above `Limits.duration_s`.
    """
    if not MIN_DURATION_S <= duration_s <= limits.duration_s:
        allowed = f"{MIN_DURATION_S:g} to {limits.duration_s:g} s"
        raise InvalidInput.of("duration out of range", where, f"{duration_s:g} s", allowed)


def _checked_table(value: Any, where: str, limits: Limits, **rules: Any) -> pd.DataFrame:
    columns = _columns(value, where, limits)
    with each_fault(partial(of_json, where)):
        return canonical_samples(columns, where, **rules)


def of_json(table: str, fault: Fault) -> Fault:
    """Return a fault of a table with its place and its value as in the JSON of a request."""
    steps = [BMS_SOC.get(f"{step}", step) for step in fault.at or ()]
    at, got = (table, *steps), re.sub(r"\bnan\b", "null", fault.got)
    return replace(fault, where=dotted(at) if steps else fault.where, got=got, at=at)


def dotted(steps: Iterable[str | int]) -> str:
    """Return a place in JSON as a text.

    Examples
    --------
    >>> dotted(["stops", 2, "name"])
    'stops[2].name'
    """
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).lstrip(".")


def _columns(value: Any, where: str, limits: Limits) -> dict[str, FloatArray]:
    if not isinstance(value, Mapping):
        raise InvalidInput.of("not an object", where, excerpt(value), "an object of lists of numbers")
    faults = []
    columns: dict[str, FloatArray] = {}
    if "soc" in value:
        faults.append(Fault("unknown column", f"{where}.soc", fix=did_you_mean("soc", BMS_SOC.values())))
    for name, values in value.items():
        field, fault = f"{where}.{name}"[:80], partial(Fault, at=(where, name))
        if not isinstance(values, list):
            faults.append(fault("not a list", field, excerpt(values), "a list of numbers"))
        elif len(values) > limits.samples:
            faults.append(fault("too many samples", field, f"{len(values)}", f"at most {limits.samples}"))
        elif not set(map(type, values)) <= NUMBER_TYPES:
            position = next(k for k, v in enumerate(values) if type(v) not in NUMBER_TYPES)
            got, allowed = excerpt(values[position]), "a number, or null where unknown"
            faults.append(
                Fault("not a number", f"{field}[{position}]", got, allowed, at=(where, name, position))
            )
        else:
            columns["soc" if name == "bms_soc" else name] = np.array(values, dtype=np.float64)
    raise_faults(faults)
    return columns


def _number_field(column: Column, default: Any = None, *, positive: bool = False) -> Any:
    """Return the field of a number, with the bounds and the description of its column."""
    least: dict[str, Any] = {"gt": 0.0} if positive else {"ge": column.minimum}
    meaning = f"{column.meaning} [{column.unit}]"
    return Field(default, **least, le=column.maximum, description=meaning)


class Link(BaseModel):
    """A link of a planned route. Give `speed_m_s` or `travel_time_s`. Give `grade`, both elevations, or neither."""

    model_config = ConfigDict(extra="forbid")

    length_m: float = _number_field(LINK_COLUMNS["length_m"], ..., positive=True)
    speed_m_s: float | None = _number_field(LINK_COLUMNS["speed_m_s"], positive=True)
    travel_time_s: float | None = _number_field(LINK_COLUMNS["travel_time_s"], positive=True)
    stop_s: float | None = _number_field(LINK_COLUMNS["stop_s"])
    moving_speed_m_s: float | None = _number_field(LINK_COLUMNS["moving_speed_m_s"], positive=True)
    speed_limit_m_s: float | None = _number_field(LINK_COLUMNS["speed_limit_m_s"], positive=True)
    grade: float | None = _number_field(LINK_COLUMNS["grade"])
    start_elevation_m: float | None = _number_field(LINK_COLUMNS["start_elevation_m"])
    end_elevation_m: float | None = _number_field(LINK_COLUMNS["end_elevation_m"])


Samples = Annotated[
    Any, _checked_by(parse_samples, _columns_type(["time_s", "speed_m_s"], MIN_SAMPLES, TRACE))
]
Observed = Annotated[Any, _checked_by(parse_observed, _columns_type(["time_s"], MIN_OBSERVED, MEASURED))]
Links = Annotated[Any, _checked_by(parse_links, Annotated[list[Link], Field(min_length=1)])]
"""Fields whose values are checked as whole tables, not one object at a time; a checked request has a table and a `LinkRoute`."""


_Share = Annotated[float, _number_field(QUANTITIES["reserve"], ...)]
Reserve = Annotated[_Share, BeforeValidator(lambda given: 0.1 if given is None else given, _Share | None)]
"""Type of the field `reserve`, whose default is 0.1; null stands for that."""


class StrictModel(BaseModel):
    """Base of documents in requests: no unknown fields, no texts for numbers, no infinities."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True)


RoadKind = Literal["city", "country", "motorway", "mixed"]
"""Kind of a road that is not known."""


class Elevation(StrictModel):
    """Elevation along a route of links; in a request it replaces grades and elevations of the links."""

    position_m: list[float] = Field(min_length=1)
    """distances from the start, never decreasing [m]"""
    elevation_m: list[float] = Field(min_length=1)
    """elevation above sea level at each position [m]"""


Body = Literal["small", "hatchback", "sedan", "estate", "suv", "van", "pickup", "quadricycle"]
"""Kind of the body of a car."""


class VehicleFigures(StrictModel):
    """A car that the library does not have, by up to six figures; what is missing is that of a usual car of its body."""

    mass_kg: float | None = Field(None, ge=400.0, le=6000.0)
    """mass ready to drive, nobody inside [kg]"""
    usable_battery_kwh: float | None = Field(None, ge=4.0, le=300.0)
    """usable energy of the battery [kWh]"""
    consumption_kwh_per_100km: float | None = Field(None, ge=4.0, le=60.0)
    """published consumption at the wall [kWh/100 km]"""
    motor_power_kw: float | None = Field(None, ge=5.0, le=1500.0)
    """largest power of all motors together [kW]"""
    body: Body | None = None
    """kind of body; default: suv"""
    heat_pump: bool | None = None
    """default: false"""
    procedure: Literal["wltp", "epa"] = "wltp"
    """where the consumption comes from; epa is the combined figure of the label"""
    title: str | None = Field(None, min_length=1, max_length=100)
    """name for people"""


NAME, DOCUMENT = "(name)", "(document)"
"""Tags of the two forms of a field. Places of faults leave them out; no field can have such a name."""

named_or_given = Discriminator(lambda value: NAME if isinstance(value, str) else DOCUMENT)

LibraryCar = Annotated[
    Annotated[str, Field(min_length=1, max_length=100), Tag(NAME)] | Annotated[VehicleFigures, Tag(DOCUMENT)],
    named_or_given,
]
"""A car by its name, or by a few figures."""


class CarRequest(StrictModel):
    """The car of a request."""

    car: LibraryCar | None = None
    """one of /v1/cars, of /v1/vehicles or of the vehicles of a fleet, by its name; or a few figures; default: the car of the model"""
    model: str | None = Field(None, max_length=100)
    """one of /v1/models; default: that of the car if it learns, or else the first one"""
    driver: str | None = Field(None, max_length=100)
    """of the model of a fleet: who drives"""

    @property
    def named(self) -> str | None:
        """Name of the car; None for figures, and for the car of the model."""
        return self.car if isinstance(self.car, str) else None

    @field_validator("car", "model")
    @classmethod
    def _is_known(cls, named: Any, info: ValidationInfo) -> Any:
        if isinstance(named, str) and info.context is not None:
            with _collect_faults():
                info.context.require_known(f"{info.field_name}", named)
        return named


def _require_text(given: Any) -> Any:
    """Refuse numbers, which pydantic takes as seconds since 1970."""
    if given is not None and not str(given)[4:].startswith("-"):
        raise PydanticKnownError("datetime_type")
    return given


Time = Annotated[AwareDatetime, BeforeValidator(_require_text)]


def departure_field(name: str, field: DepartureField) -> tuple[Any, Any]:
    """Return type and schema in a request for a field of a departure; the schema also has what a form needs."""
    kind: Any = Literal[field.choices] if field.choices else float
    unit, rules = "", dict[str, Any]()
    if field.column is not None:
        unit, rules = f" [{field.column.unit}]", {"ge": field.column.minimum, "le": field.column.maximum}
    elif field.type == "time":
        earliest, latest = (dt.datetime.fromtimestamp(s, dt.UTC) for s in (FIRST_TIME_S, LAST_TIME_S))
        kind, unit = Time, "; with its time zone"
        rules = {"strict": False, "ge": earliest, "le": latest}
    elif field.type == "values":
        kind, rules = dict[str, float | str], {"max_length": 100}  # a choice: far above what a log has
    elif field.several:
        kind, rules = list[kind], {"max_length": len(field.choices)}
    form: dict[str, Any] = {"x-label": field.label, "x-unit": field.unit, "x-option": field.option}
    described = field.help.removesuffix(".") + unit
    return kind | None, Field(None, description=described, json_schema_extra=form, **rules)


if TYPE_CHECKING:

    class DepartureRequest(StrictModel):
        """What is known at departure: the fields of `tripwatt.trips.departure.ASKED`."""

        departs_at: dt.datetime | None

else:
    DepartureRequest = create_model(
        "DepartureRequest",
        __base__=StrictModel,
        __doc__="What is known at departure.",
        **{name: departure_field(name, field) for name, field in ASKED.items()},
    )


class TripRequest(DepartureRequest):
    """What is known at departure, as fields of the request or as its `departure`."""

    departure: DepartureRequest | None = None
    """the same fields together, as a `Departure` of Python"""

    @model_validator(mode="after")
    def _take_departure(self) -> Self:
        given = {} if self.departure is None else self.departure.model_dump(exclude_none=True)
        twice = (name for name in given if getattr(self, name) is not None)
        with _collect_faults(whole=True):
            raise_faults(Fault("given twice", f"departure.{name}", "", "one of the two") for name in twice)
        for name, value in given.items():
            setattr(self, name, value)
        return self


def departure_of(request: DepartureRequest) -> Departure:
    """Return the departure of a request."""
    return Departure(**{name: getattr(request, name, None) for name in ASKED})


class RoadRequest(StrictModel):
    """A road to drive: a speed trace (`samples`), a planned route (`links`), or either as somebody else writes it (`route`)."""

    samples: Samples | None = None
    links: Links | None = None
    elevation: Elevation | None = None
    route: dict[str, Any] | str | None = None
    """an answer with a road, such as that of /v1/routes, /v1/journeys, one of its roads, or of a router; or the text of a GPX, KML or CSV file"""
    speed_m_s: float | None = Field(None, gt=0.0, le=70.0)
    """mean speed of a `route` without times and speeds [m/s]"""

    @model_validator(mode="before")
    @classmethod
    def _read_route(cls, given: Any, info: ValidationInfo) -> Any:
        if not isinstance(given, Mapping) or given.get("route") is None or info.context is None:
            return given
        speed = given.get("speed_m_s")
        if speed is not None and not (type(speed) in NUMBER_TYPES and 0.0 < speed <= 70.0):
            return given  # its field has the fault
        with _collect_faults(whole=True), each_fault(partial(replace, at=None)):
            if any(given.get(name) is not None for name in ROAD_FIELDS):
                got = "route beside links, samples or elevation"
                raise InvalidInput.of("no single trip", "route", got, "one of them")
            return info.context.with_road(given)

    def plan(self, limits: Limits, *, measured: bool = False) -> Plan:
        """Return the plan of the road of a checked request; `measured` as of a `LinkRoute`.

        Raises
        ------
        InvalidInput
            When there are none or two roads, or `elevation` does not fit the links.
        """
        samples, links = self.samples, self.links
        if samples is not None and links is None:
            with each_fault(partial(of_json, "samples")):
                return Plan.from_samples(samples, "samples")
        if links is None or samples is not None:
            got = "neither" if links is None else "both"
            raise InvalidInput.of("no single trip", "samples, links", got, "samples, links or a route")
        if self.elevation is not None:
            links = with_elevation(links, self.elevation, limits)
        return replace(links, measured=measured).plan()


class ForecastRequest(RoadRequest, TripRequest, CarRequest):
    """A trip to forecast: its road, and what is known at departure."""

    trip: str = Field("trip", min_length=1, max_length=100)
    """name of the trip in the response"""
    reserve: Reserve = 0.1
    probability: float | None = Field(None, ge=0.5, le=0.999)
    """with which the trip has to arrive with the reserve: the response has the charge to leave with; default: none is worked out"""


class UpdateRequest(ForecastRequest):
    """A trip to forecast, with the samples measured so far."""

    observed: Observed


class AdviceRequest(ForecastRequest):
    """A trip to come, and the probability to arrive that is asked for."""

    probability: float = Field(0.95, ge=0.5, le=0.999)
    """to arrive with the reserve"""


class DifferenceRequest(StrictModel):
    """Two trips of one car to compare."""

    one: ForecastRequest
    other: ForecastRequest


class ResponseModel(BaseModel):
    """Base of all documents in responses: objects without undocumented fields."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)


class ProblemDocument(ResponseModel):
    """Problem document of RFC 9457."""

    type: str = Field(json_schema_extra=PROBLEM_KINDS)
    """kind of problem, as a path"""
    title: str
    status: int
    detail: str | None = None
    instance: str | None = None
    """X-Request-ID of the request"""
    faults: list[ProblemFault] | None = None
    """all faults of the input"""
    more_faults: int | None = None
    """number of faults that are not listed"""
    trip: str | None = None
    """of a line of a batch: the trip of its request"""


class VehicleValues(ResponseModel):
    """Values of a car."""

    title: str
    test_mass_kg: float
    """mass with a driver [kg]"""
    usable_energy_wh: float
    """energy between 0 and 1 of the displayed state of charge [Wh]"""
    anchor: str = Field(json_schema_extra={"enum": [*ANCHORS]})
    """what the values were held against: road_load (measured coast-down and certified consumption), certification (a consumption), class, road (they hold for it), or published (published values alone)"""


class VehicleSummary(VehicleValues):
    """A car of the library."""

    name: str
    has_climate: bool
    """whether heating and cooling are simulated"""
    models: list[str]
    """models fitted on this car; other models forecast it with much wider intervals"""


class DescribedVehicle(VehicleValues):
    """A car from a few figures."""

    wltp_kwh_per_100km: float
    """consumption on the WLTP at the wall [kWh/100 km]"""
    wltp_low_kwh_per_100km: float
    """lower end of the 90 % interval"""
    wltp_high_kwh_per_100km: float
    """upper end of the 90 % interval"""


class VehiclesResponse(ResponseModel):
    """Cars of the library."""

    vehicles: list[VehicleSummary]


class FittedModel(BaseModel):
    """What a model was fitted on; other fields describe the model itself."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True)

    car: str
    car_title: str
    trips: int


class ModelSummary(BaseModel):
    """A model: its name in this service and its metadata."""

    name: str
    model: FittedModel
    contract: dict[str, Any]
    provenance: dict[str, Any]
    evaluation: dict[str, Any]


class ModelsResponse(ResponseModel):
    """Models of this service; the first is the default."""

    models: list[ModelSummary]


class ExampleSummary(ResponseModel):
    """A recorded trip."""

    trip: str
    title: str
    car: str
    """one of /v1/vehicles"""
    note: str
    duration_s: float
    distance_m: float
    ambient_temperature_degc: float | None
    observed_energy_wh: float


class ExampleResponse(ExampleSummary):
    """A recorded trip with its samples."""

    request: ForecastRequest
    observed: dict[str, list[float | None]]
    """measurements of the whole trip"""


class ExamplesResponse(ResponseModel):
    """Recorded trips as examples."""

    examples: list[ExampleSummary]


class RouteResponse(ResponseModel):
    """An uploaded route or trip. Send `links` with `elevation`, or `samples`, in a ForecastRequest."""

    samples: dict[str, list[float | None]]
    """speed trace; for a planned route, that of the driver model"""
    links: list[Link] | None
    """links of the planned route; null for a logged trip"""
    elevation: Elevation | None
    duration_s: float
    distance_m: float
    notes: list[FlagDocument]
    """assumptions"""


class HealthResponse(ResponseModel):
    """State of the service."""

    status: Literal["alive", "ready"]
    workers: int
    """number of worker processes that are ready"""


RequestModel = TypeVar("RequestModel", bound=BaseModel)
Made = TypeVar("Made")


def parse_json(body: bytes, where: str = "") -> Any:
    """Parse the body of a request, or a part of it; messages of errors begin with `where`.

    Raises
    ------
    Problem
        `not-json`. NaN, infinities and numbers beyond the range of a float are not JSON.
    """
    try:
        return orjson.loads(body)
    except orjson.JSONDecodeError as error:
        raise Problem("not-json", f"{where}{error}") from error


def json_object(body: bytes) -> dict[str, Any]:
    """Parse the body of a request as an object.

    Raises
    ------
    Problem
        `not-json`.
    InvalidInput
        When it is something else.
    """
    document = parse_json(body)
    if not isinstance(document, dict):
        raise InvalidInput(Fault("not an object", "body", excerpt(document), "an object", at=()))
    return document


def check_request(document: Any, model: type[RequestModel], jobs: Any = None) -> RequestModel:
    """Check the document of a request, and return it as a `model`.

    Parameters
    ----------
    document : object
        Parsed JSON.
    model : type
    jobs : Jobs, optional
        Limits, models and cars of the service, for requests with a trip or a car.

    Raises
    ------
    InvalidInput
        When fields are missing, unknown or out of range; the fault of an unknown field names the most similar one.
    """
    try:
        return model.model_validate(document, context=jobs)
    except ValidationError as error:
        errors = error.errors(include_url=False)
    raise InvalidInput(faults_of(errors, model.model_fields))


def faults_of(errors: Iterable[Mapping[str, Any]], known: Collection[str]) -> Iterator[Fault]:
    """Yield the faults of pydantic's errors; the first faults of unknown names suggest the most similar known name."""
    for number, error in enumerate(errors):
        steps = [step for step in error["loc"] if step not in (NAME, DOCUMENT)]
        if error["type"] == FAULTS:
            outer = steps if error["ctx"]["whole"] else steps[:-1]
            yield from map(partial(within, outer), error["ctx"]["faults"])
            continue
        is_unknown = number < MAX_HINTS and error["type"] == "extra_forbidden"
        fix = did_you_mean(str(steps[-1]), known) if is_unknown else ""
        kind = "named_or_given" if error["loc"][-1:] == (DOCUMENT,) else error["type"]
        what, allowed = WORDS["faults"].get(kind, (error["msg"], ""))
        bounds = {n: f"{v:g}" if isinstance(v, float) else v for n, v in error.get("ctx", {}).items()}
        where, allowed = ".".join(map(str, steps))[:80], allowed.format(**bounds)
        got = excerpt(error.get("input"), 80)
        yield Fault(what, where or "body", got, allowed, fix, at=(*steps,))


def within(outer: Sequence[str | int], fault: Fault) -> Fault:
    """Return a fault of a part of a request with its place in the whole request."""
    where = f"{dotted(outer)}.{fault.where}".lstrip(".")
    return replace(fault, where=where, at=None if fault.at is None else (*outer, *fault.at))


def both(request: Any, make: Callable[[Any], Made]) -> Iterator[Made]:
    """Yield what is made of the two parts of a request that compares them, `one` and `other`."""
    for name in ("one", "other"):
        with each_fault(partial(within, [name])):
            yield make(getattr(request, name))


def placed(fault: Fault, fields: Collection[str], body: Any, *, in_query: bool = False) -> Fault:
    """Return a fault with its place in a request: that of the fault, or the field that its text names; None if `fields` lacks it.

    It ends where the parsed body has no more of it.

    Examples
    --------
    >>> body = {"stops": ["here", "there"]}
    >>> placed(Fault("unknown place", "stops[1]"), body, body).at, placed(Fault("no road", "drive.csv"), body, body).at
    (('stops', '1'), None)
    """
    steps = tuple(STEPS.findall(fault.where)) if fault.at is None else fault.at
    if not {*steps[:1]} <= {*fields}:
        return replace(fault, at=None)
    return replace(fault, at=("query", *steps) if in_query else place_in(body, steps))


def with_elevation(route: LinkRoute, elevation: Elevation, limits: Limits) -> LinkRoute:
    """Return the links of a request, with the elevation along them.

    Raises
    ------
    InvalidInput
        When `elevation` does not fit the links.
    """
    raise_faults(_elevation_faults(route, elevation, limits.samples))
    return route_with_elevation(route, np.array(elevation.position_m), np.array(elevation.elevation_m))


def _elevation_faults(route: LinkRoute, elevation: Elevation, max_positions: int) -> Iterator[Fault]:
    position, heights = elevation.position_m, elevation.elevation_m
    if len(position) != len(heights) or len(position) > max_positions:
        got = f"{len(position)} positions and {len(heights)} elevations"
        allowed = f"equal numbers, at most {max_positions}"
        yield Fault("positions and elevations differ in number", "elevation", got, allowed)
    if position[0] < 0 or position != sorted(position):
        yield Fault("position decreases", "elevation.position_m", "", "0 m or more, never decreasing")
    if route.elevation_m is not None:
        yield Fault("elevation given twice", "elevation", "links with elevations or grades", "one of the two")
