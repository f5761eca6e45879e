"""Values of a climate control from the logged power of heater and compressor, of one set of trips or of many sets in step."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, running_sum
from tripwatt.physics.cabin import CONTROL_STEP_S, CabinStart, CabinTask, control_steps, control_values
from tripwatt.physics.simulate import conditions_at_departure
from tripwatt.trips import Trip
from tripwatt.vehicles import Climate, Vehicle

INTERIOR_WIDTH: Final = 0.7
"""Prior standard deviation of the logarithm of the interior heat capacity: a factor of two of the mass that takes part."""
COOLER_WIDTH: Final = 0.4
"""Prior standard deviation of the logarithm of sensible cooling over electric power: published figures of 2.5 to 3.5 in total, of which drying
the air, hot surfaces and the cooling of the battery take power that does not follow from the set-point."""
IDLE_WIDTH_W: Final = 300.0
"""Prior standard deviation of the least power: hardly any, because no source has one."""
FARTHEST: Final = 3.0
"""Prior standard deviations beyond which a value comes from a dead or misnamed signal, and not from the car: the published one stays."""
LEAST_TRIPS: Final = 3
"""Fewest trips with a signal before it changes anything."""
LOG_TOLERANCE: Final = 1e-5
"""The logarithm of a value is searched as far as this."""

Search = Generator[tuple[Climate, Sequence["ClimateRecord"]], FloatArray, Any]
"""Asks for the power by minutes of trips with a climate control, and gives a result at its end."""


@dataclass(frozen=True, eq=False)
class ClimateRecord:
    """Logged power of heater and air conditioner by minutes, and what the cabin model needs to follow it.

    `speed_m_s` are those of the steps of the control. `ends` are the times in such steps from which to which samples have the lengths
    `lengths`: from minute to minute, and the last sample, whose interval is shorter. `samples` are those of each minute; `least_w` is
    the least power of the compressor, NaN where it hardly ran.
    """

    speed_m_s: FloatArray
    ambient_temperature_degc: float
    start: CabinStart
    ends: FloatArray
    lengths: FloatArray
    samples: IntArray
    power_w: FloatArray
    least_w: float

    @classmethod
    def from_trip(
        cls, trip: Trip, vehicle: Vehicle, climate_w: FloatArray, compressor_w: FloatArray
    ) -> ClimateRecord | None:
        """Of a trip at equal steps, the last of which may be shorter; None where it is too short, or the car has no climate control."""
        if vehicle.climate is None or len(trip) < 120:
            return None
        conditions, time = conditions_at_departure(vehicle, trip.departure), trip.array("time_s")
        ambient, start = conditions.ambient_temperature_degc, conditions.cabin_start(vehicle)
        task = CabinTask(vehicle.climate, time, trip.array("speed_m_s"), ambient, start)
        minute = ((time - time[0]) / 60.0).astype(np.int64)
        count = np.bincount(minute)
        last = np.concatenate(([0], np.cumsum(count[:-1]) - 1, [len(time) - 2, len(time) - 1]))
        lengths = np.append(np.full(len(count), time[1] - time[0]), time[-1] - time[-2]) / CONTROL_STEP_S
        # a running compressor draws more than 50 W, and its least power in a quarter of at least a minute; choices
        running = compressor_w[compressor_w > 50.0]
        return cls(
            task.mean_speeds(task.edges()),
            ambient,
            start,
            (time[last] - time[0]) / CONTROL_STEP_S,
            lengths,
            count,
            np.bincount(minute, climate_w) / count,
            float(np.quantile(running, 0.25)) if len(running) > 60.0 else float("nan"),
        )


def climate_values(
    several: Sequence[Sequence[ClimateRecord]], vehicle: Vehicle
) -> list[dict[str, float | tuple[float, ...]]]:
    """Interior heat capacity of the cabin, and in warm air the compressor's least power and power for the cooling, of each set.

    The searches go in step, so that their cabins are simulated side by side; each ends as it does alone.
    """
    searches = [_values(records, vehicle) for records in several]
    results: list[Any] = [None] * len(searches)
    asked: dict[int, Any] = {}
    answers: dict[int, Any] = dict.fromkeys(range(len(searches)))
    while answers:
        for number, answer in answers.items():
            try:
                asked[number] = searches[number].send(answer)
            except StopIteration as end:
                results[number] = end.value
                asked.pop(number, None)
        answers = dict(zip(asked, _by_minute(list(asked.values())), strict=True))
    return results


def _values(records: Sequence[ClimateRecord], vehicle: Vehicle) -> Search:
    climate = vehicle.climate
    if climate is None or len(records) < LEAST_TRIPS:
        return {}
    names = ["interior_heat_capacity_j_k"]
    climate = yield from _scaled(climate, names[0], INTERIOR_WIDTH, records)
    # from 15 °C on a compressor cools the cabin; a choice
    warm = [r for r in records if r.ambient_temperature_degc > 15.0]
    running = [r.least_w for r in warm if np.isfinite(r.least_w)]
    if len(running) >= LEAST_TRIPS:
        known, prior = len(running) / max(float(np.var(running, ddof=1)), 1.0), IDLE_WIDTH_W**-2
        published = climate.compressor_idle_w
        least = (known * float(np.median(running)) + prior * published) / (known + prior)
        if abs(least - published) <= FARTHEST * IDLE_WIDTH_W:
            climate = replace(climate, compressor_idle_w=least)
        climate = yield from _scaled(climate, "cooler_cop", COOLER_WIDTH, warm)
        names += ["compressor_idle_w", "cooler_cop"]
    return {f"climate.{name}": getattr(climate, name) for name in names}


def _scaled(climate: Climate, name: str, width: float, records: Sequence[ClimateRecord]) -> Search:
    """The climate control with one value times the factor that follows the logged power by minutes best.

    As it is where the best factor is `FARTHEST` widths away: such a log is not of this signal.
    """
    observed = np.concatenate([r.power_w for r in records])
    # minutes of a trip scatter together: a trip counts as four of them; a choice
    weights = np.concatenate([np.full(len(r.power_w), 4.0 / len(r.power_w)) for r in records])
    farthest = FARTHEST * width
    search = bounded_minimum(-farthest, farthest)
    log = next(search)
    while True:
        at = replace(climate, **{name: getattr(climate, name) * math.exp(log)})
        power = yield at, records
        # scatter of the power of one minute: settings of the driver, seats, sun; a choice
        error = (power - observed) / 600.0
        # the sun and the driver have tails
        cost = 0.5 * (log / width) ** 2 + float(weights @ (np.sqrt(1.0 + error * error) - 1.0))
        try:
            log = search.send(cost)
        except StopIteration as end:
            best = float(end.value)
            break
    if abs(best) >= 0.98 * farthest:
        return climate
    return replace(climate, **{name: getattr(climate, name) * math.exp(best)})


def _by_minute(requests: Sequence[tuple[Climate, Sequence[ClimateRecord]]]) -> list[FloatArray]:
    """Simulated power of heater and compressor by minutes [W], all trips of a request one after the other."""
    pairs = [(climate, record) for climate, records in requests for record in records]
    if not pairs:
        return []
    controls = [control_values(c, r.ambient_temperature_degc, r.start) for c, r in pairs]
    steps = control_steps(controls, [r.speed_m_s for _, r in pairs])
    powers = []
    for (_, record), (heat, *_) in zip(pairs, steps, strict=True):
        reached = np.interp(record.ends, np.arange(len(heat) + 1.0), running_sum(heat))
        sums = (reached[1:] - reached[:-1]) / record.lengths
        sums[0] += heat[0]  # the first sample has no interval
        sums[-2] += sums[-1]
        powers.append(sums[:-1] / record.samples)
    ends = np.cumsum([len(records) for _, records in requests])
    return [np.concatenate(powers[end - len(r) : end]) for end, (_, r) in zip(ends, requests, strict=True)]


def bounded_minimum(low: float, high: float) -> Generator[float, float, float]:
    """Search the minimum of a function between two bounds: yields where it is wanted, and takes its value there.

    Golden sections and parabolas after Brent, Algorithms for Minimization without Derivatives (1973), chapter 5, with the steps of
    `scipy.optimize.minimize_scalar`.

    Examples
    --------
    >>> search = bounded_minimum(0.0, 3.0)
    >>> x = next(search)
    >>> try:
    ...     while True:
    ...         x = search.send((x - 1.0) ** 2)
    ... except StopIteration as end:
    ...     round(end.value, 4)
    1.0
    """
    golden = 0.5 * (3.0 - math.sqrt(5.0))
    best = second = third = low + golden * (high - low)
    f_best = f_second = f_third = yield best
    step = before = 0.0
    while True:
        middle = 0.5 * (low + high)
        least = math.sqrt(2.2e-16) * abs(best) + LOG_TOLERANCE / 3.0
        if abs(best - middle) <= 2.0 * least - 0.5 * (high - low):
            return best
        r, q = (best - second) * (f_best - f_third), (best - third) * (f_best - f_second)
        p, q = (best - third) * q - (best - second) * r, 2.0 * (q - r)
        p, q = (-p if q > 0.0 else p), abs(q)
        last, parabola = before, abs(before) > least
        if parabola:
            before = step
            parabola = abs(p) < abs(0.5 * q * last) and q * (low - best) < p < q * (high - best)
        if parabola:
            step = p / q
            if best + step - low < 2.0 * least or high - best - step < 2.0 * least:
                step = math.copysign(least, middle - best)
        else:
            before = (low if best >= middle else high) - best
            step = golden * before
        x = best + math.copysign(max(abs(step), least), step)
        f = yield x
        if f <= f_best:
            low, high = (best, high) if x >= best else (low, best)
            third, f_third, second, f_second, best, f_best = second, f_second, best, f_best, x, f
        else:
            low, high = (x, high) if x < best else (low, x)
            if f <= f_second or second == best:
                third, f_third, second, f_second = second, f_second, x, f
            elif f <= f_third or third in (best, second):
                third, f_third = x, f
