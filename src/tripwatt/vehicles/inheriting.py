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
from importlib import resources
from typing import Any, Final

from tripwatt.errors import Fault
from tripwatt.vehicles.licences import with_licences

DEEPEST_EXTENSION: Final = 5
"""Largest depth of files that extend one another; more counts as a circle."""

SCALINGS: Final = ("motor_losses", "cell_resistance")
"""Keys of the table `[scaled]`."""


def data_folder() -> Any:
    """Return the folder of data files that come with the package."""
    return resources.files("tripwatt.vehicles") / "data"


@cache
def bundled_text(name: str) -> str | None:
    """Return the text of a shared file or of a bundled car with a name; None if there is no such file."""
    folder = data_folder()
    files = (place / f"{name}.toml" for place in (folder / "shared", folder))
    return next((str(file.read_text(encoding="utf-8")) for file in files if file.is_file()), None)


@cache
def _bundled(name: str, depth: int) -> tuple[dict[str, Any], tuple[Fault, ...]]:
    """Return the document of a bundled file with inherited entries, and its faults. The document must not be changed."""
    faults: list[Fault] = []
    document = inherit(tomllib.loads(bundled_text(name) or ""), f"{name}.toml", faults, depth)
    return document, tuple(faults)


def bundled_bases() -> tuple[str, ...]:
    """Return the names that `extends` may use, sorted.

    Examples
    --------
    >>> "passenger_car" in bundled_bases()
    True
    """
    files = [*data_folder().iterdir(), *(data_folder() / "shared").iterdir()]
    return tuple(sorted(f.name[:-5] for f in files if f.name.endswith(".toml")))


def inherit(document: Mapping[str, Any], where: str, faults: list[Fault], depth: int = 0) -> dict[str, Any]:
    """Return the document with inherited entries and licences, without the keys that control inheritance.

    Parameters
    ----------
    document : mapping
        A parsed TOML.
    where : str
        Name of the file in messages.
    faults : list of Fault
        Faults that are found are appended to this list.
    depth : int
        Number of documents that extend one another down to this one.

    Examples
    --------
    >>> car = inherit({"extends": ["passenger_car"]}, "car.toml", [])
    >>> car["body"]["driver_mass_kg"]["value"]
    75.0
    """
    document = with_licences(document, where, faults)
    own = {k: v for k, v in document.items() if k not in ("extends", "scaled")}
    result: dict[str, Any] = {}
    for base in _names(document.get("extends", []), where, faults):
        parent = _base(base, f"{where}, extends", faults, depth)
        _take_over(result, {k: v for k, v in parent.items() if k not in ("name", "preset", "anchor")})
    _take_over(result, own)
    scaled = document.get("scaled", {})
    if not isinstance(scaled, Mapping):
        faults.append(Fault("not a table", f"{where}, scaled", repr(scaled), "a table [scaled]"))
        return result
    for key, reference in scaled.items():
        place = f"{where}, scaled.{key}"
        if key not in SCALINGS:
            faults.append(Fault("unknown key", place, str(key), ", ".join(SCALINGS)))
            continue
        parent = _base(str(reference), place, faults, depth)
        scale = _scaled_motor if key == "motor_losses" else _scaled_resistance
        values = scale(result, parent, str(reference)) if parent else {}
        section = "drivetrain" if key == "motor_losses" else "battery"
        # the car's own entries win; None means that an entry needed for scaling is missing, which is a fault elsewhere
        result[section] = {
            **result.get(section, {}),
            **{k: v for k, v in values.items() if k not in own.get(section, {})},
        }
    return result


def _names(raw: object, where: str, faults: list[Fault]) -> Sequence[str]:
    if isinstance(raw, str):
        return [raw]
    if isinstance(raw, Sequence) and all(isinstance(name, str) for name in raw):
        return list(raw)
    faults.append(Fault("not a list of names", f"{where}, extends", repr(raw), ", ".join(bundled_bases())))
    return []


def _base(name: str, place: str, faults: list[Fault], depth: int) -> dict[str, Any]:
    text = bundled_text(name)
    if text is None:
        faults.append(Fault.unknown("unknown base", place, name, bundled_bases()))
        return {}
    if depth >= DEEPEST_EXTENSION:
        faults.append(Fault("circular extends", place, name, "files that do not extend one another"))
        return {}
    document, inherited = _bundled(name, depth + 1)
    faults += inherited
    return document


def _take_over(result: dict[str, Any], more: Mapping[str, Any]) -> None:
    for key, value in more.items():
        if isinstance(value, Mapping) and isinstance(result.get(key), Mapping):
            result[key] = {**result[key], **value}
        else:
            result[key] = value


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
