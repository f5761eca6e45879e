"""The jobs of journeys: from the body of a request to a document, without HTTP."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.forecasting import ForecastModel
from tripwatt.roads.advice import advise, leaving_later
from tripwatt.roads.journey import (
    Atlas,
    Journey,
    JourneyOptions,
    Place,
    RoadForecaster,
    find_reach,
    find_stops,
    journey_with,
)
from tripwatt.server.http import journey_schemas as asked
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.schemas import both, departure_of

ModelOf = Callable[[Any], ForecastModel]
"""Returns the model for the car that a request names."""


@dataclass(frozen=True)
class JourneyJobs:
    """The atlas of the service and the jobs that use it.

    Attributes
    ----------
    atlas : Atlas or None
        None if the service has no map.
    """

    atlas: Atlas | None = None

    def plan(self, request: asked.PlanRequest, model: ForecastModel) -> dict[str, Any]:
        """Return the response to a `PlanRequest`."""
        return self._journey(request, model).to_dict()

    def difference(self, request: asked.JourneyDifferenceRequest, model_of: ModelOf) -> dict[str, Any]:
        """Return the response to a `JourneyDifferenceRequest`; `model_of` returns the model for a journey."""
        one, other = both(request, lambda asked: self._journey(asked, model_of(asked), answers=True))
        return one.difference(other, request.road).to_dict()

    def advice(self, request: asked.JourneyAdviceRequest, model: ForecastModel) -> dict[str, Any]:
        """Return the response to a `JourneyAdviceRequest`: what to do on the fastest road, with its stops to charge."""
        journey, now = self._journey(request, model), dt.datetime.now(dt.UTC)
        later = leaving_later(self._forecaster(request, model), journey.roads[0].road, now)
        required = request.model_dump(include={"reserve", "probability"})
        return advise(journey, **required, others=later, now=now).to_dict()

    def _forecaster(self, request: asked.JourneyCar, model: ForecastModel) -> RoadForecaster:
        return RoadForecaster(model, departure_of(request), self._atlas().weather)

    def _journey(self, request: asked.PlanRequest, model: ForecastModel, **changed: Any) -> Journey:
        atlas = self._atlas()
        given = request.model_dump(include={*JourneyOptions.__slots__} - {"avoid"}) | changed
        options = JourneyOptions(**given, avoid=tuple(Place(**p.model_dump()) for p in request.avoid))
        stops = find_stops([place_of(stop) for stop in request.stops], atlas, round_trip=request.round_trip)
        return journey_with(self._forecaster(request, model), stops, atlas, options)

    def reach(self, request: asked.ReachRequest, model: ForecastModel) -> dict[str, Any]:
        """Return the response to a `ReachRequest`."""
        atlas = self._atlas()
        start = atlas.find(place_of(request.start), "start")
        return find_reach(self._forecaster(request, model), start, atlas, reserve=request.reserve).to_dict()

    def places(self, text: str, limit: int) -> dict[str, Any]:
        """Return the places that a text finds by name."""
        atlas = self._atlas()
        if atlas.places is None:
            what, allowed = "names of places are not known", "latitude and longitude"
            raise InvalidInput.of(what, "query.q", text[:60], allowed)
        matches = atlas.places.search(text, limit=limit)
        return {"places": [place.to_dict() for place in matches], "attribution": atlas.attribution}

    def tile(self, zoom: int, column: int, row: int) -> bytes:
        """Return a vector tile of the roads; empty if there are no roads."""
        raise_faults(
            Fault("tile out of range", name, str(value), f"0 to {2**zoom - 1} at zoom {zoom}")
            for name, value in (("column", column), ("row", row))
            if value >= 2**zoom
        )
        return self._atlas().tile(zoom, column, row)

    def view(self, bounds_deg: Sequence[float], limit: int) -> dict[str, Any]:
        """Return settlements and charging stations inside of south, west, north and east."""
        south, west, north, east = bounds_deg
        raise_faults(
            Fault("bounds in the wrong order", name, f"{low:g} to {high:g}", "the smaller first")
            for name, low, high in (("south, north", south, north), ("west, east", west, east))
            if low > high
        )
        atlas, bounds = self._atlas(), (south, west, north, east)
        return {
            "settlements": [place.to_dict() for place in atlas.settlements(bounds, limit)],
            "stations": [asdict(station) for station in atlas.stations_within(bounds, limit)],
            "attribution": atlas.attribution,
        }

    def describe(self) -> dict[str, Any]:
        """Return the roads, places and weather of the service."""
        atlas = self.atlas
        folder = None if atlas is None else atlas.folder
        terrain = {} if atlas is None or folder is None or not atlas.is_local else folder.info["terrain"]
        return {
            "roads": atlas is not None,
            "places": atlas is not None and atlas.places is not None,
            "weather": atlas is not None and atlas.weather is not None,
            "tiles": atlas is not None and atlas.has_tiles,
            "stations": 0 if atlas is None else len(atlas.stations),
            "bounds_deg": None if atlas is None or atlas.bounds_deg is None else list(atlas.bounds_deg),
            "covers": "" if folder is None else folder.covers,
            "terrain": {"known": terrain.get("known", False), "source": terrain.get("source", "")},
            "attribution": "" if atlas is None else atlas.attribution,
        }

    def _atlas(self) -> Atlas:
        if self.atlas is None:
            raise Problem("no-map", "start the service with --map")
        return self.atlas


def place_of(stop: str | asked.PlaceRequest) -> str | Place:
    """Return a stop of a request as a place, or its text if the stop is given by name."""
    return stop if isinstance(stop, str) else Place(**stop.model_dump())
