"""What is generated is what its source says: the results in README and docs, the page of the command line."""

import json
import re
import shutil
from pathlib import Path

import pytest
from benchmarks import country
from tests.support import ROOT
from tools.docs import accuracy_page, publish_results, write_cli, write_figures
from tools.docs.pages import of_page, without_parts

from tripwatt.vehicles import load_vehicle
from tripwatt.vehicles.comparing import names_data

DOCS = ROOT / "docs"


@pytest.mark.parametrize(("protocol", "model"), [("paper", "boosting"), ("forecast", "hybrid")])
def test_the_page_shows_the_published_results(protocol: str, model: str, tmp_path: Path) -> None:
    page = copied(tmp_path)
    source = DOCS / "results" / f"{protocol}.json"
    copy = publish_results.publish(source, tmp_path / "results", page)
    for name in PAGES:
        assert (tmp_path / name).read_text(encoding="utf-8") == (DOCS / "explanation" / name).read_text(
            encoding="utf-8"
        ), "make results"
    published = source.read_text(encoding="utf-8")
    assert copy.read_text(encoding="utf-8") == published
    changed = json.loads(published)
    for scored in (changed["evaluations"][0], changed.get("studies", changed["evaluations"][0])):
        scored["models"][model]["mape"] = 0.777
        if protocol == "forecast":
            scored["models"][model]["arrival"]["soc"]["coverage_ci95"] = [0.2, 0.3]
    (tmp_path / "results.json").write_text(json.dumps(changed), encoding="utf-8")
    publish_results.publish(tmp_path, tmp_path / "results", page)
    assert "77.7" in page.read_text(encoding="utf-8")
    paper = (tmp_path / "paper.md").read_text(encoding="utf-8")
    assert ("77.7" in paper) == (protocol == "paper")
    off = "90 % of charge in leave one trip out, 58 reference trips: 93 % (20 to 30)"
    uncertainty = (tmp_path / "uncertainty.md").read_text(encoding="utf-8").replace("\u00a0", " ")
    assert (off in uncertainty) == (protocol == "forecast")


def test_values_from_the_scored_logs_are_named_beside_their_figures() -> None:
    page = (DOCS / "explanation" / "results.md").read_text(encoding="utf-8")
    car = load_vehicle("bmw_i3_60ah")
    logged = [key for key, entry in car.entries.items() if names_data(entry, "tum")]
    assert len(logged) == 4
    assert all(f"`{key}`" in page for key in logged)


def test_prose_shows_the_published_figures() -> None:
    for page in write_figures.pages():
        text = page.read_text(encoding="utf-8")
        assert text.count("<!-- fig: ") == text.count("<!-- /fig -->"), page
        assert text.count("<!-- fig: ") == len(write_figures.FIGURE.findall(text)), page
        assert write_figures.filled(text) == text, f"{page}: run tools/docs/write_figures.py"


def test_a_figure_follows_its_file(tmp_path: Path) -> None:
    rows = [{"scheme": "one", "trips": "all, of summer", "diff": -0.0123, "ci95": [-0.02, 0.01]}]
    (tmp_path / "run.json").write_text(json.dumps({"rows": rows, "by": {"0.9": 0.876}}), encoding="utf-8")
    chosen = "run/rows[scheme=one;trips=all, of summer]"
    page = f"a <!-- fig: {chosen}/diff | minus points -->0<!-- /fig --> b <!-- fig: {chosen}/ci95 | minus span -->?<!-- /fig -->"
    shown = write_figures.filled(page, tmp_path)
    assert "-->1.2<!-- /fig --> b" in shown
    assert "-->−1.0 to 2.0<!-- /fig -->" in shown
    assert write_figures.filled(shown, tmp_path) == shown
    assert write_figures.value("run/by/0.9", tmp_path) == 0.876
    assert write_figures.value("run/rows/0/diff", tmp_path) == -0.0123
    with pytest.raises(KeyError, match="scheme=two"):
        write_figures.value("run/rows[scheme=two]/diff", tmp_path)


