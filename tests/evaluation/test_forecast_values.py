"""Data, models and results of the forecast protocol, against arithmetic that is written out here."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.evaluation import forecast_models, forecast_results, held_out_forecasts
from tripwatt.evaluation.comparison import Comparison
from tripwatt.evaluation.forecast_data import ForecastData, _distinct, at_departure_only, measured_log
from tripwatt.evaluation.forecast_models import DataMethod, ForecastMethod, PowerMethod
from tripwatt.evaluation.forecast_results import (
    about_trips,
    forecast_insight,
    forecast_scores,
    measured_beside,
    strata,
)
from tripwatt.evaluation.forecast_scores import (
    FORECAST,
    FRACTIONS,
    LEVELS,
    UPDATES,
    WITHOUT_PHYSICS,
    ForecastInsight,
)
from tripwatt.evaluation.held_out_forecasts import HeldOutForecasts, arrivals_of, reforecast
from tripwatt.evaluation.hold_outs import HoldOut, Split
from tripwatt.evaluation.tasks import FoldResult, ModelSpec
from tripwatt.hybrid import SegmentTable
from tripwatt.trips import Context, Departure, Plan, Trip

EXACT = {"rel": 1e-9, "abs": 1e-9}
NO = np.nan


def log_of(time, **columns) -> Trip:
    rows = {"time_s": np.asarray(time, dtype=float), "speed_m_s": 10.0, "voltage_v": 360.0, "current_a": 10.0}
    return Trip.from_samples("t", pd.DataFrame(rows | columns))


class TestMeasuredLog:
    """360 V and 10 A are 1 Wh in each second, 10 m/s are 10 m."""

    def test_the_last_sample_that_is_not_after_each_second(self) -> None:
        log = measured_log(log_of([5.0, 5.4, 6.0, 6.9, 7.0, 9.2, 9.6]))
        # at 3 and 4 s the last one is still that of 2 s; the very last one ends the log
        assert log["time_s"].tolist() == pytest.approx([0.0, 1.0, 2.0, 4.6], **EXACT)
        assert log["observed_energy_wh"].tolist() == pytest.approx(log["time_s"].tolist(), **EXACT)
        assert log["distance_m"].tolist() == pytest.approx((10.0 * log["time_s"]).tolist(), **EXACT)
        assert list(log.columns) == ["time_s", "observed_energy_wh", "distance_m"]

    def test_steps(self) -> None:
        log = measured_log(log_of(np.arange(7.0)), step_s=2.5)
        assert log["time_s"].tolist() == [0.0, 2.0, 5.0, 6.0]

    def test_a_second_that_rounding_missed(self) -> None:
        """A sample up to a nanosecond after a second is that of the second."""
        log = measured_log(log_of([0.0, 0.5, 1.0 + 5e-10, 2.0]))
        assert log["time_s"].tolist() == pytest.approx([0.0, 1.0, 2.0], abs=1e-6)
        later = measured_log(log_of([0.0, 0.5, 1.0 + 2e-9, 2.0]))
        assert later["time_s"].tolist() == pytest.approx([0.0, 0.5, 2.0], abs=1e-6)

    def test_no_row_in_a_gap(self) -> None:
        current = [10.0, 10.0, NO, NO, 10.0, NO]
        log = measured_log(log_of(np.arange(6.0), current_a=current, soc=[0.5, 0.49, 0.48, 0.47, 0.46, 0.45]))
        assert log["time_s"].tolist() == [0.0, 1.0, 4.0]
        assert log["observed_energy_wh"].tolist() == pytest.approx([0.0, 1.0, 4.0], **EXACT)
        assert log["soc"].tolist() == [0.5, 0.49, 0.46]

    def test_changing_speed_and_a_counted_energy(self) -> None:
        rows = {
            "time_s": [0.0, 1.0, 3.0],
            "speed_m_s": [0.0, 10.0, 20.0],
            "observed_energy_wh": [5.0, 6.0, 8.0],
        }
        log = measured_log(Trip.from_samples("t", pd.DataFrame(rows)))
        assert log["distance_m"].tolist() == [0.0, 5.0, 35.0]
        assert log["observed_energy_wh"].tolist() == [0.0, 1.0, 3.0]
        with pytest.raises(InvalidInput, match="no measured energy"):
            measured_log(Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": 1.0})))


def test_only_the_departure_is_left_of_a_trip() -> None:
    samples = {"soc": [0.5, 0.4], "heating_power_w": [1.0, 2.0], "ambient_temperature_degc": [NO, NO]}
    trip = log_of([0.0, 1.0], elevation_m=[500.0, 510.0], **samples)
    known = at_departure_only(trip).samples
    assert known["soc"].tolist() == [0.5, 0.5]
    assert known["elevation_m"].tolist() == [500.0, 510.0]
    assert known["current_a"].tolist() == [10.0, 10.0]
    assert "heating_power_w" not in known
    if "ambient_temperature_degc" in known:
        assert known["ambient_temperature_degc"].isna().all()


def test_trips_of_one_name_get_marks() -> None:
    trips = [dataclasses.replace(log_of([0.0, 1.0]), trip_id=name) for name in ("a", "a", "b", "a")]
    assert [t.trip_id for t in _distinct(trips)] == ["a", "a'", "b", "a''"]


def segments(*rows: int, observed=2.0) -> SegmentTable:
    """Trips with these numbers of segments of half an hour, 100 W simulated, 2 W for each row more observed."""
    n = sum(rows)
    return SegmentTable(
        tuple(f"t{i}" for i in range(len(rows))),
        np.concatenate(([0], np.cumsum(rows))),
        pd.DataFrame({"row": np.arange(float(n))}),
        np.full(n, 0.5),
        np.full(n, 100.0),
        observed_w=100.0 + observed * np.arange(n),
    )


class Trips:
    """As a table of trips."""

    def __init__(self, ids) -> None:
        self.trip_ids = tuple(ids)

    def __len__(self) -> int:
        return len(self.trip_ids)

    def take(self, members):
        return Trips(self.trip_ids[i] for i in members)


def data(*rows: int) -> ForecastData:
    own = segments(*rows)
    plans = tuple(f"plan {i}" for i in range(len(rows)))
    logs = tuple(f"log {i}" for i in range(len(rows)))
    return ForecastData(
        "car", Trips(own.trip_ids), own, own.features.rename(columns={"row": "seen"}), plans, logs, logs
    )


class TestData:
    def test_take(self) -> None:
        some = data(1, 2, 1).take(np.array([0, 2]))
        assert some.plans == ("plan 0", "plan 2")
        assert some.logs == ("log 0", "log 2")
        assert some.table.trip_ids == ("t0", "t2")
        assert some.segments.features["row"].tolist() == [0.0, 3.0]
        assert some.data_features["seen"].tolist() == [0.0, 3.0]
        assert some.data_features.index.tolist() == [0, 1]
        assert len(some) == 2

    def test_slim(self) -> None:
        slim = data(1, 2).slim()
        assert (slim.plans, slim.logs, len(slim.table)) == ((), (), 0)
        assert len(slim.segments) == 2


class Half:
    """Predicts half of the mean of what it was fitted on, and remembers what that was."""

    def fit(self, columns, target, groups=None):
        self.columns, self.target, self.groups = columns, np.asarray(target), groups
        return self

    def predict(self, columns):
        return np.full(len(columns), 0.5 * self.target.mean())

    def leave_groups_out(self, columns, target, groups, folds):
        return 1000.0 * folds + 10.0 * groups + np.asarray(target)


class HalfCorrector:
    features = ("row", "speed_m_s")

    def __init__(self) -> None:
        self.model = Half()

    def fit(self, own):
        self.seen = own
        return self

    def predict(self, own):
        return np.full(len(own.hours), self.seen.residual_w.mean())

    def columns(self, own):
        return own.features


@pytest.fixture
def learner(monkeypatch):
    made = []

    def corrector(name, seed):
        made.append(HalfCorrector())
        return made[-1]

    monkeypatch.setattr(forecast_models, "power_corrector", corrector)
    monkeypatch.setattr(forecast_models, "LearnerCorrector", HalfCorrector)
    return made


def held_out(own: ForecastData, folds) -> HoldOut:
    return HoldOut.from_folds("s", "t", own.table, own, np.asarray(folds))


def tasks_of(method, own: ForecastData, folds, simulation="physics"):
    hold_out = held_out(own, folds)
    return list(ModelSpec("m", "", method, simulation).tasks(4, hold_out, hold_out.splits, 0))


class TestPowerModels:
    def test_a_corrector_adds_to_the_simulation(self, learner) -> None:
        """Trained on trips 0 and 2: residuals of 0, 2 and 8 W, mean 10 / 3."""
        predict = PowerMethod("x").fit(data(2, 2, 1), np.array([0, 2]), 0).predict
        assert learner[0].seen.trip_ids == ("t0", "t2")
        assert predict(np.array([1])) == pytest.approx([2 * 0.5 * (100.0 + 10 / 3)], **EXACT)

    def test_without_physics_the_power_itself_is_learned(self, learner) -> None:
        predict = DataMethod("x").fit(data(2, 2, 1), np.array([0, 2]), 0).predict
        own = learner[0].model
        assert own.columns["seen"].tolist() == [0.0, 1.0, 4.0]
        assert own.target.tolist() == [100.0, 102.0, 108.0]
        assert own.groups.tolist() == [0, 0, 2]
        half = 0.5 * 310.0 / 3.0
        assert predict(np.array([1])) == pytest.approx([2 * 0.5 * half], **EXACT)
        assert predict(np.array([1, 2])) == pytest.approx([half, 0.5 * half], **EXACT)

    def test_folds_of_a_task(self, monkeypatch) -> None:
        """Twelve folds in a task; all of them where the learner gives them at once."""
        own, folds = data(*[1] * 30), np.arange(30)
        tasks = tasks_of(PowerMethod("linear"), own, folds)
        assert [len(t.splits) for t in tasks] == [12, 12, 6]
        assert [split.number for t in tasks for split in t.splits] == list(range(30))
        assert {t.rank[0] for t in tasks} == {3}
        assert {t.comparison for t in tasks} == {4}
        monkeypatch.setattr(forecast_models, "power_corrector", lambda name, seed: HalfCorrector())
        monkeypatch.setattr(forecast_models, "LearnerCorrector", HalfCorrector)
        (whole,) = tasks_of(PowerMethod("x"), own, folds)
        assert [split.number for split in whole.splits] == list(range(30))
        assert whole.rank[0] == 0
        assert list(ModelSpec("m", "", PowerMethod("x")).tasks(4, held_out(own, folds), [], 0)) == []

    @pytest.mark.parametrize("simulation", ["physics", None])
    def test_all_folds_at_once(self, learner, simulation) -> None:
        """Rows of the stub are 1000 for the fold, 10 for the trip, and their target; half an hour each."""
        method = PowerMethod("x") if simulation else DataMethod("x")
        (task,) = tasks_of(method, data(2, 1, 1), [0, 1, 0], simulation)
        first, second = task.run()
        start = 0.0 if simulation is None else 100.0
        target = [100.0, 102.0, 104.0, 106.0] if simulation is None else [0.0, 2.0, 4.0, 6.0]
        expected = [0.5 * (2 * start + target[0] + target[1]), 0.5 * (start + 20.0 + target[3])]
        assert first.predicted_wh == pytest.approx(expected, **EXACT)
        assert second.predicted_wh == pytest.approx([0.5 * (start + 1000.0 + 10.0 + target[2])], **EXACT)
        assert (first.model, first.split.number, second.split.number) == ("m", 0, 1)
        assert 0.0 <= first.fit_s < 10.0
        assert 0.0 <= first.predict_ms < 10_000.0

    def test_a_fold_outside_of_the_others_keeps_nothing_of_the_correction(self, learner) -> None:
        """Trip 1 at 20 m/s lies within the others; these, at 10 and 40 m/s, are ten and more sd away from it."""
        own = data(2, 1, 1)
        rows = own.segments.features.assign(speed_m_s=[10.0, 10.0, 20.0, 40.0])
        own = dataclasses.replace(own, segments=dataclasses.replace(own.segments, features=rows))
        (task,) = tasks_of(PowerMethod("x"), own, [0, 1, 0])
        first, second = task.run()
        assert first.predicted_wh == pytest.approx([0.5 * 200.0, 0.5 * 100.0], **EXACT)
        assert second.predicted_wh == pytest.approx([0.5 * (100.0 + 1000.0 + 10.0 + 4.0)], **EXACT)

    def test_one_fold_after_the_other_where_a_trip_is_for_training_alone(self, learner) -> None:
        (task,) = tasks_of(PowerMethod("x"), data(2, 1, 1), [0, 1, -1])
        assert task.folds is None
        first, second = task.run()
        # trained on trips 1 and 2, residuals 4 and 6 W; then on 0 and 2, residuals 0, 2 and 6 W
        assert first.predicted_wh == pytest.approx([0.5 * 2 * 105.0], **EXACT)
        assert second.predicted_wh == pytest.approx([0.5 * (100.0 + 8 / 3)], **EXACT)
        assert (first.split.number, second.split.number) == (0, 1)
        assert 0.0 <= first.fit_s < 10.0
        assert 0.0 <= first.predict_ms < 10_000.0


class Told:
    """A forecast of 100 Wh over 1000 m in 100 s whose updates add 1000 Wh for each measured column and keep the rows."""

    energy_wh, sd_wh, flags = 100.0, 10.0, ("one", "two")
    soc_arrival = 0.4

    def __init__(self, energy_wh=100.0) -> None:
        self.energy_wh = energy_wh
        scores = SimpleNamespace(factor=lambda level: 4.0 * level)
        self.uncertainty = SimpleNamespace(scores=scores)
        self.by_cause_wh = {"air": 60.0, "hvac": 40.0}
        self.told: list[pd.DataFrame] = []

    def series(self):
        return pd.DataFrame(
            {
                "time_s": [0.0, 50.0, 100.0],
                "energy_wh": [0.0, 30.0, 100.0],
                "distance_m": [0.0, 400.0, 1000.0],
            }
        )

    def interval(self, level):
        return self.energy_wh - 10.0 * level, self.energy_wh + 20.0 * level

    def soc_interval(self, level):
        return 0.4 - 0.1 * level, 0.4 + 0.2 * level

    def p_arrive(self, reserve):
        return 1.0 - reserve

    def probability_below(self, energy):
        return energy / 1000.0

    def update_since_departure(self, observed):
        self.told.append(observed)
        return Told(1000.0 * len(observed.columns))


def driven_log(**columns) -> pd.DataFrame:
    time = np.array([0.0, 10.0, 20.0, 25.0, 60.0, 110.0])
    return pd.DataFrame(
        {"time_s": time, "observed_energy_wh": 2.0 * time, "distance_m": 5.0 * time, **columns}
    )


class TestReforecast:
    def test_after_a_quarter(self) -> None:
        """25 s: 50 Wh measured where 15 Wh were planned; 125 of 1000 m."""
        forecast = Told()
        log = driven_log(soc=[0.5, NO, NO, NO, 0.4, 0.3], displayed_soc=NO, heating_power_w=1.0)
        found = dict(zip(UPDATES, reforecast(forecast, log, 0.25), strict=True))
        assert found["update"] == 3000.0
        assert found["soc_only"] == 2000.0
        assert found["no_update"] == pytest.approx(50.0 + 100.0 - 15.0, **EXACT)
        assert found["naive_gauge"] == pytest.approx(400.0, **EXACT)
        assert found["update_low"] == pytest.approx(3000.0 - 9.0, **EXACT)
        assert found["update_high"] == pytest.approx(3000.0 + 18.0, **EXACT)
        energy, charge = forecast.told
        assert list(energy.columns) == ["time_s", "observed_energy_wh", "heating_power_w"]
        assert list(charge.columns) == ["time_s", "soc"]
        assert energy["time_s"].tolist() == [0.0, 10.0, 20.0, 25.0]

    def test_without_charge_or_motion(self) -> None:
        log = driven_log(soc=[NO, NO, NO, NO, 0.4, 0.3]).assign(distance_m=0.0)
        found = dict(zip(UPDATES, reforecast(Told(), log, 0.25), strict=True))
        assert np.isnan(found["soc_only"])
        assert found["naive_gauge"] == 100.0

    def test_before_the_second_sample(self) -> None:
        found = reforecast(Told(), driven_log(), 0.09)
        assert found == pytest.approx([100.0, NO, 100.0, 100.0, 91.0, 118.0], nan_ok=True, **EXACT)
        assert reforecast(Told(), driven_log(), 0.10)[0] == 2000.0


def test_what_is_kept_of_forecasts(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = np.full((2, 3), NO), np.full((2, 13), NO)
    monkeypatch.setattr(held_out_forecasts, "arrivals_of", lambda model, plan: nothing)
    logs = [driven_log(displayed_soc=[0.8, 0.7, 0.6, 0.5, 0.45, NO]), driven_log()]
    kept = HeldOutForecasts.from_forecasts(None, ["plan"] * 2, [Told(), Told(200.0)], logs)
    levels = (np.arange(100) + 0.5) / 100
    assert kept.factors == pytest.approx(np.array([4.0 * levels] * 2), **EXACT)
    assert kept.low_wh[1] == pytest.approx([200.0 - 10.0 * level for level in LEVELS], **EXACT)
    assert kept.high_wh[0] == pytest.approx([100.0 + 20.0 * level for level in LEVELS], **EXACT)
    assert kept.pit == pytest.approx([0.22, 0.22], **EXACT)  # of 220 Wh at the end of the log
    assert kept.flags.tolist() == [2, 2]
    assert kept.sd_wh.tolist() == [10.0, 10.0]
    assert kept.cause_names.tolist() == ["air", "hvac"]
    assert kept.causes_wh.tolist() == [[60.0, 40.0]] * 2
    assert kept.updates_wh.shape == (2, len(FRACTIONS), len(UPDATES))
    assert kept.updates_wh[0, 1, 0] == 2000.0
    assert kept.shown == pytest.approx([0.45, NO], nan_ok=True)
    assert kept.arrival.shape == (2, 2, 3)
    assert kept.arrival_chance.shape == (2, 2, 13)
    assert kept.series_rows.tolist() == [3, 3]
    assert kept.series[:, 1].tolist() == [0.0, 30.0, 100.0] * 2
    assert kept.series_names.tolist() == ["time_s", "energy_wh", "distance_m"]


def test_arrivals_from_each_charge(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the display and from the battery management alone; nothing where one is not known."""
    monkeypatch.setattr(held_out_forecasts, "p_above", lambda told, charge: told.p_arrive(charge))
    seen = []

    class Model:
        def forecast(self, plan):
            seen.append((plan.departure.soc, plan.departure.bms_soc))
            return Told()

    samples = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": 1.0})
    (both, chance), (one, none) = (
        arrivals_of(Model(), Plan.from_samples(name, samples, departure))
        for name, departure in (("a", Departure(soc=0.8, bms_soc=0.7)), ("b", Departure(bms_soc=0.6)))
    )
    assert seen == [(0.8, None), (None, 0.7), (None, 0.6)]
    known = [0.4, 0.4 - 0.09, 0.4 + 0.18]
    assert both == pytest.approx(np.array([known, known]), **EXACT)
    assert np.isnan(one[0]).all()
    assert one[1] == pytest.approx(known, **EXACT)
    offsets = np.round(np.arange(-6, 7) * 0.01, 2)
    assert chance.shape == (2, 13)
    assert chance[0] == pytest.approx(1.0 - (0.4 + offsets), **EXACT)
    assert np.isnan(none[0]).all()


