"""Finished folds are kept, and the same folds run once."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from tripwatt.hybrid import SegmentTable
from tripwatt.learners.folds import Split
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.folds import Execution, run_folds
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.tasks import FoldResult, Task


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


class Folded:
    """A model whose prediction tells where it was made: in which comparison, in which fold, with which seed."""

    def __init__(self, name):
        self.name, self.digest = name, ""

    def tasks(self, comparison, hold_out, splits, seed, *, inner_errors):
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
    assert sorted(path.name for path in folder.iterdir()) == ["0.m.0.fold", "0.m.1.fold"]
    (folder / "0.m.1.fold").write_bytes(b"half")
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
