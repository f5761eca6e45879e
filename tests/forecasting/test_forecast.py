"""The forecast: nothing leaks, parts add up, what was measured counts exactly, uncertainty behaves."""

import dataclasses
from operator import attrgetter
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student
from tests.support.dense_process import DensePower, component_covariance, covariance
from tests.support.refusals import refusal, refuses

import tripwatt as tw
from tripwatt.forecasting import ForecastModel
from tripwatt.forecasting.expected import ExpectedTrip
from tripwatt.forecasting.forecast import Forecast, with_route_error
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.forecasting.measured import ChargeReading
from tripwatt.hybrid import SegmentTable
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.uncertainty import ChargeScale, RouteUncertainty, UncertaintyModel
from tripwatt.uncertainty.charge import NORMAL_SCALE
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
    before = learner.prior_factor(learner.features(drive.table.features))
    prior = np.linalg.norm(drive.table.hours @ before)
    assert 0.9 * prior < drive.segments.outside_sd_wh <= prior * (1.0 + 1e-9)


def test_unusable_samples_are_refused(model, trip):
    forecast = model.forecast(trip)
    refuses("no measured energy", forecast.update, trip.samples[["time_s", "speed_m_s"]])
    found = refusal(forecast.update, trip.samples[["time_s", "speed_m_s"]].assign(soc=3.0))
    assert found.startswith("value out of range: observed samples, ")
    found = refusal(forecast.update, [0.0])
    assert found.startswith("unknown type: observed samples: got [0.0]; allowed: a DataFrame; for example")
    assert refusal(forecast.sample, 0) == "value out of range: n: got 0; allowed: 1 or more"
    on_the_way = forecast.update(
        trip.samples[trip.samples["time_s"] <= trip.samples["time_s"].iloc[0] + 90.0]
    )
    of_another = dataclasses.replace(
        forecast, drive=dataclasses.replace(forecast.drive, vehicle=load_vehicle("vw_id3"))
    )
    common = "forecasts without a common part: forecasts: got {}; allowed: two forecasts of one car by one model before departure"
    for one, other, got in (
        (forecast, of_another, "of two cars"),
        (forecast, on_the_way, "one that was updated on the way"),
        (on_the_way, forecast, "one that was updated on the way"),
    ):
        assert refusal(one.difference, other) == common.format(got)
    known = Departure(covariates={"traffic": 1.0})
    assert refusal(model.forecast, trip, known).startswith("unknown covariate: departure: got 'traffic'")
    assert refusal(model.forecast, "road").startswith(
        "unknown type: trip: got 'road'; allowed: a Plan or a Trip"
    )
    raw = ForecastModel(load_vehicle("bmw_i3_60ah"))
    fit = "got no training trips; call fit first"
    assert refusal(raw.forecast, trip) == f"model is not fitted: forecast: {fit}"
    refuses("too few trips", ForecastModel(load_vehicle("bmw_i3_60ah")).fit, synthetic_fleet(n_trips=3).trips)


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
        merged = Segments(pairs @ b.time_s, 2 * (pairs @ b.step_s), pairs @ b.moved_w, pairs @ b.climate_w)
        K = np.zeros((len(merged), len(merged)))
        if "drive" in components:
            K += component_covariance(
                PROCESS.drive, merged.time_s, merged.moved_w, np.sqrt(0.5) * merged.drive_noise_w
            )
        if "climate" in components:
            K += component_covariance(
                PROCESS.climate, merged.time_s, merged.climate_w, np.full(len(merged), np.sqrt(0.5))
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
    own = np.array([PROCESS.prior(t.segments).sd_wh(t.segments.hours)[-1] for t in held_out])
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
    refuses("wrong sign", before.update, half.assign(current_a=-half["current_a"]))
    refuses("clock of the trip", before.update, half.assign(time_s=half["time_s"] + 50_000.0))


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


EXACT = {"rel": 1e-9, "abs": 1e-9}
STEP_S = np.array([60.0, 120.0, 180.0])
HOURS = np.array([1 / 60, 1 / 30, 1 / 20])
SIMULATED_W = np.array([3000.0, 12000.0, 6000.0])
CORRECTION_W = np.array([100.0, -200.0, 50.0])
EXPECTED_W = np.array([3100.0, 11800.0, 6050.0])
ENERGY_WH = np.array([3100 / 60, 11800 / 30, 6050 / 20])
SPEED_M_S = np.array([5.0, 20.0, 10.0])
MOVED_W = np.array([1000.0, 9000.0, 4000.0])
CLIMATE_W = np.array([800.0, 600.0, 500.0])
SD_W = np.array([400.0, 300.0, 200.0])
VOLTAGE_V = 350.0
CAPACITY_AH = 60.0
WH_PER_SOC = CAPACITY_AH * VOLTAGE_V
ZERO, FULL = 0.1, 0.9
START_SOC = 0.5
START = 0.5
"""The battery management's half is half of the display as well."""
WH_PER_DISPLAY = WH_PER_SOC * (FULL - ZERO)
SCORES = ConformalScores.from_errors([0.5, -1.0, 1.5, -2.0])
SD_FACTOR, STATE_SD_WH, ROUTE_SD_WH = 1.5, 18.0, 24.0
BESIDE_SD_WH = 30.0
"""Of 18 and 24."""
AIR_W, ROLLING_W = np.array([500.0, 4000.0, 2000.0]), np.array([300.0, 1500.0, 900.0])
CLIMB_W, ACCELERATION_W = np.array([0.0, 1000.0, -500.0]), np.array([200.0, 0.0, -100.0])
MIN_WH = np.array([600 / 60, 3750 / 30, 850 / 20])
"""Half of air and rolling, the climb and the kinetic energy, in each segment."""
JOINT = np.array([0.2, 0.5, 0.6, 0.7, 0.8, 0.9])
CLIMATE = np.array([0.4, 0.7, 0.7, 0.7, 0.8, 0.9])
DRIVE = np.array([0.1, 0.25, 0.3, 0.3, 0.3, 0.3])
SPLIT_FACTOR = np.array([1.2, 1.5, 1.5, 1.5, 1.5, 1.5])
JOINT_FACTOR = np.array([1.1, 1.4, 1.4, 1.4, 1.4, 1.4])
ONE_SIXTH = (1 / 6 - 0.1) / (0.25 - 0.1)
"""Place of a sixth of the trip, where the first segment ends, between the first two fractions of the shrinkage."""
CONSTANT_W, DRIVE_NOISE, CLIMATE_SD_W, CLIMATE_NOISE = 500.0, 0.5, 300.0, 80.0
ONE_PROCESS = ResidualProcess(
    ComponentProcess(CONSTANT_W, 0.0, 0.0, 300.0, DRIVE_NOISE),
    ComponentProcess(CLIMATE_SD_W, 0.0, 0.0, 300.0, CLIMATE_NOISE),
    climate_limit_w=600.0,
    split=False,
)
NOISE_W2 = (DRIVE_NOISE * (100.0 + 0.3 * MOVED_W)) ** 2
BOTH_W2 = CONSTANT_W**2 + CLIMATE_SD_W**2
"""Covariance of two segments."""


class LoggedClimate:
    """A corrector that corrects the climate control by 50 W."""

    def predict_climate(self, table: SegmentTable) -> np.ndarray:
        return np.full(len(table.hours), 50.0)

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(table.hours)), np.zeros((len(table.hours), 1))

    def outside_factor(self, table: SegmentTable) -> np.ndarray:
        return np.zeros((len(table.hours), 0))


