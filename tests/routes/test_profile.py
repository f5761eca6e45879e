"""Speed over time from the lengths and times of links: laws, and numbers that are worked out by hand."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.routes.made import NO

from tripwatt.certification.consumption import schedule
from tripwatt.errors import InvalidInput
from tripwatt.physics import DriveConditions, simulate
from tripwatt.routes import LinkStyle, link_profile
from tripwatt.routes.driver import DriverStyle, draw_dwell
from tripwatt.routes.profile import Course, number_of_dips, ramp_speeds, undisturbed_speed
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


@settings(max_examples=30, deadline=None)
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


@settings(max_examples=30, deadline=None)
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


def planned(speed_m_s, links=1, distance_m=100_000.0):
    """A road of a mean speed, cut into equal links, as the driver model drives it."""
    length = np.full(links, distance_m / links)
    return link_profile(length, length / speed_m_s)


def air_factor(time, speed):
    """How much more air drag than at the mean speed throughout: the integral of v³ over that of v and the square of the mean."""
    mean = np.trapezoid(speed, time) / (time[-1] - time[0])
    return np.trapezoid(speed**3, time) / (mean**2 * np.trapezoid(speed, time))


def away_from_the_ends(profile, distance_m=2000.0):
    inside = (profile.position_m > distance_m) & (profile.position_m < profile.position_m[-1] - distance_m)
    return profile.time_s[inside], profile.speed_m_s[inside]


def even_drive(distance_m, time_s, pace_m_s2=0.8):
    """One speed between two ramps, of the same length and duration."""
    speed = 0.5 * (time_s - np.sqrt(time_s**2 - 4.0 * distance_m / pace_m_s2)) * pace_m_s2
    time = np.arange(0.0, time_s + 1.0)
    return time, np.clip(np.minimum(time, time_s - time) * pace_m_s2, 0.0, speed)


@pytest.mark.parametrize("speed", [25.0, 120.0 / 3.6, 36.0])
@pytest.mark.parametrize("links", [10, 400])
def test_a_fast_road_is_driven_alike_however_it_is_cut(speed, links):
    whole, cut = planned(speed), planned(speed, links)
    energy = [electric_energy(p.time_s, p.speed_m_s) for p in (whole, cut)]
    assert energy[1] == pytest.approx(energy[0], rel=0.025)
    assert air_factor(cut.time_s, cut.speed_m_s) == pytest.approx(
        air_factor(whole.time_s, whole.speed_m_s), abs=0.025
    )
    for drive in (whole, cut):
        assert away_from_the_ends(drive)[1].min() > 0.95 * speed


@pytest.mark.parametrize("kilometres", [25.0, 100.0])
@pytest.mark.parametrize("km_h", [90.0, 130.0])
def test_a_motorway_takes_the_energy_of_an_even_drive(kilometres, km_h):
    distance_m, time_s = 1000.0 * kilometres, 3600.0 * kilometres / km_h
    profile = planned(km_h / 3.6, distance_m=distance_m)
    even = even_drive(distance_m, time_s)
    assert electric_energy(profile.time_s, profile.speed_m_s) == pytest.approx(
        electric_energy(*even), rel=0.02
    )


def test_the_air_factor_falls_to_one_with_the_mean_speed():
    factor = [air_factor(*away_from_the_ends(planned(v))) for v in np.arange(5.0, 36.0, 1.0)]
    assert np.all(np.diff(factor) <= 1e-4)
    assert factor[0] > 3.0
    assert factor[20:] == pytest.approx([1.0] * 11, abs=1e-3)


@pytest.mark.parametrize("cycle", ["udds", "hwfet"])
def test_a_schedule_as_one_link_takes_its_energy_and_has_its_air_factor(cycle):
    """City and highway schedule of the EPA, which were made of recorded drives: means of 31.5 and 77.7 km/h."""
    time, speed = schedule(cycle)
    profile = link_profile([np.trapezoid(speed, time)], [time[-1]])
    energy = electric_energy(profile.time_s, profile.speed_m_s)
    assert energy == pytest.approx(electric_energy(time, speed), rel=0.03)
    assert air_factor(profile.time_s, profile.speed_m_s) == pytest.approx(air_factor(time, speed), rel=0.04)


def test_on_a_fast_road_the_free_speed_is_nearer_to_the_mean():
    """At 19.5 m/s half of it is left, from 25 m/s on nothing; a slow link goes 8 m/s faster at most."""
    mean = np.array([10.0, 14.0, 19.5, 25.0, 33.0])
    np.testing.assert_allclose(undisturbed_speed(mean, mean + 6.0) - mean, [6.0, 6.0, 3.0, 0.0, 0.0], **EXACT)
    assert undisturbed_speed(np.array([20.0]), np.array([15.0])).tolist() == [20.0]
    fast = LinkStyle(street_speed_m_s=40.0, length_exponent=0.0)
    np.testing.assert_allclose(
        fast.free_speed(np.full(5, 3000.0), mean) - mean, [8.0, 8.0, 4.0, 0.0, 0.0], **EXACT
    )
    road = link_profile([20_000.0], [20_000.0 / 30.0], moving_speed_m_s=[36.0])
    assert away_from_the_ends(road)[1].max() < 1.06 * 30.0


def test_a_link_without_a_dip_is_slowed_down_beside_faster_ones():
    """Its neighbours would have it at 27 m/s, more than its mean speed."""
    length, speed = np.array([2000.0, 240.0, 2000.0]), np.array([30.0, 25.0, 30.0])
    profile = link_profile(length, length / speed, step_s=0.1)
    late, _ = late_links(length, length / speed, profile)
    assert late[1] == pytest.approx(0.0, abs=0.25)


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


EXACT = {"rtol": 1e-12, "atol": 1e-12}


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("comfort", 0.05, 1.0),
        ("street_speed_m_s", 1.0, 40.0),
        ("length_exponent", 0.0, 1.0),
        ("sharpness", 1.0, 50.0),
        ("stop_place", 0.1, 0.9),
    ],
)
def test_bounds_of_a_link_style(name, low, high):
    for value in (low, high):
        assert getattr(LinkStyle(**{name: value}), name) == value
    for value in (low - 0.01, high + 0.01, NO):
        with pytest.raises(InvalidInput, match=name):
            LinkStyle(**{name: value})


def test_the_free_speed_grows_with_length_up_to_two_kilometres():
    """With an exponent of a half the street's 4 m/s are 8 on four lengths; with a mean of 6 the sum of squares is 100."""
    style = LinkStyle(street_speed_m_s=4.0, length_exponent=0.5, sharpness=2.0)
    length = np.array([1000.0, 562.5, 2000.0, 4000.0])
    found = style.free_speed(length, np.array([6.0, 8.0, 7.0, 7.0]))
    np.testing.assert_allclose(found, [10.0, 10.0, np.sqrt(128.0 + 49.0), np.sqrt(128.0 + 49.0)], **EXACT)
    sharper = LinkStyle(street_speed_m_s=6.0, sharpness=3.0)
    np.testing.assert_allclose(
        sharper.free_speed(np.array([250.0]), np.array([3.0])), (216.0 + 27.0) ** (1 / 3), **EXACT
    )


