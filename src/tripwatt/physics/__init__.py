"""The car as pure functions on arrays: road load, drivetrain, battery, and the simulation that chains them."""

from tripwatt.physics.conditions import DriveConditions
from tripwatt.physics.road_load import grade_from_elevation
from tripwatt.physics.simulate import CAUSES, Simulation, simulate, simulate_trip

__all__ = ["CAUSES", "DriveConditions", "Simulation", "grade_from_elevation", "simulate", "simulate_trip"]
