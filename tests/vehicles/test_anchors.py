"""Values that close the gap to the certified consumption."""

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.vehicles import (
    load_vehicle,
    render_vehicle,
)
from tripwatt.vehicles.anchors import Anchor, anchors, with_anchor
from tripwatt.vehicles.loading import library_document


def test_anchors_take_the_place_of_entries() -> None:
    anchor = Anchor("road_load", "gear", {"drivetrain.gearbox_efficiency": (0.95, "1")}, -0.1)
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
