"""Linear algebra that has to give an answer for every sound matrix, and the relaxation against its recursion."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.arrays import Relaxation, covariance_factor, eigen


@pytest.fixture
def covariance() -> np.ndarray:
    root = np.random.default_rng(0).normal(size=(30, 30)) * np.geomspace(1e3, 1e-2, 30)
    return root @ root.T


def rebuilt(found: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    values, vectors = found
    return vectors * values @ vectors.T


def test_values_ascend_and_rebuild_the_matrix(covariance: np.ndarray) -> None:
    found = eigen(covariance)
    assert (np.diff(found[0]) >= 0.0).all()
    np.testing.assert_allclose(rebuilt(found), covariance, rtol=1e-9, atol=1e-6)


def test_a_factor_rebuilds_a_singular_covariance(covariance: np.ndarray) -> None:
    covariance[:, 3] = covariance[3] = 0.0
    covariance[5, 6] *= 1.0 + 1e-12
    factor = covariance_factor(covariance)
    np.testing.assert_allclose(factor @ factor.T, covariance, rtol=1e-9, atol=1e-6)


def test_another_algorithm_answers_where_the_first_one_fails(
    covariance: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = eigen(covariance)

    def fails(matrix: np.ndarray) -> None:
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr(np.linalg, "eigh", fails)
    found = eigen(covariance)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(rebuilt(found), covariance, rtol=1e-9, atol=1e-6)


EXACT = {"rel": 1e-12, "abs": 1e-12}


def test_relaxation_over_several_blocks() -> None:
    """Halves, then an interval that forgets everything, then halves again; and a sum of exactly 200."""
    half = math.log(2.0)
    given = Relaxation(np.array([half, 500.0, half, half])).solve(8.0, np.array([0.0, 4.0, 0.0, 0.0]))
    assert given == pytest.approx([4.0, 4.0, 2.0, 1.0], **EXACT)
    step = np.array([199.0, 1.0, half])
    kept = 8.0 * math.exp(-200.0)
    assert Relaxation(step[:2]).solve(8.0, np.zeros(2))[-1] == pytest.approx(kept, rel=1e-9)
    assert Relaxation(step).solve(8.0, np.zeros(3))[-1] == pytest.approx(kept / 2.0, rel=1e-9)
    first = Relaxation(np.array([300.0, half])).solve(8.0, np.array([2.0, 0.0]))
    assert first == pytest.approx([2.0, 1.0], **EXACT)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 200), st.sampled_from([1e-6, 0.1, 3.0, 300.0]))
def test_relaxation_is_the_recursion(seed, n, scale) -> None:
    rng = np.random.default_rng(seed)
    step, target = rng.exponential(scale, n), rng.normal(0.0, 30.0, n)
    state, expected = 5.0, []
    for s, t in zip(step, target, strict=True):
        state = state * np.exp(-s) + t * -np.expm1(-s)
        expected.append(state)
    assert Relaxation(step).solve(5.0, target) == pytest.approx(np.array(expected), abs=1e-9, rel=1e-9)
