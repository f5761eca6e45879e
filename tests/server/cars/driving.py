"""A car that drives in tests: its samples, its plan, and how a trip ends."""

from __future__ import annotations

from typing import Final

from tests.server.cars.messages import NOON_S

import tripwatt as tw
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.telemetry import Sample

NOW_S: Final = NOON_S + 1e6
MODEL: Final = tw.load_model()
LINKS: Final = [{"length_m": 9000.0, "speed_m_s": 14.0}]


def fed(car: Car, samples: list[Sample]) -> list[str]:
    return [car.record(sample, now_s=NOW_S) for sample in samples]


def ended(car: Car, after_s: float) -> None:
    """The car stands for long enough."""
    fed(car, [Sample(NOON_S + after_s + 10.0 * k, {"speed_m_s": 0.0}) for k in range(1, 40)])
