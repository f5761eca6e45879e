"""The forecast protocol: nothing leaks into a departure forecast, and the scores are what they say."""

import dataclasses
import json
from functools import partial

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm
from tests.support.refusals import refusal

from tripwatt.forecasting import ForecastModel
from tripwatt.learners.folds import leave_one_out
from tripwatt.physics import simulate_trip
from tripwatt.study.evaluation import Execution, choose_models, evaluate, find_protocol, write_results
from tripwatt.study.evaluation.forecast_data import DATA_FEATURES, ForecastData, measured_log
from tripwatt.study.evaluation.forecast_models import DataMethod
from tripwatt.study.evaluation.forecast_protocol import ForecastProtocol
from tripwatt.study.evaluation.forecast_scores import (
    FRACTIONS,
    LEVELS,
    UPDATES,
    coverage_scores,
    crps,
    crps_scores,
)
from tripwatt.study.evaluation.held_out_forecasts import reforecast
from tripwatt.study.evaluation.hold_outs import (
    LEAVE_ONE_DAY_OUT,
    WITHOUT_DAYS,
    CarChoice,
    HoldOut,
    HoldOutChoice,
)
from tripwatt.study.evaluation.tasks import Method
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan, Trip
from tripwatt.vehicles import load_vehicle

ROAD = ("time_s", "speed_m_s", "elevation_m")
FAST = ("constant", "physics4", "power-kriging", "hybrid")


QUICK = ForecastProtocol(corrector="linear")


@pytest.fixture(scope="module")
def fleet():
    return synthetic_fleet(n_trips=11, seed=3)


@pytest.fixture(scope="module")
def car():
    return load_vehicle("bmw_i3_60ah")


@pytest.fixture(scope="module")
def prepared(fleet, car):
    return ForecastData.from_trips(fleet.trips, car)


@pytest.fixture(scope="module")
def model(prepared, car):
    return ForecastModel(car, corrector="linear").fit_segments(prepared.segments.take(range(9)))


def randomised(trip: Trip, seed: int) -> Trip:
    """Every measured column redrawn after the first sample; columns that the fleet lacks are added, random throughout."""
    rng = np.random.default_rng(seed)
    samples = trip.samples.copy()
    for name in samples.columns.difference(list(ROAD)):
        values = samples[name].to_numpy(dtype=float, copy=True)
        values[1:] = rng.permutation(values[1:]) + rng.uniform(0.1, 1.0, len(values) - 1)
        samples[name] = values
    for name in ("throttle", "motor_torque_nm", "regeneration_signal", "heating_power_w", "aircon_power_w"):
        samples[name] = rng.uniform(0.0, 1.0, len(samples))
    return dataclasses.replace(trip, samples=samples, observed_energy_wh=float(rng.uniform(1.0, 9e3)))


def test_departure_forecast_ignores_what_is_measured_later(fleet, model, car):
    trip = fleet.trips[10]
    before = model.forecast(trip)
    for seed in range(3):
        changed = randomised(trip, seed)
        assert not changed.samples.equals(trip.samples)
        after = model.forecast(changed)
        assert json.dumps(after.to_dict()) == json.dumps(before.to_dict())
        for level in LEVELS:
            assert after.interval(level) == before.interval(level)
    # and the departure itself does matter
    warm = trip.samples.assign(ambient_temperature_degc=trip.samples["ambient_temperature_degc"] + 9.0)
    assert model.forecast(dataclasses.replace(trip, samples=warm)).energy_wh != before.energy_wh


def test_prepared_trips_hold_nothing_of_later_signals(fleet, car):
    trips = fleet.trips[:2]
    before, after = (
        ForecastData.from_trips(some, car)
        for some in (trips, [keep_energy(t, randomised(t, i)) for i, t in enumerate(trips)])
    )
    pd.testing.assert_frame_equal(before.segments.features, after.segments.features)
    pd.testing.assert_frame_equal(before.data_features, after.data_features)
    pd.testing.assert_frame_equal(before.table.totals, after.table.totals)
    np.testing.assert_array_equal(before.table.simulated_wh["physics"], after.table.simulated_wh["physics"])
    for plan, other in zip(before.plans, after.plans, strict=True):
        pd.testing.assert_frame_equal(plan.samples, other.samples)


