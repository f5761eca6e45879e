"""The forecast of a trip: before departure and on the way, with honest intervals and the energy by cause."""

from tripwatt.forecast.forecast import Forecast
from tripwatt.forecast.model import DEFAULT_CORRECTOR, ForecastModel, training_blocks

__all__ = ["DEFAULT_CORRECTOR", "Forecast", "ForecastModel", "training_blocks"]
