"""The state of a car on the road as plain values: the same over HTTP, over MQTT and on the page.

The docstrings of the fields are their descriptions in the OpenAPI document.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal, NotRequired, cast

from pydantic import Field
from typing_extensions import TypedDict  # pydantic cannot read that of Python 3.11

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast
from tripwatt.forecasting.document import FlagDocument, by_probability, described
from tripwatt.roads.advice import Message, Progress
from tripwatt.trips.messages import flag_to_dict

TimeText = Annotated[str, Field(json_schema_extra={"format": "date-time"})]
"""A time in ISO 8601 with its zone."""

QUANTILES: Final = (0.05, 0.5, 0.95)
LOW, HIGH = f"{QUANTILES[0]:g}", f"{QUANTILES[-1]:g}"
"""Ends of the 90 % interval."""


ROAD_FIELDS: Final = ("samples", "links", "elevation")
"""Fields of a road."""


@described
class ProblemFault(TypedDict):
    """One thing that is wrong with an input."""

    code: str
    """kind of the fault"""
    what: str
    """the same in words"""
    where: str
    """field, or position in an upload"""
    parameter: NotRequired[str | None]
    """name of the parameter in the URL of the request"""
    pointer: NotRequired[str | None]
    """JSON pointer (RFC 6901) of the field in the body of the request"""
    got: NotRequired[str | None]
    allowed: NotRequired[str | None]
    fix: NotRequired[str | None]


def place_in(body: Any, steps: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """Return a place in a parsed body as far as the body has it; a road may be in a `route`, or the first of its `roads`.

    Examples
    --------
    >>> place_in({"route": {"links": [{"grade": 5}]}}, ("links", 0, "grade")), place_in({"a": [1]}, ("a", 7))
    (('route', 'links', 0, 'grade'), ('a',))
    """
    if steps[:1] and isinstance(body, dict) and steps[0] in ROAD_FIELDS and body.get(f"{steps[0]}") is None:
        steps = (*next((outer for outer in (("route",), ("roads", 0)) if outer[0] in body), ()), *steps)
    try:
        inner = body[int(steps[0])] if isinstance(body, list) else dict(body)[steps[0]]
    except (LookupError, TypeError, ValueError):
        return ()
    return (steps[0], *place_in(inner, steps[1:]))


@described
class LiveForecastDocument(TypedDict):
    """The forecast of a trip, given what was measured so far."""

    energy_wh: float
    """expected energy of the whole trip [Wh]"""
    quantiles_wh: dict[str, float]
    """quantiles of the energy [Wh], by probability"""
    soc_arrival: float
    """displayed state of charge at arrival"""
    soc_quantiles: dict[str, float]
    """quantiles of the displayed state of charge at arrival"""
    reserve: float
    """displayed state of charge to keep"""
    p_arrive: float
    """probability to arrive with the reserve"""
    p_arrive_at_all: float
    """probability to arrive before the battery is empty"""
    measured_until_s: float
    """time of the last measurement that counts, since departure [s]"""
    duration_s: float
    """duration of the whole trip as planned [s]"""
    distance_m: float
    """length of the whole trip [m]"""
    course: Progress
    flags: list[FlagDocument]
    """what was assumed, such as a charge at departure that no message shows"""


@described
class LiveTripDocument(TypedDict):
    """The trip that a car is on."""

    departs_at: TimeText
    """UTC"""
    duration_s: float
    distance_m: float
    samples: int
    """messages that count"""
    energy_wh: float | None
    """measured so far [Wh]; null where no message has a power"""
    power_w: float | None
    """of the battery, by the latest message [W]; output is positive"""


@described
class LiveMessages(TypedDict):
    """Messages since the service was started."""

    new: int
    doubled: int
    late: int
    """too late, or with a time of another clock: they do not count"""
    faulty: int
    """no sample, or with a value that cannot be one; its other values count"""


@described
class LiveResponse(TypedDict):
    """A car on the road."""

    car: str
    """name of its folder"""
    seconds_since_message: float | None
    """null before the first message"""
    messages: LiveMessages
    held: int
    """messages that wait until later ones confirm their time"""
    soc: float | None
    """displayed state of charge by the latest message that has a charge; of a charge of the battery management, what the display shows by the model of the car"""
    soc_source: Literal["soc", "bms_soc"] | None
    """whether that message has the displayed charge (`soc`) or that of the battery management; null before the first one"""
    ambient_temperature_degc: float | None
    """outside temperature by the latest message that has one, in the last 24 h [°C]"""
    trip: LiveTripDocument | None
    """null while the car is on no trip"""
    plan: Literal["given", "usual"] | None
    """the plan that was given, or the road of an earlier trip that began at about this time of day"""
    usual_trip: str | None
    """name of that trip"""
    destination: str | None
    """of the plan"""
    forecast: LiveForecastDocument | None
    """null without a plan"""
    flags: list[FlagDocument]
    """what is assumed of the car: another one where nothing describes it"""
    message: Message | None
    """what to do, evaluated every minute of a trip; null before that"""
    faults: list[ProblemFault]
    """why the last messages are not in the forecast; empty when they are"""


def live_forecast(forecast: Forecast, departing: Forecast, reserve: float) -> LiveForecastDocument:
    """Convert a forecast to plain values; `departing` is that of the departure.

    Raises
    ------
    InvalidInput
        When a value is not finite: no car can drive the trip.
    """
    energies_wh, charges = forecast.along.quantiles(QUANTILES)
    document: Any = {
        "energy_wh": float(forecast.along.energy_wh[-1]),
        "quantiles_wh": by_probability(energies_wh, QUANTILES),
        "soc_arrival": forecast.soc_arrival,
        "soc_quantiles": by_probability(charges, QUANTILES),
        "reserve": reserve,
        "p_arrive": forecast.p_arrive(reserve),
        "p_arrive_at_all": forecast.p_arrive(),
        "measured_until_s": forecast.measured_until_s,
        "duration_s": forecast.plan.duration_s,
        "distance_m": float(forecast.drive.distance_m[-1]),
        "course": vars(Progress.of(departing, forecast)),
        "flags": [flag_to_dict(flag) for flag in forecast.flags],
    }
    values = [value for value in document.values() if isinstance(value, float)]
    require_plausible(*values, *document["quantiles_wh"].values())
    return cast(LiveForecastDocument, document)


def require_plausible(*values: float) -> None:
    """Check that all values of a forecast are finite, because JSON has no other numbers.

    Raises
    ------
    InvalidInput
        When a value is not finite: no car can drive the trip.
    """
    if not math.isfinite(sum(values)):  # one value that is not finite makes the sum so
        raise InvalidInput.of("no forecast", "trip", "implausible results", "a trip that a car can drive")
