"""`tripwatt inspect` on models of others: what cannot be shown is said in words, and no text steers a terminal."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.support.command import Answer

from tripwatt.forecasting.storage import model_folder
from tripwatt.modelfile import read_model, write_model

Run = Callable[..., Answer]


def written(folder: Path, change: dict[str, Any]) -> Path:
    """The model of the package with other metadata and right digests."""
    sound = read_model(model_folder())
    kept = {name: value for name, value in sound.metadata.items() if name not in ("parts", "sha256")}
    write_model(folder / "m", {**kept, **change}, sound.parts)
    return folder / "m"


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({}, 0),
        ({"model": {}}, 2),
        ({"evaluation": {"mape": "small", "rmse_wh": 1, "bias_wh": 1, "trips": 1, "given": ""}}, 2),
        ({"kind": "fleet", "model": None}, 2),
    ],
)
def test_inspect_fails_in_words(tmp_path: Path, run: Run, change: dict, code: int) -> None:
    answer = run("inspect", written(tmp_path, change))
    assert answer.code == code, answer.err
    if code:
        assert answer.err.startswith("error: metadata cannot be read: ")
        assert not answer.out


def test_inspect_steers_no_terminal(tmp_path: Path, run: Run) -> None:
    title = "i3 \x1b[2J\x1b]0;owned\x07\x9b2J"
    about = dict(read_model(model_folder()).metadata["model"])
    model = written(tmp_path, {"model": {**about, "vehicle_title": title}})
    for options in ((), ("--json",)):
        answer = run("inspect", model, *options)
        assert answer.code == 0
        assert not set(answer.out) & {"\x1b", "\x07", "\x9b"}
    assert json.loads(answer.out)["model"]["vehicle_title"] == title
