"""Advice about a trip: which actions help, what they save, and how certain the saving is."""

from __future__ import annotations

import datetime as dt
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import InvalidInput, counted, percent, require_type
from tripwatt.forecasting import Difference, Forecast, ForecastModel
from tripwatt.forecasting.leaving import forecasts_like, soc_needed
from tripwatt.population import for_car
from tripwatt.roads.advice.actions import ALONE, EFFORTS, Action, actions, replan_with
from tripwatt.roads.advice.preheating import CHARGER
from tripwatt.roads.journey import ChargingPlan, Journey, RoadForecast
from tripwatt.roads.journey.stops import with_stops
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.trips.columns import require_fraction
from tripwatt.trips.messages import flag_to_dict
from tripwatt.units import SECONDS_PER_MINUTE, WH_PER_J
from tripwatt.vehicles import Vehicle

_MAX_TOGETHER: Final = 3
"""Largest number of actions that are advised together: a choice, because drivers do not do more at once."""
_MIN_P_LESS: Final = 0.95
"""Smallest chance that an action saves energy at all with which it is advised: a choice, 19 of 20 trips."""
_MIN_P_ARRIVE: Final = 0.05
"""Smallest chance to arrive with an action, with which the action is advised: a choice, since one that fails in 19 of 20 trips is no help."""
_MIN_SAVED_WH: Final = 200.0
_MIN_SAVED_SHARE: Final = 0.02
"""An action is advised if it saves at least this energy [Wh], and this share of the energy of the trip. Choices: less is not worth the effort."""
_MAX_SETS: Final = 3
_MAX_TRIED: Final = 12
"""Largest numbers of sets that are advised, and that are forecast for each size: choices that bound the list and the time."""
_MIN_SUM_SHARE: Final = 0.8
"""A set of actions is forecast only if the sum of its savings is at least this share of the missing energy: actions help or hinder each
other, so the sum is not exact. A choice."""
_EFFORT_MIN: Final = {"none": 0.0, "little": 1.0, "some": 4.0, "much": 15.0}
"""Minutes for which each effort counts when sets of actions are ordered; a choice."""

_ACTION_FIELDS: Final = ("code", "value", "effort", "wall_wh", "before_s")
_ADVISED_FIELDS: Final = ("soc_arrival", "p_arrive", "effort", "wall_wh", "saves")


