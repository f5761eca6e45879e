"""Physics of the car as pure functions on arrays: road load, drivetrain, battery, and the simulation that chains them."""

from tripwatt.physics.conditions import DriveConditions
from tripwatt.physics.simulate import Simulation, conditions_at_departure, simulate, simulate_trip

__all__ = ["DriveConditions", "Simulation", "conditions_at_departure", "simulate", "simulate_trip"]
