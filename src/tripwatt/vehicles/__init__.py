"""Cars as frozen dataclasses, one TOML per car: value, unit and source for every entry."""

from tripwatt.vehicles.loading import Entry, Vehicle, load_vehicle, vehicle_from_document, vehicle_names
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
from tripwatt.vehicles.table import render_parameters

__all__ = [
    "Auxiliaries",
    "Battery",
    "Body",
    "Climate",
    "Drivetrain",
    "Entry",
    "Regeneration",
    "RoadLoad",
    "Tyres",
    "Vehicle",
    "load_vehicle",
    "render_parameters",
    "vehicle_from_document",
    "vehicle_names",
]
