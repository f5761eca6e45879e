"""What a vehicle file of another program states, and the reading of its numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tripwatt.errors import Fault, raise_faults


@dataclass(frozen=True, slots=True)
class Stated:
    """What a vehicle file states, in our units; None where it does not.

    `mass_kg` is the mass that the source drives with, `load_kg` what of it is load or people.
    """

    title: str
    mass_kg: float
    load_kg: float | None
    drag_coefficient: float
    frontal_area_m2: float
    rolling_resistance_coefficient: float
    wheel_radius_m: float
    motor_power_w: float
    energy_wh: float
    base_load_w: float
    gearbox_efficiency: float
    window: tuple[float, float] = (0.0, 1.0)
    regeneration_fraction: float | None = None
    rotating_inertia_kg_m2: float | None = None
    gear_ratio: float | None = None
    motor_torque_nm: float | None = None
    motor_speed_rad_s: float | None = None
    regeneration_torque_nm: float | None = None
    regeneration_power_w: float | None = None
    nominal_voltage_v: float | None = None
    pack_resistance_ohm: float | None = None


class Fields:
    """Numbers of a flat table of texts; collects what is missing or no number."""

    def __init__(self, table: Mapping[str, str], where: str) -> None:
        self.table, self.where = table, where
        self.faults: list[Fault] = []
        self.asked: set[str] = set()

    def optional(self, key: str) -> float | None:
        """A number, None where the table has none."""
        self.asked.add(key)
        text = self.table.get(key, "").strip()
        if text in ("", "~", "null", "None"):
            return None
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self.faults.append(Fault("not a number", f"{self.where}, {key}", text, "a finite number"))
            return math.nan
        return value

    def number(self, key: str, factor: float = 1.0) -> float:
        """A number that has to be there."""
        value = self.optional(key)
        if value is None:
            self.faults.append(Fault("missing entry", f"{self.where}, {key}", "nothing", "a number"))
            return math.nan
        return value * factor

    def done(self) -> None:
        """Raise `InvalidInput` with every fault."""
        raise_faults(self.faults)
