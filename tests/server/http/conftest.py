"""A service that the tests of this folder share, and a request for it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from tests.support.drives import example_trip
from tests.support.roads import osrm
from tests.support.router_server import answering, write_map
from tests.support.service_process import Service, serving

from tripwatt.server.cars.folder import issue_token


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with serving(tmp_path_factory.mktemp("service"), "--workers", "1") as found:
        yield found


@pytest.fixture(scope="session")
def drive() -> dict[str, Any]:
    """A request for a short driven trip."""
    table = example_trip().iloc[:300]
    columns = ("time_s", "speed_m_s", "elevation_m")
    return {
        "samples": {name: table[name].tolist() for name in columns},
        "soc": 0.8,
        "ambient_temperature_degc": -5.0,
        "cabin_setpoint_degc": 21.0,
        "payload_mass_kg": 80.0,
        "reserve": 0.3,
    }


@pytest.fixture(scope="session")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service with a map and a car on the road."""
    folder = tmp_path_factory.mktemp("served")
    issue_token(folder / "cars" / "leaf")
    (folder / "logs").mkdir()
    with answering(osrm(annotated=True)) as router:
        roads = f"{write_map(folder / 'map')}@osrm={router.url}"
        more = ("--workers", "1", "--map", roads, "--cars", f"{folder / 'cars'}")
        with serving(folder / "logs", *more) as service:
            yield service
