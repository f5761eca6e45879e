from .comparing import differences, with_differences, without_data
from .extras import with_extras
from .loading import (
    find_vehicles,
    load_vehicle,
    require_vehicle,
    vehicle_names,
    vehicle_titles,
)
from .parts import Battery, Climate, Drivetrain, Regeneration, Tyres
from .reading import ALIASES, vehicle_from_document
from .vehicle import LICENCES, Vehicle
from .writing import describe_vehicle, render_vehicle, vehicle_document

__all__ = [
    "ALIASES",
    "LICENCES",
    "Battery",
    "Climate",
    "Drivetrain",
    "Regeneration",
    "Tyres",
    "Vehicle",
    "describe_vehicle",
    "differences",
    "find_vehicles",
    "load_vehicle",
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
