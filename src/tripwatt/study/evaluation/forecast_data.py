"""Prepare trips for the forecast protocol: what is known at departure, and a small log of measurements.

Trips are prepared once, so that folds need no further reading, resampling or simulation of raw trips.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray, distance_driven
from tripwatt.errors import InvalidInput
from tripwatt.hybrid import SegmentTable, StageRecord, identify_each, resimulated, segment_trips, stage_record
from tripwatt.hybrid.climate_log import TOLD_BY
from tripwatt.hybrid.rows import taken
from tripwatt.hybrid.segments import SEGMENT_S
from tripwatt.hybrid.trip_table import TripTable, build_table
from tripwatt.trips import (
    ROUTE_COLUMNS,
    SIGNALS,
    TEMPERATURES,
    Departure,
    Plan,
    Trip,
    observed_cumulative_energy,
)
from tripwatt.vehicles import Vehicle

CHARGE_COLUMNS: Final = ("soc", "displayed_soc")
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
"""Features of a segment for the data-only model: speed trace, road and departure, nothing simulated."""


@dataclass(frozen=True, eq=False)
class ForecastData:
    """Trips prepared for the models of the forecast protocol.

    Attributes
    ----------
    vehicle : Vehicle
    table : TripTable
        For the baselines: means over bins of 1 s; every signal but the road is constant at its first raw sample.
    segments : SegmentTable
        For the models of power.
    data_features : DataFrame, (rows of `segments`, DATA_FEATURES)
    plans : tuple of Plan
    logs : tuple of DataFrame
        From `measured_log`.
    stages : tuple of StageRecord
        Evidence of each trip's signals about the stages of the car.
    trips : tuple of Trip
        Trips as recorded, for whole models from outside.
    """

    vehicle: Vehicle
    table: TripTable
    segments: SegmentTable
    data_features: pd.DataFrame
    plans: tuple[Plan, ...]
    logs: tuple[pd.DataFrame, ...]
    stages: tuple[StageRecord, ...]
    trips: tuple[Trip, ...] = ()

    @classmethod
    def from_trips(cls, trips: Sequence[Trip], vehicle: Vehicle) -> ForecastData:
        """Prepare raw trips with measured energy. O(samples)."""
        trips = _with_distinct_ids(trips)
        table = build_table([at_departure_only(trip) for trip in trips], {"physics": vehicle})
        plans = tuple(map(Plan.from_trip, trips))
        segments = segment_trips(trips, vehicle)
        logs = tuple(measured_log(trip) for trip in trips)
        stages = tuple(stage_record(trip, vehicle) for trip in trips)
        features = _data_features(segments, plans)
        return cls(vehicle, table, segments, features, plans, logs, stages, tuple(trips))

    def __len__(self) -> int:
        return len(self.plans)

    def take(self, members: IntArray) -> ForecastData:
        """Return some of the trips by their ascending numbers."""
        rows = np.isin(self.segments.groups, members)
        kept = {name: getattr(self, name) for name in ("plans", "logs", "stages", "trips")}
        return replace(
            self,
            table=self.table.take(members),
            segments=self.segments.take(members),
            data_features=self.data_features[rows].reset_index(drop=True),
            **{name: taken(values, members) for name, values in kept.items() if values},
        )

    def identified(self, trains: Sequence[IntArray]) -> list[tuple[Vehicle, SegmentTable]]:
        """Identify the car's stages from each choice of training trips; return each car with the segments of all trips simulated by it.

        O(samples) for each choice. The table is `segments` itself if the signals change nothing of the car.
        """
        shown = identify_each([[self.stages[i] for i in train] for train in trains], self.vehicle)
        cars = [values.applied(self.vehicle) for values in shown]
        new = [car for car in cars if car is not self.vehicle]
        tables = iter(resimulated(self.segments, self.plans, new))
        return [(car, self.segments if car is self.vehicle else next(tables)) for car in cars]

    def slim(self) -> ForecastData:
        """Return the segments and data features alone, which are cheap to send to a process."""
        return replace(self, table=self.table.take([]), plans=(), logs=(), stages=(), trips=())


def at_departure_only(trip: Trip) -> Trip:
    """Return a raw trip as it was known at departure: every signal but road and measured energy is constant at its first sample.

    Columns that are neither kept nor part of a departure are dropped.
    """
    kept = [c for c in (*ROUTE_COLUMNS, "voltage_v", "current_a", "observed_energy_wh") if c in trip]
    departure = Departure.from_first_sample(trip, trip.context)
    at_start = {c: getattr(departure, name) for name, c in SIGNALS.items() if c in trip}
    values = {c: np.nan if value is None else float(value) for c, value in at_start.items()}
    return replace(trip, samples=trip.samples[kept].assign(**values))


def measured_log(trip: Trip, step_s: float = 1.0) -> pd.DataFrame:
    """Thin the measurements of a trip to one raw sample per step, without interpolation.

    Parameters
    ----------
    trip : Trip
        Raw samples with measured energy.
    step_s : float
        Length of a step; each step has at most one row, the last sample up to then.

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
        raise InvalidInput.of("no measured energy", trip.trip_id, "", "voltage and current of each trip")
    time = trip.array("time_s") - float(trip.array("time_s")[0])
    distance = distance_driven(time, trip.array("speed_m_s"))
    measured = np.isfinite(cumulative)
    if {"voltage_v", "current_a"} <= set(raw.columns):
        # energy in a gap is interpolated with the sample after it, so rows in the gap would depend on a later sample
        measured &= np.isfinite(trip.array("voltage_v") * trip.array("current_a"))
    rows = np.flatnonzero(measured)
    steps = np.arange(0.0, time[rows[-1]], step_s)
    last = np.clip(np.searchsorted(time[rows], steps + 1e-9, side="right") - 1, 0, None)
    rows = rows[np.unique(np.append(last, len(rows) - 1))]
    log = {"time_s": time[rows], "observed_energy_wh": cumulative[rows], "distance_m": distance[rows]}
    log |= {c: trip.array(c)[rows] for c in (*CHARGE_COLUMNS, *TOLD_BY) if c in trip}
    return pd.DataFrame(log)


