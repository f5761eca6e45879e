"""Climate control apart from driving: what a log tells of it, and that neither channel pays for the other."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import SegmentTable, power_corrector
from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.hybrid.segments import LINE_CAUSES
from tripwatt.hybrid.split import climate_logged
from tripwatt.trips import TEMPERATURES


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


@pytest.fixture
def table() -> SegmentTable:
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
        observed_hvac_w=frame["hvac_w"].to_numpy() + climate,
    )


def test_each_channel_learns_its_own_and_the_parts_add_up(table: SegmentTable):
    train, test = table.take(range(30)), table.take(range(30, 40))
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


def test_without_enough_logged_climate_one_corrector_learns_both(table: SegmentTable):
    known = table.observed_hvac_w
    assert known is not None
    sparse = replace(table, observed_hvac_w=np.where(table.groups < 15, known, np.nan))
    assert climate_logged(sparse).sum() == 15
    corrector = power_corrector("split").fit(sparse)
    assert corrector.predict_climate(sparse) is None
    whole = power_corrector("ensemble").fit(sparse)
    np.testing.assert_allclose(corrector.predict(sparse), whole.predict(sparse))
