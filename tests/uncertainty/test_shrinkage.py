"""The share of an update that held-out trips support, worked out by hand."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t as student
from tests.forecasting import test_forecast as by_hand

from tripwatt.uncertainty import shrinkage
from tripwatt.uncertainty.process import HeldOutResidual, Segments
from tripwatt.uncertainty.shrinkage import (
    FRACTIONS,
    SURE,
    UpdateShrinkage,
    _best_share,
    _off_share,
    _point,
    _rest,
    _rests,
    is_off,
)

EXACT = {"rel": 1e-9, "abs": 1e-9}


class TestOffShare:
    def test_the_weighted_middle(self) -> None:
        """Shares of 0.9, 0.5 and 1 with weights of 100, 200 and 50 Wh; the fourth trip was on."""
        off, not_drawn = np.array([[-100.0, -200.0, -50.0, 0.0]]), np.array([[-90.0, -100.0, -50.0, 5.0]])
        assert _off_share(off, not_drawn, np.ones(4)) == pytest.approx(0.5)
        assert _off_share(off, not_drawn, np.array([1.0, 10.0, 1.0, 1.0])) == pytest.approx(0.9)
        assert _off_share(off[:, 1:], not_drawn[:, 1:], np.ones(3)) == 0.0
        assert _off_share(off, 3.0 * not_drawn, np.ones(4)) == 1.0
        assert _off_share(off, -not_drawn, np.ones(4)) == 0.0
        # half of the weight exactly belongs to the lower share
        even = _off_share(
            np.array([[-1.0, -1.0, -1.0, -1.0]]), np.array([[-0.2, -0.4, -0.6, -0.8]]), np.ones(4)
        )
        assert even == pytest.approx(0.4)

    def test_trips_count_once_over_the_fractions(self) -> None:
        off = np.array([[-1.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])
        assert _off_share(off, 0.5 * off, np.ones(3)) == 0.0
        off[1, 2] = -1.0
        assert _off_share(off, 0.5 * off, np.ones(3)) == pytest.approx(0.5)


class Prior:
    """Energy 7 Wh for each hour to come and for each watt that was measured, a variance by the component."""

    def __init__(self, variance, log, measured=0.0) -> None:
        self.variance, self.log, self.sum = variance, log, measured

    def measured(self, seen, power_w, variance_w2):
        self.log.append((seen.tolist(), power_w.tolist(), variance_w2.tolist()))
        return Prior(self.variance, self.log, power_w.sum())

    @property
    def mean_w(self):
        return np.array([1.0, 1.0, 1.0, 1.0 + self.sum])

    def sd_wh(self, hours):
        return np.array([0.0, np.sqrt(self.variance)])


class TestRest:
    def rest(
        self, fraction, climate=(10.0, -20.0, 30.0, -40.0), expected=(50.0, 100.0, 200.0, 400.0), split=True
    ):
        four = Segments(np.arange(4.0), np.full(4, 3600.0), np.zeros(4), np.zeros(4))
        left = np.array([1.0, 2.0, 3.0, 4.0])
        trip = HeldOutResidual(four, left, np.array(climate), np.array(expected))
        log = []
        names = ("joint", "climate", "drive") if split else ("joint",)
        priors = {name: Prior(v, log) for name, v in zip(names, (9.0, 16.0, 20.0), strict=False)}
        own = SimpleNamespace(limited=lambda watts: np.clip(watts, -15.0, 15.0))
        return _rest(own, trip, priors, fraction), log

    def test_after_a_half(self) -> None:
        """Two of four hours: 3 and 4 Wh are left; the climate residual counts up to 15 W."""
        found, log = self.rest(0.5)
        assert log == [
            ([0, 1], [1.0, 2.0], [1.0, 1.0]),
            ([0, 1], [10.0, -15.0], [1.0, 1.0]),
            ([0, 1], [-9.0, 22.0], [1.0, 1.0]),
        ]
        assert found == pytest.approx((7.0, -5.0 + 2.0, 13.0 + 2.0, 3.0 + 2.0, 6.0, 3.0, 0.0, 0.0), **EXACT)

    def test_before_the_first_segment_ends(self) -> None:
        found, log = self.rest(0.2)
        assert log == []
        assert found == pytest.approx((10.0, 4.0, 4.0, 4.0, 6.0, 3.0, 0.0, 0.0), **EXACT)

    def test_climate_control_that_was_off(self) -> None:
        """It drew 0 and 50 W: off. 600 Wh were expected of the rest, of which 10 were not drawn."""
        found, _ = self.rest(0.5, climate=(-50.0, -50.0, 30.0, -40.0))
        assert found[6:] == (-600.0, -10.0)
        assert self.rest(0.5, climate=(-50.0, -49.9, 30.0, -40.0))[0][6:] == (0.0, 0.0)

    def test_jointly(self) -> None:
        found, log = self.rest(0.5, split=False)
        assert len(log) == 1
        assert found == pytest.approx((7.0, 0.0, 0.0, 5.0, 0.0, 3.0, 0.0, 0.0), **EXACT)


def test_the_point_of_errors_is_that_of_their_90_percent() -> None:
    """The 18th of 19 covers 18 / 20."""
    assert _point(np.array([(-1.0) ** k * k for k in range(1, 20)])) == 18.0


def test_shrinkage_from_rests(monkeypatch) -> None:
    """Six trips, two of them with climate control off or unknown; the same rests at every fraction."""
    truth = np.array([60.0, -40.0, 55.0, -70.0, 20.0, 35.0])
    climate = np.array([100.0, -60.0, 90.0, -150.0, 30.0, 0.0])
    drive = np.array([40.0, -30.0, 20.0, 10.0, 9.0, 0.0])
    joint = np.array([80.0, -70.0, 60.0, -90.0, 30.0, 50.0])
    split_sd, joint_sd = (
        np.array([20.0, 25.0, 30.0, 15.0, 18.0, 0.0]),
        np.array([22.0, 20.0, 35.0, 25.0, 15.0, 30.0]),
    )
    off, not_drawn = np.array([0.0, 0.0, 0.0, 0.0, -50.0, 0.0]), np.zeros(6)
    rests = np.column_stack([truth, climate, drive, joint, split_sd, joint_sd, off, not_drawn])
    own, scale = 50.0, np.array([40.0, 60.0, 50.0, 45.0, 55.0, 70.0])
    errors = np.array([90.0, -50.0, 30.0, -100.0, 60.0, 45.0])
    trips = [
        SimpleNamespace(
            segments=SimpleNamespace(hours=k), climate_w=None if k == 5 else 1.0, error_wh=float(e)
        )
        for k, e in enumerate(errors)
    ]
    monkeypatch.setattr(
        shrinkage, "_rests", lambda process, trip: [tuple(rests[trips.index(trip)])] * len(FRACTIONS)
    )
    prior = SimpleNamespace(sd_wh=lambda hours: np.array([0.0, own]))
    model = SimpleNamespace(split=True, prior=lambda segments: prior)
    found = UpdateShrinkage.from_trips(model, trips, scale)
    on = np.arange(4)
    share_climate = _best_share(truth[on], climate[on], scale[on])
    share_drive = _best_share((truth - share_climate * climate)[on], drive[on], scale[on])
    share_joint = _best_share(truth, joint, scale)
    assert found.climate == pytest.approx([share_climate] * 6, **EXACT)
    assert found.drive == pytest.approx([share_drive] * 6, **EXACT)
    assert found.joint == pytest.approx([share_joint] * 6, **EXACT)
    assert found.off.tolist() == [0.0] * 6
    before = _point(errors / scale)
    taken = np.where(off != 0.0, 0.0, climate * share_climate) + drive * share_drive
    for column, left, sd, known in (
        (found.split_sd_factor, truth - taken, split_sd, np.arange(5)),
        (found.joint_sd_factor, truth - joint * share_joint, joint_sd, np.arange(6)),
    ):
        factor = _point((left * own)[known] / (sd * scale)[known]) / before
        unscaled = np.sum((sd * scale / own)[known]) / np.sum(scale[known])
        assert column == pytest.approx([min(factor, 1.0 / unscaled)] * 6, **EXACT)
    four = UpdateShrinkage.from_trips(model, trips[:4], scale[:4])
    assert four.joint_sd_factor.tolist() == [1.0] * 6


def test_the_share_of_an_update_is_the_lower_end_of_a_slope():
    x = np.array([100.0, -50.0, 25.0, 80.0])
    assert _best_share(0.11 * x, x, np.ones(4)) == pytest.approx(0.11)
    assert _best_share(0.09 * x, x, np.ones(4)) == 0.0  # too small to change a forecast
    assert _best_share(1.7 * x, x, np.ones(4)) == 1.0
    assert _best_share(-0.5 * x, x, np.ones(4)) == 0.0
    assert _best_share(x, np.zeros(4), np.ones(4)) == 0.0
    truth, scale = np.array([90.0, -20.0, 40.0, 75.0]), np.array([10.0, 20.0, 10.0, 40.0])
    t, z = truth / scale, x / scale
    slope = (z @ t) / (z @ z)
    error = np.sqrt(np.mean((t - slope * z) ** 2) / (z @ z))
    assert student.ppf(0.95, 1e6) == pytest.approx(SURE, abs=2e-4)
    assert _best_share(truth, x, scale) == pytest.approx(slope - SURE * error, rel=1e-9)


def test_shares_are_interpolated_from_none_at_departure():
    rising = np.array([0.2, 0.4, 0.6, 0.8, 0.9, 1.0])
    ones = np.ones(6)
    shrinkage = UpdateShrinkage(rising, rising / 2, rising / 4, 2 * ones, 3 * ones)
    for fraction, share in ((0.0, 0.0), (0.05, 0.1), (0.1, 0.2), (0.175, 0.3), (0.9, 1.0), (1.0, 1.0)):
        assert shrinkage.at("climate", fraction) == pytest.approx(share)
        assert shrinkage.at("drive", fraction) == pytest.approx(share / 2)
        assert shrinkage.at("joint", fraction) == pytest.approx(share / 4)
    assert shrinkage.sd_factor(True, 0.05) == pytest.approx(1.5)
    assert shrinkage.sd_factor(False, 0.05) == pytest.approx(2.0)


def test_climate_control_that_was_off_stays_off():
    rng = np.random.default_rng(8)
    held_out = []
    for i in range(40):
        segments = by_hand_segments(rng, 40)
        expected = rng.uniform(500.0, 1500.0) * np.ones(40)
        drawn = 0.1 * expected * (np.arange(40) >= 30) if i < 12 else expected + rng.normal(0.0, 100.0, 40)
        climate = drawn - expected
        held_out.append(HeldOutResidual(segments, climate + rng.normal(0, 100, 40), climate, expected))
    split = dataclasses.replace(by_hand.ONE_PROCESS, split=True)
    own = np.array([split.prior(t.segments).sd_wh(t.segments.hours)[-1] for t in held_out])
    found = UpdateShrinkage.from_trips(split, held_out, own)
    # after half of the trip, ten segments of nothing and ten of a tenth are to come: 95 % is not drawn
    assert found.off[FRACTIONS.index(0.5)] == pytest.approx(0.95, abs=0.03)
    none_off = UpdateShrinkage.from_trips(split, held_out[10:], own[10:])
    assert (none_off.off == 0.0).all()  # two trips are too few


@pytest.mark.parametrize(
    ("climate_w", "seconds", "off"),
    [([50.0, 0.0], 60.0, True), ([50.1, 0.0], 60.0, False), ([0.0, 0.0], 59.0, False)],
)
def test_when_climate_control_counts_as_off(climate_w, seconds, off):
    assert is_off(np.array(climate_w), np.full(2, seconds)) is off


def test_the_mean_width_never_grows_on_the_way():
    rng = np.random.default_rng(6)
    held_out = []
    for _ in range(40):
        segments = by_hand_segments(rng, 30)
        size = np.where(np.arange(30) < 15, 1.0, 4.0)  # the second half errs more than the process believes
        held_out.append(HeldOutResidual(segments, rng.normal(0.0, 800.0, 30) * size))
    own = np.array([by_hand.ONE_PROCESS.prior(t.segments).sd_wh(t.segments.hours)[-1] for t in held_out])
    found = UpdateShrinkage.from_trips(by_hand.ONE_PROCESS, held_out, own)
    before = own.mean()
    rests = np.array([_rests(by_hand.ONE_PROCESS, trip) for trip in held_out])
    for k, factor in enumerate(found.joint_sd_factor):
        rest = factor * rests[:, k, 5].mean()
        assert rest <= before * (1.0 + 1e-9)
        before = rest


def by_hand_segments(rng: np.random.Generator, n: int) -> Segments:
    return Segments(
        15.0 + 30.0 * np.arange(n), np.full(n, 30.0), rng.uniform(0, 9000, n), rng.uniform(0, 3000, n)
    )


def test_without_held_out_trips_nothing_is_learned_on_the_way() -> None:
    nothing = UpdateShrinkage.from_trips(SimpleNamespace(), [], np.zeros(0))  # type: ignore[arg-type]
    for name in ("climate", "drive", "joint", "off"):
        assert getattr(nothing, name).tolist() == [0.0] * len(FRACTIONS), name
    for name in ("split_sd_factor", "joint_sd_factor"):
        assert getattr(nothing, name).tolist() == [1.0] * len(FRACTIONS), name
