"""How a covariate and a term of the GAMM are called, and the units in which they are shown."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from tripwatt.report.view import plain
from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_MINUTE

COVARIATES: Final[Mapping[str, tuple[str, str, float]]] = {
    "time_s": ("time", "min", 1.0 / SECONDS_PER_MINUTE),
    "speed_m_s": ("speed", "km/h", 1.0 / M_S_PER_KM_H),
    "ambient_temperature_degc": ("ambient temperature", "°C", 1.0),
    "elevation_difference_m": ("elevation difference", "m", 1.0),
}
"""Column of a covariate -> words, unit that is shown, factor from SI."""


def covariate_words(name: str) -> str:
    """A covariate in words; a column without an entry keeps its name.

    Examples
    --------
    >>> covariate_words("time_s"), covariate_words("season")
    ('time', 'season')
    """
    return COVARIATES[name][0] if name in COVARIATES else name


def term_in_words(term: str) -> str:
    """A term with the columns' names in words.

    Examples
    --------
    >>> term_in_words("s(ambient_temperature_degc,elevation_difference_m)")
    's(ambient temperature, elevation difference)'
    >>> term_in_words("s(time_s):seasonwinter")
    's(time):winter'
    """
    spaced = re.sub(r",(?=\S)", ", ", re.sub(r":season(?=\w)", ":", term))
    return re.sub(r"[a-z_]+", lambda match: COVARIATES.get(match[0], (match[0],))[0], spaced)


def axis_of(name: str) -> tuple[str, float]:
    """Label of a covariate's axis, and the factor from its SI value to what is shown."""
    words, unit, factor = COVARIATES.get(name, (plain(name, 30), "", 1.0))
    return (f"{words} [{unit}]" if unit else words), factor
