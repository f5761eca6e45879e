"""A car learned trip by trip: a Kalman filter with many beliefs, held against its closed form and against worlds with a known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tripwatt.hybrid import learning
from tripwatt.hybrid.factors import NAMES, SDS, TripEvidence, drift_kept
from tripwatt.hybrid.learning import KINDS, Experts
from tripwatt.vehicles import load_vehicle

P = len(NAMES)


def trips(
    n: int, truth: np.ndarray, rng: np.random.Generator, noise: float = 0.0, day: float = 0.0
) -> TripEvidence:
    """Trips of 3 kWh on which a car differs by its factors, in usual standard deviations."""
    X = rng.normal(0.0, 60.0, (n, P)) + 100.0
    X[:, 0] = 300.0
    usual = np.full(n, 100.0**2)
    y = X @ truth + np.sqrt(noise * usual) * rng.normal(size=n)
    nothing = np.full((n, 4), np.nan)
    names = tuple(f"t{i}" for i in range(n))
    return TripEvidence(names, X, y, usual, np.zeros(n), np.full(n, day), nothing)


def new() -> Experts:
    return Experts.from_prior(np.zeros(P), np.eye(P))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_beliefs_before_any_trip_are_a_distribution() -> None:
    before = new()
    assert before.weights.sum() == pytest.approx(1.0)
    assert before.kind_weights == pytest.approx(np.array(learning.KIND_WEIGHTS))
    assert set(before.noise.tolist()) == set(learning.NOISES)
    mean, covariance = before.collapsed()
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    climate = [NAMES.index(name) for name in ("heating", "mild_heating", "cooling")]
    expected = [-0.1, -0.1, -0.2]  # in mild air heating is a fifth lower, too: the sum of both
    assert mean[climate] * SDS[climate] == pytest.approx(expected)
    assert np.delete(mean, climate) == pytest.approx(0.0)


def test_one_expert_alone_is_bayesian_linear_regression(rng, monkeypatch) -> None:
    """With one belief, Gaussian errors and no drift the filter is the closed form."""
    monkeypatch.setattr(learning, "TAIL_DF", 1e12)
    n = 12
    given = trips(n, rng.normal(size=P), rng, noise=1.0)
    at = Experts(
        np.zeros((1, P + 1)),
        np.diag(np.append(np.ones(P), 1e-12))[None],
        np.ones(1),
        np.full(1, 1e-12),
        np.zeros(1, dtype=np.int64),
        np.zeros(1),
        np.zeros(1),
    )
    known, _ = at.learn(given)
    X = given.factors_wh
    precision = X.T @ X / 100.0**2 + np.eye(P)
    assert known.mean[0, :P] == pytest.approx(
        np.linalg.solve(precision, X.T @ given.residual_wh / 100.0**2), abs=1e-6
    )
    assert known.covariance[0, :P, :P] == pytest.approx(np.linalg.inv(precision), abs=1e-6)


def test_trips_one_by_one_and_at_once_are_the_same(rng) -> None:
    given = trips(8, rng.normal(0.0, 0.5, P), rng, 1.0)
    once, seen = new().learn(given)
    step = new()
    means = []
    for i in range(8):
        step, one = step.learn(given.take([i]))
        means.append(one.mean_wh[0])
    assert step.mean == pytest.approx(once.mean)
    assert step.log_weight == pytest.approx(once.log_weight)
    assert means == pytest.approx(seen.mean_wh.tolist())


def test_a_forecast_before_learning_does_not_see_its_trip(rng) -> None:
    given = trips(6, rng.normal(size=P), rng, 1.0)
    changed = replace(given, residual_wh=given.residual_wh + np.array([0, 0, 0, 0, 0, 5000.0]))
    assert new().learn(changed)[1].mean_wh == pytest.approx(new().learn(given)[1].mean_wh)


def test_the_prediction_is_the_next_forecast(rng) -> None:
    given = trips(9, rng.normal(0.0, 0.5, P), rng, 1.0)
    known, _ = new().learn(given.take(range(8)))
    mean, sd = known.predict(given.take([8]))
    following = known.learn(given.take([8]))[1]
    assert mean[0] == pytest.approx(following.mean_wh[0])
    assert sd[0] == pytest.approx(following.sd_wh[0])


@pytest.mark.parametrize("noise", [0.1, 1.0, 6.0])
def test_the_noise_of_a_car_is_found(noise) -> None:
    rng = np.random.default_rng(15)
    known, seen = new().learn(trips(120, rng.normal(0.0, 0.5, P), rng, noise))
    assert known.noise_scale == pytest.approx(noise, rel=0.5)
    late = seen.sd_wh[60:] / 100.0
    assert late.mean() == pytest.approx(noise**0.5, rel=0.35)


def test_an_exact_book_is_not_lost(rng) -> None:
    """Where the simulation is right, narrow beliefs come to count."""
    before = new()
    known, _ = before.learn(trips(60, np.zeros(P), rng, 0.1))
    assert known.kind_weights[KINDS.index("own trips")] < 0.02
    assert np.abs(known.collapsed()[0][0]) < 0.15


def test_an_outlier_moves_a_car_less_than_a_gaussian_would_let_it(rng, monkeypatch) -> None:
    given = trips(20, np.zeros(P), rng, 1.0)
    wrong = replace(given, residual_wh=given.residual_wh + 3000.0 * (np.arange(20) == 19))

    def moved() -> float:
        sound, mad = (new().learn(one)[0].collapsed()[0] for one in (given, wrong))
        return float(abs(mad[0] - sound[0]))

    robust = moved()
    monkeypatch.setattr(learning, "TAIL_DF", 1e9)
    assert robust < 0.5 * moved()


def test_old_trips_fade_from_the_drift() -> None:
    assert drift_kept(np.array([60.0, np.nan, 0.0]), 0.0) == pytest.approx(
        [np.exp(-1.0), np.exp(-1.0 / 60.0), 1.0]
    )
    rng = np.random.default_rng(0)
    truth = np.zeros(P)
    truth[0] = 0.5
    early = trips(15, truth, rng, 0.2)
    known, _ = new().learn(early)
    soon, late = known.at(1.0), known.at(400.0)
    assert np.abs(late.mean[:, -1]).max() < 0.01
    assert (late.covariance[:, -1, -1] >= soon.covariance[:, -1, -1] - 1e-12).all()
    assert late.covariance[:, -1, -1] == pytest.approx(late.drift, rel=0.01)


def test_a_change_of_the_car_is_followed(rng) -> None:
    """The same car takes 12 % more from one day on: after ten trips most of it is in the forecasts."""
    truth = np.zeros(P)
    before, after = trips(40, truth, rng, 0.3), trips(20, truth, rng, 0.3, day=30.0)
    more = replace(after, residual_wh=after.residual_wh + 0.12 * 3000.0)
    experts, seen = new().learn(before + more)
    car = load_vehicle("vw_id3")
    assert (experts.corrector(car).day, new().corrector(car).day) == (30.0, None)
    late = (more.residual_wh - seen.mean_wh[40:])[10:]
    assert np.abs(late.mean()) < 0.05 * 3000.0


def test_stated_coverage_holds_in_worlds_that_gave_no_prior_its_width(rng) -> None:
    """Cars from a t distribution, each with noise of its own: 90 % intervals from the fifth trip on."""
    inside = []
    for _ in range(40):
        truth = 0.7 * rng.standard_t(3, P)
        given = trips(30, truth, rng, float(np.exp(rng.normal(0.0, 1.0))))
        _, seen = new().learn(given)
        z = np.abs(given.residual_wh - seen.mean_wh) / seen.sd_wh
        inside += (z[5:] < 1.645).tolist()
    assert 0.84 < np.mean(inside) < 0.96


def test_runs_on_a_dynamometer_leave_the_noise_of_the_road_open(rng) -> None:
    lab, _ = new().learn(trips(40, np.zeros(P), rng, 0.07))
    road = lab.on_the_road()
    assert lab.noise_scale < 0.3
    assert road.noise_scale == pytest.approx(new().noise_scale, rel=0.05)
    assert np.abs(road.collapsed()[0][:P] - lab.collapsed()[0][:P]).max() < 0.3
    assert road.trips == 0


def test_the_drift_of_a_dynamometer_says_nothing_of_that_of_the_road(rng) -> None:
    """In every expert the drift is that of its prior, and correlated with nothing."""
    lab, _ = new().learn(trips(40, np.zeros(P), rng, 0.07))
    road = lab.on_the_road()
    assert np.abs(lab.covariance[:, -1, :-1]).max(axis=1).min() > 0.0
    assert not road.mean[:, -1].any()
    for beside in (road.covariance[:, -1, :-1], road.covariance[:, :-1, -1]):
        assert not beside.any()
    assert road.covariance[:, -1, -1].tolist() == lab.drift.tolist()
