"""Constants of nature and unit conversions. Units are converted where data come in or go out, never in between."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import pandas as pd

SUFFIXES: Final = {
    **{"s": "s", "m": "m", "wh": "Wh", "w": "W", "degc": "degC", "soc": "1", "v": "V", "a": "A", "kg": "kg"},
    **{"m_s": "m/s", "deg": "deg", "ape": "1", "mape": "1"},
}
"""Ending of the name of a quantity -> its unit."""

GRAVITY_M_S2: Final = 9.80665
"""Standard acceleration of gravity (CGPM 1901)."""

DRY_AIR_GAS_CONSTANT_J_KG_K: Final = 287.05287
"""Specific gas constant of dry air (ICAO Doc 7488, standard atmosphere)."""

SEA_LEVEL_PRESSURE_PA: Final = 101_325.0
"""Pressure of the ICAO standard atmosphere at sea level."""

TEMPERATURE_LAPSE_K_M: Final = 0.0065
"""Temperature lapse rate of the ICAO standard atmosphere below 11 km."""

SEA_LEVEL_TEMPERATURE_K: Final = 288.15
"""Temperature of the ICAO standard atmosphere at sea level."""

ZERO_CELSIUS_K: Final = 273.15

SECONDS_PER_MINUTE: Final = 60.0
SECONDS_PER_HOUR: Final = 3600.0
SECONDS_PER_DAY: Final = 86_400.0
M_S_PER_KM_H: Final = 1.0 / 3.6
M_PER_MILE: Final = 1609.344
M_PER_FOOT: Final = 0.3048
M_S_PER_MPH: Final = 0.44704
KG_PER_LB: Final = 0.45359237
N_PER_LBF: Final = 4.4482216152605
WH_PER_J: Final = 1.0 / 3600.0


def with_units(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with the units of its columns in ``attrs["units"]``, by the endings of their names.

    Examples
    --------
    >>> import pandas as pd
    >>> with_units(pd.DataFrame(columns=["trip", "speed_m_s", "energy_low_wh", "displayed_soc_low"])).attrs["units"]
    {'speed_m_s': 'm/s', 'energy_low_wh': 'Wh', 'displayed_soc_low': '1'}
    """
    units: dict[str, str] = {}
    for name in map(str, table.columns):
        parts = name.removesuffix("_low").removesuffix("_high").rsplit("_", 2)
        unit = SUFFIXES.get("_".join(parts[-2:])) or SUFFIXES.get(parts[-1])
        units |= {} if unit is None else {name: unit}
    table.attrs["units"] = units
    return table
