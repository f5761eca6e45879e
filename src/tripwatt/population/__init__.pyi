from .adapting import Adaptation, adaptation
from .cars import for_car
from .prior import population

__all__ = [
    "Adaptation",
    "adaptation",
    "for_car",
    "population",
]
