"""What is known of a drive as a whole."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass


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
