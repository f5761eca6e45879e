"""A model for a car: the model's own, another one without a trip, and one with a few trips."""

from tripwatt.population.adapting import Adaptation, adapt_model, adaptation
from tripwatt.population.cars import for_car
from tripwatt.population.without_trips import without_trips

__all__ = ["Adaptation", "adapt_model", "adaptation", "for_car", "without_trips"]
