"""Forecasts without a road: the energy and charge that a distance needs, and how far a charge carries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import percent
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.forecasting.ranges import unknown_air_sd_wh
from tripwatt.hybrid.factors import FactorCorrector
from tripwatt.hybrid.segments import day_of
from tripwatt.population import for_car
from tripwatt.roads.journey.kinds import (
    KINDS,
    UNKNOWN,
    OwnRoads,
    RoadPrior,
    Shares,
    road_prior,
    shares_of,
    shares_over,
    usual_air,
)
from tripwatt.trips import Departure, Flag, Plan, Trip, require_departure
from tripwatt.trips.columns import Column, number_faults, raise_faults, require_fraction, require_number
from tripwatt.trips.messages import flag_to_dict
from tripwatt.trips.showing import with_interval
from tripwatt.vehicles import Vehicle

NODES_M: Final = (2_000.0, 5_000.0, 15_000.0, 40_000.0, 100_000.0)
"""Lengths of the roads that are forecast; between and beyond these lengths, energy and charge are linear in the distance.
Choices: closer together where starting and arriving count."""
DISTANCES_KM: Final = (0.5, 2000.0)
_MAX_TRIPS: Final = 100
"""Bounds of distances and of equal trips: choices, beyond what a driver plans."""
BAND: Final = (0.05, 0.95)
_HALF: Final = (0.25, 0.75)
_ASSUMED: Final = "usual_value_assumed"
_CHARGE_FLAGS: Final = frozenset({"battery_empty", "battery_full", "no_elevation", "soc_assumed"})
"""Flags that are left out, since they are about the roads of `NODES_M` and the charge at their start, not about the given distance."""


def _tuples_to_lists(values: dict[str, Any]) -> dict[str, Any]:
    """Replace tuples by lists."""
    return {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}


@dataclass(frozen=True, slots=True, repr=False)
class Need:
    """The energy and charge that a distance, or some trips, need.

    Attributes
    ----------
    distance_m : float
        Distance of all trips together [m].
    kind : str
        Kind of the road; "trip" for a known trip.
    energy_wh, energy_quantile_wh : float
        Median of the energy, and energy that is not exceeded with `probability` [Wh].
    probability : float
        Probability that energy and charge suffice, 0.5 to 0.999.
    half_wh, interval_wh : tuple of float
        Ends of the middle half and of the central 90 % [Wh].
    soc_needed : float
        Displayed charge to leave with, to arrive with `reserve` with `probability`. A value above 1 means that a full battery does not
        suffice.
    reserve : float
        Displayed charge to arrive with.
    duration_s : float
        Expected duration [s].
    flags : tuple of Flag
        Assumptions, and values outside of the model's range.
    car, title : str
        Name and title of the car.
    doubt : Doubt
        Sources of the interval.

    Examples
    --------
    >>> import tripwatt as tw
    >>> cold = tw.need(50, departure=tw.Departure(ambient_temperature_degc=-5))
    >>> mild = tw.need(50, departure=tw.Departure(ambient_temperature_degc=20))
    >>> cold.energy_quantile_wh > cold.energy_wh > mild.energy_wh
    True
    """

    distance_m: float
    kind: str
    energy_wh: float
    energy_quantile_wh: float
    probability: float
    half_wh: tuple[float, float]
    interval_wh: tuple[float, float]
    soc_needed: float
    reserve: float
    duration_s: float
    flags: tuple[Flag, ...]
    car: str
    title: str
    doubt: Doubt

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values.

        Returns
        -------
        dict
            Values as in the answer of `GET /v1/need`.

        Examples
        --------
        >>> import tripwatt as tw
        >>> tw.need(50).to_dict()["kind"]
        'mixed'
        """
        return _tuples_to_lists(asdict(self)) | {"flags": [flag_to_dict(flag) for flag in self.flags]}

    def __repr__(self) -> str:
        energy = with_interval(self.energy_wh, self.interval_wh, "kWh")
        road = f"{self.distance_m / 1000.0:.1f} km, {self.kind}"
        return f"<Need {road}: {energy}, {percent(self.soc_needed)} to leave with>"


