"""Proposals for the exports of loggers, written after their public formats: every column right, none wrong."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.sources.test_suggest import Columns, drive, proposed, stamps
from tests.support import ROOT

from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.sources.mapping import shipped_mappings
from tripwatt.sources.suggest import suggest_mapping
from tripwatt.sources.table import read_table

AMBIENT_DEGC, CABIN_DEGC, BATTERY_DEGC, HEIGHT_M = 11.0, 20.0, 18.0, 320.0
SHIFT = 3.0
"""The display is so many points above the battery management's state of charge."""


def charge(d: pd.DataFrame) -> pd.Series:
    return 80.0 - 3.0 * d.t / d.t.iloc[-1]


def kilowatts(d: pd.DataFrame) -> pd.Series:
    return d.u * d.i / 1000.0


def odometer(d: pd.DataFrame) -> pd.Series:
    return 20_000.0 + np.cumsum(d.v) / 1000.0


def reach(d: pd.DataFrame) -> pd.Series:
    """Range in km: it looks like the voltage of a battery under load."""
    return 250.0 - 1.1 * np.cumsum(d.v) / 1000.0 - 4.0 * np.sin(d.t / 30.0)


def long_rows(d: pd.DataFrame) -> Columns:
    signals = {
        "Speed (GPS)": (d.v * 3.6, "km/h"),
        "Altitude (GPS)": (d.t * 0.0 + HEIGHT_M, "m"),
        "[BMS] HV battery voltage": (d.u, "V"),
        "[BMS] HV battery current": (d.i, "A"),
        "[BMS] State of charge": (charge(d), "%"),
        "[BMS] State of charge (display)": (charge(d) + SHIFT, "%"),
    }
    parts = [
        pd.DataFrame({"SECONDS": 30_000.0 + d.t, "PID": name, "VALUE": values, "UNITS": unit})
        for name, (values, unit) in signals.items()
    ]
    table = pd.concat(parts).sort_values("SECONDS", kind="stable")
    return {str(name): column.to_numpy() for name, column in table.items()}


