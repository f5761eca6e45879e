"""A built-in fleet with a known truth, to demonstrate and to test the whole pipeline.

Nothing here is measured. Drivers, days, routes and weather are drawn from a seed (`scenario`, `roads`). The driver
model gives the speed. A *hidden* car and world give the energy (`world`): the physics of the i3 on the true road, with
wind, wet or cold tyres, habits, a cabin with its own heat balance, lamps, and heavy-tailed noise that is in no model
of the package. Noisy sensors of the usual resolution (`sensors`) then log the truth. `synthetic_world` returns the
hidden effects as well.

Every trip draws from random streams of its own, keyed by the seed, its day and its place in the day. Therefore the
first trips of a longer fleet are those of a shorter one, and no trip depends on another. A following trip starts with
the warmth and the charge that its day's scenario expects, not with those at the end of the trip before it.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import pandas as pd

from tripwatt.errors import Fault, excerpt
from tripwatt.study.synthetic.roads import drive_route
from tripwatt.study.synthetic.scenario import Scenario, draw_scenarios, long_drive
from tripwatt.study.synthetic.sensors import log_samples
from tripwatt.study.synthetic.world import simulate_truth
from tripwatt.trips import Context, Flag, Trip, TripSet, raise_faults
from tripwatt.trips.columns import Column, is_number, number_faults
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.extras import with_extras

__all__ = [
    "VEHICLE",
    "example_fleet",
    "synthetic_fleet",
    "synthetic_world",
]

VEHICLE: Final = "bmw_i3_60ah"
"""Car whose physics the fleet is based on."""

FOLLOWS_WITHIN_S: Final = 300.0
"""Longest time [s] after the end of the last trip within which a trip follows it: a choice, the cabin is still warm."""

NOTES: Final = (Flag("synthetic", "synthetic"),)


MAX_TRIPS: Final = 1_000_000
"""Largest number of trips of a fleet: a choice, days of work beyond it."""
MAX_SEED: Final = 2**63 - 1
"""Largest seed, a signed number of 64 bits."""

CAR_MODELS: Final = ("bmw_i3_60ah", "nissan_leaf_24")
VEHICLES, TRIPS_EACH = 8, 48
"""Number of vehicles of `example_fleet`, and of trips of each vehicle: a choice, enough to detect the changed vehicle."""

CHANGED: Final = ("V1", dt.datetime(2023, 12, 20))
"""Vehicle of `example_fleet` that changes, and the day from which it has a roof box and 70 % of its tyre pressure."""


def synthetic_fleet(
    n_trips: int = 32,
    seed: int = 0,
    *,
    step_s: float = 1.0,
    vehicle: Vehicle | None = None,
    hours: tuple[float, float] | None = None,
) -> TripSet:
    """Compute a fleet of one car and several drivers over summer and winter days. O(samples).

    Parameters
    ----------
    n_trips : int
        Number of trips; the first trips of a longer fleet are those of a shorter one.
    seed : int
        Equal seeds give trips that are equal to the last bit.
    step_s : float
        Time between two samples [s], 1 or less.
    vehicle : Vehicle, optional
        The car whose physics the hidden car is based on; `VEHICLE` by default.
    hours : tuple of float, optional
        Shortest and longest duration [h], 0.1 to 12, of long drives mostly on motorways, which start with a battery of
        90 %. By default trips take a quarter to three quarters of an hour.

    Returns
    -------
    TripSet
        Fleet with the name "synthetic", a note that nothing was measured, and no reference trips.

    Raises
    ------
    InvalidInput
        With every argument that is out of range.

    Examples
    --------
    >>> fleet = synthetic_fleet(3, seed=1)
    >>> fleet.name, [trip.trip_id for trip in fleet.trips]
    ('synthetic', ['S001', 'S002', 'S003'])
    """
    return synthetic_world(n_trips, seed, step_s=step_s, vehicle=vehicle, hours=hours)[0]


def synthetic_world(
    n_trips: int = 32,
    seed: int = 0,
    *,
    step_s: float = 1.0,
    vehicle: Vehicle | None = None,
    hours: tuple[float, float] | None = None,
) -> tuple[TripSet, pd.DataFrame]:
    """Compute fleet and truth together. O(samples).

    Parameters
    ----------
    n_trips : int
        As for `synthetic_fleet`.
    seed : int
        As for `synthetic_fleet`.
    step_s : float
        As for `synthetic_fleet`.
    vehicle : Vehicle, optional
        As for `synthetic_fleet`.
    hours : tuple of float, optional
        As for `synthetic_fleet`.

    Returns
    -------
    fleet : TripSet
        As from `synthetic_fleet`.
    truth : DataFrame
        The hidden effects. One row per trip, index `trip`. `energy_wh` is the true energy at the battery terminals [Wh], the sum of
        `driving_` (the i3's physics with the hidden forces), `heating_`, `aircon_`, `lamps_`, `driver_` (the driver's
        habit), `trip_` (an effect of this trip alone) and `noise_energy_wh`. `wind_work_wh` and `rolling_work_wh` are
        the work [Wh] at the wheel against hidden wind and rolling resistance, part of driving. `headwind_m_s`,
        `rolling_share`, `driver_share` and `trip_share` are their causes; `ambient_temperature_degc` is the true
        mean outside temperature [°C]; `end_soc` is the true state of charge at the end; `driver`, `day`, `season`,
        `sky`, `route` describe the trip.

    Raises
    ------
    InvalidInput
        As `synthetic_fleet`.

    Examples
    --------
    >>> fleet, truth = synthetic_world(2)
    >>> fleet.trips[0].trip_id == truth.index[0]
    True
    """
    _require_sound(n_trips, seed, step_s, hours)
    vehicle = vehicle or load_vehicle(VEHICLE)
    trips, effects = [], []
    for scenario in draw_scenarios(n_trips, seed):
        if hours is not None:
            scenario = long_drive(scenario, seed, hours)
        trip, row = _trip(scenario, vehicle, seed, step_s)
        trips.append(trip)
        effects.append(row)
    truth = pd.DataFrame(effects).set_index("trip")
    return TripSet("synthetic", tuple(trips), notes=NOTES), truth


def example_fleet() -> Iterator[tuple[str, TripSet]]:
    """Compute trips of eight vehicles of two car models, for trying the commands of fleets; one vehicle changes, see `CHANGED`.

    Yields
    ------
    str, TripSet
        The car model of a vehicle, and the trips of the vehicle, whose `context.car` is its id.

    Examples
    --------
    >>> car_model, fleet = next(example_fleet())
    >>> car_model, fleet.logs[0].context.car, fleet.logs[0].context.driver
    ('bmw_i3_60ah', 'V1', 'V1 driver 5')
    """
    for number in range(VEHICLES):
        name, vehicle_id = CAR_MODELS[number % len(CAR_MODELS)], f"V{number + 1}"
        car = load_vehicle(name)
        fleet = synthetic_fleet(TRIPS_EACH, number, vehicle=car)
        changed_fleet = fleet
        if vehicle_id == CHANGED[0]:
            changed = with_extras(car, ["roof_box"], tyre_pressure=0.7)
            changed_fleet = synthetic_fleet(TRIPS_EACH, number, vehicle=changed)
        logs = []
        for before, later in zip(fleet.logs, changed_fleet.logs, strict=True):
            assert before.context.started_at is not None
            log = before if before.context.started_at < CHANGED[1] else later
            driver = f"{vehicle_id} {log.context.driver}"
            logs.append(replace(log, context=replace(log.context, car=vehicle_id, driver=driver)))
        yield name, replace(fleet, logs=tuple(logs))


def _require_sound(n_trips: int, seed: int, step_s: float, hours: tuple[float, float] | None) -> None:
    """Raise `InvalidInput` with every argument that is out of range."""
    faults = [
        *number_faults("n_trips", n_trips, Column("", 1, MAX_TRIPS, ""), whole=True),
        *number_faults("seed", seed, Column("", 0, MAX_SEED, ""), whole=True),
        *number_faults("step_s", step_s, Column("s", 0.01, 1.0, "")),
    ]
    pair = isinstance(hours, tuple | list) and len(hours) == 2 and all(map(is_number, hours))
    if hours is not None and not (pair and 0.1 <= hours[0] <= hours[1] <= 12.0):
        allowed = "0.1 to 12 h, the shorter first"
        faults.append(Fault("duration out of range", "hours", excerpt(hours), allowed))
    raise_faults(faults)


def _trip(scenario: Scenario, vehicle: Vehicle, seed: int, step_s: float) -> tuple[Trip, dict[str, object]]:
    """Drive, simulate and log one scenario; return the trip and its row of the truth."""
    drive = drive_route(scenario, seed, step_s)
    truth = simulate_truth(scenario, drive, vehicle, seed)
    follows = scenario.parked_s is not None and scenario.parked_s <= FOLLOWS_WITHIN_S
    context = Context(
        season=scenario.day.season,
        weather=scenario.weather,
        started_at=scenario.started_at,
        route=scenario.route,
        cabin_setpoint_degc=scenario.setpoint_degc,
        payload_mass_kg=scenario.payload_mass_kg,
        follows_trip=follows,
        remarks="synthetic" + (", directly after previous trip" if follows else ""),
        driver=scenario.driver.name,
    )
    trip = Trip.from_samples(scenario.trip_id, log_samples(scenario, drive, truth, vehicle, seed), context)
    row: dict[str, object] = {
        "trip": scenario.trip_id,
        "driver": scenario.driver.name,
        "day": scenario.day.date,
        "season": scenario.day.season,
        "sky": scenario.day.sky,
        "route": scenario.route,
        **truth.effects,
    }
    return trip, row
