"""The forecast of a trip: before departure and on the way, with honest intervals and the energy by cause."""

from tripwatt.forecasting.forecast import Forecast
from tripwatt.forecasting.model import DEFAULT_CORRECTOR, ForecastModel, training_blocks
from tripwatt.forecasting.planned import LinkedTrips, RouteDoubt, linked, linked_trips, planned_to_come
from tripwatt.forecasting.request import answer_of, since_departure, trip_to_come
from tripwatt.forecasting.storage import GIVEN, load_metadata, load_model, save_model

__all__ = [
    "DEFAULT_CORRECTOR",
    "GIVEN",
    "Forecast",
    "ForecastModel",
    "LinkedTrips",
    "RouteDoubt",
    "answer_of",
    "linked",
    "linked_trips",
    "load_metadata",
    "load_model",
    "planned_to_come",
    "save_model",
    "since_departure",
    "training_blocks",
    "trip_to_come",
]
