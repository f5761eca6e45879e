"""Usable energy of the batteries of a fleet, until when a route is possible with them, and what that means for a warranty.

The displayed charge that an energy takes (`display_trips`) gives the capacity of a vehicle and its loss a year, both together with those of
its car model. The capacity goes on linearly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.special import ndtr

from tripwatt.arrays import FloatArray
from tripwatt.errors import or_none
from tripwatt.fleet import Warranty
from tripwatt.fleet.changes import BATTERY, display_trips, last_changes
from tripwatt.fleet.mapping import load_car
from tripwatt.fleet.statistics import TripRows
from tripwatt.physics.battery import usable_energy_wh
from tripwatt.uncertainty.charge import CAPACITY_SD

AHEAD: Final = np.arange(121) / 12.0
"""Months ahead in which an end is looked for [years]: ten years, a choice, because a linear loss says nothing beyond."""
_YEAR: Final = np.timedelta64(365, "D")


@dataclass(frozen=True, eq=False)
class Fade:
    """Capacity of the battery of a vehicle over time, as a share of the usual one of its car model.

    Attributes
    ----------
    begins : datetime64[D]
        First day of the fleet's trips, from which years count.
    now : float
        Last day of the fleet's trips [years].
    taken, covariance : ndarray, shape (2,) and (2, 2)
        More displayed charge for an energy than usual for the car model at the beginning [1], and its rise a year.
    car_model : str
    usual_wh : float
        Usual energy of the full display of the car model [Wh].
    """

    begins: np.datetime64
    now: float
    taken: FloatArray
    covariance: FloatArray
    car_model: str = ""
    usual_wh: float = 1.0

    def capacity(self, years: Any) -> tuple[Any, Any]:
        """Return the capacity [1] at a time, and its standard deviation; it is linear through the middle of the trips."""
        years = np.asarray(years, dtype=np.float64)
        middle = 1.0 + float(self.taken @ [1.0, self.now / 2.0])
        x = np.stack([np.ones_like(years), years], axis=-1) / middle**2
        mean = 1.0 / middle - self.taken[1] * (years - self.now / 2.0) / middle**2
        return mean, np.sqrt(np.einsum("...p,pq,...q", x, self.covariance, x))

    def chance_below(self, level: float, years: Any, sd: float = 0.0) -> Any:
        """Return the chance that the capacity is below a level, known to a standard deviation, at a time."""
        mean, own_sd = self.capacity(years)
        return ndtr((level - mean) / np.hypot(own_sd, sd))

    def falls_below(self, level: float, sd: float = 0.0) -> dict[str, str | None]:
        """Return the `month` in which the capacity falls below a level, and its 95 % interval; None if not within ten years."""
        chance = np.maximum.accumulate(np.nan_to_num(self.chance_below(level, self.now + AHEAD, sd)))
        ends = np.searchsorted(chance, (0.5, 0.025, 0.975)).tolist()
        months = [self.month(self.now + AHEAD[k]) if k < len(AHEAD) else None for k in ends]
        return dict(zip(("month", "earliest", "latest"), months, strict=True))

    def month(self, years: float) -> str:
        """Return the month of a time, such as 2026-01."""
        return f"{self.begins + np.timedelta64(round(365.0 * years), 'D')}"[:7]


def fades(rows: TripRows, changed: pd.DataFrame) -> dict[str, Fade]:
    """Estimate the fade of each vehicle with readings of its display, from its trips since its last change of the battery.

    Parameters
    ----------
    rows : TripRows
    changed : DataFrame
        Result of `changes`.
    """
    since = last_changes(rows, changed[changed["cause"] == BATTERY])
    # a comparison with an unknown time is false
    display = display_trips(rows.where(~(rows.chronological[1] < since)))
    if display is None:
        return {}
    now = float((np.nanmax(rows.chronological[1]) - display.begins) / _YEAR)
    estimates = {}
    for model, vehicle in sorted(set(display.groups)):
        mean, covariance = display.posterior.weights(model, vehicle)
        taken, of_taken = mean[[0, 2]], covariance[np.ix_([0, 2], [0, 2])]
        estimates[vehicle] = Fade(display.begins, now, taken, of_taken, model, float(display.full_wh[model]))
    return estimates


def battery_table(
    known: Mapping[str, Fade], rows: TripRows, warranty: Warranty, new_at: Mapping[str, str]
) -> pd.DataFrame:
    """Tabulate the batteries of vehicles, those that most probably fall below the warranty first.

    Parameters
    ----------
    known : mapping of str to Fade
    rows : TripRows
    warranty : Warranty
    new_at : mapping of str to str
        First day of a vehicle, at which its odometer was 0; else that of its first trip. Its kilometres a year are those of its trips.

    Returns
    -------
    DataFrame
        `vehicle_id`, `car_model`; `usable_wh` and `usable_sd_wh` of the full display at the end of the trips [Wh]; `loss` a year [1] and `loss_sd`; `share` of
        the published usable energy of a new battery [1] and `share_sd`; `warranty_until`, and `below`: chance that the share is below the
        warranty's then; `month`, `earliest`, `latest`: when it falls below, from `Fade.falls_below`. The columns from `share` on are unknown for a car model without
        figures.
    """
    trips = pd.DataFrame({"km": rows.numbers("distance_m") / 1000.0, "day": rows.chronological[1]})
    driven = trips.groupby(rows.texts("vehicle_id")).agg({"km": "sum", "day": "min"})
    table = []
    for vehicle, fade in known.items():
        (capacity, sd), first = fade.capacity(fade.now), driven["day"][vehicle]
        days = np.array([first, new_at.get(vehicle, first)], "datetime64[D]")
        begins, start = ((days - fade.begins) / _YEAR).tolist()
        per_year = max(float(driven["km"][vehicle]), 1.0) / max(fade.now - begins, 1.0 / 12.0)
        month = days[1].astype("datetime64[M]")
        oldest = month + round(12.0 * warranty.years) + (days[1] - month)
        until = min(float((oldest - fade.begins) / _YEAR), start + warranty.km / per_year)
        new = _new_wh(fade.car_model) / fade.usual_wh
        level, level_sd = warranty.share * new, warranty.share * new * CAPACITY_SD
        table.append({
            "vehicle_id": vehicle, "car_model": fade.car_model,
            "usable_wh": fade.usual_wh * capacity, "usable_sd_wh": fade.usual_wh * sd,
            "loss": fade.taken[1] / capacity, "loss_sd": np.sqrt(fade.covariance[1, 1]),
            "share": capacity / new, "share_sd": np.hypot(sd / new, CAPACITY_SD),
            "warranty_until": fade.month(until), "below": fade.chance_below(level, until, level_sd),
            **fade.falls_below(level, level_sd),
        })  # fmt: skip
    return pd.DataFrame(table).sort_values("below", ascending=False, ignore_index=True)


def _new_wh(car_model: str) -> float:
    """Return the published usable energy of a car model [Wh]; NaN if it has no figures."""
    published_wh = or_none(lambda: usable_energy_wh(load_car(car_model).battery))
    return np.nan if published_wh is None else published_wh


def route_ends(
    known: Mapping[str, Fade], needs: Iterable[tuple[str, str, float]], reserve: float
) -> pd.DataFrame:
    """Tabulate when the routes of vehicles stop being possible with one charge.

    Parameters
    ----------
    known : mapping of str to Fade
    needs : iterable of (str, str, float)
        Vehicle, route, and displayed charge to leave with in a battery of the usual capacity of the car model.
    reserve : float
        Displayed charge to come back with, part of this charge.

    Returns
    -------
    DataFrame
        The first routes first: `vehicle_id`, `trip`; `soc_needed` with the vehicle's battery at the end of the trips; `month`, `earliest`,
        `latest`: when a full battery is no longer enough, from `Fade.falls_below`.
    """
    table = []
    for vehicle, trip, need in dict.fromkeys(needs):
        fade, taken = known[vehicle], need - reserve
        soc_needed = reserve + taken / fade.capacity(fade.now)[0]
        row = {"vehicle_id": vehicle, "trip": trip, "soc_needed": soc_needed}
        table.append(row | fade.falls_below(taken / (1.0 - reserve)))
    return pd.DataFrame(table).sort_values("month", kind="stable", ignore_index=True)
