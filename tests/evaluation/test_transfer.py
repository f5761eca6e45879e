"""The transfer to another car, part by part."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.evaluation import transfer
from tripwatt.evaluation.transfer import _bars, _by_car, _Car, _check, _forecasts, _paired, _period, _require
from tripwatt.hybrid import SegmentTable
from tripwatt.trips import Context, Fleet, Trip

EXACT = {"rel": 1e-9, "abs": 1e-12}


EACH = np.array([[0, 0], [1, 1], [0, 1], [0, 1]])


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
