"""The tables of eight loggers: names and order of their columns, how they write numbers and times, what a seed may set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.units import M_PER_FOOT

Cells = dict[str, list[str]]
Ours = dict[str, tuple[str, str]]

FORMATS: Final = (
    "teslamate",
    "ovms",
    "abrp",
    "car_scanner",
    "torque",
    "leaf_spy",
    "teslalogger",
    "plain",
)
"""The formats."""

KM_PER_MILE: Final = 1.609344
_SPEED: Final = {"m/s": 1.0, "km/h": 3.6, "mph": 3600.0 / 1609.344}
_LENGTH: Final = {"m": 1.0, "ft": 1.0 / M_PER_FOOT}


@dataclass(frozen=True)
class Settings:
    """How an owner's app is set, for all files of a folder.

    Attributes
    ----------
    speed, height, temperature : str
        Units, as a mapping spells them.
    whole : bool
        Whether speeds and heights are whole numbers.
    variant : int
        Which of a format's variants.
    stamp : str
        Format of the time stamps of a plain table; empty for seconds.
    split_stamp : bool
        Date and time of a plain table in two columns.
    charge_positive : bool
        Sign of the current of a plain table.
    units_row : bool
        Units of a plain table in a row below its header.
    """

    speed: str = "km/h"
    height: str = "m"
    temperature: str = "degC"
    whole: bool = False
    variant: int = 0
    stamp: str = "%Y-%m-%d %H:%M:%S"
    split_stamp: bool = False
    charge_positive: bool = False
    units_row: bool = False

    def fast(self, d: pd.DataFrame, digits: int = 2) -> list[str]:
        """Speeds in the unit that is set."""
        return number(d["v"] * _SPEED[self.speed], 0 if self.whole else digits)

    def high(self, d: pd.DataFrame, digits: int = 1) -> list[str]:
        """Heights in the unit that is set."""
        return number(d["height"] * _LENGTH[self.height], 0 if self.whole else digits)

    def warm(self, values: pd.Series, digits: int = 1) -> list[str]:
        """Temperatures in the unit that is set."""
        return number(values * 1.8 + 32.0 if self.temperature == "degF" else values, digits)


@dataclass(frozen=True)
class Format:
    """A logger's table.

    Attributes
    ----------
    cells : callable
        Cells of rows, column by column.
    ours : callable
        What the columns are: our column -> name and unit.
    needed : tuple of str
        Our columns without which a row is of no use, besides the time.
    spare : tuple of str
        Our columns that a row can do without.
    also : mapping
        Columns that are as right.
    stamp : str
        Format of time stamps, empty for numbers.
    steps : tuple of float
        Steps [s] between two rows.
    jitter_s : float
        How irregular they are.
    dated : bool
        Whether its times have a day.
    app : bool
        Whether an app or box with a clock of its own writes it, file by file; else a data base does.
    long : bool
        One row per value.
    name : str
        Name of the file with a number, where a date of the file may stand.
    """

    cells: Callable[[pd.DataFrame, Settings], Cells]
    ours: Callable[[Settings], Ours]
    needed: tuple[str, ...]
    spare: tuple[str, ...]
    name: str
    steps: tuple[float, ...] = (1.0,)
    stamp: str = ""
    also: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    jitter_s: float = 0.0
    dated: bool = True
    app: bool = True
    long: bool = False


def number(values: pd.Series, digits: int) -> list[str]:
    """Numbers with so many digits after the point."""
    array = np.round(values.to_numpy(dtype=np.float64), digits) + 0.0
    return list(np.char.mod(f"%.{digits}f", array).tolist())


def same(d: pd.DataFrame, text: str) -> list[str]:
    """One text in all rows."""
    return [text] * len(d)


def stamps(clock: pd.Series, form: str) -> list[str]:
    """Times as text."""
    times = pd.to_datetime(clock.round(3), unit="s").dt.round("ms")
    return [str(text) for text in times.dt.strftime(form)]


def minutes(degrees: pd.Series) -> list[str]:
    """Degrees and minutes, as Leaf Spy writes them."""
    whole_degrees = np.floor(degrees.to_numpy())
    return [
        f"{int(w)} {m:.5f}"
        for w, m in zip(whole_degrees, (degrees.to_numpy() - whole_degrees) * 60.0, strict=True)
    ]


def _reach(d: pd.DataFrame, share: float) -> list[str]:
    return number(d["soc"] * 260.0 * share, 2)


def _teslamate(d: pd.DataFrame, s: Settings) -> Cells:
    drive = [str(k + 17) if k >= 0 else "" for k in d["drive"]]
    return {
        "id": number(d["t"] % 1e6, 0), "date": stamps(d["clock"], "%Y-%m-%d %H:%M:%S.%f"), "latitude": number(d["lat"], 6),
        "longitude": number(d["lon"], 6), "speed": number(d["v"] * 3.6, 0), "power": number(d["p"] / 1000.0, 0),
        "odometer": number(d["odometer"], 6), "ideal_battery_range_km": _reach(d, 1.0),
        "battery_level": number(100.0 * d["soc"], 0), "outside_temp": s.warm(d["ambient"]), "elevation": s.high(d, 0),
        "fan_status": same(d, "2"), "driver_temp_setting": same(d, "21.0"), "passenger_temp_setting": same(d, "21.0"),
        "is_climate_on": same(d, "t"), "car_id": same(d, "1"), "drive_id": drive, "inside_temp": s.warm(d["cabin"]),
        "battery_heater_on": same(d, "f"), "est_battery_range_km": _reach(d, 0.9),
        "rated_battery_range_km": _reach(d, 0.95), "usable_battery_level": number(100.0 * d["display"], 0),
    }  # fmt: skip


def _teslamate_ours(s: Settings) -> Ours:
    return {
        "time_s": ("date", "timestamp"), "speed_m_s": ("speed", s.speed), "battery_power_w": ("power", "kW"),
        "soc": ("battery_level", "%"), "displayed_soc": ("usable_battery_level", "%"), "elevation_m": ("elevation", "m"),
        "ambient_temperature_degc": ("outside_temp", "degC"), "cabin_temperature_degc": ("inside_temp", "degC"),
    }  # fmt: skip


def _teslalogger(d: pd.DataFrame, s: Settings) -> Cells:
    return {
        "id": number(d["t"] % 1e6, 0), "Datum": stamps(d["clock"], "%Y-%m-%d %H:%M:%S"), "lat": number(d["lat"], 6),
        "lng": number(d["lon"], 6), "speed": number(d["v"] * 3.6, 0), "power": number(d["p"] / 735.49875, 0),
        "odometer": number(d["odometer"], 3), "ideal_battery_range_km": _reach(d, 1.0), "address": same(d, "x"),
        "outside_temp": s.warm(d["ambient"]), "altitude": s.high(d, 0), "battery_level": number(100.0 * d["soc"], 0),
        "inside_temp": s.warm(d["cabin"]), "battery_heater": same(d, "0"), "is_preconditioning": same(d, "0"),
        "sentry_mode": same(d, "0"), "battery_range_km": _reach(d, 0.95), "CarID": same(d, "1"), "AP": same(d, "0"),
    }  # fmt: skip


def _teslalogger_ours(s: Settings) -> Ours:
    return {
        "time_s": ("Datum", "timestamp"), "speed_m_s": ("speed", s.speed), "battery_power_w": ("power", "PS"),
        "soc": ("battery_level", "%"), "elevation_m": ("altitude", "m"),
        "ambient_temperature_degc": ("outside_temp", "degC"), "cabin_temperature_degc": ("inside_temp", "degC"),
    }  # fmt: skip


def _ovms(d: pd.DataFrame, s: Settings) -> Cells:
    stamp = {"m.time.utc": number(d["clock"], 0)} if s.variant else {"date": stamps(d["clock"], s.stamp)}
    return stamp | {
        "v.p.latitude": number(d["lat"], 6), "v.p.longitude": number(d["lon"], 6), "v.p.speed": s.fast(d),
        "v.p.altitude": s.high(d), "v.p.odometer": number(d["odometer"], 3), "v.b.voltage": number(d["u"], 1),
        "v.b.current": number(d["i"], 1), "v.b.power": number(d["p"] / 1000.0, 3), "v.b.soc": number(100.0 * d["display"], 1),
        "v.b.temp": s.warm(d["battery"]), "v.b.12v.voltage": same(d, "14.1"), "v.e.temp": s.warm(d["ambient"]),
        "v.e.cabintemp": s.warm(d["cabin"]), "v.m.temp": same(d, "40.0"), "v.b.range.est": _reach(d, 1.0),
    }  # fmt: skip


def _ovms_ours(s: Settings) -> Ours:
    return {
        "time_s": ("m.time.utc", "epoch_s") if s.variant else ("date", "timestamp"), "speed_m_s": ("v.p.speed", s.speed),
        "voltage_v": ("v.b.voltage", "V"), "current_a": ("v.b.current", "A"), "displayed_soc": ("v.b.soc", "%"),
        "elevation_m": ("v.p.altitude", "m"), "ambient_temperature_degc": ("v.e.temp", "degC"),
        "cabin_temperature_degc": ("v.e.cabintemp", "degC"), "battery_temperature_degc": ("v.b.temp", "degC"),
    }  # fmt: skip


def _abrp(d: pd.DataFrame, s: Settings) -> Cells:
    charging = [str(int(i < 0 and k < 0)) for i, k in zip(d["i"], d["drive"], strict=True)]
    return {
        "utc": number(d["clock"], 0), "soc": number(100.0 * d["display"], 1), "power": number(d["p"] / 1000.0, 3),
        "speed": s.fast(d), "lat": number(d["lat"], 6), "lon": number(d["lon"], 6), "is_charging": charging,
        "is_parked": [str(int(k < 0)) for k in d["drive"]], "elevation": s.high(d), "ext_temp": s.warm(d["ambient"]),
        "batt_temp": s.warm(d["battery"]), "cabin_temp": s.warm(d["cabin"]), "voltage": number(d["u"], 1),
        "current": number(d["i"], 2), "odometer": number(d["odometer"], 2), "est_battery_range": _reach(d, 1.0),
        "heading": same(d, "90.0"), "hvac_power": number(d["climate"] / 1000.0, 3), "hvac_setpoint": same(d, "21.0"),
        "soh": same(d, "97.0"), "capacity": same(d, "36.0"),
    }  # fmt: skip


def _abrp_ours(s: Settings) -> Ours:
    return {
        "time_s": ("utc", "epoch_s"), "speed_m_s": ("speed", s.speed), "battery_power_w": ("power", "kW"),
        "voltage_v": ("voltage", "V"), "displayed_soc": ("soc", "%"), "elevation_m": ("elevation", "m"),
        "ambient_temperature_degc": ("ext_temp", "degC"), "cabin_temperature_degc": ("cabin_temp", "degC"),
        "climate_power_w": ("hvac_power", "kW"), "battery_temperature_degc": ("batt_temp", "degC"),
    }  # fmt: skip


def _torque_names(s: Settings) -> tuple[str, str]:
    ambient = "°F" if s.temperature == "degF" else "°C"
    return f"Speed (OBD)({s.speed})", f"Ambient air temp({ambient})"


def _torque(d: pd.DataFrame, s: Settings) -> Cells:
    speed, ambient = _torque_names(s)
    return {
        "GPS Time": stamps(d["clock"], "%a %b %d %H:%M:%S GMT+02:00 %Y"),
        "Device Time": [text[:-3] for text in stamps(d["clock"], "%d-%b-%Y %H:%M:%S.%f")], "Longitude": number(d["lon"], 7),
        "Latitude": number(d["lat"], 7), "GPS Speed (Meters/second)": number(d["v"] * 0.99, 2),
        "Horizontal Dilution of Precision": same(d, "4.0"), "Altitude": s.high(d), "Bearing": same(d, "90.0"),
        "G(x)": same(d, "0.1"), speed: s.fast(d), "Battery Voltage(V)": number(d["u"], 1),
        "Battery Current(A)": number(d["i"], 1), "SoC BMS(%)": number(100.0 * d["soc"], 1),
        "SoC Display(%)": number(100.0 * d["display"], 1), ambient: s.warm(d["ambient"]),
    }  # fmt: skip


def _torque_ours(s: Settings) -> Ours:
    speed, ambient = _torque_names(s)
    return {
        "time_s": ("Device Time", "timestamp"), "speed_m_s": (speed, s.speed), "elevation_m": ("Altitude", "m"),
        "voltage_v": ("Battery Voltage(V)", "V"), "current_a": ("Battery Current(A)", "A"), "soc": ("SoC BMS(%)", "%"),
        "displayed_soc": ("SoC Display(%)", "%"), "ambient_temperature_degc": (ambient, s.temperature),
    }  # fmt: skip


def leaf_spy_cells(d: pd.DataFrame, s: Settings, cells: Cells) -> Cells:
    """Columns of Leaf Spy Pro, with given columns of the cells' voltages."""
    fahrenheit = number(d["battery"] * 1.8 + 32.0, 1)
    return {
        "Date/Time": stamps(d["clock"], "%m/%d/%Y %H:%M:%S"), "Lat": minutes(d["lat"]), "Long": minutes(d["lon"]),
        "Elv": s.high(d), "Speed": s.fast(d, 1), "Gids": number(d["soc"] * 281.0, 0), "SOC": number(d["soc"] * 1e6, 0),
        "AHr": same(d, "601000"), "Pack Volts": number(d["u"], 2), "Pack Amps": number(d["i"], 3), "Max CP mV": same(d, "4010"),
        "Min CP mV": same(d, "3990"), "Avg CP mV": same(d, "4000"), "CP mV Diff": same(d, "20"),
        "Judgment Value": same(d, "0"), "Pack T1 F": fahrenheit, "Pack T1 C": number(d["battery"], 1),
        "Pack T2 F": fahrenheit, "Pack T2 C": number(d["battery"], 1), "Pack T3 F": same(d, "none"),
        "Pack T3 C": same(d, "none"), "Pack T4 F": fahrenheit, "Pack T4 C": number(d["battery"], 1), **cells,
        "12v Bat Amps": same(d, "4.0"), "VIN": same(d, "SJNFAAZE0U0000000"), "Hx": same(d, "80.12"),
        "12v Bat Volts": same(d, "13.1"), "Odo(km)": number(np.floor(d["odometer"]), 0), "QC": same(d, "12"),
        "L1/L2": same(d, "840"), "TP-FL": same(d, "36.0"), "TP-FR": same(d, "36.2"), "TP-RR": same(d, "35.7"),
        "TP-RL": same(d, "35.5"), "Ambient": s.warm(d["ambient"], 0), "SOH": same(d, "92.00"), "RegenWh": same(d, "0"),
        "BLevel": same(d, "63"), "epoch time": number(d["epoch"], 0), "Motor Pwr(100w)": number(d["p"].clip(0) / 100.0, 0),
        "Aux Pwr(100w)": same(d, "3"), "A/C Pwr(250w)": number(d["aircon"] / 250.0, 0), "A/C Comp(0.1MPa)": same(d, "5"),
        "Est Pwr A/C(50w)": number(d["aircon"] / 50.0, 0), "Est Pwr Htr(250w)": number(d["heating"] / 250.0, 0),
        "Plug State": same(d, "0"), "Charge Mode": [str(3 * int(i < 0 and k < 0)) for i, k in zip(d["i"], d["drive"], strict=True)],
        "OBC Out Pwr": same(d, "0"), "Gear": [str(4 if k >= 0 else 1) for k in d["drive"]], "HVolt1": number(d["u"], 1),
        "HVolt2": number(d["u"] - 0.5, 1), "GPS Status": same(d, "3"), "Power SW": same(d, "1"), "BMS": same(d, "1"),
        "OBC": same(d, "0"), "Debug": same(d, "0"),
    }  # fmt: skip


