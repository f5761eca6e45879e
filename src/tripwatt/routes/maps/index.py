"""The index of places of a map: names by prefix, with SQLite's full-text search."""

from __future__ import annotations

import difflib
import itertools
import sqlite3
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import astuple
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.errors import InvalidInput
from tripwatt.routes.maps.extract import KINDS, Named
from tripwatt.routes.maps.stations import Station
from tripwatt.routes.places import SPELLINGS, WORD, Place, without_twins

FAR_FROM_SETTLEMENT_DEG: Final = 0.3
"""An object farther from a settlement than this [° of latitude] is named without it."""

MOST_FOUND: Final = 50
CANDIDATES: Final = 200
"""Matches that are compared; the index holds the important ones first."""

LONGEST_TEXT: Final = 200
MOST_WORDS: Final = 10
SETTLEMENT: Final = KINDS.index("street")
"""Ranks below this are settlements."""

SAME_LETTERS: Final = 3
MOST_COMPARED: Final = 3000
LONGEST_COMPARED: Final = 60
LEAST_SIMILAR: Final = 0.75
"""A name that nothing begins with is compared with so many settlements, and with what begins with its first letters."""

COLUMNS: Final = "SELECT places.kind, places.name, places.context, places.latitude, places.longitude FROM"

SCHEMA: Final = """
CREATE TABLE read (kind INTEGER, name TEXT, context TEXT, latitude REAL, longitude REAL);
CREATE TABLE stations (latitude REAL, longitude REAL, name TEXT, power REAL, direct INTEGER, known INTEGER);
CREATE TABLE places (id INTEGER PRIMARY KEY, kind INTEGER, name TEXT, context TEXT, latitude REAL, longitude REAL);
CREATE VIRTUAL TABLE names USING fts5(
    name, context, spelling, content='', prefix='1 2 3', tokenize="unicode61 remove_diacritics 2");
"""


def write_index(
    path: Path, settlements: Sequence[Named], objects: Iterable[Named | Station]
) -> dict[str, int]:
    """Write the index of a map. O(objects log objects).

    Parameters
    ----------
    path : Path
        Is replaced.
    settlements : sequence of Named
        Their names are shown beside streets and houses near them.
    objects : iterable of Named or Station

    Returns
    -------
    dict
        Number of `places` and of `stations`.
    """
    path.unlink(missing_ok=True)
    nearest = _Nearest(settlements)
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(SCHEMA)
        for batch in _batches(objects, 20_000):
            stations = [astuple(item) for item in batch if isinstance(item, Station)]
            database.executemany("INSERT INTO stations VALUES (?, ?, ?, ?, ?, ?)", stations)
            named = [item for item in batch if isinstance(item, Named)]
            database.executemany("INSERT INTO read VALUES (?, ?, ?, ?, ?)", _rows(named, nearest))
        database.execute(
            "INSERT INTO places (kind, name, context, latitude, longitude) "
            "SELECT kind, name, context, avg(latitude), avg(longitude) FROM read "
            "GROUP BY kind, name, context ORDER BY kind, length(name), name, context"
        )
        rows = database.execute("SELECT id, name, context FROM places")
        database.executemany(
            "INSERT INTO names (rowid, name, context, spelling) VALUES (?, ?, ?, ?)",
            ((k, name, context, _spelling(f"{name} {context}")) for k, name, context in rows),
        )
        database.execute("DROP TABLE read")
        return {
            table: int(database.execute(f"SELECT count(*) FROM {table}").fetchone()[0])
            for table in ("places", "stations")
        }


def _rows(named: Sequence[Named], nearest: _Nearest) -> Iterator[tuple[Any, ...]]:
    for item, settlement in zip(named, nearest.names(named), strict=True):
        name, context = item.name, item.city or settlement
        if item.kind == "house":
            name = f"{item.street} {name}"
        elif name == context:
            context = ""
        yield KINDS.index(item.kind), name, context, item.latitude_deg, item.longitude_deg


def _batches(objects: Iterable[Any], size: int) -> Iterator[list[Any]]:
    rest = iter(objects)
    while batch := list(itertools.islice(rest, size)):
        yield batch


def _spelling(text: str) -> str:
    """The words of a text as they are typed without their letters, empty where that is the same."""
    plain = text.lower().translate(SPELLINGS)
    return plain if plain != text.lower() else ""


class _Nearest:
    """The settlement nearest to each object."""

    def __init__(self, settlements: Sequence[Named]) -> None:
        from scipy.spatial import cKDTree

        large = [s for s in settlements if s.kind in ("city", "town", "village")] or list(settlements)
        self.known = [s.name for s in large]
        self.tree = cKDTree(_plane(large)) if large else None

    def names(self, objects: Sequence[Named]) -> list[str]:
        """Its name for each object; empty where none is near."""
        if self.tree is None or not objects:
            return [""] * len(objects)
        distance, index = self.tree.query(_plane(objects))
        return [
            self.known[int(k)] if off <= FAR_FROM_SETTLEMENT_DEG else ""
            for off, k in zip(distance, index, strict=True)
        ]


