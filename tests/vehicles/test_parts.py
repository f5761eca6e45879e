"""The parts of a car, and the table of their values in the documentation."""

import pytest
from tests.support import ROOT
from tools.docs.write_parameters import render_parameters

from tripwatt.vehicles import (
    load_vehicle,
)


def test_displayed_window_runs_both_ways() -> None:
    battery = load_vehicle("bmw_i3_60ah").battery
    assert battery.soc_from_displayed(0.0) == pytest.approx(0.08)
    assert battery.soc_from_displayed(1.0) == pytest.approx(0.90)
    assert battery.displayed_from_soc(battery.soc_from_displayed(0.37)) == pytest.approx(0.37)


def test_documented_values_are_those_of_the_file() -> None:
    page = (ROOT / "docs" / "explanation" / "car-model.md").read_text("utf-8")
    assert render_parameters(load_vehicle("bmw_i3_60ah")) in page, (
        "run: python -m tools.docs.write_parameters"
    )
