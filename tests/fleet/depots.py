"""Nights of depots: small ones with every schedule, a large one, and made fleets whose errors are drawn."""

import datetime as dt
import itertools
import math

import numpy as np
import pandas as pd

from tripwatt.fleet.charging import EFFICIENCY, STEP
from tripwatt.fleet.features import FEATURES, START
from tripwatt.fleet.nights import OF_ERRORS, TRIP_COLUMNS, add_up_needs, shared_errors, sum_up_depot
from tripwatt.hybrid.groups import Sums, group_posterior

AT = dt.datetime(2026, 1, 11, 18, tzinfo=dt.UTC)
UNIT_WH = 1000.0 * EFFICIENCY / 4.0
"""Energy that a kilowatt brings into the battery in a quarter of an hour."""


def needs_of(rows):
    """Needs from (vehicle, departure, arrival [quarters], energy to charge, energy of the trips, room [units], power [kW])."""
    table = [
        {
            "vehicle_id": f"V{vehicle}",
            "car_model": "m",
            "departs_at": AT + departs * STEP,
            "arrives_at": AT + arrives * STEP,
            "charge_wh": units * UNIT_WH,
            "energy_wh": taken * UNIT_WH,
            "soc": 1.0 - room / 100.0,
            "wh_per_soc": 100.0 * UNIT_WH,
            "alternating_w": 1000.0 * power,
            "direct_w": 50e3,
            "soc_needed": 0.5,
            **dict.fromkeys(set(OF_ERRORS) - {"wh_per_soc"}, 0.0),
        }
        for vehicle, departs, arrives, units, taken, room, power in rows
    ]
    return pd.DataFrame(table)


def tariff_of(prices):
    return {AT + k * STEP: float(price) for k, price in enumerate(prices)}


def best_of_all(rows, prices, limit):
    """Least (missing, cost) of every schedule in whole units with at most `limit` kilowatts together."""
    vehicles = sorted({row[0] for row in rows})
    by_vehicle = [[row for row in rows if row[0] == vehicle] for vehicle in vehicles]
    states = {(0,) * len(vehicles): (0, 0)}
    for t in range(len(prices) + 1):
        after = {}
        for state, (missing, cost) in states.items():
            fits = True
            for trips, charged in zip(by_vehicle, state, strict=True):
                need, taken = 0, 0
                for row in trips:
                    need += row[3]
                    if row[1] == t:
                        missing += max(need - charged, 0)
                        fits &= charged <= row[5] + taken
                    taken += row[4]
            if fits:
                after[state] = min(after.get(state, (math.inf, 0)), (missing, cost))
        states = after
        if t == len(prices):
            break
        after = {}
        for state, (missing, cost) in states.items():
            most = []
            for trips in by_vehicle:
                back = [0, *(row[2] for row in trips)]
                stands = any(a <= t < row[1] for a, row in zip(back, trips, strict=False))
                most.append(trips[0][6] if stands else 0)
            for powers in itertools.product(*(range(m + 1) for m in most)):
                if sum(powers) <= limit:
                    new = tuple(c + p for c, p in zip(state, powers, strict=True))
                    value = missing, cost + sum(powers) * prices[t]
                    after[new] = min(after.get(new, (math.inf, 0)), value)
        states = after
    return min(states.values())


def small_night(rng):
    rows = []
    quarters = int(rng.integers(3, 6))
    for vehicle in range(rng.integers(1, 4)):
        power, room = int(rng.integers(1, 4)), int(rng.integers(2, 9))
        departs = int(rng.integers(1, quarters + 1))
        taken = int(rng.integers(0, 4))
        rows.append(
            (vehicle, departs, min(departs + 1, quarters), int(rng.integers(0, 6)), taken, room, power)
        )
        if departs + 2 <= quarters and rng.uniform() < 0.6:
            rows.append((vehicle, quarters, quarters, int(rng.integers(0, 5)), 1, room, power))
    prices = rng.integers(-1 if rng.uniform() < 0.2 else 1, 5, quarters).tolist()
    return rows, prices, int(rng.integers(0, 7))


