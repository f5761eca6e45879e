"""Schemas of journeys: requests and responses of `/v1/journeys`, `/v1/reachable`, `/v1/places` and below `/v1/map`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, Tag, field_validator
from pydantic_core import PydanticCustomError, from_json

from tripwatt.forecasting.document import FlagDocument, ForecastResponse
from tripwatt.roads.advice.preheating import PLUG_W
from tripwatt.roads.journey.distances import Doubt
from tripwatt.roads.journey.stops import ChargingStop
from tripwatt.roads.journey.verdict import Verdict
from tripwatt.roads.maps.stations import Station
from tripwatt.server.cars.documents import TimeText
from tripwatt.server.http import schemas


class ActionDocument(schemas.ResponseModel):
    """Something that a driver can do."""

    code: Literal[
        "slower",
        "calmer",
        "setpoint",
        "seats",
        "climate_off",
        "preheat_cabin",
        "no_roof_box",
        "summer_tyres",
        "pump_up",
        "less_luggage",
        "other_road",
        "leave_later",
    ]
    value: float | None
    """speed [m/s], temperature [°C], mass [kg], tyre pressure over the recommended one, number of the road, or time later [s]"""
    effort: Literal["none", "little", "some", "much"]
    wall_wh: float
    """energy from the plug [Wh]"""
    before_s: float
    """how long before the departure it begins [s]"""


class DifferenceDocument(schemas.ResponseModel):
    """A trip less another one of the same car."""

    energy_wh: float
    """below 0 is saved [Wh]"""
    interval_wh: tuple[float, float]
    """ends of the central 90 % [Wh]"""
    duration_s: float
    soc_arrival: float
    """displayed charge at arrival, 0 to 1"""
    p_less: float
    """probability that it takes less energy"""
    by_cause_wh: dict[str, float]


class JourneyTotals(schemas.ResponseModel):
    """Time, energy and charge of a journey with its stops to charge."""

    duration_s: float
    """driving and charging [s]"""
    energy_wh: float
    """expected energy of the whole journey [Wh]"""
    soc_arrival: float
    """expected displayed state of charge at the destination, 0 to 1"""
    p_reserve: float
    """probability to have the reserve at every stop and at the end"""


class JourneyInShort(JourneyTotals):
    """A journey with its stops to charge."""

    charges: int


class AdvisedDocument(schemas.ResponseModel):
    """One action, or several together."""

    actions: list[ActionDocument]
    difference: DifferenceDocument
    soc_arrival: float
    p_arrive: float
    """chance to arrive with the reserve, with the stops to charge"""
    effort: Literal["none", "little", "some", "much"]
    wall_wh: float
    saves: Literal["energy", "range"]
    """range: the battery holds longer, but in all the plug gives more"""
    whole: JourneyInShort | None
    """with it, as `difference` has it; null where no stops to charge are needed with and without it"""


class SpeedCapDocument(schemas.ResponseModel):
    """A highest speed, and what it changes beside the speeds of the plan."""

    speed_m_s: float
    longer_s: float
    saved_wh: float
    charging_w: float
    """power of charging below which the trip is quicker in all [W]"""


class AdviceResponse(schemas.ResponseModel):
    """What to do about a trip."""

    reserve: float
    probability: float
    p_arrive: float
    """chance to arrive with the reserve, of the trip as it is"""
    soc_arrival: float
    charge_to: float
    """displayed charge to leave with, so that nothing else has to be done; above 1 where a full battery does not suffice"""
    least: list[AdvisedDocument]
    """the smallest sets of actions that reach the chance"""
    singly: list[AdvisedDocument]
    """the mildest action of each group that saves for sure and arrives in at least 5 % of trips, the largest saving first; another road has at least the chance of this one"""
    whole: JourneyInShort | None
    """the fastest plan of stops, with which `singly` is compared; null for a trip without stops to charge"""
    speeds: list[SpeedCapDocument]
    """highest speeds that save for sure, the fastest first; empty for a slow road"""
    flags: list[FlagDocument]


class PreheatDocument(schemas.ResponseModel):
    """What to warm before departure, at the least cost of wall energy, battery energy and comfort."""

    starts_at: TimeText | None
    """when it begins; null without a time of departure"""
    before_s: float
    """how long before the departure it begins [s]"""
    cabin_degc: float
    """set-point of the cabin [°C]"""
    wall_wh: float
    """energy from the wall [Wh]"""
    saved_wh: float
    """what the battery gives less, preheating and trip together [Wh]"""


class PlaceRequest(schemas.StrictModel):
    """A place by its coordinates."""

    latitude_deg: float = Field(ge=-90.0, le=90.0)
    longitude_deg: float = Field(ge=-180.0, le=180.0)
    name: str = Field("", max_length=200)
    kind: str = Field("", max_length=100)
    """what it is; the car charges at a place on the way that is a "charging_station" """


Stop = Annotated[
    Annotated[str, Field(min_length=1, max_length=200), Tag(schemas.NAME)]
    | Annotated[PlaceRequest, Tag(schemas.DOCUMENT)],
    schemas.named_or_given,
]
"""A place: its name, latitude and longitude as text, or an object."""


class JourneyCar(schemas.TripRequest, schemas.CarRequest):
    """The car, and what is known at departure."""


class PlanRequest(JourneyCar):
    """A journey: places in their order, the car, and what is known at departure."""

    stops: list[Stop] = Field(min_length=2, max_length=20)
    reserve: schemas.Reserve = 0.1
    alternatives: int = Field(0, ge=0, le=3)
    """other roads beside the fastest"""
    round_trip: bool = False
    """back to the start"""
    pause_s: float = Field(0.0, ge=0.0, le=604_800.0)
    """time at the last place of a round trip before the way back [s]; the car cools down meanwhile"""
    answers: bool = True
    """whether costs, speed and charging are worked out"""
    charge: bool = True
    """whether stops to charge are planned"""
    stop_overhead_s: float = Field(300.0, ge=0.0, le=7200.0)
    """parking, plugging in and paying at each stop [s]"""
    preheat_battery: bool = False
    """whether the battery may be heated on the way to a stop"""
    avoid: list[PlaceRequest] = Field([], max_length=100)
    """charging stations that are not used"""
    networks: list[Annotated[str, Field(min_length=1, max_length=100)]] = Field([], max_length=20)
    """networks that are preferred, by the beginnings of the networks of charging stations, or of the name where none is known"""


class JourneyAdviceRequest(PlanRequest):
    """A journey, and the probability to arrive that is asked for."""

    probability: float = Field(0.95, ge=0.5, le=0.999)
    """to arrive with the reserve"""


class JourneyDifferenceRequest(schemas.StrictModel):
    """Two journeys of one car to compare, with their stops to charge."""

    one: PlanRequest
    other: PlanRequest
    road: int = Field(0, ge=0, le=3)
    """which of the roads of each, from 0 for the fastest with its stops; the last where there are fewer"""


class ReachRequest(JourneyCar):
    """A start, the car, and what is known at departure."""

    start: Stop
    reserve: schemas.Reserve = 0.1


class RangeQuery(schemas.DepartureRequest, schemas.CarRequest):
    """A charge, the kind of road and the car, which may be figures as JSON."""

    model_config = ConfigDict(strict=False)  # values of a URL are texts

    kind: schemas.RoadKind = "mixed"
    """kind of road; mixed: nothing is known of it"""
    reserve: schemas.Reserve = 0.1
    """displayed state of charge to keep; of the next trip of a car on the road, by default that of its plan"""

    @field_validator("car", mode="before")
    @classmethod
    def _parse_figures(cls, given: Any) -> Any:
        try:
            return from_json(given) if isinstance(given, str) and given.startswith("{") else given
        except ValueError as error:
            raise PydanticCustomError("not_json", "not JSON") from error


class NeedQuery(RangeQuery):
    """A distance, or a usual trip of a car; the kind of road and the car."""

    distance_km: float | None = Field(None, ge=0.5, le=2000.0)
    """distance [km]"""
    trip: str | None = Field(None, max_length=200)
    """a trip that `car` drove before, in place of the distance"""
    probability: float = Field(0.95, ge=0.5, le=0.999)
    """with which energy and charge suffice"""
    trips: int = Field(1, ge=1, le=100)
    """equal trips ahead"""
    plug_w: float = Field(PLUG_W, ge=0.0, le=400_000.0)
    """power of the plug at home [W]; 0: the car is not plugged in"""


class NeedResponse(schemas.ResponseModel):
    """What a distance or a trip needs, and what to do until its departure, as `tripwatt need --json` prints it."""

    car: str
    """its name"""
    title: str
    distance_m: float
    kind: Literal[schemas.RoadKind, "trip"]
    """kind of road; "trip" for the plan of a car and for a usual trip"""
    usual_trip: str | None
    """name of the earlier trip whose road this is"""
    energy_wh: float
    """median [Wh]"""
    probability: float
    """with which energy and charge suffice"""
    energy_quantile_wh: float
    """not exceeded with `probability` [Wh]"""
    half_wh: tuple[float, float]
    """ends of the middle half [Wh]"""
    interval_wh: tuple[float, float]
    """ends of the central 90 % [Wh]"""
    duration_s: float
    doubt: Doubt
    reserve: float
    """displayed state of charge to arrive with"""
    soc_needed: float
    """displayed state of charge that suffices with `probability`, `reserve` left; above 1: a full battery does not suffice; 0: any charge does"""
    message: str
    """`soc_needed` as an English sentence"""
    flags: list[FlagDocument]
    """what was assumed, such as an outside temperature of the car's last message"""
    target_soc: float
    """displayed state of charge to leave with, at most 1"""
    departs_at: TimeText | None
    """by when: the time of departure"""
    soc: float | None
    """displayed state of charge now: that of the request or of the last messages; null where unknown or on a trip"""
    charge_wh: float | None
    """energy that is missing in the battery, up to a full one [Wh]"""
    wall_wh: float | None
    """the same from the wall [Wh]"""
    charging_w: float | None
    """highest power from the wall: the smaller of those of plug and car [W]; null off the plug"""
    charging_s: float | None
    """time that it takes, with less power for an almost full battery [s]; null off the plug"""
    preheat: PreheatDocument | None
    """null where it is not worth it, as off the plug"""


