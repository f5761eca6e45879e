"""Commands of cars on the road."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tripwatt.cli import app
from tripwatt.errors import InvalidInput
from tripwatt.live import open_live_car


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_token_is_printed_once_and_is_that_of_the_car(tmp_path: Path) -> None:
    printed = run("car", "token", tmp_path / "leaf").strip()
    with open_live_car(tmp_path / "leaf") as car:
        assert car.accepts(printed)
    made = json.loads(run("car", "token", tmp_path / "leaf", "--json"))
    assert made["car"] == f"{tmp_path / 'leaf'}"
    with open_live_car(tmp_path / "leaf") as car:
        assert (car.accepts(made["token"]), car.accepts(printed)) == (True, False)


def test_a_folder_without_cars_is_not_served(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"no cars.*tripwatt car token"):
        run("serve", "--live", tmp_path, "--port", 0)
