"""Worlds of synthetic cars: bounded, different, and published with an interval over cars."""

import numpy as np
import pytest
from benchmarks import worlds
from tools import CATALOGUE

from tripwatt.vehicles import load_vehicle


def drawn(name: str, number: int = 400) -> np.ndarray:
    if name == "siblings" and not (CATALOGUE / "epa_ev.csv").is_file():
        pytest.skip("the lists of cars are not at hand: set TRIPWATT_CATALOGUE")
    draw = worlds.WORLDS[name][1]
    cars = [draw(np.random.default_rng(seed)) for seed in range(number)]
    assert all(set(car) == set(worlds.WIDTHS) for car in cars)
    return np.log1p([[car[name] for name in worlds.WIDTHS] for car in cars])


@pytest.mark.parametrize("name", list(worlds.WORLDS))
def test_no_value_of_a_world_changes_its_sign_or_is_far_off(name: str) -> None:
    found = drawn(name)
    assert np.all(np.abs(found) <= np.log(worlds.FARTHEST) + 1e-12)
    assert np.array_equal(found, drawn(name))


def test_worlds_are_as_wide_as_they_are_called() -> None:
    width = np.array(list(worlds.WIDTHS.values()))
    scale = {name: np.std(drawn(name), axis=0) / width for name in ("published", "narrow", "wide")}
    assert scale["published"] == pytest.approx(np.ones(len(width)), rel=0.12)
    assert scale["narrow"] == pytest.approx(0.5 * scale["published"], rel=0.05)
    assert np.all(scale["wide"] > 1.3 * scale["published"])
    assert np.mean(drawn("shifted"), axis=0) == pytest.approx(width, rel=0.12)
    tails = [np.mean(np.abs(drawn(name) / width) > 3.0) for name in ("published", "heavy")]
    assert tails[1] > 2.0 * tails[0]


def test_a_change_is_relative_and_names_its_source() -> None:
    car = load_vehicle("bmw_i3_60ah")
    heavier = worlds.changed(car, {"mass": 0.1, "air": -0.5, "climate": 0.2})
    assert heavier.body.curb_mass_kg == pytest.approx(1.1 * car.body.curb_mass_kg)
    assert heavier.body.driver_mass_kg == pytest.approx(1.1 * car.body.driver_mass_kg)
    assert heavier.road_load.coastdown_c_n_s2_m2 == pytest.approx(0.5 * car.road_load.coastdown_c_n_s2_m2)
    assert heavier.road_load.coastdown_a_n == car.road_load.coastdown_a_n
    assert heavier.entries["body.curb_mass_kg"].source.startswith("published value times 1.100; published")
    assert heavier.entries["body.curb_mass_kg"].value == heavier.body.curb_mass_kg
    assert heavier.entries["road_load.coastdown_a_n"] == car.entries["road_load.coastdown_a_n"]


def test_a_coverage_over_cars_is_less_sure_than_over_trips() -> None:
    together = np.repeat([1.0, 1.0, 1.0, 0.0], 25)
    low, high = worlds.coverage_interval(together, [25] * 4)
    one_by_one = worlds.coverage_interval(together, [1] * 100)
    assert low < one_by_one[0] < 0.75 < one_by_one[1] < high
    assert worlds.coverage_interval(np.ones(6), [1, 2, 3]) == (1.0, 1.0)


def test_a_row_of_a_world_is_over_its_cars() -> None:
    car = np.array([[0.1, 0, 1, 1, 0.4], [-0.3, 0, 0, 1, 0.2]])
    row = worlds.Row.of("wide", "published values", [car, car[:1]])
    text = worlds.table([row])
    assert "| wide | published values | 2 | 3 | 16.7 | -3.3 | 0 | 67 | 100 | 100 to 100 | 33 |" in text
