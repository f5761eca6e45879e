"""What clients share: places, such as those in a queue, of which none can take all."""

from __future__ import annotations

import ipaddress
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

from tripwatt.server.http.problems import Problem

CLIENT: Final[ContextVar[str]] = ContextVar("client", default="")
"""Key of the client whose request a task answers, as `client_key` returns it; empty for work of the service itself."""


def unmapped(host: str) -> str:
    """Return an address; an IPv4 address that is written as an IPv6 one becomes IPv4.

    Examples
    --------
    >>> unmapped("::ffff:192.0.2.7"), unmapped("2001:db8::1"), unmapped("unix")
    ('192.0.2.7', '2001:db8::1', 'unix')
    """
    try:
        mapped = ipaddress.IPv6Address(host).ipv4_mapped
    except ValueError:
        return host
    return host if mapped is None else f"{mapped}"


def client_key(host: str) -> str:
    """Return the key of the client at an address: the address, or the network /64 of an IPv6 address, because one client has all of it.

    Examples
    --------
    >>> client_key("::ffff:192.0.2.7"), client_key("2001:db8::1") == client_key("2001:db8::2")
    ('192.0.2.7', True)
    """
    try:
        return f"{ipaddress.IPv6Interface((unmapped(host).partition('%')[0], 64)).network}"
    except ValueError:
        return unmapped(host)


class Places:
    """Places that clients share: a client may take no more than it leaves free, so that others find some.

    Parameters
    ----------
    most : int
        All places.
    refusal : str
        Why a client gets none.
    headers : mapping of str to str
        Headers of the response then.

    Attributes
    ----------
    taken : Counter
        Places by client.
    """

    def __init__(self, most: int, refusal: str, headers: Mapping[str, str]) -> None:
        self.most, self.refusal, self.headers = most, refusal, headers
        self.taken: Counter[str] = Counter()

    def require(self, count: int = 1) -> None:
        """Check that the client of this task may take so many places.

        Raises
        ------
        Problem
            `busy`.
        """
        if self.taken[CLIENT.get()] + count > self.most - self.taken.total():
            raise Problem("busy", self.refusal, headers=self.headers)

    def add(self, count: int) -> None:
        """Take places, or give them back if `count` is negative."""
        self.taken[CLIENT.get()] += count
        self.taken += Counter()  # without clients that have none

    @contextmanager
    def held(self, *, may_exceed: bool = False) -> Iterator[None]:
        """Hold one place; raises as `require` does unless it `may_exceed` the share of the client."""
        if not may_exceed:
            self.require()
        self.add(1)
        try:
            yield
        finally:
            self.add(-1)
