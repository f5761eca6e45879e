"""The charging of a depot's night, measured: python -m benchmarks.fleet_night [best] [large] [chances].

best      200 small nights: the schedule beside the best of all schedules in whole units
large     500 vehicles and 96 quarters of an hour under a tight limit, a wide one and none: time, and power beyond the limit
chances   nights of fleets drawn by their statistical model: stated chances beside what happened
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from tests.fleet.depots import (
    AT,
    FIGURES,
    UNIT_WH,
    best_of_all,
    large_night,
    needs_of,
    simulated_night,
    small_night,
    tariff_of,
)
from tools.command import run
from typer import Argument

from benchmarks.measure import Row, report
from tripwatt.fleet.charging import Depot, schedule

NIGHTS, FIRST_SEED = 900, 1000
"""Seeds below 1000 were looked at while the method was written."""


def best() -> Iterator[Row]:
    """Whether missing energy, cost and peak are those of the best schedule."""
    different = 0
    for seed in range(FIRST_SEED, FIRST_SEED + 200):
        rows, prices, limit = small_night(np.random.default_rng(seed))
        plan = schedule(needs_of(rows), Depot(AT, 22e3, 1000.0 * limit, tariff_of(prices)))
        least = best_of_all(rows, prices, limit)
        peak = next(p for p in range(limit + 1) if best_of_all(rows, prices, p) == least)
        found = plan.missing_wh.sum() / UNIT_WH, 4.0 * plan.cost
        same = np.allclose(found, least, atol=1e-4) and math.ceil(plan.peak_w / 1000.0 - 1e-4) == peak
        different += not same
    yield Row("of 200 small nights, schedules other than the best", different, most=0.0)


def large() -> Iterator[Row]:
    """Time of a large night, and the largest power beyond its limit."""
    needs, tariff = large_night(FIRST_SEED)
    for limit_w, prices in ((300e3, tariff), (600e3, tariff), (None, tariff), (600e3, {})):
        began = time.perf_counter()
        plan = schedule(needs, Depot(AT, 11e3, limit_w, prices))
        took = time.perf_counter() - began
        name = f"500 vehicles, limit {limit_w and limit_w / 1e3} kW, {'a tariff' if prices else 'no tariff'}"
        yield Row(name, took, "s", most=10.0)
        over = plan.table.groupby("begins_at")["power_w"].sum().max() - (limit_w or math.inf)
        yield Row(f"{name}: power beyond the limit", max(over, 0.0), "W", most=0.0)


def chances() -> Iterator[Row]:
    """How often what was stated happened."""
    nights = [[*simulated_night(FIRST_SEED + k).values()] for k in range(NIGHTS)]
    for name, (stated, happened) in zip(FIGURES, np.mean(nights, axis=0), strict=True):
        most = math.inf if name in ("median", "sum of quantiles") else 2.0
        yield Row(
            f"{name}: stated {100 * stated:.1f} %, difference",
            100 * abs(stated - happened),
            "points",
            most=most,
        )


def main(what: Annotated[list[str] | None, Argument()] = None) -> int:
    """Print the parts, all unless some are named; 1 when a bound is missed."""
    parts = {"best": best, "large": large, "chances": chances}
    return report(row for name in what or parts for row in parts[name]())


if __name__ == "__main__":
    run(main)
