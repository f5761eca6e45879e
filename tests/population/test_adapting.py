"""From one car to another: laws of the shrinkage, recovery of a known difference, and nothing that looks ahead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tripwatt.evaluation.transfer import _source, evaluate_transfer
from tripwatt.evaluation.transfer_scores import paired_energy_error, resamples, scored
from tripwatt.forecasting.donor import DonorModel, unknown_inputs, without_inputs
from tripwatt.hybrid.car_corrector import HierarchicalCorrector
from tripwatt.hybrid.hierarchy import CarTransfer, Evidence, Members, grid, term_scales

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel, load_metadata, load_model, save_model
from tripwatt.forecasting.fitting import donor_model, fit_with_provenance
from tripwatt.hybrid import SegmentTable, identify_trips, power_corrector, segment_table, segment_trips
from tripwatt.hybrid.parameters import PARAMETERS, changed, sensitivities
from tripwatt.hybrid.power import PowerCorrector
from tripwatt.hybrid.split import SplitCorrector
from tripwatt.hybrid.stored import new_converter, parts_tree, structured, tree_parts
from tripwatt.physics import simulate_trip
from tripwatt.population import adapt_model, adaptation, adapting, without_trips
from tripwatt.population.adapting import weighted_quantiles
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import Fleet, Trip, plan_from_trip
from tripwatt.uncertainty.held_out import process_segments
from tripwatt.vehicles import Vehicle, load_vehicle, names_data

TRUTH = {"mass": 0.08, "base_load": 0.6}
"""What the second car's book has wrong."""


def driven_by(trip: Trip, car: Vehicle, extra_w: float = 0.0) -> Trip:
    """The trip as another car would have logged it: its physics, and a constant load that no book knows."""
    road = trip.samples[["time_s", "speed_m_s", "elevation_m", "ambient_temperature_degc"]]
    bare = Trip.from_samples(trip.trip_id, road, replace(trip.context, cabin_setpoint_degc=None))
    run = simulate_trip(car, plan_from_trip(bare))
    power = np.interp(road["time_s"] - road["time_s"].iloc[0], run.time_s, run.battery_power_w) + extra_w
    samples = road.assign(voltage_v=360.0, current_a=power / 360.0)
    return Trip.from_samples(trip.trip_id, samples, bare.context)


@pytest.fixture(scope="module")
def roads() -> tuple[Trip, ...]:
    return synthetic_fleet(30, seed=3).trips


@pytest.fixture(scope="module")
def i3() -> Vehicle:
    return load_vehicle("bmw_i3_60ah")


@pytest.fixture(scope="module")
def leaf() -> Vehicle:
    return load_vehicle("nissan_leaf_24")


@pytest.fixture(scope="module")
def first_car(roads, i3) -> Fleet:
    return Fleet("i3", tuple(driven_by(t, i3, 150.0) for t in roads[:14]))


@pytest.fixture(scope="module")
def second_car(roads, leaf) -> Fleet:
    rest = sorted(roads[14:], key=lambda trip: str(trip.context.started_at))
    return Fleet("leaf", tuple(driven_by(t, changed(leaf, TRUTH), 150.0) for t in rest))


@pytest.fixture(scope="module")
def origin(first_car, i3) -> DonorModel:
    return donor_model(first_car.trips, i3)


@pytest.fixture(scope="module")
def segments(second_car, leaf) -> tuple[list[Trip], SegmentTable]:
    plans = [plan_from_trip(t) for t in second_car.trips]
    pairs = zip(plans, second_car.trips, strict=True)
    return plans, SegmentTable.join([segment_table(p, simulate_trip(leaf, p), t) for p, t in pairs])


@pytest.fixture(scope="module")
def evidence(origin, segments, i3, leaf) -> tuple[CarTransfer, Evidence]:
    plans, table = segments
    transfer = CarTransfer(origin.members, term_scales(origin.members, i3, leaf))
    return transfer, transfer.evidence(table, sensitivities(plans, leaf, table), origin.variances_wh2(table))


NOBODY = np.empty((1, 0), dtype=np.int64)


def test_the_variance_of_an_energy_is_that_of_a_t_distribution_and_of_its_measurement(
    origin, segments, second_car
) -> None:
    _, table = segments
    plain = origin.variances_wh2(table)
    nothing_known = np.zeros((int(table.offsets[1]), 1))
    sd = origin.scale.sd_wh(process_segments(table.take([0]), nothing_known))
    assert plain[0] == pytest.approx(2.0 * sd**2)  # four degrees of freedom: 4 / (4 - 2)
    vague = [replace(trip, observed_energy_std_wh=30.0) for trip in second_car.trips]
    assert origin.variances_wh2(table, vague) == pytest.approx(plain + 900.0)


