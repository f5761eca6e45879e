"""Vehicle types of Eclipse SUMO's MMPEVEM model."""

from __future__ import annotations

import math
import re
from typing import Final
from xml.etree import ElementTree

from tools.data.importing.stated import Fields, Stated
from tripwatt.errors import Fault, InvalidInput

ALSO_KNOWN: Final = frozenset(
    {
        "emissionClass",
        "loading",
        "mass",
        "powerLossMap",
        "propulsionEfficiency",
        "radialDragCoefficient",
        "recuperationEfficiency",
        "rotatingMass",
        "stoppingThreshold",
    }
)
"""Parameters of SUMO's MMPEVEM vehicles beside those that are asked for; `has.*` and `device.*` are allowed, too."""


def sumo_types(text: str, where: str) -> dict[str, dict[str, str]]:
    """Parameters of the vehicle types in a SUMO file, by id. Files with a document type or entities are refused."""
    if re.search(r"<!(DOCTYPE|ENTITY)", text):
        allowed = "plain XML without document type and entities"
        raise InvalidInput.of("XML with entities", where, "a document type", allowed)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InvalidInput.of("not an XML file", where, str(error), "XML of SUMO vehicle types") from error
    types: dict[str, dict[str, str]] = {}
    for kind in root.iter("vType"):
        known = {key: value for key, value in kind.items() if key in ("mass", "emissionClass")}
        known |= {param.get("key", ""): param.get("value", "") for param in kind.iter("param")}
        types[kind.get("id", f"vType {len(types) + 1}")] = known
    return types


def from_sumo(text: str, where: str, row: str | None) -> Stated:
    """A vehicle type of SUMO's MMPEVEM model."""
    # The text is decoded by now: a declaration of another encoding would mislead the parser.
    types = sumo_types(re.sub(r"^\s*<\?xml[^>]*\?>", "", text, count=1), where)
    title = row if row is not None else (next(iter(types)) if len(types) == 1 else "")
    if title not in types:
        several = "no single vehicle type", f"{len(types)} types"
        what, got = several if row is None else ("unknown vehicle type", row)
        raise InvalidInput.of(what, where, got, ", ".join(types) or "a <vType>")
    table = types[title]
    place = f"{where}, {title}"
    fields = Fields(table, place)
    if table.get("emissionClass", "MMPEVEM") != "MMPEVEM":
        fields.faults.append(
            Fault("unknown emission class", f"{place}, emissionClass", table["emissionClass"], "MMPEVEM")
        )
    mass_key = "vehicleMass" if "vehicleMass" in table else "mass"
    power_key = "maximumPower" if "maximumPower" in table else "device.battery.maxPower"
    capacity_keys = ("device.battery.capacity", "device.battery.maximumBatteryCapacity")
    capacity_key = next((k for k in capacity_keys if k in table), capacity_keys[0])
    loss_map = table.get("powerLossMap", "").split("|")
    speeds = re.findall(r"[\d.]+", loss_map[1].split(";")[0]) if len(loss_map) == 3 else []
    if not speeds:
        fields.faults.append(Fault("missing entry", f"{place}, powerLossMap", "nothing", "axes and losses"))
    stated = Stated(
        title=title.replace("_", " "),
        mass_kg=fields.number(mass_key),
        load_kg=None,
        drag_coefficient=fields.number("airDragCoefficient"),
        frontal_area_m2=fields.number("frontSurfaceArea"),
        rolling_resistance_coefficient=fields.number("rollDragCoefficient"),
        wheel_radius_m=fields.number("wheelRadius"),
        motor_power_w=fields.number(power_key),
        energy_wh=fields.number(capacity_key),
        base_load_w=fields.number("constantPowerIntake"),
        gearbox_efficiency=fields.number("gearEfficiency"),
        rotating_inertia_kg_m2=fields.optional("internalMomentOfInertia"),
        gear_ratio=fields.number("gearRatio"),
        motor_torque_nm=fields.number("maximumTorque"),
        motor_speed_rad_s=float(speeds[-1]) * math.pi / 30.0 if speeds else None,
        regeneration_torque_nm=fields.optional("maximumRecuperationTorque"),
        regeneration_power_w=fields.optional("maximumRecuperationPower"),
        nominal_voltage_v=fields.number("nominalBatteryVoltage"),
        pack_resistance_ohm=fields.optional("internalBatteryResistance"),
    )
    fields.faults[:0] = [
        Fault("unknown entry", f"{place}, {key}", table[key], "a parameter of the MMPEVEM model")
        for key in table
        if key not in fields.asked | ALSO_KNOWN and not key.startswith(("has.", "device."))
    ]
    fields.done()
    return stated
