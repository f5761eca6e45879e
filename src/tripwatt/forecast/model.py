"""The forecaster: physics, a corrector of power, and how sure they are, fitted together on logged trips.

How sure is learned from trips that the corrector has not seen: the training trips are held out in turn, the residual
process is fitted to what was left of them, and the standardised errors of their totals become the scores of a
conformal layer. An outer fold sees none of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecast.forecast import Forecast
from tripwatt.forecast.gain import Gain
from tripwatt.forecast.process import Blocks, ResidualProcess, fit_process
from tripwatt.forecast.scores import Scores
from tripwatt.hybrid import BlockTable, PowerCorrector, block_table, planned, power_corrector
from tripwatt.hybrid.power import DEPARTURE_COLUMNS
from tripwatt.physics import simulate_trip
from tripwatt.trips import FloatArray, Trip
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from tripwatt.forecast.elsewhere import Elsewhere

DEFAULT_CORRECTOR: Final = "ensemble"
INNER_FOLDS: Final = 10
MIN_TRIPS: Final = 8
EFFECT_START: Final = np.array([200.0, 0.05, 0.15])
"""Start of the whole-trip effects' standard deviations: a constant [W], a share of driving, a share of climate."""

WATCHED: Final = (*DEPARTURE_COLUMNS[:4], "trip_speed_m_s", "duration_s")
"""What is compared with the training range; outside, the forecast is flagged and its interval widened."""


@dataclass(frozen=True, slots=True)
class Range:
    """What training saw of a covariate: its range and its standard deviation."""

    low: float
    high: float
    sd: float

    def beyond(self, value: float) -> float:
        """Distance outside the range, in standard deviations; 0 inside or when unknown."""
        if not np.isfinite(value):
            return 0.0
        return max(self.low - value, value - self.high, 0.0) / self.sd


@dataclass(frozen=True, slots=True)
class HeldOut:
    """A training trip while its inner fold was held out.

    `score` is the error over its standard deviation before departure.
    """

    trip: str
    observed_wh: float
    predicted_wh: float
    score: float


@dataclass(eq=False)
class ForecastModel:
    """Physics plus learned correction plus doubt.

    Parameters
    ----------
    vehicle : Vehicle
    corrector : str
        One of `POWER_CORRECTORS`.
    seed : int

    Examples
    --------
    >>> from tripwatt.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> fleet = synthetic_fleet(n_trips=12)
    >>> model = ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="linear").fit(fleet.trips[:11])
    >>> forecast = model.forecast(fleet.trips[11])
    >>> low, high = forecast.interval(0.9)
    >>> bool(low < forecast.energy_wh < high)
    True
    """

    vehicle: Vehicle
    corrector: str = DEFAULT_CORRECTOR
    seed: int = 0
    fitted_: PowerCorrector | None = None
    process_: ResidualProcess | None = None
    scores_: Scores | None = None
    gain_: Gain | None = None
    ranges_: dict[str, Range] = field(default_factory=dict)
    trip_ids_: tuple[str, ...] = ()
    held_out_: tuple[HeldOut, ...] = ()
    elsewhere_: Elsewhere | None = None
    """The corrector for cars whose logs lack signals that this one's have; None when nobody made one."""

    def fit(
        self, trips: Sequence[Trip], *, progress: Callable[[int, int], None] | None = None
    ) -> ForecastModel:
        """Learn from raw trips with measured energy. See `fit_blocks`."""
        return self.fit_blocks(training_blocks(trips, self.vehicle), progress=progress)

    def fit_blocks(
        self, table: BlockTable, *, progress: Callable[[int, int], None] | None = None
    ) -> ForecastModel:
        """Learn corrector, process and scores. One fit of the corrector, and one more for each inner fold.

        Parameters
        ----------
        table : BlockTable
        progress : callable, optional
            Called with (finished fits, all fits).

        Raises
        ------
        InvalidInput
            With fewer than `MIN_TRIPS` trips.
        """
        if len(table) < MIN_TRIPS:
            raise InvalidInput(Fault("too few trips", "training", str(len(table)), f"at least {MIN_TRIPS}"))
        self.fitted_ = power_corrector(self.corrector, self.seed).fit(table)
        self.trip_ids_ = table.trip_ids
        self.ranges_ = training_ranges(table)
        folds = np.random.default_rng(self.seed).permutation(len(table)) % min(INNER_FOLDS, len(table))
        held_out: list[tuple[Blocks, FloatArray]] = []
        order: list[int] = []
        n_folds = int(folds.max()) + 1
        for fold in range(n_folds):
            if progress is not None:
                progress(fold + 1, n_folds + 1)
            inner = self.fitted_.again().fit(table.take(np.flatnonzero(folds != fold)))
            for i in np.flatnonzero(folds == fold):
                trip = table.take([int(i)])
                order.append(int(i))
                doubt = inner.uncertainty_factor(trip)
                held_out.append((process_blocks(trip, doubt), trip.residual_w - inner.predict(trip)))
        self.process_ = fit_process(held_out, len(EFFECT_START), EFFECT_START)
        self.scores_ = Scores.of([self.process_.total_score(blocks, left) for blocks, left in held_out])
        self.held_out_ = _held_out(table, order, held_out, self.process_)
        self.gain_ = Gain.of(self.process_, held_out, table.totals_wh(table.observed_power_w)[order])
        if progress is not None:
            progress(n_folds + 1, n_folds + 1)
        return self

    def forecast(self, trip: Trip) -> Forecast:
        """Forecast a trip from what is known at its departure. O(samples + blocks^2).

        Parameters
        ----------
        trip : Trip
            Raw samples: the speed trace and road of the trip to come, and in the first sample what is known of
            ambient, cabin and battery temperature, set-point and state of charge.
        """
        return self.forecast_planned(planned(trip))

    def forecast_planned(self, plan: Trip) -> Forecast:
        """Forecast a plan of `planned`: the same as `forecast` of the trip that it was made from."""
        if self.fitted_ is None or self.process_ is None or self.scores_ is None or self.gain_ is None:
            raise InvalidInput(
                Fault("model is not fitted", "forecast", "no training trips", "call fit first")
            )
        simulation = simulate_trip(self.vehicle, plan)
        table = block_table(plan, simulation)
        correction, doubt = self.fitted_.predict_with_doubt(table)
        known = _watched(table)
        outside = {name: self.ranges_[name].beyond(value) for name, value in known.items()}
        return Forecast.at_departure(
            plan=plan,
            vehicle=self.vehicle,
            simulation=simulation,
            table=table,
            correction_w=correction,
            blocks=process_blocks(table, doubt),
            process=self.process_,
            scores=self.scores_,
            gain=self.gain_,
            outside={name: beyond for name, beyond in outside.items() if beyond > 0.0},
            unknown=tuple(
                n
                for n in DEPARTURE_COLUMNS[:4]
                # a signal that no training trip had is nothing that a forecast counts on
                if not np.isfinite(known[n]) and np.isfinite(self.ranges_[n].low)
            ),
        )


