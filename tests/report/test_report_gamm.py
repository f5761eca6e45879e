"""The GAMM's panels show what the fit says, and say what they cannot show."""

import re
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tripwatt.gam import CurveEffect, RandomEffects, SurfaceEffect
from tripwatt.paper.insight import GammInsight
from tripwatt.report.covariates import term_in_words
from tripwatt.report.panel import Panel
from tripwatt.report.panels import build_sections, gamm_effects, gamm_summary, running_time
from tripwatt.report.panels.results_table import on_physics_gap
from tripwatt.report.view import View

VIEW = View({})
MakeRun = Callable[..., SimpleNamespace]


@pytest.fixture(scope="module")
def found(run: SimpleNamespace) -> GammInsight:
    return run.gamm


def only(found: GammInsight, kind: type) -> list:
    return [effect for effect in found.effects.values() if isinstance(effect, kind)]


def drawn(figure, gid: str):
    artists = figure.findobj(lambda artist: artist.get_gid() == gid)
    assert len(artists) == 1, gid
    return artists[0]


def panels_of(run: object) -> dict:
    return {panel.key: panel for section in build_sections(View.from_run(run)) for panel in section.panels}


def plain_cell(text: str) -> str:
    return text.replace("\u00a0", " ").replace("−", "-")


def test_summary_table_is_the_summary_and_shows_a_level_without_data(found: GammInsight) -> None:
    table = gamm_summary.summary_table(VIEW, found, paper=False)
    cells = [plain_cell(row[1]) for row in table.rows]
    assert cells.count("reference") == 1
    cells.remove("reference")
    assert cells == [f"{value}{mark}" for _, value, mark in found.summary.rows()]
    rows = {row[0]: row[1:] for row in table.rows}
    assert tuple(map(plain_cell, rows["weather: dark, little rainy"])) == ("0.00 (0.00)", "no data")
    assert rows["s(ambient temperature, elevation difference)"]
    assert "The paper" not in " ".join(table.columns)


def test_the_papers_own_table_stands_beside_ours_whole(found: GammInsight) -> None:
    table = gamm_summary.summary_table(VIEW, found, paper=True)
    assert gamm_summary.PAPER_TABLE2_SOURCE in table.columns[-1]
    rows = {row[0]: plain_cell(row[-1]) for row in table.rows}
    assert {name: rows[name] for name in gamm_summary.PAPER_TABLE2} == dict(gamm_summary.PAPER_TABLE2)
    ours_too = {
        "(Intercept)",
        "s(time)",
        "s(speed)",
        "s(time):winter",
        "s(trip)",
        "weather: dark, little rainy",
    }
    assert ours_too <= {row[0] for row in table.rows if row[1] != "–"}


def test_smooths_are_drawn_in_the_units_of_their_axes(found: GammInsight) -> None:
    curves = only(found, CurveEffect)
    figure = gamm_effects.plot_curves(VIEW, curves)
    factors = {"time_s": 1 / 60, "speed_m_s": 3.6}
    assert len(curves) == 6
    for place, curve in enumerate(curves):
        line = drawn(figure, f"smooth-{place}")
        np.testing.assert_allclose(line.get_xdata(), curve.x * factors.get(curve.covariate, 1.0))
        np.testing.assert_array_equal(line.get_ydata(), curve.effect)
        unit = {"time_s": "[min]", "speed_m_s": "[km/h]"}.get(curve.covariate, "[")
        assert unit in line.axes.get_xlabel()


