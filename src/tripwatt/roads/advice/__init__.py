"""Advice about a trip: actions and their savings, the smallest sets that suffice, speeds to keep, messages and progress on the way."""

from tripwatt.roads.advice.actions import Action, leaving_later
from tripwatt.roads.advice.advise import Advice, Advised, SpeedCap, advise
from tripwatt.roads.advice.on_the_way import Companion, Message, Progress
from tripwatt.roads.advice.preheating import Preheating, preheating

__all__ = [
    "Action",
    "Advice",
    "Advised",
    "Companion",
    "Message",
    "Preheating",
    "Progress",
    "SpeedCap",
    "advise",
    "leaving_later",
    "preheating",
]
