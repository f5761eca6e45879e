"""Many drives at once: cars whose values alone differ go through the chain side by side, a few similar drives at a time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, Final, TypeVar

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.physics.cabin import CabinRun, condition_cabins
from tripwatt.physics.chain import Flags, Trace, drive_chain
from tripwatt.physics.simulate import Drive, Simulation, drive_of_trip
from tripwatt.trips import Plan, Recorded
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import Vehicle

CHUNK_SAMPLES: Final = 32_768
"""Samples that go through the chain at once: their arrays stay in the cache."""


PARTS: Final = ("body", "road_load", "tyres", "drivetrain", "regeneration", "battery", "auxiliaries")
"""Parts of a car that the chain takes; the cabins have their own values."""

Pair = tuple[Vehicle, Recorded | Plan]
R = TypeVar("R")
Results = Callable[[Sequence[Drive], Sequence[CabinRun | None]], Iterable[R]]


def simulate_trips(pairs: Iterable[Pair]) -> list[Simulation]:
    """`simulate_trip` of many pairs of a car and a drive. O(samples).

    Parameters
    ----------
    pairs : iterable of (Vehicle, Trip or Plan)
        As `simulate_trip` takes them.

    Returns
    -------
    list of Simulation
        In the order of the pairs.

    Raises
    ------
    InvalidInput
        As `simulate`, with the names of the drives.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> car, trips = load_vehicle(VEHICLE), synthetic_fleet(2).trips
    >>> [len(run.time_s) for run in simulate_trips((car, trip) for trip in trips)] == [len(trip) for trip in trips]
    True
    """
    return list(_in_order(pairs, _simulations))


def trip_totals(pairs: Iterable[Pair]) -> dict[str, list[Any]]:
    """Sums over many drives, without the arrays along them. O(samples) time, O(pairs) memory.

    Parameters
    ----------
    pairs : iterable of (Vehicle, Trip or Plan)
        As `simulate_trip` takes them; taken a few at a time.

    Returns
    -------
    dict of str to list
        In the order of the pairs: `trip`, `car`, `duration_s`, `distance_m`, `energy_wh` at the battery terminals, `energy_<cause>_wh` by each of `CAUSES`, `soc` of the
        battery management at the end, and the `flags`.

    Raises
    ------
    InvalidInput
        As `simulate`, with the names of the drives.

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
    """Results of the pairs in their order, a window of them at a time."""
    # once freed, it stops the C library from handing freed memory back to the system, whose new pages cost more than the chain
    np.empty(3_000_000)
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
    """Numbers of the drives that can go through the chain together: one kind of car, and about one length."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    kinds = {number: _kind(car) for number, car in {id(d.vehicle): d.vehicle for d in drives}.items()}
    for number, drive in enumerate(drives):
        # eight classes of length for each doubling: a twentieth of the samples is padding
        length = round(8 * math.log2(len(drive.time_s)))
        key = (length, drive.headwind_m_s is None, kinds[id(drive.vehicle)])
        groups.setdefault(key, []).append(number)
    return groups.values()


def _kind(vehicle: Vehicle) -> tuple[Any, ...]:
    """Equal for cars that can be driven side by side: numbers and the values of tables may differ, all else may not."""
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
    """Results of drives that are alike, by number: their cabins together, then so many through the chain as the cache holds."""
    numbers.sort(key=lambda i: _passes(drives[i]))
    runs = iter(condition_cabins([task for i in numbers if (task := drives[i].cabin) is not None]))
    cabins = [None if drives[i].cabin is None else next(runs) for i in numbers]
    size = max(1, CHUNK_SAMPLES // max(len(drives[i].time_s) for i in numbers))
    for first in range(0, len(numbers), size):
        chunk = numbers[first : first + size]
        yield from zip(chunk, results([drives[i] for i in chunk], cabins[first : first + size]), strict=True)


def _passes(drive: Drive) -> tuple[bool, float]:
    """What decides how many passes the battery takes: whether it limits regeneration, and the mean speed."""
    rules, conditions = drive.vehicle.regeneration, drive.conditions
    cold = conditions.battery_start_degc < rules.full_temperature_degc
    return cold or conditions.initial_soc > rules.full_soc, float(drive.speed_m_s.mean())


def _stacked(several: Sequence[Any]) -> Any:
    """One object of a dataclass with arrays of shape (objects, 1) where numbers differ, (objects, values) where tables do."""
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
    """Some drives through the chain."""
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
    step_h = np.diff(arrays["time_s"], prepend=arrays["time_s"][:, :1]) * WH_PER_J
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
