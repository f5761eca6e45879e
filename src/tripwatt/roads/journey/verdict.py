"""The verdict on a whole journey: whether it arrives, when, with what charge, and what to do."""

from __future__ import annotations

import datetime as dt
from dataclasses import asdict, dataclass
from typing import Any, Literal

from tripwatt.roads.journey.corridor import CERTAIN
from tripwatt.roads.journey.stops import JOURNEY_FIELDS, START_M, ChargingPlan, Leg
from tripwatt.routes.terrain import net_climbs

Advice = Literal["go", "stop", "charge_first", "charge_before", "slower", "none"]
Reason = Literal["", "leaves_below_reserve", "to_a_stop", "to_the_end", "unknown_heights"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on a whole journey, with its stops to charge.

    Attributes
    ----------
    arrives : bool
        Whether at least 19 of 20 such journeys have the reserve at every stop and at the end.
    p_arrive, p_reserve : float
        Probability that the battery is never empty, and that there is the reserve at every stop and at the end.
    soc_arrival : float
        Expected displayed charge at the destination.
    soc_interval : tuple of float
        90 % interval of the charge at the destination.
    driving_s, charging_s, duration_s : float
        Time on the road, time at stations with overheads, and their sum [s].
    departs_at, arrives_at : datetime or None
        Local times; None if the time of departure is not known.
    energy_wh : float
        Energy of the whole journey [Wh].
    charges : int
        Number of stops to charge.
    advice : str
        "go"; "stop" to charge on the way; "charge_first" if the first stop is within 2 km of the start, for who leaves below the reserve or
        wants it; "charge_before" to leave with more; "slower"; "none" if nothing helps.
    reason : str
        What the driver has to know first: "leaves_below_reserve", since then the reserve counts after the first stop only; "to_a_stop" or
        "to_the_end" if the charge does not suffice there; "unknown_heights" if it does not suffice on a road of unknown heights that
        climbs as far as all but 1 in 20 roads in mountains, or in 20 roads past places of the known heights; "" if there is nothing.

    Examples
    --------
    >>> import tripwatt as tw
    >>> journey = tw.plan_journey(["Vaduz", "Malbun"], tw.Departure(soc=0.6), atlas="map")  # doctest: +SKIP
    >>> journey.verdict.advice  # doctest: +SKIP
    'go'
    """

    arrives: bool
    p_arrive: float
    p_reserve: float
    soc_arrival: float
    soc_interval: tuple[float, float]
    driving_s: float
    charging_s: float
    duration_s: float
    departs_at: dt.datetime | None
    arrives_at: dt.datetime | None
    energy_wh: float
    charges: int
    advice: Advice
    reason: Reason

    @classmethod
    def from_plan(cls, plan: ChargingPlan, advice_else: Advice) -> Verdict:
        """Make the verdict on the plan of a whole journey; `advice_else` is the advice if the journey does not arrive."""
        leaves, arrives = plan.legs[0].forecast.plan.departure.departs_at, plan.p_reserve >= CERTAIN
        stops = plan.stops
        advice: Advice = "go" if not stops else "charge_first" if stops[0].position_m < START_M else "stop"
        return cls(
            arrives=arrives,
            departs_at=leaves,
            arrives_at=None if leaves is None else leaves + dt.timedelta(seconds=plan.duration_s),
            charges=len(stops),
            advice=advice if arrives else advice_else,
            reason=_reason(plan, arrives),
            **{name: getattr(plan, name) for name in JOURNEY_FIELDS},
        )

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values, with times as ISO 8601.

        Returns
        -------
        dict
            One key for each attribute.
        """
        values = {**asdict(self), "soc_interval": list(self.soc_interval)}
        for name in ("departs_at", "arrives_at"):
            values[name] = values[name] and values[name].isoformat(timespec="seconds")
        return values


def _reason(plan: ChargingPlan, arrives: bool) -> Reason:
    if plan.leaves_below_reserve:
        return "leaves_below_reserve"
    if arrives:
        return "" if all(_covers_climb(leg, plan.reserve) for leg in plan.legs) else "unknown_heights"
    least = min(range(len(plan.legs)), key=plan.leg_chances.__getitem__)
    return "to_the_end" if least == len(plan.legs) - 1 else "to_a_stop"


def _covers_climb(leg: Leg, reserve: float) -> bool:
    """Return whether a leg ends with a reserve if its heights are known, or if it climbs as far as all but 1 in 20 such roads, or roads in mountains."""
    climb_m, road_m = leg.forecast.climb_to(min(reserve + leg.preheat_soc, 1.0)), leg.forecast.plan.distance_m
    net = net_climbs("mountains").given(leg.forecast.plan.climb)
    return climb_m is None or climb_m >= float(net.quantile(CERTAIN, road_m))
