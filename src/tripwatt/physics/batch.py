"""Many drives at once: cars whose values alone differ go through the chain side by side, a few similar drives at a time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from operator import attrgetter
from typing import Any, Final, TypeVar

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.physics.cabin import CabinRun, condition_cabins
from tripwatt.physics.chain import Driven, Known, Trace, drive_chain
from tripwatt.physics.simulate import Drive, Simulation, at_samples, drive_of_trip, simulated
from tripwatt.trips import Plan, Recorded
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import Vehicle

WINDOW: Final = 1024
"""Drives that are prepared and sorted together: it bounds the memory."""

CHUNK_SAMPLES: Final = 16_384
"""Samples that go through the chain at once: their arrays stay in the cache."""

LENGTHS_PER_OCTAVE: Final = 8
"""Classes of length, of which one is driven together, for each doubling: a twentieth of the samples is padding."""

PARTS: Final = ("body", "road_load", "tyres", "drivetrain", "regeneration", "battery", "auxiliaries")
"""Parts of a car that the chain takes; the cabins have their own values."""

Pair = tuple[Vehicle, Recorded | Plan]
_KNOWN: Final = attrgetter(*(f.name for f in fields(Known)))
_Result = TypeVar("_Result")


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
    >>> from tripwatt.synthetic import VEHICLE, synthetic_fleet
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
    >>> from tripwatt.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> totals = trip_totals((load_vehicle(VEHICLE), trip) for trip in synthetic_fleet(2).trips)
    >>> len(totals["energy_wh"]), totals["flags"]
    (2, [(), ()])
    """
    rows = list(_in_order(pairs, _totals))
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}


def _in_order(
    pairs: Iterable[Pair],
    results: Callable[[Sequence[Drive], Driven, Sequence[CabinRun | None]], list[_Result]],
) -> Iterator[_Result]:
    """Results of the pairs in their order, a window of them at a time."""
    # once freed, it stops the C library from handing freed memory back to the system, whose new pages cost more than the chain
    np.empty(3_000_000)
    left = iter(pairs)
    while window := list(itertools.islice(left, WINDOW)):
        made: dict[int, _Result] = {}
        for numbers, drives, driven, cabins in _chunks(_prepared(window)):
            made |= zip(numbers, results(drives, driven, cabins), strict=True)
        yield from (made[number] for number in range(len(window)))


def _prepared(window: Sequence[Pair]) -> list[Drive]:
    drives, faults = [], list[Fault]()
    for vehicle, trip in window:
        try:
            drives.append(replace(drive_of_trip(vehicle, trip), name=trip.trip_id))
        except InvalidInput as error:
            faults += [replace(fault, where=f"{trip.trip_id}, {fault.where}") for fault in error.faults]
    raise_faults(faults)
    return drives


def _chunks(
    drives: Sequence[Drive],
) -> Iterator[tuple[list[int], list[Drive], Driven, list[CabinRun | None]]]:
    """Drives of one kind of car and similar length side by side, with their numbers."""
    kinds: dict[tuple[Any, ...], list[int]] = {}
    of_car: dict[int, tuple[Any, ...]] = {}
    for number, drive in enumerate(drives):
        car = of_car.setdefault(id(drive.vehicle), ()) or _kind(drive.vehicle)
        of_car[id(drive.vehicle)] = car
        kinds.setdefault((drive.headwind_m_s is None, *car), []).append(number)
    for members in kinds.values():
        members.sort(key=lambda i: _likeness(drives[i]))
        cabins = _cabins([drives[i] for i in members])
        first = 0
        while first < len(members):
            last, longest = first, 0
            while last < len(members):
                longest = max(longest, len(drives[members[last]].time_s))
                if last > first and (last + 1 - first) * longest > CHUNK_SAMPLES:
                    break
                last += 1
            chunk = [drives[i] for i in members[first:last]]
            yield members[first:last], chunk, _driven(chunk, cabins[first:last]), cabins[first:last]
            first = last


def _likeness(drive: Drive) -> tuple[int, bool, float]:
    """Class of length; whether the battery limits regeneration, and the mean speed, which decide how many passes it takes."""
    rules, known = drive.vehicle.regeneration, drive.known
    limited = known.battery_degc < rules.full_temperature_degc or known.soc > rules.full_soc
    length = round(LENGTHS_PER_OCTAVE * math.log2(len(drive.time_s)))
    return length, bool(limited), float(drive.speed_m_s.mean())