def _leaf_spy(d: pd.DataFrame, s: Settings) -> Cells:
    level = 3500.0 + 600.0 * d["soc"]
    return leaf_spy_cells(d, s, {f"CP{k}": number(level + (k * 7) % 17, 0) for k in range(1, 97)})


def leaf_spy_ours(s: Settings) -> Ours:
    """What the columns of Leaf Spy Pro are."""
    return {
        "time_s": ("Date/Time", "timestamp"), "speed_m_s": ("Speed", s.speed), "voltage_v": ("Pack Volts", "V"),
        "current_a": ("Pack Amps", "A"), "soc": ("SOC", "ppm"), "elevation_m": ("Elv", s.height),
        "ambient_temperature_degc": ("Ambient", s.temperature), "battery_temperature_degc": ("Pack T1 C", "degC"),
        "heating_power_w": ("Est Pwr Htr(250w)", "250w"), "aircon_power_w": ("Est Pwr A/C(50w)", "50w"),
    }  # fmt: skip


SIGNAL_UNITS: Final = MappingProxyType(
    {
        "Speed (GPS)": "km/h",
        "Altitude (GPS)": "m",
        "Latitude": "°",
        "Longitude": "°",
        "[BMS] HV battery voltage": "V",
        "[BMS] HV battery current": "A",
        "[BMS] State of charge": "%",
        "[BMS] State of charge (display)": "%",
        "Outside temperature": "°C",
    }
)
"""Signals of Car Scanner and their usual units."""


