"""Preheating before departure: start and temperature of the cabin, by a search on its model; the charge to leave with."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.forecasting import ForecastModel
from tripwatt.physics import conditions_at_departure, simulate_trip
from tripwatt.physics.cabin import CONTROL_STEP_S, CabinStart, CabinTask, condition_cabins
from tripwatt.population import for_car
from tripwatt.roads.journey import Need, need
from tripwatt.roads.journey.charging import EFFICIENCY, ChargingCurve
from tripwatt.roads.journey.kinds import typical_road
from tripwatt.roads.maps.stations import Station
from tripwatt.trips import Departure, Flag, Plan, Trip
from tripwatt.trips.messages import leave_in_words
from tripwatt.uncertainty import ChargeScale
from tripwatt.units import SECONDS_PER_HOUR, WH_PER_J
from tripwatt.vehicles import Climate, Vehicle

PLUG_W: Final = 7400.0
"""A wall box with one phase of 32 A."""
CHARGER: Final = 0.9
"""Energy that reaches the car over that of the wall; on-board chargers are a little better. A choice."""
WORTH: Final = 2.0
"""Weight of energy of the battery at departure over that of the wall: charging on the way costs about twice that at home. A choice."""
SCARCE: Final = 10.0
"""The same weight if the charge does not suffice. A choice."""
COMFORT_W_K: Final = 1000.0
"""Cost of a kelvin off the set-point on the way, as power of the wall: six minutes that are 10 K too cold count for 1 kWh. A choice.
The temperature that counts is the operative one, the mean of air and surfaces (ISO 7726)."""
STEP_S: Final = 60.0
"""A choice, because a preheating is set by the minute."""
STEPS: Final = 60
"""Longest time of preheating, in steps of `STEP_S`; earlier heat is lost by the departure. A choice."""
TRIED_K: Final = (0.0, -2.0, 2.0, 4.0)
"""Set-points that are tried: by how much they are nearer to the outside air than the driver's."""
MIN_WH: Final = 20.0
"""Smaller savings are not advised, since nobody sees them on a display [Wh]."""


@dataclass(frozen=True, slots=True)
class Preheating:
    """A preheating of the cabin before departure.

    Attributes
    ----------
    cabin_degc : float
        Set-point of the cabin.
    before_s : float
        Time before departure at which the preheating begins [s].
    wall_wh : float
        Energy from the wall [Wh].
    saved_wh : float
        Saved energy of the battery, preheating and trip together [Wh].
    changed : mapping of str to (float or None)
        Fields of the departure that the preheating changes.

    Examples
    --------
    >>> import tripwatt as tw
    >>> cold = tw.Departure(ambient_temperature_degc=-5.0)
    >>> plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}]).with_departure(cold)
    >>> heat = preheating(tw.load_vehicle("vw_id3"), plan)
    >>> heat.cabin_degc >= 22.0, heat.wall_wh > heat.saved_wh > 0.0
    (True, True)
    """

    cabin_degc: float
    before_s: float
    wall_wh: float
    saved_wh: float
    changed: Mapping[str, float | None]

    def to_dict(self, departs_at: dt.datetime | None = None) -> dict[str, Any]:
        """Convert to plain values, with the time at which the preheating begins if `departs_at` is given.

        Parameters
        ----------
        departs_at : datetime, optional
            Time of departure.

        Returns
        -------
        dict
            Texts and numbers.

        Examples
        --------
        >>> heat = Preheating(22.0, 600.0, 800.0, 600.0, {})
        >>> heat.to_dict(dt.datetime(2026, 1, 5, 7, 30))["starts_at"]
        '2026-01-05T07:20:00'
        """
        starts_at = None if departs_at is None else departs_at - dt.timedelta(seconds=self.before_s)
        values = {name: getattr(self, name) for name in Preheating.__slots__[:-1]}
        return {"starts_at": starts_at and starts_at.isoformat(), **values}


