"""Restarts over MQTT: every message that a broker took is in the one trip, once."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.server.cars.brokers import MOSQUITTO

pytest.importorskip("aiomqtt", reason="the extra tripwatt[live] is not installed")

from tests.server.cars.restarts import fuzzed


@pytest.mark.skipif(MOSQUITTO is None, reason="no mosquitto: install it from the distribution's packages")
def test_a_drive_through_restarts_is_one_whole_trip(tmp_path: Path) -> None:
    """More seeds: `python -m benchmarks.hostile --only mqtt`."""
    done = fuzzed(tmp_path, seed=1, seconds=160)
    assert (done.missing, done.twice, done.trips, done.wrong) == (0, 0, 1, [])
    assert done.messages == 160
