"""The page on the paper is complete, its links lead somewhere, and its numbers are those of the results."""

import json
import re

import pytest
from tests.support import ROOT
from tools.docs.paper_page import FIGURES, SCHEMATICS, on_trip_df, render_paper_page
from tools.docs.paper_rows import CLAIMS, PAPER_TABLE2, RUNS, VERDICTS, Sources, table2_row

from tripwatt.study.report.view import View

PAGE = ROOT / "docs" / "explanation" / "paper.md"


def published(name: str) -> dict:
    return json.loads((ROOT / "docs" / "results" / f"{name}.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def results() -> dict:
    return published("paper")


@pytest.fixture(scope="module")
def page() -> str:
    return PAGE.read_text(encoding="utf-8")


def test_every_element_of_the_paper_is_a_row_with_a_verdict(results: dict, page: str) -> None:
    s = Sources(View(results), published("transfer"), published("paper_claims"))
    named = " ".join(claim.paper for claim in CLAIMS)
    # the paper has nine figures, three tables, and four equations of which the last has no number
    assert {int(n) for n in re.findall(r"Figure (\d)", named)} == set(range(1, 10))
    assert {int(n) for n in re.findall(r"Table (\d)", named)} == {1, 2, 3}
    assert {int(n) for n in re.findall(r"quation (\d)", named)} == {1, 2, 3}
    assert "F(k+1) = F(k) + T(k+1)" in named
    assert len({claim.paper for claim in CLAIMS}) == len(CLAIMS)
    for claim in CLAIMS:
        verdict = claim.verdict if isinstance(claim.verdict, str) else claim.verdict(s)
        assert verdict in VERDICTS, claim.paper
        assert page.count(f"| {claim.paper} | {verdict} |") == 1, claim.paper
        assert set(claim.run.split(", ")) <= {*RUNS, ""}, claim.paper
    for key in re.findall(r"\]\(#([\w-]+)\)", page):
        assert page.count(f'<a id="{key}"></a>') == 1, key


def test_a_verdict_follows_its_figure(results: dict) -> None:
    claims = published("paper_claims")
    claims["figure3"]["fits"]["cumulative energy"] |= {"below": 6, "expected": 5.8}
    claims["figure3"]["correlation_of_rows"]["t"] = 0.01
    claims["table2"][0] |= {"distance": 0.5, "intercept": 1500.0}
    transfer = published("transfer")
    for row in transfer["rows"]:
        row["less_physics"] = -0.01
    text = render_paper_page(results, transfer, claims)
    for row in (
        "Figure 3: the residuals match the quantiles of the t",
        "Table 2: EDF of the smooths",
        "Table 2: intercept 1537.44 (938.99)",
        "§2.2: longitudinal models remove the dependence of rows",
        "§1, §4: vehicle and external factors are apart, so a model serves another car without loss",
    ):
        assert f"| {row} | yes |" in text
        assert f"| {row} | yes |" not in render_paper_page(
            results, published("transfer"), published("paper_claims")
        )


def test_rows_follow_the_paper() -> None:
    order = ("Abstract", "§1", "§2.1", "§2.2", "§2.3", "§3", "§3.1", "§3.2", "§3.3", "§3.4", "§4")
    places = [re.match(r"(Abstract|§[\d.]*\d)", claim.paper) for claim in CLAIMS]
    found = [order.index(place[1]) for place in places if place]
    assert found == sorted(found)


def test_every_figure_of_the_page_is_committed(page: str) -> None:
    shown = set(re.findall(r"\]\(\.\./(images/[^)]+)\)", page))
    assert shown == {f"images/paper-{name}.png" for name in (*FIGURES, *SCHEMATICS)}
    assert shown == {f"images/{file.name}" for file in (PAGE.parents[1] / "images").glob("paper-*.png")}
    for name in shown:
        assert (PAGE.parents[1] / name).stat().st_size < 150_000


def test_the_numbers_of_the_page_are_those_of_the_results(results: dict, page: str) -> None:
    for name, text in PAPER_TABLE2.items():
        (line,) = [line for line in page.splitlines() if line.startswith(f"| {name} |")]
        assert text.replace(" ", "\u00a0") in line.replace(" ", "\u00a0").replace("\u00a0|", " |"), name
    models = results["studies"]["models"]
    own = set(results["evaluations"][0]["models"]) - {"physics-paper", "gamm", "boosting", "forest"}
    for name, score in models.items():
        if name not in own:  # the page of results has them
            assert f"{100 * score['mape']:.1f}" in page, name
    changed = json.loads(json.dumps(results))
    changed["studies"]["models"]["physics-brochure"]["mape"] = 0.4321
    changed["studies"]["models"]["boosting-ar1"]["mape"] = 0.9876
    text = render_paper_page(changed, published("transfer"), published("paper_claims"))
    assert "| 43.2 |" in text
    assert "/ 98.8 %" in text
    assert "| 43.2 |" not in page


def test_the_nearest_form_and_the_bars_are_those_of_the_published_results(results: dict) -> None:
    models = results["studies"]["models"]
    forms = {name: score["mape"] for name, score in models.items() if name.startswith("physics-")}
    assert min(forms, key=lambda name: abs(forms[name] - 0.379)) == results["studies"]["nearest"]
    assert results["evaluations"][0]["models"]["forest"]["mape"] <= 0.106
    assert results["evaluations"][0]["models"]["boosting"]["mape"] <= 0.103
    assert models["gamm-chosen"]["mape"] <= 0.115
    for name in ("gamm", "forest", "boosting"):
        assert models[f"{name}-brochure"]["improved_share"] > 0.9
        assert models[name]["improved_share"] < 0.9
    for name in ("gamm", "boosting"):
        assert sum(results["studies"]["choices"][f"{name}-chosen"].values()) == 58


def test_reference_df_give_the_number_of_trips_of_the_papers_fit(results: dict) -> None:
    said = on_trip_df(View(results))
    assert "are those of 64 trips, not of 72" in said  # 57 + intercept + 6 weathers with a standard error
    rows = {table2_row(r)[0]: r for r in results["table2"]}
    known = sum(name.startswith("weather: ") and r["std_error"] > 0 for name, r in rows.items())
    assert rows["s(trip)"]["ref_df"] == pytest.approx(58 - 1 - known, abs=0.01)
    assert rows["s(ambient temperature):winter"]["ref_df"] == pytest.approx(1.0, abs=0.01)
    assert rows["s(ambient temperature, elevation difference)"]["ref_df"] == pytest.approx(27.0, abs=0.01)
