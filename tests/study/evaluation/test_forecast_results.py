"""Held-out forecasts in the order of the trips, and what follows from them."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from tests.support.held_out import NO, Trips

from tripwatt.learners.folds import Split
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.forecast_results import (
    departure_table,
    forecast_frame,
    learning_curve,
)
from tripwatt.study.evaluation.forecast_scores import (
    FORECAST,
)
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecast
from tripwatt.study.evaluation.tasks import FoldResult
from tripwatt.trips import Context, Departure, Plan

EXACT = {"rel": 1e-9, "abs": 1e-12}


def fold(trips, values, model=FORECAST, forecasts=None) -> FoldResult:
    split = Split(0, np.empty(0, np.int64), np.asarray(trips))
    return FoldResult(model, split, np.asarray(values, dtype=float), 0.0, 0.0, forecasts=forecasts)


def kept(k: float) -> HeldOutForecast:
    """The forecast of a trip, of which all values are `k` more than those of another."""
    return HeldOutForecast(
        sd_wh=10.0 + k,
        bounds_wh=np.column_stack([np.arange(1.0, 5.0), np.arange(5.0, 9.0)]) + k,
        factors=np.array([1.0, 3.0]),
        pit=0.1 * k,
        flags=int(k),
        updates_wh=1000.0 * k + np.arange(24.0).reshape(4, 6),
        shown=0.2 + k,
        arrival=np.full((2, 3), 0.3 + k),
        arrival_chance=np.full((2, 13), 0.4 + k),
    )


class TestResults:
    def test_folds_in_the_order_of_the_trips(self) -> None:
        """Trips 0 and 2 are in one fold, 1 and 4 in the other; trip 3 is for training alone."""
        table = SimpleNamespace(offsets=np.arange(6))
        results = (fold([1, 4], [2.0, 5.0]), fold([0, 2], [1.0, 3.0]))
        comparison = Comparison(SimpleNamespace(table=table), (), results)
        assert comparison.energies_wh(FORECAST).tolist() == [1.0, 2.0, 3.0, 5.0]
        assert comparison.forecasts(FORECAST) == []

    def test_forecasts_in_the_order_of_the_trips(self) -> None:
        results = (
            fold([0, 2], [0.0, 0.0], forecasts=[kept(0.0), kept(2.0)]),
            fold([1], [0.0], forecasts=[kept(1.0)]),
        )
        found = Comparison(None, (), results).forecasts(FORECAST)
        assert [forecast.sd_wh for forecast in found] == [10.0, 11.0, 12.0]

    def test_frame(self) -> None:
        """Two folds of a trip each, given in the wrong order."""
        samples = pd.DataFrame({"time_s": [0.0, 10.0], "speed_m_s": 10.0, "elevation_m": [500.0, 507.0]})
        plans = [Plan.from_trace(name, samples, Departure(ambient_temperature_degc=-3.0)) for name in "ab"]
        trips = [SimpleNamespace(context=Context(driver=name)) for name in "xy"]
        own = SimpleNamespace(plans=plans, table=SimpleNamespace(trips=trips))
        pair = np.array([0, 1])
        hold_out = SimpleNamespace(table=Trips("ab"), tested=pair, scored=pair, data=own)
        results = (
            fold([1], [200.0], forecasts=[kept(1.0)]),
            fold([0], [100.0], forecasts=[kept(0.0)]),
            fold([0], [9.0], model="other"),
        )
        part = pd.DataFrame(
            {
                "trip": ["a", "b"],
                "observed_energy_wh": [110.0, 190.0],
                "predicted_energy_wh": [100.0, 200.0],
            }
        )
        comparison = Comparison(hold_out, (), results)
        rows = forecast_frame(hold_out, comparison.forecasts(FORECAST), part)
        assert rows["trip"].tolist() == ["a", "b"]
        assert rows["sd_wh"].tolist() == [10.0, 11.0]
        assert rows["low_50"].tolist() == [1.0, 2.0]
        assert rows["high_95"].tolist() == [8.0, 9.0]
        assert rows["update_10"].tolist() == [0.0, 1000.0]
        assert rows["soc_only_25"].tolist() == [7.0, 1007.0]
        assert rows["update_high_75"].tolist() == [23.0, 1023.0]
        assert rows["flags"].tolist() == [0, 1]
        assert rows["net_climb_m"].tolist() == [7.0, 7.0]
        assert rows["driver"].tolist() == ["x", "y"]
        assert comparison.forecasts("other") == comparison.forecasts("third") == []

    def test_about_trips(self) -> None:
        samples = pd.DataFrame({"time_s": [0.0, 10.0], "speed_m_s": 10.0})
        known = Departure(battery_temperature_degc=4.0)
        plans = [
            Plan.from_trace("a", samples.assign(elevation_m=[9.0, 4.0]), known),
            Plan.from_trace("b", samples),
        ]
        trips = [SimpleNamespace(context=Context(driver=name)) for name in ("x", None)]
        own = SimpleNamespace(plans=plans, table=SimpleNamespace(trips=trips))
        rows = departure_table(own, np.array([1, 0]))
        assert rows["trip"].tolist() == ["b", "a"]
        assert rows["net_climb_m"].tolist() == pytest.approx([NO, -5.0], nan_ok=True)
        assert rows["battery_temperature_degc"].tolist() == pytest.approx([NO, 4.0], nan_ok=True)
        assert rows["ambient_temperature_degc"].isna().all()
        assert rows["distance_m"].tolist() == [plans[1].distance_m, plans[0].distance_m]
        assert rows["duration_s"].tolist() == [plans[1].duration_s, plans[0].duration_s]


def test_learning_curve_is_the_mean_over_trips_of_a_draw_and_over_draws():
    """Of twelve trips of 1000 Wh, two or one are scored."""

    def draw(size: int, number: int, hybrid: list[float], data: list[float]) -> list[FoldResult]:
        split = Split(0, np.arange(size), 12 - len(hybrid) + np.arange(len(hybrid)), number)
        both = {"hybrid": hybrid, "boosting-only": data}
        return [FoldResult(name, split, 1000.0 * (1.0 + np.array(e)), 0.0, 0.0) for name, e in both.items()]

    segments = SimpleNamespace(observed_power_w=np.full(12, 1000.0), totals_wh=lambda power: power)
    results = (
        *draw(10, 1, [0.3, 0.1], [0.5, 0.5]),
        *draw(5, 0, [0.4], [0.6]),
        *draw(10, 0, [0.1], [0.2]),
    )
    hold_out = SimpleNamespace(data=SimpleNamespace(segments=segments))
    rows = learning_curve(SimpleNamespace(hold_out=hold_out, results=results), seed=0)
    assert [(row["n_trips"], row["draws"]) for row in rows] == [(5, 1), (10, 2)]
    assert rows[1]["hybrid_by_draw"] == pytest.approx([0.1, 0.2], **EXACT)
    assert rows[1]["hybrid"] == pytest.approx(0.15, **EXACT)
    assert rows[1]["boosting-only"] == pytest.approx(0.35, **EXACT)
    assert rows[1]["diff"] == pytest.approx(-0.2, **EXACT)
    assert rows[1]["diff_ci95"] is None
