"""What samples on the way show, in three segments of 10 s, against arithmetic that is written out here."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from tests.forecasting import test_forecast as by_hand
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.forecasting.measured import (
    ChargeReading,
    SegmentReadings,
    SpanReadings,
    _from_power,
    along_the_plan,
    columns_measured,
    measured_energy,
    read_measured,
    since_departure,
)
from tripwatt.routes import route_from_links
from tripwatt.trips import Plan
from tripwatt.uncertainty.charge import NORMAL_SCALE, ChargeScale

EXACT = {"rel": 1e-9, "abs": 1e-9}
NO = np.nan
SCALE = ChargeScale(0.1, 0.9, 16_000.0, 0.01, 0.02)
MARK_WH2 = (0.01 * 16_000.0 / NORMAL_SCALE) ** 2 / 2.0
"""Two marks have the error of a display at arrival."""


class Segments:
    step_s = np.full(3, 10.0)
    drive_noise_w = np.array([100.0, 200.0, 300.0])

    def __len__(self) -> int:
        return 3


DRIVE = SimpleNamespace(
    edges_s=np.array([0.0, 10.0, 20.0, 30.0]),
    table=SimpleNamespace(hours=np.full(3, 10.0 / 3600.0)),
    segments=Segments(),
)
PROCESS = SimpleNamespace(drive=SimpleNamespace(noise=0.5))
"""Half of the segments' noise is 50, 100 and 150 W."""


def steady(time, **columns) -> pd.DataFrame:
    """360 V and 10 A: 1 Wh in each second."""
    time = np.asarray(time, dtype=float)
    return pd.DataFrame({"time_s": time, "voltage_v": 360.0, "current_a": 10.0, **columns})


def columns(samples: pd.DataFrame) -> dict[str, np.ndarray]:
    return {name: values.to_numpy(dtype=float) for name, values in samples.items()}


def read(samples: pd.DataFrame):
    return read_measured(columns(samples), DRIVE, PROCESS, SCALE)


