"""Features of a fleet's linear model, and the sums of its trips."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.many_vehicles import many_vehicles

from tripwatt.fleet.features import FEATURES, SCALES, segment_features, trip_features, trip_variance_wh2
from tripwatt.hybrid import segment_trips
from tripwatt.trips import Trip
from tripwatt.vehicles import load_vehicle

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_features_are_energies_by_cause_and_climate(fleet):
    plan, *_ = fleet
    log = next(many_vehicles(plan))
    car = load_vehicle("bmw_i3_60ah")
    table = segment_trips([Trip.from_log(log)], car)
    X = segment_features(table) / SCALES
    features = table.features
    assert X[:, 0] == pytest.approx(features["air_w"].to_numpy(), rel=1e-12)
    assert X[:, FEATURES.index("climate")] == pytest.approx(features["climate_w"].to_numpy(), rel=1e-12)
    ambient, time_s = features["ambient_temperature_degc"].to_numpy(), features["time_s"].to_numpy()
    assert X[:, FEATURES.index("cold")] == pytest.approx(np.maximum(20.0 - ambient, 0.0))
    assert X[:, FEATURES.index("hot")] == pytest.approx(np.maximum(ambient - 20.0, 0.0))
    assert X[:, FEATURES.index("start")] == pytest.approx(np.exp(-time_s / 900.0))
    assert X[:, FEATURES.index("cold_start")] == pytest.approx(
        np.maximum(20.0 - ambient, 0.0) * np.exp(-time_s / 900.0)
    )
    assert trip_features(table)[0] == pytest.approx(table.hours @ segment_features(table), rel=1e-12)
    moved = float(table.hours @ features["moved_w"].to_numpy())
    assert trip_variance_wh2(table) == pytest.approx([1600.0 + 0.0025 * moved**2])
    unknown = replace(table, features=features.assign(ambient_temperature_degc=np.nan))
    assert not segment_features(unknown)[:, [FEATURES.index("cold"), FEATURES.index("hot")]].any()
