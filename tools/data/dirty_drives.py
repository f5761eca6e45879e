"""Drives with a known truth, as loggers sample them: speed and power of the computed fleet, a way over the map, an odometer."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.units import SECONDS_PER_HOUR

FLEET: Final = (14, 11)
"""Number of trips and seed of the computed fleet that the drives are cut from."""

MIN_S, MAX_S, MIN_M = 240, 600, 1600.0
"""Bounds of a drive of a small folder: so long that it can be logged in two halves that are drives of their own."""

M_PER_DEGREE: Final = 6_371_008.8 * np.pi / 180.0
BATTERY_WH: Final = 60_000.0
UTC_OFFSET_S: Final = 3600.0
"""The clock of the files is ahead of UTC."""

DISPLAY_SHIFT: Final = 0.03
"""The display is so much above the battery management's state of charge."""

EPOCH: Final = dt.datetime(1970, 1, 1)

SIGNALS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "speed_m_s": "v",
        "voltage_v": "u",
        "current_a": "i",
        "battery_power_w": "p",
        "soc": "soc",
        "displayed_soc": "display",
        "elevation_m": "height",
        "ambient_temperature_degc": "ambient",
        "cabin_temperature_degc": "cabin",
        "battery_temperature_degc": "battery",
        "heating_power_w": "heating",
        "aircon_power_w": "aircon",
        "climate_power_w": "climate",
    }
)
"""Column of a `Segment` for each of our columns."""


@dataclass(frozen=True)
class TrueDrive:
    """A drive as it was.

    Attributes
    ----------
    file : str
        File with the drive's first row.
    departs_at : datetime or None
        Time of the first row by the file's own clock, without a zone; None where the files have no date.
    duration_s : float
        From the first to the last row.
    distance_m : float
        Integral of the speed over the logged times, by trapezoids.
    energy_wh : float
        Integral of the power at the battery over the logged times, by trapezoids.
    samples : DataFrame
        All logged rows before anything was made dirty or rounded: `time_s` from 0, and our columns that the files have.
    continues_in : str
        File with the rest of the drive, empty where there is none.
    """

    file: str
    departs_at: dt.datetime | None
    duration_s: float
    distance_m: float
    energy_wh: float
    samples: pd.DataFrame
    continues_in: str = ""


@dataclass(frozen=True)
class Truth:
    """What is in a dirty folder.

    Attributes
    ----------
    logger : str
        One of the formats.
    drives : tuple of TrueDrive
        Drives of more than a kilometre and two minutes that a careful person would keep, in their order.
    sound_rows : int
        Rows of these drives, in usable files, whose needed cells are good. A copy of a row or file does not count. In a
        long format all values of one time are one row.
    faults : tuple of str
        Kinds of dirt that were planted.
    bad_files : tuple of str
        Files that nobody can use.
    columns : mapping of str to tuple of str
        Our column -> name in the files (of a signal in a long format) and unit. Date and time in two columns are
        written with a plus: "Date+Time".
    also : mapping of str to tuple of tuple of str
        Other columns and units that are as right.
    standing_rows : int
        Sound rows before, between and after the drives, in usable files.
    current_positive : str
        "discharge" or "charge".
    time_format : str
        Format of the time stamps; empty where there are none.
    """

    logger: str
    drives: tuple[TrueDrive, ...]
    sound_rows: int
    faults: tuple[str, ...]
    bad_files: tuple[str, ...]
    columns: Mapping[str, tuple[str, str]]
    also: Mapping[str, tuple[tuple[str, str], ...]]
    standing_rows: int
    current_positive: str
    time_format: str


@dataclass(frozen=True)
class Segment:
    """Rows that belong together: a drive, or the car standing.

    Attributes
    ----------
    rows : DataFrame
        `t` [s] since 1970, `clock` the same by the logger's clock, and the columns of `SIGNALS`, position and odometer.
    drive : int
        Number of the drive, -1 for a car that stands.
    part : int
        1 for the rest of a drive that another file began.
    """

    rows: pd.DataFrame
    drive: int
    part: int = 0