class FarDocument(schemas.ResponseModel):
    """How far a charge carries."""

    range_m: float
    """median [m]"""
    half_m: tuple[float, float]
    """ends of the middle half [m]"""
    interval_m: tuple[float, float]
    """ends of the central 90 % [m]: 19 of 20 times it carries at least as far as the first"""


class KindRange(FarDocument):
    """How far a charge carries on a kind of road."""

    kind: schemas.RoadKind


class RangeResponse(FarDocument):
    """How far a charge carries, without a road, as `tripwatt range --json` prints it."""

    soc: float
    """displayed state of charge at departure"""
    reserve: float
    """displayed state of charge that is kept; 0: down to an empty display"""
    by_kind: list[KindRange]
    flags: list[FlagDocument]
    doubt: Doubt


class PlaceDocument(schemas.ResponseModel):
    """A place."""

    name: str
    kind: str
    """what it is on the map; empty when unknown"""
    context: str
    """what tells it from other places of its name, also a part of the name: the settlement that a street lies in"""
    also_called: str
    """its name on the map, where another name of it was looked for; else empty"""
    latitude_deg: float
    longitude_deg: float


class PlacesResponse(schemas.ResponseModel):
    """Places whose names begin with the words of the question, the best first."""

    places: list[PlaceDocument]
    attribution: str


