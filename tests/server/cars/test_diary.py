"""Scores of a diary by hand."""

from __future__ import annotations

import pandas as pd
import pytest

from tripwatt.server.cars.diary import Diary, Score


def test_scores_by_hand() -> None:
    table = pd.DataFrame(
        {
            "energy_wh": [1000.0, 2000.0, -100.0],
            "forecast_wh": [1200.0, 1900.0, 0.0],
            "low_wh": [1000.0, 1700.0, -50.0],
            "high_wh": [1400.0, 1950.0, 50.0],
            "book_forecast_wh": [900.0, 2100.0, 100.0],
            "book_low_wh": [0.0, 2000.0, -100.0],
            "book_high_wh": [999.0, 3000.0, 200.0],
            "ambient_temperature_degc": [4.9, 5.0, 20.0],
            "cause_air_wh": [300.0, 500.0, 10.0],
            "cause_base_load_wh": [900.0, 1400.0, -10.0],
        }
    )
    score = Score.of(table)
    assert score.trips == 3
    assert score.error == pytest.approx((0.2 + 0.05) / 2), (
        "the trip without consumption has no relative error"
    )
    assert score.weighted_error == pytest.approx((200 + 100 + 100) / 3100)
    assert score.bias == pytest.approx((200 - 100 + 100) / 3100)
    assert score.coverage == pytest.approx(1 / 3), "an interval holds its ends"
    assert score.width == pytest.approx((400 + 250 + 100) / 3100)
    assert score.inside == 1
    assert score.needed_width == pytest.approx(2.0 * score.width), "the third trip lies two half widths away"
    book = Score.of(table, "book_")
    assert book.coverage == pytest.approx(2 / 3)
    assert book.bias == pytest.approx((-100 + 100 + 200) / 3100)
    diary = Diary(table)
    assert {name: s.trips for name, s in diary.by_temperature().items()} == {
        "below 5 °C": 1,
        "5 to 20 °C": 1,
        "20 °C and more": 1,
    }
    assert diary.latest(2)[0].weighted_error == pytest.approx(200 / 2100)
    dated = table.assign(
        started_at=["2023-12-31T23:00:00", "2024-02-29T08:00:00", "2024-03-01T08:00:00"],
        distance_m=[5000.0, 9000.0, 700.0],
    )
    winter, spring = Diary(dated).by_season().items()
    assert winter == (
        "december_to_february",
        {
            "trips": 2,
            "distance_m": 14_000.0,
            "energy_wh": 3000.0,
            "error": pytest.approx(300 / 3000),
            "coverage": 0.5,
        },
    )
    assert (spring[0], spring[1]["trips"], spring[1]["energy_wh"]) == ("march_to_may", 1, -100.0)
    undated = Diary(dated.assign(started_at=["", "2024-08-31T23:59:00", "2024-09-01"]))
    assert list(undated.by_season()) == ["june_to_august", "september_to_november"]
    assert diary.by_cause_wh() == {"air": 810.0, "base_load": 2290.0, "not_forecast": pytest.approx(-200.0)}
    assert sum(diary.by_cause_wh().values()) == pytest.approx(table["energy_wh"].sum())
    nothing = Diary.from_entries([])
    assert nothing.score.to_dict() == {
        "trips": 0,
        "error": None,
        "weighted_error": None,
        "bias": None,
        "coverage": None,
        "width": None,
        "inside": 0,
        "needed_width": None,
    }
    assert nothing.by_cause_wh() == {}
    assert f"{nothing!r}" == "<Diary without a trip>"
