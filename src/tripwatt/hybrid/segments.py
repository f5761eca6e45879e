"""A plan cut into short segments: the rows on which residual power is fitted, and the errors of their measured energies."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, IntArray, changes, running_sum
from tripwatt.errors import Fault, InvalidInput, or_none
from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.hybrid.rows import Records, RowTable, joined
from tripwatt.learners.gp import float_columns
from tripwatt.physics import Simulation
from tripwatt.physics.batch import simulate_trips
from tripwatt.physics.chain import CAUSES
from tripwatt.routes.free_flow import driven_by_kind
from tripwatt.routes.terrain import net_climbs
from tripwatt.trips import TEMPERATURES, Plan, Trip, raise_faults, resample, table_of
from tripwatt.trips.energy import resolution
from tripwatt.units import GRAVITY_M_S2, SECONDS_PER_DAY, SECONDS_PER_HOUR, WH_PER_J
from tripwatt.vehicles import Vehicle

SEGMENT_S: Final = 30.0
"""Length of the segments [s]: a few changes of speed, so that the residual shows the car and not errors of timing."""

LINE_CAUSES: Final = tuple(cause for cause in CAUSES if cause != "shortfall")
"""Causes whose simulated power the correctors may scale; `shortfall` is no property of the car."""


DRIVING: Final = tuple(cause for cause in LINE_CAUSES if cause not in ("climate", "climb"))
"""Causes whose energy depends on the speeds of a road."""


@dataclass(frozen=True, eq=False)
class SegmentTable(RowTable):
    """Segments of trips as one flat table: rows of trip i are ``offsets[i]:offsets[i + 1]``.

    Attributes
    ----------
    trip_ids : tuple of str
        Name of each trip.
    offsets : ndarray of int, shape (trips + 1,)
        First row of each trip, and the number of rows.
    features : DataFrame, (rows, features)
        Quantities known before departure; NaN if unknown.
    hours : ndarray, shape (rows,)
        Duration of each segment [h].
    simulated_w : ndarray, shape (rows,)
        Simulated power at the battery terminals [W].
    observed_w : ndarray or None, shape (rows,)
        Measured power at the battery terminals [W]; None for plans.
    observed_climate_w : ndarray or None, shape (rows,)
        Measured power of climate control [W]; NaN in segments in which it was not logged.
    charge : ndarray or None, shape (trips, 4)
        State of charge of the battery management at departure and arrival, then the displayed one at departure and arrival;
        NaN if not logged. None for plans.
    errors : EnergyErrors or None
        Errors of the measured energies; None for plans, and if all energies count as exact.
    covariates : DataFrame or None, (trips, covariates)
        Covariates of the trips, numbers and words; None if there are none.
    added : mapping of str to tuple of str
        Covariate that a corrector uses -> its columns of `features`.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = segment_trips(synthetic_fleet(2).trips, load_vehicle(VEHICLE))
    >>> len(table), len(table.take([1])), len(SegmentTable.join([table, table]))
    (2, 1, 4)
    >>> table.totals_wh(table.observed_w).shape
    (2,)
    """

    by_trip = ("trip_ids", "charge", "errors", "covariates")
    by_row = ("features", "hours", "simulated_w", "observed_w", "observed_climate_w")

    trip_ids: tuple[str, ...]
    offsets: IntArray
    features: pd.DataFrame
    hours: FloatArray
    simulated_w: FloatArray
    observed_w: FloatArray | None = None
    observed_climate_w: FloatArray | None = None
    charge: FloatArray | None = None
    errors: EnergyErrors | None = None
    covariates: pd.DataFrame | None = None
    added: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def columns(self) -> Mapping[str, FloatArray]:
        """Numeric columns of `features` by name, each of shape (rows,)."""
        return float_columns(self.features)

    @property
    def observed_power_w(self) -> FloatArray:
        """Measured power [W], shape (rows,); raises InvalidInput if the table has none."""
        if self.observed_w is None:
            raise InvalidInput.of("no measured energy", "trips", "none", "the measured energy of each trip")
        return self.observed_w

    @property
    def residual_w(self) -> FloatArray:
        """Observed minus simulated power [W], shape (rows,)."""
        return self.observed_power_w - self.simulated_w

    @property
    def climate_residual_w(self) -> FloatArray:
        """Observed minus simulated power of climate control [W], shape (rows,); NaN if not logged."""
        if self.observed_climate_w is None:
            return np.full(len(self.hours), np.nan)
        return np.asarray(self.observed_climate_w - self.columns["climate_w"])

    @property
    def energy_errors(self) -> EnergyErrors:
        """Return `errors`, or those of exact energies if `errors` is None."""
        if self.errors is not None:
            return self.errors
        zero = np.zeros(len(self))
        return EnergyErrors(zero, zero, np.ones(len(self), dtype=bool))

    def totals_wh(self, power_w: FloatArray) -> FloatArray:
        """Sum a power over each trip.

        Parameters
        ----------
        power_w : ndarray, shape (rows,)
            Power of each row [W].

        Returns
        -------
        ndarray, shape (trips,)
            Energy of each trip [Wh].
        """
        return np.add.reduceat(power_w * self.hours, self.offsets[:-1])

    @classmethod
    def join(cls, tables: Sequence[SegmentTable]) -> SegmentTable:
        """Join several tables into one.

        Parameters
        ----------
        tables : sequence of SegmentTable
            At least one table; all with the same features.

        Returns
        -------
        SegmentTable
            Trips in the order of the tables; measured power and charge are None unless all tables have them.
        """
        complete: dict[str, Callable[[SegmentTable], Any]] = {
            "observed_climate_w": lambda t: np.full(len(t.hours), np.nan),
            "errors": lambda t: t.energy_errors,
            "covariates": lambda t: pd.DataFrame(index=range(len(t))),
        }
        columns = {name: [getattr(t, name) for t in tables] for name in (*cls.by_trip, *cls.by_row)}
        for name, default in complete.items():
            if any(part is not None for part in columns[name]):
                pairs = zip(tables, columns[name], strict=True)
                columns[name] = [default(t) if part is None else part for t, part in pairs]
        offsets = running_sum(np.concatenate([np.diff(t.offsets) for t in tables])).astype(np.int64)
        values = {name: joined(parts) for name, parts in columns.items()}
        return cls(offsets=offsets, added=tables[0].added, **values)


def segment_table(
    plan: Plan, simulation: Simulation, measured: Trip | None = None, *, climb_wh: float = 0.0
) -> SegmentTable:
    """Cut one trip into segments, from its plan and simulation; adds the measured power if a measured trip is given.

    The last segment takes the rest of the trip and is up to twice as long as the others.

    Parameters
    ----------
    plan : Plan
        Speed trace and road, and the state known at departure.
    simulation : Simulation
        Simulation of the plan.
    measured : Trip, optional
        The raw trip; its cumulative energy is read at the ends of the segments. If it was not measured along the trip
        (`EnergyErrors.along`), only the total is used: the residual is the same in every segment.
    climb_wh : float
        Standard deviation of the measured energy due to an unknown climb [Wh].

    Returns
    -------
    SegmentTable
        Table of one trip.

    Examples
    --------
    >>> from tripwatt.physics import simulate_trip
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.trips import Plan
    >>> from tripwatt.vehicles import load_vehicle
    >>> plan = Plan.from_trip(synthetic_fleet(1).logs[0])
    >>> table = segment_table(plan, simulate_trip(load_vehicle(VEHICLE), plan))
    >>> len(table), table.observed_w is None, bool(abs(table.hours.sum() * 3600.0 - plan.duration_s) < 2.0)
    (1, True, True)
    """
    time = plan.array("time_s")
    # the first step is their median; of steps that are mostly equal a sort takes a quarter of the time of `np.median`
    steps = np.sort(time[1:] - time[:-1])
    step = np.diff(time, prepend=time[0] - 0.5 * (steps[(len(steps) - 1) // 2] + steps[len(steps) // 2]))
    segment = np.minimum(
        np.floor((time - time[0]) / SEGMENT_S).astype(np.int64),
        max(int((time[-1] - time[0]) // SEGMENT_S - 0.5), 0),
    )
    n = int(segment[-1]) + 1
    seconds = np.asarray(np.bincount(segment, step, n), dtype=np.float64)

    def mean(values: FloatArray) -> FloatArray:
        return np.bincount(segment, values * step, n) / seconds

    speed, departure = plan.array("speed_m_s"), plan.departure
    features: dict[str, Any] = {
        "simulated_w": mean(simulation.battery_power_w),
        **{f"{cause}_w": mean(simulation.power_by_cause_w[cause]) for cause in LINE_CAUSES},
        "moved_w": mean(np.abs(simulation.wheel_power_w)),
        "speed_m_s": mean(speed),
        "speed_change_m_s2": mean(np.abs(changes(speed)) / np.maximum(step, 1e-9)),
        "time_s": mean(time - time[0]),
        "trip_speed_m_s": float((speed * step).sum() / step.sum()),
        "payload_mass_kg": departure.payload_mass_kg or 0.0,
        **{name: getattr(departure, name) for name in TEMPERATURES},
        "soc": departure.bms_soc,
        "day": day_of(departure.departs_at),
        "winter": {"winter": 1.0, "summer": 0.0}.get(departure.season or "", np.nan),
    }
    # where a segment ends at the speed of its start, trees must not split on the sign of a rounding error
    features["acceleration_w"][np.abs(features["acceleration_w"]) < 1e-9] = 0.0
    simulated = np.asarray(features["simulated_w"])
    observed = climate = charge = errors = None
    if measured is not None:
        observed, charge = _measured_power(measured, segment, plan, seconds), _charge_readings(measured)
        errors = EnergyErrors.from_trip(measured, climb_wh, n)
        edges_s = float(measured.array("time_s")[0]) + np.concatenate(([0.0], np.cumsum(seconds)))
        climate = logged_climate(measured.samples, edges_s)
    if observed is not None and errors is not None and not errors.along[0]:
        observed = simulated + float(seconds @ (observed - simulated)) / float(seconds.sum())
    return SegmentTable(
        trip_ids=(plan.trip_id,),
        offsets=np.array([0, n]),
        features=table_of(features),
        hours=seconds / SECONDS_PER_HOUR,
        simulated_w=simulated,
        observed_w=observed,
        observed_climate_w=climate,
        charge=charge,
        errors=errors,
        covariates=None if departure.covariates is None else pd.DataFrame([departure.covariates]),
    )


def segment_trips(trips: Sequence[Trip], vehicle: Vehicle) -> SegmentTable:
    """Cut recorded trips into segments with measured and simulated power. O(samples).

    Parameters
    ----------
    trips : sequence of Trip
        Raw trips with measured energy.
    vehicle : Vehicle
        The car that is simulated.

    Returns
    -------
    SegmentTable
        Table of all trips, in their order.

    Raises
    ------
    InvalidInput
        If there is no trip, or a trip has no measured energy.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = segment_trips(synthetic_fleet(2).trips, load_vehicle(VEHICLE))
    >>> len(table), len(table.residual_w) == len(table.hours)
    (2, True)
    """
    require_measured(trips)
    plans = [Plan.from_trip(trip) for trip in trips]
    runs = simulate_trips((vehicle, plan) for plan in plans)
    return SegmentTable.join(
        [
            segment_table(plan, run, trip, climb_wh=unknown_climb_wh(plan, vehicle))
            for plan, trip, run in zip(plans, trips, runs, strict=True)
        ]
    )


def driven_roads(trips: Sequence[Trip], table: SegmentTable, driving: FloatArray) -> FloatArray:
    """Summaries of the roads and the weather of trips, shape (trips, 9).

    Columns 1 to 6: length [m] and time [s] in city, country and motorway, NaN for a trip without links. Column 7: the energy [Wh] of
    the power `driving`. Columns 8 and 9: outside temperature at departure [°C] and day [days since 1970], NaN if unknown.
    """
    rows = [
        np.full(6, np.nan) if cut is None else cut
        for cut in (or_none(driven_by_kind, trip) for trip in trips)
    ]
    about = table.features[["ambient_temperature_degc", "day"]].to_numpy(dtype=np.float64)[table.offsets[:-1]]
    return np.column_stack([np.array(rows), table.totals_wh(driving), about])


def driving_w(table: SegmentTable) -> FloatArray:
    """Simulated power of the causes `DRIVING` in each segment [W], shape (rows,)."""
    return np.asarray(sum(table.columns[f"{cause}_w"] for cause in DRIVING))


def require_measured(trips: Sequence[Trip], *, positive: bool = False) -> None:
    """Raise `InvalidInput` for every trip without measured energy, with `positive` above 0 Wh, and if there is no trip."""
    allowed = "voltage and current, or a column observed_energy_wh" + ", above 0 Wh" * positive
    faults = [
        Fault("no measured energy", t.trip_id, "0 Wh or less" * (t.observed_energy_wh is not None), allowed)
        for t in trips
        if t.observed_energy_wh is None or (positive and not t.observed_energy_wh > 0.0)
    ]
    if not trips:
        faults.append(Fault("no trips", "training", "0", "at least 1 with measured energy"))
    raise_faults(faults)


def resimulated(
    table: SegmentTable, plans: Sequence[Plan], vehicles: Sequence[Vehicle]
) -> list[SegmentTable]:
    """Simulate the same trips with other cars, and keep the measurements. O(samples x cars).

    Parameters
    ----------
    table : SegmentTable
        Segments of the trips, of the usual length.
    plans : sequence of Plan
        Plans of the same trips, in their order.
    vehicles : sequence of Vehicle
        The cars that are simulated.

    Returns
    -------
    list of SegmentTable
        One table for each car, with the features of its simulation.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> car, trips = load_vehicle(VEHICLE), synthetic_fleet(2).trips
    >>> table = segment_trips(trips, car)
    >>> (again,) = resimulated(table, [Plan.from_trip(trip) for trip in trips], [car])
    >>> bool((again.simulated_w == table.simulated_w).all())
    True
    """
    runs = simulate_trips((vehicle, plan) for vehicle in vehicles for plan in plans)
    parts, n = list(map(segment_table, list(plans) * len(vehicles), runs)), len(plans)
    return [_beside(table, SegmentTable.join(parts[i : i + n])) for i in range(0, len(parts), n)]


def _beside(table: SegmentTable, new: SegmentTable) -> SegmentTable:
    """Combine the measurements of a table with a new simulation of its trips."""
    observed, rows = table.observed_w, table.groups
    if observed is not None:
        # If the energy comes from the state of charge, only the total counts, and its residual is spread evenly.
        hours = table.totals_wh(np.ones(len(rows)))
        change = table.totals_wh(new.simulated_w - table.simulated_w) / hours
        even = new.simulated_w + (observed - table.simulated_w) - change[rows]
        observed = np.where(table.energy_errors.along[rows], observed, even)
    return replace(table, features=new.features, simulated_w=new.simulated_w, observed_w=observed)


def day_of(at: dt.datetime | None) -> float:
    """Days since 1970, NaN for None; a time without a zone counts as UTC on every machine."""
    if at is None:
        return np.nan
    return (at if at.tzinfo else at.replace(tzinfo=dt.UTC)).timestamp() / SECONDS_PER_DAY


def _measured_power(measured: Trip, segment: IntArray, plan: Plan, seconds: FloatArray) -> FloatArray | None:
    """Mean measured power of each segment [W]; the segments' energies add up to the trip's energy."""
    step_s = plan.step_s or float(np.median(np.diff(plan.array("time_s"))))
    if measured.step_s not in (None, step_s):
        got, allowed = f"segments of {measured.step_s:g} s", f"raw samples, or segments of {step_s:g} s"
        raise InvalidInput.of("wrong time step", measured.trip_id, got, allowed)
    raw = measured if measured.step_s is not None else resample(measured, step_s)
    if "observed_energy_wh" not in raw:  # only the total is known
        total_wh = measured.observed_energy_wh
        return None if total_wh is None else total_wh * SECONDS_PER_HOUR / seconds.sum() + 0.0 * seconds
    cumulative = raw.array("observed_energy_wh")
    ends = np.append(np.flatnonzero(np.diff(segment)), len(segment) - 1)
    return np.asarray(np.diff(cumulative[ends], prepend=0.0) / (seconds / SECONDS_PER_HOUR))


def _charge_readings(measured: Trip) -> FloatArray:
    """First and last state of charge of the battery management and of the display, shape (1, 4)."""
    readings = []
    for name in ("soc", "displayed_soc"):
        values = measured.array(name) if name in measured else np.empty(0)
        known = values[np.isfinite(values)]
        readings += [known[0], known[-1]] if len(known) else [np.nan, np.nan]
    return np.array([readings], dtype=np.float64)


def unknown_climb_wh(plan: Plan, vehicle: Vehicle) -> float:
    """Standard deviation of a trip's energy due to the unknown climb of its road [Wh]; 0 if the heights are known.

    It is the potential energy of a typical climb: losses are added on the way up and saved on the way down. The far tails of the
    distribution of climbs are left out, because errors of trips are expected to have heavy tails anyway.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan, car = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}]), tw.load_vehicle("bmw_i3_60ah")
    >>> 50.0 < unknown_climb_wh(plan, car) < 150.0
    True
    """
    if plan.has_road:
        return 0.0
    climb_m = net_climbs(plan.departure.terrain or "unknown").typical_m(plan.distance_m)
    mass_kg = vehicle.body.test_mass_kg + (plan.departure.payload_mass_kg or 0.0)
    return mass_kg * GRAVITY_M_S2 * climb_m * WH_PER_J


@dataclass(frozen=True, eq=False)
class EnergyErrors(Records):
    """Measurement errors of trips.

    Attributes
    ----------
    own_wh : ndarray, shape (trips,)
        Standard deviation of each energy, independent of other trips [Wh]; 0 if negligible.
    common : ndarray, shape (trips,)
        Relative standard deviation of the error that all energies of the car share [1].
    along : ndarray of bool, shape (trips,)
        Whether the energy was measured along the trip: from voltage and current, or by a counter that steps at least once in a
        segment. A coarser counter and an energy from the state of charge count only for the whole trip.
    """

    own_wh: FloatArray
    common: FloatArray
    along: BoolArray

    @classmethod
    def from_trip(cls, trip: Trip, climb_wh: float = 0.0, segments: int = 1) -> EnergyErrors:
        """Make the errors of one trip; `climb_wh`, by the unknown climb of its road, counts as an error of the energy."""
        along = {"voltage_v", "current_a"} <= set(trip.samples.columns)
        if not along and "observed_energy_wh" in trip and not trip.observed_energy_common_std:
            step_wh = resolution(trip.array("observed_energy_wh"))
            along = step_wh * segments <= abs(trip.observed_energy_wh or 0.0)
        return cls(
            np.array([math.hypot(trip.observed_energy_own_std_wh, climb_wh)]),
            np.array([trip.observed_energy_common_std]),
            np.array([along]),
        )
