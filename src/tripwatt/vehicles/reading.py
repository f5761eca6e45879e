"""Reading of a car's TOML into a `Vehicle`, with every fault of the file in one message.

An entry is `key = { value = ..., unit = "...", source = "...", estimated = "how" }`. The optional `estimated` states how the value was
derived if no source states it directly. `tripwatt.vehicles.licences` describes how a file names the licence of each source.
`[preset.NAME.SECTION]` tables replace entries. `without = ["climate"]` in `[preset.NAME]` leaves out an optional part;
`heater = "none"` in the file leaves out climate control in all presets.
"""

from __future__ import annotations

import dataclasses
import sys
import tomllib
import types
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, Final

from tripwatt.errors import Fault, did_you_mean, excerpt, raise_faults
from tripwatt.vehicles.inheriting import data_folder, inherit
from tripwatt.vehicles.licences import licence_faults, with_licences
from tripwatt.vehicles.overriding import ALIASES
from tripwatt.vehicles.parts import ROAD_LOADS, Battery, RoadLoad
from tripwatt.vehicles.relations import relation_faults, table_faults
from tripwatt.vehicles.vehicle import ANCHORS, OPTIONAL_SECTIONS, SECTIONS, Entry, Value, Vehicle

ENTRY_KEYS: Final = ("value", "unit", "source", "estimated", "scale", "licence", "published")
SCALES: Final = ("soc", "displayed_soc")


@cache
def _shared_presets() -> dict[str, dict[str, Any]]:
    """Return the presets that every car has unless its own file overrides them."""
    files = sorted((data_folder() / "presets").iterdir(), key=lambda f: str(f.name))
    faults: list[Fault] = []
    presets = {
        f.name[:-5]: with_licences(tomllib.loads(f.read_text(encoding="utf-8")), f.name, faults)
        for f in files
        if f.name.endswith(".toml")
    }
    raise_faults(faults)
    return presets


def vehicle_from_document(
    document: Mapping[str, Any],
    name: str,
    where: str,
    preset: str = "default",
    overrides: Mapping[str, float | str] = types.MappingProxyType({}),
) -> Vehicle:
    """Build a `Vehicle` from a parsed TOML document.

    Parameters
    ----------
    document : mapping
        A parsed TOML document.
    name : str
        Name of the car.
    where : str
        Name of the document in messages.
    preset : str
        Name of a preset of the document.
    overrides : mapping of str to (float or str)
        Values that replace those of the document, by key or short name.

    Returns
    -------
    Vehicle
        A car whose values are checked.

    Raises
    ------
    InvalidInput
        With everything that is missing, unknown or out of bounds.

    Examples
    --------
    >>> import tomllib
    >>> from tripwatt.vehicles import load_vehicle, render_vehicle
    >>> text = render_vehicle(load_vehicle("vw_id3"))
    >>> vehicle_from_document(tomllib.loads(text), "my_car", "my_car.toml").name
    'my_car'
    """
    faults: list[Fault] = []
    document = inherit(document, where, faults)
    tables = _preset_tables(document, preset, where, faults)
    entries: dict[str, Entry] = {}
    for section, table in tables.items():
        for key, raw in table.items():
            entry = _entry(section, key, raw, where, faults)
            if entry is not None:
                entries[f"{section}.{key}"] = entry
    overrides = {ALIASES.get(key, key): value for key, value in overrides.items()}
    for key, value in overrides.items():
        _override(entries, key, value, faults)
    left_out = OPTIONAL_SECTIONS - tables.keys() if preset != "default" else frozenset()
    entries = {key: e for key, e in entries.items() if key.partition(".")[0] not in left_out}
    anchor = str(document.get("anchor", "published"))
    anchor = "published" if anchor == "book" else anchor  # in the folders of cars that 0.2 made
    if anchor not in ANCHORS:
        faults.append(_unknown_fault("anchor", f"{where}, anchor", anchor, ANCHORS))
    parts = {section: _part(section, entries, tables.get(section), where, faults) for section in SECTIONS}
    if not faults:
        parts["road_load"] = _with_method(parts["road_load"], where, faults)
        faults += _useless_overrides(parts["road_load"], overrides)
        parts["battery"] = _on_soc_scale(parts["battery"], entries)
        faults += table_faults(parts, where)
    if not faults:
        faults += relation_faults(parts, where)
    raise_faults(faults)
    title = str(document.get("name", name))
    return Vehicle(name, title, preset, entries=entries, anchor=anchor, **parts)


