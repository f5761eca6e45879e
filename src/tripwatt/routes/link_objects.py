"""Routes from links that a user writes: objects, or rows of a data frame or a CSV table, with a length, a speed or a time, and a slope."""

from __future__ import annotations

import csv
import io
import itertools
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import NoneType
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, by_key, running_sum
from tripwatt.errors import (
    MAX_FAULTS,
    MAX_HINTS,
    Fault,
    InvalidInput,
    and_more,
    excerpt,
    first_faults,
    raise_faults,
)
from tripwatt.files import file_head
from tripwatt.routes.links import FASTEST_LINK_M_S, FLAT_ROAD, MAX_LINKS, LinkRoute
from tripwatt.trips import LINK_COLUMNS, STEEPEST_GRADE, Flag
from tripwatt.trips.columns import IN_KM_H
from tripwatt.trips.elevation import HEIGHT_NOISE_M
from tripwatt.trips.headers import DELIMITERS, header_faults, same_quantity

_RELATIVE_ELEVATION: Final = Flag("elevation_relative", "road")

_SUFFIXES: Final = (".gpx", ".kml", ".kmz", ".json", ".geojson")
"""Suffixes of files that are routes whatever they begin with."""

LINK_KEYS: Final = tuple(sorted(LINK_COLUMNS))
"""Keys of a link, see `route_from_links`."""

_LENGTHS: Final = re.compile(r"length|distance|km$")
"""Begin of the names that the length of a link may have."""

_HARMLESS: Final = {key: 0.0 if key in ("grade", "stop_s") else 1.0 for key in LINK_KEYS}
"""Replacement of a value that is not a finite number, so that only one fault is reported for it."""


def route_from_links(links: Iterable[Mapping[str, float | None]] | pd.DataFrame) -> LinkRoute:
    """Make a route from links. O(links).

    Parameters
    ----------
    links : iterable of mapping, or DataFrame
        Each with `length_m` [m] and either `speed_m_s`, the mean speed including every standstill [m/s], or
        `travel_time_s` [s]. Optional: `stop_s`, the standstill at the end of the link (part of the travel time; 0 means
        that the car does not stop), `moving_speed_m_s`, the speed while nothing stands in the way, `speed_limit_m_s`,
        and either `grade` or `start_elevation_m` and `end_elevation_m` [m]. A value of None, or NaN in a DataFrame, counts as
        not given.

    Returns
    -------
    LinkRoute
        In the order of the links.

    Raises
    ------
    InvalidInput
        With every fault of every link.

    Examples
    --------
    >>> route = route_from_links([{"length_m": 500.0, "speed_m_s": 10.0, "grade": 0.02},
    ...                           {"length_m": 1000.0, "travel_time_s": 60.0, "grade": -0.01}])
    >>> route.duration_s, route.elevation_at([500.0, 1500.0]), route.flags[0].code
    (110.0, array([10.,  0.]), 'elevation_relative')
    """
    rows: Iterable[object] = links
    if isinstance(links, pd.DataFrame):
        raise_faults(link_header_faults([*map(str, links)], "links"))
        rows = links.astype(object).where(links.notna(), None).to_dict("records")
    columns, faults = columns_of_links(list(itertools.islice(rows, MAX_LINKS + 1)))
    raise_faults(faults)
    return route_from_columns(columns)


def route_from_columns(columns: Mapping[str, FloatArray]) -> LinkRoute:
    """A route from columns of `columns_of_links` that have no faults."""
    length, time, limit = (columns[key] for key in ("length_m", "travel_time_s", "speed_limit_m_s"))
    with np.errstate(over="ignore"):  # `LinkRoute` reports values out of bounds
        time = np.where(np.isnan(time), length / columns["speed_m_s"], time)
    position, height, flags = _elevation(columns)
    limits = limit if np.isfinite(limit).any() else None
    stop, moving = columns["stop_s"], columns["moving_speed_m_s"]
    return LinkRoute(length, time, stop, moving, position, height, flags, limits)


def route_with_elevation(
    route: LinkRoute, position_m: npt.ArrayLike, elevation_m: npt.ArrayLike
) -> LinkRoute:
    """A copy of a route with these heights [m] at distances from its start [m], both of shape (heights,), instead of its own."""
    flags = tuple(flag for flag in route.flags if flag != FLAT_ROAD)
    position, height = (np.asarray(values, dtype=np.float64) for values in (position_m, elevation_m))
    return replace(route, elevation_position_m=position, elevation_m=height, flags=flags)


