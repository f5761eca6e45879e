"""The forecasting model: physics, a corrector of power and their uncertainty, fitted together on logged trips.

The uncertainty is estimated from trips that the corrector was not fitted on: the training trips are held out in turn,
the residual process and the scale of the total are fitted to their residuals, and the standardised errors of their
totals become the conformal scores. The trips of an outer test fold take no part in this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, percent, require_type
from tripwatt.forecasting.expected import ExpectedTrip
from tripwatt.forecasting.forecast import Forecast, with_empty_flag, with_route_error
from tripwatt.forecasting.inner import INNER_FOLDS, Again, CarsOf, inner_fits, resimulation
from tripwatt.forecasting.plausible import impossible_faults
from tripwatt.forecasting.ranges import (
    compare,
    kept_temperatures,
    training_ranges,
    unknown_air_sd_wh,
    unknown_state_sd_wh,
    unknown_wind_sd_wh,
)
from tripwatt.hybrid import (
    Corrector,
    PowerCorrector,
    SegmentTable,
    power_corrector,
    segment_table,
    segment_trips,
)
from tripwatt.hybrid.correctors import corrector_name
from tripwatt.hybrid.covariates import CovariateCorrector
from tripwatt.hybrid.factors import TripEvidence
from tripwatt.hybrid.familiarity import Range
from tripwatt.hybrid.outside import fitted_outside
from tripwatt.hybrid.segments import driven_roads, driving_w
from tripwatt.parallel import one_blas_thread
from tripwatt.physics import simulate_trip
from tripwatt.routes.terrain import net_climbs
from tripwatt.trips import Departure, Flag, Plan, Recorded, Trip, raise_faults, require_departure
from tripwatt.trips.messages import name_of
from tripwatt.trips.showing import html_table, span
from tripwatt.uncertainty import ChargeScale, LinkedTrips, RouteUncertainty, UncertaintyModel, linked_trips
from tripwatt.uncertainty.free_flow import FreeFlowTrips
from tripwatt.uncertainty.model import scale_wh
from tripwatt.uncertainty.process import HeldOutResidual, held_out_residual, process_segments
from tripwatt.vehicles import Vehicle

DEFAULT_CORRECTOR: Final = "split"
MIN_TRIPS: Final = 8


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Forecast of a training trip by a fit without the trip's inner fold.

    `score` is the error divided by its standard deviation before departure.
    """

    trip: str
    observed_wh: float
    predicted_wh: float
    score: float


