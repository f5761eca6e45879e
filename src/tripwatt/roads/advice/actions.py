"""Actions of a driver: each changes the plan of a trip, its departure, or the energy that the car takes from the plug."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from tripwatt.arrays import FloatArray, distance_driven, running_sum
from tripwatt.forecasting import Forecast
from tripwatt.physics.simulate import conditions_at_departure
from tripwatt.roads.advice.preheating import SCARCE, WORTH, preheating
from tripwatt.roads.journey import ChargingPlan, RoadForecaster
from tripwatt.roads.journey.corridor import Corridor
from tripwatt.roads.journey.plans import fastest_plan
from tripwatt.roads.routers import Road
from tripwatt.trips import Departure, Plan
from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

Effort = Literal["none", "little", "some", "much"]
EFFORTS: Final[tuple[Effort, ...]] = ("none", "little", "some", "much")

SPEEDS_KM_H: Final = (130.0, 120.0, 110.0, 100.0, 90.0, 80.0)
"""Highest speeds that are advised: a choice, because slower cars hinder others on a motorway."""
FAST_KM_H: Final = 90.0
"""Trips that are nowhere faster than this are not slowed down: on a road with one lane, the speed is that of the other cars."""
GENTLE_M_S2: Final = 0.9
"""Acceleration and braking of a calm driver: a choice of the order that eco-driving courses teach."""
_SETPOINT_STEPS_K: Final = (2.0, 4.0, 6.0)
"""Steps by which the set-point is moved towards the outside temperature, within 16 to 28 °C: choices, the latter about the ends of what cars offer."""
_SEATS_SETPOINT_DEGC: Final = 16.0
"""Set-point of the cabin with heated seats in place of warm air: a choice, because seats warm the body, not the air."""
_SEATS_FROM_K: Final = 8.0
"""Heated seats are advised only if the outside air is more than this below the set-point: a choice, because a smaller difference
saves little."""
MILD_DEGC: Final = (8.0, 30.0)
"""Outside temperatures at which a car is driven without climate control: below, windows mist; above, drivers tire."""
_LUGGAGE_KG: Final = 50.0
"""Luggage that is advised to be left at home: a choice, because less saves nothing that a driver would see."""
ALONE: Final = ("road", "departure")
"""Groups of actions that change the whole trip, and are not combined with others."""
_DEPARTURE_SHIFTS_H: Final = (-1, 1, 2, 3)
"""Hours by which a car may leave earlier or later: a choice."""
_MAX_WINTER_TYRES_DEGC: Final = 7.0
"""Winter tyres are kept at or below this outside temperature: the usual rule of 7 °C."""


@dataclass(frozen=True, eq=False, slots=True)
class Action:
    """An action of a driver.

    Attributes
    ----------
    code : str
        Code of the action, which selects its text.
    group : str
        Group of the action; at most one action of each group is taken.
    effort : str
        "none", "little", "some" or "much".
    changed : dict of str to object
        Fields of the departure that the action changes.
    value : float or None
        Value of the action, such as a speed [m/s] or a temperature [°C], in SI units.
    speed_m_s, acceleration_m_s2 : float or None
        Highest speed, and highest acceleration.
    fitted, removed : str
        An extra that is switched on, and one that is taken off.
    wall_wh : float
        Energy from the plug [Wh].
    before_s : float
        Time before departure at which the action begins [s].

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 40_000.0, "speed_m_s": 36.0}])
    >>> slow = Action("slower", "speed", "little", {}, 30.0, speed_m_s=30.0)
    >>> slow.apply_to(plan).duration_s > plan.duration_s
    True
    """

    code: str
    group: str
    effort: Effort
    changed: Mapping[str, Any]
    value: float | None = None
    speed_m_s: float | None = None
    acceleration_m_s2: float | None = None
    fitted: str = ""
    removed: str = ""
    wall_wh: float = 0.0
    before_s: float = 0.0

    def apply_to(self, plan: Plan) -> Plan:
        """Change a plan. O(samples).

        Parameters
        ----------
        plan : Plan
            A plan, with or without other actions.

        Returns
        -------
        Plan
            The plan with this action.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 40_000.0, "speed_m_s": 36.0}])
        >>> Action("climate_off", "climate", "much", {"climate": "off"}).apply_to(plan).departure.climate
        'off'
        """
        if self.speed_m_s is not None:
            plan = cap_speed(plan, self.speed_m_s)
        if self.acceleration_m_s2 is not None:
            plan = limit_acceleration(plan, self.acceleration_m_s2)
        changed = dict(self.changed)
        if self.fitted or self.removed:
            kept = (extra for extra in plan.departure.extras or () if extra != self.removed)
            changed["extras"] = (*kept, *((self.fitted,) if self.fitted else ()))
        return replace(plan, departure=replace(plan.departure, **changed)) if changed else plan


def cap_speed(plan: Plan, speed_m_s: float, after_s: float = -np.inf) -> Plan:
    """Return a plan driven no faster than a speed from `after_s` after departure on; the length of the road stays. O(samples).

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 40_000.0, "speed_m_s": 36.0}])
    >>> slow = cap_speed(plan, 25.0)
    >>> bool(slow.duration_s > 1.3 * plan.duration_s), round(slow.distance_m / plan.distance_m, 3)
    (True, 1.0)
    """
    speed, time = plan.array("speed_m_s"), plan.array("time_s")
    return _with_speeds(plan, np.where(time - time[0] > after_s, np.minimum(speed, speed_m_s), speed))


def limit_acceleration(plan: Plan, acceleration_m_s2: float) -> Plan:
    """Return a plan that accelerates and brakes no harder than a value; the length of the road stays. O(samples).

    Over a distance s, the square of the speed rises by at most 2 x acceleration x s: one pass forwards limits the acceleration, and
    one pass backwards the braking.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 400.0, "speed_m_s": 12.0, "stop_s": 10.0}] * 20)
    >>> hard = np.abs(np.diff(plan.array("speed_m_s")) / np.diff(plan.array("time_s"))).max()
    >>> soft = limit_acceleration(plan, 0.5)
    >>> bool(np.abs(np.diff(soft.array("speed_m_s")) / np.diff(soft.array("time_s"))).max() < hard)
    True
    """
    speed = plan.array("speed_m_s")
    max_rise = 2.0 * acceleration_m_s2 * np.diff(distance_driven(plan.array("time_s"), speed))
    square = speed**2
    for order in (slice(None), slice(None, None, -1)):
        limit = running_sum(max_rise[order])
        square[order] = limit + np.minimum.accumulate(square[order] - limit)
    return _with_speeds(plan, np.sqrt(np.maximum(square, 0.0)))


def _with_speeds(plan: Plan, speed_m_s: FloatArray) -> Plan:
    """Return a plan with lower speeds at the same places; standstills take as long as before."""
    time = plan.array("time_s")
    mean, mean_before = (0.5 * (v[1:] + v[:-1]) for v in (speed_m_s, plan.array("speed_m_s")))
    stretch = np.divide(mean_before, mean, out=np.ones_like(mean), where=mean > 1e-6)
    steps = np.diff(time) * np.maximum(stretch, 1.0)
    new_time = np.concatenate((time[:1], time[0] + np.cumsum(steps)))
    step_s = plan.step_s if np.array_equal(steps, np.diff(time)) else None
    return replace(plan, samples=plan.samples.assign(time_s=new_time, speed_m_s=speed_m_s), step_s=step_s)


def actions(forecast: Forecast) -> Iterator[Action]:
    """Yield all actions that are possible for a trip, whether they help or not; in each group, the mildest comes first."""
    plan, vehicle = forecast.plan, forecast.vehicle
    for limit in limits_below(float(plan.array("speed_m_s").max())):
        yield Action("slower", "speed", "little", {}, limit, speed_m_s=limit)
    yield Action("calmer", "driving", "little", {}, acceleration_m_s2=GENTLE_M_S2)
    yield from _climate_actions(vehicle, plan)
    for worth in (WORTH, SCARCE):  # preheating that pays on any day, then what pays if charge is scarce
        if heat := preheating(vehicle, plan, worth=worth):
            action = Action("preheat_cabin", "cabin", "little", heat.changed, heat.cabin_degc)
            yield replace(action, wall_wh=heat.wall_wh, before_s=heat.before_s)
    yield from _load_actions(plan.departure)


def limits_below(fastest_m_s: float) -> list[float]:
    """Return the advised speeds more than 1 m/s below the fastest of a trip [m/s], highest first; none if that is at most `FAST_KM_H`."""
    limits = [speed * M_S_PER_KM_H for speed in SPEEDS_KM_H]
    return [limit for limit in limits if fastest_m_s > max(limit + 1.0, FAST_KM_H * M_S_PER_KM_H)]


def _climate_actions(vehicle: Vehicle, plan: Plan) -> Iterator[Action]:
    """Yield a set-point nearer to the outside air, heated seats, and no climate control if it is mild."""
    departure = plan.departure
    if vehicle.climate is None or departure.climate == "off":
        return
    conditions = conditions_at_departure(vehicle, departure)
    outside, setpoint = conditions.ambient_temperature_degc, conditions.cabin_start(vehicle).setpoint_degc
    cold = outside < setpoint
    for k in _SETPOINT_STEPS_K:
        moved = setpoint - k if cold else setpoint + k
        if k <= abs(outside - setpoint) and 16.0 <= moved <= 28.0:
            yield Action("setpoint", "climate", "some", {"cabin_setpoint_degc": moved}, moved)
    if cold and setpoint - outside > _SEATS_FROM_K and "heated_seats" not in (departure.extras or ()):
        seats = {"cabin_setpoint_degc": _SEATS_SETPOINT_DEGC}
        yield Action("seats", "climate", "some", seats, fitted="heated_seats")
    if MILD_DEGC[0] <= outside <= MILD_DEGC[1]:
        yield Action("climate_off", "climate", "much", {"climate": "off"})


def _load_actions(departure: Departure) -> Iterator[Action]:
    """Yield actions on the roof box, the tyres and the luggage."""
    extras = departure.extras or ()
    ambient = departure.ambient_temperature_degc
    if "roof_box" in extras:
        yield Action("no_roof_box", "roof", "some", {}, removed="roof_box")
    if "winter_tyres" in extras and ambient is not None and ambient > _MAX_WINTER_TYRES_DEGC:
        yield Action("summer_tyres", "tyres", "much", {}, removed="winter_tyres")
    if departure.tyre_pressure is not None and departure.tyre_pressure < 1.0:
        yield Action("pump_up", "pressure", "some", {"tyre_pressure": 1.0}, departure.tyre_pressure)
    if (departure.payload_mass_kg or 0.0) > _LUGGAGE_KG:
        lighter = {"payload_mass_kg": (departure.payload_mass_kg or 0.0) - _LUGGAGE_KG}
        yield Action("less_luggage", "load", "some", lighter, _LUGGAGE_KG)


def replan_with(corridor: Corridor, action: Action, forecast: Forecast) -> ChargingPlan | None:
    """Plan the stops of a journey again with an action, given its forecast; returns None if no stop helps.

    An action on the plug is applied to the first leg only.
    """

    def change(plan: Plan) -> Plan:
        return plan if action.wall_wh and plan.departure.follows_trip else action.apply_to(plan)

    before = corridor.forecaster
    departure = before.departure
    if action.group == "departure":
        departs_at = before.departs_at + dt.timedelta(seconds=action.value or 0.0)
        departure = replace(departure, departs_at=departs_at)
    forecaster = replace(before, departure=departure, change=change)
    return fastest_plan(replace(corridor, forecaster=forecaster, forecast=forecast))


def leaving_later(forecaster: RoadForecaster, road: Road, now: dt.datetime) -> list[tuple[Action, Forecast]]:
    """Forecast a road for other hours of departure, with their weather.

    Parameters
    ----------
    forecaster : RoadForecaster
        Forecaster with the car, its departure and a source of weather.
    road : Road
        Road from a router.
    now : datetime
        Time of the earliest possible departure.

    Returns
    -------
    list of (Action, Forecast)
        Empty without a source of weather, or if the departure has its own weather.

    Raises
    ------
    InvalidInput
        As in the source of weather.

    Examples
    --------
    >>> leaving_later(forecaster, journey.roads[0].road, dt.datetime.now(dt.UTC))  # doctest: +SKIP
    """
    if forecaster.weather is None or forecaster.departure.has_weather:
        return []
    shifted = []
    for hours in _DEPARTURE_SHIFTS_H:
        leaves = forecaster.departs_at + dt.timedelta(hours=hours)
        if leaves >= now:
            later = Action("leave_later", "departure", "some", {}, SECONDS_PER_HOUR * hours)
            departure = replace(forecaster.departure, departs_at=leaves)
            shifted.append((later, replace(forecaster, departure=departure).forecast(road)))
    return shifted
