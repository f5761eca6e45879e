"""What the service computes: a body in, a document out, the same every time. Nothing here knows HTTP or waits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import orjson

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecast import (
    Forecast,
    ForecastModel,
    answer_of,
    load_metadata,
    load_model,
    since_departure,
    trip_to_come,
)
from tripwatt.forecast.storage import DEFAULT_MODEL
from tripwatt.routes import Departure, LinkRoute, plan_trip, read_route, route_from_links
from tripwatt.service.requests import (
    DEPARTURE,
    ForecastRequest,
    UpdateRequest,
    measured_of,
    parse,
    samples_of,
)
from tripwatt.service.settings import Limits
from tripwatt.sources.canonical import canonical_of_text
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import Context, Trip
from tripwatt.vehicles import load_vehicle, vehicle_names


@dataclass(frozen=True)
class Work:
    """The models that requests may name, and what can be done with them."""

    models: Mapping[str, ForecastModel]
    limits: Limits

    @classmethod
    def of(cls, folders: Mapping[str, Path], limits: Limits) -> Work:
        """Load the models; without folders the one that comes with the package."""
        models = {name: load_model(folder) for name, folder in folders.items()}
        return cls(models or {DEFAULT_MODEL: load_model()}, limits)

    def forecast(self, body: bytes) -> dict[str, Any]:
        """Answer to a `ForecastRequest`."""
        asked = parse(body, ForecastRequest)
        return answer_of(self._forecast(asked)[0], asked.reserve)

    def update(self, body: bytes) -> dict[str, Any]:
        """Answer to an `UpdateRequest`."""
        asked = parse(body, UpdateRequest)
        assert isinstance(asked, UpdateRequest)
        observed = measured_of(asked.observed, self.limits)
        found, trip = self._forecast(asked)
        return answer_of(found.update(since_departure(observed, trip)), asked.reserve)

    def _forecast(self, asked: ForecastRequest) -> tuple[Forecast, Trip]:
        model = self._model(asked)
        trip = self._trip(asked)
        return model.forecast(trip), trip

    def _model(self, asked: ForecastRequest) -> ForecastModel:
        name = next(iter(self.models)) if asked.model is None else asked.model
        if name not in self.models:
            raise InvalidInput(Fault("no such model", "model", repr(name)[:80], ", ".join(self.models)))
        model = self.models[name]
        if asked.vehicle not in (None, model.vehicle.name):
            raise InvalidInput(
                Fault("the model is of another car", "vehicle", repr(asked.vehicle)[:80], model.vehicle.name)
            )
        return model

    def _trip(self, asked: ForecastRequest) -> Trip:
        known = {name: getattr(asked, name) for name in DEPARTURE}
        if (asked.samples is None) == (asked.links is None):
            got = "neither" if asked.samples is None else "both"
            raise InvalidInput(Fault("which trip?", "samples, links", got, "either samples or links"))
        if asked.samples is not None:
            return trip_to_come(samples_of(asked.samples, "samples", self.limits), asked.trip, **known)
        route = route_from_links(asked.links)
        payload = known.pop("payload_mass_kg") or 0.0
        return plan_trip(
            route, Departure(**known, context=Context(payload_mass_kg=payload)), trip_id=asked.trip
        )

    def route(self, body: bytes, kind: str, speed_m_s: float | None) -> dict[str, Any]:
        """What an upload holds, as the fields of a `ForecastRequest`."""
        if kind == "csv":
            samples = canonical_of_text(body, "upload")
            links, notes = None, ()
        else:
            route = read_route(body, where="upload")
            trip = plan_trip(route, speed_m_s=speed_m_s)
            samples = trip.samples
            links = links_of(route) if isinstance(route, LinkRoute) else None
            notes = tuple(filter(None, trip.context.notes.split("; ")))
        time, speed = samples["time_s"].to_numpy(), samples["speed_m_s"].to_numpy()
        return {
            "samples": columns_of(samples),
            "links": links,
            "duration_s": float(time[-1] - time[0]),
            "distance_m": float(np.trapezoid(speed, time)),
            "notes": notes,
        }


def links_of(route: LinkRoute) -> list[dict[str, float]]:
    """A route as the links of a request."""
    border = np.concatenate(([0.0], np.cumsum(route.length_m)))
    columns = {
        "length_m": route.length_m,
        "travel_time_s": route.travel_time_s,
        "stop_s": route.stop_s,
        "moving_speed_m_s": route.moving_speed_m_s,
    }
    height = route.elevation_at(border)
    if height is not None:
        columns |= {"start_elevation_m": height[:-1], "end_elevation_m": height[1:]}
    names = list(columns)
    rows = zip(*(columns[name].tolist() for name in names), strict=True)
    return [{n: v for n, v in zip(names, row, strict=True) if v == v} for row in rows]


def columns_of(samples: Any) -> dict[str, list[float | None]]:
    """A table as the `samples` of a request; null where a value is missing."""
    return {
        name: [None if v != v else v for v in np.asarray(samples[name], dtype=np.float64).tolist()]
        for name in samples.columns
    }


@cache
def vehicles() -> dict[str, Any]:
    """Cars of the library."""
    rows = []
    for name in vehicle_names():
        car = load_vehicle(name)
        usable = car.battery.displayed_full_soc - car.battery.displayed_zero_soc
        rows.append(
            {
                "name": name,
                "title": car.title,
                "test_mass_kg": car.body.test_mass_kg,
                "battery_capacity_ah": car.battery.capacity_ah,
                "usable_share": usable,
                "has_climate": car.climate is not None,
            }
        )
    return {"vehicles": rows}


@cache
def examples() -> dict[str, dict[str, Any]]:
    """Synthetic trips to try the service with, by name: computed, not driven."""
    battery = load_vehicle(EXAMPLE_CAR).battery
    found = {}
    for trip in synthetic_fleet(EXAMPLES).trips:
        at_door = {
            name: float(trip.array(name)[0])
            for name in DEPARTURE
            if name in trip and np.isfinite(trip.array(name)[0])
        }
        at_door["displayed_soc"] = float(battery.displayed_from_soc(trip.array("soc")[0]))
        route = [c for c in ("time_s", "speed_m_s", "elevation_m") if c in trip]
        measured = [c for c in ("time_s", "voltage_v", "current_a", "soc") if c in trip]
        found[trip.trip_id] = {
            "trip": trip.trip_id,
            "title": trip.context.route or trip.trip_id,
            "vehicle": EXAMPLE_CAR,
            "note": "synthetic: computed, not driven",
            "duration_s": trip.duration_s,
            "distance_m": trip.distance_m,
            "observed_energy_wh": trip.observed_energy_wh,
            "request": {
                "trip": trip.trip_id,
                "samples": columns_of(trip.samples[route]),
                "payload_mass_kg": trip.context.payload_mass_kg,
                **at_door,
            },
            "observed": columns_of(trip.samples[measured]),
        }
    return found


def example_list() -> dict[str, Any]:
    """The examples without their samples."""
    return {
        "examples": [
            {name: value for name, value in found.items() if name not in ("request", "observed")}
            for found in examples().values()
        ]
    }


EXAMPLES: Final = 6
EXAMPLE_CAR: Final = "bmw_i3_60ah"
