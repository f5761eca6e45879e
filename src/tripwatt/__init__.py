"""Forecast the battery energy of an electric-car trip, and say how sure the forecast is."""

from importlib.metadata import version as _version

__version__ = _version("tripwatt")
