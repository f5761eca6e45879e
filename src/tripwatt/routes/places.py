"""Places on the map with coordinates and names, and directions of travel."""

from __future__ import annotations

import itertools
import math
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, raise_faults
from tripwatt.routes.points import EARTH_RADIUS_M, haversine_m
from tripwatt.trips import Plan

_COORDINATES: Final = re.compile(r"^\s*(?:geo:)?(-?\d{1,3}(?:\.\d+)?)\s*[,; ]\s*(-?\d{1,3}(?:\.\d+)?)\s*$")
"""Form of a latitude and longitude that a person writes or pastes."""

TWIN_M: Final = 5000.0
"""Two places of the same name within this distance [m] count as one."""

SETTLEMENTS: Final = (
    "city",
    "town",
    "village",
    "suburb",
    "quarter",
    "hamlet",
    "neighbourhood",
    "isolated_dwelling",
)
"""Kinds of places that people live in, the most important first: values of `place` of OpenStreetMap."""

_WORD: Final = re.compile(r"\w+")

SPELLINGS: Final = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "æ": "ae", "ø": "oe", "å": "aa"}
)
"""How letters are typed on keyboards that lack them."""

_PLAIN: Final = str.maketrans(
    {"ß": "ss", "æ": "ae", "œ": "oe", "ø": "o", "ł": "l", "đ": "d", "ð": "d", "þ": "th", "ı": "i"}
)
"""Replacements of letters from which Unicode decomposition removes no accent."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place.

    Attributes
    ----------
    latitude_deg, longitude_deg : float
        WGS 84.
    name : str
        As shown to a person; empty for bare coordinates.
    kind : str
        Such as "city", "street" or "house"; empty if unknown.
    also_called : str
        The name on the map if a person searched for another one, such as an older name or one in another language; else empty.

    Raises
    ------
    InvalidInput
        When the coordinates are out of range.

    Examples
    --------
    >>> Place(47.1410, 9.5209, "Vaduz").title
    'Vaduz'
    >>> Place(47.1410, 9.5209).title
    '47.14100, 9.52090'
    """

    latitude_deg: float
    longitude_deg: float
    name: str = ""
    kind: str = ""
    also_called: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        bounds = {"latitude": (self.latitude_deg, 90.0), "longitude": (self.longitude_deg, 180.0)}
        raise_faults(
            Fault("coordinate out of range", name, f"{value:g}°", f"-{limit:g}° to {limit:g}°")
            for name, (value, limit) in bounds.items()
            if not abs(value) <= limit
        )

    @property
    def title(self) -> str:
        """Name, or the coordinates to a metre."""
        return self.name or f"{self.latitude_deg:.5f}, {self.longitude_deg:.5f}"

    @property
    def described(self) -> str:
        """Name and kind, for people.

        Examples
        --------
        >>> Place(47.17, 9.51, "Landstrasse, Schaan", "street").described
        'Landstrasse, Schaan (street)'
        >>> Place(60.17, 24.94, "Helsingfors", "city", "Helsinki").described
        'Helsingfors (city, also called Helsinki)'
        """
        other = f"also called {self.also_called}" if self.also_called else ""
        about = ", ".join(part for part in (self.kind.replace("_", " "), other) if part)
        return f"{self.title} ({about})" if about else self.title

    @property
    def context(self) -> str:
        """The part of the name after the first comma, such as the settlement of a street; empty if there is none.

        Examples
        --------
        >>> Place(47.17, 9.51, "Landstrasse, Schaan", "street").context
        'Schaan'
        """
        return self.name.partition(", ")[2]

    def is_called(self, text: str) -> bool:
        """Whether a text is the name of the place: it has all words of the name's first part, and no words beyond the name.

        Case and accents are ignored, and a letter such as "ä" may be typed as two letters.

        Parameters
        ----------
        text : str
            As a person types it.

        Returns
        -------
        bool
            False also if the text has only a part of a word.

        Examples
        --------
        >>> street = Place(47.2, 9.55, "Feldkircherstrasse, Nendeln", "street")
        >>> street.is_called("Feldkirch"), street.is_called("feldkircherstrasse"), street.is_called("Nendeln")
        (False, True, False)
        """
        # without accents, and with accented letters typed as two
        spellings = (
            (plain_words(words), _WORD.findall(words.lower().translate(SPELLINGS)))
            for words in (text, self.name.partition(",")[0], self.name)
        )
        return any(
            set(first_words) <= set(typed) <= set(all_words)
            for typed, first_words, all_words in itertools.product(*spellings)
            if first_words
        )

    def to_dict(self) -> dict[str, Any]:
        """Convert the place to plain values, as the command line and the service show them.

        Returns
        -------
        dict
            Keys `name`, `kind`, `context`, `also_called`, `latitude_deg` and `longitude_deg`.

        Examples
        --------
        >>> Place(47.14, 9.52, "Vaduz", "town").to_dict()["latitude_deg"]
        47.14
        """
        names = "kind", "context", "also_called", "latitude_deg", "longitude_deg"
        return {"name": self.title} | {name: getattr(self, name) for name in names}

    def distance_m(self, other: Place) -> float:
        """Compute the distance to another place on the sphere.

        Parameters
        ----------
        other : Place
            The other place.

        Returns
        -------
        float
            Distance [m].

        Examples
        --------
        >>> round(Place(0.0, 0.0).distance_m(Place(0.0, 1.0)), 1)
        111195.1
        """
        latitude = self.latitude_deg, other.latitude_deg
        return float(haversine_m(latitude, (self.longitude_deg, other.longitude_deg))[0])

    def moved(self, bearing_deg: float, distance_m: float) -> Place:
        """Find the place at a distance in a direction, on the sphere.

        Parameters
        ----------
        bearing_deg : float
            Direction, clockwise from north [°].
        distance_m : float
            Distance [m].

        Returns
        -------
        Place
            The place found, without a name.

        Examples
        --------
        >>> east = Place(0.0, 0.0).moved(90.0, 111195.08)
        >>> round(east.latitude_deg, 6), round(east.longitude_deg, 6)
        (0.0, 1.0)
        """
        angle, bearing = distance_m / EARTH_RADIUS_M, math.radians(bearing_deg)
        lat, lon = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        sine = math.sin(lat) * math.cos(angle) + math.cos(lat) * math.sin(angle) * math.cos(bearing)
        latitude = math.asin(max(-1.0, min(1.0, sine)))
        turn = math.atan2(
            math.sin(bearing) * math.sin(angle) * math.cos(lat),
            math.cos(angle) - math.sin(lat) * math.sin(latitude),
        )
        longitude = (math.degrees(lon + turn) + 540.0) % 360.0 - 180.0
        return Place(math.degrees(latitude), longitude)