def keep_energy(trip: Trip, changed: Trip) -> Trip:
    """The changed trip with its own voltage and current, which are the target and no covariate."""
    own = {c: trip.samples[c] for c in ("voltage_v", "current_a")}
    return dataclasses.replace(
        changed, samples=changed.samples.assign(**own), observed_energy_wh=trip.observed_energy_wh
    )


@pytest.mark.parametrize("fraction", [FRACTIONS[0], FRACTIONS[-1]])
def test_reforecast_never_sees_a_sample_after_the_cut(fleet, model, fraction):
    trip = fleet.trips[10]
    forecast = model.forecast(trip)
    cut = fraction * float(forecast.to_frame()["time_s"].iloc[-1])
    rng = np.random.default_rng(1)
    samples = trip.samples.copy()
    later = (samples["time_s"] - samples["time_s"].iloc[0] > cut).to_numpy()
    for name in ("voltage_v", "current_a", "soc", "displayed_soc"):
        samples[name] = np.where(later, samples[name] * rng.uniform(0.5, 0.9, len(samples)), samples[name])
    changed = dataclasses.replace(trip, samples=samples)
    before, after = (reforecast(forecast, measured_log(t), fraction) for t in (trip, changed))
    assert before == after
    samples.loc[~later, "current_a"] += 20.0
    moved = reforecast(forecast, measured_log(dataclasses.replace(trip, samples=samples)), fraction)
    assert moved[UPDATES.index("update")] != before[UPDATES.index("update")]


def test_log_rows_depend_on_no_later_sample(fleet):
    trip = fleet.trips[0]
    samples = trip.samples.copy()
    samples.loc[100:140, "current_a"] = np.nan
    whole = measured_log(dataclasses.replace(trip, samples=samples))
    part = measured_log(dataclasses.replace(trip, samples=samples.iloc[:120]))
    known = whole[whole["time_s"] <= part["time_s"].iloc[-1]]
    pd.testing.assert_frame_equal(known.reset_index(drop=True), part)


def test_coverage_and_scores_of_a_known_distribution():
    rng = np.random.default_rng(5)
    n = 1500
    centre, sd = rng.uniform(500, 5000, n), rng.uniform(20, 400, n)
    observed = rng.normal(centre, sd)
    half = norm.ppf(0.5 + np.array(LEVELS) / 2)[None, :] * sd[:, None]
    scores = coverage_scores(observed, centre[:, None] - half, centre[:, None] + half, seed=0)
    for level in LEVELS:
        key = f"{level:g}"
        inside = np.abs(observed - centre) <= norm.ppf(0.5 + level / 2) * sd
        assert scores["coverage"][key] == pytest.approx(inside.mean())
        low, high = scores["coverage_ci95"][key]
        assert low <= level <= high
        assert scores["interval_width_wh"][key] == pytest.approx(2 * norm.ppf(0.5 + level / 2) * sd.mean())
    factors = np.tile(norm.ppf(0.5 + (np.arange(100) + 0.5) / 200), (n, 1))
    found = crps_scores(observed, centre, sd, factors)
    z = (observed - centre) / sd  # closed form of Gneiting and Raftery 2007, equation 21
    exact = np.mean(sd * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi)))
    assert found["crps_wh"] == pytest.approx(exact, rel=5e-3)
    assert found["crps_wh"] < found["crps_best_same_width_wh"] <= found["crps_same_width_wh"]
    assert crps(observed, np.tile(centre[:, None], 40)) == pytest.approx(np.abs(observed - centre))


def test_data_only_sees_nothing_simulated(prepared):
    assert not {c for c in DATA_FEATURES if c.endswith("_w")}
    segments = prepared.segments
    wrong = dataclasses.replace(
        segments,
        simulated_w=3.0 * segments.simulated_w + 500.0,
        features=segments.features.assign(simulated_w=1.0, air_w=0.0, climate_w=7.0),
    )
    train, test = np.arange(8), np.arange(8, 11)
    one, two = (
        DataMethod("boosting").fit(dataclasses.replace(prepared, segments=b), train, 0).predict(test)
        for b in (segments, wrong)
    )
    np.testing.assert_array_equal(one, two)


