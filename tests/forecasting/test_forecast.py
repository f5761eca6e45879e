"""The forecast: nothing leaks, parts add up, what was measured counts exactly, uncertainty behaves."""

import dataclasses

import numpy as np
import pytest
from tests.support.dense_process import DensePower, component_covariance, covariance

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import Trip
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.process import (
    ComponentProcess,
    HeldOutResidual,
    ResidualBatch,
    ResidualProcess,
    Segments,
)
from tripwatt.uncertainty.scale import TotalScale
from tripwatt.uncertainty.shrinkage import UpdateShrinkage
from tripwatt.vehicles import load_vehicle


@pytest.fixture(scope="module")
def fleet():
    return synthetic_fleet(n_trips=16, seed=4)


@pytest.fixture(scope="module")
def model(fleet):
    return ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="gp").fit(fleet.trips[:-2])


@pytest.fixture(scope="module")
def trip(fleet):
    return fleet.trips[-1]


def test_nothing_measured_after_the_first_sample_moves_the_departure_forecast(model, trip):
    rng = np.random.default_rng(1)
    samples = trip.samples.copy()
    for name in samples.columns.difference(["time_s", "speed_m_s", "elevation_m"]):
        later = samples[name].to_numpy(copy=True)
        later[1:] = rng.permutation(later[1:]) * rng.uniform(0.2, 3.0)
        samples[name] = later
    scrambled = Trip(trip.trip_id, samples, trip.context, observed_energy_wh=1.0)
    before, after = model.forecast(trip), model.forecast(scrambled)
    assert before.to_dict() == after.to_dict()


def test_first_sample_does_move_it(model, trip):
    samples = trip.samples.assign(ambient_temperature_degc=trip.samples["ambient_temperature_degc"] - 15.0)
    colder = dataclasses.replace(trip, samples=samples)
    assert model.forecast(colder).energy_wh != model.forecast(trip).energy_wh


def test_causes_add_up(model, trip):
    forecast = model.forecast(trip)
    assert sum(forecast.by_cause_wh.values()) == pytest.approx(forecast.energy_wh, rel=1e-9)


def test_quantiles_rise_and_probabilities_fall(model, trip):
    forecast = model.forecast(trip)
    quantiles = [forecast.quantile(p) for p in np.linspace(0.01, 0.99, 33)]
    assert np.all(np.diff(quantiles) > 0)
    chances = [forecast.p_arrive(soc) for soc in np.linspace(0.0, 1.0, 40)]
    assert np.all(np.diff(chances) <= 0)
    assert chances[0] > 0.99
    assert chances[-1] < 0.01
    half = forecast.probability_below(forecast.energy_wh)
    assert half == pytest.approx(0.5)
    assert forecast.probability_below(forecast.quantile(0.8)) == pytest.approx(0.8, abs=1e-6)


def test_series_ends_at_the_total_and_at_the_arrival(model, trip):
    forecast = model.forecast(trip)
    last = forecast.series().iloc[-1]
    low, high = forecast.interval(0.9)
    assert last["energy_wh"] == pytest.approx(forecast.energy_wh)
    assert (last["energy_low_wh"], last["energy_high_wh"]) == pytest.approx((low, high))
    assert last["displayed_soc"] == pytest.approx(forecast.soc_arrival)


def test_a_trip_that_was_measured_to_its_end_is_known(model, trip):
    done = model.forecast(trip).update(trip.samples)
    assert done.energy_wh == pytest.approx(trip.observed_energy_wh, rel=2e-3)
    low, high = done.interval(0.9)
    assert high - low < 0.05 * trip.observed_energy_wh
    assert done.soc_arrival == pytest.approx(trip.samples["displayed_soc"].iloc[-1], abs=0.01)


def test_an_update_knows_only_its_samples_and_shrinks_the_doubt(model, trip):
    forecast = model.forecast(trip)
    half = trip.samples[trip.samples["time_s"] <= trip.duration_s / 2]
    updated = forecast.update(half)
    assert updated.sd_wh < forecast.sd_wh
    measured = Trip.from_samples("half", half.reset_index(drop=True)).observed_energy_wh
    assert updated.measured.energy_wh.sum() == pytest.approx(measured, rel=1e-6)
    assert forecast.measured_until_s == 0.0, "the departure forecast is not changed"


