"""Power of a charging station from a text that people wrote, such as "2x 50 kW; 500 V" or "22.000 W"."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from types import MappingProxyType
from typing import Final, NamedTuple

LOWEST_W: Final = 2_200.0
"""Least power of a text without a plug, and of a number without a unit that is read in watts: a choice between a year such as 2024 and
2,300 W, the power of 10 A at 230 V."""
HIGHEST_W: Final = 1_500_000.0
MOST_WITHOUT_UNIT_KW: Final = 400.0
"""Largest number without a unit that is read in kW: a choice, since 500 or 800 may be volts."""

_UNITS: Final[Mapping[str, float]] = MappingProxyType(
    dict.fromkeys(["w", "va", "watt", "watts"], 1.0)
    | dict.fromkeys(["kw", "kva", "kwh", "kilowatt", "kilowatts"], 1e3)
    | dict.fromkeys(["mw", "mva", "megawatt", "megawatts"], 1e6)
)
"""Power of a unit [W]. On a station, kWh is a slip for kW, and mW one for MW."""
_VOLTS: Final = frozenset(["v", "volt", "volts", "vac"])
_AMPERES: Final = frozenset(["a", "amp", "amps", "ampere", "amperes"])
_NEUTRAL: Final = frozenset(
    ["ac", "dc", "max", "up", "to", "bis", "or", "and", "und", "oder", "ca", "per", "each"]
)
"""Words beside a number that do not change what it means."""
_AMPERES_ALONE: Final = frozenset({13.0, 16.0, 32.0})
"""Numbers without a unit that are the current of a socket with alternating current, and no power of one [A]."""
_PHASES: Final = ((200.0, 250.0, 1.0), (380.0, 420.0, math.sqrt(3.0)))
"""Bounds of voltages [V], and power over voltage and current, with one phase and with three."""
_MAX_AMPERES: Final = 64.0

_NO_NUMBERS: Final = re.compile(r"\b24\s*/\s*7\b|\d+:\d+|(?<![\d.,])\d+\s*[x×*](?![a-z])|[x×*]\s*\d+\b")
"""Hours, and the number of sockets."""
_SPACE: Final = r"[ \u00a0\u2009\u202f]"
_TOKEN: Final = re.compile(
    r"(?<![\w.,])(?:[ad]c)?(\d{1,3}(?:[.,'’ \u00a0\u2009\u202f]\d{3})+(?:[.,]\d+)?|\d+(?:[.,]\d+)?)(?![\d])\s*([a-zäöü]*)"
)
_LIST: Final = re.compile(r"\s*(?:[/+;,&–-]|\b(?:to|bis|or|oder|and|und)\b)\s*")
"""What joins numbers that share the unit of the last."""


class _Number(NamedTuple):
    """A number of a text, its unit, and its place."""

    text: str
    unit: str
    start: int

    @property
    def readings(self) -> set[float]:
        """Values that the number may mean: separators before three digits are those of thousands or of decimals."""
        *_, last = re.split(_SPACE, self.text)
        return {value for text in (self.text, last) for value in _values(re.sub(f"{_SPACE}|['’]", "", text))}


def _values(text: str) -> Iterator[float]:
    """Yield the values of digits with points and commas.

    Examples
    --------
    >>> [sorted(_values(text)) for text in ("22,0", "1.000", "1.000,5", "1,000,000")]
    [[22.0], [1.0, 1000.0], [1000.5], [1000000.0]]
    """
    separators = re.findall(r"[.,]", text)
    digits = re.sub(r"[.,]", "", text)
    decimals = len(text) - 1 - max(text.rfind("."), text.rfind(",")) if separators else 0
    if len(set(separators)) == 2 or len(separators) == 1:  # the last separator is that of decimals
        yield float(digits) / 10.0**decimals
    if not separators or (decimals == 3 and len(set(separators)) == 1):
        yield float(digits)


def power_w(
    text: str, lowest_w: float = LOWEST_W, highest_w: float = HIGHEST_W, *, alternating: bool = True
) -> float:
    """Return the highest power in a text [W]; 0 if there is none, or if it is not clear what the text means.

    Parameters
    ----------
    text : str
        Text of a tag; its first 200 characters are read.
    lowest_w, highest_w : float
        Bounds of the power of the plug; readings outside of them are left out.
    alternating : bool
        Whether the power may follow from volts and amperes.

    Returns
    -------
    float
        A number without a unit is in kW up to `MOST_WITHOUT_UNIT_KW`, else in watts.

    Examples
    --------
    >>> [power_w(text) for text in ("50 kW; 500 V", "1 MW", "22 kW;50 kW", "22000", "1.000 kW", "7,4 kW")]
    [50000.0, 1000000.0, 50000.0, 22000.0, 1000000.0, 7400.0]
    >>> [power_w(text) for text in ("400 V, 32 A", "32 A", "yes", "2024")]
    [22000.0, 0.0, 0.0, 0.0]
    """
    text = _NO_NUMBERS.sub(" ", text[:200].lower())
    numbers = _with_shared_units(text)
    units = {number.unit for number in numbers}
    if not units.isdisjoint(_UNITS):
        readings = [{_UNITS[n.unit] * value for value in n.readings} for n in numbers if n.unit in _UNITS]
    elif units & _VOLTS:
        readings = [_alternating_w(numbers)] if alternating else []
    elif {*re.findall(r"[a-zäöü]+", text)} <= _NEUTRAL:
        no_powers = _AMPERES_ALONE if alternating and highest_w < HIGHEST_W else frozenset[float]()
        readings = [_without_unit_w(number.readings - no_powers) for number in numbers]
    else:
        return 0.0
    plausible = [{watt for watt in watts if lowest_w <= watt <= highest_w} for watts in readings]
    return max((watts.pop() for watts in plausible if len(watts) == 1), default=0.0)


def _with_shared_units(text: str) -> list[_Number]:
    """Return the numbers of a text; in a list such as "11/22 kW", each number has the unit of the last."""
    numbers: list[_Number] = []
    for match in reversed([*_TOKEN.finditer(text)]):
        unit = match[2]
        if not unit or unit in _NEUTRAL:
            is_listed = numbers and _LIST.fullmatch(text, match.end(1), numbers[-1].start)
            unit = numbers[-1].unit if is_listed else ""
        numbers.append(_Number(match[1], unit, match.start()))
    return numbers


def _without_unit_w(readings: Set[float]) -> set[float]:
    """Return the powers that a number without a unit may mean [W]."""
    kilowatts = {1e3 * value for value in readings if value <= MOST_WITHOUT_UNIT_KW}
    return kilowatts | {value for value in readings if value >= LOWEST_W}


def _alternating_w(numbers: Sequence[_Number]) -> set[float]:
    """Return the rated power of one voltage and one current, to two digits [W]; nothing if there are more or fewer of them."""
    volts, amperes = (
        [value for number in numbers if number.unit in units for value in number.readings]
        for units in (_VOLTS, _AMPERES)
    )
    if len(volts) != 1 or len(amperes) != 1 or amperes[0] > _MAX_AMPERES:
        return set()
    factors = (factor for low, high, factor in _PHASES if low <= volts[0] <= high)
    return {float(f"{factor * volts[0] * amperes[0]:.1e}") for factor in factors}
