"""The process of residual power is fitted by its exact likelihood."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import SegmentTable
from tripwatt.uncertainty import process
from tripwatt.uncertainty.process import (
    HeldOutResidual,
    ResidualBatch,
    Segments,
    _merged,
    fit_process,
    held_out_residual,
    process_segments,
)

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
        assert merged.climate_w == pytest.approx([2.0, 1.0], **EXACT)
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
            assert batch.size["climate"][i, :k] == pytest.approx(merged.climate_w, **EXACT)
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


def table(rows: int, **features) -> SegmentTable:
    columns = {
        "time_s": np.arange(float(rows)),
        "moved_w": 10.0,
        "climate_w": 300.0,
        "climb_w": 20.0,
        "speed_m_s": 5.0,
    } | features
    watts = np.full(rows, 100.0)
    hours = np.arange(1.0, rows + 1.0)
    frame = pd.DataFrame(columns, index=range(rows))
    return SegmentTable(("t",), np.array([0, rows]), frame, hours, watts, watts + 30.0, np.full(rows, 320.0))


class Corrector:
    def __init__(self, watts=5.0, climate=8.0) -> None:
        self.watts, self.climate = watts, climate

    def predict(self, own):
        return np.full(len(own.hours), self.watts)

    def predict_with_uncertainty(self, own, hours):
        return self.predict(own), hours.sum() * np.array([3.0, 4.0])

    def outside_factor(self, own):
        return np.full((len(own.hours), 1), 2.0)

    def predict_climate(self, own):
        return None if self.climate is None else np.full(len(own.hours), self.climate)


class TestHeldOut:
    def test_segments(self) -> None:
        """Two segments of 1 and 2 h: 3 h of (3, 4) W are 15 Wh, of 2 W outside 6 Wh, of 100 W without 20 W of climb 240 Wh."""
        found = held_out_residual(Corrector(), table(2))
        assert found.segments.step_s.tolist() == [3600.0, 7200.0]
        assert found.segments.corrector_sd_wh == pytest.approx(15.0)
        assert found.segments.outside_sd_wh == pytest.approx(6.0)
        assert (found.segments.net_wh, found.segments.distance_m) == pytest.approx((240.0, 54_000.0))
        assert found.residual_w.tolist() == [25.0, 25.0]
        assert found.climate_w.tolist() == [12.0, 12.0]
        assert found.climate_expected_w.tolist() == [308.0, 308.0]
        assert found.error_wh == pytest.approx(75.0)
        assert process_segments(table(2), np.zeros(1)).outside_sd_wh == 0.0

    def test_joint_or_not_logged_throughout(self) -> None:
        assert held_out_residual(Corrector(climate=None), table(2)).climate_w is None
        assert held_out_residual(Corrector(), table(2, climate_w=[300.0, np.nan])).climate_w is None