def test_no_trip_is_half_of_the_correction(evidence) -> None:
    transfer, of_trips = evidence
    everyone = np.arange(len(of_trips.noise_wh2))
    found = transfer.predict_draws(of_trips, NOBODY, everyone)
    assert found.mean_wh[0] == pytest.approx(0.5 * of_trips.world @ transfer.members.weights)
    assert found.share == pytest.approx([0.5])
    none = transfer.posterior(of_trips.take(NOBODY[0]))
    assert none.share == pytest.approx(0.5)
    x = np.hstack([of_trips.world, of_trips.own, of_trips.lost, of_trips.physical])
    assert x @ none.mean == pytest.approx(found.mean_wh[0])


def test_draws_and_posterior_are_one_model(evidence) -> None:
    transfer, of_trips = evidence
    known, asked = np.array([0, 3, 5, 8]), np.array([1, 11])
    draws = transfer.predict_draws(of_trips, known[None, :], asked)
    told = transfer.posterior(of_trips.take(known))
    x = np.hstack([of_trips.world, of_trips.own, of_trips.lost, of_trips.physical])[asked]
    assert x @ told.mean == pytest.approx(draws.mean_wh[0], rel=1e-3, abs=0.5)
    variance = np.diag(x @ told.covariance @ x.T) + told.noise_scale * of_trips.noise_wh2[asked]
    assert np.sqrt(variance) == pytest.approx(draws.sd_wh[0], rel=1e-2)


def test_far_from_the_known_nothing_is_corrected_and_more_is_doubted(origin, segments, i3, leaf) -> None:
    _, table = segments
    transfer = CarTransfer(origin.members, term_scales(origin.members, i3, leaf))
    far = replace(table, features=table.features.assign(ambient_temperature_degc=80.0))
    none = np.zeros((len(table.hours), len(PARAMETERS)))
    near, away = (transfer.evidence(t, none, np.ones(len(t))) for t in (table, far))
    everyone = np.arange(len(table))
    close, distant = (transfer.predict_draws(e, NOBODY, everyone) for e in (near, away))
    assert np.abs(distant.mean_wh).max() < 0.02 * np.abs(close.mean_wh).max()
    assert (distant.sd_wh > close.sd_wh).all()


def test_recovers_what_the_book_has_wrong(origin, roads, i3, leaf) -> None:
    trips = [driven_by(t, changed(leaf, TRUTH)) for t in roads[14:]]  # nothing in common with the first car
    plans = [plan_from_trip(t) for t in trips]
    pairs = zip(plans, trips, strict=True)
    table = SegmentTable.join([segment_table(p, simulate_trip(leaf, p), t) for p, t in pairs])
    free = tuple(p for p in PARAMETERS if p.name in TRUTH)
    transfer = CarTransfer(origin.members, term_scales(origin.members, i3, leaf), free, "parameters")
    # a log without any error of its own, so that the difference is all there is to be found
    sure = transfer.evidence(table, sensitivities(plans, leaf, table, free), np.full(len(table), 100.0))
    posterior = transfer.posterior(sure)
    found = posterior.parameters([p.name for p in free])
    assert posterior.share < 0.1
    for name, truth in TRUTH.items():
        assert found[name][0] == pytest.approx(truth, rel=0.2)
        assert found[name][1] < 0.5 * next(p.width for p in free if p.name == name)


def test_many_trips_forget_the_first_car(evidence, segments) -> None:
    transfer, of_trips = evidence
    _, table = segments
    n = len(table)
    observed = table.totals_wh(table.observed_power_w)
    errors = []
    for k in (0, 2, n - 4):
        known = np.arange(k, dtype=np.int64)[None, :]
        asked = np.arange(n - 4, n)
        found = transfer.predict_draws(of_trips, known, asked).mean_wh[0]
        errors.append(np.abs(found - of_trips.residual_wh[asked]).sum() / observed[asked].sum())
    assert errors[2] < 0.25 * errors[0]
    assert errors[1] < errors[0]


def test_leaving_out_is_forgetting(evidence) -> None:
    transfer, of_trips = evidence
    some = of_trips.take(np.arange(5))
    mean, variance = transfer.left_out(some)
    for i in range(5):
        others = np.delete(np.arange(5), i)[None, :]
        found = transfer.predict_draws(some, others, np.array([i]))
        assert mean[i] == pytest.approx(found.mean_wh[0, 0])
        assert variance[i] < found.sd_wh[0, 0] ** 2  # that one has the trip's own error as well


