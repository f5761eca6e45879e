"""Laws between two forecasts of one car, through the public door: what has to change, what has to stay, and in which direction.

A sample of the library, and every car where TRIPWATT_EVERY_CAR is set.
"""

import dataclasses
import datetime as dt
import json
from functools import cache

import numpy as np
import pandas as pd
import pytest
from tests.support.cars import some_cars

import tripwatt as tw
from tripwatt.forecasting.leaving import soc_needed

SOC = 0.85
KNOWN = tw.Departure(
    soc=SOC,
    ambient_temperature_degc=18.0,
    battery_temperature_degc=18.0,
    cabin_temperature_degc=18.0,
    cabin_setpoint_degc=21.0,
    warmth=0.0,
)
LINKS = (
    {"length_m": 900.0, "speed_m_s": 8.0, "stop_s": 20.0, "grade": 0.0},
    {"length_m": 8000.0, "speed_m_s": 26.0, "grade": 0.012},
    {"length_m": 6000.0, "speed_m_s": 20.0, "grade": -0.02},
    {"length_m": 3000.0, "speed_m_s": 14.0, "grade": 0.004},
)
LEVELS = (0.02, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.98)
MIN_CHANGE = 1e-9
MIN_LOSS = {"permanent_magnet": 1.0, "induction": 0.97, "externally_excited": 0.97}
"""Losses of a drivetrain on hills over those on the level, by its machine. One whose flux is chosen loses about as much as its torque, and so
no more on a hill than where the same work is done evenly; of a machine with magnets a hill takes more."""

FALLING = ("audi_q4_e_tron_40",)
NEAR_NO_TORQUE = pytest.mark.xfail(
    strict=True, reason="losses of a machine with magnets jump near no torque: 100 kg take 0.8 Wh less"
)
every_car = pytest.mark.parametrize("car", some_cars())


@cache
def model_of(car: str) -> tw.ForecastModel:
    return tw.for_car(car=car)


def known(**more) -> tw.Departure:
    return dataclasses.replace(KNOWN, **more)


def asked(car: str, links=LINKS, departure: tw.Departure = KNOWN) -> tw.Forecast:
    return model_of(car).forecast(tw.read_route(list(links)), departure)


def at(degc: float) -> tw.Departure:
    return known(**{f"{what}_temperature_degc": degc for what in ("ambient", "battery", "cabin")})


def level(*links: tuple[float, float]) -> list[dict[str, float]]:
    return [{"length_m": metres, "speed_m_s": speed, "grade": 0.0} for metres, speed in links]


def northwards(*, back: bool = False, height_m: float = 0.0) -> bytes:
    """A level road of 20 km along a meridian."""
    degrees = np.linspace(48.0, 48.18, 60)
    line = [[11.0, round(float(latitude), 6), height_m] for latitude in (degrees[::-1] if back else degrees)]
    return json.dumps({"type": "LineString", "coordinates": line}).encode()


def on_track(car: str, track: bytes, departure: tw.Departure) -> tw.Forecast:
    return model_of(car).forecast(tw.read_route(track, speed_m_s=22.0), departure)


def same(one: tw.Forecast, other: tw.Forecast, rel: float = 1e-9) -> None:
    for name in ("energy_wh", "sd_wh", "soc_arrival"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=rel), name
    assert other.by_cause_wh == pytest.approx(one.by_cause_wh, abs=rel * one.energy_wh)


# --- within one forecast


@every_car
def test_quantiles_are_in_order_and_intervals_are_nested(car: str) -> None:
    for departure in (KNOWN, at(-15.0), at(35.0), tw.Departure()):
        found = asked(car, departure=departure)
        assert np.all(np.diff([found.quantile(p) for p in LEVELS]) > 0.0)
        assert np.all(np.diff([found.arrival.quantile(p) for p in LEVELS]) >= 0.0)
        lows, highs = zip(*(found.interval(share) for share in (0.5, 0.8, 0.9, 0.95)), strict=True)
        assert list(lows) == sorted(lows, reverse=True)
        assert list(highs) == sorted(highs)
        assert lows[0] < found.quantile(0.5) < highs[0]


