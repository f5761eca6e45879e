"""The autocorrelation of residuals is a correlation: bounded, right by hand, and that of a known process."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripwatt.gam import autocorrelation

RESIDUALS = st.lists(
    st.tuples(
        st.integers(0, 3), st.floats(-1e9, 1e9, allow_nan=False).map(lambda v: 0.0 if abs(v) < 1e-9 else v)
    ),
    min_size=2,
    max_size=60,
)


@given(RESIDUALS)
def test_it_lies_between_minus_one_and_one(rows: list[tuple[int, float]]) -> None:
    groups = [group for group, _ in rows]
    if max(groups.count(group) for group in groups) < 2:
        return
    found = autocorrelation([value for _, value in rows], groups)
    assert np.all(np.abs(found.correlation) <= 1.0)


def test_it_is_what_the_formula_gives_by_hand() -> None:
    # mean 0; lag 1: pairs (1, 2), (2, -3) of a and (2, -2) of b; lag 2: the pair (1, -3) of a alone
    found = autocorrelation([1.0, 2.0, -3.0, 2.0, -2.0], ["a", "a", "a", "b", "b"], max_lag=2)
    assert found.pairs.tolist() == [3, 1]
    first = (1 * 2 + 2 * -3 + 2 * -2) / np.sqrt((1 + 4 + 4) * (4 + 9 + 4))
    np.testing.assert_allclose(found.correlation, [first, -1.0])


def test_one_long_group_does_not_exceed_one() -> None:
    """Short quiet groups and one long, loud, alternating one: a mean product over the whole variance is -1.8 here."""
    loud = 5.0 * np.tile([1.0, -1.0], 20)
    quiet = np.tile([0.1, -0.1], 20)
    residuals = np.concatenate([loud, quiet])
    groups = np.repeat(["long", *[f"short {i}" for i in range(20)]], [40, *[2] * 20])
    found = autocorrelation(residuals, groups, max_lag=3)
    lag_3 = residuals[3:40] @ residuals[:37] / 37 / (residuals @ residuals / len(residuals))
    assert lag_3 < -1.8
    assert found.correlation[2] == pytest.approx(-1.0)


@pytest.mark.parametrize("phi", [-0.6, 0.0, 0.5, 0.9])
def test_it_recovers_an_autoregressive_process_in_groups_of_unequal_length(phi: float) -> None:
    rng = np.random.default_rng(4)
    lengths = rng.integers(20, 400, 150)
    parts = []
    for n in lengths:
        series = np.empty(n)
        series[0] = rng.normal() / np.sqrt(1.0 - phi**2)
        for t in range(1, n):
            series[t] = phi * series[t - 1] + rng.normal()
        parts.append(series)
    found = autocorrelation(np.concatenate(parts), np.repeat(np.arange(150), lengths), max_lag=4)
    np.testing.assert_allclose(found.correlation, phi ** np.arange(1, 5), atol=0.03)
