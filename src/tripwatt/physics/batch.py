"""Simulation of many drives at once: similar drives of cars that differ only in their values go through the chain together."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray, by_key, changes
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.physics.cabin import CabinRun, condition_cabins
from tripwatt.physics.chain import Flags, Trace, drive_chain, energies
from tripwatt.physics.simulate import Drive, Simulation, drive_of_trip
from tripwatt.trips import Plan, Recorded
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import Vehicle

CHUNK_SAMPLES: Final = 16_384
"""Samples that go through the chain at once, few enough for their arrays to stay in the processor's cache."""


PARTS: Final = ("body", "road_load", "tyres", "drivetrain", "regeneration", "battery", "auxiliaries")
"""Parts of a car that the chain uses; `Climate` is used by the simulation of the cabin."""

Pair = tuple[Vehicle, Recorded | Plan]
R = TypeVar("R")
Results = Callable[[Sequence[Drive], Sequence[CabinRun | None]], Iterable[R]]


def simulate_trips(pairs: Iterable[Pair]) -> list[Simulation]:
    """Simulate many pairs of a car and a drive, each as `simulate_trip` does. O(samples).

    Parameters
    ----------
    pairs : iterable of (Vehicle, Trip or Plan)
        Arguments of `simulate_trip`.

    Returns
    -------
    list of Simulation
        One for each pair, in the order of the pairs.

    Raises
    ------
    InvalidInput
        With the faults that `simulate` would raise, each with the name of its drive.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> car, trips = load_vehicle(VEHICLE), synthetic_fleet(2).trips
    >>> [len(run.time_s) for run in simulate_trips((car, trip) for trip in trips)] == [len(trip) for trip in trips]
    True
    """
    return list(_in_order(pairs, _simulations))


def energies_on_grades(
    vehicle: Vehicle, plan: Plan, run: Simulation, grades: Sequence[npt.ArrayLike]
) -> FloatArray:
    """Return the cumulative energy of a plan on several roads [Wh], shape (roads, samples), as `simulate_trip` does. O(samples) for each.

    Parameters
    ----------
    vehicle : Vehicle
    plan : Plan
        Plan without known heights.
    run : Simulation
        Simulation of the same plan.
    grades : sequence of array_like
        Grade beyond that of the plan, at the samples or of the whole road.

    Examples
    --------
    >>> import tripwatt as tw
    >>> car, plan = tw.load_vehicle("bmw_i3_60ah"), tw.read_route([{"length_m": 9000.0, "speed_m_s": 15.0}])
    >>> flat = tw.simulate(plan, car)
    >>> down, up = energies_on_grades(car, plan, flat, [-0.02, 0.02])[:, -1].tolist()
    >>> down < flat.simulated_energy_wh < up
    True
    """
    drive = drive_of_trip(vehicle, plan)
    slopes = np.array([np.broadcast_to(grade, drive.time_s.shape) for grade in grades])
    means = drive.grade + np.hstack((slopes[:, :1], 0.5 * (slopes[:, 1:] + slopes[:, :-1])))
    trace = Trace.from_samples(drive.time_s, drive.speed_m_s, means, drive.headwind_m_s)
    return energies(drive.vehicle, trace, drive.conditions, run.auxiliary_power_w)


def trip_totals(pairs: Iterable[Pair]) -> dict[str, list[Any]]:
    """Simulate many pairs of a car and a drive, and return only sums over each drive. O(samples) time, O(pairs) memory.

    Parameters
    ----------
    pairs : iterable of (Vehicle, Trip or Plan)
        Arguments of `simulate_trip`; they are drawn from the iterable a window at a time.

    Returns
    -------
    dict of str to list
        One value for each pair, in their order, under each of `trip`, `car`, `duration_s`, `distance_m`, `energy_wh` at the battery
        terminals, `energy_<cause>_wh` for each of `CAUSES`, `soc` of the battery management at the end, and `flags`.

    Raises
    ------
    InvalidInput
        With the faults that `simulate` would raise, each with the name of its drive.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> totals = trip_totals((load_vehicle(VEHICLE), trip) for trip in synthetic_fleet(2).trips)
    >>> len(totals["energy_wh"]), totals["flags"]
    (2, [(), ()])
    """
    rows = list(_in_order(pairs, _totals))
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}


def _in_order(pairs: Iterable[Pair], results: Results[R]) -> Iterator[R]:
    """Yield the results in the order of the pairs; work on a window of pairs at a time."""
    left = iter(pairs)
    # 1024 drives at a time bound the memory
    while window := list(itertools.islice(left, 1024)):
        drives, faults = [], list[Fault]()
        roads: dict[int, FloatArray] = {}
        for vehicle, trip in window:
            try:
                drives.append(drive_of_trip(vehicle, trip, roads.get(id(trip))))
                roads[id(trip)] = drives[-1].grade
            except InvalidInput as error:
                faults += [replace(fault, where=f"{trip.trip_id}, {fault.where}") for fault in error.faults]
        raise_faults(faults)
        made = {
            number: result for group in _alike(drives) for number, result in _group(drives, group, results)
        }
        yield from (made[number] for number in range(len(window)))


def _alike(drives: Sequence[Drive]) -> Iterable[list[int]]:
    """Group the indices of drives that can go through the chain together: same kind of car, similar length."""
    kinds = {number: _kind(car) for number, car in {id(d.vehicle): d.vehicle for d in drives}.items()}

    def alike(number: int) -> tuple[Any, ...]:
        drive = drives[number]
        # eight classes of length for each doubling: a twentieth of the samples is padding
        length = round(8 * math.log2(len(drive.time_s)))
        return length, drive.headwind_m_s is None, kinds[id(drive.vehicle)]

    return by_key(range(len(drives)), alike).values()


