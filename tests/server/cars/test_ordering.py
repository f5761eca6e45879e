"""Late, doubled and swapped samples come out once each, by time, from a window that is bounded."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripwatt.server.cars import Sample
from tripwatt.server.cars.sender import LATE_S, MAX_WAITING, OrderedSamples

T0 = 1_700_000_000.0


def fed(
    times: list[float], ordered: OrderedSamples | None = None
) -> tuple[list[float], list[str], OrderedSamples]:
    ordered = ordered or OrderedSamples()
    out, arrivals = [], []
    for time_s in times:
        sample = Sample(T0 + time_s)
        arrivals.append(ordered.arrival(sample))
        if arrivals[-1] == "new":
            ordered.insert(sample)
        out += [given.time_s - T0 for given in ordered.release_ready()]
    return out, arrivals, ordered


def test_a_sample_is_given_on_when_none_can_come_before_it() -> None:
    out, arrivals, ordered = fed([0.0, 10.0, 5.0, LATE_S, LATE_S + 4.5, LATE_S + 5.0])
    assert out == [0.0, 5.0]
    assert set(arrivals) == {"new"}
    assert [sample.time_s - T0 for sample in ordered.release_all()] == [
        10.0,
        LATE_S,
        LATE_S + 4.5,
        LATE_S + 5.0,
    ]
    assert ordered.waiting == []


def test_doubles_and_late_samples_do_not_count() -> None:
    _, arrivals, _ = fed([0.0, 0.0, 100.0, 70.0, 69.9, 100.0, 70.0, 0.0])
    assert arrivals == ["new", "doubled", "new", "new", "late", "doubled", "doubled", "late"]


def test_what_was_given_on_before_is_late() -> None:
    _, arrivals, ordered = fed([-1.0, 0.0, 1.0], OrderedSamples(T0))
    assert arrivals == ["late", "doubled", "new"]
    assert (ordered.newest_s, OrderedSamples().newest_s) == (T0 + 1.0, -math.inf)


@pytest.mark.parametrize(("extra", "given_on"), [(0, 0), (1, 1), (7, 7)])
def test_the_window_is_bounded(extra: int, given_on: int) -> None:
    out, _, ordered = fed([k * 1e-3 for k in range(MAX_WAITING + extra)])
    assert len(out) == given_on
    assert len(ordered.waiting) == MAX_WAITING


def test_a_stamp_far_ahead_makes_none_late() -> None:
    out, arrivals, _ = fed([0.0, 1.0, 1e6, 2.0, 3.0])
    assert (out, set(arrivals)) == ([0.0, 1.0, 2.0, 3.0], {"new"})


@given(st.lists(st.integers(0, 200), max_size=60))
def test_any_order_gives_each_time_once_and_rising(times: list[int]) -> None:
    out, arrivals, ordered = fed([float(t) for t in times])
    out += [sample.time_s - T0 for sample in ordered.release_all()]
    assert out == sorted(set(out))
    assert out == sorted({float(t) for t, arrival in zip(times, arrivals, strict=True) if arrival == "new"})


@given(st.permutations(range(25)))
def test_swaps_within_the_window_lose_nothing(times: list[int]) -> None:
    out, arrivals, ordered = fed([float(t) for t in times])
    assert set(arrivals) == {"new"}
    assert out + [s.time_s - T0 for s in ordered.release_all()] == [float(t) for t in range(25)]
