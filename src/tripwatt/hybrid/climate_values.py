"""Identification of values of a climate control from the logged power of heater and compressor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, running_sum
from tripwatt.physics.cabin import CONTROL_STEP_S, CabinStart, CabinTask, control_steps, control_values
from tripwatt.physics.simulate import conditions_at_departure
from tripwatt.trips import Trip
from tripwatt.vehicles import Climate, Vehicle

INTERIOR_WIDTH: Final = 0.7
"""Prior standard deviation of the logarithm of the interior heat capacity: a factor of two of the mass that takes part."""
COOLER_WIDTH: Final = 0.4
"""Prior standard deviation of the logarithm of sensible cooling over electric power. Published totals are 2.5 to 3.5; a part of the power
goes to drying the air, hot surfaces and cooling the battery, which does not follow from the set-point."""
IDLE_WIDTH_W: Final = 300.0
"""Prior standard deviation of the compressor's least power [W]: wide, because no source gives this power."""
FARTHEST: Final = 3.0
"""Number of prior standard deviations beyond which a value is taken to come from a dead or misnamed signal; the published value is then
kept."""
MIN_TRIPS: Final = 3
"""Fewest trips with a signal before it changes anything."""


@dataclass(frozen=True, eq=False)
class ClimateRecord:
    """Logged power of heater and air conditioner by minutes, and the inputs of the cabin model for the same minutes.

    `speed_m_s` are the speeds at the steps of the control. `ends` are times in such steps: the ends of the minutes and of the last
    sample, whose interval may be shorter; `lengths` are the intervals of the samples between them. `samples` is the number of samples
    and `power_w` the mean power of each minute. `min_w` is the least power of the compressor, NaN if it hardly ran.
    """

    speed_m_s: FloatArray
    ambient_temperature_degc: float
    start: CabinStart
    ends: FloatArray
    lengths: FloatArray
    samples: IntArray
    power_w: FloatArray
    min_w: float

    @classmethod
    def from_trip(
        cls, trip: Trip, vehicle: Vehicle, climate_w: FloatArray, compressor_w: FloatArray
    ) -> ClimateRecord | None:
        """Make the record of a trip with equal time steps, of which the last may be shorter.

        Returns None if the trip is too short, or the car has no climate control.
        """
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
            task.mean_speeds(),
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
    """Interior heat capacity of the cabin and, from trips in warm air, the compressor's least power and cooling efficiency.

    Returns the values that each of several choices of trips shows. The searches go on side by side, because a simulation of many cabins
    takes little longer than one of a few.
    """
    if vehicle.climate is None:
        return [{} for _ in several]
    climates = _scaled(
        [vehicle.climate] * len(several), "interior_heat_capacity_j_k", INTERIOR_WIDTH, several
    )
    # from 15 °C on a compressor cools the cabin; a choice
    warm = [[r for r in records if r.ambient_temperature_degc > 15.0] for records in several]
    running = [[r.min_w for r in records if np.isfinite(r.min_w)] for records in warm]
    cooled = [k for k, powers in enumerate(running) if len(powers) >= MIN_TRIPS]
    at_least = [_with_least_power(climates[k], running[k]) for k in cooled]
    found = _scaled(at_least, "cooler_cop", COOLER_WIDTH, [warm[k] for k in cooled])
    names = ("interior_heat_capacity_j_k", "compressor_idle_w", "cooler_cop")
    shown = dict(zip(cooled, found, strict=True))
    return [
        {f"climate.{n}": getattr(shown.get(k, climate), n) for n in (names if k in shown else names[:1])}
        for k, climate in enumerate(climates)
    ]


def _with_least_power(climate: Climate, running: Sequence[float]) -> Climate:
    known, prior = len(running) / max(float(np.var(running, ddof=1)), 1.0), IDLE_WIDTH_W**-2
    published = climate.compressor_idle_w
    least = (known * float(np.median(running)) + prior * published) / (known + prior)
    is_near = abs(least - published) <= FARTHEST * IDLE_WIDTH_W
    return replace(climate, compressor_idle_w=least) if is_near else climate


def _scaled(
    climates: Sequence[Climate], name: str, width: float, several: Sequence[Sequence[ClimateRecord]]
) -> list[Climate]:
    """Scale one value of each climate control by the factor that fits the logged power by minutes of its trips best.

    A climate control is unchanged if the best factor is `FARTHEST` widths away: such a log does not have this signal.
    """
    observed = [np.concatenate([r.power_w for r in records]) for records in several]
    # minutes of a trip scatter together: a trip counts as four of them; a choice
    weights = [
        np.concatenate([np.full(len(r.power_w), 4.0 / len(r.power_w)) for r in records])
        for records in several
    ]
    farthest = FARTHEST * width
    costs: list[dict[float, float]] = [{} for _ in several]
    places = [_least(known, farthest) for known in costs]

    def at(k: int) -> Climate:
        return replace(climates[k], **{name: getattr(climates[k], name) * math.exp(places[k][0])})

    while left := [k for k, (_, is_least) in enumerate(places) if not is_least]:
        powers = _by_minute([at(k) for k in left], [several[k] for k in left])
        for k, power in zip(left, powers, strict=True):
            # scatter of the power of one minute: settings of the driver, seats, sun; a choice
            error, log = (power - observed[k]) / 600.0, places[k][0]
            # the sun and the driver have tails
            tails = float(weights[k] @ (np.sqrt(1.0 + error * error) - 1.0))
            costs[k][log] = 0.5 * (log / width) ** 2 + tails
            places[k] = _least(costs[k], farthest)
    return [c if abs(places[k][0]) >= 0.98 * farthest else at(k) for k, c in enumerate(climates)]


def _least(costs: dict[float, float], farthest: float) -> tuple[float, bool]:
    """Place of the least cost and True, or the next place whose cost the search needs and False; `costs` are those of known places."""
    from scipy.optimize import minimize_scalar  # scipy is slow to import

    bounds, options = (-farthest, farthest), {"xatol": 1e-5}
    try:  # the search starts anew with all known costs, which takes less than one cost
        found = minimize_scalar(costs.__getitem__, bounds=bounds, method="bounded", options=options)
    except KeyError as place:
        return float(place.args[0]), False
    return float(found.x), True


def _by_minute(
    climates: Sequence[Climate], several: Sequence[Sequence[ClimateRecord]]
) -> Iterator[FloatArray]:
    """Simulated power of heater and compressor by minutes [W], of all trips in order, for each climate control and its trips."""
    pairs = [(climate, r) for climate, records in zip(climates, several, strict=True) for r in records]
    controls = [control_values(climate, r.ambient_temperature_degc, r.start) for climate, r in pairs]
    steps = iter(control_steps(controls, [r.speed_m_s for _, r in pairs]))
    for records in several:
        powers = []
        for record, (heat, *_) in zip(records, steps, strict=False):
            reached = np.interp(record.ends, np.arange(len(heat) + 1.0), running_sum(heat))
            sums = (reached[1:] - reached[:-1]) / record.lengths
            sums[0] += heat[0]  # the first sample has no interval
            sums[-2] += sums[-1]
            powers.append(sums[:-1] / record.samples)
        yield np.concatenate(powers)
