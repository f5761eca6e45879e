"""Messages on the way: python -m benchmarks.companion [FOLDER] [--trips N].

TUM trips are started with a charge with which they arrive with the reserve in half of the cases by the forecast before departure, and are followed every minute by a model that has
not seen them. How many messages does a driver get, and is the last one right?
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from tools import DATA
from tools.command import run
from typer import Argument

import tripwatt as tw
from benchmarks.measure import Row, report
from benchmarks.need import models, trips_and_car
from tripwatt.forecasting import ForecastModel
from tripwatt.roads.advice import Companion, Message
from tripwatt.trips import Plan, Trip
from tripwatt.units import SECONDS_PER_HOUR, SECONDS_PER_MINUTE

RESERVE = 0.1
START = (0.05, 0.95)
"""Chances between which a trip starts, drawn with a seed: low enough to matter."""


def followed(model: ForecastModel, trip: Trip, chance: float) -> tuple[list[Message], bool]:
    """Messages of a trip that starts with a chance, and whether it arrives with the reserve.

    The measured energy is taken from the charge at the start by the model's energy of a displayed percent: what is tested is the energy ahead.
    """
    plan = Plan.from_trip(trip)
    first = model.forecast(plan)
    needed_wh = first.quantile(chance)
    soc = min(RESERVE + needed_wh / first.charge.wh_per_display, 1.0)
    departure = model.forecast(plan, tw.Departure(soc=soc))
    samples = trip.samples[
        [c for c in ("time_s", "speed_m_s", "voltage_v", "current_a") if c in trip.samples]
    ]
    companion, told = Companion(departure, RESERVE), list[Message]()
    start = float(samples["time_s"].iloc[0])
    for until in np.arange(SECONDS_PER_MINUTE, trip.duration_s, SECONDS_PER_MINUTE):
        seen: pd.DataFrame = samples[samples["time_s"] <= start + until]
        message = companion.update(seen)
        if message is not None:
            told.append(message)
    left = soc - float(trip.observed_energy_wh or np.nan) / departure.charge.wh_per_display
    return told, left >= RESERVE


def rows(data: Path, most: int | None) -> Iterator[Row]:
    """Messages an hour, and how many of the last ones are right."""
    trips, car = trips_and_car("tum", data)
    rng = np.random.default_rng(39)
    chances = rng.uniform(*START, len(trips))
    per_hour, right, followed_trips = [], [], 0
    for members, model in models("tum", trips, car):
        for k in members:
            if most is not None and followed_trips >= most:
                break
            followed_trips += 1
            told, arrives = followed(model, trips[k], float(chances[k]))
            per_hour.append(len(told) * SECONDS_PER_HOUR / trips[k].duration_s)
            if told:
                right.append((told[-1].p_arrive >= 0.5) == arrives)
    yield Row(f"messages an hour, median of {len(per_hour)} trips", float(np.median(per_hour)), most=2.0)
    yield Row("messages an hour, mean", float(np.mean(per_hour)))
    yield Row(f"last message is right, of {len(right)}", float(np.mean(right)), least=0.85)


def main(data: Annotated[Path, Argument(metavar="[FOLDER]")] = DATA, trips: int | None = None) -> int:
    """Print the rows; 1 when a bound is missed."""
    return report(rows(data, trips))


if __name__ == "__main__":
    run(main)
