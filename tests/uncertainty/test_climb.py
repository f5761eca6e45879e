"""The unknown climb of a road beside the other errors."""

import numpy as np
import pytest

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
