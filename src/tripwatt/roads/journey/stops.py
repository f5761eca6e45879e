"""A journey with stops to charge: its stops, its legs, and the totals of the whole journey."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.errors import percent
from tripwatt.forecasting import Forecast
from tripwatt.forecasting.difference import Difference
from tripwatt.forecasting.leaving import leaving_with
from tripwatt.roads.journey.solver import joint_chance
from tripwatt.roads.maps.stations import Station
from tripwatt.roads.routers import Road
from tripwatt.trips import Departure
from tripwatt.trips.showing import period

START_M: Final = 2000.0
"""A stop less than this far from the start is charging before the journey. A choice."""
SAME_TIME_S: Final = 300.0
"""Plans and roads whose times differ by at most this count as equally fast if the car has to charge: a choice, the time of plugging in once."""

_BAND: Final = 0.9
ENERGY_BAND: Final = ("energy_low_wh", "energy_high_wh")
_SOC_COLUMNS: Final = ("displayed_soc", "displayed_soc_low", "displayed_soc_high")

_COURSE: Final = {"position_m": "distance_m", "time_s": "time_s"} | dict(
    zip(("displayed_soc", "low", "high"), _SOC_COLUMNS, strict=True)
)
"""Column of `ChargingPlan.series` for each field of the course of a journey."""

LINE_DIGITS: Final = {"latitude_deg": 6, "longitude_deg": 6, "position_m": 1}
"""Columns of a line on the map, and the number of digits to which each is rounded."""

MOST_CERTAIN: Final = 0.99
"""Highest chance on roads of unknown heights: a choice, since no log shows how often roads climb far."""

JOURNEY_FIELDS: Final = (
    *("p_arrive", "p_reserve", "soc_arrival", "soc_interval"),
    *("driving_s", "charging_s", "duration_s", "energy_wh"),
)
"""Attributes of a whole journey that both a plan and a verdict have."""

_IN_SHORT: Final = ("duration_s", "energy_wh", "soc_arrival", "p_reserve")


@dataclass(frozen=True, slots=True)
class NextStation:
    """Another station to go to from an occupied one.

    Attributes
    ----------
    station : Station
    soc_arrival : float
        Expected displayed charge at this station.
    p_reach : float
        Probability to reach this station; the reserve may be used.
    more_s : float
        Additional time of the journey [s].
    """

    station: Station
    soc_arrival: float
    p_reach: float
    more_s: float


@dataclass(frozen=True, eq=False, slots=True)
class ChargingStop:
    """One stop to charge.

    Attributes
    ----------
    station : Station
        Station at which the car charges.
    position_m : float
        Distance of the station along the line of the journey.
    soc_arrival, soc_leave : float
        Expected displayed charge at arrival, and displayed charge to leave with.
    soc_interval : tuple of float
        90 % interval of the charge at arrival.
    energy_wh : float
        Energy charged into the battery [Wh].
    charging_s, overhead_s : float
        Time of charging, and time for parking, plugging in and paying [s].
    arrives_after_s : float
        Time of arrival since departure [s].
    p_reach : float
        Probability to arrive with the reserve.
    needed_below : float
        Displayed charge at the station below which the stop is needed: with more, the car reaches the next stop, or the destination, with
        the chance that the plan has for it.
    preheat : bool
        Whether the battery is heated for the stop.
    if_full : NextStation or None
        Station to go to if this one is occupied; None if no other station helps.
    pause_s : float
        Pause of the journey at this stop [s]; the car charges meanwhile, and leaves no sooner.

    Examples
    --------
    >>> station = Station(47.0, 9.0, "A", 5e4, direct_current=True)
    >>> stop = ChargingStop(station, 5e4, 0.2, 0.8, (0.15, 0.25), 2.4e4, 1800.0, 300.0, 3600.0, 0.99)
    >>> stop.to_dict()["station"]["name"], stop.to_dict()["soc_interval"]
    ('A', [0.15, 0.25])
    """

    station: Station
    position_m: float
    soc_arrival: float
    soc_leave: float
    soc_interval: tuple[float, float]
    energy_wh: float
    charging_s: float
    overhead_s: float
    arrives_after_s: float
    p_reach: float
    needed_below: float = 1.0
    preheat: bool = False
    if_full: NextStation | None = None
    pause_s: float = 0.0

    @property
    def more_s(self) -> float:
        """Time that the stop adds to the journey [s]."""
        return max(self.charging_s + self.overhead_s - self.pause_s, 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Convert the stop to plain values.

        Returns
        -------
        dict
            One key for each attribute; the station as a dict.
        """
        return {**asdict(self), "soc_interval": list(self.soc_interval)}

    def in_words(self, leaves: dt.datetime | None = None) -> str:
        """Describe the stop for a driver; with the time of departure, by clock.

        Examples
        --------
        >>> station = Station(47.0, 9.0, "A", 5e4, direct_current=True, plug="type2_combo")
        >>> stop = ChargingStop(station, 5e4, 0.2, 0.8, (0.15, 0.25), 2.4e4, 1800.0, 300.0, 3600.0, 0.99, 0.42)
        >>> stop.in_words(dt.datetime(2026, 1, 5, 7, 30))
        'Charge at A (CCS, 50 kW) after 50 km, at 08:30, for 30 min: you arrive there with 20 % (15 to 25 %) and leave with 80 %. Needed only below 42 %.'
        """
        where = (
            f"after {self.position_m / 1000.0:.0f} km" if self.position_m >= START_M else "before the journey"
        )
        at = f", at {leaves + dt.timedelta(seconds=self.arrives_after_s):%H:%M}," if leaves else ""
        arrival, leave, low, high = map(percent, (self.soc_arrival, self.soc_leave, *self.soc_interval))
        text = (
            f"Charge at {self.station.place.title} ({self.station.power_in_words}) {where}{at} "
            f"for {period(self.charging_s)}{' in the pause' * (self.pause_s > 0.0)}: you arrive there with {arrival} ({low[:-2]} to {high}) and leave with {leave}. "
            f"Needed only below {math.ceil(100.0 * self.needed_below - 1e-6)} %."
        )
        if (full := self.if_full) is not None:
            text += f" If it is occupied: {full.station.place.title}, {period(full.more_s)} more."
        return f"{text} Heat the battery on the way there." if self.preheat else text


