"""Simulation of a drive of a car, and its conditions from what is known at departure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray, changes
from tripwatt.errors import Fault, raise_faults
from tripwatt.physics.cabin import CabinRun, CabinTask, condition_cabins, irradiance
from tripwatt.physics.chain import CAUSE_NAMES, Trace, drive_chain
from tripwatt.physics.conditions import UNKNOWN_AMBIENT_DEGC, DriveConditions, warmth_from_cabin
from tripwatt.physics.road_load import air_density, grade_from_elevation
from tripwatt.trips import COLUMNS, QUANTITIES, Departure, Flag, Plan, PlanWeather, Recorded
from tripwatt.trips.showing import period
from tripwatt.units import WH_PER_J, with_units
from tripwatt.vehicles import Vehicle, with_extras

if TYPE_CHECKING:
    import pandas as pd

    from tripwatt.figures import Axes, Figure

STRONGEST_WIND_M_S: Final = QUANTITIES["wind_speed_m_s"].maximum


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """Forces, powers and state of a car along a trip. Arrays have shape (samples,).

    Value k belongs to the interval that ends at sample k; the first interval has no length. Powers are positive
    when they discharge the battery, except `regen_power_w` and `friction_brake_power_w`, which are never negative.

    Attributes
    ----------
    time_s : ndarray
        Time of each sample [s].
    grade : ndarray
        Road grade used [1].
    aero_drag_force_n, rolling_resistance_force_n, grade_force_n, inertia_force_n : ndarray
        Forces of air drag, rolling, grade and inertia [N]; their sum is `traction_force_n`.
    wheel_power_w : ndarray
        Power at the wheels that the trace needs.
    motor_power_w : ndarray
        Electric power of motor and inverter.
    regen_power_w : ndarray
        Electric power that motor and inverter give back.
    friction_brake_power_w, auxiliary_power_w, climate_power_w, fan_power_w : ndarray
        Power of the friction brakes; of all auxiliaries; of climate control, a part of the auxiliaries; and of blower, rear
        window and seats, a part of climate control.
    battery_power_w : ndarray
        Power at the battery terminals; the energy is its integral.
    battery_current_a, terminal_voltage_v, battery_temperature_degc, soc : ndarray
        Current and voltage at the battery terminals, temperature of the battery, and state of charge of the battery management;
        regeneration never raises the latter above full.
    cabin_temperature_degc : ndarray
        Temperature of the cabin air [°C]; NaN if no climate control was simulated.
    battery_loss_w : ndarray
        Heat in the battery, on top of `battery_power_w`.
    energy_wh : ndarray
        Cumulative energy at the battery terminals [Wh].
    power_by_cause_w : dict of str to ndarray
        Power at the battery terminals [W] due to each of `CAUSES`; the sum is `battery_power_w`. Power that a full battery does
        not take counts for the friction brakes.
    flags : tuple of Flag
        Limits of the car that the trip reached, mostly with the time that they lasted [s]; empty if there are none.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> run = simulate(load_vehicle("bmw_i3_60ah"), np.arange(60.0), np.full(60, 15.0))
    >>> table = run.to_frame()
    >>> len(table), float(table["energy_wh"].iloc[-1]) == run.simulated_energy_wh
    (60, True)
    """

    time_s: FloatArray
    grade: FloatArray
    aero_drag_force_n: FloatArray
    rolling_resistance_force_n: FloatArray
    grade_force_n: FloatArray
    inertia_force_n: FloatArray
    wheel_power_w: FloatArray
    motor_power_w: FloatArray
    regen_power_w: FloatArray
    friction_brake_power_w: FloatArray
    auxiliary_power_w: FloatArray
    climate_power_w: FloatArray
    fan_power_w: FloatArray
    battery_power_w: FloatArray
    battery_current_a: FloatArray
    terminal_voltage_v: FloatArray
    battery_temperature_degc: FloatArray
    cabin_temperature_degc: FloatArray
    soc: FloatArray
    battery_loss_w: FloatArray
    energy_wh: FloatArray
    power_by_cause_w: Mapping[str, FloatArray]
    flags: tuple[Flag, ...]

    @property
    def simulated_energy_wh(self) -> float:
        """Energy of the whole trip at the battery terminals [Wh]."""
        return float(self.energy_wh[-1])

    @cached_property
    def by_cause_wh(self) -> dict[str, float]:
        """Energy of the whole trip [Wh] due to each of `CAUSES`, as in `Forecast.by_cause_wh`; the sum is `simulated_energy_wh`."""
        hours = changes(self.time_s) * WH_PER_J
        return {cause: float(power @ hours) for cause, power in self.power_by_cause_w.items()}

    @property
    def cumulative_by_cause_wh(self) -> dict[str, FloatArray]:
        """Cumulative energy [Wh] due to each of `CAUSES`; the sum is `energy_wh`."""
        hours = changes(self.time_s) * WH_PER_J
        return {cause: np.cumsum(power * hours) for cause, power in self.power_by_cause_w.items()}

    def to_frame(self) -> pd.DataFrame:
        """Put all arrays into one table.

        Returns
        -------
        DataFrame
            One row per sample and one column per array, energies by cause as `energy_<cause>_wh` [Wh].
        """
        import pandas as pd

        columns = {name: values for name, values in vars(self).items() if isinstance(values, np.ndarray)}
        columns |= {f"energy_{cause}_wh": e for cause, e in self.cumulative_by_cause_wh.items()}
        return with_units(pd.DataFrame(columns))

    def plot(self, ax: Axes | None = None) -> Figure:
        """Plot the energy at the battery terminals over time, by cause and in total.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw in; a new figure if not given.

        Returns
        -------
        matplotlib.figure.Figure
            Cumulative energy [kWh] over time [min]; causes with next to no energy are left out.

        Examples
        --------
        >>> import tripwatt as tw
        >>> run = tw.simulate(tw.read_route([{"length_m": 5000.0, "speed_m_s": 20.0}]), "vw_id3")
        >>> run.plot().savefig("simulation.png")  # doctest: +SKIP
        """
        from tripwatt.trips.plots import plot_parts  # matplotlib is slow to import

        causes = {CAUSE_NAMES[name]: wh for name, wh in self.cumulative_by_cause_wh.items()}
        return plot_parts(self.time_s, causes, self.energy_wh, f"{self!r}"[1:-1], ax)

    def __repr__(self) -> str:
        span = period(float(self.time_s[-1] - self.time_s[0]))
        return f"<Simulation {span}, {self.simulated_energy_wh / 1000.0:.2f} kWh, {len(self.time_s)} samples>"


def simulate(
    vehicle: Vehicle,
    time_s: npt.ArrayLike,
    speed_m_s: npt.ArrayLike,
    *,
    grade: npt.ArrayLike | None = None,
    elevation_m: npt.ArrayLike | None = None,
    climate_power_w: npt.ArrayLike | None = None,
    headwind_m_s: npt.ArrayLike | None = None,
    conditions: DriveConditions | None = None,
) -> Simulation:
    """Simulate a car that drives a speed trace. O(samples), no loop over samples.

    Parameters
    ----------
    vehicle : Vehicle
    time_s, speed_m_s : array_like, shape (samples,)
        Increasing times [s] and speeds [m/s].
    grade : array_like, shape (samples,), optional
        Road grade at the samples, rise over distance. If given, the slope of `elevation_m` is not used.
    elevation_m : array_like, shape (samples,), optional
        Logged elevation [m], cleaned by `grade_from_elevation`; NaN where missing.
    climate_power_w : float or array_like, shape (samples,), optional
        Electric power of heating and cooling [W] over the interval that ends at each sample; from the car's climate model
        if not given.
    headwind_m_s : array_like, shape (samples,), optional
        Wind against the direction of travel at the car's height [m/s], negative from behind; calm if not given.
    conditions : DriveConditions, optional
        Surroundings, load and state of the car at the start; `DriveConditions()` if not given.

    Returns
    -------
    Simulation

    Raises
    ------
    InvalidInput
        With every argument that cannot be used. A trace that the car cannot follow raises no error: see `Simulation.flags`.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car, without_climate = load_vehicle("bmw_i3_60ah"), DriveConditions(climate="off")
    >>> parked = simulate(car, [0.0, 3600.0], [0.0, 0.0], conditions=without_climate)
    >>> parked.simulated_energy_wh
    300.0
    """
    given = grade, elevation_m, climate_power_w, headwind_m_s
    return _simulated(_drive_of(vehicle, time_s, speed_m_s, *given, conditions=conditions))


def simulate_trip(vehicle: Vehicle, trip: Recorded | Plan) -> Simulation:
    """Simulate a trip or a plan from what is known at departure, its speed trace and its road.

    Measurements enter only through `trip.departure`; `conditions_at_departure` fills in what is unknown there.
    The trip may be raw or resampled.

    Parameters
    ----------
    vehicle : Vehicle
        The car, without the extras of the departure: these are added here.
    trip : Trip or Plan
        With `time_s`, `speed_m_s`, and `grade` or `elevation_m` if known.

    Returns
    -------
    Simulation
        One value per sample of the trip.

    Raises
    ------
    InvalidInput
        For the same faults as `simulate`.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt.vehicles import load_vehicle
    >>> from tripwatt.trips import Trip
    >>> log = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_m_s": [0.0, 1.0, 2.0]})
    >>> run = simulate_trip(load_vehicle("bmw_i3_60ah"), Trip.from_samples("start", log))
    >>> bool(run.simulated_energy_wh > 0.0)
    True
    """
    return _simulated(drive_of_trip(vehicle, trip))


def conditions_at_departure(
    vehicle: Vehicle, known: Departure, weather: PlanWeather | None = None
) -> DriveConditions:
    """Choose the conditions of a drive from what is known at departure, with usual values for what is unknown.

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    known : Departure
        What is known.
    weather : PlanWeather, optional
        Weather along the plan, of which air density and rain are used.

    Returns
    -------
    DriveConditions
        At the start of the drive.

    Examples
    --------
    >>> from tripwatt.trips import Departure
    >>> from tripwatt.vehicles import load_vehicle
    >>> conditions_at_departure(load_vehicle("bmw_i3_60ah"), Departure(soc=0.8)).ambient_temperature_degc
    10.0
    """
    soc = known.bms_soc
    if soc is None and known.soc is not None:
        soc = min(1.0, max(0.0, vehicle.battery.soc_from_displayed(known.soc)))
    ambient = known.ambient_temperature_degc
    if ambient is None:
        ambient = UNKNOWN_AMBIENT_DEGC
    reading, setpoint = known.cabin_temperature_degc, known.cabin_setpoint_degc
    # a logged reading at the lower end of the sensor's range shows only that the cabin is no warmer
    lowest = vehicle.climate.sensor_minimum_degc if vehicle.climate and known.cabin_logged else -math.inf
    cabin = reading if reading is None or reading > lowest else None
    warmth = warmth_from_cabin(vehicle, cabin, setpoint, ambient)
    if cabin is None:  # as cold as the outside air, but no warmer than the lower end of the sensor's range
        cabin = ambient if reading is None else min(reading, ambient)
    if known.follows_trip:
        warmth = 1.0
    if known.warmth is not None:
        warmth = known.warmth
    return DriveConditions(
        ambient_temperature_degc=ambient,
        initial_soc=0.8 if soc is None else soc,
        initial_battery_temperature_degc=known.battery_temperature_degc,
        payload_mass_kg=known.payload_mass_kg or 0.0,
        initial_cabin_temperature_degc=cabin,
        cabin_setpoint_degc=setpoint,
        solar_irradiance_w_m2=irradiance(known.weather, known.season),
        initial_warmth=warmth,
        climate=known.climate or "auto",
        air_density_kg_m3=None if weather is None else weather.air_density_kg_m3,
        rain_mm_h=0.0 if weather is None else weather.rain_mm_h,
    )


@dataclass(frozen=True, eq=False, slots=True)
class Drive:
    """Checked inputs of the chain. Arrays have shape (samples,); `grade` is the one of the intervals.

    `conditions` have an air density and a battery temperature. `climate_power_w` is used if `cabin` is None.
    """

    vehicle: Vehicle
    conditions: DriveConditions
    time_s: FloatArray
    speed_m_s: FloatArray
    grade: FloatArray
    headwind_m_s: FloatArray | None
    cabin: CabinTask | None
    climate_power_w: FloatArray
    name: str = ""

    def climate(self, cabin: CabinRun | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the power of climate control, the part of its fans, and the cabin temperature.

        The cabin temperature is NaN if no cabin was simulated.
        """
        if cabin is not None:
            return cabin.power_w, cabin.fan_power_w, cabin.temperature_degc
        power = np.broadcast_to(self.climate_power_w, self.time_s.shape)
        return power, np.zeros_like(self.time_s), np.full_like(self.time_s, np.nan)


