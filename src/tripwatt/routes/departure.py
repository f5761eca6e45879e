"""What is known when the car leaves, and the trip without measurements that begins with it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from tripwatt.errors import Fault
from tripwatt.trips import COLUMNS, Context, FloatArray, Trip, raise_faults, table_of


@dataclass(frozen=True, slots=True)
class Departure:
    """What is known when the car leaves. None means unknown; the models then take their defaults.

    Attributes
    ----------
    ambient_temperature_degc, cabin_setpoint_degc : float or None
        They stay as they are along the whole trip.
    cabin_temperature_degc, battery_temperature_degc, soc, displayed_soc : float or None
        At departure only.
    context : Context
        Season, weather, payload and so on.
    """

    ambient_temperature_degc: float | None = None
    cabin_setpoint_degc: float | None = None
    cabin_temperature_degc: float | None = None
    battery_temperature_degc: float | None = None
    soc: float | None = None
    displayed_soc: float | None = None
    context: Context = field(default_factory=Context)

    def __post_init__(self) -> None:
        faults = []
        for name in (*_STAYS, *_AT_DEPARTURE):
            value, column = getattr(self, name), COLUMNS[name]
            if value is not None and not column.minimum <= value <= column.maximum:
                allowed = f"{column.minimum:g} to {column.maximum:g} {column.unit}"
                faults.append(Fault("value out of range", name, f"{value}", allowed))
        raise_faults(faults)


_STAYS: Final = ("ambient_temperature_degc", "cabin_setpoint_degc")
_AT_DEPARTURE: Final = ("cabin_temperature_degc", "battery_temperature_degc", "soc", "displayed_soc")


def departure_of(trip: Trip) -> Departure:
    """What the first sample of a driven trip and its context say, the rest unknown.

    Examples
    --------
    >>> import pandas as pd
    >>> log = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0], "soc": [0.7, 0.6]})
    >>> departure_of(Trip.from_samples("t", log)).soc
    0.7
    """
    values: dict[str, float] = {}
    for name in (*_STAYS, *_AT_DEPARTURE):
        value = float(trip.array(name)[0]) if name in trip else math.nan
        if math.isfinite(value):
            values[name] = value
    return Departure(**values, context=trip.context)


def planned_trip(
    trip_id: str, profile: Mapping[str, FloatArray], departure: Departure, notes: Iterable[str]
) -> Trip:
    """A trip without measurements: a profile, what is known at departure, and in its context what was assumed."""
    columns = dict(profile)
    for name in (*_STAYS, *_AT_DEPARTURE):
        value = getattr(departure, name)
        if value is not None:
            columns[name] = np.full(len(columns["time_s"]), float(value))
            if name in _AT_DEPARTURE:
                columns[name][1:] = np.nan  # nobody measures it on the way
    said = "; ".join(dict.fromkeys((*filter(None, (departure.context.notes,)), *notes)))
    return Trip.from_samples(trip_id, table_of(columns), replace(departure.context, notes=said))