def test_gaps_stay_open(model, trip):
    time = trip.samples["time_s"]
    gappy = trip.samples[(time < 100) | ((time > 300) & (time < 500))]
    updated = model.forecast(trip).update(gappy)
    assert updated.measured.hours.sum() * 3600.0 == pytest.approx(300.0, abs=5.0)


def test_state_of_charge_alone_counts(model, trip):
    half = trip.samples[trip.samples["time_s"] <= trip.duration_s / 2]
    phone = half[["time_s", "speed_m_s", "displayed_soc"]]
    thirsty = phone.assign(
        displayed_soc=phone["displayed_soc"].iloc[0]
        - 3 * (phone["displayed_soc"].iloc[0] - phone["displayed_soc"])
    )
    forecast = model.forecast(trip)
    assert forecast.update(thirsty).energy_wh > forecast.update(phone).energy_wh
    assert forecast.update(thirsty).soc_arrival < forecast.update(phone).soc_arrival


def test_what_training_never_saw_is_flagged_and_widens(model, trip):
    arctic = dataclasses.replace(trip, samples=trip.samples.assign(ambient_temperature_degc=-40.0))
    usual, unusual = model.forecast(trip), model.forecast(arctic)
    assert ("outside_training", "ambient_temperature_degc") in {(f.code, f.subject) for f in unusual.flags}
    assert usual.drive.segments.outside_sd_wh == 0.0
    assert unusual.drive.segments.outside_sd_wh > 0.0
    assert unusual.sd_wh > usual.sd_wh
    # far outside the correction is as uncertain as before any trip, and no more
    colder = dataclasses.replace(trip, samples=trip.samples.assign(ambient_temperature_degc=-60.0))
    drive, learner = model.forecast(colder).drive, model.corrector_.model
    before = learner.prior_factor(learner.features(drive.table.features)[0])
    prior = np.linalg.norm(drive.table.hours @ before)
    assert 0.9 * prior < drive.segments.outside_sd_wh <= prior * (1.0 + 1e-9)


def test_unusable_samples_are_refused(model, trip):
    forecast = model.forecast(trip)
    with pytest.raises(InvalidInput, match="no measured energy"):
        forecast.update(trip.samples[["time_s", "speed_m_s"]])
    with pytest.raises(InvalidInput, match="soc"):
        forecast.update(trip.samples[["time_s", "speed_m_s"]].assign(soc=3.0))
    with pytest.raises(InvalidInput, match="too few trips"):
        ForecastModel(load_vehicle("bmw_i3_60ah")).fit(synthetic_fleet(n_trips=3).trips)


def some_blocks(rng: np.random.Generator, n: int) -> Segments:
    return Segments(
        15.0 + 30.0 * np.arange(n), np.full(n, 30.0), rng.uniform(0, 9000, n), rng.uniform(0, 3000, n)
    )


PROCESS = ResidualProcess(
    ComponentProcess(50.0, 0.02, 400.0, 90.0, 0.5),
    ComponentProcess(200.0, 0.1, 300.0, 300.0, 60.0, 2.0, 150.0),
    1000.0,
    True,
)


