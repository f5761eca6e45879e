"""Draw the drivers, the days with their weather, and the trips of each day, before any trip is driven."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.routes.driver import DriverStyle

N_DRIVERS: Final = 6
"""Number of people who share the car: a choice, as every other number of the synthetic world."""
DAYS_PER_SEASON: Final = 90
"""Number of summer or winter days of a year."""

# purposes of random streams; the key of a stream is made of the seed, a purpose, the day and the trip
DRIVERS, DAYS, TRIPS, ROADS, WHEEL, WORLD, AIR, NOISE, SENSORS = range(9)


def stream(seed: int, purpose: int, *index: int) -> np.random.Generator:
    """Return a random generator for one purpose, independent of those for all others."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(purpose, *index)))


@dataclass(frozen=True, slots=True)
class Driver:
    """One of the people who share the car.

    Attributes
    ----------
    name : str
    style : DriverStyle
        Style of driving, which is visible in the speed.
    setpoint_degc : float
        Preferred cabin temperature in winter [°C].
    power_share : float
        Hidden: extra propelling power, as a share of what the same speed needs, e.g. by a restless pedal.
    """

    name: str
    style: DriverStyle
    setpoint_degc: float
    power_share: float


@dataclass(frozen=True, slots=True)
class Day:
    """Season, weather and wind that the trips of one day share.

    Attributes
    ----------
    date : date
    season : {"summer", "winter"}
    sky : {"sunny", "slightly cloudy", "cloudy", "rainy"}
    mean_temperature_degc, swing_k : float
        The day's mean outside temperature [°C] and the amplitude of its course [K], warmest at 15 h.
    wind_m_s, wind_from_rad : float
        Speed [m/s] and direction [rad] of the wind.
    """

    date: dt.date
    season: str
    sky: str
    mean_temperature_degc: float
    swing_k: float
    wind_m_s: float
    wind_from_rad: float

    def temperature_at(self, hour: float) -> float:
        """Return the outside temperature [°C] at an hour of the day."""
        return self.mean_temperature_degc + self.swing_k * math.cos((hour - 15.0) / 12.0 * math.pi)

    def dark_at(self, hour: float) -> bool:
        """Whether the sun is down at an hour of the day."""
        rise, fall = (5.0, 21.5) if self.season == "summer" else (7.75, 16.75)
        return not rise <= hour <= fall


@dataclass(frozen=True, slots=True)
class Scenario:
    """One trip before it is driven: driver, time, route and charge.

    Attributes
    ----------
    trip_id : str
    key : tuple of int
        Day and place in the day: the key of the trip's random streams.
    day : Day
    driver : Driver
    started_at : datetime
    route : {"city", "rural", "highway", "mixed"}
    duration_s : float
        Time that the trip should take [s].
    parked_s : float or None
        Time since the end of the day's last trip [s]; None for the first trip of a day.
    soc : float
        State of charge at departure.
    setpoint_degc, payload_mass_kg : float
    """

    trip_id: str
    key: tuple[int, int]
    day: Day
    driver: Driver
    started_at: dt.datetime
    route: str
    duration_s: float
    parked_s: float | None
    soc: float
    setpoint_degc: float
    payload_mass_kg: float

    @property
    def hour(self) -> float:
        """Hour of departure."""
        return self.started_at.hour + self.started_at.minute / 60.0

    @property
    def weather(self) -> str:
        """The weather as a driver would note it."""
        return "dark" if self.day.dark_at(self.hour) and self.day.sky != "rainy" else self.day.sky


EXPECTED_SPEED_M_S: Final = {"city": 6.5, "rural": 14.0, "highway": 23.0, "mixed": 13.0}
"""Mean speed [m/s] that a scenario assumes, standstill included."""

EXPECTED_USE: Final = 0.011
"""Share of the charge per kilometre that a scenario assumes: 200 Wh/km of about 19 kWh."""


def _draw_driver(seed: int, number: int) -> Driver:
    """Draw one driver, who is the same for every fleet of that seed."""
    rng = stream(seed, DRIVERS, number)
    vigour = float(np.clip(rng.normal(), -1.5, 1.5))
    style = DriverStyle(
        acceleration_m_s2=2.4 * math.exp(0.2 * vigour),
        deceleration_m_s2=2.0 * math.exp(0.15 * vigour),
        half_acceleration_speed_m_s=22.0 * math.exp(0.15 * vigour),
        speed_share=float(np.clip(0.95 + 0.02 * vigour, 0.9, 1.0)),
        fluctuation=float(rng.uniform(0.08, 0.16)),
        fluctuation_time_s=float(rng.uniform(8.0, 14.0)),
        dwell_mean_s=22.0,
    )
    setpoint = float(np.clip(np.round(2.0 * rng.normal(22.0, 1.0)) / 2.0, 20.0, 25.0))
    return Driver(f"driver {number + 1}", style, setpoint, float(rng.normal(0.05, 0.03)))


