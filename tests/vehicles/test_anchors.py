"""Values that close the gap to the certified consumption."""

import math
import re

import pytest
from tests.support import ROOT

from tripwatt.errors import InvalidInput
from tripwatt.hybrid.factors import FACTORS
from tripwatt.hybrid.parameters import on_road
from tripwatt.vehicles import (
    load_vehicle,
    render_vehicle,
)
from tripwatt.vehicles.anchors import ROAD_GAIN, Anchor, anchors, spreads, with_anchor
from tripwatt.vehicles.catalogue import class_values
from tripwatt.vehicles.loading import library_document
from tripwatt.vehicles.vehicle import ANCHORS


def test_anchors_take_the_place_of_entries() -> None:
    anchor = Anchor("road_load", "gear", {"drivetrain.gearbox_efficiency": 0.95}, -0.1)
    document = with_anchor({"name": "x", "drivetrain": {"gear_ratio": 1}}, anchor)
    assert document["anchor"] == "road_load"
    assert document["drivetrain"]["gear_ratio"] == 1
    assert document["drivetrain"]["gearbox_efficiency"]["value"] == 0.95
    assert "-10.0 %" in document["drivetrain"]["gearbox_efficiency"]["estimated"].replace("%", " %")
    assert with_anchor({"name": "x"}, None) == {"name": "x"}
    assert "anchor" not in library_document("vw_id4_pro")
    assert {a.level for a in anchors().values()} == {"road_load", "certification", "class"}
    assert all(a.entries for a in anchors().values())


def test_an_unknown_anchor_is_a_fault(tmp_path) -> None:
    path = tmp_path / "car.toml"
    text = render_vehicle(load_vehicle("vw_id4_pro"))
    path.write_text(text.replace('anchor = "road_load"', 'anchor = "rode_load"'), encoding="utf-8")
    with pytest.raises(InvalidInput, match="did you mean 'road_load'"):
        load_vehicle(path)


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
