"""Numbers of the link driver and of the driver model, with their arithmetic."""

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes import LinkStyle, driver, link_profile, profile
from tripwatt.routes.driver import DriverStyle, draw_dwell, profile_over_time, smooth_field, speed_profile
from tripwatt.routes.profile import _Course, _number_of_dips, _ramps

NO = np.nan
EXACT = {"rtol": 1e-12, "atol": 1e-12}


def test_the_usual_styles():
    """Of the links: what `calibrate_style` found on the cars of the Vehicle Energy Dataset. Of the driver: near UDDS."""
    style = LinkStyle()
    assert (style.comfort, style.street_speed_m_s, style.length_exponent) == (0.27, 8.9, 0.43)
    assert (style.sharpness, style.stop_place) == (3.5, 0.5)
    firm = style.driver
    assert (firm.acceleration_m_s2, firm.deceleration_m_s2) == (2.5, 2.5)
    assert (firm.half_acceleration_speed_m_s, firm.dwell_mean_s) == (35.0, 20.0)
    usual = DriverStyle()
    assert (usual.acceleration_m_s2, usual.deceleration_m_s2) == (1.6, 1.5)
    assert (usual.half_acceleration_speed_m_s, usual.speed_share) == (20.0, 0.97)
    assert (usual.fluctuation, usual.fluctuation_time_s, usual.dwell_mean_s) == (0.06, 10.0, 20.0)


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
    with pytest.raises(InvalidInput, match="at most 1"):
        DriverStyle(speed_share=1.01)
    with pytest.raises(InvalidInput, match="fluctuation"):
        DriverStyle(fluctuation=-0.1)


def test_the_free_speed_grows_with_length_up_to_two_kilometres():
    """With an exponent of a half the street's 8 m/s are 16 on four lengths; with a mean of 12 the sum of squares is 400."""
    style = LinkStyle(street_speed_m_s=8.0, length_exponent=0.5, sharpness=2.0)
    length = np.array([1000.0, 562.5, 2000.0, 4000.0])
    found = style.free_speed(length, np.array([12.0, 16.0, 15.0, 15.0]))
    np.testing.assert_allclose(found, [20.0, 20.0, np.sqrt(512.0 + 225.0), np.sqrt(512.0 + 225.0)], **EXACT)
    sharper = LinkStyle(street_speed_m_s=6.0, sharpness=3.0)
    np.testing.assert_allclose(
        sharper.free_speed(np.array([250.0]), np.array([3.0])), (216.0 + 27.0) ** (1 / 3), **EXACT
    )


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"length_m": [0.0, 500.0]}, "link 1, length_m"),
        ({"length_m": [500.0, np.inf]}, "link 2, length_m"),
        ({"travel_time_s": [60.0, 0.0]}, "link 2, travel_time_s"),
        ({"travel_time_s": [np.inf, 60.0]}, "link 1, travel_time_s"),
        ({"stop_s": [-0.1, 0.0]}, "link 1, stop_s"),
        ({"stop_s": [60.0, 0.0]}, "link 1, stop_s"),
        ({"stop_s": [0.0, 61.0]}, "link 2, stop_s"),
        ({"moving_speed_m_s": [NO, 0.0]}, "link 2, moving_speed_m_s"),
        ({"moving_speed_m_s": [np.inf, NO]}, "link 1, moving_speed_m_s"),
        ({"speed_limit_m_s": [NO, 0.0]}, "link 2, speed_limit_m_s"),
        ({"speed_limit_m_s": [np.inf, NO]}, "link 1, speed_limit_m_s"),
        ({"stop_s": [0.0]}, "stop_s"),
        ({"step_s": 0.0}, "step_s"),
        ({"step_s": np.inf}, "step_s"),
    ],
)
def test_one_fault_of_two_links(changed, where):
    sound = {"length_m": [500.0, 500.0], "travel_time_s": [60.0, 60.0]}
    with pytest.raises(InvalidInput) as caught:
        link_profile(**{**sound, **changed})
    assert [fault.where for fault in caught.value.faults] == [where]


