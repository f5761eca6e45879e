"""Schemas of the requests and responses of users' cars."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NotRequired

from pydantic import BaseModel, ConfigDict, Field

from tripwatt.forecasting.document import described
from tripwatt.server.cars.car_file import MadeForecast
from tripwatt.server.cars.documents import LiveResponse, ProblemFault, TimeText
from tripwatt.server.http.journey_schemas import NeedResponse, RangeResponse, Stop
from tripwatt.server.http.schemas import (
    ForecastRequest,
    LibraryCar,
    ResponseModel,
    StrictModel,
)
from tripwatt.sources.mapping import UNITS
from tripwatt.trips.reading import Group


class NewCarRequest(StrictModel):
    """A car to keep: a name, and either a car of the library or a few figures."""

    name: str = Field(min_length=1, max_length=100)
    """any name, such as "My Model 3"; the name of its folder and of its model is made from it"""
    car: LibraryCar
    """one of /v1/vehicles by its name, or a few figures"""


class ColumnChoice(StrictModel):
    """The column of a table that is one of ours."""

    column: str = Field(max_length=500)
    unit: str | None = Field(None, max_length=20)
    """null for the unit that was proposed, or ours"""


class KindChanges(StrictModel):
    """How the files of one kind are to be read."""

    changes: dict[str, ColumnChoice | None] = Field(default_factory=dict, max_length=len(UNITS))
    """our column -> column of the table in place of the proposed one; null to leave it out"""
    current_positive: Literal["discharge", "charge"] | None = None
    """null for the sign that was proposed"""


class LogsRequest(StrictModel):
    """How uploaded files are to be read."""

    kinds: dict[str, KindChanges] = Field(default_factory=dict, max_length=100)
    """number of a kind of files -> what is read otherwise than proposed"""
    ignored: list[str] = Field(default_factory=list, max_length=4000)
    """names of files that are left out"""
    implausible: bool = False
    """learn also from an energy that the car cannot take on these trips"""


class UploadResponse(ResponseModel):
    """An upload so far."""

    files: int
    """tables"""
    bytes: int


class MappedColumnDocument(ResponseModel):
    """One of our columns and the column of the table that it is."""

    ours: str
    column: str
    unit: str
    why: str
    """empty where the request chose it"""


class FieldDocument(ResponseModel):
    """A column that can be mapped."""

    ours: str
    units: list[str]


@dataclass(frozen=True, slots=True)
class FindingsDocument(Group):
    """Findings of the audit of one kind."""

    consequence: Literal["trimmed", "split", "set aside", "noted"]


class LogsPreview(ResponseModel):
    """What would be learned of the files as they are read."""

    logs: int
    drives: int
    """sound drives with measured energy"""
    distance_m: float
    """of the sound drives, as the three below"""
    duration_s: float
    energy_wh: float
    from_date: TimeText | None
    """departure of the first one, in the zone of the service; null where no date is known"""
    to_date: TimeText | None
    ambient_degc: tuple[float, float] | None
    """lowest and highest mean outside temperature of the sound drives; null where it is not known"""
    lost_distance_m: float
    """of the drives that are left out"""
    lost_duration_s: float
    findings: list[FindingsDocument]
    """what the audit changed, those that cost a drive first"""


class KindDocument(ResponseModel):
    """Files with the same columns, and the mapping by which they are read."""

    number: int
    files: int
    columns: list[str]
    """of the largest file"""
    mapping: list[MappedColumnDocument]
    shipped: str | None
    """the bundled mapping whose columns the files have"""
    unused: list[str]
    """columns that are ignored"""
    current_positive: Literal["discharge", "charge"]
    assumed: dict[str, float]
    """values of the battery that the car's published values fill in"""


class FileDocument(ResponseModel):
    """One uploaded table."""

    name: str
    kind: int | None
    """number of its kind; null for a file that is ignored or has no columns"""
    state: Literal["read", "in part", "left out", "ignored"]
    rows: int
    rows_used: int
    logs: int
    faults: list[ProblemFault]
    """the first ones"""


class LogsResponse(ResponseModel):
    """How uploaded files are read, and what they hold then."""

    fields: list[FieldDocument]
    """our columns and their units"""
    kinds: list[KindDocument]
    files: list[FileDocument]
    report: list[Group]
    """what could not be read as it stands, the most frequent first"""
    preview: LogsPreview | None
    """null where nothing can be used"""
    faults: list[ProblemFault]
    """why not"""


class ScoreDocument(ResponseModel):
    """Forecasts beside what the trips took; null for what no trip shows."""

    trips: int
    error: float | None
    weighted_error: float | None
    bias: float | None
    coverage: float | None
    width: float | None
    """of the 90 % intervals, over the energy"""
    inside: int
    """trips within their 90 % interval"""
    needed_width: float | None
    """width with which the intervals would have held exactly 90 % of these trips"""


class SeasonDocument(ResponseModel):
    """A quarter of the year."""

    trips: int
    distance_m: float
    energy_wh: float
    """as measured"""
    error: float | None
    """sum of the errors of the forecasts over the energy"""
    coverage: float | None


