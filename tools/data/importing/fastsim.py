"""Vehicle files of NREL FASTSim: YAML of version 3, YAML and CSV of version 2."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from tools.data.importing.stated import Fields, Stated
from tripwatt.errors import Fault, InvalidInput, raise_faults


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
    raise_faults(faults)
    return result


def from_fastsim_yaml(text: str, where: str, row: str | None) -> Stated:
    """A vehicle of FASTSim 3, or one of FASTSim 2 as that version writes it, in YAML."""
    table = flat_yaml(text, where)
    if "veh_pt_type" in table:
        return _from_version_2(table, where)
    if not any(key.startswith("pt_type.") for key in table) or "name" not in table:
        allowed = "a vehicle of FASTSim 3 with name, pt_type and chassis, or of FASTSim 2 with veh_pt_type"
        raise InvalidInput.of("not a FASTSim vehicle", where, ", ".join(list(table)[:5]), allowed)
    kinds = {key.split(".")[1] for key in table if key.startswith("pt_type.")}
    if kinds != {"BEV"}:
        raise InvalidInput.of("not a battery electric car", f"{where}, pt_type", ", ".join(kinds), "BEV")
    fields = Fields(table, where)
    power = "pt_type.BEV."
    regeneration = fields.optional(f"{power}em.max_regen")
    stated = Stated(
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
    return stated


def _wheels(fields: Fields, inertia: str, wheels: str) -> float | None:
    one, count = fields.optional(inertia), fields.optional(wheels)
    return None if one is None or count is None else one * count


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


def from_fastsim_csv(text: str, where: str, row: str | None) -> Stated:
    """A vehicle of FASTSim 2 in a CSV file: one vehicle, or a table and the scenario name of one."""
    try:
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except csv.Error as error:
        raise InvalidInput.of("unreadable CSV", where, f"{error}"[:120], "a CSV file of FASTSim 2") from error
    return _from_version_2(_csv_row(rows, where, row), where)


def _from_version_2(table: Mapping[str, str], where: str) -> Stated:
    """A vehicle by FASTSim 2's names of its parameters."""
    kind = table.get("veh_pt_type", "")
    if kind != "BEV":
        raise InvalidInput.of("not a battery electric car", f"{where}, veh_pt_type", kind or "nothing", "BEV")
    fields = Fields(table, where)
    cargo = fields.number("cargo_kg")
    mass = fields.optional("veh_override_kg")
    stated = Stated(
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
    return stated


def _fastsim_mass(fields: Fields, cargo: float) -> float:
    """Sum of the components, as FASTSim 2 adds them up."""
    multiplier = fields.number("comp_mass_multiplier")
    pack = fields.number("ess_max_kwh") * fields.number("ess_kg_per_kwh") + fields.number("ess_base_kg")
    motor = fields.number("mc_max_kw") * fields.number("mc_pe_kg_per_kw") + fields.number("mc_pe_base_kg")
    return cargo + fields.number("glider_kg") + multiplier * (pack + motor + fields.number("trans_kg"))


def _csv_row(lines: list[list[str]], where: str, row: str | None) -> dict[str, str]:
    """One vehicle: the row of a table, or a file of one vehicle with a line for each parameter."""
    if not lines:
        raise InvalidInput.of("empty file", where, "no line", "a FASTSim vehicle")
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
    what, got = ("no single vehicle", f"{len(tables)} rows") if row is None else ("unknown row", row)
    raise InvalidInput.of(what, where, got, ", ".join(electric) or "a scenario name")
