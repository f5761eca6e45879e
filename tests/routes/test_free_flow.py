"""Times of an empty road and the times that drives take."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.link_style import road_work

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.routes import LinkRoute, route_from_links
from tripwatt.routes.free_flow import TravelTimeFactors, free_flow_links, log_energy_ratios, moving_share
from tripwatt.trips import Trip

NAN = float("nan")


def trip(*pieces):
    """A drive of pieces (seconds, km/h)."""
    speed = np.concatenate([np.full(seconds, kmh / 3.6) for seconds, kmh in pieces])
    return Trip.from_samples("t", pd.DataFrame({"time_s": np.arange(float(len(speed))), "speed_m_s": speed}))


@pytest.mark.parametrize(
    ("kmh", "free"),
    [
        (5, 30),
        (29, 30),
        (30, 30),
        (31, 50),
        (50, 50),
        (69, 70),
        (99, 100),
        (101, 120),
        (121, 130),
        (180, 130),
    ],
)
def test_the_free_speed_is_the_class_above_the_moving_speed(kmh, free):
    route, _ = free_flow_links(trip((200, kmh)))
    assert 3.6 * route.moving_speed_m_s == pytest.approx(np.full(len(route), free))
    assert route.travel_time_s == pytest.approx(route.length_m / route.moving_speed_m_s)
    assert route.free_flow


def test_a_standstill_is_no_speed_but_counts_as_time():
    driven = trip((60, 36), (100, 0), (60, 36))
    route, seconds = free_flow_links(driven, 5000.0)
    assert 3.6 * route.moving_speed_m_s == pytest.approx([50.0])
    assert seconds == pytest.approx([219.0])
    assert route.travel_time_s == pytest.approx(route.distance_m / (50.0 / 3.6))


def test_each_sample_counts_for_the_link_on_which_it_lies():
    """Two links of 250 m. A sample of 20 m/s lies at 249.5 m, another one at the end of the trip, 500 m.

    The highest tenth of 12.5, 12.5, 13 and 20 begins at 17.9 m/s, that of 10, 10 and 20 at 18 m/s: the class of 70 km/h.
    """
    speed = np.array([13.0, 12.5, 12.5, 20.0, 10.0, 10.0, 20.0])
    way = np.array([63.75, 62.5, 123.25, 75.0, 100.0, 75.5])
    time = np.concatenate(([0.0], np.cumsum(way / (0.5 * (speed[1:] + speed[:-1])))))
    log = Trip.from_samples("t", pd.DataFrame({"time_s": time, "speed_m_s": speed}))
    route, _ = free_flow_links(log)
    assert route.length_m == pytest.approx([250.0, 250.0])
    assert 3.6 * route.moving_speed_m_s == pytest.approx([70.0, 70.0])


def links(speed_kmh, length_m):
    speed, length = np.array(speed_kmh) / 3.6, np.array(length_m, dtype=float)
    empty = np.full(len(speed), NAN)
    return LinkRoute(length, length / speed, empty, speed, free_flow=True)


def test_factors_are_time_over_free_time_by_class():
    route = links([50.0, 130.0], [1e6, 1e6])
    factors = TravelTimeFactors.from_links([route], [np.array([1.5, 1.1]) * route.travel_time_s])
    assert factors.at(np.array([50.0, 130.0]) / 3.6) == pytest.approx([1.5, 1.1], rel=1e-2)


def test_a_class_with_little_road_is_drawn_to_the_classes_next_to_it():
    """Roads of 30, 100 and 120 km/h; that of 130 km/h has no road, that of 50 km/h none but beside it."""
    route = links([30.0, 100.0, 120.0], [8e5, 8e5, 8e5])
    factors = TravelTimeFactors.from_links([route], [np.array([2.5, 1.3, 1.1]) * route.travel_time_s])
    assert factors.factor[[0, 3, 4]] == pytest.approx([2.5, 1.3, 1.1], rel=0.02)
    assert factors.factor[[1, 2, 5]] == pytest.approx([2.5, 1.3, 1.1], rel=0.02)


def test_a_class_without_road_near_it_has_the_factor_of_all():
    route = links([50.0, 100.0], [20_000.0, 40_000.0])
    factors = TravelTimeFactors.from_links([route], [np.array([1.6, 1.2]) * route.travel_time_s])
    free = [1440.0, 1440.0]  # 20 km at 50 and 40 km at 100 km/h
    overall = (1.6 * free[0] + 1.2 * free[1]) / sum(free)
    assert overall == pytest.approx(1.4)
    assert factors.factor[5] == pytest.approx(1.4)
    # 20 km of a class weigh as much as what is assumed of it, and the road next to it counts as its own
    assert factors.factor[1] == pytest.approx((1.6 + (1.6 + 1.4) / 2.0) / 2.0)
    assert factors.factor[3] == pytest.approx((2.0 * 1.2 + (2.0 * 1.2 + 1.4) / 3.0) / 3.0)
    # 20 km at 50 are as long as 12 at 30 km/h
    assert factors.factor[0] == pytest.approx((1.6 * 12.0 + 1.4 * 20.0) / 32.0)


@pytest.mark.parametrize(("times", "factor"), [(10.0, 3.0), (2.9, 2.9), (0.4, 0.4), (0.1, 1.0 / 3.0)])
def test_factors_lie_between_a_third_and_three(times, factor):
    route = links([50.0], [1e6])
    found = TravelTimeFactors.from_links([route], [times * route.travel_time_s])
    assert found.factor == pytest.approx([factor] * 6)


def test_expected_times_never_fall_below_those_of_the_router():
    factors = TravelTimeFactors(np.array([10.0, 30.0]), np.array([1.5, 1.1]))
    route = LinkRoute(
        np.array([1000.0, 1000.0, 900.0]),
        np.array([100.0, 200.0, 30.0]),
        np.full(3, NAN),
        np.array([10.0, 10.0, NAN]),
    )
    found = factors.with_expected_times(route)
    assert found.travel_time_s == pytest.approx([150.0, 200.0, 33.0])
    assert found.moving_speed_m_s == pytest.approx([10.0, 10.0, 30.0])


def test_a_limit_slows_down_and_leaves_the_factor_to_the_free_speed():
    """Links of a kilometre with a free speed of 30 m/s; below 10 m/s the factor is 1.5."""
    factors = TravelTimeFactors(np.array([10.0, 30.0]), np.array([1.5, 1.1]), moving_share=0.9)
    road = LinkRoute(
        np.full(3, 1000.0),
        np.full(3, 1000.0 / 30.0),
        np.full(3, NAN),
        np.array([30.0, 30.0, NAN]),
        speed_limit_m_s=np.array([10.0, NAN, 40.0]),
    )
    found = factors.with_expected_times(road)
    assert found.travel_time_s == pytest.approx([110.0, 1100.0 / 30.0, 1100.0 / 30.0])
    assert found.moving_speed_m_s == pytest.approx([9.0, 27.0, 27.0])


def cut(number, **more):
    return route_from_links([{"length_m": 20_000.0 / number, "speed_m_s": 50.0 / 3.6, **more}] * number)


@pytest.mark.parametrize(
    "more", [{}, {"moving_speed_m_s": 15.0}, {"speed_limit_m_s": 16.0}, {"grade": 0.01}, {"stop_s": 0.0}]
)
def test_energy_does_not_depend_on_how_a_road_is_cut(more):
    model = tw.load_model()
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=10.0)
    found = [model.forecast(cut(n, **more).plan(), departure) for n in (1, 20, 200)]
    assert [f.energy_wh for f in found] == pytest.approx([found[0].energy_wh] * 3, rel=1e-6)
    assert [f.sd_wh for f in found] == pytest.approx([found[0].sd_wh] * 3, rel=1e-6)


def test_an_impossible_log_cannot_be_cut():
    with pytest.raises(InvalidInput, match="length out of range"):
        free_flow_links(trip((10, 50)), -1.0)


def limited(*pieces, elevation_m=None):
    """A drive of pieces (seconds, km/h driven, km/h allowed)."""
    driven = trip(*((seconds, kmh) for seconds, kmh, _ in pieces))
    limit = np.concatenate([np.full(seconds, kmh / 3.6) for seconds, _, kmh in pieces])
    columns = {"speed_limit_m_s": limit}
    if elevation_m is not None:
        columns["elevation_m"] = elevation_m(np.arange(float(len(limit))))
    return Trip.from_samples("t", driven.samples.assign(**columns))


def test_a_log_with_limits_is_cut_where_they_change():
    route, seconds = free_flow_links(limited((100, 36, 40), (100, 36, 60), (101, 36, 40)))
    assert 3.6 * route.moving_speed_m_s == pytest.approx([40.0, 60.0, 40.0])
    assert route.length_m == pytest.approx([1000.0, 1000.0, 1000.0])
    assert seconds == pytest.approx([100.0, 100.0, 100.0])
    assert route.travel_time_s == pytest.approx(3600.0 / np.array([40.0, 60.0, 40.0]))
    assert route.free_flow


def test_the_speed_of_the_drive_is_no_part_of_links_by_limit():
    """The same road at half of the speed: the same links, twice the time."""
    quick, quick_s = free_flow_links(limited((100, 36, 40), (101, 36, 60)))
    slow, slow_s = free_flow_links(limited((200, 18, 40), (201, 18, 60)))
    assert slow.length_m == pytest.approx(quick.length_m)
    assert slow.moving_speed_m_s == pytest.approx(quick.moving_speed_m_s)
    assert slow_s == pytest.approx(2.0 * quick_s)


@pytest.mark.parametrize("between", [20.0, NAN])
def test_a_short_or_unknown_piece_goes_with_the_link_before_it(between):
    route, seconds = free_flow_links(limited((100, 36, 40), (3, 36, between), (98, 36, 60)))
    assert 3.6 * route.moving_speed_m_s == pytest.approx([40.0, 60.0])
    assert route.length_m == pytest.approx([1030.0, 970.0])
    assert seconds == pytest.approx([103.0, 97.0])


def test_a_log_whose_limit_begins_late_has_it_from_the_start():
    route, _ = free_flow_links(limited((50, 36, NAN), (151, 36, 60)))
    assert 3.6 * route.moving_speed_m_s == pytest.approx([60.0])
    assert route.distance_m == pytest.approx(2000.0)


def test_heights_of_links_by_limit_are_those_of_the_road():
    route, _ = free_flow_links(limited((201, 36, 60), elevation_m=lambda second: 100.0 + second))
    assert route.elevation_at([0.0, 500.0, 1000.0, 2000.0]) == pytest.approx([100.0, 150.0, 200.0, 300.0])


def test_a_class_stands_at_the_mean_free_speed_of_its_links():
    """40 and 60 km/h lie between the classes; their own factors are not mixed with those of the neighbours."""
    route = links([40.0, 60.0], [1e6, 1e6])
    factors = TravelTimeFactors.from_links([route], [np.array([1.5, 2.1]) * route.travel_time_s])
    assert factors.at(np.array([40.0, 60.0]) / 3.6) == pytest.approx([1.5, 2.1], rel=0.02)
    assert (np.diff(factors.speed_m_s) > 0.0).all()


def test_the_speed_between_stops_is_a_share_of_the_free_speed():
    factors = TravelTimeFactors(np.array([10.0, 30.0]), np.array([1.5, 1.5]), moving_share=0.8)
    found = factors.with_expected_times(links([36.0], [1000.0]))
    assert found.moving_speed_m_s == pytest.approx([8.0])
    assert found.travel_time_s == pytest.approx([150.0])


@pytest.mark.parametrize("share", [0.7, 0.85, 1.0])
def test_the_share_of_drives_that_were_made_with_it_is_found(share):
    """Drives that the driver model made of links with a share of the limit between their stops."""
    road = links([50.0, 80.0, 60.0], [2000.0, 5000.0, 3000.0])
    seconds = np.array([1.9, 1.5, 2.1]) * road.travel_time_s
    made = LinkRoute(road.length_m, seconds, road.stop_s, share * road.moving_speed_m_s).plan(trip_id="made")
    drive = Trip.from_samples("made", made.samples)
    found = log_energy_ratios(drive, road, seconds, road_work)
    assert moving_share([found, found]) == pytest.approx(share, abs=0.02)
