"""Bodies of requests: what may stand in them, and what they mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import NoneType
from typing import Annotated, Any, Final, TypeVar

import numpy as np
import orjson
import pandas as pd
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError, WithJsonSchema

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput
from tripwatt.routes import LinkRoute, route_from_links
from tripwatt.routes.links import FLAT_ROAD
from tripwatt.service.settings import Limits
from tripwatt.sources.canonical import LEAST_SAMPLES, canonical_samples
from tripwatt.trips import COLUMNS, LINK_COLUMNS, QUANTITIES, Column

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
            "Speed trace and road, one list per column. Other signals give only their first sample.",
        )
    ),
]
Measured = Annotated[
    Any,
    WithJsonSchema(
        _columns_schema(
            ["time_s"],
            LEAST_MEASURED,
            "Samples measured so far, on the clock of the trip: voltage_v with current_a (positive when the battery "
            "discharges), or soc or displayed_soc.",
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


def _field(
    columns: Mapping[str, Column],
    name: str,
    default: Any = None,
    *,
    positive: bool = False,
    also: AliasChoices | None = None,
) -> Any:
    """A number with the bounds and the meaning that the schema gives it."""
    column = columns[name]
    return Field(
        default,
        gt=0.0 if positive else None,
        ge=None if positive else column.minimum,
        le=column.maximum,
        validation_alias=also,
        description=f"{column.meaning} [{column.unit}]",
    )


class Link(BaseModel):
    """A link of a planned route. Give `speed_m_s` or `travel_time_s`. Give `grade`, both elevations, or neither."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra=_one_of(speed_m_s="number", travel_time_s="number")
    )

    length_m: float = _field(LINK_COLUMNS, "length_m", ..., positive=True)
    speed_m_s: float | None = _field(LINK_COLUMNS, "speed_m_s", positive=True)
    travel_time_s: float | None = _field(LINK_COLUMNS, "travel_time_s", positive=True)
    stop_s: float | None = _field(LINK_COLUMNS, "stop_s")
    moving_speed_m_s: float | None = _field(LINK_COLUMNS, "moving_speed_m_s", positive=True)
    speed_limit_m_s: float | None = _field(LINK_COLUMNS, "speed_limit_m_s", positive=True)
    grade: float | None = _field(LINK_COLUMNS, "grade")
    start_elevation_m: float | None = _field(LINK_COLUMNS, "start_elevation_m")
    end_elevation_m: float | None = _field(LINK_COLUMNS, "end_elevation_m")


class Elevation(BaseModel):
    """Elevation along a route of links; replaces grades and elevations of the links."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    position_m: list[float] = Field(
        min_length=1, description="distances from the start, never decreasing [m]"
    )
    elevation_m: list[float] = Field(
        min_length=1, description="elevation above sea level at each position [m]"
    )


Links = Annotated[
    Any,
    WithJsonSchema({"type": "array", "items": {"$ref": "#/components/schemas/Link"}, "minItems": 1}),
]
"""Checked by `tripwatt.routes.route_from_links`, not one object at a time."""


class ForecastRequest(BaseModel):
    """A trip to forecast: a speed trace (`samples`) or a planned route (`links`), and the state at departure."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        json_schema_extra=_one_of(samples="object", links="array"),
    )

    model: str | None = Field(None, max_length=100, description="one of /v1/models; default: the first one")
    vehicle: str | None = Field(
        None, max_length=100, description="one of /v1/vehicles; default: the car of the model"
    )
    trip: str = Field("trip", min_length=1, max_length=100, description="name of the trip in the response")
    samples: Samples | None = None
    links: Links | None = None
    elevation: Elevation | None = None
    soc: float | None = _field(COLUMNS, "displayed_soc", also=AliasChoices("soc", "displayed_soc"))
    ambient_temperature_degc: float | None = _field(COLUMNS, "ambient_temperature_degc")
    cabin_setpoint_degc: float | None = _field(COLUMNS, "cabin_setpoint_degc")
    cabin_temperature_degc: float | None = _field(COLUMNS, "cabin_temperature_degc")
    battery_temperature_degc: float | None = _field(COLUMNS, "battery_temperature_degc")
    payload_mass_kg: float | None = _field(QUANTITIES, "payload_mass_kg")
    reserve: float = _field(QUANTITIES, "reserve", 0.1)


class UpdateRequest(ForecastRequest):
    """A trip to forecast, with the samples measured so far."""

    observed: Measured


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
        got = f"{len(position)} positions and {len(height)} elevations"
        faults.append(
            Fault(
                "positions and elevations differ in number",
                "elevation",
                got,
                f"equal numbers, at most {limits.samples}",
            )
        )
    if (np.diff(position) < 0).any() or position[0] < 0:
        faults.append(
            Fault("position decreases", "elevation.position_m", "", "0 m or more, never decreasing")
        )
    if any("start_elevation_m" in link or "grade" in link for link in links):
        faults.append(
            Fault("elevation given twice", "elevation", "links with elevations or grades", "one of the two")
        )
    if faults:
        raise InvalidInput(faults)
    flags = tuple(flag for flag in route.flags if flag != FLAT_ROAD)
    return replace(route, elevation_position_m=position, elevation_m=height, flags=flags)


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