def _drive_of(
    vehicle: Vehicle,
    time_s: npt.ArrayLike,
    speed_m_s: npt.ArrayLike,
    *more: npt.ArrayLike | None,
    conditions: DriveConditions | None = None,
    name: str = "",
    road: FloatArray | None = None,
) -> Drive:
    """Check the arguments of `simulate` and collect them in a `Drive`. O(samples).

    `more` are grade, elevation, climate power and headwind. `road` is the grade of the intervals, if it was computed before.
    """
    conditions = DriveConditions() if conditions is None else conditions
    time = np.asarray(time_s, dtype=np.float64)
    speed = np.asarray(speed_m_s, dtype=np.float64)
    slope, height, given, wind = (None if a is None else np.asarray(a, dtype=np.float64) for a in more)
    climate = np.zeros(()) if given is None else given
    faults = _argument_faults(time, speed, slope, height, climate, wind)
    raise_faults([*faults, *conditions.faults(vehicle)])
    if road is not None:
        slope = road
    elif slope is None:
        slope = np.zeros(len(time)) if height is None else grade_from_elevation(time, speed, height)
    else:
        slope = np.concatenate((slope[:1], 0.5 * (slope[1:] + slope[:-1])))
    density = conditions.air_density_kg_m3
    if density is None:
        known = np.zeros(0) if height is None else height[np.isfinite(height)]
        density = air_density(conditions.ambient_temperature_degc, float(known.mean()) if len(known) else 0.0)
    battery_degc = conditions.battery_start_degc
    conditions = replace(conditions, air_density_kg_m3=density, initial_battery_temperature_degc=battery_degc)
    cabin: CabinTask | None = None
    if conditions.climate != "off" and given is None and vehicle.climate is not None:
        ambient, start = conditions.ambient_temperature_degc, conditions.cabin_start(vehicle)
        cabin = CabinTask(vehicle.climate, time, speed, ambient, start)
    return Drive(vehicle, conditions, time, speed, slope, wind, cabin, climate, name)


