"""What a planned route adds to the doubt: a forecast from links knows the speed less well than one from the driven trace.

While a model is fitted, each training trip is cut into links as a router sees them, a driver is made of the links, and
the corrector that has not seen the trip forecasts both: the driven trace and the trip that was made from its links. The
relative difference of the two energies is what knowing only links costs. Its mean square, by the length of the links, is
the variance that a forecast of a planned route carries besides that of a driven trace. The mean difference is in it: no
forecast is shifted.

The links of the training trips have the travel times that were driven. That a router expects the wrong time is not in
the measure; it belongs to the router.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from tripwatt.auditing.signals import blank_stuck_heater
from tripwatt.errors import InvalidInput
from tripwatt.hybrid import BlockTable, IntArray, PowerCorrector, block_table
from tripwatt.hybrid.climate_log import CLIMATE_COLUMNS
from tripwatt.physics import simulate_trip
from tripwatt.routes import links_of_trip, plan_from_links
from tripwatt.trips import Flag, FloatArray, Plan, Trip, observed_cumulative_energy
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from tripwatt.forecasting.forecast import Forecast

DRIVEN_S: Final = "driven_s"
"""Column of the car's own clock beside that of its plan."""

LENGTHS_M: Final = (250.0, 1000.0, 4000.0)
"""Lengths of links whose cost is measured."""

MOST_TRIPS: Final = 200
"""So many training trips at most are cut into links; more say hardly more of three variances."""

LEAST_TRIPS: Final = 5

GAP_S: Final = 15.0
"""Longest time between two samples under which nothing is missing, as `Forecast.update` has it."""

FILL_S: Final = 5.0

DRIVEN: Final = "the driven speed trace"
PLANNED: Final = "a planned route"


@dataclass(frozen=True, eq=False)
class RouteDoubt:
    """Relative variance that links add to the energy of a trip, by their length.

    Attributes
    ----------
    length_m : ndarray, shape (lengths,)
        Ascending.
    variance : ndarray, shape (lengths,)
        Of the energy over the forecast energy; never falls with the length.
    trips : int
        Trips that it was measured on.

    Examples
    --------
    >>> doubt = RouteDoubt(np.array([250.0, 1000.0]), np.array([0.0004, 0.0016]), 20)
    >>> round(doubt.share(250.0), 6), round(doubt.share(625.0) ** 2, 6), doubt.share(0.0), round(doubt.share(9e9), 6)
    (0.02, 0.001, 0.0, 0.04)
    """

    length_m: FloatArray
    variance: FloatArray
    trips: int

    @classmethod
    def of(cls, differences: FloatArray) -> RouteDoubt | None:
        """From relative differences, shape (trips, `LENGTHS_M`), NaN where there is none; None with too few trips."""
        known = differences[np.isfinite(differences).all(axis=1)]
        if len(known) < LEAST_TRIPS:
            return None
        variance = np.maximum.accumulate(np.mean(known**2, axis=0))
        return cls(np.array(LENGTHS_M), variance, len(known))

    def share(self, link_m: float) -> float:
        """Standard deviation over the energy for links of a length.

        The variance is linear in between and from 0 m; beyond the longest length it stays.
        """
        length, variance = np.concatenate(([0.0], self.length_m)), np.concatenate(([0.0], self.variance))
        return float(np.sqrt(np.interp(link_m, length, variance)))


@dataclass(frozen=True, eq=False)
class LinkedTrips:
    """Training trips as their links make them.

    Attributes
    ----------
    tables : tuple of tuple of BlockTable
        For each trip its blocks on links of every length of `LENGTHS_M`, or nothing where it was not cut.
    """

    tables: tuple[tuple[BlockTable, ...], ...]

    def take(self, members: Sequence[int] | IntArray) -> LinkedTrips:
        """Those of some of the trips."""
        return LinkedTrips(tuple(self.tables[int(i)] for i in members))

    def differences(self, corrector: PowerCorrector, driven: BlockTable, members: IntArray) -> FloatArray:
        """(energy on links - energy on the driven trace) / the latter, as a corrector that knows neither sees them.

        Parameters
        ----------
        corrector : PowerCorrector
            Fitted without these trips.
        driven : BlockTable
            All trips, on their driven traces.
        members : ndarray of int
            Which of them.

        Returns
        -------
        ndarray, shape (members, lengths)
            NaN for trips that were not cut.
        """
        found = np.full((len(members), len(LENGTHS_M)), np.nan)
        cut = [k for k, i in enumerate(members) if self.tables[int(i)]]
        if not cut:
            return found
        on_links = BlockTable.join([table for k in cut for table in self.tables[int(members[k])]])
        base = _energies(corrector, driven.take(members[cut]))[:, None]
        found[cut] = _energies(corrector, on_links).reshape(len(cut), len(LENGTHS_M)) / base - 1.0
        return found


