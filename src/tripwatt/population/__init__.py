"""Models for cars: for a model's own car, for another car without trips, and for one with a few trips."""

from tripwatt.population.adapting import Adaptation, adapt_model, adaptation, without_trips
from tripwatt.population.cars import for_car
from tripwatt.population.prior import population

__all__ = [
    "Adaptation",
    "adapt_model",
    "adaptation",
    "for_car",
    "population",
    "without_trips",
]