def car():
    usual = load_vehicle("bmw_i3_60ah")
    battery = dataclasses.replace(
        usual.battery, capacity_ah=CAPACITY_AH, displayed_zero_soc=ZERO, displayed_full_soc=FULL
    )
    return dataclasses.replace(usual, battery=battery)


def drive() -> ExpectedTrip:
    time = np.arange(361.0)
    samples = pd.DataFrame({"time_s": time, "speed_m_s": np.full(361, 12.0)})
    plan = Plan.from_trace("by hand", samples, Departure(soc=START))
    features = pd.DataFrame(
        {
            "speed_m_s": SPEED_M_S,
            "climate_w": CLIMATE_W,
            "air_w": AIR_W,
            "rolling_w": ROLLING_W,
            "climb_w": CLIMB_W,
            "acceleration_w": ACCELERATION_W,
        }
    )
    table = SegmentTable(("by hand",), np.array([0, 3]), features, HOURS, SIMULATED_W)
    segments = Segments(np.array([30.0, 120.0, 270.0]), STEP_S, MOVED_W, CLIMATE_W)
    simulation = SimpleNamespace(
        time_s=np.array([0.0, 120.0, 360.0]),
        soc=np.array([START_SOC, 0.49, 0.48]),
        terminal_voltage_v=np.array([VOLTAGE_V - 10.0, VOLTAGE_V, VOLTAGE_V + 10.0]),
        battery_loss_w=np.array([999.0, 300.0, 600.0]),
        by_cause_wh={"aero": 400.0, "climb": 100.0, "climate": 240.0},
    )
    return ExpectedTrip(plan, car(), simulation, table, segments, LoggedClimate(), CORRECTION_W)


def uncertainty(split: bool = False) -> UncertaintyModel:
    shrinkage = UpdateShrinkage(CLIMATE, DRIVE, JOINT, SPLIT_FACTOR, JOINT_FACTOR)
    process = dataclasses.replace(ONE_PROCESS, split=split)
    return UncertaintyModel(process, TotalScale(np.ones(4)), SCORES, shrinkage)


@pytest.fixture
def forecast() -> Forecast:
    posterior = DensePower.from_covariance(np.diag(SD_W**2))
    return Forecast(drive(), uncertainty(), posterior, SD_FACTOR, 1.0, STATE_SD_WH, ROUTE_SD_WH)


def departing(split: bool = False) -> Forecast:
    """As the process has it, with a known state and not on a planned route."""
    known = uncertainty(split)
    expected = drive()
    posterior = known.process.prior(expected.segments)
    return Forecast(expected, known, posterior, SD_FACTOR)


TOTAL_WH = 3100 / 60 + 11800 / 30 + 6050 / 20


