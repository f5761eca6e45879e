"""How the vehicles of a depot are charged for their planned trips: a schedule under a grid limit and a tariff, for EMHASS and for evcc."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import numpy as np
import pandas as pd
from scipy import sparse
from scipy.optimize import linprog

from tripwatt.arrays import FloatArray
from tripwatt.errors import Check, Fault, InvalidInput
from tripwatt.fleet.nights import OF_ERRORS, POWERS, parse_time, records, sum_up_depot, up_to_each
from tripwatt.roads.maps.stations import DIRECT_FROM_W
from tripwatt.sources.columnar import open_table
from tripwatt.trips import raise_faults
from tripwatt.trips.columns import require_number
from tripwatt.units import SECONDS_PER_HOUR

EFFICIENCY: Final = 0.9
"""Share of the energy from an alternating-current charger that reaches the battery: a choice, because chargers lose about a tenth."""

STEP: Final = dt.timedelta(minutes=15)
_STEP_H: Final = STEP.total_seconds() / SECONDS_PER_HOUR
_ON_FACE: Final = 1e-7
"""Price of a bound or row from which on it holds with equality in each cheapest schedule: the tolerance of HiGHS."""
_LEAST_W: Final = 0.1
_MISSING_WH: Final = 1.0
"""Smallest power that is charged and smallest energy that counts as missing: choices, far below what a car shows."""
_EMHASS_STEP: Final = dt.timedelta(minutes=30)
_LONGEST: Final = 1344
"""Largest number of quarters of an hour in a schedule: a choice, two weeks, because solving takes long, and no charge is kept for longer."""
_FAST_W: Final = 1e7
"""Power that fills every battery within `STEP` [W]."""


@dataclass(frozen=True, slots=True)
class Depot:
    """The place where the vehicles of a fleet are charged; each vehicle has a charger.

    Attributes
    ----------
    begins_at : datetime
        When charging may begin, with its time zone.
    charger_w : float
        Power of a charger [W]; a vehicle takes the smaller one of charger and car. A charger of more than 43 kW has direct current.
    grid_w : float, optional
        Largest power of all chargers together [W].
    tariff : mapping of datetime to float
        Price [per kWh] by its beginning; it holds until the next one begins.
    """

    begins_at: dt.datetime
    charger_w: float
    grid_w: float | None = None
    tariff: Mapping[dt.datetime, float] = field(default_factory=dict)

    def windows(self, needs: pd.DataFrame) -> pd.DataFrame:
        """Return needs with `begins_at` (return from the hour before), `ends_at` (departure) and `power_w` of the charging [W]."""
        after = needs.groupby("vehicle_id")["arrives_at"].shift(fill_value=self.begins_at)
        power_w = needs[POWERS[self.charger_w >= DIRECT_FROM_W]].clip(upper=self.charger_w)
        return needs.assign(begins_at=after, ends_at=needs["departs_at"], power_w=power_w)

    def prices(self, times: pd.DatetimeIndex) -> FloatArray:
        """Return the price at each time [per kWh]; 1 without a tariff, so that the cheapest schedule takes the least energy."""
        if not self.tariff:
            return np.ones(len(times))
        begins, prices = zip(*sorted(self.tariff.items()), strict=True)
        at = np.searchsorted(pd.to_datetime(list(begins), utc=True), times, side="right") - 1
        if at.min(initial=0) < 0:
            got, allowed = f"the first begins at {begins[0]}", f"one that begins at {times[0]} or before"
            raise InvalidInput.of("no price", "tariff", got, allowed)
        return np.array(prices)[at]


def read_tariff(file: Path | str) -> dict[dt.datetime, float]:
    """Read the columns `begins_at` and `price` [per kWh] of a tariff from CSV or Parquet.

    Raises
    ------
    InvalidInput
        If the file cannot be read, or a cell is no time or number.
    """
    read = open_table(Path(file))
    (numbers,) = read.numbers(["price"])
    raise_faults(read.faults)
    with Check() as check:
        times = [check(parse_time, text, f"{file}: begins_at") for text in read.texts("begins_at")]
        prices = [check(require_number, f"{file}: price", number) for number in numbers]
    return dict(zip(times, prices, strict=True))


@dataclass(frozen=True, eq=False)
class Schedule:
    """When each vehicle is charged, and with which power.

    Attributes
    ----------
    begins_at : datetime
        Beginning of the first quarter of an hour.
    table : DataFrame
        Columns `vehicle_id`, `begins_at` (of a quarter of an hour) and `power_w` (from the grid) [W]; quarters without power are left out.
    peak_w : float
        Largest power of all vehicles together [W].
    chargers : float
        Most chargers in use at the same time; one that a vehicle uses with half of its power counts half.
    cost : float
        Cost by the tariff.
    charged_wh : ndarray, shape (needs,)
        Energy that the battery gets before the departure of each row of the needs [Wh].
    missing_wh : ndarray, shape (needs,)
        What the battery lacks at the departure of each row [Wh]; 0 if it is less than `_MISSING_WH`.
    """

    begins_at: dt.datetime
    table: pd.DataFrame
    peak_w: float
    chargers: float
    cost: float
    charged_wh: FloatArray
    missing_wh: FloatArray

    @property
    def loads(self) -> pd.DataFrame:
        """Spans of the same power of a vehicle, in the columns that `emhass` reads."""
        table = self.table.sort_values(["vehicle_id", "begins_at"], kind="stable")
        follows = table["vehicle_id"].eq(table["vehicle_id"].shift()) & table["begins_at"].diff().eq(STEP)
        span = (~(follows & table["power_w"].diff().abs().lt(1.0))).cumsum()
        charge_wh = EFFICIENCY * _STEP_H * table["power_w"]
        table = table.assign(ends_at=table["begins_at"] + STEP, charge_wh=charge_wh)
        spans = table.groupby(span)
        latest, charge_wh = spans[["ends_at", "power_w"]].max(), spans["charge_wh"].sum()
        return spans[["vehicle_id", "begins_at"]].first().join([latest, charge_wh])


def schedule(needs: pd.DataFrame, depot: Depot, *, shared: bool = False) -> Schedule:
    """Schedule the charging of vehicles: first the least missing energy, then the least cost, then the lowest peak.

    Two linear programs, solved by HiGHS. A vehicle charges between its trips and never beyond a full battery, whose room grows with the
    median energy of its trips. The missing energy is that of all departures added up: what a vehicle lacks at two departures weighs twice in
    the choice of the schedule, but is missing once. The second program lowers the peak on the set of cheapest schedules, by complementary slackness.

    Parameters
    ----------
    needs : DataFrame
        Result of `needs_by_hour`. Vehicles whose charge is not known are left out.
    depot : Depot
    shared : bool
        Whether vehicles share chargers, one after the other within a quarter of an hour: then the fewest chargers, in place of the lowest peak.

    Raises
    ------
    InvalidInput
        If the tariff begins later than the charging, or a vehicle departs more than two weeks after it.
    """
    rows, so_far = depot.windows(needs), up_to_each(needs)
    begin = pd.Timestamp(depot.begins_at).tz_convert("UTC").ceil(STEP)
    spans = [(pd.to_datetime(rows[name], utc=True) - begin) / STEP for name in ("begins_at", "ends_at")]
    first, last = np.ceil(spans[0].clip(lower=0.0)).astype(int), np.floor(spans[1]).astype(int)
    if last.max() > _LONGEST:
        got = f"a departure at {rows['ends_at'].max()}"
        allowed = "two weeks before the last departure, or later"
        where, fix = f"{depot.begins_at:%Y-%m-%d %H:%M}", "give --begins"
        raise InvalidInput.of("charging begins too early", where, got, allowed, fix)
    cells = [(k, t) for k, span in enumerate(zip(first, last, strict=True)) for t in range(*span)]
    row, quarter = np.array(cells, dtype=int).reshape(-1, 2).T
    times = pd.date_range(begin, periods=quarter.max(initial=-1) + 1, freq=STEP)
    price = depot.prices(times)
    of_row, at = (
        sparse.csr_matrix(index == np.arange(n)[:, None], dtype=float)
        for index, n in ((row, len(rows)), (quarter, len(times)))
    )
    charging = so_far @ of_row * (EFFICIENCY * _STEP_H)
    charge_wh, soc = rows["charge_wh"].fillna(0.0).to_numpy(), rows["soc"].to_numpy()
    spent_wh = so_far @ rows["energy_wh"].to_numpy() - rows["energy_wh"]
    room_wh = np.nan_to_num(np.maximum((1.0 - soc) * rows["wh_per_soc"] + spent_wh, 0.0))
    energies, most_w = (so_far @ charge_wh, room_wh), rows["power_w"].to_numpy()[row]
    in_use = at.multiply(1000.0 / np.maximum(most_w, _LEAST_W)).tocsr()
    power_w = _cheapest(charging, at, in_use if shared else at, price, *energies, most_w, depot.grid_w)
    charged_wh, all_w = charging @ power_w, at @ power_w
    missing_wh = energies[0] - charged_wh
    ids = rows["vehicle_id"].to_numpy()[row]
    table = pd.DataFrame({"vehicle_id": ids, "begins_at": times[quarter], "power_w": power_w})[power_w > 0.0]
    peak_w, chargers = (float(load.max(initial=0.0)) for load in (all_w, in_use @ power_w / 1000.0))
    cost = float(all_w @ price) * _STEP_H / 1000.0
    missing_wh = np.where(missing_wh > _MISSING_WH, missing_wh, 0.0)
    return Schedule(begin.to_pydatetime(), table, peak_w, chargers, cost, charged_wh, missing_wh)


def _cheapest(
    charging: sparse.csr_matrix, at: sparse.csr_matrix, load: sparse.csr_matrix, price: FloatArray, need_wh: FloatArray, room_wh: FloatArray,
    most_w: FloatArray, grid_w: float | None,
) -> FloatArray:  # fmt: skip
    """Solve the programs of `schedule`: the power of each vehicle and quarter that may be charged [W], shape (variables,).

    The variables are these powers, the missing energies and the peak. In the second program, a bound or a row with a price in the first
    one holds with equality.

    Parameters
    ----------
    charging : sparse matrix, shape (needs, variables)
        Energy that the battery gets before each departure by a power [h].
    at : sparse matrix, shape (quarters, variables)
        1 where a variable is a power in a quarter.
    load : sparse matrix, shape (quarters, variables)
        What a power adds to the load in a quarter whose peak is lowered last.
    price : ndarray, shape (quarters,)
        Price [per kWh].
    need_wh, room_wh : ndarray, shape (needs,)
        Energy that the battery has to get, and the largest that it can get, before each departure [Wh].
    most_w : ndarray, shape (variables,)
        Largest power [W].
    grid_w : float or None
        Largest power of all together [W].
    """
    if not len(most_w):
        return most_w
    k, quarters = len(need_wh), len(price)
    # a missing kWh less may move the power of every quarter: no such move may cost more than it is worth
    worst = ((1 + quarters) * np.ptp(price) + np.abs(price).max() + 1.0) / EFFICIENCY
    cost = np.concatenate((at.T @ price * _STEP_H, np.full(k, worst), [0.0]))
    limit_kw = (most_w.sum() if grid_w is None else min(grid_w, most_w.sum())) / 1000.0
    upper = np.concatenate((most_w / 1000.0, np.full(k + 1, np.inf)))
    peak, limits = -np.ones((quarters, 1)), np.full(quarters, limit_kw * 1000.0)
    blocks = [[-charging, -sparse.eye(k), None], [charging, None, None], [load, None, peak], [at, None, None]]
    A, b = sparse.bmat(blocks, "csr"), np.concatenate((-need_wh, room_wh, 0.0 * limits, limits)) / 1000.0
    best = linprog(cost, A, b, bounds=np.column_stack((0.0 * cost, upper)), method="highs-ds")
    tight = best.ineqlin.marginals < -_ON_FACE
    low = np.where(best.upper.marginals < -_ON_FACE, upper, 0.0)
    bounds = np.column_stack((low, np.where(best.lower.marginals > _ON_FACE, 0.0, upper)))
    by_peak = np.arange(len(cost)) == len(cost) - 1
    lowest = linprog(by_peak, A[~tight], b[~tight], A[tight], b[tight], bounds, "highs-ipm")
    power_w = (lowest if lowest.success else best).x[: len(most_w)] * 1000.0
    power_w = np.where(power_w < _LEAST_W, 0.0, np.minimum(power_w, most_w))
    over = limit_kw * 1000.0 * (1.0 - 1e-12) / np.maximum(at @ power_w, 1e-9)
    return np.asarray(power_w * (at.T @ np.minimum(1.0, over)))


def emhass(loads: pd.DataFrame, at: dt.datetime, step: dt.timedelta = _EMHASS_STEP) -> dict[str, Any]:
    """Return the payload for EMHASS's `naive-mpc-optim`: one deferrable load per row with a positive `charge_wh`.

    `vehicles` names the vehicle of each load. EMHASS counts steps from the time of the request, so the payload is to be posted at
    `begins_at`. EMHASS switches a load for whole steps only, so the operating hours are rounded up to whole steps.

    Parameters
    ----------
    loads : DataFrame
        Columns `vehicle_id`, `begins_at` and `ends_at` (bounds of the charging), `charge_wh`, of which the share `EFFICIENCY` reaches
        the battery, and `power_w`: from `Depot.windows`, or from `Schedule.loads`, which leave EMHASS no choice.
    at : datetime
        Beginning of the first step, with its time zone.
    step : timedelta
        Length of a step.

    Raises
    ------
    InvalidInput
        If a vehicle that has to charge departs before `at`.

    Examples
    --------
    >>> at, hour = dt.datetime(2026, 1, 11, 21, 30, tzinfo=dt.UTC), dt.timedelta(hours=1)
    >>> row = {"vehicle_id": "V1", "begins_at": at, "ends_at": at + 10 * hour, "charge_wh": 13320.0, "power_w": 7400.0}
    >>> load = emhass(pd.DataFrame([row]), at)
    >>> load["operating_hours_of_each_deferrable_load"], load["end_timesteps_of_each_deferrable_load"]
    ([2.0], [20])
    """
    loads = loads[loads["charge_wh"] > 0.0]
    rows = loads.to_dict("records")
    departed = ((row["vehicle_id"], f"{row['ends_at']}") for row in rows if row["ends_at"] < at)
    what = "departs before the charging begins"
    fix = "let the charging begin earlier, or leave out what is driven already"
    raise_faults(Fault(what, *row, f"later than {at}", fix) for row in departed)
    steps = [[(row[name] - at) / step for name in ("begins_at", "ends_at")] for row in rows]
    last, step_h = [int(end) for _, end in steps], step.total_seconds() / SECONDS_PER_HOUR
    steps_needed = loads["charge_wh"] / (EFFICIENCY * loads["power_w"] * step_h)
    return {
        "begins_at": at.isoformat(timespec="seconds"),
        "optimization_time_step": round(60.0 * step_h),
        "prediction_horizon": max([*last, 1]),
        "number_of_deferrable_loads": len(loads),
        "nominal_power_of_deferrable_loads": loads["power_w"].tolist(),
        "operating_hours_of_each_deferrable_load": [math.ceil(n - 1e-3) * step_h for n in steps_needed],
        "start_timesteps_of_each_deferrable_load": [math.ceil(max(begin, 0.0)) for begin, _ in steps],
        "end_timesteps_of_each_deferrable_load": last,
        "vehicles": loads["vehicle_id"].tolist(),
    }


def evcc(needs: pd.DataFrame) -> list[str]:
    """Return paths to post to evcc: one charging plan per vehicle, with the charge needed at its first departure.

    Examples
    --------
    >>> leaves = dt.datetime(2026, 1, 12, 7, 30, tzinfo=dt.UTC)
    >>> evcc(pd.DataFrame({"vehicle_id": ["V1"] * 2, "departs_at": [leaves] * 2, "soc_needed": [0.551, 0.3]}))
    ['/api/vehicles/V1/plan/soc/56/2026-01-12T07:30:00Z']
    """
    return [
        f"/api/vehicles/{quote(str(row['vehicle_id']), safe='')}/plan/soc/{min(math.ceil(100.0 * row['soc_needed'] - 1e-9), 100)}/"
        f"{row['departs_at'].astimezone(dt.UTC):%Y-%m-%dT%H:%M:%SZ}"
        for row in needs.drop_duplicates("vehicle_id").to_dict("records")
    ]


@dataclass(frozen=True, eq=False)
class Night:
    """The needs of a night, what they add up to, and their schedule.

    Attributes
    ----------
    needs : DataFrame
        Result of `needs_by_hour`.
    depot : Depot
    probability : float
        Probability of the needs.
    """

    needs: pd.DataFrame
    depot: Depot
    probability: float = 0.95

    @cached_property
    def plan(self) -> Schedule | None:
        """The schedule; None without a limit or a tariff."""
        is_free = self.depot.grid_w is None and not self.depot.tariff
        return None if is_free else schedule(self.needs, self.depot)

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The needs without the columns `OF_ERRORS`, and the schedule, if there is one, as `schedule`.

        With a schedule, the needs have `missing_wh`: what cannot be charged before the departure [Wh].
        """
        needs = self.needs.drop(columns=[*OF_ERRORS])
        if self.plan is None:
            return {"needs": needs}
        return {"needs": needs.assign(missing_wh=self.plan.missing_wh), "schedule": self.plan.table}

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Energy of all vehicles together, and the chance that all have enough if each is charged as planned, or as needed without a plan.

        With a plan also its `peak_w`, its `cost` if there is a tariff, and `fails_first`: vehicle and departure of the first row with
        missing energy, and its `reason`.
        """
        plan, needs = self.plan, self.needs
        wanted = up_to_each(needs) @ needs["charge_wh"].fillna(0.0).to_numpy()
        totals = sum_up_depot(needs, self.probability, wanted if plan is None else plan.charged_wh)
        if plan is None:
            return totals
        short = self.tables["needs"].query("missing_wh > 0.0").sort_values("departs_at", kind="stable")
        fails = records(short[["vehicle_id", "departs_at", "missing_wh"]].head(1))
        cost = {"cost": plan.cost} if self.depot.tariff else {}
        first = fails[0] | {"reason": self._reason(fails[0]["vehicle_id"])} if fails else None
        return totals | {"peak_w": plan.peak_w, **cost, "fails_first": first}

    def _reason(self, vehicle: str) -> str:
        """Say why a vehicle lacks energy: what it has to be without to lack none."""
        own = self.needs[self.needs["vehicle_id"] == vehicle]
        depot = replace(self.depot, grid_w=None)
        if not schedule(own, depot).missing_wh.any():
            return "grid limit"
        fast = own.assign(**dict.fromkeys(POWERS, _FAST_W))
        if not schedule(fast, replace(depot, charger_w=_FAST_W)).missing_wh.any():
            return "time at the charger"
        return "size of the battery, or no time between trips"

    @cached_property
    def document(self) -> dict[str, Any]:
        """The rows of the needs and of the schedule, the summary, the payload of `emhass`, and the paths of `evcc`, as data."""
        plan, depot = self.plan, self.depot
        windows = depot.windows(self.needs), depot.begins_at
        loads = windows if plan is None else (plan.loads, plan.begins_at, STEP)
        tables = {name: records(table) for name, table in self.tables.items()}
        return {**tables, "depot": self.summary, "emhass": emhass(*loads), "evcc": evcc(self.needs)}