SOFT = LinkStyle(
    driver=DriverStyle(
        acceleration_m_s2=2.5, deceleration_m_s2=5.0, half_acceleration_speed_m_s=15.0, dwell_mean_s=20.0
    ),
    comfort=0.4,
)
"""Speeds up by 1 m/s² from standstill and by half of it at 15 m/s, brakes with 2 m/s²."""


def test_a_change_of_speed_lies_on_both_sides_of_a_border():
    """The mean of 10 and 20 m/s is passed at 100 m, and v² falls by 2 x 0.5 m²/s² a metre on either side."""
    position = np.arange(0.0, 401.0, 25.0)
    ends = np.array([4, 16])
    ramp = ramp_speeds(position, ends, np.array([10.0, 20.0]), SOFT)
    expected = np.sqrt(np.maximum(225.0 - np.abs(position - 100.0), 0.0))
    np.testing.assert_allclose(ramp, expected, **EXACT)
    np.testing.assert_allclose(ramp[[0, 4, 8, 16]], [np.sqrt(125.0), 15.0, np.sqrt(125.0), 0.0], **EXACT)


def test_the_nearer_of_two_borders_rules():
    position = np.arange(0.0, 301.0, 10.0)
    ramp = ramp_speeds(position, np.array([10, 20, 30]), np.array([20.0, 10.0, 8.0]), SOFT)
    first = np.where(position <= 200.0, np.sqrt(np.maximum(225.0 - np.abs(position - 100.0), 0.0)), 0.0)
    pace = 1.0 / (1.0 + (9.0 / 15.0) ** 2)
    second = np.sqrt(np.maximum(81.0 - 2.0 * pace * np.abs(position - 200.0), 0.0))
    second = np.where(position > 100.0, second, 0.0)
    np.testing.assert_allclose(ramp, np.maximum(first, second), **EXACT)
    assert not ramp_speeds(position, np.array([30]), np.array([20.0]), SOFT).any()


