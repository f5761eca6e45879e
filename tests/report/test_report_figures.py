"""Figures and tables show the numbers they were given."""

import io
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import matplotlib
import matplotlib.text
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from tools.docs.results_pages import update_readme, update_results_page

from tripwatt.errors import InvalidInput
from tripwatt.evaluation import PROTOCOLS
from tripwatt.report import render_table
from tripwatt.report.model_styles import model_styles
from tripwatt.report.panel import Panel
from tripwatt.report.panels import (
    PANELS,
    correctors,
    error_distribution,
    mean_errors,
    paired,
    results_table,
    trips,
)
from tripwatt.report.short_table import short_list
from tripwatt.report.style import WIDTH_IN, style_context
from tripwatt.report.view import View
from tripwatt.report.words import compared

MakeRun = Callable[..., SimpleNamespace]
STYLES = model_styles()
MODELS = [name for name in STYLES if not name.startswith(("hybrid", "power-", "physics-identified"))]


@pytest.fixture(scope="module")
def view(run: SimpleNamespace) -> View:
    return View.from_run(run)


@pytest.fixture(scope="module")
def folds(view: View) -> pd.DataFrame:
    return view.folds_of(view.main)


def by_gid(figure, gid: str):
    found = figure.findobj(lambda artist: artist.get_gid() == gid)
    assert len(found) == 1, gid
    return found[0]


def shown_texts(figure) -> Iterator[matplotlib.text.Text]:
    """Every text that is drawn: a tick outside of the axis has a label that is not."""
    yield from figure.texts
    yield figure._suptitle
    for legend in figure.legends:
        yield from legend.get_texts()
    for axes in figure.axes:
        yield from (axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label, *axes.texts)
        for axis, (low, high) in (
            (axes.xaxis, sorted(axes.get_xlim())),
            (axes.yaxis, sorted(axes.get_ylim())),
        ):
            yield from (t.label1 for t in axis.get_major_ticks() if low <= t.get_loc() <= high)


def test_main_evaluation_is_one_trip_out_on_the_reference_trips(view: View) -> None:
    assert (view.main["scheme"], view.main["trips"]) == ("leave_one_trip_out", "reference")
    assert len(view.folds_of(view.main)) == view.main["n_trips"] * len(MODELS)


def test_distribution_shows_the_signed_error_of_every_trip(folds: pd.DataFrame) -> None:
    figure = error_distribution.plot_error_distribution(View({}), folds)
    for number, model in enumerate(MODELS):
        rows = folds[folds["model"] == model]
        expected = rows["predicted_energy_wh"] / rows["observed_energy_wh"] - 1
        shown = by_gid(figure, f"rug-{number}").get_xdata()
        np.testing.assert_allclose(shown, np.clip(expected, -1.5, 1.5), rtol=0, atol=1e-12)


def test_box_plot_shows_every_trip_or_counts_it(folds: pd.DataFrame) -> None:
    far = folds.copy()
    far.loc[(far["model"] == "boosting-only") & (far["trip"] == "A01"), "ape"] = 9.0
    figure = error_distribution.plot_error_boxes(View({}), far)
    for number, model in enumerate(MODELS):
        expected = far.loc[far["model"] == model, "ape"].to_numpy()
        shown = np.asarray(by_gid(figure, f"trips-{number}").get_offsets())[:, 0]
        np.testing.assert_allclose(np.sort(shown), np.sort(expected[expected <= 1.5]))
    assert "1 beyond" in {text.get_text() for text in figure.findobj(matplotlib.text.Text)}


def test_means_and_paired_differences_are_those_of_the_results(view: View) -> None:
    means = mean_errors.plot_mean_errors(view)
    for number, evaluation in enumerate(view.evaluations):
        for row, model in enumerate(MODELS):
            assert by_gid(means, f"mean-{number}-{row}").get_xdata()[0] == evaluation["models"][model]["mape"]
    pairs = view.paired_of(view.main)
    differences = paired.plot_paired_differences(view, pairs)
    assert [by_gid(differences, f"pair-{i}").get_xdata()[0] for i in range(len(pairs))] == [
        p["diff"] for p in pairs
    ]