def drive_of_trip(vehicle: Vehicle, trip: Recorded | Plan, road: FloatArray | None = None) -> Drive:
    """Make the `Drive` of a car, with the extras of the departure, on a trip or a plan. O(samples)."""
    weather = trip.air if isinstance(trip, Plan) else None
    return _drive_of(
        with_extras(vehicle, trip.departure.extras or (), trip.departure.tyre_pressure),
        trip.array("time_s"),
        trip.array("speed_m_s"),
        trip.array("grade") if trip.has("grade") else None,
        trip.elevation_m,
        None,
        None if weather is None else weather.headwind_m_s,
        conditions=conditions_at_departure(vehicle, trip.departure, weather),
        name=trip.trip_id,
        road=road,
    )


def _simulated(drive: Drive) -> Simulation:
    trace = Trace.from_samples(drive.time_s, drive.speed_m_s, drive.grade, drive.headwind_m_s)
    cabin = None if drive.cabin is None else condition_cabins([drive.cabin])[0]
    power, fan, air = drive.climate(cabin)
    arrays, flags = drive_chain(drive.vehicle, trace, drive.conditions, power)
    return Simulation(**arrays, fan_power_w=fan, cabin_temperature_degc=air, flags=flags[0])


def _argument_faults(
    time: FloatArray,
    speed: FloatArray,
    slope: FloatArray | None,
    height: FloatArray | None,
    climate: FloatArray,
    headwind: FloatArray | None,
) -> Iterator[Fault]:
    """Yield a fault for every argument of `simulate` that cannot be used.

    All arrays have the shape of `time`; `climate` may also be a single number, and `height` may have NaN.
    """
    if time.ndim != 1 or len(time) < 2:
        yield Fault("wrong shape", "time_s", str(time.shape), "one dimension, at least 2 samples")
    elif not (time[1:] > time[:-1]).all() and np.isfinite(time).all():
        late = int(np.flatnonzero(np.diff(time) <= 0)[0]) + 1
        got = f"{time[late]:g} s after {time[late - 1]:g} s"
        yield Fault("time does not increase", f"time_s, sample {late}", got, "increasing times")
    largest = float(np.finfo(np.float64).max)
    for name, values, low, high in (
        ("time_s", time, -largest, largest),
        ("speed_m_s", speed, *COLUMNS["speed_m_s"].bounds),
        ("grade", slope, *COLUMNS["grade"].bounds),
        ("elevation_m", height, -largest, largest),
        ("climate_power_w", climate, 0.0, 1e5),
        ("headwind_m_s", headwind, -STRONGEST_WIND_M_S, STRONGEST_WIND_M_S),
    ):
        if values is None:
            continue
        if values.shape not in (time.shape, () if name == "climate_power_w" else time.shape):
            yield Fault("wrong shape", name, str(values.shape), f"that of time_s, {time.shape}")
        if values.size and values.min() >= low and values.max() <= high:
            continue  # a missing value fails both comparisons
        wrong = np.isinf(values) if name == "elevation_m" else ~np.isfinite(values)
        if wrong.any():
            sample = int(np.flatnonzero(wrong)[0])
            where, got = f"{name}, sample {sample}", str(values.flat[sample])
            yield Fault("missing value", where, got, "finite numbers")
        elif values.size and (values.min() < low or values.max() > high):
            got = f"{values.min() if values.min() < low else values.max():g}"
            yield Fault("value out of range", name, got, f"{low:g} to {high:g}")
