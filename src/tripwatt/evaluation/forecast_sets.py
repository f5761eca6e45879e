"""Trips as the forecast protocol needs them: what is known at departure, and a small log of what was measured.

Prepared once and small, so that a fold costs no second reading, resampling or simulation of raw trips.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.auditing import Audit
from tripwatt.errors import Fault, InvalidInput
from tripwatt.evaluation.results import Evaluation
from tripwatt.forecasting.model import MIN_TRIPS
from tripwatt.hybrid import BlockTable, IntArray, TripTable, block_table, build_table
from tripwatt.hybrid.blocks import BLOCK_S
from tripwatt.hybrid.climate_log import TOLD_BY
from tripwatt.physics import simulate_trip
from tripwatt.trips import (
    ROUTE_COLUMNS,
    SIGNALS,
    TEMPERATURES,
    Fleet,
    FloatArray,
    Plan,
    Trip,
    observed_cumulative_energy,
    plan_from_trip,
)
from tripwatt.vehicles import Vehicle

CHARGE_COLUMNS: Final = ("soc", "displayed_soc")
MIN_DAYS: Final = 3
TRAINING_ONLY: Final = -1
"""Fold of a trip that is only trained on."""
DATA_FEATURES: Final = (
    "speed_m_s",
    "speed_change_m_s2",
    "kinetic_m2_s3",
    "climb_m_s",
    "time_s",
    "trip_speed_m_s",
    "payload_mass_kg",
    "winter",
    *TEMPERATURES,
)
"""What the data-only model sees of a block: the speed trace, the road and the departure, nothing simulated."""


@dataclass(frozen=True, eq=False)
class ForecastSet:
    """Some trips, prepared.

    Attributes
    ----------
    table : TripTable
        Block means of 1 s; every column but the road is its first raw sample. For the baselines.
    blocks : BlockTable
        For the models of power.
    data_features : DataFrame, (rows of `blocks`, DATA_FEATURES)
    plans : tuple of Plan
    logs : tuple of DataFrame
        From `measured_log`.
    """

    table: TripTable
    blocks: BlockTable
    data_features: pd.DataFrame
    plans: tuple[Plan, ...]
    logs: tuple[pd.DataFrame, ...]

    @classmethod
    def of(cls, trips: Sequence[Trip], vehicle: Vehicle) -> ForecastSet:
        """Prepare raw trips with measured energy. O(samples)."""
        trips = _distinct(trips)
        table = build_table([at_departure_only(trip) for trip in trips], {"physics": vehicle})
        plans = tuple(map(plan_from_trip, trips))
        blocks = BlockTable.join(
            [
                block_table(plan, simulate_trip(vehicle, plan), trip)
                for plan, trip in zip(plans, trips, strict=True)
            ]
        )
        logs = tuple(measured_log(trip) for trip in trips)
        return cls(table, blocks, _data_features(blocks, plans), plans, logs)

    def __len__(self) -> int:
        return len(self.plans)


def at_departure_only(trip: Trip) -> Trip:
    """A raw trip in which every signal but road and measured energy is constant: its first sample.

    Columns that no departure knows are dropped.
    """
    kept = [c for c in (*ROUTE_COLUMNS, "voltage_v", "current_a", "observed_energy_wh") if c in trip]
    first = {c: float(trip.array(c)[0]) for c in SIGNALS.values() if c in trip}
    return replace(trip, samples=trip.samples[kept].assign(**first))


def measured_log(trip: Trip, step_s: float = 1.0) -> pd.DataFrame:
    """What was measured by each second of a trip: raw samples, none of them interpolated.

    Parameters
    ----------
    trip : Trip
        Raw samples with measured energy.
    step_s : float
        One row at most for each step: the last sample that is not after it.

    Returns
    -------
    DataFrame
        `time_s` since departure, `observed_energy_wh`, `distance_m`, and the states of charge and the powers of
        climate control that the trip has. A row depends on no sample after it.

    Examples
    --------
    >>> samples = pd.DataFrame({"time_s": [5.0, 5.4, 6.1, 7.0], "speed_m_s": 1.0, "voltage_v": 360.0, "current_a": 10.0})
    >>> log = measured_log(Trip.from_samples("t", samples))
    >>> [round(float(t), 6) for t in log["time_s"]]
    [0.0, 0.4, 2.0]
    """
    raw = trip.samples
    cumulative = observed_cumulative_energy(raw)
    if cumulative is None:
        raise InvalidInput(Fault("no measured energy", trip.trip_id, "", "voltage and current of each trip"))
    time = trip.array("time_s") - float(trip.array("time_s")[0])
    speed = trip.array("speed_m_s")
    distance = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))))
    known = np.isfinite(cumulative)
    if {"voltage_v", "current_a"} <= set(raw.columns):
        # energy under a gap is bridged with the sample after it, so rows in the gap would look ahead
        known &= np.isfinite(trip.array("voltage_v") * trip.array("current_a"))
    rows = np.flatnonzero(known)
    steps = np.arange(0.0, time[rows[-1]], step_s)
    last = np.clip(np.searchsorted(time[rows], steps + 1e-9, side="right") - 1, 0, None)
    rows = rows[np.unique(np.append(last, len(rows) - 1))]
    log = {"time_s": time[rows], "observed_energy_wh": cumulative[rows], "distance_m": distance[rows]}
    log |= {c: trip.array(c)[rows] for c in (*CHARGE_COLUMNS, *TOLD_BY) if c in trip}
    return pd.DataFrame(log)


def _data_features(blocks: BlockTable, plans: Sequence[Plan]) -> pd.DataFrame:
    """`DATA_FEATURES` of each block."""
    climbs, kinetic = [], []
    for i, plan in enumerate(plans):
        rows = slice(int(blocks.offsets[i]), int(blocks.offsets[i + 1]))
        seconds = blocks.hours[rows] * 3600.0
        height = _height(plan)
        climbs.append(_change(height, plan, seconds))
        kinetic.append(_change(0.5 * plan.array("speed_m_s") ** 2, plan, seconds))
    own = {"climb_m_s": np.concatenate(climbs), "kinetic_m2_s3": np.concatenate(kinetic)}
    return blocks.features.assign(**own)[list(DATA_FEATURES)]


def _height(plan: Plan) -> FloatArray:
    if "elevation_m" in plan:
        return plan.array("elevation_m")
    if "grade" in plan:
        step = np.diff(plan.array("time_s"), prepend=plan.array("time_s")[0])
        return np.asarray(np.cumsum(plan.array("grade") * plan.array("speed_m_s") * step))
    return np.full(len(plan), np.nan)


def _change(values: FloatArray, plan: Plan, seconds: FloatArray) -> FloatArray:
    """Change per second over each block of a plan."""
    time = plan.array("time_s") - plan.array("time_s")[0]
    edges = np.minimum(np.arange(len(seconds) + 1) * BLOCK_S, time[-1])
    edges[-1] = time[-1]
    return np.asarray(np.diff(np.interp(edges, time, values)) / seconds)


def _distinct(trips: Sequence[Trip]) -> list[Trip]:
    """Trips of two fleets may bear one id; the later one is told apart by a mark."""
    seen: set[str] = set()
    named = []
    for trip in trips:
        name = trip.trip_id
        while name in seen:
            name += "'"
        seen.add(name)
        named.append(trip if name == trip.trip_id else replace(trip, trip_id=name))
    return named


Prepare = Callable[[Sequence[Trip]], ForecastSet]


def held_out(
    fleet: Fleet, audited: Audit, prepare: Prepare
) -> tuple[list[Evaluation], list[ForecastSet], list[str]]:
    """Leave-one-trip-out on the reference and the audited trips, leave-one-day-out on the first of them.

    Returns
    -------
    evaluations, sets, notes
        A set for each evaluation.
    """
    named = {"reference": fleet.reference_trips(), "audited": audited.trips}
    notes = []
    evaluations: list[Evaluation] = []
    sets: list[ForecastSet] = []
    for name, trips in named.items():
        if not trips:
            notes.append(f"no {name} trips in the data set {fleet.name!r}")
            continue
        _require(len(trips) - 1, fleet)
        found = prepare(trips)
        folds = np.arange(len(found), dtype=np.int64)
        evaluations.append(Evaluation("leave_one_trip_out", name, found.table, folds))
        sets.append(found)
    if not evaluations:
        _require(0, fleet)
    days = [trip.context.day for trip in sets[0].table.trips]
    _, day = np.unique(np.array([str(d) for d in days]), return_inverse=True)
    if any(d is None for d in days) or len(set(days)) < MIN_DAYS:
        notes.append("leave-one-day-out left out: the dates of the trips are unknown or fewer than three")
    elif len(days) - int(np.bincount(day).max()) < MIN_TRIPS:
        notes.append("leave-one-day-out left out: too few trips remain without the fullest day")
    else:
        main = evaluations[0]
        evaluations.append(Evaluation("leave_one_day_out", main.trips, main.table, day.astype(np.int64)))
        sets.append(sets[0])
    return evaluations, sets, notes


def fitted_elsewhere(
    fleet: Fleet, audited: Audit, test_fleet: Fleet, test_audited: Audit, prepare: Prepare
) -> tuple[list[Evaluation], list[ForecastSet], list[str]]:
    """Fit on the trips of one fleet, score those of another: reference trips, or audited ones without a reference."""
    train = fleet.reference_trips() or audited.trips
    name = "reference" if test_fleet.reference_trips() else "audited"
    test = test_fleet.reference_trips() or test_audited.trips
    _require(len(train), fleet)
    if not test:
        raise InvalidInput(
            Fault("no trip to score", f"--test {test_fleet.name}", "0", "at least 1 after the audit")
        )
    both = prepare([*test, *train])
    folds: IntArray = np.concatenate(
        [np.zeros(len(test), np.int64), np.full(len(train), TRAINING_ONLY, np.int64)]
    )
    note = f"fitted on {len(train)} trips of {fleet.name!r}, scored on {len(test)} of {test_fleet.name!r}"
    return [Evaluation("other_trips", name, both.table, folds)], [both], [note]


def _require(training: int, fleet: Fleet) -> None:
    if training < MIN_TRIPS:
        got = f"{training} to train on, of {len(fleet.trips)}"
        raise InvalidInput(
            Fault("too few trips after the audit", fleet.name, got, f"at least {MIN_TRIPS} to train on")
        )