def _cabins(drives: Sequence[Drive]) -> list[CabinRun | None]:
    done = iter(condition_cabins([drive.cabin for drive in drives if drive.cabin is not None]))
    return [None if drive.cabin is None else next(done) for drive in drives]


def _kind(vehicle: Vehicle) -> tuple[Any, ...]:
    """Equal for cars that can be driven side by side: a number counts only as zero or not, everything else as it is."""
    parts = [getattr(vehicle, part) for part in PARTS]
    values = [None if part is None else [getattr(part, f.name) for f in fields(part)] for part in parts]
    return tuple(
        own and tuple(value == 0.0 if isinstance(value, float) else value for value in own) for own in values
    )


def _stacked(cars: Sequence[Vehicle]) -> Vehicle:
    """One car with columns of shape (cars, 1) where the values of the cars differ."""
    first, parts = cars[0], {}
    for name in PARTS:
        own = [getattr(car, name) for car in cars]
        if own[0] is None or all(part is own[0] for part in own):
            continue
        values = {f.name: [getattr(part, f.name) for part in own] for f in fields(own[0])}
        columns = {
            key: np.array(several)[:, None]
            for key, several in values.items()
            if isinstance(several[0], float) and len(set(several)) > 1
        }
        parts[name] = replace(own[0], **columns)
    return replace(first, **parts) if parts else first


def _driven(drives: Sequence[Drive], cabins: Sequence[CabinRun | None]) -> Driven:
    """Some drives through the chain."""
    length = [len(drive.time_s) for drive in drives]
    shape = len(drives), max(length)

    def padded(rows: Iterable[FloatArray]) -> FloatArray:
        table = np.empty(shape)
        for row, values, n in zip(table, rows, length, strict=True):
            row[:n] = values
            row[n:] = values[-1]
        return table

    beyond = None if min(length) == shape[1] else np.arange(shape[1]) >= np.array(length)[:, None]
    grade = padded(drive.grade for drive in drives)
    if beyond is not None:
        grade[beyond] = 0.0
    winds = [drive.headwind_m_s for drive in drives if drive.headwind_m_s is not None]
    trace = Trace.from_samples(
        padded(drive.time_s for drive in drives),
        padded(drive.speed_m_s for drive in drives),
        grade,
        padded(winds) if winds else None,
        beyond,
    )
    climate = padded(
        np.broadcast_to(drive.climate_power_w, n) if cabin is None else cabin.power_w
        for drive, cabin, n in zip(drives, cabins, length, strict=True)
    )
    known = np.array([_KNOWN(drive.known) for drive in drives]).T[:, :, None]
    return drive_chain(_stacked([drive.vehicle for drive in drives]), trace, Known(*known), climate)


def _simulations(
    drives: Sequence[Drive], driven: Driven, cabins: Sequence[CabinRun | None]
) -> list[Simulation]:
    arrays = simulated(driven)
    causes = arrays.pop("power_by_cause_w")
    runs = []
    for row, (drive, cabin) in enumerate(zip(drives, cabins, strict=True)):
        n = len(drive.time_s)
        own = {name: values[row, :n] for name, values in arrays.items()}
        own["power_by_cause_w"] = {cause: power[row, :n] for cause, power in causes.items()}
        runs.append(Simulation(**own, **at_samples(drive, cabin), flags=driven.flags[row]))
    return runs


def _totals(
    drives: Sequence[Drive], driven: Driven, cabins: Sequence[CabinRun | None]
) -> list[dict[str, Any]]:
    step_s = driven.trace.step_s
    powers = {"energy_wh": driven.battery.power_w}
    powers |= {f"energy_{cause}_wh": power for cause, power in driven.by_cause_w().items()}

    def sums(rate: FloatArray, step: FloatArray) -> list[float]:
        return list(np.einsum("...i,...i->...", rate, step).tolist())

    columns: dict[str, Sequence[Any]] = {
        "trip": [drive.name for drive in drives],
        "car": [drive.vehicle.name for drive in drives],
        "duration_s": [float(drive.time_s[-1] - drive.time_s[0]) for drive in drives],
        "distance_m": sums(driven.trace.mean_speed_m_s, step_s),
        **{name: sums(power, step_s * WH_PER_J) for name, power in powers.items()},
        "soc": np.clip(driven.battery.soc[:, -1], 0.0, 1.0).tolist(),
        "flags": driven.flags,
    }
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
