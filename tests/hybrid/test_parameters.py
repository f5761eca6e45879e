"""Parameters of a car: what their changes do, and their widths."""

import pytest

from tripwatt.hybrid.parameters import changed, parameters
from tripwatt.vehicles import load_vehicle


class TestParameters:
    car = load_vehicle("bmw_i3_60ah")

    def test_a_change_is_relative_and_names_its_source(self) -> None:
        heavier = changed(self.car, {"mass": 0.1, "air": -0.5}, source="mine")
        assert heavier.body.curb_mass_kg == pytest.approx(1.1 * self.car.body.curb_mass_kg)
        assert heavier.body.driver_mass_kg == pytest.approx(1.1 * self.car.body.driver_mass_kg)
        assert heavier.road_load.coastdown_c_n_s2_m2 == pytest.approx(
            0.5 * self.car.road_load.coastdown_c_n_s2_m2
        )
        assert heavier.road_load.coastdown_a_n == self.car.road_load.coastdown_a_n
        assert heavier.entries["body.curb_mass_kg"].source.startswith("mine; published")
        assert heavier.entries["body.curb_mass_kg"].value == heavier.body.curb_mass_kg
        assert heavier.entries["road_load.coastdown_a_n"] == self.car.entries["road_load.coastdown_a_n"]
        unnamed = changed(self.car, {"mass": 0.1}).entries["body.curb_mass_kg"]
        assert unnamed.source.startswith("published value times 1.100")

    def test_widths_are_those_of_their_sources(self) -> None:
        widths = {p.name: p.width for p in parameters()}
        assert widths == {
            "mass": 0.05,
            "rolling": 0.15,
            "air": 0.10,
            "base_load": 0.40,
            "drivetrain": 0.20,
            "climate": 0.30,
        }
