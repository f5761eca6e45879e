"""Reading of a car's TOML into a `Vehicle`, with every fault of the file in one message.

An entry is `key = { value = ..., unit = "...", source = "...", estimated = "how", licence = "..." }`. The optional `estimated` states how the
value was derived if no source states it directly. An entry without a licence has the `licence` at the top of the file.
`[preset.NAME.SECTION]` tables replace entries. `without = ["climate"]` leaves out an optional part, at the top of the file in all presets,
in `[preset.NAME]` in this one.
"""

from __future__ import annotations

import dataclasses
import tomllib
import types
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final

from tripwatt.errors import Fault, did_you_mean, excerpt, raise_faults
from tripwatt.files import shipped_toml
from tripwatt.vehicles.inheriting import DATA, inherit
from tripwatt.vehicles.parts import ROAD_LOADS, Battery, RoadLoad
from tripwatt.vehicles.relations import relation_faults, table_faults
from tripwatt.vehicles.vehicle import ANCHORS, FIELDS, LICENCES, OPTIONAL_SECTIONS, SECTIONS, Entry, Vehicle

ALIASES: Final[Mapping[str, str]] = shipped_toml("vehicles/data/table/aliases.toml")
"""Short name of an override -> its key. `payload` is the mass of everything aboard, including the driver."""

ENTRY_KEYS: Final = ("value", "unit", "source", "estimated", "scale", "licence", "published")
SCALES: Final = ("soc", "displayed_soc")
TABLES: Final = (*SECTIONS, "scaled", "preset")
"""Keys of a file whose values are tables."""


@cache
def _shared_presets() -> Mapping[str, Any]:
    """Return the presets that every car has unless its own file overrides them."""
    files = (DATA / "presets").glob("*.toml")
    return {file.stem: tomllib.loads(file.read_text(encoding="utf-8")) for file in files}


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
    document = inherit(_well_formed(document, where, faults), where, faults)
    presets = {**_shared_presets(), **document.get("preset", {})}
    if preset not in ("default", *presets):
        faults.append(Fault.unknown("unknown preset", where, preset, sorted({"default", *presets})))
    chosen = _well_formed(presets.get(preset, {}), f"{where}, preset.{preset}", faults)
    left_out = {*document.get("without", []), *chosen.get("without", [])}
    raws = {
        f"{section}.{key}": raw
        for section in SECTIONS
        if section not in left_out
        for key, raw in {**document.get(section, {}), **chosen.get(section, {})}.items()
    }
    overrides = {ALIASES.get(key, key): value for key, value in overrides.items()}
    raws |= {key: _override_entry(key, value, raws.get(key)) for key, value in overrides.items()}
    licence = document.get("licence", "not-stated")
    faults += _licence_faults(licence, f"{where}, licence")
    entries: dict[str, Entry] = {}
    for key, raw in raws.items():
        wrong = list(_entry_faults(key, raw, f"{'overrides' if key in overrides else where}, {key}"))
        faults += wrong
        # `[scaled]` leaves None where it could not compute the entry because another one is missing
        if not wrong and raw is not None and key.partition(".")[0] not in left_out:
            entries[key] = _entry({"licence": licence, **raw})
    anchor = str(document.get("anchor", "published"))
    anchor = "published" if anchor == "book" else anchor  # in the folders of cars that 0.2 made
    if anchor not in ANCHORS:
        faults.append(Fault.unknown("unknown anchor", f"{where}, anchor", anchor, ANCHORS))
    parts = {section: _part(section, entries, raws, where, faults) for section in SECTIONS}
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


def _well_formed(document: object, where: str, faults: list[Fault]) -> dict[str, Any]:
    """Return the keys of a document or a preset whose values have the right type; the others are faults."""
    if not isinstance(document, Mapping):
        faults.append(Fault("not a table", where, excerpt(document), "a table"))
        return {}
    kept = {}
    for key, value in document.items():
        place = f"{where}, {key}"
        if key in TABLES and not isinstance(value, Mapping):
            faults.append(Fault("not a table", place, excerpt(value), f"a table [{key}]"))
        elif key == "without" and not (
            isinstance(value, list) and all(section in list(OPTIONAL_SECTIONS) for section in value)
        ):
            allowed = f"a list of {', '.join(sorted(OPTIONAL_SECTIONS))}"
            faults.append(Fault("part cannot be left out", place, excerpt(value), allowed))
        elif key not in (*TABLES, "without", "name", "anchor", "licence", "extends"):
            faults.append(Fault.unknown("unknown section", place, key, (*SECTIONS, "preset")))
        else:
            kept[key] = value
    return kept


def _override_entry(key: str, value: float | str, replaced: Any) -> dict[str, Any]:
    """Return the entry of a value that the caller gives, on the scale of the entry that it replaces."""
    about = FIELDS[key].metadata if key in FIELDS else {"unit": ""}
    entry = {"value": value, "unit": about["unit"], "source": "given by the caller", "licence": "user"}
    if about.get("scaled"):
        entry["scale"] = replaced.get("scale") if isinstance(replaced, Mapping) else "soc"
    return entry


