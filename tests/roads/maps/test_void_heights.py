"""Heights that no road can have, from the file to the forecast: the energy is that of the sound road."""

import json

import numpy as np
import pandas as pd
import pytest

import tripwatt as tw
from tripwatt.physics import simulate_trip
from tripwatt.vehicles import load_vehicle

NORTH_DEG = 1.0 / 111_195.0
"""Of a metre."""


def road(every_s):
    """Time, latitude and height of 18 km at 65 km/h."""
    time = np.arange(0.0, 1000.1, every_s)
    way = 18.0 * time
    return time, 47.0 + NORTH_DEG * way, 400.0 + 10.0 * np.sin(way / 1800.0) + 0.004 * way


def gpx(time, latitude, height):
    rows = "".join(
        f'<trkpt lat="{p:.7f}" lon="9"><ele>{h}</ele><time>{pd.Timestamp("2026-03-14T08:00Z") + pd.Timedelta(t, "s"):%Y-%m-%dT%H:%M:%SZ}</time></trkpt>'
        for t, p, h in zip(time, latitude, height, strict=True)
    )
    return f"<gpx><trk><trkseg>{rows}</trkseg></trk></gpx>".encode()


def kml(time, latitude, height):
    rows = " ".join(f"9,{p:.7f},{h}" for p, h in zip(latitude, height, strict=True))
    return f"<kml><Placemark><LineString><coordinates>{rows}</coordinates></LineString></Placemark></kml>".encode()


def geojson(time, latitude, height):
    points = [[9.0, p, h] for p, h in zip(latitude.tolist(), height.tolist(), strict=True)]
    line = {"type": "LineString", "coordinates": points}
    return json.dumps({"type": "Feature", "properties": {"speed_m_s": 18.0}, "geometry": line}).encode()


def csv(time, latitude, height):
    speed = np.full(len(time), 18.0)
    return (
        pd.DataFrame({"time_s": time, "speed_m_s": speed, "elevation_m": height}).to_csv(index=False).encode()
    )


FORMS = {
    "gpx 1 s": (gpx, 1.0, None),
    "gpx 5 s": (gpx, 5.0, None),
    "gpx 20 s": (gpx, 20.0, None),
    "kml": (kml, 5.0, 18.0),
    "geojson": (geojson, 5.0, None),
    "csv 1 s": (csv, 1.0, None),
    "csv 0.1 s": (csv, 0.1, None),
}

FAULTS = {
    "before the fix": lambda t, h: np.where(t < 6.0, 0.0, h),
    "long before the fix": lambda t, h: np.where(t < 60.0, 0.0, h),
    "at the end": lambda t, h: np.where(t > 980.0, 0.0, h),
    "at the last point": lambda t, h: np.where(t == t[-1], 0.0, h),
    "in the middle": lambda t, h: np.where((t > 300.0) & (t < 360.0), 0.0, h),
    "two in the middle": lambda t, h: np.where((t % 400.0 > 300.0) & (t % 400.0 < 360.0), 0.0, h),
    "in a tunnel of 2 km": lambda t, h: np.where((t > 440.0) & (t < 555.0), 6000.0, h),
    "an offset at the end": lambda t, h: h + np.where(t > 800.0, 250.0, 0.0),
}


@pytest.fixture(scope="module")
def car():
    return load_vehicle("bmw_i3_60ah")


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_a_road(form, car, tmp_path):
    write, every_s, speed_m_s = FORMS[form]
    time, latitude, height = road(every_s)

    def read(heights, name):
        file = tmp_path / f"{name}.{form[:3] if form != 'geojson' else form}"
        file.write_bytes(write(time, latitude, heights))
        return tw.read_route(file, speed_m_s=speed_m_s) if speed_m_s else tw.read_route(file)

    sound = read(height, "sound")
    assert "elevation_interpolated" not in [flag.code for flag in sound.flags]
    expected = simulate_trip(car, sound).simulated_energy_wh
    for number, (name, fault) in enumerate(FAULTS.items()):
        plan = read(fault(time, height), f"fault{number}")
        assert simulate_trip(car, plan).simulated_energy_wh == pytest.approx(expected, rel=0.03), name
        assert [flag.code for flag in plan.flags].count("elevation_interpolated") == 1, name


def test_links_with_voids(car):
    links = [
        {"length_m": 100.0, "speed_m_s": 15.0, "start_elevation_m": h, "end_elevation_m": h + 1.0}
        for h in np.arange(400.0, 480.0)
    ]
    expected = simulate_trip(car, tw.read_route(links)).simulated_energy_wh
    for part in (slice(0, 4), slice(30, 50), slice(79, 80)):
        faulty = list(links)
        faulty[part] = [{**link, "start_elevation_m": 0.0, "end_elevation_m": 0.0} for link in links[part]]
        plan = tw.read_route(faulty)
        assert simulate_trip(car, plan).simulated_energy_wh == pytest.approx(expected, rel=0.03)
        assert [flag.code for flag in plan.flags] == ["elevation_interpolated"]


def test_the_forecast_says_so(tmp_path):
    time, latitude, height = road(1.0)
    model = tw.load_model()
    forecasts = []
    for name, fault in (("sound", lambda t, h: h), ("faulty", FAULTS["before the fix"])):
        file = tmp_path / f"{name}.gpx"
        file.write_bytes(gpx(time, latitude, fault(time, height)))
        forecasts.append(model.forecast(tw.read_route(file)))
    sound, faulty = forecasts
    assert faulty.energy_wh == pytest.approx(sound.energy_wh, rel=0.01)
    assert "elevation_interpolated" in [flag.code for flag in faulty.flags]
    assert "elevation_interpolated" not in [flag.code for flag in sound.flags]