def test_values_at_the_edge_are_links():
    made = link_profile(
        [500.0, 500.0], [60.0, 60.0], stop_s=[0.0, NO], moving_speed_m_s=[9.0, NO], speed_limit_m_s=[NO, 20.0]
    )
    assert made.time_s[-1] == pytest.approx(120.0, abs=1.0)


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
    ramp = _ramps(position, ends, np.array([10.0, 20.0]), SOFT)
    expected = np.sqrt(np.maximum(225.0 - np.abs(position - 100.0), 0.0))
    np.testing.assert_allclose(ramp, expected, **EXACT)
    np.testing.assert_allclose(ramp[[0, 4, 8, 16]], [np.sqrt(125.0), 15.0, np.sqrt(125.0), 0.0], **EXACT)


def test_the_nearer_of_two_borders_rules():
    position = np.arange(0.0, 301.0, 10.0)
    ramp = _ramps(position, np.array([10, 20, 30]), np.array([20.0, 10.0, 8.0]), SOFT)
    first = np.where(position <= 200.0, np.sqrt(np.maximum(225.0 - np.abs(position - 100.0), 0.0)), 0.0)
    pace = 1.0 / (1.0 + (9.0 / 15.0) ** 2)
    second = np.sqrt(np.maximum(81.0 - 2.0 * pace * np.abs(position - 200.0), 0.0))
    second = np.where(position > 100.0, second, 0.0)
    np.testing.assert_allclose(ramp, np.maximum(first, second), **EXACT)
    assert not _ramps(position, np.array([30]), np.array([20.0]), SOFT).any()


A_STOP_S = 15.0 / (2 * 2.0) + 15.0 / (2 * 1.0) * (1.0 + 15.0**2 / (6.0 * 15.0**2))
"""What a stop from 15 m/s costs: braking with 2 m/s², and speeding up from 1 to 0.5 m/s²."""


def dips(length_m, stops, place=1, unknown=True, count=3):
    """Number on one of several links that take the time of so many stops longer than at 15 m/s."""
    length = np.full(count, length_m)
    time = length / 15.0 + stops * (A_STOP_S + 20.0)
    return int(_number_of_dips(length, time, np.full(count, 15.0), np.full(count, unknown), SOFT)[place])


def test_a_link_has_as_many_stops_as_fit_into_the_time_that_is_left():
    assert pytest.approx(3.75 + 7.5 + 1.25) == A_STOP_S
    assert [dips(3000.0, k) for k in (0.4, 1.4, 1.6, 2.4, 2.6, 7.6)] == [1, 1, 2, 2, 3, 8]
    assert [dips(3000.0, k, 0) for k in (0.9, 1.1, 1.9, 2.1)] == [
        0,
        1,
        1,
        2,
    ]  # standing at the start is half a stop
    assert [dips(3000.0, k, 2) for k in (0.9, 1.1, 1.9, 2.1)] == [0, 1, 1, 2]
    assert [dips(3000.0, k, 0, count=1) for k in (1.4, 1.6)] == [0, 1]
    assert dips(3000.0, 3.0, unknown=False) == 0


def test_invented_stops_are_25_metres_apart():
    assert [dips(length, 9.0) for length in (124.0, 125.0, 49.0, 24.0, 5.0)] == [4, 5, 1, 1, 1]


