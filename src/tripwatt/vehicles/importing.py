"""Vehicle files of other programs as the text of a car's TOML.

Read are those of NREL FASTSim (YAML of version 3, CSV of version 2) and Eclipse SUMO (XML of its MMPEVEM model). What such a file does not hold comes from shared data, from similarity with a bundled car, or from a stated estimate;
each entry says which. Motor efficiency and loss maps of the source are not taken over.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.parsers import expat

from tripwatt.errors import Fault, InvalidInput
from tripwatt.vehicles.loading import vehicle_from_document

LARGEST_FILE_BYTES: Final = 20_000_000
"""Vehicle files are far smaller; larger ones are refused unread."""

DRIVER_KG: Final = 75.0
CELL_VOLTAGE_V: Final = 3.69
"""Mean open-circuit voltage of the shared NMC cell."""
CELLS_IN_SERIES: Final = 96
PACK_KG_PER_KWH: Final = 6.7
"""Packs hold about 0.15 kWh per kilogram."""

Line = tuple[str, float | str, str, str, str]
"""Key, value, unit, source, how it was estimated (empty for a stated value)."""


@dataclass(frozen=True, slots=True)
class Found:
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


def import_vehicle(path: str | Path, row: str | None = None) -> str:
    """Text of a car's TOML for a vehicle file of FASTSim (.yaml, .yml, .csv) or SUMO MMPEVEM (.xml).

    Parameters
    ----------
    path : str or Path
    row : str, optional
        For a CSV table with many vehicles: the scenario name or number of one. For an XML with many vehicle types:
        the id of one.

    Raises
    ------
    InvalidInput
        With everything that the file lacks or that cannot be used.
    """
    file = Path(path)
    readers: dict[str, Callable[[str, str, str | None], Found]] = {
        ".yaml": _from_fastsim_yaml,
        ".yml": _from_fastsim_yaml,
        ".csv": _from_fastsim_csv,
        ".xml": _from_sumo,
    }
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise InvalidInput(Fault("unknown kind of file", str(file), file.suffix, ", ".join(readers)))
    try:
        if file.stat().st_size > LARGEST_FILE_BYTES:
            size, most = f"{file.stat().st_size} bytes", f"at most {LARGEST_FILE_BYTES} bytes"
            raise InvalidInput(Fault("file too large", str(file), size, most))
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInput(Fault("file cannot be read", str(file), str(error), "a text file")) from error
    found = reader(text, str(file), row)
    result = _toml(found, file.name)
    vehicle_from_document(tomllib.loads(result), file.stem, str(file))  # impossible values show here
    return result


class _Fields:
    """Numbers of a flat table of texts; collects what is missing or no number."""

    def __init__(self, table: Mapping[str, str], where: str) -> None:
        self.table, self.where = table, where
        self.faults: list[Fault] = []

    def optional(self, key: str) -> float | None:
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
        value = self.optional(key)
        if value is None:
            self.faults.append(Fault("missing entry", f"{self.where}, {key}", "nothing", "a number"))
            return math.nan
        return value * factor

    def done(self) -> None:
        if self.faults:
            raise InvalidInput(self.faults)


# --------------------------------------------------------------------------------------------------- FASTSim, YAML


def flat_yaml(text: str, where: str) -> dict[str, str]:
    r"""Scalars of block mappings as "outer.inner" -> text; lists are passed over.

    This is the part of YAML in which FASTSim writes its files. What could hide values (tabs, anchors, flow mappings)
    is refused.

    Examples
    --------
    >>> flat_yaml("name: car\nchassis:\n  drag_coef: 0.3 # c_d\n  ratios:\n    - 1.0\n", "car.yaml")
    {'name': 'car', 'chassis.drag_coef': '0.3'}
    """
    result: dict[str, str] = {}
    faults: list[Fault] = []
    path: list[tuple[int, str]] = []
    listed: int | None = None
    for number, raw in enumerate(text.splitlines(), start=1):
        line = re.sub(r"(^|\s)#.*$", "", raw).rstrip()
        bare = line.lstrip(" ")
        indent = len(line) - len(bare)
        if not bare or bare in ("---", "..."):
            continue
        if listed is not None and (indent > listed or (indent == listed and bare.startswith("-"))):
            continue
        listed = indent if bare.startswith("- ") or bare == "-" else None
        if listed is not None:
            continue
        match = re.fullmatch(r"([A-Za-z0-9_ .()%/+-]+?):(?:\s+(.*))?", bare)
        if match is None or (match[2] or "").startswith(("{", "&", "*", "|", ">", "!")):
            allowed = "block mappings `key: value` with spaces, as FASTSim writes them"
            faults.append(Fault("line cannot be read", f"{where}, line {number}", bare[:60], allowed))
            continue
        while path and path[-1][0] >= indent:
            path.pop()
        path.append((indent, match[1]))
        if match[2] is not None:
            result[".".join(key for _, key in path)] = match[2].strip().strip("'\"")
    if faults:
        raise InvalidInput(faults)
    return result


def _from_fastsim_yaml(text: str, where: str, row: str | None) -> Found:
    table = flat_yaml(text, where)
    if not any(key.startswith("pt_type.") for key in table) or "name" not in table:
        allowed = "a vehicle of FASTSim 3 with name, pt_type and chassis"
        raise InvalidInput(Fault("not a FASTSim vehicle", where, ", ".join(list(table)[:5]), allowed))
    kinds = {key.split(".")[1] for key in table if key.startswith("pt_type.")}
    if kinds != {"BEV"}:
        raise InvalidInput(Fault("not a battery electric car", f"{where}, pt_type", ", ".join(kinds), "BEV"))
    fields = _Fields(table, where)
    power = "pt_type.BEV."
    regeneration = fields.optional(f"{power}em.max_regen")
    found = Found(
        title=table["name"],
        mass_kg=fields.number("mass_kilograms"),
        load_kg=fields.optional("chassis.cargo_mass_kilograms"),
        drag_coefficient=fields.number("chassis.drag_coef"),
        frontal_area_m2=fields.number("chassis.frontal_area_square_meters"),
        rolling_resistance_coefficient=fields.number("chassis.wheel_rr_coef"),
        wheel_radius_m=fields.number("chassis.wheel_radius_meters"),
        motor_power_w=fields.number(f"{power}em.pwr_out_max_watts"),
        energy_wh=fields.number(f"{power}res.energy_capacity_joules", 1.0 / 3600.0),
        base_load_w=fields.number("pwr_aux_base_watts"),
        gearbox_efficiency=fields.number(f"{power}transmission.eff_interp"),
        window=(fields.number(f"{power}res.min_soc"), fields.number(f"{power}res.max_soc")),
        regeneration_fraction=regeneration,
        rotating_inertia_kg_m2=_wheels(
            fields, "chassis.wheel_inertia_kilogram_square_meters", "chassis.num_wheels"
        ),
    )
    fields.done()
    return found


def _wheels(fields: _Fields, inertia: str, wheels: str) -> float | None:
    one, count = fields.optional(inertia), fields.optional(wheels)
    return None if one is None or count is None else one * count


# ---------------------------------------------------------------------------------------------------- FASTSim, CSV

CAMEL_NAMES: Final = {
    "vehPtType": "veh_pt_type",
    "maxMotorKw": "mc_max_kw",
    "maxEssKwh": "ess_max_kwh",
    "frontalAreaM2": "frontal_area_m2",
    "maxFuelConvKw": "fc_max_kw",
    "wheelRadiusM": "wheel_radius_m",
    "wheelInertiaKgM2": "wheel_inertia_kg_m2",
}
"""Names in FASTSim's files of one vehicle that do not follow from those of the table by their spelling."""