@dataclass(frozen=True, slots=True)
class KindRange:
    """How far a charge carries on a kind of road.

    Attributes
    ----------
    range_m : float
        Median [m]; 0 if the charge is not above the reserve.
    half_m, interval_m : tuple of float
        Ends of the middle half and of the central 90 % [m]. In 19 of 20 cases, the charge carries at least to the lower end of
        `interval_m`.
    """

    range_m: float
    half_m: tuple[float, float]
    interval_m: tuple[float, float]


@dataclass(frozen=True, slots=True, repr=False)
class Range(KindRange):
    """How far a charge carries.

    Attributes
    ----------
    by_kind : dict of str to KindRange
        The range on each kind of road.
    flags : tuple of Flag
        Assumptions, and values outside of the model's range.
    soc, reserve : float
        Displayed charge at departure, and displayed charge that is kept.
    doubt : Doubt
        Sources of the interval.

    Examples
    --------
    >>> import tripwatt as tw
    >>> far = tw.range_km(soc=0.35, departure=tw.Departure(ambient_temperature_degc=5))
    >>> far.interval_m[0] < far.half_m[0] < far.range_m < far.half_m[1] < far.interval_m[1]
    True
    """

    by_kind: dict[str, KindRange]
    flags: tuple[Flag, ...]
    soc: float
    reserve: float
    doubt: Doubt

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values.

        Returns
        -------
        dict
            Values as in the answer of `GET /v1/range`.

        Examples
        --------
        >>> import tripwatt as tw
        >>> [row["kind"] for row in tw.range_km(soc=0.5).to_dict()["by_kind"]]
        ['city', 'country', 'motorway', 'mixed']
        """
        rows = [{"kind": kind, **_tuples_to_lists(asdict(row))} for kind, row in self.by_kind.items()]
        flags = [flag_to_dict(flag) for flag in self.flags]
        return _tuples_to_lists(asdict(self)) | {"by_kind": rows, "flags": flags}

    def __repr__(self) -> str:
        distance = with_interval(self.range_m, self.interval_m, "km", 0)
        return f"<Range {distance}, from {percent(self.soc)} to {percent(self.reserve)}>"


@dataclass(frozen=True, slots=True)
class Doubt:
    """The sources of an interval, and the single input that would narrow the interval most.

    Attributes
    ----------
    car : float
        Share of the variance by errors of the car's parameters. `car`, `road`, `weather` and `day` add up to 1.
    road : float
        Share by unknown speeds and climb of the road.
    weather : float
        Share by unknown weather and state of the car at departure.
    day : float
        Share by driver, wind, traffic and all that differs from trip to trip.
    narrows : str or None
        "ambient_temperature_degc", "kind" or "own trips"; None if none of these is missing.
    narrower : float
        Largest share by which the interval would be narrower with this input.

    Examples
    --------
    >>> import tripwatt as tw
    >>> doubt = tw.range_km(0.8, car="vw_id3").doubt
    >>> round(doubt.car + doubt.road + doubt.weather + doubt.day, 9), doubt.narrows
    (1.0, 'own trips')
    """

    car: float
    road: float
    weather: float
    day: float
    narrows: str | None
    narrower: float

    @classmethod
    def from_forecast(cls, forecast: Forecast, by_kind: float = 0.0) -> Doubt:
        """Split the variance of a forecast; `by_kind` is the share of the variance of the road that its kind would remove."""
        segments, scale = forecast.drive.segments, forecast.uncertainty.scale
        climb = forecast.sd_wh**2 - float(forecast.along.energy_sd_wh[-1]) ** 2
        car = (scale.values[3] * segments.corrector_sd_wh) ** 2
        day = scale.sd_wh(segments) ** 2 - car
        parts = np.array([car, forecast.route_sd_wh**2 + climb, forecast.state_sd_wh**2, day])
        shares = dict(zip(("car", "road", "weather", "day"), (parts / parts.sum()).tolist(), strict=True))
        missing = {
            "own trips": shares["car"] * any(flag.code == "no_trips_of_car" for flag in forecast.flags),
            "kind": shares["road"] * by_kind,
            "ambient_temperature_degc": shares["weather"]
            * any(f.subject == "ambient_temperature_degc" and f.code == _ASSUMED for f in forecast.flags),
        }
        largest = max(missing, key=lambda name: missing[name])
        narrower = 1.0 - math.sqrt(1.0 - missing[largest])
        return cls(**shares, narrows=largest if narrower > 0.0 else None, narrower=narrower)


@dataclass(frozen=True, slots=True)
class KindForecaster:
    """A forecaster of distances for one car, one departure and one kind of road.

    Attributes
    ----------
    model : ForecastModel
    departure : Departure
    shares : tuple of float
        Shares of the distance in city, country and motorway.
    is_known : bool
        Whether the shares are known; else they are those of an unknown road.
    prior : RoadPrior
    is_named : bool
        Whether the shares are those of a named kind, whose town does not grow with the distance.
    own_roads : OwnRoads or None
        Roads of the car's own trips.
    """

    model: ForecastModel
    departure: Departure
    shares: Shares
    is_known: bool
    prior: RoadPrior
    is_named: bool = False
    own_roads: OwnRoads | None = None

    @classmethod
    def from_kind(
        cls, model: ForecastModel, departure: Departure, kind: str | Sequence[float]
    ) -> KindForecaster:
        """Make the forecaster of a kind of road. The displayed charge of the departure is left out, since it does not change the need."""
        departure, prior, is_named = replace(departure, soc=None), road_prior(), isinstance(kind, str)
        own_roads = roads_of_model(model, prior)
        return cls(model, departure, shares_of(kind), kind != UNKNOWN, prior, is_named, own_roads)

    def quantiles(self, distance_m: float, levels: Sequence[float]) -> tuple[FloatArray, FloatArray, float]:
        """Return quantiles of energy [Wh] and displayed charge [1], shape (levels,), and the duration [s]. At most two forecasts."""
        k = self._node_below(distance_m)
        low, high = (_node_values(self, k + i, tuple(levels)) for i in (0, 1))
        part = (distance_m - NODES_M[k]) / (NODES_M[k + 1] - NODES_M[k])
        energy, charge, duration_s = (a + part * (b - a) for a, b in zip(low, high, strict=True))
        return energy, charge, duration_s

    def inverse(self, amount: float, levels: tuple[float, ...], quantity: Literal[0, 1]) -> list[float]:
        """Return the distances [m] whose quantiles of energy [Wh] (`quantity` 0) or displayed charge (`quantity` 1) are an amount."""
        return [self._inverse(amount, levels, quantity, k) for k in range(len(levels))]

    def _inverse(self, amount: float, levels: tuple[float, ...], of: Literal[0, 1], level: int) -> float:
        longest_first = range(len(NODES_M) - 2, 0, -1)
        k = next((k for k in longest_first if _node_values(self, k, levels)[of][level] <= amount), 0)
        low, high = (float(_node_values(self, k + i, levels)[of][level]) for i in (0, 1))
        part = (amount - low) / max(high - low, 1e-9)
        return max(NODES_M[k] + part * (NODES_M[k + 1] - NODES_M[k]), 0.0)

    def flags_and_doubt(self, distance_m: float) -> tuple[tuple[Flag, ...], Doubt]:
        """Return the flags and the doubt of the road of `NODES_M` whose length is nearest to a distance [m]."""
        k = self._node_below(distance_m)
        roads = self._roads(NODES_M[k])
        known_sd, unknown_sd = (roads.relative_sd(NODES_M[k], known) for known in (True, False))
        by_kind = 0.0 if self.is_known else 1.0 - min(known_sd / unknown_sd, 1.0) ** 2
        return _flags_and_doubt(self, k + (2.0 * distance_m > NODES_M[k] + NODES_M[k + 1]), by_kind)

    def forecast(self, length_m: float) -> Forecast:
        """Forecast a typical road of a length [m], with the variance that remains if only its kind is known."""
        roads = self._roads(length_m)
        shares = self.shares if self.is_known else roads.usual
        if self.is_named and (self.is_known or self.own_roads is None):
            shares = shares_over(shares, length_m)
        plan = replace(roads.plan(length_m, shares), link_m=None)
        relative_sd = roads.relative_sd(length_m, self.is_known)
        if self.own_roads is None:
            forecast = self.model.expect(plan, self.departure)
            return _with_road_variance(forecast, relative_sd * abs(forecast.energy_wh))
        forecast = self._forecast_in_usual_air(plan, self.own_roads)
        drive = forecast.drive.with_more_driving(roads.extra[not self.is_known])
        return _with_road_variance(replace(forecast, drive=drive), relative_sd * drive.driving_wh)

    def _forecast_in_usual_air(self, plan: Plan, own_roads: OwnRoads) -> Forecast:
        """Forecast a plan; if no outside temperature is given, with that of the car's own trips around the day of the year."""
        if self.departure.ambient_temperature_degc is not None:
            return self.model.expect(plan, self.departure)
        degc, sd_k = usual_air(own_roads.air, day_of(self.departure.departs_at))
        forecast = self.model.expect(plan, replace(self.departure, ambient_temperature_degc=degc))
        usual_wh = forecast.drive.simulation.simulated_energy_wh
        air_wh = unknown_air_sd_wh(self.model.vehicle, plan, usual_wh, degc, sd_k)
        assumed = Flag(_ASSUMED, "ambient_temperature_degc", degc, "degc")
        state_sd_wh = math.hypot(forecast.state_sd_wh, air_wh)
        return replace(forecast, state_sd_wh=state_sd_wh, flags=(*forecast.flags, assumed))

    def _roads(self, length_m: float) -> RoadPrior:
        return self.prior if self.own_roads is None else self.own_roads.at(length_m)

    def _node_below(self, distance_m: float) -> int:
        return int(np.clip(np.searchsorted(NODES_M, distance_m) - 1, 0, len(NODES_M) - 2))


