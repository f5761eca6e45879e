"""Climate control apart from driving: what a log tells of it, and that neither channel pays for the other."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from tests.hybrid.tables import NO, Fixed, table

from tripwatt.hybrid import SegmentTable, power_corrector
from tripwatt.hybrid.power import (
    SplitCorrector,
    climate_logged,
)
from tripwatt.hybrid.segments import LINE_CAUSES
from tripwatt.trips import TEMPERATURES


@pytest.fixture
def logged_fleet() -> SegmentTable:
    """Trips whose climate residual goes with the ambient temperature and whose driving residual with air drag."""
    rng = np.random.default_rng(1)
    trips, segments = 40, 20
    rows = trips * segments
    ambient = np.repeat(rng.uniform(-10, 30, trips), segments)
    features = {name: rng.uniform(0, 2000, rows) for name in (f"{c}_w" for c in LINE_CAUSES)}
    features |= {name: np.repeat(rng.uniform(0, 30, trips), segments) for name in (*TEMPERATURES, "soc")}
    features["ambient_temperature_degc"] = ambient
    features |= {
        "simulated_w": sum(features[f"{c}_w"] for c in LINE_CAUSES),
        "moved_w": rng.uniform(0, 9000, rows),
        "speed_m_s": rng.uniform(0, 30, rows),
        "speed_change_m_s2": rng.uniform(0, 1, rows),
        "time_s": np.tile(15.0 + 30.0 * np.arange(segments), trips),
        "trip_speed_m_s": np.repeat(rng.uniform(5, 25, trips), segments),
        "payload_mass_kg": np.zeros(rows),
    }
    frame = pd.DataFrame(features)
    climate = 20.0 * (20.0 - ambient) + np.repeat(rng.normal(0, 60, trips), segments)
    drive = -0.15 * frame["air_w"].to_numpy() + np.repeat(rng.normal(0, 60, trips), segments)
    return SegmentTable(
        trip_ids=tuple(f"t{i}" for i in range(trips)),
        offsets=np.arange(0, rows + 1, segments),
        features=frame,
        hours=np.full(rows, 30.0 / 3600.0),
        simulated_w=frame["simulated_w"].to_numpy(),
        observed_w=frame["simulated_w"].to_numpy() + climate + drive,
        observed_climate_w=frame["climate_w"].to_numpy() + climate,
    )


def test_each_channel_learns_its_own_and_the_parts_add_up(logged_fleet: SegmentTable):
    train, test = logged_fleet.take(range(30)), logged_fleet.take(range(30, 40))
    corrector = power_corrector("split").fit(train)
    climate = corrector.predict_climate(test)
    assert climate is not None
    truth = 20.0 * (20.0 - test.features["ambient_temperature_degc"].to_numpy())
    assert np.corrcoef(climate, truth)[0, 1] > 0.95
    assert np.mean(np.abs(climate - truth)) < 0.35 * np.mean(np.abs(truth))
    driving = corrector.predict(test) - climate
    assert abs(np.corrcoef(driving, truth)[0, 1]) < 0.5  # driving has not learned the climate once more
    assert np.mean(np.abs(driving + 0.15 * test.features["air_w"].to_numpy())) < 0.2 * np.mean(np.abs(truth))
    mean, doubt = corrector.predict_with_uncertainty(test)
    np.testing.assert_allclose(mean, corrector.predict(test))
    np.testing.assert_allclose(
        doubt @ doubt.T, (lambda L: L @ L.T)(corrector.predict_with_uncertainty(test)[1])
    )


def test_without_enough_logged_climate_one_corrector_learns_both(logged_fleet: SegmentTable):
    known = logged_fleet.observed_climate_w
    assert known is not None
    sparse = replace(logged_fleet, observed_climate_w=np.where(logged_fleet.groups < 15, known, np.nan))
    assert climate_logged(sparse).sum() == 15
    corrector = power_corrector("split").fit(sparse)
    assert corrector.predict_climate(sparse) is None
    whole = power_corrector("ensemble").fit(sparse)
    np.testing.assert_allclose(corrector.predict(sparse), whole.predict(sparse))


class TestSplit:
    def logged(self, n, known) -> SegmentTable:
        """Trips of two rows; the last one of an unknown trip has no climate control."""
        climate = np.full(2 * n, 350.0)
        climate[2 * known + 1 :: 2] = NO
        return table(
            [2] * n,
            np.full(2 * n, 0.1),
            simulated=np.full(2 * n, 5000.0),
            observed=np.full(2 * n, 5300.0),
            climate=climate,
            simulated_climate=np.full(2 * n, 300.0),
        )

    @pytest.mark.parametrize(
        ("n", "known", "split"), [(8, 8, True), (7, 7, False), (16, 8, True), (17, 8, False), (20, 9, False)]
    )
    def test_climate_control_needs_eight_trips_and_half_of_them(self, n, known, split) -> None:
        own = self.logged(n, known)
        assert climate_logged(own).tolist() == [True] * known + [False] * (n - known)
        parts = Fixed(20.0, 1.0), Fixed(7.0, 2.0), Fixed(99.0, 4.0)
        found = SplitCorrector(*parts).fit(own)
        assert found.split_ is split
        climate, drive, joint = parts
        if not split:
            assert joint.seen is own
            assert climate.seen is drive.seen is None
            assert found.predict(own)[0] == 99.0
            assert found.predict_climate(own) is None
            assert found.outside_factor(own)[0].tolist() == [40.0]
            assert found.predict_with_uncertainty(own)[1][0].tolist() == [4.0]
            again = found.clone_tuned()
            assert again.joint.watts == 99.5
            assert again.split is False
            return
        # climate control took 50 W more than simulated, of the 300 W of the residual
        assert len(climate.seen) == known
        assert climate.seen.residual_w.tolist() == [50.0] * (2 * known)
        assert drive.seen.residual_w.tolist() == [250.0] * (2 * known) + [280.0] * (2 * (n - known))
        assert joint.seen is None
        assert found.predict(own)[0] == 27.0
        assert found.predict_climate(own)[0] == 20.0
        assert found.outside_factor(own)[0].tolist() == [10.0, 20.0]
        mean, factor = found.predict_with_uncertainty(own)
        assert mean[0] == 27.0
        assert factor[0].tolist() == [1.0, 2.0]
        again = found.clone_tuned()
        assert (again.climate.watts, again.drive.watts) == (20.5, 7.5)
        assert again.split is True

    def test_the_choice_can_be_given(self) -> None:
        parts = Fixed(), Fixed(), Fixed()
        assert not SplitCorrector(*parts, False).fit(self.logged(8, 8)).split_
        assert SplitCorrector(*parts, True).split_
