"""Departure: what is known when the car leaves, with one table of fields for command line, service, web page and docs."""

from __future__ import annotations

import datetime as dt
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from inspect import signature
from typing import TYPE_CHECKING, Any, Final

from tripwatt.errors import Fault, require_type
from tripwatt.files import shipped_toml
from tripwatt.trips.columns import COLUMNS, DEPARTURE_BOUNDS, raise_faults
from tripwatt.trips.fields import Field

if TYPE_CHECKING:
    import pandas as pd

    from tripwatt.trips.samples import Sampled


SIGNALS: Final[Mapping[str, str]] = {
    "ambient_temperature_degc": "ambient_temperature_degc",
    "cabin_temperature_degc": "cabin_temperature_degc",
    "cabin_setpoint_degc": "cabin_setpoint_degc",
    "battery_temperature_degc": "battery_temperature_degc",
    "bms_soc": "soc",
    "soc": "displayed_soc",
}
"""Field of a departure -> the column of a log whose first value it takes. The column `soc` is that of the battery management."""

TEMPERATURES: Final = tuple(name for name in SIGNALS if name.endswith("_degc"))
"""Temperatures among the fields; they are features of the correctors, and a forecast compares them with its training."""

FIRST_S: Final = 60.0
"""Time after the first sample [s] within which a value counts as that of the departure: signals do not start all at once."""

WEATHER: Final = ("wind_speed_m_s", "wind_from_deg", "rain_mm_h", "pressure_pa")
"""Fields of the weather; if one is known, the weather of a server is not used."""


@dataclass(frozen=True, slots=True)
class Context:
    """What is known of a drive as a whole. None means unknown, never zero.

    Attributes
    ----------
    season : {"summer", "winter"} or None
        Season of the drive.
    weather : str or None
        Weather in the words of the data set, in lower case.
    started_at : datetime or None
        Local time of departure; leave-one-day-out groups trips by its date.
    route : str or None
        Kind of road in the words of the source, in lower case.
    cabin_setpoint_degc : float or None
        Set-point of the cabin at departure [°C].
    payload_mass_kg : float
        Load on top of the vehicle's test mass [kg].
    follows_trip : bool
        Whether the log states that the trip directly follows another one.
    remarks : str
        Free text from the source.
    car : str or None
        Name of the car, if the data set has several cars; None otherwise.
    driver : str or None
        Name of the driver; None if the source has none.

    Examples
    --------
    >>> context = Context(season="winter", payload_mass_kg=80.0)
    >>> context.payload_mass_kg, context.driver is None
    (80.0, True)
    """

    season: str | None = None
    weather: str | None = None
    started_at: dt.datetime | None = None
    route: str | None = None
    cabin_setpoint_degc: float | None = None
    payload_mass_kg: float = 0.0
    follows_trip: bool = False
    remarks: str = ""
    car: str | None = None
    driver: str | None = None

    @property
    def day(self) -> dt.date | None:
        """Date of departure, None when unknown."""
        return None if self.started_at is None else self.started_at.date()


