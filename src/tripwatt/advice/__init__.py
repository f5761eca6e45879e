"""What to do about a trip: actions with what each saves, the least that helps, speeds along the road, messages on the way."""

from tripwatt.advice.actions import Action, leaving_later
from tripwatt.advice.advise import Advice, Advised, advise
from tripwatt.advice.cruise import Cruise, Front, front, least_energy, least_total_time
from tripwatt.advice.cruise_advice import CruiseAdvice, followable
from tripwatt.advice.cruise_problem import CruiseProblem, CruiseRoad
from tripwatt.advice.on_the_way import Companion, Message
from tripwatt.advice.pacing import Pace
from tripwatt.advice.preheating import Preheating, preheating

__all__ = [
    "Action",
    "Advice",
    "Advised",
    "Companion",
    "Cruise",
    "CruiseAdvice",
    "CruiseProblem",
    "CruiseRoad",
    "Front",
    "Message",
    "Pace",
    "Preheating",
    "advise",
    "followable",
    "front",
    "least_energy",
    "least_total_time",
    "leaving_later",
    "preheating",
]
