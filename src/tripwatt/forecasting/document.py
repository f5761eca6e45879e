"""A forecast as data: what `Forecast.to_dict`, the command line and the service give.

The docstrings of the fields are their descriptions in the service's OpenAPI document, the annotated units those of a model's contract.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Final, TypeVar

from typing_extensions import TypedDict  # pydantic takes that of typing from Python 3.12 on

from tripwatt.arrays import FloatArray

QUANTILES: Final = (0.025, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.975)
ARRIVAL_LEVELS: Final = (0.0, 0.05, 0.1, 0.2)
Kind = TypeVar("Kind", bound=type)


def described(kind: Kind) -> Kind:
    """Set up a document class: its pydantic schema describes fields by their docstrings and forbids other fields."""
    kind.__pydantic_config__ = {"use_attribute_docstrings": True, "extra": "forbid"}  # type: ignore[attr-defined]
    return kind


@described
class FlagDocument(TypedDict):
    """An assumption, or a value outside the range of the training trips."""

    code: str
    """kind of flag"""
    subject: str
    """field or component that the flag concerns"""
    value: float | str | None
    """value found or assumed, in `unit`"""
    unit: str
    message: str
    """the flag as an English sentence"""


@described
class Series(TypedDict):
    """Values at departure and at the end of every time step; low and high are the central 90 % interval."""

    time_s: list[float]
    """time since departure [s]"""
    distance_m: list[float]
    energy_wh: list[float]
    """energy since departure [Wh]"""
    energy_low_wh: list[float]
    energy_high_wh: list[float]
    displayed_soc: list[float]
    """displayed state of charge; 0 where the battery is empty"""
    displayed_soc_low: list[float]
    displayed_soc_high: list[float]


@described
class EmptyAt(TypedDict):
    """Distance at which the display reaches 0 [m], at the ends and the middle of the 90 % band; null: not on this trip."""

    early: float | None
    expected: float | None
    late: float | None


@described
class UnknownClimbDocument(TypedDict):
    """What the climb of a road of unknown heights changes."""

    terrain: str
    """country that the interval allows for"""
    expected_m: float | None
    """net climb of the trip by the heights of places beside the road [m]; null if nothing is known"""
    soc_per_m: float
    """displayed state of charge that each metre of climb takes [1/m]"""
    changes_at_m: dict[str, float | None]
    """by displayed state of charge: net climb with which the expected arrival falls to it [m]; null where no road of this length and country climbs so far"""


@described
class Missing(TypedDict):
    """Energy that the trip takes beyond what the battery holds [Wh], at the ends and the middle of the 90 % band."""

    least: float
    expected: float
    most: float


@described
class LeaveWith(TypedDict):
    """The charge to leave with; on the way, the charge to go on with from the last reading."""

    soc_needed: float
    """displayed state of charge with which the trip arrives with the reserve with the probability; above 1: a full battery does not suffice; 0: any charge does"""
    reserve: float
    probability: float
    message: str
    """the same as an English sentence"""


@described
class ForecastResponse(TypedDict):
    """The forecast of a trip, as `tripwatt forecast --json` prints it."""

    trip: str
    given: str
    """what the forecast is conditional on"""
    energy_wh: Annotated[float, "Wh"]
    """expected energy at the battery terminals over the whole trip [Wh]"""
    quantiles_wh: Annotated[dict[str, float], "Wh"]
    """quantiles of the energy [Wh] by probability"""
    soc_arrival: Annotated[float, "1, displayed"]
    """displayed state of charge at arrival; 0 where the battery is empty before arrival"""
    soc_quantiles: Annotated[dict[str, float], "1, displayed, by probability"]
    """quantiles of the displayed state of charge at arrival by probability"""
    empty_at_m: Annotated[EmptyAt, "m, early, expected and late"]
    missing_wh: Annotated[Missing, "Wh, least, expected and most"]
    wh_per_display: Annotated[float, "Wh"]
    """energy of a whole display [Wh]"""
    p_arrive_by_soc: Annotated[dict[str, float], "1, by displayed state of charge at the end"]
    """probability to arrive with at least this displayed state of charge; 0: at all"""
    climb: UnknownClimbDocument | None
    """null where the heights of the road are known"""
    leave_with: Annotated[LeaveWith | None, "soc_needed, reserve, probability, message"]
    """null where the request has no probability"""
    series: Annotated[Series, "by column"]
    by_cause_wh: Annotated[dict[str, float], "Wh"]
    """energy by cause [Wh]; the sum is energy_wh"""
    battery_loss_wh: Annotated[float, "Wh"]
    """heat loss inside the battery, not part of energy_wh [Wh]"""
    measured_until_s: Annotated[float, "s"]
    """time up to which measurements are used [s]; 0 before departure"""
    flags: Annotated[list[FlagDocument], "code, subject, value, unit, message"]
    """assumptions, and values outside the range of the training trips"""


def by_probability(values: FloatArray, p: Sequence[float]) -> dict[str, float]:
    """Quantiles as plain values, by their probability."""
    return {f"{level:g}": value for level, value in zip(p, values.tolist(), strict=True)}
