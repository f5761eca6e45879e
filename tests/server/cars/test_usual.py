"""Where a car usually goes: the earlier trip that began nearest by time of day."""

from __future__ import annotations

import datetime as dt

import pytest

from tripwatt.server.cars.plan import NEAR_S, usual_departure


def at(day: int, hour: int, minute: int = 0) -> float:
    """Local time in November 2023; the 6th is a Monday."""
    return dt.datetime(2023, 11, day, hour, minute).timestamp()


@pytest.mark.parametrize(
    ("earlier", "departure", "expected"),
    [
        ([], at(7, 8), None),
        ([at(6, 8)], at(7, 8, 20), at(6, 8)),
        ([at(6, 8), at(6, 17)], at(7, 16, 30), at(6, 17)),
        ([at(6, 6, 30)], at(7, 8), at(6, 6, 30)),
        ([at(6, 6, 29)], at(7, 8), None),
        ([at(6, 23, 30)], at(8, 0, 30), at(6, 23, 30)),
        ([at(6, 8), at(7, 8)], at(8, 8), at(7, 8)),
        ([at(4, 8), at(6, 9)], at(7, 8), at(6, 9)),
        ([at(6, 8), at(5, 9)], at(11, 8), at(5, 9)),
        ([at(4, 8)], at(7, 8), at(4, 8)),
    ],
    ids=[
        "none",
        "same hour",
        "nearest",
        "an hour and a half",
        "further away",
        "over midnight",
        "latest",
        "working day before weekend",
        "weekend before working day",
        "other kind of day",
    ],
)
def test_the_nearest_departure_by_time_of_day(
    earlier: list[float], departure: float, expected: float | None
) -> None:
    assert usual_departure(earlier, departure) == expected
    assert usual_departure(iter(reversed(earlier)), departure) == expected


def test_the_bound_is_an_hour_and_a_half() -> None:
    assert NEAR_S == 5400.0
