"""What is known when the car leaves: one class for options of a command, a log's first sample and a request's fields."""

from __future__ import annotations

import datetime as dt
import difflib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, excerpt
from tripwatt.trips.context import Context
from tripwatt.trips.drive import Drive
from tripwatt.trips.schema import COLUMNS, DEPARTURE_BOUNDS, raise_faults, scalar_faults
from tripwatt.trips.showing import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SIGNALS: Final[Mapping[str, str]] = {
    "ambient_temperature_degc": "ambient_temperature_degc",
    "cabin_temperature_degc": "cabin_temperature_degc",
    "cabin_setpoint_degc": "cabin_setpoint_degc",
    "battery_temperature_degc": "battery_temperature_degc",
    "bms_soc": "soc",
    "soc": "displayed_soc",
}
"""Field of a departure -> the column of a log whose first sample it is. A log's `soc` is the battery management's."""

TEMPERATURES: Final = (
    "ambient_temperature_degc",
    "cabin_temperature_degc",
    "cabin_setpoint_degc",
    "battery_temperature_degc",
)
"""Fields that the correctors learn from, and that a forecast compares with its training."""

FIRST_S: Final = 60.0
"""A signal that is logged within this time counts as that of the departure: loggers start one after the other."""

CLIMATE_MODES: Final = ("auto", "off", "heat", "cool")
"""What the driver allows climate control: all, nothing, no compressor for cooling, or no heater."""

SEASONS: Final = ("summer", "winter")
"""Seasons of a drive."""

EXTRAS: Final = ("winter_tyres", "roof_box", "trailer", "headlights")
"""What can be fitted to the car or switched on for a trip."""

TERRAINS: Final = ("unknown", "flat", "hilly", "mountains")
"""What is known of the country where the heights of a road are unknown."""

ASKED: Final = ("soc", *TEMPERATURES, "payload_mass_kg", "climate", "extras", "terrain")
"""Fields that a person gives: options of the command line, fields of a request."""


def climate_faults(mode: object) -> list[Fault]:
    """The fault of a climate mode that is none of `CLIMATE_MODES`; None is unknown and no fault."""
    return choice_faults("climate", mode, CLIMATE_MODES, "unknown mode")


def choice_faults(
    name: str, value: object, choices: tuple[str, ...], what: str = "unknown choice"
) -> list[Fault]:
    """The fault of a value that is none of some words; None is unknown and no fault."""
    if value is None or (isinstance(value, str) and value in choices):
        return []
    near = difflib.get_close_matches(value[:40], choices, n=1) if isinstance(value, str) else []
    fix = f"did you mean {near[0]!r}?" if near else ""
    return [Fault(what, name, excerpt(value, 42), f"one of {', '.join(choices)}", fix)]


def type_faults(departure: Departure) -> list[Fault]:
    """The faults of the fields of a departure that are neither numbers nor words of a list."""
    kinds: dict[str, tuple[tuple[type, ...], str]] = {
        "weather": ((str,), "a text"),
        "follows_trip": ((bool, np.bool_), "True or False"),
        "cabin_logged": ((bool, np.bool_), "True or False"),
        "started_at": ((dt.datetime,), "a datetime, for example datetime.datetime(2024, 1, 5, 8, 30)"),
    }
    given = {name: getattr(departure, name) for name in kinds}
    return [
        Fault("wrong type", name, excerpt(value), kinds[name][1])
        for name, value in given.items()
        if value is not None and (not isinstance(value, kinds[name][0]) or value is pd.NaT)
    ]


def extras_faults(extras: object) -> list[Fault]:
    """The fault of extras that are none of `EXTRAS`; None is nothing fitted and no fault."""
    if extras is None:
        return []
    known = isinstance(extras, tuple | list) and all(isinstance(e, str) and e in EXTRAS for e in extras)
    return [] if known else [Fault("unknown extra", "extras", repr(extras)[:60], ", ".join(EXTRAS))]


