"""Cars of the library for tests of laws that hold for every one, and cars with extreme values inside of their bounds."""

import dataclasses
import os
import random
from collections.abc import Iterator

from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_names
from tripwatt.vehicles.vehicle import SECTIONS

KEPT = ("bmw_i3_60ah", "nissan_leaf_24", "vw_id3")
"""The car of the bundled model, one with another chemistry, and one whose road load was fitted."""

LEVEL_ROAD = (
    {"length_m": 3000.0, "speed_m_s": 8.0, "grade": 0.0},
    {"length_m": 20_000.0, "speed_m_s": 25.0, "grade": 0.0},
    {"length_m": 10_000.0, "speed_m_s": 15.0, "grade": 0.0},
)
"""33 km."""


def some_cars(count: int = 8, seed: int = 15) -> list[str]:
    """`KEPT` and a sample of the rest; the whole library where TRIPWATT_EVERY_CAR is set."""
    names = vehicle_names()
    if os.environ.get("TRIPWATT_EVERY_CAR"):
        return list(names)
    rest = [name for name in names if name not in KEPT]
    return [*KEPT, *random.Random(seed).sample(rest, count - len(KEPT))]


def extreme_cars(number: int, seed: int) -> Iterator[tuple[str, dict[str, float | tuple[float, ...]]]]:
    """Names of cars, and values at and between the bounds for one to all of their fields; a table is scaled as one value."""
    chance = random.Random(seed)
    names = vehicle_names()
    for _ in range(number):
        name = chance.choice(names)
        fields = list(_bounded(load_vehicle(name)))
        count = chance.choice((1, 1, 2, 2, 3, 4, 6, 10, len(fields)))
        yield (
            name,
            {key: _drawn(*rest, chance) for key, *rest in chance.sample(fields, min(count, len(fields)))},
        )


def _bounded(car: Vehicle) -> Iterator[tuple[str, float | tuple[float, ...], float, float]]:
    """Key, value and bounds of each number of a car that has an effect."""
    for section, part in SECTIONS.items():
        for field in dataclasses.fields(part):
            value = getattr(getattr(car, section), field.name, None)
            unused = section == "road_load" and field.name.startswith("coastdown") != (
                car.road_load.method == "coastdown"
            )
            if (
                "minimum" in field.metadata
                and value is not None
                and not unused
                and not field.name.endswith("soc")
            ):
                yield f"{section}.{field.name}", value, field.metadata["minimum"], field.metadata["maximum"]


def _drawn(
    own: float | tuple[float, ...], low: float, high: float, chance: random.Random
) -> float | tuple[float, ...]:
    """A bound, a value between the bounds, or the own one times a factor."""
    if isinstance(own, tuple):
        factor = chance.choice((low / min(own), high / max(own), chance.lognormvariate(0.0, 1.0)))
        return tuple(min(max(factor * value, low), high) for value in own)
    near = min(max(own * chance.lognormvariate(0.0, 1.0), low), high)
    return chance.choice((low, high, low, high, chance.uniform(low, high), near))
