"""What cars have in common: means and spreads from sums, and nothing of a car that is scored."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tripwatt.certification import describe_car
from tripwatt.hybrid.factors import FACTORS, NAMES, SDS, TripEvidence
from tripwatt.hybrid.learning import KINDS
from tripwatt.population.prior import (
    LEVEL_SDS,
    POPULATION_FILE,
    Population,
    Source,
    _beyond_values,
    population,
)
from tripwatt.vehicles import load_vehicle
from tripwatt.vehicles.anchors import spreads
from tripwatt.vehicles.catalogue import beyond_classes

P = len(NAMES)


def car(name: str, truth: np.ndarray, n: int = 60, seed: int = 0) -> tuple[Source, TripEvidence]:
    rng = np.random.default_rng(seed)
    X = rng.normal(0.0, 80.0, (n, P)) + 150.0
    usual = np.full(n, 60.0**2)
    y = X @ truth + 60.0 * rng.normal(size=n)
    evidence = TripEvidence(
        tuple(f"{name}{i}" for i in range(n)),
        X,
        y,
        usual,
        np.zeros(n),
        np.full(n, np.nan),
        np.full((n, 4), np.nan),
    )
    return Source(name, f"{name}-1", name, n, "", ""), evidence


def test_without_cars_a_car_has_the_assumed_spread() -> None:
    experts = Population.from_evidence([]).experts(load_vehicle("bmw_i3_60ah"))
    own = experts.kind == KINDS.index("own trips")
    # three times the spread between cars and of what is unknown of what they have in common
    between = (LEVEL_SDS**2).sum(axis=0)
    found = np.diagonal(experts.covariance[own], axis1=1, axis2=2)[:, :P]
    assert found == pytest.approx(np.tile(9.0 * (between + 0.35**2), (len(found), 1)))


def test_the_mean_follows_cars_and_is_shrunk() -> None:
    truth = np.full(P, 1.0)
    few = Population.from_evidence([car("a", truth)])._posterior.weights()[0]
    many = Population.from_evidence([car(f"c{i}", truth, seed=i) for i in range(12)])._posterior.weights()[0]
    assert 0.0 < few.mean() < 0.25
    assert few.mean() < many.mean() < 1.0


def test_a_car_model_with_trips_starts_from_them() -> None:
    truth = np.zeros(P)
    truth[0] = 2.0
    cars = Population.from_evidence([car("nissan_leaf_24", truth), car("b", np.zeros(P), seed=1)])
    leaf, other = (cars.experts(load_vehicle(name)) for name in ("nissan_leaf_24", "vw_id3"))
    assert leaf.collapsed()[0][0] > other.collapsed()[0][0] + 0.2
    leaf_sd, other_sd = (
        known.covariance[known.kind == KINDS.index("population"), 0, 0].mean() for known in (leaf, other)
    )
    assert leaf_sd < other_sd


def test_cars_that_scatter_more_widen_the_spread() -> None:
    rng = np.random.default_rng(3)
    alike = Population.from_evidence([car(f"a{i}", np.zeros(P), seed=i) for i in range(8)])
    apart = Population.from_evidence([car(f"a{i}", 2.5 * rng.normal(size=P), seed=i) for i in range(8)])
    assert (apart.to_frame()["car_sd"] / alike.to_frame()["car_sd"]).median() > 1.3


def test_a_data_set_that_is_left_out_changes_nothing_by_its_numbers() -> None:
    """The population without a set is the same whatever the set holds."""
    one, two = car("a", np.zeros(P)), car("b", np.ones(P), seed=1)
    strange = (two[0], replace(two[1], residual_wh=two[1].residual_wh * 7.0))
    vehicle = load_vehicle("vw_id3")
    alone = Population.from_evidence([one]).experts(vehicle).collapsed()
    for other in (two, strange):
        left = Population.from_evidence([one, other]).without({"b"}).experts(vehicle).collapsed()
        for a, b in zip(alone, left, strict=True):
            assert a == pytest.approx(b)


def test_the_package_has_no_set_whose_licence_forbids_it() -> None:
    licences = {source.dataset: source.licence for source in population().sources}
    assert licences == {"tum": "CC BY 4.0", "ved": "Apache-2.0", "twizy": "CC BY 4.0"}
    stored = json.loads(POPULATION_FILE.read_text(encoding="utf-8"))
    assert set(stored) == {"factors", "sources", "sums", "logs"}  # no trip
    assert "sedan" not in POPULATION_FILE.read_text(encoding="utf-8")
    assert stored["factors"] == dict(zip(NAMES, SDS.tolist(), strict=True))  # made by the factors of now


def test_stored_spreads_are_those_of_the_sums() -> None:
    again = Population(population().sums, population().sources)
    assert again.to_frame()["car_sd"].to_numpy() == pytest.approx(
        population().to_frame()["car_sd"].to_numpy(), rel=1e-4
    )


def test_plain_values_and_back() -> None:
    again = Population.from_dict(json.loads(json.dumps(population().to_dict())))
    assert again.to_frame()["mean"].to_numpy() == pytest.approx(population().to_frame()["mean"].to_numpy())


def test_the_table_prints_what_spreads_rest_on() -> None:
    table = population().to_frame()
    assert list(table.index) == list(NAMES)
    assert table["models_df"].to_dict() == {f.name: f.df for f in FACTORS}
    assert (table["vehicles_df"] == 4).all()
    assert table["models_sd"]["everything"] == 0.031
    assert np.hypot(table["models_sd"], table["vehicles_sd"]).to_numpy() == pytest.approx(
        SDS * np.linalg.norm(LEVEL_SDS, axis=0)
    )
    assert table["source"].str.len().min() > 20


def test_a_car_far_below_the_classes_rolls_harder_and_is_less_certain() -> None:
    cars = Population.from_evidence([])
    light, usual = describe_car(body="quadricycle"), describe_car(mass_kg=1500, body="hatchback")
    rolling = NAMES.index("rolling")
    far, near = (cars.experts(vehicle).collapsed() for vehicle in (light, usual))
    assert far[0][rolling] * SDS[rolling] > 0.3
    assert near[0][rolling] == pytest.approx(0.0)
    assert far[1][0, 0] > 2.0 * near[1][0, 0]
    beyond = beyond_classes(light.body.curb_mass_kg)
    for name in ("rolling", "drivetrain"):
        its = NAMES.index(name)
        assert far[0][its] * SDS[its] == pytest.approx(math.exp(0.5 * beyond) - 1.0)


def test_a_mass_outside_of_the_classes_widens_the_whole_consumption_by_a_quarter_of_its_distance() -> None:
    light, usual = describe_car(body="quadricycle"), describe_car(mass_kg=1500, body="hatchback")
    beyond = beyond_classes(light.body.curb_mass_kg)
    assert beyond > 0.3
    far, near = (_beyond_values(vehicle) for vehicle in (light, usual))
    assert far[1][0] == pytest.approx((0.25 * beyond / SDS[0]) ** 2)
    assert (near[0] == 0.0).all()
    for name, width in spreads(usual.anchor).items():
        assert near[1][NAMES.index(name)] == pytest.approx(
            max(0.0, (width / SDS[NAMES.index(name)]) ** 2 - (LEVEL_SDS[:, NAMES.index(name)] ** 2).sum())
        )


def test_the_better_a_car_is_anchored_the_more_certain_it_is() -> None:
    its = NAMES.index("rolling")
    by_anchor = [
        Population.from_evidence([])
        .experts(replace(load_vehicle("vw_id4_pro"), anchor=anchor))
        .collapsed()[1][its, its]
        for anchor in ("road_load", "certification", "class")
    ]
    assert by_anchor == sorted(by_anchor)
    assert by_anchor[0] < by_anchor[-1]
