"""Uncertainty of a trip's energy: residual process, scale of the total, conformal scores, updates and planned routes."""

from tripwatt.uncertainty.charge import ChargeScale
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.coverage import Coverage
from tripwatt.uncertainty.model import UncertaintyModel
from tripwatt.uncertainty.process import Segments
from tripwatt.uncertainty.residual_power import PowerPrior, ResidualPower
from tripwatt.uncertainty.route import LinkedTrips, RouteUncertainty, linked_trips

__all__ = [
    "ChargeScale",
    "ConformalScores",
    "Coverage",
    "LinkedTrips",
    "PowerPrior",
    "ResidualPower",
    "RouteUncertainty",
    "Segments",
    "UncertaintyModel",
    "linked_trips",
]
