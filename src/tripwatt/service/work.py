"""What the service computes: a body in, a document out, the same every time. Nothing here knows HTTP or waits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecast import Forecast, ForecastModel, answer_of, load_model, since_departure, trip_to_come
from tripwatt.forecast.storage import DEFAULT_MODEL
from tripwatt.physics.battery import open_circuit_voltage
from tripwatt.routes import Departure, LinkRoute, Track, plan_trip, read_route, route_from_track
from tripwatt.service.bodies import (
    DEPARTURE,
    ForecastRequest,
    UpdateRequest,
    measured_of,
    parse,
    require_duration,
    route_of,
    samples_of,
)
from tripwatt.service.settings import Limits
from tripwatt.sources.canonical import canonical_of_text
from tripwatt.synthetic import example_trip, synthetic_fleet
from tripwatt.trips import Context, Trip
from tripwatt.vehicles import load_vehicle, vehicle_names

EXAMPLES: Final = 6
EXAMPLE_CAR: Final = "bmw_i3_60ah"


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

    def warm_up(self) -> None:
        """Forecast something, so that the first request is as fast as the others."""
        samples = example_trip()
        for model in self.models.values():
            answer_of(model.forecast(trip_to_come(samples, "warm-up")), 0.0)

    def done(self, job: Mapping[str, Any], body: bytes) -> dict[str, Any]:
        """The document that a job asks for.

        Parameters
        ----------
        job : mapping
            `kind`: a key of `JOBS`; for a route also `format` and `speed_m_s`; for an example `trip`.
        body : bytes

        Raises
        ------
        NotJson, InvalidInput
            When the body is wrong.
        """
        return JOBS[job["kind"]](self, job, body)

    def forecast(self, body: bytes) -> dict[str, Any]:
        """Answer to a `ForecastRequest`."""
        asked = parse(body, ForecastRequest)
        return _sound(answer_of(self._forecast(asked)[0], asked.reserve))

    def update(self, body: bytes) -> dict[str, Any]:
        """Answer to an `UpdateRequest`."""
        asked = parse(body, UpdateRequest)
        observed = measured_of(asked.observed, self.limits)
        found, trip = self._forecast(asked)
        return _sound(answer_of(found.update(since_departure(observed, trip)), asked.reserve))

    def _forecast(self, asked: ForecastRequest) -> tuple[Forecast, Trip]:
        model = self._model(asked)
        trip = self._trip(asked)
        return model.forecast(trip), trip

    def _model(self, asked: ForecastRequest) -> ForecastModel:
        name = next(iter(self.models)) if asked.model is None else asked.model
        if name not in self.models:
            raise InvalidInput(Fault("no such model", "model", repr(name), ", ".join(self.models)))
        model = self.models[name]
        if asked.vehicle not in (None, model.vehicle.name):
            got, allowed = repr(asked.vehicle), f"{model.vehicle.name}, which the model was fitted on"
            raise InvalidInput(Fault("the model is of another car", "vehicle", got, allowed))
        return model

    def _trip(self, asked: ForecastRequest) -> Trip:
        known = {name: getattr(asked, name) for name in DEPARTURE}
        if (asked.samples is None) == (asked.links is None):
            got = "neither" if asked.samples is None else "both"
            raise InvalidInput(Fault("which trip?", "samples, links", got, "either samples or links"))
        if asked.samples is not None:
            return trip_to_come(samples_of(asked.samples, self.limits), asked.trip, **known)
        route = route_of(asked.links, asked.elevation, self.limits)
        payload = known.pop("payload_mass_kg") or 0.0
        departure = Departure(**known, context=Context(payload_mass_kg=payload))
        return plan_trip(route, departure, trip_id=asked.trip)

    def route(self, body: bytes, kind: str, speed_m_s: float | None) -> dict[str, Any]:
        """What an upload holds, as the fields of a `ForecastRequest`.

        Parameters
        ----------
        body : bytes
            CSV of samples, GPX, GeoJSON, a router's answer, or links.
        kind : {"csv", "route"}
        speed_m_s : float or None
            Mean speed [m/s] of pieces that know neither time nor speed.
        """
        if kind == "csv":
            return self._uploaded_samples(canonical_of_text(body, "upload"))
        route = read_route(body, where="upload")
        if isinstance(route, Track):
            if route.is_log and route.time_s is not None:
                require_duration(float(route.time_s[-1]), "upload", self.limits)
                return self._uploaded_samples(plan_trip(route).samples, route.notes)
            route = route_from_track(route, speed_m_s)
        if len(route) > self.limits.links:
            raise InvalidInput(
                Fault("too many links", "upload", f"{len(route)}", f"at most {self.limits.links}")
            )
        require_duration(route.duration_s, "upload", self.limits)
        trip = plan_trip(route)
        notes = tuple(filter(None, trip.context.notes.split("; ")))
        return self._uploaded_samples(trip.samples, notes) | {
            "links": links_of(route),
            "elevation": None
            if route.elevation_m is None or route.elevation_position_m is None
            else {
                "position_m": route.elevation_position_m.tolist(),
                "elevation_m": route.elevation_m.tolist(),
            },
        }

    def vehicles(self) -> list[dict[str, Any]]:
        """Cars of the library, each with the models that forecast it."""
        cars = [(name, model.vehicle.name) for name, model in self.models.items()]
        return [{**row, "models": [name for name, car in cars if car == row["name"]]} for row in vehicles()]

    def _uploaded_samples(self, samples: pd.DataFrame, notes: tuple[str, ...] = ()) -> dict[str, Any]:
        time, speed = samples["time_s"].to_numpy(), samples["speed_m_s"].to_numpy()
        if len(samples) > self.limits.samples:
            allowed = f"at most {self.limits.samples}"
            raise InvalidInput(Fault("too many samples", "upload", f"{len(samples)}", allowed))
        require_duration(float(time[-1] - time[0]), "upload", self.limits)
        return {
            "samples": columns_of(samples),
            "links": None,
            "elevation": None,
            "duration_s": float(time[-1] - time[0]),
            "distance_m": float(np.trapezoid(speed, time)),
            "notes": notes,
        }


JOBS: Final[Mapping[str, Callable[[Work, Mapping[str, Any], bytes], dict[str, Any]]]] = MappingProxyType(
    {
        "forecast": lambda work, job, body: work.forecast(body),
        "update": lambda work, job, body: work.update(body),
        "route": lambda work, job, body: work.route(body, job["format"], job["speed_m_s"]),
        "vehicles": lambda work, job, body: {"vehicles": work.vehicles()},
        "examples": lambda work, job, body: examples(),
    }
)
"""Kind of job -> what does it."""


def _sound(answer: dict[str, Any]) -> dict[str, Any]:
    """An answer of numbers; a trip that drives the physics out of its mind is the trip's fault."""
    lists = (v for v in answer["series"].values())
    scalars = [answer["energy_wh"], answer["soc_arrival"], answer["battery_loss_wh"]]
    scalars += [*answer["quantiles_wh"].values(), *answer["p_arrive"].values()]
    if not (np.isfinite(scalars).all() and all(np.isfinite(values).all() for values in lists)):
        raise InvalidInput(
            Fault("no forecast", "trip", "values that no car has", "a trip that can be driven")
        )
    return answer


def links_of(route: LinkRoute) -> list[dict[str, float]]:
    """A route as the links of a request, without its heights."""
    columns = {
        "length_m": route.length_m,
        "travel_time_s": route.travel_time_s,
        "stop_s": route.stop_s,
        "moving_speed_m_s": route.moving_speed_m_s,
    }
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
def vehicles() -> tuple[dict[str, Any], ...]:
    """Cars of the library."""
    rows = []
    for name in vehicle_names():
        car = load_vehicle(name)
        window = np.linspace(car.battery.displayed_zero_soc, car.battery.displayed_full_soc, 101)
        mean_v = float(open_circuit_voltage(window, car.battery).mean())
        rows.append(
            {
                "name": name,
                "title": car.title,
                "test_mass_kg": car.body.test_mass_kg,
                "usable_energy_wh": car.battery.capacity_ah * mean_v * float(window[-1] - window[0]),
                "has_climate": car.climate is not None,
            }
        )
    return tuple(rows)


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
