"""Laws of the link driver: travel times, limits, energy; and what drawing changes."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.physics import DriveConditions, simulate
from tripwatt.routes import LinkStyle, link_profile
from tripwatt.vehicles import load_vehicle

CAR = load_vehicle("bmw_i3_60ah")


def time_at(profile, position):
    """First time at which a position is reached, exact between two samples of a constant acceleration."""
    moves = np.concatenate(([True], np.diff(profile.position_m) > 0))
    return np.interp(position, profile.position_m[moves], profile.time_s[moves])


def links(draw, fewest=3, most=20):
    """Links whose mean speeds change by no more than traffic does, so that limits can keep the times."""
    n = draw(st.integers(fewest, most))
    length = draw(st.lists(st.floats(150.0, 1500.0), min_size=n, max_size=n))
    speed = [draw(st.floats(2.0, 12.0))]
    for _ in range(n - 1):
        factor = draw(st.floats(0.75, 1.3))
        speed.append(min(max(speed[-1] * factor, 2.0), 35.0))
    return np.array(length), np.array(length) / np.array(speed)


routes = st.composite(links)()


def pedal_use(profile, style):
    """Share of the driver's largest acceleration or deceleration at its speed that each interval uses."""
    change = np.diff(profile.speed_m_s) / np.diff(profile.time_s)
    speed = 0.5 * (profile.speed_m_s[1:] + profile.speed_m_s[:-1])
    driver = style.driver
    up = driver.acceleration_m_s2 / (1.0 + (speed / driver.half_acceleration_speed_m_s) ** 2)
    return np.abs(change) / np.where(change > 0.0, up, driver.deceleration_m_s2)


def late_links(length, time, profile):
    """How much longer than its travel time each link takes [s]; negative on a link that is left too early."""
    borders = time_at(profile, np.concatenate(([0.0], np.cumsum(length))))
    # standing at the start and at the end belongs to the first and the last link
    borders[0], borders[-1] = 0.0, profile.time_s[-1]
    return np.diff(borders) - time, borders


@settings(max_examples=60, deadline=None)
@given(routes)
# the last link is too short to brake in; the fast link between slower ones is too short to speed up on
@example((np.array([500.0, 200.0, 200.0]), np.array([41.667, 12.821, 9.862])))
@example((np.array([150.0, 250.0, 160.0]), np.array([13.817, 21.811, 10.738])))
@example(
    (
        np.array([1500.0, 1500.0, 250.0, 160.0, 200.0, 1500.0]),
        np.array([125.0, 96.154, 12.6, 6.203, 10.338, 77.538]),
    )
)
def test_every_link_takes_its_travel_time_or_the_driver_is_at_the_limit(route):
    length, time = route
    profile = link_profile(length, time, step_s=0.1)
    late, borders = late_links(length, time, profile)
    # a standstill at a border belongs to the link before it, which arrival times cannot tell from the next
    kept = np.abs(late) <= np.maximum(0.006 * time, 0.3)
    kept[[0, -1]] = np.abs(late[[0, -1]]) <= np.maximum(0.01 * time[[0, -1]], 0.5)
    use = pedal_use(profile, LinkStyle())
    for link in np.flatnonzero(~kept):
        inside = (profile.time_s[1:] > borders[link]) & (profile.time_s[:-1] < borders[link + 1])
        assert late[link] > 0.0
        assert use[inside].max() > 0.95
    assert profile.time_s[-1] - time.sum() == pytest.approx(
        late[~kept].sum(), rel=0.01, abs=0.01 * time.sum() + 0.5
    )
    assert profile.position_m[-1] == pytest.approx(length.sum())


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(1.0, 3000.0), st.floats(0.3, 60.0)), min_size=1, max_size=15),
    st.one_of(st.none(), st.integers(0, 9)),
)
def test_no_acceleration_beyond_the_drivers_and_no_teleport(route, seed):
    length = np.array([r[0] for r in route])
    rng = None if seed is None else np.random.default_rng(seed)
    style = LinkStyle()
    profile = link_profile(length, length / np.array([r[1] for r in route]), style=style, rng=rng, step_s=0.5)
    change = np.diff(profile.speed_m_s) / 0.5
    assert change.max(initial=0.0) <= style.driver.acceleration_m_s2 + 1e-6
    assert change.min(initial=0.0) >= -style.driver.deceleration_m_s2 - 1e-6
    assert profile.speed_m_s[0] == 0.0
    assert profile.speed_m_s.min() >= 0.0
    assert np.all(np.diff(profile.position_m) >= 0.0)
    driven = np.trapezoid(profile.speed_m_s, profile.time_s)
    assert driven == pytest.approx(length.sum(), rel=0.05, abs=5.0)


