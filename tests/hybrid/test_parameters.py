"""Parameters of a car: what their changes do, and their widths."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import segments
from tripwatt.hybrid.parameters import changed, parameters, sensitivities
from tripwatt.hybrid.segments import LINE_CAUSES, segment_table
from tripwatt.trips import Plan
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

    def test_sensitivities(self, monkeypatch) -> None:
        """A power of 2 W for each kilogram of the car, at a change of 2 %; a cause that is multiplied as it is."""
        plan = Plan.from_trace("p", pd.DataFrame({"time_s": np.arange(31.0), "speed_m_s": 1.0}))

        def run(car, plan):
            n = len(plan)
            causes = dict.fromkeys(LINE_CAUSES, np.full(n, 7.0)) | {"climate": np.full(n, 30.0)}
            watts = np.full(n, 2.0 * car.body.test_mass_kg)
            return SimpleNamespace(battery_power_w=watts, power_by_cause_w=causes, wheel_power_w=watts)

        own = segment_table(plan, run(self.car, plan))
        monkeypatch.setattr(segments, "simulate_trips", lambda pairs: [run(*pair) for pair in pairs])
        found = sensitivities([plan], self.car, own)
        assert found == pytest.approx(
            np.array([[2.0 * self.car.body.test_mass_kg, 0.0, 0.0, 7.0, 7.0, 30.0]]), rel=1e-6, abs=1e-6
        )
