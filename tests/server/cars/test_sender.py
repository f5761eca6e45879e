"""The clock of a sender: jumps are held until they are confirmed, two senders are told apart, nothing is lost silently."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest
from benchmarks.clocks import FAULTS, replayed
from hypothesis import given
from hypothesis import strategies as st
from tests.server.cars.messages import NOON_S, measured
from tests.support.drives import example_trip

from tripwatt.server.cars import sender
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.live_trip import SILENCE_S
from tripwatt.server.cars.sender import FUTURE_S, LATE_S, MAX_WAITING, RECENT, OrderedSamples, Sender
from tripwatt.server.cars.telemetry import Sample

HOUR_S = 3600.0


def driven(car: Car, seconds: range, shift_s: float = 0.0, **more: float) -> list[str]:
    """A message a second, whose stamps are by a clock that is ahead by so much."""
    values = {"speed_m_s": 15.0, **more}
    return [car.record(Sample(NOON_S + k + shift_s, values), now_s=NOON_S + k + 0.5) for k in seconds]


@pytest.mark.parametrize("fault", FAULTS)
def test_every_message_that_was_acknowledged_is_in_its_trip(fault: str) -> None:
    """The gate's sample of `python -m benchmarks.clocks`."""
    tables = [measured(example_trip(3)).iloc[:900]]
    done = replayed(tables, fault, seed=1)
    assert (done.lost, done.split, done.joined, done.disordered) == (0, 0, 0, 0)
    assert done.sent > 700
    if fault.startswith("milliseconds"):
        assert done.answers["refused"] == done.told > 250
    else:
        assert done.told == (len(tables) if fault.startswith("one stamp") else 0)
        assert done.in_trips == done.sent - done.told


@pytest.mark.parametrize("error_s", [-HOUR_S, HOUR_S])
def test_our_clock_may_be_wrong(folder: Path, error_s: float) -> None:
    with Car.follow(folder) as car:
        assert {car.record(Sample(NOON_S + k), now_s=NOON_S + k + error_s) for k in range(60)} == {"new"}


@pytest.mark.parametrize("step_s", [HOUR_S, -HOUR_S, 20 * 365.0 * 86_400.0])
def test_a_clock_that_is_set_moves_the_trip_so_far(folder: Path, step_s: float) -> None:
    with Car.follow(folder) as car:
        driven(car, range(100))
        answers = driven(car, range(100, 200), step_s)
        assert answers[:5] == ["held"] * 5
        assert answers[5:] == ["new"] * 95
        assert car.shown(NOON_S)["held"] == 0
        assert car.trip is not None
        assert car.trip.start_s == NOON_S + step_s
        assert car.observed()["time_s"].tolist() == pytest.approx(list(range(200)), abs=0.01)
        assert car.counts == {"new": 200, "doubled": 0, "late": 0, "faulty": 0}
    with Car.follow(folder) as again:
        assert len(again.observed()) == 200, "a restart goes on with the same clock"
        assert driven(again, range(200, 230), step_s) == ["new"] * 30


def test_the_charge_of_the_departure_goes_with_the_clock(folder: Path) -> None:
    with Car.follow(folder) as car:
        car.record(Sample(NOON_S - 1.0, {"speed_m_s": 0.0, "displayed_soc": 0.6}), now_s=NOON_S - 0.5)
        driven(car, range(100))
        driven(car, range(100, 110), HOUR_S)
        assert car.trip is not None
        assert car.trip.start_s > NOON_S + HOUR_S - 60.0
        about = car.shown(NOON_S)
        assert (about["soc"], about["soc_source"], car.departure().soc) == (0.6, "soc", 0.6)


def test_the_forecasts_on_the_way_go_with_the_trip(folder: Path) -> None:
    made = {"energy_wh": 2000.0, "quantiles_wh": {"0.05": 1800.0, "0.95": 2200.0}}
    with Car.follow(folder) as car:
        driven(car, range(100))
        assert car.keep_forecast(made)  # type: ignore[arg-type]
        driven(car, range(100, 200), HOUR_S)
        assert [one.energy_wh for one in car.forecasts] == [2000.0]
        assert car.end_when_silent(NOON_S + 200.0 + SILENCE_S)
        (log,) = car.logs()
        assert [one.energy_wh for one in car.forecasts_of(log.trip_id)] == [2000.0]
        assert car.file.departures(math.inf) == [NOON_S + HOUR_S]


