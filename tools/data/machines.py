"""Loss of traction machines by type, from published maps: `python -m tools.data.machines [--write]`.

`machine_maps.csv` has the published efficiency of motor and inverter of three induction machines and of one with permanent magnets.
The equation of a machine whose flux is chosen (`tripwatt.physics.drivetrain`) is fitted to the induction machines at the same shares of
their largest torque and speed; each machine is also predicted from the two others. Prints how far, and how far the published
machine with magnets is from the reference of the library. `--write` renews `data/shared/induction_motor.toml` and
`externally_excited_motor.toml`, which has published constants of one machine.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from tools import ROOT
from tools.command import run
from tripwatt.arrays import FloatArray
from tripwatt.vehicles import Drivetrain, load_vehicle
from tripwatt.vehicles.losses import motor_loss

MAPS: Final = Path(__file__).with_name("machine_maps.csv")
SHARED: Final = ROOT / "src" / "tripwatt" / "vehicles" / "data" / "shared"


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine of `machine_maps.csv`: its largest torque [Nm] and speed [rad/s], and where its map was published."""

    torque_nm: float
    speed_rad_s: float
    source: str


INDUCTION: Final = MappingProxyType(
    {
        "induction_62_kw": Machine(
            198.0,
            837.8,
            "Menne et al., 15th Electric Vehicle Symposium, Brussels 1998 (NREL ADVISOR, MC_AC62)",
        ),
        "induction_75_kw": Machine(
            271.1,
            1047.2,
            "Lester et al., Advanced Components for Electric and Hybrid Vehicles, Gaithersburg 1993 (NREL ADVISOR, MC_AC75)",
        ),
        "induction_83_kw": Machine(
            203.4, 1361.0, "General Electric, tested by Virginia Tech in 1997 (NREL ADVISOR, MC_AC83)"
        ),
    }
)
MAGNETS: Final = MappingProxyType(
    {
        "permanent_magnet_49_kw": Machine(
            274.4, 890.1, "Honda EV Plus, Honda R&D Americas, 1999 (NREL ADVISOR, MC_PM49)"
        )
    }
)

RATING: Final = Machine(200.0, 1000.0, "")
"""Torque and speed that the fitted values are written for; another rating scales them."""

CURRENT_A: Final = 400.0
"""Phase current at the largest torque; only its products with resistance and voltage drop count."""


@dataclass(frozen=True, slots=True)
class Excited:
    """Published constants of an externally excited machine for electric cars, rotor seen from the stator."""

    pole_pairs: int = 3
    stator_ohm: float = 15.55e-3
    rotor_ohm: float = 7.2e-3
    mutual_h: float = 1.589e-3
    current_a: float = 150.0
    field_a: float = 150.0
    nominal_rpm: float = 4300.0
    max_rpm: float = 12_000.0
    source: str = "Nguyen and Hofmann, ICEM 2014, doi 10.1109/ICELMACH.2014.6960287 (gym-electric-motor, MIT)"


EXCITED: Final = Excited()

LIGHT: Final = 0.4
"""Share of the largest torque below which a car mostly drives."""

STARTS: Final = 8
LEAST_SQUARES_SCALE: Final = 0.1
"""Relative error of a loss beyond which points count less: maps are filled up beside the limits of torque."""


def published(name: str) -> FloatArray:
    """Points of a map: torque [Nm], speed [rad/s], loss of motor and inverter [W]; shape (points, 3)."""
    with MAPS.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["machine"] == name]
    torque, speed, efficiency = (
        np.array([float(row[key]) for row in rows]) for key in ("torque_nm", "speed_rad_s", "efficiency")
    )
    return np.column_stack([torque, speed, (1.0 / efficiency - 1.0) * torque * speed])


def shares(machines: Mapping[str, Machine]) -> FloatArray:
    """Points of several maps: shares of the largest torque and speed, loss over their product, weight of the machine."""
    points = []
    for name, machine in machines.items():
        torque, speed, loss = published(name).T
        power = machine.torque_nm * machine.speed_rad_s
        weight = np.full(len(loss), 1.0 / math.sqrt(len(loss)))
        points.append(
            np.column_stack([torque / machine.torque_nm, speed / machine.speed_rad_s, loss / power, weight])
        )
    return np.concatenate(points)