CUMULATIVE_SD_WH = np.array(
    [
        np.hypot(SD_FACTOR * 400 / 60, BESIDE_SD_WH / 6),
        np.hypot(SD_FACTOR * np.sqrt((400 / 60) ** 2 + 10.0**2), BESIDE_SD_WH / 2),
        np.hypot(SD_FACTOR * np.sqrt((400 / 60) ** 2 + 10.0**2 + 10.0**2), BESIDE_SD_WH),
    ]
)
"""The errors of a planned route and of an unknown state grow with the time: 60, 180 and 360 of 360 s."""


SD_WH = CUMULATIVE_SD_WH[-1]


TAIL_90 = 2.0 * student.ppf(0.95, 4) / student.ppf(0.9, 4)
"""Four scores reach to a level of 4 / 5; beyond, the largest grows as a t distribution with 4 degrees of freedom."""


def charge_sd(energy_sd_wh: float, energy_wh: float, display_sd: float = 0.01) -> float:
    """Of energy, display and capacity."""
    return np.sqrt(
        (energy_sd_wh / WH_PER_DISPLAY) ** 2 + display_sd**2 + (0.03 * energy_wh / WH_PER_DISPLAY) ** 2
    )


def powered(**columns: float) -> pd.DataFrame:
    """The first minute at 4 kW."""
    return pd.DataFrame({"time_s": np.arange(61.0), "voltage_v": 400.0, "current_a": 10.0, **columns})


def test_energy_and_its_standard_deviation(forecast):
    np.testing.assert_allclose(forecast.power_w, EXPECTED_W, rtol=1e-12)
    np.testing.assert_allclose(np.diff(forecast.along.energy_wh), ENERGY_WH, rtol=1e-12)
    assert forecast.energy_wh == pytest.approx(TOTAL_WH, **EXACT)
    assert forecast.sd_wh == pytest.approx(SD_WH, **EXACT)


def test_intervals_quantiles_and_probabilities(forecast):
    for level, factor in ((0.2, 0.5), (0.4, 1.0), (0.5, 1.25), (0.8, 2.0), (0.9, TAIL_90)):
        assert forecast.interval(level) == pytest.approx(
            (TOTAL_WH - factor * SD_WH, TOTAL_WH + factor * SD_WH), **EXACT
        )
        low, high = 0.5 - level / 2, 0.5 + level / 2
        assert forecast.quantile(low) == pytest.approx(TOTAL_WH - factor * SD_WH, **EXACT)
        assert forecast.quantile(high) == pytest.approx(TOTAL_WH + factor * SD_WH, **EXACT)
        assert forecast.probability_below(TOTAL_WH + factor * SD_WH) == pytest.approx(high, **EXACT)
        assert forecast.probability_below(TOTAL_WH - factor * SD_WH) == pytest.approx(low, **EXACT)
    assert forecast.quantile(0.5) == pytest.approx(TOTAL_WH, **EXACT)


def test_arrays_have_the_values_of_their_numbers_and_their_shape(forecast):
    p = np.array([[0.05, 0.5], [0.8, 0.95]])
    for function in (forecast.quantile, forecast.p_arrive, forecast.arrival.quantile):
        assert function(p).tolist() == [[function(each) for each in row] for row in p.tolist()]
    for interval in (forecast.interval, forecast.arrival.interval):
        low, high = interval(p[:, 0])
        assert list(zip(low, high, strict=True)) == [interval(level) for level in p[:, 0].tolist()]
    refuses("value out of range: p: got 95", forecast.quantile, np.array([0.5, 95.0]))


def climbing() -> Forecast:
    link = {"length_m": 20_000.0, "speed_m_s": 15.0}
    return tw.forecast(tw.read_route([link]), tw.Departure(soc=0.4, ambient_temperature_degc=5.0))


@pytest.mark.parametrize("kind", ["departure", "unknown heights", "power", "charge"])
def test_sampled_drives_have_the_distributions_of_each_edge_and_of_the_arrival(forecast, kind):
    """Kolmogorov-Smirnov distances of 4,000 draws; the correlation of two places is that of the covariance."""
    if kind == "unknown heights":
        forecast = climbing()
    elif kind != "departure":
        seen = powered() if kind == "power" else pd.DataFrame({"time_s": [0.0, 60.0], "soc": [0.6, 0.595]})
        forecast = forecast.update_since_departure(seen)
    hours = forecast.open_hours
    sums = np.tril(np.broadcast_to(hours, (len(hours), len(hours))))
    variance = np.diag(sums @ forecast.posterior.covariance_w2 @ sums.T)
    assert np.sqrt(np.maximum(variance, 0.0)) == pytest.approx(forecast.posterior.sd_wh(hours), abs=1e-5)
    drawn, p = forecast.sample(4000, seed=3), np.linspace(0.02, 0.98, 25)
    along = forecast.along
    end_wh, end_soc = drawn.cumulative_energy_wh[:, -1], drawn.displayed_soc[:, -1]
    assert np.mean(end_wh[:, None] <= forecast.quantile(p), axis=0) == pytest.approx(p, abs=0.03)
    assert np.mean(end_soc[:, None] <= forecast.arrival.quantile(p), axis=0) == pytest.approx(p, abs=0.03)
    place = len(along.time_s) // 2
    if along.charge_sd[place] > 0.0:
        soc = np.array([along.soc(1.0 - each)[place] for each in p])
        below = np.mean(drawn.displayed_soc[:, [place]] <= soc, axis=0)
        assert below == pytest.approx(p, abs=0.035)
    assert drawn.to_frame().groupby("draw")["cumulative_energy_wh"].last().to_list() == end_wh.tolist()
    np.testing.assert_array_equal(forecast.sample(5, 1).displayed_soc, forecast.sample(5, 1).displayed_soc)