@pytest.mark.parametrize("stray_s", [86_400.0, FUTURE_S + 1.0, -HOUR_S])
def test_one_stray_stamp_does_not_count_and_costs_no_other(folder: Path, stray_s: float) -> None:
    with Car.follow(folder) as car:
        driven(car, range(100))
        assert (
            car.record(Sample(NOON_S + 100.0 + stray_s, {"speed_m_s": 15.0}), now_s=NOON_S + 100.5) == "held"
        )
        assert car.document(NOON_S + 101.0)["held"] == 1
        assert set(driven(car, range(101, 160))) == {"new"}
        assert (car.counts, car.shown(0.0)["held"]) == ({"new": 159, "doubled": 0, "late": 1, "faulty": 0}, 0)


def test_a_stamp_that_was_held_outlives_a_restart(folder: Path) -> None:
    with Car.follow(folder) as car:
        driven(car, range(100))
        assert driven(car, range(100, 103), HOUR_S) == ["held"] * 3
    with Car.follow(folder) as car:
        assert (car.shown(0.0)["held"], set(car.counts.values())) == (3, {0})
        assert set(driven(car, range(103, 130), HOUR_S)[3:]) == {"new"}
        assert len(car.observed()) == 130


def test_a_repeated_message_of_the_trip_is_doubled_however_old(folder: Path) -> None:
    with Car.follow(folder) as car:
        driven(car, range(300))
        assert driven(car, range(40)) == ["doubled"] * 40
        assert len(car.observed()) == 300


@pytest.mark.parametrize("ahead_s", [HOUR_S, -HOUR_S])
def test_two_senders_with_two_clocks_are_told(folder: Path, ahead_s: float) -> None:
    with Car.follow(folder) as car:
        driven(car, range(100))
        assert car.document(NOON_S + 100.0)["faults"] == []
        for k in range(100, 160):
            driven(car, range(k, k + 1))
            car.record(Sample(NOON_S + k + 0.3 + ahead_s, {"speed_m_s": 0.0}), now_s=NOON_S + k + 0.8)
        faults = car.document(NOON_S + 160.0)["faults"]
        assert [fault["what"] for fault in faults] == ["two senders"]
        assert car.document(NOON_S + 160.0 + SILENCE_S)["faults"] == []
        assert len(car.observed()) == 160, "the other one is not mixed in"


@pytest.mark.parametrize("other", [{"speed_m_s": 0.0}, {"speed_m_s": 15.0, "displayed_soc": 0.4}])
@pytest.mark.parametrize("every", [1, 8])
def test_two_cars_by_one_clock_are_told_by_what_they_send(
    folder: Path, other: dict[str, float], every: int
) -> None:
    with Car.follow(folder) as car:
        for k in range(120):
            driven(car, range(k, k + 1), displayed_soc=0.8)
            if k % every == 0:
                car.record(Sample(NOON_S + k + 0.3, other), now_s=NOON_S + k + 0.8)
        assert [fault["what"] for fault in car.document(NOON_S + 120.0)["faults"]] == ["two senders"]


def test_one_car_is_one_sender(folder: Path) -> None:
    """A real drive with its noise, and a spike of the speed now and then."""
    draw, table = random.Random(1), measured(example_trip())
    with Car.follow(folder) as car:
        for k, speed in enumerate(table["speed_m_s"]):
            speed = 40.0 if draw.random() < 0.01 else speed
            car.record(Sample(NOON_S + k, {"speed_m_s": float(speed)}), now_s=NOON_S + k + draw.random())
            assert car.mixed(NOON_S + k) == []


