"""Cars as frozen dataclasses, one TOML per car: value, unit and source for every entry."""

from tripwatt.vehicles.comparing import Difference, differences, with_differences
from tripwatt.vehicles.extras import with_extras
from tripwatt.vehicles.loading import (
    find_vehicles,
    load_vehicle,
    require_vehicle,
    vehicle_names,
    vehicle_titles,
)
from tripwatt.vehicles.overriding import ALIASES, parse_overrides
from tripwatt.vehicles.parts import (
    Auxiliaries,
    Battery,
    Body,
    Climate,
    Drivetrain,
    Regeneration,
    RoadLoad,
    Tyres,
)
from tripwatt.vehicles.reading import vehicle_from_document
from tripwatt.vehicles.vehicle import ANCHORS, LICENCES, Entry, Vehicle
from tripwatt.vehicles.without import names_data, without_data
from tripwatt.vehicles.writing import describe_vehicle, render_vehicle, vehicle_document

__all__ = [
    "ALIASES",
    "ANCHORS",
    "LICENCES",
    "Auxiliaries",
    "Battery",
    "Body",
    "Climate",
    "Difference",
    "Drivetrain",
    "Entry",
    "Regeneration",
    "RoadLoad",
    "Tyres",
    "Vehicle",
    "describe_vehicle",
    "differences",
    "find_vehicles",
    "load_vehicle",
    "names_data",
    "parse_overrides",
    "render_vehicle",
    "require_vehicle",
    "vehicle_document",
    "vehicle_from_document",
    "vehicle_names",
    "vehicle_titles",
    "with_differences",
    "with_extras",
    "without_data",
]
