"""The models of the forecast protocol, on stand-ins whose energies are known."""

import dataclasses

import numpy as np
import pytest
from tests.support.held_out import EXACT, data

from tripwatt.learners.folds import leave_one_out
from tripwatt.study.evaluation import forecast_models
from tripwatt.study.evaluation.forecast_data import ForecastData
from tripwatt.study.evaluation.forecast_models import DataMethod, PowerMethod
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.tasks import ModelSpec


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
    return HoldOut("s", "t", own.table, own, leave_one_out(np.asarray(folds)))


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

    def test_stages_are_identified_without_the_recorded_trips(self) -> None:
        own = dataclasses.replace(data(1, 1), trips=("a recorded trip", "another"))
        sent = PowerMethod(None, identified=True).required_data(held_out(own, [0, 1]), np.array([0]))
        assert (sent.trips, sent.logs, sent.plans, sent.stages) == ((), (), own.plans, own.stages)

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
