"""Forecasts of a trip that are kept while it is driven."""

from __future__ import annotations

from pathlib import Path

from tripwatt.server.cars.folder import FORECASTS
from tripwatt.server.cars.on_the_way import EVERY_S, MadeForecast, OnTheWay, read_forecasts


def test_the_forecasts_of_a_trip_have_a_bound_and_a_distance(tmp_path: Path) -> None:
    path = tmp_path / FORECASTS
    way = OnTheWay(path)
    kept = [way.add(5.0, MadeForecast(k * EVERY_S / 2.0, k, 1.0, 0.5, 2.0)) for k in range(5)]
    assert kept == [True, False, True, False, True]
    assert not way.add(5.0, MadeForecast(1e9, 1.0, float("nan"), 0.5, 2.0))
    assert [row.distance_m for row in read_forecasts(path)[1]] == [0.0, 2.0, 4.0]
    assert way.is_due(6.0, 0.0), "of another trip"
    assert way.add(6.0, MadeForecast(0.0, 0.0, 7.0, 0.5, 9.0))
    assert [row.energy_wh for row in OnTheWay(path).of(6.0)] == [7.0]
    for content in ("{", "[]", '{"start_s": 1, "forecasts": [{}]}', '{"start_s": 1, "forecasts": [1]}'):
        path.write_text(content)
        assert read_forecasts(path) == (None, ())
    assert read_forecasts(tmp_path / "missing") == (None, ())
