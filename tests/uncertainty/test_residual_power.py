"""Conditioning without a matrix gives the numbers of the textbook's matrices, for any measurements."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.dense_process import DensePower, covariance

from tripwatt.uncertainty.process import ComponentProcess, ResidualProcess, Segments
from tripwatt.uncertainty.residual_power import PowerSum, drift_variance, fading_sums

DRIVE = ComponentProcess(49.0, 0.011, 710.0, 66.0, 0.7)
CLIMATE = ComponentProcess(214.0, 0.072, 277.0, 217.0, 134.0, 4.1, 101.0)
PROCESS = ResidualProcess(DRIVE, CLIMATE, 1244.0, split=True)
WITHOUT = {
    "constants": {"constant_sd_w": 0.0, "share_sd": 0.0},
    "drifts": {"drift_sd_w": 0.0},
    "both": {"constant_sd_w": 0.0, "share_sd": 0.0, "drift_sd_w": 0.0},
    "nothing": {},
}


def a_trip(rng: np.random.Generator, n: int) -> Segments:
    step = np.full(n, 30.0)
    step[-1] = rng.uniform(5.0, 30.0)
    edges = np.concatenate(([0.0], np.cumsum(step)))
    middle = 0.5 * (edges[1:] + edges[:-1])
    return Segments(middle, step, rng.uniform(0, 9000, n), rng.uniform(0, 3000, n))


def same(found, expected, hours) -> None:
    np.testing.assert_allclose(
        found.mean_w, expected.mean_w, rtol=1e-8, atol=1e-8 * np.abs(expected.mean_w).max()
    )
    covariance_w2 = expected.covariance_w2
    atol = 1e-8 * np.abs(covariance_w2).max()
    np.testing.assert_allclose(found.covariance_w2, covariance_w2, rtol=1e-6, atol=atol)
    sd_wh = expected.sd_wh(hours)
    np.testing.assert_allclose(found.sd_wh(hours), sd_wh, rtol=1e-8, atol=1e-8 * sd_wh.max())


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    n=st.integers(2, 150),
    share=st.floats(0.02, 1.0),
    gaps=st.floats(0.0, 0.6),
    without=st.sampled_from(list(WITHOUT)),
    component=st.sampled_from(["joint", "drive", "climate"]),
)
def test_measured_power_of_segments(seed, n, share, gaps, without, component):
    rng = np.random.default_rng(seed)
    process = dataclasses.replace(
        PROCESS,
        drive=dataclasses.replace(DRIVE, **WITHOUT[without]),
        climate=dataclasses.replace(CLIMATE, **WITHOUT[without]),
    )
    segments = a_trip(rng, n)
    upto = max(int(share * n), 1)
    seen = np.flatnonzero(rng.random(upto) >= gaps)
    seen = seen if len(seen) else np.array([upto - 1])
    power, variance = (
        rng.normal(0, 900, len(seen)),
        1.0 + rng.uniform(0, 3e4, len(seen)) * (rng.random() < 0.5),
    )
    prior = process.prior(segments, component)
    dense = DensePower.from_covariance(covariance(process, segments, component))
    expected = dense.given(np.eye(n)[seen], power, variance)
    open_hours = segments.hours * rng.uniform(0, 1, n)
    found = prior.measured(seen, power, variance)
    same(found, expected, open_hours)
    # what was measured as a whole takes no part any more
    open_hours[seen] = 0.0
    same(found, expected, open_hours)
    same(prior.averaged(np.eye(n)[seen], power, np.diag(variance)), expected, open_hours)


@pytest.mark.parametrize("n", [3, 64, 65, 200])
def test_means_over_several_segments(n):
    rng = np.random.default_rng(n)
    segments = a_trip(rng, n)
    ends = np.unique(np.concatenate(([0], np.sort(rng.integers(1, n + 1, 5)))))
    weights = np.array([(np.arange(n) >= a) & (np.arange(n) < b) for a, b in itertools.pairwise(ends)])
    weights = weights / weights.sum(axis=1, keepdims=True)
    power, variance = rng.normal(0, 900, len(weights)), rng.uniform(1e3, 1e5, len(weights))
    prior = PROCESS.prior(segments)
    expected = DensePower.from_covariance(covariance(PROCESS, segments)).given(weights, power, variance)
    same(prior.averaged(weights, power, np.diag(variance)), expected, segments.hours)


@pytest.mark.parametrize("component", ["joint", "drive", "climate"])
@pytest.mark.parametrize("n", [1, 63, 64, 65, 300])
def test_before_anything_was_measured(n, component):
    rng = np.random.default_rng(n)
    segments = a_trip(rng, n)
    prior, dense = PROCESS.prior(segments, component), covariance(PROCESS, segments, component)
    same(prior, DensePower.from_covariance(dense), segments.hours)
    columns = rng.normal(size=(n, 3))
    np.testing.assert_allclose(prior.times(columns), dense @ columns, rtol=1e-9, atol=1e-6)


def test_sums_that_fade():
    time, values = np.array([0.0, 10.0, 30.0]), np.array([1.0, 2.0, 4.0])
    expected = [1.0, 2.0 + np.exp(-0.5), 4.0 + 2.0 * np.exp(-1.0) + np.exp(-1.5)]
    np.testing.assert_allclose(fading_sums(time, values, 20.0), expected, rtol=1e-14)
    covariance_ = np.exp(-np.abs(time[:, None] - time) / 20.0) * np.outer(values, values)
    variance = [covariance_[: k + 1, : k + 1].sum() for k in range(3)]
    np.testing.assert_allclose(drift_variance(time, values, 20.0), variance, rtol=1e-14)
    late = np.concatenate((time, time + 15_000.0, time + 30_000.0))
    parts = np.add.outer([0.0, variance[-1], 2.0 * variance[-1]], variance).ravel()
    np.testing.assert_allclose(drift_variance(late, np.tile(values, 3), 20.0), parts, rtol=1e-12)


def test_variances_of_parts_add_up():
    rng = np.random.default_rng(3)
    segments = a_trip(rng, 40)
    drive, climate = (
        PROCESS.prior(segments, name).measured(np.arange(9), rng.normal(0, 500, 9), np.ones(9))
        for name in ("drive", "climate")
    )
    both = PowerSum((drive, climate), drive.mean_w + 100.0)
    hours = segments.hours
    np.testing.assert_allclose(both.sd_wh(hours), np.hypot(drive.sd_wh(hours), climate.sd_wh(hours)))
    np.testing.assert_allclose(PowerSum((drive,), both.mean_w).sd_wh(hours), drive.sd_wh(hours))
