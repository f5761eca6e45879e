"""Faults of loggers, planted into trips of the synthetic fleet at known places: what an audit has to find.

Three trips get one fault each. Where, is drawn from a stream of its own, so that nothing else of the fleet changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import pandas as pd

from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.study.synthetic.scenario import stream
from tripwatt.trips import Log, Recorded, Trip, TripSet

FaultKind = Literal["frozen signal", "wrong sign", "filled gap"]

FAULTS: Final = 9
"""What the stream of random numbers is for; the fleet has those before."""

FROZEN_S: Final = 150.0
"""The last part [s] of the log in which every signal keeps the value that it had."""

FILLED_S: Final = 45.0
"""Length [s] of the gap that is filled with straight lines."""

DRIVING_M_S: Final = 8.0
"""Faults are planted where the car drives: a freeze or a straight line of a standing car is no different from sound data."""

SHORT_STANDSTILL_S: Final = 50.0
"""The trip of the wrong sign never stands longer [s]: the load of a car that stands for a minute would, with the wrong
sign, be a charging stop as well, a second fault."""

FILLED_CHANGE_M_S: Final = 4.0
"""Least difference of the speeds [m/s] at both ends of a filled gap: a level line may be a steady drive."""


@dataclass(frozen=True, slots=True)
class PlantedFault:
    """One fault and what it hides: samples from `first` to `stop`, times of the last sound sample before and the first after them, and the
    measured energy without it."""

    trip: str
    kind: FaultKind
    first: int
    stop: int
    from_s: float
    to_s: float
    unfaulted_energy_wh: float


def faulty_fleet(n_trips: int = 32, seed: int = 0) -> tuple[TripSet, tuple[PlantedFault, ...]]:
    """`synthetic_fleet` with a frozen signal, a current of the wrong sign and a filled gap, and where they are."""
    sound = synthetic_fleet(n_trips, seed)
    trips, faults = plant_faults(sound.trips, seed)
    return replace(sound, logs=trips), faults


def plant_faults(trips: Sequence[Trip], seed: int) -> tuple[tuple[Recorded, ...], tuple[PlantedFault, ...]]:
    """The trips with one fault of each kind in three of them, and where they are."""
    rng = stream(seed, FAULTS)
    order: list[int] = rng.permutation(len(trips)).tolist()
    reversed_trip = next((i for i in order if _longest_standstill_s(trips[i]) < SHORT_STANDSTILL_S), order[0])
    others = [i for i in order if i != reversed_trip]
    places: dict[FaultKind, int] = {
        "frozen signal": others[0],
        "wrong sign": reversed_trip,
        "filled gap": others[1],
    }
    faulty = {number: _plant(trips[number], kind, rng) for kind, number in places.items()}
    planted = tuple(faulty[i][0] if i in faulty else trip for i, trip in enumerate(trips))
    return planted, tuple(faulty[number][1] for number in sorted(faulty))


def _plant(trip: Trip, kind: FaultKind, rng: np.random.Generator) -> tuple[Log, PlantedFault]:
    samples, time = trip.samples, trip.array("time_s")
    if kind == "frozen signal":
        first = _freeze_at(trip)
        faulty, stop = _freeze(samples, first), len(samples)
    elif kind == "wrong sign":
        first, stop = 0, len(samples)
        faulty = samples.assign(current_a=-samples["current_a"])
    else:
        first, stop = _gap_at(trip, rng)
        faulty = _fill_gap(samples, first, stop)
    fault = PlantedFault(
        trip=trip.trip_id,
        kind=kind,
        first=first,
        stop=stop,
        from_s=float(time[max(first - 1, 0)]),
        to_s=float(time[min(stop, len(time) - 1)]),
        unfaulted_energy_wh=float(trip.observed_energy_wh or 0.0),
    )
    return Log.from_samples(trip.trip_id, faulty, trip.context), fault


def _longest_standstill_s(trip: Trip) -> float:
    time, moving = trip.array("time_s"), trip.array("speed_m_s") > 0.0
    ends = np.concatenate((time[:1], time[moving], time[-1:]))
    return float(np.max(np.diff(ends)))


def _freeze_at(trip: Trip) -> int:
    """The first sample that repeats the one before it: the car drives, and the log goes on for `FROZEN_S`."""
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    driving = np.flatnonzero((speed >= min(DRIVING_M_S, speed.max())) & (time <= time[-1] - FROZEN_S))
    return int(driving[-1]) + 1


def _freeze(samples: pd.DataFrame, first: int) -> pd.DataFrame:
    faulty = samples.copy()
    names = [name for name in faulty.columns if name != "time_s"]
    faulty.loc[faulty.index[first:], names] = faulty[names].iloc[first - 1].to_numpy()
    return faulty


def _gap_at(trip: Trip, rng: np.random.Generator) -> tuple[int, int]:
    """Samples of a gap in the middle half of the log whose ends differ in speed and in current."""
    time, speed, current = (trip.array(name) for name in ("time_s", "speed_m_s", "current_a"))
    steps = round(FILLED_S / float(np.median(np.diff(time))))
    before = np.arange(len(time) // 4, 3 * len(time) // 4 - steps)
    after = before + steps
    slowest = np.minimum(speed[before], speed[after])
    change = np.abs(speed[after] - speed[before])
    good = (
        (slowest >= DRIVING_M_S)
        & (change >= FILLED_CHANGE_M_S)
        & (np.abs(current[after] - current[before]) >= 5.0)
    )
    start = int(rng.choice(before[good])) if good.any() else int(before[np.argmax(slowest + change)])
    return start + 1, start + steps


def _fill_gap(samples: pd.DataFrame, first: int, stop: int) -> pd.DataFrame:
    faulty = samples.copy()
    time = samples["time_s"].to_numpy(dtype=np.float64)
    share = (time[first:stop] - time[first - 1]) / (time[stop] - time[first - 1])
    for name in faulty.columns:
        if name != "time_s":
            values = samples[name].to_numpy(dtype=np.float64, copy=True)
            values[first:stop] = values[first - 1] + share * (values[stop] - values[first - 1])
            faulty[name] = values
    return faulty
