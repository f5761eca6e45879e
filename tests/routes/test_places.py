"""Places: coordinates, names, directions, distances."""

import math

import numpy as np
import pandas as pd
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes.places import Place, bearings_deg, driven_m, read_coordinates, without_twins
from tripwatt.trips import Plan

DEGREE_M = 6_371_008.8 * math.pi / 180.0


@pytest.mark.parametrize(
    ("start", "bearing", "degrees", "end"),
    [
        ((0.0, 0.0), 0.0, 30.0, (30.0, 0.0)),
        ((0.0, 0.0), 180.0, 30.0, (-30.0, 0.0)),
        ((10.0, 20.0), 180.0, 40.0, (-30.0, 20.0)),
        ((0.0, 0.0), 90.0, 30.0, (0.0, 30.0)),
        ((0.0, 0.0), 270.0, 30.0, (0.0, -30.0)),
        ((0.0, 170.0), 90.0, 30.0, (0.0, -160.0)),
        ((0.0, -170.0), 270.0, 30.0, (0.0, 160.0)),
        ((80.0, 0.0), 0.0, 20.0, (80.0, -180.0)),
        ((8.0, 0.0), 0.0, 82.0, (90.0, None)),
        ((-8.0, 0.0), 180.0, 82.0, (-90.0, None)),
        ((60.0, 0.0), 90.0, 90.0, (0.0, 90.0)),
        ((0.0, 0.0), 45.0, 90.0, (45.0, 90.0)),
    ],
)
def test_moving_along_a_great_circle(start, bearing, degrees, end):
    found = Place(*start).moved(bearing, degrees * DEGREE_M)
    assert found.latitude_deg == pytest.approx(end[0], abs=1e-6)
    if end[1] is not None:
        assert found.longitude_deg == pytest.approx(end[1], abs=1e-6)
    assert Place(*start).distance_m(found) == pytest.approx(degrees * DEGREE_M)


def test_directions_of_a_great_circle():
    """A quarter of the equator from a place at 60 degrees the path to it begins to the east."""
    lines = [
        ((60.0, 0.0), (0.0, 90.0), 90.0),
        ((0.0, 0.0), (45.0, 90.0), 45.0),
        ((0.0, 0.0), (-45.0, -90.0), 225.0),
        ((60.0, 0.0), (90.0, 50.0), 0.0),
        ((50.0, 10.0), (40.0, 10.0), 180.0),
        ((10.0, 10.0), (10.0, 10.0), 0.0),
    ]
    for first, last, direction in lines:
        found = bearings_deg(*np.array([first, last]).T)
        assert found == pytest.approx([direction], abs=1e-9)


def test_bounds_of_a_place():
    for pair in ((90.0, 180.0), (-90.0, -180.0)):
        assert (Place(*pair).latitude_deg, Place(*pair).longitude_deg) == pair
    for pair, number in (((90.1, 0.0), 1), ((0.0, -180.1), 1), ((-91.0, 181.0), 2), ((0.0, math.inf), 1)):
        with pytest.raises(InvalidInput) as caught:
            Place(*pair)
        assert len(caught.value.faults) == number


def test_a_place_in_plain_values():
    assert Place(47.1, 9.5, "Vaduz", "town").to_dict() == {
        "name": "Vaduz",
        "kind": "town",
        "context": "",
        "also_called": "",
        "latitude_deg": 47.1,
        "longitude_deg": 9.5,
    }
    assert Place(47.1, 9.123456).to_dict()["name"] == "47.10000, 9.12346"


@pytest.mark.parametrize(
    ("text", "pair"),
    [
        ("-47.1,-9.5", (-47.1, -9.5)),
        ("47 9", (47.0, 9.0)),
        ("47;  179.25", (47.0, 179.25)),
        ("geo:1,2", (1.0, 2.0)),
        ("090,010", (90.0, 10.0)),
    ],
)
def test_latitude_comes_first(text, pair):
    found = read_coordinates(text)
    assert (found.latitude_deg, found.longitude_deg) == pair


@pytest.mark.parametrize("text", ["47.,9", "47.1", "+47,9", "0047,9", "47,0009", "47,9 km", "47--9", "4 7,9"])
def test_what_looks_like_coordinates_is_none(text):
    assert read_coordinates(text) is None


def test_coordinates_of_no_place_are_refused():
    with pytest.raises(InvalidInput, match="latitude: got 91°"):
        read_coordinates("91,9")


def test_places_of_one_name_that_lie_together_are_one() -> None:
    village, office, far = (Place(47.1 + d, 9.5, "Vaduz", "village") for d in (0.0, 0.01, 1.0))
    assert without_twins([village, office, far]) == (village, far)
    assert without_twins(iter([village, office, far, far]), limit=1) == (village,)


@pytest.mark.parametrize(
    ("kind", "other", "described"),
    [
        ("", "", "Oslo"),
        ("city", "", "Oslo (city)"),
        ("", "Christiania", "Oslo (also called Christiania)"),
        ("capital_city", "Christiania", "Oslo (capital city, also called Christiania)"),
    ],
)
def test_a_place_is_described_by_what_is_known_of_it(kind, other, described):
    assert Place(59.91, 10.75, "Oslo", kind, other).described == described


def test_the_distance_of_a_plan_is_that_of_its_line_and_a_standing_car_has_none():
    plan = Plan.from_samples(pd.DataFrame({"time_s": [0.0, 1.0, 3.0], "speed_m_s": [5.0, 10.0, 20.0]}))
    assert driven_m(plan, 100.0)[[0, -1]].tolist() == [0.0, 100.0]
    standing = Plan.from_samples(pd.DataFrame({"time_s": [0.0, 1.0, 3.0], "speed_m_s": [0.0, 0.0, 0.0]}))
    assert set(driven_m(standing, 100.0)) == {0.0}
