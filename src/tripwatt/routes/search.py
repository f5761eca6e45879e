"""Places by name: of the index of a map, or of a Photon or Nominatim server."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Protocol

from tripwatt.errors import Fault, InvalidInput, RemoteError
from tripwatt.routes.places import Place, read_coordinates
from tripwatt.routes.points import a_list, a_number, an_object
from tripwatt.routes.routers import split_kind
from tripwatt.routes.web import WebClient

KEY: Final = "TRIPWATT_PLACES_KEY"
LONGEST_TEXT: Final = 200
MOST_FOUND: Final = 50
LONGEST_NAME: Final = 60
"""Characters of a name in a message, and of what is compared with it."""

SAME_LETTERS: Final = 3
"""Letters at the beginning of an unknown name that are taken as right when a similar name is looked for."""


class PlaceSearch(Protocol):
    """What finds places by name."""

    def search(self, text: str, *, limit: int = 10) -> tuple[Place, ...]:
        """Places for a text, the best first; empty where there is none."""
        ...


@dataclass(frozen=True)
class PhotonSearch:
    """Places of a Photon server."""

    client: WebClient

    @classmethod
    def from_url(cls, url: str) -> PhotonSearch:
        """A server by its URL."""
        return cls(WebClient(url, "the search for places", KEY, "query:api_key"))

    def search(self, text: str, *, limit: int = 10) -> tuple[Place, ...]:
        """See `PlaceSearch.search`.

        Raises
        ------
        RemoteError
            When the server does not answer, or not with places.
        """
        answer = self.client.get_json("/api", {"q": text[:LONGEST_TEXT], "limit": str(limit)})
        return _places(answer, self.client.host, _from_photon, limit)


@dataclass(frozen=True)
class NominatimSearch:
    """Places of a Nominatim server."""

    client: WebClient

    @classmethod
    def from_url(cls, url: str) -> NominatimSearch:
        """A server by its URL."""
        return cls(WebClient(url, "the search for places", KEY, "query:key"))

    def search(self, text: str, *, limit: int = 10) -> tuple[Place, ...]:
        """See `PlaceSearch.search`.

        Raises
        ------
        RemoteError
            When the server does not answer, or not with places.
        """
        query = {"q": text[:LONGEST_TEXT], "limit": str(limit), "format": "jsonv2"}
        return _places(self.client.get_json("/search", query), self.client.host, _from_nominatim, limit)


def _places(
    answer: Any, where: str, read: Callable[[Any, str], list[Place]], limit: int
) -> tuple[Place, ...]:
    try:
        return tuple(read(answer, where)[: min(limit, MOST_FOUND)])
    except InvalidInput as error:
        raise RemoteError(error.faults) from error


def _from_photon(answer: Any, where: str) -> list[Place]:
    places = []
    for k, entry in enumerate(a_list(an_object(answer, where).get("features"), f"{where}, features")):
        feature = an_object(entry, f"{where}, features[{k}]")
        about = an_object(feature.get("properties"), f"{where}, features[{k}], properties")
        geometry = an_object(feature.get("geometry"), f"{where}, features[{k}], geometry")
        pair = a_list(geometry.get("coordinates"), f"{where}, features[{k}], coordinates", least=2)
        street = " ".join(str(about[key]) for key in ("street", "housenumber") if about.get(key))
        parts = [about.get("name") or street, about.get("city"), about.get("country")]
        name = ", ".join(dict.fromkeys(str(part) for part in parts if part))
        longitude, latitude = (a_number(value, f"{where}, features[{k}], coordinates") for value in pair[:2])
        places.append(Place(latitude, longitude, name[:LONGEST_TEXT], str(about.get("osm_value", ""))[:40]))
    return places


def _from_nominatim(answer: Any, where: str) -> list[Place]:
    places = []
    for k, entry in enumerate(a_list(answer, where)):
        found = an_object(entry, f"{where}[{k}]")
        latitude, longitude = (_text_number(found.get(key), f"{where}[{k}], {key}") for key in ("lat", "lon"))
        name, kind = (
            str(found.get("display_name", "")),
            str(found.get("addresstype") or found.get("type") or ""),
        )
        places.append(Place(latitude, longitude, name[:LONGEST_TEXT], kind[:40]))
    return places


def _text_number(value: Any, where: str) -> float:
    """Nominatim writes coordinates as text."""
    try:
        return a_number(float(value), where)
    except (TypeError, ValueError) as error:
        raise InvalidInput(Fault("not a number", where, repr(value)[:40], "a number")) from error


SEARCH_KINDS: Final[Mapping[str, Callable[[str], PlaceSearch]]] = MappingProxyType(
    {"photon": PhotonSearch.from_url, "nominatim": NominatimSearch.from_url}
)
"""Kind of a server that finds places -> what opens one by its URL."""


def open_search(text: str, where: str = "--places") -> PlaceSearch:
    """A search by the URL of its server, `KIND=URL` or the URL of a Photon server.

    Raises
    ------
    InvalidInput
        For an unknown kind, or what is no URL.
    """
    kind, url = split_kind(text, SEARCH_KINDS, where)
    return SEARCH_KINDS[kind](url)


def find_place(text: str, search: PlaceSearch | None, where: str) -> Place:
    """The place that a person means: coordinates, or the best match of a name.

    Parameters
    ----------
    text : str
    search : PlaceSearch or None
        None where only coordinates can be understood.
    where : str
        Name of the field, for messages.

    Raises
    ------
    InvalidInput
        When the place is unknown.
    """
    place = read_coordinates(text)
    if place is not None:
        return place
    if not text.strip():
        raise InvalidInput(Fault("no place", where, "an empty text", "a name, or latitude and longitude"))
    if search is None:
        fix = "give latitude and longitude, build a map, or name a search for places by its URL"
        raise InvalidInput(Fault("names of places are not known", where, text[:60], "47.141, 9.521", fix))
    found = search.search(text, limit=1)
    if not found:
        got, allowed = text[:60], "a place, street or house of the map, or latitude and longitude"
        raise InvalidInput(Fault("unknown place", where, got, allowed, _did_you_mean(text, search)))
    return found[0]


def _did_you_mean(text: str, search: PlaceSearch) -> str:
    """The place whose name is most similar, among those that begin with the same letters; one more search."""
    typed = " ".join(text.split())[:LONGEST_NAME]
    try:
        found = search.search(typed[:SAME_LETTERS])
    except RemoteError:
        return ""
    named = {place.name.partition(",")[0].casefold(): place.name for place in reversed(found)}
    near = difflib.get_close_matches(typed.casefold(), [*named], n=1)
    return f"did you mean {named[near[0]][:LONGEST_NAME]!r}?" if near else ""