def _snake(name: str) -> str:
    name = CAMEL_NAMES.get(name, name)
    return re.sub(r"(?<=[a-z0-9])([A-Z])", r"_\1", name).lower()


def _from_fastsim_csv(text: str, where: str, row: str | None) -> Found:
    table = _csv_row(list(csv.reader(io.StringIO(text))), where, row)
    kind = table.get("veh_pt_type", "")
    if kind != "BEV":
        raise InvalidInput(
            Fault("not a battery electric car", f"{where}, veh_pt_type", kind or "nothing", "BEV")
        )
    fields = _Fields(table, where)
    cargo = fields.number("cargo_kg")
    mass = fields.optional("veh_override_kg")
    found = Found(
        title=table.get("scenario name") or table.get("scenario_name") or Path(where).stem,
        mass_kg=mass if mass else _fastsim_mass(fields, cargo),
        load_kg=cargo if not mass or cargo else None,
        drag_coefficient=fields.number("drag_coef"),
        frontal_area_m2=fields.number("frontal_area_m2"),
        rolling_resistance_coefficient=fields.number("wheel_rr_coef"),
        wheel_radius_m=fields.number("wheel_radius_m"),
        motor_power_w=fields.number("mc_max_kw", 1000.0),
        energy_wh=fields.number("ess_max_kwh", 1000.0),
        base_load_w=fields.number("aux_kw", 1000.0),
        gearbox_efficiency=fields.number("trans_eff"),
        window=(fields.number("min_soc"), fields.number("max_soc")),
        regeneration_fraction=fields.number("max_regen"),
        rotating_inertia_kg_m2=_wheels(fields, "wheel_inertia_kg_m2", "num_wheels"),
    )
    fields.done()
    return found