def _with_road_variance(forecast: Forecast, sd_wh: float) -> Forecast:
    """Add the standard deviation of an unknown road to a forecast.

    The scores are from held-out trips with known speeds, so they hold only for the rest of the variance.
    """
    variance_wh2, uncertainty = forecast.sds_wh(forecast.open_hours)[-1] ** 2 + sd_wh**2, forecast.uncertainty
    scores = uncertainty.scores.with_other_causes((sd_wh**2 + forecast.state_sd_wh**2) / variance_wh2)
    return replace(forecast, route_sd_wh=sd_wh, uncertainty=replace(uncertainty, scores=scores))


@lru_cache(maxsize=64)
def roads_of_model(model: ForecastModel, prior: RoadPrior) -> OwnRoads | None:
    """Return the roads of the trips on which a model was fitted, combined with a prior; returns None if there are no such trips."""
    if model.roads_ is None or model.evidence_ is None:
        return None
    driven, corrector = model.roads_.copy(), model.corrector_
    if isinstance(corrector, FactorCorrector):
        driven[:, 6] += corrector.driving_wh(model.evidence_)
    driven = driven[np.isfinite(driven[:, 0])]
    if not len(driven):
        return None
    return OwnRoads.from_trips(prior, driven, lambda plan: model.forecast(plan).drive.driving_wh)