def plain_words(text: str) -> list[str]:
    """The words of a text in lower case, without accents.

    Examples
    --------
    >>> plain_words("Ängsgatan, ŁÓDŹ")
    ['angsgatan', 'lodz']
    """
    if text.isascii():
        return _WORD.findall(text.lower())
    letters = unicodedata.normalize("NFKD", text.lower().translate(_PLAIN))
    return _WORD.findall("".join(letter for letter in letters if not unicodedata.combining(letter)))


def without_twins(places: Iterable[Place], limit: int | None = None) -> tuple[Place, ...]:
    """The places without repetitions, at most `limit` of them. O(places²) for places of the same name.

    A place is left out if, within `TWIN_M`, an earlier place has the same name or is a settlement with the same first part of its
    name. A village, its boundary and its post office are one place; streets of the same name in two villages are two.

    Examples
    --------
    >>> village, office = Place(47.139, 9.523, "Vaduz", "village"), Place(47.1386, 9.522, "Vaduz", "poi")
    >>> without_twins([village, office]) == (village,)
    True
    """
    kept: dict[str, list[Place]] = {}
    distinct = []
    for place in places:
        same = kept.setdefault(place.name.partition(", ")[0], [])
        twins = [other for other in same if other.name == place.name or other.kind in SETTLEMENTS]
        if all(other.distance_m(place) > TWIN_M for other in twins):
            same.append(place)
            distinct.append(place)
            if len(distinct) == limit:
                break
    return tuple(distinct)


def read_coordinates(text: str) -> Place | None:
    """The place of a text with latitude and longitude; None for any other text.

    Raises
    ------
    InvalidInput
        When the coordinates are out of range.

    Examples
    --------
    >>> read_coordinates("47.141, 9.5209"), read_coordinates("Vaduz")
    (Place(latitude_deg=47.141, longitude_deg=9.5209, name='', kind=''), None)
    """
    match = _COORDINATES.match(text)
    return None if match is None else Place(float(match[1]), float(match[2]))


def bearings_deg(latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
    """Direction from each point to the next, clockwise from north, 0 to 360 [°], shape (points - 1,).

    Examples
    --------
    >>> bearings_deg(np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, 1.0])).round(1).tolist()
    [0.0, 90.0]
    """
    lat, lon = np.radians(latitude_deg), np.radians(longitude_deg)
    east = np.sin(np.diff(lon)) * np.cos(lat[1:])
    north = np.cos(lat[:-1]) * np.sin(lat[1:]) - np.sin(lat[:-1]) * np.cos(lat[1:]) * np.cos(np.diff(lon))
    return np.asarray(np.degrees(np.arctan2(east, north)) % 360.0, dtype=np.float64)


def heading_along(
    latitude_deg: FloatArray, longitude_deg: FloatArray, position_m: FloatArray, at_m: FloatArray
) -> FloatArray:
    """Direction of travel along a line, clockwise from north [°], at the distances `at_m` and of their shape.

    The direction is 0 everywhere if the line has fewer than two points.

    Parameters
    ----------
    latitude_deg, longitude_deg, position_m : ndarray, shape (points,)
        Coordinates of the points of the line [°], and their distances from its start [m].
    at_m : ndarray
        Distances from the start of the line [m].

    Examples
    --------
    >>> line = np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, 100.0, 200.0])
    >>> heading_along(*line, np.array([50.0, 150.0])).round(1).tolist()
    [0.0, 90.0]
    """
    if len(position_m) < 2:
        return np.zeros_like(at_m)
    heading = bearings_deg(latitude_deg, longitude_deg)
    piece = np.searchsorted(position_m, at_m, side="right") - 1
    return np.asarray(heading[np.clip(piece, 0, len(heading) - 1)], dtype=np.float64)


def driven_m(plan: Plan, distance_m: float) -> FloatArray:
    """Distance of each sample of a plan from its start [m], scaled so that the last one is `distance_m`, shape (samples,)."""
    time = plan.array("time_s")
    driven = np.cumsum(plan.array("speed_m_s") * np.diff(time, prepend=time[0]))
    return driven * (distance_m / driven[-1]) if driven[-1] > 0.0 else driven


def with_heading(
    plan: Plan, latitude_deg: FloatArray, longitude_deg: FloatArray, position_m: FloatArray, distance_m: float
) -> Plan:
    """A copy of a plan with its direction of travel, from the points of a line, their positions and the length of the line."""
    heading = heading_along(latitude_deg, longitude_deg, position_m, driven_m(plan, distance_m))
    return replace(plan, heading_deg=heading)