def test_the_fold_of_a_forecast_is_held_out(monkeypatch) -> None:
    seen = {}

    class Model:
        def __init__(self, vehicle, corrector, seed) -> None:
            seen.update(vehicle=vehicle, corrector=corrector, seed=seed)

        def fit_segments(self, own, *, again) -> None:
            seen["trained"] = own.trip_ids
            seen["again"] = again(np.array([0])).trip_ids

        def forecast(self, plan):
            return Told(100.0 + len(plan))

    nothing = np.full((2, 3), NO), np.full((2, 13), NO)
    monkeypatch.setattr(forecast_models, "ForecastModel", Model)
    monkeypatch.setattr(held_out_forecasts, "arrivals_of", lambda model, plan: nothing)
    monkeypatch.setattr(
        ForecastData, "identified", lambda own, train: (f"car of {train.tolist()}", own.segments)
    )
    own = dataclasses.replace(data(1, 1, 1), logs=(driven_log(),) * 3)
    hold_out = held_out(own, [5, 6, 5])
    tasks = list(
        ModelSpec("f", "", ForecastMethod("split"), "physics").tasks(3, hold_out, hold_out.splits, 9)
    )
    assert [[len(log) > 0 for log in t.data.logs] for t in tasks] == [
        [True, False, True],
        [False, True, False],
    ]
    assert [[split.number for split in t.splits] for t in tasks] == [[5], [6]]
    assert tasks[0].rank[0] == 1
    assert tasks[0].comparison == 3
    (result,) = tasks[0].run()
    assert seen.pop("again") == ("t1",), "the inner folds have no other trips"
    assert seen == {"vehicle": "car of [1]", "corrector": "split", "seed": 9, "trained": ("t1",)}
    assert result.predicted_wh.tolist() == [106.0, 106.0]
    assert (result.model, result.split.number) == ("f", 5)
    assert result.forecasts.pit.tolist() == [0.22, 0.22]
    assert 0.0 <= result.fit_s < 10.0
    assert 0.0 <= result.predict_ms < 10_000.0


