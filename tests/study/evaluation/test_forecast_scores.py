"""Scores of a probabilistic forecast by hand."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.study.evaluation.forecast_scores import (
    FRACTIONS,
    LEVELS,
    RESERVE_OFFSETS,
    UPDATES,
    arrival_scores,
    coverage_scores,
    crps,
    crps_scores,
    reliability,
    strata_of,
    strata_scores,
    symmetric_quantiles,
    update_scores,
)
from tripwatt.uncertainty.coverage import clopper_pearson

EXACT = {"rel": 1e-9, "abs": 1e-12}


def test_crps_of_quantiles_by_hand():
    # levels 1/4 and 3/4; twice the pinball loss, averaged
    low, high = 2.0 * 0.25 * (5.0 - 3.0), 2.0 * 0.25 * (7.0 - 5.0)
    inside = crps(np.array([5.0]), np.array([[3.0, 7.0]]))
    assert inside[0] == pytest.approx((low + high) / 2, **EXACT)
    above = crps(np.array([10.0]), np.array([[3.0, 7.0]]))
    assert above[0] == pytest.approx((2 * 0.25 * 7.0 + 2 * 0.75 * 3.0) / 2, **EXACT)
    below = crps(np.array([1.0]), np.array([[3.0, 7.0]]))
    assert below[0] == pytest.approx((2 * 0.75 * 2.0 + 2 * 0.25 * 6.0) / 2, **EXACT)


def test_symmetric_quantiles_ascend_around_the_centre():
    found = symmetric_quantiles(np.array([10.0, 20.0]), np.array([[1.0, 3.0], [2.0, 8.0]]))
    np.testing.assert_allclose(found, [[7.0, 9.0, 11.0, 13.0], [12.0, 18.0, 22.0, 28.0]], rtol=1e-12)


def test_the_crps_of_a_number_is_its_absolute_error():
    observed, predicted = np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, -2.0])
    assert crps(observed, predicted[:, None]).tolist() == pytest.approx([1.0, 0.0, 5.0], **EXACT)


def test_crps_with_own_and_with_one_width():
    observed, centre, sd = np.array([12.0, 20.0]), np.array([10.0, 20.0]), np.array([1.0, 3.0])
    factors = np.array([[1.0], [1.0]])

    def score(first: float, second: float) -> float:
        # quantiles centre -+ sd at levels 1/4 and 3/4
        one = (0.25 * (12.0 - (10.0 - first)) + _pinball(0.75, 12.0 - (10.0 + first))) * 2 / 2
        two = (0.25 * second + 0.25 * second) * 2 / 2
        return (one + two) / 2

    scores = crps_scores(observed, centre, sd, factors)
    assert scores["crps_wh"] == pytest.approx(score(1.0, 3.0), **EXACT)
    assert scores["crps_same_width_wh"] == pytest.approx(score(2.0, 2.0), **EXACT)
    best = min(score(2.0 * s, 2.0 * s) for s in np.geomspace(0.25, 4.0, 49))
    assert scores["crps_best_same_width_wh"] == pytest.approx(best, **EXACT)


def _pinball(level: float, error: float) -> float:
    return level * error if error > 0 else (level - 1.0) * error


def test_coverage_and_width_by_level():
    observed = np.array([10.0, 20.0, 30.0, 40.0])
    half = np.array([[1.0, 2.0, 4.0, 9.0]] * 3 + [[2.0, 4.0, 8.0, 18.0]])
    centre = np.array([11.0, 17.0, 22.0, 40.0])[:, None]  # the first two lie on a bound: inside
    scores = coverage_scores(observed, centre - half, centre + half, seed=0)
    assert LEVELS == (0.5, 0.8, 0.9, 0.95)
    assert scores["coverage"] == {"0.5": 0.5, "0.8": 0.5, "0.9": 0.75, "0.95": 1.0}
    assert scores["interval_width_wh"] == {"0.5": 2.5, "0.8": 5.0, "0.9": 10.0, "0.95": 22.5}
    assert scores["coverage_ci95"]["0.9"] == clopper_pearson(3, 4)
    assert scores["coverage_bootstrap95"]["0.95"] == (1.0, 1.0)
    above = coverage_scores(observed, centre - 100.0 * half, observed[:, None] - 1e-6 * half, seed=0)
    assert set(above["coverage"].values()) == {0.0}
    below = coverage_scores(observed, observed[:, None] + 1e-6 * half, centre + 100.0 * half, seed=0)
    assert set(below["coverage"].values()) == {0.0}


def test_updates_against_their_baselines():
    observed = np.array([1000.0, 2000.0, 400.0])
    one = {
        "update": [1100.0, 1900.0, 400.0],
        "soc_only": [1300.0, np.nan, 500.0],
        "no_update": [1200.0, 1800.0, 440.0],
        "naive_gauge": [700.0, 2200.0, 300.0],
        "update_low": [1000.0, 1700.0, 401.0],
        "update_high": [1200.0, 2000.0, 500.0],
    }
    assert set(one) == set(UPDATES)
    energies = np.array([[[one[name][trip] for name in UPDATES] for _ in FRACTIONS] for trip in range(3)])
    scores = update_scores(observed, energies, seed=0)
    assert list(scores) == ["0.1", "0.25", "0.5", "0.75"]
    for found in scores.values():
        assert found["mape"] == pytest.approx((0.1 + 0.05 + 0.0) / 3, **EXACT)
        assert found["no_update"] == pytest.approx((0.2 + 0.1 + 0.1) / 3, **EXACT)
        assert found["naive_gauge"] == pytest.approx((0.3 + 0.1 + 0.25) / 3, **EXACT)
        assert found["soc_only"] == pytest.approx((0.3 + 0.25) / 2, **EXACT)
        assert found["diff"] == pytest.approx((-0.1 - 0.05 - 0.1) / 3, **EXACT)
        assert found["diff_gauge"] == pytest.approx((-0.2 - 0.05 - 0.25) / 3, **EXACT)
        assert found["significant"]
        assert found["diff_ci95"] == pytest.approx((-0.1, -0.05), abs=1e-9)
        assert found["diff_gauge_ci95"] == pytest.approx((-0.25, -0.05), abs=1e-9)
        assert found["mape_ci95"] == pytest.approx((0.0, 0.1), abs=1e-9)
        assert found["coverage"] == pytest.approx(2 / 3, **EXACT)  # on a bound is inside
        assert found["interval_width_wh"] == pytest.approx((200.0 + 300.0 + 99.0) / 3, **EXACT)
    on_one_day = update_scores(observed, energies, 0, ["mon"] * 3)["0.5"]
    assert on_one_day["diff_ci95"] == pytest.approx([on_one_day["diff"]] * 2, abs=1e-9)
    assert on_one_day["diff_gauge_ci95"] == pytest.approx([on_one_day["diff_gauge"]] * 2, abs=1e-9)
    without = energies.copy()
    without[:, :, UPDATES.index("soc_only")] = np.nan
    assert update_scores(observed, without, seed=0)["0.5"]["soc_only"] is None


def test_strata_hold_their_bounds():
    trips = pd.DataFrame(
        {
            "net_climb_m": [-10.0, -10.1, 0.0, np.nan],
            "battery_temperature_degc": [4.9, 5.0, 28.0, 28.1],
            "ambient_temperature_degc": [4.9, 5.0, 15.0, 25.0],
            "distance_m": [9_999.0, 10_000.0, 20_000.0, 40_000.0],
            "duration_s": [1_200.0, 1_200.0, 1_440.0, 3_600.0],  # 30, 30, 50, 40 km/h
            "driver": ["a", "b", "a", None],
        }
    )
    found = {key: members.tolist() for key, members in strata_of(trips).items()}
    yes, no = True, False
    assert found == {
        ("road", "net descent of more than 10 m"): [no, yes, no, no],
        ("road", "no net descent"): [yes, no, yes, no],
        ("battery", "below 5 °C"): [yes, no, no, no],
        ("battery", "5 to 28 °C"): [no, yes, yes, no],
        ("battery", "above 28 °C"): [no, no, no, yes],
        ("ambient", "below 5 °C"): [yes, no, no, no],
        ("ambient", "5 to 15 °C"): [no, yes, no, no],
        ("ambient", "15 to 25 °C"): [no, no, yes, no],
        ("ambient", "25 °C or more"): [no, no, no, yes],
        ("length", "below 10 km"): [yes, no, no, no],
        ("length", "10 to 20 km"): [no, yes, no, no],
        ("length", "20 to 40 km"): [no, no, yes, no],
        ("length", "40 km or more"): [no, no, no, yes],
        ("mean speed", "below 30 km/h"): [yes, no, no, no],
        ("mean speed", "30 to 50 km/h"): [no, yes, no, yes],
        ("mean speed", "50 km/h or more"): [no, no, yes, no],
        ("driver", "a"): [yes, no, yes, no],
        ("driver", "b"): [no, yes, no, no],
    }


def test_scores_by_stratum():
    trips = pd.DataFrame(
        {
            "net_climb_m": [-50.0, 5.0, 5.0],
            "battery_temperature_degc": np.nan,
            "ambient_temperature_degc": np.nan,
            "distance_m": 5_000.0,
            "duration_s": 600.0,
            "driver": None,
        },
        index=range(3),
    )
    strata = {key: members for key, members in strata_of(trips).items() if key[0] == "road"}
    down, flat = strata_scores(strata, np.array([0.3, 0.1, 0.2]), np.array([0.1, 0.4, 0.6]), seed=0)
    assert (down["n_trips"], flat["n_trips"]) == (1, 2)
    assert (down["hybrid"], flat["hybrid"]) == pytest.approx((0.3, 0.15), **EXACT)
    assert (down["boosting-only"], flat["boosting-only"]) == pytest.approx((0.1, 0.5), **EXACT)
    assert (down["diff"], flat["diff"]) == pytest.approx((0.2, -0.35), **EXACT)
    assert down["diff_ci95"] is None
    assert flat["diff_ci95"] == pytest.approx((-0.4, -0.3), abs=1e-9)
    assert "boosting-only" not in strata_scores(strata, np.array([0.3, 0.1, 0.2]), None, seed=0)[0]


def test_arrival_by_what_was_known_at_departure():
    shown = np.array([0.50, 0.30, 0.10, np.nan])
    from_display = [[0.52, 0.48, 0.56], [0.29, 0.30, 0.35], [0.20, 0.15, 0.25], [0.4, 0.3, 0.5]]
    arrival = np.array([[row, [np.nan] * 3] for row in from_display])
    chance = np.full((4, 2, len(RESERVE_OFFSETS)), 0.5)
    found = arrival_scores(shown, arrival, chance, seed=0)
    assert found["bms_soc"] is None
    scores = found["soc"]
    assert scores["n_trips"] == 3
    assert scores["mae"] == pytest.approx((0.02 + 0.01 + 0.10) / 3, **EXACT)
    assert scores["bias"] == pytest.approx((0.02 - 0.01 + 0.10) / 3, **EXACT)
    assert scores["coverage"] == pytest.approx(2 / 3, **EXACT)  # on a bound is inside
    assert scores["coverage_ci95"] == clopper_pearson(2, 3)
    assert scores["interval_width"] == pytest.approx((0.08 + 0.05 + 0.10) / 3, **EXACT)
    # reserves of the first trip from 0.46 to 0.58: it had 0.50, so five of 13 were met; the others nine and none
    (row,) = scores["reliability"]
    assert len(RESERVE_OFFSETS) == 13
    met = sum(0.52 + o <= 0.50 for o in RESERVE_OFFSETS) + sum(0.29 + o <= 0.30 for o in RESERVE_OFFSETS)
    assert row["observed"] == pytest.approx(met / 39, **EXACT)
    assert row["share"] == 1.0


def test_reliability_by_tenths_and_over_trips():
    chance = np.array([[0.05, 0.15, 0.95], [0.08, 0.55, 1.0]])
    happened = np.array([[False, True, True], [False, False, True]])
    rows = reliability(chance, happened, seed=0)
    assert [row["stated"] for row in rows] == pytest.approx([0.065, 0.15, 0.55, 0.975], **EXACT)
    assert [row["observed"] for row in rows] == [0.0, 1.0, 0.0, 1.0]
    assert [row["share"] for row in rows] == pytest.approx([2 / 6, 1 / 6, 1 / 6, 2 / 6], **EXACT)
    mixed = reliability(np.full((2, 4), 0.7), np.array([[True] * 4, [False] * 4]), seed=0)
    assert mixed[0]["observed"] == 0.5
    assert mixed[0]["observed_ci95"] == (0.0, 1.0)  # two trips are two pieces of evidence, not eight
