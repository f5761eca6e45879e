"""Settings of the service, fixed at its start."""

from __future__ import annotations

import ipaddress
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Final

from tripwatt.errors import Fault, raise_faults
from tripwatt.roads.journey import AtlasSettings
from tripwatt.server.cars.following import MqttSettings

TOKEN_VARIABLE: Final = "TRIPWATT_TOKEN"
"""Environment variable of the bearer token."""

PASSWORD_VARIABLE: Final = "TRIPWATT_MQTT_PASSWORD"
"""Environment variable of the broker's password."""

SECRETS: Final = (TOKEN_VARIABLE, PASSWORD_VARIABLE, "TRIPWATT_MQTT")
"""Variables that workers, which read the files of strangers, do not get; the URL of a broker may have its password."""

MIN_TOKEN_LENGTH: Final = 16
"""Fewest characters of a token; shorter tokens can be guessed. A choice: 16 random letters have 75 bits."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of requests, clients and the service.

    Attributes
    ----------
    body_bytes : int
        Largest body of a request.
    batch_bytes : int
        Largest body of a batch.
    samples : int
        Most samples of a trip, and of the measurements of an update.
    links : int
        Most links or points of a route.
    duration_s : float
        Longest trip [s], as in the library; longer trips are refused before anything is calculated.
    batch : int
        Most trips of a batch.
    waiting : int
        Most requests that wait for a worker; further requests are refused.
    arriving_bytes : int
        Most bytes of all bodies that are arriving; the request whose body exceeds them is refused.
    batches : int
        Most batches that run at the same time.
    timeout_s : float
        Longest time [s] from the arrival of a request to its response, including the wait for a worker.
    compute_s : float
        Longest computing time [s] of a request about one trip or one distance.
    body_timeout_s : float
        Longest time [s] until the body of a request has arrived.
    upload_bytes : int
        Largest file of logs.
    car_bytes : int
        Most bytes of the files of a car that are not learned yet, as they came and unpacked.
    learn_s : float
        Longest time that learning the trips of an upload may take [s].
    listeners : int
        Most streams of events at the same time; a further one is refused.
    live_every_s : float
        Shortest time [s] between two events of a stream.
    memory_bytes : int
        Most memory that a job may take [bytes], beyond that of a worker without work; on Linux only.
    """

    body_bytes: int = 4_000_000
    batch_bytes: int = 64_000_000
    samples: int = 50_000
    links: int = 20_000
    duration_s: float = 12 * 3600.0
    batch: int = 5_000
    waiting: int = 64
    arriving_bytes: int = 256_000_000
    batches: int = 2
    timeout_s: float = 20.0
    compute_s: float = 10.0
    body_timeout_s: float = 20.0
    upload_bytes: int = 64_000_000
    car_bytes: int = 512_000_000
    learn_s: float = 1800.0
    listeners: int = 64
    live_every_s: float = 0.5
    publish_every_s: float = 5.0
    memory_bytes: int = 2_000_000_000


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of one service.

    Attributes
    ----------
    models : mapping of str to Path
        Name -> folder of a model or of a registry; the first is the default. Empty for the model of the package.
    host : str
    port : int
        0 selects a free port.
    workers : int
        Number of worker processes.
    token : str
        Required bearer token; empty for none.
    limits : Limits
    atlas : AtlasSettings
        Roads, places, weather and charging stations; without a map there are no journeys.
    cars : Path or None
        Folder of cars: their trips, the models adapted to them, and what they send on the road; None for none.
    keep_days : float
        Days that finished trips of cars on the road stay on disk; without a limit they stay until the car is forgotten.
    prefix : str
        Path under which a proxy serves the service, such as "/tripwatt"; empty for none.
    cors_origins : tuple of str
        Origins whose pages a browser lets read answers.
    mqtt : MqttSettings or None
        The broker that cars send to, and to which they are published; None for no broker.
    """

    models: Mapping[str, Path] = field(default_factory=lambda: MappingProxyType({}))
    host: str = "127.0.0.1"
    port: int = 8000
    workers: int = 2
    token: str = field(default="", repr=False)
    limits: Limits = field(default_factory=Limits)
    atlas: AtlasSettings = field(default_factory=AtlasSettings)
    cars: Path | None = None
    keep_days: float = math.inf
    prefix: str = ""
    cors_origins: tuple[str, ...] = ()
    mqtt: MqttSettings | None = None

    @property
    def hosts(self) -> frozenset[str]:
        """Allowed names in the Host header; empty for any name.

        On loopback, a page of another site could otherwise reach the service under its own name (DNS rebinding). At other
        addresses the token prevents this.

        Examples
        --------
        >>> "localhost" in Settings().hosts, Settings(host="0.0.0.0").hosts
        (True, frozenset())
        """
        own = "localhost", "127.0.0.1", "[::1]", self.host.lower()
        return frozenset(own if is_loopback(self.host) else ())


def is_loopback(host: str) -> bool:
    """Whether an address to listen on can be reached from this machine only.

    Examples
    --------
    >>> [is_loopback(host) for host in ("127.0.0.1", "::1", "localhost", "0.0.0.0", "::", "192.0.2.7")]
    [True, True, True, False, False, False]
    """
    try:
        return host.lower() == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def limits_of(given: Mapping[str, float | str]) -> Limits:
    """Return the limits with these names and values, and the others as they are by default.

    Raises
    ------
    InvalidInput
        With all unknown names and all values out of range.

    Examples
    --------
    >>> limits_of({"samples": 2000.0}).samples
    2000
    """
    defaults, faults = asdict(Limits()), list[Fault]()
    for name, value in given.items():
        is_whole = isinstance(defaults.get(name), int)
        if name not in defaults:
            faults.append(Fault.unknown("unknown limit", "--limit", name, defaults))
        elif isinstance(value, str) or not 0 < value < 1e12 or (is_whole and value % 1.0):
            allowed = "a whole number above 0" if is_whole else "a number above 0"
            faults.append(Fault("value out of range", f"--limit {name}", f"{value}", allowed))
    raise_faults(faults)
    return Limits(**defaults | {name: type(defaults[name])(value) for name, value in given.items()})
