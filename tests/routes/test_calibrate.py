"""The style of a driver from trips."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from benchmarks.link_style import calibrate_style, road_work
from tests.routes.made import NO
from tests.support.refusals import refuses

from tripwatt.routes import LinkStyle, links_of_trip, route_from_links
from tripwatt.trips import Trip


def test_calibration_finds_the_style_that_made_the_trips():
    truth = LinkStyle(street_speed_m_s=14.0, comfort=0.4)
    rng = np.random.default_rng(5)
    trips = [
        route_from_links([{"length_m": 250.0, "speed_m_s": v} for v in rng.uniform(4.0, 16.0, 30)]).plan(
            style=truth
        )
        for _ in range(4)
    ]
    found = calibrate_style(trips, length_m=(250.0,), max_evaluations=60)
    wrong = [abs(road_work(links_of_trip(t).plan(style=LinkStyle())) / road_work(t) - 1.0) for t in trips]
    right = [abs(road_work(links_of_trip(t).plan(style=found)) / road_work(t) - 1.0) for t in trips]
    assert np.mean(right) < 0.02
    assert np.mean(right) < 0.25 * np.mean(wrong)
    refuses("no trips", calibrate_style, [])


def test_the_work_of_a_compact_car_by_hand():
    """Rolling 0.01 g, drag 2.6e-4 v², inertia 1.05; 85 % of it on the way out, 70 % on the way back."""
    trip = Trip.from_samples(
        "t", pd.DataFrame({"time_s": [3.0, 7.0, 9.0, 14.0], "speed_m_s": [0.0, 20.0, 20.0, 0.0]})
    )
    rolling = 0.01 * 9.80665
    up = (rolling + 2.6e-4 * 100.0 + 1.05 * 5.0) * 10.0
    steady = (rolling + 2.6e-4 * 400.0) * 20.0
    down = (rolling + 2.6e-4 * 100.0 - 1.05 * 4.0) * 10.0
    expected = up / 0.85 * 4.0 + steady / 0.85 * 2.0 + 0.7 * down * 5.0
    assert road_work(trip) == pytest.approx(expected, rel=1e-12)


def test_slow_driving_takes_work_and_slow_braking_gives_some_back():
    """At a walking pace the power per mass is far below 1 W/kg: 0.01 g and 2.6e-4 v² at 1 m/s."""
    steady = Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 10.0], "speed_m_s": [1.0, 1.0]}))
    assert road_work(steady) == pytest.approx((0.0980665 + 2.6e-4) / 0.85 * 10.0, rel=1e-12)
    slower = Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 5.0], "speed_m_s": [1.5, 0.5]}))
    power = 0.0980665 + 2.6e-4 - 1.05 * 0.2
    assert road_work(slower) == pytest.approx(0.7 * power * 5.0, rel=1e-12)


def cruise(name, n=101):
    return Trip.from_samples(
        name, pd.DataFrame({"time_s": np.arange(float(n)), "speed_m_s": np.full(n, 10.0)})
    )


def calibrated(monkeypatch, answer, tried=(), **options):
    """The style from an answer of the search, what the search was given, and its loss at some places."""
    seen = {}

    def search(loss, first, **given):
        seen.update(given, first=first, losses=[loss(np.array(x)) for x in tried])
        return SimpleNamespace(x=np.array(answer))

    monkeypatch.setattr("scipy.optimize.minimize", search)
    used = []

    def energy(trip):
        used.append(trip.trip_id)
        return 100.0 if trip.trip_id != "route" else 130.0

    trips = options.pop("trips", [cruise("A")])
    style = calibrate_style(trips, energy=energy, **options)
    return style, seen, dict.fromkeys(used)


def test_one_length_of_links_leaves_the_growth_alone(monkeypatch):
    start = LinkStyle(length_exponent=0.7)
    style, seen, _ = calibrated(monkeypatch, [9.0, 0.3], length_m=(250.0,), style=start)
    assert len(seen["first"]) == 2
    assert (style.street_speed_m_s, style.length_exponent, style.comfort) == (9.0, 0.7, 0.3)


def test_the_found_style_keeps_to_its_bounds(monkeypatch):
    low, seen, _ = calibrated(
        monkeypatch, [1.0, -0.5, 0.01], tried=[[1.0, 0.5, 0.5], [9.0, 0.4, 0.9], [9.0, 0.4, 0.3]]
    )
    assert (low.street_speed_m_s, low.length_exponent, low.comfort) == (2.0, 0.0, 0.08)
    # driven again, the trip takes three tenths more; beyond a bound the distance from it is added
    np.testing.assert_allclose(seen["losses"], [0.3 + 1.0, 0.3 + 0.1, 0.3])
    high, _, _ = calibrated(monkeypatch, [99.0, 0.99, 0.99])
    assert (high.street_speed_m_s, high.length_exponent, high.comfort) == (30.0, 0.8, 0.8)


def test_trips_without_positive_energy_are_refused():
    for energy in (0.0, -1.0, NO):
        refuses("no positive energy", calibrate_style, [cruise("A")], energy=lambda trip, found=energy: found)