def _draw_day(seed: int, number: int) -> Day:
    """Draw one day; the two seasons alternate and dates do not repeat."""
    rng = stream(seed, DAYS, number)
    summer = number % 2 == 0
    season_day = number // 2
    # 37 and 90 have no common factor: every date of a season occurs once, spread out from the first day on
    into_season = (season_day * 37 + 5) % DAYS_PER_SEASON
    first = dt.date(2023 + season_day // DAYS_PER_SEASON, 6 if summer else 12, 1)
    skies = ["sunny", "slightly cloudy", "cloudy", "rainy"]
    sky = str(rng.choice(skies, p=[0.4, 0.25, 0.2, 0.15] if summer else [0.2, 0.25, 0.35, 0.2]))
    clear = {"sunny": 1.0, "slightly cloudy": 0.5}.get(sky, 0.0)
    mean = rng.normal(19.0, 3.5) + 3.0 * clear if summer else rng.normal(2.5, 4.0) - 1.5 * clear
    return Day(
        date=first + dt.timedelta(days=into_season),
        season="summer" if summer else "winter",
        sky=sky,
        mean_temperature_degc=float(mean),
        swing_k=float((5.0 if summer else 2.0) * (0.4 + 0.6 * clear)),
        wind_m_s=float(rng.gamma(2.0, 1.5)),
        wind_from_rad=float(rng.uniform(0.0, 2.0 * math.pi)),
    )


def long_drive(scenario: Scenario, seed: int, hours: tuple[float, float]) -> Scenario:
    """Change a scenario to a long drive on the motorway, as if it were the first trip of its day, with a uniformly drawn duration."""
    duration_s = 3600.0 * float(stream(seed, TRIPS, *scenario.key, 0).uniform(*hours))
    return replace(scenario, route="highway", duration_s=duration_s, parked_s=None, soc=0.9)


def draw_scenarios(n_trips: int, seed: int) -> Iterator[Scenario]:
    """Draw the trips, day by day, one to four per day. O(trips)."""
    drivers = [_draw_driver(seed, d) for d in range(N_DRIVERS)]
    n_drawn = day_number = 0
    while n_drawn < n_trips:
        day = _draw_day(seed, day_number)
        day_stream = stream(seed, TRIPS, day_number)
        hour_s = 3600.0 * float(day_stream.uniform(6.25, 17.0))
        driver = drivers[int(day_stream.integers(N_DRIVERS))]
        soc = float(day_stream.uniform(0.6, 0.88))
        parked_s: float | None = None
        for place_in_day in range(min(int(day_stream.integers(1, 5)), n_trips - n_drawn)):
            rng = stream(seed, TRIPS, day_number, place_in_day)
            route = str(rng.choice(["city", "rural", "highway", "mixed"], p=[0.25, 0.3, 0.15, 0.3]))
            longest_s = 1700.0 if route == "highway" else 2500.0
            duration_s = float(np.clip(1250.0 * math.exp(0.4 * rng.normal()), 820.0, longest_s))
            use = EXPECTED_USE * EXPECTED_SPEED_M_S[route] * duration_s / 1000.0
            if soc < 0.15 + 1.5 * use:
                soc = float(rng.uniform(0.75, 0.88))  # charged while parked
            payload = float(rng.choice([0.0, 70.0, 80.0, 150.0], p=[0.6, 0.2, 0.1, 0.1]))
            yield Scenario(
                trip_id=f"S{n_drawn + 1:03d}",
                key=(day_number, place_in_day),
                day=day,
                driver=driver,
                started_at=dt.datetime.combine(day.date, dt.time()) + dt.timedelta(seconds=round(hour_s)),
                route=route,
                duration_s=duration_s,
                parked_s=parked_s,
                soc=round(soc, 3),
                setpoint_degc=driver.setpoint_degc if day.season == "winter" else driver.setpoint_degc + 1.0,
                payload_mass_kg=payload,
            )
            n_drawn += 1
            soc -= use
            parked_s = float(rng.choice([120.0, 900.0, 5400.0]) * rng.uniform(0.7, 1.3))
            hour_s += 1.3 * duration_s + parked_s
            if hour_s > 21.0 * 3600.0:  # nobody departs after nine in the evening
                break
        day_number += 1
