"""Models of trips whose energy is only half known."""

from dataclasses import replace

import numpy as np
import pytest

import tripwatt as tw
from tripwatt.hybrid import segment_trips
from tripwatt.learners.gp import AdditiveGP, KernelTerm
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import observed_cumulative_energy
from tripwatt.uncertainty.process import Segments
from tripwatt.uncertainty.scale import TotalScale

CAR = "bmw_i3_60ah"


@pytest.fixture(scope="module")
def trips():
    return synthetic_fleet(24).trips


def by_charge(trip, rng, sd_wh=90.0, common=0.0):
    """The trip with its energy as a charge in coarse steps tells it."""
    energy = trip.observed_energy_wh + rng.normal(0.0, sd_wh)
    samples = trip.samples.drop(columns=["voltage_v", "current_a"])
    samples["observed_energy_wh"] = np.floor(np.linspace(0.0, 8.0, len(samples))) / 8.0 * energy
    own = replace(trip, samples=samples, observed_energy_wh=energy)
    return replace(
        own, observed_energy_std_wh=np.hypot(sd_wh, common * energy), observed_energy_common_std=common
    )


def test_only_the_total_of_an_energy_by_charge_counts(trips):
    coarse = [by_charge(trip, np.random.default_rng(0)) for trip in trips[:3]]
    table = segment_trips([*coarse, trips[3]], tw.load_vehicle(CAR))
    assert table.errors.along.tolist() == [False, False, False, True]
    assert table.errors.own_wh[:3] == pytest.approx(90.0)
    residual = table.residual_w[: table.offsets[1]]
    assert np.ptp(residual) == pytest.approx(0.0, abs=1e-6)
    assert table.totals_wh(table.observed_power_w)[0] == pytest.approx(coarse[0].observed_energy_wh)
    part = table.take([3, 1])
    assert part.errors.along.tolist() == [True, False]
    assert part.errors.own_wh[1] == table.errors.own_wh[1]


@pytest.mark.parametrize(("step_wh", "along"), [(None, True), (1.0, True), (200.0, False), (np.inf, False)])
def test_a_counter_suffices_and_a_coarse_one_or_a_total_counts_as_a_whole(trips, step_wh, along):
    trip, samples = trips[0], trips[0].samples.drop(columns=["voltage_v", "current_a"])
    total_wh = trip.observed_energy_wh
    if step_wh is None:
        trip = replace(trip, observed_energy_std_wh=None)
    elif np.isinf(step_wh):
        trip = replace(trip, samples=samples)
    else:
        energy = observed_cumulative_energy(trip.samples)
        trip = trip.with_samples(samples.assign(observed_energy_wh=step_wh * np.round(energy / step_wh)))
    table = segment_trips([trip], tw.load_vehicle(CAR))
    (wh,) = table.totals_wh(table.observed_power_w)
    assert (table.errors.common[0], bool(table.errors.along[0])) == (0.0, along)
    assert wh == pytest.approx(trip.observed_energy_wh)
    assert abs(wh - total_wh) <= (step_wh if step_wh == 200.0 else 1.0)
    assert table.errors.own_wh[0] == pytest.approx(step_wh / 6.0**0.5 if step_wh == 200.0 else 0.0)


def test_a_total_that_is_not_well_known_counts_less():
    import pandas as pd

    rng = np.random.default_rng(0)
    X = pd.DataFrame({"x": rng.uniform(0.0, 10.0, 40)})
    sd = np.where(np.arange(40) < 20, 50.0, 0.0)
    y = 3.0 * X["x"].to_numpy() + sd + rng.normal(0.0, 1.0, 40)
    terms = [KernelTerm(("x",), "line", sd=10.0)]
    told, untold = (
        AdditiveGP(terms, effect_sd=1.0, df=None).fit(X, y, np.arange(40), total_sd=own).weights_[0]
        for own in (sd, None)
    )
    assert abs(told - 3.0) < 0.2
    assert abs(untold - 3.0) > 1.0


def test_measurement_is_no_error_of_the_model():
    rng, flat = np.random.default_rng(0), np.full(10, 30.0)
    segments = [Segments(np.arange(10) * 30.0, flat, np.full(10, 4000.0), np.zeros(10)) for _ in range(60)]
    model, measured = rng.normal(0.0, 60.0, 60), rng.normal(0.0, 150.0, 60)
    alone, told, untold = (
        TotalScale.from_errors(segments, errors, None, sd).sd_wh(segments[0])
        for errors, sd in ((model, 0.0), (model + measured, 150.0), (model + measured, 0.0))
    )
    assert told < 1.6 * alone
    assert untold > 2.0 * alone
    wider = TotalScale(np.array([30.0, 0.0, 0.0, 1.0])).with_share(0.05, 2.0)
    assert wider.values.tolist() == [30.0, 0.0, 0.1, 1.0]


def test_a_model_of_charges_alone_covers_the_true_energy(trips):
    rng = np.random.default_rng(1)
    coarse = [by_charge(trip, rng) for trip in trips]
    model = tw.ForecastModel(tw.load_vehicle(CAR), "gp").fit(coarse[:18])
    inside, errors = [], []
    for known, true in zip(coarse[18:], trips[18:], strict=True):
        forecast = model.forecast(known)
        low, high = forecast.interval(0.9)
        inside.append(low <= true.observed_energy_wh <= high)
        errors.append(abs(forecast.energy_wh / true.observed_energy_wh - 1.0))
    assert sum(inside) >= 5
    assert np.mean(errors) < 0.12
    assert not model.uncertainty_.process.split
    assert np.all(model.uncertainty_.shrinkage.joint == 0.0)


def test_a_capacity_that_is_not_well_known_widens_every_interval(trips):
    widths = []
    for common in (0.0, 0.05):
        rng = np.random.default_rng(1)
        coarse = [by_charge(trip, rng, common=common) for trip in trips[:12]]
        model = tw.ForecastModel(tw.load_vehicle(CAR), "linear").fit(coarse)
        forecast = model.forecast(trips[20])
        widths.append(forecast.sd_wh)
    energy = forecast.energy_wh
    added = np.sqrt(widths[1] ** 2 - widths[0] ** 2) / energy
    assert 0.02 < added < 0.10