@dataclass(frozen=True, eq=False, slots=True)
class Advised:
    """One action, or several together, and what they change.

    Attributes
    ----------
    actions : tuple of Action
        Actions, each of another group.
    forecast : Forecast
        Forecast of the trip with the actions.
    difference : Difference
        Trip with the actions minus trip without them; negative values are savings.
    soc_arrival : float
        Expected displayed charge at arrival, with the stops to charge.
    p_arrive : float
        Chance to arrive with the reserve, with the stops to charge.
    whole : ChargingPlan or None
        The journey with its stops to charge; None if there are none with and without the actions.

    Examples
    --------
    >>> import tripwatt as tw
    >>> road = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 33.0}])
    >>> first = tw.advise(road, tw.Departure(soc=0.8, ambient_temperature_degc=20.0)).singly[0]
    >>> first.actions[0].code, first.effort, first.wall_wh
    ('slower', 'little', 0.0)
    """

    actions: tuple[Action, ...]
    forecast: Forecast
    difference: Difference
    soc_arrival: float
    p_arrive: float
    whole: ChargingPlan | None = None

    @property
    def effort(self) -> str:
        """Effort of the hardest action."""
        return max((action.effort for action in self.actions), key=EFFORTS.index)

    @property
    def wall_wh(self) -> float:
        """Energy from the plug [Wh]."""
        return float(sum(action.wall_wh for action in self.actions))

    @property
    def saves(self) -> str:
        """Whether the action takes less from the plug in all ("energy"), or the battery holds longer and the plug gives more ("range")."""
        return "energy" if -self.difference.energy_wh / CHARGER > self.wall_wh else "range"

    @property
    def cost_min(self) -> float:
        """Minutes that the trip takes longer, plus the minutes for which the efforts count [min]."""
        effort = sum(_EFFORT_MIN[action.effort] for action in self.actions)
        return max(self.difference.duration_s, 0.0) / SECONDS_PER_MINUTE + effort

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values.

        Returns
        -------
        dict
            Numbers, texts, lists and further dicts only.

        Examples
        --------
        >>> import tripwatt as tw
        >>> road = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 33.0}])
        >>> advice = tw.advise(road, tw.Departure(soc=0.8, ambient_temperature_degc=20.0))
        >>> advice.singly[0].to_dict()["actions"][0]["code"]
        'slower'
        """
        return {
            "actions": [{name: getattr(action, name) for name in _ACTION_FIELDS} for action in self.actions],
            "difference": self.difference.to_dict(),
            **{name: getattr(self, name) for name in _ADVISED_FIELDS},
            "whole": self.whole and self.whole.in_short,
        }


@dataclass(frozen=True, slots=True)
class SpeedCap:
    """A highest speed, and the time and energy that it changes compared with the speeds of the plan.

    Attributes
    ----------
    speed_m_s : float
        Highest speed [m/s].
    longer_s : float
        Additional driving time [s].
    saved_wh : float
        Saved energy [Wh].

    Examples
    --------
    >>> SpeedCap(33.3, longer_s=180.0, saved_wh=1000.0).charging_w
    20000.0
    """

    speed_m_s: float
    longer_s: float
    saved_wh: float

    @property
    def charging_w(self) -> float:
        """Charging power below which the whole trip is quicker at this speed, since the saved energy need not be charged [W]."""
        return self.saved_wh / WH_PER_J / self.longer_s

    def to_dict(self) -> dict[str, float]:
        """Convert to plain values.

        Returns
        -------
        dict
            Numbers.

        Examples
        --------
        >>> sorted(SpeedCap(33.3, 180.0, 1000.0).to_dict())
        ['charging_w', 'longer_s', 'saved_wh', 'speed_m_s']
        """
        return {name: getattr(self, name) for name in (*SpeedCap.__slots__, "charging_w")}


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Advice:
    """Advice about a trip.

    Attributes
    ----------
    forecast : Forecast
        Forecast of the trip as it is.
    reserve, probability : float
        Displayed charge to arrive with, and the required probability to do so.
    p_arrive : float
        Chance to arrive with the reserve on the trip as it is.
    charge_to : float
        Displayed charge to leave with, so that nothing else has to be done. A value above 1 means that a full battery does not suffice.
    least : tuple of Advised
        Sets of actions that reach the required probability, the smallest `cost_min` first. Empty if the trip reaches it as it is, or no set
        does.
    singly : tuple of Advised
        The mildest action of each group that certainly saves energy, the largest saving first. Each has a chance to arrive of at least
        5 %, and another road at least that of the road as it is, in whole percents.
    speeds : tuple of SpeedCap
        Highest speeds that certainly save energy, the fastest first; empty for a slow road.
    whole : ChargingPlan or None
        The journey as it is with its stops to charge; None for a trip without stops.

    Examples
    --------
    >>> import tripwatt as tw
    >>> road = tw.read_route([{"length_m": 80_000.0, "speed_m_s": 35.0, "grade": 0.0}])
    >>> advice = tw.advise(road, tw.Departure(soc=0.9, ambient_temperature_degc=15.0))
    >>> advice.p_arrive < advice.probability <= advice.least[0].p_arrive
    True
    >>> advice.least[0].actions[0].code
    'slower'
    >>> [round(3.6 * cap.speed_m_s) for cap in advice.speeds]
    [120, 110, 100, 90, 80]
    """

    forecast: Forecast
    reserve: float
    probability: float
    p_arrive: float
    charge_to: float
    least: tuple[Advised, ...]
    singly: tuple[Advised, ...]
    speeds: tuple[SpeedCap, ...]
    whole: ChargingPlan | None = None

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values.

        Returns
        -------
        dict
            Values as in the answer of `POST /v1/advice`.

        Examples
        --------
        >>> import tripwatt as tw
        >>> road = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])
        >>> tw.advise(road, tw.Departure(soc=0.9)).to_dict()["least"]
        []
        """
        return {
            "reserve": self.reserve,
            "probability": self.probability,
            "p_arrive": self.p_arrive,
            "soc_arrival": self.forecast.soc_arrival,
            "charge_to": self.charge_to,
            "least": [advised.to_dict() for advised in self.least],
            "singly": [advised.to_dict() for advised in self.singly],
            "whole": self.whole and self.whole.in_short,
            "speeds": [cap.to_dict() for cap in self.speeds],
            "flags": [flag_to_dict(flag) for flag in self.forecast.flags],
        }

    def __repr__(self) -> str:
        chance, reserve, charge = map(percent, (self.p_arrive, self.reserve, self.charge_to))
        helps = f"{charge} to leave with, {counted(len(self.singly), 'action')} to save energy"
        return f"<Advice {self.forecast.plan.trip_id}: chance of {chance} to arrive with {reserve}, {helps}>"