def test_energy_along_the_trip_ends_where_the_fold_says(view: View, folds: pd.DataFrame) -> None:
    selected = view.selected_trips()
    errors = folds.loc[folds["model"] == view.best, "ape"]
    assert [role for role, _, _ in selected] == ["Best", "Median", "Worst"]
    assert selected[0][2] == errors.min()
    assert selected[2][2] == errors.max()
    assert abs((errors < selected[1][2]).sum() - (errors > selected[1][2]).sum()) <= 1
    figure = trips.plot_trip_energy(view, selected, str(view.best))
    for number, (_, trip, _) in enumerate(selected):
        rows = folds[folds["trip"] == trip].set_index("model")
        ends = {
            "measured": rows["observed_energy_wh"].iloc[0],
            "simulated": rows.loc["physics-paper", "predicted_energy_wh"],
            "corrected": rows.loc[view.best, "predicted_energy_wh"],
        }
        for label, energy in ends.items():
            line = by_gid(figure, f"energy-{number}-{label}")
            assert line.get_ydata()[-1] == pytest.approx(energy / 1000)
            assert line.get_xdata()[-1] == pytest.approx((len(view.series[trip]) - 1) / 60)


def test_errors_by_trip_are_sorted_and_complete(view: View, folds: pd.DataFrame) -> None:
    figure = trips.plot_trip_errors(view, "boosting", "physics-paper")
    expected = folds[folds["model"] == "boosting"].set_index("trip")["ape"].sort_values(ascending=False)
    np.testing.assert_allclose(by_gid(figure, "own").get_xdata(), expected)
    other = folds[folds["model"] == "physics-paper"].set_index("trip")["ape"]
    np.testing.assert_allclose(by_gid(figure, "other").get_xdata(), other[expected.index])
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == list(expected.index)


def test_learning_curve_and_importances(view: View) -> None:
    curves = view.learning_curves
    drawn = correctors.plot_learning_curves(view, curves)
    for number, model in enumerate(("boosting", "boosting-only")):
        mean = curves[curves["model"] == model].groupby("rounds")["error"].mean()
        np.testing.assert_allclose(by_gid(drawn, f"mean-{number}").get_ydata(), mean)
    figure = correctors.plot_importances(view, view.importances)
    bars = figure.findobj(lambda a: (a.get_gid() or "").startswith("importance-0-"))
    forest = view.importances[view.importances["model"] == "forest"]["importance"]
    assert [b.get_width() for b in bars] == sorted(forest, reverse=True)


def test_no_text_of_a_figure_leaves_it_or_covers_its_neighbour(
    view: View, folds: pd.DataFrame, panels: dict[str, Panel]
) -> None:
    made_up = replace(view, results={**view.results, "synthetic": True})
    pairs = view.paired_of(view.main)
    with style_context():
        drawn = [
            mean_errors.plot_mean_errors(made_up),
            error_distribution.plot_error_distribution(made_up, folds),
            error_distribution.plot_error_boxes(made_up, folds),
            trips.plot_trip_energy(made_up, view.selected_trips(), "boosting"),
            trips.plot_trip_errors(made_up, "boosting", "physics-paper"),
            paired.plot_paired_differences(made_up, pairs[:9]),
            paired.plot_paired_differences(made_up, paired.paired_with(pairs, view.best)),
            correctors.plot_learning_curves(made_up, view.learning_curves),
            correctors.plot_importances(made_up, view.importances),
        ]
    drawn += [
        *(
            panels[name].figure
            for s in PROTOCOLS["paper"].sections
            for name in s.panels
            if s.key in ("gamm", "inside") and name in panels and panels[name].figure
        ),
    ]
    for figure in drawn:
        with style_context():
            figure.draw_without_rendering()
        page = figure.bbox
        for text in shown_texts(figure):
            if text.get_text() and text.get_visible():
                box = text.get_window_extent()
                overhang = max(page.x0 - box.x0, box.x1 - page.x1, page.y0 - box.y0, box.y1 - page.y1)
                assert overhang <= 1.0, text.get_text()
        for axes in figure.axes:
            boxes = [t.get_window_extent() for t in axes.get_yticklabels() if t.get_text()]
            assert not any(a.overlaps(b) for a, b in pairwise(boxes))
        assert figure.get_size_inches()[0] == WIDTH_IN


def test_panels_leave_the_settings_of_the_process_alone(view: View) -> None:
    before = dict(matplotlib.rcParams)
    assert PANELS["error-boxes"].content(view).figure is not None
    assert dict(matplotlib.rcParams) == before