@dataclass
class Car:
    """Where a car is between two drives: position, height, odometer, charge, weather."""

    latitude: float
    longitude: float
    odometer_km: float
    soc: float
    ambient_degc: float
    height_m: float = 520.0

    def drive(self, window: Window, start_s: float, times: FloatArray, bend: float) -> pd.DataFrame:
        """Rows of a drive at some times [s] since its start. O(seconds)."""
        second = np.arange(len(window.speed), dtype=np.float64)
        way = integral(second, window.speed)
        middle = 0.5 * (way[1:] + way[:-1])
        heading = bend + 0.8 * np.sin(middle / 600.0) + 0.4 * np.sin(middle / 250.0 + bend)
        step = np.diff(way) / M_PER_DEGREE
        north = self.latitude + np.append(0.0, np.cumsum(step * np.cos(heading)))
        narrow = np.cos(np.radians(0.5 * (north[1:] + north[:-1])))
        east = self.longitude + np.append(0.0, np.cumsum(step * np.sin(heading) / narrow))
        used = integral(second, window.voltage * window.current) / SECONDS_PER_HOUR / BATTERY_WH
        fine = {
            "v": window.speed, "u": window.voltage, "i": window.current, "height": window.height,
            "heating": window.heating, "aircon": window.aircon, "lat": north, "lon": east,
            "odometer": self.odometer_km + way / 1000.0, "soc": self.soc - used,
        }  # fmt: skip
        rows = pd.DataFrame({name: np.interp(times, second, values) for name, values in fine.items()})
        self.latitude, self.longitude = float(north[-1]), float(east[-1])
        self.height_m = float(window.height[-1])
        self.odometer_km, self.soc = float(fine["odometer"][-1]), float(fine["soc"][-1])
        return self._completed(rows, start_s + times)

    def stand(self, start_s: float, times: FloatArray, current_a: float) -> pd.DataFrame:
        """Rows of a car that stands; a negative current charges it. O(rows)."""
        zero = np.zeros(len(times))
        voltage = 375.0 - 0.1 * current_a
        rows = pd.DataFrame(
            {
                "v": zero, "u": zero + voltage, "i": zero + current_a, "height": zero + self.height_m, "heating": zero,
                "aircon": zero, "lat": zero + self.latitude, "lon": zero + self.longitude,
                "odometer": zero + self.odometer_km,
                "soc": self.soc - voltage * current_a * times / SECONDS_PER_HOUR / BATTERY_WH,
            }
        )  # fmt: skip
        self.soc = float(rows["soc"].iloc[-1])
        return self._completed(rows, start_s + times)

    def _completed(self, rows: pd.DataFrame, t: FloatArray) -> pd.DataFrame:
        return rows.assign(
            t=t,
            clock=t,
            epoch=t - UTC_OFFSET_S,
            p=rows["u"] * rows["i"],
            display=rows["soc"] + DISPLAY_SHIFT,
            ambient=self.ambient_degc,
            cabin=21.0,
            battery=self.ambient_degc * 0.5 + 10.0,
            climate=rows["heating"] + rows["aircon"],
        )


@dataclass(frozen=True)
class Window:
    """A piece of a computed trip at 1 Hz, from a standstill to a standstill."""

    speed: FloatArray
    voltage: FloatArray
    current: FloatArray
    height: FloatArray
    heating: FloatArray
    aircon: FloatArray

    @property
    def length_m(self) -> float:
        """Its length."""
        return float(integral(np.arange(float(len(self.speed))), self.speed)[-1])


def integral(time: FloatArray, values: FloatArray) -> FloatArray:
    """Running integral by trapezoids, 0 at first."""
    return np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time)))


@cache
def whole_trips() -> tuple[Window, ...]:
    """All trips of the computed fleet."""
    number, seed = FLEET
    names = ("speed_m_s", "voltage_v", "current_a", "elevation_m", "heating_power_w", "aircon_power_w")
    return tuple(
        Window(*(trip.samples[name].to_numpy(dtype=np.float64) for name in names))
        for trip in synthetic_fleet(number, seed).trips
    )


@cache
def windows(min_s: int = MIN_S, max_s: int = MAX_S, min_m: float = MIN_M) -> tuple[Window, ...]:
    """Pieces between two standstills of the computed fleet, of some duration and length."""
    starts = []
    for trip in whole_trips():
        way = integral(np.arange(float(len(trip.speed))), trip.speed)
        stops = np.flatnonzero(trip.speed < 0.1)
        stops = stops[np.append(True, np.diff(stops) > 1)]
        for a, b in ((a, b) for a in stops for b in stops if min_s <= b - a <= max_s):
            if way[b] - way[a] >= min_m:
                starts.append(Window(*(values[a : b + 1] for values in vars(trip).values())))
    return tuple(starts)


def sample_times(
    rng: np.random.Generator, duration_s: float, steps: Sequence[float], jitter_s: float = 0.0
) -> FloatArray:
    """Irregular times from 0 to about a duration: steps drawn from some, moved by up to a jitter."""
    number = int(duration_s / min(steps)) + 2
    times = np.append(0.0, np.cumsum(rng.choice(steps, number)))
    times[1:] += np.round(rng.uniform(-jitter_s, jitter_s, number), 3)
    return times[times <= duration_s]


def true_drive(
    files: Sequence[str], rows: pd.DataFrame, columns: Sequence[str], *, dated: bool = True
) -> TrueDrive:
    """Sum up a drive from its rows and the columns that the files have."""
    time = rows["t"].to_numpy() - float(rows["t"].iloc[0])
    ours = {name: rows[SIGNALS[name]].to_numpy() for name in columns if name in SIGNALS}
    departs = EPOCH + dt.timedelta(seconds=float(rows["clock"].iloc[0]))
    return TrueDrive(
        files[0],
        departs if dated else None,
        float(time[-1]),
        float(integral(time, rows["v"].to_numpy())[-1]),
        float(integral(time, rows["p"].to_numpy())[-1]) / SECONDS_PER_HOUR,
        pd.DataFrame({"time_s": time, **ours}),
        files[1] if len(files) > 1 else "",
    )
