"""The GAMM's panels show what the fit says."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tripwatt.study.paper.insight import GammInsight
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.panels import gamm
from tripwatt.study.report.view import View
from tripwatt_gamm import SurfaceEffect

VIEW = View({})


@pytest.fixture(scope="module")
def found(run: SimpleNamespace) -> GammInsight:
    return run.gamm


def test_the_table_of_terms_is_the_summary_and_shows_a_level_without_data(found: GammInsight) -> None:
    table = gamm.terms_table(VIEW, found)
    assert [row[1].replace("−", "-") for row in table.rows] == [
        f"{v}{mark}" for _, v, mark in found.summary.rows()
    ]
    rows = dict(table.rows)
    assert rows["weather: dark, little rainy"] == "0.00 (0.00)"
    assert {"s(time)", "s(time):winter", "s(ambient temperature, elevation difference)", "s(trip)"} <= set(
        rows
    )


def test_dependent_rows_and_a_fit_that_did_not_converge_are_called_so(found: GammInsight) -> None:
    loud = replace(found.autocorrelation, correlation=np.full(len(found.autocorrelation.lag), 0.9))
    broken = replace(found.summary, converged=False, message="60 passes were not enough.")
    rows = gamm.fit_table(VIEW, replace(found, autocorrelation=loud, summary=broken)).rows
    assert any("EDFs are too large" in value for _, value in rows)
    assert rows[0][1].startswith("no, ")
    assert "60 passes" in rows[0][1]
    quiet = replace(loud, correlation=np.zeros(len(loud.lag)))
    settled = replace(found.summary, converged=True, message="")
    rows = gamm.fit_table(VIEW, replace(found, autocorrelation=quiet, summary=settled)).rows
    assert not any("EDFs" in value for _, value in rows)
    assert rows[0] == ("Converged", "yes")


def test_a_surface_that_is_flat_or_has_no_data_is_drawn(found: GammInsight) -> None:
    effects = {
        name: replace(e, effect=np.zeros_like(e.effect), points=np.zeros((0, 2)))
        for name, e in found.effects.items()
        if isinstance(e, SurfaceEffect)
    }
    shown = gamm.panels(replace(VIEW, gamm=replace(found, effects=effects)))
    assert "gamm-surface" in [panel.key for panel in shown]


def test_residuals_and_effects_are_drawn(panels: dict[str, Panel]) -> None:
    for key in ("gamm-diagnosis", "gamm-smooths", "gamm-surface", "gamm-random"):
        assert panels[key].figure
    assert len(panels["gamm-smooths"].figure.axes) == 6
