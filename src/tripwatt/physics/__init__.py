"""Physics of the car as pure functions on arrays: road load, drivetrain, battery, and the simulation that chains them."""

from tripwatt.physics.chain import CAUSES
from tripwatt.physics.conditions import DriveConditions
from tripwatt.physics.road_load import grade_from_elevation
from tripwatt.physics.simulate import Simulation, conditions_at_departure, simulate, simulate_trip

__all__ = [
    "CAUSES",
    "DriveConditions",
    "Simulation",
    "conditions_at_departure",
    "grade_from_elevation",
    "simulate",
    "simulate_trip",
]
