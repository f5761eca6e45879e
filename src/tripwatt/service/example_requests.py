"""Examples of the OpenAPI document: requests and uploads that a reader may copy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

SAMPLES: Final = {
    "time_s": [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0],
    "speed_m_s": [0.0, 8.0, 13.0, 13.5, 13.0, 7.0, 0.0],
    "elevation_m": [520.0, 520.5, 522.0, 524.0, 525.0, 525.0, 525.0],
}
PLANNED_REQUEST: Final = {
    "links": [
        {"length_m": 800.0, "speed_m_s": 8.5, "grade": 0.01},
        {"length_m": 12000.0, "travel_time_s": 480.0, "grade": 0.0},
    ],
    "displayed_soc": 0.8,
    "ambient_temperature_degc": -5.0,
    "cabin_setpoint_degc": 21.0,
    "reserve": 0.15,
}
DRIVEN_REQUEST: Final = {"samples": SAMPLES, "displayed_soc": 0.8, "ambient_temperature_degc": 12.0}
OBSERVED: Final = {
    "time_s": [0.0, 10.0, 20.0],
    "voltage_v": [370.0, 362.0, 366.0],
    "current_a": [2.0, 40.0, 12.0],
}
MESSAGE: Final = {
    "utc": 1_700_000_000,
    "speed": 72.0,
    "power": 11.1,
    "soc": 65.0,
    "ext_temp": 4.5,
    "is_charging": 0,
}

JOURNEY: Final = {
    "stops": [
        {"latitude_deg": 47.141, "longitude_deg": 9.5209},
        {"latitude_deg": 47.241, "longitude_deg": 9.5285},
    ],
    "soc": 0.8,
    "ambient_temperature_degc": -5.0,
    "departure_utc": "2026-02-01T07:30:00+01:00",
    "wind_speed_m_s": 6.0,
    "wind_from_deg": 350.0,
}

EXAMPLES: Final[Mapping[str, Mapping[str, Any]]] = {
    "ForecastRequest": {"planned road": PLANNED_REQUEST, "speed trace": DRIVEN_REQUEST},
    "UpdateRequest": {"after 20 s": {**DRIVEN_REQUEST, "observed": OBSERVED}},
    "LivePlanRequest": {"planned road": PLANNED_REQUEST},
    "TelemetryRequest": {"a message": {"token": "the-token-of-the-car", "tlm": MESSAGE}},
    "NewCarRequest": {"a car": {"name": "my-leaf", "vehicle": "nissan_leaf_24"}},
    "LogsRequest": {"as proposed": {}},
    "PlanRequest": {"a journey": JOURNEY},
    "JourneyAdviceRequest": {"a journey": {**JOURNEY, "chance": 0.95}},
    "JourneyDifferenceRequest": {
        "warmer": {"one": {**JOURNEY, "ambient_temperature_degc": 10.0}, "other": JOURNEY}
    },
    "AdviceRequest": {"planned road": {**PLANNED_REQUEST, "chance": 0.95, "extras": ["roof_box"]}},
    "DifferenceRequest": {
        "warmer": {"one": {**PLANNED_REQUEST, "cabin_setpoint_degc": 18.0}, "other": PLANNED_REQUEST}
    },
    "NightRequest": {
        "tomorrow": {
            "trips": [
                {
                    "vehicle_id": "V17",
                    "vehicle": "nissan_leaf_40",
                    "departs_at": "2027-02-01T07:30:00+01:00",
                    "distance_km": 60.0,
                    "soc": 0.4,
                    "ambient_temperature_degc": -5.0,
                }
            ],
            "begins_at": "2027-01-31T18:00:00+01:00",
        }
    },
    "ReachRequest": {"a start": {"start": {"latitude_deg": 47.141, "longitude_deg": 9.5209}, "soc": 0.2}},
    "VehicleFigures": {
        "compact car": {
            "mass_kg": 1830.0,
            "usable_battery_kwh": 58.0,
            "consumption_kwh_per_100km": 15.5,
            "motor_power_kw": 150.0,
            "body": "hatchback",
            "heat_pump": True,
        }
    },
}
"""Examples by schema and name."""

GPX: Final = (
    '<gpx><trk><trkseg><trkpt lat="48.10" lon="11.5"><time>2026-05-01T08:00:00Z</time></trkpt>'
    '<trkpt lat="48.11" lon="11.5"><time>2026-05-01T08:01:30Z</time></trkpt></trkseg></trk></gpx>'
)
KML: Final = "<kml><Placemark><LineString><coordinates>11.5,48.1 11.52,48.1</coordinates></LineString></Placemark></kml>"
CSV: Final = "time_s,speed_m_s\n0,0\n10,9\n20,12\n30,0\n"
GEOJSON: Final = {
    "type": "Feature",
    "geometry": {"type": "LineString", "coordinates": [[11.5, 48.1], [11.52, 48.1]]},
    "properties": {"speed_m_s": 14.0},
}
BINARY: Final = {"type": "string", "format": "binary"}
ROUTE: Final = {"type": "object", "description": "of a router, GeoJSON, or `links`; a list of links, too"}
UPLOADS: Final[dict[str, dict[str, Any]]] = {
    "application/gpx+xml": {"schema": BINARY, "example": GPX},
    "application/xml": {"schema": BINARY, "example": GPX},
    "text/xml": {"schema": BINARY, "example": GPX},
    "application/vnd.google-earth.kml+xml": {"schema": BINARY, "example": KML},
    "text/csv": {"schema": BINARY, "example": CSV},
    "application/octet-stream": {"schema": BINARY},
    "application/geo+json": {"schema": {"type": "object"}, "example": GEOJSON},
    "application/json": {"schema": ROUTE, "example": {"links": PLANNED_REQUEST["links"]}},
}
"""Media type of the upload of a route -> its media type object."""
