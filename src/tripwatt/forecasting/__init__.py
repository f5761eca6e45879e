"""The forecast of a trip: before departure and on the way, with its uncertainty and the energy by cause."""

from tripwatt.forecasting.difference import Difference
from tripwatt.forecasting.forecast import Forecast
from tripwatt.forecasting.leaving import leaving_with, soc_needed
from tripwatt.forecasting.model import DEFAULT_CORRECTOR, ForecastModel
from tripwatt.forecasting.storage import (
    GIVEN,
    load_metadata,
    load_model,
    model_folder,
    save_model,
)

__all__ = [
    "DEFAULT_CORRECTOR",
    "GIVEN",
    "Difference",
    "Forecast",
    "ForecastModel",
    "leaving_with",
    "load_metadata",
    "load_model",
    "model_folder",
    "save_model",
    "soc_needed",
]
