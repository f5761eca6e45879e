"""Forecast the battery energy of an electric-car trip, with its uncertainty.

>>> import tripwatt as tw
>>> model = tw.load_model("bmw_i3_tum")
>>> plan = tw.read_route([{"length_m": 12_000.0, "speed_m_s": 15.0}], trip_id="commute")
>>> forecast = model.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=-5))
>>> low, high = forecast.interval(0.9)
>>> bool(low < forecast.energy_wh < high)
True

The names of this module are imported when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from tripwatt.api import adapt, fit, forecast, read_route, read_trips, simulate, sweep
    from tripwatt.auditing import audit
    from tripwatt.certification import describe_car
    from tripwatt.errors import InvalidInput
    from tripwatt.evaluation import evaluate
    from tripwatt.forecasting import Forecast, ForecastModel, load_model, save_model
    from tripwatt.journey import Journey, plan_journey
    from tripwatt.live import create_car, open_car
    from tripwatt.population import for_car
    from tripwatt.sources import read_logs
    from tripwatt.store import create_store, open_store
    from tripwatt.synthetic import synthetic_fleet
    from tripwatt.trips import Departure, Plan, Trip
    from tripwatt.vehicles import load_vehicle

    __version__: str

__all__ = [
    "Departure",
    "Forecast",
    "ForecastModel",
    "InvalidInput",
    "Journey",
    "Plan",
    "Trip",
    "__version__",
    "adapt",
    "audit",
    "create_car",
    "create_store",
    "describe_car",
    "evaluate",
    "fit",
    "for_car",
    "forecast",
    "load_model",
    "load_vehicle",
    "open_car",
    "open_store",
    "plan_journey",
    "read_logs",
    "read_route",
    "read_trips",
    "save_model",
    "simulate",
    "sweep",
    "synthetic_fleet",
]

_HOMES: Final = {
    "Departure": "trips",
    "Forecast": "forecasting",
    "ForecastModel": "forecasting",
    "InvalidInput": "errors",
    "Journey": "journey",
    "Plan": "trips",
    "Trip": "trips",
    "adapt": "api",
    "audit": "auditing",
    "create_car": "live",
    "create_store": "store",
    "describe_car": "certification",
    "evaluate": "evaluation",
    "fit": "api",
    "for_car": "population",
    "forecast": "api",
    "load_model": "forecasting",
    "load_vehicle": "vehicles",
    "open_car": "live",
    "open_store": "store",
    "plan_journey": "journey",
    "read_logs": "sources",
    "read_route": "api",
    "read_trips": "api",
    "save_model": "forecasting",
    "simulate": "api",
    "sweep": "api",
    "synthetic_fleet": "synthetic",
}
"""Public name -> the module that holds it."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # reads files of the installation

        value: Any = version("tripwatt")
    elif name in _HOMES:
        value = getattr(import_module(f"tripwatt.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module 'tripwatt' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
