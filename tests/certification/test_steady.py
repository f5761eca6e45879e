"""Every car at steady speed: laws of the points, and a cause for each that is far from its class."""

import numpy as np
import pytest
from benchmarks import steady
from tests.support.cars import some_cars
from tools.docs import pages

from tripwatt.vehicles import load_vehicle, vehicle_names

CARS = tuple(some_cars(8))


@pytest.mark.parametrize("name", CARS)
def test_consumption_rises_with_speed_and_in_the_cold(name: str) -> None:
    found = np.array([steady.driven(load_vehicle(name), *point).wh_per_km for point in steady.POINTS])
    by_weather = found.reshape(len(steady.AMBIENT_DEGC), len(steady.SPEEDS_KM_H))
    assert (np.diff(by_weather, axis=1) > 0.0).all()
    assert (np.diff(by_weather, axis=0) > 0.0).all()
    assert (by_weather > 80.0).all()
    assert (by_weather < 600.0).all()


@pytest.mark.parametrize("name", CARS)
def test_parts_sum_and_have_their_signs(name: str) -> None:
    for point in (steady.driven(load_vehicle(name), 110.0, 0.0), steady.expected(name, 110.0, 0.0)):
        assert set(point.parts) == set(steady.PARTS)
        assert sum(point.parts.values()) == pytest.approx(point.wh_per_km)
        assert min(point.parts.values()) > 0.0


def test_the_formula_is_that_of_the_published_mass_and_drag_area() -> None:
    """ID.4: 2143 kg of test weight less 61 kg, and a drag area that its coast-down has; half of the class's values are below."""
    name = "vw_id4_pro"
    plain = steady.expected(name, 90.0, 20.0)
    assert plain.parts["air"] == pytest.approx(
        0.5 * 1.204 * steady.drag_area(name) * 25.0**2 / 3.6, rel=0.001
    )
    heavier, faster = steady.expected("audi_e_tron_55", 90.0, 20.0), steady.expected(name, 110.0, 20.0)
    assert heavier.parts["rolling"] > plain.parts["rolling"]
    assert faster.parts["air"] == pytest.approx((110.0 / 90.0) ** 2 * plain.parts["air"])


def test_every_car_that_is_apart_has_a_cause_on_the_page() -> None:
    table = pages.of_page("reference/library.md", "steady")
    for name in vehicle_names():
        lines = [line for line in table.splitlines() if f"| `{name}` |" in line]
        assert lines, f"{name}: run python -m benchmarks.steady --write"
        low, high = (float(v) for v in lines[0].split("|")[12].replace("%", "").split(" to "))
        if max(abs(low), abs(high)) > 100.0 * steady.APART + 0.5:
            assert len(lines) > 1, name
            assert "(" in lines[1].split("|")[5], name


@pytest.mark.parametrize("name", CARS[:3])
def test_the_page_has_the_figures_of_the_day(name: str) -> None:
    page = pages.of_page("reference/library.md", "steady")
    line = next(line for line in page.splitlines() if f"| `{name}` |" in line)
    shown = [float(cell) for cell in line.split("|")[3:12]]
    found = [steady.driven(load_vehicle(name), *point).wh_per_km for point in steady.POINTS]
    assert shown == pytest.approx(found, abs=0.51)


def test_models_of_titles() -> None:
    titles = {
        "BMW i3 120 Ah": "BMW i3",
        "BMW i3s 120 Ah 37.9 kWh (2019-2021)": "BMW i3",
        "Hyundai Ioniq 6 Long Range RWD 74 kWh 18-inch (2023)": "Hyundai Ioniq 6",
        "Tesla Model 3 RWD 57.5 kWh (2024)": "Tesla Model 3",
        "Renault Zoe ZE50 R135": "Renault Zoe",
    }
    assert {title: steady.model_of(title) for title in titles} == titles
