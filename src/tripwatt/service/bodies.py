"""Bodies of requests: what may stand in them, and what they mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import NoneType
from typing import Annotated, Any, Final, TypeVar

import numpy as np
import orjson
import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, ValidationError, WithJsonSchema

from tripwatt.errors import Fault, InvalidInput
from tripwatt.routes import LinkRoute, route_from_links
from tripwatt.routes.links import FASTEST_LINK_M_S, FLAT_ROAD_NOTE
from tripwatt.service.settings import Limits
from tripwatt.sources.canonical import LEAST_SAMPLES, canonical_samples
from tripwatt.trips import COLUMNS, FloatArray

LEAST_MEASURED: Final = 2
LEAST_DURATION_S: Final = 1.0
"""The physics goes by seconds."""

NUMBERS: Final = frozenset({float, int, NoneType})
"""Types of JSON numbers and of null; true and false are none of them."""


def _columns_schema(required: list[str], least: int, meaning: str) -> dict[str, Any]:
    properties = {}
    for name, column in COLUMNS.items():
        item: dict[str, Any] = {"type": "number" if name in required else ["number", "null"]}
        if name == "time_s":
            item["minimum"] = 0.0
        else:
            item |= {"minimum": column.minimum, "maximum": column.maximum}
        properties[name] = {
            "type": "array",
            "items": item,
            "minItems": least,
            "description": f"{column.meaning} [{column.unit}]",
        }
    return {
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
        "description": meaning,
    }


Samples = Annotated[
    Any,
    WithJsonSchema(
        _columns_schema(
            ["time_s", "speed_m_s"],
            LEAST_SAMPLES,
            "Speed trace and road, a list for each column. Of other signals only the first sample counts.",
        )
    ),
]
Measured = Annotated[
    Any,
    WithJsonSchema(
        _columns_schema(
            ["time_s"],
            LEAST_MEASURED,
            "What was measured so far, on the trip's clock: voltage_v with current_a (+ discharges), or soc or "
            "displayed_soc.",
        )
    ),
]


def _one_of(**fields: str) -> dict[str, Any]:
    """Schema of an object that has one of two fields, of its type, and not the other."""
    return {
        "oneOf": [
            {
                "required": [name],
                "properties": {other: {"type": kind if other == name else "null"} for other in fields},
            }
            for name, kind in fields.items()
        ]
    }


class Link(BaseModel):
    """A piece of a planned road. Either `speed_m_s` or `travel_time_s`; either `grade` or both heights, or neither."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra=_one_of(speed_m_s="number", travel_time_s="number")
    )

    length_m: float = Field(gt=0, le=1e7, description="length [m]")
    speed_m_s: float | None = Field(
        None, gt=0, le=FASTEST_LINK_M_S, description="mean speed, standstill included [m/s]"
    )
    travel_time_s: float | None = Field(None, gt=0, description="time on it, standstill included [s]")
    stop_s: float | None = Field(
        None,
        ge=0,
        description="standstill at its end, part of its travel time [s]; 0 = the car does not stop",
    )
    moving_speed_m_s: float | None = Field(
        None, gt=0, le=FASTEST_LINK_M_S, description="speed while nothing stands in the way [m/s]"
    )
    speed_limit_m_s: float | None = Field(
        None, gt=0, le=FASTEST_LINK_M_S, description="highest allowed [m/s]"
    )
    grade: float | None = Field(None, ge=-0.4, le=0.4, description="rise over length [1]")
    start_elevation_m: float | None = Field(None, ge=-500, le=9000, description="height at its start [m]")
    end_elevation_m: float | None = Field(None, ge=-500, le=9000, description="height at its end [m]")


class Elevation(BaseModel):
    """Heights along a route of links, in place of those of the links."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    position_m: list[float] = Field(min_length=1, description="distances from the start, not falling [m]")
    elevation_m: list[float] = Field(min_length=1, description="height above sea level at each [m]")


Links = Annotated[
    Any,
    WithJsonSchema({"type": "array", "items": {"$ref": "#/components/schemas/Link"}, "minItems": 1}),
]
"""Checked by `tripwatt.routes.route_from_links`, not one object at a time."""


class ForecastRequest(BaseModel):
    """A trip to come: a speed trace (`samples`) or a planned road (`links`), and what is known at the door."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        json_schema_extra=_one_of(samples="object", links="array"),
    )

    model: str | None = Field(
        None, max_length=100, description="one of /v1/models; the first one if left out"
    )
    vehicle: str | None = Field(
        None, max_length=100, description="one of /v1/vehicles; the model's own car if left out"
    )
    trip: str = Field("trip", min_length=1, max_length=100, description="name of the trip in the answer")
    samples: Samples | None = None
    links: Links | None = None
    elevation: Elevation | None = None
    displayed_soc: float | None = Field(
        None, ge=0, le=1, description="state of charge at departure as the driver sees it [1]"
    )
    ambient_temperature_degc: float | None = Field(
        None, ge=-60, le=70, description="outside temperature [°C]"
    )
    cabin_setpoint_degc: float | None = Field(None, ge=0, le=45, description="set-point of the cabin [°C]")
    cabin_temperature_degc: float | None = Field(None, ge=-60, le=100, description="cabin at departure [°C]")
    battery_temperature_degc: float | None = Field(
        None, ge=-60, le=100, description="battery at departure [°C]"
    )
    payload_mass_kg: float | None = Field(None, ge=0, le=60_000, description="load besides the driver [kg]")
    reserve: float = Field(0.1, ge=0, le=1, description="displayed state of charge to arrive with [1]")


