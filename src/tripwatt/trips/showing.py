"""How objects of the library look in a notebook: small HTML tables, nothing that is executed."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from tripwatt.trips.messages import period


def html_table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """A table of names and values with a caption; every text is escaped.

    Examples
    --------
    >>> html_table("Trip", [("distance", "1.2 km")])
    '<table><caption>Trip</caption><tr><th scope="row">distance</th><td>1.2 km</td></tr></table>'
    """
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>' for name, value in rows
    )
    return f"<table><caption>{escape(title)}</caption>{body}</table>"


def journey(distance_m: float, duration_s: float) -> str:
    """Distance and duration of a drive, for people.

    Examples
    --------
    >>> journey(12_345.0, 1500.0), journey(120.0, 30.0)
    ('12.3 km in 25 min', '0.1 km in 30 s')
    """
    return f"{distance_m / 1000.0:.1f} km in {period(duration_s)}"