def preheating(
    vehicle: Vehicle, plan: Plan, *, plug_w: float = PLUG_W, worth: float = WORTH
) -> Preheating | None:
    """Find the start and temperature of preheating the cabin with the least cost. O(options x samples).

    The cost is the wall energy, plus `worth` times the energy of the battery, plus the discomfort on the way. All starts and set-points
    are tried. Power beyond that of the plug comes from the battery and counts as such; options that take more from the battery than no
    preheating are left out.

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    plan : Plan
        Plan with the departure as it is without preheating.
    plug_w : float
        Power of the plug [W]; 0 if the car is not plugged in.
    worth : float
        Weight of energy of the battery over that of the wall.

    Returns
    -------
    Preheating or None
        None if no preheating is worth its cost, such as without a plug.

    Examples
    --------
    >>> import tripwatt as tw
    >>> car, road = tw.load_vehicle("vw_id3"), tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])
    >>> cold = road.with_departure(tw.Departure(ambient_temperature_degc=-5.0))
    >>> mild = road.with_departure(tw.Departure(ambient_temperature_degc=20.0))
    >>> preheating(car, cold, plug_w=0.0) is preheating(car, mild) is None
    True
    """
    climate, conditions = vehicle.climate, conditions_at_departure(vehicle, plan.departure, plan.air)
    start, ambient = conditions.cabin_start(vehicle), conditions.ambient_temperature_degc
    if climate is None or start.mode == "off":
        return None
    aims = [
        start.setpoint_degc + kelvin * math.copysign(1.0, ambient - start.setpoint_degc) for kelvin in TRIED_K
    ]
    power, air, interior = _parked_cabins(climate, ambient, start, aims)
    road = CabinTask(climate, plan.array("time_s"), plan.array("speed_m_s"), ambient, start)
    within = start.temperature_degc if start.interior_degc is None else start.interior_degc
    run = road.run_from(np.append(start.temperature_degc, air), np.append(within, interior))
    hours = CONTROL_STEP_S / SECONDS_PER_HOUR
    trip_wh = (run.heat_w + run.fan_w).sum(axis=0) * hours
    operative = 0.5 * (run.air_degc + run.interior_degc)[1:]
    discomfort_wh = np.abs(operative - start.setpoint_degc).sum(axis=0) * hours * COMFORT_W_K
    # number 0 is no preheating
    plugged, total = (
        np.append(0.0, watt.cumsum(axis=1) * (STEP_S * WH_PER_J))
        for watt in (np.minimum(power, plug_w * CHARGER), power)
    )
    taken = total - plugged + trip_wh
    # rounded, so that equal options stay equal on every machine
    saved, wall = np.round(taken[0] - taken, 6), plugged / CHARGER
    cost = wall - worth * saved + discomfort_wh
    cost[saved < 0.0] = np.inf
    cost[0] -= worth * MIN_WH
    best = int(np.argmin(cost))
    if best == 0:
        return None
    aim, steps = divmod(best - 1, STEPS)
    light, heavy = climate.air_heat_capacity_j_k, climate.interior_heat_capacity_j_k
    mixed = (light * air[aim, steps] + heavy * interior[aim, steps]) / (light + heavy)
    changed = {"cabin_temperature_degc": float(mixed), "cabin_logged": None, "warmth": start.warmth}
    return Preheating(aims[aim], STEP_S * (steps + 1), float(wall[best]), float(saved[best]), changed)


def _parked_cabins(climate: Climate, ambient: float, start: CabinStart, aims: list[float]) -> FloatArray:
    """Simulate parked cabins without people and sun at some set-points; return mean power [W] and temperatures of air and interior [°C] at the end of each step.

    The result has shape (3, set-points, STEPS).
    """
    empty, hour, still = replace(climate, occupant_heat_w=0.0), STEP_S * np.array([0.0, STEPS]), np.zeros(2)
    dark = [replace(start, setpoint_degc=aim, solar_irradiance_w_m2=0.0) for aim in aims]
    runs = condition_cabins([CabinTask(empty, hour, still, ambient, start) for start in dark])
    per_step = round(STEP_S / CONTROL_STEP_S)
    power = [(run.heat_w + run.fan_w).reshape(STEPS, per_step).mean(axis=1) for run in runs]
    air, interior = (
        [getattr(run, name)[per_step::per_step] for run in runs] for name in ("air_degc", "interior_degc")
    )
    return np.array([power, air, interior])