def fold(trips, values, model=FORECAST, forecasts=None) -> FoldResult:
    split = Split(0, np.empty(0, np.int64), np.asarray(trips))
    return FoldResult(model, split, np.asarray(values, dtype=float), 0.0, 0.0, forecasts=forecasts)


def kept(k: float, series=((0.0, 0.0), (10.0, 50.0)), rows=(2,)) -> HeldOutForecasts:
    """Forecasts of some trips whose values are those of one trip and `k`; the second column of the series has `k` more."""
    n, series = len(rows), np.array(series)
    return HeldOutForecasts(
        sd_wh=np.full(n, 10.0 + k),
        low_wh=np.tile([1.0 + k, 2.0 + k, 3.0 + k, 4.0 + k], (n, 1)),
        high_wh=np.tile([5.0 + k, 6.0 + k, 7.0 + k, 8.0 + k], (n, 1)),
        factors=np.tile([1.0, 3.0], (n, 1)),
        pit=np.full(n, 0.1 * k),
        flags=np.full(n, k, dtype=int),
        causes_wh=np.tile([1.0 + k, 2.0 + k], (n, 1)),
        cause_names=np.array(["air", "hvac"]),
        updates_wh=np.tile(1000.0 * k + np.arange(24.0).reshape(1, 4, 6), (n, 1, 1)),
        shown=np.full(n, 0.2 + k),
        arrival=np.full((n, 2, 3), 0.3 + k),
        arrival_chance=np.full((n, 2, 13), 0.4 + k),
        series=series + np.array([0.0, k]),
        series_names=np.array(["time_s", "energy_wh"]),
        series_rows=np.array(rows),
    )


