"""One drive as loggers and spreadsheets spoil it, with the energy that it has: kinds of dirt that change the meaning of numbers.

Each kind writes one file and says whether a careful reader gets the energy from it, or has to refuse it. A seed chooses the drive, the
names, the units, the separators and the sign.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tools.data.dirty_drives import Car, windows
from tripwatt.physics.battery import usable_energy_wh
from tripwatt.vehicles import Vehicle

UNLISTED: Final = (
    "HV",
    "xyz",
    "Traction",
    "col 7",
    "Power flow",
    "Current power",
    "Strom-Leistung",
    "電力",
    "Мощность",
)
LANGUAGES: Final = ("Leistung", "Puissance", "Potencia", "Potenza", "Vermogen", "Moc", "Effekt", "Teho", "Výkon", "power", "v.b.power")  # fmt: skip
UNITS: Final[Mapping[str, float]] = {
    " (kW)": 1e-3, " [kW]": 1e-3, "_kW": 1e-3, " kW": 1e-3, " (W)": 1.0, " [W]": 1.0, " (watts)": 1.0, " (PS)": 1.0 / 735.49875,
}  # fmt: skip
"""Unit in the name of a power -> factor from watts."""
SPEEDS: Final[Mapping[str, float]] = {
    "Speed (km/h)": 1.0, "Geschwindigkeit [km/h]": 1.0, "Vitesse (km/h)": 1.0, "Velocità (km/h)": 1.0, "speed_kmh": 1.0,
    "Prędkość": 1.0, "Speed (mph)": 1.0 / 1.609344,
}  # fmt: skip
"""Name of a speed -> factor from km/h."""
WHOLE: Final = ("soc_bms", "SoC (BMS)", "BMS SoC [%]", "Actual SOC", "Ladezustand BMS (%)")
MONTHS: Final = ("Jan", "Feb", "Mrz", "Apr", "Mai", "Jun", "Jul", "Aug", "Sep", "Okt", "Nov", "Dez")
NUMBER_OF_WINDOWS: Final = 6
"""A drive is put together from so many parts, which use more than five percent of a battery of 40 kWh."""


@dataclass(frozen=True)
class Drive:
    """A drive as it was, with a sample in each second.

    Attributes
    ----------
    rows : DataFrame
        Columns t [s since 1970], v [km/h], p [W], soc [1, of the whole battery], display [1], height [m].
    energy_wh : float
    """

    rows: pd.DataFrame
    energy_wh: float

    def text(
        self, name: str, digits: int, factor: float = 1.0, decimal: str = ".", group: str = ""
    ) -> list[str]:
        """A column as texts."""
        marks = str.maketrans({",": group or None, ".": decimal})
        return [f"{value:,.{digits}f}".translate(marks) for value in factor * self.rows[name]]

    def stamps(self, form: str = "%Y-%m-%d %H:%M:%S") -> list[str]:
        """The times as texts."""
        return [*pd.to_datetime(self.rows["t"], unit="s").dt.strftime(form)]


def drive_of(rng: np.random.Generator, vehicle: Vehicle) -> Drive:
    """A drive whose state of charge is that of a car."""
    found = windows()
    car = Car(50.0, 10.0, 3e4, 0.6, 15.0)
    parts, start = [], 1.7e9 + 7.0 * float(rng.integers(0, 10_000_000))
    for k in rng.choice(len(found), NUMBER_OF_WINDOWS, replace=False):
        window = found[int(k)]
        parts.append(car.drive(window, start, np.arange(float(len(window.speed))), 1.0))
        start = float(parts[-1]["t"].iloc[-1]) + 1.0
    rows = pd.concat(parts, ignore_index=True)
    power = rows["p"].to_numpy()
    used_wh = np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1])))) / 3600.0
    battery = vehicle.battery
    display = 0.9 - used_wh / usable_energy_wh(battery)
    window_soc = battery.displayed_full_soc - battery.displayed_zero_soc
    soc = battery.displayed_zero_soc + window_soc * display
    rows = rows.assign(v=3.6 * rows["v"], display=100.0 * display, soc=100.0 * soc)
    return Drive(rows[["t", "v", "p", "soc", "display", "height"]], float(used_wh[-1]))


def table(columns: Mapping[str, Sequence[Any]], delimiter: str = ",", *, quoted: bool = False) -> str:
    """The text of a file."""
    quote = '"' if quoted else ""
    rows = [[*columns], *zip(*columns.values(), strict=True)]
    return "\n".join(delimiter.join(f"{quote}{cell}{quote}" for cell in row) for row in rows) + "\n"


def _measured(rng: np.random.Generator, drive: Drive, names: Sequence[str], *, sign: float = 1.0) -> str:
    unit = str(rng.choice([*UNITS]))
    speed = str(rng.choice([*SPEEDS]))
    decimal, delimiter = [(".", ","), (".", "\t"), (",", ";")][int(rng.integers(3))]
    columns = {
        str(rng.choice(["Time", "Zeit", "timestamp", "Hora"])): drive.stamps(),
        speed: drive.text("v", 1, SPEEDS[speed], decimal),
        f"{rng.choice(names)}{unit}": drive.text("p", 3, sign * UNITS[unit], decimal),
    }
    if rng.random() < 0.5:
        columns["SoC (%)"] = drive.text("display", 1, 1.0, decimal)
    return table(columns, delimiter)


def _unlisted_name(rng: np.random.Generator, drive: Drive) -> str:
    return _measured(rng, drive, UNLISTED)


def _other_language(rng: np.random.Generator, drive: Drive) -> str:
    return _measured(rng, drive, LANGUAGES)


def _wrong_sign(rng: np.random.Generator, drive: Drive) -> str:
    return _measured(rng, drive, [*LANGUAGES, *UNLISTED], sign=-1.0)


def _grouped(
    rng: np.random.Generator, drive: Drive, decimal: str, group: str, delimiter: str, *, quoted: bool
) -> str:
    columns = {
        "Time": drive.stamps(),
        "Speed (km/h)": drive.text("v", int(rng.integers(0, 3)), 1.0, decimal),
        f"{rng.choice(['Power', 'Leistung', 'HV'])} (W)": drive.text(
            "p", int(rng.integers(0, 2)), 1.0, decimal, group
        ),
        "SoC (%)": drive.text("display", 1, 1.0, decimal),
    }
    return table(columns, delimiter, quoted=quoted)


def _grouped_in_quotes(rng: np.random.Generator, drive: Drive) -> str:
    return _grouped(rng, drive, ".", ",", ",", quoted=True)


def _grouped_unquoted(rng: np.random.Generator, drive: Drive) -> str:
    return _grouped(rng, drive, ".", ",", ",", quoted=False)


def _grouped_beside_decimal_commas(rng: np.random.Generator, drive: Drive) -> str:
    return _grouped(rng, drive, ",", ".", ";", quoted=bool(rng.integers(2)))


def _spaces_in_numbers(rng: np.random.Generator, drive: Drive) -> str:
    group = str(rng.choice(["'", "’", "\u202f", "\u00a0", " "]))
    return _grouped(rng, drive, str(rng.choice([".", ","])), group, ";", quoted=False)


def _whole_battery(rng: np.random.Generator, drive: Drive) -> str:
    columns: dict[str, Sequence[Any]] = {"timestamp": drive.stamps(), "speed_kmh": drive.text("v", 1)}
    if rng.integers(2):
        columns["soc_display"] = ["2.5"] * len(drive.rows)
    return table(columns | {str(rng.choice(WHOLE)): drive.text("soc", 2)})


def _wrong_unit(rng: np.random.Generator, drive: Drive) -> str:
    name, factor = [("Power (W)", 1e-3), ("Power (kW)", 1.0), ("Power (kW)", 1e-3 / 3.6), ("HV kW", 3e-3)][
        int(rng.integers(4))
    ]
    columns = {"Time": drive.stamps(), "Speed (km/h)": drive.text("v", 1), name: drive.text("p", 4, factor)}
    return table(columns | {"SoC (%)": drive.text("display", 1)})


def _dates_of_a_spreadsheet(rng: np.random.Generator, drive: Drive) -> str:
    def spoilt(text: str) -> str:
        whole, _, part = text.partition(".")
        is_date = whole.isdigit() and 1 <= int(whole) <= 31 and 1 <= int(part) <= 12
        return f"{int(whole):02d}. {MONTHS[int(part) - 1]}" if is_date else text

    columns = {"Time": drive.stamps(), "Speed (km/h)": [spoilt(text) for text in drive.text("v", 1)]}
    return table(
        columns | {f"{rng.choice(LANGUAGES)} (kW)": [spoilt(text) for text in drive.text("p", 1, 1e-3)]}, ";"
    )


def _minutes_and_seconds(rng: np.random.Generator, drive: Drive) -> str:
    form = str(rng.choice(["%M:%S.0", "%a %b %d %H:%M:%S GMT+02:00 %Y"]))
    name = "time" if form.startswith("%M") else "GPS Time"
    return table(
        {name: drive.stamps(form), "Speed (km/h)": drive.text("v", 1), "Power (kW)": drive.text("p", 3, 1e-3)}
    )


def _kiloseconds(rng: np.random.Generator, drive: Drive) -> str:
    time = [f"{k / 1000.0:.3f}" for k in range(len(drive.rows))]
    return table(
        {
            "Time (sec)": time,
            "Speed (km/h)": drive.text("v", 1),
            f"Power{rng.choice([' (W)', '_W'])}": drive.text("p", 0),
        }
    )


def _first_heights_and_a_doubled_stamp(rng: np.random.Generator, drive: Drive) -> str:
    heights, stamps = drive.text("height", 1), drive.stamps()
    first = int(rng.integers(3, 12))
    heights[:first] = ["0.0"] * first
    place = int(rng.integers(20, len(stamps) - 20))
    stamps[place] = stamps[place - 1]
    columns = {"Time": stamps, "Speed (km/h)": drive.text("v", 1), "Power (W)": drive.text("p", 0)}
    return table(columns | {"Altitude (m)": heights})


READABLE: Final[Mapping[str, Callable[[np.random.Generator, Drive], str]]] = {
    "power of an unlisted name": _unlisted_name,
    "power of another language": _other_language,
    "power of the wrong sign": _wrong_sign,
    "thousands in quotes": _grouped_in_quotes,
    "thousands beside decimal commas": _grouped_beside_decimal_commas,
    "spaces in numbers": _spaces_in_numbers,
    "charge of the whole battery": _whole_battery,
    "minutes and seconds": _minutes_and_seconds,
    "first heights and a doubled stamp": _first_heights_and_a_doubled_stamp,
}
"""Kinds of dirt whose energy a careful reader gets."""

UNREADABLE: Final[Mapping[str, Callable[[np.random.Generator, Drive], str]]] = {
    "thousands without quotes": _grouped_unquoted,
    "power in a wrong unit": _wrong_unit,
    "dates of a spreadsheet": _dates_of_a_spreadsheet,
    "time in kiloseconds": _kiloseconds,
}
"""Kinds of dirt that a careful reader refuses."""


def write_spoilt(file: Path, kind: str, seed: int, vehicle: Vehicle) -> Drive:
    """Write a drive with a kind of dirt; return what it was."""
    rng = np.random.default_rng([seed, len(kind)])
    drive = drive_of(rng, vehicle)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text({**READABLE, **UNREADABLE}[kind](rng, drive), encoding="utf-8")
    return drive
