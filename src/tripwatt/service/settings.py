"""What is decided when the service starts, and never by a request."""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

from tripwatt.errors import Fault, InvalidInput

TOKEN_VARIABLE: Final = "TRIPWATT_TOKEN"
"""Environment variable of the bearer token."""

LEAST_TOKEN: Final = 16
"""Fewest characters of a token: shorter ones can be guessed."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What one request, one client and the whole service may ask for.

    Attributes
    ----------
    body_bytes : int
        Largest body of a request.
    batch_bytes : int
        Largest body of a batch.
    samples : int
        Most samples of a trip, and of what was measured on it.
    links : int
        Most links or points of a route.
    duration_s : float
        Longest trip; the work of a forecast grows with the square of it.
    batch : int
        Most trips of a batch.
    waiting : int
        Most requests that wait for a worker; more are turned away.
    bodies : int
        Most bodies that are received at a time, besides batches; more are turned away.
    batches : int
        Most batches at a time; more are turned away.
    timeout_s : float
        Longest time from the arrival of a request to its answer, the wait included.
    body_timeout_s : float
        Longest time that the body of a request may take to arrive.
    rate_per_s : float
        Requests of one client, on average; 0 for any number. A batch counts once.
    burst : int
        Requests of one client at once.
    """

    body_bytes: int = 4_000_000
    batch_bytes: int = 64_000_000
    samples: int = 50_000
    links: int = 20_000
    duration_s: float = 12 * 3600.0
    batch: int = 5_000
    waiting: int = 64
    bodies: int = 128
    batches: int = 2
    timeout_s: float = 20.0
    body_timeout_s: float = 20.0
    rate_per_s: float = 50.0
    burst: int = 100


@dataclass(frozen=True, slots=True)
class Settings:
    """One service.

    Attributes
    ----------
    models : mapping of str to Path, or None
        Name -> folder; the first one is meant where a request names none. Empty for the model of the package.
    host : str
    port : int
        0 for one that is free.
    workers : int
        Processes that compute.
    token : str
        Bearer token that is asked for; empty for none.
    limits : Limits
    """

    models: Mapping[str, Path] = field(default_factory=lambda: MappingProxyType({}))
    host: str = "127.0.0.1"
    port: int = 8000
    workers: int = 2
    token: str = field(default="", repr=False)
    limits: Limits = field(default_factory=Limits)

    @property
    def hosts(self) -> frozenset[str]:
        """Names that a Host header may give; empty for any.

        On loopback a page of another site could reach the service under a name of its own (DNS rebinding); elsewhere
        the token keeps it out.

        Examples
        --------
        >>> "localhost" in Settings().hosts, Settings(host="0.0.0.0").hosts
        (True, frozenset())
        """
        if not is_loopback(self.host):
            return frozenset()
        return frozenset({"localhost", "127.0.0.1", "[::1]", self.host.lower()})


def is_loopback(host: str) -> bool:
    """Whether an address to listen on is reached from this machine only.

    Examples
    --------
    >>> [is_loopback(host) for host in ("127.0.0.1", "::1", "localhost", "0.0.0.0", "::", "192.0.2.7")]
    [True, True, True, False, False, False]
    """
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def parse_limits(pairs: list[str]) -> Limits:
    """Limits from `KEY=VALUE` texts.

    Raises
    ------
    InvalidInput
        With every key that is none and every value that cannot be one.

    Examples
    --------
    >>> parse_limits(["samples=2000"]).samples
    2000
    """
    known = {f.name: f.type for f in fields(Limits)}
    values: dict[str, float] = {}
    faults = []
    for pair in pairs:
        key, _, text = pair.partition("=")
        if key not in known:
            faults.append(Fault("unknown limit", "--limit", pair, ", ".join(known)))
            continue
        try:
            value = float(text) if known[key] == "float" else int(text)
        except ValueError:
            value = -1
        if not 0 <= value < 1e12 or (value == 0 and key != "rate_per_s"):
            allowed = "a number" if known[key] == "float" else "a whole number"
            faults.append(Fault("value out of range", f"--limit {key}", text, f"{allowed} above 0"))
        values[key] = value
    if faults:
        raise InvalidInput(faults)
    return replace(Limits(), **values)  # type: ignore[arg-type] # int and float by the table of fields
