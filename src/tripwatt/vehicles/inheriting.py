"""Inheritance of entries: a car's TOML takes over entries from shared files or from another car, before they are checked.

`extends = ["passenger_car", ...]` takes the entries of files in `data/shared` or of bundled cars; later names and the
car's own entries replace earlier ones. `[scaled]` computes entries from a reference car by similarity:

- `motor_losses = "CAR"`: the type of motor and its losses with inverter at the same shares of torque and speed,
- `cell_resistance = "CAR"`: resistance of one cell at the same product of resistance and capacity.

Every entry taken over keeps its source and licence, and names the file that it came from.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import Fault

DATA: Final = Path(__file__).parent / "data"
"""Folder of the data files that come with the package."""


@cache
def bundled_files() -> Mapping[str, Path]:
    """Return the files that `extends` may name, shared ones and cars, by their names without the ending, sorted.

    Examples
    --------
    >>> bundled_files()["passenger_car"].name
    'passenger_car.toml'
    """
    files = {file.stem: file for folder in (DATA, DATA / "shared") for file in folder.glob("*.toml")}
    return dict(sorted(files.items()))


@cache
def bundled_document(name: str) -> Mapping[str, Any]:
    """Return the document of a bundled file as it is written; it must not be changed."""
    return tomllib.loads(bundled_files()[name].read_text(encoding="utf-8"))


@cache
def _whole_document(name: str) -> Mapping[str, Any]:
    """Return the document of a bundled file with inherited entries; it must not be changed."""
    return inherit(bundled_document(name), f"{name}.toml", [])


def inherit(document: Mapping[str, Any], where: str, faults: list[Fault]) -> dict[str, Any]:
    """Return the document with inherited entries, without the keys that control inheritance.

    Parameters
    ----------
    document : mapping
        A parsed TOML whose sections are tables.
    where : str
        Name of the file in messages.
    faults : list of Fault
        Faults that are found are appended to this list.

    Examples
    --------
    >>> car = inherit({"extends": ["passenger_car"]}, "car.toml", [])
    >>> car["body"]["driver_mass_kg"]["value"]
    75.0
    """
    own = {key: value for key, value in document.items() if key not in ("extends", "scaled")}
    bases = document.get("extends", [])
    result: dict[str, Any] = {}
    for base in bases if isinstance(bases, list) else [bases]:
        parent = _base(base, f"{where}, extends", faults)
        _take_over(result, {key: value for key, value in parent.items() if key not in NOT_INHERITED})
    _take_over(result, own)
    for key, reference in document.get("scaled", {}).items():
        place = f"{where}, scaled.{key}"
        if key not in SCALINGS:
            faults.append(Fault.unknown("unknown key", place, key, SCALINGS))
            continue
        section, scale = SCALINGS[key]
        parent = _base(reference, place, faults)
        values = scale(result, parent, reference) if parent else {}
        # the car's own entries win; None means that an entry needed for scaling is missing, which is a fault elsewhere
        result[section] = {**result.get(section, {}), **values, **own.get(section, {})}
    return result


NOT_INHERITED: Final = ("name", "preset", "anchor", "licence")
"""Keys of a file that hold for this file alone."""


def _base(name: Any, place: str, faults: list[Fault]) -> Mapping[str, Any]:
    if name not in list(bundled_files()):
        faults.append(Fault.unknown("unknown base", place, name, bundled_files()))
        return {}
    return _whole_document(name)


def _take_over(result: dict[str, Any], more: Mapping[str, Any]) -> None:
    for key, value in more.items():
        result[key] = {**result.get(key, {}), **value} if isinstance(value, Mapping) else value


def _numbers(document: Mapping[str, Any], section: str, keys: Sequence[str]) -> list[float] | None:
    """Return the values of some entries; None if one is missing or not a positive number."""
    table = document.get(section, {})
    values = [table[k].get("value") if isinstance(table.get(k), Mapping) else None for k in keys]
    if not all(isinstance(v, int | float) and v > 0 for v in values):
        return None
    return [float(v) for v in values if v is not None]


def _scaled_motor(car: Mapping[str, Any], reference: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Scale the loss parameters of a reference to the largest torque and the largest speed of a car.

    The losses are the same shares of power at the same shares of torque and speed. At the same voltage the magnet flux falls as
    speed rises, so phase currents and losses scale with torque times speed. The corner speed, power over torque, is not used
    as a scale: many cars limit the power far below the motor's. Each value is None if the car lacks torque or speed.
    """
    rated = ("motor_max_torque_nm", "motor_max_speed_rad_s")
    mine, theirs = _numbers(car, "drivetrain", rated), _numbers(reference, "drivetrain", rated)
    if theirs is None:
        return {}
    torque, speed = (own / other for own, other in zip(mine or theirs, theirs, strict=True))
    power = torque * speed
    losses = reference["drivetrain"]
    exponent = float(losses["iron_loss_torque_exponent"]["value"])
    factors = {
        "torque_constant_nm_a": 1.0 / speed,
        "phase_resistance_ohm": 1.0 / power,
        "field_weakening_speed_rad_s": speed,
        "characteristic_current_a": power,
        "iron_loss_linear": torque ** (1.0 - exponent),
        "iron_loss_quadratic": torque ** (1.0 - exponent) / speed,
        "iron_loss_torque_exponent": 1.0,
        "inverter_fixed_loss_w": power,
        "inverter_voltage_drop_v": 1.0,
        "inverter_resistance_ohm": 1.0 / power,
        "field_loss_w": power,
    }
    how = f"motor and inverter of {name} at {torque:.3g} times its torque and {speed:.3g} times its speed"
    scaled = {key: _scale_entry(losses[key], factor, how) for key, factor in factors.items() if key in losses}
    scaled |= {"machine": losses["machine"]} if "machine" in losses else {}
    return scaled if mine is not None else dict.fromkeys(scaled)


def _scaled_resistance(car: Mapping[str, Any], reference: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Scale the resistance of one cell (or cells in parallel) of a reference in inverse proportion to capacity.

    Each value is None if the car has no valid capacity.
    """
    mine = _numbers(car, "battery", ("capacity_ah",))
    theirs = _numbers(reference, "battery", ("capacity_ah",))
    if mine is None or theirs is None:
        return dict.fromkeys(("resistance_ohm", "resistance_soc")) if theirs else {}
    factor = theirs[0] / mine[0]
    how = f"{name}'s cell at {factor:.3g} times its resistance, in inverse proportion to capacity"
    taken = {"resistance_ohm": factor, "resistance_soc": 1.0}
    return {key: _scale_entry(reference["battery"][key], f, how) for key, f in taken.items()}


def _scale_entry(entry: Mapping[str, Any], factor: float, how: str) -> dict[str, Any]:
    value = entry["value"]
    scaled = [float(v) * factor for v in value] if isinstance(value, list) else float(value) * factor
    before = entry.get("estimated", "")
    return {**entry, "value": scaled, "estimated": f"{how}; {before}" if before else how}


SCALINGS: Final = {
    "motor_losses": ("drivetrain", _scaled_motor),
    "cell_resistance": ("battery", _scaled_resistance),
}
"""Key of the table `[scaled]` -> the section of the entries that it computes, and how."""