def course(length, time, stop=NO, moving=NO, limit=NO, style=SOFT, rng=None):
    length, time = np.array(length, dtype=float), np.array(time, dtype=float)
    given = (np.broadcast_to(np.asarray(x, dtype=float), length.shape).copy() for x in (stop, moving, limit))
    return _Course.from_links(length, time, *given, style, rng)


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
    street = 8.9 * 1.2**0.43
    free = 10.0 * (1.0 + (street / 10.0) ** 3.5) ** (1 / 3.5)
    np.testing.assert_allclose(grid.free, [free, 15.0, 10.0, 10.0, 13.0, 12.0], **EXACT)
    assert grid.limit.tolist() == [np.inf, np.inf, 10.0, np.inf, 13.0, np.inf]
    assert grid.dip_link.tolist() == [3, 4]
    assert grid.most_delay.tolist() == [0.0, 0.95, 0.95, 1.0, 1.0, 0.95]
    assert grid.can_wait.tolist() == [True, False, False, True, True, False]
    np.testing.assert_allclose(grid.fastest, [18.0, 26.0, 10.0, 18.0, 13.0, 18.0], **EXACT)
    np.testing.assert_allclose(
        grid.ramp,
        _ramps(grid.position, grid.ends, np.minimum(grid.free, [18, 26, 18, 18, 18, 18]), SOFT),
        **EXACT,
    )


def test_nobody_hurries_more_than_1_6_times_and_2_metres_a_second():
    grid = course([240.0] * 3, [60.0] * 3, moving=30.0)
    np.testing.assert_allclose(grid.fastest, 30.0, **EXACT)
    np.testing.assert_allclose(
        grid.ramp, _ramps(grid.position, grid.ends, np.full(3, 1.6 * 4.0 + 2.0), SOFT), **EXACT
    )


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


def test_drawn_speeds_have_a_twentieth_and_drawn_places_the_middle_of_a_link():
    grid = course([240.0] * 3, [20.0, 80.0, 20.0], moving=15.0, rng=np.random.default_rng(3))
    twin = np.random.default_rng(3)
    np.testing.assert_allclose(grid.free, 15.0 * np.exp(0.05 * twin.standard_normal(3)), **EXACT)
    n = len(grid.dip_link)
    place = (np.arange(n) + twin.uniform(0.2, 0.8, n)) / n * 60.0
    assert grid.dip_node.tolist() == (60 + np.rint(place)).tolist()


@pytest.fixture
def aims(monkeypatch):
    """What is aimed at, in place of what can be reached."""
    seen = []

    def remember(position, aim, style, effort=None):
        seen.append((aim.copy(), None if effort is None else effort.copy()))
        return np.maximum(aim, 1.0)

    for module in (profile, driver):
        monkeypatch.setattr(module, "reachable_speed", remember)
    return seen


def test_a_delay_slows_down_at_the_dip_and_a_lead_uses_the_pedals(aims):
    """240 m in 16 s at 15 m/s, with a dip in the middle of each but the first and the last."""
    grid = course([240.0] * 5, [16.0] * 5, stop=[NO, NO, NO, 0.0, NO], moving=15.0)
    assert grid.dip_link.tolist() == [1, 2]
    speed, driving_s = grid.drive(np.array([-0.1, 0.4, -0.2, 0.3, -1.5]))
    ((aim, effort),) = aims
    first, second, third, fourth, last = (slice(60 * k + 20, 60 * k + 40) for k in range(5))
    np.testing.assert_allclose(aim[first], 15.0 * 1.1, **EXACT)  # without a dip one minus the delay
    np.testing.assert_allclose(np.delete(aim[second], 10), 15.0, **EXACT)
    assert aim[90] == pytest.approx(15.0 * 0.6)
    np.testing.assert_allclose(np.delete(aim[third], 10), 15.0 * 1.2, **EXACT)
    assert aim[150] == pytest.approx(15.0)
    np.testing.assert_allclose(aim[fourth], np.maximum(15.0 * 0.7, grid.ramp[fourth]), **EXACT)
    np.testing.assert_allclose(aim[last], 1.6 * 15.0 + 2.0, **EXACT)
    assert aim[0] == aim[-1] == 0.0
    np.testing.assert_allclose(
        effort[::60], [0.4 * 1.3, 0.4, 0.4 * 1.6, 0.4, 1.0], **EXACT
    )  # comfort, and three times the lead
    np.testing.assert_allclose(driving_s, 8.0 / (speed[1:] + speed[:-1]), **EXACT)


