"""The consumption curve of a car as request parameters of HERE, TomTom, Mapbox and A Better Routeplanner.

These services describe a car by its consumption at constant speeds on a level road, by the energy that a metre of height
costs and brings back, and by a constant auxiliary power. All these values are simulated here: drives of half an hour, but at
most 20 km, from the given departure, so that a cold cabin and cold tyres are included. `docs/howto/export.md` lists the
parameters of each service, their units and the sources.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, changes
from tripwatt.errors import Fault, InvalidInput
from tripwatt.physics import Simulation, simulate_trip
from tripwatt.physics.battery import usable_energy_wh
from tripwatt.routes import route_from_links
from tripwatt.trips import Departure, Flag, Plan, require_departure
from tripwatt.trips.messages import message
from tripwatt.units import GRAVITY_M_S2, M_S_PER_KM_H, SECONDS_PER_HOUR, WH_PER_J
from tripwatt.vehicles import Vehicle

DRIVE_S: Final = 1800.0
"""Longest simulated drive [s]; the auxiliary power is the mean over such a drive."""

DRIVE_M: Final = 20_000.0
"""Longest simulated drive [m]: no battery runs empty on it."""

LOWEST_KM_H: Final = 10
HIGHEST_KM_H: Final = 180
STEP_KM_H: Final = 10
"""Speeds of the curve. TomTom takes at most 25 points."""

REFERENCE_KM_H: Final = 70
"""Speed at which slopes are driven and the auxiliaries are counted."""

SLOPE: Final = 0.05
"""Grade of the slopes: steep enough that a part of the way down is braked by the motor."""

ABRP_KM_H: Final = 110

TRAFFIC_LINK_M: Final = 1000.0

AUXILIARIES: Final = ("base_load", "climate")
"""Causes of a simulation that flow with time rather than with distance."""


@dataclass(frozen=True, eq=False, slots=True)
class ConsumptionCurve:
    """Consumption of a car on level ground and on slopes, without a route. Arrays have shape (speeds,).

    Attributes
    ----------
    speed_km_h : ndarray of int
        Speeds that the car can hold.
    energy_wh_km : ndarray
        Energy at the battery terminals at constant speed on a level road, without auxiliaries.
    traffic_energy_wh_km : ndarray
        The same energy if the speed is only the mean over each link, stops included.
    auxiliary_power_w : float
        Base load and climate control, mean over the drive.
    ascent_wh_m, descent_wh_m : float
        Energy that a metre of height costs uphill, and that it saves downhill.
    acceleration_efficiency, deceleration_efficiency : float
        Kinetic energy gained over the energy spent for it; energy saved over the kinetic energy lost.
    mass_kg : float
        Test mass and payload.
    capacity_wh : float
        Energy between an empty and a full battery, as displayed.
    reference_wh_km : float
        Energy at 110 km/h, auxiliaries included.
    """

    speed_km_h: IntArray
    energy_wh_km: FloatArray
    traffic_energy_wh_km: FloatArray
    auxiliary_power_w: float
    ascent_wh_m: float
    descent_wh_m: float
    acceleration_efficiency: float
    deceleration_efficiency: float
    mass_kg: float
    capacity_wh: float
    reference_wh_km: float

    @property
    def uphill_efficiency(self) -> float:
        """Potential energy gained over the energy spent for it."""
        return _share(self.mass_kg * GRAVITY_M_S2 * WH_PER_J / self.ascent_wh_m)

    @property
    def downhill_efficiency(self) -> float:
        """Energy saved over the potential energy lost."""
        return _share(self.descent_wh_m / (self.mass_kg * GRAVITY_M_S2 * WH_PER_J))


def _share(value: float) -> float:
    return min(max(value, 0.01), 1.0)


def consumption_curve(
    vehicle: Vehicle,
    departure: Departure | None = None,
    *,
    correction: Callable[[Plan], float] | None = None,
) -> ConsumptionCurve:
    """Simulate the car at constant speeds, in traffic, on slopes and in changes of speed. About 40 drives of half an hour.

    Parameters
    ----------
    vehicle : Vehicle
    departure : Departure, optional
        Temperatures, payload and state of charge; unknown values are the defaults of `simulate`.
    correction : callable, optional
        Returns the energy [Wh] to add to the simulated energy of a plan, such as that of a corrector. The power of the
        correction at the lowest speed, where driving takes least, counts as auxiliary power. Its difference from this power
        at other speeds and in traffic counts as driving, so that the sum is right at every speed. Slopes and changes of
        speed are simulated without it: no log holds half an hour of a steep road.

    Raises
    ------
    InvalidInput
        When an argument cannot be used, or the car cannot hold any speed.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> curve = consumption_curve(load_vehicle("bmw_i3_60ah"))
    >>> bool(curve.energy_wh_km[-1] > curve.energy_wh_km[4]), bool(curve.descent_wh_m < curve.ascent_wh_m)
    (True, True)
    """
    departure = require_departure(departure)
    physics = _Driver(vehicle, departure)
    correction, slow = correction or physics.correction, physics.steady(LOWEST_KM_H * M_S_PER_KM_H)
    drive = _Driver(vehicle, departure, correction, correction(slow) * SECONDS_PER_HOUR / slow.duration_s)
    speeds, levels = [], []
    for speed in range(LOWEST_KM_H, HIGHEST_KM_H + 1, STEP_KM_H):
        level, flags = drive.constant(speed * M_S_PER_KM_H)
        if flags:
            break
        speeds.append(speed)
        levels.append(level)
    if not speeds:
        where = f"{vehicle.name} at {LOWEST_KM_H} km/h"
        got = "; ".join(map(message, flags))
        raise InvalidInput.of("car cannot hold the speed", where, got, "a car that can hold the speed")
    mass = vehicle.body.test_mass_kg + (departure.payload_mass_kg or 0.0)
    reference = REFERENCE_KM_H * M_S_PER_KM_H
    flat, up, down = (physics.constant(reference, grade)[0] for grade in (0.0, SLOPE, -SLOPE))
    rise_m_km = 1000.0 * SLOPE
    gained, saved = physics.changes_of_speed(mass * vehicle.body.rotating_mass_factor)
    return ConsumptionCurve(
        speed_km_h=np.array(speeds, dtype=np.int64),
        energy_wh_km=np.array(levels),
        traffic_energy_wh_km=np.array([drive.in_traffic(v * M_S_PER_KM_H) for v in speeds]),
        auxiliary_power_w=max(physics.auxiliary_power(reference) + drive.constant_w, 0.0),
        ascent_wh_m=(up - flat) / rise_m_km,
        descent_wh_m=max(flat - down, 0.0) / rise_m_km,
        acceleration_efficiency=gained,
        deceleration_efficiency=saved,
        mass_kg=mass,
        capacity_wh=usable_energy_wh(vehicle.battery),
        reference_wh_km=drive.reference(),
    )


@dataclass(frozen=True, slots=True)
class _Driver:
    """Simulated drives of one car from one departure, with a correction of their energy [Wh].

    The correction counts as driving, less `constant_w`, its power at the lowest speed [W].
    """

    vehicle: Vehicle
    departure: Departure
    correction: Callable[[Plan], float] = lambda trip: 0.0
    constant_w: float = 0.0

    def trip(self, speed_m_s: FloatArray, grade: float = 0.0) -> Plan:
        samples = {"time_s": np.arange(float(len(speed_m_s))), "speed_m_s": speed_m_s}
        if grade:
            samples["grade"] = np.full(len(speed_m_s), grade)
        return Plan.from_trace("export", samples, self.departure)

    def driving_wh(self, trip: Plan) -> tuple[float, Simulation]:
        """Energy of a trip without auxiliaries [Wh], and its simulation."""
        run = simulate_trip(self.vehicle, trip)
        by_cause = run.by_cause_wh
        energy = run.simulated_energy_wh - sum(by_cause[cause] for cause in AUXILIARIES)
        constant_wh = self.constant_w * trip.duration_s / SECONDS_PER_HOUR
        return energy + self.correction(trip) - constant_wh, run

    def steady(self, speed_m_s: float, grade: float = 0.0) -> Plan:
        duration = int(min(DRIVE_S, DRIVE_M / speed_m_s))
        return self.trip(np.full(duration + 1, speed_m_s), grade)

    def constant(self, speed_m_s: float, grade: float = 0.0) -> tuple[float, tuple[Flag, ...]]:
        """Energy [Wh/km] at constant speed without auxiliaries, and the flags that say why the car cannot hold the speed."""
        trip = self.steady(speed_m_s, grade)
        energy, run = self.driving_wh(trip)
        return energy / (trip.distance_m / 1000.0), run.flags

    def auxiliary_power(self, speed_m_s: float) -> float:
        run = simulate_trip(self.vehicle, self.trip(np.full(int(DRIVE_S) + 1, speed_m_s)))
        energy = sum(run.by_cause_wh[cause] for cause in AUXILIARIES)
        return energy * SECONDS_PER_HOUR / DRIVE_S

    def reference(self) -> float:
        """Energy per kilometre [Wh/km] at 110 km/h with auxiliaries."""
        trip = self.steady(ABRP_KM_H * M_S_PER_KM_H)
        energy = simulate_trip(self.vehicle, trip).simulated_energy_wh
        return (energy + self.correction(trip)) / (trip.distance_m / 1000.0)

    def in_traffic(self, speed_m_s: float) -> float:
        """Energy per kilometre [Wh/km] without auxiliaries on links with only a mean speed."""
        number = max(3, round(min(speed_m_s * DRIVE_S, DRIVE_M) / TRAFFIC_LINK_M))
        route = route_from_links([{"length_m": TRAFFIC_LINK_M, "speed_m_s": speed_m_s}] * number)
        trip = route.plan().with_departure(self.departure)
        return self.driving_wh(trip)[0] / (trip.distance_m / 1000.0)

    def changes_of_speed(self, inertia_kg: float) -> tuple[float, float]:
        """Kinetic energy gained per energy spent, and energy saved per kinetic energy lost, between 20 and 90 km/h."""
        slow, fast, pace = 20.0 * M_S_PER_KM_H, 90.0 * M_S_PER_KM_H, 0.7
        change_s = round((fast - slow) / pace)
        hold = np.full(600, 1.0)  # warms the car as far as a drive does before the change is made
        up = np.concatenate((slow * hold, np.linspace(slow, fast, change_s + 1)))
        kinetic_wh = 0.5 * inertia_kg * (fast**2 - slow**2) * WH_PER_J
        spent = self._change_wh(up, len(hold))
        down = np.concatenate((fast * hold, np.linspace(fast, slow, change_s + 1)))
        saved = self._change_wh(down, len(hold))
        return _share(kinetic_wh / spent), _share(-saved / kinetic_wh)

    def _change_wh(self, speed: FloatArray, start: int) -> float:
        """Energy [Wh] of a change of speed from sample `start` on, less what the same stretch takes at constant speeds."""
        _, run = self.driving_wh(self.trip(speed))
        hours = changes(run.time_s) * WH_PER_J
        auxiliary = sum(run.power_by_cause_w[cause] for cause in AUXILIARIES)
        total = float(np.sum(((run.battery_power_w - auxiliary) * hours)[start:]))
        mean = 0.5 * (speed[1:] + speed[:-1])[start - 1 :]
        levels = np.linspace(float(speed.min()), float(speed.max()), 8)
        rate = np.interp(mean, levels, [self.constant(v)[0] for v in levels.tolist()])
        return total - float(np.sum(rate * mean)) / 1000.0


def _here(curve: ConsumptionCurve) -> dict[str, str]:
    return {
        "ev[freeFlowSpeedTable]": ",".join(_pairs(curve.speed_km_h, curve.energy_wh_km / 1000.0, 4)),
        "ev[trafficSpeedTable]": ",".join(_pairs(curve.speed_km_h, curve.traffic_energy_wh_km / 1000.0, 4)),
        "ev[auxiliaryConsumption]": f"{curve.auxiliary_power_w / SECONDS_PER_HOUR:.4f}",
        "ev[ascent]": f"{curve.ascent_wh_m:.3f}",
        "ev[descent]": f"{curve.descent_wh_m:.3f}",
        "ev[maxCharge]": f"{curve.capacity_wh / 1000.0:.2f}",
    }


def _tomtom(curve: ConsumptionCurve) -> dict[str, str]:
    energy = curve.energy_wh_km[:25] / 10.0
    rises = np.flatnonzero(np.diff(energy) >= 0.0)
    end = int(rises[-1]) + 2 if len(rises) else 1  # TomTom accepts no falling end
    shares = {
        "accelerationEfficiency": curve.acceleration_efficiency,
        "decelerationEfficiency": curve.deceleration_efficiency,
        "uphillEfficiency": curve.uphill_efficiency,
        "downhillEfficiency": curve.downhill_efficiency,
    }
    return {
        "vehicleEngineType": "electric",
        "constantSpeedConsumptionInkWhPerHundredkm": ":".join(
            _pairs(curve.speed_km_h[:end], energy[:end], 2)
        ),
        "auxiliaryPowerInkW": f"{curve.auxiliary_power_w / 1000.0:.3f}",
        "vehicleWeight": f"{curve.mass_kg:.0f}",
        **{name: f"{math.floor(share * 1000) / 1000:.3f}" for name, share in shares.items()},
    }


def _mapbox(curve: ConsumptionCurve) -> dict[str, str]:
    return {
        "engine": "electric",
        "energy_consumption_curve": ";".join(_pairs(curve.speed_km_h, curve.energy_wh_km, 0)),
        "auxiliary_consumption": f"{curve.auxiliary_power_w:.0f}",
        "ev_max_charge": f"{curve.capacity_wh:.0f}",
        "ascent": f"{min(curve.ascent_wh_m, 1000.0):.3f}",
        "descent": f"{min(curve.descent_wh_m, 1000.0):.3f}",
    }


def _pairs(speed_km_h: IntArray, energy: FloatArray, digits: int) -> list[str]:
    least = np.maximum(energy, 0.01).tolist()
    return [f"{v},{e:.{digits}f}" for v, e in zip(speed_km_h.tolist(), least, strict=True)]


EXPORTS: Final[Mapping[str, Callable[[ConsumptionCurve], dict[str, str]]]] = {
    "here": _here,
    "tomtom": _tomtom,
    "mapbox": _mapbox,
    "abrp": lambda c: {"ref_consumption": f"{c.reference_wh_km:.0f}"},
}
"""The services that a curve can be exported to."""


def export_curve(
    vehicle: Vehicle,
    service: str,
    departure: Departure | None = None,
    *,
    correction: Callable[[Plan], float] | None = None,
) -> dict[str, str]:
    """Request parameters that describe a car to a routing service: name -> text of the value.

    Parameters
    ----------
    vehicle : Vehicle
    service : str
        One of `EXPORTS`: here, tomtom, mapbox, abrp.
    departure, correction
        As `consumption_curve`.

    Raises
    ------
    InvalidInput
        When there is no such service, or as `consumption_curve`.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> sorted(export_curve(load_vehicle("bmw_i3_60ah"), "abrp"))
    ['ref_consumption']
    """
    if service not in EXPORTS:
        raise InvalidInput(Fault.unknown("unknown service", "service", service, EXPORTS))
    return EXPORTS[service](consumption_curve(vehicle, departure, correction=correction))


def render_query(parameters: Mapping[str, str]) -> str:
    """Parameters as the query part of a request's address.

    Examples
    --------
    >>> render_query({"ev[ascent]": "9", "ev[freeFlowSpeedTable]": "0,0.2"})
    'ev[ascent]=9&ev[freeFlowSpeedTable]=0,0.2'
    """
    from urllib.parse import quote, urlencode

    return urlencode(parameters, safe="[],;:", quote_via=quote)