def _energies(corrector: PowerCorrector, table: BlockTable) -> FloatArray:
    return table.totals_wh(table.simulated_w + corrector.predict(table))


def linked_trips(trips: Sequence[Trip], vehicle: Vehicle) -> LinkedTrips:
    """Cut trips into links and let a driver drive these. O(samples) for each length.

    Of more than `MOST_TRIPS` trips, so many are cut, evenly chosen. Trips that do not move are not.
    """
    chosen = {int(i) for i in np.linspace(0, len(trips) - 1, min(len(trips), MOST_TRIPS)).round()}
    return LinkedTrips(tuple(_on_links(t, vehicle) if i in chosen else () for i, t in enumerate(trips)))


def _on_links(trip: Trip, vehicle: Vehicle) -> tuple[BlockTable, ...]:
    try:
        plans = [plan_on_links(trip, length) for length in LENGTHS_M]
        return tuple(block_table(plan, simulate_trip(vehicle, plan)) for plan in plans)
    except InvalidInput:  # a log that is no drive as a route knows it says nothing of routes
        return ()


def plan_on_links(trip: Trip, length_m: float) -> Plan:
    """The plan of a drive of which only links of a length are known, with their mean speeds.

    Travel times of the links include every standstill; elevation is known at their ends, stops are not.

    Raises
    ------
    InvalidInput
        When the trip does not move, or faster than a link can be.
    """
    plan = plan_from_links(links_of_trip(trip, length_m), trip_id=trip.trip_id)
    return plan.with_departure(trip.departure)


def with_route_error(forecast: Forecast, doubt: RouteDoubt | None) -> Forecast:
    """A forecast before departure with the error of its route; that of a driven trace stays as it is.

    The standard deviation of the whole trip becomes ``sqrt(own² + (share · energy)²)``; on the way, what is left of the
    second part is in proportion to the time to go.

    Parameters
    ----------
    forecast : Forecast
    doubt : RouteDoubt or None
        The model's.
    """
    link_m = forecast.plan.link_m
    if link_m is None:
        return forecast
    flags = [*forecast.flags, *forecast.plan.flags]
    extra = 0.0
    if doubt is None:
        flags.append(Flag("route_error_unknown", "links"))
    else:
        extra = doubt.share(link_m) * abs(forecast.energy_wh)
        if link_m > float(doubt.length_m[-1]):
            flags.append(Flag("links_too_long", "links", link_m, "m"))
    return replace(forecast, route_doubt_wh=extra, flags=tuple(dict.fromkeys(flags)))