def before_departure(
    model: ForecastModel, plan: Plan, soc_needed: float, plug_w: float, now: Departure
) -> dict[str, Any]:
    """Return what to do before a trip, for `GET /v1/need`: target charge and time, energy and time of charging, preheating.

    Parameters
    ----------
    model : ForecastModel
        Model of the car.
    plan : Plan
        Plan with the departure as it is without preheating.
    soc_needed : float
        Displayed charge to leave with.
    plug_w : float
        Power of the plug [W]; 0 if the car is not plugged in.
    now : Departure
        Displayed charge now, and time of departure.

    Returns
    -------
    dict
        Plain values. The car charges with the smaller of the powers of plug and car, and with less if the battery is almost full.

    Examples
    --------
    >>> import tripwatt as tw
    >>> cold, road = tw.Departure(soc=0.3, ambient_temperature_degc=-5.0), [{"length_m": 60_000.0, "speed_m_s": 20.0}]
    >>> do = before_departure(tw.load_model(), tw.read_route(road).with_departure(cold), 0.8, 3700.0, cold)
    >>> do["target_soc"] > do["soc"], do["charging_s"] > 3600.0, do["preheat"]["wall_wh"] > 0.0
    (True, True, True)
    """
    vehicle, scale = model.vehicle, model.fitted_parts("forecast")[1].charge
    if scale is None:
        scale = ChargeScale.from_published(vehicle.battery, simulate_trip(vehicle, plan).terminal_voltage_v)
    soc, leaves, target, wh = now.soc, now.departs_at, min(soc_needed, 1.0), scale.wh_per_display
    begins = target if soc is None else min(soc, target)
    missing_wh = None if soc is None else (target - begins) * wh
    curve, plug = ChargingCurve.from_vehicle(vehicle, wh), Station.without_plugs(0.0, 0.0, "", plug_w)
    cell_degc = conditions_at_departure(vehicle, plan.departure).battery_start_degc
    into_battery_s = float(curve.seconds(np.linspace(begins, target, 101), plug, wh, cell_degc)[-1])
    heat = preheating(vehicle, plan, plug_w=plug_w)
    return {
        "target_soc": target,
        "departs_at": leaves and leaves.isoformat(),
        "soc": soc,
        "charge_wh": missing_wh,
        "wall_wh": None if missing_wh is None else missing_wh / CHARGER,
        "charging_w": min(plug_w, curve.most_w[plug.direct_current]) if plug_w else None,
        "charging_s": into_battery_s * EFFICIENCY / CHARGER if plug_w and soc is not None else None,
        "preheat": heat and heat.to_dict(leaves),
    }


def need_before_departure(
    ahead: float | Plan | Trip, kind: str, departure: Departure, plug_w: float, **options: Any
) -> tuple[Need, dict[str, Any]]:
    """Return the result of `need`, and the same with that of `before_departure` as plain values, for `GET /v1/need` and `tripwatt need --json`.

    `ahead` is a distance [km] or a trip, `plug_w` the power of the plug [W]; `options` go to `need`, but `soc`: the displayed charge now, by
    default that of the departure.

    Examples
    --------
    >>> import tripwatt as tw
    >>> cold = tw.Departure(ambient_temperature_degc=-5.0)
    >>> need_before_departure(50.0, "mixed", cold, 7400.0)[1]["preheat"]["before_s"] > 0.0
    True
    """
    model = for_car(options.pop("model", None), options.pop("car", None))
    now = replace(departure, soc=options.pop("soc", departure.soc))
    needed = need(ahead, kind, departure, model=model, **options)
    trip = Plan.from_trip(ahead) if isinstance(ahead, Trip) else ahead
    plan = trip if isinstance(trip, Plan) else typical_road(1000.0 * trip, kind)
    until = before_departure(model, plan.with_departure(departure), needed.soc_needed, plug_w, now)
    depends = until["charging_s"] and model.vehicle.charging is None
    assumed = (Flag("class_charging_curve", "charging"),) if depends else ()
    message = leave_in_words(needed.soc_needed, needed.reserve, needed.probability)
    needed = replace(needed, flags=(*needed.flags, *assumed))
    return needed, {**needed.to_dict(), "message": message, **until}
