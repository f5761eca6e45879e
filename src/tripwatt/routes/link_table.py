"""A CSV table of links."""

from __future__ import annotations

import csv
import io
import itertools
from collections import Counter
from typing import Final

from tripwatt.errors import MOST_FAULTS, MOST_HINTS, Fault, InvalidInput, excerpt, first_faults
from tripwatt.routes.link_objects import (
    ALLOWED_KEYS,
    LINK_KEYS,
    harmless,
    route_from_links,
    unit_hint,
)
from tripwatt.routes.links import MOST_LINKS, LinkRoute

DELIMITERS: Final = (";", "\t", ",")


def is_links_table(data: bytes) -> bool:
    r"""Tell whether a text begins with a header of a table of links: a length in it, and no time of samples.

    Parameters
    ----------
    data : bytes
        The text, or its beginning.

    Returns
    -------
    bool
        Of a long first line the first 4000 bytes count.

    Examples
    --------
    >>> is_links_table(b"length_m,speed_m_s\n"), is_links_table(b"time_s,speed_m_s\n"), is_links_table(b"<gpx/>")
    (True, False, False)
    """
    names = _cells(data.partition(b"\n")[0][:4000].decode("utf-8-sig", "replace"))[0]
    return any(n.startswith("length") for n in names) and not any(n.startswith("time") for n in names)


def route_from_table(data: bytes, where: str = "links") -> LinkRoute:
    r"""Read links from a CSV table with a header: comma, semicolon or tab between cells. O(bytes).

    Columns are those of `route_from_links`; an empty cell is not given. With semicolons or tabs a decimal comma is read.

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
        names, delimiter = _cells(text.partition("\n")[0])
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        filled = (row for row in itertools.islice(reader, 1, None) if any(cell.strip() for cell in row))
        rows = list(itertools.islice(filled, MOST_LINKS + 1))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InvalidInput.of("not a table", where, str(error)[:120], "CSV in UTF-8") from error
    unknown = [name for name in names if name not in LINK_KEYS]
    faults = first_faults(
        [
            Fault(
                "unknown column",
                f"{where}, column {name[:40]!r}",
                name[:40],
                ALLOWED_KEYS,
                unit_hint(name) if k < MOST_HINTS else "",
            )
            for k, name in enumerate(unknown)
        ],
        where,
    )
    counts = Counter(name for name in names if name in LINK_KEYS)
    faults += [
        Fault("duplicate column", f"{where}, column {name!r}", f"{count} times", "once")
        for name, count in sorted(counts.items())
        if count > 1
    ]
    if "length_m" not in names:
        faults.append(Fault("missing column", where, ", ".join(names)[:120], "length_m"))
    if not {"speed_m_s", "travel_time_s"} & set(names):
        faults.append(Fault("missing column", where, ", ".join(names)[:120], "speed_m_s or travel_time_s"))
    links: list[dict[str, float | None]] = []
    wrong: list[Fault] = []
    for row in rows:
        place = f"{where}, link {len(links) + 1}"
        if len(row) > len(names):
            wrong.append(Fault("too many cells", place, f"{len(row)}", f"{len(names)}"))
        cells = zip(names, row, strict=False)
        links.append({n: _number(c, n, place, delimiter, wrong) for n, c in cells if n in LINK_KEYS})
        if len(wrong) > MOST_FAULTS:
            break
    if faults:  # a header that is wrong makes every link wrong: named once
        raise InvalidInput([*faults, *wrong])
    try:
        route = route_from_links(links)
    except InvalidInput as error:
        raise InvalidInput([*wrong, *error.faults]) from error
    if wrong:
        raise InvalidInput(wrong)
    return route


def _cells(header: str) -> tuple[list[str], str]:
    """Names of the columns, and what is between them."""
    delimiter = max(DELIMITERS, key=header.count)
    return [name.strip().strip('"').strip().lower() for name in header.split(delimiter)], delimiter


def _number(cell: str, name: str, where: str, delimiter: str, faults: list[Fault]) -> float | None:
    text = cell.strip()
    if not text:
        return None
    try:
        return float(text if delimiter == "," else text.replace(",", "."))
    except ValueError:
        got = excerpt(text)
        faults.append(Fault("not a number", f"{where}, {name}", got, "a number, or an empty cell"))
        return harmless(name)
