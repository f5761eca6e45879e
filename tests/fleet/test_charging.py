"""The schedule of a night's charging beside all schedules of small nights, and its limits on large ones."""

import math

import numpy as np
import pytest
from tests.fleet.depots import (
    AT,
    FIGURES,
    UNIT_WH,
    best_of_all,
    drawn_trips,
    large_night,
    needs_of,
    simulated_night,
    small_night,
    tariff_of,
)

from tripwatt.errors import InvalidInput
from tripwatt.fleet.charging import EFFICIENCY, STEP, Depot, Night, read_tariff, schedule
from tripwatt.fleet.features import FEATURES, START
from tripwatt.fleet.nights import shared_errors
from tripwatt.hybrid.groups import Sums, group_posterior


@pytest.mark.parametrize("first", range(0, 200, 50))
def test_a_schedule_is_the_best_of_all_on_small_nights(first):
    for seed in range(first, first + 50):
        rows, prices, limit = small_night(np.random.default_rng(seed))
        depot = Depot(AT, 22e3, 1000.0 * limit, tariff_of(prices))
        plan = schedule(needs_of(rows), depot)
        missing, cost = best_of_all(rows, prices, limit)
        assert plan.missing_wh.sum() / UNIT_WH == pytest.approx(missing, abs=1e-5), seed
        assert plan.cost == pytest.approx(cost / 4.0, abs=1e-5), seed
        least = next(p for p in range(limit + 1) if best_of_all(rows, prices, p) == (missing, cost))
        assert math.ceil(plan.peak_w / 1000.0 - 1e-4) == least, seed
        assert plan.peak_w <= 1000.0 * limit, seed


def test_a_large_night_keeps_every_limit():
    needs, tariff = large_night(3)
    plan = schedule(needs, Depot(AT, 7400.0, 400e3, tariff))
    table = plan.table.merge(needs.groupby("vehicle_id")["alternating_w"].first().reset_index())
    together = table.groupby("begins_at")["power_w"].sum()
    assert together.max() == pytest.approx(plan.peak_w)
    assert plan.peak_w <= 400e3
    assert (table["power_w"] <= table["alternating_w"].clip(upper=7400.0)).all()
    driving = plan.table.merge(needs, on="vehicle_id")
    is_away = (driving["begins_at"] + STEP > driving["departs_at"]) & (
        driving["begins_at"] < driving["arrives_at"]
    )
    assert not is_away.any()
    assert plan.table["power_w"].sum() * EFFICIENCY / 4.0 == pytest.approx(
        needs["charge_wh"].sum() - plan.missing_wh.sum(), rel=0.01
    )


def test_the_peak_is_flat_where_the_price_is_and_the_first_failure_is_named():
    rows = [(0, 4, 4, 4, 0, 50, 4), (1, 2, 2, 4, 0, 50, 4)]
    free = schedule(needs_of(rows), Depot(AT, 22e3))
    assert (free.peak_w, free.missing_wh.sum()) == (pytest.approx(2000.0, abs=1e-3), 0)
    tight = schedule(needs_of(rows), Depot(AT, 22e3, 1000.0))
    fails = Night(needs_of(rows), Depot(AT, 22e3, 1000.0)).summary["fails_first"]
    assert (fails["vehicle_id"], fails["reason"]) == ("V1", "grid limit")
    for slow_w, reason in (
        (500.0, "time at the charger"),
        (22e3, "size of the battery, or no time between trips"),
    ):
        needs = needs_of(rows).assign(
            alternating_w=slow_w, charge_wh=[UNIT_WH, UNIT_WH * (4 if slow_w < 1e3 else 60)]
        )
        assert Night(needs, Depot(AT, 22e3, 20e3)).summary["fails_first"]["reason"] == reason
    assert tight.missing_wh.sum() == pytest.approx(4.0 * UNIT_WH, abs=0.01)
    nothing = schedule(needs_of(rows), Depot(AT, 22e3, 0.0))
    assert (len(nothing.table), nothing.peak_w) == (0, 0.0)


