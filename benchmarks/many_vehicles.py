"""A synthetic fleet of many vehicles with a known truth, made in blocks of trips as arrays: hundreds of trips a second.

Nothing here is measured. Car models are those of the library; of each vehicle the truth differs from its car model in
rolling resistance, air drag, heat loss of the cabin and base load, and each car model from its published values. Drivers
differ in their set-point and in how much they take; batteries age; seasons change. `vehicle_truth` has all of
it. A trip depends on the seed, its car model and its place in the order of the model alone, so that any block can be
made anywhere, and a longer fleet begins with the shorter one.

The speed is a sequence of speeds with accelerations between them. The energy is that of `tripwatt.physics` where it works
on whole arrays (road load, drivetrain, battery); tyres and cabin warm up by an exponential of their own.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import Fault, InvalidInput
from tripwatt.physics.battery import battery_current, internal_resistance, open_circuit_voltage
from tripwatt.physics.cabin import heat_pump_cop, heat_pump_heat
from tripwatt.physics.drivetrain import propulsion
from tripwatt.physics.road_load import air_density
from tripwatt.study.synthetic.scenario import stream
from tripwatt.study.synthetic.sensors import quantise
from tripwatt.trips import Context, Log, raise_faults, table_of
from tripwatt.units import GRAVITY_M_S2, SECONDS_PER_HOUR, WH_PER_J
from tripwatt.vehicles import Vehicle, load_vehicle

CAR_MODELS: Final = (
    "bmw_i3_60ah",
    "nissan_leaf_24",
    "vw_id3",
    "renault_zoe_ze50_r135",
    "tesla_model_3_sr_plus",
    "hyundai_kona_64",
    "chevrolet_bolt",
    "nissan_leaf_40",
)

BLOCK: Final = 64
"""Trips that are made together."""

FIRST_DAY: Final = dt.date(2023, 1, 1)

MODELS, VEHICLES, BLOCKS = 20, 21, 22  # purposes of streams, after those of `scenario`

MODEL_SD: Final = np.array([0.08, 0.06, 0.15, 0.2])
VEHICLE_SD: Final = np.array([0.08, 0.05, 0.15, 0.25])
"""Relative deviations of rolling resistance, air drag, heat loss and base load: of a model from its published values, of a
vehicle from its model."""

TRIP_SD: Final = 0.03
"""Of a trip: wind, surface and load that nobody logs, as a share of the rolling and air resistance."""

DRIVER_SD: Final = 0.02
"""Of a driver: how much more of the propelling power he takes."""

AGEING_PER_YEAR: Final = np.array([0.03, 0.015])
"""Rise of the battery's resistance and loss of its capacity in a year, as shares."""

CAUSES: Final = ("road load", "climate", "base load", "battery")
"""What may change of a vehicle."""

NOISE_W: Final = 150.0
PHASES: Final = 48


