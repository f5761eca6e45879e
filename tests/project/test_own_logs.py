"""The benchmark of models that are fitted to own logs, on a few synthetic trips."""

import json

from benchmarks import own_logs
from benchmarks.measure import Row
from benchmarks.unknown_climb import coverage_rows, shown
from tools import DOCS
from tools.docs.pages import of_page

import tripwatt as tw


def test_blocks_of_time_are_left_out_whatever_the_order_of_the_trips(monkeypatch):
    trips = tw.synthetic_fleet(12).trips
    evaluate, given = tw.evaluate, []
    monkeypatch.setattr(tw, "evaluate", lambda some, **rest: given.append(some) or evaluate(some, **rest))
    score = own_logs.held_blocks(trips, tw.load_vehicle("bmw_i3_60ah"), blocks=3)
    dates = [trip.context.started_at for trip in given[0]]
    assert dates == sorted(dates) != [trip.context.started_at for trip in trips]
    assert score["n_trips"] == 12
    levels = list(own_logs.rows("car", score))
    assert [row["level"] for row in levels] == ["50 %", "90 %", "95 %"]
    inside = [int(row["inside"].split()[0]) for row in levels]
    assert 0 < inside[0] <= inside[1] <= inside[2] <= 12


def test_a_share_that_is_off_its_level_is_named():
    score = {
        "n_trips": 104,
        "inside": {"0.5": 52, "0.9": 86, "0.95": 104},
        "coverage_ci95": {"0.5": (0.40, 0.60), "0.9": (0.74, 0.89), "0.95": (0.965, 1.0)},
        "interval_width_wh": dict.fromkeys(own_logs.LEVELS, 299.0),
        "needed_width_wh": dict.fromkeys(own_logs.LEVELS, 378.0),
    }
    text = own_logs.shown(list(own_logs.rows("sedan", score)), 3)
    assert "| sedan | 90 % | 86 of 104* | 74 to 89 | 0.30 | 0.38 |" in text
    assert "too few trips (Clopper-Pearson, 95 %): sedan, 90 % (86 of 104)." in text
    assert "too many trips (Clopper-Pearson, 95 %): sedan, 95 % (104 of 104)." in text
    assert "| 52 of 104 |" in text


def test_the_pages_name_the_one_car_of_all_sets():
    for page in ("explanation/uncertainty.md", "explanation/evaluation.md"):
        text = of_page(page, "coverage")
        assert "one car, a BMW i3 60 Ah" in text
        assert "Over 8 sets" in text
        assert "8 ways" in text


def test_a_missed_bound_stands_in_words_and_no_bound_is_met_by_every_figure():
    wide = Row("sedan, unknown", 1.0, least=0.85, most=0.97)
    narrow = Row("twizy, unknown", 0.5, least=0.85, most=0.97)
    text = shown([wide, narrow, Row("free", 7.0)]).splitlines()[-1]
    assert "Too wide: sedan, unknown (1, " in text
    assert "Too narrow: twizy, unknown (0.5, " in text
    assert "free" not in text
    for bound in (True, False):
        ends = list(coverage_rows("twizy", [True] * 15 + [False] * 2, bound))
        assert [row.bounds for row in ends] == (["≤ 0.9", "≥ 0.9"] if bound else ["", ""])


def test_the_cars_whose_interval_is_too_wide_are_those_that_the_page_names():
    cars = json.loads((DOCS / "results" / "cars.json").read_text(encoding="utf-8"))["cars"]
    wide = [car["car"] for car in cars if car["without_trips"]["coverage_ci95"][0] > 0.9]
    page = (DOCS / "explanation" / "cars.md").read_text(encoding="utf-8")
    said = page.partition("**Without own trips the 90 % interval is too wide** for two")[2].partition("\n\n")[
        0
    ]
    assert wide == [name for name in (car["car"] for car in cars) if f"[car={name}]" in said]
    assert len(wide) == 2