@dataclass(frozen=True, slots=True, repr=False)
class Departure:
    """What is known when the car leaves. None means unknown; the models then use defaults.

    The fields come from a table that also defines their checks, the options of the command line, the fields of requests with
    their schema, and the table of the docs. State of charge and the temperatures of cabin and battery are those at the start; the
    other fields hold for the whole trip.

    Attributes
    ----------
    {fields}

    Raises
    ------
    InvalidInput
        With every field that there is not, and every value that has a wrong type, is out of bounds, or is an unknown choice.

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
    departs_at: dt.datetime | None = None
    climate: str | None = None
    extras: tuple[str, ...] | None = None
    terrain: str | None = None
    cabin_logged: bool | None = None
    warmth: float | None = None
    wind_speed_m_s: float | None = None
    wind_from_deg: float | None = None
    rain_mm_h: float | None = None
    pressure_pa: float | None = None
    tyre_pressure: float | None = None
    covariates: Mapping[str, float | str] | None = None

    def __new__(cls, *_: Any, **given: Any) -> Departure:
        """Refuse unknown fields with the names of the known ones, which a TypeError would not list."""
        unknown = given.keys() - FIELDS.keys()
        raise_faults(Fault.unknown("unknown field", "Departure", name, FIELDS) for name in sorted(unknown))
        return object.__new__(cls)

    def __post_init__(self) -> None:
        raise_faults(fault for name, value in self._known() for fault in FIELDS[name].faults(name, value))
        if self.covariates is not None:
            object.__setattr__(self, "covariates", dict(self.covariates))
        if self.extras is not None:
            object.__setattr__(self, "extras", tuple(self.extras))

    @property
    def has_weather(self) -> bool:
        """Whether wind, rain or air pressure is known; the weather of a server is then not used."""
        return any(getattr(self, name) is not None for name in WEATHER)

    def without_weather(self) -> Departure:
        """Return the departure without wind, rain and air pressure.

        Returns
        -------
        Departure
            A copy that still has the outside temperature.

        Examples
        --------
        >>> Departure(soc=0.8, wind_speed_m_s=8.0).without_weather()
        Departure(soc=0.8)
        """
        return replace(self, **dict.fromkeys(WEATHER))

    @classmethod
    def from_first_sample(cls, samples: Sampled, context: Context) -> Departure:
        """Make the departure of a recorded drive from its first sample and its context.

        If the first sample lacks a signal, the first value within `FIRST_S` is used; without one the signal is unknown. A value
        above the bounds for a person's input, as from a temperature sensor in the sun, is unknown. A column that is no signal is a
        covariate, an input that a plan knows, as it knows the speeds of its road: its mean over the drive counts, or its most frequent
        word.

        Parameters
        ----------
        samples : Sampled
            The drive, of which only the first values and the covariates are used.
        context : Context
            What the log has beside its samples: season, weather, payload, the trip before.

        Returns
        -------
        Departure
            Fields that are in neither samples nor context are None.

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
        >>> Departure.from_first_sample(Trip.from_samples("t", log), Context(payload_mass_kg=80.0))
        Departure(ambient_temperature_degc=7.0, payload_mass_kg=80.0, follows_trip=False)
        """
        first: dict[str, Any] = {}
        for name, column in SIGNALS.items():
            value = _first_value(samples, column)
            highest = DEPARTURE_BOUNDS.get(name, COLUMNS[column]).maximum
            if value is not None and not highest < value <= COLUMNS[column].maximum:
                first[name] = value
        first.setdefault("cabin_setpoint_degc", context.cabin_setpoint_degc)
        others = [name for name in samples.samples if name not in (*COLUMNS, "observed_energy_wh")]
        known = {name: values for name in others if len(values := samples.samples[name].dropna())}
        first["covariates"] = {f"{name}": _typical(values) for name, values in known.items()} or None
        same = ("payload_mass_kg", "season", "weather", "follows_trip")
        first |= {"departs_at": context.started_at} | {name: getattr(context, name) for name in same}
        return cls(**first, cabin_logged=True if "cabin_temperature_degc" in first else None)

    def merge(self, other: Departure | None) -> Departure:
        """Return the departure with its fields replaced by the known fields of another departure.

        A displayed state of charge also replaces the reading of the battery management. A cabin temperature also replaces the
        information whether it was logged.

        Parameters
        ----------
        other : Departure or None
            The other departure; None changes nothing.

        Returns
        -------
        Departure
            A changed copy.

        Examples
        --------
        >>> Departure(bms_soc=0.6, payload_mass_kg=80.0).merge(Departure(soc=0.8))
        Departure(soc=0.8, payload_mass_kg=80.0)
        """
        if other is None:
            return self
        known = dict(other._known())
        if self.covariates and other.covariates:
            known["covariates"] = {**self.covariates, **other.covariates}
        if other.soc is not None and other.bms_soc is None:
            known["bms_soc"] = None
        if other.cabin_temperature_degc is not None:
            known["cabin_logged"] = other.cabin_logged
        return replace(self, **known)

    def to_dict(self) -> dict[str, Any]:
        """Return the known fields, with the time of departure as ISO 8601.

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
        known = dict(self._known())
        if self.departs_at is not None:
            known["departs_at"] = self.departs_at.isoformat()
        return known

    def _known(self) -> Iterator[tuple[str, Any]]:
        """Yield name and value of every known field."""
        return ((name, value) for name in FIELDS if (value := getattr(self, name)) is not None)

    def to_frame(self) -> pd.DataFrame:
        """Return a table of one row, with a column for each field; unknown fields are missing values.

        Returns
        -------
        DataFrame
            Table of one row.

        Examples
        --------
        >>> from tripwatt import Departure
        >>> Departure(soc=0.8).to_frame()["soc"].tolist()
        [0.8]
        """
        import pandas as pd  # slow to import, and the help of the command line needs this module

        return pd.DataFrame([asdict(self)], columns=list(FIELDS))

    def __repr__(self) -> str:
        return f"Departure({', '.join(f'{name}={value!r}' for name, value in self._known())})"

    def _repr_html_(self) -> str:
        from tripwatt.trips.showing import html_table

        return html_table("Departure", [(name, str(value)) for name, value in self.to_dict().items()])