class LineDocument(schemas.ResponseModel):
    """The line of a road on the map."""

    latitude_deg: list[float]
    longitude_deg: list[float]
    position_m: list[float]
    """distance of each point from the start [m]"""


class StopDocument(schemas.ResponseModel):
    """An intermediate stop."""

    position_m: float
    displayed_soc: float
    """expected displayed state of charge there"""


class CourseDocument(schemas.ResponseModel):
    """Charge along a journey; a stop has one entry before and one after charging."""

    position_m: list[float]
    time_s: list[float]
    displayed_soc: list[float]
    low: list[float]
    high: list[float]


class ChargingDocument(JourneyTotals):
    """A plan with stops to charge."""

    p_arrive: float
    """probability that the battery is empty nowhere; `p_arrive` of the journey is another one"""
    soc_interval: list[float]
    """90 % interval of the charge at the destination"""
    driving_s: float
    """on the road [s]"""
    charging_s: float
    """at stations, with overheads [s]"""
    label: Literal["fastest", "fewest stops", "safest", "cheapest", "best effort"]
    stops: list[ChargingStop]
    energy_interval_wh: list[float]
    """90 % interval"""
    by_cause_wh: dict[str, float]
    """parts that add up to the energy"""
    battery_loss_wh: float
    """heat in the battery on the road"""
    course: CourseDocument
    line: LineDocument


