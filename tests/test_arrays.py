"""Linear algebra that has to give an answer for every sound matrix."""

import numpy as np
import pytest

from tripwatt.arrays import covariance_factor, eigen


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
