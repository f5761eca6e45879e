"""Overrides of a car's values in the notation of the command line: `mass=1300`, `c_d=0.27`, `battery.capacity_ah=58`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from tripwatt.errors import Fault, did_you_mean, raise_faults
from tripwatt.files import shipped_toml

ALIASES: Final[Mapping[str, str]] = shipped_toml("vehicles/data/table/aliases.toml")
"""Short name of an override -> its key. `payload` is the mass of everything aboard, including the driver."""


def parse_overrides(texts: Iterable[str]) -> dict[str, float | str]:
    """Parse texts such as "mass=1300" into overrides for `load_vehicle`, with short names spelled out.

    Parameters
    ----------
    texts : iterable of str
        Texts `key=value`; the key is a short name of `ALIASES`, or `section.key`.

    Returns
    -------
    dict of str to (float or str)
        "section.key" -> value in SI units as in the TOML; a text if the value is not a number.

    Raises
    ------
    InvalidInput
        With every text that is not `key=value`, every unknown short name, and every repeated key.

    Examples
    --------
    >>> parse_overrides(["mass=1300", "battery.capacity_ah=94"])
    {'body.curb_mass_kg': 1300.0, 'battery.capacity_ah': 94.0}
    """
    result: dict[str, float | str] = {}
    faults: list[Fault] = []
    for text in texts:
        short, equals, value = (part.strip() for part in text.partition("="))
        key = ALIASES.get(short, short)
        if not equals or not short or not value:
            faults.append(Fault("not an override", "--set", text, "key=value, for example mass=1300"))
        elif key in result:
            faults.append(Fault("override given twice", "--set", text, f"one value for {key}"))
        elif "." not in key:
            allowed = f"section.key, or one of {', '.join(ALIASES)}"
            faults.append(Fault("unknown key", "--set", short, allowed, did_you_mean(key, ALIASES)))
        else:
            try:
                result[key] = float(value)
            except ValueError:
                result[key] = value
    raise_faults(faults)
    return result
