"""The forecast of a trip: before departure and on the way, with its uncertainty and the energy by cause."""

from tripwatt.forecasting.difference import Difference
from tripwatt.forecasting.forecast import Forecast
from tripwatt.forecasting.model import DEFAULT_CORRECTOR, ForecastModel
from tripwatt.forecasting.storage import GIVEN, load_metadata, load_model, save_model

__all__ = [
    "DEFAULT_CORRECTOR",
    "GIVEN",
    "Difference",
    "Forecast",
    "ForecastModel",
    "load_metadata",
    "load_model",
    "save_model",
]