@pytest.mark.parametrize("kind", ["interval", "arrival.interval"])
def test_no_interval_holds_every_trip(forecast, kind):
    interval = attrgetter(kind)(forecast)
    low, high = interval(0.999)
    assert low < high
    for level in (1, 1.0):
        refuses("no interval holds every trip: level", interval, level)


def test_the_least_of_a_road_of_unknown_heights_is_that_of_a_descent():
    link = {"length_m": 20_000.0, "speed_m_s": 15.0}
    known = tw.Departure(soc=0.8, ambient_temperature_degc=5.0)
    unknown, level = (tw.forecast(tw.read_route([road]), known) for road in (link, link | {"grade": 0.0}))
    assert unknown.interval(0.9999)[0] < 0.0 < level.interval(0.9999)[0]
    assert f"{level!r}".endswith(f", {len(level.flags)} flags>")
    assert repr(dataclasses.replace(level, flags=())).endswith("%>")
    assert repr(dataclasses.replace(level, flags=level.flags[:1])).endswith(", 1 flag>")


def test_a_low_energy_stays_above_the_least_of_the_road(forecast):
    least = MIN_WH.sum()
    straight, rest = 0.75 * (TOTAL_WH - least), 0.25 * (TOTAL_WH - least)
    half = straight + 100.0
    wide = dataclasses.replace(forecast, sd_factor=1e-9, state_sd_wh=half / 2.0, route_sd_wh=0.0)
    expected = least + rest * np.exp(-100.0 / rest)
    assert wide.quantile(0.1) == pytest.approx(
        expected, rel=1e-6
    )  # the largest score, 2, is of a level of 0.8
    assert wide.probability_below(expected) == pytest.approx(0.1, rel=1e-6)
    assert wide.probability_below(least) == 0.0
    assert wide.quantile(0.9) == pytest.approx(TOTAL_WH + half, rel=1e-6)
    boundless = dataclasses.replace(wide, state_sd_wh=1e9)
    assert boundless.quantile(0.001) >= least


def test_arrival(forecast):
    left = START - TOTAL_WH / WH_PER_DISPLAY
    sd = charge_sd(SD_WH, TOTAL_WH)
    assert forecast.soc_arrival == pytest.approx(left, **EXACT)
    for level, factor in ((0.2, 0.5), (0.5, 1.25), (0.8, 2.0), (0.9, TAIL_90)):
        assert forecast.arrival.interval(level) == pytest.approx(
            (left - factor * sd, left + factor * sd), **EXACT
        )
        assert forecast.p_arrive(left - factor * sd) == pytest.approx(0.5 + level / 2, **EXACT)
        assert forecast.p_arrive(left + factor * sd) == pytest.approx(0.5 - level / 2, **EXACT)
    beyond = 2.0 * student.cdf(left / sd / 2.0 * student.ppf(0.9, 4), 4) - 1.0
    assert forecast.p_arrive() == pytest.approx(0.5 + beyond / 2, **EXACT)
    assert forecast.along.empty_at_m == (None, None, None)


def test_arrival_from_the_charge_of_the_battery_management(forecast):
    plan = dataclasses.replace(forecast.plan, departure=Departure(bms_soc=START_SOC))
    managed = dataclasses.replace(forecast, drive=dataclasses.replace(forecast.drive, plan=plan))
    left = START - TOTAL_WH / WH_PER_DISPLAY
    sd = charge_sd(SD_WH, TOTAL_WH, 0.03)
    assert managed.soc_arrival == pytest.approx(left, **EXACT)
    assert managed.arrival.interval(0.5) == pytest.approx((left - 1.25 * sd, left + 1.25 * sd), **EXACT)
    assert managed.to_frame()["displayed_soc_high"][0] == pytest.approx(START + TAIL_90 * 0.03, **EXACT)


def test_a_battery_that_runs_empty(forecast):
    plan = dataclasses.replace(forecast.plan, departure=Departure(soc=0.03))
    weak = dataclasses.replace(forecast, drive=dataclasses.replace(forecast.drive, plan=plan))
    assert weak.soc_arrival == 0.0
    sd = charge_sd(SD_WH, TOTAL_WH)
    short = TOTAL_WH / WH_PER_DISPLAY - 0.03
    assert short < 2.0 * sd
    assert weak.p_arrive() == pytest.approx(
        0.5 - np.interp(short / sd, [0, 0.5, 1, 1.5, 2], [0, 0.1, 0.2, 0.3, 0.4]), **EXACT
    )
    early, expected, late = weak.along.empty_at_m
    # the display is at 0 when 504 Wh are taken: in the third segment, at 30 of whose 302.5 Wh
    share = (0.03 * WH_PER_DISPLAY - 3100 / 60 - 11800 / 30) / (6050 / 20)
    assert expected == pytest.approx(2700.0 + 1800.0 * share, **EXACT)
    assert early < expected
    assert late is None
    assert (weak.to_frame()["displayed_soc"] >= 0.0).all()


