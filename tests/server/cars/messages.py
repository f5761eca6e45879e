"""Messages of a car as senders have them, from a table of samples, and what a bad connection makes of them."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from tripwatt.server.cars.telemetry import Sample

NOON_S = 1_700_000_000.0
"""Departure of every replayed trip [s since 1970]."""

NOON = "2023-11-14T22:13:20Z"
"""The same in a request."""

ABRP = {
    "speed_m_s": ("speed", 3.6),
    "displayed_soc": ("soc", 100.0),
    "elevation_m": ("elevation", 1.0),
    "ambient_temperature_degc": ("ext_temp", 1.0),
    "cabin_temperature_degc": ("cabin_temp", 1.0),
    "battery_temperature_degc": ("batt_temp", 1.0),
    "voltage_v": ("voltage", 1.0),
}
COLUMNS = ("time_s", "voltage_v", "current_a", *(name for name in ABRP if name != "voltage_v"))


def measured(samples: pd.DataFrame) -> pd.DataFrame:
    """The columns of a drive that a car sends, once a second."""
    time = samples["time_s"].to_numpy()
    kept = np.unique(np.searchsorted(time, np.arange(time[0], time[-1], 1.0)))
    return samples[[name for name in COLUMNS if name in samples]].iloc[kept].reset_index(drop=True)


def samples_of(table: pd.DataFrame, start_s: float = NOON_S) -> list[Sample]:
    """A sample for each row; the first one at `start_s`."""
    first = float(table["time_s"].iloc[0])
    return [
        Sample(
            start_s + row["time_s"] - first,
            {name: value for name, value in row.items() if name != "time_s" and value == value},
        )
        for row in table.to_dict("records")
    ]


def abrp_messages(table: pd.DataFrame, start_s: float = NOON_S) -> Iterator[dict[str, Any]]:
    """A message in the format of A Better Routeplanner for each row."""
    first = float(table["time_s"].iloc[0])
    for row in table.to_dict("records"):
        message = {"utc": start_s + row["time_s"] - first}
        if {"voltage_v", "current_a"} <= set(row):
            message["power"] = row["voltage_v"] * row["current_a"] / 1000.0
        message |= {name: row[ours] * f for ours, (name, f) in ABRP.items() if ours in row}
        yield {name: value for name, value in message.items() if value == value}


def over_a_bad_connection(samples: list[Sample], seed: int, late_s: float = 30.0) -> list[Sample]:
    """A fifth of the samples each lost, late by up to 30 s, and doubled; in the order of their arrival."""
    draw = random.Random(seed)
    arrivals = []
    for sample in samples:
        if draw.random() < 0.2:
            continue
        late = draw.uniform(0.0, late_s) if draw.random() < 0.2 else 0.0
        arrivals.append((sample.time_s + late, sample))
        if draw.random() < 0.2:
            arrivals.append((sample.time_s + late + draw.uniform(0.0, 5.0), sample))
    return [sample for _, sample in sorted(arrivals, key=lambda pair: pair[0])]