def test_the_search_for_the_delays_ends_after_thirty_passes(monkeypatch):
    """A car that is by turns too slow and too fast never keeps its time."""
    passes = []

    def by_turns(position, aim, style, effort=None):
        passes.append(1)
        return np.full(len(position), 1.0 if len(passes) % 2 else 100.0)

    monkeypatch.setattr(profile, "reachable_speed", by_turns)
    link_profile([240.0] * 3, [16.0] * 3, moving_speed_m_s=[15.0] * 3)
    assert len(passes) == 30


def test_the_slower_link_rules_where_two_meet_and_a_given_stop_is_a_standstill(aims):
    grid = course([240.0] * 3, [26.0, 16.0, 16.0], stop=[10.0, 0.0, 0.0], limit=[NO, NO, 15.0])
    grid.drive(np.array([-0.4, 0.0, -0.4]))
    ((aim, _),) = aims
    assert aim[60] == 0.0
    assert aim[59] == pytest.approx(21.0)
    assert aim[61] == pytest.approx(15.0)
    assert aim[120] == 15.0
    np.testing.assert_allclose(aim[121:180], 15.0, **EXACT)


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


def test_smooth_noise_is_an_autoregression_of_order_two():
    """Ten points to a length, eighty of them to forget the start."""
    position, value = smooth_field(25.0, 5.0, np.random.default_rng(7))
    assert len(position) == 25 / 5 * 10 + 2
    np.testing.assert_allclose(position, 0.5 * np.arange(52), **EXACT)
    pole = np.exp(-0.1)
    state, found = [0.0, 0.0], []
    for drawn in np.random.default_rng(7).standard_normal(52 + 80):
        state = [drawn + 2.0 * pole * state[0] - pole**2 * state[1], state[0]]
        found.append(state[0])
    variance = (1.0 + pole**2) / (1.0 - pole**2) ** 3
    np.testing.assert_allclose(value, np.array(found[80:]) / np.sqrt(variance), rtol=1e-9)


@pytest.mark.parametrize("fluctuation", [0.06, 0.4])
def test_an_unsteady_foot_aims_beside_the_limit_and_varies_its_pressure(aims, fluctuation):
    """Links of 40 and 6 m at 10 and 5 m/s have ten cells of 0.4 s and two of 0.6 s."""
    style = DriverStyle(fluctuation=fluctuation)
    speed_profile([40.0, 6.0, 2.0], [10.0, 5.0, 8.0], style=style, rng=np.random.default_rng(5))
    ((aim, effort),) = aims
    at_s = np.concatenate((np.arange(11) * 0.4, [4.6, 5.2, 5.325, 5.45]))
    twin = np.random.default_rng(5)
    steady = np.interp(at_s, *smooth_field(5.45, 10.0, twin))
    press = np.interp(at_s, *smooth_field(5.45, 1.5, twin))
    share = 0.97 * np.exp(fluctuation * steady)
    share = np.maximum(np.where(share > 1.0, 2.0 - share, share), 0.4 * 0.97)
    allowed = np.array([10.0] * 10 + [5.0] * 3 + [8.0] * 2)
    expected = allowed * share
    expected[[0, -1]] = 0.0
    np.testing.assert_allclose(aim, expected, rtol=1e-9)
    np.testing.assert_allclose(
        effort, np.clip(1.0 - 2.0 * fluctuation * (1.0 + press), 0.3, 1.0)[1:], rtol=1e-9
    )