@every_car
def test_energy_is_the_sum_of_its_causes(car: str) -> None:
    for departure in (KNOWN, at(-15.0), at(35.0), known(payload_mass_kg=300.0)):
        found = asked(car, departure=departure)
        size = sum(map(abs, found.by_cause_wh.values()))
        assert abs(sum(found.by_cause_wh.values()) - found.energy_wh) < 1e-9 * size
        assert found.along.energy_wh[-1] == pytest.approx(found.energy_wh, rel=1e-9)


# --- more of something costs more


@pytest.mark.parametrize(
    "car", [pytest.param(car, marks=NEAR_NO_TORQUE if car in FALLING else ()) for car in some_cars()]
)
def test_a_load_costs_energy_and_chance(car: str) -> None:
    loads = [asked(car, departure=known(payload_mass_kg=mass)) for mass in (0.0, 100.0, 300.0)]
    assert np.all(np.diff([found.energy_wh for found in loads]) > 0.0)
    assert np.all(np.diff([soc_needed(found, 0.1) for found in loads]) > 0.0)
    assert np.all(np.diff([found.p_arrive(0.1) for found in loads]) <= MIN_CHANGE)


@every_car
def test_cold_costs_energy(car: str) -> None:
    colder = [asked(car, departure=at(degc)).energy_wh for degc in (18.0, 10.0, 0.0, -10.0, -20.0)]
    assert np.all(np.diff(colder) > 0.0)


@every_car
def test_a_longer_road_costs_energy(car: str) -> None:
    further = [asked(car, level((metres, 20.0))).energy_wh for metres in (2e3, 5e3, 1.5e4, 4e4)]
    assert np.all(np.diff(further) > 0.0)


@every_car
def test_a_motorway_costs_more_the_faster_it_is_driven(car: str) -> None:
    faster = [asked(car, level((20_000.0, speed))).energy_wh for speed in (22.0, 25.0, 28.0, 31.0)]
    assert np.all(np.diff(faster) > 0.0)


@every_car
def test_wind_costs_from_ahead_and_gives_from_behind(car: str) -> None:
    ahead, calm, behind = (
        on_track(car, northwards(), known(wind_speed_m_s=speed, wind_from_deg=origin)).energy_wh
        for speed, origin in ((8.0, 0.0), (0.0, 0.0), (8.0, 180.0))
    )
    assert ahead > calm > behind > 0.0
    # the other way, what was ahead is behind
    back = on_track(car, northwards(back=True), known(wind_speed_m_s=8.0, wind_from_deg=0.0)).energy_wh
    assert back == pytest.approx(behind, rel=1e-3)
    # a wind from ahead costs more than one from behind gives: drag grows with the square
    assert ahead - calm > calm - behind


@every_car
def test_thin_air_costs_less(car: str) -> None:
    heights = [on_track(car, northwards(height_m=height), KNOWN).energy_wh for height in (0.0, 800.0, 2000.0)]
    assert np.all(np.diff(heights) < 0.0)
    pressures = [
        asked(car, departure=known(pressure_pa=hpa * 100.0)).energy_wh for hpa in (1030.0, 950.0, 800.0)
    ]
    assert np.all(np.diff(pressures) < 0.0)


# --- the same in other words


def split(links) -> list[dict[str, float]]:
    """Each link as two of half the length, which are driven as fast; its stop is at the end of the second."""
    halves = []
    for link in links:
        stop_s = link.get("stop_s", 0.0)
        moving_s = 0.5 * (link["length_m"] / link["speed_m_s"] - stop_s)
        half = {"length_m": 0.5 * link["length_m"], "grade": link["grade"]}
        for part_s in (0.0, stop_s):
            speed = half["length_m"] / (moving_s + part_s)
            halves.append({**half, "speed_m_s": speed, "stop_s": part_s})
    return halves


@every_car
def test_links_that_are_split_are_the_same_road(car: str) -> None:
    whole = asked(car, [{"stop_s": 0.0, **link} for link in LINKS])
    for parts in (split(LINKS), split(split(LINKS))):
        same(whole, asked(car, parts), rel=3e-3)
    # where stops are not known, links of 1 km and of 2 km of one road have as many
    same(asked(car, level(*[(2000.0, 26.0)] * 5)), asked(car, level(*[(1000.0, 26.0)] * 10)))


