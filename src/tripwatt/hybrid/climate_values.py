"""Identification of values of a climate control from the logged power of heater and compressor."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
    records: Sequence[ClimateRecord], vehicle: Vehicle
) -> dict[str, float | tuple[float, ...]]:
    """Interior heat capacity of the cabin and, from trips in warm air, the compressor's least power and cooling efficiency."""
    climate = vehicle.climate
    assert climate is not None  # else there is no record
    names = ["interior_heat_capacity_j_k"]
    climate = _scaled(climate, names[0], INTERIOR_WIDTH, records)
    # from 15 °C on a compressor cools the cabin; a choice
    warm = [r for r in records if r.ambient_temperature_degc > 15.0]
    running = [r.min_w for r in warm if np.isfinite(r.min_w)]
    if len(running) >= MIN_TRIPS:
        known, prior = len(running) / max(float(np.var(running, ddof=1)), 1.0), IDLE_WIDTH_W**-2
        published = climate.compressor_idle_w
        least = (known * float(np.median(running)) + prior * published) / (known + prior)
        if abs(least - published) <= FARTHEST * IDLE_WIDTH_W:
            climate = replace(climate, compressor_idle_w=least)
        climate = _scaled(climate, "cooler_cop", COOLER_WIDTH, warm)
        names += ["compressor_idle_w", "cooler_cop"]
    return {f"climate.{name}": getattr(climate, name) for name in names}


def _scaled(climate: Climate, name: str, width: float, records: Sequence[ClimateRecord]) -> Climate:
    """Scale one value of a climate control by the factor that fits the logged power by minutes best.

    Returns the climate control unchanged if the best factor is `FARTHEST` widths away: such a log does not have this signal.
    """
    from scipy.optimize import minimize_scalar  # scipy is slow to import

    observed = np.concatenate([r.power_w for r in records])
    # minutes of a trip scatter together: a trip counts as four of them; a choice
    weights = np.concatenate([np.full(len(r.power_w), 4.0 / len(r.power_w)) for r in records])
    farthest = FARTHEST * width

    def at(log: float) -> Climate:
        return replace(climate, **{name: getattr(climate, name) * math.exp(log)})

    def cost(log: float) -> float:
        # scatter of the power of one minute: settings of the driver, seats, sun; a choice
        error = (_by_minute(at(log), records) - observed) / 600.0
        # the sun and the driver have tails
        return 0.5 * (log / width) ** 2 + float(weights @ (np.sqrt(1.0 + error * error) - 1.0))

    found = minimize_scalar(cost, bounds=(-farthest, farthest), method="bounded", options={"xatol": 1e-5})
    best = float(found.x)
    return climate if abs(best) >= 0.98 * farthest else at(best)


def _by_minute(climate: Climate, records: Sequence[ClimateRecord]) -> FloatArray:
    """Simulated power of heater and compressor by minutes [W], of all trips in order."""
    controls = [control_values(climate, r.ambient_temperature_degc, r.start) for r in records]
    steps = control_steps(controls, [r.speed_m_s for r in records])
    powers = []
    for record, (heat, *_) in zip(records, steps, strict=True):
        reached = np.interp(record.ends, np.arange(len(heat) + 1.0), running_sum(heat))
        sums = (reached[1:] - reached[:-1]) / record.lengths
        sums[0] += heat[0]  # the first sample has no interval
        sums[-2] += sums[-1]
        powers.append(sums[:-1] / record.samples)
    return np.concatenate(powers)