def _car_scanner(d: pd.DataFrame, s: Settings) -> Cells:
    signals = {
        "Speed (GPS)": s.fast(d), "Altitude (GPS)": s.high(d), "Latitude": number(d["lat"], 6), "Longitude": number(d["lon"], 6),
        "[BMS] HV battery voltage": number(d["u"], 1), "[BMS] HV battery current": number(d["i"], 1),
        "[BMS] State of charge": number(100.0 * d["soc"], 1), "[BMS] State of charge (display)": number(100.0 * d["display"], 1),
        "Outside temperature": s.warm(d["ambient"]),
    }  # fmt: skip
    set_units = {"Speed (GPS)": s.speed, "Altitude (GPS)": s.height}
    set_units["Outside temperature"] = "°F" if s.temperature == "degF" else "°C"
    units = {**SIGNAL_UNITS, **set_units}
    seconds = number(d["clock"] % 86_400.0, 2)
    rows = [(k, name) for k in range(len(d)) for name in signals]
    return {
        "SECONDS": [seconds[k] for k, _ in rows],
        "PID": [name for _, name in rows],
        "VALUE": [signals[name][k] for k, name in rows],
        "UNITS": [units[name] for _, name in rows],
    }


def _car_scanner_ours(s: Settings) -> Ours:
    return {
        "time_s": ("SECONDS", "s"), "speed_m_s": ("Speed (GPS)", s.speed), "elevation_m": ("Altitude (GPS)", s.height),
        "voltage_v": ("[BMS] HV battery voltage", "V"), "current_a": ("[BMS] HV battery current", "A"),
        "soc": ("[BMS] State of charge", "%"), "displayed_soc": ("[BMS] State of charge (display)", "%"),
        "ambient_temperature_degc": ("Outside temperature", s.temperature),
    }  # fmt: skip