@dataclass(eq=False, repr=False)
class ForecastModel:
    """Physics, a correction and their uncertainty.

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    corrector : str or Corrector
        One of `POWER_CORRECTORS`, or an object from outside: a regressor of scikit-learn's kind, or an object with `fit` and
        `predict` on a `SegmentTable`.
    seed : int
        Seed of the random numbers; the same seed gives the same model.
    corrector_ : PowerCorrector or None
        The fitted corrector.
    uncertainty_ : UncertaintyModel or None
        Uncertainty of the forecasts, estimated from held-out trips.
    ranges_ : dict of str to Range
        Range of each quantity over the training trips.
    trip_ids_ : tuple of str
        Training trips.
    held_out_ : tuple of HeldOut
        Forecast of each training trip while its inner fold was held out.
    evidence_ : TripEvidence or None
        Evidence of the training trips on the factors by which the car differs from its simulation, for models of other cars.
    roads_ : ndarray, shape (trips, 9), or None
        Roads of the training trips from `tripwatt.hybrid.segments.driven_roads`, for forecasts without a road. The energy of driving
        is corrected. In a model adapted to another car it is simulated, and `evidence_` holds the correction.
    flags : tuple of Flag
        First flags of every forecast of this model, such as that of a car without trips; empty for a model fitted on its own trips.
    covariates : tuple of str
        Covariates that the corrector uses: columns of the logs beside their signals.
    covariate_errors_ : dict of str to float
        Mean absolute percentage error [1] of the forecasts of `held_out_` "with" and "without" the covariates; empty without covariates.

    Examples
    --------
    >>> import tripwatt as tw
    >>> *logged, last = tw.sample_trips().trips
    >>> model = ForecastModel(tw.load_vehicle("bmw_i3_60ah"), corrector="linear").fit(logged)
    >>> forecast = model.forecast(last)
    >>> low, high = forecast.interval(0.9)
    >>> bool(low < forecast.energy_wh < high)
    True
    """

    vehicle: Vehicle
    corrector: str | Corrector = DEFAULT_CORRECTOR
    seed: int = 0
    corrector_: PowerCorrector | None = None
    uncertainty_: UncertaintyModel | None = None
    ranges_: dict[str, Range] = field(default_factory=dict)
    trip_ids_: tuple[str, ...] = ()
    held_out_: tuple[HeldOut, ...] = ()
    evidence_: TripEvidence | None = None
    roads_: FloatArray | None = None
    flags: tuple[Flag, ...] = ()
    covariates: tuple[str, ...] = ()
    covariate_errors_: dict[str, float] = field(default_factory=dict)

    def fit(
        self,
        trips: Sequence[Trip],
        *,
        cars_of: CarsOf | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> ForecastModel:
        """Fit to raw trips with measured energy. See `fit_segments`.

        Parameters
        ----------
        trips : sequence of Trip
            At least `MIN_TRIPS` trips with measured energy.
        cars_of : callable, optional
            Function from several choices of trips, as indices, to the car with the values that each choice shows. Give it if values of
            the model's car come from the trips; it is called for the inner folds, each without the fold's own trips.
        progress : callable, optional
            Called with (finished fits, all fits).

        Returns
        -------
        ForecastModel
            This model.

        Raises
        ------
        InvalidInput
            If there are fewer than `MIN_TRIPS` trips, or a trip has no measured energy.

        Examples
        --------
        >>> import tripwatt as tw
        >>> trips = tw.sample_trips().trips
        >>> model = tw.ForecastModel(tw.load_vehicle("bmw_i3_60ah"), corrector="linear")
        >>> model.fit(trips)
        <ForecastModel BMW i3 60 Ah, linear corrector, 15 trips>
        """
        table = segment_trips(trips, self.vehicle)
        again = None if cars_of is None else resimulation(trips, table, self.vehicle, cars_of)
        self.fit_segments(
            table,
            routes=linked_trips(trips, self.vehicle),
            free_flow=FreeFlowTrips.from_trips(trips, self.vehicle),
            again=again,
            progress=progress,
        )
        corrector, _ = self.fitted_parts("training")
        self.roads_ = driven_roads(trips, table, driving_w(table) + corrector.predict_driving(table))
        return self

    @one_blas_thread
    def fit_segments(
        self,
        table: SegmentTable,
        *,
        routes: LinkedTrips | None = None,
        free_flow: FreeFlowTrips | None = None,
        again: Again | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> ForecastModel:
        """Fit the corrector, the residual process and the conformal scores to a table of segments.

        This takes one fit of the corrector on all trips, one for each inner fold, and a few for its settings.

        Parameters
        ----------
        table : SegmentTable
            Segments of the training trips, simulated with the car of the model.
        routes : LinkedTrips, optional
            The same trips on links, for the uncertainty of planned routes.
        free_flow : FreeFlowTrips, optional
            The same trips on free-flow links, for the uncertainty of travel times.
        again : callable, optional
            Function that simulates all trips with the car as some of them show it, see `inner.Again`. If not given, the inner folds
            use the car of the table.
        progress : callable, optional
            Called with (finished fits, all fits).

        Returns
        -------
        ForecastModel
            This model.

        Raises
        ------
        InvalidInput
            If there are fewer than `MIN_TRIPS` trips.

        Examples
        --------
        >>> import tripwatt as tw
        >>> trips = tw.sample_trips().trips
        >>> model = tw.ForecastModel(tw.load_vehicle("bmw_i3_60ah"), corrector="linear")
        >>> from tripwatt.hybrid import segment_trips
        >>> len(model.fit_segments(segment_trips(trips, model.vehicle)).trip_ids_)
        15
        """
        if len(table) < MIN_TRIPS:
            fix = "adapt a model of another car with tripwatt fit --base MODEL"
            raise InvalidInput.of("too few trips", "training", str(len(table)), f"at least {MIN_TRIPS}", fix)
        corrector = power_corrector(self.corrector, self.seed)
        if self.covariates:
            corrector = CovariateCorrector(corrector, self.covariates)
        self.corrector_ = corrector.fit(table)
        self.trip_ids_ = table.trip_ids
        self.ranges_ = training_ranges(table, self.covariates)
        self.evidence_ = TripEvidence.from_table(table, self.vehicle)
        self.flags = ()
        held_out: dict[int, HeldOutResidual] = {}
        link_errors: list[FloatArray] = []
        time_errors = np.full(len(table), np.nan)
        n_folds = min(INNER_FOLDS, len(table))
        advance = progress or (lambda *_: None)
        for fold, inner in enumerate(inner_fits(self.corrector, self.seed, self.corrector_, table, again)):
            advance(fold + 1, n_folds + 1)
            # links and driven trace are compared with one car, that of the model
            if routes is not None:
                link_errors.append(routes.differences(inner.corrector, table, inner.members))
            if free_flow is not None:
                time_errors[inner.members] = free_flow.differences(inner.corrector, table, inner.members)
            for i in inner.members:
                held_out[int(i)] = held_out_residual(inner.corrector, inner.table.take([int(i)]))
        route = RouteUncertainty.from_differences(np.concatenate(link_errors)) if link_errors else None
        self._estimate_uncertainty(table, [held_out[i] for i in range(len(table))], route)
        if free_flow is not None and self.uncertainty_ is not None:
            self.uncertainty_ = replace(self.uncertainty_, free_flow=free_flow.uncertainty(time_errors))
        if self.covariates:
            plain = ForecastModel(self.vehicle, self.corrector, self.seed).fit_segments(table, again=again)
            self.covariate_errors_ = {"with": _mape(self.held_out_), "without": _mape(plain.held_out_)}
        advance(n_folds + 1, n_folds + 1)
        return self

    def _estimate_uncertainty(
        self, table: SegmentTable, held_out: Sequence[HeldOutResidual], route: RouteUncertainty | None
    ) -> None:
        observed = table.totals_wh(table.observed_power_w)
        charge = None if table.charge is None else ChargeScale.from_readings(table.charge, observed)
        self.uncertainty_ = UncertaintyModel.from_held_out(held_out, route, charge)
        errors = np.array([trip.error_wh for trip in held_out])
        measured = table.energy_errors
        scores = errors / np.hypot(scale_wh(self.uncertainty_.scale, held_out), measured.own_wh)
        if measured.common.any():
            moved = table.totals_wh(table.columns["moved_w"])
            share = float(np.sqrt(np.mean(measured.common**2)))
            wider = self.uncertainty_.scale.with_share(share, float(observed.sum() / moved.sum()))
            self.uncertainty_ = replace(self.uncertainty_, scale=wider)
        columns = np.stack((observed, observed - errors, scores)).tolist()
        self.held_out_ = tuple(map(HeldOut, table.trip_ids, *columns))

    def fitted_parts(self, where: str) -> tuple[PowerCorrector, UncertaintyModel]:
        """Corrector and uncertainty of a fitted model.

        Parameters
        ----------
        where : str
            Purpose of the call, quoted in the error message.

        Returns
        -------
        tuple of PowerCorrector and UncertaintyModel
            The fitted corrector and the uncertainty.

        Raises
        ------
        InvalidInput
            If the model is not fitted.

        Examples
        --------
        >>> import tripwatt as tw
        >>> corrector, uncertainty = tw.load_model().fitted_parts("an example")
        >>> type(uncertainty).__name__
        'UncertaintyModel'
        """
        if self.corrector_ is None or self.uncertainty_ is None:
            raise InvalidInput.of("model is not fitted", where, "no training trips", fix="call fit first")
        return self.corrector_, self.uncertainty_

    @property
    def outside(self) -> Any:
        """The fitted object from outside in the corrector; None for a corrector of tripwatt.

        A stored model does not contain this object. Store the object as its own package advises, and pass it to `load_model`.
        """
        return fitted_outside(self.corrector_)

    def forecast(self, trip: Plan | Trip, departure: Departure | None = None) -> Forecast:
        """Forecast a trip from what is known at its departure. O(samples).

        Parameters
        ----------
        trip : Plan or Trip
            The drive to forecast. If it is a logged trip, only its speed trace, its road and its first sample are used.
        departure : Departure, optional
            Its known fields replace those of the plan.

        Returns
        -------
        Forecast
            Energy, charge at arrival and their uncertainty.

        Raises
        ------
        InvalidInput
            If the model is not fitted, the plan cannot be simulated, or the forecast breaks a law of physics.

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
        return with_empty_flag(self.expect(trip, departure))

    @one_blas_thread
    def expect(self, trip: Plan | Trip, departure: Departure | None = None) -> Forecast:
        """Forecast as `forecast`, without the flag of a battery that does not last, which takes the charge along the road.

        Parameters
        ----------
        trip : Plan or Trip
            As for `forecast`.
        departure : Departure, optional
            As for `forecast`.

        Returns
        -------
        Forecast
            The same energy and charge as those of `forecast`.

        Raises
        ------
        InvalidInput
            As for `forecast`.

        Examples
        --------
        >>> import tripwatt as tw
        >>> model, plan = tw.load_model(), tw.read_route([{"length_m": 5000.0, "speed_m_s": 15.0}])
        >>> model.expect(plan).energy_wh == model.forecast(plan).energy_wh
        True
        """
        require_departure(departure)
        fix = "make a plan with tripwatt.read_route"
        require_type("trip", trip, Plan | Recorded, "a Plan or a Trip", fix)
        recorded = trip if isinstance(trip, Plan) else Plan.from_trip(trip)
        plan = recorded.with_departure(departure)
        corrector, uncertainty = self.fitted_parts("forecast")
        for name in (departure and departure.covariates) or ():
            if name not in self.covariates:
                raise InvalidInput(Fault.unknown("unknown covariate", "departure", name, self.covariates))
        simulation = simulate_trip(self.vehicle, plan)
        table = segment_table(plan, simulation)
        correction, factor = corrector.predict_with_uncertainty(table, table.hours)
        is_off, terrain = plan.departure.climate == "off", plan.departure.terrain or "unknown"
        if is_off:
            climate = corrector.predict_climate(table)
            correction = correction if climate is None else correction - climate
        segments = process_segments(table, factor, corrector.outside_factor(table))
        drive = ExpectedTrip(plan, self.vehicle, simulation, table, segments, corrector, correction)
        drive = drive.with_pauses(self.expect) if plan.pauses else drive
        posterior = uncertainty.process.prior(segments)
        flags, unknown = compare(table, self.ranges_, self.vehicle, plan.departure)
        missing, covariate_sd_wh = corrector.unknown(table)
        forecast = Forecast(
            drive,
            uncertainty,
            posterior,
            sd_factor=uncertainty.scale.sd_wh(segments) / float(posterior.sd_wh(segments.hours)[-1]),
            state_sd_wh=math.hypot(
                unknown_state_sd_wh(self.vehicle, unknown, float(segments.hours.sum()), is_off),
                unknown_wind_sd_wh(self.vehicle, plan),
                covariate_sd_wh,
                unknown_air_sd_wh(self.vehicle, plan, simulation.simulated_energy_wh)
                if "ambient_temperature_degc" in unknown
                else 0.0,
            ),
            climbing=None if plan.has_road else drive.climbing_energy(net_climbs(terrain).given(plan.climb)),
            flags=(
                *self.flags,
                *flags,
                *(Flag("covariate_unknown", name) for name in missing),
                *_assumed(drive),
                *simulation.flags,
                *kept_temperatures(recorded, departure),
            ),
            model=self,
        )
        forecast = with_route_error(forecast, uncertainty.route, uncertainty.free_flow)
        raise_faults(impossible_faults(float(drive.power_w @ drive.table.hours), drive))
        return forecast

    def to_dict(self) -> dict[str, Any]:
        """Return plain values: the car, the corrector, and the ranges of the training trips.

        Returns
        -------
        dict
            Numbers, texts, lists and further dicts only.

        Examples
        --------
        >>> import tripwatt as tw
        >>> tw.load_model().to_dict()["vehicle"]
        'bmw_i3_60ah'
        """
        return {
            "vehicle": self.vehicle.name,
            "vehicle_title": self.vehicle.title,
            "corrector": corrector_name(self.corrector),
            "seed": self.seed,
            "trips": len(self.trip_ids_),
            "covariates": {name: self.covariate_errors_ for name in [", ".join(self.covariates)] if name},
            "training": {
                name: [seen.low, seen.high] for name, seen in self.ranges_.items() if np.isfinite(seen.low)
            },
        }

    def _title(self) -> str:
        trips = f"{corrector_name(self.corrector)} corrector, {len(self.trip_ids_)} trips"
        return f"{self.vehicle.title}, {trips if self.trip_ids_ else 'no trips'}"

    def __repr__(self) -> str:
        return f"<ForecastModel {self._title()}>"

    def _repr_html_(self) -> str:
        rows = [(name_of(name), span(name, *ends)) for name, ends in self.to_dict()["training"].items()]
        rows += [
            (f"error {how} {', '.join(self.covariates)}", percent(e, 1))
            for how, e in self.covariate_errors_.items()
        ]
        return html_table(f"ForecastModel {self._title()}", [("seen in training", ""), *rows] if rows else [])


def _mape(held_out: Sequence[HeldOut]) -> float:
    return float(np.mean([abs(trip.predicted_wh / trip.observed_wh - 1.0) for trip in held_out]))


def _assumed(drive: ExpectedTrip) -> list[Flag]:
    """Flags for a departure without a state of charge and for a wind of unknown direction."""
    flags, departure = [], drive.plan.departure
    if departure.bms_soc is None and departure.soc is None:
        start = drive.vehicle.battery.displayed_from_soc(float(drive.simulation.soc[0]))
        flags.append(Flag("soc_assumed", "soc", start, "1"))
    air = drive.plan.air
    if air is not None and air.any_side_m_s:
        flags.append(Flag("wind_direction_unknown", "wind_from_deg", departure.wind_speed_m_s, "m_s"))
    return flags
