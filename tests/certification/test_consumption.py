"""Certified and simulated consumption."""

import dataclasses
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from tools.data.anchoring import WH_PER_KM, certified_figures
from tools.data.schedules import available, circuit, counted, published

from tripwatt.certification.consumption import (
    CYCLES,
    SPEED_STEP_M_S,
    CertifiedFigure,
    charging_efficiency,
    driven_wh_per_km,
    relative_error,
    schedule,
    simulated_wh_per_km,
    wltp_test_mass,
)
from tripwatt.vehicles import load_vehicle


def test_units_of_certified_figures() -> None:
    assert 27.0 * WH_PER_KM["kWh/100 mi"] == pytest.approx(27_000.0 / 160.9344)
    assert 15.5 * WH_PER_KM["kWh/100 km"] == 155.0
    assert 149.6 * WH_PER_KM["Wh/mi"] == pytest.approx(149.6 / 1.609344)


def test_charging_efficiency_is_the_mean_of_the_seven_certificates() -> None:
    seven = (0.8856, 0.8894, 0.8902, 0.8915, 0.9015, 0.9015, 0.8973)
    assert charging_efficiency() == pytest.approx(sum(seven) / 7.0)


def test_test_mass_of_the_wltp() -> None:
    # 1577 kg with a driver and 25 kg, and 15 % of the 386 kg that are left up to 1988 kg
    assert wltp_test_mass(1577.0, 1988.0) == pytest.approx(1602.0 + 57.9)
    assert wltp_test_mass(1600.0) == pytest.approx(1625.0 + 52.5)


def test_figures_of_a_car_of_the_table() -> None:
    car = load_vehicle("vw_id4_pro_2024")
    figures = certified_figures("vw_id4_pro_2024", car)
    assert [f.cycle for f in figures] == ["udds"] * 4 + ["hwfet"] * 4 + ["wltc"]
    at_battery = [f for f in figures if not f.at_wall]
    assert sorted(f.wh_per_km for f in at_battery) == pytest.approx(
        [v / 1.609344 for v in (171.8, 174.6, 204.8, 205.0)]
    )
    assert {f.test_mass_kg for f in figures} == {5000.0 * 0.45359237, 2285.0}
    # mains over range: 85.869 kWh for 443.27 mi in mode D
    assert figures[0].wh_per_km == pytest.approx(85_869.0 / 443.27 / 1.609344, rel=1e-5)
    assert not any(f.outlier for f in figures)
    assert certified_figures("no such car", car) == ()


def test_test_masses_of_wltp_figures() -> None:
    own, zoe, megane = (load_vehicle(n) for n in ("vw_id3", "renault_zoe_ze50_r135", "renault_megane_60"))
    assert {f.test_mass_kg for f in certified_figures("vw_id3", own)} == {1911.0}  # as registered
    assert certified_figures("renault_zoe_ze50_r135", zoe)[0].test_mass_kg == pytest.approx(1659.9)
    (figure,) = certified_figures("renault_megane_60", megane)
    assert figure.test_mass_kg == pytest.approx(1711.0 + 25.0 + 52.5)
    assert figure.wh_per_km == pytest.approx(0.5 * (146.0 + 173.0))


def test_the_wall_is_the_battery_over_the_charging_efficiency() -> None:
    car = load_vehicle("vw_id4_pro")
    at_wall = CertifiedFigure("hwfet", 140.0, True, 2154.6, "")
    at_battery = dataclasses.replace(at_wall, at_wall=False)
    battery = simulated_wh_per_km(car, at_battery)
    assert battery == driven_wh_per_km(car, schedule("hwfet"), 2154.6)
    assert simulated_wh_per_km(car, at_wall) == pytest.approx(battery / charging_efficiency())
    assert relative_error(car, at_battery) == pytest.approx(battery / 140.0 - 1.0)


def test_heavier_and_rougher_cars_use_more_and_the_cell_is_warm() -> None:
    car = load_vehicle("nissan_leaf_40")
    base = driven_wh_per_km(car, schedule("udds"), 1758.0)
    assert driven_wh_per_km(car, schedule("udds"), 1.1 * 1758.0) > 1.02 * base
    rough = dataclasses.replace(
        car,
        road_load=dataclasses.replace(
            car.road_load, coastdown_a_n=1.2 * float(car.road_load.coastdown_a_n or 0.0)
        ),
    )
    assert driven_wh_per_km(rough, schedule("udds"), 1758.0) > base
    assert car.climate is not None
    hot = dataclasses.replace(car, climate=dataclasses.replace(car.climate, setpoint_degc=30.0))
    assert driven_wh_per_km(hot, schedule("udds"), 1758.0) == base  # climate control is off


# Length [km], duration [s], highest speed [km/h] and seconds at a standstill: 40 CFR 86 appendix I, 40 CFR 600 appendix I, UN GTR 15.
PUBLISHED = {
    "udds": (11.99, 1369, 91.25),
    "hwfet": (16.51, 765, 96.4),
    "wltc": (23.27, 1800, 131.3),
}


@pytest.mark.parametrize("cycle", CYCLES)
def test_traces_have_length_duration_and_top_speed_of_the_schedules(cycle: str) -> None:
    time, speed = schedule(cycle)
    length, duration, top = PUBLISHED[cycle]
    assert (time[0], time[-1], len(speed)) == (0.0, duration, duration + 1)
    assert np.all(np.diff(time) == 1.0)
    assert np.trapezoid(speed, time) / 1000.0 == pytest.approx(length, abs=0.01)
    assert speed.max() * 3.6 == pytest.approx(top, abs=0.2)
    assert (speed[0], speed[-1], speed.min()) == (0.0, 0.0, 0.0)
    assert not speed.flags.writeable


def test_a_circuit_by_hand() -> None:
    # two hops 0-1-0 and 0-2-0, two seconds at 0 and three at 2
    counts = {(0, 1): 1, (1, 0): 1, (0, 2): 1, (2, 0): 1, (0, 0): 2, (2, 2): 3}
    for order in range(4):
        found = circuit(counts, order).tolist()
        assert Counter(pairwise(found)) == counts
        assert found[0] == found[-1] == 0
        assert len(found) == 10
        top = found.index(2)
        assert found[top : top + 4] == [2, 2, 2, 2]
    # standing still is spread over the visits, not done at once
    assert circuit({(0, 1): 2, (1, 0): 2, (0, 0): 3}, 0).tolist() == [0, 0, 1, 0, 0, 1, 0, 0]


@pytest.mark.parametrize("cycle", CYCLES)
def test_energy_is_that_of_the_schedule(cycle: str) -> None:
    if not available(cycle):
        pytest.skip("no schedule: install fastsim 2.1.5, the extra `schedules`")
    steps = np.rint(schedule(cycle)[1] / SPEED_STEP_M_S).astype(int).tolist()
    assert Counter(pairwise(steps)) == Counter(counted(cycle))
    for name in ("vw_id3", "fiat_500e"):
        car = load_vehicle(name)
        mass = car.body.test_mass_kg
        mine = driven_wh_per_km(car, schedule(cycle), mass)
        assert mine == pytest.approx(driven_wh_per_km(car, published(cycle), mass), rel=0.005)
