"""Segments, correctors and baselines, against arithmetic that is written out here."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.hybrid import SegmentTable, calibrate, power
from tripwatt.hybrid.baselines import EnergyRegression, PhysicsOnly
from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.hybrid.parameters import PARAMETERS, Parameter, changed, sensitivities
from tripwatt.hybrid.power import (
    TREE_FEATURES,
    EnsembleCorrector,
    GPCorrector,
    LearnerCorrector,
    boosting_corrector,
    forest_corrector,
    less_trip_mean,
)
from tripwatt.hybrid.segments import LINE_CAUSES, segment_table
from tripwatt.hybrid.split import (
    CLIMATE_TERMS,
    DRIVE_TERMS,
    DRIVE_TREE_FEATURES,
    SplitCorrector,
    climate_logged,
)
from tripwatt.hybrid.stored import StoredTrees
from tripwatt.hybrid.trip_table import TripTable, build_table
from tripwatt.learners.gp import KernelTerm
from tripwatt.trips import TEMPERATURES, Context, Departure, Plan, Trip
from tripwatt.vehicles import load_vehicle

EXACT = {"rel": 1e-9, "abs": 1e-9}
NO = np.nan
CAUSES_W = [f"{cause}_w" for cause in LINE_CAUSES]


def table(
    rows, hours, *, simulated=None, observed=None, climate=None, hvac=None, charge=None
) -> SegmentTable:
    """Trips with these numbers of rows."""
    n = sum(rows)
    return SegmentTable(
        trip_ids=tuple(f"t{i}" for i in range(len(rows))),
        offsets=np.concatenate(([0], np.cumsum(rows))),
        features=pd.DataFrame({"hvac_w": np.zeros(n) if hvac is None else hvac, "row": np.arange(float(n))}),
        hours=np.asarray(hours, dtype=float),
        simulated_w=np.zeros(n) if simulated is None else np.asarray(simulated, dtype=float),
        observed_w=None if observed is None else np.asarray(observed, dtype=float),
        observed_hvac_w=None if climate is None else np.asarray(climate, dtype=float),
        charge=charge,
    )


class TestSegmentTable:
    both = table(
        [2, 3],
        [0.1, 0.2, 0.3, 0.4, 0.5],
        simulated=[10.0, 20.0, 30.0, 40.0, 50.0],
        observed=[11.0, 18.0, 33.0, 40.0, 49.0],
        climate=[5.0, NO, 5.0, 5.0, 5.0],
        hvac=[1.0, 2.0, 3.0, 4.0, 5.0],
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
        assert back.observed_hvac_w == pytest.approx([5.0, 5.0, 5.0, 5.0, NO], nan_ok=True)
        assert back.charge[:, 0].tolist() == [0.9, 0.5]
        turned = self.both.take([1, 0])
        assert turned.offsets.tolist() == [0, 3, 5]
        assert turned.simulated_w.tolist() == back.simulated_w.tolist()

    def test_joined_with_a_table_that_lacks_measurements(self) -> None:
        joined = SegmentTable.join([self.both, table([1], [0.1])])
        assert joined.observed_w is None
        assert joined.charge is None
        assert joined.observed_hvac_w == pytest.approx([5.0, NO, 5.0, 5.0, 5.0, NO], nan_ok=True)
        assert SegmentTable.join([table([1], [0.1]), table([1], [0.1])]).observed_hvac_w is None


class Log:
    """A measured trip."""

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
        plan = Plan.from_samples("p", pd.DataFrame({"time_s": time, "speed_m_s": speed}), departure)
        power_w = 100.0 * np.arange(1.0, n + 1.0)
        run = SimpleNamespace(
            battery_power_w=power_w,
            power_by_cause_w={cause: power_w * (k + 2) for k, cause in enumerate(LINE_CAUSES)},
            wheel_power_w=power_w * np.where(np.arange(n) % 2, -1.0, 1.0),
        )
        return segment_table(plan, run, measured, segment_s=segment_s)

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
        plan = Plan.from_samples("p", pd.DataFrame({"time_s": np.arange(61.0), "speed_m_s": 1.0}))
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
        assert found.observed_hvac_w == pytest.approx([1000.0, 1000.0], **EXACT)
        with pytest.raises(
            InvalidInput, match=r"got segments of 3 s; allowed: raw samples, or segments of 2 s"
        ):
            self.cut(measured=Log(3.0, **columns))
        del columns["observed_energy_wh"], columns["soc"], columns["heating_power_w"]
        bare = self.cut(measured=Log(2.0, **columns))
        assert bare.observed_w is None
        assert bare.observed_hvac_w is None
        assert bare.charge == pytest.approx(np.array([[NO, NO, 0.7, 0.65]]), nan_ok=True)


class TestLoggedClimate:
    edges = np.array([0.0, 4.0, 8.0])

    def log(self, time, heat, cool=100.0) -> pd.DataFrame:
        return pd.DataFrame(
            {"time_s": np.asarray(time, dtype=float), "heating_power_w": heat, "aircon_power_w": cool}
        )

    def test_means_and_negative_powers(self) -> None:
        found = logged_climate(self.log([0, 2, 4, 6, 8], [400.0, 600.0, 800.0, -200.0, 0.0]), self.edges)
        # trapezia of 500, 700, 400, 0 W and 100 W of the compressor
        assert found == pytest.approx([700.0, 300.0], **EXACT)

    def test_half_of_a_segment_is_enough(self) -> None:
        assert logged_climate(self.log([0, 2, 4, 6], 400.0), self.edges) == pytest.approx(
            [500.0, 500.0], **EXACT
        )
        found = logged_climate(self.log([0, 2, 4, 5.9], 400.0), self.edges)
        assert found == pytest.approx([500.0, NO], nan_ok=True, **EXACT)

    def test_gaps_up_to_the_longest_segment(self) -> None:
        assert logged_climate(self.log([0, 4, 8], 400.0), self.edges) == pytest.approx(
            [500.0, 500.0], **EXACT
        )
        found = logged_climate(self.log([0, 4, 8.1], 400.0), self.edges)
        assert found == pytest.approx([500.0, NO], nan_ok=True, **EXACT)

    def test_missing_values_cover_nothing(self) -> None:
        found = logged_climate(self.log([0, 2, 4, 6, 8], [400.0, 400.0, 400.0, 400.0, NO]), self.edges)
        assert found == pytest.approx([500.0, 500.0], **EXACT)
        found = logged_climate(self.log([0, 2, 4, 6, 8], [400.0, 400.0, 400.0, NO, 400.0]), self.edges)
        assert found == pytest.approx([500.0, NO], nan_ok=True, **EXACT)
        never = self.log([0, 2, 4], [NO, 400.0, NO], [100.0, NO, 100.0])
        assert logged_climate(never, self.edges) is None


class TestParameters:
    car = load_vehicle("bmw_i3_60ah")

    def test_a_change_is_relative_and_names_its_source(self) -> None:
        heavier = changed(self.car, {"mass": 0.1, "air": -0.5}, source="mine")
        assert heavier.body.curb_mass_kg == pytest.approx(1.1 * self.car.body.curb_mass_kg)
        assert heavier.body.driver_mass_kg == pytest.approx(1.1 * self.car.body.driver_mass_kg)
        assert heavier.road_load.coastdown_c_n_s2_m2 == pytest.approx(
            0.5 * self.car.road_load.coastdown_c_n_s2_m2
        )
        assert heavier.road_load.coastdown_a_n == self.car.road_load.coastdown_a_n
        assert heavier.entries["body.curb_mass_kg"].source.startswith("mine; published")
        assert heavier.entries["body.curb_mass_kg"].value == heavier.body.curb_mass_kg
        assert heavier.entries["road_load.coastdown_a_n"] == self.car.entries["road_load.coastdown_a_n"]
        unnamed = changed(self.car, {"mass": 0.1}).entries["body.curb_mass_kg"]
        assert unnamed.source.startswith("published value times 1.100")

    def test_widths_are_those_of_their_sources(self) -> None:
        widths = {p.name: p.width for p in PARAMETERS}
        assert widths == {
            "mass": 0.05,
            "rolling": 0.15,
            "air": 0.10,
            "base_load": 0.40,
            "drivetrain": 0.20,
            "hvac": 0.30,
        }

    def test_sensitivities(self) -> None:
        """A power of 2 W for each kilogram of the car, at a change of 2 %; a cause that is multiplied as it is."""
        plan = Plan.from_samples("p", pd.DataFrame({"time_s": np.arange(31.0), "speed_m_s": 1.0}))

        def run(car, plan):
            n = len(plan)
            causes = dict.fromkeys(LINE_CAUSES, np.full(n, 7.0)) | {"hvac": np.full(n, 30.0)}
            watts = np.full(n, 2.0 * car.body.test_mass_kg)
            return SimpleNamespace(battery_power_w=watts, power_by_cause_w=causes, wheel_power_w=watts)

        own = segment_table(plan, run(self.car, plan))
        found = sensitivities([plan], self.car, own, PARAMETERS, run)
        assert found == pytest.approx(
            np.array([[2.0 * self.car.body.test_mass_kg, 0.0, 0.0, 7.0, 7.0, 30.0]]), rel=1e-6, abs=1e-6
        )
        assert sensitivities([plan], self.car, own, (), run).shape == (1, 0)


class TestCalibration:
    def test_the_usual_error_is_five_percent_of_the_usual_trip(self, monkeypatch) -> None:
        """Trips of 1, 3 and 8 kWh: 150 Wh."""
        seen = {}

        def solved(X, residual, width, usual_wh):
            seen.update(X=X, residual=residual, width=width, usual_wh=usual_wh)
            return np.array([0.1, -0.2]), np.diag([0.04, 0.09])

        trips = [SimpleNamespace(trip_id=f"t{i}", observed_energy_wh=1.0) for i in range(3)]
        simulated, observed = [1000.0, 6000.0, -4000.0], [1100.0, 6000.0, -4000.0]
        own = table([1, 1, 1], [1.0, 0.5, 2.0], simulated=simulated, observed=observed)
        two = tuple(Parameter(name, width, "", (), ("hvac",)) for name, width in (("a", 0.3), ("b", 0.1)))
        monkeypatch.setattr(calibrate, "PARAMETERS", two)
        monkeypatch.setattr(calibrate, "plan_from_trip", lambda trip: trip)
        monkeypatch.setattr(calibrate, "segment_trips", lambda trips, car: own)
        slopes = np.array([[10.0, 1.0], [20.0, 2.0], [30.0, 3.0]])
        monkeypatch.setattr(calibrate, "sensitivities", lambda *_: slopes)
        monkeypatch.setattr(calibrate, "_most_probable", solved)
        found = calibrate.calibrate(trips, None)
        assert seen["usual_wh"] == pytest.approx(150.0, **EXACT)
        assert seen["X"] == pytest.approx(np.array([[10.0, 1.0], [10.0, 1.0], [60.0, 6.0]]), **EXACT)
        assert seen["residual"].tolist() == [100.0, 0.0, 0.0]
        assert seen["width"].tolist() == [0.3, 0.1]
        assert found.changes == {"a": 0.1, "b": -0.2}
        assert found.sd == pytest.approx({"a": 0.2, "b": 0.3})
        assert str(found) == "calibrated on 3 trips: a +10% (± 20%), b -20% (± 30%)"
        with pytest.raises(InvalidInput, match=r"too few trips.*got 2; allowed: at least 3"):
            calibrate.calibrate(trips[:2], None)

    def test_one_trip_and_one_value(self) -> None:
        """The fixed point: weight 5 / (4 + r²/s²), and a scale of the trip and of four that err by 150 Wh."""
        mean, covariance = calibrate._most_probable(
            np.array([[1000.0]]), np.array([400.0]), np.array([0.3]), 150.0
        )
        left = 400.0 - 1000.0 * mean[0]
        scale2 = 150.0**2
        for _ in range(500):
            scale2 = (left**2 * 5.0 / (4.0 + left**2 / scale2) + 4.0 * 150.0**2) / 5.0
        weight = 5.0 / (4.0 + left**2 / scale2)
        precision = weight * 1000.0**2 / scale2 + 1.0 / 0.3**2
        assert covariance[0, 0] == pytest.approx(1.0 / precision, rel=1e-6)
        assert mean[0] == pytest.approx(weight * 1000.0 * 400.0 / scale2 / precision, rel=1e-6)


class TestTripTable:
    def trip(self, name="a", context=None, start=50.0, **columns) -> Trip:
        time = start + np.arange(5.0)
        rows = {
            "time_s": time,
            "speed_m_s": [0.0, 10.0, 20.0, 10.0, 10.0],
            "voltage_v": 360.0,
            "current_a": 10.0,
        }
        return Trip.from_samples(name, pd.DataFrame(rows | columns), context or Context())

    def made(self) -> TripTable:
        one = self.trip(context=Context(season="winter"), ambient_temperature_degc=5.0)
        two = self.trip("b", elevation_m=[100.0, 101.0, 102.0, 103.0, 104.0], ambient_temperature_degc=30.0)
        return build_table([one, two, self.trip("c")], {"x": load_vehicle("bmw_i3_60ah")})

    def test_any_energy_above_zero_counts(self) -> None:
        little = self.trip(current_a=0.25)
        assert little.observed_energy_wh == pytest.approx(0.1)
        cars = {"x": load_vehicle("bmw_i3_60ah")}
        assert build_table([little], cars).trip_ids == ("a",)
        with pytest.raises(InvalidInput, match=r"no measured energy: a: got 0\.0 Wh"):
            build_table([self.trip(current_a=0.0)], cars)

    def test_running_sums(self) -> None:
        """Of the bin means of 1 s that the table holds; 20 °C is comfortable."""
        made = self.made()
        for i, (cold, hot) in enumerate(((15.0, 0.0), (0.0, 10.0), (0.0, 0.0))):
            rows = slice(int(made.offsets[i]), int(made.offsets[i + 1]))
            own, totals = made.trips[i], made.totals.iloc[rows]
            time, speed = own.array("time_s"), own.array("speed_m_s")
            step = np.concatenate(([0.0], np.diff(time)))
            hours = (time - time[0]) / 3600.0
            assert len(time) >= 4
            assert totals["distance_km"].to_numpy() == pytest.approx(
                np.cumsum(speed * step) / 1000.0, **EXACT
            )
            assert totals["duration_h"].to_numpy() == pytest.approx(hours, **EXACT)
            assert totals["cold_h"].to_numpy() == pytest.approx(cold * hours, **EXACT)
            assert totals["hot_h"].to_numpy() == pytest.approx(hot * hours, **EXACT)
            assert totals["cubed_speed"].to_numpy() == pytest.approx(np.cumsum(speed**3 * step), **EXACT)
            faster = np.concatenate(([0.0], np.maximum(np.diff(speed), 0.0)))
            assert totals["acceleration_work"].to_numpy() == pytest.approx(np.cumsum(faster * speed), **EXACT)

    def test_covariates(self) -> None:
        made = self.made()
        climb = made.covariates["elevation_difference_m"].to_numpy()[made.groups == 1]
        assert climb[0] == 0.0
        assert (np.diff(climb) > 0.0).all()
        assert np.isnan(made.covariates["elevation_difference_m"][made.groups != 1]).all()
        assert set(made.covariates["season"][made.groups == 0]) == {"winter"}
        assert set(made.covariates["season"][made.groups == 1]) == {"unknown"}
        assert made.notes == ("covariate weather dropped: no trip has it",)
        assert "weather" not in made.covariates

    def test_rows(self) -> None:
        made = self.made()
        assert len(made) == 3
        lengths = [len(t) for t in made.trips]
        assert made.offsets.tolist() == np.concatenate(([0], np.cumsum(lengths))).tolist()
        assert made.last_rows.tolist() == (np.cumsum(lengths) - 1).tolist()
        assert made.observed_wh[made.last_rows] == pytest.approx([4.0] * 3, rel=1e-6)
        taken = made.take([2, 0])
        assert taken.trip_ids == ("c", "a")
        assert taken.offsets.tolist() == [0, lengths[2], lengths[2] + lengths[0]]
        rows = made.rows_of(np.array([2, 0]))
        assert taken.observed_wh.tolist() == made.observed_wh[rows].tolist()
        assert taken.simulated("x").tolist() == made.simulated("x")[rows].tolist()
        assert taken.covariates.index.tolist() == list(range(len(rows)))
        assert taken.totals["distance_km"].tolist() == made.totals["distance_km"].iloc[rows].tolist()
        assert made.rows_of(np.array([], dtype=int)).tolist() == []
        assert made.simulated(None).tolist() == [0.0] * len(made.observed_wh)

    def test_digest_and_slim(self) -> None:
        made = self.made()
        assert made.digest() == self.made().digest()
        assert made.take([0, 1]).digest() != made.digest()
        slim = made.without_samples()
        assert all(len(t.samples) == 0 for t in slim.trips)
        assert slim.digest() == made.digest()

    def test_energy_above_zero(self) -> None:
        car = {"x": load_vehicle("bmw_i3_60ah")}
        with pytest.raises(InvalidInput) as caught:
            build_table([self.trip(current_a=0.0), self.trip("b", current_a=-1.0), self.trip("c")], car)
        assert [f.where for f in caught.value.faults] == ["a", "b"]
        with pytest.raises(InvalidInput, match="no trips"):
            build_table([], car)


def test_regression_of_the_relative_error() -> None:
    """Two trips with one regressor: each row is divided by its energy, so (1/2 + 2/2) over (1/4 + 4/4)."""
    own = SimpleNamespace(
        last_rows=np.array([1, 3]),
        observed_wh=np.array([1.0, 2.0, 1.0, 2.0]),
        totals=pd.DataFrame({"km": [0.5, 1.0, 1.0, 2.0]}),
        simulated=lambda name: {"x": np.array([0.0, 3.0, 0.0, 5.0])}[name],
    )
    model = EnergyRegression(("km",)).fit(own)
    assert model.coefficients_ == pytest.approx([(0.5 + 1.0) / (0.25 + 1.0)], **EXACT)
    assert model.predict(own) == pytest.approx(1.2 * np.array([0.5, 1.0, 1.0, 2.0]), **EXACT)
    # with the simulation: 3 a + 1 b = 2 and 5 a + 2 b = 2
    both = EnergyRegression(("km",), "x").fit(own)
    assert both.coefficients_ == pytest.approx([2.0, -4.0], **EXACT)
    assert PhysicsOnly("x").fit(own).predict(own).tolist() == [0.0, 3.0, 0.0, 5.0]


class Fixed:
    """A corrector with a fixed correction that remembers what it was fitted on."""

    def __init__(self, watts=0.0, factor=0.0) -> None:
        self.watts, self.factor, self.seen = watts, factor, None

    def fit(self, own):
        self.seen = own
        return self

    def clone_tuned(self):
        return Fixed(self.watts + 0.5, self.factor)

    def predict(self, own):
        return np.full(len(own.hours), self.watts)

    def outside_factor(self, own):
        return np.full((len(own.hours), 1), 10.0 * self.factor)

    def predict_with_uncertainty(self, own):
        return self.predict(own), np.full((len(own.hours), 1), self.factor)


class TestCorrectors:
    two = table([1, 1], [0.1, 0.1])

    def test_ensemble(self) -> None:
        members = [Fixed(10.0, 3.0), Fixed(40.0, 5.0)]
        mean = EnsembleCorrector(members).fit(self.two)
        assert [m.seen is self.two for m in members] == [True, True]
        assert mean.predict(self.two).tolist() == [25.0, 25.0]
        assert mean.outside_factor(self.two).tolist() == [[30.0], [30.0]]
        both = mean.predict_with_uncertainty(self.two)
        assert both[0].tolist() == [25.0, 25.0]
        assert both[1].tolist() == [[3.0], [3.0]]
        assert mean.clone_tuned().predict(self.two).tolist() == [25.5, 25.5]
        assert mean.predict_climate(self.two) is None

    def logged(self, n, known) -> SegmentTable:
        """Trips of two rows; the last one of an unknown trip has no climate control."""
        climate = np.full(2 * n, 350.0)
        climate[2 * known + 1 :: 2] = NO
        return table(
            [2] * n,
            np.full(2 * n, 0.1),
            simulated=np.full(2 * n, 5000.0),
            observed=np.full(2 * n, 5300.0),
            climate=climate,
            hvac=np.full(2 * n, 300.0),
        )

    @pytest.mark.parametrize(
        ("n", "known", "split"), [(8, 8, True), (7, 7, False), (16, 8, True), (17, 8, False), (20, 9, False)]
    )
    def test_climate_control_needs_eight_trips_and_half_of_them(self, n, known, split) -> None:
        own = self.logged(n, known)
        assert climate_logged(own).tolist() == [True] * known + [False] * (n - known)
        parts = Fixed(20.0, 1.0), Fixed(7.0, 2.0), Fixed(99.0, 4.0)
        found = SplitCorrector(*parts).fit(own)
        assert found.split_ is split
        climate, drive, joint = parts
        if not split:
            assert joint.seen is own
            assert climate.seen is drive.seen is None
            assert found.predict(own)[0] == 99.0
            assert found.predict_climate(own) is None
            assert found.outside_factor(own)[0].tolist() == [40.0]
            assert found.predict_with_uncertainty(own)[1][0].tolist() == [4.0]
            again = found.clone_tuned()
            assert again.joint.watts == 99.5
            assert again.split is False
            return
        # climate control took 50 W more than simulated, of the 300 W of the residual
        assert len(climate.seen) == known
        assert climate.seen.residual_w.tolist() == [50.0] * (2 * known)
        assert drive.seen.residual_w.tolist() == [250.0] * (2 * known) + [280.0] * (2 * (n - known))
        assert joint.seen is None
        assert found.predict(own)[0] == 27.0
        assert found.predict_climate(own)[0] == 20.0
        assert found.outside_factor(own)[0].tolist() == [10.0, 20.0]
        mean, factor = found.predict_with_uncertainty(own)
        assert mean[0] == 27.0
        assert factor[0].tolist() == [1.0, 2.0]
        again = found.clone_tuned()
        assert (again.climate.watts, again.drive.watts) == (20.5, 7.5)
        assert again.split is True

    def test_the_choice_can_be_given(self) -> None:
        parts = Fixed(), Fixed(), Fixed()
        assert not SplitCorrector(*parts, False).fit(self.logged(8, 8)).split_
        assert SplitCorrector(*parts, True).split_

    def test_less_the_mean_over_time(self) -> None:
        """(1 h 4 + 3 h 8) / 4 h is 7; the other trip has one row."""
        own = table([2, 1], [1.0, 3.0, 2.0])
        found = less_trip_mean(np.array([[4.0], [8.0], [5.0]]), own)
        assert found[:, 0] == pytest.approx([-3.0, 1.0, 0.0], **EXACT)

    def test_a_longer_drive_is_no_further_outside_than_one_of_an_hour(self) -> None:
        rng = np.random.default_rng(4)
        rows = pd.DataFrame({"time_s": np.tile(np.arange(10) * 200.0, 6), "simulated_w": 5000.0})
        corrector = GPCorrector((KernelTerm(("time_s",), "smooth", 1.0),))
        corrector.model.fit(rows, rng.normal(0.0, 300.0, 60), np.repeat(np.arange(6), 10), np.full(60, 0.05))

        def outside(time_s: float) -> np.ndarray:
            return corrector.outside_factor(SimpleNamespace(features=rows.assign(time_s=time_s)))

        assert outside(1800.0).shape == (60, 0)
        assert (outside(3500.0) < outside(3600.0)).all()
        np.testing.assert_array_equal(outside(3600.0), outside(9000.0))

    def test_shape_moves_energy_along_a_trip(self) -> None:
        """One feature of prior variance 9: ridge on rows less their mean; the total stays that of the weights."""
        own = table([2], [1.0, 3.0], simulated=[0.0, 0.0], observed=[10.0, 30.0])
        column = np.array([[1.0], [2.0]])

        class Model:
            def fit(self, *given):
                self.given = given

            def features(self, features):
                return column, np.array([9.0])

            def predict(self, features):
                return np.array([12.0, 20.0])

            def mean(self, features):
                return 100.0 * features[:, 0]

            def factor(self, features):
                return features * 2.0

        corrector = GPCorrector(())
        model = Model()
        corrector._set_terms = lambda *given: setattr(corrector, "model", model)
        corrector.fit(own)
        assert model.given[1].tolist() == [10.0, 30.0]
        # left are -2 and 10, less 7: -9 and 3; the feature less 1.75: -0.75 and 0.25
        gram = 0.75**2 + 0.25**2 + ((81.0 + 9.0) / 2.0) / (4.0 * 9.0)
        shape = (0.75 * 9.0 + 0.25 * 3.0) / gram
        assert corrector.shape == pytest.approx([shape], **EXACT)
        expected = [100.0 - 0.75 * shape, 200.0 + 0.25 * shape]
        assert corrector.predict(own) == pytest.approx(expected, **EXACT)
        mean, factor = corrector.predict_with_uncertainty(own)
        assert mean == pytest.approx(expected, **EXACT)
        assert factor.tolist() == [[2.0], [4.0]]

    def test_learners_see_their_features(self) -> None:
        seen = {}

        class Learner:
            def __init__(self, settings) -> None:
                self.settings = settings

            def fit(self, columns, target, groups) -> None:
                seen.update(columns=list(columns), target=target, groups=groups)

            def predict(self, columns):
                return columns["row"].to_numpy() * 2.0

        own = table([1, 2], [0.1] * 3, observed=[1.0, 2.0, 3.0])
        made = LearnerCorrector(Learner, lambda model: {"tuned": 1}, features=("row",)).fit(own)
        assert seen["columns"] == ["row"]
        assert seen["target"].tolist() == [1.0, 2.0, 3.0]
        assert seen["groups"].tolist() == [0, 1, 1]
        mean, factor = made.predict_with_uncertainty(own)
        assert mean.tolist() == [0.0, 2.0, 4.0]
        assert factor.tolist() == [[0.0]] * 3
        assert made.outside_factor(own).shape == (3, 0)
        again = made.clone_tuned()
        assert again.model.settings == {"tuned": 1}
        assert again.features == ("row",)
        assert LearnerCorrector(Learner, dict).features == TREE_FEATURES

    def test_settings_that_stored_models_were_learned_with(self) -> None:
        """Terms: 10 % of each cause, 30 % of the simulated climate control; 100 and 200 W of smooth functions."""
        lines = [t for t in power.LINES if t.kind == "line"]
        assert [(t.columns, t.sd) for t in lines] == [((name,), 0.1) for name in CAUSES_W]
        for terms, watts in (
            (power._SMOOTH, 100.0),
            (CLIMATE_TERMS[1:], 200.0),
            (DRIVE_TERMS[len(CAUSES_W) - 1 :], 100.0),
        ):
            assert {(t.kind, t.sd) for t in terms} == {("smooth", watts)}
            assert [t.length for t in terms] == [1.0] * (len(terms) - 1) + [1.5]
        assert (CLIMATE_TERMS[0].kind, CLIMATE_TERMS[0].sd) == ("line", 0.3)
        driven = [t.columns[0] for t in DRIVE_TERMS if t.kind == "line"]
        assert driven == [name for name in CAUSES_W if name != "hvac_w"]
        assert {t.sd for t in DRIVE_TERMS if t.kind == "line"} == {0.1}
        assert set(TREE_FEATURES) - set(DRIVE_TREE_FEATURES) == {"hvac_w", *TEMPERATURES[1:3]}
        process = GPCorrector().model
        assert (process.effect_sd, process.share_sd) == (220.0, 0.05)
        boosted = boosting_corrector(3).model.get_params()
        assert {k: boosted[k] for k in ("max_leaf_nodes", "learning_rate", "max_features", "subsample")} == {
            "max_leaf_nodes": 4,
            "learning_rate": 0.05,
            "max_features": 0.6,
            "subsample": 0.7,
        }
        assert boosted["random_state"] == 3
        assert boosting_corrector(3).tuned(SimpleNamespace(n_rounds_=0)) == {"n_rounds": 1, "n_folds": None}
        assert boosting_corrector(3).tuned(SimpleNamespace(n_rounds_=7)) == {"n_rounds": 7, "n_folds": None}
        assert forest_corrector(3).model.n_trees == 200

    @pytest.mark.parametrize(("divisor", "expected"), [(None, [105.0, 106.0]), (4, [2.5, 2.75])])
    def test_stored_trees(self, divisor, expected) -> None:
        class Trees:
            """One column instead of trees."""

            def __len__(self) -> int:
                return 0

            def sum(self, X: np.ndarray) -> np.ndarray:
                return X[:, 0]

        trees = Trees()
        stored = StoredTrees(
            trees, ("row",), 100.0 if divisor is None else 0.0, 5.0 if divisor is None else 10.0, divisor
        )
        own = table([2], [0.1, 0.1])
        assert stored.predict(own) == pytest.approx(expected, **EXACT)
        assert stored.predict_with_uncertainty(own)[1].tolist() == [[0.0], [0.0]]
        assert stored.outside_factor(own).shape == (2, 0)