@dataclass(frozen=True, slots=True)
class FleetPlan:
    """What a synthetic fleet is made of.

    Attributes
    ----------
    trips : int
        Of all vehicles together.
    vehicles : int
        Spread evenly over the car models.
    car_models : tuple of str
    seed : int
    minutes : float
        Longest trip; the shortest has two thirds of it.
    days_between : float
        Mean time from one trip of a vehicle to the next.
    changes : tuple of (int, str, float, float)
        Planted changes: number of the vehicle, one of `CAUSES`, the day of the fleet from which on it holds, and the share by
        which it multiplies the road load, the climate control's power or the base load, or divides the capacity, on top of 1.

    Raises
    ------
    InvalidInput
        With every number that cannot be.
    """

    trips: int
    vehicles: int = 200
    car_models: tuple[str, ...] = CAR_MODELS
    seed: int = 0
    minutes: float = 24.0
    days_between: float = 3.65
    changes: tuple[tuple[int, str, float, float], ...] = ()

    def __post_init__(self) -> None:
        bounds = {
            "trips": (1, 10**8),
            "vehicles": (1, 10**6),
            "minutes": (5.0, 120.0),
            "days_between": (0.05, 30.0),
        }
        raise_faults(
            Fault("value out of range", name, f"{getattr(self, name)}", f"{low:g} to {high:g}")
            for name, (low, high) in bounds.items()
            if not low <= getattr(self, name) <= high
        )
        if not self.car_models or len(self.car_models) > self.vehicles:
            got = f"{len(self.car_models)} for {self.vehicles} vehicles"
            raise InvalidInput.of(
                "wrong number of car models", "car_models", got, "1 to the number of vehicles"
            )

    def vehicles_of(self, model: int) -> range:
        """Numbers of the vehicles of a car model."""
        return range(model, self.vehicles, len(self.car_models))

    def trips_of(self, model: int) -> int:
        """Number of trips of a car model: each vehicle has the same number, but for the last round."""
        whole, rest = divmod(self.trips, self.vehicles)
        its = self.vehicles_of(model)
        return whole * len(its) + sum(number < rest for number in its)

    def blocks(self) -> list[tuple[int, int]]:
        """(car model, number of the block) of all blocks."""
        return [
            (model, block)
            for model in range(len(self.car_models))
            for block in range(-(-self.trips_of(model) // BLOCK))
        ]


@dataclass(frozen=True, slots=True)
class VehicleTruth:
    """What is true of a vehicle and in no log.

    Attributes
    ----------
    vehicle_id, car_model : str
    shares : tuple of 4 floats
        Relative deviations from the published values: rolling resistance, air drag, heat loss, base load; those of the car
        model and the vehicle's own together.
    own : tuple of 4 floats
        The vehicle's own part.
    drivers : tuple of (str, float, float)
        Name, set-point [°C] and share of the propelling power on top.
    """

    vehicle_id: str
    car_model: str
    shares: tuple[float, ...]
    own: tuple[float, ...]
    drivers: tuple[tuple[str, float, float], ...]


def vehicle_truth(plan: FleetPlan, number: int) -> VehicleTruth:
    """The truth of one vehicle of a fleet.

    Examples
    --------
    >>> vehicle_truth(FleetPlan(100, vehicles=10), 9).car_model
    'nissan_leaf_24'
    """
    model = number % len(plan.car_models)
    common = MODEL_SD * np.clip(stream(plan.seed, MODELS, model).standard_normal(4), -2.0, 2.0)
    rng = stream(plan.seed, VEHICLES, number)
    own = VEHICLE_SD * np.clip(rng.standard_normal(4), -2.0, 2.0)
    drivers = tuple(
        (
            f"V{number:05d}/{letter}",
            float(np.clip(rng.normal(21.5, 1.0), 19.0, 24.0)),
            float(DRIVER_SD * rng.standard_normal()),
        )
        for letter in "ABC"[: int(rng.integers(1, 4))]
    )
    return VehicleTruth(
        f"V{number:05d}",
        plan.car_models[model],
        tuple((common + own).tolist()),
        tuple(own.tolist()),
        drivers,
    )


def many_vehicles(plan: FleetPlan) -> Iterator[Log]:
    """All logs of a synthetic fleet, block by block. O(samples).

    Parameters
    ----------
    plan : FleetPlan

    Examples
    --------
    >>> logs = list(many_vehicles(FleetPlan(20, vehicles=4, car_models=("vw_id3", "chevrolet_bolt"))))
    >>> len(logs), len({log.context.car for log in logs})
    (20, 4)
    """
    for model, block in plan.blocks():
        yield from block_of_logs(plan, model, block)


def block_of_logs(plan: FleetPlan, model: int, block: int) -> list[Log]:
    """The logs of one block of one car model.

    Parameters
    ----------
    plan : FleetPlan
    model, block : int
        As `FleetPlan.blocks` numbers them.
    """
    order = np.arange(
        block * BLOCK, (block + 1) * BLOCK
    )  # always whole, so that a longer fleet begins with a shorter
    used = min(BLOCK, plan.trips_of(model) - block * BLOCK)
    its = plan.vehicles_of(model)
    truths = [vehicle_truth(plan, its[int(j) % len(its)]) for j in order]
    numbers = order // len(its)
    rng = stream(plan.seed, BLOCKS, model, block)
    trips = BlockOfTrips.drawn(plan, truths, numbers, rng)
    columns = _driven(_car(plan.car_models[model]), trips, rng)
    power = columns["voltage_v"] * columns["current_a"]
    energy_wh = (
        np.cumsum(0.5 * (power[:, 1:] + power[:, :-1]), axis=1) * WH_PER_J
    )  # as `observed_energy`, of all at once
    logs = []
    for i in range(used):
        n = int(trips.samples[i])
        started = dt.datetime.combine(FIRST_DAY, dt.time()) + dt.timedelta(
            seconds=round(float(trips.start_s[i]))
        )
        context = Context(started_at=started, car=truths[i].vehicle_id, driver=trips.driver[i])
        table = table_of({name: values[i, :n] for name, values in columns.items()})
        name = f"{truths[i].vehicle_id}-{int(numbers[i]):05d}"
        logs.append(Log(name, table, context, float(energy_wh[i, n - 2])))
    return logs


@lru_cache(maxsize=64)
def _car(name: str) -> Vehicle:
    return load_vehicle(name)


@dataclass(frozen=True, eq=False, slots=True)
class BlockOfTrips:
    """Trips of a block before they are driven; arrays of shape (trips,) or (trips, 1)."""

    samples: FloatArray
    start_s: FloatArray
    driver: list[str]
    setpoint_degc: FloatArray
    power_share: FloatArray
    shares: FloatArray
    years: FloatArray
    ambient_degc: FloatArray
    soc: FloatArray
    resistance_share: FloatArray
    changed: dict[str, FloatArray]

    @classmethod
    def drawn(
        cls, plan: FleetPlan, truths: list[VehicleTruth], numbers: IntArray, rng: np.random.Generator
    ) -> BlockOfTrips:
        n = len(truths)
        days = plan.days_between * (numbers + rng.uniform(0.0, 0.8, n))
        hour = np.clip(rng.normal(13.0, 4.0, n), 5.0, 21.0)
        season = np.cos((days - 20.0) / 365.25 * 2.0 * np.pi)
        course = np.cos((hour - 15.0) / 12.0 * np.pi)
        ambient = 10.0 - 10.0 * season + 3.0 * course + 4.0 * rng.standard_normal(n)
        who = [
            truth.drivers[int(k * len(truth.drivers))] for truth, k in zip(truths, rng.random(n), strict=True)
        ]
        longest = plan.minutes * 60.0
        return cls(
            np.floor(rng.uniform(2.0 / 3.0, 1.0, n) * longest) + 1.0,
            (np.floor(days) * 24.0 + hour) * SECONDS_PER_HOUR,
            [name for name, _, _ in who],
            np.round(2.0 * np.array([setpoint for _, setpoint, _ in who])) / 2.0,
            np.array([share for _, _, share in who]),
            np.array([truth.shares for truth in truths]),
            days / 365.25,
            ambient,
            rng.uniform(0.5, 0.9, n),
            TRIP_SD * rng.standard_normal(n),
            changed_shares(plan, truths, days),
        )


def changed_shares(plan: FleetPlan, truths: list[VehicleTruth], days: FloatArray) -> dict[str, FloatArray]:
    """Share of each cause on top of 1, of shape (trips, 1), by the planted changes of a fleet."""
    ids = np.array([truth.vehicle_id for truth in truths])
    shares = {cause: np.zeros((len(truths), 1)) for cause in CAUSES}
    for number, cause, day, share in plan.changes:
        shares[cause][(ids == f"V{number:05d}") & (np.floor(days) >= day)] += share
    return shares


def _speeds(n: int, trips: int, rng: np.random.Generator) -> FloatArray:
    """Speeds [m/s] of trips at 1 Hz, shape (trips, n): phases of a speed with accelerations between, and stops."""
    road = rng.uniform(0.0, 1.0, (trips, 1))  # 0 a town, 1 a motorway
    target = np.clip(9.0 + 22.0 * road + (3.0 + 3.0 * road) * rng.standard_normal((trips, PHASES)), 3.0, 38.0)
    target[rng.random((trips, PHASES)) < 0.30 - 0.22 * road] = 0.0
    target[:, 0] = 0.0
    hold = rng.exponential(1.0, (trips, PHASES)) * (18.0 + 30.0 * road) + 4.0
    hold[:, 0] = rng.uniform(2.0, 8.0, trips)
    pace = rng.uniform(0.7, 1.5, (trips, PHASES))
    change = np.abs(np.diff(target, axis=1, prepend=0.0)) / pace + 1.0
    knots = np.cumsum(np.stack([change, hold], axis=2).reshape(trips, -1), axis=1)
    values = np.repeat(target, 2, axis=1)
    time = np.arange(float(n))
    speed = np.array([np.interp(time, k, v) for k, v in zip(knots, values, strict=True)])
    phase = rng.uniform(0.0, 2.0 * np.pi, (trips, 2))
    wave = np.sin(time / 9.0 + phase[:, :1]) + np.sin(time / 31.0 + phase[:, 1:])
    return np.asarray(speed * (1.0 + 0.03 * wave))


def _driven(car: Vehicle, trips: BlockOfTrips, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Logged columns of the trips of a block, each of shape (trips, samples)."""
    n, count = int(trips.samples.max()), len(trips.samples)
    time = np.broadcast_to(np.arange(float(n)), (count, n))
    speed = _speeds(n, count, rng)
    mean = speed.copy()
    mean[:, 1:] = 0.5 * (speed[:, 1:] + speed[:, :-1])
    acceleration = np.diff(speed, axis=1, prepend=speed[:, :1])
    distance = np.cumsum(mean, axis=1)
    size, length = rng.uniform(2.0, 12.0, (count, 1)), rng.uniform(300.0, 900.0, (count, 1))
    elevation = 300.0 + size * np.sin(distance / length)
    grade = size / length * np.cos((distance - 0.5 * mean) / length)
    ambient = trips.ambient_degc[:, None]
    power = wheel_power(car, trips, mean, acceleration, grade, time)
    drive = propulsion(power.ravel(), mean.ravel(), np.ones(power.size), car.drivetrain, car.regeneration)
    motor = drive.motor_power_w.reshape(count, n)
    motor = motor + trips.power_share[:, None] * np.maximum(motor, 0.0)
    climate, cabin = climate_power(car, trips, time)
    climate = climate * (1.0 + trips.changed["climate"])
    base = car.auxiliaries.base_load_w * (1.0 + trips.shares[:, 3:4]) * (1.0 + trips.changed["base load"])
    noise = NOISE_W * rng.standard_normal((count, n)) * (0.3 + (speed > 0.0))
    current, voltage, soc = battery_states(car, trips, motor + climate + base + noise)
    cells = car.battery
    return {
        "time_s": time,
        "speed_m_s": speed,
        "elevation_m": quantise(elevation, 0.1),
        "ambient_temperature_degc": np.broadcast_to(quantise(ambient, 0.5), (count, n)),
        "cabin_temperature_degc": quantise(cabin, 0.1),
        "cabin_setpoint_degc": np.broadcast_to(trips.setpoint_degc[:, None], (count, n)),
        "battery_temperature_degc": np.broadcast_to(quantise(ambient + 3.0, 0.5), (count, n)),
        "voltage_v": quantise(voltage, 0.1),
        "current_a": quantise(current, 0.05),
        "soc": quantise(soc, 0.001),
        "displayed_soc": quantise(np.clip(cells.displayed_from_soc(soc), 0.0, 1.0), 0.005),
    }


def wheel_power(
    car: Vehicle,
    trips: BlockOfTrips,
    mean: FloatArray,
    acceleration: FloatArray,
    grade: FloatArray,
    time: FloatArray,
) -> FloatArray:
    mass = car.body.test_mass_kg
    constant, linear = car.road_load.rolling_coefficients
    rolling, drag = trips.shares[:, :1], trips.shares[:, 1:2]
    trip = trips.resistance_share[:, None]
    density = np.array([air_density(t, 300.0) for t in trips.ambient_degc])[:, None]
    factor = np.ones_like(density)
    warm = np.ones_like(mean)
    if car.tyres is not None:
        weather = [car.tyres.weather_factor(t) for t in trips.ambient_degc.tolist()]
        factor = np.maximum(np.array(weather)[:, None], 0.5)
        warm = 1.0 + car.tyres.cold_excess * np.exp(-time / car.tyres.warm_up_time_s)
    rolling_n = mass * GRAVITY_M_S2 * (constant + linear * mean) * (mean > 0.0) * factor * warm
    air_n = 0.5 * density * car.road_load.drag_area_m2 * mean * mean
    resistance = rolling_n * (1.0 + rolling + trip) + air_n * (1.0 + drag + trip)
    resistance = resistance * (1.0 + trips.changed["road load"])
    climb = mass * GRAVITY_M_S2 * grade / np.sqrt(1.0 + grade * grade)
    return np.asarray((resistance + climb + mass * car.body.rotating_mass_factor * acceleration) * mean)


def climate_power(car: Vehicle, trips: BlockOfTrips, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Electric power of the climate control [W] and cabin temperature [°C]."""
    ambient, setpoint = trips.ambient_degc[:, None], trips.setpoint_degc[:, None]
    soaked = ambient + 1.0
    cabin = setpoint + (soaked - setpoint) * np.exp(-time / 420.0)
    rules = car.climate
    if rules is None:
        return np.zeros_like(cabin), cabin
    loss = (rules.shell_w_k + rules.fresh_air_low_w_k) * (1.0 + trips.shares[:, 2:3])
    store = (rules.air_heat_capacity_j_k + 0.5 * rules.interior_heat_capacity_j_k) / 420.0
    heat = loss * (cabin - ambient) + store * (setpoint - cabin) - rules.occupant_heat_w - 150.0
    warming = np.clip(heat, 0.0, rules.heater_max_heat_w)
    cooling = np.clip(-heat, 0.0, rules.cooler_max_heat_w) * (ambient > 15.0)
    most = np.array([heat_pump_heat(t, rules) for t in trips.ambient_degc])[:, None]
    cop = np.array([heat_pump_cop(t, rules) for t in trips.ambient_degc])[:, None]
    pumped = np.minimum(warming, most)
    power = pumped / cop + (warming - pumped) / rules.heater_efficiency + cooling / rules.cooler_cop
    return np.asarray(power + rules.blower_low_power_w), np.asarray(cabin)


def battery_states(
    car: Vehicle, trips: BlockOfTrips, power: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Current [A], terminal voltage [V] and state of charge for a power at the terminals [W]."""
    cells = car.battery
    years = trips.years[:, None]
    usual = open_circuit_voltage(np.full(1, 0.6), cells)[0]
    capacity_ah = cells.capacity_ah * (1.0 - AGEING_PER_YEAR[1] * years) / (1.0 + trips.changed["battery"])
    capacity_wh = usual * capacity_ah
    taken = np.cumsum(power, axis=1) * WH_PER_J
    soc = np.clip(trips.soc[:, None] - taken / capacity_wh, 0.02, 1.0)
    ocv = open_circuit_voltage(soc.ravel(), cells).reshape(soc.shape)
    middle = internal_resistance(trips.soc, trips.ambient_degc + 3.0, cells)[:, None]
    resistance = middle * (1.0 + AGEING_PER_YEAR[0] * years)
    most = 0.2 * ocv * ocv / resistance  # below ocv²/(4 R), beyond which no current gives the power
    current = battery_current(np.minimum(power, most), ocv, np.broadcast_to(resistance, ocv.shape))
    charge_ah = np.cumsum(current, axis=1) / SECONDS_PER_HOUR
    soc = np.clip(trips.soc[:, None] - charge_ah / capacity_ah, 0.0, 1.0)
    return current, ocv - resistance * current, soc