def _fastsim_mass(fields: _Fields, cargo: float) -> float:
    """Sum of the components, as FASTSim 2 adds them up."""
    multiplier = fields.number("comp_mass_multiplier")
    pack = fields.number("ess_max_kwh") * fields.number("ess_kg_per_kwh") + fields.number("ess_base_kg")
    motor = fields.number("mc_max_kw") * fields.number("mc_pe_kg_per_kw") + fields.number("mc_pe_base_kg")
    return cargo + fields.number("glider_kg") + multiplier * (pack + motor + fields.number("trans_kg"))


def _csv_row(lines: list[list[str]], where: str, row: str | None) -> dict[str, str]:
    """One vehicle: the row of a table, or a file of one vehicle with a line for each parameter."""
    if not lines:
        raise InvalidInput(Fault("empty file", where, "no line", "a FASTSim vehicle"))
    head = [name.strip() for name in lines[0]]
    if "Param Name" in head and "Param Value" in head:
        name, value = head.index("Param Name"), head.index("Param Value")
        return {
            _snake(line[name].strip()): line[value].strip()
            for line in lines[1:]
            if len(line) > max(name, value) and line[name].strip()
        }
    names = [_snake(name) if name and name[0].islower() else name.lower() for name in head]
    tables = [dict(zip(names, line, strict=False)) for line in lines[1:]]
    titles = [t.get("scenario name") or t.get("scenario_name") or "" for t in tables]
    if row is None and len(tables) == 1:
        return tables[0]
    for table, title in zip(tables, titles, strict=True):
        if row is not None and row in (title, table.get("selection")):
            return table
    electric = [t for t, table in zip(titles, tables, strict=True) if table.get("veh_pt_type") == "BEV"]
    raise InvalidInput(Fault("which row?", where, row or "no row", ", ".join(electric) or "a scenario name"))


# ------------------------------------------------------------------------------------------------------------ SUMO

SUMO_NAMES: Final = frozenset(
    [
        "vehicleMass",
        "wheelRadius",
        "internalMomentOfInertia",
        "radialDragCoefficient",
        "rollDragCoefficient",
        "airDragCoefficient",
        "frontSurfaceArea",
        "gearRatio",
        "gearEfficiency",
        "maximumTorque",
        "maximumPower",
        "maximumRecuperationTorque",
        "maximumRecuperationPower",
        "internalBatteryResistance",
        "nominalBatteryVoltage",
        "constantPowerIntake",
        "powerLossMap",
        "propulsionEfficiency",
        "recuperationEfficiency",
        "stoppingThreshold",
        "rotatingMass",
        "mass",
        "loading",
    ]
)
"""Parameters of SUMO's MMPEVEM vehicles; `has.*` and `device.*` are allowed besides."""


