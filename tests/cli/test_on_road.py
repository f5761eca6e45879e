"""Commands of cars on the road."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tripwatt.cli import app
from tripwatt.cli.on_road import sentence
from tripwatt.cli.serve import make_cars_folder
from tripwatt.errors import InvalidInput
from tripwatt.live.tokens import digest_of, token_digest


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_token_is_printed_once_and_is_that_of_the_car(tmp_path: Path) -> None:
    printed = run("car", "token", tmp_path / "leaf").strip()
    assert token_digest(tmp_path / "leaf") == digest_of(printed)
    made = json.loads(run("car", "token", tmp_path / "leaf", "--json"))
    assert made["car"] == f"{tmp_path / 'leaf'}"
    assert token_digest(tmp_path / "leaf") == digest_of(made["token"]) != digest_of(printed)


def test_a_new_folder_of_cars_is_made_and_only_there(tmp_path: Path) -> None:
    make_cars_folder(tmp_path / "cars")
    make_cars_folder(tmp_path / "cars")
    assert (tmp_path / "cars").is_dir()
    for place in (tmp_path / "missing" / "cars", Path(__file__)):
        with pytest.raises(InvalidInput, match=r"cannot make the folder: --cars"):
            run("serve", "--cars", place, "--port", 0)
    assert not (tmp_path / "missing").exists()


def test_all_wrong_options_are_named_together(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput) as caught:
        run(
            "live",
            tmp_path / "leaf",
            "--mqtt",
            "http://h",
            "--source",
            "bmw",
            "--topic",
            "x",
            "--plan",
            "none.gpx",
        )
    whats = [fault.what for fault in caught.value.faults]
    assert whats[:2] == ["not a broker", "unknown sender"]
    assert len(whats) == 3
    assert not (tmp_path / "leaf").exists()


def test_without_the_extra_the_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "aiomqtt", None)
    with pytest.raises(InvalidInput, match=r"pip install -e '\.\[live\]'"):
        run("live", tmp_path / "leaf", "--mqtt", "mqtt://h", "--source", "ovms", "--topic", "x")


def test_a_car_in_one_line() -> None:
    found = {
        "vehicle": "leaf",
        "messages": {"new": 7},
        "trip": {"distance_m": 3456.0},
        "forecast": {
            "energy_wh": 2345.0,
            "soc_arrival": 0.62,
            "soc_quantiles": {"0.05": 0.6, "0.5": 0.62, "0.95": 0.64},
            "p_arrive": 0.998,
            "p_arrive_at_all": 0.9994,
            "reserve": 0.1,
        },
        "faults": [{"what": "charge rises"}],
    }
    assert sentence(found) == (
        "leaf: 3.5 km driven, 7 messages, 2.35 kWh in all, arrival with 62% (60% to 64%), 99.9% to arrive, "
        "99.8% with 10%, charge rises"
    )