def large_night(seed, vehicles=500):
    """A night of 96 quarters: half of the vehicles drive again in the afternoon."""
    rng, rows = np.random.default_rng(seed), []
    for vehicle in range(vehicles):
        departs, again = int(rng.integers(44, 60)), rng.uniform() < 0.5
        power, room = float(rng.choice([3.7, 7.4, 11.0])), float(rng.uniform(60.0, 250.0))
        back = departs + int(rng.integers(4, 20))
        rows.append((vehicle, departs, back, rng.uniform(0.0, 100.0), 60.0, room, power))
        if again:
            rows.append((vehicle, 96, 96, rng.uniform(0.0, 60.0), 40.0, room, power))
    return needs_of(rows), tariff_of(np.repeat(rng.uniform(0.05, 0.45, 24), 4))


P, WH_PER_SOC = len(FEATURES), 50e3
FIGURES = ("chance now", "vehicle", "depot", "energy", "median", "sum of quantiles")


def _deviation(rng, level):
    return rng.normal(0.0, np.sqrt(START.variances(level)))


def drawn_trips(rng, n):
    return rng.uniform(0.3, 1.7, (n, 1)) * rng.uniform(20.0, 300.0, P)


def simulated_night(seed, probability=0.95, models=3, vehicles=8, history=12):
    """Draw a fleet by its own statistical model, fit it, plan a night, and drive the night.

    Vehicles have 0 to `history` trips and drive one or two hours. Returns the stated figures and what happened: for each vehicle the chance
    that its charge suffices; for the depot the quantile of its energy and the chance that all have enough.
    """
    rng = np.random.default_rng([61, seed])
    weights = {(): _deviation(rng, 0)}
    groups, X, y, n = [], [], [], []
    for m in range(models):
        weights[(f"m{m}",)] = weights[()] + _deviation(rng, 1)
        for v in range(vehicles):
            name = (f"m{m}", f"v{m}{v}")
            weights[name] = weights[name[:1]] + _deviation(rng, 2)
            x = drawn_trips(rng, int(rng.integers(1, history + 1)) if v else 0)
            variance = np.full(len(x), 200.0**2)
            groups += [(*name, "")] * len(x)
            X, n = [*X, *x], [*n, *variance]
            y += (x @ weights[name] + rng.normal(0.0, np.sqrt(variance))).tolist()
    posterior = group_posterior(Sums.from_trips(groups, np.array(X), np.array(y), np.array(n)), START)
    rows, taken = [], {}
    for name in [name for name in weights if len(name) == 2]:
        soc = float(rng.uniform(0.15, 0.5))
        for hour in range(int(rng.integers(1, 3))):
            (x,) = drawn_trips(rng, 1)
            mean, covariance = posterior.weights(*name)
            own = 200.0**2
            sd = math.sqrt(float(x @ covariance @ x) + own)
            shared = np.append(shared_errors(posterior, name, x), 0.0)
            at = AT + dt.timedelta(hours=12 + 3 * hour)
            median = 8000.0 + float(x @ mean)
            errors = *shared, own, median / WH_PER_SOC, sd / WH_PER_SOC, sd
            rows.append((name[1], at, name[0], at, at, soc, 11e3, 50e3, [], 1, 1e4, median, *errors))
            taken[name[1], at] = 8000.0 + float(x @ weights[name]) + rng.normal(0.0, math.sqrt(own))
    needs = add_up_needs(pd.DataFrame(rows, columns=TRIP_COLUMNS), probability, 0.1)
    charged = needs["charge_wh"].groupby(needs["vehicle_id"]).cumsum().to_numpy()
    stated = sum_up_depot(needs, probability, charged)
    truth = np.array([taken[key] for key in zip(needs["vehicle_id"], needs["departs_at"], strict=True)])
    left = needs["soc"] - 0.1 - pd.Series(truth).groupby(needs["vehicle_id"]).cumsum() / WH_PER_SOC
    after = left + charged / WH_PER_SOC
    needed = needs["charge_wh"] > 0.0
    quantiles_wh = needs["energy_quantile_wh"].sum()
    values = (
        (needs["p_enough"].mean(), (left >= 0.0).mean()),
        (probability, (after[needed] >= 0.0).mean()),
        (stated["p_enough"], float((after >= 0.0).all())),
        (probability, float(truth.sum() <= stated["energy_quantile_wh"])),
        (0.5, float(truth.sum() <= stated["energy_wh"])),
        (probability, float(truth.sum() <= quantiles_wh)),
    )
    return dict(zip(FIGURES, values, strict=True))
