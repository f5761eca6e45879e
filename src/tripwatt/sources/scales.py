"""Units that differ from those of a mapping, found from several files together.

The distance by positions or by the odometer shows the unit of speed; the temperature of the battery shows that of the air.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, number_in
from tripwatt.errors import or_none
from tripwatt.sources.columnar import TableFile
from tripwatt.sources.evidence import SPEED_UNITS
from tripwatt.sources.naming import words
from tripwatt.units import M_PER_MILE

PLACES: Final = (
    re.compile(r"^(gps |v p |position )?(lat|latitude)\b"),
    re.compile(r"^(gps |v p |position )?(lon|lng|long|longitude)\b"),
)
ODOMETER: Final = re.compile(r"^(odo|odometer|mileage|kilometerstand|v p odometer)\b")
M_PER_DEGREE: Final = 111_195.0
MIN_M: Final = 2000.0
NEAR: Final = 0.15
"""Tolerance of the logarithm of a ratio of distances: units of speed differ by a factor of 1.6 or more, distances by a few percent."""


class Distances(NamedTuple):
    """Distances [m] of one file by its speed in the assumed unit, and over the same samples by positions and by the odometer."""

    speed_at_positions: float = 0.0
    positions: float = 0.0
    speed_at_odometer: float = 0.0
    odometer: float = 0.0


def distances_of(table: TableFile, time_s: FloatArray, speed_m_s: FloatArray) -> Distances:
    """Distances of a file by speed, positions and odometer. O(samples).

    Parameters
    ----------
    table : TableFile
    time_s, speed_m_s : ndarray, shape (rows,)
        NaN = missing value.
    """
    step = np.diff(time_s)
    mean = 0.5 * (speed_m_s[1:] + speed_m_s[:-1])
    # 30.0: over a longer step the mean of two speeds is no measurement
    # 90.0: speeds above this, in the assumed unit, count as wrong cells and are not used
    use = (step > 0.0) & (step <= 30.0) & (mean < 90.0)

    def compare(moved: FloatArray, use: BoolArray) -> tuple[float, float]:
        rows = use & np.isfinite(moved) & (moved >= 0.0)
        return float((mean * step)[rows].sum()), float(moved[rows].sum())

    speed_and_positions = speed_and_odometer = (0.0, 0.0)
    place, counter = positions_of(table), _named(table, ODOMETER)
    odometer = None if counter is None else _numbers_of(table, counter)
    if place is not None:
        latitude, longitude = place
        north = np.diff(latitude) * M_PER_DEGREE
        east = np.diff(longitude) * M_PER_DEGREE * np.cos(np.radians(latitude[1:]))
        # 3.0: below this speed the changes of position are mostly errors and are not used
        speed_and_positions = compare(np.hypot(north, east), use & (mean > 3.0))
    if odometer is not None:
        to_m = M_PER_MILE if "mi" in (counter or "").lower() else 1000.0
        speed_and_odometer = compare(to_m * np.diff(odometer), use)
    return Distances(*speed_and_positions, *speed_and_odometer)


def positions_of(table: TableFile) -> tuple[FloatArray, FloatArray] | None:
    """Latitude and longitude of each row [°], NaN if missing; None if the file has no such columns."""
    names = [_named(table, form) for form in PLACES]
    latitude, longitude = (None if name is None else _numbers_of(table, name) for name in names)
    return None if latitude is None or longitude is None else (latitude, longitude)


def _named(table: TableFile, form: re.Pattern[str]) -> str | None:
    return next((name for name in table.names if form.search(words(name))), None)


def speed_unit_of(assumed: str, distances: Iterable[Distances]) -> str:
    """Unit of the speed in files by their distances; the assumed unit if the distances do not show another one.

    Examples
    --------
    >>> speed_unit_of("km/h", [Distances(10_000.0, 16_200.0)]), speed_unit_of("km/h", [])
    ('mph', 'km/h')
    """
    total = Distances(*np.sum([Distances(), *distances], axis=0))
    # by positions, or else by the odometer, which counts whole kilometres
    pairs = (
        (total.positions, total.speed_at_positions, MIN_M),
        (total.odometer, total.speed_at_odometer, 20_000.0),
    )
    ratio = next(
        (moved / by_speed for moved, by_speed, min_m in pairs if by_speed > 0.0 and moved >= min_m), 1.0
    )
    factor = SPEED_UNITS.get({"kmh": "km/h", "kph": "km/h"}.get(assumed, assumed))
    if factor is None or abs(np.log(ratio)) < NEAR:
        return assumed
    true = ratio * factor
    return next((unit for unit, other in SPEED_UNITS.items() if abs(np.log(true / other)) < NEAR), assumed)


def air_unit_of(assumed: str, air: Sequence[FloatArray], battery_degc: Sequence[FloatArray]) -> str:
    """Unit of the outside temperature in files: the one in which it is nearer to the battery temperature.

    Without a battery temperature, values that are too hot for air in °C are taken to be in °F.

    Examples
    --------
    >>> air_unit_of("degc", [np.array([68.0, 50.0])], [np.array([22.0, 15.0])]), air_unit_of("degc", [np.array([21.0])], [])
    ('degf', 'degc')
    """
    values = np.concatenate([*air, np.zeros(0)])
    known = np.isfinite(values)
    if assumed not in ("degc", "degf", "c", "f", "°c", "°f") or not known.any():
        return assumed
    battery = np.concatenate(battery_degc) if len(battery_degc) == len(air) else np.full(len(values), np.nan)
    comparable = known & np.isfinite(battery) & (np.abs(values) < 150.0)
    if comparable.any():
        as_c = float(np.median(np.abs(values[comparable] - battery[comparable])))
        as_f = float(np.median(np.abs((values[comparable] - 32.0) / 1.8 - battery[comparable])))
        is_clear = min(as_c, as_f) < 0.7 * max(as_c, as_f)
        unit = "f" if as_f < as_c else "c"
        return f"deg{unit}" if is_clear and not assumed.endswith(unit) else assumed
    # 57.0: the highest air temperature on record is 56.7 °C (WMO, Furnace Creek 1913)
    hot = float(np.quantile(values[known], 0.98)) > 57.0
    return "degf" if hot and assumed.endswith("c") else assumed


def _numbers_of(table: TableFile, name: str) -> FloatArray | None:
    """A column of numbers, which may be written as degrees and minutes as in "48 12.345"; None if it cannot be read."""
    texts = or_none(table.texts, name)
    if texts is None:
        return None
    if not any(" " in text.strip() for text in texts[:50]):
        return table.numbers([name])[0]
    values = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        parts = text.replace(",", ".").split()
        has_minutes = len(parts) == 2
        values[i] = abs(number_in(parts[0])) + number_in(parts[1]) / 60.0 if has_minutes else number_in(text)
    return values
