"""Answers of Google Routes, HERE and TomTom: the same road has the same energy in the answer of every service."""

import json
import string

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.routes.made import M_PER_DEGREE, encode_polyline, faults_of

import tripwatt as tw
from tripwatt.routes import parse_route
from tripwatt.routes.points import decode_flexible_polyline
from tripwatt.routes.responses import ROUTERS, recognise_router
from tripwatt.trips import Flag

MODEL = tw.load_model()
LETTERS = string.ascii_uppercase + string.ascii_lowercase + string.digits + "-_"
Links = list[tuple[float, float]]


def flexible(points, kind=3, third=1):
    """A flexible polyline, with the letters of an encoded polyline replaced."""
    header = 5 | kind << 4 | third << 7
    text = encode_polyline(points, [1e5, 1e5, 10**third][: len(points[0])])
    head, value = [1], header
    while value >= 0x20:
        head.append(0x20 | value & 0x1F)
        value >>= 5
    return "".join(LETTERS[n] for n in [*head, value, *(ord(letter) - 63 for letter in text)])


def line(links, heights):
    position = np.concatenate(([0.0], np.cumsum([length for length, _ in links])))
    return [
        (48.0 + at / M_PER_DEGREE, 11.0, height)
        for at, height in zip(position.tolist(), heights, strict=True)
    ]


def google(links, mark=()):
    steps = [
        {
            "distanceMeters": length,
            "staticDuration": f"{seconds}s",
            "navigationInstruction": {"maneuver": "FERRY" if k in mark else "DEPART"},
        }
        for k, (length, seconds) in enumerate(links)
    ]
    return {"routes": [{"legs": [{"duration": f"{sum(s for _, s in links)}s", "steps": steps}]}]}


def here(links, mark=(), heights=None, kind=3, mode="ferry"):
    points = line(links, heights or [0.0] * (len(links) + 1))
    sections = [
        {
            "transport": {"mode": mode if k in mark else "car"},
            "spans": [{"offset": 0, "length": length, "duration": seconds}],
            "polyline": flexible(points[k : k + 2], kind),
        }
        for k, (length, seconds) in enumerate(links)
    ]
    return {"routes": [{"id": "r", "sections": sections}]}


def tomtom(links, mark=(), mode="FERRY", travel="car"):
    ends = np.vstack(([0.0, 0.0], np.cumsum(links, axis=0))).tolist()
    progress = [
        {"pointIndex": 4 * k, "distanceInMeters": at, "travelTimeInSeconds": time}
        for k, (at, time) in enumerate(ends)
    ]
    sections = [{"sectionType": mode, "startPointIndex": 4 * k, "endPointIndex": 4 * k + 4} for k in mark]
    whole = {"sectionType": "TRAVEL_MODE", "travelMode": travel, "startPointIndex": 0, "endPointIndex": 4}
    return {
        "formatVersion": "0.0.12",
        "routes": [{"summary": {}, "legs": [], "progress": progress, "sections": [*sections, whole]}],
    }


def graphhopper(links, mark=(), heights=None):
    points = line(links, heights or [0.0] * (len(links) + 1))
    names = ["ferry" if k in mark else "road" for k in range(len(links))]
    details = {
        "time": [[k, k + 1, 1000.0 * seconds] for k, (_, seconds) in enumerate(links)],
        "road_environment": [[k, k + 1, name] for k, name in enumerate(names)],
    }
    coordinates = [[lon, lat, height] for lat, lon, height in points]
    length = sum(length for length, _ in links)
    return {"paths": [{"points": {"coordinates": coordinates}, "distance": length, "details": details}]}


SERVICES = {"google": google, "here": here, "tomtom": tomtom, "graphhopper": graphhopper}

ROADS = st.lists(
    st.tuples(st.integers(300, 3000), st.integers(30, 120)).filter(
        lambda link: 4.0 < link[0] / link[1] < 35.0
    ),
    min_size=1,
    max_size=6,
)


def energy_wh(route):
    return MODEL.forecast(route.plan(), tw.Departure()).energy_wh


def read(answer):
    return parse_route(json.dumps(answer).encode())


@settings(max_examples=12, deadline=None)
@given(ROADS)
def test_a_road_has_one_energy_in_the_answer_of_every_service(links):
    plain = read([{"length_m": length, "travel_time_s": seconds} for length, seconds in links])
    for name, answer in SERVICES.items():
        route = read(answer(links))
        assert route.duration_s == pytest.approx(plain.duration_s), name
        assert route.distance_m == pytest.approx(plain.distance_m, rel=1e-3), name
        flat = [route, plain]
        if route.elevation_m is not None:
            flat[1] = read(
                [{"length_m": length, "travel_time_s": seconds, "grade": 0.0} for length, seconds in links]
            )
        assert energy_wh(flat[0]) == pytest.approx(energy_wh(flat[1]), rel=0.01), name


def test_a_climb_has_one_energy_in_the_answers_that_have_heights():
    links, heights = [(2000, 100), (1500, 60), (1000, 70)], [500.0, 560.0, 550.0, 590.0]
    rows = zip(links, heights[:-1], heights[1:], strict=True)
    names = "length_m", "travel_time_s", "start_elevation_m", "end_elevation_m"
    plain = read([dict(zip(names, (*link, *ends), strict=True)) for link, *ends in rows])
    for answer in (here(links, heights=heights), graphhopper(links, heights=heights)):
        assert energy_wh(read(answer)) == pytest.approx(energy_wh(plain), rel=0.01)
    assert read(here(links, heights=heights, kind=6)).elevation_m is None  # not heights


