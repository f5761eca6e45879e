"""Names of covariates and of terms of the GAMM in words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

COVARIATES: Final[Mapping[str, str]] = {
    "time_s": "time",
    "speed_m_s": "speed",
    "ambient_temperature_degc": "ambient temperature",
    "elevation_difference_m": "elevation difference",
}
"""Column of a covariate -> words; a column without an entry keeps its name."""


def term_in_words(term: str) -> str:
    """Write a term with the names of its columns, or its level of the weather, in words.

    Examples
    --------
    >>> term_in_words("s(ambient_temperature_degc,elevation_difference_m)")
    's(ambient temperature, elevation difference)'
    >>> term_in_words("s(time_s):seasonwinter")
    's(time):winter'
    >>> term_in_words("weatherdark")
    'weather: dark'
    """
    if term.startswith("weather"):
        return f"weather: {term.removeprefix('weather')}"
    spaced = re.sub(r",(?=\S)", ", ", re.sub(r":season(?=\w)", ":", term))
    return re.sub(r"[a-z_]+", lambda match: COVARIATES.get(match[0], match[0]), spaced)
