"""What `tripwatt demo` serves: a car with the diary of real trips and the replay of another one, and the map of a made-up country."""

from __future__ import annotations

import itertools
import os
import shutil
import time
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from http.client import HTTPException
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
import orjson

from tripwatt.roads.journey import AtlasSettings
from tripwatt.roads.maps.folder import build_map
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import create_car, issue_token
from tripwatt.server.cars.telemetry import Sample
from tripwatt.server.http.library import EXAMPLE_CAR, examples
from tripwatt.server.http.settings import Settings
from tripwatt.sources.sample import sample_trips

HERE: Final = Path(__file__).parent
CAR: Final = "example-car"
DRIVE: Final = "TripB37"
"""The last trip of the sample, which the car drives; all others are in its diary."""
TILE: Final = "N44W034.hgt"
"""The tile of one degree in which the country is: the open Atlantic."""

EVERY_S: Final = 5.0
"""Time between two messages of the car on the road [s]."""

DRIVEN: Final = 0.4
"""Part of its trip that the car has driven when the service starts."""

Drive = Iterator[tuple[float, dict[str, Any]]]


def make_demo(folder: Path, progress: Callable[[str], object] = lambda step: None) -> tuple[Settings, str]:
    """Make the map, the car and its diary in an empty folder; a second call uses what is there.

    Parameters
    ----------
    folder : Path
    progress : callable
        Called with the name of each step.

    Returns
    -------
    Settings, str
        Settings of the service, without a map if `tripwatt[routing]` is missing, and the token of the car on the road.
    """
    atlas = AtlasSettings()
    if find_spec("valhalla") is not None and find_spec("osmium") is not None:
        progress("map of a made-up country")
        atlas = AtlasSettings(str(example_map(folder)))
    cars, unfinished = folder / "cars", folder / "unfinished"
    if not (cars / CAR).is_dir():
        sample = sample_trips()
        progress(f"car with the diary of {len(sample) - 1} real trips")
        shutil.rmtree(unfinished, ignore_errors=True)  # of a demo that was killed
        car = create_car(unfinished / CAR, EXAMPLE_CAR, label="Example car")
        car.add(replace(sample, logs=sample.logs[:-1]))
        os.renames(unfinished / CAR, cars / CAR)
    return Settings(atlas=atlas, cars=cars), issue_token(cars / CAR)


def example_map(folder: Path) -> Path:
    """Return the folder of the map of the made-up country; build the map if it is missing."""
    folder_of_map = folder / "map"
    if not folder_of_map.is_dir():
        from scipy.ndimage import zoom

        tiles = folder / "heights"
        tiles.mkdir(exist_ok=True)
        heights = zoom(np.load(HERE / "heights.npy").astype(float), 1201 / 121, mode="nearest")
        (tiles / TILE).write_bytes(np.round(heights).astype(">i2").tobytes())
        attribution = "made-up roads: no place of this map exists"
        build_map(HERE / "example-country.osm.pbf", folder_of_map, elevation=tiles, attribution=attribution)
    return folder_of_map


def depart(settings: Settings) -> Drive:
    """Record the last trip of the sample up to now, and return the samples to come.

    Parameters
    ----------
    settings : Settings
        From `make_demo`.

    Returns
    -------
    iterator of float, dict
        Time [s since 1970] and values of the samples to come, in SI units.
    """
    assert settings.cars is not None
    trip = examples()[DRIVE]
    begins_s = time.time() - DRIVEN * trip["duration_s"]
    samples = _samples(trip, begins_s)
    with Car.follow(settings.cars / CAR) as car:
        car.set_plan({**trip["request"]}, begins_s)
        for time_s, values in itertools.takewhile(lambda sample: sample[0] <= time.time(), samples):
            car.record(Sample(time_s, values))
    return samples


def _samples(trip: Mapping[str, Any], begins_s: float) -> Drive:
    """Yield time and values of the samples of an example, one every `EVERY_S`."""
    measured = {**trip["request"]["samples"], **trip["observed"]}
    time_s = np.array(measured.pop("time_s"))
    for k in np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], EVERY_S)).tolist():
        now_s = begins_s + float(time_s[k] - time_s[0])
        yield now_s, {name.removeprefix("bms_"): values[k] for name, values in measured.items()}


def send(samples: Drive, url: str, token: str) -> None:
    """Send samples to a service, each at its time, as live data of A Better Routeplanner."""
    for time_s, values in samples:
        time.sleep(max(time_s - time.time(), 0.0))
        message = {
            "utc": time_s,
            "speed": 3.6 * values["speed_m_s"],
            "voltage": values["voltage_v"],
            "current": values["current_a"],
        }
        body, headers = orjson.dumps({"token": token, "tlm": message}), {"Content-Type": "application/json"}
        request = urllib.request.Request(f"{url}/v1/telemetry", body, headers, method="POST")
        # the next message follows after one that the service refuses, or does not take as it stops
        with suppress(OSError, HTTPException), urllib.request.urlopen(request, timeout=EVERY_S):
            pass
