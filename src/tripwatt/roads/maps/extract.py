"""Places and charging stations of an OpenStreetMap extract, read with `osmium` (extra `tripwatt[routing]`)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import InvalidInput
from tripwatt.roads.maps.powers import power_w
from tripwatt.roads.maps.stations import HOUSEHOLD, PLUG_KINDS, UNLISTED, Plug, PlugKind, Station
from tripwatt.routes.places import SETTLEMENTS
from tripwatt.routes.web import EXTRA

POINTS_OF_INTEREST: Final = ("amenity", "tourism", "leisure", "shop", "railway", "aeroway", "healthcare")
"""Keys of other named objects, besides settlements and streets, that are found by name."""

KINDS: Final = (*SETTLEMENTS, "street", "poi", "house")
"""Kinds of places, the most important first."""

NAME_KEYS: Final = ("name", "operator", "brand", "network")
"""Keys of the name of a charging station, the best first; all but the first tell who runs it."""

SOCKET: Final = re.compile(r"socket:([a-z0-9_]+)(?::output)?")
ABSENT: Final = frozenset({"", "no", "none", "0"})
"""Values of the key of a socket that a station does not have."""

WEST_OF_CCS_2_DEG: Final = -30.0
"""Longitude between America, where the socket `ccs` has the plug of Type 1, and Europe."""

OTHER_NAMES: Final = re.compile(
    r"name:[a-z]{2,3}(?:[-_]\w+)?|(?:alt|old|short|official|loc|int|nat|reg)_name(?::[a-z]{2,3})?|name_\d"
)
"""Keys of names in other languages, and of older or shorter names."""

ROADSIDE: Final = ("place", "highway", "railway", "amenity", "information")
"""Keys of objects whose tag `ele` is the height of a road beside them; that of a peak or a tower is not."""

HEIGHT: Final = re.compile(r"(-?\d{1,4}(?:\.\d+)?)\s*m?")
MAX_NAMES: Final = 200
LONGEST_NAME: Final = 200


@dataclass(frozen=True, slots=True)
class Height:
    """A place beside a road whose height above sea level the map has [m]."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    at_stop: bool = False
    """Whether it is that of a bus stop, which may be the height of the municipality."""


@dataclass(frozen=True, slots=True)
class Named:
    """An object with a name on the map; its kind is one of `KINDS`."""

    kind: str
    name: str
    latitude_deg: float
    longitude_deg: float
    street: str = ""
    """Street of a house."""
    city: str = ""
    """Settlement in the address of the object."""
    also: tuple[str, ...] = ()
    """Other names of the object: in other languages, older and shorter names."""
    population: int = 0


def read_objects(path: Path, *, settlements_only: bool = False) -> Iterator[Named | Station | Height]:
    """Yield the named objects, charging stations and heights of an extract, in its order. O(extract).

    Parameters
    ----------
    path : Path
        An extract in one of the formats of OpenStreetMap.
    settlements_only : bool
        Read only nodes with the key `place`, which is quicker.

    Raises
    ------
    InvalidInput
        If the extract cannot be read, or `osmium` is not installed.
    """
    try:
        import osmium  # an extra
        import osmium.filter

        keys, objects = ["place"], osmium.FileProcessor(str(path), osmium.osm.NODE)
        if not settlements_only:
            keys += ["highway", "addr:housenumber", *POINTS_OF_INTEREST]
            objects = osmium.FileProcessor(str(path), osmium.osm.NODE | osmium.osm.WAY).with_locations()
        for element in objects.with_filter(osmium.filter.KeyFilter(*keys)):
            yield from _read(element)
    except ImportError as error:
        raise InvalidInput.of("missing package", "tripwatt map build", str(error), fix=EXTRA) from error
    except (RuntimeError, OSError) as error:
        got, allowed = str(error)[:120], "an OpenStreetMap extract"
        raise InvalidInput.of("cannot read the extract", path.name, got, allowed) from error


def _read(element: Any) -> Iterator[Named | Station | Height]:
    """Yield the charging station, the height, the named object and the house that an element is; nothing if its place is unknown."""
    tags = {tag.k: tag.v for tag in element.tags}
    where = _centre(element)
    if where is None:
        return
    latitude, longitude = where
    height = HEIGHT.fullmatch(tags.get("ele", ""))
    if height and not element.is_way() and "natural" not in tags and any(key in tags for key in ROADSIDE):
        yield Height(latitude, longitude, float(height[1]), tags.get("highway") == "bus_stop")
    if tags.get("amenity") == "charging_station":
        station = station_of_tags(tags, latitude, longitude)
        if station is not None:
            yield station
    kind = _kind(tags, element.is_way())
    name = tags.get("name", "")[:LONGEST_NAME]
    if kind is not None and name:
        people = tags.get("population", "")
        size = int(people) if people.isascii() and people.isdigit() and len(people) < 10 else 0
        yield Named(kind, name, latitude, longitude, also=_other_names(tags, name), population=size)
    number, street = tags.get("addr:housenumber"), tags.get("addr:street") or tags.get("addr:place")
    if number and street:
        city = tags.get("addr:city", "")[:LONGEST_NAME]
        yield Named("house", number[:20], latitude, longitude, street[:LONGEST_NAME], city)