@every_car
def test_a_road_in_other_units_is_the_same_road(car: str) -> None:
    def response(unit: str, metres: float) -> bytes:
        steps = [
            {"distance": 6000.0 / metres, "duration": 300.0},
            {"distance": 9000.0 / metres, "duration": 400.0},
        ]
        line = [[11.0, 48.0], [11.0, 48.135]]
        route = {"segments": [{"steps": steps}], "summary": {}, "way_points": [0, 1]}
        return json.dumps(
            {
                "type": "FeatureCollection",
                "metadata": {"query": {"units": unit}},
                "features": [{"properties": route, "geometry": {"type": "LineString", "coordinates": line}}],
            }
        ).encode()

    in_m, in_km, in_miles = (
        model_of(car).forecast(tw.read_route(response(*unit)), KNOWN)
        for unit in (("m", 1.0), ("km", 1000.0), ("mi", 1609.344))
    )
    same(in_m, in_km)
    same(in_m, in_miles)
    frame = pd.DataFrame(LINKS)
    same(asked(car), model_of(car).forecast(tw.read_route(frame), KNOWN))
    height_m, slopes = 24.0, []  # the lowest point of a road of grades is at 0 m
    for link in LINKS:
        end_m = height_m + link["grade"] * link["length_m"]
        plain = {key: value for key, value in link.items() if key != "grade"}
        slopes.append({**plain, "start_elevation_m": height_m, "end_elevation_m": end_m})
        height_m = end_m
    same(asked(car), asked(car, slopes))


@every_car
def test_the_clock_does_not_count(car: str) -> None:
    time_s = np.arange(0.0, 900.0)
    speed = 14.0 - 14.0 * np.cos(time_s * 2.0 * np.pi / 150.0)
    drive = pd.DataFrame({"time_s": time_s, "speed_m_s": speed, "elevation_m": 300.0})
    first, later = (
        model_of(car).forecast(tw.read_route(drive.assign(time_s=time_s + start_s)), KNOWN)
        for start_s in (0.0, 43_210.0)
    )
    same(first, later)
    morning, night = (
        asked(car, departure=known(departs_at=dt.datetime(2024, 5, 1, hour))) for hour in (8, 23)
    )
    same(morning, night)


@every_car
def test_an_update_with_nothing_new_changes_nothing(car: str) -> None:
    before = asked(car)
    at_start = pd.DataFrame({"time_s": [0.0, 1.0], "displayed_soc": [SOC, SOC]})
    after = before.update(at_start)
    assert after.energy_wh == pytest.approx(before.energy_wh, rel=1e-9)
    assert 0.99 * before.sd_wh < after.sd_wh <= before.sd_wh
    on_the_way = pd.DataFrame(
        {
            "time_s": [0.0, 200.0, 400.0],
            "speed_m_s": [0.0, 26.0, 26.0],
            "displayed_soc": [SOC, SOC - 0.01, SOC - 0.03],
        }
    )
    once = before.update(on_the_way)
    assert once.sd_wh != before.sd_wh
    same(once, once.update(on_the_way))


@every_car
def test_a_plan_and_its_way_back(car: str) -> None:
    there = [{k: v for k, v in link.items() if k != "stop_s"} for link in LINKS]
    back = [{**link, "grade": -link["grade"]} for link in reversed(there)]
    out, home = asked(car, there), asked(car, back)
    climb = out.by_cause_wh["climb"]
    assert climb == pytest.approx(-home.by_cause_wh["climb"], rel=0.02, abs=1.0)
    # what a climb takes comes back, less what drivetrain and brakes lose of it; the air is thinner above
    flat = [asked(car, [{**link, "grade": 0.0} for link in links]) for links in (there, back)]
    for lost, least in (
        ("drivetrain", MIN_LOSS[model_of(car).vehicle.drivetrain.machine]),
        ("friction_brakes", 1.0),
    ):
        assert sum(f.by_cause_wh[lost] for f in (out, home)) > least * sum(f.by_cause_wh[lost] for f in flat)
    assert sum(f.by_cause_wh["air"] for f in (out, home)) < sum(f.by_cause_wh["air"] for f in flat)
    # a level road costs the same from either end
    there_level, back_level = level((4000.0, 25.0), (4000.0, 12.0)), level((4000.0, 12.0), (4000.0, 25.0))
    assert asked(car, there_level).energy_wh == pytest.approx(asked(car, back_level).energy_wh, rel=0.03)