def _entry_faults(key: str, raw: Any, place: str) -> Iterator[Fault]:
    field = FIELDS.get(key)
    if field is None:
        allowed = "a key of the parameter table in docs/explanation/car-model.md"
        yield Fault("unknown key", place, key, allowed, did_you_mean(key, (*ALIASES, *FIELDS)))
    elif raw is not None and not isinstance(raw, Mapping):
        yield Fault("not an entry", place, excerpt(raw), "{ value = ..., unit = ..., source = ... }")
    elif raw is not None:
        for word in raw:
            if word not in ENTRY_KEYS:
                yield Fault.unknown("unknown key of an entry", place, word, ENTRY_KEYS)
        if not str(raw.get("source", "")).strip():
            yield Fault("missing source", place, "nothing", "the source of the value")
        if raw.get("unit") != field.metadata["unit"]:
            yield Fault("wrong unit", place, excerpt(raw.get("unit")), repr(field.metadata["unit"]))
        scales = SCALES if field.metadata.get("scaled") else (None,)
        if raw.get("scale") not in scales:
            allowed = " or ".join(SCALES) if field.metadata.get("scaled") else "no scale"
            yield Fault("wrong scale", place, excerpt(raw.get("scale")), allowed)
        yield from _licence_faults(raw.get("licence", "not-stated"), f"{place}, licence")
        yield from _value_faults(field, raw.get("value"), place)
        if "published" in raw:
            yield from _value_faults(field, raw["published"], place)


def _licence_faults(expression: object, place: str) -> Iterator[Fault]:
    for name in str(expression).split(" AND "):
        if name not in LICENCES:
            yield Fault.unknown("unknown licence", place, name, LICENCES)


def _value_faults(field: dataclasses.Field[Any], value: Any, place: str) -> Iterator[Fault]:
    meta = field.metadata
    if "choice" in meta:
        if value not in meta["choice"]:
            yield Fault.unknown("unknown value", place, value, meta["choice"])
        return
    is_table = str(field.type).startswith("tuple")
    if is_table and not (isinstance(value, list | tuple) and len(value) > 1):
        yield Fault("not a table", place, excerpt(value), "a list of at least two numbers")
        return
    for number in value if is_table else [value]:
        if not isinstance(number, int | float) or isinstance(number, bool):
            yield Fault("not a number", place, excerpt(number), "a finite number")
        elif not meta["minimum"] <= number <= meta["maximum"]:
            allowed = f"{meta['minimum']:g} to {meta['maximum']:g} {meta['unit']}"
            yield Fault("value out of range", place, f"{excerpt(number)} {meta['unit']}", allowed)


def _entry(raw: Mapping[str, Any]) -> Entry:
    """Make an entry of checked values, with numbers as float and lists as tuples."""
    values = {word: _as_value(raw[word]) for word in ("value", "published") if word in raw}
    words = {word: str(raw[word]) for word in raw.keys() - values.keys()}
    return Entry(**values, **words)  # type: ignore[arg-type]


def _as_value(raw: Any) -> float | str | tuple[float, ...]:
    if isinstance(raw, str):
        return raw
    return tuple(map(float, raw)) if isinstance(raw, list | tuple) else float(raw)


def _part(
    section: str,
    entries: Mapping[str, Entry],
    raws: Mapping[str, Any],
    where: str,
    faults: list[Fault],
) -> Any:
    """Build a part from its entries; None if the car lacks this optional part, or an entry is missing."""
    fields = {f.name: f for f in dataclasses.fields(SECTIONS[section])}
    values = {name: entries[key].value for name in fields if (key := f"{section}.{name}") in entries}
    if not values and section in OPTIONAL_SECTIONS:
        return None
    missing = [name for name, f in fields.items() if f.default is dataclasses.MISSING and name not in values]
    for name in missing:
        if f"{section}.{name}" not in raws:  # else the entry already has a fault
            unit = fields[name].metadata["unit"]
            fix = f'add {name} = {{ value = ..., unit = "{unit}", source = "..." }} under [{section}]'
            faults.append(
                Fault("missing entry", f"{where}, [{section}]", "nothing", f"an entry {name!r}", fix)
            )
    return None if missing else SECTIONS[section](**values)


def _useless_overrides(road_load: RoadLoad, overrides: Mapping[str, float | str]) -> Iterator[Fault]:
    """Yield a fault for each override of the description of the road load that is not used."""
    for method, names in ROAD_LOADS.items():
        for key in (f"road_load.{name}" for name in names):
            if key in overrides and road_load.method not in ("", method):
                allowed = f"entries of the {road_load.method} road load"
                fix = f"also set road_load.method to {method!r}, which needs all of its entries"
                yield Fault("override has no effect", f"overrides, {key}", str(overrides[key]), allowed, fix)


def _with_method(road_load: RoadLoad, where: str, faults: list[Fault]) -> RoadLoad:
    """Set the method of the road load to the description that is complete, if the document names none."""
    complete = [m for m, keys in ROAD_LOADS.items() if all(getattr(road_load, k) is not None for k in keys)]
    if road_load.method in complete or (not road_load.method and len(complete) == 1):
        return dataclasses.replace(road_load, method=road_load.method or complete[0])
    allowed = "all of " + ", or all of ".join(
        f"{', '.join(keys)} ({method})" for method, keys in ROAD_LOADS.items()
    )
    got = f"method {road_load.method!r}, complete: {' and '.join(complete) or 'none'}"
    what, fix = "road load is incomplete or ambiguous", "choose a complete description with `method`"
    faults.append(Fault(what, f"{where}, [road_load]", got, allowed, fix))
    return road_load


def _on_soc_scale(battery: Battery, entries: Mapping[str, Entry]) -> Battery:
    """Convert the capacity to the one between soc 0 and soc 1, if it was given on the displayed scale."""
    window = battery.displayed_full_soc - battery.displayed_zero_soc
    if entries["battery.capacity_ah"].scale == "soc" or not window > 0.0:
        return battery
    return dataclasses.replace(battery, capacity_ah=battery.capacity_ah / window)
