"""Scores and rules of the transfer's evaluation, each number of them by hand."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tripwatt.errors import InvalidInput
from tripwatt.evaluation import transfer
from tripwatt.evaluation.comparison import Comparison
from tripwatt.evaluation.folds import Execution, run_folds
from tripwatt.evaluation.hold_outs import HoldOut, Split
from tripwatt.evaluation.metrics import bootstrap_interval, leaves_out_zero, paired_difference
from tripwatt.evaluation.results import _plain
from tripwatt.evaluation.tasks import FoldResult, Task
from tripwatt.evaluation.transfer import _bars, _by_car, _Car, _check, _forecasts, _paired, _period, _require
from tripwatt.evaluation.transfer_scores import curve_row, paired_energy_error, resamples, scored
from tripwatt.hybrid import SegmentTable
from tripwatt.trips import Context, Fleet, Trip

EXACT = {"rel": 1e-9, "abs": 1e-12}
EACH = np.array([[0, 0], [1, 1], [0, 1], [0, 1]])
"""Of two trips the first twice, the second twice, and both, twice."""


def of_quantiles(values):
    return [float(np.quantile(values, q)) for q in (0.025, 0.975)]


def test_resamples_draw_as_many_trips_as_there_are():
    found = resamples(3, 7)
    np.testing.assert_array_equal(found, np.random.default_rng((7, 3)).integers(0, 3, size=(4000, 3)))
    assert resamples(3, 7, 5).shape == (5, 3)


def test_error_and_bias_with_their_intervals():
    found = scored(np.array([1000.0, 3000.0]), np.array([1200.0, 2700.0]), EACH)
    assert found["error"] == pytest.approx(500.0 / 4000.0, **EXACT)
    assert found["bias"] == pytest.approx(-100.0 / 4000.0, **EXACT)
    assert found["error_ci95"] == pytest.approx(of_quantiles([0.2, 0.1, 0.125, 0.125]), **EXACT)
    assert found["bias_ci95"] == pytest.approx(of_quantiles([0.2, -0.1, -0.025, -0.025]), **EXACT)


def test_a_paired_error_is_that_of_the_first_less_that_of_the_second():
    observed, index = np.array([1000.0, 3000.0]), EACH
    found = paired_energy_error(observed, np.array([1100.0, 2900.0]), np.array([700.0, 3400.0]), index)
    assert found["diff"] == pytest.approx((-200.0 - 300.0) / 4000.0, **EXACT)
    assert found["diff_ci95"] == pytest.approx(of_quantiles([-0.2, -0.1, -0.125, -0.125]), **EXACT)
    assert found["significant"]
    other = paired_energy_error(observed, np.array([1100.0, 2900.0]), np.array([1300.0, 3050.0]), index)
    assert other["diff"] == pytest.approx((-200.0 + 50.0) / 4000.0, **EXACT)
    assert not other["significant"]
    worse = paired_energy_error(observed, np.array([700.0, 3400.0]), np.array([1100.0, 2900.0]), index)
    assert worse["significant"]
    same = paired_energy_error(observed, observed, observed, index)
    assert (same["diff"], same["significant"]) == (0.0, False)


def test_a_row_of_the_curve_by_hand():
    """Two draws; the second misses by 300 and 100 Wh with a deviation of 200 Wh, 1.645 of which are 329 Wh."""
    observed, simulated = np.array([1000.0, 3000.0]), np.array([900.0, 3100.0])
    mean = np.array([[100.0, -600.0], [400.0, 0.0]])
    forecast = SimpleNamespace(mean_wh=mean, sd_wh=np.full((2, 2), 200.0), share=np.array([0.2, 0.6]))
    row = curve_row(5, forecast, simulated, observed, EACH, 3)
    assert (row["k"], row["draws"]) == (5, 2)
    assert row["error"] == pytest.approx((500.0 + 400.0) / 2 / 4000.0, **EXACT)
    assert row["bias"] == pytest.approx((-500.0 + 400.0) / 2 / 4000.0, **EXACT)
    assert row["error_of_draws"] == pytest.approx(
        [0.1 + 0.025 * 0.025, 0.1125, 0.125 - 0.025 * 0.025], **EXACT
    )
    assert row["share_in_common"] == pytest.approx(0.4, **EXACT)
    assert row["inside_90"] == 0.75
    drawn = np.random.default_rng((3, 1, 5)).integers(0, 2, size=4)
    miss = np.array([[0.0, 500.0], [300.0, 100.0]])
    both = [miss[d, i].sum() / observed[i].sum() for d, i in zip(drawn, EACH, strict=True)]
    assert row["error_ci95"] == pytest.approx(of_quantiles(both), **EXACT)


@pytest.mark.parametrize(("sd_wh", "inside"), [(60.80, 1.0), (60.79, 0.0)])
def test_the_central_nine_tenths_are_1_645_standard_deviations(sd_wh, inside):
    """Of 60.796 Wh they are 100 Wh."""
    assert stats.norm.ppf(0.95) * 60.796 == pytest.approx(100.0, abs=1e-3)
    forecast = SimpleNamespace(mean_wh=np.array([[100.0]]), sd_wh=np.array([[sd_wh]]), share=np.array([0.5]))
    one = np.array([1000.0])
    assert curve_row(1, forecast, one, one, np.array([[0]]), 0)["inside_90"] == inside


def test_what_a_transfer_is_asked_for():
    _check((0,), 1, 0.0)
    for trips, draws, distance_m, what in (
        ((), 1, 0.0, "trips"),
        ((3, -1), 1, 0.0, "trips"),
        ((1,), 0, 0.0, "draws"),
        ((1,), 1, -1.0, "min_distance_m"),
        ((1,), 1, np.nan, "min_distance_m"),
    ):
        with pytest.raises(InvalidInput) as caught:
            _check(trips, draws, distance_m)
        assert [fault.where for fault in caught.value.faults] == [what]


def test_the_usual_questions():
    """None, one, and up to the fifty trips of some weeks, 200 draws of each, of trips of two kilometres or more."""
    assert transfer.TRIPS == (0, 1, 2, 5, 10, 20, 50)
    assert (transfer.DRAWS, transfer.MIN_DISTANCE_M, transfer.MIN_CAR_TRIPS) == (200, 2000.0, 4)
    assert transfer.MAIN_MODE == "both"


def drive(name, metres=2000.0, car=None, day=None, energy=True):
    speed = metres / 200.0
    columns = {"time_s": [0.0, 200.0], "speed_m_s": [speed, speed]}
    if energy:
        columns |= {"voltage_v": [360.0, 360.0], "current_a": [10.0, 10.0]}
    at = None if day is None else pd.Timestamp(2026, 5, day).to_pydatetime()
    return Trip.from_samples(name, pd.DataFrame(columns), Context(car=car, started_at=at))


def names(cars):
    return {name: [trip.trip_id for trip in own] for name, own in cars.items()}


def test_trips_are_those_of_a_car_in_the_order_of_time():
    trips = [
        drive("A", car="x", day=2),
        drive("B", car="y", day=5),
        drive("C", car="y", day=3),
        drive("short", 1990.0, car="y", day=1),
        drive("unmeasured", car="y", day=1, energy=False),
        drive("D", car="w", day=9),
    ]
    cars, notes = _by_car(trips, 2000.0)
    assert names(cars) == {"y": ["C", "B"], "w": ["D"], "x": ["A"]}
    assert list(cars) == ["y", "w", "x"]
    assert notes == ["2 trips of less than 2 km were left out"]


def test_trips_without_a_date_keep_their_order():
    cars, notes = _by_car([drive("B", day=5), drive("A", day=1), drive("C")], 0.0)
    assert names(cars) == {"": ["B", "A", "C"]}
    assert notes == ["no dates: the order of the log counts as that of time"]
    _, notes = _by_car([drive("A", car="x"), drive("B", 10.0, car="x")], 2000.0)
    assert notes[0] == "1 trips of less than 2 km were left out"
    assert notes[1] == "no dates of car x: the order of the log counts as that of time"


def test_a_transfer_needs_trips_to_learn_from_and_four_to_score(monkeypatch):
    fleet = Fleet("f", (drive("A"), drive("B")))
    monkeypatch.setattr(transfer, "MIN_TRIPS", 5)

    def lacks(learned, by_car):
        try:
            _require(learned, fleet, by_car, fleet, 2500.0)
        except InvalidInput as error:
            return [(fault.what, fault.got) for fault in error.faults]
        return []

    four = {"x": [drive("A")] * 4, "y": [drive("A")]}
    assert lacks(5, four) == []
    assert lacks(4, four) == [("too few trips to train on", "4 of 2 after the audit")]
    words = "3 of 2 after the audit, of at least 2.5 km"
    assert lacks(5, {"x": [drive("A")] * 3, "y": [drive("A")]}) == [("too few trips to score", words)]
    assert lacks(5, {})[0][1].startswith("0 of 2")


def table(n_trips):
    n = 2 * n_trips
    return SegmentTable(
        tuple(f"T{k}" for k in range(n_trips)),
        np.arange(0, n + 1, 2),
        pd.DataFrame(index=range(n)),
        np.full(n, 0.5),
        1000.0 + 100.0 * np.arange(n),
        2000.0 + 100.0 * np.arange(n),
    )


def car(n_trips, first, days=()):
    trips = tuple(drive(f"T{k}", day=days[k] if k < len(days) else None) for k in range(n_trips))
    order = np.arange(n_trips)
    prepared = SimpleNamespace(segments=table(n_trips))
    return _Car("x", trips, prepared, np.zeros((2 * n_trips, 1)), order[:first], order[first:])


def test_energies_are_those_of_the_second_half():
    half = car(4, 2)
    # two segments of half an hour each
    assert half.observed_wh.tolist() == [0.5 * (2400.0 + 2500.0), 0.5 * (2600.0 + 2700.0)]
    assert half.energies(np.full(8, 50.0)).tolist() == [0.5 * (1450.0 + 1550.0), 0.5 * (1650.0 + 1750.0)]


@pytest.mark.parametrize(("n_trips", "first"), [(3, 0), (4, 2), (5, 2), (6, 3)])
def test_four_trips_are_cut_into_halves(monkeypatch, n_trips, first):
    monkeypatch.setattr(
        transfer.ForecastData, "from_trips", lambda trips, vehicle: SimpleNamespace(plans=(), segments=None)
    )
    monkeypatch.setattr(transfer, "sensitivities", lambda *_: np.zeros(0))
    found = transfer._car("x", [drive("A")] * n_trips, None)
    assert found.first.tolist() == list(range(first))
    assert found.second.tolist() == list(range(first, n_trips))


class Drawn:
    """A transfer that remembers which trips were drawn."""

    def predict_draws(self, evidence, chosen, asked):
        assert asked.tolist() == [6, 7, 8, 9, 10, 11]
        return chosen


def test_draws_of_the_first_half():
    drawn = _forecasts(Drawn(), None, car(12, 6), (0, 2, 6, 50), 7, 3)
    assert [trips for trips, _ in drawn] == [0, 2, 6]
    found = dict(drawn)
    assert [chosen.shape for chosen in found.values()] == [(1, 0), (7, 2), (1, 6)]
    rng = np.random.default_rng((3, 2))
    np.testing.assert_array_equal(found[2], [rng.permutation(np.arange(6))[:2] for _ in range(7)])
    assert sorted(found[6][0]) == list(range(6))


def test_without_a_first_half_nothing_is_drawn():
    class Nothing:
        def predict_draws(self, evidence, chosen, asked):
            return chosen.shape

    assert _forecasts(Nothing(), None, car(3, 0), (0, 2), 7, 3) == [(0, (1, 0))]


def test_the_period_of_trips_with_dates():
    dated = car(4, 2, days=(9, 3))
    assert _period(dated, np.array([0, 1, 2])) == ["2026-05-03", "2026-05-09"]
    assert _period(dated, np.array([2, 3])) is None


OBSERVED = np.array([1000.0, 3000.0])
MODELS = {
    "physics": np.array([1300.0, 3300.0]),
    "zero-shot": np.array([1100.0, 3100.0]),
    "boosting-as-is": np.array([1000.0, 3000.0]),
    "own-channels": np.array([1100.0, 3100.0]),
}


def test_differences_that_matter():
    pairs = _paired(MODELS, OBSERVED, EACH)
    assert [(p["a"], p["b"]) for p in pairs] == [
        ("zero-shot", "physics"),
        ("zero-shot", "boosting-as-is"),
        ("zero-shot", "own-channels"),
    ]
    assert [p["diff"] for p in pairs] == pytest.approx([-0.1, 0.05, 0.0], **EXACT)


def bars(ten, own, zero_shot=MODELS["zero-shot"], k=10):
    curve = [{"k": 0, "error": 9.0}, {"k": k, "error": ten}]
    scores = {"own-channels": {"error": own}, "own-kriging": {"error": 2.0 * own}, "physics": {"error": 0.01}}
    return _bars(scores, curve, {**MODELS, "zero-shot": zero_shot}, OBSERVED, EACH)


def test_the_questions_of_a_transfer():
    found = bars(0.114, 0.1)["ten_trips_within_15_percent_of_own"]
    assert (found["met"], found["error"], found["own_error"]) == (True, 0.114, 0.1)
    assert found["ratio"] == pytest.approx(1.14, **EXACT)
    assert not bars(0.116, 0.1)["ten_trips_within_15_percent_of_own"]["met"]
    assert "ten_trips_within_15_percent_of_own" not in bars(0.1, 0.1, k=11)
    none = _bars({}, [{"k": 10, "error": 0.1}], MODELS, OBSERVED, EACH)
    assert list(none) == ["zero_shot_better_than_physics"]
    better = none["zero_shot_better_than_physics"]
    assert (better["met"], better["diff"]) == (True, pytest.approx(-0.1))
    assert not bars(0.1, 0.1, np.array([1400.0, 3400.0]))["zero_shot_better_than_physics"]["met"]
    assert not bars(0.1, 0.1, MODELS["physics"])["zero_shot_better_than_physics"]["met"]
    mixed = bars(0.1, 0.1, np.array([1000.0, 3350.0]))["zero_shot_better_than_physics"]
    assert mixed["diff"] < 0.0
    assert not mixed["met"]


def test_progress_counts_the_cars(monkeypatch):
    """One step to learn, and one for each car."""
    trips = tuple(drive(f"T{k}", car="xy"[k % 2]) for k in range(8))
    fleet = Fleet("f", trips)
    sound = SimpleNamespace(trips=trips, findings=())
    asked = []

    def evaluate_car(car, origin, vehicle, k, draws, seed):
        asked.append((car, k, draws, seed))
        return {"car": car}, [{"car": car}]

    monkeypatch.setattr(transfer, "audit", lambda fleet: sound)
    monkeypatch.setattr(transfer, "MIN_TRIPS", 8)
    monkeypatch.setattr(transfer, "unknown_inputs", lambda trips: ("soc",) if len(trips) == 8 else ())
    monkeypatch.setattr(transfer, "_source", lambda *_: None)
    monkeypatch.setattr(transfer, "_car", lambda name, own, vehicle: name)
    monkeypatch.setattr(transfer, "_evaluate_car", evaluate_car)
    steps = []
    run = transfer.evaluate_transfer(
        fleet,
        fleet,
        trips=(5, 0, 5),
        draws=3,
        seed=4,
        progress=lambda done, steps_: steps.append((done, steps_)),
    )
    assert steps == [(1, 3), (2, 3), (3, 3)]
    assert asked == [("x", [0, 5], 3, 4), ("y", [0, 5], 3, 4)]
    assert (run.results["from"]["trips_used"], run.results["to"]["trips_used"]) == (8, 8)
    assert run.results["hidden"] == []
    assert (run.results["draws"], run.results["min_distance_m"]) == (3, 2000.0)
    assert run.trips["car"].tolist() == ["x", "y"]


def test_the_interval_of_a_mean_has_ten_thousand_draws_and_95_percent():
    values = np.array([0.1, 0.4, 0.25, 0.05, 0.3, 0.17, 0.02]) / 3.0
    expected = stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=10_000,
        confidence_level=0.95,
        method="percentile",
        rng=np.random.default_rng(5),
    ).confidence_interval
    assert bootstrap_interval(values, 5) == (round(expected.low, 12), round(expected.high, 12))
    assert bootstrap_interval(np.array([1.0 / 3.0]), 5) == (0.333333333333, 0.333333333333)


def test_an_interval_that_ends_at_zero_is_not_significant():
    cases = [(-0.2, -0.1), (-0.2, 0.0), (-0.1, 0.1), (0.0, 0.2), (0.1, 0.2)]
    assert [leaves_out_zero(ci, lambda _: (0.1, 0.2)) for ci in cases] == [True, False, False, False, True]


def test_an_interval_near_zero_has_to_leave_it_out_for_every_seed():
    asked = []

    def again(seed: int, crossing: int = 0) -> tuple[float, float]:
        asked.append(seed)
        return (-0.001, 0.1) if seed == crossing else (0.001, 0.1)

    assert leaves_out_zero((0.01, 0.1), again)  # further from 0 than a tenth of its width
    assert asked == []
    assert leaves_out_zero((0.009, 0.1), again)
    assert asked == list(range(1, 40))
    assert not leaves_out_zero((0.009, 0.1), lambda seed: again(seed, 39))
    assert not leaves_out_zero((-0.1, -0.009), lambda seed: again(seed, 1))
    difference = paired_difference(np.array([0.1, 0.2, 0.35]), np.array([0.1, 0.1, 0.1]), 3)
    assert difference.significant is (difference.ci95[0] > 0.0)


def test_a_summary_counts_trips_that_are_better_than_physics():
    """Two trips of 1000 and 2000 Wh, each predicted at two rows."""
    table = SimpleNamespace(
        observed_wh=np.array([0.0, 1000.0, 0.0, 2000.0]),
        offsets=np.array([0, 2, 4]),
        last_rows=np.array([1, 3]),
        trip_ids=("a", "b"),
        simulated=lambda name: np.zeros(4),
    )
    hold_out = SimpleNamespace(scheme="s", trips="t", scored=np.arange(2), table=table)
    energies = {"physics": [1100.0, 2100.0], "better": [1050.0, 2100.0]}
    specs = [SimpleNamespace(name=name, simulation=None) for name in energies]
    results = [
        FoldResult(name, Split(k, np.array([1 - k]), np.array([k])), np.array([5.0, wh]), 1.0 + k, 10.0 * k)
        for name, both in energies.items()
        for k, wh in enumerate(both)
    ]
    comparison = Comparison(hold_out, tuple(specs), tuple(results))
    found = comparison.summary(0)
    assert found["n_trips"] == 2
    assert found["models"]["physics"]["improved_share"] == {}
    assert found["models"]["better"]["improved_share"] == {"physics": 0.5}
    assert found["models"]["better"]["mape"] == pytest.approx(0.05, **EXACT)
    assert (found["models"]["better"]["fit_s"], found["models"]["better"]["predict_ms"]) == (1.5, 5.0)
    (pair,) = comparison.paired(0)
    assert (pair["a"], pair["b"]) == ("physics", "better")
    assert pair["diff"] == pytest.approx((0.05 + 0.0) / 2, **EXACT)
    assert comparison.frame["trip"].tolist() == ["a", "b", "a", "b"]


def test_results_hold_plain_numbers():
    assert _plain(np.float64(2.5)) == 2.5
    with pytest.raises(TypeError, match="results hold a set"):
        _plain({1})


class Folded:
    """A model whose prediction tells where it was made: in which comparison, in which fold, with which seed."""

    def __init__(self, name):
        self.name = name

    def tasks(self, comparison, hold_out, splits, seed):
        return [Part(comparison, self, None, (split,), seed) for split in splits]


class Part(Task):
    @property
    def rank(self):
        return (self.splits[0].number, 0)

    def run(self):
        (split,) = self.splits
        values = np.array([100.0 * self.comparison + 10.0 * split.number + self.seed])
        return [FoldResult(self.spec.name, split, values, 0.5, 2.0, 3.0)]


def compared(digest, folds=(0, 1), name="m"):
    table = SimpleNamespace(digest=lambda: digest)
    splits = tuple(Split(k, np.array([1 - i]), np.array([i])) for i, k in enumerate(folds))
    return Comparison(HoldOut("s", digest, table, None, splits), (Folded(name),))


def found_in(comparisons):
    return sorted(
        (i, r.model, r.split.number, float(r.predicted_wh[0]))
        for i, comparison in enumerate(comparisons)
        for r in comparison.results
    )


def test_comparisons_of_the_same_models_and_trips_run_once(tmp_path):
    held = [compared("a"), compared("b"), compared("a"), compared("a", (1, 0)), compared("a", name="extra")]
    counted = []
    results = run_folds(held, 7, Execution(1, progress=lambda *done: counted.append(done)))
    of_model = [
        (k, "m", fold, 100.0 * (0 if k == 2 else k) + 10.0 * fold + 7.0) for k in range(4) for fold in (0, 1)
    ]
    of_extra = [(4, "extra", fold, 400.0 + 10.0 * fold + 7.0) for fold in (0, 1)]
    assert found_in(results) == sorted(of_model + of_extra)
    assert (counted[0], counted[-1]) == ((0, 8), (8, 8))
    assert len(counted) == 9


def test_finished_folds_are_kept_and_damaged_ones_run_again(tmp_path):
    held = [compared("a")]
    first = run_folds(held, 7, Execution(1, tmp_path))
    (folder,) = tmp_path.iterdir()
    assert len(folder.name) == 16
    assert sorted(path.name for path in folder.iterdir()) == ["0.m.0.npz", "0.m.1.npz"]
    (folder / "0.m.1.npz").write_bytes(b"half")
    counted = []
    again = run_folds(held, 7, Execution(1, tmp_path, True, lambda *done: counted.append(done)))
    assert counted == [(1, 2), (2, 2)]
    assert found_in(again) == found_in(first)
    kept = next(r for r in again[0].results if r.split.number == 0)
    assert (kept.fit_s, kept.predict_ms, kept.inner_error) == (0.5, 2.0, 3.0)
    run_folds(held, 7, Execution(1, tmp_path, False, lambda *done: counted.append(done)))
    assert counted[2] == (0, 2)
    run_folds(held, 8, Execution(1, tmp_path, True))
    assert len(list(tmp_path.iterdir())) == 2