def _part(
    section: str,
    entries: Mapping[str, Entry],
    table: Mapping[str, Any] | None,
    where: str,
    faults: list[Fault],
) -> Any:
    """Build a part from its entries; None if the car lacks this optional part, or an entry is missing."""
    fields = _fields(section)
    values = {key: entries[name].value for key in fields if (name := f"{section}.{key}") in entries}
    if table is None and not values and section in OPTIONAL_SECTIONS:
        return None
    missing = [k for k, f in fields.items() if f.default is dataclasses.MISSING and k not in values]
    place = f"{where}, [{section}]"
    faults += [
        Fault("missing entry", place, "nothing", f"an entry {key!r}", _entry_line(section, key))
        for key in missing
        if key not in (table or ())  # else the entry already has a fault
    ]
    return None if missing else SECTIONS[section](**values)


def _preset_tables(
    document: Mapping[str, Any], preset: str, where: str, faults: list[Fault]
) -> dict[str, dict[str, Any]]:
    """Return the sections of a document with entries replaced by those of a preset."""
    faults += [
        _unknown_fault("section", f"{where}, [{key}]", key, [*SECTIONS, "preset"])
        for key in document
        if key not in (*SECTIONS, "preset", "name", "anchor", "heater")
    ]
    heater = document.get("heater", "none")
    if heater != "none":
        fix = "describe a heater in [climate]"
        faults.append(
            Fault("unknown heater", f"{where}, heater", excerpt(heater), '"none", or no such key', fix)
        )
    presets = {**_shared_presets(), **document.get("preset", {})}
    if preset != "default" and preset not in presets:
        allowed = ", ".join(sorted({"default", *presets}))
        faults.append(Fault("unknown preset", where, preset, allowed))
    chosen = presets.get(preset, {})
    dropped = [*chosen.get("without", []), *(["climate"] if "heater" in document else [])]
    for section in dropped:
        if section not in OPTIONAL_SECTIONS:
            allowed = ", ".join(sorted(OPTIONAL_SECTIONS)) or "nothing"
            faults.append(Fault("part cannot be left out", f"{where}, [preset.{preset}]", section, allowed))
    tables: dict[str, dict[str, Any]] = {}
    for section in SECTIONS:
        if (section in document or section in chosen) and section not in dropped:
            tables[section] = {**document.get(section, {}), **chosen.get(section, {})}
    faults += [
        _unknown_fault("section", f"{where}, [preset.{preset}.{key}]", key, SECTIONS)
        for key in chosen
        if key not in (*SECTIONS, "without")
    ]
    return tables


def _unknown_fault(what: str, where: str, got: str, allowed: Sequence[str] | Mapping[str, Any]) -> Fault:
    many = "a key of the parameter table in docs/explanation/car-model.md"
    known = ", ".join(sorted(allowed)) if len(allowed) < 12 else many
    return Fault(f"unknown {what}", where, got, known, did_you_mean(got, allowed))


@cache
def _fields(section: str) -> dict[str, dataclasses.Field[Any]]:
    return {f.name: f for f in dataclasses.fields(SECTIONS[section])}


def _entry_line(section: str, key: str) -> str:
    """Return the line of TOML to write for a missing entry."""
    unit = _fields(section)[key].metadata["unit"]
    return f'add {key} = {{ value = ..., unit = "{unit}", source = "..." }} under [{section}]'


def _entry(section: str, key: str, raw: object, where: str, faults: list[Fault]) -> Entry | None:
    """Check and build one entry; None if it cannot be used, with the reason appended to `faults`."""
    place = f"{where}, {section}.{key}"
    if raw is None:  # `[scaled]` could not compute the entry because another one is missing
        return None
    field = _fields(section).get(key)
    if field is None:
        faults.append(_unknown_fault("key", place, key, list(_fields(section))))
        return None
    if not isinstance(raw, Mapping):
        got = excerpt(raw)
        faults.append(Fault("not an entry", place, got, "{ value = ..., unit = ..., source = ... }"))
        return None
    before = len(faults)
    scaled = bool(field.metadata.get("scaled"))
    faults += [
        _unknown_fault("key of an entry", place, str(word), ENTRY_KEYS)
        for word in raw
        if word not in ENTRY_KEYS
    ]
    faults += [
        Fault(f"missing {word}", place, "nothing", "every entry has value, unit and source")
        for word in ("value", "unit")
        if word not in raw
    ]
    if not str(raw.get("source", "")).strip():
        faults.append(Fault("missing source", place, "nothing", "the source of the value"))
    faults += licence_faults(raw["licence"], f"{place}, licence") if "licence" in raw else []
    unit = field.metadata["unit"]
    if "unit" in raw and raw["unit"] != unit:
        faults.append(Fault("wrong unit", place, excerpt(raw["unit"]), repr(unit)))
    if scaled and raw.get("scale") not in SCALES:
        faults.append(
            Fault("missing scale", place, excerpt(raw.get("scale")), " or ".join(map(repr, SCALES)))
        )
    if not scaled and "scale" in raw:
        faults.append(Fault("scale has no effect", place, excerpt(raw["scale"]), "no scale"))
    for word in ("value", "published"):
        if word in raw:
            faults.extend(_value_faults(field, raw[word], place))
    if len(faults) > before or "licence" not in raw:  # the file's missing licences are one fault
        return None
    return Entry(
        _as_value(raw["value"]),
        unit,
        str(raw["source"]),
        str(raw.get("estimated", "")),
        str(raw.get("scale", "")),
        str(raw["licence"]),
        _as_value(raw["published"]) if "published" in raw else None,
    )


