"""Power of a charging station from a text that people wrote, such as "2x 50 kW; 500 V" or "22.000 W"."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

LOWEST_W: Final = 2_200.0
"""Least power of a text without a plug, and of a number without a unit that is read in watts: a choice between a year such as 2024 and
2,300 W, the power of 10 A at 230 V."""
HIGHEST_W: Final = 1_500_000.0
MOST_WITHOUT_UNIT_KW: Final = 400.0
"""Largest number without a unit that is read in kW: a choice, since 500 or 800 may be volts."""

_UNITS: Final[Mapping[str, float]] = MappingProxyType(
    {
        **dict.fromkeys(("w", "va", "watt", "watts"), 1.0),
        **dict.fromkeys(("kw", "kva", "kwh", "kilowatt", "kilowatts"), 1e3),
        **dict.fromkeys(("mw", "mva", "megawatt", "megawatts"), 1e6),
    }
)
"""Power of a unit [W]. On a station, kWh is a slip for kW, and mW one for MW."""
_VOLTS: Final = frozenset({"v", "volt", "volts", "vac"})
_AMPERES: Final = frozenset({"a", "amp", "amps", "ampere", "amperes"})
_NEUTRAL: Final = frozenset(
    {"", "ac", "dc", "max", "up", "to", "bis", "or", "and", "und", "oder", "ca", "per", "each"}
)
"""Words beside a number that do not change what it means."""
_AMPERES_ALONE: Final = (13.0, 16.0, 32.0)
"""Numbers without a unit that are the current of a socket with alternating current, and no power of one [A]."""
_SINGLE_PHASE_V: Final = (200.0, 250.0)
_THREE_PHASE_V: Final = (380.0, 420.0)
_MAX_AMPERES: Final = 64.0

_NO_NUMBERS: Final = re.compile(r"\b24\s*/\s*7\b|\d+:\d+|(?<![\d.,])\d+\s*[x×*](?![a-z])|[x×*]\s*\d+\b")
"""Hours, and the number of sockets."""
_TOKEN: Final = re.compile(
    r"(?<![\w.,])(?:[ad]c)?(\d{1,3}(?:[.,'’ \u00a0\u2009\u202f]\d{3})+(?:[.,]\d+)?|\d+(?:[.,]\d+)?)(?![\d])\s*([a-zäöü]*)"
)
_LIST: Final = re.compile(r"\s*(?:[/+;,&–-]|\b(?:to|bis|or|oder|and|und)\b)\s*")
"""What joins numbers that share the unit of the last."""


@dataclass(frozen=True, slots=True)
class _Number:
    """A number of a text, the word after it, and its place."""

    text: str
    unit: str
    start: int
    end: int

    @property
    def readings(self) -> set[float]:
        """Values that the number may mean: separators before three digits are those of thousands or of decimals."""
        spaceless = re.sub(r"['’]", "", self.text)
        *_, last = re.split(r"[ \u00a0\u2009\u202f]", spaceless)
        texts = {re.sub(r"[ \u00a0\u2009\u202f]", "", spaceless), last}
        return {value for text in texts for value in _values(text)}


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
    powers = [number for number in numbers if number.unit in _UNITS]
    if powers:
        readings = [
            {_UNITS[number.unit] * value for value in number.readings if number.unit in _UNITS}
            for number in powers
        ]
    elif any(number.unit not in _NEUTRAL for number in numbers):
        return _alternating_w(numbers, lowest_w, highest_w) if alternating else 0.0
    elif not {*re.findall(r"[a-zäöü]+", text)} <= _NEUTRAL:
        return 0.0
    else:
        readings = [_without_unit_w(number, alternating and highest_w < HIGHEST_W) for number in numbers]
    plausible = [{watt for watt in watts if lowest_w <= watt <= highest_w} for watts in readings]
    return max((watts.pop() for watts in plausible if len(watts) == 1), default=0.0)


def _with_shared_units(text: str) -> list[_Number]:
    """Return the numbers of a text; in a list such as "11/22 kW", each number has the unit of the last."""
    numbers: list[_Number] = []
    for match in reversed([*_TOKEN.finditer(text)]):
        unit, end = match[2], match.end(2)
        if unit in _NEUTRAL:
            unit, end = "", match.end(1)
            if numbers and _LIST.fullmatch(text, end, numbers[-1].start):
                unit = numbers[-1].unit
        numbers.append(_Number(match[1], unit, match.start(), end))
    return numbers[::-1]


def _without_unit_w(number: _Number, is_alternating: bool) -> set[float]:
    """Return the powers that a number without a unit may mean [W]."""
    kilowatts = {value for value in number.readings if value <= MOST_WITHOUT_UNIT_KW}
    if is_alternating:
        kilowatts -= {*_AMPERES_ALONE}
    watts = {value for value in number.readings if value >= LOWEST_W}
    return {1e3 * value for value in kilowatts} | watts


def _alternating_w(numbers: list[_Number], lowest_w: float, highest_w: float) -> float:
    """Return the rated power of one voltage and one current, to two digits [W]; 0 if there are more or fewer of them."""
    volts, amperes = (
        [value for number in numbers if number.unit in units for value in number.readings]
        for units in (_VOLTS, _AMPERES)
    )
    if len(volts) != 1 or len(amperes) != 1 or not 0.0 < amperes[0] <= _MAX_AMPERES:
        return 0.0
    if _SINGLE_PHASE_V[0] <= volts[0] <= _SINGLE_PHASE_V[1]:
        watt = volts[0] * amperes[0]
    elif _THREE_PHASE_V[0] <= volts[0] <= _THREE_PHASE_V[1]:
        watt = math.sqrt(3.0) * volts[0] * amperes[0]
    else:
        return 0.0
    watt = float(f"{watt:.1e}")
    return watt if lowest_w <= watt <= highest_w else 0.0