class RoadDocument(schemas.ResponseModel):
    """A road and its forecast."""

    labels: list[Literal["fastest", "shortest", "least energy"]]
    distance_m: float
    duration_s: float
    """driving [s]"""
    whole: JourneyInShort
    """with its stops to charge"""
    charging: ChargingDocument | None
    """its fastest plan with stops; null where the charge suffices or stops do not help"""
    line: LineDocument
    links: list[schemas.Link]
    """with expected times; `links` with `elevation`, or this document as `route`, is the road of a ForecastRequest"""
    elevation: schemas.Elevation | None
    road_class: list[str]
    """kind of each link"""
    stops: list[StopDocument]
    samples: dict[str, list[float | None]]
    """speed and elevation that the driver model gives"""
    forecast: ForecastResponse


class PlanResponse(schemas.ResponseModel):
    """A journey, as `tripwatt plan --json` prints it."""

    stops: list[PlaceDocument]
    """the places as they were understood"""
    reserve: float
    verdict: Verdict
    arrives: bool
    """as in `verdict`"""
    p_arrive: float
    """`p_reserve` of `verdict`: with the reserve at every stop and at the end; `p_arrive` of `verdict` is another one"""
    soc_needed: float
    """displayed state of charge to leave with, to arrive without a stop and with the reserve in 19 of 20 trips: on the first road if it suffices there, else the least of all roads; above 1: a full battery does not suffice; 0: any charge does"""
    soc_needed_with_stops: float | None
    """the same with stops to charge, if no plan with stops arrives as it is"""
    plugs: list[str]
    """plugs that the car is assumed to have, by their names on OpenStreetMap; empty if they are not known, or no stop is needed"""
    leave: str
    """`soc_needed` as an English sentence"""
    costs_wh: dict[str, float]
    """energy that the journey takes less without each [Wh]"""
    needs_motorway_speed: bool
    """whether a lower speed on motorways was looked for"""
    motorway_speed_m_s: float | None
    """speed on motorways with which it arrives; null: none does"""
    motorway_duration_s: float | None
    charging: ChargingDocument | None
    """where the charge does not suffice and stops help: the fastest"""
    charging_alternatives: list[ChargingDocument]
    """with the fewest stops, the safest, the cheapest by energy, where they differ"""
    roads: list[RoadDocument]
    """the fastest with its stops first"""
    flags: list[FlagDocument]
    attribution: str
    """to be shown beside roads and places"""


class PolygonDocument(schemas.ResponseModel):
    """A polygon of GeoJSON."""

    type: Literal["Polygon"]
    coordinates: list[list[list[float]]]
    """longitude and latitude [°]"""


class AreaDocument(schemas.ResponseModel):
    """The area that is reached with a probability."""

    probability: float
    polygon: PolygonDocument


class ReachResponse(schemas.ResponseModel):
    """The area of reach."""

    start: PlaceDocument
    areas: list[AreaDocument]
    map_ends: bool
    """whether the map ends before the charge in at least one direction"""
    flags: list[FlagDocument]
    attribution: str


class ViewResponse(schemas.ResponseModel):
    """What is named in a part of the map."""

    settlements: list[PlaceDocument]
    """the most important first"""
    stations: list[Station]
    """charging stations, those with the most power first"""
    attribution: str


class TerrainDocument(schemas.ResponseModel):
    """Heights of the roads of this service."""

    known: bool
    """whether the map has heights"""
    source: str
    """where they are from; to be shown beside a climb"""


class MapResponse(schemas.ResponseModel):
    """Roads, places and weather of this service."""

    roads: bool
    """whether /v1/journeys and /v1/reachable are served"""
    places: bool
    """whether places are found by name"""
    weather: bool
    """whether a weather server is asked"""
    tiles: bool
    """whether /v1/tiles has the roads as vector tiles"""
    stations: int
    """number of charging stations"""
    bounds_deg: list[float] | None
    """south, west, north and east of the map"""
    covers: str
    """the region of the map in words; empty without a map folder"""
    terrain: TerrainDocument
    attribution: str