class TestPower:
    def test_whole_segments(self) -> None:
        log = steady(np.arange(31.0))
        log.loc[log["time_s"] > 20.0, "current_a"] = 20.0
        measured, found = read(log)
        # the current doubles between 20 and 21 s: half a Wh less
        assert measured.energy_wh == pytest.approx([10.0, 10.0, 19.5], **EXACT)
        assert measured.hours * 3600.0 == pytest.approx([10.0, 10.0, 10.0], **EXACT)
        assert measured.until_s == 30.0
        assert measured.anchor is None
        assert found.seen.tolist() == [0, 1, 2]
        assert found.power_w == pytest.approx([3600.0, 3600.0, 7020.0], **EXACT)
        assert found.variance_w2 == pytest.approx([1.0, 1.0, 1.0], **EXACT)

    def test_a_part_of_a_segment(self) -> None:
        """Nine tenths leave a tenth of the squared noise of 150 W, beside 1 W²; seven tenths are not used."""
        measured, found = read(steady(np.arange(30.0)))
        assert measured.until_s == 29.0
        assert measured.hours * 3600.0 == pytest.approx([10.0, 10.0, 9.0], **EXACT)
        assert found.power_w == pytest.approx([3600.0] * 3, **EXACT)
        assert found.variance_w2 == pytest.approx([1.0, 1.0, 0.1 * 150.0**2 + 1.0], **EXACT)
        assert read(steady(np.arange(28.0)))[1].seen.tolist() == [0, 1]

    def test_a_gap(self) -> None:
        measured, found = read(steady([0.0, 5.0, 20.0, 30.0]))
        assert measured.energy_wh == pytest.approx([10.0, 10.0, 10.0], **EXACT)
        measured, found = read(steady([0.0, 4.0, 20.0, 30.0]))
        assert measured.energy_wh == pytest.approx([4.0, 0.0, 10.0], **EXACT)
        assert measured.hours * 3600.0 == pytest.approx([4.0, 0.0, 10.0], **EXACT)
        assert found.seen.tolist() == [2]

    def test_samples_after_the_plan_belong_to_its_last_segment(self) -> None:
        measured, found = read(steady(np.arange(34.0)))
        assert measured.energy_wh == pytest.approx([10.0, 10.0, 13.0], **EXACT)
        assert measured.hours * 3600.0 == pytest.approx([10.0, 10.0, 13.0], **EXACT)
        assert found.variance_w2 == pytest.approx([1.0, 1.0, 1.0], **EXACT)
        assert DRIVE.edges_s[-1] == 30.0

    @pytest.mark.parametrize(("took_s", "seen"), [(15.0, [0, 1, 2]), (15.5, [0, 2])])
    def test_a_segment_that_took_half_as_long_again_is_used(self, took_s, seen) -> None:
        log = steady(np.arange(31.0))
        log["driven_s"] = np.interp(
            log["time_s"], [0.0, 10.0, 20.0, 30.0], np.cumsum([0.0, 10.0, took_s, 10.0])
        )
        assert read(log)[1].seen.tolist() == seen

    def test_missing_at_the_end(self) -> None:
        log = steady(np.arange(31.0))
        log.loc[log["time_s"] > 25.0, "voltage_v"] = NO
        assert read(log)[0].until_s == 25.0

    def test_no_measurement(self) -> None:
        refuses("no measured energy", read, pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": 1.0}))
        with pytest.raises(InvalidInput, match="no measured energy"):
            read(pd.DataFrame({"time_s": [0.0, 1.0], "soc": NO, "displayed_soc": NO}))


class TestCharge:
    def readings(self, time, soc):
        return read(pd.DataFrame({"time_s": np.asarray(time, dtype=float), "soc": soc}))

    def test_three_steps(self) -> None:
        """A display of 0.5 falls to 0.46875 half way between 20 and 30 s: 500 Wh; two marks, and 3 % of the capacity."""
        measured, found = self.readings([0, 10, 20, 30], [0.50, 0.49, 0.48, 0.47])
        hours = 25.0 / 3600.0
        assert found.weights == pytest.approx(np.array([[0.4, 0.4, 0.2]]), **EXACT)
        assert found.power_w == pytest.approx([500.0 / hours], **EXACT)
        assert found.covariance_w2 == pytest.approx(
            np.array([[(2.0 * MARK_WH2 + 15.0**2) / hours**2]]), **EXACT
        )
        assert measured.until_s == 30.0
        assert measured.energy_wh == 0.0
        assert measured.anchor == ChargeReading(30.0, 0.47, False)

    def test_fine_readings(self) -> None:
        """Marks are at 8.5 s, 200 Wh, and at 22.5 s, 300 Wh more. Both spans share a mark and the capacity."""
        _, found = self.readings([0, 5, 7, 12, 14, 31], [0.5, 0.498, NO, 0.482, 0.482, 0.468])
        expected = np.array([[8.5, 0.0, 0.0], [1.5, 10.0, 2.5]]) / [[8.5], [14.0]]
        hours = np.array([8.5, 14.0]) / 3600.0
        power = np.array([200.0, 300.0]) / hours
        assert found.weights == pytest.approx(expected, **EXACT)
        assert found.power_w == pytest.approx(power, **EXACT)
        errors = MARK_WH2 * np.array([[2.0, -1.0], [-1.0, 2.0]]) / np.outer(hours, hours)
        errors += 0.03**2 * np.outer(power, power)
        assert found.covariance_w2 == pytest.approx(errors, **EXACT)
        assert (found.mean_of(np.eye(3)) > 0.0).any(axis=0).tolist() == [True, True, True]

    def test_charging(self) -> None:
        _, found = self.readings([0, 2, 4, 6], [0.5, 0.51, 0.52, 0.54])
        assert found.power_w == pytest.approx([-600.0 * 720.0], **EXACT)
        assert (found.mean_of(np.eye(3)) > 0.0).any(axis=0).tolist() == [True, False, False]

    @pytest.mark.parametrize("soc", [[0.5, 0.5, 0.5], [0.5, 0.4, 0.4], [0.5, 0.49, 0.48]])
    def test_fewer_than_three_steps_show_nothing(self, soc) -> None:
        _, found = self.readings([0, 10, 20], soc)
        assert found.weights.shape == (0, 3)
        assert len(found.power_w) == len(found.covariance_w2) == 0

    def test_a_full_display_counts_from_its_first_change(self) -> None:
        """From 0.995 half way between 9 and 10 s to 0.965 at 25 s: 480 Wh."""
        log = {
            "time_s": [0.0, 9.0, 10.0, 15.0, 20.0, 30.0],
            "displayed_soc": [1.0, 1.0, 0.99, 0.98, 0.97, 0.96],
        }
        _, found = read(pd.DataFrame(log))
        assert found.weights == pytest.approx(np.array([[0.5, 10.0, 5.0]]) / 15.5, **EXACT)
        assert found.power_w == pytest.approx([480.0 * 3600.0 / 15.5], **EXACT)

    def test_displayed_charge(self) -> None:
        log = pd.DataFrame({"time_s": [0.0, 10.0, 20.0, 30.0], "displayed_soc": [0.5, 0.45, 0.4, 0.35]})
        measured, found = read(log)
        assert found.power_w == pytest.approx([0.125 * 16_000.0 * 144.0], **EXACT)
        assert measured.anchor == ChargeReading(30.0, 0.35, True)

    def test_both(self) -> None:
        """The battery management measures, the display is the anchor; the last that is known."""
        log = pd.DataFrame(
            {"time_s": [0.0, 10.0, 20.0], "soc": [0.5, 0.4, 0.2], "displayed_soc": [0.6, 0.5, NO]}
        )
        measured, _ = read(log)
        assert measured.anchor == ChargeReading(10.0, 0.5, True)
        log["displayed_soc"] = NO
        assert read(log)[0].anchor == ChargeReading(20.0, 0.2, False)
        log["soc"] = [0.5, 0.4, NO]
        assert read(log)[0].anchor == ChargeReading(10.0, 0.4, False)


def test_readings_of_values() -> None:
    values = np.array([1.0, 10.0, 100.0])
    single = SegmentReadings(np.array([0, 2]), np.zeros(2), np.ones(2))
    assert single.mean_of(values).tolist() == [1.0, 100.0]
    assert (single.mean_of(np.eye(3)) > 0.0).any(axis=0).tolist() == [True, False, True]
    span = SpanReadings(np.array([[0.5, 0.5, 0.0]]), np.zeros(1), np.ones(1))
    assert span.mean_of(values).tolist() == [5.5]
    assert (span.mean_of(np.eye(3)) > 0.0).any(axis=0).tolist() == [True, True, False]


def energy_of(log: pd.DataFrame):
    return measured_energy(columns(log))


class TestEnergy:
    def test_up_to_fifteen_seconds_are_bridged(self) -> None:
        time = np.arange(60.0)
        log = steady(time)
        log.loc[(time > 9.0) & (time < 24.0), "current_a"] = NO
        log.loc[(time > 30.0) & (time < 46.0), "voltage_v"] = NO
        found = energy_of(log)
        missing = (time > 30.0) & (time < 46.0)
        assert np.isnan(found).tolist() == missing.tolist()
        assert found[~missing] == pytest.approx(time[~missing], **EXACT)

    def test_the_ends_are_not_bridged(self) -> None:
        log = steady(100.0 + np.arange(6.0))
        log.loc[[0, 1, 5], "current_a"] = NO
        assert np.isnan(energy_of(log)).tolist() == [True, True, False, False, False, True]
        log["current_a"] = [10.0, 10.0, NO, 10.0, 10.0, 10.0]
        assert energy_of(log) == pytest.approx(np.arange(6.0), **EXACT)

    @pytest.mark.parametrize(("last_s", "bridged"), [(16.0, True), (16.5, False)])
    def test_a_gap_that_ends_with_the_last_sample(self, last_s, bridged) -> None:
        log = steady([0.0, 1.0, 10.0, last_s])
        log.loc[2, "current_a"] = NO
        assert bool(np.isfinite(energy_of(log)[2])) is bridged

    def test_counted_energy_is_never_bridged(self) -> None:
        log = pd.DataFrame({"time_s": [0.0, 1.0, 2.0, 3.0], "observed_energy_wh": [5.0, NO, 7.0, 9.0]})
        assert energy_of(log) == pytest.approx([0.0, NO, 2.0, 4.0], nan_ok=True, **EXACT)

    def test_nothing_known(self) -> None:
        assert energy_of(pd.DataFrame({"time_s": [0.0, 1.0]})) is None
        assert energy_of(pd.DataFrame({"time_s": [0.0, 1.0], "observed_energy_wh": NO})) is None
        only_voltage = pd.DataFrame(
            {"time_s": [0.0, 1.0], "voltage_v": 360.0, "observed_energy_wh": [0.0, 3.0]}
        )
        assert energy_of(only_voltage).tolist() == [0.0, 3.0]


def planned(time, speed):
    arrays = {"time_s": np.asarray(time, dtype=float), "speed_m_s": np.asarray(speed, dtype=float)}
    return SimpleNamespace(link_m=50.0, array=arrays.__getitem__)


def driven(time, speed, **more) -> dict[str, np.ndarray]:
    return columns(steady(time, speed_m_s=np.asarray(speed, dtype=float), **more))


class TestPlansClock:
    """The plan drives at 10 m/s, from 100 s on its own clock."""

    even = planned([100.0, 110.0, 140.0], [10.0, 10.0, 10.0])

    def test_half_as_fast(self) -> None:
        found = along_the_plan(driven(np.arange(5.0), np.full(5, 5.0)), self.even)
        assert found["time_s"].tolist() == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0], **EXACT)
        assert found["driven_s"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
        assert found["observed_energy_wh"].tolist() == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0], **EXACT)

    def test_of_a_standstill_the_last_sample_counts(self) -> None:
        """10 m/s to 0 in a second are 5 m; then it stands, starts again in 5 m and drives 10 m."""
        log = driven(np.arange(5.0), [10.0, 0.0, 0.0, 10.0, 10.0], soc=[0.5, 0.4, 0.3, 0.2, 0.1])
        found = along_the_plan(log, self.even)
        assert found["time_s"].tolist() == pytest.approx([0.0, 0.5, 1.0, 2.0], **EXACT)
        assert found["driven_s"].tolist() == pytest.approx([0.0, 2.0, 3.0, 4.0], **EXACT)
        assert found["observed_energy_wh"].tolist() == pytest.approx([0.0, 2.0, 3.0, 4.0], **EXACT)
        assert found["soc"].tolist() == pytest.approx([0.5, 0.3, 0.2, 0.1], **EXACT)

    def test_a_standstill_at_the_start_keeps_its_first_sample(self) -> None:
        """The last sample of it is a millisecond later, or half the way to the next one."""
        found = along_the_plan(driven(np.arange(4.0), [0.0, 0.0, 10.0, 10.0]), self.even)
        assert found["time_s"].tolist() == pytest.approx([0.0, 0.001, 0.5, 1.5], **EXACT)
        assert found["driven_s"].tolist() == pytest.approx([0.0, 1.0, 2.0, 3.0], **EXACT)
        slow = along_the_plan(driven(5.0 + np.arange(3.0), [0.0, 0.0, 0.02]), self.even)
        assert slow["time_s"].tolist() == pytest.approx([5.0, 5.0005, 5.001], **EXACT)
        stands = along_the_plan(driven(np.arange(3.0), np.zeros(3)), self.even)
        assert stands["time_s"].tolist() == pytest.approx([0.0, 0.001], **EXACT)
        assert stands["driven_s"].tolist() == pytest.approx([0.0, 2.0], **EXACT)

    def test_where_the_plan_waits_and_the_car_does_not_time_is_filled(self) -> None:
        """The plan needs 13 s from 100 to 110 m, the car one: two samples between, that show power but no charge."""
        waits = planned([0.0, 10.0, 11.0, 22.0, 23.0, 33.0], [10.0, 10.0, 0.0, 0.0, 10.0, 10.0])
        log = driven(
            [9.0, 10.0, 11.0, 12.0],
            np.full(4, 10.0),
            soc=[0.5, 0.4, 0.3, 0.2],
            heating_power_w=[900.0, 1000.0, 1300.0, 1400.0],
        )
        found = along_the_plan(log, waits)
        third = 13.0 / 3.0
        assert found["time_s"].tolist() == pytest.approx(
            [9.0, 10.0, 10 + third, 10 + 2 * third, 23.0, 24.0], **EXACT
        )
        moved = [9.0, 10.0, 10 + 1 / 3, 10 + 2 / 3, 11.0, 12.0]
        assert found["driven_s"].tolist() == pytest.approx(moved, **EXACT)
        energy = [0.0, 1.0, 4 / 3, 5 / 3, 2.0, 3.0]
        assert found["observed_energy_wh"].tolist() == pytest.approx(energy, **EXACT)
        assert found["soc"].tolist() == pytest.approx([0.5, 0.4, NO, NO, 0.3, 0.2], nan_ok=True, **EXACT)
        heat = [900.0, 1000.0, 1100.0, 1200.0, 1300.0, 1400.0]
        assert found["heating_power_w"].tolist() == pytest.approx(heat, **EXACT)

    @pytest.mark.parametrize(
        ("gap_s", "times"), [(15.0, [0, 5, 10, 14.6, 19.2, 23.8, 28.4, 33]), (16.0, [0, 5, 10, 33])]
    )
    def test_a_gap_of_the_samples_is_not_filled(self, gap_s, times) -> None:
        """10 s of the plan take two pieces of 5 s, 23 s five of 4.6 s."""
        waits = planned([0.0, 10.0, 11.0, 22.0, 23.0, 33.0], [10.0, 10.0, 0.0, 0.0, 10.0, 10.0])
        found = along_the_plan(driven([0.0, 10.0, 10.0 + gap_s], np.full(3, 10.0)), waits)
        assert found["time_s"].tolist() == pytest.approx(times, **EXACT)

    def test_gaps_of_a_standstill_count_one_by_one(self) -> None:
        """Two gaps of 10 s between the samples that are kept are no gap of 20 s."""
        found = along_the_plan(driven([0.0, 2.0, 12.0, 22.0, 24.0], [10.0, 0.0, 0.0, 10.0, 10.0]), self.even)
        # 10, 10, 60 and 80 m: 1, 1, 6 and 8 s of the plan; the standstill ends at 12 s
        assert found["driven_s"].tolist() == pytest.approx([0.0, 12.0, 22.0, 24.0], **EXACT)
        assert found["time_s"].tolist() == pytest.approx([0.0, 1.0, 6.0, 8.0], **EXACT)

    def test_one_sample(self) -> None:
        found = along_the_plan(driven([3.0], [10.0], soc=[0.5]), self.even)
        assert found["time_s"].tolist() == [3.0]
        assert found["soc"].tolist() == [0.5]

    def test_a_driven_trace_is_left_alone(self) -> None:
        log = driven(np.arange(3.0), np.full(3, 5.0))
        assert along_the_plan(log, SimpleNamespace(link_m=None)) is log

    def test_samples_without_a_speed_are_on_schedule(self) -> None:
        log = driven(np.arange(3.0), np.full(3, 5.0))
        assert along_the_plan(log, self.even)["time_s"].tolist() == [0.0, 0.5, 1.0]
        blind = {name: values for name, values in log.items() if name != "speed_m_s"}
        assert along_the_plan(blind, self.even) is blind, "it is where it was planned to be"


