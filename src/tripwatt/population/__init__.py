"""Models for cars: for a model's own car, for another car without trips, and for one with a few trips."""

from tripwatt.population.adapting import Adaptation, adaptation
from tripwatt.population.cars import for_car
from tripwatt.population.prior import population

__all__ = [
    "Adaptation",
    "adaptation",
    "for_car",
    "population",
]