class UpdateRequest(ForecastRequest):
    """The same trip, and what was measured on it so far."""

    observed: Measured


DEPARTURE: Final = (
    "displayed_soc",
    "ambient_temperature_degc",
    "cabin_setpoint_degc",
    "cabin_temperature_degc",
    "battery_temperature_degc",
    "payload_mass_kg",
)


Body = TypeVar("Body", bound=BaseModel)


class NotJson(Exception):
    """A body that is no JSON document."""


def parse(body: bytes, kind: type[Body]) -> Body:
    """The request that a body holds.

    Raises
    ------
    NotJson
        When it is no JSON. NaN, infinities and numbers that no float holds are none.
    InvalidInput
        With what is wrong with its fields.
    """
    try:
        document = orjson.loads(body)
    except orjson.JSONDecodeError as error:
        raise NotJson(str(error)) from error
    try:
        return kind.model_validate(document)
    except ValidationError as error:
        raise InvalidInput(
            Fault(
                e["msg"],
                ".".join(map(str, e["loc"])) or "body",
                repr(e["input"])[:80],
            )
            for e in error.errors(include_url=False, include_context=False)
        ) from error


def samples_of(value: Any, limits: Limits) -> pd.DataFrame:
    """Checked samples of the trip of a request."""
    samples = canonical_samples(_columns(value, "samples", limits), "samples")
    time = samples["time_s"].to_numpy()
    require_duration(float(time[-1] - time[0]), "samples", limits)
    return samples


def measured_of(value: Any, limits: Limits) -> pd.DataFrame:
    """Checked samples of what was measured."""
    return canonical_samples(
        _columns(value, "observed", limits), "observed", required=("time_s",), least=LEAST_MEASURED
    )


def route_of(links: Any, elevation: Elevation | None, limits: Limits) -> LinkRoute:
    """Checked links of a request, with the heights that it gives beside them."""
    if not isinstance(links, list):
        raise InvalidInput(Fault("not a list", "links", repr(links)[:60], "a list of objects"))
    if len(links) > limits.links:
        raise InvalidInput(Fault("too many links", "links", f"{len(links)}", f"at most {limits.links}"))
    route = route_from_links(links)
    require_duration(route.duration_s, "links", limits)
    if elevation is None:
        return route
    position, height = np.array(elevation.position_m), np.array(elevation.elevation_m)
    faults = []
    if position.shape != height.shape or len(position) > limits.samples:
        got = f"{len(position)} positions and {len(height)} heights"
        faults.append(Fault("heights disagree", "elevation", got, f"as many, at most {limits.samples}"))
    if (np.diff(position) < 0).any() or position[0] < 0:
        faults.append(Fault("position falls", "elevation.position_m", "", "0 m or more, not falling"))
    if any("start_elevation_m" in link or "grade" in link for link in links):
        faults.append(Fault("two roads", "elevation", "links that have heights or grades", "one of both"))
    if faults:
        raise InvalidInput(faults)
    notes = tuple(note for note in route.notes if note != FLAT_ROAD_NOTE)
    return replace(route, elevation_position_m=position, elevation_m=height, notes=notes)


def require_duration(duration_s: float, where: str, limits: Limits) -> None:
    """Refuse a trip that takes longer than the service computes, or no time at all."""
    if not LEAST_DURATION_S <= duration_s <= limits.duration_s:
        allowed = f"{LEAST_DURATION_S:g} to {limits.duration_s:g} s"
        raise InvalidInput(Fault("duration out of range", where, f"{duration_s:g} s", allowed))


def _columns(value: Any, where: str, limits: Limits) -> dict[str, FloatArray]:
    if not isinstance(value, Mapping):
        raise InvalidInput(Fault("not an object", where, repr(value)[:60], "an object of lists of numbers"))
    faults = []
    columns: dict[str, FloatArray] = {}
    for name, values in value.items():
        place = f"{where}.{name}"[:80]
        if not isinstance(values, list):
            faults.append(Fault("not a list", place, repr(values)[:60], "a list of numbers"))
        elif len(values) > limits.samples:
            faults.append(Fault("too many samples", place, f"{len(values)}", f"at most {limits.samples}"))
        elif not set(map(type, values)) <= NUMBERS:
            first = next(k for k, v in enumerate(values) if type(v) not in NUMBERS)
            got = repr(values[first])[:60]
            faults.append(Fault("not a number", f"{place}[{first}]", got, "a number, or null where unknown"))
        else:
            columns[name] = np.array(values, dtype=np.float64)
    if faults:
        raise InvalidInput(faults)
    return columns