def test_grid_of_a_mode() -> None:
    assert {o.own for o in grid("parameters")} == {0.0}
    assert {o.published for o in grid("effects")} == {0.0}
    assert np.mean([o.share for o in grid("both")]) == pytest.approx(0.5)


def test_a_changed_car_is_another_car(leaf) -> None:
    heavy = changed(leaf, {"mass": 0.1}, source="weighed")
    assert heavy.body.test_mass_kg == pytest.approx(1.1 * leaf.body.test_mass_kg)
    assert heavy.entries["body.curb_mass_kg"].source.startswith("weighed; published")
    assert changed(leaf, {}) == leaf


def test_hidden_signals_are_hidden() -> None:
    trip = synthetic_fleet(1, seed=1).trips[0]
    assert unknown_inputs([trip]) == ()
    bare = without_inputs(trip, ("battery_temperature_degc", "cabin_setpoint_degc"))
    assert unknown_inputs([bare]) == ("cabin_setpoint_degc", "battery_temperature_degc")
    assert bare.context.weather is None


def test_power_of_blocks_of_an_irregular_log(leaf) -> None:
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.choice([0.3, 0.4, 1.7, 2.6], 400))
    speed = 10.0 + 3.0 * np.sin(time / 40.0)
    log = pd.DataFrame({"time_s": time, "speed_m_s": speed, "voltage_v": 360.0, "current_a": 5.0 + speed})
    trip = Trip.from_samples("irregular", log)
    plan = plan_from_trip(trip)
    table = segment_table(plan, simulate_trip(leaf, plan), trip)
    assert table.totals_wh(table.observed_power_w)[0] == pytest.approx(trip.observed_energy_wh, rel=1e-3)


def test_the_second_half_is_not_looked_at(first_car, second_car) -> None:
    first_car = replace(first_car, logs=first_car.logs[:8])
    half = len(second_car.trips) // 2
    louder = [
        t
        if i < half
        else Trip.from_samples(t.trip_id, t.samples.assign(current_a=1.7 * t.samples["current_a"]), t.context)
        for i, t in enumerate(second_car.trips)
    ]
    runs = [
        evaluate_transfer(first_car, fleet, trips=(0, 2), draws=1, min_distance_m=0.0)
        for fleet in (second_car, replace(second_car, logs=tuple(louder)))
    ]
    before, after = (run.trips.set_index(["trip", "model"]) for run in runs)
    assert before["predicted_energy_wh"].to_list() == after["predicted_energy_wh"].to_list()
    assert not np.allclose(before["observed_energy_wh"], after["observed_energy_wh"])
    results = runs[0].results
    (car,) = results["cars"]
    assert [row["k"] for row in car["curves"]["both"]] == [0, 2, half]
    assert results["hidden"] == []  # the first car's log lacks the same signals
    assert set(car["models"]) >= {"physics", "zero-shot", "data-only", "own-kriging", f"adapted-{half}"}


def otherwise_logged(car: Vehicle, dataset: str) -> Vehicle:
    """The car with other values wherever the data set's logs gave one."""
    keys = [key for key, entry in car.entries.items() if names_data(entry, dataset)]
    parts = {}
    for key in keys:
        section, _, name = key.partition(".")
        part = parts.get(section, getattr(car, section))
        parts[section] = replace(part, **{name: 0.8 * getattr(part, name) + 0.05})
    return replace(car, **parts)


@pytest.mark.parametrize(("dataset", "same"), [("tum", True), ("leaf", False)])
def test_values_of_the_targets_logs_take_no_part(first_car, second_car, i3, leaf, dataset, same) -> None:
    first, second = (replace(fleet, logs=fleet.logs[:8]) for fleet in (first_car, second_car))
    target = replace(second, name=dataset)
    cars = [(i3, leaf), (otherwise_logged(i3, "tum"), otherwise_logged(leaf, "tum"))]
    assert cars[0][1] != cars[1][1]
    runs = [
        evaluate_transfer(first, target, vehicles=pair, trips=(0, 2), draws=1, min_distance_m=0.0)
        for pair in cars
    ]
    one, other = (run.trips["predicted_energy_wh"].to_list() for run in runs)
    assert (one == other) == same
    assert bool(runs[0].results["without_target"]) == same


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"trips": ()}, "value out of range: trips"),
        ({"trips": (1, -1), "draws": 0}, "value out of range: draws"),
        ({"min_distance_m": 1e9}, "too few trips to score"),
    ],
)
def test_what_cannot_be_scored_is_refused(first_car, second_car, options, words) -> None:
    with pytest.raises(InvalidInput, match=words):
        evaluate_transfer(first_car, second_car, **options)


