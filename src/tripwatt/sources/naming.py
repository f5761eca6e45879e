"""What loggers call things: the words of a column's name, the unit in it, and our columns that it may be."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from typing import Final

from tripwatt.sources.mapping import POWER, UNITS

_PACK: Final = r"\b(hv|pack|traction|batt?(ery|erie)?|bms|akku|dc)\b.*"

NAMES: Final[Mapping[str, tuple[str, ...]]] = {
    "time_s": (
        r"^(unix )?(time ?stamp|date ?time|zeitstempel|epoch|utc)\b",
        r"^(elapsed |unix |gps |device |local |log )?(time|zeit|temps|tiempo|tijd)\b",
        r"\b(time|timestamp|zeit|uhrzeit|date|datum)\b|^elapsed",
        r"^(t|ts|sec|secs|seconds|sekunden|date|clock)$",
    ),
    "speed_m_s": (
        r"\b(vehicle|veh|car|wheel|fahrzeug) ?(speed|spd|velocity|geschwindigkeit)\b",
        r"^(speed|spd|velocity|velo|geschwindigkeit|vitesse|velocidad|snelheid|v)$",
        r"\b(speed|spd|velocity|geschwindigkeit|vitesse|velocidad|snelheid)\b",
        r"^v veh\b|^v fzg\b|^veh v\b",
        r"^(kmh|kph|mph)$",
    ),
    "voltage_v": (
        _PACK + r"\b(voltage|volts?|spannung|tension|u|v)\b",
        r"\b(u|v) ?(hv|pack|batt?(ery)?|bms|dc)\b",
        r"\b(voltage|spannung|tension)\b",
        r"^(volts?|u|vbat|vbatt|ubat|ubatt)$",
    ),
    "current_a": (
        _PACK + r"\b(current|amps?|amperes?|strom|courant|i|a)\b",
        r"\bi ?(hv|pack|batt?(ery)?|bms|dc)\b",
        r"\b(current|strom|courant)\b",
        r"^(amps?|amperes?|i|ibat|ibatt)$",
    ),
    POWER: (_PACK + r"\b(power|leistung|puissance|p)\b", r"^(power|leistung|puissance|p)$"),
    "displayed_soc": (
        r"\bdisplay(ed)?\b.*\b(soc|state of charge)\b",
        r"\busable\b.*\b(level|soc)\b",
        r"\b(soc|state of charge)\b.*\bdisplay(ed)?\b",
        r"\b(soc|state of charge)\b.*\bdash(board)?\b",
        r"\b(soc|ladezustand)\b.*\banzeige\b|\banzeige\b.*\b(soc|ladezustand)\b",
    ),
    "soc": (
        r"\bsoc\b",
        r"\bstate of charge\b",
        r"\b(battery|charge) ?level\b",
        r"\bladezustand\b",
    ),
    "elevation_m": (
        r"\b(elevation|elev|elv|altitude|alt|height|hohe|hoehe|hoogte|altitud)\b",
        r"^z$",
    ),
    "grade": (r"\b(grade|slope|inclination|steigung|pente)\b",),
    "ambient_temperature_degc": (
        r"\b(ambient|outside|outdoor|oat|aussentemperatur|aussen|exterieure?|exterior|external|umgebung\w*)\b",
        r"\b(t|temp|temperature) ?(amb|ambient|out|outside|ext|env|air)\b",
        r"\b(amb|out|ext|env|air) ?(t|temp|temperature)\b",
        r"^tamb$|^tout$|^text$|^weather temp|^v e temp$",
        r"^(t|temp|temperature|temperatur)$",
    ),
    "cabin_temperature_degc": (
        r"\b(cabin|interior|innenraum|habitacle)\b",
        r"\binnentemp\w*\b|\bcabintemp\b",
        r"\binside ?temp",
        r"\b(t|temp) ?(cabin|in|inside)\b",
    ),
    "battery_temperature_degc": (
        r"\bbatt?(ery|erie)?\b.*\b(temp|temperature|temperatur|t)\b",
        r"\b(t|temp|temperature)\b.*\bbatt?(ery|erie)?\b",
        r"^v b temp$",
        r"^pack t\d? c$",
    ),
    "motor_torque_nm": (r"\b(torque|drehmoment|couple)\b",),
    "heating_power_w": (
        r"\bheat(er|ing)? ?power\b",
        r"\bheizleistung\b",
        r"\bptc ?power\b",
        r"\bpwr htr\b",
    ),
    "aircon_power_w": (r"\b(air ?con\w*|a c|ac) ?power\b", r"\bpwr a c\b"),
    "climate_power_w": (r"\b(climate|hvac) ?(control )?power\b",),
}
"""What loggers call our columns, the likeliest first; matched on `words`."""

_OTHER: Final = re.compile(
    r"\b(id|range|reichweite|odo\w*|mileage|kilometerstand|lat|lon|lng|long|latitude|longitude|heading|bearing|pressure|"
    r"tp|fan|cp\d*|gids|soh|hx|rpm)\b"
)
"""Words of columns that hold something else of a car than any of ours, whatever their values look like."""

_NEVER: Final = (
    r"\b(12 ?v|lv|aux\w*|modul\w*|cell|cells|zelle\w*|min|max|avg|charger|obd|adapter|requested|request|target|"
    r"set ?point|limit|lim|soll)\b"
)
_NOT: Final[Mapping[str, str]] = {
    "time_s": r"\b(remaining|duration|step|delta|zone|to)\b",
    "speed_m_s": r"\b(motor|engine|rpm|wind|fan|compressor|pump|gps accuracy)\b",
    "voltage_v": r"\b(motor|inverter|ac|phase|outlet|temp\w*)\b",
    "current_a": r"\b(motor|inverter|ac|phase|outlet|temp\w*|speed|trip|drive)\b",
    POWER: r"\b(motor|inverter|ac|heat\w*|air|climate|hvac)\b",
    "soc": r"\b(charging)\b",
    "ambient_temperature_degc": r"\b(batt\w*|motor|inverter|coolant|cabin|pressure|brightness|humidity)\b",
    "cabin_temperature_degc": r"\b(batt\w*|motor|humidity)\b",
    "battery_temperature_degc": r"\b(ambient|outside)\b",
}
"""Words of columns that share a name with ours but are something else."""

_SHOWN: Final = re.compile(r"[(\[]\s*display(ed)?\s*[)\]]", re.IGNORECASE)

_SPELLINGS: Final = {
    "km/h": ("kmh", "kph", "kmph", "kmhr", "km h", "km/hr"),
    "m/s": ("mps", "m s", "meters/second"),
    "mph": ("mi/h", "miles/h"),
    "v": ("volt", "volts"),
    "a": ("amp", "amps", "ampere", "amperes"),
    "degc": ("celsius", "deg c", "grad c", "°c", "\ufffdc", "?c"),
    "degf": ("fahrenheit", "deg f", "°f"),
    "k": ("kelvin",),
    "%": ("pct", "percent", "prozent"),
    "m": ("meter", "meters", "metres"),
    "ft": ("feet", "foot"),
    "w": ("watt", "watts"),
    "s": ("sec", "secs", "seconds"),
    "ms": ("msec", "millis"),
    "min": ("minutes",),
}
_UNIT_WORDS: Final = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}


def words(name: str) -> str:
    """A column's name as lower-case words, without its unit in brackets.

    Examples
    --------
    >>> words("T_amb_C"), words("hvBatteryCurrent [A]"), words("Höhe (m)"), words("v.b.voltage")
    ('t amb c', 'hv battery current', 'hohe', 'v b voltage')
    """
    bare = re.sub(r"[\[({][^\])}]*[\])}]*", " ", name) or name
    if not bare.strip():
        bare = name
    folded = unicodedata.normalize("NFKD", bare.replace("ß", "ss")).encode("ascii", "ignore").decode()
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", re.sub(r"\bSoC\b", "SOC", folded))
    return " ".join(re.sub(r"[^a-z0-9]+", " ", split.casefold()).split())


def units_in(name: str) -> tuple[str, ...]:
    """Units that a column's name may state: in brackets, the last first, else as its last word.

    Examples
    --------
    >>> units_in("v [km/h]"), units_in("speed_kmh"), units_in("power_kW"), units_in("Speed (OBD)(km/h)")
    (('km/h',), ('km/h',), ('kw', 'w'), ('km/h', 'obd'))
    """
    bracketed = [text.strip() for text in re.findall(r"[\[({]([^\])}]*)[\])}]*", name)]
    if bracketed:
        return tuple(dict.fromkeys(_unit(text) for text in reversed(bracketed) if text))
    last = re.split(r"[\s_.:/-]+", name.strip())[-1]
    camel = re.sub(r"^.*[a-z0-9](?=[A-Z])", "", last)
    return tuple(dict.fromkeys(_unit(text) for text in (last, camel) if text))


def _unit(text: str) -> str:
    unit = " ".join(text.casefold().replace("º", "°").split())
    return _UNIT_WORDS.get(unit, unit)


def unit_in(ours: str, name: str) -> str | None:
    """The unit that a column's name states, if one of our column `ours` has it.

    Examples
    --------
    >>> unit_in("speed_m_s", "Spd (mph)"), unit_in("voltage_v", "HV Volts"), unit_in("speed_m_s", "speed")
    ('mph', 'v', None)
    """
    units = units_in(name)
    if ours == "speed_m_s":
        units = tuple("m/s" if unit == "ms" else unit for unit in units)
    return next((unit for unit in units if unit in UNITS[ours]), None)


def unit_named(ours: str, text: str) -> str | None:
    """The unit of our column `ours` that a text is, if it is one.

    Examples
    --------
    >>> unit_named("speed_m_s", "MPH"), unit_named("voltage_v", "bar")
    ('mph', None)
    """
    unit = _unit(text.strip())
    return unit if unit in UNITS[ours] else None


def is_something_else(name: str) -> bool:
    """Whether a column is none of ours by its name alone, so that its values need not be checked.

    Examples
    --------
    >>> is_something_else("ideal_battery_range_km"), is_something_else("odometer"), is_something_else("a4")
    (True, True, False)
    """
    return _OTHER.search(words(name)) is not None


def candidates(ours: str, names: Sequence[str]) -> list[str]:
    """Columns that may be `ours` by their names, the likeliest first.

    Examples
    --------
    >>> candidates("voltage_v", ["Cell voltage min", "12 V battery voltage", "Pack Voltage [V]"])
    ['Pack Voltage [V]']
    """
    if ours in names:
        return [ours]
    forbidden = re.compile(f"{_NEVER}|{_NOT[ours]}" if ours in _NOT else _NEVER)
    likely: dict[str, None] = {}
    for pattern in NAMES[ours]:
        for name in names:
            shown = _SHOWN.search(name) is not None  # "State of charge (display)": brackets are no unit here
            if ours == "soc" and shown:
                continue
            text = f"{words(name)} display" if ours == "displayed_soc" and shown else words(name)
            without_unit = " ".join(text.split()[:-1])  # "u v", "i a", "z m": a letter and its unit
            matches = re.search(pattern, text) or (without_unit and re.search(pattern, without_unit))
            if matches and not forbidden.search(text):
                likely.setdefault(name)
    return list(likely)
