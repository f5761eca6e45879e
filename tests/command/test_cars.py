"""Searching the library and describing a car on the command line."""

import json
from collections.abc import Callable
from pathlib import Path

from tests.command.conftest import Answer

from tripwatt.vehicles import load_vehicle

NEW = ("vehicles", "new", "--mass", "1830", "--battery", "58", "--power", "150", "--body", "hatchback")


def test_words_list_the_cars_that_they_find(run: Callable[..., Answer]) -> None:
    found = json.loads(run("vehicles", "model", "3", "2024", "--json").out)
    assert [car["name"] for car in found] == ["tesla_model_3_2024_rwd", "tesla_model_3_2024_lr_awd"]
    assert "hyundai_kona_64" in run("vehicles", "kona").out
    refused = run("vehicles", "zeppelin")
    assert refused.code == 2
    assert "unknown car" in refused.err


def test_a_new_car_is_written_and_loads(run: Callable[..., Answer], tmp_path: Path) -> None:
    out = tmp_path / "no folder yet" / "vans" / "my_car.toml"
    answer = run(*NEW, "--consumption", "15.5", "--heat-pump", "--out", out)
    assert answer.code == 0
    assert "15.5 kWh/100 km" in answer.err + answer.out
    car = load_vehicle(out)
    assert (car.body.curb_mass_kg, car.anchor) == (1830.0, "certification")
    shown = json.loads(run(*NEW, "--json").out)
    assert shown["anchor"] == "class"
    assert shown["wltp_kwh_per_100km"]["low"] < shown["wltp_kwh_per_100km"]["high"]
    assert run(*NEW).out.startswith('name = "hatchback')
    assert run("vehicles", "new", "--body", "suv").out.startswith('name = "suv')
    unsaid = run("vehicles", "new")
    assert (unsaid.code, unsaid.out) == (2, "")
    assert "nothing is said of the car: new: got no value; allowed: --mass, --battery" in unsaid.err


def test_faults_have_the_names_of_the_options(run: Callable[..., Answer]) -> None:
    refused = run("vehicles", "new", "--mass", "1", "--body", "boat", "--procedure", "nedc")
    assert refused.code == 2
    for option in ("--mass:", "--body:", "--procedure:"):
        assert option in refused.err
    refused = run("vehicles", "kona", "--mass", "1800")
    assert "option has no effect: --mass: got 1800" in refused.err
    assert "only together with new" in refused.err
