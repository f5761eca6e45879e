"""Find places by name, by the index of a map or a Photon or Nominatim server."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from tripwatt.errors import InvalidInput, places_named, require_type
from tripwatt.roads.routers import split_kind
from tripwatt.routes.documents import Node
from tripwatt.routes.places import TWIN_M, Place, read_coordinates, without_twins
from tripwatt.routes.web import WebClient, as_remote

_KEY_VARIABLE: Final = "TRIPWATT_PLACES_KEY"
_LONGEST_TEXT: Final = 200
MAX_FOUND: Final = 50
"""Bounds of a text and of the places in an answer: choices, since no name is longer and no list is read further."""
_LONGEST_NAME: Final = 60
"""Largest number of characters of a name that are shown in a message or compared: a choice that keeps messages readable."""

_MAX_CANDIDATES: Final = 10
_MAX_NAMED: Final = 5
"""Largest numbers of places that are searched for a name, and that are named in a message: choices, since nobody reads longer lists."""


class PlaceSearch(Protocol):
    """A search for places by name."""

    def search(self, text: str, *, limit: int = 10) -> tuple[Place, ...]:
        """Find places for a text, the best first; returns an empty tuple if there is none."""
        ...


@dataclass(frozen=True)
class ServerSearch:
    """A search for places by a server of a kind of `_SERVERS`."""

    client: WebClient
    kind: str

    def search(self, text: str, *, limit: int = 10) -> tuple[Place, ...]:
        """See `PlaceSearch.search`.

        Raises
        ------
        RemoteError
            If the server does not answer, or its answer is no list of places. Without a match the result is empty.
        """
        _, path, parameters, read_places = _SERVERS[self.kind]
        answer = self.client.get_json(path, {"q": text[:_LONGEST_TEXT], "limit": str(limit), **parameters})
        with as_remote():
            return without_twins(read_places(Node(answer, self.client.host)))[: min(limit, MAX_FOUND)]


def _photon_places(answer: Node) -> list[Place]:
    """Read the places of an answer of Photon, the best first."""
    places = []
    for feature in answer["features"].entries():
        tags = feature["properties"].members()
        coordinates = feature["geometry"]["coordinates"].entries(min_count=2)
        street = " ".join(str(tags[key]) for key in ("street", "housenumber") if tags.get(key))
        parts = [tags.get("name") or street, tags.get("city"), tags.get("country")]
        name = ", ".join(dict.fromkeys(str(part) for part in parts if part))
        longitude, latitude = (degrees.number() for degrees in coordinates[:2])
        places.append(Place(latitude, longitude, name[:_LONGEST_TEXT], str(tags.get("osm_value", ""))[:40]))
    return places


def _nominatim_places(answer: Node) -> list[Place]:
    """Read the places of an answer of Nominatim, the best first."""
    places = []
    for entry in answer.entries():
        latitude, longitude = (_number_from_text(entry[key]) for key in ("lat", "lon"))
        values = entry.members()
        name = str(values.get("display_name", ""))[:_LONGEST_TEXT]
        kind = str(values.get("addresstype") or values.get("type") or "")[:40]
        places.append(Place(latitude, longitude, name, kind))
    return places


def _number_from_text(text: Node) -> float:
    """Read a number that Nominatim writes as text."""
    try:
        return Node(float(text.value), text.where).number()
    except (TypeError, ValueError) as error:
        raise InvalidInput.of("not a number", text.where, repr(text.value)[:40], "a number") from error


_SERVERS: Final[Mapping[str, tuple[str, str, Mapping[str, str], Callable[[Node], list[Place]]]]] = {
    "photon": ("query:api_key", "/api", {}, _photon_places),
    "nominatim": ("query:key", "/search", {"format": "jsonv2"}, _nominatim_places),
}
"""Place of the key, path, parameters besides the text and the number of places, and reader of the answer, for each kind of server."""


def open_search(text: str, where: str = "--places") -> PlaceSearch:
    """Open a search by the URL of its server: `KIND=URL`, or the plain URL of a Photon server.

    Raises
    ------
    InvalidInput
        If the kind is unknown, or the URL is not valid.
    """
    kind, url = split_kind(text, _SERVERS, where)
    return ServerSearch(WebClient(url, "the search for places", _KEY_VARIABLE, _SERVERS[kind][0]), kind)


def find_place(text: str, search: PlaceSearch | None, where: str, covers: str = "") -> Place:
    """Find the place of a text: coordinates, or the whole name of exactly one place.

    A text that is only part of a name, or the name of several places far apart, is an error, since a journey to a wrong place is worse
    than none.

    Parameters
    ----------
    text : str
    search : PlaceSearch or None
        Search for names; None if only coordinates are accepted.
    where : str
        Name of the field, for messages.
    covers : str
        The region of the map in words, for messages.

    Raises
    ------
    InvalidInput
        If the text is not the name of exactly one place. The message names the places that may be meant.
    """
    with places_named(dict.fromkeys(("latitude", "longitude"), where)):
        if (place := read_coordinates(require_type(where, text, str, "a text"))) is not None:
            return place
    if not text.strip():
        raise InvalidInput.of("no place", where, "an empty text", "a name, or latitude and longitude")
    if search is None:
        fix = "give latitude and longitude, build a map, or name a search for places by its URL"
        raise InvalidInput.of("names of places are not known", where, text[:60], "47.141, 9.521", fix)
    matches = search.search(text, limit=_MAX_CANDIDATES)
    exact = [place for place in matches if place.is_called(text)]
    elsewhere = [p for p in exact if p.kind == exact[0].kind and p.distance_m(exact[0]) > TWIN_M]
    if exact and not elsewhere:
        return exact[0]
    what = "several places have this name" if exact else "unknown place"
    candidates = [exact[0], *elsewhere] if exact else matches
    allowed = "the whole name of a place, street or house of the map, or latitude and longitude"
    fix = "; ".join(part for part in (did_you_mean(candidates), covers) if part)
    raise InvalidInput.of(what, where, text[:60], allowed, fix)


def did_you_mean(places: Sequence[Place]) -> str:
    """Return a question with the names and kinds of some places, or an empty text if there are none.

    Examples
    --------
    >>> did_you_mean([Place(47.2, 9.5, "Ruggell", "village"), Place(47.2, 9.5, "Ruggeller Strasse", "street")])
    "did you mean 'Ruggell' (village) or 'Ruggeller Strasse' (street)?"
    """
    names = [
        f"{place.name[:_LONGEST_NAME]!r}" + (f" ({place.kind.replace('_', ' ')})" if place.kind else "")
        for place in places
    ]
    return f"did you mean {' or '.join(list(dict.fromkeys(names))[:_MAX_NAMED])}?" if names else ""