@pytest.mark.parametrize("name", SERVICES)
def test_a_ferry_is_not_driven(name):
    links = [(2000, 100), (20_000, 3600), (1000, 70)]
    route = read(SERVICES[name](links, mark=(1,)))
    assert (route.distance_m, route.elapsed_s) == pytest.approx((3000.0, 3770.0), rel=1e-3)
    (pause,) = route.pauses
    assert (pause.duration_s, pause.carried_m) == pytest.approx((3600.0, 20_000.0), rel=1e-3)


@pytest.mark.parametrize("answer", [here([(900, 60), (900, 60)], (1,), mode="carShuttleTrain"),
                                    tomtom([(900, 60), (900, 60)], (1,), mode="CAR_TRAIN")])  # fmt: skip
def test_a_train_carries_the_car(answer):
    assert (read(answer).distance_m, len(read(answer).pauses)) == (900.0, 1)


@pytest.mark.parametrize(("car", "truck"), [
    (here([(900, 60)]), here([(900, 60)], (0,), mode="truck")),
    (tomtom([(900, 60)]), tomtom([(900, 60)], travel="truck")),
])  # fmt: skip
def test_times_of_a_truck_are_named(car, truck):
    flag = Flag("times_of_truck", "route")
    assert (flag in read(car).flags, flag in read(truck).flags) == (False, True)


def test_google_gives_the_traffic_of_a_leg():
    answer = google([(900, 60), (900, 30)])
    answer["routes"][0]["legs"][0]["duration"] = "180s"
    assert read(answer).travel_time_s.tolist() == [120.0, 60.0]
    del answer["routes"][0]["legs"][0]["steps"][1]["distanceMeters"]  # Google leaves out a length of 0
    assert read(answer).distance_m == 900.0


@pytest.mark.parametrize(
    ("answer", "lacks", "request_for"),
    [
        ({"routes": [{"distanceMeters": 9, "duration": "9s"}]}, "legs", "X-Goog-FieldMask"),
        ({"routes": [{"legs": [{"distanceMeters": 9, "duration": "9s"}]}]}, "steps", "routes.legs.steps"),
        ({"routes": [{"sections": [{"transport": {"mode": "car"}}]}]}, "spans", "spans=length,duration"),
        ({"formatVersion": "0", "routes": [{"legs": [], "sections": []}]}, "progress", "=travelTime"),
    ],
)
def test_what_an_answer_lacks_is_named_with_the_request_for_it(answer, lacks, request_for):
    (fault,) = faults_of(read, answer)
    router = recognise_router(answer)
    assert fault.what == "incomplete answer of a router"
    assert f"({router})" in fault.where
    assert fault.where.endswith(lacks)
    assert request_for in fault.fix


@pytest.mark.parametrize("seconds", [None, "s", "-5s", "soon", [], "nans"])
def test_a_duration_of_google_is_a_number_of_seconds(seconds):
    answer = google([(900, 60)])
    answer["routes"][0]["legs"][0]["steps"][0]["staticDuration"] = seconds
    (fault,) = faults_of(read, answer)
    assert (fault.what, fault.where.rpartition(", ")[2]) == ("not a number", "staticDuration")


def test_progress_of_tomtom_never_decreases():
    answer = tomtom([(900, 60), (900, 60)])
    answer["routes"][0]["progress"][1]["distanceInMeters"] = 1900.0
    assert faults_of(read, answer)[0].what == "not a number"


@given(st.lists(st.tuples(st.floats(-80, 80), st.floats(-170, 170), st.floats(-400, 8000)), min_size=2))
def test_a_flexible_polyline_has_the_points_that_were_encoded(points):
    found = decode_flexible_polyline(flexible(points), "t")
    np.testing.assert_allclose(found, points, atol=0.06)
    np.testing.assert_allclose(found[:, :2], np.array(points)[:, :2], atol=6e-6)
    flat = [point[:2] for point in points]
    assert decode_flexible_polyline(flexible(flat, kind=0), "t").shape == (len(points), 2)


@pytest.mark.parametrize(
    "text", ["", "B", "BF", "CFoz5xJ67i1B", "BFoz5xJ67i1", "BFoz5xJ", "é", "BF~~~~", "_" * 40]
)
def test_other_texts_are_no_flexible_polyline(text):
    with pytest.raises(tw.InvalidInput, match="not an encoded polyline"):
        decode_flexible_polyline(text, "t")


def test_here_without_a_line_has_no_heights():
    answer = here([(900, 60)], heights=[500.0, 510.0])
    assert read(answer).elevation_m is not None
    del answer["routes"][0]["sections"][0]["polyline"]
    assert (read(answer).distance_m, read(answer).flags[0].code) == (900.0, "no_elevation")


def test_an_answer_without_a_route_is_refused():
    for router in ("google", "here", "tomtom"):
        assert faults_of(ROUTERS[router], {"routes": []}, "t")[0].what == "too few entries"
    assert recognise_router({"notices": [{"code": "noRouteFound"}], "routes": []}) == "here"
