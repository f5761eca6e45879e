"""A CSV table of links."""

from __future__ import annotations

import csv
import io
import itertools

from tripwatt.errors import Fault, InvalidInput, first_faults, raise_faults
from tripwatt.routes.link_objects import columns_of_links, link_header_faults, route_from_columns
from tripwatt.routes.links import MAX_LINKS, LinkRoute
from tripwatt.trips.headers import DELIMITERS


def is_links_table(data: bytes) -> bool:
    r"""Whether a text begins with the header of a table of links: it has a length and no time of samples.

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
    >>> is_links_table(b"length_m,speed_m_s\n"), is_links_table(b"time_s,speed_m_s\n"), is_links_table(b"<gpx/>")
    (True, False, False)
    """
    names = _header_cells(data.partition(b"\n")[0][:4000].decode("utf-8-sig", "replace"))[0]
    return any(n.startswith("length") for n in names) and not any(n.startswith("time") for n in names)


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
