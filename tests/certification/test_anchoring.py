"""Anchors: one loss closes the mean error."""

import dataclasses

import numpy as np
import pytest
from benchmarks import anchors as bench
from benchmarks.anchors import unanchored
from tests.support.cars import some_cars
from tools.data.anchoring import (
    LOSSES,
    PAIR,
    ROW_TOLERANCE,
    Anchored,
    anchored,
    certified_figures,
    keys,
    most_probable,
    motorway_loss_wh_per_km,
    scaled,
)
from tools.docs import pages

from tripwatt.certification.consumption import ROAD_LOAD, driven_wh_per_km, errors
from tripwatt.vehicles import load_vehicle
from tripwatt.vehicles.anchors import anchors, with_anchor
from tripwatt.vehicles.losses import motor_loss

CARS = [name for name in some_cars(8) if name in anchors()]


@pytest.mark.parametrize("name", CARS)
def test_the_library_meets_certified_consumption_in_the_mean(name: str) -> None:
    car = load_vehicle(name)
    figures = [f for f in certified_figures(name, unanchored(name)) if not f.outlier]
    found = errors(car, figures)
    assert abs(found.mean()) <= 0.02, "run python -m benchmarks.anchors --write"
    assert np.abs(found).max() <= 0.08 or name in bench.REASONS
    assert car.anchor == anchors()[name].level
    before = errors(unanchored(name), figures).mean()
    assert before == pytest.approx(anchors()[name].before, abs=0.02)


def test_each_factor_changes_its_own_entries() -> None:
    car = load_vehicle("bmw_i3_60ah")
    assert scaled(car, "motor", 1.5).drivetrain.motor_loss_factor == 1.5
    assert scaled(scaled(car, "motor", 1.5), "motor", 2.0).drivetrain.motor_loss_factor == 3.0
    assert scaled(car, "gear", 3.0).drivetrain.gearbox_efficiency == pytest.approx(0.99**3)
    # 200 W at 20 m/s: the motor turns with 20 x 9.665 / 0.35 rad/s
    iron = scaled(car, "iron", 2.0).drivetrain.flux_loss_w_s2_rad2
    assert iron * (20.0 * 9.665 / 0.35) ** 2 == pytest.approx(200.0)
    assert scaled(car, "iron", 1.0) == car
    # most of a gap belongs to the losses that scatter most: gear before rolling before air
    more = scaled(car, ROAD_LOAD, 1.5)
    road = more.road_load
    assert road.coastdown_a_n == pytest.approx(1.5**0.4 * float(car.road_load.coastdown_a_n or 0.0))
    assert road.coastdown_b_n_s_m == pytest.approx(1.5**0.4 * float(car.road_load.coastdown_b_n_s_m or 0.0))
    assert road.coastdown_c_n_s2_m2 == pytest.approx(
        1.5**0.2 * float(car.road_load.coastdown_c_n_s2_m2 or 0.0)
    )
    assert road.coastdown_mass_kg == 1443.33
    assert more.drivetrain.gearbox_efficiency == pytest.approx(0.99**1.5)
    leaf = load_vehicle("peugeot_e_208")
    assert leaf.road_load.method == "coefficients"
    assert scaled(leaf, ROAD_LOAD, 1.5).road_load.drag_area_m2 == pytest.approx(
        1.5**0.2 * leaf.road_load.drag_area_m2
    )
    assert len(keys(leaf, ROAD_LOAD)) == 3


def test_losses_of_the_map_and_beside_it() -> None:
    drivetrain = load_vehicle("bmw_i3_60ah").drivetrain
    torque, speed = np.array([0.0, 50.0, -50.0]), np.array([500.0, 500.0, 500.0])
    usual = motor_loss(torque, speed, drivetrain)
    twice = motor_loss(torque, speed, dataclasses.replace(drivetrain, motor_loss_factor=2.0))
    assert twice.tolist() == (2.0 * usual).tolist()
    beside = dataclasses.replace(drivetrain, flux_loss_w_s2_rad2=0.002)
    assert (motor_loss(torque, speed, beside) - usual).tolist() == pytest.approx([0.0, 500.0, 500.0])
    both = dataclasses.replace(beside, motor_loss_factor=2.0)
    assert (motor_loss(torque, speed, both) - 2.0 * usual).tolist() == pytest.approx([0.0, 500.0, 500.0])


