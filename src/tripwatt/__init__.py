"""Forecast the battery energy of an electric-car trip, with its uncertainty.

>>> import tripwatt as tw
>>> model = tw.load_model("bmw_i3_tum")
>>> plan = tw.read_route([{"length_m": 12_000.0, "speed_m_s": 15.0}], trip_id="commute")
>>> forecast = model.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=-5))
>>> low, high = forecast.interval(0.9)
>>> bool(low < forecast.energy_wh < high)
True

`__init__.pyi` lists the names. Each is imported when it is first used.
"""

from typing import Any

import lazy_loader

_import, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


def __getattr__(name: str) -> Any:
    if name != "__version__":
        return _import(name)
    from importlib.metadata import version  # reads files of the installation

    return version(__name__)
