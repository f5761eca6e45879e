"""Cars of the library for tests of laws that hold for every one."""

import os
import random

from tripwatt.vehicles import vehicle_names

KEPT = ("bmw_i3_60ah", "nissan_leaf_24", "vw_id3")
"""The car of the bundled model, one with another chemistry, and one whose road load was fitted."""


def some_cars(count: int = 8, seed: int = 15) -> list[str]:
    """`KEPT` and a sample of the rest; the whole library where TRIPWATT_EVERY_CAR is set."""
    names = vehicle_names()
    if os.environ.get("TRIPWATT_EVERY_CAR"):
        return list(names)
    rest = [name for name in names if name not in KEPT]
    return [*KEPT, *random.Random(seed).sample(rest, count - len(KEPT))]