MEASURED = re.compile(
    r"(?<![\w.])[−+-]?\d+(?:[.,]\d+)?\s?(?:%|(?:percentage )?points\b|k?Wh\b)"
    r"(?!\s(?:band|interval|percentile|bootstrap|level))"
)
ACCURACY = re.compile(
    r"\b(err(?:s|or|ors|ed)?|MAPE|APE|RMSE|cover(?:s|age)?|contains?|inside|within|bias|held|holds|accura\w+|"
    r"width|wide|narrower|better|worse)\b"
)
CODE = re.compile(r"^```.*?^```", re.S | re.M)
SETTINGS = (
    "whole percents and 50 kWh",
    "standard error below 2 %",
    "from the median of the logs",
    "within 6 points of the forecast charge",
    "that are reached with 95 %",
    "a second source agrees within 5 %",
    "intervals of 50, 80, 90 and 95 %",
    "An interval of 90 %",
    "a coverage of 90 %",
    "would have held exactly 90 %",
)
"""Sentences with a bound or a level of the method, which no run gives."""


def typed_figures(text: str) -> list[str]:
    """Sentences with an accuracy figure that no command wrote."""
    for written in (CODE, write_figures.FIGURE):
        text = written.sub("", text)
    text = without_parts(text)
    sentences = (" ".join(part.split()) for part in re.split(r"(?<=[.:;])\s+|\n\n|\n[-|*] ", text))
    found = (part for part in sentences if MEASURED.search(part) and ACCURACY.search(part))
    return [part for part in found if not any(setting in part for setting in SETTINGS)]


def test_no_accuracy_figure_is_typed() -> None:
    found = {page: typed_figures(page.read_text(encoding="utf-8")) for page in write_figures.pages()}
    assert not {page: rows for page, rows in found.items() if rows}


def test_a_typed_accuracy_figure_is_seen() -> None:
    assert typed_figures("Text. The forecast errs by 6.2 % on these trips. The 90 % interval is wide.")
    assert typed_figures("its error is 0.45 points higher")
    assert not typed_figures("The 90 % interval is wide. The car takes 15 kWh.")
    assert not typed_figures("It errs by <!-- fig: a/b | % -->6.2<!-- /fig --> %.")


PAGES = ("results.md", "paper.md", "uncertainty.md")
"""Pages that an evaluation writes."""


def copied(folder: Path) -> Path:
    """Copies of the pages; gives that of the results."""
    for name in PAGES:
        shutil.copy(DOCS / "explanation" / name, folder / name)
    return folder / "results.md"


def test_readme_and_pages_show_every_outside_check() -> None:
    names = ("outside", "cars", "before", "links")
    outside, cars, before, links = map(accuracy_page.published, names)
    shown = accuracy_page.text_of(outside, cars, accuracy_page.planned_rows(before, links))
    assert of_page(accuracy_page.PAGE, "accuracy") == shown, "make results"
    line = accuracy_page.line(cars, before)
    for page in ("../README.md", "index.md", accuracy_page.PAGE):
        assert of_page(page, "line") == line, "make results"
    built_on, *unseen = cars["cars"]
    assert built_on["dataset"] == "tum"
    scores = [(car["without_trips"], car["in_time"][0]) for car in unseen]
    assert all(
        one["trips"] == other["trips"] == car["trips"]
        for car, (one, other) in zip(unseen, scores, strict=True)
    )
    means = [100 * sum(s["error"] for s in each) / len(unseen) for each in zip(*scores, strict=True)]
    assert f"Unseen cars: {means[0]:.1f} %, learning from their trips: {means[1]:.1f} %" in line
    held = [100 * sum(s["coverage"] for s in each) / len(unseen) for each in zip(*scores, strict=True)]
    assert f"intervals hold {held[0]:.0f} and {held[1]:.0f} %" in line
    before["cars"][0]["known"]["before departure, times of another car"]["error"] += 1.0
    assert accuracy_page.line(cars, before) != line
    groups = [check["group"] for check in outside["checks"]]
    assert set(groups) == {"road tests", "certified", "dynamometer"}
    assert {"summer", "winter"} <= {
        c["name"].partition(",")[0] for c in outside["checks"] if c["group"] == "road tests"
    }
    drawn = accuracy_page.figure(outside, cars, accuracy_page.planned_rows(before, links))
    assert all(
        "[" in axes.get_xlabel() for axes in drawn.axes[:1] + [a for f in drawn.subfigs for a in f.axes]
    )