A_STOP_S = 15.0 / (2 * 2.0) + 15.0 / (2 * 1.0) * (1.0 + 15.0**2 / (6.0 * 15.0**2))
"""What a stop from 15 m/s costs: braking with 2 m/s², and speeding up from 1 to 0.5 m/s²."""


def dips(length_m, stops, place=1, unknown=True, count=3):
    """Number on one of several links that take the time of so many stops longer than at 15 m/s."""
    length = np.full(count, length_m)
    time = length / 15.0 + stops * (A_STOP_S + 20.0)
    return int(number_of_dips(length, time, np.full(count, 15.0), np.full(count, unknown), SOFT)[place])


def test_a_link_has_as_many_stops_as_fit_into_the_time_that_is_left():
    assert pytest.approx(3.75 + 7.5 + 1.25) == A_STOP_S
    assert [dips(1500.0, k) for k in (0.4, 1.4, 1.6, 2.4, 2.6, 7.6)] == [1, 1, 2, 2, 3, 8]
    # standing at the start is half a stop
    assert [dips(1500.0, k, 0) for k in (0.9, 1.1, 1.9, 2.1)] == [0, 1, 1, 2]
    assert [dips(1500.0, k, 2) for k in (0.9, 1.1, 1.9, 2.1)] == [0, 1, 1, 2]
    assert [dips(1500.0, k, 0, count=1) for k in (1.4, 1.6)] == [0, 1]
    assert dips(1500.0, 3.0, unknown=False) == 0


def course(length, time, stop=NO, moving=NO, limit=NO, style=SOFT, rng=None):
    length, time = np.array(length, dtype=float), np.array(time, dtype=float)
    given = (np.broadcast_to(np.asarray(x, dtype=float), length.shape).copy() for x in (stop, moving, limit))
    return Course((length, time, *given), style, rng)


def test_the_grid_has_cells_of_four_metres_and_twelve_to_a_dip():
    grid = course([96.0, 10.0, 96.0, 98.0], [10.0, 1.0, 10.0, 10.0], stop=[NO, 0.0, NO, NO], moving=10.0)
    assert np.diff(grid.ends, prepend=0).tolist() == [24, 4, 24, 25]
    assert grid.position[grid.ends].tolist() == [96.0, 106.0, 202.0, 300.0]
    np.testing.assert_allclose(np.diff(grid.position)[:24], 4.0, **EXACT)
    np.testing.assert_allclose(np.diff(grid.position)[24:28], 2.5, **EXACT)
    assert grid.link.tolist() == [0] * 24 + [1] * 4 + [2] * 24 + [3] * 25
    short = course([96.0, 20.0, 96.0], 9.6 * np.ones(3), moving=10.0)
    assert np.diff(short.ends, prepend=0).tolist() == [24, 12, 24]


def test_a_long_route_has_400_000_cells():
    grid = course([1.6e6, 1.6e6], [1e5, 1e5], stop=0.0)
    assert len(grid.position) == 400_001
    grid = course([8e5, 8e5], [1e5, 1e5], stop=0.0)
    assert len(grid.position) == 400_001


def test_what_is_known_of_a_link_before_the_delays():
    """Links of 300 m in 30 s; the second stands for 10 s, so that it is driven at 15 m/s."""
    stop = [NO, 10.0, 0.0, NO, NO, 0.0]
    moving = [NO, NO, NO, 8.0, 14.0, 12.0]
    limit = [NO, NO, 5.0, NO, 13.0, NO]
    grid = course([300.0] * 6, [30.0] * 6, stop, moving, limit)
    assert grid.time.tolist() == [30.0, 20.0, 30.0, 30.0, 30.0, 30.0]
    assert grid.stop.tolist() == [0.0, 10.0, 0.0, 0.0, 0.0, 0.0]
    street = 8.2 * 1.2**0.53
    free = 10.0 * (1.0 + (street / 10.0) ** 3.5) ** (1 / 3.5)
    np.testing.assert_allclose(grid.free, [free, 15.0, 10.0, 10.0, 13.0, 12.0], **EXACT)
    assert grid.limit.tolist() == [np.inf, np.inf, 10.0, np.inf, 13.0, np.inf]
    assert grid.dip_link.tolist() == [4]
    assert grid.max_delay.tolist() == [0.0, 0.95, 0.95, 0.95, 1.0, 0.95]
    assert grid.can_wait.tolist() == [True, False, False, False, True, False]
    np.testing.assert_allclose(grid.fastest, [18.0, 26.0, 10.0, 18.0, 13.0, 18.0], **EXACT)
    ramp = ramp_speeds(grid.position, grid.ends, np.minimum(grid.free, [18, 26, 18, 18, 18, 18]), SOFT)
    most = np.concatenate(([np.inf], grid.limit[grid.link]))
    most[:-1] = np.minimum(most[:-1], grid.limit[grid.link])
    assert ramp.max() > 10.0
    np.testing.assert_allclose(grid.ramp, np.minimum(ramp, most), **EXACT)