def test_emhass_gets_the_plan_without_a_choice():
    needs, tariff = large_night(5, 20)
    night = Night(needs, Depot(AT, 11e3, 40e3, tariff))
    load = night.document["emhass"]
    together = np.zeros(load["prediction_horizon"])
    assert load["optimization_time_step"] == 15
    spans = zip(
        load["start_timesteps_of_each_deferrable_load"],
        load["end_timesteps_of_each_deferrable_load"],
        strict=True,
    )
    for (a, b), hours, power_w in zip(
        spans,
        load["operating_hours_of_each_deferrable_load"],
        load["nominal_power_of_deferrable_loads"],
        strict=True,
    ):
        assert (b - a) / 4.0 == hours
        together[a:b] += power_w
    assert together.max() == pytest.approx(night.summary["peak_w"], abs=20.0)


def test_a_tariff_is_read_or_its_faults_are_named(tmp_path):
    file = tmp_path / "tariff.csv"
    file.write_text("begins_at,price\n2026-01-11T18:00+00:00,0.30\n2026-01-12T02:00+00:00,-0.02\n")
    tariff = read_tariff(file)
    assert tariff == {AT: 0.3, AT.replace(day=12, hour=2): -0.02}
    late = Depot(AT - STEP, 11e3, None, tariff)
    with pytest.raises(InvalidInput, match="no price: tariff"):
        schedule(needs_of([(0, 4, 4, 1, 0, 50, 4)]), late)
    early = Depot(AT - 14 * 96 * STEP, 11e3, 60e3)
    with pytest.raises(InvalidInput, match="charging begins too early"):
        schedule(needs_of([(0, 4, 4, 1, 0, 50, 4)]), early)
    for text, place in (("at,price\n1,2\n", "begins_at"), ("begins_at\n2026-01-11\n", "price")):
        file.write_text(text)
        with pytest.raises(InvalidInput, match=place):
            read_tariff(file)


def test_stated_chances_hold_in_simulated_nights():
    """`python -m benchmarks.fleet_night` drives more of them."""
    stated, happened = np.mean(
        [[*zip(*simulated_night(k).values(), strict=True)] for k in range(100)], axis=0
    )
    figures = dict(zip(FIGURES, zip(stated, happened, strict=True), strict=True))
    bounds = {"chance now": 0.02, "vehicle": 0.02, "energy": 0.05, "depot": 0.08, "median": 0.1}
    for name, within in bounds.items():
        assert figures[name][1] == pytest.approx(figures[name][0], abs=within), name
    assert figures["sum of quantiles"][1] > 0.99, "too much for a depot"


def test_the_errors_that_vehicles_share_are_those_of_their_joint_distribution():
    """Beside the posterior of all weights at once."""
    rng = np.random.default_rng(1)
    names = [(f"m{m}", f"v{m}{v}") for m in range(2) for v in range(3)]
    groups = [(*name, "") for k, name in enumerate(names) for _ in range(3 * (k % 3))]
    X, noise, p = drawn_trips(rng, len(groups)), np.full(len(groups), 200.0**2), len(FEATURES)
    posterior = group_posterior(Sums.from_trips(groups, X, np.zeros(len(X)), noise), START)
    nodes = [(), ("m0",), ("m1",), *names]
    shared = [[sum(a[:k] == b[:k] for k in range(1, 1 + min(len(a), len(b)))) for b in nodes] for a in nodes]
    prior = np.block(
        [[np.diag(sum(START.variances(k) for k in range(n + 1))) for n in row] for row in shared]
    )
    A, B = np.zeros((len(X), len(prior))), np.zeros((len(names), len(prior)))
    for row, group in enumerate(groups):
        A[row].reshape(-1, p)[nodes.index(group[:2])] = X[row]
    for row, x in enumerate(tonight := drawn_trips(rng, len(names))):
        B[row].reshape(-1, p)[3 + row] = x
    gain = np.linalg.solve(A @ prior @ A.T + np.diag(noise), A @ prior).T
    exact = B @ (prior - gain @ A @ prior) @ B.T
    errors = np.array([shared_errors(posterior, (*n, None), x) for n, x in zip(names, tonight, strict=True)])
    same = np.array([[a[0] == b[0] for b in names] for a in names])
    joint = errors[:, :p] @ errors[:, :p].T + same * (errors[:, p : 2 * p] @ errors[:, p : 2 * p].T)
    joint += np.diag((errors[:, 2 * p :] ** 2).sum(axis=1))
    assert joint == pytest.approx(exact, rel=1e-6, abs=1e-3)
