"""What to do about a trip: actions, what each saves and how sure that is, and the least that helps."""

from tripwatt.advice.actions import Action
from tripwatt.advice.advise import Advice, Advised, advise
from tripwatt.advice.on_the_way import Companion, Message

__all__ = ["Action", "Advice", "Advised", "Companion", "Message", "advise"]