def require_departure(departure: Departure | None) -> Departure:
    """Check that an argument is a departure or None.

    Parameters
    ----------
    departure : Departure or None
        The argument.

    Returns
    -------
    Departure
        The same departure; one with nothing known for None.

    Raises
    ------
    InvalidInput
        If the argument is anything else.

    Examples
    --------
    >>> require_departure(Departure(soc=0.8)), require_departure(None)
    (Departure(soc=0.8), Departure())
    """
    fix = "for example Departure(soc=0.8)"
    return require_type("departure", departure, Departure | None, "a Departure", fix) or Departure()


def _typical(column: pd.Series[Any]) -> float | str:
    """Mean of the numbers of a covariate, or the most frequent of its words."""
    return float(column.mean()) if column.dtype.kind in "iuf" else f"{column.mode().iloc[0]}"


def _first_value(samples: Sampled, column: str) -> float | None:
    """Return the first known value of a column within `FIRST_S`; None if there is none."""
    if column not in samples:
        return None
    times = samples.array("time_s")
    pairs = zip(times, samples.array(column), strict=True)
    early = itertools.takewhile(lambda pair: pair[0] - times[0] <= FIRST_S, pairs)
    return next((float(value) for _, value in early if math.isfinite(value)), None)


FIELDS: Final[Mapping[str, Field]] = {
    name: Field.from_entry(name, entry) for name, entry in shipped_toml("trips/departure.toml").items()
}
"""Name of a field of a departure -> its description, bounds and option."""

ASKED: Final[Mapping[str, Field]] = {name: field for name, field in FIELDS.items() if field.option}
"""Fields that a person can give: options of the command line, fields of a request and of the web page."""

EXTRAS: Final = FIELDS["extras"].choices
"""Extras that can be fitted to the car or switched on for a trip."""

TERRAINS: Final = FIELDS["terrain"].choices
"""Kinds of terrain, for a road of unknown heights."""


def _described(name: str, field: Field) -> str:
    kinds = {"text": "str", "truth": "bool", "time": "datetime", "values": "dict"}
    kind = kinds.get(field.type, "float")
    if field.choices:
        kind = "tuple of str" if field.several else f"{{{', '.join(repr(c) for c in field.choices)}}}"
    allowed = f" {field.allowed}." if field.column is not None else ""
    return f"{name} : {kind} or None\n        {field.help}{allowed}"


# `__new__` takes any name; a list of the fields is what a person looks for
Departure.__signature__ = signature(Departure.__init__.__get__(Departure))  # type: ignore[attr-defined]

if Departure.__doc__:  # absent under -OO
    Departure.__doc__ = Departure.__doc__.replace(
        "{fields}", "\n    ".join(_described(name, field) for name, field in FIELDS.items())
    )
