"""The index of places of a map: names by the beginnings of their words, with SQLite's full-text search."""

from __future__ import annotations

import itertools
import json
import sqlite3
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.errors import InvalidInput
from tripwatt.roads.maps.extract import KINDS, Height, Named
from tripwatt.roads.maps.heights import KnownHeights
from tripwatt.roads.maps.near_words import SCHEMA as WORDS_SCHEMA
from tripwatt.roads.maps.near_words import near_words, write_words
from tripwatt.roads.maps.stations import Plug, Station, on_sphere
from tripwatt.routes.places import SPELLINGS, TWIN_M, Place, plain_words, without_twins

FAR_FROM_SETTLEMENT_M: Final = 33_000.0
"""An object farther from a settlement than this [m] is named without the settlement."""

MAX_FOUND: Final = 50
CANDIDATES: Final = 200
"""Largest number of matches that are compared; the index has the important places first."""

LONGEST_TEXT: Final = 200
MAX_WORDS: Final = 10
SETTLEMENT: Final = KINDS.index("street")
"""Ranks below this are settlements."""

HOUSE: Final = KINDS.index("house")
NEAR_PLACES: Final = 2
"""Number of settlements with a similar name that are included in a list that is already full of places with the typed beginning."""

NOT_MEANT: Final = 100
"""Number of mistakes that is counted for a typed word that means no word of a place."""

SEPARATOR: Final = ";"
"""Separator between the other names of a place, as in the extract."""

AROUND_DEG: Final = 0.1
"""Heights up to this far beyond the places of a journey count: a choice, about 10 km."""

SHARED_HEIGHTS: Final = """
DELETE FROM heights WHERE rowid IN (SELECT one.rowid FROM heights AS one JOIN heights AS other ON other.height = one.height
    AND other.latitude BETWEEN one.latitude - 0.1 AND one.latitude + 0.1
    AND other.longitude BETWEEN one.longitude - 0.1 AND one.longitude + 0.1
    AND max(abs(other.latitude - one.latitude), abs(other.longitude - one.longitude)) > 0.01
    WHERE one.at_stop AND other.at_stop)
"""
"""Bus stops more than 1 km apart with one height have that of their municipality, as import files of operators do."""

SCHEMA: Final = f"""
CREATE TEMP TABLE read (kind INTEGER, name TEXT, context TEXT, latitude REAL, longitude REAL, also TEXT, population INTEGER);
CREATE TEMP TABLE merged AS SELECT * FROM read;
CREATE TABLE heights (latitude REAL, longitude REAL, height REAL, at_stop INTEGER);
CREATE INDEX heights_by_height ON heights (height, latitude);
CREATE TABLE stations (latitude REAL, longitude REAL, name TEXT, power REAL, direct INTEGER, known INTEGER, plug TEXT, plugs TEXT,
    networks TEXT);
CREATE TABLE places (
    id INTEGER PRIMARY KEY, kind INTEGER, name TEXT, context TEXT, latitude REAL, longitude REAL, also TEXT);
CREATE VIRTUAL TABLE names USING fts5(name, also, context, content='', prefix='1 2 3', tokenize="unicode61");
{WORDS_SCHEMA};
"""


def write_index(
    path: Path, settlements: Sequence[Named], objects: Iterable[Named | Station | Height]
) -> dict[str, Any]:
    """Write the index of a map. O(objects log objects).

    Parameters
    ----------
    path : Path
        File of the index; an existing file is replaced.
    settlements : sequence of Named
        Settlements, whose names are shown beside streets and houses near them.
    objects : iterable of Named, Station or Height

    Returns
    -------
    dict
        Numbers of `places` and `stations`; `bounds_deg`, the south, west, north and east of all places, or None without a place.
    """
    path.unlink(missing_ok=True)
    nearest = _Nearest(settlements)
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(SCHEMA)
        rest = iter(objects)
        while batch := list(itertools.islice(rest, 20_000)):
            found = [item for item in batch if isinstance(item, Station)]
            stations = [(*item[:-2], *map(json.dumps, item[-2:])) for item in map(astuple, found)]
            database.executemany("INSERT INTO stations VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", stations)
            heights = [astuple(item) for item in batch if isinstance(item, Height)]
            database.executemany("INSERT INTO heights VALUES (?, ?, ?, ?)", heights)
            named = [item for item in batch if isinstance(item, Named)]
            database.executemany("INSERT INTO read VALUES (?, ?, ?, ?, ?, ?, ?)", _rows(named, nearest))
        database.execute(SHARED_HEIGHTS)
        rows = database.execute("SELECT * FROM read ORDER BY kind, name, context, latitude, longitude")
        merged = _merged(rows, nearest)
        database.executemany("INSERT INTO merged VALUES (?, ?, ?, ?, ?, ?, ?)", merged)
        database.execute(
            "INSERT INTO places (kind, name, context, latitude, longitude, also) "
            "SELECT kind, name, context, latitude, longitude, also FROM merged "
            "ORDER BY kind, population DESC, length(name), name, context"
        )
        rows = database.execute("SELECT id, name, also, context FROM places")
        texts = ((k, *map(_searched, (name, also, context))) for k, name, also, context in rows)
        database.executemany("INSERT INTO names (rowid, name, also, context) VALUES (?, ?, ?, ?)", texts)
        rows = database.execute(
            "SELECT id, name || ' ' || also FROM places WHERE kind < ? ORDER BY id DESC", (HOUSE,)
        )
        write_words(database, {word: k for k, text in rows for word in _searched(text).split()}.items())
        (stations,) = database.execute("SELECT count(*) FROM stations").fetchone()
        extremes = "min(latitude), min(longitude), max(latitude), max(longitude)"
        places, *bounds = database.execute(f"SELECT count(*), {extremes} FROM places").fetchone()
        return {"places": places, "stations": stations, "bounds_deg": bounds if places else None}


