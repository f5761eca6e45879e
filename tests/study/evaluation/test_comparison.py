"""Models beside each other on a hold-out."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.hybrid import SegmentTable
from tripwatt.learners.folds import Split
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.tasks import FoldResult

EXACT = {"rel": 1e-9, "abs": 1e-12}


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


def test_a_summary_counts_trips_that_are_better_than_physics():
    """Two trips of 1000 and 2000 Wh, each predicted at two rows."""
    table = SimpleNamespace(
        observed_wh=np.array([0.0, 1000.0, 0.0, 2000.0]),
        offsets=np.array([0, 2, 4]),
        last_rows=np.array([1, 3]),
        trip_ids=("a", "b"),
        days=("mon", "tue"),
        simulated=lambda name: np.zeros(4),
    )
    hold_out = SimpleNamespace(scheme="s", trips="t", tested=np.arange(2), scored=np.arange(2), table=table)
    energies = {"physics": [1100.0, 2100.0], "better": [1050.0, 2100.0]}
    specs = [SimpleNamespace(name=name, simulation=None) for name in energies]
    results = [
        FoldResult(name, Split(k, np.array([1 - k]), np.array([k])), np.array([wh]), 1.0 + k, 10.0 * k)
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
    assert pair["ci95"][0] < pair["diff"] < pair["ci95"][1]
    table.days = ("mon", "mon")
    (of_one_day,) = comparison.paired(0)
    assert of_one_day["ci95"] == pytest.approx([pair["diff"]] * 2, abs=1e-9)
    assert comparison.frame["trip"].tolist() == ["a", "b", "a", "b"]