@lru_cache(maxsize=24)
def _node_forecast(forecaster: KindForecaster, node: int) -> Forecast:
    """Forecast a typical road of the length number `node` of `NODES_M`; a forecast takes a megabyte, so few are kept."""
    return forecaster.forecast(NODES_M[node])


@lru_cache(maxsize=1024)
def _flags_and_doubt(forecaster: KindForecaster, node: int, by_kind: float) -> tuple[tuple[Flag, ...], Doubt]:
    """Return the flags of `_node_forecast` that hold for other distances, too, and its doubt."""
    forecast = _node_forecast(forecaster, node)
    flags = tuple(flag for flag in forecast.flags if flag.code not in _CHARGE_FLAGS)
    return flags, Doubt.from_forecast(forecast, by_kind)


@lru_cache(maxsize=1024)
def _node_values(forecaster: KindForecaster, node: int, levels: tuple[float, ...]) -> tuple[Any, Any, float]:
    """Return quantiles of the energy [Wh] and displayed charge taken, and the duration [s], of `_node_forecast`."""
    return trip_quantiles(_node_forecast(forecaster, node), levels)


def trip_quantiles(forecast: Forecast, levels: Sequence[float]) -> tuple[FloatArray, FloatArray, float]:
    """Return quantiles of the energy [Wh] and displayed charge that a trip takes, shape (levels,), and its duration [s]."""
    along, n, wh = forecast.along, len(levels), forecast.along.wh_per_display
    sd_wh = np.repeat([along.energy_sd_wh[-1], along.charge_sd[0] * wh, along.charge_sd[-1] * wh], n)
    ends = along.excess.at(*np.repeat([-1, 0, -1], n).tolist())
    more_wh, before_wh, after_wh = np.split(ends.quantiles(np.tile(levels, 3), sd_wh), 3)
    charge = along.charge[0] - along.charge[-1] + (after_wh - before_wh) / wh
    return along.energy_beyond(more_wh, -1), charge, forecast.plan.duration_s


