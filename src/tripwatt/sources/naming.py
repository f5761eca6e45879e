"""Names that loggers give to columns: the words and the unit in a name, and the canonical columns that it may stand for."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any, Final

from tripwatt.files import shipped_toml
from tripwatt.sources.mapping import UNITS

_OTHER_WATTS: Final = ("mw", "dw", "cw", "µw", "gw", "va", "kva")
_SHOWN: Final = re.compile(r"[(\[]\s*display(ed)?\s*[)\]]", re.IGNORECASE)


@cache
def vocabulary() -> dict[str, Any]:
    """The tables of `names.toml`."""
    return shipped_toml("sources/names.toml")


@cache
def column_names() -> Mapping[str, tuple[str, ...]]:
    """Our columns in the order in which they are searched -> patterns of the names that loggers use, the likeliest first."""
    pack, columns = vocabulary()["pack"], vocabulary()["columns"].items()
    names = {ours: tuple(name.replace("PACK", pack) for name in about["names"]) for ours, about in columns}
    return MappingProxyType(names)


def words(name: str) -> str:
    """A column's name as lower-case words, without its unit in brackets.

    Examples
    --------
    >>> words("T_amb_C"), words("hvBatteryCurrent [A]"), words("Höhe (m)"), words("v.b.voltage")
    ('t amb c', 'hv battery current', 'hohe', 'v b voltage')
    """
    bare = re.sub(r"[\[({][^\])}]*[\])}]*", " ", name).strip() or name
    folded = unicodedata.normalize("NFKD", bare.replace("ß", "ss")).encode("ascii", "ignore").decode()
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", re.sub(r"\bSoC\b", "SOC", folded))
    return " ".join(re.sub(r"[^a-z0-9]+", " ", split.casefold()).split())


def _units_in(name: str) -> list[str]:
    """Units that a column's name may state: the texts in brackets, the last one first; without brackets, the last word."""
    bracketed = [text.strip() for text in re.findall(r"[\[({]([^\])}]*)[\])}]*", name)]
    last = re.split(r"[\s_.:/-]+", name.strip())[-1]
    camel = re.sub(r"^.*[a-z0-9](?=[A-Z])", "", last)
    return [_unit(text) for text in (bracketed[::-1] or (last, camel)) if text]


def _unit(text: str) -> str:
    unit = " ".join(text.casefold().replace("º", "°").split())
    return next((ours for ours, others in vocabulary()["spellings"].items() if unit in others), unit)


def unit_in(ours: str, name: str) -> str | None:
    """The first unit stated in a column's name that is a unit of our column `ours`; None if there is none.

    Examples
    --------
    >>> unit_in("speed_m_s", "Spd (mph)"), unit_in("voltage_v", "HV Volts"), unit_in("speed_m_s", "speed")
    ('mph', 'v', None)
    >>> unit_in("speed_m_s", "speed_kmh"), unit_in("battery_power_w", "power_kW"), unit_in("speed_m_s", "Speed (OBD)(km/h)")
    ('km/h', 'kw', 'km/h')
    """
    units = ["m/s" if (ours, unit) == ("speed_m_s", "ms") else unit for unit in _units_in(name)]
    return next((unit for unit in units if unit in UNITS[ours]), None)


def may_hold(ours: str, label: str) -> bool:
    """Whether a column whose name is unknown may be our column `ours`: its name states a unit of it, or none of any column.

    Examples
    --------
    >>> may_hold("current_a", "HV kW"), may_hold("current_a", "HV (A)"), may_hold("current_a", "HV")
    (False, True, True)
    """
    if unit_in(ours, label) is not None:
        return True
    # a single letter at the end of a name may be no unit, as in "sensor a"
    units = [unit for unit in _units_in(label) if len(unit) > 1 or label.rstrip()[-1:] in "])}"]
    # "dW", "MW": a power in a unit that is not read
    return not any(unit in known for unit in units for known in (*UNITS.values(), _OTHER_WATTS))


def is_excluded(ours: str, name: str) -> bool:
    """Whether a column's name has a word that our column `ours` cannot have."""
    excluded = vocabulary()["columns"][ours].get("not")
    return re.search("|".join(filter(None, (vocabulary()["never"], excluded))), words(name)) is not None


def unit_named(ours: str, text: str) -> str | None:
    """The unit of our column `ours` that a text names; None if it names none.

    Examples
    --------
    >>> unit_named("speed_m_s", "MPH"), unit_named("voltage_v", "bar")
    ('mph', None)
    """
    unit = _unit(text.strip())
    return unit if unit in UNITS[ours] else None


def is_something_else(name: str) -> bool:
    """Whether a column's name alone shows that it is none of our columns, so that its values need no check.

    Examples
    --------
    >>> is_something_else("ideal_battery_range_km"), is_something_else("odometer"), is_something_else("a4")
    (True, True, False)
    """
    return re.search(vocabulary()["other"], words(name)) is not None


def candidates(ours: str, names: Sequence[str]) -> list[str]:
    """The columns in `names` that by their names may be our column `ours`, the likeliest first.

    Examples
    --------
    >>> candidates("voltage_v", ["Cell voltage min", "12 V battery voltage", "Pack Voltage [V]"])
    ['Pack Voltage [V]']
    """
    if ours in names:
        return [ours]
    likely: dict[str, None] = {}
    for pattern in column_names()[ours]:
        for name in names:
            shown = _SHOWN.search(name) is not None  # "State of charge (display)": brackets are no unit here
            text = f"{words(name)} display" if ours == "displayed_soc" and shown else words(name)
            without_unit = " ".join(text.split()[:-1])  # "u v", "i a", "z m": a letter and its unit
            matches = re.search(pattern, text) or (without_unit and re.search(pattern, without_unit))
            if matches and not (ours == "soc" and shown) and not is_excluded(ours, name):
                likely.setdefault(name)
    return list(likely)
