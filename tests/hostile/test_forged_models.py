"""Models whose digests were computed again: values without a meaning are refused, by their place."""

import time
from pathlib import Path

import pytest
from tests.hostile.test_bounds import forge
from tests.support.cars import some_cars

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import load_model
from tripwatt.forecasting.storage import require_usable
from tripwatt.population import for_car


def scaled(place: str, factor: float):
    def change(part: dict) -> None:
        part[place] = part[place] * factor

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


@pytest.mark.parametrize(
    ("part", "change", "what"),
    [
        ("model.json", put(*SPREAD, "drift_time_s", factor=-1.0), r"out of range: .*drift_time_s: got -210"),
        ("model.json", put(*SPREAD, "constant_sd_w", factor=-1.0), r"out of range: .*constant_sd_w"),
        (
            "model.json",
            put("uncertainty_", "scale", "course", "drifts", 0, 1, value=0.0),
            r"out of range: .*drifts\.0\.1",
        ),
        (
            "model.json",
            put("uncertainty_", "charge", "wh_per_display", factor=-1.0),
            r"out of range: .*wh_per_display",
        ),
        (
            "model.json",
            put("uncertainty_", "charge", "zero_soc", value=0.99),
            r"out of range: .*zero_soc: got 0\.99",
        ),
        (
            "model.json",
            put(*MEMBERS, factor=10_000),
            "too many members: .*got 20000; allowed: at most",
        ),
        ("model.json", swapped, "out of order: .*duration_s: got low and high"),
        ("model.json", put(*MEMBERS, 1, "start", value=-1e7), "no forecast: .*energy that physics forbids"),
        ("model.npz", scaled("uncertainty_.scores.values", -1.0), r"out of range: .*scores\.values"),
        ("model.npz", scaled("uncertainty_.shrinkage.joint", 8.0), r"out of range: .*shrinkage\.joint"),
        ("model.npz", scaled("uncertainty_.scale.values", 1e4), "no forecast: .*energy that physics forbids"),
        (
            "model.npz",
            scaled("corrector_.climate.process.weights", 1e6),
            "no forecast: .*energy that physics forbids",
        ),
        (
            "model.npz",
            scaled("corrector_.drive.members.0.process.weights", 1e6),
            "no forecast: .*energy that physics forbids",
        ),
        (
            "model.npz",
            scaled("corrector_.drive.members.0.process.factor", 1e6),
            "no forecast: .*energy that physics forbids",
        ),
        (
            "model.npz",
            scaled("corrector_.drive.members.1.trees.leaf_value", 1e6),
            "no forecast: .*energy that physics forbids",
        ),
    ],
)
def test_a_model_of_values_without_a_meaning_is_refused(tmp_path: Path, part: str, change, what: str) -> None:
    place = forge(tmp_path, part, change)
    started = time.process_time()
    with pytest.raises(InvalidInput, match=what):
        load_model(place)
    assert time.process_time() - started < 20.0


def test_scores_that_descend_are_refused(tmp_path: Path) -> None:
    def reverse(part: dict) -> None:
        part["uncertainty_.scores.values"] = part["uncertainty_.scores.values"][::-1]

    with pytest.raises(InvalidInput, match=r"out of order: model\.uncertainty_\.scores\.values"):
        load_model(forge(tmp_path, "model.npz", reverse))


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