def test_dips_lie_in_their_shares_of_the_link():
    waits = 2.0 * (A_STOP_S + 20.0) + 16.0
    grid = course([240.0] * 3, [20.0, waits, 20.0], moving=15.0)
    assert grid.dip_link.tolist() == [1, 1]
    assert grid.dip_node.tolist() == [60 + 15, 60 + 45]
    early = LinkStyle(driver=SOFT.driver, comfort=0.4, stop_place=0.1)
    assert course([240.0] * 3, [20.0, waits, 20.0], moving=15.0, style=early).dip_node.tolist() == [63, 93]
    assert course([240.0, 40.0, 240.0], [20.0, 4.0, 20.0], moving=15.0, style=early).dip_node.tolist() == [62]
    late = LinkStyle(driver=SOFT.driver, comfort=0.4, stop_place=0.9)
    assert course([240.0, 40.0, 240.0], [20.0, 4.0, 20.0], moving=15.0, style=late).dip_node.tolist() == [70]


def test_time_that_is_left_is_spent_at_stops():
    """Three links of 240 m in 80 s: the first and the last stand at the ends of the route, all of them at their dips."""
    grid = course([240.0] * 3, [80.0, 80.0, 80.0], stop=[NO, NO, NO], moving=15.0)
    assert grid.dip_link.tolist() == [0, 1, 1, 2] or grid.dip_link.tolist() == [0, 1, 2]
    speed = np.full(181, 0.5)
    speed[grid.dip_node[grid.dip_link == 1]] = 0.49
    speed[grid.dip_node[grid.dip_link == 2]] = 0.49
    driving_s = np.repeat([50.0, 90.0, 60.0], 60) / 60.0
    wait = grid.waiting(speed, driving_s, None)
    assert wait[0] == pytest.approx(30.0)
    np.testing.assert_allclose(wait[grid.dip_node[grid.dip_link == 1]], 0.0, atol=1e-9)
    of_last = grid.dip_node[grid.dip_link == 2]
    np.testing.assert_allclose(wait[[*of_last, 180]], 20.0 / (len(of_last) + 1), **EXACT)
    assert wait.sum() == pytest.approx(50.0)
    drawn = grid.waiting(speed, driving_s, np.random.default_rng(1))
    share = draw_dwell(
        np.ones(len(grid.dip_node[speed[grid.dip_node] < 0.5]) + 2), SOFT.driver, np.random.default_rng(1)
    )
    last_share = np.array([*share[-2 - len(of_last) : -2], share[-1]])
    np.testing.assert_allclose(drawn[[*of_last, 180]], 20.0 * last_share / last_share.sum(), **EXACT)


def test_a_given_stop_is_waited_for():
    grid = course([240.0] * 2, [46.0, 26.0], stop=[30.0, 10.0], moving=15.0)
    wait = grid.waiting(np.ones(121), np.full(120, 16.0 / 60.0), None)
    assert np.flatnonzero(wait > 1e-9).tolist() == [60, 120]
    np.testing.assert_allclose(wait[[60, 120]], [30.0, 10.0], atol=1e-9)


def test_links_that_are_driven_again_are_driven_as_in_a_whole_drive():
    """Some links get another delay, also beside short ones, over which their speed reaches."""
    rng = np.random.default_rng(3)
    length, mean = rng.uniform(15.0, 600.0, 60), rng.uniform(4.0, 30.0, 60)
    grid, whole = course(length, length / mean), np.ones(60, dtype=bool)
    delay, nothing = rng.uniform(-0.2, 1.0, 60), np.zeros(len(grid.position))
    speed, _ = grid.drive(delay, nothing, whole)
    for _ in range(30):
        new = rng.random(60) < 0.05
        delay = np.where(new, rng.uniform(-0.2, 1.0, 60), delay)
        speed, driving_s = grid.drive(delay, speed, new)
        right, right_s = grid.drive(delay, nothing, whole)
        np.testing.assert_allclose(speed, right, rtol=0.0, atol=1e-8)
        np.testing.assert_allclose(driving_s, right_s, rtol=1e-7)
