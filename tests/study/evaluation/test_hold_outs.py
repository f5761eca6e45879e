"""Splits of trips: folds, any splitter's, and random draws."""

from types import SimpleNamespace

import numpy as np
import pytest
from sklearn.model_selection import KFold
from tests.support.refusals import refusal

from tripwatt.learners.folds import Split, leave_one_out
from tripwatt.study.evaluation.hold_outs import (
    LEAVE_ONE_TRIP_OUT,
    HoldOut,
    HoldOutChoice,
    number_days,
    random_draws,
    split_trips,
)


def folds_of(*numbers: int, scheme: str = "s") -> HoldOut:
    return HoldOut(scheme, "reference", range(len(numbers)), "data", leave_one_out(np.array(numbers)))


def plain(splits: tuple[Split, ...]) -> list:
    return [(s.number, s.train.tolist(), s.test.tolist(), s.draw) for s in splits]


def test_a_fold_is_fitted_on_all_others() -> None:
    hold_out = folds_of(3, 1, 3)
    assert plain(hold_out.splits) == [(1, [0, 2], [1], 0), (3, [1], [0, 2], 0)]
    assert hold_out.folds.tolist() == [3, 1, 3]
    assert hold_out.scored.tolist() == [0, 1, 2]


def test_a_trip_may_be_for_training_alone() -> None:
    hold_out = folds_of(0, -1, 0)
    assert plain(hold_out.splits) == [(0, [1], [0, 2], 0)]
    assert hold_out.scored.tolist() == [0, 2]
    assert hold_out.folds is None


def test_any_splitter_serves() -> None:
    class Gap:
        """Trains on some trips alone; its second split gives a mask."""

        def split(self, X, y, groups):
            return [([0], [2]), ([0, 1], np.arange(len(X)) == 3)]

    trips = [SimpleNamespace(context=SimpleNamespace(day=None))] * 7
    splitters = {"KFold": KFold(3, shuffle=True, random_state=1), "Gap": Gap()}
    found = {
        name: HoldOut(name, "all", range(7), None, split_trips(name, splitter, trips, np.ones(7)))
        for name, splitter in splitters.items()
    }
    assert [split.number for split in found["KFold"].splits] == [0, 1, 2]
    assert found["KFold"].folds is not None
    for split in found["KFold"].splits:
        assert sorted([*split.train, *split.test]) == list(range(7))
    assert found["Gap"].folds is None
    assert found["Gap"].scored.tolist() == [2, 3]


def test_settings_are_compared_on_the_reference_trips_alone() -> None:
    assert folds_of(0, 1, scheme=LEAVE_ONE_TRIP_OUT).is_reference
    assert not folds_of(0, 1).is_reference


@pytest.mark.parametrize(("n", "sizes"), [(12, []), (13, [5]), (47, [5, 10, 20]), (48, [5, 10, 20, 40])])
def test_a_draw_is_scored_on_all_other_trips(n: int, sizes: list[int]) -> None:
    draws = random_draws(folds_of(*range(n)), (5, 10, 20, 40), 6, 8, 7)
    assert [(len(s.train), s.draw) for s in draws.splits] == [(size, k) for size in sizes for k in range(6)]
    for split in draws.splits:
        order = np.random.default_rng((7, split.draw)).permutation(n)
        assert split.train.tolist() == sorted(order[: len(split.train)])
        assert split.test.tolist() == sorted(order[len(split.train) :])
    if sizes:
        assert draws.folds is None


def test_days_need_a_date_of_each_trip_and_three_of_them() -> None:
    def trips(*days: str | None) -> list:
        return [SimpleNamespace(context=SimpleNamespace(day=day)) for day in days]

    assert number_days(trips("b", "a", "c", "a")).tolist() == [1, 0, 2, 0]
    assert number_days(trips("b", "a", "b")) is None
    assert number_days(trips("b", "a", None, "c")) is None


def test_hold_outs_are_chosen_by_name_in_the_order_of_the_choice() -> None:
    available = [("leave_one_trip_out", "reference"), ("leave_one_trip_out", "all"), ("days", "all")]
    take = HoldOutChoice.from_argument
    assert take(None).select(available) == available
    assert take("all").select(available) == available[1:]
    assert take(["days", "leave_one_trip_out:all", "all"]).select(available) == [*available[:0:-1]]
    folds = KFold(3)
    assert take([folds, "days"]).select(available) == [("KFold", folds), available[2]]
    allowed = "leave_one_trip_out, days, leave_one_trip_out:reference, leave_one_trip_out:all, days:all"
    assert refusal(take(["day", "week"]).select, available).splitlines() == [
        f"unknown hold-out: hold_outs: got 'day'; allowed: {allowed}; did you mean 'days'?",
        f"unknown hold-out: hold_outs: got 'week'; allowed: {allowed}",
    ]
    kinds = "names of hold-outs, or splitters of scikit-learn's kind (objects, not classes)"
    for wrong, got in (([], "an empty list"), (7, "7"), (KFold, f"{KFold!r}")):
        assert refusal(take, wrong) == f"unknown hold-out: hold_outs: got {got}; allowed: {kinds}"