def _other_names(tags: Mapping[str, str], name: str) -> tuple[str, ...]:
    """Return the names under other keys than `name`, each once."""
    values = (value for key, value in sorted(tags.items()) if OTHER_NAMES.fullmatch(key))
    names = dict.fromkeys(part.strip()[:LONGEST_NAME] for value in values for part in value.split(";"))
    return tuple(other for other in names if other not in ("", name))[:MAX_NAMES]


def _kind(tags: Mapping[str, str], is_way: bool) -> str | None:
    place = tags.get("place")
    if place in SETTLEMENTS:
        return place
    if "highway" in tags:
        return "street" if is_way else None
    return "poi" if any(key in tags for key in POINTS_OF_INTEREST) else None


def _centre(element: Any) -> tuple[float, float] | None:
    """Return latitude and longitude of a node, or of the middle node of a way; returns None if no node is in the extract."""
    if not element.is_way():
        return float(element.lat), float(element.lon)
    known = [node.location for node in element.nodes if node.location.valid()]
    middle = known[len(known) // 2] if known else None
    return None if middle is None else (float(middle.lat), float(middle.lon))


def station_of_tags(tags: Mapping[str, str], latitude_deg: float, longitude_deg: float) -> Station | None:
    """Make a charging station from its tags; returns None if it is not a public station for cars, or out of use.

    Examples
    --------
    >>> station_of_tags({"socket:type2_combo": "2", "socket:type2_combo:output": "150 kW"}, 47.1, 9.5).power_w
    150000.0
    >>> station_of_tags({"motorcar": "no"}, 47.1, 9.5) is None
    True
    """
    if tags.get("access") in ("private", "no") or tags.get("motorcar") == "no":
        return None
    if "yes" in (tags.get("disused"), tags.get("abandoned")):
        return None
    given = {key: tags[key][:LONGEST_NAME] for key in NAME_KEYS if tags.get(key)}
    name = next(iter(given.values()), "")
    networks = tuple(given[key] for key in NAME_KEYS[1:] if key in given)
    plugs = _plugs(tags, "type1_combo" if longitude_deg < WEST_OF_CCS_2_DEG else "type2_combo")
    is_for_bicycles = tags.get("bicycle") in ("yes", "designated") and "motorcar" not in tags
    if plugs and is_for_bicycles and {plug.kind for plug in plugs} <= HOUSEHOLD:
        return None
    station = Station.without_plugs(latitude_deg, longitude_deg, name, _whole_w(tags))
    if plugs:
        station = Station.with_plugs(latitude_deg, longitude_deg, name, *plugs)
    return replace(station, networks=networks)


def _plugs(tags: Mapping[str, str], ccs: str) -> tuple[Plug, ...]:
    """Return the plugs of a station, the strongest kinds first, with their own powers.

    The power of the whole station is that of the first plug without an own power that can give it; no plug is assumed to have more.
    """
    sockets: dict[str, set[str]] = {}
    for key in tags:
        match = SOCKET.fullmatch(key)
        if match and match[1] != "unknown" and tags.get(f"socket:{match[1]}", "yes") not in ABSENT:
            name = ccs if match[1] == "ccs" else match[1]
            kind = name if name in PLUG_KINDS else name.removesuffix("_cable")
            sockets.setdefault(kind, set()).add(match[1])
    order, whole_w, plugs = [*PLUG_KINDS], _whole_w(tags), list[Plug]()
    for name in sorted(sockets, key=lambda kind: order.index(kind) if kind in PLUG_KINDS else len(order)):
        kind_of_plug = PLUG_KINDS.get(name, UNLISTED)
        own_w = max(_output_w(tags, socket, kind_of_plug) for socket in sockets[name])
        if not own_w and kind_of_plug.lowest_w <= whole_w <= kind_of_plug.highest_w:
            own_w = whole_w * all(plug.power_w != whole_w for plug in plugs)
        assumed_w = min(kind_of_plug.assumed_w, whole_w or math.inf)
        plugs.append(Plug(name, own_w or assumed_w, own_w > 0.0))
    return tuple(plugs)


def _output_w(tags: Mapping[str, str], socket: str, kind: PlugKind) -> float:
    """Return the power of a socket by its tags [W], or 0 if they do not tell it."""
    output, volts, amperes = (
        tags.get(f"socket:{socket}:{key}", "") for key in ("output", "voltage", "current")
    )
    known = (
        power_w(text, kind.lowest_w, kind.highest_w, alternating=not kind.direct_current)
        for text in (output, f"{volts} V; {amperes} A")
    )
    return next(filter(None, known), 0.0)


def _whole_w(tags: Mapping[str, str]) -> float:
    """Return the power of a whole station by its tags [W], or 0."""
    return max(power_w(tags.get(key, "")) for key in ("charging_station:output", "maxpower"))