def advise(
    trip: Plan | Trip | Journey | Forecast,
    departure: Departure | None = None,
    car: Vehicle | str | None = None,
    model: ForecastModel | Path | str | None = None,
    *,
    reserve: float = 0.1,
    probability: float = 0.95,
    others: Sequence[tuple[Action, Forecast]] = (),
    now: dt.datetime | None = None,
) -> Advice:
    """Find actions that help a trip to arrive or save energy. O(actions x samples).

    Parameters
    ----------
    trip : Plan, Trip, Journey or Forecast
        The trip ahead. A journey and a forecast have their own car and departure.
    departure : Departure, optional
        What is known when the car leaves.
    car : Vehicle or str, optional
        A car other than the model's own.
    model : ForecastModel or path, optional
        Model of the car. By default, the model that comes with the package.
    reserve : float
        Displayed state of charge to arrive with, 0 to 1.
    probability : float
        Required probability to arrive with the reserve, 0.5 to 0.999.
    others : sequence of (Action, Forecast)
        Other ways to make the trip, with their forecasts, such as from `leaving_later`. The other roads of a journey are always added.
    now : datetime, optional
        What has to begin before this time is not advised; without a time of departure, the car leaves now. By default, there is time.

    Returns
    -------
    Advice
        Actions with their savings, and the sets of actions that suffice.

    Raises
    ------
    InvalidInput
        If the reserve or the probability is out of its bounds, or the forecast was updated on the way; else as in `ForecastModel.forecast`.

    Examples
    --------
    >>> import tripwatt as tw
    >>> road = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])
    >>> cold = tw.advise(road, tw.Departure(soc=0.8, ambient_temperature_degc=-5.0, extras=("roof_box",)))
    >>> cold.least, [advised.actions[0].code for advised in cold.singly][:2]
    ((), ['no_roof_box', 'setpoint'])
    """
    require_fraction("reserve", reserve)
    require_fraction("probability", probability, 0.5, 0.999)
    if isinstance(trip, Journey | Forecast):
        forecast = _forecast_before_departure(trip, departure, car, model)
    else:
        forecast = for_car(model, car).forecast(trip, departure)
    p_arrive, roads = forecast.p_arrive(reserve), trip.roads if isinstance(trip, Journey) else ()
    wholes = [road.whole(reserve) for road in roads]
    ways = [
        (Action("other_road", "road", "none", {}, float(k)), road.forecast)
        for k, (road, plan) in enumerate(zip(roads, wholes, strict=True))
        if k and round(plan.p_reserve, 2) >= round(wholes[0].p_reserve, 2)
    ] + [*require_type("others", others, Sequence, "a list")]
    forecast_again = forecasts_like(forecast)

    def with_actions(*chosen: Action) -> Advised:
        plan = forecast.plan
        for action in chosen:
            plan = action.apply_to(plan)
        return _compared(chosen, forecast_again(plan), forecast, reserve)

    leaves = forecast.plan.departure.departs_at or now
    left_s = math.inf if now is None or leaves is None else max((leaves - now).total_seconds(), 0.0)
    candidates = [with_actions(one) for one in actions(forecast) if one.before_s <= left_s]
    candidates += [_compared((action,), way, forecast, reserve) for action, way in ways]
    least_wh = max(_MIN_SAVED_WH, _MIN_SAVED_SHARE * forecast.energy_wh)
    likely = [advised for advised in candidates if advised.difference.p_less >= _MIN_P_LESS]
    saving = [advised for advised in likely if advised.difference.energy_wh <= -least_wh]
    mildest = {advised.actions[0].group: advised for advised in reversed(saving)}
    counted = [_with_stops(trip, one) if isinstance(trip, Journey) else one for one in mildest.values()]
    singly = [
        advised
        for advised in sorted(counted, key=lambda advised: advised.difference.energy_wh)
        if advised.difference.energy_wh <= -least_wh and advised.p_arrive >= _MIN_P_ARRIVE
    ]
    speeds = [
        SpeedCap(cap, advised.difference.duration_s, -advised.difference.energy_wh)
        for advised in saving
        if (cap := advised.actions[0].speed_m_s) is not None
    ]
    charge_to = soc_needed(forecast, reserve, probability)
    lacking_wh = (charge_to - float(forecast.along.expected_soc[0])) * forecast.charge.wh_per_display
    least = _smallest_sets(with_actions, saving, probability, lacking_wh) if p_arrive < probability else []
    whole = trip.charging if isinstance(trip, Journey) else None
    return Advice(
        forecast, reserve, probability, p_arrive, charge_to, tuple(least), tuple(singly), tuple(speeds), whole
    )