class TestResults:
    def test_folds_in_the_order_of_the_trips(self) -> None:
        """Trips 0 and 2 are in one fold, 1 and 4 in the other; trip 3 is for training alone."""
        table = SimpleNamespace(offsets=np.arange(6))
        results = (fold([1, 4], [2.0, 5.0]), fold([0, 2], [1.0, 3.0]))
        comparison = Comparison(SimpleNamespace(table=table), (), results)
        assert comparison.energies_wh(FORECAST).tolist() == [1.0, 2.0, 3.0, 5.0]
        assert comparison.forecasts(FORECAST) is None

    def test_forecasts_in_the_order_of_the_trips(self) -> None:
        """Trips of one and of two rows of the series, given in another order."""
        first = kept(0.0, [(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)], (1, 2))
        results = (fold([0, 2], [0.0, 0.0], forecasts=first), fold([1], [0.0], forecasts=kept(1.0)))
        joined = Comparison(None, (), results).forecasts(FORECAST)
        assert joined.sd_wh.tolist() == [10.0, 11.0, 10.0]
        assert joined.series_rows.tolist() == [1, 2, 2]
        assert [piece[:, 0].tolist() for piece in joined.pieces()] == [[1.0], [0.0, 10.0], [2.0, 3.0]]

    def test_insight(self) -> None:
        """Two folds of a trip each, given in the wrong order."""
        samples = pd.DataFrame({"time_s": [0.0, 10.0], "speed_m_s": 10.0, "elevation_m": [500.0, 507.0]})
        plans = [Plan.from_samples(name, samples, Departure(ambient_temperature_degc=-3.0)) for name in "ab"]
        trips = [SimpleNamespace(context=Context(driver=name)) for name in "xy"]
        own = SimpleNamespace(plans=plans, logs=("log a", "log b"), table=SimpleNamespace(trips=trips))
        hold_out = SimpleNamespace(table=Trips("ab"), scored=np.array([0, 1]), data=own)
        results = (
            fold([1], [200.0], forecasts=kept(1.0)),
            fold([0], [100.0], forecasts=kept(0.0)),
            fold([0], [9.0], model="other"),
        )
        part = pd.DataFrame(
            {
                "trip": ["a", "b"],
                "observed_energy_wh": [110.0, 190.0],
                "predicted_energy_wh": [100.0, 200.0],
            }
        )
        comparison = Comparison(hold_out, (), results)
        found = forecast_insight(hold_out, comparison.forecasts(FORECAST), part)
        rows = found.trips
        assert rows["trip"].tolist() == ["a", "b"]
        assert rows["sd_wh"].tolist() == [10.0, 11.0]
        assert rows["low_50"].tolist() == [1.0, 2.0]
        assert rows["high_95"].tolist() == [8.0, 9.0]
        assert rows["update_10"].tolist() == [0.0, 1000.0]
        assert rows["soc_only_25"].tolist() == [7.0, 1007.0]
        assert rows["update_high_75"].tolist() == [23.0, 1023.0]
        assert rows["flags"].tolist() == [0, 1]
        assert rows["net_climb_m"].tolist() == [7.0, 7.0]
        assert rows["driver"].tolist() == ["x", "y"]
        assert found.causes.loc["b"].tolist() == [2.0, 3.0]
        assert found.series["a"]["energy_wh"].tolist() == [0.0, 50.0]
        assert found.series["b"]["energy_wh"].tolist() == [1.0, 51.0]
        assert found.logs == {"a": "log a", "b": "log b"}
        assert comparison.forecasts("other") is None
        assert comparison.forecasts("third") is None

    def test_measured_beside_the_forecast(self) -> None:
        """100 m in 10 s, then 60 m in 20 s; the last speed is none."""
        series = pd.DataFrame(
            {"time_s": [0.0, 10.0, 30.0], "distance_m": [0.0, 100.0, 160.0], "energy_wh": [0.0, 5.0, 9.0]}
        )
        log = pd.DataFrame({"time_s": [0.0, 20.0, 40.0], "observed_energy_wh": [0.0, 8.0, 12.0]})
        frame = measured_beside(ForecastInsight(pd.DataFrame(), pd.DataFrame(), {"a": series}, {"a": log}))[
            "a"
        ]
        assert frame["speed_m_s"].tolist() == [10.0, 3.0, 0.0]
        assert frame["observed_energy_wh"].tolist() == [0.0, 4.0, 10.0]
        assert frame[FORECAST].tolist() == [0.0, 5.0, 9.0]

    def test_about_trips(self) -> None:
        samples = pd.DataFrame({"time_s": [0.0, 10.0], "speed_m_s": 10.0})
        known = Departure(battery_temperature_degc=4.0)
        plans = [
            Plan.from_samples("a", samples.assign(elevation_m=[9.0, 4.0]), known),
            Plan.from_samples("b", samples),
        ]
        trips = [SimpleNamespace(context=Context(driver=name)) for name in ("x", None)]
        own = SimpleNamespace(plans=plans, table=SimpleNamespace(trips=trips))
        rows = about_trips(own, np.array([1, 0]))
        assert rows["trip"].tolist() == ["b", "a"]
        assert rows["net_climb_m"].tolist() == pytest.approx([NO, -5.0], nan_ok=True)
        assert rows["battery_temperature_degc"].tolist() == pytest.approx([NO, 4.0], nan_ok=True)
        assert rows["ambient_temperature_degc"].isna().all()
        assert rows["distance_m"].tolist() == [plans[1].distance_m, plans[0].distance_m]
        assert rows["duration_s"].tolist() == [plans[1].duration_s, plans[0].duration_s]

    def test_scores_belong_to_the_forecast(self, monkeypatch) -> None:
        part = pd.DataFrame({"observed_energy_wh": [10.0, 20.0], "predicted_energy_wh": [11.0, 22.0]})
        seen = {}
        for name in ("arrival_scores", "coverage_scores", "crps_scores", "update_scores"):
            monkeypatch.setattr(
                forecast_results,
                name,
                lambda *given, name=name: seen.setdefault(name, given) and {name: 1},
            )
        own = HeldOutForecasts.joined([kept(0.0), kept(1.0)], np.array([0, 1]))
        found = forecast_scores(own, part, 7)
        plain = {
            name: [v if isinstance(v, int) else v.tolist() for v in given] for name, given in seen.items()
        }
        rows = {name: values.tolist() for name, values in vars(own).items()}
        assert plain["arrival_scores"] == [rows["shown"], rows["arrival"], rows["arrival_chance"], 7]
        assert plain["coverage_scores"] == [[10.0, 20.0], rows["low_wh"], rows["high_wh"], 7]
        assert plain["crps_scores"] == [[10.0, 20.0], [11.0, 22.0], rows["sd_wh"], rows["factors"]]
        assert plain["update_scores"] == [[10.0, 20.0], rows["updates_wh"], 7]
        assert set(found) == {"arrival", "coverage_scores", "crps_scores", "update"}

    def test_strata_compare_with_the_model_without_physics(self, monkeypatch) -> None:
        errors = {FORECAST: np.array([0.1, 0.2]), WITHOUT_PHYSICS: np.array([0.3, 0.4])}
        monkeypatch.setattr(forecast_results, "strata_of", lambda about: "kinds")
        monkeypatch.setattr(forecast_results, "strata_scores", lambda *given: [given])
        monkeypatch.setattr(forecast_results, "about_trips", lambda data, members: None)

        def strata_with(*names):
            specs = [SimpleNamespace(name=name) for name in names]
            hold_out = SimpleNamespace(data=None, scored=None)
            return strata(SimpleNamespace(specs=specs, ape=errors.__getitem__, hold_out=hold_out), 5)

        ((kinds, own, other, seed),) = strata_with(FORECAST, WITHOUT_PHYSICS)
        assert (kinds, own.tolist(), other.tolist(), seed) == ("kinds", [0.1, 0.2], [0.3, 0.4], 5)
        assert strata_with(WITHOUT_PHYSICS) == []
        assert strata_with(FORECAST)[0][2] is None