def test_energy_errors() -> None:
    observed, index = np.array([1000.0, 3000.0]), resamples(2, 0, 500)
    score = scored(observed, np.array([1100.0, 2700.0]), index)
    assert (score["error"], score["bias"]) == (pytest.approx(0.1), pytest.approx(-0.05))
    pair = paired_energy_error(observed, observed * 1.01, observed * 1.2, index)
    assert pair["diff"] == pytest.approx(-0.19)
    assert pair["significant"]


@pytest.fixture(scope="module")
def base(i3, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stored model of a car that logs cabin and battery temperature."""
    fleet = replace(synthetic_fleet(12, seed=8))
    model, provenance, figures = fit_with_provenance(fleet, i3, corrector="gp")
    assert model.donor_ is not None
    place = tmp_path_factory.mktemp("base") / "model"
    save_model(model, place, provenance=provenance, evaluation=figures)
    return place


def test_adapted_model_is_an_ordinary_one(base, second_car, leaf, tmp_path: Path) -> None:
    about, model = load_metadata(base), load_model(base)
    assert model.donor_ is not None
    few = replace(second_car, logs=second_car.logs[:1])
    found, provenance, figures = adapt_model(few, leaf, model, about)
    assert provenance["base"]["sha256"] == about["sha256"]
    assert provenance["base"]["provenance"]["data"]["sha256"] == about["provenance"]["data"]["sha256"]
    assert provenance["adapted"]["trips"] == figures["trips"] == 1
    assert set(provenance["adapted"]["hidden"]) == set(model.donor_.masked_inputs)
    save_model(found, tmp_path / "leaf", provenance=provenance, evaluation=figures)
    again = load_model(tmp_path / "leaf")
    trip = second_car.trips[-1]
    assert again.forecast(trip).to_dict() == found.forecast(trip).to_dict()
    assert not [flag for flag in again.forecast(trip).flags if "cabin" in flag.subject]
    calibrated = again.vehicle.entries["auxiliaries.base_load_w"]
    assert calibrated.source.startswith("calibrated on 1 trip of the car; published 250")
    seen = trip.samples[trip.samples["time_s"] < 300.0]
    assert np.isfinite(again.forecast(trip).update(seen).energy_wh)


def test_more_trips_are_surer_and_nearer(base, second_car, leaf) -> None:
    model, trip = load_model(base), second_car.trips[-1]
    answers = [adaptation(model, second_car.trips[:k], leaf).model.forecast(trip) for k in (1, 12)]
    widths = [high - low for low, high in (a.interval(0.9) for a in answers)]
    assert widths[1] < 0.7 * widths[0]
    assert trip.observed_energy_wh is not None
    misses = [abs(a.energy_wh - trip.observed_energy_wh) for a in answers]
    assert misses[1] < misses[0]


def test_errors_of_another_car_grow_with_the_energy(base, second_car, leaf, tmp_path: Path) -> None:
    """As a share of the energy that own trips moved, less the part that every trip has; never below half of the middle trip."""
    model, trips = load_model(base), second_car.trips[:6]
    own = adaptation(model, trips, leaf)
    donor = model.donor_ if own.masked_inputs else model.as_donor()
    table = segment_trips(trips, leaf)
    noise = donor.variances_wh2(table, trips) - 2.0 * donor.scale.values[0] ** 2
    moved = np.array([table.take([i]).features["moved_w"] @ table.take([i]).hours for i in range(6)])
    driven = np.maximum(moved, 0.5 * np.median(moved))
    share = np.sqrt(np.mean(np.maximum(noise, 0.0) * max(own.posterior.noise_scale, 1.0) / driven**2))
    found = own.model.uncertainty_.scale
    assert found.least_share == pytest.approx(share, rel=1e-9)
    save_model(own.model, tmp_path / "grown", provenance={}, evaluation={})
    assert load_model(tmp_path / "grown").uncertainty_.scale.least_share == found.least_share
    assert model.uncertainty_.scale.least_share == 0.0


def test_trips_left_out_in_turn_have_errors_of_the_sign_of_their_scores(base, second_car, leaf) -> None:
    found = adaptation(load_model(base), second_car.trips[:6], leaf).model.held_out_
    assert [one.trip for one in found] == [trip.trip_id for trip in second_car.trips[:6]]
    for one, trip in zip(found, second_car.trips, strict=False):
        assert one.observed_wh == pytest.approx(trip.observed_energy_wh, rel=0.01)
        sd = (one.observed_wh - one.predicted_wh) / one.score
        assert 0.0 < sd < 0.5 * one.observed_wh


def test_errors_of_the_base_and_own_errors_share_one_weight(base, second_car, leaf, monkeypatch) -> None:
    seen = []
    monkeypatch.setattr(
        adapting, "weighted_quantiles", lambda values, weight: seen.append(weight) or weighted(values, weight)
    )
    weighted = weighted_quantiles
    model = load_model(base)
    adaptation(model, second_car.trips[:4], leaf)
    weight = seen[-1]
    assert weight.sum() == pytest.approx(1.0)
    assert weight[-4:] == pytest.approx(np.full(4, 1.0 / (adapting.BASE_TRIPS + 4.0)))


def test_an_energy_from_the_state_of_charge_counts_less(base, second_car, leaf) -> None:
    model, trip = load_model(base), second_car.trips[0]
    assert trip.observed_energy_wh is not None
    vague = replace(trip, observed_energy_std_wh=0.5 * trip.observed_energy_wh)
    loads = [adaptation(model, [t], leaf).parameters["base_load"][0] for t in (trip, vague)]
    assert abs(loads[1]) < 0.5 * abs(loads[0])


def test_what_cannot_be_adapted_is_refused(base, leaf, roads, i3) -> None:
    model = load_model(base)
    with pytest.raises(InvalidInput, match="no trips"):
        adaptation(model, [], leaf)
    with pytest.raises(InvalidInput, match="unknown adaptation mode"):
        adaptation(model, roads[:1], leaf, mode="all")
    with pytest.raises(InvalidInput, match="not fitted"):
        adaptation(ForecastModel(i3), roads[:1], leaf)
    trees = ForecastModel(i3, "boosting").fit(roads[:9])
    with pytest.raises(InvalidInput, match="cannot be transferred"):
        adaptation(trees, roads[:1], leaf)


def test_every_corrector_with_a_process_goes_to_another_car(roads, segments, i3, leaf) -> None:
    _, table = segments
    logged = segment_trips(roads[:10], i3)
    fitted = power_corrector("split").fit(logged)
    assert isinstance(fitted, SplitCorrector)
    assert fitted.split_
    members = Members.from_corrector(fitted)
    assert len(members.correctors) == 2
    assert members.features(table) @ members.weights == pytest.approx(
        sum(c.model.predict(table.features) for c in members.correctors)
    )
    transfer = CarTransfer(members, term_scales(members, i3, leaf), (), "effects")
    evidence = transfer.evidence(table, np.empty((len(table.hours), 0)), np.full(len(table), 1e4))
    none = HierarchicalCorrector.from_posterior(transfer, transfer.posterior(evidence.take([])), frozenset())
    expected = transfer.predict_draws(evidence, NOBODY, np.arange(len(table))).mean_wh[0]
    assert table.totals_wh(none.predict(table)) == pytest.approx(expected)


def test_a_car_without_trips_starts_from_the_donor() -> None:
    """The donor has one process for the whole residual, the model itself one for climate and one for the drive."""
    base, car = load_model(), load_vehicle("nissan_leaf_24")
    assert base.donor_ is not None
    from_donor, from_model = (without_trips(b, car).corrector_ for b in (base, replace(base, donor_=None)))
    assert isinstance(from_donor, HierarchicalCorrector)
    assert isinstance(from_model, HierarchicalCorrector)
    assert (len(from_donor.shares), len(from_model.shares)) == (1, 2)


def test_a_transferred_corrector_comes_back_from_its_parts() -> None:
    """The shares of climate and drive in their order."""
    base = replace(load_model(), donor_=None)
    made = without_trips(base, load_vehicle("nissan_leaf_24")).corrector_
    assert isinstance(made, HierarchicalCorrector)
    assert made.shares == pytest.approx((0.5, 0.5))
    converter = new_converter()
    values = converter.unstructure(replace(made, shares=(0.25, 0.75)), PowerCorrector)
    back = structured(parts_tree(tree_parts(values)), PowerCorrector, converter, "a corrector")
    assert isinstance(back, HierarchicalCorrector)
    assert back.shares == (0.25, 0.75)


def test_the_source_of_an_evaluation_has_its_identified_car() -> None:
    trips, car = synthetic_fleet(10).trips, load_vehicle("bmw_i3_60ah")
    found = identify_trips(trips, car).applied(car)
    assert found.climate != car.climate
    assert _source(trips, (), car, 0).vehicle == found
