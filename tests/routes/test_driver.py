"""The driver model: laws of the speed over a route, and its numbers, each bound from both sides."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.routes.made import NO
from tests.support.refusals import refusal, refuses

from tripwatt.errors import InvalidInput
from tripwatt.routes.driver import (
    DriverStyle,
    draw_dwell,
    profile_over_time,
    reachable_speed,
    smooth_field,
    speed_profile,
)

links = st.lists(
    st.tuples(st.floats(0.5, 3000.0), st.floats(1.0, 40.0), st.one_of(st.just(0.0), st.floats(1.0, 90.0))),
    min_size=1,
    max_size=12,
)


styles = st.builds(
    DriverStyle,
    acceleration_m_s2=st.floats(0.3, 4.0),
    deceleration_m_s2=st.floats(0.3, 5.0),
    half_acceleration_speed_m_s=st.floats(5.0, 80.0),
    speed_share=st.floats(0.3, 1.0),
    fluctuation=st.floats(0.0, 0.5),
)


@settings(max_examples=60, deadline=None)
@given(
    route=links,
    style=styles,
    seed=st.one_of(st.none(), st.integers(0, 99)),
    step_s=st.sampled_from([0.1, 1.0]),
)
def test_laws(route, style, seed, step_s):
    length, limit, dwell = map(np.array, zip(*route, strict=True))
    rng = None if seed is None else np.random.default_rng(seed)
    p = speed_profile(length, limit, dwell_s=dwell, style=style, rng=rng, step_s=step_s)
    v = p.speed_m_s

    np.testing.assert_allclose(np.diff(p.time_s), step_s)
    assert (v >= 0).all()
    edges = np.concatenate(([0.0], np.cumsum(length)))
    link = np.clip(np.searchsorted(edges, p.position_m) - 1, 0, len(length) - 1)
    assert (v <= limit[link] * (1 + 1e-9)).all()
    assert v[0] == 0
    assert v[-1] == 0
    change = np.diff(v) / step_s
    assert change.max() <= style.acceleration_m_s2 * (1 + 1e-6)
    assert change.min() >= -style.deceleration_m_s2 * (1 + 1e-6)
    # the whole distance, never backwards, and speed and position tell the same story
    np.testing.assert_allclose(p.position_m[-1], length.sum(), rtol=1e-9)
    moved = np.diff(p.position_m)
    assert (moved >= -1e-9).all()
    firmest = max(style.acceleration_m_s2, style.deceleration_m_s2)
    assert (np.abs(moved - 0.5 * (v[1:] + v[:-1]) * step_s) <= 0.25 * firmest * step_s**2 + 1e-9).all()
    # each stop holds the car for its time, at the end of its link
    for end, wait in zip(edges[1:], dwell, strict=True):
        standing = (np.abs(p.position_m - end) < 1e-6) & (v == 0)
        if wait >= step_s:
            assert abs(standing.sum() * step_s - wait) <= 2 * step_s


def test_driver_uses_the_road_that_is_free():
    """Without this a car that crawls would pass every law above."""
    style = DriverStyle(
        acceleration_m_s2=2.0, deceleration_m_s2=1.0, half_acceleration_speed_m_s=1e6, speed_share=1.0
    )
    p = speed_profile([2000.0], [20.0], style=style)
    # 10 s and 100 m up, 20 s and 200 m down, 1700 m at 20 m/s
    np.testing.assert_allclose(p.speed_m_s[[5, 10, 50, 95]], [10.0, 20.0, 20.0, 20.0], atol=1e-6)
    assert abs(p.time_s[-1] - 115.0) <= 1.0


def test_reachable_speed_follows_the_equation_of_motion():
    """Second opinion: the differential equation dv/ds = a(v) / v in small steps."""
    style = DriverStyle(acceleration_m_s2=1.8, half_acceleration_speed_m_s=15.0)
    position = np.linspace(0.0, 800.0, 401)
    found = reachable_speed(position, np.where(position == 0, 3.0, 60.0), style)
    v, fine = 3.0, [3.0]
    for i in range(1, 80_001):
        v += 0.01 * 1.8 / (1 + (v / 15.0) ** 2) / v
        if i % 200 == 0:
            fine.append(v)
    np.testing.assert_allclose(found, fine, rtol=1e-3)


def test_braking_starts_before_a_slower_link():
    p = speed_profile([500.0, 500.0], [30.0, 10.0], style=DriverStyle(speed_share=1.0), step_s=0.1)
    enters = np.searchsorted(p.position_m, 500.0)
    assert p.speed_m_s[enters] <= 10.0 + 1e-9
    assert p.speed_m_s[enters - 1] > 9.9
    assert p.speed_m_s[enters - 30] > 12.0


def test_draws_do_not_depend_on_the_step_and_repeat():
    args = ([800.0, 1500.0], [14.0, 25.0])
    coarse = speed_profile(*args, rng=np.random.default_rng(3))
    fine = speed_profile(*args, rng=np.random.default_rng(3), step_s=0.1)
    n = min(len(coarse.time_s), len(fine.time_s[::10]))
    np.testing.assert_allclose(coarse.speed_m_s[: n - 1], fine.speed_m_s[::10][: n - 1], atol=1e-9)
    other = speed_profile(*args, rng=np.random.default_rng(4))
    assert other.speed_m_s[30] != coarse.speed_m_s[30]


def test_smooth_field_has_its_variance_and_correlation():
    position, value = smooth_field(400_000.0, 100.0, np.random.default_rng(0))
    assert position[-1] >= 400_000.0
    assert abs(value.std() - 1.0) < 0.05
    apart = 10  # grid points per correlation length: (1 + 1) / e
    assert abs(np.corrcoef(value[apart:], value[:-apart])[0, 1] - 2 / np.e) < 0.05


def test_dwell_has_the_style_s_mean_and_the_given_frequency():
    dwell = draw_dwell(np.full(20_000, 0.3), DriverStyle(dwell_mean_s=20.0), np.random.default_rng(0))
    assert abs((dwell > 0).mean() - 0.3) < 0.01
    assert abs(dwell[dwell > 0].mean() - 20.0) < 1.0
    assert dwell[dwell > 0].min() >= 2.0
    assert draw_dwell([1.0], DriverStyle(dwell_mean_s=1.0), np.random.default_rng(9)).tolist() == [2.0]


def test_all_faults_of_a_style_at_once():
    assert refusal(DriverStyle, deceleration_m_s2=-1.0, fluctuation=NO, speed_share=1.2).splitlines() == [
        "driver style out of range: deceleration_m_s2: got -1.0; allowed: more than 0",
        "driver style out of range: fluctuation: got nan; allowed: 0 or more",
        "driver style out of range: speed_share: got 1.2; allowed: at most 1",
    ]


EXACT = {"rtol": 1e-12, "atol": 1e-12}


@pytest.mark.parametrize(
    "name", ["acceleration_m_s2", "deceleration_m_s2", "fluctuation_time_s", "speed_share"]
)
def test_a_driver_style_is_positive(name):
    for value in (0.0, -1.0, NO, np.inf):
        with pytest.raises(InvalidInput, match=name):
            DriverStyle(**{name: value})
    assert getattr(DriverStyle(**{name: 0.01}), name) == 0.01


def test_a_steady_foot_and_short_stops_are_allowed():
    still = DriverStyle(fluctuation=0.0, dwell_mean_s=0.0, speed_share=1.0)
    assert (still.fluctuation, still.dwell_mean_s, still.speed_share) == (0.0, 0.0, 1.0)
    refuses("at most 1", DriverStyle, speed_share=1.01)
    refuses("fluctuation", DriverStyle, fluctuation=-0.1)


def test_distance_becomes_time():
    """1 s standing, 2 s up to 4 m/s, 2 s on at 4 m/s, 1.5 s standing, 2 s up again, 1 s down."""
    position = np.array([0.0, 4.0, 12.0, 14.0, 18.0, 20.0])
    speed = np.array([0.0, 4.0, 4.0, 0.0, 4.0, 0.0])
    driving = np.array([2.0, 2.0, 1.0, 2.0, 1.0])
    waiting = np.array([1.0, 0.0, 0.0, 1.5, 0.0, 0.0])
    found = profile_over_time(position, speed, driving, waiting, 0.5)
    assert found.time_s.tolist() == [0.5 * k for k in range(22)]
    up, rest = [0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 0.0]
    assert found.speed_m_s.tolist() == [0.0, 0.0, *up, *[4.0] * 5, 2.0, *rest, *up, 4.0, 2.0, 0.0]
    np.testing.assert_allclose(
        found.position_m,
        [0, 0, 0, 0.25, 1, 2.25, 4, 6, 8, 10, 12, 13.5, 14, 14, 14, 14, 14.25, 15, 16.25, 18, 19.5, 20],
        **EXACT,
    )


def test_the_last_sample_is_the_first_after_the_arrival():
    at, speed = np.array([0.0, 4.0, 8.0]), np.array([0.0, 4.0, 0.0])
    found = profile_over_time(at, speed, np.array([2.0, 2.0]), np.zeros(3), 1.5)
    assert found.time_s.tolist() == [0.0, 1.5, 3.0, 4.5]
    assert found.position_m.tolist() == [0.0, 2.25, 7.0, 8.0]
    assert found.speed_m_s.tolist() == [0.0, 3.0, 2.0, 0.0]
    exact = profile_over_time(at, speed, np.array([2.0, 2.0]), np.zeros(3), 0.1)
    assert len(exact.time_s) == 41
    rounded = profile_over_time(at, speed, np.array([2.0, 2.0 + 5e-10]), np.zeros(3), 1.0)
    assert (rounded.time_s[-1], rounded.position_m[-1], rounded.speed_m_s[-1]) == (4.0, 8.0, 0.0)
