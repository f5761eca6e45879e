"""Cars on the cold dynamometer: the rows of the list, and the page that shows them."""

from __future__ import annotations

import pytest
from benchmarks import cold_rows
from tools import CATALOGUE
from tools.docs import pages

needs_list = pytest.mark.skipif(
    not (CATALOGUE / "epa_ev.csv").is_file(), reason="needs the public lists of ../shared"
)


def test_ratios_by_hand() -> None:
    row = cold_rows.ColdRow("car", 30.0, 20.0, 120.0, 180.0, 100.0)
    assert (row.measured, row.off, row.heated) == (1.5, 1.2, 1.8)
    assert "1 measured rows lie between both" in cold_rows.summary([row])
    assert "| car | 30.0 | 20.0 | 1.50 | 1.20 | 1.80 |" in cold_rows.render([row])


@needs_list
def test_measured_rises_lie_between_no_heating_and_a_warm_cabin() -> None:
    rows = cold_rows.compute()
    assert len(rows) == 36
    assert all(row.off < row.measured < row.heated for row in rows)
    three = next(row for row in rows if row.title == "Tesla Model 3 Long Range AWD 2022")
    assert three.measured == pytest.approx(25.0 / 18.3, rel=0.01)
    assert cold_rows.summary(rows) == pages.of_page("reference/library.md", "cold")
