"""The forecast of a trip: before departure and on the way, with honest intervals and the energy by cause."""

from tripwatt.forecasting.forecast import Forecast
from tripwatt.forecasting.model import DEFAULT_CORRECTOR, ForecastModel, training_blocks
from tripwatt.forecasting.planned import LinkedTrips, RouteDoubt, linked_trips, plan_on_links
from tripwatt.forecasting.request import read_route, read_trips
from tripwatt.forecasting.storage import GIVEN, load_metadata, load_model, save_model

__all__ = [
    "DEFAULT_CORRECTOR",
    "GIVEN",
    "Forecast",
    "ForecastModel",
    "LinkedTrips",
    "RouteDoubt",
    "linked_trips",
    "load_metadata",
    "load_model",
    "plan_on_links",
    "read_route",
    "read_trips",
    "save_model",
    "training_blocks",
]