PLAIN_NAMES: Final = (
    ("Date", "Time", "Speed", "Pack V", "Pack A", "SOC", "Outside", "Height", "Lat", "Lon", "Odometer"),
    (
        "Date", "Time", "Vehicle speed", "HV voltage", "HV current", "State of charge", "Ambient temp", "Altitude", "Latitude",
        "Longitude", "Odo",
    ),
    (
        "Datum", "Uhrzeit", "Geschwindigkeit", "HV-Spannung", "HV-Strom", "Ladezustand", "Außentemperatur", "Höhe", "Breite",
        "Länge", "Kilometerstand",
    ),
)  # fmt: skip
"""Names that owners give: date, time, speed, voltage, current, charge, outside temperature, height, position, odometer."""


def plain_names(s: Settings) -> tuple[list[str], list[str]]:
    """Names of the columns of a plain table, with their units in brackets or without, and the units."""
    names = PLAIN_NAMES[s.variant % 3]
    temperature = ("F" if s.temperature == "degF" else "C") if s.variant % 2 else f"°{s.temperature[-1]}"
    units = [
        *(["", ""] if s.split_stamp else ["" if s.stamp else "s"]),
        s.speed, "V", "A", "%", temperature, s.height, "", "", "mi" if s.speed == "mph" else "km",
    ]  # fmt: skip
    together = "/".join(names[:2]) if s.stamp and s.variant % 2 else names[1]
    clock = list(names[:2]) if s.split_stamp else [together]
    bare = [*clock, *names[2:]]
    if s.units_row:
        return bare, units
    shown = ["" if name.endswith((" V", " A")) else unit for name, unit in zip(bare, units, strict=True)]
    form = "{} [{}]" if s.variant >= 3 else "{} ({})"
    return [form.format(n, u) if u else n for n, u in zip(bare, shown, strict=True)], units