def _plane(objects: Sequence[Named]) -> Any:
    """Latitudes and longitudes on one scale: good enough to compare distances of some kilometres."""
    table = np.array([(item.latitude_deg, item.longitude_deg) for item in objects])
    table[:, 1] *= np.cos(np.radians(table[:, 0]))
    return table


class PlaceIndex:
    """The places and stations of a map.

    Parameters
    ----------
    path : Path
        Written by `write_index`.

    Raises
    ------
    InvalidInput
        When it is none.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            uri = f"{path.resolve().as_uri()}?mode=ro"
            self.database = sqlite3.connect(uri, uri=True, check_same_thread=False)
            self.database.execute("SELECT count(*) FROM stations").fetchone()
        except sqlite3.Error as error:
            fix = "build the map again with tripwatt map build"
            raise InvalidInput.of("no index of places", str(path), str(error)[:80], fix=fix) from error

    def search(self, text: str, *, limit: int = 10) -> tuple[Place, ...]:
        """Places whose name begins with the words of a text, the most important first.

        Every word has to begin a word of the name or of the settlement around it. Accents and case do not count. Where nothing does, the
        places with the most similar names. Of places with one name that lie close together the most important is given.

        Parameters
        ----------
        text : str
            Words, for example "Landstr 12 Vaduz".
        limit : int
            Most places.

        Returns
        -------
        tuple of Place
            Empty where there is none.
        """
        words = WORD.findall(text[:LONGEST_TEXT])[:MOST_WORDS]
        if not words:
            return ()
        query = " ".join(f'"{word}"*' for word in words)
        rows = self._matching(query)
        whole = " ".join(words).lower()
        rows.sort(key=lambda row: _order(row, whole))
        return without_twins(map(_place, rows or self._similar(whole)))[: min(limit, MOST_FOUND)]

    def _matching(self, query: str) -> list[tuple[Any, ...]]:
        """Rows of the first places by a query of the full-text search, in the order of their importance."""
        joined = f"{COLUMNS} names JOIN places ON places.id = names.rowid"
        ordered = f"{joined} WHERE names MATCH ? ORDER BY names.rowid LIMIT ?"
        return self.database.execute(ordered, (query, CANDIDATES)).fetchall()

    def _similar(self, typed: str) -> list[tuple[Any, ...]]:
        """Rows whose names are most similar to a text, the most similar first. O(compared names)."""
        rows = self.database.execute(
            f"{COLUMNS} places WHERE id < ? ORDER BY id LIMIT ?", (self._first_street, MOST_COMPARED)
        ).fetchall()
        rows += self._matching(f'"{typed.split()[0][:SAME_LETTERS]}"*')
        by_name: dict[str, list[tuple[Any, ...]]] = {}
        for row in dict.fromkeys(rows):
            by_name.setdefault(row[1].lower(), []).append(row)
        text = typed[:LONGEST_COMPARED]
        near = difflib.get_close_matches(text, by_name, n=MOST_FOUND, cutoff=LEAST_SIMILAR)
        return [row for name in near for row in by_name[name]]

    def settlements(
        self, south: float, west: float, north: float, east: float, limit: int
    ) -> tuple[Place, ...]:
        """Settlements inside of bounds [°], cities first, then towns, villages and what is smaller. O(settlements)."""
        rows = self.database.execute(
            "SELECT kind, name, latitude, longitude FROM places WHERE id < ? AND latitude BETWEEN ? AND ? "
            "AND longitude BETWEEN ? AND ? ORDER BY id LIMIT ?",
            (self._first_street, south, north, west, east, limit),
        ).fetchall()
        return tuple(Place(lat, lon, name, KINDS[kind]) for kind, name, lat, lon in rows)

    @cached_property
    def _first_street(self) -> int:
        """Id above those of all settlements: places are written in the order of their kinds."""
        row = self.database.execute(
            "SELECT id FROM places WHERE kind >= ? ORDER BY id LIMIT 1", (SETTLEMENT,)
        ).fetchone()
        return sys.maxsize if row is None else int(row[0])

    def stations(self) -> tuple[Station, ...]:
        """All charging stations."""
        rows = self.database.execute("SELECT * FROM stations").fetchall()
        return tuple(
            Station(lat, lon, name, w, bool(dc), bool(known)) for lat, lon, name, w, dc, known in rows
        )


def _place(row: tuple[Any, ...]) -> Place:
    kind, name, context, latitude, longitude = row
    return Place(latitude, longitude, f"{name}, {context}" if context else name, KINDS[kind])


def _order(row: tuple[Any, ...], whole: str) -> tuple[bool, bool, int, int]:
    """The whole name first, then what begins with the text, then the kind of place, then short names."""
    kind, name = row[0], " ".join(WORD.findall(row[1])).lower()
    return (name != whole, not name.startswith(whole), kind, len(name))
