"""Two cars are the same when their values are."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import pytest
from benchmarks.worlds import changed
from hypothesis import given, settings
from hypothesis import strategies as st

import tripwatt as tw
from tripwatt.hybrid.identification import Identified
from tripwatt.hybrid.parameters import on_road
from tripwatt.vehicles import (
    Vehicle,
    differences,
    load_vehicle,
    render_vehicle,
    vehicle_names,
    with_differences,
    without_data,
)
from tripwatt.vehicles.comparing import names_data
from tripwatt.vehicles.vehicle import SECTIONS

I3 = tw.load_vehicle("bmw_i3_60ah")
NUMBERS = [
    (section, field.name)
    for section in SECTIONS
    if getattr(I3, section) is not None
    for field in fields(getattr(I3, section))
    if isinstance(getattr(getattr(I3, section), field.name), float)
    and field.name not in ("drag_coefficient", "frontal_area_m2", "rolling_resistance_coefficient")
]


@pytest.mark.parametrize("name", ["bmw_i3_60ah", "vw_id4_pro", "tesla_model_3_lr", vehicle_names()[-1]])
def test_a_copy_in_a_file_is_the_same_car(name: str, tmp_path: Path) -> None:
    car = tw.load_vehicle(name)
    copy = tmp_path / "copy.toml"
    copy.write_text(render_vehicle(car).replace(car.title, "Another title"))
    found = tw.load_vehicle(copy)
    assert found.title == "Another title"
    assert differences(found, car) == differences(car, found) == ()


@given(where=st.sampled_from(NUMBERS), factor=st.sampled_from([0.5, 0.999, 1.001, 1.5]))
@settings(max_examples=40, deadline=None)
def test_every_changed_number_is_named(where: tuple[str, str], factor: float) -> None:
    section, name = where
    part = getattr(I3, section)
    value = getattr(part, name) * factor or factor
    other = replace(I3, **{section: replace(part, **{name: value})})
    found = differences(other, I3)
    assert [(d.key, d.value) for d in found] == [(f"{section}.{name}", value)]
    assert getattr(with_differences(I3, found, other), section) == getattr(other, section)


def test_a_part_that_one_car_lacks_is_a_difference() -> None:
    paper = tw.load_vehicle("bmw_i3_60ah", preset="paper")
    found = {d.key: d.change for d in differences(paper, I3)}
    assert found["climate"] == "given -> none"
    assert with_differences(I3, differences(paper, I3), paper).climate is None
    assert {d.key: d.change for d in differences(I3, paper)}["climate"] == "none -> given"


def published_and_learned() -> list[tuple[Vehicle, Vehicle]]:
    """Cars with the same car whose values trips have changed."""
    id4 = tw.load_vehicle("vw_id4_pro")
    found = Identified(
        {"auxiliaries.base_load_w": 380.0, "climate.compressor_idle_w": 90.0},
        {"auxiliaries.base_load_w": 9, "climate.compressor_idle_w": 9},
    )
    return [
        (I3, found.applied(I3)),
        (I3, changed(found.applied(I3), {"mass": 0.03, "rolling": -0.1, "base_load": 0.2})),
        (id4, changed(on_road(id4), {"air": 0.05})),
    ]


@pytest.mark.parametrize(("car", "learned"), published_and_learned())
def test_values_that_trips_changed_do_not_make_another_car(car: Vehicle, learned: Vehicle) -> None:
    assert learned != car
    assert differences(car, learned) == ()
    assert differences(learned, learned) == ()
    # neither the published nor the learned value
    heavy = replace(car, body=replace(car.body, curb_mass_kg=car.body.curb_mass_kg * 1.5))
    assert [d.key for d in differences(heavy, learned)] == ["body.curb_mass_kg"]
    base = replace(car, auxiliaries=replace(car.auxiliaries, base_load_w=1234.0))
    assert [d.key for d in differences(base, learned)] == ["auxiliaries.base_load_w"]


def test_the_unused_description_of_a_road_load_does_not_count() -> None:
    other = replace(I3, road_load=replace(I3.road_load, drag_coefficient=0.9))
    assert I3.road_load.method == "coastdown"
    assert differences(other, I3) == ()


@pytest.mark.parametrize("name", vehicle_names())
def test_every_value_of_a_data_sets_logs_has_another_without_it(name: str) -> None:
    car = load_vehicle(name)
    logged = {key for key, entry in car.entries.items() if names_data(entry, "tum")}
    assert "climate.sensor_minimum_degc" in logged or "climate.cooler_cop" in logged
    bare = without_data(car, "tum")
    assert not any(names_data(entry, "tum") for entry in bare.entries.values())
    differ = {key for key, entry in bare.entries.items() if entry.value != car.entries[key].value}
    assert differ == logged
    for key in logged:
        section, _, field = key.partition(".")
        assert getattr(getattr(bare, section), field) == bare.entries[key].value
        assert bare.entries[key].unit == car.entries[key].unit
    assert without_data(bare, "tum") is bare
    assert without_data(car, "ved") is car