@dataclass(frozen=True, eq=False, slots=True)
class Leg:
    """A road between two stops with its forecast.

    Attributes
    ----------
    road : Road
    forecast : Forecast
        Forecast from the charge with which the leg begins.
    preheat_soc : float
        Displayed charge that is used to heat the battery for the stop at the end of the leg.
    """

    road: Road
    forecast: Forecast
    preheat_soc: float = 0.0

    def chance(self, reserve: float) -> float:
        """Return the probability to arrive with a reserve."""
        return self.forecast.p_arrive(min(reserve + self.preheat_soc, 1.0))

    @property
    def soc_arrival(self) -> float:
        """Expected displayed charge at the end of the leg."""
        return max(self.forecast.soc_arrival - self.preheat_soc, 0.0)

    @property
    def soc_interval(self) -> tuple[float, float]:
        """90 % interval of the charge at the end of the leg."""
        low, high = self.forecast.arrival.interval(_BAND)
        return max(low - self.preheat_soc, 0.0), max(high - self.preheat_soc, 0.0)

    @property
    def energy_wh(self) -> float:
        """Energy of the drive and of heating the battery [Wh]."""
        return self.forecast.energy_wh + self.preheat_soc * self.forecast.charge.wh_per_display

    @property
    def common_share(self) -> float:
        """Share of the errors common to all legs of a journey in the standard deviation of the charge at the end of the leg.

        The errors by the drift of the power, local travel times, an unknown climb and the reading of the display are new on each leg.
        The errors of car, driver and weather are common.
        """
        common, independent = (float(part[-1]) for part in variance_along(self.forecast))
        climb = self.forecast.sd_wh**2 - float(self.forecast.along.energy_sd_wh[-1]) ** 2
        return float(np.sqrt(common / (common + independent + climb)))

    def leaving_with(self, soc: float) -> Leg:
        """Return the leg from another charge, forecast again if the charges differ by more than 5 percentage points."""
        # a choice: within 5 points the energy changes by a thousandth
        if abs(soc - (self.forecast.plan.departure.soc or 0.0)) <= 0.05:
            drive = replace(self.forecast.drive, plan=self.forecast.plan.with_departure(Departure(soc=soc)))
            return replace(self, forecast=replace(self.forecast, drive=drive))
        return replace(self, forecast=leaving_with(self.forecast, soc))


