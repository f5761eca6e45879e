from .api import adapt, fit, forecast, read_route, read_trips, simulate, sweep
from .auditing import audit
from .certification import describe_car
from .errors import InvalidInput
from .fleet.store import create_store, open_store
from .forecasting import Forecast, ForecastModel, load_model, save_model
from .forecasting.leaving import leaving_with, soc_needed
from .population import for_car
from .roads.advice import Advice, advise
from .roads.journey import Journey, Need, Range, need, plan_journey, range_km
from .server.cars.folder import create_car, open_car
from .sources import read_logs
from .sources.sample import sample_trips
from .study.evaluation import evaluate
from .trips import Departure, Plan, Trip
from .vehicles import load_vehicle

__version__: str

__all__ = [
    "Advice",
    "Departure",
    "Forecast",
    "ForecastModel",
    "InvalidInput",
    "Journey",
    "Need",
    "Plan",
    "Range",
    "Trip",
    "__version__",
    "adapt",
    "advise",
    "audit",
    "create_car",
    "create_store",
    "describe_car",
    "evaluate",
    "fit",
    "for_car",
    "forecast",
    "leaving_with",
    "load_model",
    "load_vehicle",
    "need",
    "open_car",
    "open_store",
    "plan_journey",
    "range_km",
    "read_logs",
    "read_route",
    "read_trips",
    "sample_trips",
    "save_model",
    "simulate",
    "soc_needed",
    "sweep",
]
