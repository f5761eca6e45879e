"""Metrics against values worked out by hand, and the bootstrap against the normal theory."""

import numpy as np
import pytest

from tripwatt.evaluation.metrics import bootstrap_interval, paired_difference, summarise_errors


def test_summary_by_hand():
    summary = summarise_errors(np.array([100.0, 200.0, 400.0]), np.array([110.0, 180.0, 400.0]), seed=0)
    assert summary.mape == pytest.approx(0.2 / 3)
    assert summary.median_ape == pytest.approx(0.1)
    assert summary.max_ape == pytest.approx(0.1)
    assert summary.bias == pytest.approx(0.0)
    assert summary.rmse_wh == pytest.approx(np.sqrt(500 / 3))


def test_interval_matches_normal_theory():
    values = np.random.default_rng(3).normal(0.1, 0.05, 400)
    low, high = bootstrap_interval(values, seed=1)
    half = 1.96 * values.std() / np.sqrt(len(values))
    assert low == pytest.approx(values.mean() - half, abs=half / 15)
    assert high == pytest.approx(values.mean() + half, abs=half / 15)


def test_paired_difference_is_antisymmetric_and_knows_significance():
    rng = np.random.default_rng(0)
    a, noise = rng.uniform(0.05, 0.2, 60), rng.normal(0, 0.01, 60)
    clear = paired_difference(a, a + 0.02 + noise, seed=5)
    assert clear.significant
    assert clear.diff < 0
    assert paired_difference(a + 0.02 + noise, a, seed=5).diff == pytest.approx(-clear.diff)
    assert not paired_difference(a, a + noise - noise.mean(), seed=5).significant


def test_one_trip_has_an_interval_without_width() -> None:
    assert bootstrap_interval(np.array([0.25]), seed=3) == (0.25, 0.25)
