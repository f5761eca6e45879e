"""Models whose digests were computed again: values without a meaning are refused, by their place."""

import time
from pathlib import Path

import numpy as np
import pytest
from tests.support.cars import some_cars
from tests.support.hostile_files import forge

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import load_model
from tripwatt.forecasting.storage import require_usable
from tripwatt.hybrid.stored import MAX_MEMBERS
from tripwatt.population import for_car


def scaled(place: str, factor: float):
    def change(part: dict) -> None:
        part[place] = part[place] * factor

    return change


def sliced(place: str, part_of: slice):
    def change(part: dict) -> None:
        part[place] = part[place][part_of]

    return change


def put(*path: str | int, value=None, factor: float = 1.0):
    """Another value at a place of `model.json`, or the one that is there times a factor."""

    def change(part: dict) -> None:
        for key in path[:-1]:
            part = part[key]
        part[path[-1]] = part[path[-1]] * factor if value is None else value

    return change


def swapped(part: dict) -> None:
    seen = part["ranges_"]["duration_s"]
    seen["low"], seen["high"] = seen["high"], seen["low"]


SPREAD = ("uncertainty_", "process", "climate")
MEMBERS = ("corrector_", "drive", "members")


ABSURD = "no forecast: .*energy that physics forbids"
JSON_CHANGES = [
    (put(*SPREAD, "drift_time_s", factor=-1.0), r"out of range: .*drift_time_s: got -210"),
    (put(*SPREAD, "constant_sd_w", factor=-1.0), r"out of range: .*constant_sd_w"),
    (put("uncertainty_", "scale", "course", "drifts", 0, 1, value=0.0), r"out of range: .*drifts\.0\.1"),
    (put("uncertainty_", "charge", "wh_per_display", factor=-1.0), r"out of range: .*wh_per_display"),
    (put("uncertainty_", "charge", "zero_soc", value=0.99), r"out of range: .*zero_soc: got 0\.99"),
    (put(*MEMBERS, factor=MAX_MEMBERS), rf"too many members: .*allowed: at most {MAX_MEMBERS}"),
    (swapped, "out of order: .*duration_s: got low and high"),
    (put(*MEMBERS, 1, "start", value=-1e7), ABSURD),
    (put("seed", value="x"), r"model: seed: "),
    (put("uncertainty_", "process", "split", value=1), r"uncertainty_\.process\.split: "),
    (
        lambda part: part["corrector_"]["drive"]["members"][1]["trees"].pop("decision"),
        r"corrector_.*'decision'",
    ),
    (dict.clear, "parts do not make a forecast model"),
]
PROCESS = "corrector_.climate.process"
ARRAY_CHANGES = [
    (scaled("uncertainty_.scores.values", -1.0), r"out of range: .*scores\.values"),
    (scaled("uncertainty_.shrinkage.joint", 8.0), r"out of range: .*shrinkage\.joint"),
    (scaled("uncertainty_.scale.values", 1e4), ABSURD),
    (scaled(f"{PROCESS}.weights", 1e6), ABSURD),
    (scaled("corrector_.drive.members.0.process.weights", 1e6), ABSURD),
    (scaled("corrector_.drive.members.0.process.factor", 1e6), ABSURD),
    (scaled("corrector_.drive.members.1.trees.leaf_value", 1e6), ABSURD),
    (scaled(f"{PROCESS}.weights", np.nan), "model gives no forecast"),
    (scaled(f"{PROCESS}.sds", 0.0), "model gives no forecast"),
    (sliced(f"{PROCESS}.factor", slice(-1)), "model gives no forecast"),
    (sliced("uncertainty_.scores.values", slice(0)), "model gives no forecast|parts do not make"),
    (
        sliced("uncertainty_.scores.values", slice(None, None, -1)),
        r"out of order: model\.uncertainty_\.scores",
    ),
]


@pytest.mark.parametrize(
    ("part", "change", "what"),
    [
        *(("model.json", *row) for row in JSON_CHANGES),
        *(("model.npz", *row) for row in ARRAY_CHANGES),
    ],
)
def test_a_model_of_values_without_a_meaning_is_refused(tmp_path: Path, part: str, change, what: str) -> None:
    place = forge(tmp_path, part, change)
    started = time.process_time()
    with pytest.raises(InvalidInput, match=what):
        load_model(place)
    assert time.process_time() - started < 20.0


@pytest.mark.parametrize("vehicle", some_cars(5))
def test_every_car_without_trips_passes_the_trial_of_a_stored_model(vehicle: str) -> None:
    require_usable(for_car(None, vehicle), vehicle)


def test_the_trial_of_a_stored_model_is_short(tmp_path: Path) -> None:
    model = load_model(forge(tmp_path, "model.json", lambda part: None))
    seconds = []
    for _ in range(9):
        started = time.process_time()
        require_usable(model, "model")
        seconds.append(time.process_time() - started)
    assert min(seconds) < 0.05
