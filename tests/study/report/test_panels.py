"""Figures and tables show the numbers they were given."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import matplotlib
import matplotlib.text
import numpy as np
import pandas as pd
import pytest
from tools.docs.results_pages import update_results_page

from tripwatt.errors import InvalidInput
from tripwatt.study.report.model_styles import model_styles
from tripwatt.study.report.panels import build_sections, errors, paired, results_table
from tripwatt.study.report.shortlist import short_table, short_table_models
from tripwatt.study.report.style import WIDTH_IN, style_context
from tripwatt.study.report.view import View

MakeRun = Callable[..., SimpleNamespace]
STYLES = model_styles()
MODELS = [name for name in STYLES if not name.startswith(("hybrid", "power-", "physics-identified"))]


@pytest.fixture(scope="module")
def view(run: SimpleNamespace) -> View:
    return View(run.results, run.folds, run.gamm)


@pytest.fixture(scope="module")
def folds(view: View) -> pd.DataFrame:
    return view.main_folds


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


def test_distribution_shows_the_signed_error_of_every_trip(view: View, folds: pd.DataFrame) -> None:
    figure = errors.plot_error_distribution(view, MODELS)
    for number, model in enumerate(MODELS):
        rows = folds[folds["model"] == model]
        expected = rows["predicted_energy_wh"] / rows["observed_energy_wh"] - 1
        shown = by_gid(figure, f"rug-{number}").get_xdata()
        np.testing.assert_allclose(shown, np.clip(expected, -1.5, 1.5), rtol=0, atol=1e-12)


def test_box_plot_shows_every_trip_a_far_one_at_the_edge(view: View, folds: pd.DataFrame) -> None:
    far = folds.copy()
    far.loc[(far["model"] == "boosting-only") & (far["trip"] == "A01"), "predicted_energy_wh"] *= 9.0
    figure = errors.plot_error_boxes(replace(view, folds=far), MODELS, "Errors")
    for number, model in enumerate(MODELS):
        rows = far[far["model"] == model]
        expected = np.abs(rows["predicted_energy_wh"] / rows["observed_energy_wh"] - 1)
        shown = np.asarray(by_gid(figure, f"trips-{number}").get_offsets())[:, 0]
        np.testing.assert_allclose(np.sort(shown), np.sort(np.minimum(expected, 1.5)))
    assert "errors beyond 150 % are drawn at the edge" in figure._suptitle.get_text()


def test_no_text_of_a_figure_leaves_it_or_covers_its_neighbour(view: View, run: SimpleNamespace) -> None:
    made_up = replace(view, results={**run.results, "synthetic": True})
    panels = [panel for section in build_sections(made_up).values() for panel in section]
    drawn = [panel.figure for panel in panels if panel.figure is not None]
    assert len(drawn) == 7
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


def test_the_short_table_has_the_models_of_the_paper_and_ours_with_their_titles(run: SimpleNamespace) -> None:
    view = View(run.results)
    table = short_table(view)
    for name, row in zip(short_table_models(view), table.rows, strict=True):
        score = view.main["models"][name]
        low, high = score["mape_ci95"]
        assert row[0] == STYLES[name].label
        of_paper = f"{100 * view.published[name]:.1f}" if name in view.published else "–"
        shown = f"{100 * score['mape']:.1f}", f"{100 * low:.1f}\u00a0to\u00a0{100 * high:.1f}", of_paper
        assert row[1:] == shown
    errors = {name: score["mape"] for name, score in view.main["models"].items()}
    kinds = {STYLES[name].kind for name in errors}
    best = {min((m for m in errors if STYLES[m].kind == kind), key=errors.__getitem__) for kind in kinds}
    assert {"linear4", "linear6"} & best
    assert {*short_table_models(view)} == {*view.published, *best}
    asked = {m: view.main["models"][m] for m in ("constant", "linear4", "physics-paper")}
    few = View({**run.results, "evaluations": [{**view.main, "models": asked}]})
    assert few.published
    assert short_table_models(few) == few.models
    assert "synthetic" not in table.caption
    assert "synthetic" in short_table(View({**run.results, "dataset": "synthetic"})).caption


def test_short_table_is_the_best_of_each_kind_and_holds_the_best_of_all(made_up: MakeRun) -> None:
    view = View(made_up("logs", trips=["a", "b", "c", "d", "e"]).results)
    models = view.main["models"]
    names = short_table_models(view)
    kinds = [STYLES[m].kind for m in names]
    assert names[0] == "constant"
    assert kinds == ["constant", "baseline", "physics", "data", "hybrid"]
    for name in names[1:]:
        rivals = [m for m in models if STYLES[m].kind == STYLES[name].kind]
        assert models[name]["mape"] == min(models[m]["mape"] for m in rivals)
    assert min(m["mape"] for m in models.values()) == min(models[m]["mape"] for m in names)
    few = {**view.main, "models": {m: models[m] for m in ("linear4", "linear6", "physics")}}
    assert short_table_models(View({"evaluations": [few]})) == ["linear4", "linear6", "physics"]
    assert len(short_table(view, whole=True).rows) == len(models) > len(short_table(view).rows)


def test_a_page_holds_the_results_and_keeps_the_rest(run: SimpleNamespace, tmp_path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Title\n<!-- paper:begin -->\nold\n<!-- paper:end -->\ntail\n", encoding="utf-8")
    results = {**run.results, "protocol": "paper"}
    update_results_page(results, page)
    once = page.read_text(encoding="utf-8")
    update_results_page(results, page)
    assert page.read_text(encoding="utf-8") == once
    assert once.startswith("# Title\n<!-- paper:begin -->\n")
    assert once.endswith("\n<!-- paper:end -->\ntail\n")
    assert "\nold\n" not in once
    view = View(results)
    assert all(f"{100 * view.main['models'][m]['mape']:.1f}" in once for m in MODELS)


@pytest.mark.parametrize("text", ["", "<!-- paper:begin -->", "<!-- paper:end --><!-- paper:begin -->"])
def test_a_page_without_its_markers_is_refused_and_left_alone(
    text: str, run: SimpleNamespace, tmp_path
) -> None:
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput, match="no place for the results"):
        update_results_page({**run.results, "protocol": "paper"}, page)
    assert page.read_text(encoding="utf-8") == text


def test_table_cells_are_those_of_the_results(view: View) -> None:
    table = results_table.results_table(view)
    score = view.main["models"]["boosting"]
    rows = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    row = rows[STYLES["boosting"].label]
    assert row["RMSE [kWh]"] == f"{score['rmse_wh'] / 1000:.2f}"
    assert row["Max [%]"] == f"{100 * score['max_ape']:.1f}"
    assert row["The paper [%]"] == "10.3"
    above = f"Above {STYLES[view.best].label} [points]"
    for pair in paired.paired_with(view.results["paired"], view.best):
        cell = rows[STYLES[pair["a"]].label][above].replace("−", "-")
        assert cell.startswith(f"{100 * pair['diff']:.1f} (")
        assert cell.endswith("*") == pair["significant"]
    assert rows[STYLES[view.best].label][above] == "–"
    assert [table.rows[k][0] for k in table.strong] == [STYLES[view.best].label]
    assert results_table.panels(view)[0].caption.startswith(
        "Bold is the model that the others are compared with."
    )
    for other in (table, results_table.sets_table(view)):
        assert {len(cells) for cells in other.rows} == {len(other.columns)}