@pytest.mark.parametrize("name", ["vw_id4_awd_pro", "polestar_2_single"])
def test_the_most_probable_loss_closes_the_mean(name: str) -> None:
    """Of losses that meet city and highway alike, the one that changes the motorway least."""
    car = unanchored(name)
    figures = certified_figures(name, car)
    each = {loss: anchored(car, figures, loss) for loss in LOSSES}
    published = motorway_loss_wh_per_km(car)

    def cost(found: Anchored) -> float:
        rows = (found.after / 0.02) ** 2
        motorway = np.log(motorway_loss_wh_per_km(found.vehicle) / published) / 0.45
        return float(rows.sum() + motorway**2) + 1e6 * (abs(found.after.mean()) > 1e-3)

    found = most_probable(car, figures)
    assert found.loss == min(each, key=lambda loss: cost(each[loss]))
    # no car's drivetrain takes a third of a motorway's energy because a map is scaled beyond its schedules
    assert motorway_loss_wh_per_km(found.vehicle) < 0.3 * driven_wh_per_km(
        found.vehicle, (np.arange(2.0), np.full(2, 36.0)), car.body.test_mass_kg
    )
    assert found.before.tolist() == errors(car, figures).tolist()
    assert found.after.tolist() == errors(found.vehicle, figures).tolist()
    entry = found.anchor("road_load")
    assert entry.before == pytest.approx(found.before.mean())
    ((key, value),) = entry.entries.items()
    section, _, name = key.partition(".")
    assert getattr(getattr(found.vehicle, section), name) == value


def test_two_losses_meet_a_city_and_a_highway_that_one_cannot() -> None:
    """The city too high and the highway too low: the loss that grows with speed rises while the map's falls."""
    car = unanchored("audi_e_tron_55")
    figures = certified_figures("audi_e_tron_55", car)
    single = min(
        (anchored(car, figures, loss) for loss in LOSSES), key=lambda a: float(np.abs(a.after).max())
    )
    assert np.abs(single.after).max() > ROW_TOLERANCE
    found = most_probable(car, figures)
    assert found.loss == PAIR
    assert np.abs(found.after).max() < 0.01
    assert found.vehicle.drivetrain.motor_loss_factor < 1.0
    assert found.vehicle.drivetrain.flux_loss_w_s2_rad2 > car.drivetrain.flux_loss_w_s2_rad2
    assert found.anchor("road_load").entries.keys() == set(keys(car, PAIR))
    drivetrain = with_anchor({}, found.anchor("road_load"))["drivetrain"]
    assert {entry["unit"] for entry in drivetrain.values()} == {"1", "W s2/rad2"}


def test_marked_rows_do_not_count_and_bounds_hold() -> None:
    car = unanchored("vw_id4_pro")
    city, highway = certified_figures("vw_id4_pro", car)
    wrong = dataclasses.replace(highway, wh_per_km=5.0 * highway.wh_per_km, outlier=True)
    assert most_probable(car, [city, wrong]).after.shape == (1,)
    assert most_probable(car, [dataclasses.replace(city, outlier=True)]).after.shape == (1,)
    far = dataclasses.replace(city, wh_per_km=10.0 * city.wh_per_km)
    done = anchored(car, [far], "motor")
    assert done.factor == 2.5
    assert done.after[0] < -0.5
    assert anchored(car, [dataclasses.replace(city, wh_per_km=1.0)], ROAD_LOAD).factor == 0.3
    met = dataclasses.replace(city, wh_per_km=city.wh_per_km * (1.0 + errors(car, [city])[0]))
    assert anchored(car, [met], "gear").factor == 1.0


def test_the_page_shows_the_bars_and_the_table_every_anchored_car() -> None:
    outcomes = bench.committed()
    assert pages.of_page("reference/library.md", "anchors") == bench.render(outcomes)
    table = bench.render_cars(outcomes)
    for name, anchor in anchors().items():
        if anchor.level != "class":
            (line,) = [line for line in table.splitlines() if f"| `{name}` |" in line]
            assert f"| {anchor.loss} |" in line
            assert abs(float(line.split("|")[4].strip(" %")) - 100 * anchor.before) <= 3.0


def test_names_that_the_benchmark_lists_are_cars() -> None:
    for name in (*bench.NOT_ANCHORED, *bench.OWN_ROAD_LOAD, *bench.REASONS):
        load_vehicle(name)
    assert {load_vehicle(n).anchor for n in bench.NOT_ANCHORED} == {"published"}
