"""A fitted model on another car: without a trip of it, and with a few."""

from tripwatt.transfer.adapting import Adaptation, adapt_model, adaptation
from tripwatt.transfer.zero_shot import on_vehicle, other_car, zero_shot_model

__all__ = ["Adaptation", "adapt_model", "adaptation", "on_vehicle", "other_car", "zero_shot_model"]