def need(
    distance_km: float | Plan | Trip,
    kind: str | Sequence[float] = UNKNOWN,
    departure: Departure | None = None,
    *,
    model: ForecastModel | Path | str | None = None,
    car: Vehicle | str | None = None,
    probability: float = 0.95,
    trips: int = 1,
    reserve: float = 0.1,
) -> Need:
    """Forecast the energy and charge that a distance needs, without a road.

    The first call for a car, a departure and a kind of road takes up to two forecasts; other distances are then interpolated.

    Parameters
    ----------
    distance_km : float, Plan or Trip
        Distance [km]; or a usual trip of the car, for which `kind` is not used.
    kind : str or sequence of float
        One of `tripwatt.roads.journey.kinds.KINDS`, "mixed", or the shares of the distance in city, country and motorway. "mixed" is the
        kind of a road of which nothing is known.
    departure : Departure, optional
        What is known at departure.
    model : ForecastModel or path, optional
        Model of the car, such as ``car.model()`` for an own car. By default, the model that comes with the package. A model in memory is
        the fastest.
    car : Vehicle or str, optional
        A car other than the model's own.
    probability : float
        Probability that energy and charge suffice, 0.5 to 0.999.
    trips : int
        Number of equal trips ahead. They share their errors in full, so the need of one trip is multiplied by this number.
    reserve : float
        Displayed state of charge to arrive with, part of `Need.soc_needed`.

    Returns
    -------
    Need
        Energy and charge.

    Raises
    ------
    InvalidInput
        If the distance, kind, probability or number of trips is out of its bounds; else as in `ForecastModel.forecast`.

    Examples
    --------
    >>> import tripwatt as tw
    >>> one, five = (tw.need(20, "city", trips=number) for number in (1, 5))
    >>> round(five.energy_quantile_wh / one.energy_quantile_wh, 6)
    5.0
    """
    require_fraction("probability", probability, 0.5, 0.999)
    require_fraction("reserve", reserve)
    raise_faults(number_faults("trips", trips, Column("", 1, _MAX_TRIPS, ""), whole=True))
    n_trips = int(trips)
    own_model, departure = for_car(model, car), require_departure(departure)
    levels = (BAND[0], _HALF[0], 0.5, _HALF[1], BAND[1], probability)
    if isinstance(distance_km, Plan | Trip):
        forecast = own_model.forecast(distance_km, departure)
        energy, _, duration_s = trip_quantiles(forecast, levels)
        taken = soc_needed(forecast, reserve, probability) - reserve
        distance_m, kind_name, flags = forecast.plan.distance_m, "trip", forecast.flags
        doubt = Doubt.from_forecast(forecast)
    else:
        distance_m = 1000.0 * require_number("distance_km", distance_km, *DISTANCES_KM)
        forecaster = KindForecaster.from_kind(own_model, departure, kind)
        kind_name = kind if isinstance(kind, str) else "shares"
        energy, charge, duration_s = forecaster.quantiles(distance_m, levels)
        flags, doubt = forecaster.flags_and_doubt(distance_m)
        taken = float(charge[-1])
    low, lower, median, upper, high, quantile_wh = (n_trips * energy).tolist()
    needed = max(reserve + n_trips * taken, 0.0)
    distance_m, vehicle = n_trips * distance_m, own_model.vehicle
    rest = needed, reserve, n_trips * duration_s, flags, vehicle.name, vehicle.title, doubt
    return Need(distance_m, kind_name, median, quantile_wh, probability, (lower, upper), (low, high), *rest)