def fields_of_route(route: LinkRoute) -> dict[str, Any]:
    """The fields `links` and `elevation` of a request for a route: the inverse of `route_from_links` and `route_with_elevation`.

    Examples
    --------
    >>> fields_of_route(route_from_links([{"length_m": 100.0, "speed_m_s": 10.0}]))
    {'links': [{'length_m': 100.0, 'travel_time_s': 10.0}], 'elevation': None}
    """
    names = "length_m", "travel_time_s", "stop_s", "moving_speed_m_s", "speed_limit_m_s"
    columns = {name: values for name in names if (values := getattr(route, name)) is not None}
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    links = [{n: v for n, v in zip(columns, row, strict=True) if v == v} for row in rows]
    heights = {"position_m": route.elevation_position_m, "elevation_m": route.elevation_m}
    known = {name: values.tolist() for name, values in heights.items() if values is not None}
    return {"links": links, "elevation": known or None}


@dataclass(slots=True)
class _Faults:
    """Faults of links, in the order of the rules."""

    where: str
    faults: list[Fault] = field(default_factory=list)

    def add(
        self, what: str, wrong: BoolArray, key: str, got: Callable[[int], str], allowed: str, fix: str = ""
    ) -> None:
        """Add the faults of one kind.

        `got` takes the index of a wrong link. `key` is empty if the link as a whole is wrong.
        """
        bad = np.flatnonzero(wrong).tolist() if wrong.any() else []
        # up to three faults are listed one by one; of more, only the first is listed and the others are counted
        listed, count = (bad, "") if len(bad) <= 3 else (bad[:1], and_more(bad, "link"))
        for k in listed:
            place = f"{self.where}link {k + 1}{key and ', ' + key}"
            at = (k, key) if key else (k,)
            self.faults.append(Fault(what, place, got(k) + count, allowed, fix, at=at))


def columns_of_links(links: Sequence[object], where: str = "") -> tuple[dict[str, FloatArray], list[Fault]]:
    """The values of links as columns by key (NaN = not given), and the faults of the links. O(links).

    Parameters
    ----------
    links : sequence
        Objects with the keys of `route_from_links`.
    where : str
        Text before the number of a link in messages.

    Examples
    --------
    >>> columns, faults = columns_of_links([{"length_m": 5.0, "speed_m_s": 1.0}, {"length_m": -5.0, "speed_m_s": 1.0}])
    >>> columns["length_m"].tolist(), str(faults[0])
    ([5.0, -5.0], 'link out of range: link 2, length_m: got -5; allowed: more than 0')
    """
    if not links:
        raise InvalidInput.of("no links", "links", "0", "at least one link")
    wrong = _Faults(where)
    if len(links) > MAX_LINKS:
        got, allowed = f"more than {MAX_LINKS}", f"at most {MAX_LINKS}"
        wrong.faults.append(Fault("too many links", "links", got, allowed))
    is_mapping = {kind: issubclass(kind, Mapping) for kind in set(map(type, links))}
    no_link = np.array([not is_mapping[type(link)] for link in links])
    wrong.add("not a link", no_link, "", lambda k: excerpt(links[k]), "an object with length_m and speed_m_s")
    rows: list[Any] = [{} if wrong_kind else link for link, wrong_kind in zip(links, no_link, strict=True)]
    given = set[Any]().union(*rows)
    if not given <= LINK_COLUMNS.keys():
        _unknown_keys(rows, wrong)
    columns = {key: np.full(len(rows), np.nan) for key in LINK_KEYS}
    columns |= {
        key: _column_values([row.get(key) for row in rows], key, wrong) for key in LINK_KEYS if key in given
    }
    _missing_keys(columns, ~no_link, wrong)
    for key in ("length_m", "speed_m_s", "travel_time_s"):
        not_positive = columns[key] <= 0.0
        wrong.add("link out of range", not_positive, key, _formatter(columns[key]), "more than 0")
    speed, allowed = columns["speed_m_s"], f"more than 0, at most {FASTEST_LINK_M_S:g} m/s"
    wrong.add("link out of range", speed > FASTEST_LINK_M_S, "speed_m_s", _formatter(speed), allowed, IN_KM_H)
    with np.errstate(all="ignore"):  # a length of 0 is named above
        rise = columns["end_elevation_m"] - columns["start_elevation_m"]
        slope, noise = rise / columns["length_m"], HEIGHT_NOISE_M / columns["length_m"]
    allowed = f"-{STEEPEST_GRADE} to {STEEPEST_GRADE}"
    for key, grade, margin in (("grade", columns["grade"], 0.0), ("end_elevation_m", slope, noise)):
        too_steep = np.abs(grade) > STEEPEST_GRADE + margin
        wrong.add("grade out of range", too_steep, key, _formatter(grade), allowed)
    return columns, first_faults(wrong.faults, "links", MAX_FAULTS + 1)


def _formatter(values: FloatArray) -> Callable[[int], str]:
    return lambda k: f"{values[k]:g}"