def charged_first(trip: Trip) -> Trip:
    """A trip of the same energy whose first 60 % give back 8 kW more than they did."""
    late = np.arange(len(trip)) >= 0.6 * len(trip)
    moved_w = np.where(late, 8000.0 * np.sum(~late) / np.sum(late), -8000.0)
    changed = trip.samples.assign(current_a=trip.array("current_a") + moved_w / trip.array("voltage_v"))
    return dataclasses.replace(trip, samples=changed)


@pytest.fixture(scope="module")
def whole(fleet):
    """An evaluation in which the first trip breaks a law of physics on the way."""
    trips = (charged_first(fleet.trips[0]), *fleet.trips[1:])
    hold_out = "leave_one_trip_out:audited"
    return evaluate(trips, protocol=QUICK, models=FAST, hold_outs=hold_out, execution=Execution(n_jobs=1))


def test_a_trip_that_fails_is_a_row_with_its_reason_and_in_no_score(whole, fleet):
    (row,) = whole.failed.to_dict("records")
    assert (row["trip"], row["model"]) == (fleet.trips[0].trip_id, "hybrid")
    assert row["reason"].startswith("less energy than the drive takes")
    assert set(whole.to_frame()["n_trips"]) == {10}
    assert row["trip"] not in set(whole.folds["trip"])
    (note,) = [note for note in whole.results["notes"] if "failed" in note]
    assert note.startswith(
        f"leave_one_trip_out:audited: 10 of 11 trips scored; 1 failed: {row['trip']} (less"
    )


def test_results_hold_the_contract(whole, tmp_path):
    run = whole
    write_results(run, tmp_path)
    results = json.loads((tmp_path / "results.json").read_text())
    assert {"learning_curve", "strata", "paired", "evaluations", "failed"} <= set(results)
    for evaluation in results["evaluations"]:
        hybrid = evaluation["models"]["hybrid"]
        assert list(hybrid["coverage"]) == ["0.5", "0.8", "0.9", "0.95"]
        widths = list(hybrid["interval_width_wh"].values())
        assert widths == sorted(widths)
        assert widths[0] > 0
        assert list(hybrid["update"]) == ["0.1", "0.25", "0.5", "0.75"]
        assert {"mape", "no_update", "naive_gauge", "soc_only", "diff_ci95"} <= set(hybrid["update"]["0.5"])
        assert 0 < hybrid["crps_wh"] < evaluation["models"]["hybrid"]["rmse_wh"]
    forecasts = pd.read_csv(tmp_path / "forecasts.csv")
    folds = run.folds.query("scheme == 'leave_one_trip_out' and model == 'hybrid'")
    np.testing.assert_allclose(forecasts["energy_wh"], folds["predicted_energy_wh"])
    assert forecasts["pit"].between(0, 1).all()


def forecast_of(data: ForecastData, held_out: int) -> np.ndarray:
    """Centre, width and bounds of one trip while it is held out."""
    (spec,) = choose_models(QUICK, ("hybrid",))
    hold_out = HoldOut("s", "t", data.table, data, leave_one_out(np.arange(len(data))))
    (task,) = spec.tasks(0, hold_out, hold_out.splits[held_out : held_out + 1], 0)
    (found,) = task.run()
    (kept,) = found.forecasts
    return np.concatenate([found.predicted_wh, [kept.sd_wh], kept.bounds_wh.ravel()])


def test_held_out_trips_do_not_move_their_own_forecast(prepared):
    """Nothing of an outer fold is in its centre, its width or its bounds; everything of the others is."""

    def run(held_out, observed_w):
        segments = dataclasses.replace(prepared.segments, observed_w=observed_w)
        return forecast_of(dataclasses.replace(prepared, segments=segments), held_out)

    own = prepared.segments.observed_power_w
    louder = np.where(prepared.segments.groups == 4, 1.7 * own + 300.0, own)
    np.testing.assert_array_equal(run(4, own), run(4, louder))
    assert not np.array_equal(run(5, own), run(5, louder))


