"""Intervals by the rank of held-out errors."""

import pytest
from scipy.stats import t as student

from tripwatt.uncertainty.conformal import ConformalScores


def test_scores_by_rank():
    scores = ConformalScores.from_errors([3.0, -1.0, 2.0])
    # the k-th of three covers k / 4 of new trips
    assert [scores.factor(level) for level in (0.0, 0.125, 0.25, 0.5, 0.75)] == [0.0, 0.5, 1.0, 2.0, 3.0]
    top = student.ppf(0.875, 4)
    for level in (0.8, 0.9, 0.99):
        assert scores.factor(level) == pytest.approx(3.0 * student.ppf(0.5 + level / 2, 4) / top, rel=1e-9)
    for size, chance in ((0.0, 0.5), (1.5, 0.6875), (3.0, 0.875), (-2.0, 0.25)):
        assert scores.probability(size) == pytest.approx(chance, rel=1e-12)
    assert scores.probability(6.0) == pytest.approx(student.cdf(2.0 * top, 4), rel=1e-9)
    assert scores.probability(-6.0) == pytest.approx(1.0 - student.cdf(2.0 * top, 4), rel=1e-9)


def test_scores_of_zero_are_sure():
    sure = ConformalScores.from_errors([0.0, 0.0])
    assert (sure.probability(1e-9), sure.probability(-1e-9)) == (1.0, 0.0)
