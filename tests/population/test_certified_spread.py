"""Spreads between car models: the constants are what certified consumption shows."""

import pytest
from tools import CATALOGUE
from tools.data import certified_spread

from tripwatt.hybrid.factors import CERTIFIED_EVERYTHING, CERTIFIED_TILT, FACTORS, NAMES, VEHICLES_EVERYTHING
from tripwatt.vehicles import load_vehicle

needs_list = pytest.mark.skipif(
    not (CATALOGUE / "wltp.csv").is_file(), reason="needs the public lists of ../shared"
)


@needs_list
def test_the_spread_of_everything_is_what_the_causes_leave() -> None:
    found = certified_spread.consumption()
    assert found.value == pytest.approx(0.061, abs=0.0006)
    assert found.models == FACTORS[0].df + 1
    left = certified_spread.left_for_everything(found.value, "models")
    assert left == pytest.approx(CERTIFIED_EVERYTHING, abs=0.0006)
    left = certified_spread.left_for_everything(certified_spread.ONE_MODEL_SD, "vehicles")
    assert left == pytest.approx(VEHICLES_EVERYTHING, abs=0.0006)


def test_the_spread_of_the_causes_is_that_between_city_and_highway() -> None:
    found = certified_spread.tilt()
    assert found.value == pytest.approx(CERTIFIED_TILT, abs=0.006)
    assert found.models == FACTORS[NAMES.index("air")].df + 1


def test_everything_is_a_tenth_of_a_schedule_and_the_city_has_more_changes_of_speed() -> None:
    car = load_vehicle("nissan_leaf_40")
    city, highway = (certified_spread.schedule_factors(car, cycle) for cycle in ("udds", "hwfet"))
    assert [city[0], highway[0]] == pytest.approx([0.1, 0.1])
    assert city[NAMES.index("transients")] > 2.0 * highway[NAMES.index("transients")]
    assert city[NAMES.index("air")] < 0.7 * highway[NAMES.index("air")]