def _rows(named: Sequence[Named], nearest: _Nearest) -> Iterator[tuple[Any, ...]]:
    """Yield rows of the table `read`; the context is the settlement of the address or nearby, or the town beside a settlement."""
    for item, settlement in zip(named, nearest.names(named), strict=True):
        name, context = item.name, item.city or settlement
        if item.kind == "house":
            name = f"{item.street} {name}"
        elif name == context:
            context = nearest.beside(item)
        rest = item.latitude_deg, item.longitude_deg, SEPARATOR.join(item.also), item.population
        yield KINDS.index(item.kind), name, context, *rest


def _merged(rows: Iterable[tuple[Any, ...]], nearest: _Nearest) -> Iterator[tuple[Any, ...]]:
    """Merge rows of one kind, name and context that lie together, such as pieces of a street, into one at the middle, with all names.

    If pieces of the same name lie apart in one settlement, the quarter of each is put in front of its context. Houses get the other
    names of their street, so the rows have to be in the order of kind, name and context, streets before houses.
    """
    streets: dict[tuple[str, str], str] = {}
    for (kind, name, context), pieces in itertools.groupby(rows, key=lambda row: row[:3]):
        groups = _together(
            [Named("", name, row[3], row[4], also=(row[5],), population=row[6]) for row in pieces]
        )
        for group in groups:
            middle = group[0] if len(group) == 1 else _middle(group)
            other = (part for piece in group for part in piece.also[0].split(SEPARATOR) if part)
            also = SEPARATOR.join(dict.fromkeys(other))
            if kind == HOUSE:
                street, _, number = name.rpartition(" ")
                named = streets.get((street, context), "")
                also = SEPARATOR.join(f"{part} {number}" for part in named.split(SEPARATOR) if part)
            elif also and KINDS[kind] == "street":
                streets[name, context] = also
            quarter = nearest.quarter(middle) if len(groups) > 1 else ""
            around = ", ".join(part for part in dict.fromkeys((quarter, context)) if part)
            people = max(piece.population for piece in group)
            yield kind, name, around, middle.latitude_deg, middle.longitude_deg, also, people


def _together(pieces: Sequence[Named]) -> list[list[Named]]:
    """Group pieces that lie within `TWIN_M` of the first piece of their group. O(pieces · groups)."""
    groups: list[list[Named]] = []
    for piece in pieces:
        near = (group for group in groups if _where(group[0]).distance_m(_where(piece)) <= TWIN_M)
        group = next(near, None)
        if group is None:
            groups.append(group := [])
        group.append(piece)
    return groups


def _middle(pieces: Sequence[Named]) -> Named:
    """Return the piece nearest to the mean position of all pieces."""
    mean = Place(*np.mean([(piece.latitude_deg, piece.longitude_deg) for piece in pieces], axis=0).tolist())
    return min(pieces, key=lambda piece: mean.distance_m(_where(piece)))


def _where(item: Named) -> Place:
    return Place(item.latitude_deg, item.longitude_deg)


def _searched(text: str) -> str:
    """Return the words of a text for the search: without accents, and in the spelling used if special letters cannot be typed."""
    typed = text.lower().translate(SPELLINGS)
    words = plain_words(text)
    return " ".join(words if typed == text.lower() else dict.fromkeys([*words, *plain_words(typed)]))