def drivetrain(values: Sequence[float] | FloatArray) -> Drivetrain:
    """The machine of `RATING` with fitted values: copper, field, iron by speed and its square, fixed, voltage drop, base speed."""
    copper, field, linear, quadratic, fixed, drop, base = (float(v) for v in values)
    power = RATING.torque_nm * RATING.speed_rad_s
    return replace(
        load_vehicle("bmw_i3_60ah").drivetrain,
        machine="induction",
        motor_max_torque_nm=RATING.torque_nm,
        motor_max_speed_rad_s=RATING.speed_rad_s,
        torque_constant_nm_a=RATING.torque_nm / CURRENT_A,
        phase_resistance_ohm=copper * power / (1.5 * CURRENT_A**2),
        field_loss_w=field * power,
        iron_loss_linear=linear * RATING.torque_nm,
        iron_loss_quadratic=quadratic * RATING.torque_nm / RATING.speed_rad_s,
        iron_loss_torque_exponent=0.0,
        inverter_fixed_loss_w=fixed * power,
        inverter_voltage_drop_v=drop * power / CURRENT_A,
        inverter_resistance_ohm=0.0,
        field_weakening_speed_rad_s=base * RATING.speed_rad_s,
        characteristic_current_a=0.0,
    )


def loss_at(torque: FloatArray, speed: FloatArray, values: Drivetrain) -> FloatArray:
    """Loss over the product of the largest torque and speed, at shares of both."""
    power = values.motor_max_torque_nm * values.motor_max_speed_rad_s
    return (
        motor_loss(torque * values.motor_max_torque_nm, speed * values.motor_max_speed_rad_s, values) / power
    )


def fitted(machines: Mapping[str, Machine]) -> FloatArray:
    """Values of `drivetrain` with the smallest relative errors of loss, the best of several starts."""
    from scipy.optimize import least_squares

    torque, speed, loss, weight = shares(machines).T
    rng = np.random.default_rng(0)

    def errors(values: FloatArray) -> FloatArray:
        return np.asarray((loss_at(torque, speed, drivetrain(values)) / loss - 1.0) * weight)

    start = np.array([0.03, 0.005, 0.01, 0.01, 0.002, 0.005, 0.3])
    scale = LEAST_SQUARES_SCALE * float(weight.mean())
    bounds = (np.append(np.full(6, 1e-9), 0.05), np.append(np.full(6, 1.0), 0.8))
    runs = [
        least_squares(
            errors,
            start * np.exp(0.5 * rng.standard_normal(7) * (start < 0.2)),
            bounds=bounds,
            loss="soft_l1",
            f_scale=scale,
        )
        for _ in range(STARTS)
    ]
    return np.asarray(min(runs, key=lambda run: run.cost).x)


def report(label: str, name: str, machine: Machine, values: Drivetrain) -> None:
    """Print the error of loss and efficiency on the map of a machine."""
    torque, speed, loss, _ = shares({name: machine}).T
    modelled = loss_at(torque, speed, values)
    error = modelled / loss - 1.0
    out = torque * speed
    points = out / (out + modelled) - out / (out + loss)
    print(
        f"{name}, {label}: loss {np.median(error):+.0%} (light load {np.median(error[torque < LIGHT]):+.0%}), efficiency "
        f"{np.mean(points):+.3f}, rms {math.sqrt(float(np.mean(points**2))):.3f}, {len(out)} points"
    )


def _entry(value: float, unit: str, source: str, estimated: str) -> str:
    return f'{{ value = {value:.6g}, unit = "{unit}", source = "{source}", estimated = "{estimated}", licence = "facts" }}'