EXPORTS: dict[str, Callable[[pd.DataFrame], Columns]] = {
    "teslamate": lambda d: {
        "id": d.t.astype(int) + 88_000, "date": stamps(d, "%Y-%m-%d %H:%M:%S.%f"), "latitude": 48.1, "longitude": 11.5,
        "speed": (d.v * 3.6).round(), "power": kilowatts(d).round(), "odometer": odometer(d), "ideal_battery_range_km": reach(d),
        "battery_level": charge(d).round(), "outside_temp": AMBIENT_DEGC, "elevation": HEIGHT_M, "fan_status": 2,
        "driver_temp_setting": 21.0, "passenger_temp_setting": 21.0, "is_climate_on": "t", "car_id": 1, "drive_id": 17,
        "inside_temp": CABIN_DEGC, "battery_heater_on": "f", "est_battery_range_km": reach(d) * 0.9,
        "rated_battery_range_km": reach(d) * 0.95, "usable_battery_level": (charge(d) + SHIFT).round(),
    },
    "teslalogger": lambda d: {
        "id": d.t.astype(int), "Datum": stamps(d, "%Y-%m-%d %H:%M:%S"), "lat": 48.0, "lng": 11.0, "speed": (d.v * 3.6).astype(int),
        "power": (kilowatts(d) * 1.35962).astype(int), "odometer": odometer(d), "ideal_battery_range_km": reach(d), "address": "x",
        "outside_temp": AMBIENT_DEGC, "altitude": HEIGHT_M, "battery_level": charge(d).round(), "inside_temp": CABIN_DEGC,
        "battery_heater": 0, "is_preconditioning": 0, "sentry_mode": 0, "battery_range_km": reach(d), "CarID": 1, "AP": 0,
    },
    "ovms_log": lambda d: {
        "date": stamps(d, "%Y-%m-%d %H:%M:%S"), "v.p.speed": d.v * 3.6, "v.p.altitude": HEIGHT_M, "v.p.odometer": odometer(d),
        "v.b.voltage": d.u, "v.b.current": d.i, "v.b.power": kilowatts(d), "v.b.soc": charge(d) + SHIFT, "v.b.temp": BATTERY_DEGC,
        "v.b.12v.voltage": 14.1, "v.e.temp": AMBIENT_DEGC, "v.e.cabintemp": CABIN_DEGC, "v.m.temp": 40.0, "v.b.range.est": reach(d),
    },
    "abrp": lambda d: {
        "utc": 1.7e9 + d.t, "soc": charge(d) + SHIFT, "power": kilowatts(d), "speed": d.v * 3.6, "lat": 48.0, "lon": 11.0,
        "is_charging": 0, "is_parked": 0, "elevation": HEIGHT_M, "ext_temp": AMBIENT_DEGC, "batt_temp": BATTERY_DEGC,
        "cabin_temp": CABIN_DEGC, "voltage": d.u, "current": d.i, "odometer": odometer(d), "est_battery_range": reach(d),
        "heading": 90.0, "hvac_power": 1.2, "hvac_setpoint": 21.0, "soh": 97.0, "capacity": 58.0,
    },
    "torque": lambda d: {
        "GPS Time": stamps(d, "%a %b %d %H:%M:%S GMT+02:00 %Y"), "Device Time": stamps(d, "%d-%b-%Y %H:%M:%S.%f"),
        "Longitude": 11.0, "Latitude": 48.0, "GPS Speed (Meters/second)": d.v * 0.99, "Horizontal Dilution of Precision": 4.0,
        "Altitude": HEIGHT_M, "Bearing": 90.0, "G(x)": 0.1, "Speed (OBD)(km/h)": d.v * 3.6, "Battery Voltage(V)": d.u,
        "Battery Current(A)": d.i, "SoC BMS(%)": charge(d), "SoC Display(%)": charge(d) + SHIFT,
        "Ambient air temp(°C)": AMBIENT_DEGC,
    },
    "leaf_spy": lambda d: {
        "Date/Time": stamps(d, "%m/%d/%Y %H:%M:%S"), "Lat": "48 12.3", "Long": "11 30.5", "Elv": HEIGHT_M, "Speed": d.v * 3.6,
        "Gids": 200, "SOC": (charge(d) * 10_000).round(), "AHr": 601_000, "Pack Volts": d.u, "Pack Amps": d.i, "Max CP mV": 4010,
        "Min CP mV": 3990, "Avg CP mV": 4000, "CP mV Diff": 20, "Pack T1 F": 64.4, "Pack T1 C": BATTERY_DEGC, "Pack T3 C": "none",
        **{f"CP{k}": 4000 for k in range(1, 97)}, "12v Bat Amps": 4.0, "VIN": "x", "Hx": 80.0, "12v Bat Volts": 13.1,
        "Odo(km)": 20_000, "TP-FL": 36.0, "Ambient": AMBIENT_DEGC, "SOH": 92.0, "epoch time": 1.7e9 + d.t, "Motor Pwr(100w)": 3,
        "Aux Pwr(100w)": 3, "A/C Pwr(250w)": 2, "A/C Comp(0.1MPa)": 5, "Est Pwr A/C(50w)": 8, "Est Pwr Htr(250w)": 4,
    },
    "car_scanner": long_rows,
    "german": lambda d: {
        "Zeit": stamps(d, "%d.%m.%Y %H:%M:%S"), "Geschwindigkeit": d.v * 3.6, "HV-Spannung (V)": d.u, "HV-Strom (A)": d.i,
        "Ladezustand (%)": charge(d), "Ladezustand Anzeige (%)": charge(d) + SHIFT, "Außentemperatur (°C)": AMBIENT_DEGC,
        "Innentemperatur (°C)": CABIN_DEGC, "Höhe über NN (m)": HEIGHT_M, "Reichweite (km)": reach(d),
    },
}  # fmt: skip

LACKING: dict[str, set[str]] = {
    "teslamate": {"battery_temperature_degc"},
    "teslalogger": {"displayed_soc", "battery_temperature_degc"},
    "ovms_log": {"soc"},
    "abrp": {"soc"},
    "torque": {"cabin_temperature_degc", "battery_temperature_degc"},
    "leaf_spy": {"displayed_soc", "cabin_temperature_degc"},
    "car_scanner": {"ambient_temperature_degc", "cabin_temperature_degc", "battery_temperature_degc"},
    "german": {"battery_temperature_degc"},
}
"""Signals that a logger does not write, of those that the test looks at."""
WHOLE_UNITS = {"teslamate": 1000.0, "teslalogger": 735.5}
"""Loggers that round the power [W] and the speed [km/h]."""


