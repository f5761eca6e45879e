"""From a car's TOML to a `Vehicle`, with every fault of the file in one message.

An entry is `key = { value = ..., unit = "...", source = "...", estimated = "how" }`; `estimated` is optional and says
how a value came about that no source states as it stands. `tripwatt.vehicles.licences` says how a file names the
licence of each source. `[preset.NAME.SECTION]` tables replace entries, and
`without = ["climate"]` in `[preset.NAME]` leaves out an optional part.
"""

from __future__ import annotations

import dataclasses
import difflib
import re
import sys
import tomllib
import types
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput, excerpt
from tripwatt.files import MOST_TEXT_BYTES, read_text_file
from tripwatt.vehicles.anchors import anchored_document
from tripwatt.vehicles.catalogue import catalogue, class_values, table_names
from tripwatt.vehicles.charging import charging_section
from tripwatt.vehicles.inheriting import bundled_text, data_folder, inherit
from tripwatt.vehicles.licences import licence_faults, with_licences
from tripwatt.vehicles.overriding import spelled_out
from tripwatt.vehicles.parts import (
    Auxiliaries,
    Battery,
    Body,
    Charging,
    Climate,
    Drivetrain,
    Regeneration,
    RoadLoad,
    Tyres,
)
from tripwatt.vehicles.relations import relation_faults, table_faults
from tripwatt.vehicles.similar import figures_of_row, similar_document

Value = float | str | tuple[float, ...]

SECTIONS: Final[Mapping[str, type]] = types.MappingProxyType(
    {
        "body": Body,
        "road_load": RoadLoad,
        "tyres": Tyres,
        "drivetrain": Drivetrain,
        "regeneration": Regeneration,
        "battery": Battery,
        "auxiliaries": Auxiliaries,
        "climate": Climate,
        "charging": Charging,
    }
)
"""Sections of a car's TOML and the part that each describes."""

OPTIONAL_SECTIONS: Final[frozenset[str]] = frozenset({"tyres", "climate", "charging"})
"""Parts that a car may lack."""

ANCHORS: Final = ("published", "road_load", "certification", "class", "road")
"""What a car's values were held against: nothing; its certified consumption with a measured coast-down, or without one;
nothing of its own, because its values are those of a class; or values carried from a test to the road already."""

ENTRY_KEYS: Final = ("value", "unit", "source", "estimated", "scale", "licence", "published")
SCALES: Final = ("soc", "displayed_soc")