def sumo_types(text: str, where: str) -> dict[str, dict[str, str]]:
    """Parameters of the vehicle types in a SUMO file, by id. Files with a document type or entities are refused."""
    types: dict[str, dict[str, str]] = {}
    current: list[dict[str, str]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag == "vType":
            current[:] = [{k: v for k, v in attributes.items() if k in ("mass", "emissionClass")}]
            types[attributes.get("id", f"vType {len(types) + 1}")] = current[0]
        elif tag == "param" and current:
            current[0][attributes.get("key", "")] = attributes.get("value", "")

    def end(tag: str) -> None:
        if tag == "vType":
            current.clear()

    def refuse(name: str, *_: object) -> None:
        allowed = "plain XML without document type and entities"
        raise InvalidInput(Fault("file may not define entities", where, name, allowed))

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        raise InvalidInput(
            Fault("not an XML file", where, str(error), "XML of SUMO vehicle types")
        ) from error
    return types


def _from_sumo(text: str, where: str, row: str | None) -> Found:
    # The text is decoded by now: a declaration of another encoding would mislead the parser.
    types = sumo_types(re.sub(r"^\s*<\?xml[^>]*\?>", "", text, count=1), where)
    title = row if row is not None else (next(iter(types)) if len(types) == 1 else "")
    if title not in types:
        raise InvalidInput(
            Fault("which vehicle type?", where, row or "no id", ", ".join(types) or "a <vType>")
        )
    table = types[title]
    place = f"{where}, {title}"
    fields = _Fields(table, place)
    fields.faults += [
        Fault("unknown entry", f"{place}, {key}", table[key], "a parameter of the MMPEVEM model")
        for key in table
        if key not in SUMO_NAMES and key != "emissionClass" and not key.startswith(("has.", "device."))
    ]
    if table.get("emissionClass", "MMPEVEM") != "MMPEVEM":
        fields.faults.append(
            Fault("another model", f"{place}, emissionClass", table["emissionClass"], "MMPEVEM")
        )
    mass_key = "vehicleMass" if "vehicleMass" in table else "mass"
    power_key = "maximumPower" if "maximumPower" in table else "device.battery.maxPower"
    capacity_keys = ("device.battery.capacity", "device.battery.maximumBatteryCapacity")
    capacity_key = next((k for k in capacity_keys if k in table), capacity_keys[0])
    loss_map = table.get("powerLossMap", "").split("|")
    speeds = re.findall(r"[\d.]+", loss_map[1].split(";")[0]) if len(loss_map) == 3 else []
    if not speeds:
        fields.faults.append(Fault("missing entry", f"{place}, powerLossMap", "nothing", "axes and losses"))
    found = Found(
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
    fields.done()
    return found


# ------------------------------------------------------------------------------------------------------------ TOML


def _toml(found: Found, source: str) -> str:
    sections: dict[str, list[Line]] = {
        "body": _body(found, source),
        "road_load": [
            ("drag_coefficient", found.drag_coefficient, "1", source, ""),
            ("frontal_area_m2", found.frontal_area_m2, "m2", source, ""),
            ("rolling_resistance_coefficient", found.rolling_resistance_coefficient, "1", source, ""),
        ],
        "drivetrain": _drivetrain(found, source),
        "regeneration": _regeneration(found, source),
        "battery": _battery(found, source),
        "auxiliaries": [("base_load_w", found.base_load_w, "W", source, "")],
    }
    lines = [
        f"# Taken from {json.dumps(source, ensure_ascii=False)}; the motor's losses are scaled from a bundled car.",
        f"name = {json.dumps(found.title, ensure_ascii=False)}",
        'extends = ["passenger_car", "nmc_cells"]',
        "",
        "[scaled]",
        'motor_losses = "bmw_i3_60ah"',
    ]
    if found.pack_resistance_ohm is None:
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
    return f'{key} = {{ value = {shown}, unit = "{unit}"{scale}, source = {quoted}{how} }}'


def _body(found: Found, source: str) -> list[Line]:
    load = found.load_kg
    how = (
        f"{found.mass_kg:.7g} kg less {load:g} kg of load"
        if load
        else f"less {DRIVER_KG:g} kg for the driver"
    )
    curb = found.mass_kg - (load or DRIVER_KG)
    rows: list[Line] = [("curb_mass_kg", curb, "kg", source, how)]
    if found.rotating_inertia_kg_m2 is not None:
        factor = 1.0 + found.rotating_inertia_kg_m2 / (found.wheel_radius_m**2 * found.mass_kg)
        rows.append(("rotating_mass_factor", factor, "1", source, "from its rotating inertia at the wheels"))
    return rows


def _drivetrain(found: Found, source: str) -> list[Line]:
    i3 = "BMW, technical data i3 (2013)"
    share = found.motor_power_w / 125e3
    return [
        ("wheel_radius_m", found.wheel_radius_m, "m", source, ""),
        ("gear_ratio", found.gear_ratio, "1", source, "")
        if found.gear_ratio
        else ("gear_ratio", 9.665, "1", i3, f"that of the BMW i3; {source} has none"),
        ("gearbox_efficiency", found.gearbox_efficiency, "1", source, ""),
        ("motor_max_torque_nm", found.motor_torque_nm, "Nm", source, "")
        if found.motor_torque_nm
        else ("motor_max_torque_nm", 250.0 * share, "Nm", i3, f"in proportion to power; {source} has none"),
        ("motor_max_power_w", found.motor_power_w, "W", source, ""),
        ("motor_max_speed_rad_s", found.motor_speed_rad_s, "rad/s", source, "end of its loss map")
        if found.motor_speed_rad_s
        else ("motor_max_speed_rad_s", 1193.8, "rad/s", i3, f"that of the BMW i3; {source} has none"),
    ]


def _regeneration(found: Found, source: str) -> list[Line]:
    rows: list[Line] = []
    if found.regeneration_fraction is not None:
        rows.append(("fraction", found.regeneration_fraction, "1", source, ""))
    torque = found.motor_torque_nm or 250.0 * found.motor_power_w / 125e3
    half = f"half of the motor's; {source} has none"
    for key, value, motor, unit in (
        ("max_torque_nm", found.regeneration_torque_nm, torque, "Nm"),
        ("max_power_w", found.regeneration_power_w, found.motor_power_w, "W"),
    ):
        rows.append((key, value, unit, source, "") if value else (key, 0.5 * motor, unit, source, half))
    return rows


def _battery(found: Found, source: str) -> list[Line]:
    cells = CELLS_IN_SERIES
    how = f"{cells} cells, the usual number"
    if found.nominal_voltage_v:
        cells = max(1, round(found.nominal_voltage_v / CELL_VOLTAGE_V))
        how = f"{found.nominal_voltage_v:g} V over {CELL_VOLTAGE_V} V"
    capacity = found.energy_wh / (cells * CELL_VOLTAGE_V)
    kwh = found.energy_wh / 1000.0
    rows: list[Line] = [
        ("capacity_ah", capacity, "Ah", source, f"{kwh:g} kWh over {cells} cells of {CELL_VOLTAGE_V} V"),
        ("cells_in_series", float(cells), "1", source, how),
        (
            "heat_capacity_j_k",
            PACK_KG_PER_KWH * kwh * 1000.0,
            "J/K",
            "general figures of packs, 0.15 kWh/kg; cells 1000 J/(kg K) (Collath et al. 2024)",
            f"pack of {PACK_KG_PER_KWH * kwh:.0f} kg",
        ),
        ("displayed_zero_soc", found.window[0], "1", source, "lowest state of charge that is used"),
        ("displayed_full_soc", found.window[1], "1", source, "highest state of charge that is used"),
    ]
    if found.pack_resistance_ohm is not None:
        cell = found.pack_resistance_ohm / cells
        rows.append(("resistance_soc", "[0.0, 1.0]", "1", "grid of resistance_ohm", ""))
        rows.append(("resistance_ohm", f"[{cell:.10g}, {cell:.10g}]", "ohm", source, f"over {cells} cells"))
    return rows
