"""Routers behind one protocol: Valhalla as a library or a server, and servers of OSRM, GraphHopper, openrouteservice."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final

from tripwatt.errors import InvalidInput
from tripwatt.roads.routers.road import Edges, Road, Router, join_edges
from tripwatt.roads.routers.servers import SERVERS, ServerRouter
from tripwatt.roads.routers.valhalla import ValhallaRouter
from tripwatt.routes.web import require_url

__all__ = [
    "ROUTER_KINDS",
    "Edges",
    "Road",
    "Router",
    "ValhallaRouter",
    "is_server",
    "join_edges",
    "open_server",
    "split_kind",
]

ROUTER_KINDS: Final[Mapping[str, Callable[[str], Router]]] = {
    "valhalla": ValhallaRouter.from_url,
    **{kind: partial(ServerRouter.from_url, kind) for kind in SERVERS},
}
"""Function that opens a router by the URL of its server, for each kind of server."""


def split_kind(text: str, kinds: Mapping[str, object], where: str) -> tuple[str, str]:
    """Split a text `KIND=URL` into kind and URL; the kind of a plain URL is the first of `kinds`.

    Raises
    ------
    InvalidInput
        If the kind is unknown, or the URL is not that of a server.

    Examples
    --------
    >>> split_kind("osrm=http://127.0.0.1:5000/", ROUTER_KINDS, "--router")
    ('osrm', 'http://127.0.0.1:5000')
    """
    kind, mark, url = text.partition("=")
    if not mark or "://" in kind:
        kind, url = next(iter(kinds)), text
    if kind not in kinds:
        raise InvalidInput.of("unknown kind of server", where, kind[:40], ", ".join(kinds))
    return kind, require_url(url, where)


def open_server(text: str, where: str = "--router") -> Router:
    """Open a router by the URL of its server: `KIND=URL`, or the plain URL of a Valhalla server.

    Raises
    ------
    InvalidInput
        As in `split_kind`.

    Examples
    --------
    >>> open_server("osrm=http://127.0.0.1:5000").kind
    'osrm'
    """
    kind, url = split_kind(text, ROUTER_KINDS, where)
    return ROUTER_KINDS[kind](url)


def is_server(text: str) -> bool:
    """Return whether a text names a server rather than a folder.

    Examples
    --------
    >>> is_server("osrm=http://127.0.0.1:5000"), is_server("maps/liechtenstein"), is_server("http://[::1]:8002")
    (True, False, True)
    """
    return "://" in text and not Path(text).exists()