def test_terminal_table_has_five_models_with_their_titles(run: SimpleNamespace) -> None:
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(render_table(run.results))
    text = console.export_text()
    view = View(run.results)
    models = view.main["models"]
    shown = [line for line in text.splitlines() if any(f" {STYLES[m].label} " in line for m in MODELS)]
    assert len(shown) == 5
    for name, line in zip(short_list(view), shown, strict=True):
        assert STYLES[name].label in line
        low, high = models[name]["mape_ci95"]
        assert f"{100 * models[name]['mape']:.1f}" in line
        assert f"{100 * low:.1f}\u00a0to\u00a0{100 * high:.1f}" in line
    assert not any(re.search(rf"(?<![\w]){name}(?![\w])", text) for name in ("physics-paper", "linear4"))
    assert "…" not in text  # fits a terminal of 80 columns
    assert "synthetic" not in text
    console.print(render_table({**run.results, "dataset": "synthetic"}))
    assert "synthetic" in console.export_text()


def test_short_table_is_the_best_of_each_kind_and_holds_the_best_of_all(made_up: MakeRun) -> None:
    view = View(made_up("tum", trips=["a", "b", "c", "d", "e"]).results)
    models = view.main["models"]
    names = short_list(view)
    kinds = [STYLES[m].kind for m in names]
    assert names[0] == "constant"
    assert kinds == ["constant", "baseline", "physics", "data", "hybrid"]
    for name in names[1:]:
        rivals = [m for m in models if STYLES[m].kind == STYLES[name].kind]
        assert models[name]["mape"] == min(models[m]["mape"] for m in rivals)
    assert min(m["mape"] for m in models.values()) == min(models[m]["mape"] for m in names)
    few = {**view.main, "models": {m: models[m] for m in ("linear4", "linear6", "physics")}}
    assert short_list(View({"evaluations": [few]})) == ["linear4", "linear6", "physics"]


def test_identical_evaluations_are_shown_once_and_named(made_up: MakeRun) -> None:
    run = made_up("synthetic", trips=["a", "b", "c", "d"])
    reference = next(e for e in run.results["evaluations"] if e["trips"] == "reference")
    slower = {name: {**score, "fit_s": 9e3} for name, score in reference["models"].items()}
    others = [e for e in run.results["evaluations"] if e["trips"] == "audited"]
    other = others[0]
    run.results["evaluations"] = [reference, {**reference, "trips": "all", "models": slower}, other]
    view = View(run.results)
    assert [e["trips"] for e in view.evaluations] == ["reference", "audited"]
    table = results_table.sets_table(view)
    assert len(table.columns) == 3
    assert table.columns[1] == "leave one trip out, 4 reference trips (identical: all 4 trips, unaudited)"
    assert "identical" not in table.columns[2]
    assert next(row[1] for row in table.rows if row[0] == "Constant Wh/km").startswith(
        f"{100 * reference['models']['constant']['mape']:.1f} ("
    )
    mended = {m: {**s, "mape": s["mape"] + 1e-9} for m, s in slower.items()}
    run.results["evaluations"][1]["models"] = mended
    assert len(View(run.results).evaluations) == 3


@pytest.mark.parametrize(
    ("update", "marker", "protocol"),
    [(update_readme, "results", "forecast"), (update_results_page, "paper", "paper")],
)
def test_a_page_holds_the_results_and_keeps_the_rest(
    update: Callable[..., None], marker: str, protocol: str, run: SimpleNamespace, tmp_path
) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# Title\n<!-- {marker}:begin -->\nold\n<!-- {marker}:end -->\ntail\n", encoding="utf-8")
    results = {**run.results, "protocol": protocol}
    update(results, page)
    once = page.read_text(encoding="utf-8")
    update(results, page)
    assert page.read_text(encoding="utf-8") == once
    assert once.startswith(f"# Title\n<!-- {marker}:begin -->\n")
    assert once.endswith(f"\n<!-- {marker}:end -->\ntail\n")
    assert "\nold\n" not in once
    view = View(results)
    shown = MODELS if protocol == "paper" else short_list(view)
    assert all(f"{100 * view.main['models'][m]['mape']:.1f}" in once for m in shown)


def test_the_readme_shows_the_forecast_alone(run: SimpleNamespace, tmp_path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("no markers", encoding="utf-8")
    update_readme(run.results, readme)
    assert readme.read_text(encoding="utf-8") == "no markers"


@pytest.mark.parametrize("text", ["", "<!-- results:begin -->", "<!-- results:end --><!-- results:begin -->"])
def test_readme_without_its_markers_is_refused_and_left_alone(
    text: str, run: SimpleNamespace, tmp_path
) -> None:
    readme = tmp_path / "README.md"
    readme.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput, match="no place for the results"):
        update_readme({**run.results, "protocol": "forecast"}, readme)
    assert readme.read_text(encoding="utf-8") == text


