"""The unknown climb of a road beside the other errors."""

import numpy as np
import pytest
from scipy import stats
from scipy.interpolate import interp1d

from tripwatt.routes.terrain import KnownClimb, net_climbs
from tripwatt.uncertainty.climb import ClimbingEnergy, Excess, UnknownClimb
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
        found = float(mixture.quantile(scores, np.array([p]), np.array([0.0, 150.0]))[0, -1])
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


KNOWN = KnownClimb(
    np.array([0.0, 6e3, 2e4]), np.array([0.0, 500.0, 100.0]), np.array([0.0, 80.0, 20.0]), 500.0
)


@pytest.mark.parametrize("from_m", [0.0, 3000.0])
@pytest.mark.parametrize("known", [None, KNOWN])
def test_the_climb_ahead_costs_what_each_piece_of_road_costs_beyond_its_expected_grade(known, from_m):
    """Every energy grows with the distance: a rate that is linear between grades and beyond them."""
    net, way = net_climbs("mountains").given(known), np.linspace(0.0, 2e4, 9)
    grade, hill = np.array([-0.06, -0.02, 0.0, 0.03, 0.07]), np.array([0.0, 0.03, 0.06])
    even, hills = np.array([-0.4, -0.15, 0.0, 0.3, 0.9]), np.array([0.0, 0.02, 0.09])
    drive = ClimbingEnergy(grade, np.outer(even, way), hill, np.outer(hills, way), way, net)
    rate, rate_of_hills = (
        interp1d(x, y, fill_value="extrapolate") for x, y in ((grade, even), (hill, hills))
    )
    ahead = np.maximum(way - from_m, 0.0)
    usual = np.zeros(9) if known is None else np.interp(from_m + ahead, KNOWN.distance_m, KNOWN.climb_m)
    usual -= usual[ahead == 0.0][-1]
    climb, length = net.net_m(ahead, from_m) - usual, np.maximum(ahead, 1e-9)
    if known is None:
        expected = rate(climb / length) * ahead
    else:
        pieces = np.diff(ahead, prepend=0.0)
        steps = np.diff(climb, axis=1, prepend=0.0) / np.maximum(pieces, 1e-9)
        expected = np.cumsum(rate(steps) * pieces, axis=1)
    expected = np.where(ahead > 0.0, expected + rate_of_hills(net.local_grade())[:, None] * ahead, 0.0)
    found = drive.ahead(from_m)
    assert found.offsets_wh == pytest.approx(expected, rel=1e-9, abs=1e-6)
    assert found.weights is net.weights
    most = float(net.limit(ahead[-1]))
    for climb_m in (0.1 * most, 0.6 * most):
        energy_wh = float(drive.more_wh(climb_m, from_m))
        assert energy_wh == pytest.approx(float(rate((climb_m - usual[-1]) / ahead[-1])) * ahead[-1])
        assert drive.climb_for(energy_wh, from_m) == pytest.approx(climb_m, rel=0.01)
    assert drive.climb_for(1.01 * float(drive.more_wh(most, from_m)), from_m) is None
    assert drive.climb_for(1.0, way[-1]) is None
    excess = Excess(ConformalScores.from_errors([0.5, 1.0, 2.0]), found, way)
    assert excess.at(-1).climb.offsets_wh.tolist() == found.offsets_wh[:, -1:].tolist()
    assert excess.at(-1).expected_wh.tolist() == excess.expected_wh[-1:].tolist()
