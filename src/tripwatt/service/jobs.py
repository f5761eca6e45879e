"""What the service computes: a body in, a document out, the same every time. Nothing here knows HTTP or waits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting import (
    Forecast,
    ForecastModel,
    load_model,
)
from tripwatt.forecasting.storage import DEFAULT_MODEL
from tripwatt.routes import (
    Track,
    is_links_table,
    parse_route,
    plan_from_route,
    route_from_track,
)
from tripwatt.service.bodies import (
    ForecastRequest,
    UpdateRequest,
    measured_of,
    parse,
    require_duration,
    route_of,
    samples_of,
)
from tripwatt.service.library import columns_of, examples, links_of, vehicles
from tripwatt.service.settings import Limits
from tripwatt.sources.canonical import canonical_of_text
from tripwatt.synthetic import example_trip
from tripwatt.transfer.zero_shot import on_vehicle
from tripwatt.trips import ASKED, Departure, Flag, Plan, plan_from_samples
from tripwatt.trips.messages import flag_to_dict
from tripwatt.vehicles import vehicle_names

ROUTE_STARTS: Final = (b"<", b"{", b"[", b"\xff", b"\xfe")
"""First bytes of XML, of JSON, and of UTF-16."""


@dataclass(frozen=True)
class Work:
    """The models that requests may name, and what can be done with them."""

    models: Mapping[str, ForecastModel]
    limits: Limits
    elsewhere: dict[tuple[str, str], tuple[ForecastModel, tuple[Flag, ...]]] = field(default_factory=dict)
    """Models on other cars of the library than their own, made when they are first asked for."""

    @classmethod
    def from_folders(cls, folders: Mapping[str, Path], limits: Limits) -> Work:
        """Load the models; without folders the one that comes with the package."""
        models = {name: load_model(folder) for name, folder in folders.items()}
        return cls(models or {DEFAULT_MODEL: load_model()}, limits)

    def warm_up(self) -> None:
        """Forecast something, so that the first request is as fast as the others."""
        plan = plan_from_samples(example_trip(), "warm-up")
        for model in self.models.values():
            model.forecast(plan).to_dict()

    def done(self, job: Mapping[str, Any], body: bytes) -> dict[str, Any]:
        """The document that a job asks for.

        Parameters
        ----------
        job : mapping
            `kind`: a key of `JOBS`; for a route also `speed_m_s`.
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
        return _sound(self._forecast(asked).to_dict(asked.reserve))

    def update(self, body: bytes) -> dict[str, Any]:
        """Answer to an `UpdateRequest`."""
        asked = parse(body, UpdateRequest)
        observed = measured_of(asked.observed, self.limits)
        return _sound(self._forecast(asked).update(observed).to_dict(asked.reserve))

    def _forecast(self, asked: ForecastRequest) -> Forecast:
        model, flags = self._model(asked)
        found = model.forecast(self._plan(asked), Departure(**{n: getattr(asked, n) for n in ASKED}))
        return replace(found, flags=(*flags, *found.flags)) if flags else found

    def _model(self, asked: ForecastRequest) -> tuple[ForecastModel, tuple[Flag, ...]]:
        """The model that is asked for, on the car that is asked for, and what has to be said of that."""
        name = next(iter(self.models)) if asked.model is None else asked.model
        if name not in self.models:
            raise InvalidInput(Fault("unknown model", "model", repr(name), ", ".join(self.models)))
        model = self.models[name]
        if asked.vehicle in (None, model.vehicle.name):
            return model, ()
        if asked.vehicle not in vehicle_names():  # a name of the library and nothing else, never a file
            raise InvalidInput(
                Fault("unknown car", "vehicle", repr(asked.vehicle), ", ".join(vehicle_names()))
            )
        if (name, asked.vehicle) not in self.elsewhere:
            self.elsewhere[name, asked.vehicle] = on_vehicle(model, asked.vehicle)
        return self.elsewhere[name, asked.vehicle]

    def _plan(self, asked: ForecastRequest) -> Plan:
        if (asked.samples is None) == (asked.links is None):
            got = "neither" if asked.samples is None else "both"
            raise InvalidInput(Fault("no single trip", "samples, links", got, "either samples or links"))
        if asked.samples is not None:
            return plan_from_samples(samples_of(asked.samples, self.limits), asked.trip)
        return plan_from_route(route_of(asked.links, asked.elevation, self.limits), trip_id=asked.trip)

    def route(self, body: bytes, speed_m_s: float | None) -> dict[str, Any]:
        """What an upload holds, as the fields of a `ForecastRequest`.

        Parameters
        ----------
        body : bytes
            GPX, GeoJSON, a router's answer, links as JSON or CSV, or CSV of samples: told from the content.
        speed_m_s : float or None
            Mean speed [m/s] of pieces that know neither time nor speed.
        """
        if body.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] not in ROUTE_STARTS and not is_links_table(body):
            return self._uploaded_samples(canonical_of_text(body, "upload"))
        route = parse_route(body, where="upload")
        if isinstance(route, Track):
            if route.is_log and route.time_s is not None:
                require_duration(float(route.time_s[-1]), "upload", self.limits)
                return self._uploaded_samples(plan_from_route(route).samples, route.flags)
            route = route_from_track(route, speed_m_s)
        if len(route) > self.limits.links:
            raise InvalidInput(
                Fault("too many links", "upload", f"{len(route)}", f"at most {self.limits.links}")
            )
        require_duration(route.duration_s, "upload", self.limits)
        plan = plan_from_route(route)
        return self._uploaded_samples(plan.samples, plan.flags) | {
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

    def _uploaded_samples(self, samples: pd.DataFrame, flags: tuple[Flag, ...] = ()) -> dict[str, Any]:
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
            "notes": [flag_to_dict(flag) for flag in flags],
        }


JOBS: Final[Mapping[str, Callable[[Work, Mapping[str, Any], bytes], dict[str, Any]]]] = MappingProxyType(
    {
        "forecast": lambda work, job, body: work.forecast(body),
        "update": lambda work, job, body: work.update(body),
        "route": lambda work, job, body: work.route(body, job["speed_m_s"]),
        "vehicles": lambda work, job, body: {"vehicles": work.vehicles()},
        "examples": lambda work, job, body: examples(),
    }
)
"""Kind of job -> what does it."""


def _sound(answer: dict[str, Any]) -> dict[str, Any]:
    """An answer of numbers; a trip that drives the physics out of its mind is the trip's fault."""
    scalars = [answer["energy_wh"], answer["soc_arrival"], answer["battery_loss_wh"]]
    lists = [
        scalars,
        answer["quantiles_wh"].values(),
        answer["p_arrive"].values(),
        *answer["series"].values(),
    ]
    if not all(math.isfinite(sum(values)) for values in lists):  # one that is not spoils the sum
        raise InvalidInput(Fault("no forecast", "trip", "implausible results", "a trip that a car can drive"))
    return answer