def test_a_steady_foot_aims_at_its_share_and_stops_where_it_has_to(aims):
    speed_profile([40.0, 40.0, 40.0], [10.0, 20.0, 20.0], dwell_s=[0.0, 3.0, 0.0])
    ((aim, effort),) = aims
    assert effort is None
    expected = 0.97 * np.array([10.0] * 11 + [20.0] * 20)
    expected[[0, 20, 30]] = 0.0
    np.testing.assert_allclose(aim, expected, **EXACT)


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"length_m": [0.0, 5.0]}, "link 1, length_m"),
        ({"length_m": [5.0, np.inf]}, "link 2, length_m"),
        ({"speed_m_s": [5.0, 0.0]}, "link 2, speed_m_s"),
        ({"dwell_s": [-1.0, 0.0]}, "link 1, dwell_s"),
        ({"step_s": 0.0}, "step_s"),
        ({"step_s": NO}, "step_s"),
    ],
)
def test_one_fault_of_a_route(changed, where):
    with pytest.raises(InvalidInput) as caught:
        speed_profile(**{"length_m": [5.0, 5.0], "speed_m_s": [5.0, 5.0], **changed})
    assert [fault.where for fault in caught.value.faults] == [where]


def test_a_stop_lasts_two_seconds_and_an_exponential():
    found = draw_dwell([0.0, 1.0, 0.5, 1.0], DriverStyle(dwell_mean_s=12.0), np.random.default_rng(9))
    twin = np.random.default_rng(9)
    stops = twin.random(4) < np.array([0.0, 1.0, 0.5, 1.0])
    np.testing.assert_allclose(found, np.where(stops, 2.0 + 10.0 * twin.exponential(1.0, 4), 0.0), **EXACT)
    short = draw_dwell([1.0], DriverStyle(dwell_mean_s=1.0), np.random.default_rng(9))
    assert short.tolist() == [2.0]
    for wrong in (-0.01, 1.01, NO):
        with pytest.raises(InvalidInput, match="stop_probability, link 2"):
            draw_dwell([0.5, wrong], DriverStyle(), np.random.default_rng(0))


def test_distance_becomes_time():
    """1 s standing, 2 s up to 4 m/s, 2 s on at 4 m/s, 1.5 s standing, 2 s up again, 1 s down."""
    position = np.array([0.0, 4.0, 12.0, 14.0, 18.0, 20.0])
    speed = np.array([0.0, 4.0, 4.0, 0.0, 4.0, 0.0])
    driving = np.array([2.0, 2.0, 1.0, 2.0, 1.0])
    waiting = np.array([1.0, 0.0, 0.0, 1.5, 0.0, 0.0])
    found = profile_over_time(position, speed, driving, waiting, np.array([2, 3, 5]), 0.5)
    assert found.time_s.tolist() == [0.5 * k for k in range(22)]
    up, rest = [0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 0.0]
    assert found.speed_m_s.tolist() == [0.0, 0.0, *up, *[4.0] * 5, 2.0, *rest, *up, 4.0, 2.0, 0.0]
    np.testing.assert_allclose(
        found.position_m,
        [0, 0, 0, 0.25, 1, 2.25, 4, 6, 8, 10, 12, 13.5, 14, 14, 14, 14, 14.25, 15, 16.25, 18, 19.5, 20],
        **EXACT,
    )
    assert found.link.tolist() == [0] * 10 + [1] * 5 + [2] * 7


def test_the_last_sample_is_the_first_after_the_arrival():
    at, speed, ends = np.array([0.0, 4.0, 8.0]), np.array([0.0, 4.0, 0.0]), np.array([2])
    found = profile_over_time(at, speed, np.array([2.0, 2.0]), np.zeros(3), ends, 1.5)
    assert found.time_s.tolist() == [0.0, 1.5, 3.0, 4.5]
    assert found.position_m.tolist() == [0.0, 2.25, 7.0, 8.0]
    assert found.speed_m_s.tolist() == [0.0, 3.0, 2.0, 0.0]
    exact = profile_over_time(at, speed, np.array([2.0, 2.0]), np.zeros(3), ends, 0.1)
    assert len(exact.time_s) == 41