def _key_hint(key: object) -> str:
    """A question with the link key of the same quantity; an empty text if there is no such key.

    Examples
    --------
    >>> _key_hint("speed_km_h"), _key_hint("km"), _key_hint("colour")
    ('did you mean speed_m_s?', 'did you mean length_m?', '')
    """
    near = "length_m" if _LENGTHS.match(f"{key}") else same_quantity(key, LINK_KEYS, cutoff=0.8)
    return f"did you mean {near}?" if near else ""


def link_header_faults(names: Sequence[str], where: str) -> list[Fault]:
    """The faults in the header of a table of links; each is reported once, not for every link.

    Examples
    --------
    >>> [str(fault) for fault in link_header_faults(["length_m"], "links")]
    ['missing column: links: got length_m; allowed: speed_m_s or travel_time_s']
    """
    return [
        *header_faults(names, LINK_KEYS, where, "unknown column", _key_hint),
        *(
            Fault("missing column", where, ", ".join(names)[:120], " or ".join(needed))
            for needed in (("length_m",), ("speed_m_s", "travel_time_s"))
            if not set(needed) & set(names)
        ),
    ]


def _unknown_keys(rows: Sequence[Mapping[str, Any]], wrong: _Faults) -> None:
    """Add the faults of unknown keys, each with its links; of more than `MAX_FAULTS` keys, the rest is counted."""
    places = ((key, k) for k, row in enumerate(rows) for key in row if key not in LINK_COLUMNS)
    unknown = by_key(places, lambda place: place[0])
    allowed = ", ".join(LINK_KEYS)
    for number, (name, its) in enumerate(itertools.islice(unknown.items(), MAX_FAULTS)):
        where = [k for _, k in its]
        hint, got = _key_hint(name) if number < MAX_HINTS else "", dict.fromkeys(where, excerpt(name))
        has_key = np.isin(np.arange(len(rows)), where)
        wrong.add("unknown key", has_key, "", got.__getitem__, allowed, hint)
    if len(unknown) > MAX_FAULTS:
        wrong.faults.append(Fault("unknown key", "links", f"{len(unknown) - MAX_FAULTS} more", allowed))


def _column_values(values: Sequence[object], key: str, wrong: _Faults) -> FloatArray:
    """Values of one key, NaN if not given; `_HARMLESS` replaces a value that is not a finite number, which is a fault."""
    cells: list[Any] = list(values)
    if not set(map(type, cells)) <= {float, int, NoneType}:
        no_number = np.array([isinstance(v, bool) or not isinstance(v, int | float | None) for v in cells])
        wrong.add("not a number", no_number, key, lambda k: excerpt(values[k]), "a number")
        cells = [_HARMLESS[key] if bad else value for value, bad in zip(cells, no_number, strict=True)]
    try:
        numbers = np.array(cells, dtype=np.float64)
    except OverflowError:
        largest = sys.float_info.max
        numbers = np.array([np.nan if v is None else np.inf if abs(v) > largest else v for v in cells])
    endless = ~np.isfinite(numbers)
    if endless.any():
        endless &= np.array([value is not None for value in cells])
        wrong.add("not a finite number", endless, key, lambda k: excerpt(values[k]), "a finite number")
        numbers[endless] = _HARMLESS[key]
    return numbers


def _missing_keys(columns: Mapping[str, FloatArray], is_link: BoolArray, wrong: _Faults) -> None:
    """Add the faults of missing keys, and of keys of which only one may be given."""
    is_given = {key: ~np.isnan(values) for key, values in columns.items()}

    def given_keys(k: int) -> str:
        return f"{[key for key in LINK_KEYS if is_given[key][k]]}"

    wrong.add("missing key", is_link & ~is_given["length_m"], "", given_keys, "length_m")
    speed, time = is_given["speed_m_s"], is_given["travel_time_s"]
    allowed = "either speed_m_s or travel_time_s"
    wrong.add("speed and travel time mixed", speed & time, "", given_keys, allowed)
    wrong.add("speed is missing", is_link & ~speed & ~time, "", given_keys, allowed)
    start, end, grade = is_given["start_elevation_m"], is_given["end_elevation_m"], is_given["grade"]
    allowed = "either grade or start_elevation_m and end_elevation_m"
    wrong.add("grade and elevation mixed", grade & (start | end), "", given_keys, allowed)
    wrong.add("elevation at one end only", (start != end) & ~grade, "", given_keys, allowed)


