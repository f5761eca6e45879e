"""The residual process, its shrinkage on the way and the errors of links, against plain matrices and by hand."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import SegmentTable
from tripwatt.uncertainty import process, route, shrinkage
from tripwatt.uncertainty.charge import ChargeScale
from tripwatt.uncertainty.held_out import held_out_residual, process_segments
from tripwatt.uncertainty.process import HeldOutResidual, ResidualBatch, Segments, _merged, fit_process
from tripwatt.uncertainty.route import LENGTHS_M, LinkedTrips, linked_trips
from tripwatt.uncertainty.scale import TimeCourse, TotalScale
from tripwatt.uncertainty.shrinkage import FRACTIONS, UpdateShrinkage, _best_share, _off_share, _point, _rest

EXACT = {"rel": 1e-9, "abs": 1e-9}


def segments(n: int, seed: int = 0) -> Segments:
    rng = np.random.default_rng(seed)
    step = rng.choice([20.0, 30.0, 40.0], n)
    return Segments(
        np.cumsum(step) - step / 2, step, rng.uniform(0.0, 9000.0, n), rng.uniform(0.0, 3000.0, n)
    )


def held_out(n: int, seed: int, climate: bool = True) -> HeldOutResidual:
    rng = np.random.default_rng(seed + 50)
    own = rng.normal(0.0, 400.0, n)
    return HeldOutResidual(segments(n, seed), rng.normal(0.0, 700.0, n), own if climate else None)


class TestMerging:
    def test_two_in_one(self) -> None:
        """20 and 40 s in one of 60 s: weights 1/3 and 2/3, the noise of a mean is sqrt(5) / 3."""
        three = Segments(
            np.array([10.0, 40.0, 75.0]),
            np.array([20.0, 40.0, 30.0]),
            np.array([3.0, 6.0, 9.0]),
            np.array([6.0, 0.0, 1.0]),
        )
        merged, left, rest = _merged(three, np.array([30.0, 60.0, 7.0]))
        assert merged.step_s.tolist() == [60.0, 30.0]
        assert merged.time_s == pytest.approx([30.0, 75.0], **EXACT)
        assert merged.moved_w == pytest.approx([5.0, 9.0], **EXACT)
        assert merged.hvac_w == pytest.approx([2.0, 1.0], **EXACT)
        assert left == pytest.approx([50.0, 7.0], **EXACT)
        assert rest == pytest.approx([np.sqrt(5.0) / 3.0, 1.0], **EXACT)

    @pytest.mark.parametrize(("what", "limit"), [("joint", np.inf), ("climate", 300.0), ("drive", 300.0)])
    def test_what_is_explained(self, what, limit) -> None:
        trips = [held_out(5, 0), held_out(2, 1)]
        batch = ResidualBatch.from_trips(trips, what, limit)
        assert batch.real.tolist() == [[True, True, True], [True, False, False]]
        for i, trip in enumerate(trips):
            own = {
                "joint": trip.residual_w,
                "climate": np.clip(trip.climate_w, -300.0, 300.0),
                "drive": trip.residual_w - trip.climate_w,
            }[what]
            merged, left, rest = _merged(trip.segments, own)
            k = len(merged)
            assert batch.residual[i, :k] == pytest.approx(left, **EXACT)
            assert batch.time[i, :k] == pytest.approx(merged.time_s, **EXACT)
            assert batch.size["drive"][i, :k] == pytest.approx(merged.moved_w, **EXACT)
            assert batch.size["climate"][i, :k] == pytest.approx(merged.hvac_w, **EXACT)
            # 100 W and 30 % of what is moved
            assert batch.noise["drive"][i, :k] == pytest.approx(
                rest * (100.0 + 0.3 * merged.moved_w), **EXACT
            )
            assert batch.noise["climate"][i, :k] == pytest.approx(rest, **EXACT)
        alone = ResidualBatch.from_trips([held_out(4, 2, climate=False)], "drive")
        merged, left, _ = _merged(segments(4, 2), held_out(4, 2).residual_w)
        assert alone.residual[0] == pytest.approx(left, **EXACT)


VALUES = np.array([[90.0, 0.06, 250.0, 150.0, 0.6, 1.5, 80.0], [180.0, 0.2, 320.0, 260.0, 45.0, 2.5, 170.0]])


class TestLikelihood:
    batch = ResidualBatch.from_trips([held_out(5, 0), held_out(2, 1), held_out(8, 2)], "joint")

    def plain(self, values: np.ndarray) -> float:
        """Of one trip after the other, from the process as the documentation has it."""
        total = 0.0
        for i in range(3):
            k = self.batch.real[i]
            time, left = self.batch.time[i, k], self.batch.residual[i, k]
            covariance = np.zeros((k.sum(), k.sum()))
            for name, (constant, share, sd, fading, noise, onset, onset_time) in zip(
                ("drive", "climate"), values, strict=True
            ):
                start = np.sqrt(1.0 + onset**2 * np.exp(-time / onset_time))
                size = share * self.batch.size[name][i, k]
                drift = sd**2 * np.exp(-np.abs(np.subtract.outer(time, time)) / fading)
                covariance += constant**2 + np.outer(size, size) + drift * np.outer(start, start)
                covariance += np.diag((noise * self.batch.noise[name][i, k]) ** 2)
            total += 0.5 * left @ np.linalg.solve(covariance, left) + 0.5 * np.linalg.slogdet(covariance)[1]
        return total

    def test_value_and_gradient(self) -> None:
        value, gradient = self.batch.cost(("drive", "climate"), VALUES)
        assert value == pytest.approx(self.plain(VALUES), rel=1e-10)
        for row in range(2):
            for column in range(7):
                step = np.ones_like(VALUES)
                step[row, column] = np.exp(1e-5)
                slope = (self.plain(VALUES * step) - self.plain(VALUES / step)) / 2e-5
                assert gradient[row, column] == pytest.approx(slope, rel=1e-4, abs=1e-6)

    def test_the_mode(self) -> None:
        """The gradient of the likelihood and of a pull to the start, sd 2 on the logarithms, vanishes."""
        start = np.array(
            [[100.0, 0.05, 300.0, 200.0, 0.5, 0.0, 1.0], [200.0, 0.15, 300.0, 200.0, 50.0, 2.0, 200.0]]
        )
        found = process._fitted(self.batch, ("drive", "climate"))
        values = np.array([[getattr(one, name) for name in one.__dataclass_fields__] for one in found])
        assert values[0, 5:].tolist() == [0.0, 1.0]  # driving has no onset
        _, gradient = self.batch.cost(("drive", "climate"), values)
        free = start > 0.0
        free[0, 6] = False
        pull = np.log(values[free] / start[free]) / 4.0
        assert gradient[free] + pull == pytest.approx(np.zeros(free.sum()), abs=2e-2)
        assert np.abs(np.log(values[free] / start[free])).max() < 5.0


def test_components_are_fitted_separately_where_climate_control_is_logged(monkeypatch) -> None:
    """The limit is the 95 % point of the climate residuals; a trip without them takes no part."""
    seen = []

    def fitted(batch, components):
        seen.append((len(batch.real), components, float(np.abs(batch.residual).max())))
        return list(components)

    monkeypatch.setattr(process, "_fitted", fitted)
    trips = [held_out(6, 0), held_out(4, 1, climate=False), held_out(5, 2)]
    found = fit_process(trips)
    assert [(n, names) for n, names, _ in seen] == [(2, ("climate",)), (2, ("drive",))]
    climate = np.abs(np.concatenate([trips[0].climate_w, trips[2].climate_w]))
    assert found.climate_limit_w == pytest.approx(np.quantile(climate, 0.95), **EXACT)
    assert (found.drive, found.climate, found.split) == ("drive", "climate", True)
    joint = fit_process([trips[1]])
    assert seen[-1][:2] == (1, ("drive", "climate"))
    assert (joint.drive, joint.climate, joint.climate_limit_w, joint.split) == (
        "drive",
        "climate",
        np.inf,
        False,
    )


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

    def energy_wh(self, hours):
        return np.array([0.0, self.sum + hours.sum()]), np.array([0.0, np.sqrt(self.variance)])


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
        SimpleNamespace(segments=None, climate_w=None if k == 5 else 1.0, error_wh=float(e))
        for k, e in enumerate(errors)
    ]
    monkeypatch.setattr(
        shrinkage, "_rests", lambda process, trip: [tuple(rests[trips.index(trip)])] * len(FRACTIONS)
    )
    model = SimpleNamespace(split=True, sd_wh=lambda segments: own)
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


def table(rows: int, **features) -> SegmentTable:
    columns = {"time_s": np.arange(float(rows)), "moved_w": 10.0, "hvac_w": 300.0} | features
    watts = np.full(rows, 100.0)
    hours = np.arange(1.0, rows + 1.0)
    frame = pd.DataFrame(columns, index=range(rows))
    return SegmentTable(("t",), np.array([0, rows]), frame, hours, watts, watts + 30.0, np.full(rows, 320.0))


class Corrector:
    def __init__(self, watts=5.0, climate=8.0) -> None:
        self.watts, self.climate = watts, climate

    def predict(self, own):
        return np.full(len(own.hours), self.watts)

    def predict_with_uncertainty(self, own):
        return self.predict(own), np.column_stack(
            [np.full(len(own.hours), 3.0), np.full(len(own.hours), 4.0)]
        )

    def outside_factor(self, own):
        return np.full((len(own.hours), 1), 2.0)

    def predict_climate(self, own):
        return None if self.climate is None else np.full(len(own.hours), self.climate)


class TestHeldOut:
    def test_segments(self) -> None:
        """Two segments of 1 and 2 h: 3 h of (3, 4) W are 15 Wh, of 2 W outside 6 Wh."""
        found = held_out_residual(Corrector(), table(2))
        assert found.segments.step_s.tolist() == [3600.0, 7200.0]
        assert found.segments.corrector_sd_wh == pytest.approx(15.0)
        assert found.segments.outside_sd_wh == pytest.approx(6.0)
        assert found.residual_w.tolist() == [25.0, 25.0]
        assert found.climate_w.tolist() == [12.0, 12.0]
        assert found.climate_expected_w.tolist() == [308.0, 308.0]
        assert found.error_wh == pytest.approx(75.0)
        assert process_segments(table(2), np.zeros((2, 1))).outside_sd_wh == 0.0

    def test_joint_or_not_logged_throughout(self) -> None:
        assert held_out_residual(Corrector(climate=None), table(2)).climate_w is None
        assert held_out_residual(Corrector(), table(2, hvac_w=[300.0, np.nan])).climate_w is None


class TestLinks:
    def test_relative_differences(self) -> None:
        """105 W on the driven trace of 1 h; 100, 110 and 130 W and the correction on links; one trip was not cut."""

        def one(watts):
            own = table(1)
            return SegmentTable(("t",), own.offsets, own.features, own.hours, np.array([watts]))

        driven = SegmentTable.join([one(100.0), one(50.0), one(200.0)])
        tables = tuple(one(w) for w in (100.0, 110.0, 130.0))
        linked = LinkedTrips((tables, (), tuple(one(w) for w in (190.0, 200.0, 210.0))))
        found = linked.differences(Corrector(), driven, np.array([2, 1, 0]))
        assert found[0] == pytest.approx([195 / 205 - 1, 0.0, 215 / 205 - 1], **EXACT)
        assert np.isnan(found[1]).all()
        assert found[2] == pytest.approx([0.0, 115 / 105 - 1, 135 / 105 - 1], **EXACT)
        assert np.isnan(linked.differences(Corrector(), driven, np.array([1]))).all()
        assert linked.take([1, 0]).tables == ((), tables)

    def test_at_most_two_hundred_trips_evenly(self, monkeypatch) -> None:
        monkeypatch.setattr(route, "_on_links", lambda trip, vehicle: (trip,))
        assert all(linked_trips(range(200), None).tables)
        cut = [i for i, t in enumerate(linked_trips(range(399), None).tables) if t]
        assert len(cut) == 200
        assert (cut[0], cut[1], cut[-1]) == (0, 2, 398)
        assert LENGTHS_M == (250.0, 1000.0, 4000.0)


def test_published_charge() -> None:
    """A window of 80 % of 20 kWh; 1 % of the display, 2 % by way of the battery management; 3 % of the capacity."""
    battery = SimpleNamespace(displayed_zero_soc=0.1, displayed_full_soc=0.9)
    book = ChargeScale.from_book(battery, 20_000.0)
    assert book.wh_per_display == pytest.approx(16_000.0)
    assert (book.zero_soc, book.full_soc, book.trips, book.hidden) == (0.1, 0.9, 0, 0.0)
    assert book.displayed(0.3) == pytest.approx(0.25)
    assert book.left(0.8, 4000.0) == pytest.approx(0.55)
    assert book.sd(-8000.0, True) == pytest.approx(np.hypot(0.01, 0.015))
    assert book.sd(8000.0, False) == pytest.approx(np.hypot(0.02, 0.015))


def test_the_scale_of_a_total() -> None:
    """100 Wh a trip, 60 W over 2 h, 5 % of 3 kWh moved, the corrector's 80 Wh twice, and 70 Wh outside.

    These are a standard deviation; the scale of a t distribution with four degrees of freedom is smaller by the root of 2.
    """
    two = Segments(
        np.array([0.0, 1.0]), np.full(2, 3600.0), np.array([1000.0, 2000.0]), np.zeros(2), 80.0, 70.0
    )
    expected = np.sqrt(100.0**2 + 120.0**2 + 150.0**2 + 160.0**2 + 70.0**2 / 2.0)
    values = np.array([100.0, 60.0, 0.05, 2.0])
    assert TotalScale(values).sd_wh(two) == pytest.approx(expected, **EXACT)
    # hours and energy together are 192 Wh; 6 % of 3 kWh are less, 10 % are more
    assert TotalScale(values, least_share=0.06).sd_wh(two) == pytest.approx(expected, **EXACT)
    more = np.sqrt(100.0**2 + 300.0**2 + 160.0**2 + 70.0**2 / 2.0)
    assert TotalScale(values, least_share=0.1).sd_wh(two) == pytest.approx(more, **EXACT)
    # 7200 s are 20 correlation times: 2 sd² T² (20 - 1 + exp(-20)) over sd²
    course = TimeCourse(0.0, ((300.0, 360.0),))
    assert course.hours(2.0) == pytest.approx(
        np.sqrt(2.0 * 360.0**2 * (19.0 + np.exp(-20.0))) / 3600.0, **EXACT
    )
    assert TimeCourse(0.0, ()).hours(3.0) == 3.0
