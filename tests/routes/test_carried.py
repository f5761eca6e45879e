"""Ferries and trains take time and no energy, in the answer of every router."""

import json

import numpy as np
import pytest

import tripwatt as tw
from tripwatt.roads.routers.road import Road
from tripwatt.roads.routers.servers import SERVERS
from tripwatt.routes import LinkRoute, parse_route
from tripwatt.routes.carried import driven_positions, pauses_of
from tripwatt.routes.documents import Node
from tripwatt.routes.places import Place
from tripwatt.routes.responses import ROUTERS

ROAD_M, CROSSING_M, ROAD_S, CROSSING_S = 10_000.0, 49_000.0, 500.0, 7200.0
DEGREES = [60.0, 60.089932, 60.5306, 60.620532]
LINE = [[5.0, degrees, 0.0] for degrees in DEGREES]


def steps(time="duration", length="distance", factor=1.0, **ferry):
    road = {length: ROAD_M / 1000.0 if length == "length" else ROAD_M, time: factor * ROAD_S}
    crossing = {length: CROSSING_M / 1000.0 if length == "length" else CROSSING_M, time: factor * CROSSING_S}
    return [road, crossing | ferry, road]


def osrm(**ferry):
    duration = 2 * ROAD_S + CROSSING_S
    leg = {"distance": 2 * ROAD_M + CROSSING_M, "duration": duration, "steps": steps(**ferry)}
    line = {"coordinates": [point[:2] for point in LINE]}
    return {"code": "Ok", "routes": [{"legs": [leg], "geometry": line}]}


def annotated(**ferry):
    answer = osrm(**ferry)
    parts = [(4, ROAD_M, ROAD_S), (7, CROSSING_M, CROSSING_S), (3, ROAD_M, ROAD_S)]
    answer["routes"][0]["legs"][0]["annotation"] = {
        name: [whole[k] / n for n, *whole in parts for _ in range(n)]
        for k, name in enumerate(("distance", "duration"))
    }
    return answer


def valhalla(**ferry):
    return {"trip": {"legs": [{"maneuvers": steps("time", "length", **ferry)}], "units": "kilometers"}}


def openrouteservice(waytype):
    entries = [step | {"way_points": [k, k + 1]} for k, step in enumerate(steps())]
    extras = {"waytypes": {"values": [[0, 1, 1], [1, 2, waytype], [2, 3, 2]]}}
    properties = {"segments": [{"steps": entries}], "extras": extras}
    return {"features": [{"geometry": {"coordinates": LINE}, "properties": properties}]}


def graphhopper(environment):
    names = ("road", environment, "road")
    details = {
        "time": [[k, k + 1, 1000.0 * s] for k, s in enumerate((ROAD_S, CROSSING_S, ROAD_S))],
        "average_speed": [],
        "max_speed": [],
        "road_class": [],
        "road_environment": [[k, k + 1, name] for k, name in enumerate(names)],
    }
    distance = 2 * ROAD_M + CROSSING_M
    return {"paths": [{"points": {"coordinates": LINE}, "distance": distance, "details": details}]}


@pytest.mark.parametrize(
    ("router", "answer"),
    [
        ("osrm", osrm(mode="ferry")),
        ("osrm", annotated(mode="train")),
        ("valhalla", valhalla(type=28)),
        ("openrouteservice", openrouteservice(9)),
        ("graphhopper", graphhopper("ferry")),
    ],
)
def test_a_ferry_of_a_saved_answer_is_not_driven(router, answer):
    route = ROUTERS[router](answer, "answer")
    assert route.distance_m == pytest.approx(2 * ROAD_M, rel=1e-3)
    assert route.elapsed_s == pytest.approx(2 * ROAD_S + CROSSING_S)
    (pause,) = route.pauses
    assert pause.carried_m == pytest.approx(CROSSING_M, rel=1e-3)
    plan = route.plan()
    assert (plan.elapsed_s - plan.duration_s, plan.flags[-1].code) == (CROSSING_S, "carried")


@pytest.mark.parametrize(
    ("router", "answer", "key"),
    [
        ("osrm", annotated(mode="ferry"), "routes"),
        ("openrouteservice", openrouteservice(9), "features"),
        ("graphhopper", graphhopper("ferry"), "paths"),
    ],
)
def test_a_ferry_of_a_server_is_not_driven_and_stays_on_the_map(router, answer, key):
    leg = SERVERS[router][2](Node(answer[key][0], "answer"))
    road = Road.from_legs([leg], (Place(DEGREES[0], 5.0), Place(DEGREES[-1], 5.0)))
    assert (road.distance_m, road.duration_s) == pytest.approx(
        (2 * ROAD_M, 2 * ROAD_S + CROSSING_S), rel=1e-3
    )
    assert road.position_m == pytest.approx([0.0, ROAD_M, ROAD_M, 2 * ROAD_M], rel=1e-3)
    assert len(road.latitude_deg) == 4


def test_a_crossing_takes_time_and_no_energy():
    model, cold = tw.load_model(), tw.Departure(ambient_temperature_degc=-5.0)
    with_ferry = model.forecast(ROUTERS["osrm"](osrm(mode="ferry"), "answer").plan(), cold)
    road = LinkRoute(np.full(2, ROAD_M), np.full(2, ROAD_S), np.full(2, np.nan), np.full(2, np.nan))
    assert with_ferry.energy_wh == pytest.approx(model.forecast(road.plan(), cold).energy_wh, rel=1e-6)


@pytest.mark.parametrize(("seconds", "expected"), [(1.0, 1260.0), (1e6, 38_880.0), (7200.0, 7200.0)])
def test_an_impossible_time_of_a_crossing_is_bounded(seconds, expected):
    (pause,) = pauses_of(np.array([CROSSING_M]), np.array([seconds]), np.array([True]))
    assert pause.duration_s == pytest.approx(expected)


def test_a_road_without_ferries_keeps_its_positions():
    position = np.array([0.0, 70.0])
    assert driven_positions(position, np.array([100.0]), np.array([False])) is position


def test_a_route_of_a_ferry_alone_is_refused():
    answer = osrm(mode="ferry")
    answer["routes"][0]["legs"][0]["steps"] = steps(mode="ferry")[1:2]
    with pytest.raises(tw.InvalidInput, match="no route"):
        parse_route(json.dumps(answer).encode())