class LearnedParameter(ResponseModel):
    """What the trips show of a factor by which the car differs from its simulation."""

    change: float
    """in the unit"""
    sd: float
    unit: Literal["1", "kW"]
    """1: relative to what the simulation gives; kW: a power that it does not have"""
    seen_degc: tuple[float, float] | None
    """outside temperatures of the trips that show it; null where none does: then it is what cars have in common"""


class DiaryEntry(ResponseModel):
    """A trip as it was forecast before the model was adapted to it, and what it took."""

    trip: str
    started_at: TimeText | None
    """in the zone of the service; null where unknown"""
    trips_learned: int
    """trips that the car had learned before"""
    distance_m: float
    duration_s: float
    ambient_temperature_degc: float | None
    energy_wh: float
    forecast_wh: float
    low_wh: float
    high_wh: float
    book_forecast_wh: float
    """by the published values of the car"""
    book_low_wh: float
    book_high_wh: float
    by_cause_wh: dict[str, float]
    """the forecast by cause"""
    has_heights: bool | None = None
    """null where an older version learned the trip"""
    on_the_way: list[MadeForecast]
    """of a trip that the service followed with a plan; the first one is that of the departure"""


class LearningDocument(ResponseModel):
    """Trips that a car learns, or has learned last."""

    state: Literal["running", "done", "failed"]
    done: int
    """trips that were forecast"""
    total: int | None
    """null before they are counted"""
    added: int | None
    """logs that are new; null while it runs"""
    known: int | None
    entries: int | None
    """new trips of the diary"""
    left_out: list[str]
    """drives that are not learned, with the reason; the first ones"""
    flat: int | None
    """new trips of the diary without heights: with the altitude of the app that logs them forecasts would be narrower"""
    faults: list[ProblemFault]


class CarSummary(ResponseModel):
    """A car of the service."""

    name: str
    """of its folder and its model"""
    label: str
    """as its owner calls it"""
    car: str
    """one of /v1/vehicles, or of its description"""
    title: str
    trips: int
    """logs in its store"""
    in_diary: int
    latest: ScoreDocument
    """of the last trips"""
    latest_by_book: ScoreDocument
    """the same by the published values of the car"""
    left_out: dict[str, str]
    """trips that did not enter the diary -> why"""
    has_token: bool
    """whether it can send messages"""


class CarResponse(CarSummary):
    """A car, what it learned, and its diary."""

    learned: dict[str, LearnedParameter]
    experts: dict[str, float]
    """how much each kind of model counts, by its forecasts so far; empty before the first trip"""
    score: ScoreDocument
    by_temperature: dict[str, ScoreDocument]
    by_season: dict[str, SeasonDocument]
    by_cause_wh: dict[str, float]
    diary: list[DiaryEntry]
    """the last trips, newest first"""
    learning: LearningDocument | None


class CarsResponse(ResponseModel):
    """The cars of the service."""

    cars: list[CarSummary] | None
    """null where the service keeps no cars"""
    damaged: dict[str, list[ProblemFault]]
    """names of cars that cannot be read -> why; they can be erased"""


class TokenResponse(ResponseModel):
    """A token with which a car sends its messages; it cannot be shown again."""

    token: str


class Forgotten(ResponseModel):
    """The car that was erased."""

    forgotten: str


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: None in place of a number that is not finite."""
    return None if isinstance(value, float) and value - value != 0.0 else value


class TelemetryRequest(BaseModel):
    """A message of a car in the format of A Better Routeplanner's live data; other fields are allowed."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True)

    tlm: dict[str, Any] | str | None = None
    """the message as an object, or as its JSON text; default: the fields beside the token. utc [s since 1970], by default now; speed [km/h], power [kW, output is positive], soc [%], voltage, current, elevation, ext_temp, batt_temp, cabin_temp, hvac_power [kW], hvac_setpoint, is_charging, is_parked"""
    token: str | None = Field(None, max_length=200)
    """token of the car; or as a bearer token"""


class TelemetryResponse(ResponseModel):
    """What became of a message."""

    status: Literal["ok", "held"]
    """`held`: the message waits until later ones confirm its time"""
    car: str
    arrival: Literal["new", "doubled", "held"]
    """only a new message counts; one that is too late to count is refused"""
    ignored: list[ProblemFault]
    """values that cannot be one"""


class LivePlanRequest(ForecastRequest):
    """The trip that a car is on or that comes next. What the plan leaves unknown of the departure is that of the car's messages."""

    destination: str | None = Field(None, max_length=200)
    """where the trip ends, in words"""
    stops: list[Stop] | None = Field(None, min_length=2, max_length=20)
    """places in their order, in place of the road: its road is the fastest one between them"""


@described
class LiveCarDocument(LiveResponse):
    """A car on the road, with what the request includes of what is ahead of it."""

    need: NotRequired[NeedResponse | None]
    """of the next trip; null on a trip, and without a plan or a usual trip"""
    range: NotRequired[RangeResponse | None]
    """null without a charge"""
    next: NotRequired[list[NeedResponse]]
    """of the next 10 and 50 km, on a trip without a plan"""


class LiveCarsResponse(ResponseModel):
    """The cars that the service follows, by name."""

    cars: list[LiveCarDocument]
