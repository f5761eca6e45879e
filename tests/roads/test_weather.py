"""The weather along a road."""

import datetime as dt
from dataclasses import replace

import httpx
import numpy as np
import pytest
from tests.support.refusals import refuses
from tests.support.roads import client, mutated

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.physics import DriveConditions, simulate, simulate_trip
from tripwatt.physics.road_load import WET_ROAD
from tripwatt.roads import weather as weather_module
from tripwatt.roads.routers import Edges, Road, join_edges
from tripwatt.roads.weather import (
    WIND_AT_CAR,
    Weather,
    WeatherServer,
    forecast_sd,
    plan_with_weather,
    weather_along,
)
from tripwatt.routes.places import Place
from tripwatt.trips import Departure, Plan, table_of
from tripwatt.vehicles import load_vehicle

NOON = dt.datetime(2030, 1, 1, 12, 0, tzinfo=dt.UTC)


CAR = load_vehicle("bmw_i3_60ah")


def road(latitude, longitude, length_m=10_000.0, speed_m_s=25.0):
    n = len(latitude) - 1
    links, kinds = join_edges(
        Edges.from_speeds(np.full(n, length_m / n), np.full(n, length_m / n / speed_m_s), np.full(n, np.nan))
    )
    return Road(links, kinds, np.array(latitude), np.array(longitude), np.linspace(0.0, length_m, n + 1))


NORTH, EAST = road([47.0, 47.09], [9.0, 9.0]), road([0.0, 0.0], [9.0, 9.09])


THERE_AND_BACK = road([47.0, 47.045, 47.0], [9.0, 9.0, 9.0])


def headwind(way, *weather, at=(0.0,)):
    return plan_with_weather(way.plan(), way, np.array(at), weather).weather.headwind_m_s


@pytest.mark.parametrize(
    ("way", "origin", "share"),
    [
        (NORTH, 0.0, 1.0),
        (NORTH, 180.0, -1.0),
        (NORTH, 90.0, 0.0),
        (EAST, 90.0, 1.0),
        (EAST, 270.0, -1.0),
        (NORTH, 60.0, 0.5),
    ],
)
def test_wind_counts_by_its_angle_to_the_road(way, origin, share):
    assert pytest.approx(0.5) == WIND_AT_CAR  # ln(1 / 0.1) / ln(10 / 0.1)
    found = headwind(way, Weather(10.0, wind_speed_m_s=8.0, wind_from_deg=origin))
    assert found == pytest.approx(np.full(len(found), 4.0 * share), abs=1e-6)


def test_wind_turns_with_the_road():
    found = headwind(THERE_AND_BACK, Weather(10.0, wind_speed_m_s=8.0, wind_from_deg=0.0))
    assert found[10] == pytest.approx(4.0)
    assert found[-10] == pytest.approx(-4.0)


