"""The unknown climb of a road beside the other errors."""

import numpy as np
import pytest
from scipy import stats

from tripwatt.routes.terrain import net_climbs
from tripwatt.uncertainty.climb import UnknownClimb
from tripwatt.uncertainty.conformal import ConformalScores


def test_the_sum_of_climb_and_error_is_that_of_many_draws():
    rng = np.random.default_rng(3)
    scores = ConformalScores.from_errors(np.abs(rng.standard_t(5, 60)).tolist())
    net = net_climbs()
    offsets = 4.0 * net.net_m(np.array([0.0, 15_000.0]))
    mixture = UnknownClimb(offsets, net.weights)
    n = 400_000
    climb = offsets[rng.choice(len(net.weights), n, p=net.weights), -1]
    levels = rng.uniform(0.0, 1.0, n)
    grid = np.linspace(0.0, 0.9999, 4000)
    error = np.interp(levels, grid, [scores.factor(p) for p in grid]) * rng.choice([-1.0, 1.0], n) * 150.0
    for p in (0.05, 0.25, 0.5, 0.75, 0.9, 0.975, 0.995):
        found = float(mixture.quantile(scores, p, np.array([0.0, 150.0]))[-1])
        assert np.mean(climb + error <= found) == pytest.approx(p, abs=0.003)


def test_quantiles_of_many_probabilities_in_one_pass_are_those_of_each_alone():
    rng = np.random.default_rng(5)
    net = net_climbs()
    probabilities = np.array([0.0, 0.001, 0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975, 0.999, 1.0])
    for heavy, sd_wh in ((60, 150.0), (3, 20.0), (200, 2000.0), (60, 1e-6)):
        scores = ConformalScores.from_errors(rng.standard_t(5, heavy).round(2).tolist())  # some repeat
        one = UnknownClimb(4.0 * net.net_m(np.array([15_000.0])), net.weights)
        sd = np.geomspace(sd_wh, 2.0 * sd_wh, len(probabilities))
        together = one.quantiles(scores, probabilities, sd)
        alone = [one.quantiles(scores, probabilities[[k]], sd[[k]]).item() for k in range(len(probabilities))]
        assert together[1:-1] == pytest.approx(alone[1:-1], rel=1e-12)
        assert together == pytest.approx(alone, rel=1e-4)  # so near to 1 a probability has seven digits
        assert (np.diff(together) > 0.0).all() or sd_wh < 1.0
        just_under, just_over = (
            one.probability_below(scores, together + by_wh, sd) for by_wh in (-1e-6, 1e-6)
        )
        assert (just_under[1:-1] <= probabilities[1:-1]).all()
        assert (just_over[1:-1] >= probabilities[1:-1]).all()


def test_the_core_of_normal_climbs_is_their_standard_deviation():
    n = 2000
    normal = stats.norm.ppf((np.arange(n) + 0.5) / n)
    mixture = UnknownClimb(np.column_stack([40.0 * normal, 100.0 * normal[::-1]]), np.full(n, 1.0 / n))
    assert mixture.core_sd_wh == pytest.approx([40.0, 100.0], rel=0.01)
