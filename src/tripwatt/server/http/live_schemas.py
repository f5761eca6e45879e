"""Schemas of the requests and responses of cars on the road."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tripwatt.forecasting.document import FlagDocument
from tripwatt.server.cars.documents import ProblemFault
from tripwatt.server.http.advice_schemas import UntilDeparture
from tripwatt.server.http.schemas import ForecastRequest, ResponseModel, StrictModel, Time, asked
from tripwatt.trips import ASKED


class TelemetryRequest(BaseModel):
    """A message of a car in the format of A Better Routeplanner's live data; other fields are allowed."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True)

    tlm: dict[str, Any] | str
    """the message as an object, or as its JSON text: utc [s since 1970] is required; speed [km/h], power [kW, output is positive], soc [%], voltage, current, elevation, ext_temp, batt_temp, cabin_temp, hvac_power [kW], hvac_setpoint, is_charging, is_parked"""
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


class LiveDeparture(StrictModel):
    """When a car leaves."""

    departs_at: Time | None = asked("departs_at", ASKED["departs_at"])[1]
    """departure; default: the start of the trip. Earlier messages do not count"""

    @property
    def departure_s(self) -> float | None:
        """Departure [s since 1970]."""
        return None if self.departs_at is None else self.departs_at.timestamp()


class LivePlanRequest(LiveDeparture, ForecastRequest):
    """The trip that a car is on or that comes next. What the plan leaves unknown of the departure is that of the car's messages."""


class NeedResponse(UntilDeparture):
    """What the next trip of a car needs, for charge planning."""

    car: str
    plan: Literal["given", "usual"]
    """the plan that was given, or the road of an earlier trip that began at about this time of day"""
    usual_trip: str | None
    """name of that trip"""
    probability: float
    """with which energy and charge suffice"""
    reserve: float
    """displayed state of charge to arrive with"""
    expected_wh: float
    """expected energy of the trip [Wh]"""
    energy_quantile_wh: float
    """not exceeded with the probability [Wh]"""
    soc_needed: float
    """displayed state of charge to leave with; above 1 where a full battery does not suffice, 0 where any charge does"""
    message: str
    """`soc_needed` as an English sentence"""
    wh_per_display: float
    """energy of a whole display [Wh]"""
    flags: list[FlagDocument]
    """what was assumed, such as an outside temperature of the car's last message"""


class LiveCarSummary(ResponseModel):
    """A car that the service follows."""

    car: str
    seconds_since_message: float | None
    """null before the first message"""
    on_trip: bool


class LiveCarsResponse(ResponseModel):
    """The cars that the service follows, by name."""

    cars: list[LiveCarSummary]