def test_wind_between_two_points_is_that_of_both_as_a_vector():
    weather = (Weather(10.0, 8.0, 0.0), Weather(10.0, 8.0, 180.0))
    found = headwind(NORTH, *weather, at=(0.0, 10_000.0))
    assert found[0] == pytest.approx(4.0, abs=0.05)
    assert found[len(found) // 2] == pytest.approx(0.0, abs=0.15)
    assert found[-1] == pytest.approx(-4.0, abs=0.05)


def test_temperature_counts_where_the_departure_has_none():
    weather = (
        Weather(2.0, rain_mm_h=1.0, pressure_pa=90_000.0),
        Weather(6.0, rain_mm_h=3.0, pressure_pa=92_000.0),
    )
    plan = plan_with_weather(NORTH.plan(), NORTH, np.array([0.0, 10_000.0]), weather)
    assert plan.departure.ambient_temperature_degc == 4.0
    assert plan.weather.rain_mm_h == 2.0
    assert plan.weather.air_density_kg_m3 == pytest.approx(91_000.0 / (287.05287 * 277.15))
    own = NORTH.plan().with_departure(Departure(ambient_temperature_degc=-10.0))
    plan = plan_with_weather(own, NORTH, np.array([0.0, 10_000.0]), weather)
    assert plan.departure.ambient_temperature_degc == -10.0
    assert plan.weather.air_density_kg_m3 == pytest.approx(91_000.0 / (287.05287 * 263.15))
    unknown = plan_with_weather(NORTH.plan(), NORTH, np.array([0.0, 1.0]), (Weather(2.0), Weather(None)))
    assert unknown.departure.ambient_temperature_degc is None
    partly = (weather[0], Weather(6.0))
    assert (
        plan_with_weather(NORTH.plan(), NORTH, np.array([0.0, 1.0]), partly).weather.air_density_kg_m3 is None
    )


def test_calm_and_dry_changes_nothing():
    plan = NORTH.plan()
    still = plan_with_weather(plan, NORTH, np.array([0.0]), (Weather(),))
    assert simulate_trip(CAR, still).simulated_energy_wh == pytest.approx(
        simulate_trip(CAR, plan).simulated_energy_wh
    )


def test_air_drag_against_the_wind_is_that_of_the_sum_of_both_speeds():
    time, speed = np.arange(100.0), np.full(100, 20.0)
    conditions = DriveConditions(climate="off", air_density_kg_m3=1.2)
    area = CAR.road_load.drag_area_m2
    for wind in (0.0, 5.0, -5.0, -30.0):
        run = simulate(CAR, time, speed, headwind_m_s=np.full(100, wind), conditions=conditions)
        against = 20.0 + wind
        assert run.aero_drag_force_n[50] == pytest.approx(0.6 * area * against * abs(against))


def test_rain_raises_rolling_resistance():
    time, speed = np.arange(100.0), np.full(100, 20.0)
    dry, wet = (
        simulate(CAR, time, speed, conditions=DriveConditions(climate="off", rain_mm_h=rain))
        for rain in (0.0, 5.0)
    )
    assert wet.rolling_resistance_force_n[50] == pytest.approx(
        (1.0 + WET_ROAD) * dry.rolling_resistance_force_n[50]
    )


@pytest.mark.parametrize(
    "wind", [np.full(99, 1.0), np.full(100, np.nan), np.full(100, 61.0), np.full(100, -61.0)]
)
def test_impossible_wind_is_refused(wind):
    refuses("headwind_m_s", simulate, CAR, np.arange(100.0), np.full(100, 20.0), headwind_m_s=wind)


def test_every_value_out_of_bounds_is_named():
    with pytest.raises(InvalidInput) as caught:
        Weather(99.0, -1.0, 361.0, 300.0, 1.0)
    assert [fault.where for fault in caught.value.faults] == [
        "ambient_temperature_degc",
        "wind_speed_m_s",
        "wind_from_deg",
        "rain_mm_h",
        "pressure_pa",
    ]


def answers(request):
    number = len(request.url.params["latitude"].split(","))
    tables = [
        {
            "hourly": {
                "time": ["2030-01-01T12:00", "2030-01-01T13:00"],
                "temperature_2m": [1.0 + k, 2.0 + k],
                "precipitation": [0.0, 0.5],
                "surface_pressure": [950.0, 951.0],
                "wind_speed_10m": [3.0, 4.0],
                "wind_direction_10m": [360.0, 90.0],
            }
        }
        for k in range(number)
    ]
    return tables if number > 1 else tables[0]


def server(seen):
    return WeatherServer(client(lambda r: seen.append(r) or httpx.Response(200, json=answers(r))))


def test_each_place_is_asked_for_its_own_hour_and_once():
    seen = []
    source = server(seen)
    places = (Place(47.0, 9.0), Place(47.5, 9.0))
    first, second = source.at(places, (NOON, NOON + dt.timedelta(minutes=31)))
    assert (first.temperature_degc, first.wind_from_deg, first.pressure_pa) == (1.0, 0.0, 95_000.0)
    assert (second.temperature_degc, second.wind_speed_m_s, second.rain_mm_h) == (3.0, 4.0, 0.5)
    assert first.hours_ahead > 1000.0
    query = seen[0].url.params
    assert (query["latitude"], query["longitude"]) == ("47.00,47.50", "9.00,9.00")
    assert (query["start_hour"], query["end_hour"]) == ("2030-01-01T12:00", "2030-01-01T13:00")
    assert query["wind_speed_unit"] == "ms"
    source.at(places, (NOON, NOON + dt.timedelta(minutes=40)))
    assert len(seen) == 1
    source.at(places, (NOON, NOON))
    assert len(seen) == 2


def test_the_weather_is_asked_along_the_road_when_the_car_comes_by():
    asked = []

    class Source:
        def at(self, places, when):
            asked.extend(zip(places, when, strict=True))
            return tuple(Weather(1.0) for _ in places)

    long = road([47.0, 47.9], [9.0, 9.0], length_m=100_000.0)
    position, weather = weather_along(long, Source(), NOON)
    assert position == pytest.approx([100_000 / 6, 50_000.0, 500_000 / 6])
    assert len(weather) == 3
    assert asked[1][0].latitude_deg == pytest.approx(47.45)
    assert (asked[1][1] - NOON).total_seconds() == pytest.approx(2000.0)
    paused = replace(long, stop_position_m=(60_000.0,)).with_pause(7200.0)
    weather_along(paused, Source(), NOON)
    later = [
        (after[1] - before[1]).total_seconds() for before, after in zip(asked[:3], asked[3:], strict=True)
    ]
    assert later == pytest.approx([0.0, 0.0, 7200.0])


@pytest.mark.parametrize(
    "answer",
    [{"error": True, "reason": "Out of range"}, [], {}, {"hourly": {"time": ["2030-01-01T11:00"]}}, [{}, {}]],
)
def test_weather_of_another_hour_or_place_is_an_error_of_the_server(answer):
    with pytest.raises(RemoteError):
        WeatherServer(client(answer)).at((Place(47.0, 9.0),), (NOON,))


def test_a_mutated_answer_is_weather_or_one_clear_error():
    table = answers(httpx.Request("GET", "http://h", params={"latitude": "1"}))
    outcomes = set()
    for answer in mutated(table, 150, seed=4):
        try:
            outcomes.add(
                isinstance(WeatherServer(client(answer)).at((Place(47.0, 9.0),), (NOON,))[0], Weather)
            )
        except RemoteError as error:
            outcomes.add(str(error)[:0])
    assert outcomes == {True, ""}


def test_the_url_is_checked():
    refuses("not the URL of a server: --weather", WeatherServer.from_url, "open-meteo")
    assert WeatherServer.from_url("https://h/").client.base_url == "https://h"


def test_the_standard_deviation_grows_with_each_day_ahead():
    for hours, sd in ((-5.0, 1.0), (0.0, 1.0), (0.6, 1.01), (24.0, 1.4)):
        assert forecast_sd([Weather(hours_ahead=hours)]) == pytest.approx((sd, sd))
    assert forecast_sd([Weather(hours_ahead=h) for h in (-5.0, 24.0)]) == pytest.approx((1.2, 1.2))


@pytest.mark.parametrize(
    ("minutes", "hour"), [(-31, "11:00"), (-30, "12:00"), (0, "12:00"), (29.99, "12:00"), (30, "13:00")]
)
def test_the_nearest_hour_is_asked(minutes, hour):
    seen = []
    source = server(seen)
    moment = NOON + dt.timedelta(minutes=minutes, seconds=0.5)
    if hour == "11:00":
        with pytest.raises(RemoteError, match=r"no weather for this hour: .* got 2030-01-01T11:00"):
            source.at((Place(47.0, 9.0),), (moment,))
    else:
        source.at((Place(47.0, 9.0),), (moment,))
    assert seen[0].url.params["start_hour"] == f"2030-01-01T{hour}"


def test_the_whole_question_for_the_weather():
    seen = []
    server(seen).at((Place(47.024, -9.026),), (NOON.astimezone(dt.timezone(dt.timedelta(hours=5))),))
    assert seen[0].url.path == "/base/v1/forecast"
    assert dict(seen[0].url.params) == {
        "latitude": "47.00",
        "longitude": "-9.05",
        "hourly": "temperature_2m,precipitation,surface_pressure,wind_speed_10m,wind_direction_10m",
        "wind_speed_unit": "ms",
        "timezone": "UTC",
        "start_hour": "2030-01-01T12:00",
        "end_hour": "2030-01-01T12:00",
    }


def test_places_of_one_cell_are_asked_once():
    """Cells are a twentieth of a degree wide."""
    seen = []
    server(seen).at((Place(47.0, 9.0), Place(47.02, 9.02), Place(47.03, 9.0), Place(47.0, 9.0)), (NOON,) * 4)
    assert seen[0].url.params["latitude"] == "47.00,47.05"
    assert seen[0].url.params["longitude"] == "9.00,9.00"


def test_an_answer_is_kept_for_an_hour(monkeypatch):
    now, seen = [5000.0], []
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    source = server(seen)
    for at, questions in ((5000.0, 1), (5001.0, 1), (8600.0, 1), (8600.5, 2), (12200.5, 2), (12201.0, 3)):
        now[0] = at
        source.at((Place(47.0, 9.0),), (NOON,))
        assert len(seen) == questions


def test_so_many_answers_are_kept(monkeypatch):
    """A third place makes room for itself; what is asked with it is asked again."""
    monkeypatch.setattr(weather_module, "MAX_CACHED", 2)
    first, second, third = Place(47.0, 9.0), Place(47.1, 9.0), Place(47.2, 9.0)
    seen = []
    source = server(seen)
    for place in (first, second):
        source.at((place,), (NOON,))
    source.at((second, first), (NOON, NOON))
    assert len(seen) == 2
    found = source.at((first, third), (NOON, NOON))
    assert [w.temperature_degc for w in found] == [1.0, 2.0]
    assert seen[2].url.params["latitude"] == "47.00,47.20"
    source.at((third, first), (NOON, NOON))
    assert len(seen) == 3
    source.at((second,), (NOON,))
    assert len(seen) == 4


def hours(**changed):
    hourly = answers(httpx.Request("GET", "http://h", params={"latitude": "1"}))["hourly"]
    return WeatherServer(client({"hourly": {**hourly, **changed}}))


def test_a_column_reaches_to_its_hour():
    one_pm = (NOON + dt.timedelta(hours=1),)
    place = (Place(47.0, 9.0),)
    assert hours(temperature_2m=[1.0]).at(place, (NOON,))[0].temperature_degc == 1.0
    with pytest.raises(RemoteError, match="temperature_2m: got 1; allowed: at least 2"):
        hours(temperature_2m=[1.0]).at(place, one_pm)
    found = hours(wind_direction_10m=[0.0, 725.0]).at(place, one_pm)[0]
    assert (found.wind_from_deg, found.wind_speed_m_s, found.pressure_pa) == (5.0, 4.0, 95_100.0)
    with pytest.raises(RemoteError, match="too few entries"):
        hours(time=[]).at(place, (NOON,))


@pytest.mark.parametrize(
    ("changed", "unknown"),
    [
        ({"temperature_2m": [None]}, ("ambient_temperature_degc",)),
        ({"surface_pressure": None}, ("pressure_pa",)),
        ({"wind_speed_10m": [None], "wind_direction_10m": [None]}, ("wind_speed_m_s",)),
        ({"wind_direction_10m": [None]}, ("wind_speed_m_s",)),
        ({"wind_direction_10m": [None], "wind_speed_10m": [0.0]}, ()),
        ({"precipitation": [None]}, ("rain_mm_h",)),
    ],
)
def test_a_null_is_unknown_and_named(changed, unknown):
    (found,) = hours(**changed).at((Place(47.0, 9.0),), (NOON,))
    assert found.unknown == unknown
    plan = plan_with_weather(NORTH.plan(), NORTH, np.array([0.0]), (found,))
    assert [flag.subject for flag in plan.flags if flag.code == "weather_unknown"] == list(unknown)
    if "wind_speed_m_s" in unknown:
        assert not plan.weather.headwind_m_s.any()


def test_units_and_the_zone_of_the_answer_count():
    hourly = answers(httpx.Request("GET", "http://h", params={"latitude": "1"}))["hourly"]
    hourly |= {"time": ["2030-01-01T14:00"], "wind_speed_10m": [28.8], "temperature_2m": [41.0]}
    units = {"temperature_2m": "°F", "wind_speed_10m": "km/h", "precipitation": "feet"}
    units |= {"surface_pressure": "hPa", "wind_direction_10m": "°"}
    table = {"hourly": hourly, "hourly_units": units, "utc_offset_seconds": 7200}
    (found,) = WeatherServer(client(table)).at((Place(47.0, 9.0),), (NOON,))
    assert (found.temperature_degc, found.wind_speed_m_s) == pytest.approx((5.0, 8.0))
    assert found.unknown == ("rain_mm_h",)


def test_an_hour_that_has_passed_is_known_as_of_now():
    past = dt.datetime(2020, 1, 1, 12, 0, tzinfo=dt.UTC)
    (found,) = hours(time=["2020-01-01T12:00"]).at((Place(47.0, 9.0),), (past,))
    assert found.hours_ahead == 0.0
    left = lambda: (NOON - dt.datetime.now(dt.UTC)).total_seconds() / 3600.0  # noqa: E731
    before = left()
    (ahead,) = hours().at((Place(47.0, 9.0),), (NOON + dt.timedelta(seconds=7.5),))
    assert left() <= ahead.hours_ahead <= before


@pytest.mark.parametrize(
    ("kilometres", "number"), [(0.1, 1), (44.9, 1), (45.1, 2), (75.1, 3), (599.0, 20), (900.0, 20)]
)
def test_the_weather_is_asked_every_thirty_kilometres_at_twenty_points_at_most(kilometres, number):
    class Source:
        def at(self, places, when):
            return tuple(Weather(1.0) for _ in places)

    length_m = 1000.0 * kilometres
    position, weather = weather_along(road([47.0, 47.9], [9.0, 9.0], length_m=length_m), Source(), NOON)
    assert len(weather) == number
    assert position == pytest.approx([(k + 0.5) / number * length_m for k in range(number)])


def made(speed, start_s=0.0):
    time = start_s + np.arange(float(len(speed)))
    return Plan.from_trace("t", table_of({"time_s": time, "speed_m_s": np.array(speed)}))


def wind_of(plan):
    weather = (Weather(1.0, 8.0, 0.0), Weather(1.0, 0.0, 0.0))
    return plan_with_weather(plan, NORTH, np.array([0.0, 10_000.0]), weather).weather.headwind_m_s


def test_a_plan_is_laid_along_the_whole_road():
    """The wind falls from 4 m/s at the car to nothing; samples count by the way up to them, of 10, 20 and 30 m."""
    assert wind_of(made([7.0, 10.0, 10.0, 10.0], 50.0)) == pytest.approx([4.0, 8.0 / 3.0, 4.0 / 3.0, 0.0])
    assert wind_of(made([0.0, 0.25, 0.25])) == pytest.approx([4.0, 2.0, 0.0])
    assert wind_of(made([0.0, 0.0, 0.0])) == pytest.approx([4.0, 4.0, 4.0])
