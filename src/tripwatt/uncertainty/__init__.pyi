from .charge import ChargeScale
from .conformal import ConformalScores
from .coverage import Coverage
from .model import UncertaintyModel
from .process import Segments
from .residual_power import PowerPrior, ResidualPower
from .route import LinkedTrips, RouteUncertainty, linked_trips

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