def test_a_smooth_whose_band_exceeds_the_observed_range_gives_its_reason_instead(found: GammInsight) -> None:
    curves = only(found, CurveEffect)[:3]
    observed = float(np.ptp(found.diagnosis.response.response))
    half = curves[1].multiplier * curves[1].std_error
    vague = replace(curves[1], std_error=curves[1].std_error * 1.01 * observed / (2 * np.median(half)))
    clear = replace(curves[1], std_error=curves[1].std_error * 0.99 * observed / (2 * np.median(half)))
    assert gamm_effects.band_width_wh(vague) == pytest.approx(1.01 * observed, rel=1e-6)
    assert not gamm_effects.is_determined(vague, observed)
    assert gamm_effects.is_determined(clear, observed)

    shown = [curves[0], vague, curves[2]]
    figure = gamm_effects.plot_curves(VIEW, shown, observed)
    reason = drawn(figure, "reason-1").get_text().replace("\n", " ")
    assert reason == gamm_effects.not_determined(vague, observed)
    assert f"{1.01 * observed:,.0f} Wh wide" in reason
    assert not figure.findobj(lambda artist: artist.get_gid() == "smooth-1")
    said = gamm_effects.on_curves(shown, observed)
    assert f"{term_in_words(vague.label)} is not drawn: not determined by these trips" in said
    assert "not drawn" not in gamm_effects.on_curves([curves[0], clear, curves[2]], observed)


def test_the_axis_of_a_smooth_is_that_of_its_data_not_of_a_runaway_end(found: GammInsight) -> None:
    curve = next(c for c in only(found, CurveEffect) if c.covariate == "speed_m_s" and ":" not in c.label)
    wild = curve.std_error.copy()
    wild[-1] = 1e5
    axes = drawn(gamm_effects.plot_curves(VIEW, [replace(curve, std_error=wild)]), "smooth-0").axes
    low, high = axes.get_ylim()
    assert high - low < 1e4
    assert low <= curve.effect.min()
    assert curve.effect.max() <= high


def test_an_odd_number_of_smooths_leaves_no_empty_half(found: GammInsight) -> None:
    figure = gamm_effects.plot_curves(VIEW, only(found, CurveEffect)[:3])
    first, _, last = (axes.get_subplotspec().colspan for axes in figure.axes)
    assert (len(first), len(last)) == (1, 2)


def test_a_surface_that_the_data_do_not_determine_is_called_so(found: GammInsight) -> None:
    (surface,) = only(found, SurfaceEffect)
    observed = float(np.ptp(found.diagnosis.response.response))
    assert "do not determine" not in gamm_effects.on_surface(
        replace(surface, std_error=surface.std_error * 0.0), observed
    )
    vague = replace(surface, std_error=np.full_like(surface.effect, observed / 3.0))
    assert "do not determine" in gamm_effects.on_surface(vague, observed)


def test_qq_plot_keeps_the_extremes_and_its_line_is_the_fitted_distribution(found: GammInsight) -> None:
    qq = found.diagnosis.qq
    many = np.linspace(-4.0, 4.0, 5000) ** 3
    figure = gamm_summary.plot_diagnosis(
        VIEW, replace(found.diagnosis, qq=type(qq).from_residuals(many, qq.distribution))
    )
    shown = np.asarray(drawn(figure, "qq").get_offsets())
    assert len(shown) < 1000
    assert {many.min(), many.max()} <= set(shown[:, 1])
    line = drawn(figure, "qq-line")
    np.testing.assert_array_equal(line.get_xdata(), line.get_ydata())


def test_random_effects_and_autocorrelation_are_those_of_the_fit(found: GammInsight) -> None:
    (effect,) = only(found, RandomEffects)
    points = drawn(gamm_effects.plot_random(VIEW, effect), "random")
    np.testing.assert_array_equal(points.get_xdata(), effect.theoretical)
    np.testing.assert_array_equal(points.get_ydata(), effect.effect)
    points = drawn(gamm_summary.plot_dependence(VIEW, found.autocorrelation, 30.0), "autocorrelation")
    np.testing.assert_array_equal(points.get_ydata(), found.autocorrelation.correlation)
    np.testing.assert_allclose(points.get_xdata(), found.autocorrelation.lag / 2)