@dataclass(frozen=True, slots=True)
class Entry:
    """One value of a car with its unit, where it comes from, and the licence of that source.

    Attributes
    ----------
    value : float, str or tuple of float
        The value in `unit`.
    unit : str
        As the TOML has it; "1" for a number without a unit.
    source : str
        Where the value comes from.
    estimated : str
        How it was estimated; empty for a stated value.
    scale : str
        Scale of the state of charge to which the value belongs, empty where the value depends on none.
    licence : str
        Of the source, one of `tripwatt.vehicles.LICENCES`.
    published : float, str, tuple of float or None
        The car's value before trips changed it; None where `value` is the published one.

    Examples
    --------
    >>> entry = load_vehicle("bmw_i3_60ah").entries["body.curb_mass_kg"]
    >>> entry.unit, entry.estimated
    ('kg', "the test weight is a class of 125 lb; BMW's own figure is 1195 kg without options (EU) and 2799 lb (US)")
    """

    value: Value
    unit: str
    source: str
    estimated: str = ""
    scale: str = ""
    licence: str = "not-stated"
    published: Value | None = None


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A car: its parts, and the origin of every value.

    Attributes
    ----------
    name : str
        Name of the TOML without its ending.
    title : str
        Name for people.
    preset : str
        Preset of the TOML that was read.
    body : Body
        Masses.
    road_load : RoadLoad
        Resistance on a flat road.
    tyres : Tyres or None
        How rolling drag depends on weather and warmth; None in presets without it.
    drivetrain : Drivetrain
        Gear, motor and inverter.
    regeneration : Regeneration
        How much braking goes through the motor.
    battery : Battery
        High-voltage battery.
    auxiliaries : Auxiliaries
        Loads that neither drive nor heat.
    climate : Climate or None
        Cabin and climate control; None in presets without it.
    entries : mapping of str to Entry
        "section.key" -> value, unit and source, as used.
    anchor : str
        What the values were held against, one of `ANCHORS`.
    charging : Charging or None
        Charging power; None where it is not known.

    Examples
    --------
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> car.body.test_mass_kg
    1356.0
    >>> car.entries["regeneration.fraction"].unit
    '1'
    """

    name: str
    title: str
    preset: str
    body: Body
    road_load: RoadLoad
    tyres: Tyres | None
    drivetrain: Drivetrain
    regeneration: Regeneration
    battery: Battery
    auxiliaries: Auxiliaries
    climate: Climate | None
    entries: Mapping[str, Entry] = dataclasses.field(repr=False, compare=False, hash=False)
    anchor: str = "published"
    charging: Charging | None = None


@cache
def vehicle_names() -> tuple[str, ...]:
    """Names of the cars that come with the package, sorted.

    Examples
    --------
    >>> "bmw_i3_60ah" in vehicle_names()
    True
    """
    return tuple(sorted({*file_names(), *table_names()}))


@cache
def file_names() -> tuple[str, ...]:
    """Names of the cars that have a TOML of their own, sorted."""
    return tuple(sorted(f.name[:-5] for f in data_folder().iterdir() if f.name.endswith(".toml")))


def load_vehicle(
    name_or_path: str | Path, preset: str = "default", overrides: Mapping[str, float | str] | None = None
) -> Vehicle:
    """Load a car that comes with the package, or one from a TOML file.

    Parameters
    ----------
    name_or_path : str or Path
        A name from `vehicle_names()`, or the path of a TOML file.
    preset : str
        "default", "paper", or a preset of the file.
    overrides : mapping of str to (float or str), optional
        "section.key" or a short name of `tripwatt.vehicles.overriding` -> value in the unit of the entry, e.g.
        ``{"auxiliaries.base_load_w": 400.0, "mass": 1300.0}``. Those of a part that the preset leaves out
        change nothing.

    Returns
    -------
    Vehicle
        Its parts, and the origin of every value.

    Raises
    ------
    InvalidInput
        With every fault of the file, the preset and the overrides.

    Examples
    --------
    >>> load_vehicle("bmw_i3_60ah", preset="paper").regeneration.fraction
    0.5
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        name = str(name_or_path)
        if overrides:
            return _from_library(name, preset, overrides)
        found = _unchanged(name, preset)
        return dataclasses.replace(found, entries=dict(found.entries))
    try:
        document = tomllib.loads(_read(path))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InvalidInput(Fault("not a TOML file", str(path), str(error)[:200], "TOML 1.0")) from error
    # what a user gives for an own car is the user's
    document = {"licence": "user", **document}
    return vehicle_from_document(document, path.stem, str(path), preset, overrides or {})


def _from_library(name: str, preset: str, overrides: Mapping[str, float | str]) -> Vehicle:
    require_vehicle(name)
    document = anchored_document(name, library_document(name))
    return vehicle_from_document(document, name, f"{name}.toml", preset, overrides)


@lru_cache(maxsize=256)
def _unchanged(name: str, preset: str) -> Vehicle:
    """A car of the library as it is, read once: its file takes 10 ms. Nothing of it can change but its entries."""
    return _from_library(name, preset, {})


def require_vehicle(name: str) -> None:
    """Raise `InvalidInput` for a name that is none of `vehicle_names()`, with the cars that are meant perhaps.

    Parameters
    ----------
    name : str
        Name of a bundled car.

    Raises
    ------
    InvalidInput
        When the name is none of `vehicle_names()`; with the cars that may be meant.

    Examples
    --------
    >>> require_vehicle("bmw_i3_60ah")
    """
    if name in vehicle_names():
        return
    near = find_vehicles(name) or difflib.get_close_matches(name, vehicle_names(), n=3)
    fix = (
        f"did you mean {' or '.join(repr(n) for n in near[:3])}?"
        if near
        else "or give the path of a .toml file"
    )
    allowed = f"one of {len(vehicle_names())} names, listed by `tripwatt vehicles`"
    raise InvalidInput(Fault("unknown car", "vehicle", excerpt(name), allowed, fix))


@cache
def vehicle_titles() -> Mapping[str, str]:
    """Name for people of every car of the library, by its name, without loading the cars.

    Examples
    --------
    >>> vehicle_titles()["vw_id3"]
    'Volkswagen ID.3 58 kWh'
    """
    titles = {name: str(tomllib.loads(bundled_text(name) or "")["name"]) for name in file_names()}
    titles |= {name: catalogue()[name]["title"][0].value for name in table_names()}
    return types.MappingProxyType({name: titles[name] for name in vehicle_names()})