def variance_along(forecast: Forecast) -> tuple[FloatArray, FloatArray]:
    """Return the variances of the energy taken from the battery up to each edge of the segments [Wh²], shape (segments + 1,) each.

    Returns
    -------
    common : ndarray
        Variance by errors that all parts of a journey share: car, driver, weather, capacity. It grows with the square of the distance.
    independent : ndarray
        Variance by errors that are new on each part: the drift of the power, local travel times, the reading of the display. It grows
        with the distance. An unknown climb is in neither.
    """
    uncertainty, charge = forecast.uncertainty, forecast.charge
    hours = running_sum(forecast.drive.table.hours)
    independent = forecast.sd_factor**2 * uncertainty.scale.course.drift_wh2(hours)
    if forecast.plan.free_flow and uncertainty.free_flow is not None:
        local = uncertainty.free_flow.local_variance_m / forecast.plan.distance_m * forecast.energy_wh**2
        independent = independent + local * hours / hours[-1]
    reading = (charge.displayed_sd * charge.wh_per_display) ** 2
    charge_sd_wh = charge.sd(forecast.along.energy_wh, True) * charge.wh_per_display
    total = forecast.along.energy_sd_wh**2 + charge_sd_wh**2 - reading
    return np.maximum(total - independent, 0.0), independent + reading


