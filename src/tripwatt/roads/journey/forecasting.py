"""The forecast of one road, with the weather along it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import BoolArray
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.forecast import Forecaster
from tripwatt.physics import simulate_trip
from tripwatt.roads.maps.heights import KnownHeights
from tripwatt.roads.routers import Road
from tripwatt.roads.weather import Weather, WeatherSource, forecast_sd, plan_with_weather, weather_along
from tripwatt.trips import TERRAINS, Departure, Plan
from tripwatt.trips.weather import WIND_AT_CAR

_MOTORWAY_CLASSES: Final = frozenset({"motorway", "motorway_link", "trunk"})


@dataclass(frozen=True, eq=False)
class RoadForecaster:
    """A forecaster of roads for one car and one departure, used for all roads of a journey.

    Attributes
    ----------
    model : ForecastModel
        Model of the car.
    departure : Departure
        Time of departure, and what is known then.
    weather : WeatherSource or None
        Source of the weather, used if the departure has no weather; None if there is no source.
    change : callable
        Change that is applied to every plan, such as a slower drive.
    heights : KnownHeights or None
        Heights of places on the map: terrain and climb of roads of unknown heights, used if the departure has no terrain.

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.routes import route_from_links
    >>> links = route_from_links([{"length_m": 3000.0, "travel_time_s": 240.0}])
    >>> line = np.array([0.0, 3000.0])
    >>> road = Road(links, ("primary",), np.array([47.0, 47.027]), np.array([9.0, 9.0]), line)
    >>> forecaster = RoadForecaster(tw.load_model("bmw_i3_tum"), Departure(soc=0.8))
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
    heights: KnownHeights | None = None

    @property
    def departs_at(self) -> dt.datetime:
        """Time of departure, or now if it is not known."""
        return self.departure.departs_at or dt.datetime.now(dt.UTC)

    def forecast(self, road: Road, trip_id: str = "journey", **changed: Any) -> Forecast:
        """Forecast the energy of a road.

        Parameters
        ----------
        road : Road
            Road from a router.
        trip_id : str
            Name of the plan.
        **changed : object
            Fields of the departure that differ.

        Returns
        -------
        Forecast
            Forecast whose standard deviation includes the error of the weather.

        Raises
        ------
        InvalidInput
            As in the source of weather and `ForecastModel.forecast`.
        """
        return self.forecast_plan(*self.plan(road, trip_id, **changed))

    def plan(self, road: Road, trip_id: str = "journey", **changed: Any) -> tuple[Plan, tuple[Weather, ...]]:
        """Make the plan of a road with its weather.

        Parameters
        ----------
        road : Road
            Road from a router.
        trip_id : str
            Name of the plan.
        **changed : object
            Fields of the departure that differ.

        Returns
        -------
        plan : Plan
            The plan with its departure.
        weather : tuple of Weather
            Weather at places along the road; empty without a source of weather, or if the departure has its own weather.

        Raises
        ------
        InvalidInput
            As in the source of weather.
        """
        road = with_expected_times(road, self.model)
        departure = replace(self.departure, **changed)
        plan = road.plan(trip_id).with_departure(departure)
        if not plan.has_road and self.heights is not None:
            climb = self.heights.climb(road.latitude_deg, road.longitude_deg, road.position_m)
            terrain = self.heights.terrain if departure.terrain in (None, TERRAINS[0]) else departure.terrain
            plan = replace(plan, climb=climb).with_departure(Departure(terrain=terrain))
        if self.weather is None or departure.has_weather:
            return self.change(plan), ()
        position, weather = weather_along(road, self.weather, self.departs_at)
        return self.change(plan_with_weather(plan, road, position, weather)), weather

    def forecast_plan(self, plan: Plan, weather: tuple[Weather, ...] = ()) -> Forecast:
        """Forecast the energy of a plan; the error of the weather is part of the standard deviation.

        Parameters
        ----------
        plan : Plan
            Plan with its departure and weather.
        weather : tuple of Weather
            Weather from which the plan's weather was made.

        Returns
        -------
        Forecast
            Forecast for the model's car.
        """
        forecast = self.model.forecast(plan)
        sd_wh = np.hypot(forecast.state_sd_wh, self._weather_sd_wh(forecast, weather))
        # without weather the same object: its cached properties are kept
        return replace(forecast, state_sd_wh=float(sd_wh)) if weather else forecast

    def _weather_sd_wh(self, forecast: Forecast, weather: tuple[Weather, ...]) -> float:
        """Return the standard deviation of the energy by errors of forecast temperature and wind [Wh]; each takes one more simulation."""
        plan = forecast.plan
        if not weather or plan.weather is None or weather[0].hours_ahead is None:
            return 0.0
        kelvin, wind_m_s = forecast_sd(weather)
        changed = [replace(plan, weather=plan.weather.with_more_wind(WIND_AT_CAR * wind_m_s))]
        ambient = plan.departure.ambient_temperature_degc
        if ambient is not None and self.departure.ambient_temperature_degc is None:
            colder = replace(plan.departure, ambient_temperature_degc=ambient - kelvin)
            changed.append(replace(plan, departure=colder))
        base_wh = forecast.drive.simulation.simulated_energy_wh
        changed_wh = [simulate_trip(self.model.vehicle, other).simulated_energy_wh for other in changed]
        return float(np.linalg.norm([wh - base_wh for wh in changed_wh]))