def training_blocks(trips: Sequence[Trip], vehicle: Vehicle) -> BlockTable:
    """Blocks of all trips, their measured power beside the simulated one.

    Raises
    ------
    InvalidInput
        When there is no trip or one has no measured energy.
    """
    silent = [t.trip_id for t in trips if t.observed_energy_wh is None]
    faults = [Fault("no measured energy", name, "", "voltage and current") for name in silent]
    if not trips:
        faults.append(Fault("no trips", "training", "0", f"at least {MIN_TRIPS}"))
    if faults:
        raise InvalidInput(faults)
    tables = []
    for trip in trips:
        plan = planned(trip)
        tables.append(block_table(plan, simulate_trip(vehicle, plan), trip))
    return BlockTable.join(tables)


def _held_out(
    table: BlockTable,
    order: Sequence[int],
    held_out: Sequence[tuple[Blocks, FloatArray]],
    process: ResidualProcess,
) -> tuple[HeldOut, ...]:
    observed = table.totals_wh(table.observed_power_w)
    rows = [
        HeldOut(
            table.trip_ids[i],
            float(observed[i]),
            float(observed[i] - blocks.step_s @ left / 3600.0),
            process.total_score(blocks, left),
        )
        for i, (blocks, left) in sorted(zip(order, held_out, strict=True), key=lambda pair: pair[0])
    ]
    return tuple(rows)


def process_blocks(table: BlockTable, doubt_w: FloatArray) -> Blocks:
    """Blocks of one trip as the residual process sees them.

    Whole-trip effects load on: every hour alike; the power of driving, as much as the wheels move; the power of
    climate. What is new in each block grows with the power that is moved. What the corrector does not know of the
    trip's total only widens the interval.
    """
    features, hours = table.features, table.hours
    moved = features["moved_w"].to_numpy(dtype=np.float64)
    loadings = np.column_stack([np.ones(len(moved)), moved, features["hvac_w"].to_numpy()])
    return Blocks(
        time_s=features["time_s"].to_numpy(dtype=np.float64),
        step_s=table.hours * 3600.0,
        loadings=loadings,
        spread_w=100.0 + 0.3 * moved,
        doubt_wh=float(np.linalg.norm(hours @ doubt_w)),
    )


def _watched(table: BlockTable) -> dict[str, float]:
    row = dict(zip(table.features.columns.tolist(), table.features.to_numpy()[0].tolist(), strict=True))
    first: dict[str, float] = {name: float(row[name]) for name in WATCHED if name in row}
    return first | {"duration_s": float(table.hours.sum() * 3600.0)}


def training_ranges(table: BlockTable) -> dict[str, Range]:
    """What the trips of a table show of each of `WATCHED`."""
    rows = [_watched(table.take([i])) for i in range(len(table))]
    ranges = {}
    for name in WATCHED:
        values = np.array([row[name] for row in rows])
        known = values[np.isfinite(values)]
        if not len(known):
            ranges[name] = Range(-np.inf, np.inf, 1.0)
            continue
        spread = float(known.std())
        ranges[name] = Range(float(known.min()), float(known.max()), spread if spread > 0 else 1.0)
    return ranges
