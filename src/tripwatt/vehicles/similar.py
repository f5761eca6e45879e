"""Document of a car with only a few published figures: the other values come from its class.

Mass, power, usable energy and, if published, the coast-down are the car's own. Wheel, gear, motor and cells are those of the class, in
proportion to the car's own figures; `estimated` of each such entry states this.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

from tripwatt.files import shipped_toml
from tripwatt.units import GRAVITY_M_S2
from tripwatt.vehicles.catalogue import (
    DRIVER_KG,
    QUADRICYCLE,
    ROAD_LOAD_DENSITY_KG_M3,
    TWIZY_ROLLING,
    Cell,
    ClassValues,
    Coastdown,
    Row,
    curb_mass_kg,
    entry,
    with_entries,
)

WHEEL_RADIUS_M: Final = shipped_toml("vehicles/data/table/bodies.toml")["wheel_radius_m"]
"""Kind of body -> rolling radius of its usual tyres."""

GEAR_RATIO: Final = 9.5
"""Motor over wheel speed. The cars with a file of their own have 7.05 to 11.5, their mean is 9.3."""

CORNER_SPEED_RAD_S: Final = 420.0
"""Largest power over largest torque. The cars with a file of their own have 315 to 563 rad/s, their mean is 419."""

TOP_SPEEDS_KM_H: Final = ((90.0, 160.0), (150.0, 200.0), (float("inf"), 240.0))
"""Pairs of a power over curb mass [W/kg] and the top speed [km/h] that is usual up to it."""

RECOVERY_M_S2: Final = 2.0
"""Deceleration up to which recent cars recover energy without friction brakes; road tests: 0.2 g and more."""

COASTING_M_S2: Final = 0.7
"""Deceleration up to which a quadricycle recovers energy, without the brake pedal, which acts on friction brakes (Renault, Twizy)."""

RECOVERY_W_PER_KG: Final = 45.0
"""Largest recovery over mass. The cars with a file of their own have 20 to 46 W/kg, newer ones 37 to 46."""

PACK_KG_PER_KWH: Final = 6.2
"""Mass of the pack over usable energy: about 160 Wh/kg, such as 375 kg for 58 kWh of the ID.3."""


CHEMISTRIES: Final = {"nmc": ("nmc_cells", 3.72, 3.65), "lfp": ("lfp_cells", 3.28, 3.20)}
"""Cathode, layered oxides (NMC, NCA) or iron phosphate -> shared file of such cells, mean and nominal voltage of one cell [V].
The mean over the range of the display converts energy to charge. The nominal voltage, a general figure, converts that of a pack to the
number of cells in series."""

MACHINES: Final = {
    "psm": "permanent_magnet_motor",
    "asm": "induction_motor",
    "eesm": "externally_excited_motor",
}
"""Word for a type of motor in the table -> its shared file."""

DISPLAY: Final = (0.03, 0.97)
"""State of charge at which the display shows 0 and 1, as in cars with 94 to 96 % of the gross energy usable."""

RECENT_YEAR: Final = 2020
HEAT_PUMPS: Final = {False: (2500.0, 2.0), True: (5000.0, 2.4)}
"""Whether a car is of 2020 or later -> heat [W] of its heat pump at 7 degC outside, and coefficient of performance at 0 degC. The values
before 2020 are those of the small cars of the library. The later ones are general figures of R1234yf systems, 4 to 6 kW; the EPA's
rows at 20 degF informed the coefficient."""


@dataclass(frozen=True, slots=True)
class Figures:
    """The few figures of a car, each with its source.

    Attributes
    ----------
    title : str
    body : str
        One of `BODIES`.
    curb_mass, motor_power, usable_energy, pack_voltage : mapping of str to object
        Figures [kg], [W], [Wh], [V], each with `value`, `source`, `licence` and perhaps `estimated`.
    heat_pump : bool
    recent : bool
        Whether the car is of 2020 or later.
    chemistry : str
        A key of `CHEMISTRIES`.
    machine : str
        A key of `MACHINES`.
    coastdown : Coastdown, optional
    coastdown_source : mapping of str to object, optional
        Source, licence and estimate of the coast-down.
    """

    title: str
    body: str
    curb_mass: Mapping[str, Any]
    motor_power: Mapping[str, Any]
    usable_energy: Mapping[str, Any]
    pack_voltage: Mapping[str, Any]
    heat_pump: bool
    recent: bool = True
    chemistry: str = "nmc"
    machine: str = "psm"
    coastdown: Coastdown | None = None
    coastdown_source: Mapping[str, Any] | None = None


def figures_of_row(row: Row) -> Figures:
    """Collect the figures of a car of the table."""

    def first(key: str, factor: float = 1.0) -> dict[str, Any]:
        return _sourced(row[key][0].number * factor, row[key][0])

    run = Coastdown.of_parts(row) if "coastdown_a" in row else None
    (weighed,) = row.get("test_weight") or row["running_mass"]
    how = "mass in running order less a driver of 75 kg"
    if "test_weight" in row:
        how = f"test weight {weighed.value} lb less 300 lb (40 CFR 86.1803); a class of 125 to 500 lb"
    return Figures(
        title=row["title"][0].value,
        body=row["body"][0].value,
        curb_mass=_sourced(curb_mass_kg(row), weighed, how),
        motor_power=first("motor_power", 1000.0),
        usable_energy=first("usable_energy", 1000.0),
        pack_voltage=first("pack_voltage"),
        heat_pump=row["heat_pump"][0].value == "1",
        recent=row["year_first"][0].number >= RECENT_YEAR,
        chemistry=row["chemistry"][0].value if "chemistry" in row else "nmc",
        machine=row["machine"][0].value if "machine" in row else "psm",
        coastdown=run,
        coastdown_source=None if run is None else _sourced(0.0, row["coastdown_a"][0], _split(row)),
    )


def _split(row: Row) -> str:
    """Describe how the force of a coast-down was split into its parts."""
    if "drag_coefficient" not in row:
        return "the force is split so that B is that of a usual car; its energy on UDDS and HWFET stays"
    drag, area = row["drag_coefficient"][0], row["frontal_area"][0]
    return f"the force is split by c_d {drag.value} and {area.value} m2 ({area.note}); its energy on UDDS and HWFET stays"


def _sourced(value: float, cell: Cell, estimated: str = "") -> dict[str, Any]:
    return entry(value, cell.citation, cell.licence, estimated)


def similar_document(car: Figures, classes: ClassValues) -> dict[str, Any]:
    """Make the document of a car, with the structure of a TOML of the library.

    Parameters
    ----------
    car : Figures
    classes : ClassValues
        Values for the road load of a car without a coast-down.
    """
    radius = WHEEL_RADIUS_M[car.body]
    mass, power = float(car.curb_mass["value"]), float(car.motor_power["value"])
    recovery = COASTING_M_S2 if car.body == QUADRICYCLE else RECOVERY_M_S2
    top_speed = next(speed for limit, speed in TOP_SPEEDS_KM_H if power / mass < limit)
    torque, recovery_nm = power / CORNER_SPEED_RAD_S, recovery * (mass + DRIVER_KG) * radius / GEAR_RATIO
    motor_rad_s = top_speed / 3.6 / radius * GEAR_RATIO
    recovery_w = min(RECOVERY_W_PER_KG * (mass + DRIVER_KG), power)
    entries = {
        "body.curb_mass_kg": car.curb_mass,
        **_road_load(car, classes),
        "drivetrain.wheel_radius_m": _class(radius, f"usual tyres of a {car.body}"),
        "drivetrain.gear_ratio": _class(GEAR_RATIO, "mean of the cars with a file of their own"),
        "drivetrain.motor_max_torque_nm": _class(torque, f"power over {CORNER_SPEED_RAD_S:g} rad/s"),
        "drivetrain.motor_max_power_w": car.motor_power,
        "drivetrain.motor_max_speed_rad_s": _class(motor_rad_s, f"a top speed of {top_speed:g} km/h"),
        "regeneration.max_torque_nm": _class(recovery_nm, f"{recovery:g} m/s2"),
        "regeneration.max_power_w": _class(recovery_w, f"{RECOVERY_W_PER_KG:g} W/kg"),
        **_battery(car),
    }
    if car.heat_pump and car.body != QUADRICYCLE:
        heat_w, cop = HEAT_PUMPS[car.recent]
        how = f"that of cars {'from 2020 on' if car.recent else 'before 2020'}; the car has a heat pump"
        entries["climate.heat_pump_max_heat_w"] = _class(heat_w, how)
        entries["climate.heat_pump_cop_at_0_degc"] = _class(cop, how)
    document = {
        "name": car.title,
        "extends": ["passenger_car", CHEMISTRIES[car.chemistry][0]],
        "scaled": {"motor_losses": MACHINES[car.machine], "cell_resistance": "bmw_i3_94ah"},
        "without": ["climate"] if car.body == QUADRICYCLE else [],
    }
    return with_entries(document, entries)


def _class(value: float, estimated: str) -> dict[str, Any]:
    return entry(value, "class of the car", "estimate", estimated)


def _road_load(car: Figures, classes: ClassValues) -> dict[str, Any]:
    """Return the coast-down of a car, or else that of its class: rolling in proportion to the weight, the drag area of its body."""
    run, about = car.coastdown, car.coastdown_source
    if run is None or about is None:
        mass, area = float(car.curb_mass["value"]) + DRIVER_KG, classes.drag_area_m2[car.body]
        weight = mass * GRAVITY_M_S2
        rolling = TWIZY_ROLLING if car.body == QUADRICYCLE else classes.rolling
        c = 0.5 * ROAD_LOAD_DENSITY_KG_M3 * area
        run = Coastdown(rolling * weight, classes.rolling_per_speed_s_m * weight, c, mass)
        how = f"medians of {classes.cars} measured coast-downs, for the weight with a driver and the drag area of the body {car.body}, {area:.3f} m2"
        about = _class(0.0, how)
    entries = {f"road_load.coastdown_{key}": {**about, "value": value} for key, value in asdict(run).items()}
    how = "SAE J2263 reference conditions, 20 degC and 98.21 kPa, ideal gas"
    return entries | {"road_load.coastdown_air_density_kg_m3": entry(ROAD_LOAD_DENSITY_KG_M3, how, "facts")}


def _battery(car: Figures) -> dict[str, Any]:
    energy_wh, volts = float(car.usable_energy["value"]), float(car.pack_voltage["value"])
    _, mean_v, nominal_v = CHEMISTRIES[car.chemistry]
    cells = round(volts / nominal_v)
    how = f"{energy_wh / 1000.0:g} kWh usable at a mean of {mean_v:g} V of {cells} cells in series"
    nominal = f"{volts:g} V nominal at {nominal_v:g} V a cell"
    heat_j_k, warming = PACK_KG_PER_KWH * energy_wh, f"{PACK_KG_PER_KWH:g} kg/kWh at 1000 J/(kg K)"
    own = {"value": energy_wh / (cells * mean_v), "scale": "displayed_soc", "estimated": how}
    return {
        "battery.capacity_ah": {**car.usable_energy, **own},
        "battery.cells_in_series": {**car.pack_voltage, "value": cells, "estimated": nominal},
        "battery.heat_capacity_j_k": _class(heat_j_k, warming),
        "battery.displayed_zero_soc": _class(DISPLAY[0], "a reserve at each end"),
        "battery.displayed_full_soc": _class(DISPLAY[1], "a reserve at each end"),
    }