def _elevation(
    columns: Mapping[str, FloatArray],
) -> tuple[FloatArray | None, FloatArray | None, tuple[Flag, ...]]:
    """Positions, heights and flags of a route, from the heights at the ends of its links or from their grades.

    If only some links have heights, those without are interpolated. If only some have grades, those without are level. Returns
    None for positions and heights if no link has either.
    """
    border = running_sum(columns["length_m"])
    start, end, grade = columns["start_elevation_m"], columns["end_elevation_m"], columns["grade"]
    if np.isfinite(start).any():
        # two links may have different heights where they meet, so each link keeps its own two heights
        position = np.column_stack((border[:-1], border[1:])).ravel()
        height = np.column_stack((start, end)).ravel()
        if np.isfinite(grade).any():
            got = "grade on some links and elevation on others"
            allowed = "the same one of the two on all links"
            raise InvalidInput.of("grade and elevation mixed", "links", got, allowed)
        known = np.isfinite(height)
        flags = () if known.all() else (Flag("elevation_interpolated", "links"),)
        return position[known], height[known], flags
    if np.isfinite(grade).any():
        rise = np.nan_to_num(grade, nan=0.0) * columns["length_m"]
        height = running_sum(rise)
        return border, height - height.min(), (_RELATIVE_ELEVATION,)
    return None, None, (FLAT_ROAD,)


def is_links_table(data: bytes) -> bool:
    r"""Whether a text begins with the header of a table of links: it has a length and no time of samples, and is not JSON.

    Parameters
    ----------
    data : bytes
        The text, or its beginning.

    Returns
    -------
    bool
        Decided by the first 4000 bytes of the first line.

    Examples
    --------
    >>> [is_links_table(text) for text in (b"length_m,speed_m_s\n", b"km,speed\n", b"time_s,speed_m_s\n", b'[{"time":1,"length":2}]')]
    [True, True, False, False]
    """
    names = _header_cells(data.partition(b"\n")[0][:4000].decode("utf-8-sig", "replace"))[0]
    return any(map(_LENGTHS.match, names)) and not any(n.startswith(("time", "{", "[")) for n in names)


def is_route(path: Path | str) -> bool:
    r"""Whether a file is to be read as a route, by its suffix or its beginning.

    True for a file with the suffix gpx, kml, kmz, json or geojson, for a text that begins like XML or JSON, and for a table of links.

    Parameters
    ----------
    path : str or Path
        A file.

    Returns
    -------
    bool
        False if there is no such file.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "links.csv")
    ...     _ = file.write_text("length_m,speed_m_s\n500,10\n")
    ...     is_route(file), is_route(folder)
    (True, False)
    """
    path = Path(path)
    if path.suffix.lower() in _SUFFIXES:
        return path.is_file()
    head = file_head(path)
    return head.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"<", b"{", b"[") or is_links_table(head)


def route_from_table(data: bytes, where: str = "links") -> LinkRoute:
    r"""Read links from a CSV table with a header and comma, semicolon, tab or bar between cells. O(bytes).

    Columns are those of `route_from_links`; an empty cell is a value not given. A decimal comma is read unless commas separate
    the cells.

    Parameters
    ----------
    data : bytes
        The text in UTF-8.
    where : str
        Name for messages.

    Returns
    -------
    LinkRoute
        One link for each row.

    Raises
    ------
    InvalidInput
        With every fault of the header and of the cells.

    Examples
    --------
    >>> route_from_table(b"length_m,speed_m_s,stop_s\n500,10,\n250,5,20\n").duration_s
    100.0
    """
    try:
        text = data.decode("utf-8-sig")
        names, delimiter = _header_cells(text.partition("\n")[0])
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        filled = (row for row in itertools.islice(reader, 1, None) if any(cell.strip() for cell in row))
        rows = list(itertools.islice(filled, MAX_LINKS + 1))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InvalidInput.of("not a table", where, str(error)[:120], "CSV in UTF-8") from error
    raise_faults(link_header_faults(names, where))
    faults = [
        Fault("too many cells", f"{where}, link {k}", f"{len(row)}", f"{len(names)}")
        for k, row in enumerate(rows, start=1)
        if len(row) > len(names)
    ]
    comma = delimiter != ","
    links = [{name: _cell_value(cell, comma) for name, cell in zip(names, row, strict=False)} for row in rows]
    columns, link_faults = columns_of_links(links, f"{where}, ")
    raise_faults([*link_faults, *first_faults(faults, where)])
    return route_from_columns(columns)


def _header_cells(header: str) -> tuple[list[str], str]:
    """The names of the columns, and the delimiter between them."""
    delimiter = max(DELIMITERS, key=header.count)
    return [name.strip().strip('"').strip().lower() for name in header.split(delimiter)], delimiter


def _cell_value(cell: str, decimal_comma: bool) -> float | str | None:
    """The number in a cell; None if the cell is empty, its text if it is not a number."""
    text = cell.strip()
    try:
        return float(text.replace(",", ".") if decimal_comma else text) if text else None
    except ValueError:
        return text