class _Nearest:
    """The settlement nearest to each object."""

    def __init__(self, settlements: Sequence[Named]) -> None:
        large = [s for s in settlements if s.kind in ("city", "town", "village")]
        self.large = _Tree(large or settlements)
        self.any = _Tree(settlements)
        self.towns = _Tree([s for s in settlements if s.kind in ("city", "town")] or large)
        named = defaultdict(list)
        for settlement in large:
            named[settlement.name].append(settlement)
        self.repeated = {name for name, same in named.items() if len(_together(same)) > 1}

    def names(self, objects: Sequence[Named]) -> list[str]:
        """Return the name of the nearest large settlement for each object; empty if none is near."""
        return [near[0] if near else "" for near in self.large.near(objects, 1)]

    def quarter(self, item: Named) -> str:
        """Return the name of the nearest settlement of any kind; empty if none is near."""
        return next(iter(self.any.near([item], 1)[0]), "")

    def beside(self, item: Named) -> str:
        """Return the nearest town of another name for a settlement whose name is not unique, else an empty text."""
        if item.name not in self.repeated:
            return ""
        return next((name for name in self.towns.near([item], 3)[0] if name != item.name), "")


class _Tree:
    """A spatial index of settlements."""

    def __init__(self, settlements: Sequence[Named]) -> None:
        from scipy.spatial import cKDTree

        self.known = [s.name for s in settlements]
        self.tree = cKDTree(on_sphere(settlements)) if settlements else None

    def near(self, objects: Sequence[Named], number: int) -> list[list[str]]:
        """Return the names of the `number` nearest settlements of each object, without those farther than `FAR_FROM_SETTLEMENT_M`."""
        if self.tree is None or not objects:
            return [[] for _ in objects]
        distance, index = self.tree.query(on_sphere(objects), range(1, number + 1))
        return [
            [self.known[int(k)] for off, k in zip(*pair, strict=True) if off <= FAR_FROM_SETTLEMENT_M]
            for pair in zip(distance, index, strict=True)
        ]