def _plain(d: pd.DataFrame, s: Settings) -> Cells:
    names, units = plain_names(s)
    if s.split_stamp:
        date, _, time = s.stamp.partition(" ")
        clock = [stamps(d["clock"], date), stamps(d["clock"], time)]
    else:
        clock = [stamps(d["clock"], s.stamp) if s.stamp else number(d["clock"] - d["clock"].iloc[0], 1)]
    odometer = d["odometer"] / (KM_PER_MILE if units[-1] == "mi" else 1.0)
    columns = [
        *clock, s.fast(d, 1), number(d["u"], 1), number(-d["i"] if s.charge_positive else d["i"], 1),
        number(100.0 * d["soc"], 1), s.warm(d["ambient"]), s.high(d), number(d["lat"], 6), number(d["lon"], 6),
        number(odometer, 2),
    ]  # fmt: skip
    return dict(zip(names, columns, strict=True))


def _plain_ours(s: Settings) -> Ours:
    names, _ = plain_names(s)
    clock = "+".join(names[:-9])
    speed, voltage, current, soc, outside, height = names[-9:-3]
    return {
        "time_s": (clock, "timestamp" if s.stamp else "s"), "speed_m_s": (speed, s.speed), "voltage_v": (voltage, "V"),
        "current_a": (current, "A"), "soc": (soc, "%"), "ambient_temperature_degc": (outside, s.temperature),
        "elevation_m": (height, s.height),
    }  # fmt: skip


