"""Laws of updates and of chances at the edges, for some cars of the library; `benchmarks.edges` takes all."""

import pytest
from benchmarks import edges
from tests.support.cars import some_cars


@pytest.mark.parametrize("name", some_cars(5, seed=59))
def test_laws_hold_at_the_edges(name: str) -> None:
    missed = [row.line for row in edges.rows(2, seed=59, names=[name]) if row.met is False]
    assert not missed


def test_laws_hold_for_a_small_battery_in_the_cold() -> None:
    missed = [row.line for row in edges.rows(3, seed=7, names=["smart_eq_fortwo"]) if row.met is False]
    assert not missed