def _with_stops(journey: Journey, advised: Advised) -> Advised:
    """Compare a journey and its stops to charge with an action and without it; unchanged if there are no stops."""
    (action,), (first, *_), corridor = advised.actions, journey.roads, journey.corridor
    road = RoadForecast(first.road, advised.forecast)
    if action.group == "road":
        road = journey.roads[int(action.value or 0)]
    elif corridor is not None:
        road = replace(road, charging=replan_with(corridor, action, advised.forecast))
    whole, before = road.whole(journey.reserve), first.whole(journey.reserve)
    if not whole.stops and not before.stops:
        return advised
    difference, arrival = with_stops(advised.difference, whole, before), whole.soc_arrival
    return replace(advised, whole=whole, difference=difference, soc_arrival=arrival, p_arrive=whole.p_reserve)


def _forecast_before_departure(trip: Journey | Forecast, *other_arguments: object) -> Forecast:
    """Return the forecast of a journey or a given forecast; raise `InvalidInput` if it cannot be used, or other arguments are given."""
    forecast = trip.forecast if isinstance(trip, Journey) else trip
    if any(value is not None for value in other_arguments):
        allowed = "only with a plan or a trip"
        raise InvalidInput.of("given twice", "departure, car, model", "beside a forecast", allowed)
    if forecast.model is None or forecast.measured_until_s:
        got = "one that was updated on the way" if forecast.measured_until_s else "one that was put together"
        raise InvalidInput.of("no advice for it", "trip", got, "the forecast of a model before departure")
    return forecast


def _compared(chosen: tuple[Action, ...], changed: Forecast, before: Forecast, reserve: float) -> Advised:
    """Compare the forecast of a trip with some actions with a forecast without them."""
    difference = changed.difference(before)
    return Advised(chosen, changed, difference, changed.soc_arrival, changed.p_arrive(reserve))


def _smallest_sets(
    with_actions: Callable[..., Advised], singly: Sequence[Advised], probability: float, lacking_wh: float
) -> list[Advised]:
    """Find up to `_MAX_SETS` sets of actions that reach the required probability: the smallest sets, and larger ones that cost less.

    Sets are forecast in the order of the sum of their costs, if the sum of their savings is at least `_MIN_SUM_SHARE` times the missing
    energy `lacking_wh`. From sets with the same codes, only the cheapest is kept.
    """
    sufficient: dict[tuple[str, ...], Advised] = {}
    for size in range(1, _MAX_TOGETHER + 1):
        max_cost = min((advised.cost_min for advised in sufficient.values()), default=math.inf)
        sets = [chosen for chosen in itertools.combinations(singly, size) if _can_be_combined(chosen)]
        promising = [
            (cost, chosen)
            for chosen in sets
            if (cost := sum(advised.cost_min for advised in chosen)) < max_cost
            and -sum(advised.difference.energy_wh for advised in chosen) >= _MIN_SUM_SHARE * lacking_wh
        ]
        for _, chosen in sorted(promising, key=lambda pair: pair[0])[:_MAX_TRIED]:
            codes = tuple(advised.actions[0].code for advised in chosen)
            if codes not in sufficient and len(sufficient) < _MAX_SETS:
                together = with_actions(*(advised.actions[0] for advised in chosen))
                if together.p_arrive >= probability:
                    sufficient[codes] = together
    return sorted(sufficient.values(), key=lambda advised: advised.cost_min)


def _can_be_combined(chosen: Sequence[Advised]) -> bool:
    groups = [advised.actions[0].group for advised in chosen]
    return len({*groups}) == len(groups) and (len(groups) == 1 or not {*groups} & {*ALONE})