def _kind(vehicle: Vehicle) -> tuple[Any, ...]:
    """Return a key that is equal for cars that can go through the chain together.

    These cars may differ in numbers and in the values of tables, but in nothing else.
    """
    parts = {name: part for name in PARTS if (part := getattr(vehicle, name)) is not None}
    values = [(f.name, getattr(part, f.name)) for part in parts.values() for f in fields(part)]
    return (
        *parts,
        vehicle.battery.heat_loss_w_k == 0.0,
        *(
            len(v) if isinstance(v, tuple) and not name.endswith("soc") else v
            for name, v in values
            if not isinstance(v, float)
        ),
    )


def _group(drives: Sequence[Drive], numbers: list[int], results: Results[R]) -> Iterator[tuple[int, R]]:
    """Yield index and result of each of some similar drives.

    All their cabins are simulated together; the chain takes as many drives at a time as fit into `CHUNK_SAMPLES`.
    """
    numbers.sort(key=lambda i: _passes(drives[i]))
    runs = iter(condition_cabins([task for i in numbers if (task := drives[i].cabin) is not None]))
    cabins = [None if drives[i].cabin is None else next(runs) for i in numbers]
    size = max(1, CHUNK_SAMPLES // max(len(drives[i].time_s) for i in numbers))
    for first in range(0, len(numbers), size):
        chunk = numbers[first : first + size]
        yield from zip(chunk, results([drives[i] for i in chunk], cabins[first : first + size]), strict=True)


def _passes(drive: Drive) -> tuple[bool, float]:
    """Sort key of drives that need a similar number of battery passes: whether the battery limits regeneration, and the mean speed."""
    rules, conditions = drive.vehicle.regeneration, drive.conditions
    cold = conditions.battery_start_degc < rules.full_temperature_degc
    return cold or conditions.initial_soc > rules.full_soc, float(drive.speed_m_s.mean())


def _stacked(several: Sequence[Any]) -> Any:
    """Merge objects of a dataclass into one.

    Numbers that differ become arrays of shape (objects, 1), tables that differ arrays of shape (objects, values).
    """
    first = several[0]
    if all(each is first for each in several):
        return first
    columns = {}
    for field in fields(first):
        values = [getattr(each, field.name) for each in several]
        if isinstance(values[0], int | float | tuple) and any(value != values[0] for value in values):
            columns[field.name] = np.array(values).reshape(len(values), -1)
    return replace(first, **columns)


def _driven(drives: Sequence[Drive], climate_w: Sequence[FloatArray]) -> tuple[dict[str, Any], list[Flags]]:
    """Run some similar drives through the chain together; shorter ones are padded."""
    length = np.array([len(drive.time_s) for drive in drives])
    beyond = np.arange(length.max()) >= length[:, None]

    def padded(rows: Iterable[FloatArray]) -> FloatArray:
        table = np.empty(beyond.shape)
        for row, values, n in zip(table, rows, length, strict=True):
            row[:n], row[n:] = values, values[-1]
        return table

    winds = [drive.headwind_m_s for drive in drives if drive.headwind_m_s is not None]
    trace = Trace.from_samples(
        padded(drive.time_s for drive in drives),
        padded(drive.speed_m_s for drive in drives),
        np.where(beyond, 0.0, padded(drive.grade for drive in drives)),
        padded(winds) if winds else None,
        beyond if beyond.any() else None,
    )
    cars = [drive.vehicle for drive in drives]
    parts = {name: _stacked([getattr(car, name) for car in cars]) for name in PARTS if getattr(cars[0], name)}
    return drive_chain(
        replace(cars[0], **parts), trace, _stacked([drive.conditions for drive in drives]), padded(climate_w)
    )


def _simulations(drives: Sequence[Drive], cabins: Sequence[CabinRun | None]) -> Iterator[Simulation]:
    climates = [drive.climate(cabin) for drive, cabin in zip(drives, cabins, strict=True)]
    arrays, flags = _driven(drives, [power for power, _, _ in climates])
    causes = arrays.pop("power_by_cause_w")
    for row, (drive, (_, fan, air)) in enumerate(zip(drives, climates, strict=True)):
        n = len(drive.time_s)
        own: dict[str, Any] = {name: values[row, :n] for name, values in arrays.items()}
        own["power_by_cause_w"] = {cause: power[row, :n] for cause, power in causes.items()}
        yield Simulation(**own, fan_power_w=fan, cabin_temperature_degc=air, flags=flags[row])


def _totals(drives: Sequence[Drive], cabins: Sequence[CabinRun | None]) -> Iterator[dict[str, Any]]:
    power = [c.power_w if c else drive.climate(c)[0] for drive, c in zip(drives, cabins, strict=True)]
    arrays, flags = _driven(drives, power)
    step_h = changes(arrays["time_s"]) * WH_PER_J
    energies = {
        f"energy_{cause}_wh": np.einsum("ij,ij->i", power, step_h)
        for cause, power in arrays["power_by_cause_w"].items()
    }
    for row, drive in enumerate(drives):
        yield {
            "trip": drive.name,
            "car": drive.vehicle.name,
            "duration_s": float(drive.time_s[-1] - drive.time_s[0]),
            "distance_m": float(np.trapezoid(drive.speed_m_s, drive.time_s)),
            "energy_wh": float(arrays["energy_wh"][row, -1]),
            **{name: float(energy[row]) for name, energy in energies.items()},
            "soc": float(arrays["soc"][row, -1]),
            "flags": flags[row],
        }
