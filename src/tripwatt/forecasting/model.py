"""The forecaster: physics, a corrector of power, and how sure they are, fitted together on logged trips.

How sure is learned from trips that the corrector has not seen: the training trips are held out in turn, the residual
process and the scale of the total are fitted to what was left of them, and the standardised errors of their totals
become the scores of a conformal layer. An outer fold sees none of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting.forecast import Forecast
from tripwatt.forecasting.gain import Gain
from tripwatt.forecasting.planned import LinkedTrips, RouteDoubt, linked_trips, with_route_error
from tripwatt.forecasting.process import Blocks, HeldOutResidual, ResidualProcess, fit_process
from tripwatt.forecasting.scale import TotalScale
from tripwatt.forecasting.scores import Scores
from tripwatt.hybrid import BlockTable, PowerCorrector, block_table, power_corrector
from tripwatt.physics import simulate_trip
from tripwatt.trips import TEMPERATURES, Departure, FloatArray, Plan, Trip, plan_from_trip
from tripwatt.trips.messages import name_of
from tripwatt.trips.showing import html_table
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tripwatt.forecasting.elsewhere import Elsewhere

DEFAULT_CORRECTOR: Final = "channels"
INNER_FOLDS: Final = 10
MIN_TRIPS: Final = 8
WATCHED: Final = (*TEMPERATURES, "trip_speed_m_s", "duration_s")
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


@dataclass(eq=False, repr=False)
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
    scale_: TotalScale | None = None
    scores_: Scores | None = None
    gain_: Gain | None = None
    route_doubt_: RouteDoubt | None = None
    ranges_: dict[str, Range] = field(default_factory=dict)
    trip_ids_: tuple[str, ...] = ()
    held_out_: tuple[HeldOut, ...] = ()
    elsewhere_: Elsewhere | None = None
    """The corrector for cars whose logs lack signals that this one's have; None when nobody made one."""

    def fit(
        self, trips: Sequence[Trip], *, progress: Callable[[int, int], None] | None = None
    ) -> ForecastModel:
        """Learn from raw trips with measured energy. See `fit_blocks`."""
        table = training_blocks(trips, self.vehicle)
        return self.fit_blocks(table, routes=linked_trips(trips, self.vehicle), progress=progress)

    def fit_blocks(
        self,
        table: BlockTable,
        *,
        routes: LinkedTrips | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> ForecastModel:
        """Learn corrector, process and scores. One fit of the corrector, and one more for each inner fold.

        Parameters
        ----------
        table : BlockTable
        routes : LinkedTrips, optional
            The same trips on links, for the doubt of planned routes.
        progress : callable, optional
            Called with (finished fits, all fits).

        Raises
        ------
        InvalidInput
            With fewer than `MIN_TRIPS` trips.
        """
        if len(table) < MIN_TRIPS:
            fix = "adapt a model of another car with tripwatt fit --base MODEL"
            raise InvalidInput(
                Fault("too few trips", "training", str(len(table)), f"at least {MIN_TRIPS}", fix)
            )
        self.fitted_ = power_corrector(self.corrector, self.seed).fit(table)
        self.trip_ids_ = table.trip_ids
        self.ranges_ = training_ranges(table)
        folds = np.random.default_rng(self.seed).permutation(len(table)) % min(INNER_FOLDS, len(table))
        held_out: dict[int, HeldOutResidual] = {}
        off: list[FloatArray] = []
        n_folds = int(folds.max()) + 1
        for fold in range(n_folds):
            if progress is not None:
                progress(fold + 1, n_folds + 1)
            inner = self.fitted_.again().fit(table.take(np.flatnonzero(folds != fold)))
            if routes is not None:
                off.append(routes.differences(inner, table, np.flatnonzero(folds == fold)))
            for i in np.flatnonzero(folds == fold):
                held_out[int(i)] = held_out_residual(inner, table.take([int(i)]))
        self.route_doubt_ = RouteDoubt.of(np.concatenate(off)) if off else None
        self._learn_doubt(table, [held_out[i] for i in range(len(table))])
        if progress is not None:
            progress(n_folds + 1, n_folds + 1)
        return self

    def _learn_doubt(self, table: BlockTable, held_out: Sequence[HeldOutResidual]) -> None:
        """Process, scale, scores and gain from trips that were held out."""
        observed = table.totals_wh(table.observed_power_w)
        errors = np.array([trip.error_wh for trip in held_out])
        self.process_ = fit_process(held_out)
        self.scale_ = scale = TotalScale.of([trip.blocks for trip in held_out], errors)
        sd = np.array([scale.sd_wh(trip.blocks) for trip in held_out])
        scores = errors / sd
        self.scores_ = Scores.of(scores.tolist())
        self.held_out_ = tuple(
            HeldOut(name, float(o), float(o - e), float(s))
            for name, o, e, s in zip(table.trip_ids, observed, errors, scores, strict=True)
        )
        self.gain_ = Gain.of(self.process_, held_out, sd)

    def forecast(self, trip: Plan | Trip, departure: Departure | None = None) -> Forecast:
        """Forecast a trip from what is known at its departure. O(samples + blocks^2).

        Parameters
        ----------
        trip : Plan or Trip
            The drive to come. Of a trip that took place only the speed trace, the road and the first sample count.
        departure : Departure, optional
            Its known fields take the place of those of the plan.

        Returns
        -------
        Forecast

        Raises
        ------
        InvalidInput
            When the model is not fitted, or the plan cannot be simulated.

        Examples
        --------
        >>> import tripwatt as tw
        >>> model = tw.load_model()
        >>> plan = tw.read_route([{"length_m": 5000.0, "speed_m_s": 15.0}])
        >>> cold = model.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=-5))
        >>> mild = model.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=20))
        >>> bool(cold.energy_wh > mild.energy_wh)
        True
        """
        plan = (trip if isinstance(trip, Plan) else plan_from_trip(trip)).with_departure(departure)
        if (
            self.fitted_ is None
            or self.process_ is None
            or self.scale_ is None
            or self.scores_ is None
            or self.gain_ is None
        ):
            raise InvalidInput(
                Fault("model is not fitted", "forecast", "no training trips", fix="call fit first")
            )
        simulation = simulate_trip(self.vehicle, plan)
        table = block_table(plan, simulation)
        correction, doubt = self.fitted_.predict_with_doubt(table)
        known = _watched(table)
        outside = {name: self.ranges_[name].beyond(value) for name, value in known.items()}
        forecast = Forecast.at_departure(
            plan=plan,
            vehicle=self.vehicle,
            simulation=simulation,
            table=table,
            correction_w=correction,
            corrector=self.fitted_,
            blocks=process_blocks(table, doubt),
            process=self.process_,
            scale=self.scale_,
            scores=self.scores_,
            gain=self.gain_,
            outside={name: beyond for name, beyond in outside.items() if beyond > 0.0},
            unknown=tuple(
                n
                for n in TEMPERATURES
                # a signal that no training trip had is nothing that a forecast counts on
                if not np.isfinite(known[n]) and np.isfinite(self.ranges_[n].low)
            ),
        )
        return with_route_error(forecast, self.route_doubt_)

    def to_dict(self) -> dict[str, Any]:
        """Plain values: the car, the corrector, and what training saw."""
        return {
            "vehicle": self.vehicle.name,
            "vehicle_title": self.vehicle.title,
            "corrector": self.corrector,
            "seed": self.seed,
            "trips": len(self.trip_ids_),
            "training": {
                name: [seen.low, seen.high] for name, seen in self.ranges_.items() if np.isfinite(seen.low)
            },
        }

    def to_frame(self) -> pd.DataFrame:
        """One row for each quantity that forecasts compare with the training trips: `low`, `high`, `sd`."""
        rows = {name: (seen.low, seen.high, seen.sd) for name, seen in self.ranges_.items()}
        return pd.DataFrame.from_dict(rows, orient="index", columns=["low", "high", "sd"])

    def plot(self) -> Figure:
        """Forecast consumption over speed at three outside temperatures, with 90 % intervals."""
        from tripwatt.forecasting.plot import plot_model  # matplotlib is slow to import

        return plot_model(self)

    def _title(self) -> str:
        learned = f"{self.corrector} corrector, {len(self.trip_ids_)} trips" if self.trip_ids_ else "no trips"
        return f"{self.vehicle.title}, {learned}"

    def __repr__(self) -> str:
        return f"<ForecastModel {self._title()}>"

    def _repr_html_(self) -> str:
        rows = [
            (name_of(name), f"{seen.low:.3g} to {seen.high:.3g}")
            for name, seen in self.ranges_.items()
            if np.isfinite(seen.low)
        ]
        return html_table(f"ForecastModel {self._title()}", [("training trips", ""), *rows] if rows else [])


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
        plan = plan_from_trip(trip)
        tables.append(block_table(plan, simulate_trip(vehicle, plan), trip))
    return BlockTable.join(tables)


def held_out_residual(corrector: PowerCorrector, table: BlockTable) -> HeldOutResidual:
    """What a corrector that has not seen a trip leaves of it; `table` holds that one trip."""
    correction, doubt = corrector.predict_with_doubt(table)
    blocks = process_blocks(table, doubt)
    climate = corrector.predict_climate(table)
    left = None if climate is None else table.climate_residual_w - climate
    logged = left is not None and bool(np.isfinite(left).all())
    return HeldOutResidual(blocks, table.residual_w - correction, left if logged else None)


def process_blocks(table: BlockTable, doubt_w: FloatArray) -> Blocks:
    """Blocks of one trip as the residual process sees them."""
    features = table.features
    return Blocks(
        time_s=features["time_s"].to_numpy(dtype=np.float64),
        step_s=table.hours * 3600.0,
        moved_w=features["moved_w"].to_numpy(dtype=np.float64),
        hvac_w=features["hvac_w"].to_numpy(dtype=np.float64),
        doubt_wh=float(np.linalg.norm(table.hours @ doubt_w)),
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
