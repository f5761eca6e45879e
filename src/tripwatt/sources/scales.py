"""Units that differ from those of a mapping, found from several files together.

The distance by positions or by the odometer shows the unit of speed; the temperature of the battery shows that of the air.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import or_none
from tripwatt.sources.columnar import TableFile
from tripwatt.sources.evidence import SPEED_UNITS
from tripwatt.sources.naming import unit_in, words

PLACES: Final = (
    re.compile(r"^(gps |v p |position )?(lat|latitude)\b"),
    re.compile(r"^(gps |v p |position )?(lon|lng|long|longitude)\b"),
)
ODOMETER: Final = re.compile(r"^(odo|odometer|mileage|kilometerstand|v p odometer)\b")
M_PER_DEGREE: Final = 111_195.0
MIN_M: Final = 2000.0
NEAR: Final = 0.15
"""Tolerance of the logarithm of a ratio of distances: units of speed differ by a factor of 1.6 or more, distances by a few percent."""


@dataclass(frozen=True, slots=True)
class Ways:
    """Distances [m] of one file by its speed in the assumed unit, and over the same samples by positions and by the odometer."""

    speed_at_positions: float = 0.0
    positions: float = 0.0
    speed_at_odometer: float = 0.0
    odometer: float = 0.0


def ways_of(table: TableFile, time_s: FloatArray, speed_m_s: FloatArray) -> Ways:
    """Distances of a file by speed, positions and odometer. O(samples).

    Parameters
    ----------
    table : TableFile
    time_s, speed_m_s : ndarray, shape (rows,)
        NaN = missing value.
    """
    step = np.diff(time_s)
    mean = 0.5 * (speed_m_s[1:] + speed_m_s[:-1])
    with np.errstate(invalid="ignore"):
        # 30.0: over a longer step the mean of two speeds is no measurement
        # 90.0: speeds above this, in the assumed unit, count as wrong cells and are not used
        use = (step > 0.0) & (step <= 30.0) & (mean < 90.0)
    place, counter = positions_of(table), _named(table, ODOMETER)
    odometer = None if counter is None else _degrees(table, counter)
    driven, on_map, counted, by_odometer = 0.0, 0.0, 0.0, 0.0
    if place is not None:
        latitude, longitude = place
        north = np.diff(latitude) * M_PER_DEGREE
        east = np.diff(longitude) * M_PER_DEGREE * np.cos(np.radians(latitude[1:]))
        with np.errstate(invalid="ignore"):
            # 3.0: below this speed the changes of position are mostly errors and are not used
            seen = use & (mean > 3.0) & np.isfinite(north) & np.isfinite(east)
        driven, on_map = float((mean * step)[seen].sum()), float(np.hypot(north, east)[seen].sum())
    if odometer is not None and use.any():
        to_m = 1609.344 if "mi" in (counter or "").lower() else 1000.0
        moved = np.diff(odometer)
        both = use & np.isfinite(moved) & (moved >= 0.0)
        counted, by_odometer = float((mean * step)[both].sum()), to_m * float(moved[both].sum())
    return Ways(driven, on_map, counted, by_odometer)


def positions_of(table: TableFile) -> tuple[FloatArray, FloatArray] | None:
    """Latitude and longitude of each row [°], NaN if missing; None if the file has no such columns."""
    names = [_named(table, form) for form in PLACES]
    latitude, longitude = (None if name is None else _degrees(table, name) for name in names)
    return None if latitude is None or longitude is None else (latitude, longitude)


def _named(table: TableFile, form: re.Pattern[str]) -> str | None:
    return next((name for name in table.names if form.search(words(name))), None)


def speed_unit_of(assumed: str, ways: Iterable[Ways]) -> str:
    """Unit of the speed in files by their distances; the assumed unit if the distances do not show another one.

    Examples
    --------
    >>> speed_unit_of("km/h", [Ways(10_000.0, 16_200.0)]), speed_unit_of("km/h", [])
    ('mph', 'km/h')
    """
    sums = np.array([(w.speed_at_positions, w.positions, w.speed_at_odometer, w.odometer) for w in ways])
    now = SPEED_UNITS.get({"kmh": "km/h", "kph": "km/h"}.get(assumed, assumed))
    if not len(sums) or now is None:
        return assumed
    total = sums.sum(axis=0)
    for by_speed, other, least in ((total[0], total[1], MIN_M), (total[2], total[3], 20_000.0)):
        if by_speed > 0.0 and other >= least:
            ratio = other / by_speed
            fitting = [u for u, factor in SPEED_UNITS.items() if abs(np.log(ratio * now / factor)) < NEAR]
            if fitting and abs(np.log(ratio)) >= NEAR:
                return fitting[0]
            return assumed
    return assumed


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
    if len(battery_degc) == len(air):
        battery = np.concatenate(battery_degc)
        both = known & np.isfinite(battery) & (np.abs(values) < 150.0)
        if both.any():
            as_c = float(np.median(np.abs(values[both] - battery[both])))
            as_f = float(np.median(np.abs((values[both] - 32.0) / 1.8 - battery[both])))
            if min(as_c, as_f) < 0.7 * max(as_c, as_f):  # else neither is clearly nearer
                now = "f" if as_f < as_c else "c"
                return assumed if assumed.endswith(now) else f"deg{now}"
            return assumed
    # 57.0: the highest air temperature on record is 56.7 °C (WMO, Furnace Creek 1913)
    hot = float(np.quantile(values[known], 0.98)) > 57.0
    return "degf" if hot and assumed.endswith("c") else assumed


def is_stated(ours: str, column: str) -> bool:
    """Whether the name of a column states its unit.

    Examples
    --------
    >>> is_stated("speed_m_s", "Speed (OBD)(km/h)"), is_stated("speed_m_s", "Speed")
    (True, False)
    """
    return unit_in(ours, column) is not None


def _degrees(table: TableFile, name: str) -> FloatArray | None:
    """A column of numbers, which may be written as degrees and minutes as in "48 12.345"; None if it cannot be read."""
    texts = or_none(table.texts, name)
    if texts is None:
        return None
    if not any(" " in text.strip() for text in texts[:50]):
        return table.numbers([name])[0]
    values = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        parts = text.replace(",", ".").split()
        try:
            values[i] = abs(float(parts[0])) + float(parts[1]) / 60.0 if len(parts) == 2 else float(text)
        except (ValueError, IndexError):
            continue
    return values
