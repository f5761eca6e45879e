"""Trees of a fleet."""

import numpy as np
import pytest
from tests.fleet.rows import mapped

from tripwatt.fleet.corrector import FleetCorrector, FleetTrees, choose_rounds
from tripwatt.fleet.mapping import SampledTrips, sample_digests

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_trees_are_used_where_they_help(fleet):
    _, store, _, folder = fleet
    results = mapped(store, folder / "trees", sample_digests(store.trip_rows(), 9, 9))
    table = SampledTrips.read(results).table
    folds = np.arange(len(table)) % 4
    speed = table.features["speed_m_s"].to_numpy()
    step = np.where(speed > np.median(speed), 900.0, -900.0)
    rounds, held_out = choose_rounds(table, step, folds, 0)
    assert rounds in range(20, 121, 20)
    assert np.abs(step - held_out).mean() < 0.5 * np.abs(step).mean()
    noise = np.random.default_rng(0).normal(0.0, 900.0, len(speed))
    assert choose_rounds(table, noise, folds, 0)[0] == 0
    trees = FleetTrees.fit(table, step, 60, 3)
    assert trees.text == FleetTrees.fit(table, step, 60, 3).text
    assert np.abs(step - trees.predict(table)).mean() < 0.4 * 900.0
    assert not FleetTrees.fit(table, step, 0, 3).predict(table).any()
    corrector = FleetCorrector(np.zeros(12), np.zeros((12, 12)), trees)
    assert corrector.predict_with_uncertainty(table)[0].tolist() == trees.predict(table).tolist()
    assert corrector.outside_factor(table).tolist() == [[0.0]] * len(speed)
    assert corrector.predict_climate(table) is None
