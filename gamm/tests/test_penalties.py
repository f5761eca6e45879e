"""The determinant of several penalties."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tripwatt_gamm.penalties import LOG_RATIO, PenaltyBlock, PenaltyStack

few = settings(max_examples=8, deadline=None)


@few
@example(logs=[-25.0, 22.0, 0.0], count=3)
@given(logs=st.lists(st.floats(*LOG_RATIO), min_size=3, max_size=3), count=st.integers(1, 3))
def test_log_determinant_of_several_penalties(logs, count):
    rng = np.random.default_rng(3)
    D = [np.diff(np.eye(4), axis=0), np.diff(np.eye(3), axis=0)]
    parts = [np.kron(D[0].T @ D[0], np.eye(3)), np.kron(np.eye(4), D[1].T @ D[1])]
    parts.append(parts[0] @ parts[1])
    Q = np.linalg.qr(rng.normal(size=(12, 12)))[0]
    matrices = [Q.T @ S @ Q for S in parts][:count]
    stack = PenaltyStack(14, [PenaltyBlock.from_matrices(2, matrices)])
    rho = np.array(logs[:count])
    value, gradient, _ = stack.log_determinant(rho)
    # all parts share their eigenvectors, so the truth needs no cancelling sums
    share = np.linalg.eigh(sum(np.pi**j * S for j, S in enumerate(parts)))[1]
    diagonals = np.array([np.diag(share.T @ S @ share).clip(0) for S in parts[:count]])
    diagonals[diagonals < 1e-9] = 0
    seen = diagonals.any(axis=0)
    truth = np.log(np.exp(rho) @ diagonals[:, seen]).sum()
    assert value == pytest.approx(truth, abs=1e-4)
    assert gradient.sum() == pytest.approx(seen.sum(), abs=1e-4)
    assert stack.null_dim == 14 - seen.sum()