_FLOW: Final = ("speed_m_s", "voltage_v", "current_a")
_POWER: Final = ("speed_m_s", "battery_power_w")
_SPARE: Final = ("ambient_temperature_degc", "elevation_m")

TABLES: Final[Mapping[str, Format]] = MappingProxyType(
    {
        "teslamate": Format(
            _teslamate, _teslamate_ours, _POWER, (*_SPARE, "soc", "displayed_soc"), "positions_{n:03d}", (1.0, 2.0),
            "%Y-%m-%d %H:%M:%S.%f", jitter_s=0.3, app=False,
        ),
        "teslalogger": Format(
            _teslalogger, _teslalogger_ours, _POWER, (*_SPARE, "soc"), "pos_{n:03d}", (1.0, 2.0), "%Y-%m-%d %H:%M:%S",
        ),
        "ovms": Format(
            _ovms, _ovms_ours, _FLOW, (*_SPARE, "displayed_soc"), "metrics-{date}-{n:02d}", (1.0, 2.0), "%Y-%m-%d %H:%M:%S", also=MappingProxyType({"battery_power_w": (("v.b.power", "kW"),)}),
        ),
        "abrp": Format(_abrp, _abrp_ours, _POWER, (*_SPARE, "displayed_soc"), "telemetry_{n:02d}", (1.0, 2.0, 3.0),
            also=MappingProxyType({"current_a": (("current", "A"),)})),
        "car_scanner": Format(
            _car_scanner, _car_scanner_ours, _FLOW, (*_SPARE, "soc"), "{date} {n:02d}-00-00", (1.0, 1.5, 2.0), jitter_s=0.2,
            dated=False, long=True,
        ),
        "torque": Format(
            _torque, _torque_ours, _FLOW, (*_SPARE, "soc"), "trackLog-{date}_{n:02d}", (1.0,), "%d-%b-%Y %H:%M:%S.%f",
            jitter_s=0.1,
            also=MappingProxyType({
                "time_s": (("GPS Time", "timestamp"),), "speed_m_s": (("GPS Speed (Meters/second)", "m/s"),),
            }),
        ),
        "leaf_spy": Format(
            _leaf_spy, leaf_spy_ours, _FLOW, (*_SPARE, "soc"), "Log_U0000000_{date}_{n:02d}", (2.0, 3.0, 4.0),
            "%m/%d/%Y %H:%M:%S",
            also=MappingProxyType({
                "time_s": (("epoch time", "epoch_s"),), "battery_temperature_degc": (("Pack T2 C", "degC"), ("Pack T4 C", "degC"),
                ("Pack T1 F", "degF"), ("Pack T2 F", "degF"), ("Pack T4 F", "degF")),
                "aircon_power_w": (("A/C Pwr(250w)", "250w"),),
            }),
        ),
        "plain": Format(_plain, _plain_ours, _FLOW, (*_SPARE, "soc"), "drive{n}", (1.0, 2.0)),
    }
)  # fmt: skip
"""Table of each format."""