def with_signals(trip: Trip, car, torque_nm: float, heater_w: float, standing_w: float) -> Trip:
    """A trip with what the log of a car's stages has: torque, heater, air conditioner, and power at standstill."""
    run = simulate_trip(car, trip)
    speed = np.maximum(trip.array("speed_m_s"), 0.1)
    ratio = car.drivetrain.wheel_radius_m / car.drivetrain.gear_ratio
    standing = trip.array("speed_m_s") < 0.1
    samples = trip.samples.assign(
        motor_torque_nm=run.wheel_power_w / speed * ratio + torque_nm,
        heating_power_w=np.where(standing, 0.0, heater_w),
        aircon_power_w=0.0,
        current_a=np.where(standing, standing_w / trip.array("voltage_v"), trip.array("current_a")),
    )
    return dataclasses.replace(trip, samples=samples)


def test_signals_of_a_held_out_trip_do_not_move_its_forecast(fleet, car):
    """Stages are identified inside the fold: torque, heater and standing power of the held-out trip change nothing."""
    usual = {"torque_nm": 2.0, "heater_w": 600.0, "standing_w": 400.0}
    loud = {name: 5.0 * value for name, value in usual.items()}

    def prepared_with(trip_number):
        trips = [
            with_signals(trip, car, **(loud if i == trip_number else usual))
            for i, trip in enumerate(fleet.trips)
        ]
        measured = prepared_of_usual  # energies stay those of the usual trips
        stages = ForecastData.from_trips(trips, car).stages
        return dataclasses.replace(measured, stages=stages)

    prepared_of_usual = ForecastData.from_trips([with_signals(t, car, **usual) for t in fleet.trips], car)
    before = forecast_of(prepared_of_usual, 4)
    np.testing.assert_array_equal(before, forecast_of(prepared_with(4), 4))
    assert not np.array_equal(before, forecast_of(prepared_with(5), 4))


def test_fit_here_score_there(fleet):
    other = synthetic_fleet(n_trips=4, seed=8)
    run = evaluate(
        fleet,
        protocol=QUICK,
        models=("physics", "power-kriging", "hybrid"),
        test_fleet=other,
        execution=Execution(n_jobs=1),
    )
    (evaluation,) = run.results["evaluations"]
    assert (evaluation["scheme"], evaluation["n_trips"]) == ("other_trips", 4)
    assert set(run.forecast["observed_energy_wh"].round(6)) == {
        round(float(t.observed_energy_wh), 6) for t in other.trips
    }


def test_what_cannot_be_evaluated_is_refused(fleet):
    few, none = (dataclasses.replace(fleet, logs=fleet.logs[:n]) for n in (6, 0))
    run = partial(refusal, evaluate, models=("constant",), execution=Execution(n_jobs=1))
    allowed = "got 6 to train on, of 6; allowed: at least 8 to train on"
    small = f"too few trips after the audit: {fleet.name}: "
    assert run(few, protocol="forecast") == small + "got 5 to train on, of 6; allowed: at least 8 to train on"
    assert run(few, protocol="forecast", test_fleet=fleet) == small + allowed
    found = run(fleet, protocol="forecast", test_fleet=none)
    assert found == f"no trip to score: --test {fleet.name}: got 0; allowed: at least 1 after the audit"
    found = run(fleet, protocol="forecast", test_fleet=few, hold_outs="reference")
    both = "option has no effect: hold_outs: got hold-outs with test trips; allowed: one of the two"
    assert found == both
    found = run(fleet, protocol="paper", test_fleet=few)
    assert found == "option not available: --test: got protocol 'paper'; allowed: protocol 'forecast'"
    few = dataclasses.replace(fleet, logs=fleet.logs[:2])
    assert run(few, protocol="paper") == small + "got 2 of 2; allowed: at least 3 with measured energy"
    found = run(few, protocol="papr")
    assert found == "unknown protocol: protocol: got 'papr'; allowed: paper, forecast; did you mean 'paper'?"
    with pytest.raises(NotImplementedError):
        Method().fit(None, np.arange(3), 0)
    with pytest.raises(NotImplementedError):
        Method().fit_all_folds(None, np.arange(3), 0, inner_errors=False)
    with pytest.raises(NotImplementedError):
        Method().required_data(None, np.arange(3))