def find_vehicles(words: str) -> tuple[str, ...]:
    """Find the cars whose title or name has every one of some words. O(cars).

    Parameters
    ----------
    words : str
        Words in any order; a year finds the cars that were made in it. Signs and case do not count: "model3 2022" finds the
        Model 3 of 2022. A word of one or two letters has to be a whole word of the title.

    Returns
    -------
    tuple of str
        Names of cars, those with the shortest titles first; empty for no words.

    Examples
    --------
    >>> find_vehicles("kona")
    ('hyundai_kona_64', 'hyundai_kona_39')
    """
    wanted = [_plain(word) for word in words.split()]
    wanted = [word for word in wanted if word]
    found = []
    for name, title in vehicle_titles().items():
        years = _years(title)
        texts = {_plain(word) for word in re.split(r"[\s_()/-]+", f"{title} {name}")}
        whole = _plain(f"{title} {name}")
        if wanted and all(
            word in texts or (len(word) > 2 and word in whole) or _is_year_in(word, years) for word in wanted
        ):
            found.append((len(title), name))
    return tuple(name for _, name in sorted(found))


def _plain(text: str) -> str:
    """Letters and digits of a text, in lower case and without accents."""
    plain = unicodedata.normalize("NFKD", text.lower())
    return "".join(sign for sign in plain if sign.isascii() and sign.isalnum())


def _years(title: str) -> tuple[int, int] | None:
    """First and last model year in the brackets at the end of a title."""
    found = re.search(r"\((\d{4})(?:-(\d{4}))?\)$", title)
    return None if found is None else (int(found[1]), int(found[2] or found[1]))


def _is_year_in(word: str, years: tuple[int, int] | None) -> bool:
    return years is not None and len(word) == 4 and word.isdigit() and years[0] <= int(word) <= years[1]


def library_document(name: str) -> dict[str, Any]:
    """The document of a car of the library, before it is anchored.

    Parameters
    ----------
    name : str
        One of `vehicle_names()`.
    """
    if name in file_names():
        return {**tomllib.loads(bundled_text(name) or ""), **charging_section(name)}
    return {**similar_document(figures_of_row(catalogue()[name]), class_values()), **charging_section(name)}


def _read(path: Path) -> str:
    return read_text_file(path, MOST_TEXT_BYTES, what="file cannot be read", allowed="a TOML text file")


@cache
def _shared_presets() -> dict[str, dict[str, Any]]:
    """Presets that every car has unless its own file overrides them."""
    files = sorted((data_folder() / "presets").iterdir(), key=lambda f: str(f.name))
    faults: list[Fault] = []
    presets = {
        f.name[:-5]: with_licences(tomllib.loads(f.read_text(encoding="utf-8")), f.name, faults)
        for f in files
        if f.name.endswith(".toml")
    }
    if faults:
        raise InvalidInput(faults)
    return presets


def vehicle_from_document(
    document: Mapping[str, Any],
    name: str,
    where: str,
    preset: str = "default",
    overrides: Mapping[str, float | str] = types.MappingProxyType({}),
) -> Vehicle:
    """Build a `Vehicle` from a parsed TOML document. Arguments and errors as in `load_vehicle`.

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
        With every part, its values checked.

    Raises
    ------
    InvalidInput
        With everything that is missing, unknown or out of bounds.

    Examples
    --------
    >>> import tomllib
    >>> from tripwatt.vehicles import render_vehicle
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
    overrides = spelled_out(overrides)
    for key, value in overrides.items():
        _override(entries, key, value, faults)
    left_out = OPTIONAL_SECTIONS - tables.keys() if preset != "default" else frozenset()
    entries = {key: e for key, e in entries.items() if key.partition(".")[0] not in left_out}
    parts: dict[str, Any] = {}
    anchor = str(document.get("anchor", "published"))
    anchor = "published" if anchor == "book" else anchor  # its name up to 0.2
    if anchor not in ANCHORS:
        faults.append(_unknown_fault("anchor", f"{where}, anchor", anchor, ANCHORS))
    for section, part in SECTIONS.items():
        if section in left_out:
            parts[section] = None
            continue
        present = {k.partition(".")[2]: e for k, e in entries.items() if k.startswith(f"{section}.")}
        if section in OPTIONAL_SECTIONS and section not in tables and not present:
            parts[section] = None
            continue
        missing = [f.name for f in dataclasses.fields(part) if _is_required(f) and f.name not in present]
        named = tables.get(section, {})
        faults += [
            Fault(
                "missing entry",
                f"{where}, [{section}]",
                "nothing",
                f"an entry {key!r}",
                _entry_line(section, key),
            )
            for key in missing
            if key not in named  # else its own fault was told
        ]
        if not missing:
            parts[section] = part(**{k: e.value for k, e in present.items()})
    if not faults:
        parts["road_load"] = _with_method(parts["road_load"], where, faults)
        faults += _useless_overrides(parts["road_load"], overrides)
        parts["battery"] = _on_soc_scale(parts["battery"], entries)
        faults += table_faults(parts, where)
    if not faults:
        faults += relation_faults(parts, where)
    if faults:
        raise InvalidInput(faults)
    title = str(document.get("name", name))
    return Vehicle(name, title, preset, entries=entries, anchor=anchor, **parts)


def _preset_tables(
    document: Mapping[str, Any], preset: str, where: str, faults: list[Fault]
) -> dict[str, dict[str, Any]]:
    """The sections with the preset's entries in place of their own."""
    faults += [
        _unknown_fault("section", f"{where}, [{key}]", key, [*SECTIONS, "preset"])
        for key in document
        if key not in (*SECTIONS, "preset", "name", "anchor")
    ]
    presets = {**_shared_presets(), **document.get("preset", {})}
    if preset != "default" and preset not in presets:
        allowed = ", ".join(sorted({"default", *presets}))
        faults.append(Fault("unknown preset", where, preset, allowed))
    chosen = presets.get(preset, {})
    dropped = chosen.get("without", [])
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


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING


