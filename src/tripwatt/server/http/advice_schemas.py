"""Schemas of the response of `/v1/advice`."""

from __future__ import annotations

from typing import Literal

from tripwatt.forecasting.document import FlagDocument
from tripwatt.server.http.schemas import ResponseModel


class ActionDocument(ResponseModel):
    """Something that a driver can do."""

    code: Literal[
        "slower",
        "calmer",
        "setpoint",
        "seats",
        "climate_off",
        "preheat_cabin",
        "preheat_battery",
        "no_roof_box",
        "summer_tyres",
        "check_tyres",
        "pump_up",
        "less_luggage",
        "other_road",
        "leave_later",
        "stop",
    ]
    value: float | None
    """speed [m/s], temperature [°C], mass [kg], tyre pressure over the recommended one, number of the road, stops to charge, or time later [s]"""
    effort: Literal["none", "little", "some", "much"]
    wall_wh: float
    """energy from the plug [Wh]"""
    before_s: float
    """how long before the departure it begins [s]"""


class DifferenceDocument(ResponseModel):
    """A trip less another one of the same car."""

    energy_wh: float
    """below 0 is saved [Wh]"""
    interval_wh: tuple[float, float]
    """ends of the central 90 % [Wh]"""
    duration_s: float
    soc_arrival: float
    """displayed charge at arrival, 0 to 1"""
    p_less: float
    """probability that it takes less energy"""
    by_cause_wh: dict[str, float]


class WholeDocument(ResponseModel):
    """A journey with its stops to charge."""

    duration_s: float
    """driving and charging [s]"""
    charges: int
    p_reserve: float
    """chance to have the reserve at every stop and at the end"""


class AdvisedDocument(ResponseModel):
    """One action, or several together."""

    actions: list[ActionDocument]
    difference: DifferenceDocument
    soc_arrival: float
    p_arrive: float
    """chance to arrive with the reserve"""
    effort: Literal["none", "little", "some", "much"]
    wall_wh: float
    interaction_wh: float
    """what several actions take together beyond the sum of each alone [Wh]"""
    whole: WholeDocument | None
    """with it; null for a trip without stops to charge, or where no plan is sure enough"""


class SpeedCapDocument(ResponseModel):
    """A highest speed, and what it changes beside the speeds of the plan."""

    speed_m_s: float
    longer_s: float
    saved_wh: float
    charging_w: float
    """power of charging below which the trip is quicker in all [W]"""


class AdviceResponse(ResponseModel):
    """What to do about a trip."""

    reserve: float
    chance: float
    p_arrive: float
    """chance to arrive with the reserve, of the trip as it is"""
    soc_arrival: float
    charge_to: float
    """displayed charge to leave with, so that nothing else has to be done; above 1 where a full battery does not suffice"""
    least: list[AdvisedDocument]
    """the smallest sets of actions that reach the chance"""
    singly: list[AdvisedDocument]
    """the mildest action of each group that saves for sure, the largest saving first"""
    whole: WholeDocument | None
    """null for a trip without stops to charge"""
    speeds: list[SpeedCapDocument]
    """highest speeds that save for sure, the fastest first; empty for a slow road"""
    flags: list[FlagDocument]


class PreheatDocument(ResponseModel):
    """What to warm before departure, at the least cost of wall energy, battery energy and comfort."""

    starts_at: str | None
    """when it begins; null without a time of departure"""
    before_s: float
    """how long before the departure it begins [s]"""
    cabin_degc: float | None
    """set-point of the cabin [°C]; null: leave it as it is"""
    cabin_before_s: float
    battery_degc: float | None
    """temperature of the battery at departure [°C]; null: leave it as it is"""
    battery_before_s: float
    wall_wh: float
    """energy from the wall [Wh]"""
    saved_wh: float
    """what the battery gives less, preheating and trip together [Wh]"""


class UntilDeparture(ResponseModel):
    """What to do until a trip."""

    target_soc: float
    """displayed state of charge to leave with, at most 1"""
    departs_at: str | None
    """by when: the time of departure"""
    soc: float | None
    """displayed state of charge now: that of the request or of the last messages; null where unknown or on a trip"""
    charge_wh: float | None
    """energy that is missing in the battery, up to a full one [Wh]"""
    wall_wh: float | None
    """the same from the wall [Wh]"""
    charging_s: float | None
    """time that it takes at the power of the plug [s]; null off the plug"""
    preheat: PreheatDocument | None
    """null where it is not worth it, as off the plug"""
