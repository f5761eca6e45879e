"""What is kept of a held-out forecast: its arrays, its updates, its charge at arrival."""

import numpy as np
import pandas as pd
import pytest
from tests.support.held_out import EXACT, NO, Told, driven_log

from tripwatt.study.evaluation import held_out_forecasts
from tripwatt.study.evaluation.forecast_scores import (
    FRACTIONS,
    LEVELS,
    UPDATES,
)
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecasts, arrivals_of, reforecast
from tripwatt.trips import Departure, Plan


class TestReforecast:
    def test_after_a_quarter(self) -> None:
        """25 s: 50 Wh measured where 15 Wh were planned; 125 of 1000 m."""
        forecast = Told()
        log = driven_log(soc=[0.5, NO, NO, NO, 0.4, 0.3], displayed_soc=NO, heating_power_w=1.0)
        found = dict(zip(UPDATES, reforecast(forecast, log, 0.25), strict=True))
        assert found["update"] == 3000.0
        assert found["soc_only"] == 2000.0
        assert found["no_update"] == pytest.approx(50.0 + 100.0 - 15.0, **EXACT)
        assert found["naive_gauge"] == pytest.approx(400.0, **EXACT)
        assert found["update_low"] == pytest.approx(3000.0 - 9.0, **EXACT)
        assert found["update_high"] == pytest.approx(3000.0 + 18.0, **EXACT)
        energy, charge = forecast.told
        assert list(energy.columns) == ["time_s", "observed_energy_wh", "heating_power_w"]
        assert list(charge.columns) == ["time_s", "soc"]
        assert energy["time_s"].tolist() == [0.0, 10.0, 20.0, 25.0]

    def test_without_charge_or_motion(self) -> None:
        log = driven_log(soc=[NO, NO, NO, NO, 0.4, 0.3]).assign(distance_m=0.0)
        found = dict(zip(UPDATES, reforecast(Told(), log, 0.25), strict=True))
        assert np.isnan(found["soc_only"])
        assert found["naive_gauge"] == 100.0

    def test_before_the_second_sample(self) -> None:
        found = reforecast(Told(), driven_log(), 0.09)
        assert found == pytest.approx([100.0, NO, 100.0, 100.0, 91.0, 118.0], nan_ok=True, **EXACT)
        assert reforecast(Told(), driven_log(), 0.10)[0] == 2000.0


def test_what_is_kept_of_forecasts(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = np.full((2, 3), NO), np.full((2, 13), NO)
    monkeypatch.setattr(held_out_forecasts, "arrivals_of", lambda model, plan: nothing)
    logs = [driven_log(displayed_soc=[0.8, 0.7, 0.6, 0.5, 0.45, NO]), driven_log()]
    kept = HeldOutForecasts.from_forecasts(None, ["plan"] * 2, [Told(), Told(200.0)], logs)
    levels = (np.arange(100) + 0.5) / 100
    assert kept.factors == pytest.approx(np.array([4.0 * levels] * 2), **EXACT)
    assert kept.low_wh[1] == pytest.approx([200.0 - 10.0 * level for level in LEVELS], **EXACT)
    assert kept.high_wh[0] == pytest.approx([100.0 + 20.0 * level for level in LEVELS], **EXACT)
    assert kept.pit == pytest.approx([0.22, 0.22], **EXACT)  # of 220 Wh at the end of the log
    assert kept.flags.tolist() == [2, 2]
    assert kept.sd_wh.tolist() == [10.0, 10.0]
    assert kept.cause_names.tolist() == ["air", "climate"]
    assert kept.causes_wh.tolist() == [[60.0, 40.0]] * 2
    assert kept.updates_wh.shape == (2, len(FRACTIONS), len(UPDATES))
    assert kept.updates_wh[0, 1, 0] == 2000.0
    assert kept.shown == pytest.approx([0.45, NO], nan_ok=True)
    assert kept.arrival.shape == (2, 2, 3)
    assert kept.arrival_chance.shape == (2, 2, 13)
    assert kept.series_rows.tolist() == [3, 3]
    assert kept.series[:, 1].tolist() == [0.0, 30.0, 100.0] * 2
    assert kept.series_names.tolist() == ["time_s", "energy_wh", "distance_m"]


def test_arrivals_from_each_charge() -> None:
    """From the display and from the battery management alone; nothing where one is not known."""
    seen = []

    class Model:
        def forecast(self, plan):
            seen.append((plan.departure.soc, plan.departure.bms_soc))
            return Told()

    samples = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": 1.0})
    (both, chance), (one, none) = (
        arrivals_of(Model(), Plan.from_samples(name, samples, departure))
        for name, departure in (("a", Departure(soc=0.8, bms_soc=0.7)), ("b", Departure(bms_soc=0.6)))
    )
    assert seen == [(0.8, None), (None, 0.7), (None, 0.6)]
    known = [0.4, 0.4 - 0.09, 0.4 + 0.18]
    assert both == pytest.approx(np.array([known, known]), **EXACT)
    assert np.isnan(one[0]).all()
    assert one[1] == pytest.approx(known, **EXACT)
    offsets = np.round(np.arange(-6, 7) * 0.01, 2)
    assert chance.shape == (2, 13)
    assert chance[0] == pytest.approx(1.0 - (0.4 + offsets), **EXACT)
    assert np.isnan(none[0]).all()


def kept(k: float, series=((0.0, 0.0), (10.0, 50.0)), rows=(2,)) -> HeldOutForecasts:
    """Forecasts of some trips whose values are those of one trip and `k`; the second column of the series has `k` more."""
    n, series = len(rows), np.array(series)
    return HeldOutForecasts(
        sd_wh=np.full(n, 10.0 + k),
        low_wh=np.tile([1.0 + k, 2.0 + k, 3.0 + k, 4.0 + k], (n, 1)),
        high_wh=np.tile([5.0 + k, 6.0 + k, 7.0 + k, 8.0 + k], (n, 1)),
        factors=np.tile([1.0, 3.0], (n, 1)),
        pit=np.full(n, 0.1 * k),
        flags=np.full(n, k, dtype=int),
        causes_wh=np.tile([1.0 + k, 2.0 + k], (n, 1)),
        cause_names=np.array(["air", "climate"]),
        updates_wh=np.tile(1000.0 * k + np.arange(24.0).reshape(1, 4, 6), (n, 1, 1)),
        shown=np.full(n, 0.2 + k),
        arrival=np.full((n, 2, 3), 0.3 + k),
        arrival_chance=np.full((n, 2, 13), 0.4 + k),
        series=series + np.array([0.0, k]),
        series_names=np.array(["time_s", "energy_wh"]),
        series_rows=np.array(rows),
    )