def range_km(
    soc: float | None = None,
    kind: str | Sequence[float] = UNKNOWN,
    departure: Departure | None = None,
    *,
    reserve: float = 0.1,
    model: ForecastModel | Path | str | None = None,
    car: Vehicle | str | None = None,
) -> Range:
    """Forecast how far a charge carries, without a road.

    Parameters
    ----------
    soc : float, optional
        Displayed state of charge, 0 to 1. By default, that of the departure, or 1 if the departure has none.
    kind : str or sequence of float
        As for `need`.
    departure : Departure, optional
        What is known at departure.
    reserve : float
        Displayed state of charge that is kept, 0 to 1.
    model : ForecastModel or path, optional
        As for `need`.
    car : Vehicle or str, optional
        As for `need`.

    Returns
    -------
    Range
        Distance with its interval, and by kind of road.

    Raises
    ------
    InvalidInput
        If the charge, reserve or kind is out of its bounds; else as in `ForecastModel.forecast`.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.range_km(0.8).range_m > tw.range_km(0.8, reserve=0.2).range_m
    True
    """
    departure = require_departure(departure)
    given = departure.soc if soc is None else soc
    start = require_fraction("soc", 1.0 if given is None else given)
    spare = max(start - require_fraction("reserve", reserve), 0.0)
    own_model = for_car(model, car)

    def range_by(forecaster: KindForecaster) -> KindRange:
        levels = BAND[1], _HALF[1], 0.5, _HALF[0], BAND[0]
        low, lower, median, upper, high = forecaster.inverse(spare, levels, 1) if spare else [0.0] * 5
        return KindRange(median, (lower, upper), (low, high))

    forecaster_of = partial(KindForecaster.from_kind, own_model, departure)
    of_kind = range_by(forecaster_of(kind))
    by_kind = {name: range_by(forecaster_of(name)) for name in (*KINDS, UNKNOWN)}
    flags, doubt = forecaster_of(kind).flags_and_doubt(of_kind.range_m)
    doubt = doubt if spare else replace(doubt, narrows=None, narrower=0.0)  # of an interval without width
    flags = flags if given is not None else (Flag("soc_assumed", "soc", start, "1"), *flags)
    return Range(**asdict(of_kind), by_kind=by_kind, flags=flags, soc=start, reserve=reserve, doubt=doubt)
