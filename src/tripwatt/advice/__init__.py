"""What to do about a forecast: speeds along the road."""

from tripwatt.advice.cruise import Cruise, Front, front, least_energy, least_total_time
from tripwatt.advice.cruise_advice import CruiseAdvice, followable
from tripwatt.advice.cruise_problem import CruiseProblem, CruiseRoad

__all__ = [
    "Cruise",
    "CruiseAdvice",
    "CruiseProblem",
    "CruiseRoad",
    "Front",
    "followable",
    "front",
    "least_energy",
    "least_total_time",
]
