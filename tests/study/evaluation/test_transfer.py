"""Correctors of another vehicle: nothing of a scored trip takes part, own trips do, and values from the target's logs do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import transfer
from benchmarks.transfer import comparisons, evaluate_transfer, table_of
from tests.study.evaluation.test_cars import louder, made
from tools.docs.transfer_page import figure_of, text_of

from tripwatt.study.evaluation.cars import CarTrips
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.folds import Execution, run_folds


@pytest.fixture(scope="module")
def cars() -> list[CarTrips]:
    return [made("a", "one", "vw_id3", 10, 1, base_load=0.5), made("b", "two", "nissan_leaf_40", 10, 2)]


@pytest.fixture(autouse=True)
def boosting(monkeypatch: pytest.MonkeyPatch) -> None:
    """The quickest learner alone, with and without physics."""
    monkeypatch.setattr(transfer, "LEARNERS", transfer.LEARNERS[-2:])


def of_target(every: list[CarTrips]) -> list[Comparison]:
    """The comparisons of the first vehicle with five own trips: without a source, and with the second vehicle."""
    planned = list(comparisons(every, 1, 0))
    return [c for about, c in planned if about["target"] == every[0].name and about["own"] == 5]


def energies(planned: list[Comparison]) -> list[np.ndarray]:
    done = run_folds(planned, 0, Execution(n_jobs=1))
    return [c.energies_wh(spec.name) for c in done for spec in c.specs if spec.name != "physics"]


def test_the_scored_trips_take_no_part_and_the_own_trips_do(cars) -> None:
    before = of_target(cars)
    hold_out = before[0].hold_out
    scored = {hold_out.table.trip_ids[i] for i in hold_out.scored}
    unaltered = energies(before)
    for alter_scored in (True, False):
        altered = tuple(louder(t, 3.0) if (t.trip_id in scored) == alter_scored else t for t in cars[0].trips)
        after = energies(of_target([replace(cars[0], trips=altered), cars[1]]))
        equal = [np.allclose(a, b, rtol=1e-9) for a, b in zip(unaltered, after, strict=True)]
        assert equal == [alter_scored] * 5  # population, and two learners without a source and with one


def test_values_from_the_logs_of_the_target_are_replaced_in_the_source(cars) -> None:
    with_tum, without_tum = (table_of(cars[1], dataset) for dataset in ("another set", "tum"))
    assert np.array_equal(with_tum.observed_wh, without_tum.observed_wh)
    assert not np.array_equal(with_tum.simulated("physics"), without_tum.simulated("physics"))


def test_every_pair_has_its_row_and_the_page_its_tables(cars) -> None:
    results = evaluate_transfer(cars, draws=2)
    found = {(row["source"], row["target"], row["own"]) for row in results["rows"]}
    assert found == {(s, t, k) for s, t in (("", "a"), ("b", "a"), ("", "b"), ("a", "b")) for k in (0, 5)}
    assert all(row["mape_ci95"][0] <= row["mape"] <= row["mape_ci95"][1] for row in results["rows"])
    physics = [row["mape"] for row in results["rows"] if row["model"] == "physics" and row["target"] == "a"]
    assert len({round(error, 12) for error in physics[:2]}) == 1  # with a source or without one
    text = text_of(results)
    for row in ("a→b", "b→a", "Without physics: boosting"):
        assert f"| {row} |" in text
    lines = {line.get_label() for line in figure_of(results).axes[0].lines}
    assert {"Physics alone", "Corrector of own trips"} <= lines