def electric_energy(time, speed):
    return simulate(
        CAR, time, speed, conditions=DriveConditions(climate="off", initial_warmth=1.0)
    ).simulated_energy_wh


@settings(max_examples=25, deadline=None)
@given(routes)
def test_energy_lies_between_constant_speed_and_full_stops_at_top_speed(route):
    length, time = route
    profile = link_profile(length, time)
    energy = electric_energy(profile.time_s, profile.speed_m_s)
    mean = length.sum() / profile.time_s[-1]
    steady = electric_energy(profile.time_s, np.full(len(profile.time_s), mean))
    # the bound: all of the way at the top speed, all of its kinetic energy lost at every rise of speed, and at no
    # better an efficiency than the car has anywhere while it pulls away
    top = profile.speed_m_s.max()
    fastest = np.arange(0.0, length.sum() / top + 1.0)
    fast = electric_energy(fastest, np.full(len(fastest), top))
    rises = np.maximum(np.diff(profile.speed_m_s**2), 0.0).sum()
    kinetic = 0.5 * CAR.body.test_mass_kg * CAR.body.rotating_mass_factor * rises / 3600.0
    base = CAR.auxiliaries.base_load_w * profile.time_s[-1] / 3600.0
    assert steady * 0.995 <= energy <= fast + base + kinetic / 0.75


def test_low_mean_speed_is_a_stop_and_not_a_crawl():
    length, time = np.full(9, 250.0), np.full(9, 20.0)
    time[4] = 60.0
    profile = link_profile(length, time)
    inside = (profile.position_m > 1000.0) & (profile.position_m < 1250.0)
    assert np.count_nonzero(profile.speed_m_s[inside] == 0.0) >= 10
    assert profile.speed_m_s[inside].max() > 8.0


def test_given_stops_are_kept_and_none_are_invented():
    profile = link_profile([500.0, 500.0, 500.0], [70.0, 70.0, 60.0], stop_s=[25.0, 0.0, 0.0])
    stands = profile.speed_m_s == 0.0
    assert np.count_nonzero(stands & (np.abs(profile.position_m - 500.0) < 1.0)) in (25, 26)
    assert not np.any(stands[5:-5] & (np.abs(profile.position_m[5:-5] - 500.0) >= 1.0))


def test_moving_speed_is_the_speed_between_stops():
    slow = link_profile([1000.0] * 4, [110.0] * 4, moving_speed_m_s=[13.0] * 4)
    fast = link_profile([1000.0] * 4, [110.0] * 4, moving_speed_m_s=[20.0] * 4)
    assert slow.speed_m_s.max() == pytest.approx(13.0, rel=0.02)
    assert fast.speed_m_s.max() == pytest.approx(20.0, rel=0.02)


def test_seeds_draw_different_drives_of_the_same_links():
    length, time = np.full(12, 250.0), np.linspace(15.0, 70.0, 12)
    one, same, other = (link_profile(length, time, rng=np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.speed_m_s, same.speed_m_s)
    assert len(one.speed_m_s) != len(other.speed_m_s) or np.any(one.speed_m_s != other.speed_m_s)
    assert one.time_s[-1] == pytest.approx(time.sum(), rel=0.01)
    again = link_profile(length, time)
    np.testing.assert_array_equal(again.speed_m_s, link_profile(length, time).speed_m_s)


def test_all_faults_at_once():
    with pytest.raises(InvalidInput) as caught:
        link_profile([100.0, -1.0], [10.0, np.nan], stop_s=[20.0, 0.0], step_s=0.0)
    assert {f.where.split(", ")[-1] for f in caught.value.faults} == {
        "length_m",
        "travel_time_s",
        "stop_s",
        "step_s",
    }
    with pytest.raises(InvalidInput, match="comfort"):
        LinkStyle(comfort=0.0)