@dataclass(frozen=True, eq=False, slots=True)
class ChargingPlan:
    """A whole journey with its stops to charge, or on one road without a stop.

    Attributes
    ----------
    label : str
        "fastest", "fewest stops", "safest" or "cheapest"; "best effort" if no plan reaches the chance that a journey has to have. For a
        road without a stop, the labels of the road.
    stops : tuple of ChargingStop
        Stops in the order of the journey.
    legs : tuple of Leg
        Legs between the stops, one more than stops.
    reserve : float
        Displayed charge to have at every stop and at the end. A car that leaves with less has to have the reserve after the first stop.
    soc_needed : float or None
        For "best effort", displayed charge to leave with, so that the plan has the chance that a journey has to have. A value above 1 means
        that a full battery does not suffice.

    Examples
    --------
    >>> import tripwatt as tw
    >>> journey = tw.plan_journey(["Vaduz", "Malbun"], tw.Departure(soc=0.12), atlas="map")  # doctest: +SKIP
    >>> [stop.station.name for stop in journey.charging.stops]  # doctest: +SKIP
    ['Triesen']
    """

    label: str
    stops: tuple[ChargingStop, ...]
    legs: tuple[Leg, ...]
    reserve: float
    soc_needed: float | None = None

    @property
    def p_arrive(self) -> float:
        """Probability that the battery is never empty."""
        return self._joint([leg.chance(0.0) for leg in self.legs])

    @property
    def p_reserve(self) -> float:
        """Probability to have the reserve at every stop and at the end."""
        return self._joint(self.leg_chances)

    @property
    def leaves_below_reserve(self) -> bool:
        """Whether the charge at departure is below the reserve."""
        return bool(self.legs[0].forecast.along.expected_soc[0] < self.reserve)

    @property
    def leg_chances(self) -> tuple[float, ...]:
        """Probability of each leg to end with the reserve that it has to keep."""
        first = 0.0 if len(self.legs) > 1 and self.leaves_below_reserve else self.reserve
        return (self.legs[0].chance(first), *(leg.chance(self.reserve) for leg in self.legs[1:]))

    def _joint(self, chances: Sequence[float]) -> float:
        chance = joint_chance(np.array(chances), np.array([leg.common_share for leg in self.legs]))
        return min(chance, 1.0 if all(leg.forecast.climbing is None for leg in self.legs) else MOST_CERTAIN)

    @property
    def soc_arrival(self) -> float:
        """Expected displayed charge at the destination."""
        return self.legs[-1].soc_arrival

    @property
    def soc_interval(self) -> tuple[float, float]:
        """90 % interval of the charge at the destination."""
        return self.legs[-1].soc_interval

    @property
    def driving_s(self) -> float:
        """Time on the road [s], with ferries and trains that carry the car."""
        return sum(leg.forecast.plan.elapsed_s for leg in self.legs)

    @property
    def charging_s(self) -> float:
        """Time at stations with overheads, without that of pauses [s]."""
        return sum(stop.more_s for stop in self.stops)

    @property
    def duration_s(self) -> float:
        """Time of driving and charging [s]."""
        return self.driving_s + self.charging_s

    @property
    def energy_wh(self) -> float:
        """Energy of all legs [Wh]."""
        return sum(leg.energy_wh for leg in self.legs)

    @property
    def distance_m(self) -> float:
        """Length with detours [m]."""
        return sum(leg.road.distance_m for leg in self.legs)

    @property
    def by_cause_wh(self) -> dict[str, float]:
        """Energy of all legs by cause [Wh]; heating the battery for a stop counts as climate control."""
        by_leg = [leg.forecast.by_cause_wh for leg in self.legs]
        parts = {cause: sum(wh[cause] for wh in by_leg) for cause in by_leg[0]}
        heating_wh = self.energy_wh - sum(leg.forecast.energy_wh for leg in self.legs)
        return parts | {"climate": parts["climate"] + heating_wh}

    @property
    def battery_loss_wh(self) -> float:
        """Heat losses in the battery on the road [Wh], in addition to the energy at its terminals."""
        return sum(leg.forecast.battery_loss_wh for leg in self.legs)

    @property
    def energy_interval_wh(self) -> tuple[float, float]:
        """90 % interval of the energy of all legs [Wh]."""
        low, high = self.series()[list(ENERGY_BAND)].iloc[-1].tolist()
        return low, high

    @property
    def in_short(self) -> dict[str, Any]:
        """The totals by which journeys are compared, as plain values."""
        return {"charges": len(self.stops), **{name: getattr(self, name) for name in _IN_SHORT}}

    def series(self) -> pd.DataFrame:
        """Return the series along the journey, as `Forecast.series`; each stop has a row before charging and a row after.

        Returns
        -------
        DataFrame
            Time since departure with charging, and distance with detours. In the band of the energy, the common errors of the legs add
            up linearly, and the other errors as independent ones.

        Examples
        --------
        >>> journey.charging.series()["displayed_soc"].min()  # doctest: +SKIP
        0.14
        """
        tables, time_s, distance_m, energy_wh = [], 0.0, 0.0, 0.0
        common_wh, independent_wh2 = np.zeros((1, 2)), np.zeros((1, 2))
        waits_s = [*(stop.more_s for stop in self.stops), 0.0]
        for leg, wait_s in zip(self.legs, waits_s, strict=True):
            table = leg.forecast.to_frame()
            table["distance_m"] *= leg.road.distance_m / float(table["distance_m"].iloc[-1])
            table["time_s"] += time_s + leg.road.links.paused_s(table["distance_m"].to_numpy())
            table["distance_m"] += distance_m
            half_wh = np.abs(table[list(ENERGY_BAND)].to_numpy() - table[["energy_wh"]].to_numpy())
            common_wh = common_wh[-1] + leg.common_share * half_wh
            independent_wh2 = independent_wh2[-1] + (1.0 - leg.common_share**2) * half_wh**2
            table["energy_wh"] += energy_wh
            off_wh = np.array([-1.0, 1.0]) * np.sqrt(common_wh**2 + independent_wh2)
            table[list(ENERGY_BAND)] = table[["energy_wh"]].to_numpy() + off_wh
            end = table.index[-1], list(_SOC_COLUMNS)
            table.loc[end] = (table.loc[end] - leg.preheat_soc).clip(lower=0.0)
            tables.append(table)
            distance_m += leg.road.distance_m
            energy_wh += leg.energy_wh
            time_s = float(table["time_s"].iloc[-1]) + wait_s
        return pd.concat(tables, ignore_index=True)

    @property
    def line(self) -> dict[str, FloatArray]:
        """Line of all legs on the map: `latitude_deg, longitude_deg, position_m`."""
        roads = [leg.road for leg in self.legs]
        line = {name: np.concatenate([getattr(road, name) for road in roads]) for name in LINE_DIGITS}
        starts = np.cumsum([0.0, *(road.distance_m for road in roads[:-1])])
        line["position_m"] += np.repeat(starts, [len(road.position_m) for road in roads])
        return line

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values, as in the answers of the command line and the service.

        Returns
        -------
        dict
            Numbers, texts, lists and further dicts only.

        Examples
        --------
        >>> sorted(journey.charging.to_dict()["course"])  # doctest: +SKIP
        ['displayed_soc', 'high', 'low', 'position_m', 'time_s']
        """
        series = self.series()
        return {
            "label": self.label,
            "stops": [stop.to_dict() for stop in self.stops],
            **{name: getattr(self, name) for name in JOURNEY_FIELDS},
            "soc_interval": list(self.soc_interval),
            "energy_interval_wh": series[list(ENERGY_BAND)].iloc[-1].tolist(),
            "by_cause_wh": self.by_cause_wh,
            "battery_loss_wh": self.battery_loss_wh,
            "course": {name: series[column].tolist() for name, column in _COURSE.items()},
            "line": {name: np.round(self.line[name], k).tolist() for name, k in LINE_DIGITS.items()},
        }


def with_stops(difference: Difference, one: ChargingPlan, other: ChargingPlan) -> Difference:
    """Return the difference of two forecasts of one car with the time and energy of the stops to charge of each journey."""
    return replace(
        difference,
        energy_wh=one.energy_wh - other.energy_wh,
        duration_s=one.duration_s - other.duration_s,
        soc_arrival=one.soc_arrival - other.soc_arrival,
        by_cause_wh={cause: wh - other.by_cause_wh[cause] for cause, wh in one.by_cause_wh.items()},
    )