class PlaceIndex:
    """The places and stations of a map.

    Parameters
    ----------
    path : Path
        File written by `write_index`.

    Attributes
    ----------
    first_street : float
        First id after those of all settlements.

    Raises
    ------
    InvalidInput
        If the file is not an index.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._damage_is_a_fault():
            uri = f"{path.resolve().as_uri()}?mode=ro"
            self.database = sqlite3.connect(uri, uri=True, check_same_thread=False)
            # places are written in the order of their kinds
            first = "SELECT ifnull(min(id), 1e18) FROM places WHERE kind >= ?"
            (self.first_street,) = self.database.execute(first, (SETTLEMENT,)).fetchone()

    @contextmanager
    def _damage_is_a_fault(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, ValueError, TypeError, LookupError) as error:
            fix = "build the map again with tripwatt map build"
            raise InvalidInput.of("no index of places", str(self.path), str(error)[:80], fix=fix) from error

    def search(self, text: str, *, limit: int = 10) -> tuple[Place, ...]:
        """Find places whose name has the words of a text, the most important first. O(log places) for each word.

        Every word of the text has to begin a word of the name of a place, of another of its names, or of the settlement around it.
        Accents and case do not count. Places with similar words follow. If places of the same name lie close together, only the most
        important is returned. A place that is found by another name gets this name.

        Parameters
        ----------
        text : str
            Words, for example "Landstr 12 Vaduz".
        limit : int
            Largest number of places.

        Returns
        -------
        tuple of Place
            Places found; empty if there are none.
        """
        words = plain_words(text[:LONGEST_TEXT])[:MAX_WORDS]
        if not words or limit < 1:
            return ()
        limit = min(limit, MAX_FOUND)
        with self._damage_is_a_fault():
            rows = self._matching([[f'"{word}"*'] for word in words])
            found = sorted((_Match.of(row, words) for row in rows), key=lambda match: match.order)
            near: list[_Match] = []
            if not (found and found[0].is_whole):
                near = self._similar(words)
                lead = [match for match in near if match.row[0] < SETTLEMENT] if len(found) >= limit else near
                found = (
                    found[: limit - NEAR_PLACES] + lead[:NEAR_PLACES] + found[limit - NEAR_PLACES :] + near
                )
            return without_twins((match.place for match in found), limit)

    def _matching(self, words: Sequence[Sequence[str]]) -> list[tuple[Any, ...]]:
        """Return the rows of the places that have a term of each word, in the order of importance, at most `CANDIDATES`."""
        query = " AND ".join(f"({' OR '.join(terms)})" for terms in words)
        return self.database.execute(
            "SELECT places.kind, places.name, places.context, places.latitude, places.longitude, places.also "
            "FROM names JOIN places ON places.id = names.rowid WHERE names MATCH ? ORDER BY names.rowid LIMIT ?",
            (query, CANDIDATES),
        ).fetchall()

    def _similar(self, typed: Sequence[str]) -> list[_Match]:
        """Find places with words similar to the typed words, those with the fewest mistakes first."""
        near = [near_words(self.database, word) for word in typed]
        if not any(near):
            return []
        terms = [
            [f'"{word}"*', *(f'"{other}"' for other in others)]
            for word, others in zip(typed, near, strict=True)
        ]
        matches = []
        for row in self._matching(terms):
            meant = min(
                (_meant(typed, near, name, row[2]) for name in _names(row)), key=lambda entry: entry[0]
            )
            if 0 < meant[0] < NOT_MEANT:
                matches.append((meant[0], _Match.of(row, meant[1])))
        return [match for _, match in sorted(matches, key=lambda entry: (entry[0], entry[1].order))]

    def settlements(
        self, south: float, west: float, north: float, east: float, limit: int
    ) -> tuple[Place, ...]:
        """Return the settlements inside of bounds [°]: cities first, then towns, villages and smaller ones. O(settlements)."""
        with self._damage_is_a_fault():
            rows = self.database.execute(
                "SELECT kind, name, latitude, longitude FROM places WHERE id < ? AND latitude BETWEEN ? AND ? "
                "AND longitude BETWEEN ? AND ? ORDER BY id LIMIT ?",
                (self.first_street, south, north, west, east, limit),
            ).fetchall()
            return tuple(Place(lat, lon, name, KINDS[kind]) for kind, name, lat, lon in rows)

    def heights_around(self, places: Sequence[Place]) -> KnownHeights | None:
        """Return the heights of the map around places, None if there are too few. O(heights)."""
        at = np.array([(place.latitude_deg, place.longitude_deg) for place in places])
        ends = np.stack((at.min(axis=0) - AROUND_DEG, at.max(axis=0) + AROUND_DEG), axis=1)
        with self._damage_is_a_fault():
            rows = self.database.execute(
                "SELECT latitude, longitude, height FROM heights "
                "WHERE latitude BETWEEN ? AND ? AND longitude BETWEEN ? AND ?",
                ends.ravel().tolist(),
            ).fetchall()
        return KnownHeights.from_rows(rows)

    def stations(self) -> tuple[Station, ...]:
        """Return all charging stations."""
        with self._damage_is_a_fault():
            rows = self.database.execute("SELECT * FROM stations").fetchall()
            return tuple(
                Station(lat, lon, name, w, bool(dc), bool(known), plug, *_read_lists(plugs, networks))
                for lat, lon, name, w, dc, known, plug, plugs, networks in rows
            )


def _read_lists(plugs: str, networks: str) -> tuple[tuple[Plug, ...], tuple[str, ...]]:
    return tuple(Plug(*plug) for plug in json.loads(plugs)), tuple(json.loads(networks))


def _names(row: Sequence[Any]) -> list[str]:
    """Return the name of a row, followed by its other names."""
    return [row[1], *(row[5].split(SEPARATOR) if row[5] else ())]


def _meant(
    typed: Sequence[str], near: Sequence[dict[str, int]], name: str, context: str
) -> tuple[int, list[str]]:
    """Return the number of mistakes in typed words if they mean a name, and the words of the name that they mean."""
    have = _searched(f"{name} {context}").split()
    mistakes, words = 0, []
    for word, others in zip(typed, near, strict=True):
        if any(other.startswith(word) for other in have):
            words.append(word)
            continue
        meant, count = next((entry for entry in others.items() if entry[0] in have), (word, NOT_MEANT))
        mistakes += count
        words.append(meant)
    return mistakes, words


@dataclass(frozen=True, slots=True)
class _Match:
    """A row of the index, with the one of its names that matches the words of a text."""

    row: tuple[Any, ...]
    name: str
    words: tuple[str, ...]
    """Words of the name."""
    typed: tuple[str, ...]

    @classmethod
    def of(cls, row: tuple[Any, ...], typed: Sequence[str]) -> _Match:
        """Make the match of a row by its best matching name; the first name is preferred to equally good other names."""
        matches = (cls(row, name, (*_searched(name).split(),), (*typed,)) for name in _names(row))
        return min(matches, key=lambda match: (-match._begun, not match.is_whole))

    @property
    def _begun(self) -> int:
        """Number of typed words that begin a word of the name."""
        return sum(any(word.startswith(typed) for word in self.words) for typed in self.typed)

    @property
    def is_whole(self) -> bool:
        """Whether the text is the whole name."""
        return self.typed in (self.words, (*plain_words(self.name),))

    @property
    def order(self) -> tuple[bool, bool, int, int]:
        """Sort key: whole names first, then names that begin with the text, then by kind of place, then short names."""
        begins = " ".join(self.words).startswith(" ".join(self.typed))
        return (not self.is_whole, not begins, self.row[0], len(self.name))

    @property
    def place(self) -> Place:
        """The place with the name by which it was found."""
        kind, own, context, latitude, longitude, _ = self.row
        name = f"{self.name}, {context}" if context else self.name
        return Place(latitude, longitude, name, KINDS[kind], own if own != self.name else "")