def departed(log: pd.DataFrame, plan: Plan):
    return since_departure(columns_measured(log), plan)


class TestDeparture:
    plan = Plan.from_samples(pd.DataFrame({"time_s": [60.0, 61.0, 90.0], "speed_m_s": 10.0}))

    def readings(self, *times: float) -> pd.DataFrame:
        return pd.DataFrame({"time_s": np.array(times), "soc": 0.5})

    def test_times_count_from_the_departure(self) -> None:
        assert departed(self.readings(60.0, 70.0), self.plan)["time_s"].tolist() == [0.0, 10.0]
        assert departed(self.readings(90.0, 95.0), self.plan)["time_s"].tolist() == [30.0, 35.0]
        refuses("too few samples", departed, self.readings(), self.plan)

    def test_before_and_after(self) -> None:
        with pytest.raises(
            InvalidInput, match=r"measured before departure.*got 59 s; allowed: 60 s or later"
        ):
            departed(self.readings(59.0, 70.0), self.plan)
        with pytest.raises(
            InvalidInput, match=r"measured after the trip.*got 91 to 95 s; allowed: 60 to 90 s"
        ):
            departed(self.readings(91.0, 95.0), self.plan)

    def test_a_planned_route_may_begin_late_but_not_by_another_clock(self) -> None:
        planned = route_from_links([{"length_m": 900.0, "speed_m_s": 15.0}]).plan()
        assert departed(self.readings(3600.0, 3700.0), planned)["time_s"].tolist() == [3600.0, 3700.0]
        with pytest.raises(InvalidInput, match=r"measured after the trip.*got 1.7e\+09"):
            departed(self.readings(1.7e9, 1.7e9 + 60.0), planned)

    def accelerating(self, sign: float, own_speed: bool = True):
        """1500 kg between 10 and 20 m/s for ten minutes."""
        time = np.arange(600.0)
        speed = 15.0 + 5.0 * np.sin(time / 8.0)
        power = sign * (1500.0 * speed * np.gradient(speed, time) + 3000.0)
        log = pd.DataFrame({"time_s": time, "voltage_v": 360.0, "current_a": power / 360.0})
        plan = Plan.from_trace("p", pd.DataFrame({"time_s": time, "speed_m_s": speed}))
        return (log.assign(speed_m_s=speed) if own_speed else log), plan

    @pytest.mark.parametrize("own_speed", [True, False])
    def test_a_battery_that_charges_while_the_car_accelerates(self, own_speed) -> None:
        log, plan = self.accelerating(1.0, own_speed)
        assert len(departed(log, plan)["time_s"]) == 600
        log, plan = self.accelerating(-1.0, own_speed)
        refuses("current has the wrong sign", departed, log, plan)
        assert len(departed(log.drop(columns="voltage_v"), plan)["time_s"]) == 600

    def test_on_a_planned_route_only_the_own_speed_counts(self) -> None:
        log, plan = self.accelerating(-1.0)
        linked = Plan.from_trace("p", plan.samples, link_m=50.0)
        refuses("current has the wrong sign", departed, log, linked)
        assert len(departed(log.drop(columns="speed_m_s"), linked)["time_s"]) == 600
        assert len(departed(self.readings(700.0, 710.0), linked)["time_s"]) == 2


@pytest.mark.parametrize(("stretch", "counts"), [(1.0, True), (1.5, True), (1.51, False), (3.0, False)])
def test_a_segment_that_took_long_is_no_evidence_of_its_power(stretch, counts):
    drive = by_hand.drive()
    ends = drive.edges_s.copy()
    ends[1:] += (stretch - 1.0) * 60.0  # the first segment took longer than planned, the others as planned
    readings = _from_power(
        np.array([60.0, 400.0, 300.0]), by_hand.HOURS.copy(), drive, by_hand.ONE_PROCESS, ends
    )
    assert (0 in readings.seen) is counts
    assert len(readings.power_w) == 2 + counts
    assert readings.power_w[-1] == pytest.approx(300.0 * 20)
