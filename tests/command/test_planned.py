"""`tripwatt forecast` with planned routes, and `tripwatt export`, as a new user meets them."""

import json
from pathlib import Path
from urllib.parse import parse_qs

import numpy as np
import pytest
from tests.support import ROOT
from tests.support.command import Run

from tripwatt.export import EXPORTS, consumption_curve
from tripwatt.forecasting import load_model
from tripwatt.routes import parse_route, route_from_links
from tripwatt.trips import Departure, Plan
from tripwatt.vehicles import load_vehicle

RESPONSES = ROOT / "tests" / "routes" / "responses"


LINKS = [{"length_m": 600.0, "speed_m_s": 9.0, "grade": 0.01}, {"length_m": 4000.0, "travel_time_s": 200.0}]
TRACK = "<gpx><trk><trkseg>{}</trkseg></trk></gpx>"


def routes(folder: Path) -> dict[str, Path]:
    """One route of about 5 km in every format that says how fast it is."""
    point = '<trkpt lat="48.{:04d}" lon="11"><ele>{}</ele><time>2026-05-01T08:{:02d}:{:02d}Z</time></trkpt>'
    sparse = "".join(point.format(10 * k, 500 + k, k // 2, 30 * (k % 2)) for k in range(40))
    texts = {
        "links.json": json.dumps(LINKS),
        "object.json": json.dumps({"links": LINKS}),
        "links.csv": "length_m,speed_m_s,travel_time_s,grade\n600,9,,0.01\n4000,,200,\n",
        "links.txt": "length_m;speed_m_s\n600;9\n4000;20,0\n",
        "sparse.gpx": TRACK.format(sparse),
        "roads.geojson": json.dumps(
            {
                "type": "Feature",
                "properties": {"highway": "primary"},
                "geometry": {
                    "type": "LineString",
                    "coordinates": [[11.5, 48.1], [11.54, 48.1], [11.57, 48.1]],
                },
            }
        ),
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    return {name: folder / name for name in texts} | {"osrm.json": RESPONSES / "osrm.json"}


def test_every_format_is_a_trip(run: Run, tmp_path: Path) -> None:
    for name, path in routes(tmp_path).items():
        answer = run("forecast", path, "--soc", 0.7, "--ambient", 3, "--payload", 80, "--json")
        assert answer.code == 0, (name, answer.err)
        found = json.loads(answer.out)
        assert found["given"] == "a planned route", name
        assert found["trip"] == path.stem
        assert found["series"]["displayed_soc"][0] == pytest.approx(0.7)
        assert found["series"]["distance_m"][-1] == pytest.approx(
            parse_route(path).plan().distance_m, rel=0.01
        )
        assert 0.0 < found["energy_wh"] < 2000.0
    plain = run("forecast", tmp_path / "links.csv", "--soc", 0.7)
    assert "given a planned route" in plain.out
    assert "the driven speed trace" not in plain.out


def test_a_track_without_times_needs_a_speed(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "line.gpx"
    path.write_text(TRACK.format('<trkpt lat="48" lon="11"/><trkpt lat="48.1" lon="11"/>'))
    answer = run("forecast", path)
    assert answer.code == 2
    assert "--speed" in answer.err
    times = [
        json.loads(run("forecast", path, "--speed", v, "--json").out)["series"]["time_s"][-1]
        for v in (50, 100)
    ]
    assert times[0] == pytest.approx(2.0 * times[1], rel=0.02)
    answer = run("forecast", RESPONSES / "osrm.json", "--speed", 50)
    assert answer.code == 2
    assert "has no effect: --speed" in answer.err


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("r.csv", "length_m,speed_m_s\n500,-3\n-1,5\n", ["link 1, speed_m_s", "link 2, length_m"]),
        ("r.csv", "length_km,speed_km_h\n500,3\n", ["did you mean length_m", "did you mean speed_m_s"]),
        (
            "r.csv",
            "km,speed_kmh\n5,30\n",
            ["did you mean length_m", "did you mean speed_m_s", "travel_time_s"],
        ),
        ("r.csv", "length_m,speed_m_s\n500,119\n", ["at most 70 m/s; the unit appears to be km/h"]),
        ("r.csv", "time_s,speed_m_s\n0,0\n9,50\n18,119\n", ["0 to 90 m/s; the unit appears to be km/h"]),
        ("r.csv", "t,v\n0,0\n9,5\n18,9\n", ["a column 'time_s'", "a column 'speed_m_s'"]),
        (
            "r.json",
            '[{"length_m": 5}, {"speed_m_s": 5, "colour": 1}]',
            ["link 1", "missing key: link 2", "'colour'"],
        ),
        ("r.gpx", '<!DOCTYPE g [<!ENTITY a "b">]><gpx>&a;</gpx>', ["r.gpx"]),
        ("r.json", '{"code": "NoRoute"}', ["found no route"]),
    ],
)
def test_a_bad_route_is_one_message_with_the_options_faults(
    run: Run, tmp_path: Path, name: str, text: str, said: list[str]
) -> None:
    (tmp_path / name).write_text(text)
    answer = run("forecast", tmp_path / name, "--soc", 7, "--reserve", 3, "--observed", tmp_path / "none.csv")
    assert answer.code == 2
    for words in (*said, "--soc", "--reserve", "none.csv", "faults:"):
        assert words in answer.err
    assert answer.out == ""
    assert "Traceback" not in answer.err


def test_export_prints_the_curve_of_the_car(run: Run) -> None:
    service = "here"
    answer = run("export", service, "--car", "nissan_leaf_40", "--ambient", -5)
    assert answer.code == 0
    car = load_vehicle("nissan_leaf_40")
    expected = EXPORTS[service](consumption_curve(car, Departure(soc=0.8, ambient_temperature_degc=-5.0)))
    assert json.loads(answer.out) == expected
    assert "physics only" in answer.err
    query = run("export", service, "--car", "nissan_leaf_40", "--ambient", -5, "--query")
    assert {k: v[0] for k, v in parse_qs(query.out.strip()).items()} == expected


def test_export_of_a_model_is_what_the_model_forecasts(run: Run) -> None:
    """HERE's formula on a level link of constant speed gives the forecast of that drive."""
    said = json.loads(run("export", "here", "--ambient", 5, "--setpoint", 21, "--payload", 75).out)
    table = np.array(said["ev[freeFlowSpeedTable]"].split(","), dtype=float).reshape(-1, 2)
    seconds = 1200.0  # 20 km at 60 km/h
    model = load_model()
    drive = route_from_links(
        [{"length_m": 20_000.0, "travel_time_s": seconds, "moving_speed_m_s": 60 / 3.6}]
    ).plan()
    steady = Plan.from_trace("steady", drive.samples.assign(speed_m_s=60.0 / 3.6))
    departure = Departure(
        soc=0.8, ambient_temperature_degc=5.0, cabin_setpoint_degc=21.0, payload_mass_kg=75.0
    )
    forecast = model.forecast(steady, departure)
    exported = dict(table.tolist())[60.0] * 20_000.0 + float(said["ev[auxiliaryConsumption]"]) * seconds
    # the auxiliaries of HERE are the mean of half an hour, those of the forecast of its first 20 minutes
    assert exported == pytest.approx(forecast.energy_wh, rel=0.12)
    bare = json.loads(run("export", "here", "--car", "bmw_i3_60ah", "--ambient", 5, "--setpoint", 21).out)
    assert bare["ev[freeFlowSpeedTable]"] != said["ev[freeFlowSpeedTable]"]


def test_export_names_all_faults(run: Run, tmp_path: Path) -> None:
    answer = run(
        "export", "here", "--model", tmp_path / "none", "--ambient", 900, "--payload", -1, "--soc", 3
    )  # fmt: skip
    assert answer.code == 2
    for said in ("none", "--ambient", "--payload", "--soc"):
        assert said in answer.err
    answer = run("export", "mapbox", "--model", "x", "--car", "nissan_leaf_40")
    assert answer.code == 2
    assert "one of the two" in answer.err
    answer = run("export", "tomtoms", "--car", "nissan_leaf_40")
    assert answer.code == 2
    assert "tomtom" in answer.err
