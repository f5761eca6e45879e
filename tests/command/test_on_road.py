"""Commands of cars on the road."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest
from tests.support.refusals import refuses
from typer.testing import CliRunner

from tripwatt.command import app
from tripwatt.command.serve import make_cars_folder
from tripwatt.errors import InvalidInput
from tripwatt.server.cars.folder import digest_of, setting_of


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_token_is_printed_once_and_is_that_of_the_car(tmp_path: Path) -> None:
    printed = run("car", "token", tmp_path / "leaf").strip()
    assert setting_of(tmp_path / "leaf", "token") == digest_of(printed)
    made = json.loads(run("car", "token", tmp_path / "leaf", "--json"))
    assert made["car"] == f"{tmp_path / 'leaf'}"
    assert setting_of(tmp_path / "leaf", "token") == digest_of(made["token"]) != digest_of(printed)


def test_a_new_folder_of_cars_is_made_and_only_there(tmp_path: Path) -> None:
    make_cars_folder(tmp_path / "cars")
    make_cars_folder(tmp_path / "cars")
    assert (tmp_path / "cars").is_dir()
    for place in (tmp_path / "missing" / "cars", Path(__file__)):
        refuses(r"cannot make the folder: --cars", run, "serve", "--cars", place, "--port", 0)
    assert not (tmp_path / "missing").exists()


def test_all_wrong_options_are_named_together(tmp_path: Path) -> None:
    options = ["--mqtt", "mqtt://h", "--follow", "leaf=bmw:x", "--follow", "leaf", "--follow", "zoe=ovms:#"]
    with pytest.raises(InvalidInput) as caught:
        run("serve", "--cars", tmp_path / "cars", *options)
    whats = [fault.what for fault in caught.value.faults]
    assert whats == ["unknown sender", "not a car to follow", "no topic of one car"]


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--mqtt", "http://h"], "not a broker"),
        (
            ["--mqtt", "mqtt://h"],
            "option has no effect: --mqtt: got 'mqtt://h'; allowed: only together with --cars",
        ),
        (["--follow", "leaf=ovms:x"], "only together with --mqtt"),
        (["--mqtt", "mqtt://h", "--follow", "a=ovms:x", "--follow", "a=ovms:y"], "duplicate car name"),
    ],
)
def test_options_of_mqtt_go_together(options: list[str], what: str) -> None:
    with pytest.raises(InvalidInput, match=re.escape(what)):
        run("serve", *options)


def test_without_the_extra_the_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "aiomqtt", None)
    refuses(r"pip install -e '\.\[live\]'", run, "serve", "--cars", tmp_path, "--mqtt", "mqtt://h")