def along_the_plan(samples: pd.DataFrame, plan: Plan) -> pd.DataFrame:
    """Samples of a drive on the clock of its plan: each at the time at which the plan is where the car was. O(samples).

    A car that is late on a planned route has more of it before it than the clock says. Where the car stands longer than
    planned, the energy counts and the plan's clock waits. Of a plan that is the driven trace the clock is right already.

    Parameters
    ----------
    samples : DataFrame
        Sound samples since departure with the car's speed.
    plan : Plan

    Returns
    -------
    DataFrame
        `time_s`, `driven_s` by the car's own clock, and what was measured of `observed_energy_wh`, `soc`, `displayed_soc` and the powers of climate control.
    """
    if plan.link_m is None:
        return samples
    there, at = _distance(plan.array("time_s") - plan.array("time_s")[0], plan.array("speed_m_s"))
    moves = np.concatenate(([True], np.diff(there) > 0.0))
    time, speed = (samples[name].to_numpy(dtype=np.float64) for name in ("time_s", "speed_m_s"))
    driven = _distance(time, speed)[0] + float(np.interp(time[0], at, there))
    clock = np.interp(driven, there[moves], at[moves])
    states = {n: samples[n].to_numpy(dtype=np.float64) for n in ("soc", "displayed_soc") if n in samples}
    sound = blank_stuck_heater(samples, "")[0]  # told by the log's own clock
    powers = {n: sound[n].to_numpy(dtype=np.float64) for n in CLIMATE_COLUMNS if n in sound}
    energy = measured_energy(samples)
    # of a standstill the last sample counts, and the first of all, from which energy is counted
    last = np.append(np.diff(clock) > 0.0, True)
    kept = np.flatnonzero(last)
    if kept[0] != 0:
        clock[kept[0]] += min(1e-3, 0.5 * (clock[kept[1]] - clock[0]) if len(kept) > 1 else 1e-3)
        kept = np.concatenate(([0], kept))
    # where the plan waits and the car did not, nothing is missing
    wait = np.diff(clock[kept])
    gap = np.maximum.reduceat(np.diff(time), kept[:-1]) if len(kept) > 1 else np.empty(0)
    parts = np.where((wait > FILL_S) & (gap <= GAP_S), np.ceil(wait / FILL_S), 1.0).astype(np.int64)
    first = np.repeat(np.arange(len(parts)), parts)
    place = np.append(
        first + (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[first],
        len(parts),
    )
    order = np.arange(len(kept))
    found = {"time_s": np.interp(place, order, clock[kept]), DRIVEN_S: np.interp(place, order, time[kept])}
    if energy is not None:
        found["observed_energy_wh"] = np.interp(place, order, energy[kept])
    found |= {name: np.interp(place, order, values[kept]) for name, values in powers.items()}
    whole = place == np.floor(place)
    for name, values in states.items():
        found[name] = np.where(whole, values[kept][place.astype(np.int64)], np.nan)
    return pd.DataFrame(found)


def measured_energy(samples: pd.DataFrame) -> FloatArray | None:
    """As `observed_cumulative_energy`, but NaN where voltage or current are missing for longer than `GAP_S`."""
    energy = observed_cumulative_energy(samples)
    if energy is None:
        return None
    pair = {"voltage_v", "current_a"} <= set(samples.columns)
    names = ["voltage_v", "current_a"] if pair else ["observed_energy_wh"]
    known = np.isfinite(samples[names].to_numpy(dtype=np.float64)).all(axis=1)
    time, at = samples["time_s"].to_numpy(dtype=np.float64), np.flatnonzero(known)
    if not len(at):
        return None
    after = np.searchsorted(at, np.arange(len(time)))
    inside = (after > 0) & (after < len(at))
    before, after = at[np.maximum(after - 1, 0)], at[np.minimum(after, len(at) - 1)]
    bridged = inside & (time[after] - time[before] <= GAP_S)
    return np.where(known | (bridged & pair), energy, np.nan)


def _distance(time: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance driven at each time [m], and the times."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time)))), time


def route_sd_wh(forecast: Forecast) -> FloatArray:
    """Doubt of the route in the energy up to the end of each block [Wh]: in proportion to the time that was not measured.

    One doubt for the whole route, as if all links erred together: along the way it grows like the band's other parts.
    """
    ahead = forecast.open_hours
    if (
        forecast.measured_hours is None and forecast.anchor is not None
    ):  # a state of charge tells what is behind
        ends = np.cumsum(forecast.blocks.step_s)
        ahead = ahead * np.clip((ends - forecast.anchor[0]) / forecast.blocks.step_s, 0.0, 1.0)
    return np.asarray(forecast.route_doubt_wh * np.cumsum(ahead) / forecast.table.hours.sum())


def given_of(plan: Plan) -> str:
    """What a forecast takes as known of the speed: `DRIVEN` or `PLANNED`."""
    return DRIVEN if plan.link_m is None else PLANNED
