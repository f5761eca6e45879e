"""The benchmark of models that are fitted to own logs, on a few synthetic trips."""

from types import SimpleNamespace

from benchmarks import own_logs, unknown_climb
from benchmarks.measure import Row
from benchmarks.unknown_climb import coverage_rows, shown

import tripwatt as tw
from tripwatt.study.synthetic import synthetic_fleet

SCORE = {
    "n_trips": 104,
    "inside": {"0.5": 52, "0.9": 86, "0.95": 104},
    "coverage_ci95": {"0.5": (0.40, 0.60), "0.9": (0.74, 0.89), "0.95": (0.965, 1.0)},
    "interval_width_wh": dict.fromkeys(own_logs.LEVELS, 299.0),
    "needed_width_wh": dict.fromkeys(own_logs.LEVELS, 378.0),
}


def test_blocks_of_time_are_left_out_whatever_the_order_of_the_trips(monkeypatch):
    evaluated = []
    results = {"evaluations": [{"n_trips": 104, "models": {"hybrid": SCORE}}]}

    def evaluate(trips, *, hold_outs, **options):
        evaluated.append((trips, hold_outs))
        return SimpleNamespace(results=results)

    monkeypatch.setattr(tw, "evaluate", evaluate)
    trips = synthetic_fleet(4).trips
    assert own_logs.held_blocks(trips, tw.load_vehicle("bmw_i3_60ah"), blocks=3) == SCORE
    (given, hold_outs), dates = evaluated[0], [trip.context.started_at for trip in trips]
    assert [trip.context.started_at for trip in given] == sorted(dates) != dates
    assert (hold_outs.n_splits, hold_outs.shuffle) == (3, False)


def test_a_share_that_is_off_its_level_is_named():
    text = own_logs.shown(list(own_logs.rows("sedan", SCORE)), 3)
    assert "| sedan | 90 % | 86 of 104* | 74 to 89 | 0.30 | 0.38 |" in text
    assert "too few trips (Clopper-Pearson, 95 %): sedan, 90 % (86 of 104)." in text
    assert "too many trips (Clopper-Pearson, 95 %): sedan, 95 % (104 of 104)." in text
    assert "| 52 of 104 |" in text


def test_a_figure_beside_its_own_copy_meets_no_bound(monkeypatch):
    trips = synthetic_fleet(2).trips
    monkeypatch.setattr(unknown_climb, "trips_of", lambda *_: (trips, None))
    monkeypatch.setattr(unknown_climb, "region_scale", lambda _: 22.03)
    ours, stale, unused = unknown_climb.region_rows(None, None)
    assert ours.cells.endswith("| 22 | the package has 22 from these logs |  |")
    assert stale.met is False
    assert unused.cells.endswith("| 22 |  |  |")
    assert shown([ours, unused]).endswith("Every bound is met.")
    assert "Stale: twizy" in shown([ours, stale])


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