def _as_value(raw: object) -> Value:
    if isinstance(raw, str):
        return raw
    if isinstance(raw, Sequence):
        return tuple(float(v) for v in raw)
    assert isinstance(raw, int | float)
    return float(raw)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _value_faults(field: dataclasses.Field[Any], value: object, place: str) -> Iterator[Fault]:
    meta = field.metadata
    if "choice" in meta:
        if value not in meta["choice"]:
            yield Fault("unknown value", place, excerpt(value), " or ".join(map(repr, meta["choice"])))
        return
    table = str(field.type).startswith("tuple")
    numbers = value if table and isinstance(value, Sequence) and not isinstance(value, str) else [value]
    if table and (isinstance(value, str) or not isinstance(value, Sequence) or len(value) < 2):
        yield Fault("not a table", place, excerpt(value), "a list of at least two numbers")
        return
    for number in numbers:
        if not _is_number(number):
            yield Fault("not a number", place, excerpt(number), "a finite number")
        elif not meta["minimum"] <= number <= meta["maximum"]:
            allowed = f"{meta['minimum']:g} to {meta['maximum']:g} {meta['unit']}"
            yield Fault("value out of range", place, f"{number:g} {meta['unit']}", allowed)


def _override(entries: dict[str, Entry], key: str, value: float | str, faults: list[Fault]) -> None:
    known = {f"{section}.{name}": field for section in SECTIONS for name, field in _fields(section).items()}
    field = known.get(key)
    if field is None:
        faults.append(_unknown_fault("key", "overrides", key, known))
        return
    wrong = list(_value_faults(field, value, f"overrides, {key}"))
    faults += wrong
    if not wrong:
        unit, absent = field.metadata["unit"], "soc" if field.metadata.get("scaled") else ""
        scale = entries[key].scale if key in entries else absent
        entries[key] = Entry(_as_value(value), unit, "given by the caller", scale=scale, licence="user")


def _useless_overrides(road_load: RoadLoad, overrides: Mapping[str, float | str]) -> Iterator[Fault]:
    """Yield a fault for each override of the description of the road load that is not used."""
    for key in overrides:
        section, _, name = key.partition(".")
        if section != "road_load" or name == "method" or not road_load.method:
            continue
        belongs = "coastdown" if name.startswith("coastdown_") else "coefficients"
        if belongs != road_load.method:
            allowed = f"entries of the {road_load.method} road load"
            fix = f"also set road_load.method to {belongs!r}, which needs all of its entries"
            yield Fault("override has no effect", f"overrides, {key}", str(overrides[key]), allowed, fix)


def _with_method(road_load: RoadLoad, where: str, faults: list[Fault]) -> RoadLoad:
    """Set the method of the road load to the description that is complete, if the document names none."""
    complete = [m for m, keys in ROAD_LOADS.items() if all(getattr(road_load, k) is not None for k in keys)]
    place = f"{where}, [road_load]"
    if road_load.method and road_load.method not in complete:
        lacking = [k for k in ROAD_LOADS[road_load.method] if getattr(road_load, k) is None]
        fix = "; ".join(_entry_line("road_load", key) for key in lacking)
        faults.append(Fault("missing entry", place, "nothing", f"entries {', '.join(lacking)}", fix))
    elif not road_load.method and len(complete) != 1:
        allowed = "either all of " + " or all of ".join(", ".join(keys) for keys in ROAD_LOADS.values())
        got = "both descriptions and no method" if complete else "no complete description"
        faults.append(
            Fault("road load is incomplete or ambiguous", place, got, allowed, "choose one with `method`")
        )
    elif not road_load.method:
        return dataclasses.replace(road_load, method=complete[0])
    return road_load


def _on_soc_scale(battery: Battery, entries: Mapping[str, Entry]) -> Battery:
    """Convert the capacity to the one between soc 0 and soc 1, if it was given on the displayed scale."""
    window = battery.displayed_full_soc - battery.displayed_zero_soc
    if entries["battery.capacity_ah"].scale == "soc" or not window > 0.0:
        return battery
    return dataclasses.replace(battery, capacity_ah=battery.capacity_ah / window)
