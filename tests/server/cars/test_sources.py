"""One drive of the TUM set as five senders write it: the same forecast, whatever the names, units, signs and rounding."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pandas as pd
import pytest
from tests.server.cars.messages import NOON_S, measured

import tripwatt as tw
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.telemetry import format_of
from tripwatt.server.cars.topics import TopicJoiner
from tripwatt.sources.mapping import POWER

SENDERS: Final = ("ovms", "teslamate", "abrp", "torque", "plain")
ROOT: Final = "cars/leaf"
POINT: Final = 0.01
"""A point of charge."""


def fields_of(source: str, table: pd.DataFrame) -> Iterator[tuple[float, dict[str, Any]]]:
    """When each message is sent, and its fields: what the sender has of the drive, rounded as it rounds."""
    columns = format_of(source).columns
    for row in table.to_dict("records"):
        row[POWER] = row["voltage_v"] * row["current_a"]
        fields = {
            name: (row[ours] - offset) / factor
            for name, (ours, factor, offset) in columns.items()
            if row.get(ours) is not None and row[ours] == row[ours]
        }
        if source == "teslamate":
            whole = ("power", "speed", "battery_level", "usable_battery_level")
            fields = {name: round(value) if name in whole else value for name, value in fields.items()}
        yield NOON_S + row["time_s"], fields


def sent(source: str, table: pd.DataFrame) -> Iterator[tuple[str, bytes, float]]:
    """Topic, payload and time of each message: a metric each of OVMS and TeslaMate, whole messages of the others."""
    made = format_of(source)
    for time_s, fields in fields_of(source, table):
        if source in ("ovms", "teslamate"):
            named = {"m/time/utc": f"{time_s:.0f}"} if source == "ovms" else {}
            named |= {
                name.replace(".", "/") if source == "ovms" else name: repr(v) for name, v in fields.items()
            }
            yield from ((f"{ROOT}/{name}", text.encode(), time_s) for name, text in named.items())
        else:
            clock = {made.time_field: time_s / made.columns[made.time_field][1]} if made.time_field else {}
            yield ROOT, json.dumps({**fields, **clock}).encode(), time_s


def test_one_drive_by_five_senders_ends_in_one_forecast(data_dir: Path, tmp_path: Path) -> None:
    fleet, model = tw.read_logs(data_dir / "tum", "tum"), tw.load_model()
    trip = next(trip for trip in tw.audit(fleet).trips if trip.trip_id == "TripB11")
    departure = model.forecast(trip)
    table = measured(trip.samples)
    table = table.assign(time_s=table["time_s"] - departure.plan.start_s)
    more = [name for name in ("soc", "displayed_soc") if name in trip and name not in table]
    at = trip.samples["time_s"].searchsorted(table["time_s"] + departure.plan.start_s)
    table = table.assign(**{name: trip.samples[name].to_numpy()[at] for name in more})
    table = table[table["time_s"] <= 0.7 * table["time_s"].iloc[-1]]
    arrivals = {"log": departure.update_since_departure(table).soc_arrival}
    for source in SENDERS:
        joiner = TopicJoiner(source, ROOT)
        with Car.follow(tmp_path / source) as car:
            for topic, payload, time_s in sent(source, table):
                sample = joiner.take(topic, payload, time_s)
                if sample is not None:
                    car.record(sample, now_s=time_s + 1.0)
            last = joiner.flush()
            if last is not None:
                car.record(last, now_s=NOON_S + 1e5)
            car.set_plan({}, NOON_S)
            arrivals[source] = car.update(departure).soc_arrival
    assert max(arrivals.values()) - min(arrivals.values()) <= 0.5 * POINT, arrivals
    assert arrivals["plain"] == pytest.approx(arrivals["log"], abs=1e-6)
