"""How far a car on the road may be from its values."""

import math
import re

import pytest
from tests.support import ROOT

from tripwatt.hybrid.factors import FACTORS
from tripwatt.hybrid.parameters import on_road
from tripwatt.vehicles import (
    load_vehicle,
)
from tripwatt.vehicles.catalogue import class_values
from tripwatt.vehicles.spreads import ROAD_GAIN, spreads
from tripwatt.vehicles.vehicle import ANCHORS


def test_the_better_a_car_is_known_the_narrower() -> None:
    assert set(ANCHORS) == {"published", "road_load", "certification", "class", "road"}
    levels = [spreads(level) for level in ("road_load", "certification", "class")]
    for name in ("rolling", "air"):
        values = [level[name] for level in levels]
        assert values == sorted(values)
        assert values[0] < values[2]
    assert spreads("published") == spreads("road") == {}
    # tyres 8 % and the gain's 5 %; trim 5 % and the gain's 5 %; a class on top
    assert levels[0]["rolling"] == pytest.approx((0.08**2 + 0.05**2) ** 0.5)
    assert levels[0]["air"] == pytest.approx((2 * 0.05**2) ** 0.5)
    classes = class_values()
    half = (0.08**2 + 0.05**2 + 0.5 * classes.rolling_sd**2) ** 0.5
    assert levels[1]["rolling"] == pytest.approx(half)
    assert levels[2]["air"] == pytest.approx((2 * 0.05**2 + classes.drag_area_sd**2) ** 0.5)


def test_on_the_road_a_car_has_more_rolling_resistance_once() -> None:
    car = load_vehicle("vw_id4_pro")
    road = on_road(car)
    assert road.road_load.drag_area_m2 == car.road_load.drag_area_m2
    for before, after in zip(
        car.road_load.rolling_coefficients, road.road_load.rolling_coefficients, strict=True
    ):
        assert after == pytest.approx((1.0 + ROAD_GAIN) * before)
    assert road.body == car.body
    assert road.anchor == "road"
    assert on_road(road) is road


def test_the_page_of_the_cars_shows_the_spreads() -> None:
    """The rows of the anchors in docs/reference/vehicles.md, in percent."""
    page = (ROOT / "docs" / "reference" / "vehicles.md").read_text(encoding="utf-8")
    published = {factor.name: math.hypot(factor.models, factor.vehicles) for factor in FACTORS}
    for anchor in ("road_load", "certification", "class", "published"):
        widths = [max(published[name], spreads(anchor).get(name, 0.0)) for name in ("rolling", "air")]
        shown = " | ".join(f"{100.0 * width:.0f} %" for width in widths)
        assert re.search(rf"^\| `{anchor}` \|.*\| {re.escape(shown)} \|$", page, re.MULTILINE), anchor
