"""A model on another car: recovery of a known difference, trips that stand out, and nothing that looks ahead."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.worlds import changed
from scipy.stats import t as t_distribution
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel, load_metadata, load_model, save_model
from tripwatt.hybrid import learning
from tripwatt.hybrid.factors import NAMES, UNITS, FactorCorrector
from tripwatt.hybrid.groups import Sums
from tripwatt.hybrid.learning import KINDS, Experts
from tripwatt.physics import simulate_trip
from tripwatt.population import adaptation, population
from tripwatt.population.adapting import (
    PROTOCOL,
    Adaptation,
    adapt_model,
    in_order,
    population_of,
    scores_of,
    without_trips,
)
from tripwatt.population.prior import Population, Source
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan, Trip, TripSet
from tripwatt.vehicles import Vehicle, load_vehicle

NOBODY = Population(Sums.empty(len(NAMES)))
"""No car was seen: each factor is zero on average, with its assumed spread between cars."""

LEARNED = 26
"""Trips of the second car that are learned; the last six are forecast."""

ERROR = 0.01
"""Relative error of each trip that no factor explains."""


def driven_by(trip: Trip, car: Vehicle, extra_w: float = 0.0, times: float = 1.0) -> Trip:
    """The trip as another car would have logged it: its physics, a constant load that no book knows, and a factor."""
    road = trip.samples[["time_s", "speed_m_s", "elevation_m", "ambient_temperature_degc"]]
    bare = Trip.from_samples(trip.trip_id, road, replace(trip.context, cabin_setpoint_degc=None))
    run = simulate_trip(car, Plan.from_trip(bare))
    power = np.interp(road["time_s"] - road["time_s"].iloc[0], run.time_s, run.battery_power_w)
    samples = road.assign(voltage_v=360.0, current_a=(times * power + extra_w) / 360.0)
    return Trip.from_samples(trip.trip_id, samples, bare.context)


@pytest.fixture(scope="module")
def roads() -> list[Trip]:
    return in_order(synthetic_fleet(LEARNED + 6, seed=6).trips)


@pytest.fixture(scope="module")
def leaf() -> Vehicle:
    """A Leaf with a load that many trips can tell."""
    return load_vehicle("nissan_leaf_24", overrides={"auxiliaries.base_load_w": 480.0})


@pytest.fixture(scope="module")
def base() -> ForecastModel:
    return load_model()


def car_with(roads: Sequence[Trip], car: Vehicle, times: float = 1.0, error: float = ERROR) -> list[Trip]:
    """Trips of a car, each with an error of its own."""
    errors = 1.0 + error * np.random.default_rng(5).normal(size=len(roads))
    return [driven_by(t, car, 0.0, times * e) for t, e in zip(roads, errors.tolist(), strict=True)]


@pytest.fixture(scope="module")
def as_published(roads: list[Trip], leaf: Vehicle) -> list[Trip]:
    return car_with(roads, leaf)


@pytest.fixture(scope="module")
def loaded(roads: list[Trip], leaf: Vehicle) -> list[Trip]:
    """A base load of 80 % more than in the file."""
    return car_with(roads, changed(leaf, {"base_load": 0.8}))


@pytest.fixture(scope="module")
def hungry(roads: list[Trip], leaf: Vehicle) -> list[Trip]:
    """Everything takes 20 % more than in the file."""
    return car_with(roads, leaf, 1.2)


@pytest.fixture(scope="module")
def learned(
    base: ForecastModel, leaf: Vehicle, as_published: list[Trip], loaded: list[Trip], hungry: list[Trip]
) -> dict[str, Adaptation]:
    """The car after the trips that are learned, by what its file has wrong."""
    new = Adaptation.before_trips(base, leaf, NOBODY)
    cars = {"as_published": as_published, "loaded": loaded, "hungry": hungry}
    return {name: new.with_trips(trips[:LEARNED]) for name, trips in cars.items()}


def error_of(model: ForecastModel, trips: Sequence[Trip]) -> float:
    """Sum of absolute errors over the energy."""
    observed = np.array([trip.observed_energy_wh for trip in trips])
    forecast = np.array([model.forecast(trip).energy_wh for trip in trips])
    return float(np.abs(forecast - observed).sum() / observed.sum())


def mean_sd(model: ForecastModel, trips: Sequence[Trip]) -> float:
    return float(np.mean([model.forecast(trip).sd_wh for trip in trips]))


# ------------------------------------------------------------------------------------------------- what is found
@pytest.mark.parametrize(
    ("fixture", "factor", "truth"), [("loaded", "base_load", 0.8), ("hungry", "everything", 0.2)]
)
def test_many_trips_find_what_the_file_has_wrong(
    base: ForecastModel,
    leaf: Vehicle,
    learned: dict[str, Adaptation],
    request: pytest.FixtureRequest,
    fixture: str,
    factor: str,
    truth: float,
) -> None:
    trips = request.getfixturevalue(fixture)
    before = Adaptation.before_trips(base, leaf, NOBODY)
    after = learned[fixture]
    change, sd = after.changes[factor]
    assert abs(change - truth) < 2.0 * sd
    assert change > 0.5 * truth
    assert sd < 0.75 * before.changes[factor][1]
    zero, own = (error_of(known.model, trips[LEARNED:]) for known in (before, after))
    assert own < 0.3 * zero
    assert own < 3.0 * ERROR


def test_a_car_as_its_file_says_stays_so(as_published: list[Trip], learned: dict[str, Adaptation]) -> None:
    after = learned["as_published"]
    for name, (change, sd) in after.changes.items():
        assert abs(change) < 2.0 * sd, name
    assert abs(after.changes["everything"][0]) < 0.03
    assert error_of(after.model, as_published[LEARNED:]) < 3.0 * ERROR


def test_more_trips_are_surer_and_nearer(base: ForecastModel, leaf: Vehicle, hungry: list[Trip]) -> None:
    known, errors, sds = Adaptation.before_trips(base, leaf, NOBODY), [], []
    for part in (hungry[:0], hungry[:1], hungry[1:6], hungry[6:LEARNED]):
        known = known.with_trips(part) if part else known
        errors.append(error_of(known.model, hungry[LEARNED:]))
        sds.append(mean_sd(known.model, hungry[LEARNED:]))
    assert errors[3] < 0.5 * errors[1] < 0.5 * errors[0]
    assert errors[2] < errors[1]
    assert sds == sorted(sds, reverse=True)
    assert sds[3] < 0.5 * sds[0]


def test_kinds_of_experts_count_by_their_forecasts(
    base: ForecastModel, leaf: Vehicle, learned: dict[str, Adaptation]
) -> None:
    def weights(known: Adaptation) -> dict[str, float]:
        found = known.experts.kind_weights
        assert found.sum() == pytest.approx(1.0)
        return dict(zip(KINDS, found.tolist(), strict=True))

    before = weights(Adaptation.before_trips(base, leaf, NOBODY))
    assert before == pytest.approx(dict(zip(KINDS, learning.KIND_WEIGHTS, strict=True)))
    published, load, everything = map(weights, learned.values())
    assert published["published"] > before["published"]
    assert load["published"] < 0.2 * before["published"]
    assert everything["published"] < 2e-3
    assert everything["one factor"] > max(before["one factor"], load["one factor"])


def test_a_car_whose_errors_are_larger_has_wider_intervals(
    base: ForecastModel, leaf: Vehicle, roads: list[Trip], learned: dict[str, Adaptation]
) -> None:
    wild = car_with(roads[:LEARNED], leaf, error=0.15)
    calm, loud = learned["as_published"], adaptation(base, wild, leaf, NOBODY)
    assert calm.experts.noise_scale < 0.5 < loud.experts.noise_scale
    widths = []
    for known in (calm, loud):
        low, high = known.model.forecast(roads[-1]).interval(0.9)
        widths.append(high - low)
    assert widths[1] > 2.0 * widths[0]


# ------------------------------------------------------------------------------------------------- what counts less
def with_energy(trip: Trip, factor: float) -> Trip:
    """The trip with another energy."""
    samples = trip.samples.assign(current_a=factor * trip.samples["current_a"])
    return Trip.from_samples(trip.trip_id, samples, trip.context)


@pytest.mark.parametrize("place", [2, 15])
def test_one_trip_that_stands_out_hardly_moves_the_car(
    base: ForecastModel, leaf: Vehicle, as_published: list[Trip], place: int
) -> None:
    sound = as_published[:16]
    doubled = [with_energy(t, 2.0) if i == place else t for i, t in enumerate(sound)]
    one, other = (adaptation(base, trips, leaf, NOBODY) for trips in (sound, doubled))
    for name, limit in (("everything", 0.05), ("rolling", 0.05), ("air", 0.05)):
        assert abs(other.changes[name][0] - one.changes[name][0]) < limit, name
    assert error_of(other.model, as_published[16:]) < 0.05


def alone(experts: Experts, kind: str) -> Experts:
    """One of the experts: of this kind, with the usual variance of errors and the widest spread."""
    its = np.flatnonzero((experts.kind == KINDS.index(kind)) & (experts.noise == 1.0))
    widest = its[[np.argmax(experts.covariance[its, 0, 0])]]
    arrays = {
        f.name: getattr(experts, f.name)[widest]
        for f in fields(experts)
        if isinstance(getattr(experts, f.name), np.ndarray)
    }
    return replace(experts, **arrays)


def test_a_trip_that_stands_out_moves_a_belief_less_than_a_third_of_what_it_would(
    base: ForecastModel, leaf: Vehicle, as_published: list[Trip], monkeypatch: pytest.MonkeyPatch
) -> None:
    new = Adaptation.before_trips(base, leaf, NOBODY)
    known = new.with_trips(as_published[:12])
    # the last of these trips with three times its energy, and as it was
    place, more = 11, 2.0 * known.evidence.observed_wh[11]
    residual = known.evidence.residual_wh.copy()
    residual[place] += more
    wrong = replace(known.evidence, residual_wh=residual)
    belief, moved = alone(new.experts, "population"), {}
    for df in (learning.TAIL_DF, 1e9):
        monkeypatch.setattr(learning, "TAIL_DF", df)
        learned = [belief.learn(evidence)[0].mean[0] for evidence in (known.evidence, wrong)]
        moved[df] = float(np.linalg.norm(learned[1] - learned[0]))
    assert moved[4.0] < moved[1e9] / 3.0
    assert moved[1e9] > 0.5, "a Gaussian update moves by half a spread or more"


def test_an_energy_from_the_state_of_charge_counts_less(
    base: ForecastModel, leaf: Vehicle, hungry: list[Trip]
) -> None:
    changes, sds = [], []
    for share in (0.0, 0.1, 0.5):
        trips = [
            replace(t, observed_energy_std_wh=share * t.observed_energy_wh) if share else t
            for t in hungry[:5]
        ]
        known = adaptation(base, trips, leaf, NOBODY)
        measured = np.array([share * (t.observed_energy_wh or 0.0) for t in in_order(trips)])
        assert np.sqrt(known.evidence.measured_wh2) == pytest.approx(measured, abs=20.0)
        changes.append(known.changes["everything"][0])
        sds.append(mean_sd(known.model, hungry[LEARNED:]))
    assert changes == sorted(changes, reverse=True)
    assert changes[2] < 0.5 * changes[0]
    assert sds[0] < 0.9 * min(sds[1:])


def test_what_was_learned_long_ago_is_less_certain(
    as_published: list[Trip], learned: dict[str, Adaptation]
) -> None:
    """The consumption drifts slowly: the day after the last trip it is known better than five years later."""
    model = learned["as_published"].model
    last = as_published[LEARNED - 1].context.started_at
    assert last is not None
    asked = as_published[-1]
    soon, late = (
        model.forecast(replace(asked, context=replace(asked.context, started_at=last + dt.timedelta(days))))
        for days in (1.0, 5.0 * 365.0)
    )
    assert late.sd_wh > 1.05 * soon.sd_wh
    assert late.energy_wh == pytest.approx(soon.energy_wh, rel=0.1)


# --------------------------------------------------------------------------------------------- one trip after the other
def test_trips_one_by_one_give_the_model_of_all_at_once(
    base: ForecastModel, leaf: Vehicle, loaded: list[Trip]
) -> None:
    at_once = adaptation(base, loaded[:9], leaf, NOBODY)
    known = Adaptation.before_trips(base, leaf, NOBODY)
    for trip in loaded[:9]:
        known = known.with_trips([trip])
    for trip in loaded[LEARNED:]:
        one, other = (adapted.model.forecast(trip) for adapted in (at_once, known))
        assert one.energy_wh == pytest.approx(other.energy_wh, rel=1e-9)
        assert one.sd_wh == pytest.approx(other.sd_wh, rel=1e-9)
        assert one.interval(0.9) == pytest.approx(other.interval(0.9), rel=1e-9)
        assert one.flags == other.flags
    assert known.model.trip_ids_ == at_once.model.trip_ids_
    assert known.innovations.mean_wh == pytest.approx(at_once.innovations.mean_wh, rel=1e-9)
    again = Adaptation.before_trips(base, leaf, NOBODY).with_evidence(known.evidence, known.ranges)
    assert np.array([*again.changes.values()]) == pytest.approx(np.array([*known.changes.values()]), rel=1e-9)


def test_the_order_in_which_trips_are_given_does_not_count_where_all_have_a_date(
    base: ForecastModel, leaf: Vehicle, loaded: list[Trip]
) -> None:
    forwards, backwards = (
        adaptation(base, trips, leaf, NOBODY).model for trips in (loaded[:6], loaded[5::-1])
    )
    assert backwards.trip_ids_ == forwards.trip_ids_
    asked = loaded[-1]
    assert backwards.forecast(asked).energy_wh == forwards.forecast(asked).energy_wh


def test_no_forecast_looks_ahead(base: ForecastModel, leaf: Vehicle, loaded: list[Trip]) -> None:
    """Each trip is forecast by the trips before it alone, as the model of these forecasts it."""
    new = Adaptation.before_trips(base, leaf, NOBODY)
    known = new.with_trips(loaded[:6])
    louder = new.with_trips([*loaded[:5], with_energy(loaded[5], 1.4)])
    held_out = known.model.held_out_
    assert [one.predicted_wh for one in held_out] == pytest.approx(
        [one.predicted_wh for one in louder.model.held_out_], rel=1e-12
    )
    assert louder.innovations.sd_wh == pytest.approx(known.innovations.sd_wh, rel=1e-12)
    for k, (one, trip) in enumerate(zip(held_out, loaded, strict=False)):
        assert one.trip == trip.trip_id
        assert one.observed_wh == pytest.approx(trip.observed_energy_wh, rel=0.01)
        before = new.with_trips(loaded[:k]).model if k else new.model
        assert one.predicted_wh == pytest.approx(before.forecast(trip).energy_wh, rel=1e-6)
        sd = (one.observed_wh - one.predicted_wh) / one.score
        assert 0.0 < sd < 0.5 * one.observed_wh
    assert known.innovations.weights.sum(axis=1) == pytest.approx(np.ones(6))
    assert known.innovations.weights[0] == pytest.approx(learning.KIND_WEIGHTS)


def test_trips_come_by_departure_and_without_a_date_as_they_are_given(roads: list[Trip]) -> None:
    def at(trip: Trip, when: dt.datetime | None) -> Trip:
        return replace(trip, context=replace(trip.context, started_at=when))

    day = dt.datetime(2024, 2, 28, 23, 0)
    a, b, c = (at(trip, day + k * dt.timedelta(hours=2)) for k, trip in enumerate(roads[:3]))
    assert in_order([c, a, b]) == [a, b, c]
    silent = replace(b, observed_energy_wh=None)
    assert in_order([c, silent, a]) == [a, c], "what was not measured is not learned"
    undated = at(b, None)
    assert in_order([c, undated, a]) == [c, undated, a]
    assert in_order([]) == []


# ------------------------------------------------------------------------------------------------- a model like any other
def test_an_adapted_model_is_an_ordinary_one(
    base: ForecastModel, leaf: Vehicle, loaded: list[Trip], tmp_path: Path
) -> None:
    about = load_metadata()
    found, provenance, figures = adapt_model(TripSet("leaf", tuple(loaded[:3])), leaf, base, about)
    assert figures["protocol"] == PROTOCOL
    assert figures["trips"] == 3
    assert provenance["base"]["sha256"] == about["sha256"]
    assert provenance["base"]["provenance"]["data"] == about["provenance"]["data"]
    adapted = provenance["adapted"]
    assert adapted["trips"] == 3
    assert list(adapted["experts"]) == list(KINDS)
    assert sum(adapted["experts"].values()) == pytest.approx(1.0)
    assert 0.0 < adapted["noise_scale"] <= max(learning.NOISES)
    assert list(adapted["parameters"]) == list(NAMES)
    for name, factor in adapted["parameters"].items():
        assert sorted(factor) == ["change", "sd", "unit"]
        assert factor["unit"] == UNITS[name]
        assert factor["sd"] > 0.0
    save_model(found, tmp_path / "leaf", provenance=provenance, evaluation=figures)
    again = load_model(tmp_path / "leaf")
    assert load_metadata(tmp_path / "leaf")["provenance"]["adapted"] == adapted
    assert isinstance(again.corrector_, FactorCorrector)
    seen = loaded[-1].samples[loaded[-1].samples["time_s"] < 300.0]
    for trip in loaded[-2:]:
        ours, theirs = found.forecast(trip), again.forecast(trip)
        assert theirs.to_dict() == ours.to_dict()
        assert theirs.energy_wh == ours.energy_wh
        assert theirs.sd_wh == ours.sd_wh
    updated = [model.forecast(loaded[-1]).update(seen) for model in (found, again)]
    assert updated[0].to_dict() == updated[1].to_dict()
    assert updated[0].sd_wh > 0.0


def test_a_stored_model_is_taken_up_where_it_was_left(
    base: ForecastModel, leaf: Vehicle, loaded: list[Trip], tmp_path: Path
) -> None:
    new = Adaptation.before_trips(base, leaf, NOBODY)
    known = new.with_trips(loaded[:4])
    save_model(known.model, tmp_path / "leaf")
    stored = load_model(tmp_path / "leaf")
    assert stored.evidence_ is not None
    again = new.with_evidence(stored.evidence_, stored.ranges_).with_trips(loaded[4:6])
    direct = known.with_trips(loaded[4:6])
    one, other = (adapted.model.forecast(loaded[-1]) for adapted in (again, direct))
    assert one.energy_wh == other.energy_wh
    assert one.sd_wh == other.sd_wh


def undated(trip: Trip) -> Trip:
    return replace(trip, context=replace(trip.context, started_at=None))


@pytest.mark.parametrize("kind", ["no trips", "with dates", "without dates"])
def test_models_with_and_without_trips_and_dates_are_stored_to_the_last_bit(
    base: ForecastModel, leaf: Vehicle, loaded: list[Trip], tmp_path: Path, kind: str
) -> None:
    trips = [undated(trip) if kind == "without dates" else trip for trip in loaded[:2]]
    model = without_trips(base, leaf) if kind == "no trips" else adaptation(base, trips, leaf).model
    save_model(model, tmp_path / "model")
    again = load_model(tmp_path / "model")
    for asked in (loaded[-1], undated(loaded[-1])):
        assert again.forecast(asked).to_dict() == model.forecast(asked).to_dict()


def test_every_fitted_model_is_a_base(leaf: Vehicle, loaded: list[Trip]) -> None:
    fitted = ForecastModel(load_vehicle("bmw_i3_60ah"), "linear").fit(synthetic_fleet(9, seed=1).trips)
    assert fitted.evidence_ is not None
    assert len(fitted.evidence_) == 9
    model = adaptation(fitted, loaded[:3], leaf).model
    assert model.vehicle.name == leaf.name
    assert error_of(model, loaded[LEARNED:]) < error_of(without_trips(fitted, leaf), loaded[LEARNED:])


def test_what_cannot_be_adapted_is_refused(base: ForecastModel, leaf: Vehicle, loaded: list[Trip]) -> None:
    refuses("no trips", adaptation, base, [], leaf)
    silent = [replace(trip, observed_energy_wh=None) for trip in loaded[1:3]]
    with pytest.raises(InvalidInput, match="no measured energy") as caught:
        adaptation(base, [loaded[0], *silent], leaf)
    assert [fault.where for fault in caught.value.faults] == [trip.trip_id for trip in silent]
    blank = ForecastModel(load_vehicle("bmw_i3_60ah"))
    refuses("not fitted", adaptation, blank, loaded[:1], leaf)
    refuses("not fitted", without_trips, blank, leaf)


@pytest.mark.parametrize("ambient", [-8.0, 33.0])
def test_a_departure_without_climate_control_has_no_correction_of_it(
    leaf: Vehicle, loaded: list[Trip], learned: dict[str, Adaptation], ambient: float
) -> None:
    model = learned["loaded"].model
    assert isinstance(model.corrector_, FactorCorrector)
    plan = Plan.from_trip(loaded[-1])
    known = tw.Departure(soc=0.8, ambient_temperature_degc=ambient)
    auto, off = (model.forecast(plan, replace(known, climate=climate)) for climate in ("auto", "off"))
    simulated = auto.drive.table.simulated_w - off.drive.table.simulated_w
    assert (simulated > -1.0).all()
    assert off.drive.climate_w is not None
    assert np.abs(off.drive.climate_w).max() == 0.0
    assert np.abs(model.corrector_.predict_climate(off.drive.table)).max() == 0.0
    # shares of the whole consumption are those of climate control as well; the rest is the same
    climate = model.corrector_.predict_climate(auto.drive.table)
    hours = auto.drive.table.hours
    difference = float(hours @ (simulated + climate))
    assert difference > 100.0
    whole = replace(model.corrector_, mean=np.where(shares(model.corrector_), model.corrector_.mean, 0.0))
    with_whole = [float(hours @ whole.predict(one.drive.table)) for one in (auto, off)]
    expected = difference + with_whole[0] - with_whole[1]
    assert auto.energy_wh - off.energy_wh == pytest.approx(expected, rel=0.01)
    assert auto.energy_wh - off.energy_wh == pytest.approx(difference, rel=0.15)


def shares(corrector: FactorCorrector) -> np.ndarray:
    """Which entries of the mean act on the whole consumption: all but those of one part of it."""
    parts = (
        "rolling",
        "air",
        "drivetrain",
        "base_load",
        "heating",
        "mild_heating",
        "cooling",
        "cold",
        "transients",
    )
    of_parts = np.isin(NAMES, (*parts, "climb", "frost", "warm_up"))
    return ~np.append(of_parts, np.zeros(len(corrector.mean) - len(NAMES), dtype=bool))


def test_who_does_not_heat_in_spring_may_heat_in_winter(base: ForecastModel, roads: list[Trip]) -> None:
    car, unheated = (replace(load_vehicle("vw_id3"), **part) for part in ({}, {"climate": None}))

    def in_air(trip: Trip, degc: float) -> Trip:
        return replace(trip, samples=trip.samples.assign(ambient_temperature_degc=degc))

    spring = [in_air(trip, 8.0 + 0.75 * k) for k, trip in enumerate(roads[:12])]
    known = Adaptation.before_trips(base, car, population())
    known = known.with_trips([driven_by(trip, unheated) for trip in spring])
    ahead = driven_by(max(roads[12:], key=len), unheated)
    for degc in (12.0, -5.0, -15.0):
        plan = Plan.from_trip(in_air(ahead, degc))
        forecast = known.model.forecast(plan)
        cold, warm = (simulate_trip(one, plan).simulated_energy_wh for one in (unheated, car))
        least, most = forecast.interval(0.9)
        if degc > 0.0:
            assert forecast.energy_wh == pytest.approx(cold, rel=0.05), "as in spring"
        else:
            assert least < cold < forecast.energy_wh < warm < most, degc


def test_a_car_without_climate_control_learns_none(base: ForecastModel, roads: list[Trip]) -> None:
    car = tw.describe_car(body="quadricycle")
    slow = [t for t in roads if t.samples["speed_m_s"].max() < 45.0][:8]
    known = Adaptation.before_trips(base, car, NOBODY)
    after = known.with_trips([driven_by(t, car, 100.0) for t in slow])
    assert len(after.evidence) == len(slow) > 4
    for name in ("heating", "mild_heating", "cooling"):
        its = NAMES.index(name)
        assert np.abs(after.evidence.factors_wh[:, its]).max() == 0.0
        for part in ("mean", "covariance"):
            before, now = (getattr(one.experts, part)[:, its] for one in (known, after))
            assert now == pytest.approx(before, abs=1e-12), "no belief about it changes"
    assert after.changes["base_load"][1] < known.changes["base_load"][1]


# ------------------------------------------------------------------------------------------------- scores
def test_without_own_trips_the_scores_are_those_of_a_t_distribution() -> None:
    scores = scores_of(np.empty(0))
    for level in (0.5, 0.8, 0.9, 0.95):
        quantile = t_distribution.ppf(0.5 + 0.5 * level, 4) / np.sqrt(2.0)
        assert scores.factor(level) == pytest.approx(quantile, rel=0.02)
    assert scores.factor(0.9) == pytest.approx(1.507, rel=0.02)
    assert [len(scores_of(np.full(n, 1.0)).values) for n in (0, 1, 100)] == [40, 40, 40]


def test_own_errors_narrow_and_widen_the_scores() -> None:
    usual = scores_of(np.empty(0)).factor(0.9)
    small, large = (
        [scores_of(np.full(n, size)).factor(0.9) for n in (1, 10, 40, 100)] for size in (0.2, 3.0)
    )
    assert small == sorted(small, reverse=True)
    assert 0.9 * usual < small[0] < usual
    assert small[2] < 0.6 * usual
    assert large == sorted(large)
    assert large[2] > 1.7 * usual
    # signs do not count, and one of its own sizes changes next to nothing
    assert (
        scores_of(np.array([-0.4, 2.0])).values.tolist() == scores_of(np.array([0.4, -2.0])).values.tolist()
    )
    assert scores_of(np.array([0.7])).factor(0.9) == pytest.approx(usual, rel=0.1)
    alike = np.abs(t_distribution.rvs(4, size=400, random_state=1)) / np.sqrt(2.0)
    assert scores_of(alike).factor(0.9) == pytest.approx(usual, rel=0.25)


def test_the_latest_errors_count_most() -> None:
    """A car whose errors grow is soon covered again, and one whose errors fall is soon narrow."""
    rising = scores_of(np.append(np.full(60, 0.2), np.full(60, 3.0)))
    falling = scores_of(np.append(np.full(60, 3.0), np.full(60, 0.2)))
    assert rising.factor(0.5) > 3.0 * falling.factor(0.5)


# ------------------------------------------------------------------------------------------------- the population
def test_what_all_cars_have_in_common_is_expected_of_the_next(
    base: ForecastModel, leaf: Vehicle, roads: list[Trip]
) -> None:
    """Each model takes 20 % more than in its file: so does the next car, the more of them were seen, and the surer."""
    cars = []
    for i, name in enumerate(("bmw_i3_60ah", "vw_id3", "fiat_500e", "hyundai_kona_64")):
        car = load_vehicle(name)
        trips = car_with(roads[: LEARNED // 2], car, 1.2)
        evidence = Adaptation.before_trips(base, car, NOBODY).with_trips(trips).evidence
        cars.append((Source(name, f"v{i}", f"set {i}", len(evidence), "", ""), evidence))
    known = [NOBODY, *(Population.from_evidence(cars[:n]) for n in (1, 2, 4))]
    models = [without_trips(base, leaf, one) for one in known]
    energies = [sum(model.forecast(trip).energy_wh for trip in roads[LEARNED:]) for model in models]
    assert energies == sorted(energies)
    assert 1.02 < energies[3] / energies[0] < 1.2
    sds = [mean_sd(model, roads[LEARNED:]) for model in models]
    assert sds == sorted(sds, reverse=True)


def test_a_car_model_with_trips_of_another_vehicle_starts_from_these(
    base: ForecastModel, leaf: Vehicle, hungry: list[Trip], learned: dict[str, Adaptation]
) -> None:
    evidence = learned["hungry"].evidence
    source = Source(leaf.name, "other leaf", "mine", len(evidence), "", "")
    seen = NOBODY.with_car(source, evidence)
    assert seen.sources == (source,)
    same, other = (without_trips(base, car, seen) for car in (leaf, load_vehicle("vw_id3")))
    unseen = without_trips(base, leaf, NOBODY)
    asked = hungry[LEARNED:]
    assert error_of(same, asked) < 0.85 * error_of(unseen, asked)
    changes = [model.corrector_.changes["everything"] for model in (same, other)]  # type: ignore[union-attr]
    assert changes[0][0] > changes[1][0]
    twice = seen.with_car(replace(source, vehicle="third leaf"), evidence)
    assert [one.vehicle for one in twice.sources] == ["third leaf"], (
        "trips of a model take the place of older ones"
    )


@pytest.mark.parametrize(
    ("cars", "notes"),
    [((None, None), []), (("one", "one"), []), (("one", "other"), ["cars one, other count as one car"])],
)
def test_logs_of_several_cars_are_said_to_count_as_one(
    leaf: Vehicle, cars: tuple[str | None, ...], notes: list[str]
) -> None:
    made = synthetic_fleet(2, seed=3, vehicle=leaf)
    logs = tuple(
        replace(log, context=replace(log.context, car=name))
        for log, name in zip(made.logs, cars, strict=True)
    )
    _, provenance, _ = adapt_model(replace(made, logs=logs), leaf, load_model(), load_metadata())
    assert [note for note in provenance["data"]["notes"] if "count as one car" in note] == notes


def test_the_car_of_a_base_counts_where_the_package_does_not_have_it() -> None:
    base = load_model()
    other = replace(base, vehicle=load_vehicle("vw_id3"))
    known = [source.vehicle for source in population().sources]
    assert [source.vehicle for source in population_of(base).sources] == known
    assert [source.vehicle for source in population_of(other).sources] == [*known, "base"]


def test_trips_are_in_the_order_of_time_whatever_their_zone() -> None:
    """09:30 in Berlin is before 08:00 in London; as texts they are the other way round. A time without a zone is UTC."""
    berlin, none = dt.timezone(dt.timedelta(hours=2)), None
    times = [
        dt.datetime(2026, 5, 1, 8, 0, tzinfo=dt.UTC),
        dt.datetime(2026, 5, 1, 9, 30, tzinfo=berlin),
        dt.datetime(2026, 5, 1, 7, 45, tzinfo=none),
    ]
    trips = [
        replace(trip, context=replace(trip.context, started_at=at))
        for trip, at in zip(synthetic_fleet(3).trips, times, strict=True)
    ]
    assert [trip.context.started_at for trip in in_order(trips)] == [times[1], times[2], times[0]]
