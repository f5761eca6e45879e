"""The panels on what differs from the paper show what the results hold."""

import json

import numpy as np
import pytest
from tests.support import ROOT

from tripwatt.study.report.panels import paper_studies
from tripwatt.study.report.view import View


def score(
    mape: float, simulation: str = "physics-paper", improved: float | None = 0.5, title: str = ""
) -> dict:
    return {
        "title": title,
        "simulation": simulation,
        "mape": mape,
        "mape_ci95": [mape - 0.02, mape + 0.02],
        "median_ape": mape,
        "max_ape": 3 * mape,
        "bias": -mape,
        "fit_s": 1.25,
        "predict_ms": 1.0,
        "improved_share": improved,
    }


@pytest.fixture
def results() -> dict:
    found = json.loads((ROOT / "docs" / "results" / "paper.json").read_text(encoding="utf-8"))
    models = {
        "physics-paper": score(0.2, improved=None, title="own"),
        "physics-idle": score(0.5, "physics-idle", None, "idle form"),
        "physics-brochure": score(0.36, "physics-brochure", None, "brochure form"),
        "gamm": score(0.13, improved=0.61, title="GAMM t"),
        "gamm-ar1": score(0.11, title="GAMM AR(1)"),
        "gamm-chosen": score(0.112, title="GAMM chosen"),
        "boosting": score(0.10, improved=0.62, title="independent"),
        "boosting-exchangeable": score(0.12, title="exchangeable"),
        "boosting-ar1": score(0.15, title="ar1"),
        "boosting-chosen": score(0.105, title="chosen"),
        "boosting-brochure": score(0.101, "physics-brochure", 0.96, "on the form"),
    }
    curve = [
        {"n_trips": 2, "draws": 4, "boosting": 0.4, "boosting-only": 0.9},
        {"n_trips": 8, "draws": 4, "boosting": 0.2, "boosting-only": 0.3},
    ]
    found["studies"] = {
        "trips": "reference",
        "n_trips": 58,
        "models": models,
        "nearest": "physics-brochure",
        "choices": {"gamm-chosen": {"gamm": 8, "gamm-ar1": 50}, "boosting-chosen": {"boosting": 58}},
        "trips_needed": {"curve": curve, "crossing": 4.0, "crossing_ci95": [2.5, None]},
    }
    return found


def test_forms_are_compared_with_the_papers_simulation(results: dict) -> None:
    forms = paper_studies.forms_table(View(results))
    assert [row[0] for row in forms.rows] == ["own", "idle form", "brochure form", "the paper's simulation"]
    assert [row[1] for row in forms.rows] == ["20.0", "50.0", "36.0", "37.9"]
    assert [row[5] for row in forms.rows] == ["−17.9 points", "+12.1 points", "−1.9 points", "–"]
    correctors = paper_studies.improved_table(View(results))
    assert [row[5] for row in correctors.rows] == ["61", "62", "96"]
    assert [row[1] for row in correctors.rows] == ["own", "own", "brochure form"]
    # 58 trips of 13 % in the mean, one of them with 39 %: the others have (58 * 13 - 39) / 57 = 12.54 %
    assert correctors.rows[0][4] == "12.5"


def test_options_have_their_error_and_the_choice(results: dict) -> None:
    table = paper_studies.choice_table(View(results), "boosting-chosen")
    assert [row[1] for row in table.rows] == ["10.0", "12.0", "15.0", "10.5", "10.3"]
    assert [row[5] for row in table.rows] == ["58", "–", "–", "–", "–"]
    table = paper_studies.choice_table(View(results), "gamm-chosen")
    assert [row[5] for row in table.rows] == ["8", "50", "–", "–"]


def test_the_crossing_is_drawn(results: dict) -> None:
    axes = paper_studies.plot_trips_needed(View(results)).axes[0]
    lines = {line.get_gid(): line for line in axes.lines}
    np.testing.assert_allclose(lines["curve-boosting"].get_ydata(), [40.0, 20.0])
    np.testing.assert_allclose(lines["curve-boosting-only"].get_ydata(), [90.0, 30.0])
    assert (lines["crossing"].get_xdata(), lines["crossing"].get_ydata()) == ([4.0], [30.0])
    np.testing.assert_allclose(lines["interval"].get_xdata(), [2.5, 8.0])
    results["studies"]["trips_needed"] |= {"crossing": None, "crossing_ci95": [None, None]}
    axes = paper_studies.plot_trips_needed(View(results)).axes[0]
    assert "crossing" not in {line.get_gid() for line in axes.lines}


def test_other_trips_have_no_study(results: dict) -> None:
    assert [panel.key for panel in paper_studies.panels(View(results))] == ["paper-studies", "trips-needed"]
    assert paper_studies.panels(View({**results, "studies": {}})) == []