@given(diff=st.floats(-1, 1), low=st.floats(0, 0.5), high=st.floats(0, 0.5))
def test_turning_a_pair_round_keeps_its_verdict(diff: float, low: float, high: float) -> None:
    pair = {"a": "boosting", "b": "forest", "diff": diff, "ci95": [diff - low, diff + high]}
    (turned,) = paired.paired_with([pair], "boosting")
    assert paired.result_of(turned) == paired.result_of(pair)
    assert turned["ci95"][0] <= turned["diff"] <= turned["ci95"][1]


def test_sentences_follow_the_numbers(made_up: MakeRun) -> None:
    small = made_up("tum", trips=["a", "b", "c", "d"])
    view = View.from_run(small)
    best = view.best
    assert best is not None
    hybrids = {m: view.main["models"][m]["mape"] for m in ("physics4", "forest", "boosting")}
    assert best == min(hybrids, key=lambda m: hybrids[m])
    assert f"{100 * hybrids[best]:.1f}\u00a0%" in results_table.on_lowest(view)
    pairs = [
        {"a": "constant", "b": best, "diff": 0.1, "ci95": [0.05, 0.2]},
        {"a": best, "b": "linear4", "diff": 0.0, "ci95": [-0.1, 0.1]},
    ]
    said = paired.on_paired(pairs, best)
    assert "significantly lower than that of Constant Wh/km" in said
    assert "not significantly different from that of Linear (4 coefficients)" in said


@given(diff=st.floats(-0.9, 0.9), low=st.floats(0.001, 0.05), high=st.floats(0.001, 0.05))
def test_a_comparison_reads_the_same_whichever_model_comes_first(
    diff: float, low: float, high: float
) -> None:
    pair = {"a": "physics4", "b": "forest", "diff": diff, "ci95": [diff - low, diff + high]}
    turned = {"a": "forest", "b": "physics4", "diff": -diff, "ci95": [-diff - high, -diff + low]}
    said = compared([pair], "forest", ["physics4"])
    assert said == compared([turned], "forest", ["physics4"])
    if diff - low <= 0.0 <= diff + high:
        assert "not significantly different" in said
    else:
        assert ("lower than" if diff > 0 else "higher than") in said
        assert f"{abs(100 * diff):.1f} percentage points" in said


def test_table_cells_are_those_of_the_results(view: View) -> None:
    table = results_table.results_table(view, view.main)
    score = view.main["models"]["boosting"]
    row = dict(zip(table.columns, table.rows[list(MODELS).index("boosting")], strict=True))
    assert row["RMSE [kWh]"] == f"{score['rmse_wh'] / 1000:.2f}"
    assert row["Max [%]"] == f"{100 * score['max_ape']:.1f}"
    assert row["The paper [%]"] == "10.3"
    for other in (table, trips.trips_table(view), paired.paired_table(view), results_table.sets_table(view)):
        assert {len(cells) for cells in other.rows} == {len(other.columns)}


def test_one_model_is_compared_with_nothing() -> None:
    def shown(*names: str) -> View:
        score = {"mape": 0.1, "mape_ci95": [0.08, 0.12], "rmse_wh": 500.0}
        models = {name: score | {"mape": 0.1 + 0.01 * place} for place, name in enumerate(names)}
        main = {"scheme": "leave_one_trip_out", "trips": "audited", "n_trips": 9, "models": models}
        return View({"protocol": "paper", "models": dict.fromkeys(names, ""), "evaluations": [main]})

    for name in ("boosting", "constant"):
        one = shown(name)
        legend = results_table.legend.content(one)
        assert legend is not None
        said = [mean_errors.on_intervals(one), results_table.on_lowest(one), legend.sentence]
        assert not re.search(r"of the other|hybrids|lowest|1 models", " ".join(said)), said
    two = shown("boosting", "forest")
    assert "1 of the other 1 intervals" in mean_errors.on_intervals(two)
    assert results_table.on_lowest(two).startswith("Of the hybrids, Hybrid boosting has the lowest")
    assert results_table.on_lowest(shown("boosting", "constant")).startswith(
        "The mean error of Hybrid boosting is 10"
    )
    assert results_table.on_lowest(shown("constant", "linear4")).startswith("Constant Wh/km has the lowest")