def test_the_page_shows_the_published_figures_of_planned_routes(tmp_path: Path) -> None:
    page = copied(tmp_path)
    published = DOCS / "results" / "links.json"
    copy = publish_results.publish(published, tmp_path / "results", page)
    assert page.read_text(encoding="utf-8") == (DOCS / "explanation" / page.name).read_text(encoding="utf-8")
    assert copy.read_text(encoding="utf-8") == published.read_text(encoding="utf-8")
    changed = json.loads(published.read_text(encoding="utf-8"))
    assert (changed["synthetic"], changed["n_trips"]) == (False, 58)
    shown = page.read_text(encoding="utf-8").partition("<!-- links:begin -->")[2]
    assert "free flow by a proxy from the held-out drive |" in shown
    assert "the driven speed trace itself: the best case |" in shown
    assert "90th percentile of the moving speed of this drive" in shown
    changed["known"]["250 m"]["mape"] = 0.666
    (tmp_path / "results.json").write_text(json.dumps(changed), encoding="utf-8")
    publish_results.publish(tmp_path, tmp_path / "results", page)
    assert "| 66.6 |" in page.read_text(encoding="utf-8")
    for row in changed["known"].values():
        rows = row["by_trip"]
        inside = [r["low_90_wh"] <= r["observed_wh"] <= r["high_90_wh"] for r in rows]
        assert sum(inside) / len(rows) == pytest.approx(row["coverage"]["0.9"])
    trace = changed["known"]["driven trace"]["by_trip"]
    mape = sum(abs(r["energy_wh"] / r["observed_wh"] - 1.0) for r in trace) / len(trace)
    assert mape == pytest.approx(changed["known"]["driven trace"]["mape"])


@pytest.mark.parametrize("protocol", ["paper", "forecast"])
def test_published_results_are_of_real_trips_and_hold_no_samples(protocol: str) -> None:
    published = DOCS / "results" / f"{protocol}.json"
    results = json.loads(published.read_text(encoding="utf-8"))
    assert results["synthetic"] is False
    assert results["evaluations"][0]["n_trips"] == 58
    assert published.stat().st_size < 200_000


def test_page_of_the_command_line_is_complete() -> None:
    page = write_cli.render()
    for name, command in write_cli.commands(write_cli.typer.main.get_command(write_cli.app)):
        assert f"## {name}\n" in page
        assert command.help, name
        for parameter in command.params:
            if parameter.name != "help":
                assert parameter.help, f"{name} {parameter.name}"
                option = parameter.param_type_name == "option"
                shown = parameter.opts if option else [parameter.metavar or parameter.name.upper()]
                assert all(word.replace("|", write_cli.BAR) in page for word in shown), f"{name} {shown}"


def test_table_of_the_departure_is_up_to_date() -> None:
    assert of_page("reference/forecast.md", "departure") == write_cli.departure(), (
        "python -m tools.docs.write_cli"
    )


def test_every_command_teaches_with_examples_that_exist() -> None:
    known = dict(write_cli.commands(write_cli.typer.main.get_command(write_cli.app)))
    page = write_cli.render()
    blocks = re.findall(r"```sh\n(.*?)```", page, flags=re.DOTALL)
    assert len(blocks) == len(known)
    for line in (line for block in blocks for line in block.splitlines() if line.startswith("tripwatt")):
        name = max((n for n in known if line.startswith(n)), key=len)
        options = {option for parameter in known[name].params for option in parameter.opts}
        assert set(re.findall(r"\s(--[a-z-]+)", line)) <= options, line


def test_the_record_of_large_maps_shows_the_published_costs() -> None:
    published = json.loads(country.PUBLISHED.read_text("utf-8"))
    assert country.table(published) == of_page("decisions/page-03-large-maps.md", "country")
