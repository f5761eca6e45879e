"""Logged power of climate control by segments."""

import numpy as np
import pandas as pd
import pytest
from tests.hybrid.tables import EXACT, NO

from tripwatt.hybrid.climate_log import logged_climate


def test_logged_climate_adds_up_over_blocks_and_leaves_gaps_open():
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0.0, 300.0, 900))
    heater, cooler = rng.uniform(0, 4000, 900), rng.uniform(0, 900, 900)
    log = pd.DataFrame({"time_s": time, "heating_power_w": heater, "aircon_power_w": cooler})
    edges = np.array([0.0, 60.0, 150.0, 300.0])
    found = logged_climate(log, edges)
    whole = logged_climate(log, np.array([0.0, 300.0]))
    assert found is not None
    assert whole is not None
    np.testing.assert_allclose(found @ np.diff(edges) / 300.0, whole[0], rtol=0.01)
    assert whole[0] == pytest.approx(np.mean(heater + cooler), rel=0.05)
    part = logged_climate(log[log["time_s"] < 70.0], edges)
    assert part is not None
    assert np.isfinite(part[0])
    assert np.isnan(part[1:]).all()


def test_one_of_the_two_or_a_stuck_heater_says_nothing():
    time = np.arange(0.0, 1200.0)
    both = pd.DataFrame({"time_s": time, "heating_power_w": 1500.0, "aircon_power_w": 200.0})
    both["heating_power_w"] += 1000.0 * (time % 400 == 7)  # pulses on a value that never moves
    edges = np.array([0.0, 600.0, 1200.0])
    stuck = both.assign(requested_heating_power_w=0.0)
    assert logged_climate(stuck, edges) is None
    assert logged_climate(both.drop(columns="aircon_power_w"), edges) is None
    assert logged_climate(both.assign(aircon_power_w=np.nan), edges) is None


class TestLoggedClimate:
    edges = np.array([0.0, 4.0, 8.0])

    def log(self, time, heat, cool=100.0) -> pd.DataFrame:
        return pd.DataFrame(
            {"time_s": np.asarray(time, dtype=float), "heating_power_w": heat, "aircon_power_w": cool}
        )

    def test_means_and_negative_powers(self) -> None:
        found = logged_climate(self.log([0, 2, 4, 6, 8], [400.0, 600.0, 800.0, -200.0, 0.0]), self.edges)
        # trapezia of 500, 700, 400, 0 W and 100 W of the compressor
        assert found == pytest.approx([700.0, 300.0], **EXACT)

    def test_half_of_a_segment_is_enough(self) -> None:
        assert logged_climate(self.log([0, 2, 4, 6], 400.0), self.edges) == pytest.approx(
            [500.0, 500.0], **EXACT
        )
        found = logged_climate(self.log([0, 2, 4, 5.9], 400.0), self.edges)
        assert found == pytest.approx([500.0, NO], nan_ok=True, **EXACT)

    def test_gaps_up_to_the_longest_segment(self) -> None:
        assert logged_climate(self.log([0, 4, 8], 400.0), self.edges) == pytest.approx(
            [500.0, 500.0], **EXACT
        )
        found = logged_climate(self.log([0, 4, 8.1], 400.0), self.edges)
        assert found == pytest.approx([500.0, NO], nan_ok=True, **EXACT)

    def test_missing_values_cover_nothing(self) -> None:
        found = logged_climate(self.log([0, 2, 4, 6, 8], [400.0, 400.0, 400.0, 400.0, NO]), self.edges)
        assert found == pytest.approx([500.0, 500.0], **EXACT)
        found = logged_climate(self.log([0, 2, 4, 6, 8], [400.0, 400.0, 400.0, NO, 400.0]), self.edges)
        assert found == pytest.approx([500.0, NO], nan_ok=True, **EXACT)
        never = self.log([0, 2, 4], [NO, 400.0, NO], [100.0, NO, 100.0])
        assert logged_climate(never, self.edges) is None
