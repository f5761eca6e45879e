"""Journeys from A to B: the charge at arrival, the charge to leave with, stops to charge, and the area of reach."""

from tripwatt.roads.journey.atlas import Atlas, AtlasSettings, open_atlas
from tripwatt.roads.journey.charging import ChargingCurve
from tripwatt.roads.journey.corridor import JourneyOptions
from tripwatt.roads.journey.distances import Need, Range, need, range_km
from tripwatt.roads.journey.forecasting import RoadForecaster
from tripwatt.roads.journey.planning import (
    Journey,
    RoadForecast,
    find_stops,
    journey_with,
    plan_journey,
)
from tripwatt.roads.journey.reach import Reach, find_reach
from tripwatt.roads.journey.stops import ChargingPlan, ChargingStop
from tripwatt.routes.places import Place

__all__ = [
    "Atlas",
    "AtlasSettings",
    "ChargingCurve",
    "ChargingPlan",
    "ChargingStop",
    "Journey",
    "JourneyOptions",
    "Need",
    "Place",
    "Range",
    "Reach",
    "RoadForecast",
    "RoadForecaster",
    "find_reach",
    "find_stops",
    "journey_with",
    "need",
    "open_atlas",
    "plan_journey",
    "range_km",
]
