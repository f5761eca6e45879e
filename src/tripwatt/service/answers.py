"""Documents that the service answers with, as the OpenAPI describes them. They are made in `work`."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


class Answer(BaseModel):
    """What all answers are: objects with nothing unsaid."""

    model_config = ConfigDict(extra="forbid")


class FlagAnswer(Answer):
    """Something that was assumed, or that lies outside what the model has learned from."""

    code: str = Field(description="what it is, for programs")
    subject: str = Field(description="the field or part that it is about")
    value: float | str | None = Field(description="what was found or assumed, in `unit`")
    unit: str
    message: str = Field(description="the same in English")


class Series(Answer):
    """Along the route: a value at departure and at the end of every block; the band is the central 90 %."""

    time_s: list[float] = Field(description="since departure [s]")
    distance_m: list[float]
    energy_wh: list[float] = Field(description="taken so far [Wh]")
    energy_low_wh: list[float]
    energy_high_wh: list[float]
    displayed_soc: list[float] = Field(description="state of charge that the driver sees; below 0 = empty")
    displayed_soc_low: list[float]
    displayed_soc_high: list[float]


class ForecastAnswer(Answer):
    """The forecast of a trip, as `tripwatt forecast --json` prints it."""

    trip: str
    given: str = Field(description="what the forecast takes as known")
    energy_wh: float = Field(description="energy at the battery terminals over the whole trip [Wh]")
    quantiles_wh: dict[str, float] = Field(description="probability -> energy [Wh]")
    soc_arrival: float = Field(description="displayed state of charge at the end; below 0 = it does not last")
    p_arrive: dict[str, float] = Field(
        description="displayed state of charge -> probability to arrive with at least as much"
    )
    series: Series
    by_cause_wh: dict[str, float] = Field(description="cause -> energy [Wh]; they add up to energy_wh")
    battery_loss_wh: float = Field(description="heat in the battery, on top of the energy [Wh]")
    measured_until_s: float = Field(description="how much of the trip was measured [s]; 0 before departure")
    flags: list[FlagAnswer] = Field(
        description="what was unknown, or lies outside the range of the training trips"
    )


class ProblemFault(Answer):
    """One thing that is wrong with an input."""

    what: str
    where: str = Field(description="the field, or the place in an upload")
    got: str | None = None
    allowed: str | None = None
    fix: str | None = None


class ProblemDocument(Answer):
    """RFC 9457: a request that is not answered, and why."""

    type: str = Field(description="the kind of problem, a path")
    title: str
    status: int
    detail: str | None = None
    instance: str | None = Field(None, description="the request, as its X-Request-ID")
    faults: list[ProblemFault] | None = Field(None, description="everything that is wrong with the input")
    more_faults: int | None = Field(None, description="faults that are not listed")


class VehicleAnswer(Answer):
    """A car of the library."""

    name: str
    title: str
    test_mass_kg: float
    usable_energy_wh: float = Field(description="between 0 and 1 of the displayed state of charge [Wh]")
    has_climate: bool = Field(description="whether its heating and cooling are simulated")
    models: list[str] = Field(
        description="models that were fitted on it; others forecast it with much wider bands"
    )


class VehiclesAnswer(Answer):
    """Cars of the library."""

    vehicles: list[VehicleAnswer]


class ModelAnswer(BaseModel):
    """What a model says of itself: its metadata.json and its name here."""

    name: str
    model: dict[str, Any]
    contract: dict[str, Any]
    provenance: dict[str, Any]
    evaluation: dict[str, Any]


class ModelsAnswer(Answer):
    """Models that requests may name, the first one being meant where none is named."""

    models: list[ModelAnswer]


class ExampleAnswer(Answer):
    """A synthetic trip: computed, not driven."""

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
    observed: dict[str, list[float | None]] = Field(description="what was 'measured' on all of it")


class ExamplesAnswer(Answer):
    """Synthetic trips to try the service with."""

    examples: list[ExampleAnswer]


class ElevationAnswer(Answer):
    """Heights along a route of links."""

    position_m: list[float]
    elevation_m: list[float]


class RouteAnswer(Answer):
    """What an upload holds; `links` with `elevation`, or else `samples`, go into a ForecastRequest."""

    samples: dict[str, list[float | None]] = Field(
        description="the drive; for a planned road, how a driver would drive it"
    )
    links: list[dict[str, float]] | None = Field(description="the planned road; null for a logged drive")
    elevation: ElevationAnswer | None
    duration_s: float
    distance_m: float
    notes: list[FlagAnswer] = Field(description="what had to be assumed")


class HealthAnswer(Answer):
    """How the service is."""

    status: str
    workers: int = Field(description="processes that compute and are ready")
