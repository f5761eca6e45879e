"""The displayed charge, its energy and its errors."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.uncertainty.charge import FULL as FULL_DISPLAY
from tripwatt.uncertainty.charge import NORMAL_SCALE, ChargeScale
from tripwatt.vehicles import load_vehicle


def test_published_charge() -> None:
    """A window of 80 % of 20 kWh; 1 % of the display, 2 % by way of the battery management; 3 % of the capacity."""
    battery = SimpleNamespace(displayed_zero_soc=0.1, displayed_full_soc=0.9, capacity_ah=50.0)
    published = ChargeScale.from_published(battery, np.array([410.0, 390.0]))
    assert published.wh_per_display == pytest.approx(16_000.0)
    assert (published.zero_soc, published.full_soc, published.trips, published.hidden) == (0.1, 0.9, 0, 0.0)
    assert published.displayed(0.3) == pytest.approx(0.25)
    assert published.left(0.8, 4000.0) == pytest.approx(0.55)
    assert published.sd(-8000.0, True) == pytest.approx(np.hypot(0.01, 0.015))
    assert published.sd(8000.0, False) == pytest.approx(np.hypot(0.03, 0.015))


def test_seven_trips_are_too_few_and_eight_are_enough():
    trips = synthetic_fleet(n_trips=8, seed=1).trips
    car = load_vehicle("bmw_i3_60ah")
    with pytest.raises(InvalidInput, match="too few trips"):
        ForecastModel(car, corrector="linear").fit(trips[:7])
    assert len(ForecastModel(car, corrector="linear").fit(trips).held_out_) == 8


def test_charge_is_learned_from_readings():
    energy = np.array([500.0, 1000.0, 2000.0, 3000.0, 800.0, 1500.0, 2500.0, 400.0])
    start = np.array([0.9, 0.8, 0.7, 0.9, 0.6, 0.5, 0.8, 0.4])
    shown = np.column_stack([start, start - energy / 16_000.0])
    exact = ChargeScale.from_readings(np.hstack([0.1 + 0.8 * shown, shown]), energy)
    assert (exact.zero_soc, exact.full_soc) == pytest.approx((0.1, 0.9), rel=1e-9)
    assert exact.wh_per_display == pytest.approx(16_000.0, rel=1e-9)
    assert exact.trips == 8
    # at least a step of the display, as a scale of t-distributed errors with the same central 90 %
    t_scale = NORMAL_SCALE
    assert t_scale == pytest.approx(norm.ppf(0.95) / student.ppf(0.95, 4), abs=1e-4)
    assert exact.displayed_sd == pytest.approx(0.005 / np.sqrt(6.0) * t_scale, rel=1e-9)
    off = np.array([1, -1, 1, -1, -1, 1, -1, 1]) * 0.02
    noisy = ChargeScale.from_readings(
        np.hstack([0.1 + 0.8 * shown, np.column_stack([start, shown[:, 1] + off])]), energy
    )
    per_wh = float(energy @ (start - shown[:, 1] - off)) / float(energy @ energy)
    assert noisy.wh_per_display == pytest.approx(1.0 / per_wh, rel=1e-9)
    error = (start - shown[:, 1] - off) - energy * per_wh
    left = np.sum(error**2 - (0.03 * energy * per_wh) ** 2) / 7
    assert noisy.displayed_sd == pytest.approx(np.sqrt(left) * t_scale, rel=1e-9)
    assert ChargeScale.from_readings(np.hstack([shown, shown])[:7], energy[:7]) is None
    assert ChargeScale.from_readings(np.hstack([shown, shown]), -energy) is None
    alike = np.column_stack([np.full(8, 0.8), 0.8 - energy / 16_000.0])  # no line goes through one charge
    assert ChargeScale.from_readings(np.hstack([alike, alike]), energy) is None


def test_a_full_display_hides_charge():
    energy = np.array([500.0, 1000.0, 2000.0, 3000.0, 800.0, 1500.0, 2500.0, 400.0, 700.0, 1800.0])
    full = np.arange(10) < 5
    start = np.where(full, 1.0, 0.7)
    end = start + 0.02 * full - energy / 16_000.0
    soc = 0.1 + 0.8 * np.column_stack([start + 0.02 * full, end])
    found = ChargeScale.from_readings(np.hstack([soc, np.column_stack([start, end])]), energy)
    assert found.hidden == pytest.approx(0.02, rel=1e-9)
    assert found.wh_per_display == pytest.approx(16_000.0, rel=1e-9)
    few = ChargeScale.from_readings(np.hstack([soc, np.column_stack([start, end])])[:9], energy[:9])
    assert few.hidden == 0.0  # four trips of the other kind are too few
    assert found.left(1.0, 4000.0) == pytest.approx(0.77)
    assert found.left(FULL_DISPLAY, 4000.0) == pytest.approx(FULL_DISPLAY + 0.02 - 0.25)
    assert found.left(0.985, 4000.0) == pytest.approx(0.735)
    assert found.left(0.99, 4000.0) == pytest.approx(0.75)  # half of the way from 98.5 to 99.5 %
    # what is computed from the battery management's charge hides nothing
    assert found.left(1.0, 4000.0, from_display=False) == pytest.approx(0.75)
