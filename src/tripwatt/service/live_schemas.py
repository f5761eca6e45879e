"""Schemas of the requests and responses of cars on the road."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tripwatt.live.telemetry import FIRST_TIME_S, LAST_TIME_S
from tripwatt.service.schemas import ForecastRequest, ProblemFault, ResponseModel


class TelemetryRequest(BaseModel):
    """A message of a car in the format of A Better Routeplanner's live data; other fields are allowed."""

    model_config = ConfigDict(extra="allow")

    tlm: dict[str, Any] | str = Field(
        description="the message as an object, or as its JSON text: utc [s since 1970] is required; speed [km/h], "
        "power [kW, output is positive], soc [%], voltage, current, elevation, ext_temp, batt_temp, cabin_temp, "
        "hvac_power [kW], hvac_setpoint, is_charging, is_parked"
    )
    token: str | None = Field(None, max_length=200, description="token of the car; or as a bearer token")


class TelemetryResponse(ResponseModel):
    """What became of a message."""

    status: Literal["ok"]
    vehicle: str
    arrival: Literal["new", "doubled", "late"] = Field(description="only a new message counts")
    ignored: list[ProblemFault] = Field(description="values that cannot be one")


class LivePlanRequest(ForecastRequest):
    """The trip that a car is on or that comes next. What the plan leaves unknown of the departure is that of the car's messages."""

    departure_utc: float | None = Field(
        None,
        ge=FIRST_TIME_S,
        le=LAST_TIME_S,
        description="departure [s since 1970]; default: the start of the trip. Earlier messages do not count",
    )


class NeedResponse(ResponseModel):
    """What the next trip of a car needs, for charge planning."""

    vehicle: str
    plan: Literal["given", "usual"] = Field(
        description="the plan that was given, or the road of an earlier trip that began at about this time of day"
    )
    usual_trip: str | None = Field(description="name of that trip")
    probability: float = Field(description="with which energy and charge suffice")
    reserve: float = Field(description="displayed state of charge to arrive with")
    expected_wh: float = Field(description="expected energy of the trip [Wh]")
    energy_wh: float = Field(description="quantile of the energy at the probability [Wh]")
    soc_needed: float = Field(
        description="displayed state of charge to leave with; above 1 where a full battery does not suffice, 0 where any "
        "charge does"
    )
    message: str = Field(description="`soc_needed` as an English sentence")
    wh_per_display: float = Field(description="energy of a whole display [Wh]")
    soc: float | None = Field(
        description="displayed state of charge of the last messages; null where unknown or on a trip"
    )
    charge_wh: float | None = Field(
        description="energy that is missing in the battery, up to a full one [Wh]"
    )


class LiveTripDocument(ResponseModel):
    """The trip that a car is on."""

    departure_utc: float = Field(description="[s since 1970]")
    duration_s: float
    distance_m: float
    samples: int = Field(description="messages that count")


class LiveForecastDocument(ResponseModel):
    """The forecast of a trip, given what was measured so far."""

    energy_wh: float = Field(description="energy of the whole trip [Wh]")
    quantiles_wh: dict[str, float] = Field(description="quantiles of the energy [Wh], by probability")
    soc_arrival: float = Field(description="displayed state of charge at arrival")
    soc_quantiles: dict[str, float] = Field(
        description="quantiles of the displayed state of charge at arrival"
    )
    reserve: float = Field(description="displayed state of charge to keep")
    p_arrive: float = Field(description="probability to arrive with the reserve")
    p_arrive_at_all: float = Field(description="probability to arrive before the battery is empty")
    measured_until_s: float = Field(
        description="time of the last measurement that counts, since departure [s]"
    )
    distance_m: float = Field(description="length of the whole trip [m]")


class LiveMessages(ResponseModel):
    """Messages since the service was started."""

    new: int
    doubled: int
    late: int


class LiveResponse(ResponseModel):
    """A car on the road."""

    vehicle: str
    seconds_since_message: float | None = Field(description="null before the first message")
    messages: LiveMessages
    soc: float | None = Field(description="displayed state of charge of the latest message that has one")
    trip: LiveTripDocument | None = Field(description="null while the car is on no trip")
    plan: Literal["given", "usual"] | None = Field(
        description="the plan that was given, or the road of an earlier trip that began at about this time of day"
    )
    usual_trip: str | None = Field(description="name of that trip")
    forecast: LiveForecastDocument | None = Field(description="null without a plan")
    faults: list[ProblemFault] = Field(
        description="why the last messages are not in the forecast; empty when they are"
    )


class LiveCarSummary(ResponseModel):
    """A car that the service follows."""

    vehicle: str
    seconds_since_message: float | None = Field(description="null before the first message")
    on_trip: bool


class LiveCarsResponse(ResponseModel):
    """The cars that the service follows, by name."""

    vehicles: list[LiveCarSummary]