def _unknown_fault(what: str, where: str, got: str, allowed: Sequence[str] | Mapping[str, Any]) -> Fault:
    near = difflib.get_close_matches(got[:60], list(allowed), n=1)
    return Fault(
        f"unknown {what}",
        where,
        got,
        ", ".join(sorted(allowed)) if len(allowed) < 12 else "a key of the parameter table in docs/model.md",
        f"did you mean {near[0]!r}?" if near else "",
    )


def _fields(section: str) -> dict[str, dataclasses.Field[Any]]:
    return {f.name: f for f in dataclasses.fields(SECTIONS[section])}


def _entry_line(section: str, key: str) -> str:
    """What to write for an entry that is missing."""
    unit = _fields(section)[key].metadata["unit"]
    return f'add {key} = {{ value = ..., unit = "{unit}", source = "..." }} under [{section}]'


def _entry(section: str, key: str, raw: object, where: str, faults: list[Fault]) -> Entry | None:
    """One checked entry; None when it cannot be used, with the reason in `faults`."""
    place = f"{where}, {section}.{key}"
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
    section, _, name = key.partition(".")
    known = section in SECTIONS and name in _fields(section)
    if not known:
        allowed = [f"{s}.{f}" for s in SECTIONS for f in _fields(s)]
        faults.append(_unknown_fault("key", "overrides", key, allowed))
        return
    field = _fields(section)[name]
    found = list(_value_faults(field, value, f"overrides, {key}"))
    faults.extend(found)
    if not found:
        old = entries.get(key)
        entries[key] = Entry(
            _as_value(value),
            field.metadata["unit"],
            "given by the caller",
            scale=old.scale if old else "soc",
            licence="user",
        )


def _useless_overrides(road_load: RoadLoad, overrides: Mapping[str, float | str]) -> Iterator[Fault]:
    """Overrides of the description of the road load that is not in use."""
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
    """The road load with its method settled: the one whose values are all there."""
    names = {
        "coastdown": [f.name for f in dataclasses.fields(RoadLoad) if f.name.startswith("coastdown_")],
        "coefficients": ["drag_coefficient", "frontal_area_m2", "rolling_resistance_coefficient"],
    }
    complete = [m for m, keys in names.items() if all(getattr(road_load, k) is not None for k in keys)]
    place = f"{where}, [road_load]"
    if road_load.method and road_load.method not in complete:
        lacking = [k for k in names[road_load.method] if getattr(road_load, k) is None]
        fix = "; ".join(_entry_line("road_load", key) for key in lacking)
        faults.append(Fault("missing entry", place, "nothing", f"entries {', '.join(lacking)}", fix))
    elif not road_load.method and len(complete) != 1:
        allowed = "either all of " + " or all of ".join(", ".join(keys) for keys in names.values())
        got = "both descriptions and no method" if complete else "no complete description"
        faults.append(
            Fault("road load is incomplete or ambiguous", place, got, allowed, "choose one with `method`")
        )
    elif not road_load.method:
        return dataclasses.replace(road_load, method=complete[0])
    return road_load


def _on_soc_scale(battery: Battery, entries: Mapping[str, Entry]) -> Battery:
    """The battery with its capacity between soc 0 and soc 1."""
    window = battery.displayed_full_soc - battery.displayed_zero_soc
    if entries["battery.capacity_ah"].scale == "soc" or not window > 0.0:
        return battery
    return dataclasses.replace(battery, capacity_ah=battery.capacity_ah / window)