def written(folder: Path, logger: str) -> Path:
    table = pd.DataFrame(EXPORTS[logger](drive()))
    path = folder / f"{logger}.csv"
    german = logger == "german"
    table.to_csv(path, index=False, sep=";" if german else ",", decimal="," if german else ".")
    return path


@pytest.mark.parametrize("logger", EXPORTS)
def test_an_export_reads_as_the_drive_that_it_is(tmp_path, logger) -> None:
    d = drive()
    path = written(tmp_path, logger)
    suggestion = suggest_mapping(path)
    assert suggestion.missing == ()
    assert suggestion.shipped == (None if logger == "german" else logger)
    trip = proposed(path)
    step_w = WHOLE_UNITS.get(logger, 0.0)
    assert trip.array("speed_m_s") == pytest.approx(d.v.to_numpy(), abs=1.0 / 3.6 if step_w else 1e-5)
    energy = np.trapezoid(d.u * d.i, d.t) / 3600.0
    assert trip.observed_energy_wh == pytest.approx(energy, abs=step_w * d.t.iloc[-1] / 3600.0, rel=1e-6)
    middle = len(d) // 2
    soc = charge(d)[middle] / 100.0
    expected = {
        "elevation_m": HEIGHT_M,
        "soc": pytest.approx(soc, abs=0.006),
        "displayed_soc": pytest.approx(soc + SHIFT / 100.0, abs=0.006),
        "ambient_temperature_degc": AMBIENT_DEGC,
        "cabin_temperature_degc": CABIN_DEGC,
        "battery_temperature_degc": BATTERY_DEGC,
    }
    assert {name for name in expected if name not in trip} == LACKING.get(logger, set()), "see LACKING"
    for name in expected.keys() - LACKING.get(logger, set()):
        assert trip.array(name)[middle] == expected[name], name


def test_what_an_export_knows_of_the_climate_is_read(tmp_path) -> None:
    edges = np.array([0.0, 60.0, 120.0])
    leaf, planner = (proposed(written(tmp_path, name)) for name in ("leaf_spy", "abrp"))
    assert leaf.array("heating_power_w")[5] == 4 * 250.0
    assert leaf.array("aircon_power_w")[5] == 8 * 50.0
    assert logged_climate(leaf.samples, edges) == pytest.approx(1400.0)
    assert logged_climate(planner.samples, edges) == pytest.approx(1200.0)


def test_the_sum_of_climate_control_counts_before_its_parts() -> None:
    log = pd.DataFrame(
        {"time_s": np.arange(5.0), "heating_power_w": 100.0, "aircon_power_w": 50.0, "climate_power_w": -3.0}
    )
    edges = np.array([0.0, 4.0])
    assert logged_climate(log, edges).tolist() == [0.0]
    assert logged_climate(log.drop(columns="climate_power_w"), edges).tolist() == [150.0]
    assert logged_climate(log.drop(columns=["climate_power_w", "aircon_power_w"]), edges) is None


def test_miles_make_heights_and_temperatures_questions(tmp_path) -> None:
    d = drive()
    export = EXPORTS["leaf_spy"](d) | {"Speed": d.v / 0.44704, "Elv": HEIGHT_M / 0.3048, "Ambient": 51.8}
    pd.DataFrame(export).to_csv(tmp_path / "miles.csv", index=False)
    found = {g.ours: g for g in suggest_mapping(tmp_path / "miles.csv").guesses}
    assert found["speed_m_s"].unit == "mph"
    assert "may be feet" in found["elevation_m"].why
    assert "may be °F" in found["ambient_temperature_degc"].why


def test_common_names_alone_make_no_logger(tmp_path) -> None:
    """A date, a speed and a power in watts are not TeslaMate's kilowatts."""
    d = drive()
    table = pd.DataFrame({"date": stamps(d, "%Y-%m-%d %H:%M:%S"), "speed": d.v * 3.6, "power": d.u * d.i})
    table.to_csv(tmp_path / "own.csv", index=False)
    found = {g.ours: g for g in suggest_mapping(tmp_path / "own.csv").guesses}
    assert found["battery_power_w"].unit == "w"
    assert "shipped" not in found["battery_power_w"].why


