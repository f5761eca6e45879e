"""The forecast of one road, with the weather along it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import BoolArray
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.physics import simulate_trip
from tripwatt.roads.routers import Road
from tripwatt.roads.weather import Weather, WeatherSource, plan_with_weather, weather_along
from tripwatt.trips import Departure, Plan
from tripwatt.trips.weather import WIND_AT_CAR

MOTORWAYS: Final = frozenset({"motorway", "motorway_link", "trunk"})


@dataclass(frozen=True, eq=False)
class RoadForecaster:
    """Forecasts roads for one car and one departure: what is the same for all roads of a journey.

    Attributes
    ----------
    model : ForecastModel
        Of the car.
    departure : Departure
        When the car leaves, and what is known then.
    weather : WeatherSource or None
        Where the weather comes from that the departure does not name; None where it is not known.
    change : callable
        Of every plan, such as a slower drive.

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.routes import route_from_links
    >>> links = route_from_links([{"length_m": 3000.0, "travel_time_s": 240.0}])
    >>> line = np.array([0.0, 3000.0])
    >>> road = Road(links, ("primary",), np.array([47.0, 47.027]), np.array([9.0, 9.0]), line)
    >>> forecaster = RoadForecaster(tw.load_model("bmw_i3_tum"), Departure(soc=0.8))
    >>> forecaster.expected(road).distance_m
    3000.0
    >>> plan, weather = forecaster.plan(road, "there")
    >>> plan.trip_id, weather, forecaster.forecast_plan(plan).energy_wh == forecaster.forecast(road).energy_wh
    ('there', (), True)
    >>> forecaster.forecast(road, payload_mass_kg=300.0).energy_wh > forecaster.forecast(road).energy_wh
    True
    """

    model: ForecastModel
    departure: Departure
    weather: WeatherSource | None = None
    change: Callable[[Plan], Plan] = lambda plan: plan

    @property
    def departs_at(self) -> dt.datetime:
        """Departure; now where it is not known."""
        return self.departure.departs_at or dt.datetime.now(dt.UTC)

    def forecast(self, road: Road, trip_id: str = "journey", **changed: Any) -> Forecast:
        """Forecast the energy of a road.

        Parameters
        ----------
        road : Road
            From a router.
        trip_id : str
            Name of the plan.
        **changed : object
            Fields of the departure that differ.

        Returns
        -------
        Forecast
            With the error of the weather in its standard deviation.

        Raises
        ------
        InvalidInput
            As the weather, and `ForecastModel.forecast`.
        """
        plan, weather = self.plan(road, trip_id, **changed)
        return self.forecast_plan(plan, weather)

    def plan(self, road: Road, trip_id: str = "journey", **changed: Any) -> tuple[Plan, tuple[Weather, ...]]:
        """Make the plan of a road with its weather.

        Parameters
        ----------
        road : Road
            From a router.
        trip_id : str
            Name of the plan.
        **changed : object
            Fields of the departure that differ.

        Returns
        -------
        plan : Plan
            With the departure.
        weather : tuple of Weather
            At places along the road; empty without a source of weather, or where the departure names it.

        Raises
        ------
        InvalidInput
            As the weather.
        """
        road = self.expected(road)
        departure = replace(self.departure, **changed)
        plan = road.plan(trip_id).with_departure(departure)
        if self.weather is None or departure.has_weather:
            return self.change(plan), ()
        position, weather = weather_along(road, self.weather, self.departs_at)
        return self.change(plan_with_weather(plan, road, position, weather)), weather

    def expected(self, road: Road) -> Road:
        """Replace free-flow travel times by those that are expected on the road, where the model has them.

        Parameters
        ----------
        road : Road
            From a router.

        Returns
        -------
        Road
            The same road where its travel times are not of free flow, or the model has not measured them.
        """
        uncertainty = self.model.uncertainty_
        if not road.links.free_flow or uncertainty is None or uncertainty.free_flow is None:
            return road
        return road.with_links(uncertainty.free_flow.factors.expected(road.links))

    def forecast_plan(self, plan: Plan, weather: tuple[Weather, ...] = ()) -> Forecast:
        """Forecast the energy of a plan; the error of the weather is part of its standard deviation.

        Parameters
        ----------
        plan : Plan
            With its departure and weather.
        weather : tuple of Weather
            From which the plan's weather was made.

        Returns
        -------
        Forecast
            For the model's car.
        """
        forecast = self.model.forecast(plan)
        sd_wh = self._weather_sd_wh(forecast, weather)
        return replace(forecast, state_sd_wh=float(np.hypot(forecast.state_sd_wh, sd_wh)))

    def _weather_sd_wh(self, forecast: Forecast, weather: tuple[Weather, ...]) -> float:
        """Standard deviation of the energy by the error of the weather forecast [Wh]: one simulation more for each."""
        plan = forecast.plan
        if not weather or plan.weather is None or weather[0].hours_ahead is None:
            return 0.0
        kelvin = float(np.mean([w.temperature_sd_k for w in weather]))
        wind = WIND_AT_CAR * float(np.mean([w.wind_sd_m_s for w in weather]))
        parts = []
        ambient = plan.departure.ambient_temperature_degc
        if ambient is not None and self.departure.ambient_temperature_degc is None:
            colder = replace(
                plan, departure=replace(plan.departure, ambient_temperature_degc=ambient - kelvin)
            )
            parts.append(self._simulated_wh(colder))
        parts.append(self._simulated_wh(replace(plan, weather=plan.weather.with_more_wind(wind))))
        base = forecast.drive.simulation.simulated_energy_wh
        return float(np.linalg.norm([part - base for part in parts]))

    def _simulated_wh(self, plan: Plan) -> float:
        return simulate_trip(self.model.vehicle, plan).simulated_energy_wh


def capped(road: Road, speed_m_s: float) -> Road:
    """The road driven no faster than a speed on motorways. O(links).

    The speed is a limit of the links. Their free speed stays, so that a motorway is expected to have the traffic of a motorway.

    Examples
    --------
    >>> import numpy as np
    >>> from tripwatt.roads.routers import Edges, pooled
    >>> links, _ = pooled(Edges.from_speeds(np.array([3600.0]), np.array([100.0]), np.array([36.0])))
    >>> road = Road(links, ("motorway",), np.zeros(2), np.array([0.0, 0.03]), np.array([0.0, 3600.0]))
    >>> capped(road, 30.0).duration_s, capped(road, 40.0).duration_s
    (120.0, 100.0)
    """
    links = road.links
    moving = np.where(np.isnan(links.moving_speed_m_s), links.speed_m_s, links.moving_speed_m_s)
    slower = on_motorway(road) & (moving > speed_m_s)
    longer_s = np.where(slower, links.length_m * (1.0 / speed_m_s - 1.0 / moving), 0.0)
    limit = np.full(len(links), np.nan) if links.speed_limit_m_s is None else links.speed_limit_m_s
    limit = np.where(slower, np.fmin(limit, speed_m_s), limit)
    slow = replace(links, travel_time_s=links.travel_time_s + longer_s, speed_limit_m_s=limit)
    return road.with_links(slow)


def on_motorway(road: Road) -> BoolArray:
    """Which links are motorways, shape (links,), bool."""
    return np.array([kind in MOTORWAYS for kind in road.road_class], dtype=bool)
