"""Tables of segments, and trips cut into them, against arithmetic that is written out here."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
from tests.hybrid.tables import CAUSES_W, EXACT, NO, table
from tests.support.refusals import refusal

from tripwatt.errors import InvalidInput
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.segments import LINE_CAUSES, segment_table, segment_trips
from tripwatt.physics import simulate_trip
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import TEMPERATURES, Departure, Plan
from tripwatt.vehicles import load_vehicle


class TestSegmentTable:
    both = table(
        [2, 3],
        [0.1, 0.2, 0.3, 0.4, 0.5],
        simulated=[10.0, 20.0, 30.0, 40.0, 50.0],
        observed=[11.0, 18.0, 33.0, 40.0, 49.0],
        climate=[5.0, NO, 5.0, 5.0, 5.0],
        simulated_climate=[1.0, 2.0, 3.0, 4.0, 5.0],
        charge=np.array([[0.5, 0.4, 0.6, 0.5], [0.9, 0.8, 0.95, 0.85]]),
    )

    def test_rows_of_trips(self) -> None:
        assert len(self.both) == 2
        assert self.both.groups.tolist() == [0, 0, 1, 1, 1]
        assert self.both.residual_w.tolist() == [1.0, -2.0, 3.0, 0.0, -1.0]
        assert self.both.climate_residual_w == pytest.approx([4.0, NO, 2.0, 1.0, 0.0], nan_ok=True)
        # 1 + 4 Wh, and 9 + 16 + 25 Wh
        assert self.both.totals_wh(self.both.simulated_w) == pytest.approx([5.0, 50.0], **EXACT)

    def test_without_measurements(self) -> None:
        bare = table([2], [0.1, 0.2])
        assert np.isnan(bare.climate_residual_w).tolist() == [True, True]
        with pytest.raises(InvalidInput, match="no measured energy"):
            _ = bare.residual_w

    def test_take_and_join(self) -> None:
        second, first = self.both.take([1]), self.both.take([0])
        assert second.trip_ids == ("t1",)
        assert second.offsets.tolist() == [0, 3]
        assert second.features["row"].tolist() == [2.0, 3.0, 4.0]
        assert second.features.index.tolist() == [0, 1, 2]
        assert second.charge.tolist() == [[0.9, 0.8, 0.95, 0.85]]
        back = SegmentTable.join([second, first])
        assert back.trip_ids == ("t1", "t0")
        assert back.offsets.tolist() == [0, 3, 5]
        assert back.hours.tolist() == [0.3, 0.4, 0.5, 0.1, 0.2]
        assert back.observed_w.tolist() == [33.0, 40.0, 49.0, 11.0, 18.0]
        assert back.observed_climate_w == pytest.approx([5.0, 5.0, 5.0, 5.0, NO], nan_ok=True)
        assert back.charge[:, 0].tolist() == [0.9, 0.5]
        turned = self.both.take([1, 0])
        assert turned.offsets.tolist() == [0, 3, 5]
        assert turned.simulated_w.tolist() == back.simulated_w.tolist()

    def test_tables_of_several_trips_join_trip_by_trip(self) -> None:
        twice = SegmentTable.join([self.both, self.both])
        again = twice.take([2, 3])
        assert twice.trip_ids == (*self.both.trip_ids, *self.both.trip_ids)
        assert twice.offsets.tolist() == [0, 2, 5, 7, 10]
        assert (
            again.totals_wh(again.simulated_w).tolist() == self.both.totals_wh(self.both.simulated_w).tolist()
        )

    def test_joined_with_a_table_that_lacks_measurements(self) -> None:
        joined = SegmentTable.join([self.both, table([1], [0.1])])
        assert joined.observed_w is None
        assert joined.charge is None
        assert joined.observed_climate_w == pytest.approx([5.0, NO, 5.0, 5.0, 5.0, NO], nan_ok=True)
        assert SegmentTable.join([table([1], [0.1]), table([1], [0.1])]).observed_climate_w is None


class Log:
    """A measured trip."""

    observed_energy_wh: float | None = 20.0
    observed_energy_std_wh = None
    observed_energy_own_std_wh = observed_energy_common_std = 0.0

    def __init__(self, step_s, **columns) -> None:
        self.step_s, self.trip_id = step_s, "log"
        self.samples = pd.DataFrame(columns)

    def array(self, name):
        return self.samples[name].to_numpy(dtype=float)

    def __contains__(self, name) -> bool:
        return name in self.samples


class TestSegments:
    """Samples after 0, 2, 4, 6, 10, 12, 20 s; segments of 10 s. The first sample counts for the median step, 2 s."""

    time = 100.0 + np.array([0.0, 2.0, 4.0, 6.0, 10.0, 12.0, 20.0])
    speed = np.array([0.0, 2.0, 4.0, 6.0, 6.0, 8.0, 16.0])

    def cut(self, departure=None, measured=None, time=None, segment_s=10.0) -> SegmentTable:
        time = self.time if time is None else time
        n = len(time)
        speed = self.speed if n == 7 else np.full(n, 10.0)
        plan = Plan.from_trace("p", pd.DataFrame({"time_s": time, "speed_m_s": speed}), departure)
        power_w = 100.0 * np.arange(1.0, n + 1.0)
        run = SimpleNamespace(
            battery_power_w=power_w,
            power_by_cause_w={cause: power_w * (k + 2) for k, cause in enumerate(LINE_CAUSES)},
            wheel_power_w=power_w * np.where(np.arange(n) % 2, -1.0, 1.0),
        )
        with patch("tripwatt.hybrid.segments.SEGMENT_S", segment_s):
            return segment_table(plan, run, measured)

    def test_means_by_hand(self) -> None:
        found = self.cut()
        assert found.hours == pytest.approx([8 / 3600, 14 / 3600], **EXACT)
        power_w = [250.0, (500 * 4 + 600 * 2 + 700 * 8) / 14]
        assert found.simulated_w == pytest.approx(power_w, **EXACT)
        features = found.features
        assert features["simulated_w"].to_numpy() == pytest.approx(power_w, **EXACT)
        for k, name in enumerate(CAUSES_W):
            assert features[name].to_numpy() == pytest.approx([(k + 2) * p for p in power_w], **EXACT)
        assert features["moved_w"].to_numpy() == pytest.approx(power_w, **EXACT)
        assert features["speed_m_s"].to_numpy() == pytest.approx([3.0, (24 + 16 + 128) / 14], **EXACT)
        assert features["speed_change_m_s2"].to_numpy() == pytest.approx([0.75, 10 / 14], **EXACT)
        assert features["time_s"].to_numpy() == pytest.approx([3.0, 16.0], **EXACT)
        assert features["trip_speed_m_s"].to_numpy() == pytest.approx([192 / 22] * 2, **EXACT)
        assert found.offsets.tolist() == [0, 2]
        assert found.observed_w is None

    def test_departure(self) -> None:
        known = Departure(bms_soc=0.6, payload_mass_kg=80.0, season="winter", ambient_temperature_degc=-3.0)
        features = self.cut(known).features.iloc[0]
        assert features[["soc", "payload_mass_kg", "winter"]].tolist() == [0.6, 80.0, 1.0]
        assert features["ambient_temperature_degc"] == -3.0
        other = self.cut(Departure(season="summer")).features.iloc[0]
        assert other[["payload_mass_kg", "winter"]].tolist() == [0.0, 0.0]
        assert np.isnan(other[["soc", *TEMPERATURES]].to_numpy(dtype=float)).all()
        assert np.isnan(self.cut().features["winter"]).all()

    @pytest.mark.parametrize(
        ("last_s", "seconds"),
        [
            (5, [6.0]),
            (9, [10.0]),
            (10, [11.0]),
            (19, [20.0]),
            (20, [10.0, 11.0]),
            (29, [10.0, 20.0]),
            (30, [10, 10, 11]),
        ],
    )
    def test_the_rest_of_a_segment_joins_the_last_whole_one(self, last_s, seconds) -> None:
        found = self.cut(time=np.arange(last_s + 1.0))
        assert found.hours * 3600.0 == pytest.approx(seconds, **EXACT)

    def test_thirty_seconds(self) -> None:
        assert self.cut(time=np.arange(61.0), segment_s=30.0).hours * 3600.0 == pytest.approx([30.0, 31.0])
        plan = Plan.from_trace("p", pd.DataFrame({"time_s": np.arange(61.0), "speed_m_s": 1.0}))
        zero = SimpleNamespace(
            battery_power_w=np.zeros(61),
            power_by_cause_w=dict.fromkeys(LINE_CAUSES, np.zeros(61)),
            wheel_power_w=np.zeros(61),
        )
        assert segment_table(plan, zero).hours * 3600.0 == pytest.approx([30.0, 31.0])

    def test_measured(self) -> None:
        """The energy at the last sample of each segment: 6 and 20 Wh in 8 and 14 s."""
        columns = {
            "time_s": self.time,
            "observed_energy_wh": [0.0, 2.0, 4.0, 6.0, 10.0, 12.0, 20.0],
            "soc": [NO, 0.6, 0.59, 0.58, 0.57, 0.56, NO],
            "displayed_soc": [0.7, NO, NO, NO, NO, NO, 0.65],
            "heating_power_w": 900.0,
            "aircon_power_w": 100.0,
        }
        found = self.cut(measured=Log(2.0, **columns))
        assert found.observed_w == pytest.approx([6 * 450.0, 14 * 3600 / 14], **EXACT)
        assert found.charge.tolist() == [[0.6, 0.56, 0.7, 0.65]]
        # 8 to 22 s on the clock of the log, which ends at 20 s
        assert found.observed_climate_w == pytest.approx([1000.0, 1000.0], **EXACT)
        with pytest.raises(
            InvalidInput, match=r"got segments of 3 s; allowed: raw samples, or segments of 2 s"
        ):
            self.cut(measured=Log(3.0, **columns))
        del columns["observed_energy_wh"], columns["soc"], columns["heating_power_w"]
        total = self.cut(measured=Log(2.0, **columns))
        assert total.totals_wh(total.residual_w) == pytest.approx(20.0 - total.totals_wh(total.simulated_w))
        assert np.ptp(total.residual_w) == pytest.approx(0.0, abs=1e-9)
        log = Log(2.0, **columns)
        log.observed_energy_wh = None
        bare = self.cut(measured=log)
        assert bare.observed_w is None
        assert bare.observed_climate_w is None
        assert bare.charge == pytest.approx(np.array([[NO, NO, 0.7, 0.65]]), nan_ok=True)


def test_trips_to_learn_have_measured_energy():
    assert (
        refusal(segment_trips, [], None)
        == "no trips: training: got 0; allowed: at least 1 with measured energy"
    )
    bare = [replace(trip, observed_energy_wh=None) for trip in synthetic_fleet(2).trips]
    allowed = "allowed: voltage and current, or a column observed_energy_wh"
    expected = [f"no measured energy: {trip.trip_id}: {allowed}" for trip in bare]
    assert refusal(segment_trips, bare, None).splitlines() == expected


def test_a_segment_that_ends_at_the_speed_of_its_start_has_no_power_of_acceleration() -> None:
    speed = np.random.default_rng(1).uniform(5.0, 25.0, 90)
    speed[[0, 29, 89]] = 10.0
    plan = Plan.from_trace("wave", {"time_s": np.arange(90.0), "speed_m_s": speed})
    found = segment_table(plan, simulate_trip(load_vehicle("bmw_i3_60ah"), plan)).columns["acceleration_w"]
    assert found.tolist() == [0.0, 0.0]
