"""Autocorrelation of residuals and concurvity: bounds, values by hand, and those of mgcv."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamm_samples import FIXTURES, mgcv_fit
from tripwatt_gamm import autocorrelation
from tripwatt_gamm.checks import column_concurvity, concurvity
from tripwatt_gamm.errors import InvalidInput

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


@pytest.mark.parametrize("phi", [-0.6, 0.9])
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


def test_autocorrelation_refuses_what_it_cannot_use():
    with pytest.raises(InvalidInput, match=r"lengths differ[\s\S]*not finite"):
        autocorrelation([1.0, np.nan], ["a"])
    with pytest.raises(InvalidInput, match="no pair"):
        autocorrelation([1.0, 2.0], ["a", "b"])


def test_concurvity_lies_between_zero_and_one(waves_fit):
    table = concurvity(waves_fit)
    assert list(table.index) == ["parametric", *[b.label for b in waves_fit.terms_ if b.kind != "parametric"]]
    assert table.to_numpy().min() >= 0
    assert table.to_numpy().max() <= 1
    assert (table["worst"] >= table["observed"] - 1e-9).all()


def test_concurvity_is_that_of_mgcv():
    fit, smooths, _ = mgcv_fit("concurvity")
    table = concurvity(fit)
    assert list(table.index) == ["parametric", *smooths.index]
    # mgcv's first row sees the intercept only; ours is the whole parametric part
    np.testing.assert_allclose(
        table[1:], pd.read_csv(FIXTURES / "inference" / "concurvity" / "concurvity.csv")[1:], atol=1e-6
    )


def test_concurvity_of_a_repeated_column_is_one_and_of_an_orthogonal_one_zero():
    rng = np.random.default_rng(0)
    basis, _ = np.linalg.qr(rng.normal(size=(50, 5)))
    factor = np.column_stack([basis, basis[:, 3] * 2.0])
    assert column_concurvity(factor, np.ones(6), np.array([5])) == pytest.approx((1.0, 1.0, 1.0))
    assert column_concurvity(factor, np.ones(6), np.array([0, 1])) == pytest.approx(
        (0.0, 0.0, 0.0), abs=1e-12
    )
