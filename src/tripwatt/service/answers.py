"""Documents that the service answers with, as the OpenAPI describes them. They are made in `work`."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


class Answer(BaseModel):
    """What all answers are: objects with nothing unsaid."""

    model_config = ConfigDict(extra="forbid")


class FlagAnswer(Answer):
    """An assumption, or a value outside the range of the training trips."""

    code: str = Field(description="kind of flag")
    subject: str = Field(description="field or component that the flag concerns")
    value: float | str | None = Field(description="value found or assumed, in `unit`")
    unit: str
    message: str = Field(description="the flag as an English sentence")


class Series(Answer):
    """Values at departure and at the end of every time step; low and high are the central 90 % interval."""

    time_s: list[float] = Field(description="time since departure [s]")
    distance_m: list[float]
    energy_wh: list[float] = Field(description="energy since departure [Wh]")
    energy_low_wh: list[float]
    energy_high_wh: list[float]
    displayed_soc: list[float] = Field(description="displayed state of charge; below 0 the battery is empty")
    displayed_soc_low: list[float]
    displayed_soc_high: list[float]


class ForecastAnswer(Answer):
    """The forecast of a trip, as `tripwatt forecast --json` prints it."""

    trip: str
    given: str = Field(description="what the forecast is conditional on")
    energy_wh: float = Field(description="energy at the battery terminals over the whole trip [Wh]")
    quantiles_wh: dict[str, float] = Field(description="quantiles of the energy [Wh] by probability")
    soc_arrival: float = Field(
        description="displayed state of charge at arrival; below 0 the battery is empty before arrival"
    )
    p_arrive: dict[str, float] = Field(
        description="probability to arrive with at least this displayed state of charge"
    )
    series: Series
    by_cause_wh: dict[str, float] = Field(description="energy by cause [Wh]; the sum is energy_wh")
    battery_loss_wh: float = Field(description="heat loss inside the battery, not part of energy_wh [Wh]")
    measured_until_s: float = Field(
        description="time up to which measurements are used [s]; 0 before departure"
    )
    flags: list[FlagAnswer] = Field(
        description="assumptions, and values outside the range of the training trips"
    )


class ProblemFault(Answer):
    """One thing that is wrong with an input."""

    what: str
    where: str = Field(description="field, or position in an upload")
    got: str | None = None
    allowed: str | None = None
    fix: str | None = None


class ProblemDocument(Answer):
    """Problem document of RFC 9457."""

    type: str = Field(description="kind of problem, as a path")
    title: str
    status: int
    detail: str | None = None
    instance: str | None = Field(None, description="X-Request-ID of the request")
    faults: list[ProblemFault] | None = Field(None, description="all faults of the input")
    more_faults: int | None = Field(None, description="number of faults that are not listed")


class VehicleAnswer(Answer):
    """A car of the library."""

    name: str
    title: str
    test_mass_kg: float
    usable_energy_wh: float = Field(
        description="energy between 0 and 1 of the displayed state of charge [Wh]"
    )
    has_climate: bool = Field(description="whether heating and cooling are simulated")
    models: list[str] = Field(
        description="models fitted on this car; other models forecast it with much wider intervals"
    )


class VehiclesAnswer(Answer):
    """Cars of the library."""

    vehicles: list[VehicleAnswer]


class ModelAnswer(BaseModel):
    """A model: its name in this service and its metadata."""

    name: str
    model: dict[str, Any]
    contract: dict[str, Any]
    provenance: dict[str, Any]
    evaluation: dict[str, Any]


class ModelsAnswer(Answer):
    """Models of this service; the first is the default."""

    models: list[ModelAnswer]


class ExampleAnswer(Answer):
    """A synthetic trip."""

    trip: str
    title: str
    vehicle: str
    note: str
    duration_s: float
    distance_m: float
    ambient_temperature_degc: float | None
    observed_energy_wh: float


class ExampleTripAnswer(ExampleAnswer):
    """A synthetic trip with its samples."""

    request: dict[str, Any] = Field(description="a ForecastRequest")
    observed: dict[str, list[float | None]] = Field(description="simulated measurements of the whole trip")


class ExamplesAnswer(Answer):
    """Synthetic trips as examples."""

    examples: list[ExampleAnswer]


class ElevationAnswer(Answer):
    """Elevation along a route of links."""

    position_m: list[float]
    elevation_m: list[float]


class RouteAnswer(Answer):
    """An uploaded route or trip. Send `links` with `elevation`, or `samples`, in a ForecastRequest."""

    samples: dict[str, list[float | None]] = Field(
        description="speed trace; for a planned route, that of the driver model"
    )
    links: list[dict[str, float]] | None = Field(
        description="links of the planned route; null for a logged trip"
    )
    elevation: ElevationAnswer | None
    duration_s: float
    distance_m: float
    notes: list[FlagAnswer] = Field(description="assumptions")


class HealthAnswer(Answer):
    """State of the service."""

    status: str
    workers: int = Field(description="number of worker processes that are ready")