def _data_features(segments: SegmentTable, plans: Sequence[Plan]) -> pd.DataFrame:
    """Compute `DATA_FEATURES` of each segment."""
    climbs, kinetic = [], []
    for i, plan in enumerate(plans):
        rows = slice(int(segments.offsets[i]), int(segments.offsets[i + 1]))
        seconds = segments.hours[rows] * 3600.0
        height = _height(plan)
        climbs.append(_change_per_second(height, plan, seconds))
        kinetic.append(_change_per_second(0.5 * plan.array("speed_m_s") ** 2, plan, seconds))
    columns = {"climb_m_s": np.concatenate(climbs), "kinetic_m2_s3": np.concatenate(kinetic)}
    return segments.features.assign(**columns)[list(DATA_FEATURES)]


def _height(plan: Plan) -> FloatArray:
    if "elevation_m" in plan:
        return plan.array("elevation_m")
    if "grade" in plan:
        step = np.diff(plan.array("time_s"), prepend=plan.array("time_s")[0])
        return np.asarray(np.cumsum(plan.array("grade") * plan.array("speed_m_s") * step))
    return np.full(len(plan), np.nan)


def _change_per_second(values: FloatArray, plan: Plan, seconds: FloatArray) -> FloatArray:
    """Change per second over each segment of a plan."""
    time = plan.array("time_s") - plan.array("time_s")[0]
    edges = np.minimum(np.arange(len(seconds) + 1) * SEGMENT_S, time[-1])
    edges[-1] = time[-1]
    return np.asarray(np.diff(np.interp(edges, time, values)) / seconds)


def _with_distinct_ids(trips: Sequence[Trip]) -> list[Trip]:
    """Make the ids of trips distinct: a later trip with an id that is taken gets a mark."""
    taken: set[str] = set()
    named = []
    for trip in trips:
        name = trip.trip_id
        while name in taken:
            name += "'"
        taken.add(name)
        named.append(trip if name == trip.trip_id else replace(trip, trip_id=name))
    return named
