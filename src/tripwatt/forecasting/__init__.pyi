from .difference import Difference
from .forecast import Forecast
from .model import DEFAULT_CORRECTOR, ForecastModel
from .storage import GIVEN, load_metadata, load_model, save_model

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
