"""The text of a car's TOML for what a vehicle file states, with what stands in for the rest."""

from __future__ import annotations

import json
from typing import Final

from tools.data.importing.stated import Stated

DRIVER_KG: Final = 75.0
CELL_VOLTAGE_V: Final = 3.69
"""Mean open-circuit voltage of the shared NMC cell."""
CELLS_IN_SERIES: Final = 96
PACK_KG_PER_KWH: Final = 6.7
"""Packs hold about 0.15 kWh per kilogram."""

I3: Final = "BMW, technical data i3 (2013)"
PACKS: Final = "general figures of packs, 0.15 kWh/kg; cells 1000 J/(kg K) (Collath et al. 2024)"
GRID: Final = "grid of resistance_ohm"
LICENCES: Final = {I3: "facts", PACKS: "estimate AND facts", GRID: "estimate"}
"""Licence of each source other than the imported file."""

Line = tuple[str, float | str, str, str, str]
"""Key, value, unit, source, how it was estimated (empty for a stated value)."""


def vehicle_toml(stated: Stated, source: str) -> str:
    """The text of a car's TOML, each entry with where it comes from."""
    sections: dict[str, list[Line]] = {
        "body": _body(stated, source),
        "road_load": [
            ("drag_coefficient", stated.drag_coefficient, "1", source, ""),
            ("frontal_area_m2", stated.frontal_area_m2, "m2", source, ""),
            ("rolling_resistance_coefficient", stated.rolling_resistance_coefficient, "1", source, ""),
        ],
        "drivetrain": _drivetrain(stated, source),
        "regeneration": _regeneration(stated, source),
        "battery": _battery(stated, source),
        "auxiliaries": [("base_load_w", stated.base_load_w, "W", source, "")],
    }
    lines = [
        f"# Taken from {json.dumps(source, ensure_ascii=False)}; the motor's losses are scaled from a bundled car.",
        f"name = {json.dumps(stated.title, ensure_ascii=False)}",
        'extends = ["passenger_car", "nmc_cells"]',
        'licence = "as-source-file"',
        "",
        "[scaled]",
        'motor_losses = "permanent_magnet_motor"',
    ]
    if stated.pack_resistance_ohm is None:
        lines.append('cell_resistance = "bmw_i3_94ah"')
    for section, rows in sections.items():
        lines += ["", f"[{section}]", *(_toml_line(row) for row in rows)]
    return "\n".join(lines) + "\n"


def _toml_line(line: Line) -> str:
    key, value, unit, source, estimated = line
    shown = value if isinstance(value, str) else repr(float(f"{value:.8g}"))
    scale = ', scale = "soc"' if key == "capacity_ah" else ""
    how = f", estimated = {json.dumps(estimated, ensure_ascii=False)}" if estimated else ""
    quoted = json.dumps(source, ensure_ascii=False)
    licence = f', licence = "{LICENCES[source]}"' if source in LICENCES else ""
    return f'{key} = {{ value = {shown}, unit = "{unit}"{scale}, source = {quoted}{how}{licence} }}'


def _body(stated: Stated, source: str) -> list[Line]:
    load = stated.load_kg
    how = (
        f"{stated.mass_kg:.7g} kg less {load:g} kg of load"
        if load
        else f"less {DRIVER_KG:g} kg for the driver"
    )
    curb = stated.mass_kg - (load or DRIVER_KG)
    rows: list[Line] = [("curb_mass_kg", curb, "kg", source, how)]
    if stated.rotating_inertia_kg_m2 is not None:
        factor = 1.0 + stated.rotating_inertia_kg_m2 / (stated.wheel_radius_m**2 * stated.mass_kg)
        rows.append(("rotating_mass_factor", factor, "1", source, "from its rotating inertia at the wheels"))
    return rows


def _drivetrain(stated: Stated, source: str) -> list[Line]:
    share = stated.motor_power_w / 125e3
    return [
        ("wheel_radius_m", stated.wheel_radius_m, "m", source, ""),
        ("gear_ratio", stated.gear_ratio, "1", source, "")
        if stated.gear_ratio
        else ("gear_ratio", 9.665, "1", I3, f"that of the BMW i3; {source} has none"),
        ("gearbox_efficiency", stated.gearbox_efficiency, "1", source, ""),
        ("motor_max_torque_nm", stated.motor_torque_nm, "Nm", source, "")
        if stated.motor_torque_nm
        else ("motor_max_torque_nm", 250.0 * share, "Nm", I3, f"in proportion to power; {source} has none"),
        ("motor_max_power_w", stated.motor_power_w, "W", source, ""),
        ("motor_max_speed_rad_s", stated.motor_speed_rad_s, "rad/s", source, "end of its loss map")
        if stated.motor_speed_rad_s
        else ("motor_max_speed_rad_s", 1193.8, "rad/s", I3, f"that of the BMW i3; {source} has none"),
    ]


def _regeneration(stated: Stated, source: str) -> list[Line]:
    rows: list[Line] = []
    if stated.regeneration_fraction is not None:
        rows.append(("fraction", stated.regeneration_fraction, "1", source, ""))
    torque = stated.motor_torque_nm or 250.0 * stated.motor_power_w / 125e3
    half = f"half of the motor's; {source} has none"
    for key, value, motor, unit in (
        ("max_torque_nm", stated.regeneration_torque_nm, torque, "Nm"),
        ("max_power_w", stated.regeneration_power_w, stated.motor_power_w, "W"),
    ):
        rows.append((key, value, unit, source, "") if value else (key, 0.5 * motor, unit, source, half))
    return rows


def _battery(stated: Stated, source: str) -> list[Line]:
    cells = CELLS_IN_SERIES
    how = f"{cells} cells, the usual number"
    if stated.nominal_voltage_v:
        cells = max(1, round(stated.nominal_voltage_v / CELL_VOLTAGE_V))
        how = f"{stated.nominal_voltage_v:g} V over {CELL_VOLTAGE_V} V"
    capacity = stated.energy_wh / (cells * CELL_VOLTAGE_V)
    kwh = stated.energy_wh / 1000.0
    rows: list[Line] = [
        ("capacity_ah", capacity, "Ah", source, f"{kwh:g} kWh over {cells} cells of {CELL_VOLTAGE_V} V"),
        ("cells_in_series", float(cells), "1", source, how),
        (
            "heat_capacity_j_k",
            PACK_KG_PER_KWH * kwh * 1000.0,
            "J/K",
            PACKS,
            f"pack of {PACK_KG_PER_KWH * kwh:.0f} kg",
        ),
        ("displayed_zero_soc", stated.window[0], "1", source, "lowest state of charge that is used"),
        ("displayed_full_soc", stated.window[1], "1", source, "highest state of charge that is used"),
    ]
    if stated.pack_resistance_ohm is not None:
        cell = stated.pack_resistance_ohm / cells
        rows.append(("resistance_soc", "[0.0, 1.0]", "1", GRID, ""))
        rows.append(("resistance_ohm", f"[{cell:.10g}, {cell:.10g}]", "ohm", source, f"over {cells} cells"))
    return rows