@dataclass(frozen=True, slots=True, repr=False)
class Departure:
    """What is known when the car leaves. None means unknown; the models then take their defaults.

    Attributes
    ----------
    soc : float or None
        State of charge as the driver sees it, 0 to 1.
    ambient_temperature_degc, cabin_setpoint_degc, cabin_temperature_degc, battery_temperature_degc : float or None
        Temperatures [°C]; outside air and set-point hold for the whole trip, the others for its start.
    payload_mass_kg : float or None
        Load besides the driver [kg].
    bms_soc : float or None
        State of charge of the battery management, 0 to 1; it counts before `soc` where a log has both.
    season : {"summer", "winter"} or None
        Season of the drive.
    weather : str or None
        Words of the data set for it, in lower case.
    follows_trip : bool or None
        Whether the car comes directly from another trip: tyres and driveline are warm.
    started_at : datetime or None
        Local time of departure.
    climate : {"auto", "off", "heat", "cool"} or None
        What the driver allows climate control: "heat" never cools with the compressor, "cool" never heats. None is "auto".
    extras : tuple of str or None
        What is fitted to the car, of `EXTRAS`.
    terrain : {"unknown", "flat", "hilly", "mountains"} or None
        Country of a road whose heights are unknown: how far it may climb. None is "unknown"; without effect where heights are known.
    cabin_logged : bool or None
        Whether the cabin's temperature is a reading of the car's sensor, which shows nothing below the lower end of its range.

    Raises
    ------
    InvalidInput
        With every value of another type, out of its bounds, or of no known choice.

    Examples
    --------
    >>> Departure(soc=0.8, ambient_temperature_degc=-5)
    Departure(soc=0.8, ambient_temperature_degc=-5)
    """

    soc: float | None = None
    ambient_temperature_degc: float | None = None
    cabin_setpoint_degc: float | None = None
    cabin_temperature_degc: float | None = None
    battery_temperature_degc: float | None = None
    payload_mass_kg: float | None = None
    bms_soc: float | None = None
    season: str | None = None
    weather: str | None = None
    follows_trip: bool | None = None
    started_at: dt.datetime | None = None
    climate: str | None = None
    extras: tuple[str, ...] | None = None
    terrain: str | None = None
    cabin_logged: bool | None = None

    def __post_init__(self) -> None:
        numbers = {name: getattr(self, name) for name in ("soc", *TEMPERATURES, "payload_mass_kg")}
        faults = [*scalar_faults(numbers), *climate_faults(self.climate)]
        faults += [*scalar_faults({"soc": self.bms_soc}), *choice_faults("season", self.season, SEASONS)]
        faults += choice_faults("terrain", self.terrain, TERRAINS)
        raise_faults([*faults, *type_faults(self), *extras_faults(self.extras)])
        if self.extras is not None:
            object.__setattr__(self, "extras", tuple(self.extras))

    @classmethod
    def from_drive(cls, drive: Drive, context: Context) -> Departure:
        """The departure of a drive, from its first sample and its context.

        A signal that the first sample lacks is that of the next one within `FIRST_S`, else it is unknown. An outside
        temperature that only a sensor in the sun can show is unknown.

        Parameters
        ----------
        drive : Drive
            Its first sample counts.
        context : Context
            What the log says beside its samples: season, weather, payload, the trip before.

        Returns
        -------
        Departure
            Fields that neither has are None.

        Raises
        ------
        InvalidInput
            When a value of the first sample is out of its bounds.

        Examples
        --------
        >>> import pandas as pd
        >>> from tripwatt import Departure, Trip
        >>> from tripwatt.trips import Context
        >>> log = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0], "ambient_temperature_degc": [7.0, 7.5]})
        >>> Departure.from_drive(Trip.from_samples("t", log), Context(payload_mass_kg=80.0))
        Departure(ambient_temperature_degc=7.0, payload_mass_kg=80.0, follows_trip=False)
        """
        first: dict[str, Any] = {}
        times = drive.array("time_s")
        for name, column in SIGNALS.items():
            if column in drive:
                values = drive.array(column)
                known = np.flatnonzero(np.isfinite(values))
                if len(known) and times[known[0]] - times[0] <= FIRST_S:
                    value = float(values[known[0]])
                    bounds = DEPARTURE_BOUNDS.get(name)
                    if bounds is None or not bounds.maximum < value <= COLUMNS[column].maximum:
                        first[name] = value
        if "cabin_setpoint_degc" not in first and context.cabin_setpoint_degc is not None:
            first["cabin_setpoint_degc"] = context.cabin_setpoint_degc
        return cls(
            **first,
            payload_mass_kg=context.payload_mass_kg,
            season=context.season,
            weather=context.weather,
            follows_trip=context.follows_trip,
            started_at=context.started_at,
            cabin_logged=True if "cabin_temperature_degc" in first else None,
        )

    def merge(self, other: Departure | None) -> Departure:
        """The departure with the known fields of another in place of its own.

        A state of charge that a driver gives takes the place of the battery management's reading, a cabin temperature that of
        the sensor's.

        Parameters
        ----------
        other : Departure or None
            None changes nothing.

        Returns
        -------
        Departure
            A new one.

        Examples
        --------
        >>> Departure(bms_soc=0.6, payload_mass_kg=80.0).merge(Departure(soc=0.8))
        Departure(soc=0.8, payload_mass_kg=80.0)
        """
        if other is None:
            return self
        known: dict[str, Any] = other.to_dict()
        if "started_at" in known:
            known["started_at"] = other.started_at
        if other.soc is not None and other.bms_soc is None:
            known["bms_soc"] = None
        if other.cabin_temperature_degc is not None:
            known["cabin_logged"] = other.cabin_logged
        return replace(self, **known)

    def to_dict(self) -> dict[str, Any]:
        """The fields that are known; the time of departure as ISO 8601.

        Returns
        -------
        dict
            Field -> value.

        Examples
        --------
        >>> from tripwatt import Departure
        >>> Departure(soc=0.8, payload_mass_kg=80.0).to_dict()
        {'soc': 0.8, 'payload_mass_kg': 80.0}
        """
        known = {
            field.name: value for field in fields(self) if (value := getattr(self, field.name)) is not None
        }
        if self.started_at is not None:
            known["started_at"] = self.started_at.isoformat()
        return known

    def to_frame(self) -> pd.DataFrame:
        """One row; a column for each field, missing where unknown.

        Returns
        -------
        DataFrame
            Of one row.

        Examples
        --------
        >>> from tripwatt import Departure
        >>> Departure(soc=0.8).to_frame()["soc"].tolist()
        [0.8]
        """
        return pd.DataFrame([asdict(self)], columns=[field.name for field in fields(self)])

    def plot(self) -> Figure:
        """The fields that are known, as a table.

        Returns
        -------
        matplotlib.figure.Figure
            A table without axes.

        Examples
        --------
        >>> from tripwatt import Departure
        >>> Departure(soc=0.8).plot().savefig("departure.png")  # doctest: +SKIP
        """
        from tripwatt.trips.plots import plot_table  # matplotlib is slow to import

        return plot_table("Departure", [(name, str(value)) for name, value in self.to_dict().items()])

    def __repr__(self) -> str:
        known = ((field.name, getattr(self, field.name)) for field in fields(self))
        return f"Departure({', '.join(f'{name}={value!r}' for name, value in known if value is not None)})"

    def _repr_html_(self) -> str:
        return html_table("Departure", [(name, str(value)) for name, value in self.to_dict().items()])
