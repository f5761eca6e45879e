"""Certified consumption of cars: schedules, simulated consumption, anchors, and cars from a few figures."""

from tripwatt.certification.anchoring import Anchored, anchored, scaled
from tripwatt.certification.consumption import (
    CertifiedFigure,
    charging_efficiency,
    driven_wh_per_km,
    relative_error,
    simulated_wh_per_km,
)
from tripwatt.certification.describing import (
    ConsumptionInterval,
    certified_interval,
    describe_car,
    usual_figures,
)
from tripwatt.certification.schedules import CYCLES, schedule

__all__ = [
    "CYCLES",
    "Anchored",
    "CertifiedFigure",
    "ConsumptionInterval",
    "anchored",
    "certified_interval",
    "charging_efficiency",
    "describe_car",
    "driven_wh_per_km",
    "relative_error",
    "scaled",
    "schedule",
    "simulated_wh_per_km",
    "usual_figures",
]