def test_a_backlog_goes_into_its_gap_and_a_double_does_not(folder: Path) -> None:
    with Car.follow(folder) as car:
        driven(car, range(100))
        driven(car, range(400, 500))
        late = [Sample(NOON_S + k, {"speed_m_s": 15.0, "displayed_soc": 0.5}) for k in range(100, 400)]
        for k, sample in enumerate(late):
            assert car.record(sample, now_s=NOON_S + 500.0 + 0.1 * k) in ("held", "new")
            if k % 10 == 9:
                driven(car, range(500 + k // 10, 501 + k // 10))
        driven(car, range(530, 540))
        assert car.observed()["time_s"].tolist() == pytest.approx(list(range(540)))
        assert car.trip is not None
        assert car.trip.distance_m == pytest.approx(15.0 * car.trip.last_s - 15.0 * NOON_S)
        assert car.counts == {"new": 540, "doubled": 0, "late": 0, "faulty": 0}


def test_the_clock_of_the_machine_may_be_set(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = sender.steady_clock()
    before_s, real = now_s(), sender.time.time
    monkeypatch.setattr(sender.time, "time", lambda: real() + HOUR_S)
    assert 0.0 <= now_s() - before_s < 60.0


def test_a_clock_is_known_from_messages_at_the_pace_of_their_stamps() -> None:
    burst, live = Sender(), Sender()
    for k in range(3 * RECENT):
        burst.accept(Sample(NOON_S + k, received_s=NOON_S + 1e6 + 0.01 * k))
        live.accept(Sample(NOON_S + k, received_s=NOON_S + 1e6 + k))
    assert (burst.offset_s, live.offset_s) == (None, 1e6)


def test_a_time_far_ahead_counts_before_the_clock_is_known(folder: Path) -> None:
    with Car.follow(folder) as car:
        assert car.record(Sample(NOON_S + 1e5), now_s=NOON_S) == "new"


def test_what_a_standing_car_sent_outlives_the_messages_that_are_erased(folder: Path) -> None:
    """The charge that is sent once, and every second of the standstill that belongs to the next trip."""
    with Car.follow(folder) as car:
        car.record(Sample(NOON_S - 1.0, {"displayed_soc": 0.69}), now_s=NOON_S - 0.5)
        for k in range(2000):
            car.record(Sample(NOON_S + k, {"speed_m_s": 0.0}), now_s=NOON_S + k + 0.5)
        needed = (*car._finder.before, *car._ordered.waiting, *car._sender.held)
        before = [sample.time_s for sample in needed]
        assert len(car.file.messages()) < 1500
    with Car.follow(folder) as car:
        assert [s.time_s for s in (*car._finder.before, *car._ordered.waiting)][-len(before) :] == before
        driven(car, range(2000, 2100))
        assert car.departure().soc == 0.69
        assert car.shown(0.0)["soc"] == 0.69
        assert len(car.observed()) > 250


def test_what_is_kept_after_a_trip_has_its_first_sample(folder: Path) -> None:
    with Car.follow(folder) as car:
        driven(car, range(100))
        for k in range(100, 500):
            car.record(Sample(NOON_S + k, {"speed_m_s": 0.0}), now_s=NOON_S + k + 0.5)
        assert len(car.logs()) == 1
        first = car.file.messages()[0].time_s
    with Car.follow(folder) as car:
        assert car._finder.before[0].time_s == first, "the bound of what was given on is before it"


def test_two_slow_senders_do_not_move_the_trip_to_and_fro(folder: Path) -> None:
    with Car.follow(folder) as car:
        for k in range(0, 600, 10):
            driven(car, range(k, k + 1))
            if k >= 100:
                driven(car, range(k + 5, k + 6), HOUR_S)
            assert car.trip is None or car.trip.start_s == NOON_S
        assert [fault["what"] for fault in car.document(NOON_S + 600.0)["faults"]] == ["two senders"]


def test_a_stamp_that_was_held_outlives_the_messages_that_are_erased(folder: Path) -> None:
    with Car.follow(folder) as car:
        for k in range(400):
            car.record(Sample(NOON_S + k, {"speed_m_s": 0.0}), now_s=NOON_S + k + 0.5)
        assert driven(car, range(400, 402), HOUR_S) == ["held"] * 2
        car._messages = 2000  # many that do not count
        car._store_ended_trips()
        assert len(car.file.messages()) < 300
    with Car.follow(folder) as car:
        assert car.shown(0.0)["held"] == 2


def test_one_sender_is_trusted_again_after_the_other_has_gone(folder: Path) -> None:
    with Car.follow(folder) as car:
        for k in range(100):
            driven(car, range(k, k + 1))
            car.record(Sample(NOON_S + k + 0.3, {"speed_m_s": 0.0}), now_s=NOON_S + k + 0.8)
        driven(car, range(100, 250))
        mixed_s = car._sender.mixed_s
        car.record(Sample(NOON_S + 250.0, {"speed_m_s": 40.0}), now_s=NOON_S + 250.5)
        assert car._sender.mixed_s == mixed_s < NOON_S + 110.0


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
    assert [sample.time_s - T0 for sample in ordered.release()] == [
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
    out += [sample.time_s - T0 for sample in ordered.release()]
    assert out == sorted(set(out))
    assert out == sorted({float(t) for t, arrival in zip(times, arrivals, strict=True) if arrival == "new"})


@given(st.permutations(range(25)))
def test_swaps_within_the_window_lose_nothing(times: list[int]) -> None:
    out, arrivals, ordered = fed([float(t) for t in times])
    assert set(arrivals) == {"new"}
    assert out + [s.time_s - T0 for s in ordered.release()] == [float(t) for t in range(25)]


def test_a_stray_stamp_is_let_go_for_the_next_that_does_not_follow_it(folder: Path) -> None:
    with Car.follow(folder) as car:
        driven(car, range(100))
        strays = [
            driven(car, range(k, k + 1), ahead_s) for k, ahead_s in ((100, 2e5), (101, 4e5), (102, 6e5))
        ]
        assert strays == [["held"]] * 3
        assert (car.shown(NOON_S)["held"], car.counts["late"] + car.counts["new"]) == (1, 102)