def test_conditioning_is_exact_on_what_was_seen():
    rng = np.random.default_rng(0)
    n = 12
    segments = some_blocks(rng, n)
    K = covariance(PROCESS, segments)
    seen, power = np.array([0, 3, 4]), rng.normal(0, 800, 3)
    posterior = DensePower.from_covariance(K).given(np.eye(n)[seen], power, np.full(3, 1e-6))
    np.testing.assert_allclose(posterior.mean_w[seen], power, atol=1e-3)
    dense = K[:, seen] @ np.linalg.solve(K[np.ix_(seen, seen)], power)
    np.testing.assert_allclose(posterior.mean_w, dense, rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("components", [("drive",), ("climate",), ("drive", "climate")])
def test_likelihood_and_its_gradient_are_exact(components: tuple[str, ...]):
    rng = np.random.default_rng(2)
    trips = [HeldOutResidual(some_blocks(rng, n), rng.normal(0, 600, n)) for n in (8, 12)]
    batch = ResidualBatch.from_trips(trips, "joint")
    values = np.array([dataclasses.astuple(getattr(PROCESS, name)) for name in components])
    cost, gradient = batch.cost(components, values)
    for at in np.ndindex(values.shape):
        if values[at] == 0.0:
            continue
        up, down = values.copy(), values.copy()
        up[at] *= np.exp(1e-5)
        down[at] *= np.exp(-1e-5)
        slope = (batch.cost(components, up)[0] - batch.cost(components, down)[0]) / 2e-5
        assert gradient[at] == pytest.approx(slope, rel=1e-5, abs=1e-6)
    dense = 0.0
    for trip in trips:  # pairs of segments are merged before the likelihood is taken
        pairs = np.kron(np.eye(len(trip.segments) // 2), np.full((1, 2), 0.5))
        b = trip.segments
        merged = Segments(pairs @ b.time_s, 2 * (pairs @ b.step_s), pairs @ b.moved_w, pairs @ b.hvac_w)
        K = np.zeros((len(merged), len(merged)))
        if "drive" in components:
            K += component_covariance(
                PROCESS.drive, merged.time_s, merged.moved_w, np.sqrt(0.5) * merged.drive_noise_w
            )
        if "climate" in components:
            K += component_covariance(
                PROCESS.climate, merged.time_s, merged.hvac_w, np.full(len(merged), np.sqrt(0.5))
            )
        left = pairs @ trip.residual_w
        dense += 0.5 * left @ np.linalg.solve(K, left) + 0.5 * np.linalg.slogdet(K)[1]
    assert cost == pytest.approx(dense, rel=1e-9)


def test_scale_learns_what_errors_grow_with():
    rng = np.random.default_rng(3)
    segments = [
        Segments(np.arange(n) * 60.0, np.full(n, 60.0), np.full(n, 5000.0), np.zeros(n))
        for n in range(4, 204)
    ]
    hours = np.array([b.hours.sum() for b in segments])
    errors = rng.standard_t(4, len(segments)) * np.hypot(20.0, 300.0 * hours)
    scale = TotalScale.from_errors(segments, errors)
    short, long = scale.sd_wh(segments[0]), scale.sd_wh(segments[-1])
    assert short == pytest.approx(np.hypot(20.0, 300.0 * hours[0]), rel=0.5)
    assert long == pytest.approx(np.hypot(20.0, 300.0 * hours[-1]), rel=0.25)


def test_a_channel_that_explains_the_rest_is_taken_and_noise_is_not():
    rng = np.random.default_rng(4)
    n_trips, n = 60, 40
    held_out = []
    for _ in range(n_trips):
        segments = some_blocks(rng, n)
        climate = np.full(n, rng.normal(0, 300))
        held_out.append(HeldOutResidual(segments, climate + rng.normal(0, 1500, n), climate))
    errors = np.array([trip.error_wh for trip in held_out])
    shrinkage = UpdateShrinkage.from_trips(PROCESS, held_out, np.full(n_trips, errors.std()))
    assert shrinkage.at("climate", 0.5) > 0.8
    assert shrinkage.at("drive", 0.25) < 0.5
    assert shrinkage.at("joint", 0.0) == 0.0


def test_intervals_on_the_way_are_as_wide_as_what_held_out_trips_leave():
    rng = np.random.default_rng(6)
    held_out = []
    for _ in range(80):
        segments = some_blocks(rng, 30)
        size = np.where(np.arange(30) < 15, 1.0, 3.0)  # the second half errs more than the process believes
        errors = np.linalg.cholesky(covariance(PROCESS, segments)) @ rng.standard_normal(30) * size
        held_out.append(HeldOutResidual(segments, errors))
    own = np.array([PROCESS.sd_wh(trip.segments) for trip in held_out])
    shrinkage = UpdateShrinkage.from_trips(PROCESS, held_out, own)
    rest = [trip.segments.hours[15:] @ trip.residual_w[15:] for trip in held_out]
    total = [trip.error_wh for trip in held_out]
    assert np.std(rest) > 0.5 * np.std(total)
    assert shrinkage.sd_factor(False, 0.5) > 1.15
    assert shrinkage.sd_factor(False, 0.0) == 1.0


def test_measured_climate_on_the_way_is_told_from_driving(fleet):
    trips = [t for t in fleet.trips if t.has("heating_power_w") and t.has("aircon_power_w")]
    model = ForecastModel(load_vehicle("bmw_i3_60ah")).fit(trips[:-1])
    assert model.uncertainty_ is not None
    assert model.uncertainty_.process.split
    # so few trips would not show that an update helps
    full = UpdateShrinkage(np.ones(6), np.ones(6), np.zeros(6), np.ones(6), np.ones(6))
    model.uncertainty_ = dataclasses.replace(model.uncertainty_, shrinkage=full)
    before = model.forecast(trips[-1])
    half = trips[-1].samples.iloc[: len(trips[-1]) // 2]
    columns = ["time_s", "voltage_v", "current_a", "heating_power_w", "aircon_power_w"]
    # one kilowatt more of climate control, in the battery's power as well
    more = half[columns].assign(
        heating_power_w=half["heating_power_w"] + 1000.0,
        current_a=half["current_a"] + 1000.0 / half["voltage_v"],
    )
    as_is, warmer = before.update(half[columns]), before.update(more)
    so_far = 1000.0 * half["time_s"].iloc[-1] / 3600.0
    assert warmer.energy_wh - as_is.energy_wh > 1.1 * so_far  # it is expected to go on
    # one column alone says nothing of the sum: the forecast is that of the undivided power
    alone = before.update(half[columns[:4]])
    assert alone.energy_wh == before.update(half[columns[:3]]).energy_wh


@pytest.fixture(scope="module")
def driven(fleet, model):
    """A trip, its forecast, and what was measured in its first half."""
    trip = fleet.trips[-1]
    half = trip.samples.iloc[: len(trip) // 2][["time_s", "voltage_v", "current_a"]].reset_index(drop=True)
    return model.forecast(trip), half


def test_missing_current_is_a_gap_and_no_measurement(driven):
    before, half = driven
    hole = half["time_s"].between(100.0, 300.0)
    blank = half.assign(current_a=half["current_a"].mask(hole))
    assert before.update(blank).energy_wh == pytest.approx(before.update(half[~hole]).energy_wh, rel=0.01)
    stopped = half.assign(current_a=half["current_a"].mask(half["time_s"] > 100.0))
    until = before.update(half[half["time_s"] <= 100.0])
    assert before.update(stopped).energy_wh == pytest.approx(until.energy_wh, rel=0.02)


def test_samples_that_cannot_be_of_this_trip_are_refused(driven):
    before, half = driven
    with pytest.raises(InvalidInput, match="wrong sign"):
        before.update(half.assign(current_a=-half["current_a"]))
    with pytest.raises(InvalidInput, match="clock of the trip"):
        before.update(half.assign(time_s=half["time_s"] + 50_000.0))


def test_samples_without_news_leave_the_forecast(driven):
    before, half = driven
    same = before.update(half[["time_s"]].assign(displayed_soc=0.8))
    assert (same.energy_wh, same.sd_wh) == (before.energy_wh, before.sd_wh)


def test_conformal_factor_covers_exchangeable_errors():
    rng = np.random.default_rng(5)
    covered = []
    for _ in range(400):
        errors = rng.standard_t(3, 40)
        covered.append(abs(errors[-1]) <= ConformalScores.from_errors(errors[:-1]).factor(0.9))
    assert 0.86 <= np.mean(covered) <= 0.94


def test_scores_and_probabilities_are_inverse():
    scores = ConformalScores.from_errors(np.random.default_rng(0).standard_normal(30))
    for level in (0.1, 0.5, 0.9, 0.96, 0.99):
        assert scores.probability(scores.factor(level)) == pytest.approx(0.5 + level / 2, abs=1e-9)
        assert scores.probability(-scores.factor(level)) == pytest.approx(0.5 - level / 2, abs=1e-9)