def with_expected_times(road: Road, model: Forecaster | None) -> Road:
    """Return a road with expected travel times in place of those of free flow; unchanged if it has no such times, or the model no factors.

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.routes import route_from_links
    >>> links = route_from_links([{"length_m": 3000.0, "travel_time_s": 240.0}])
    >>> road = Road(links, ("primary",), np.zeros(2), np.array([0.0, 0.027]), np.array([0.0, 3000.0]))
    >>> with_expected_times(road, tw.load_model()).distance_m
    3000.0
    """
    uncertainty = getattr(model, "uncertainty_", None)
    if not road.links.free_flow or uncertainty is None or uncertainty.free_flow is None:
        return road
    return road.with_links(uncertainty.free_flow.factors.with_expected_times(road.links))


def cap_motorway_speed(road: Road, speed_m_s: float) -> Road:
    """Return a road driven no faster than a speed on motorways. O(links).

    The speed becomes a limit of the links. Their free speed stays, so that the traffic expected on them is still that of a motorway.

    Examples
    --------
    >>> import numpy as np
    >>> from tripwatt.roads.routers import Edges, join_edges
    >>> links, _ = join_edges(Edges.from_speeds(np.array([3600.0]), np.array([100.0]), np.array([36.0])))
    >>> road = Road(links, ("motorway",), np.zeros(2), np.array([0.0, 0.03]), np.array([0.0, 3600.0]))
    >>> cap_motorway_speed(road, 30.0).duration_s, cap_motorway_speed(road, 40.0).duration_s
    (120.0, 100.0)
    """
    links = road.links
    moving = np.where(np.isnan(links.moving_speed_m_s), links.speed_m_s, links.moving_speed_m_s)
    is_slower = is_motorway(road) & (moving > speed_m_s)
    longer_s = np.where(is_slower, links.length_m * (1.0 / speed_m_s - 1.0 / moving), 0.0)
    limit = np.full(len(links), np.nan) if links.speed_limit_m_s is None else links.speed_limit_m_s
    limit = np.where(is_slower, np.fmin(limit, speed_m_s), limit)
    slowed = replace(links, travel_time_s=links.travel_time_s + longer_s, speed_limit_m_s=limit)
    return road.with_links(slowed)


def is_motorway(road: Road) -> BoolArray:
    """Return which links are motorways, shape (links,)."""
    return np.array([kind in _MOTORWAY_CLASSES for kind in road.road_class], dtype=bool)
