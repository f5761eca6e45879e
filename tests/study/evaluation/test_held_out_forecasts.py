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
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecast, forecast_arrivals, reforecast
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


def test_what_is_kept_of_a_forecast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(held_out_forecasts, "forecast_arrivals", lambda model, plan: ("bounds", "chances"))
    log = driven_log(displayed_soc=[0.8, 0.7, 0.6, 0.5, 0.45, NO])
    kept = HeldOutForecast.from_forecast(None, "plan", Told(), log)
    assert kept.factors == pytest.approx(4.0 * (np.arange(100) + 0.5) / 100, **EXACT)
    assert kept.bounds_wh[:, 0] == pytest.approx([100.0 - 10.0 * level for level in LEVELS], **EXACT)
    assert kept.bounds_wh[:, 1] == pytest.approx([100.0 + 20.0 * level for level in LEVELS], **EXACT)
    assert kept.pit == pytest.approx(0.22, **EXACT)  # of 220 Wh at the end of the log
    assert (kept.flags, kept.sd_wh) == (2, 10.0)
    assert kept.updates_wh.shape == (len(FRACTIONS), len(UPDATES))
    assert kept.updates_wh[1, 0] == 2000.0
    assert kept.shown == 0.45
    assert np.isnan(HeldOutForecast.from_forecast(None, "plan", Told(200.0), driven_log()).shown)
    assert (kept.arrival, kept.arrival_chance) == ("bounds", "chances")


def test_arrivals_from_each_charge() -> None:
    """From the display and from the battery management alone; nothing where one is not known."""
    seen = []

    class Model:
        def forecast(self, plan):
            seen.append((plan.departure.soc, plan.departure.bms_soc))
            return Told()

    samples = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": 1.0})
    (both, chance), (one, none) = (
        forecast_arrivals(Model(), Plan.from_trace(name, samples, departure))
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