def test_probabilities_to_arrive_are_given_for_four_charges_and_the_reserve(forecast):
    assert list(forecast.to_dict()["p_arrive_by_soc"]) == ["0", "0.05", "0.1", "0.2"]
    assert list(forecast.to_dict(0.15)["p_arrive_by_soc"]) == ["0", "0.05", "0.1", "0.2", "0.15"]
    assert list(forecast.to_dict()["quantiles_wh"]) == [
        *("0.025", "0.05", "0.1", "0.25", "0.5", "0.75", "0.9", "0.95", "0.975")
    ]


def test_the_charge_to_leave_with(forecast):
    sd = charge_sd(SD_WH, TOTAL_WH)
    tail = SCORES.factor(0.9)
    needed = 0.1 + TOTAL_WH / WH_PER_DISPLAY + tail * sd  # the reserve, what is taken, and 19 of 20 trips
    assert soc_needed(forecast) == pytest.approx(needed, abs=1e-5)
    assert soc_needed(forecast, 0.2, 0.5) == pytest.approx(0.2 + TOTAL_WH / WH_PER_DISPLAY, abs=1e-5)


def test_series(forecast):
    series = forecast.to_frame()
    energy = np.concatenate(([0.0], np.cumsum(ENERGY_WH)))
    half = TAIL_90 * np.concatenate(([0.0], CUMULATIVE_SD_WH))
    low = energy - half
    assert np.all(half[1:] < 0.75 * (energy - np.cumsum([0.0, *MIN_WH]))[1:])
    charge = START - energy / WH_PER_DISPLAY
    charge_half = [0.0, *(TAIL_90 * charge_sd(CUMULATIVE_SD_WH[k], energy[k + 1]) for k in range(3))]
    expected = {
        "time_s": [0.0, 60.0, 180.0, 360.0],
        "distance_m": [0.0, 300.0, 2700.0, 4500.0],
        "energy_wh": energy,
        "energy_low_wh": low,
        "energy_high_wh": energy + half,
        "displayed_soc": charge,
        "displayed_soc_low": charge - charge_half,
        "displayed_soc_high": charge + charge_half,
    }
    assert list(series) == list(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(series[name], values, rtol=1e-9, atol=1e-12, err_msg=name)


def test_causes(forecast):
    simulated = 3000 / 60 + 12000 / 30 + 6000 / 20
    causes = forecast.by_cause_wh
    assert (causes["aero"], causes["climb"]) == pytest.approx((400.0, 100.0), **EXACT)
    learned = 50.0 / 10  # of climate control, in six minutes
    assert causes["climate"] == pytest.approx(240.0 + simulated - 740.0 + learned, **EXACT)
    assert causes["correction"] == pytest.approx(100 / 60 - 200 / 30 + 50 / 20 - learned, **EXACT)
    assert forecast.battery_loss_wh == pytest.approx((300 * 120 + 600 * 240) / 3600, **EXACT)


def test_a_planned_route_adds_its_share_of_the_energy():
    route = RouteUncertainty(np.array([250.0, 1000.0]), np.array([0.0004, 0.0016]), 20)
    driven = departing()
    assert with_route_error(driven, route, None).to_dict() == driven.to_dict()
    on_links = dataclasses.replace(
        driven, drive=dataclasses.replace(driven.drive, plan=dataclasses.replace(driven.plan, link_m=625.0))
    )
    found = with_route_error(on_links, route, None)
    assert found.route_sd_wh == pytest.approx(np.sqrt(0.001) * (TOTAL_WH - 100.0), **EXACT)
    assert found.sd_wh == pytest.approx(np.hypot(driven.sd_wh, found.route_sd_wh), **EXACT)
    assert found.flags == ()
    longer = dataclasses.replace(
        on_links,
        drive=dataclasses.replace(driven.drive, plan=dataclasses.replace(driven.plan, link_m=1500.0)),
    )
    (flag,) = with_route_error(longer, route, None).flags
    assert (flag.code, flag.value) == ("links_too_long", 1500.0)
    (flag,) = with_route_error(on_links, None, None).flags
    assert flag.code == "route_error_unknown"
    assert with_route_error(on_links, None, None).sd_wh == pytest.approx(driven.sd_wh, **EXACT)


def test_an_update_by_power():
    updated = departing().update(powered())
    residual = 4000.0 - 3100.0
    first = BOTH_W2 + NOISE_W2[0] + CLIMATE_NOISE**2
    gain = BOTH_W2 / (first + 1.0)
    share = 0.2 + ONE_SIXTH * (0.5 - 0.2)
    rest = share * gain * residual
    ahead = (11800 + rest) / 30 + (6050 + rest) / 20
    assert updated.measured_until_s == 60.0
    assert updated.energy_wh == pytest.approx(4000 / 60 + ahead, **EXACT)
    # what is left of the constant after the first segment was seen, and what is new in each
    constant = BOTH_W2 - gain * BOTH_W2
    new = NOISE_W2 + CLIMATE_NOISE**2
    variance = constant * (1 / 30 + 1 / 20) ** 2 + new[1] / 30**2 + new[2] / 20**2
    factor = 1.1 + ONE_SIXTH * (1.4 - 1.1)
    assert updated.sd_wh == pytest.approx(SD_FACTOR * factor * np.sqrt(variance), rel=1e-9)
    np.testing.assert_allclose(
        updated.to_frame()["energy_wh"],
        np.cumsum([0.0, 4000 / 60, (11800 + rest) / 30, (6050 + rest) / 20]),
        rtol=1e-9,
    )
    # without a reading of the charge, the energy is taken from that of the departure
    assert updated.soc_arrival == pytest.approx(START - updated.energy_wh / WH_PER_DISPLAY, **EXACT)


class UnknownCar(LoggedClimate):
    """A corrector whose car may differ by a share of the power, and by a load while it warms up."""

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[np.ndarray, np.ndarray]:
        warming = np.array([90.0, 30.0, 0.0])
        return np.zeros(3), np.column_stack([0.1 * table.simulated_w, 5.0 * warming])


@pytest.mark.parametrize("split", [False, True])
def test_the_rest_has_what_is_learned_of_the_car_in_full(split):
    start = departing(split)
    start = dataclasses.replace(start, drive=dataclasses.replace(start.drive, corrector=UnknownCar()))
    samples = powered(heating_power_w=800.0, aircon_power_w=50.0) if split else powered()
    updated = start.update(samples)
    process, segments = start.uncertainty.process, start.drive.segments
    own = UnknownCar().predict_with_uncertainty(start.drive.table)[1]
    own = own @ own.T / SD_FACTOR**2
    whole = process.prior(segments).covariance_w2
    left = 1.0 - segments.hours @ own @ segments.hours / (segments.hours @ whole @ segments.hours)
    assert 0.2 < left < 0.98
    others = left * process.prior(segments, "drive" if split else "joint").covariance_w2
    seen_w2 = own[0, 0] + others[0, 0] + 1.0
    share = updated.uncertainty.shrinkage.at("drive" if split else "joint", 1.0 / 6.0)
    rest = (own[1:, 0] + share * others[1:, 0]) / seen_w2 * 900.0
    np.testing.assert_allclose(updated.power_w[1:], start.power_w[1:] + rest, rtol=1e-9)
    after = own + others - np.outer((own + others)[:, 0], (own + others)[:, 0]) / seen_w2
    if not split:
        np.testing.assert_allclose(updated.posterior.covariance_w2, after, atol=1e-6)


def test_an_update_by_power_with_climate_control_beside_it():
    logged = powered(heating_power_w=1000.0, aircon_power_w=150.0)
    updated = departing(split=True).update(logged)
    climate = 1150.0 - 800.0 - 50.0
    driving = 900.0 - climate
    climate_gain = CLIMATE_SD_W**2 / (CLIMATE_SD_W**2 + CLIMATE_NOISE**2 + 1.0)
    drive_gain = CONSTANT_W**2 / (CONSTANT_W**2 + NOISE_W2[0] + 1.0)
    rest = (0.4 + ONE_SIXTH * 0.3) * climate_gain * climate + (0.1 + ONE_SIXTH * 0.15) * drive_gain * driving
    assert updated.energy_wh == pytest.approx(4000 / 60 + (11800 + rest) / 30 + (6050 + rest) / 20, **EXACT)
    constant = CLIMATE_SD_W**2 * (1 - climate_gain) + CONSTANT_W**2 * (1 - drive_gain)
    new = NOISE_W2 + CLIMATE_NOISE**2
    variance = constant * (1 / 30 + 1 / 20) ** 2 + new[1] / 30**2 + new[2] / 20**2
    factor = 1.2 + ONE_SIXTH * (1.5 - 1.2)
    assert updated.sd_wh == pytest.approx(SD_FACTOR * factor * np.sqrt(variance), rel=1e-9)


@pytest.mark.parametrize(
    "columns", [{"voltage_v": 400.0, "current_a": 10.0}, {"soc": [0.50, 0.49, 0.48, 0.47]}]
)
def test_an_update_is_at_most_as_wide_as_the_departure(columns):
    start = departing()
    ten = np.full(6, 10.0)
    shrinkage = dataclasses.replace(start.uncertainty.shrinkage, joint_sd_factor=ten)
    start = dataclasses.replace(
        start, uncertainty=dataclasses.replace(start.uncertainty, shrinkage=shrinkage)
    )
    updated = start.update(pd.DataFrame({"time_s": [0.0, 20.0, 40.0, 60.0], **columns}))
    assert updated.sd_wh == pytest.approx(start.sd_wh, rel=1e-9)


def test_climate_control_that_was_off_is_left_out_of_the_rest():
    known = uncertainty(split=True)
    off = np.array([0.0, 0.0, 0.0, 0.8, 0.8, 0.8])
    known = dataclasses.replace(known, shrinkage=dataclasses.replace(known.shrinkage, off=off))
    start = dataclasses.replace(departing(split=True), uncertainty=known)
    log = pd.DataFrame(
        {
            "time_s": np.arange(181.0),
            "voltage_v": 400.0,
            "current_a": 10.0,
            "heating_power_w": 0.0,
            "aircon_power_w": 50.0,
        }
    )
    updated = start.update(log)
    # after half of the trip; the last segment was to have 500 W, corrected by 50 W
    seen = np.array([4000.0 - 3100.0, 4000.0 - 11800.0]) - (50.0 - (CLIMATE_W[:2] + 50.0))
    noise = NOISE_W2[:2] + 1.0
    drive_gain = CONSTANT_W**2 / (1.0 + CONSTANT_W**2 * np.sum(1.0 / noise))
    driving = 0.3 * drive_gain * np.sum(seen / noise)
    assert updated.energy_wh == pytest.approx(
        4000 / 60 + 4000 / 30 + (6050 - 0.8 * 550 + driving) / 20, **EXACT
    )
    drawn = start.update(log.assign(aircon_power_w=51.0))  # more than fans take
    assert drawn.posterior.mean_w[2] != pytest.approx(updated.posterior.mean_w[2], abs=1.0)


def test_a_departure_without_climate_control_has_no_energy_for_it():
    model, plan = tw.load_model(), tw.read_route([{"length_m": 20000.0, "speed_m_s": 20.0}])
    known = tw.Departure(soc=0.8, ambient_temperature_degc=-5.0, cabin_setpoint_degc=21.0)
    auto, off = (model.forecast(plan, dataclasses.replace(known, climate=mode)) for mode in ("auto", "off"))
    drive = auto.drive
    climate_wh = float((drive.table.hours * drive.climate_w).sum())
    assert climate_wh > 300.0
    # the battery is as cold in both, so little else changes
    assert auto.energy_wh - off.energy_wh == pytest.approx(climate_wh, rel=0.05)
    assert off.by_cause_wh["climate"] == pytest.approx(0.0, abs=0.2)  # a second of the base load, at the end
    assert (off.drive.climate_w == 0.0).all()
    heat = model.forecast(plan, dataclasses.replace(known, climate="heat"))
    assert heat.energy_wh == pytest.approx(auto.energy_wh, rel=1e-12)
    assert model.forecast(plan, known).energy_wh == auto.energy_wh


def test_a_burst_of_the_heater_counts_up_to_the_limit():
    burst = departing(split=True).update(powered(heating_power_w=3000.0, aircon_power_w=0.0))
    climate, driving = 600.0, 900.0 - (3000.0 - 850.0)
    climate_gain = CLIMATE_SD_W**2 / (CLIMATE_SD_W**2 + CLIMATE_NOISE**2 + 1.0)
    drive_gain = CONSTANT_W**2 / (CONSTANT_W**2 + NOISE_W2[0] + 1.0)
    rest = (0.4 + ONE_SIXTH * 0.3) * climate_gain * climate + (0.1 + ONE_SIXTH * 0.15) * drive_gain * driving
    assert burst.energy_wh == pytest.approx(4000 / 60 + (11800 + rest) / 30 + (6050 + rest) / 20, **EXACT)


def rest_sd_wh(updated, ahead):
    """Standard deviation of the energy of the parts of the segments that are ahead."""
    hours = ahead * updated.drive.table.hours
    variance = hours @ updated.posterior.covariance_w2 @ hours
    return SD_FACTOR * updated.rest_sd_factor * np.sqrt(variance)


def test_an_update_by_charge():
    readings = pd.DataFrame({"time_s": [0.0, 20.0, 40.0, 60.0], "soc": [0.50, 0.49, 0.48, 0.47]})
    updated = departing().update(readings)
    # steps of 0.01: the last change, to 0.475, lies half way between 40 and 60 s
    taken = 0.025 * WH_PER_SOC
    residual = taken * 72.0 - 3100.0
    error_w2 = ((0.01 / NORMAL_SCALE * WH_PER_DISPLAY) ** 2 + (0.03 * taken) ** 2) * 72.0**2 / SD_FACTOR**2
    first = BOTH_W2 + NOISE_W2[0] + CLIMATE_NOISE**2
    seen = first * residual / (first + error_w2)
    share = 0.2 + ONE_SIXTH * (0.5 - 0.2)
    rest = share * BOTH_W2 * residual / (first + error_w2)
    energy = np.array([(3100 + seen) / 60, (11800 + rest) / 30, (6050 + rest) / 20])
    assert updated.energy_wh == pytest.approx(energy.sum(), rel=1e-9)
    # arrival counts from the last reading, not from the first
    left = (0.47 - ZERO) / (FULL - ZERO) - energy[1:].sum() / WH_PER_DISPLAY
    assert updated.soc_arrival == pytest.approx(left, rel=1e-9)
    sd = charge_sd(
        rest_sd_wh(updated, np.array([0, 1, 1])), energy.sum()
    )  # the display at departure was known
    assert updated.p_arrive(left - 1.5 * sd) == pytest.approx(0.8, rel=1e-9)


def test_displayed_charge_is_converted_before_it_counts():
    times = {"time_s": [0.0, 20.0, 40.0, 60.0]}
    shown = departing().update(pd.DataFrame({**times, "displayed_soc": [0.50, 0.48, 0.46, 0.44]}))
    managed = departing().update(pd.DataFrame({**times, "soc": [0.500, 0.484, 0.468, 0.452]}))
    assert shown.energy_wh == pytest.approx(managed.energy_wh, rel=1e-9)
    assert shown.soc_arrival == pytest.approx(managed.soc_arrival, rel=1e-9)
    assert shown.measured.anchor == ChargeReading(60.0, 0.44, True)
    assert managed.measured.anchor == ChargeReading(60.0, 0.452, False)


@pytest.mark.parametrize(
    ("shown", "at_s", "counts"),
    [(0.55, 0.0, True), (0.66, 0.0, False), (0.55, 61.0, False), (None, 0.0, False)],
)
def test_a_charge_of_the_battery_management_counts_from_the_display_at_departure(shown, at_s, counts):
    expected = departing()
    plan = dataclasses.replace(expected.plan, departure=Departure(soc=shown, bms_soc=0.5))
    readings = pd.DataFrame(
        {"time_s": at_s + np.array([0.0, 20.0, 40.0, 60.0]), "soc": [0.500, 0.484, 0.468, 0.452]}
    )
    updated = dataclasses.replace(expected, drive=dataclasses.replace(expected.drive, plan=plan)).update(
        readings
    )
    before, after = np.interp([at_s + 60.0, 360.0], [0.0, 60.0, 180.0, 360.0], updated.along.energy_wh)
    base, taken = (0.01, after) if counts else (0.03, after - before)
    start = shown - 0.048 / (FULL - ZERO) if counts else (0.452 - ZERO) / (FULL - ZERO)
    left = start - (after - before) / WH_PER_DISPLAY
    assert updated.soc_arrival == pytest.approx(left, rel=1e-9)
    ahead = np.clip((360.0 - at_s - 60.0 - np.array([300.0, 180.0, 0.0])) / [60.0, 120.0, 180.0], 0.0, 1.0)
    sd = charge_sd(rest_sd_wh(updated, ahead), taken, base)
    assert updated.p_arrive(left - 1.5 * sd) == pytest.approx(0.8, rel=1e-9)


def test_a_full_display_gives_what_it_hides_before_the_battery_managements_charge_counts():
    known = dataclasses.replace(
        uncertainty(), charge=ChargeScale(ZERO, FULL, WH_PER_DISPLAY, 0.01, 0.02, hidden=0.02)
    )
    expected = dataclasses.replace(departing(), uncertainty=known)
    plan = dataclasses.replace(expected.plan, departure=Departure(soc=1.0))
    full = dataclasses.replace(expected, drive=dataclasses.replace(expected.drive, plan=plan))
    updated = full.update(pd.DataFrame({"time_s": [0.0, 60.0], "soc": [0.90, 0.86]}))
    rest = updated.along.energy_wh[-1] - updated.along.energy_wh[1]
    left = 1.02 - 0.04 / (FULL - ZERO) - rest / WH_PER_DISPLAY
    assert updated.soc_arrival == pytest.approx(left, rel=1e-9)


def test_what_is_unknown_of_route_and_state_counts_from_the_last_reading_of_the_charge(forecast):
    within_second = ChargeReading(150.0, 0.48, True)
    read = dataclasses.replace(
        forecast, measured=dataclasses.replace(forecast.measured, anchor=within_second)
    )
    own = np.sqrt(SD_WH**2 - BESIDE_SD_WH**2)
    left = (0.25 / 30 + 1 / 20) / (1 / 60 + 1 / 30 + 1 / 20)
    assert read.sd_wh == pytest.approx(np.hypot(own, left * BESIDE_SD_WH), rel=1e-9)


@pytest.mark.parametrize(("until_s", "counts"), [(47.0, False), (48.0, True), (60.0, True)])
def test_a_segment_counts_from_four_fifths_of_its_time_on(until_s, counts):
    log = powered()[lambda rows: rows["time_s"] <= until_s]
    updated = departing().update(log)
    if not counts:
        assert updated.posterior.mean_w.tolist() == [0.0, 0.0, 0.0]
        return
    # a part of a segment tells of the whole as far as its noise allows
    error_w2 = (1.0 - until_s / 60.0) * NOISE_W2[0] + 1.0
    share = np.interp(until_s / 360.0, [0.0, 0.1, 0.25], [0.0, 0.2, 0.5])
    gain = BOTH_W2 / (BOTH_W2 + NOISE_W2[0] + CLIMATE_NOISE**2 + error_w2)
    assert updated.posterior.mean_w[1] == pytest.approx(share * gain * 900.0, rel=1e-9)


def test_a_gap_of_fifteen_seconds_is_bridged_and_a_longer_one_is_not():
    for gap_s, hours in ((15.0, 60.0), (16.0, 44.0)):
        log = powered()
        kept = log[(log["time_s"] <= 20.0) | (log["time_s"] >= 20.0 + gap_s)]
        assert departing().update(kept).measured.hours[0] * 3600.0 == pytest.approx(hours, rel=1e-9)
