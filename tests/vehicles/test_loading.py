"""The cars of the library: their names, finding them, loading them."""

import pickle
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from tests.support.cars import some_cars
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.vehicles import (
    describe_vehicle,
    find_vehicles,
    load_vehicle,
    require_vehicle,
    vehicle_names,
    vehicle_titles,
)

ASKED_FOR = [
    "vw_id3_77",
    "vw_e_up_32",
    "cupra_born_77",
    "mg_mg4_64",
    "tesla_model_y_2023_rwd",
    "renault_r5_52",
    "kia_niro_2023",
    "hyundai_kona_65_2023",
    "bmw_i3_60ah",
    "bmw_i3_94ah",
    "bmw_i3_120ah",
    "nissan_leaf_24",
    "nissan_leaf_30",
    "nissan_leaf_40",
    "tesla_model_3_sr_plus",
    "tesla_model_3_lr",
    "vw_e_golf",
    "vw_id3",
    "renault_zoe_ze50_r135",
    "hyundai_kona_64",
    "chevrolet_bolt",
    "fiat_500e",
    "peugeot_e_208",
]


def faults_of(error: pytest.ExceptionInfo[InvalidInput]) -> str:
    return str(error.value)


# ------------------------------------------------------------------------------------------------ the cars
def test_library_has_every_car_that_was_asked_for() -> None:
    assert set(ASKED_FOR) <= set(vehicle_names())
    assert not set(vehicle_names()) & {"passenger_car", "nmc_cells", "lmo_cells"}


@pytest.mark.parametrize("name", ASKED_FOR[::4])
def test_cars_are_plausible_and_keep_the_origin_of_every_value(name: str) -> None:
    car = load_vehicle(name)
    kwh = car.battery.capacity_ah * car.battery.cells_in_series * np.mean(car.battery.ocv_v) / 1000.0
    assert 1150.0 < car.body.curb_mass_kg < 2150.0
    assert 18.0 < kwh < 90.0
    # Road load at 80 km/h as a share of the weight.
    speed = 80.0 / 3.6
    a, b = car.road_load.rolling_coefficients
    force = (
        a + b * speed + 0.5 * 1.17 * car.road_load.drag_area_m2 * speed**2 / (car.body.test_mass_kg * 9.81)
    )
    assert 0.013 < force < 0.028
    top = (
        car.drivetrain.motor_max_speed_rad_s / car.drivetrain.gear_ratio * car.drivetrain.wheel_radius_m * 3.6
    )
    assert 130.0 < top < 300.0
    rows = describe_vehicle(name)
    assert len(rows) == len(car.entries)
    assert all(source for *_, source in rows)


PRESETS = [(name, preset) for name in some_cars(6) for preset in ("default", "paper")]


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_every_bundled_car_loads_and_travels_to_a_worker(name: str, preset: str) -> None:
    car = load_vehicle(name, preset)
    assert pickle.loads(pickle.dumps(car)) == car
    assert all(entry.source and isinstance(entry.unit, str) for entry in car.entries.values())
    assert car.entries["battery.capacity_ah"].scale in ("soc", "displayed_soc")


def test_a_car_that_is_loaded_again_is_as_its_file_is() -> None:
    first = load_vehicle("bmw_i3_60ah")
    assert isinstance(first.entries, dict)
    first.entries.clear()
    again = load_vehicle("bmw_i3_60ah")
    assert again == first
    assert again.entries["body.curb_mass_kg"].value == again.body.curb_mass_kg


def test_unknown_car_preset_and_file(tmp_path: Path) -> None:
    refuses("did you mean 'bmw_i3_60ah'", load_vehicle, "bmw_i3_60")
    refuses("unknown preset", load_vehicle, "bmw_i3_60ah", preset="sport")
    refuses("cannot be read", load_vehicle, tmp_path / "none.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("[body\n")
    refuses(r"not a TOML file.*broken\.toml", load_vehicle, broken)


def test_a_car_from_a_path(tmp_path: Path) -> None:
    text = (resources.files("tripwatt.vehicles") / "data" / "bmw_i3_60ah.toml").read_text("utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    assert load_vehicle(path).name == "mine"


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("kona", "hyundai_kona_64"),
        ("model 3 2022", "tesla_model_3_2022_rwd"),
        ("MODEL3 2024", "tesla_model_3_2024_rwd"),
        ("ë-c4", "citroen_e_c4"),
        ("id4 awd", "vw_id4_awd_pro"),
        ("2025 ex30 18", "volvo_ex30_er"),
        ("id 3", "vw_id3"),
        ("ID.3 77", "vw_id3_77"),
        ("zoe ze50", "renault_zoe_ze50_r135"),
        ("R5", "renault_r5_52"),
        ("ev 6 gt", "kia_ev6_gt"),
        ("cupra born", "cupra_born_77"),
    ],
)
def test_words_find_cars(words: str, first: str) -> None:
    assert find_vehicles(words)[0] == first


def test_years_of_a_title_do_not_order_what_is_found() -> None:
    found = find_vehicles("ioniq")
    fives = [found.index(f"hyundai_ioniq_5_{version}") for version in ("lr_awd", "lr_rwd", "sr_rwd")]
    assert fives == [*range(fives[0], fives[0] + 3)]
    assert max(fives) < min(found.index(name) for name in found if "ioniq_6" in name)


def test_a_search_holds_every_word_and_a_year_has_to_be_one_of_the_car() -> None:
    assert find_vehicles("van") == ()  # "GV60 Advanced" has the letters alone
    assert find_vehicles("") == find_vehicles(" - ") == find_vehicles("kona tesla") == ()
    assert "tesla_model_3_2024_rwd" not in find_vehicles("model 3 2023")
    assert "tesla_model_3_2022_rwd" in find_vehicles("model 3 2023")
    assert "tesla_model_s_2021_lr" not in find_vehicles("model 3")
    assert all("Model 3" in vehicle_titles()[n] for n in find_vehicles("model 3"))


def test_an_unknown_car_is_named_with_those_that_are_meant() -> None:
    require_vehicle("vw_id3")
    with pytest.raises(InvalidInput, match="did you mean 'vw_id4_pro'") as error:
        load_vehicle("vw_id4")
    assert len(str(error.value)) < 300  # not the whole library
    refuses(r"describe it: `tripwatt vehicles new`, the path of a \.toml file", require_vehicle, "zzz")


@pytest.mark.parametrize("name", vehicle_names())
def test_a_car_is_found_by_its_title_and_by_its_name_in_parts(name: str) -> None:
    title = vehicle_titles()[name].partition(" (")[0]
    for words in (title, title.replace(".", " "), name.replace("_", " ")):
        assert name in find_vehicles(words), words


def test_short_words_stand_alone_or_with_their_neighbour() -> None:
    assert "kia_ev6_gt" not in find_vehicles("ev gt")
    assert set(find_vehicles("id 3")) == {"vw_id3", "vw_id3_77"}
    assert set(find_vehicles("mg 4")) == {"mg_mg4_51", "mg_mg4_64"}
