"""Certified consumption of cars: schedules, simulated consumption, anchors, and cars from a few figures."""

from tripwatt.certification.describing import certified_interval, describe_car

__all__ = ["certified_interval", "describe_car"]
