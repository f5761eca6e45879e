"""Cars held against their certified consumption: schedules, simulated consumption, anchors, cars from a few figures."""

from tripwatt.certification.anchoring import Anchored, anchored, scaled
from tripwatt.certification.consumption import (
    CertifiedFigure,
    certified_figures,
    charging_efficiency,
    driven_wh_per_km,
    relative_error,
    simulated_wh_per_km,
)
from tripwatt.certification.schedules import CYCLES, schedule

__all__ = [
    "CYCLES",
    "Anchored",
    "CertifiedFigure",
    "anchored",
    "certified_figures",
    "charging_efficiency",
    "driven_wh_per_km",
    "relative_error",
    "scaled",
    "schedule",
    "simulated_wh_per_km",
]
