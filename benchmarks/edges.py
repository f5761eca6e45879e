"""Laws of updates and of chances at the edges: `python -m benchmarks.edges [--roads N] [--seed N]`.

Every car of the library without own trips, on random roads, from -60 to 45 °C, with charges of 1 to 100 %. An update that agrees with the
forecast does not widen or move it; more charge never lowers a chance; a car arrives with no more than it left with plus what descents give;
colder air never saves energy.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import pandas as pd
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.population.cars import for_car
from tripwatt.vehicles import vehicle_names

ROADS: Final = 20
CHARGES: Final = (0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2, 0.35, 0.6, 1.0)
RESERVES: Final = np.array([0.0, 0.05, 0.1, 0.2, 0.5])
TEMPERATURES_DEGC: Final = (-30.0, -5.0, 20.0, 45.0)
COLD_DEGC: Final = (-60.0, -50.0, -40.0, -30.0, -20.0)
FRACTIONS: Final = (0.1, 0.5, 0.8)
DISPLAY: Final = 0.03
"""Three times the error of a display, beyond which a chance counts as one of an impossible charge."""


def random_roads(number: int, seed: int) -> list[tw.Plan]:
    """Return roads of 3 to 60 km with known heights."""
    rng = np.random.default_rng(seed)
    roads = []
    for _ in range(number):
        count = int(rng.integers(3, 12))
        columns = (
            rng.uniform(500.0, 5000.0, count),
            rng.uniform(6.0, 34.0, count),
            rng.normal(0.0, 0.02, count),
        )
        links = [
            {"length_m": length, "speed_m_s": speed, "grade": grade}
            for length, speed, grade in zip(*(column.tolist() for column in columns), strict=True)
        ]
        roads.append(tw.read_route(links))
    return roads


def agreeing(forecast: tw.Forecast, fraction: float, source: str) -> tw.Forecast:
    """Return the update by samples every 10 s that the forecast expected, with a display in steps of 1 %."""
    along = forecast.along
    time_s = np.append(np.arange(0.0, fraction * along.time_s[-1], 10.0), fraction * along.time_s[-1])
    charge = np.clip(np.interp(time_s, along.time_s, along.expected_soc), 0.0, 1.0)
    columns = {
        "energy": {"observed_energy_wh": np.interp(time_s, along.time_s, along.energy_wh)},
        "display": {"displayed_soc": charge.round(2)},
    }
    return forecast.update_since_departure(pd.DataFrame({"time_s": time_s, **columns[source]}))


def updates(names: Sequence[str], roads: Sequence[tw.Plan], seed: int) -> Iterator[Row]:
    """Rows of updates that agree: the largest ratio of widths, and the largest change of the energy."""
    rng = np.random.default_rng([seed, 1])
    widths, moves, charges = [], [], []
    for name in names:
        model = for_car(None, name)
        for road in roads:
            before = model.forecast(road, tw.Departure(0.9, float(rng.uniform(-30.0, 45.0))))
            if before.soc_arrival < 0.05:
                continue
            for fraction in FRACTIONS:
                for source in ("energy", "display"):
                    after = agreeing(before, fraction, source)
                    widths.append(np.ptp(after.interval(0.9)) / np.ptp(before.interval(0.9)))
                    charges.append(after.along.charge_sd[-1] / before.along.charge_sd[-1])
                    moves.append(abs(after.energy_wh - before.energy_wh) / before.sd_wh)
    yield Row("updates that agree", float(len(widths)))
    yield Row("interval of the energy over that at departure, largest", float(max(widths)), most=1.0 + 1e-9)
    yield Row("error of the charge over that at departure, largest", float(max(charges)), most=1.0 + 1e-9)
    yield Row("change of the energy in standard deviations, largest", float(max(moves)), most=0.2)


def chances(names: Sequence[str], roads: Sequence[tw.Plan]) -> Iterator[Row]:
    """Rows of chances: the largest fall with more charge, and the largest of a charge that cannot be."""
    falls, beyond = [0.0], [0.0]
    for name in names:
        model = for_car(None, name)
        for road in roads:
            for degc in TEMPERATURES_DEGC:
                chance = np.zeros(len(RESERVES))
                for charge in CHARGES:
                    forecast = model.forecast(road, tw.Departure(charge, degc))
                    along = forecast.along
                    given = -min(float(along.min_wh.min()), 0.0) / along.wh_per_display
                    before, chance = chance, forecast.p_arrive(RESERVES)
                    falls.append(float((before - chance).max()))
                    most = charge + given + DISPLAY
                    beyond.append(float(forecast.p_arrive(most)) if most < 1.0 else 0.0)
    yield Row("chances", float(len(falls) - 1))
    yield Row("fall of a chance with more charge, largest", max(falls), most=0.001)
    yield Row("chance of more charge than there can be, largest", max(beyond), most=0.02)


def cold(names: Sequence[str], roads: Sequence[tw.Plan]) -> Iterator[Row]:
    """The largest energy that a colder air saves [Wh]."""
    saved = [0.0]
    for name in names:
        model = for_car(None, name)
        for road in roads[:3]:
            for charge in (0.15, 0.9):
                departures = [tw.Departure(charge, degc) for degc in COLD_DEGC]
                saved.append(float(np.diff([model.forecast(road, d).energy_wh for d in departures]).max()))
    yield Row("energy that colder air saves, largest", max(saved), "Wh", most=0.0)


def rows(roads: int = ROADS, seed: int = 0, names: Sequence[str] = ()) -> Iterator[Row]:
    """All rows, of every car if no names are given."""
    names, made = names or vehicle_names(), random_roads(roads, seed)
    yield from updates(names, made, seed)
    yield from chances(names, made)
    yield from cold(names, made)


def main(roads: int = ROADS, seed: int = 0) -> int:
    """Print the rows; 1 where one is missed."""
    return report(rows(roads, seed))


if __name__ == "__main__":
    run(main)
