"""Errors of a fleet's energy by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tripwatt.evaluation.transfer_scores import curve_row, paired_energy_error, resamples, scored

EXACT = {"rel": 1e-9, "abs": 1e-12}


EACH = np.array([[0, 0], [1, 1], [0, 1], [0, 1]])


def of_quantiles(values):
    return [float(np.quantile(values, q)) for q in (0.025, 0.975)]


def test_resamples_draw_as_many_trips_as_there_are():
    found = resamples(3, 7)
    np.testing.assert_array_equal(found, np.random.default_rng((7, 3)).integers(0, 3, size=(4000, 3)))
    assert resamples(3, 7, 5).shape == (5, 3)


def test_error_and_bias_with_their_intervals():
    found = scored(np.array([1000.0, 3000.0]), np.array([1200.0, 2700.0]), EACH)
    assert found["error"] == pytest.approx(500.0 / 4000.0, **EXACT)
    assert found["bias"] == pytest.approx(-100.0 / 4000.0, **EXACT)
    assert found["error_ci95"] == pytest.approx(of_quantiles([0.2, 0.1, 0.125, 0.125]), **EXACT)
    assert found["bias_ci95"] == pytest.approx(of_quantiles([0.2, -0.1, -0.025, -0.025]), **EXACT)


def test_a_paired_error_is_that_of_the_first_less_that_of_the_second():
    observed, index = np.array([1000.0, 3000.0]), EACH
    found = paired_energy_error(observed, np.array([1100.0, 2900.0]), np.array([700.0, 3400.0]), index)
    assert found["diff"] == pytest.approx((-200.0 - 300.0) / 4000.0, **EXACT)
    assert found["diff_ci95"] == pytest.approx(of_quantiles([-0.2, -0.1, -0.125, -0.125]), **EXACT)
    assert found["significant"]
    other = paired_energy_error(observed, np.array([1100.0, 2900.0]), np.array([1300.0, 3050.0]), index)
    assert other["diff"] == pytest.approx((-200.0 + 50.0) / 4000.0, **EXACT)
    assert not other["significant"]
    worse = paired_energy_error(observed, np.array([700.0, 3400.0]), np.array([1100.0, 2900.0]), index)
    assert worse["significant"]
    same = paired_energy_error(observed, observed, observed, index)
    assert (same["diff"], same["significant"]) == (0.0, False)


def test_a_row_of_the_curve_by_hand():
    """Two draws; the second misses by 300 and 100 Wh with a deviation of 200 Wh, 1.645 of which are 329 Wh."""
    observed, simulated = np.array([1000.0, 3000.0]), np.array([900.0, 3100.0])
    mean = np.array([[100.0, -600.0], [400.0, 0.0]])
    forecast = SimpleNamespace(mean_wh=mean, sd_wh=np.full((2, 2), 200.0), share=np.array([0.2, 0.6]))
    row = curve_row(5, forecast, simulated, observed, EACH, 3)
    assert (row["k"], row["draws"]) == (5, 2)
    assert row["error"] == pytest.approx((500.0 + 400.0) / 2 / 4000.0, **EXACT)
    assert row["bias"] == pytest.approx((-500.0 + 400.0) / 2 / 4000.0, **EXACT)
    assert row["error_of_draws"] == pytest.approx(
        [0.1 + 0.025 * 0.025, 0.1125, 0.125 - 0.025 * 0.025], **EXACT
    )
    assert row["share_in_common"] == pytest.approx(0.4, **EXACT)
    assert row["inside_90"] == 0.75
    drawn = np.random.default_rng((3, 1, 5)).integers(0, 2, size=4)
    miss = np.array([[0.0, 500.0], [300.0, 100.0]])
    both = [miss[d, i].sum() / observed[i].sum() for d, i in zip(drawn, EACH, strict=True)]
    assert row["error_ci95"] == pytest.approx(of_quantiles(both), **EXACT)


@pytest.mark.parametrize(("sd_wh", "inside"), [(60.80, 1.0), (60.79, 0.0)])
def test_the_central_nine_tenths_are_1_645_standard_deviations(sd_wh, inside):
    """Of 60.796 Wh they are 100 Wh."""
    assert stats.norm.ppf(0.95) * 60.796 == pytest.approx(100.0, abs=1e-3)
    forecast = SimpleNamespace(mean_wh=np.array([[100.0]]), sd_wh=np.array([[sd_wh]]), share=np.array([0.5]))
    one = np.array([1000.0])
    assert curve_row(1, forecast, one, one, np.array([[0]]), 0)["inside_90"] == inside
