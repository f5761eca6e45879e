"""The i3 against Argonne's dynamometer, from -18 to +36 °C."""

import pandas as pd
import pytest
from benchmarks.argonne import argonne_rows, render_rows, summary
from tools.docs import pages


@pytest.fixture(scope="module")
def rows(data_dir, reference_dir) -> pd.DataFrame:
    return argonne_rows(data_dir, reference_dir)


def test_every_warm_row_within_eight_percent(rows) -> None:
    warm = rows[rows["cell_temperature_degc"].between(21, 25)]
    assert len(warm) == 7
    assert warm["error"].abs().max() <= 0.08


def test_mean_absolute_error_over_all_temperatures(rows) -> None:
    assert len(rows) == 31
    assert summary(rows)["mean_absolute_error"] <= 0.12


def test_the_documented_rows_are_those_of_now(rows) -> None:
    assert pages.of_page("explanation/argonne.md", "argonne") == render_rows(rows).strip(), (
        "run: python -m benchmarks.argonne --write"
    )