FLEETS: dict[str, Callable[[pd.DataFrame], Columns]] = {
    "geotab": lambda d: diagnostics(d),
    "samsara": lambda d: {
        "time": stamps(d, "%Y-%m-%dT%H:%M:%SZ"), "name": "van 7", "ecuSpeedMph": d.v / 0.44704,
        "evBatteryVoltageMilliVolt": 1000.0 * d.u, "evBatteryCurrentMilliAmp": 1000.0 * d.i,
        "evStateOfChargeMilliPercent": 1000.0 * charge(d), "ambientAirTemperatureMilliC": 1000.0 * AMBIENT_DEGC,
    },
    "teltonika": lambda d: {
        "Timestamp": 1000 * (1_717_142_400 + d.t.astype(int)), "Speed": d.v * 3.6, "Altitude": HEIGHT_M, "Priority": 0,
        "High voltage battery voltage": 1000.0 * d.u, "High voltage battery current": 1000.0 * d.i,
        "Generic state of charge": charge(d), "Ignition": 1,
    },
    "tesla_fleet": lambda d: {
        "createdAt": stamps(d, "%Y-%m-%dT%H:%M:%SZ"), "vin": "van 7", "VehicleSpeed": d.v / 0.44704, "PackVoltage": d.u,
        "PackCurrent": d.i, "Soc": charge(d), "OutsideTemp": AMBIENT_DEGC, "InsideTemp": CABIN_DEGC,
    },
}  # fmt: skip


def diagnostics(d: pd.DataFrame) -> Columns:
    signals = {"EngineRoadSpeed": d.v * 3.6, "ElectricVehicleBatteryPower": d.u * d.i, "StateOfCharge": charge(d),
               "OutsideTemperature": d.t * 0.0 + AMBIENT_DEGC}  # fmt: skip
    times = stamps(d, "%Y-%m-%dT%H:%M:%S.000Z")
    parts = [
        pd.DataFrame({"device": "van 7", "dateTime": times, "diagnostic": f"Diagnostic{name}Id", "data": x})
        for name, x in signals.items()
    ]
    table = pd.concat(parts).sort_values("dateTime", kind="stable")
    return {str(name): column.to_numpy() for name, column in table.items()}


@pytest.mark.parametrize("name", FLEETS)
def test_records_of_telematics_read_by_their_mapping_and_the_proposal_is_that_mapping(tmp_path, name) -> None:
    d, path = drive(), tmp_path / "records.csv"
    pd.DataFrame(FLEETS[name](d)).to_csv(path, index=False)
    assert suggest_mapping(path).shipped == name
    (log,) = read_table(path, name, strict=True).logs
    assert log.context.car == (None if name == "teltonika" else "van 7")
    assert log.context.started_at is not None
    assert log.array("speed_m_s") == pytest.approx(d.v.to_numpy(), abs=1e-5)
    energy = np.trapezoid(d.u * d.i, d.t) / 3600.0
    assert log.observed_energy_wh == pytest.approx(energy, rel=1e-6)
    shown = "soc" if name == "tesla_fleet" else "displayed_soc"
    assert log.array(shown) == pytest.approx(charge(d).to_numpy() / 100.0)
    if name == "teltonika":
        assert log.array("elevation_m")[0] == HEIGHT_M
    else:
        assert log.array("ambient_temperature_degc")[0] == pytest.approx(AMBIENT_DEGC)


def test_every_mapping_has_its_name_on_the_page() -> None:
    named = re.findall(r'^  (\w+): "[^"]+",$', (ROOT / "web/src/text/loggers.ts").read_text(), re.MULTILINE)
    assert sorted(named) == sorted(shipped_mappings())


def test_tracks_of_webfleet_are_proposed_without_a_mapping_of_their_own(tmp_path) -> None:
    """Its names of a charge are not public; those of time, speed and vehicle are enough, and the energy is a question."""
    d = drive()
    table = {
        "objectno": "van 7",
        "pos_time": stamps(d, "%d/%m/%Y %H:%M:%S"),
        "speed": (d.v * 3.6).round(),
        "course": 90,
    }
    pd.DataFrame(table).to_csv(tmp_path / "tracks.csv", index=False)
    suggestion = suggest_mapping(tmp_path / "tracks.csv")
    found = {guess.ours: guess.column for guess in suggestion.guesses}
    assert (found["time_s"], found["speed_m_s"]) == ("pos_time", "speed")
    assert 'vehicle = "objectno"' in suggestion.toml
    assert suggestion.missing