def test_dependent_rows_are_called_so(found: GammInsight) -> None:
    loud = replace(found.autocorrelation, correlation=np.full(len(found.autocorrelation.lag), 0.9))
    said = gamm_summary.on_dependence(replace(found, autocorrelation=loud))
    assert "EDFs are too large" in said
    quiet = replace(loud, correlation=np.zeros(len(loud.lag)))
    assert "EDFs" not in gamm_summary.on_dependence(replace(found, autocorrelation=quiet))


def test_a_fit_that_did_not_converge_says_so_first(found: GammInsight) -> None:
    broken = replace(
        found, summary=replace(found.summary, converged=False, message="60 passes were not enough.")
    )
    said = gamm_summary.on_summary(broken, paper=False)
    assert said.startswith("The fit did not converge")
    assert "60 passes" in said


def test_surface_that_is_flat_or_has_no_data_is_drawn(found: GammInsight) -> None:
    (surface,) = only(found, SurfaceEffect)
    flat = replace(surface, effect=np.zeros_like(surface.effect), points=np.zeros((0, 2)))
    gamm_effects.plot_surface(VIEW, flat)


def test_panels_name_the_rule_and_the_trips_it_concerns(
    run: SimpleNamespace, panels: dict[str, Panel]
) -> None:
    rule = panels["gamm-extrapolation"]
    assert "no effect grows" in rule.sentence
    assert f"2 of {View.from_run(run).main['n_trips']} trips" in rule.sentence
    assert [row[0] for row in rule.tables[0].rows] == run.gamm.outside["trip"].tolist()
    assert all(
        panels[key].figure for key in ("gamm-diagnosis", "gamm-smooths", "gamm-surface", "gamm-random")
    )


def test_without_gamm_the_page_says_so(made_up: MakeRun) -> None:
    run = made_up("tum", trips=["a", "b", "c"], models=("physics-paper", "physics", "gamm"))
    panels = panels_of(SimpleNamespace(**{**vars(run), "gamm": None}))
    assert [key for key in panels if key.startswith("gamm")] == ["gamm-errors", "gamm-summary"]
    assert "not among the models" in panels["gamm-summary"].sentence
    assert not panels["gamm-summary"].tables


def test_running_times_are_those_of_the_results(run: SimpleNamespace) -> None:
    view = View.from_run(run)
    models = view.main["models"]
    figure = running_time.plot_running_time(view)
    names = running_time.timed_models(view)
    assert "physics" not in names
    for row, name in enumerate(names):
        for key in ("fit_s", "predict_ms"):
            assert drawn(figure, f"{key}-{row}").get_xdata()[0] == models[name][key]
    slowest = max(models[m]["fit_s"] for m in ("forest", "boosting"))
    ratio = float(re.findall(r"takes ([\d.]+) times", running_time.on_running_time(view))[0])
    assert ratio == pytest.approx(models["gamm"]["fit_s"] / slowest, rel=0.06)
    assert running_time.PAPER_SAYS["gamm"] in running_time.on_running_time(view)


def test_runs_without_times_or_correctors_say_so() -> None:
    scores = {"constant": {"mape": 0.2, "fit_s": None, "predict_ms": None}}
    evaluation = {"scheme": "leave_one_trip_out", "trips": "audited", "n_trips": 3, "models": scores}
    panel = panels_of(SimpleNamespace(results={"evaluations": [evaluation]}))["running-time"]
    assert panel.figure is None
    assert "No corrector" in panel.sentence


def test_why_our_physics_differs_is_said_of_the_papers_trips_and_car_alone(made_up: MakeRun) -> None:
    run = made_up("tum", trips=["a", "b", "c", "d"])
    ours = View.from_run(run).main["models"]["physics-paper"]["mape"]
    said = on_physics_gap(View.from_run(run))
    assert f"{100 * ours:.1f}\u00a0%" in said
    assert "37.9\u00a0%" in said
    assert said.endswith("this table 4.")
    assert on_physics_gap(View({**run.results, "dataset": "ved"})) == ""
    assert on_physics_gap(View({**run.results, "vehicle": "my_car"})) == ""