def induction_toml(values: FloatArray) -> str:
    """The shared file of induction machines."""
    machine = drivetrain(values)
    source = "; ".join(motor.source for motor in INDUCTION.values())
    how = "least relative error of loss, python -m tools.data.machines"
    units = {
        "motor_max_torque_nm": "Nm",
        "motor_max_speed_rad_s": "rad/s",
        "torque_constant_nm_a": "Nm/A",
        "phase_resistance_ohm": "ohm",
        "field_weakening_speed_rad_s": "rad/s",
        "characteristic_current_a": "A",
        "iron_loss_linear": "W s/(rad Nm^x)",
        "iron_loss_quadratic": "W s2/(rad2 Nm^x)",
        "iron_loss_torque_exponent": "1",
        "inverter_fixed_loss_w": "W",
        "inverter_voltage_drop_v": "V",
        "inverter_resistance_ohm": "ohm",
        "field_loss_w": "W",
    }
    lines = [f"{key} = {_entry(getattr(machine, key), unit, source, how)}" for key, unit in units.items()]
    head = (
        "# Motor and inverter of an induction machine: the equation of a machine whose flux is chosen, fitted to the published maps of\n"
        "# three machines. Written by `python -m tools.data.machines --write`; see docs/decisions/physics-08-machines.md.\n"
    )
    kind = f'machine = {{ value = "induction", unit = "", source = "{source}", licence = "facts" }}'
    return "\n".join([head, "[drivetrain]", kind, *lines, ""])


def excited_toml(values: FloatArray) -> str:
    """The shared file of externally excited machines."""
    torque = 1.5 * EXCITED.pole_pairs * EXCITED.mutual_h * EXCITED.field_a * EXCITED.current_a
    speed, base = (rpm * math.pi / 30.0 for rpm in (EXCITED.max_rpm, EXCITED.nominal_rpm))
    induction = drivetrain(values)
    torques, speeds = torque / RATING.torque_nm, speed / RATING.speed_rad_s
    maps = "; ".join(motor.source for motor in INDUCTION.values())
    own, same = (
        "published constants of the machine",
        "iron of the induction machines at the same shares of torque and speed",
    )
    full = "at the published limits of both currents, without the torque of the poles' shape"
    entries = {
        "motor_max_torque_nm": (torque, "Nm", EXCITED.source, full),
        "motor_max_speed_rad_s": (speed, "rad/s", EXCITED.source, own),
        "torque_constant_nm_a": (torque / EXCITED.current_a, "Nm/A", EXCITED.source, full),
        "phase_resistance_ohm": (EXCITED.stator_ohm, "ohm", EXCITED.source, own),
        "field_loss_w": (EXCITED.rotor_ohm * EXCITED.field_a**2, "W", EXCITED.source, full),
        "field_weakening_speed_rad_s": (base, "rad/s", EXCITED.source, own),
        "characteristic_current_a": (0.0, "A", EXCITED.source, "no magnets"),
        "iron_loss_linear": (induction.iron_loss_linear * torques, "W s/(rad Nm^x)", maps, same),
        "iron_loss_quadratic": (
            induction.iron_loss_quadratic * torques / speeds,
            "W s2/(rad2 Nm^x)",
            maps,
            same,
        ),
        "iron_loss_torque_exponent": (0.0, "1", maps, same),
    }
    lines = [f"{key} = {_entry(*entry)}" for key, entry in entries.items()]
    head = (
        "# Motor and inverter of an externally excited machine: published constants of stator and rotor, the iron of induction machines,\n"
        "# and the inverter of the machine with magnets. No map of one is published with numbers. Written by\n"
        "# `python -m tools.data.machines --write`; see docs/decisions/physics-08-machines.md.\n\n"
        '[scaled]\nmotor_losses = "permanent_magnet_motor"\n'
    )
    kind = f'machine = {{ value = "externally_excited", unit = "", source = "{EXCITED.source}", licence = "facts" }}'
    return "\n".join([head, "[drivetrain]", kind, *lines, ""])


def main(write: bool = False) -> None:
    """Print the errors of fits and predictions. `--write` renews the shared files of both types."""
    values = fitted(INDUCTION)
    for name, machine in INDUCTION.items():
        report("fitted", name, machine, drivetrain(values))
        other_motors = {other: INDUCTION[other] for other in INDUCTION if other != name}
        report("from the two others", name, machine, drivetrain(fitted(other_motors)))
    for name, machine in MAGNETS.items():
        report("reference of the library", name, machine, load_vehicle("tesla_model_3_lr").drivetrain)
    if write:
        (SHARED / "induction_motor.toml").write_text(induction_toml(values), encoding="utf-8")
        (SHARED / "externally_excited_motor.toml").write_text(excited_toml(values), encoding="utf-8")


if __name__ == "__main__":
    run(main)
