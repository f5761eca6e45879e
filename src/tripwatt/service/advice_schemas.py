"""Schemas of the response of `/v1/advice`."""

from __future__ import annotations

from typing import Literal

from tripwatt.forecasting.document import FlagDocument
from tripwatt.service.schemas import ResponseModel


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
        "less_luggage",
    ]
    value: float | None
    """speed [m/s], temperature [°C] or mass [kg]"""
    effort: Literal["none", "little", "some", "much"]
    wall_wh: float
    """energy from the plug [Wh]"""
    before_s: float
    """how long before the departure it begins [s]"""


class DifferenceDocument(ResponseModel):
    """A trip with actions less the trip without them."""

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


class AdviceResponse(ResponseModel):
    """What to do about a trip."""

    reserve: float
    chance: float
    p_arrive: float
    """chance of the trip as it is"""
    soc_arrival: float
    charge_to: float
    """displayed charge to leave with, so that nothing else has to be done; above 1 where a full battery does not suffice"""
    least: list[AdvisedDocument]
    """the smallest sets of actions that reach the chance"""
    singly: list[AdvisedDocument]
    """the mildest action of each group that saves for sure, the largest saving first"""
    flags: list[FlagDocument]