def test_trips_of_another_fleet_are_its_reference_trips_where_it_names_any(fleet):
    other = synthetic_fleet(n_trips=4, seed=8)
    named = dataclasses.replace(other, reference={other.trips[k].trip_id: None for k in (0, 2)})
    for test, name, count in ((other, "audited", 4), (named, "reference", 2)):
        prepared = QUICK.prepare(fleet, test, CarChoice("bmw_i3_60ah"), HoldOutChoice())
        (hold_out,) = prepared.hold_outs
        assert (hold_out.trips, len(hold_out.scored)) == (name, count)


def test_kinds_of_trips_are_scored_by_models_that_did_not_see_them(car):
    fleet = synthetic_fleet(n_trips=26, seed=8)
    found = QUICK.prepare(fleet, None, CarChoice("bmw_i3_60ah"), HoldOutChoice())
    by_name = {(h.scheme, h.trips): h for h in found.hold_outs}
    for name, measure in (
        ("longer third", lambda plan: plan.duration_s),
        ("faster third", lambda plan: plan.distance_m / plan.duration_s),
    ):
        held = by_name["leave_regime_out", name]
        values = np.array([measure(plan) for plan in held.data.plans])
        (split,) = held.splits
        assert values[split.test].min() > values[split.train].max()
        assert len(split.test) == pytest.approx(len(values) / 3, abs=1)
        assert held.data.segments.trip_ids == held.table.trip_ids == tuple(p.trip_id for p in held.data.plans)
        assert len(held.data.data_features) == len(held.data.segments.hours)
    seasons = [h for (scheme, name), h in by_name.items() if "fitted on" in name]
    for held in seasons:
        (split,) = held.splits
        kinds = [{held.table.trips[i].context.season for i in part} for part in (split.train, split.test)]
        assert list(map(len, kinds)) == [1, 1]
        assert kinds[0] != kinds[1]
    later = by_name.get(("time_split", "last third by date"))
    if later is not None:
        days = [str(trip.context.day) for trip in later.table.trips]
        (split,) = later.splits
        assert max(days[i] for i in split.train) <= min(days[i] for i in split.test)


def test_a_first_sample_without_a_value_takes_the_next_within_a_minute(fleet):
    trip = fleet.trips[0]
    samples = trip.samples.copy()
    samples.loc[:2, "displayed_soc"] = np.nan
    late = dataclasses.replace(trip, samples=samples)
    assert Plan.from_trip(late).departure.soc == samples["displayed_soc"].iloc[3]
    samples = samples.assign(displayed_soc=samples["displayed_soc"].where(samples["time_s"] > 60.5))
    assert Plan.from_trip(dataclasses.replace(trip, samples=samples)).departure.soc is None


def test_notes_say_which_hold_outs_and_trips_are_left_out(fleet):
    i3 = CarChoice("bmw_i3_60ah")
    logs = [
        dataclasses.replace(log, context=dataclasses.replace(log.context, started_at=None))
        for log in fleet.logs
    ]
    undated = dataclasses.replace(fleet, logs=tuple(logs), reference={"none": None})
    for protocol in (QUICK, find_protocol("paper")):
        dated = protocol.prepare(fleet, None, i3, HoldOutChoice())
        found = protocol.prepare(undated, None, i3, HoldOutChoice())
        assert WITHOUT_DAYS in found.notes
        assert WITHOUT_DAYS not in dated.notes
        assert LEAVE_ONE_DAY_OUT not in {hold_out.scheme for hold_out in found.hold_outs}
        few = "leave-one-day-out left out: too few trips remain without the fullest day"
        assert (few in dated.notes) != (LEAVE_ONE_DAY_OUT in {h.scheme for h in dated.hold_outs})
    (left,) = [n for n in QUICK.prepare(fleet, None, i3, HoldOutChoice()).notes if "regimes left out" in n]
    assert "time_split" not in left
    assert "longer third" in left
    lost = f"none of the reference trips of the data set {fleet.name!r} is here"
    assert (lost in found.notes, lost in dated.notes) == (True, False)
