"""Proposals for tables with all kinds of headers: what is proposed reads the same drive, or says what to check."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.physics.battery import usable_energy_wh
from tripwatt.sources.mapping import parse_mapping
from tripwatt.sources.suggest import suggest_mapping
from tripwatt.sources.table import read_table
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip
from tripwatt.trips.messages import message
from tripwatt.vehicles import load_vehicle

AMBIENT_DEGC, HEIGHT_M = 11.0, 320.0
Columns = dict[str, object]


def drive(n: int = 700) -> pd.DataFrame:
    """A drive of a car of 1600 kg: seconds, m/s, V, A (+ discharges)."""
    rng = np.random.default_rng(4)
    time = np.arange(float(n))
    speed = np.maximum(11.0 + 9.0 * np.sin(time / 11.0) + 3.0 * np.sin(time / 4.3), 0.0)
    power = 1600.0 * speed * np.gradient(speed, time) + 250.0 * speed + 900.0
    current = power / 365.0 + rng.normal(0.0, 0.2, n)
    return pd.DataFrame({"t": time, "v": speed, "u": 365.0 - 0.1 * current, "i": current})


def stamps(d: pd.DataFrame, form: str) -> list[str]:
    return list((pd.Timestamp("2024-05-31 08:00:00") + pd.to_timedelta(d.t, unit="s")).dt.strftime(form))


HEADERS: dict[str, Callable[[pd.DataFrame], Columns]] = {
    "units at the end": lambda d: {
        "time_s": d.t, "speed_kmh": d.v * 3.6, "current_A": d.i, "voltage_V": d.u, "T_amb_C": AMBIENT_DEGC, "elev_m": HEIGHT_M,
    },
    "german, charge positive": lambda d: {
        "Zeit [s]": d.t, "v [km/h]": d.v * 3.6, "I_Batt [A]": -d.i, "U_Batt [V]": d.u, "Außentemperatur [°C]": AMBIENT_DEGC,
        "Höhe [m]": HEIGHT_M,
    },
    "american": lambda d: {
        "Date/Time": stamps(d, "%m/%d/%Y %H:%M:%S"), "Spd (mph)": d.v / 0.44704, "HV Amps": -d.i, "HV Volts": d.u,
        "OAT (F)": AMBIENT_DEGC * 1.8 + 32, "Alt (ft)": HEIGHT_M / 0.3048,
    },
    "letters": lambda d: {"t": d.t, "v": d.v, "i": d.i, "u": d.u, "temp_out": AMBIENT_DEGC, "height": HEIGHT_M},
    "camel case": lambda d: {
        "timeMs": d.t * 1000, "vehicleSpeedKmh": d.v * 3.6, "hvBatteryCurrentA": d.i, "hvBatteryVoltageV": d.u,
        "ambientTemperatureC": AMBIENT_DEGC, "gpsAltitudeM": HEIGHT_M,
    },
    "epoch and amps": lambda d: {
        "ts": (1.7e9 + d.t) * 1000, "velocity": d.v * 3.6, "amps": d.i, "volts": d.u, "oat": AMBIENT_DEGC, "alt": HEIGHT_M,
    },
    "german stamps": lambda d: {
        "Datum": stamps(d, "%d.%m.%Y %H:%M:%S"), "Geschwindigkeit (km/h)": d.v * 3.6, "Batteriestrom (A)": d.i,
        "Batteriespannung (V)": d.u, "Umgebungstemperatur (°C)": AMBIENT_DEGC, "Höhe (m)": HEIGHT_M,
    },
    "a clock": lambda d: {
        "time": stamps(d, "%H:%M:%S"), "Vehicle Speed": d.v * 3.6, "Pack current": d.i, "Pack voltage": d.u,
        "Outside temperature": AMBIENT_DEGC, "Altitude": HEIGHT_M,
    },
    "our own names in other units": lambda d: {
        "time_s": 1.7e9 + d.t, "speed_m_s": d.v, "voltage_v": d.u, "current_a": d.i, "soc": 80.0,
        "ambient_temperature_degc": AMBIENT_DEGC, "elevation_m": HEIGHT_M,
    },
    "things of the same name": lambda d: {
        "Time": d.t, "12V battery voltage": 12.5, "Cell voltage max": 4.1, "Motor current": 1.4 * d.i, "Motor speed (rpm)": d.v * 500,
        "Speed limit": 50, "Vehicle speed": d.v * 3.6, "Battery voltage": d.u, "Battery current": d.i, "Battery temperature": 21.0,
        "Ambient temperature": AMBIENT_DEGC, "Altitude": HEIGHT_M,
    },
}  # fmt: skip


def proposed(path) -> Trip:
    (trip,) = read_table(path, parse_mapping(suggest_mapping(path).toml, "proposed")).trips
    return trip


@pytest.mark.parametrize("header", HEADERS)
def test_what_is_proposed_reads_the_same_drive(tmp_path, header) -> None:
    truth = drive()
    table = pd.DataFrame(HEADERS[header](truth))
    comma = "german" in header
    path = tmp_path / "drive.csv"
    table.to_csv(
        path, index=False, sep=";" if comma else ",", decimal="," if comma else ".", encoding="latin-1"
    )
    suggestion = suggest_mapping(path)
    assert suggestion.missing == ()
    assert all(guess.why for guess in suggestion.guesses)
    trip = proposed(path)
    assert trip.array("speed_m_s") == pytest.approx(truth.v.to_numpy(), abs=1e-6)
    assert trip.array("time_s")[-1] - trip.array("time_s")[0] == pytest.approx(699.0)
    energy = np.trapezoid(truth.u * truth.i, truth.t) / 3600.0
    assert trip.observed_energy_wh == pytest.approx(energy, rel=1e-6)
    assert trip.array("ambient_temperature_degc")[0] == pytest.approx(AMBIENT_DEGC)
    assert trip.array("elevation_m")[0] == pytest.approx(HEIGHT_M)
    started = trip.context.started_at
    assert (started is not None) == any(word in header for word in ("american", "epoch", "stamps", "other"))


def test_columns_that_no_name_explains_are_found_by_physics(tmp_path) -> None:
    d = drive()
    table = pd.DataFrame({"a1": d.t, "a2": d.v * 3.6, "a3": -d.i, "a4": d.u, "a5": 3.0})
    table.to_csv(tmp_path / "x.csv", index=False)
    suggestion = suggest_mapping(tmp_path / "x.csv")
    assert {g.ours: g.column for g in suggestion.guesses} == {
        "time_s": "a1",
        "speed_m_s": "a2",
        "voltage_v": "a4",
        "current_a": "a3",
    }
    assert all("no name matches" in g.why for g in suggestion.guesses)
    assert 'positive = "charge"' in suggestion.toml
    assert suggestion.unused == ("a5",)
    assert proposed(tmp_path / "x.csv").array("speed_m_s") == pytest.approx(d.v.to_numpy())


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "m/s"), (3.6, "km/h"), (1 / 0.44704, "mph")])
def test_a_slow_drive_tells_the_unit_of_its_speed_by_the_cars_mass(tmp_path, factor, unit) -> None:
    d = drive()
    slow = d.v * 0.4
    current = (1600.0 * slow * np.gradient(slow, d.t) + 1500.0) / d.u
    pd.DataFrame({"time": d.t, "speed": slow * factor, "current": current, "voltage": d.u}).to_csv(
        tmp_path / "x.csv", index=False
    )
    (speed,) = [g for g in suggest_mapping(tmp_path / "x.csv").guesses if g.ours == "speed_m_s"]
    assert speed.unit == unit
    assert "kg" in speed.why


def test_a_unit_in_the_name_that_physics_denies_is_doubted(tmp_path) -> None:
    d = drive()
    pd.DataFrame({"time": d.t, "speed [m/s]": d.v * 3.6, "current": d.i, "voltage": d.u}).to_csv(
        tmp_path / "x.csv", index=False
    )
    (speed,) = [g for g in suggest_mapping(tmp_path / "x.csv").guesses if g.ours == "speed_m_s"]
    assert (speed.unit, "CHECK" in speed.why, "km/h" in speed.why) == ("m/s", True, True)


def test_a_folder_stands_for_its_largest_file_and_an_empty_one_is_refused(tmp_path) -> None:
    refuses("no table", suggest_mapping, tmp_path)
    d = drive()
    pd.DataFrame({"time_s": d.t, "speed_m_s": d.v, "voltage_v": d.u, "current_a": d.i, "fahrt_nr": 3}).to_csv(
        tmp_path / "a.csv", index=False
    )
    (tmp_path / "0.csv").write_text("a,b\n1,2\n")
    suggestion = suggest_mapping(tmp_path)
    assert 'column = "fahrt_nr"' in suggestion.toml
    assert "Proposed for a.csv" in suggestion.toml


def test_power_alone_gets_a_voltage_that_stands_in(tmp_path) -> None:
    d = drive()
    power = d.u * d.i / 1000.0
    pd.DataFrame({"time": d.t, "speed": d.v * 3.6, "battery_power_kW": power}).to_csv(
        tmp_path / "x.csv", index=False
    )
    assert suggest_mapping(tmp_path / "x.csv").missing == ()
    energy = 1000.0 * np.trapezoid(power, d.t) / 3600.0
    assert proposed(tmp_path / "x.csv").observed_energy_wh == pytest.approx(energy, rel=1e-6)


def test_what_a_logger_writes_only_when_it_changes_is_held(tmp_path) -> None:
    d = drive()
    pd.DataFrame(
        {"time": d.t, "speed": d.v * 3.6, "current": d.i.where(d.t % 3 == 0), "voltage": d.u}
    ).to_csv(tmp_path / "x.csv", index=False)
    assert "hold_s = 10" in suggest_mapping(tmp_path / "x.csv").toml
    assert proposed(tmp_path / "x.csv").samples["current_a"].notna().all()


def test_a_row_for_each_value_gets_the_shipped_mapping_with_the_signals_that_are_there(tmp_path) -> None:
    d = drive(300)
    rows = ["SECONDS;PID;VALUE;UNITS"]
    for t, v, u, i in d.itertuples(index=False):
        rows += [
            f"{t};Speed (GPS);{3.6 * v};km/h",
            f"{t};HV pack voltage;{u};V",
            f"{t};HV pack current;{i};A",
        ]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    suggestion = suggest_mapping(tmp_path / "log.csv")
    assert (suggestion.shipped, suggestion.missing) == ("car_scanner", ())
    assert suggestion.toml.count("CHECK") == 2
    energy = np.trapezoid(d.u * d.i, d.t) / 3600.0
    assert proposed(tmp_path / "log.csv").observed_energy_wh == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_times_that_parquet_knows_as_such_are_time_stamps(tmp_path, zone) -> None:
    d = drive()
    when = pd.date_range("2024-05-31 08:00", periods=len(d), freq="s", tz=zone)
    path = tmp_path / "x.parquet"
    columns = {"when": when, "speed_kmh": d.v * 3.6, "pack_voltage": d.u, "pack_current": d.i}
    pd.DataFrame(columns).to_parquet(path)
    trip = proposed(path)
    assert trip.duration_s == pytest.approx(699.0)
    assert trip.context.started_at is not None
    with pytest.raises(InvalidInput, match='unit = "timestamp"'):
        read_table(path, parse_mapping(suggest_mapping(path).toml.replace('"timestamp"', '"epoch_s"'), "m"))


def test_headers_that_a_logger_repeats_and_rows_without_a_time_are_left_out(tmp_path) -> None:
    d = drive()
    text = pd.DataFrame({"time": d.t, "speed": d.v * 3.6, "current": d.i, "voltage": d.u}).to_csv(index=False)
    lines = text.splitlines()
    lines[400] = "," + lines[400].partition(",")[2]
    (tmp_path / "x.csv").write_text("\n".join([*lines[:200], lines[0], *lines[200:]]) + "\n")
    fleet = read_table(tmp_path / "x.csv", parse_mapping(suggest_mapping(tmp_path / "x.csv").toml, "m"))
    assert len(fleet.trips[0]) == len(d) - 1
    assert any("1 rows without a time" in note for note in map(message, fleet.notes))


def test_time_of_day_and_elapsed_milliseconds_win_over_a_temperature(tmp_path: Path) -> None:
    drive = synthetic_fleet(2).trips[1].samples.iloc[::10].reset_index(drop=True)
    seconds = pd.Series(range(len(drive)))
    clock = pd.Timestamp("2025-01-01 08:00:00") + pd.to_timedelta(seconds, unit="s")
    signals = {
        "v Fzg [km/h]": (3.6 * drive["speed_m_s"]).round(1),
        "HV-Spg (V)": drive["voltage_v"].round(1),
        "HV Strom/A": drive["current_a"].round(1),
        "T aussen": drive["ambient_temperature_degc"].round(1),
    }
    times = {"Uhrzeit": clock.dt.strftime("%d.%m.%Y %H:%M:%S"), "ElapsedMs": 1000 * seconds}
    for name, values in times.items():
        file = tmp_path / f"{name}.csv"
        pd.DataFrame({name: values, **signals}).to_csv(file, sep=";", index=False)
        found = {guess.ours: guess.column for guess in suggest_mapping(file).guesses}
        assert found["time_s"] == name
        assert found["ambient_temperature_degc"] == "T aussen"


def test_a_column_of_the_vehicle_is_proposed(tmp_path: Path) -> None:
    table = pd.DataFrame({**HEADERS["letters"](drive()), "VIN": "W1V44781313000001", "driver": "anna"})
    table.to_csv(tmp_path / "log.csv", index=False)
    proposal = suggest_mapping(tmp_path / "log.csv")
    assert '[trip]\nvehicle = "VIN"  # 1 in this file\n' in proposal.toml
    assert "VIN" not in proposal.unused
    mapping = parse_mapping(proposal.toml.replace("[trip]\n", '[trip]\ndriver = "driver"\n'), "proposed")
    (log,) = read_table(tmp_path / "log.csv", mapping).logs
    assert (log.context.car, log.context.driver) == ("W1V44781313000001", "anna")
    (alone,) = read_table(tmp_path / "log.csv").logs
    assert alone.context.car is None
    table.loc[3, "driver"] = "bert"
    table.to_csv(tmp_path / "log.csv", index=False)
    (both,) = read_table(tmp_path / "log.csv", mapping).logs
    assert both.context.driver is None


def test_the_column_of_the_vehicle_is_proposed_with_that_of_the_trip(tmp_path: Path) -> None:
    parts = []
    for car in (10, 541):
        d = drive()
        signals = {"Speed [km/h]": d.v * 3.6, "Current [A]": d.i, "Voltage [V]": d.u + (car == 10)}
        parts.append(pd.DataFrame({"VehId": car, "Trip": 7, "Time [s]": d.t, **signals}))
    file = tmp_path / "two.csv"
    pd.concat(parts).to_csv(file, index=False)
    found = suggest_mapping(file)
    assert "VehId" not in found.unused
    assert '[trip]\ncolumn = "Trip"\nvehicle = "VehId"  # 2 in this file' in found.toml
    fleet = read_table(file, parse_mapping(found.toml, "m"))
    assert [trip.trip_id for trip in fleet.trips] == ["10-7", "541-7"]
    assert [len(trip) for trip in fleet.trips] == [len(d), len(d)]


def energy_of(path: Path) -> float:
    (log,) = read_table(path).logs
    assert log.observed_energy_wh is not None
    return log.observed_energy_wh


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("HV kW", 1e-3),
        ("xyz (W)", 1.0),
        ("xyz [kW]", -1e-3),
        ("Potencia", 1e-3),
        ("v.b.power", 1e-3),
        ("Leistung Akku", 1.0),
    ],
)
@pytest.mark.parametrize("other", [{}, {"xyz (A)": -1.0}])
def test_a_power_whose_name_is_not_listed_is_no_current(tmp_path, name, factor, other) -> None:
    """The unit in the name counts, and a power without one has the names of several languages."""
    d, file = drive(), tmp_path / "drive.csv"
    power = d.u * d.i
    more = {key: sign * d.i.round(1) for key, sign in other.items()} if "xyz" not in name else {}
    table = {"Time (s)": d.t, "Speed (km/h)": d.v * 3.6, name: power * factor, **more}
    pd.DataFrame(table).to_csv(file, index=False)
    true_wh = float(np.trapezoid(power, d.t)) / 3600.0
    assert energy_of(file) == pytest.approx(true_wh, rel=0.01)


def test_a_power_in_watts_that_is_called_kilowatts_is_named(tmp_path) -> None:
    """A single impossible value is of a logger that failed, and is left out alone."""
    d, file = drive(), tmp_path / "drive.csv"
    kilowatts = d.u * d.i / 1000.0 + 5.0
    table = pd.DataFrame(
        {"Time (s)": d.t, "Speed (km/h)": d.v * 3.6, "Power (kW)": kilowatts, "SoC (%)": 80.0}
    )
    table.assign(**{"Power (kW)": 1000.0 * kilowatts}).to_csv(file, index=False)
    refuses("column 'Power .kW.'.*the unit appears to be W; convert it to kW", read_table, file)
    table.loc[7, "Power (kW)"] *= 1000.0
    table.to_csv(file, index=False)
    read = read_table(file)
    assert [fault.fix for fault in read.report.faults] == ["check the unit in the mapping"]
    assert np.flatnonzero(read.logs[0].samples["current_a"].isna()).tolist() == [7]


@pytest.mark.parametrize("other", [{}, {"SoC (%)": 80.0}])
def test_a_column_that_may_be_power_or_current_is_not_guessed(tmp_path, other) -> None:
    """Without a voltage, a name or a unit, both are possible: 3 kW is not 3 A."""
    d, file = drive(), tmp_path / "drive.csv"
    pd.DataFrame({"Time (s)": d.t, "Speed (km/h)": d.v * 3.6, "xyz": d.i, **other}).to_csv(file, index=False)
    assert "xyz" in suggest_mapping(file).unused


@pytest.mark.parametrize(("unit", "factor"), [("mA", 1000.0), ("dA", 10.0), ("cA", 100.0), ("A", 1.0)])
def test_the_unit_of_an_unlisted_current_and_speed_counts(tmp_path, unit, factor) -> None:
    d, file = drive(), tmp_path / "drive.csv"
    table = {"Time (s)": d.t, "abc [mph]": d.v / 0.44704, "uvw": d.u, f"xyz [{unit}]": factor * d.i}
    pd.DataFrame(table).to_csv(file, index=False)
    (log,) = read_table(file).logs
    assert log.array("current_a") == pytest.approx(d.i.to_numpy())
    assert log.array("speed_m_s") == pytest.approx(d.v.to_numpy())


def test_a_time_as_torque_writes_it_and_minutes_of_a_spreadsheet_are_read(tmp_path) -> None:
    d = drive(1000)
    for name, form in (
        ("GPS Time", "%a %b %d %H:%M:%S GMT+01:00 %Y"),
        ("time", "%M:%S.%f"),
        ("time", "%M:%S,%f"),
    ):
        shifted = d.assign(t=d.t + 3000.0)  # minutes pass the full hour
        table = {name: stamps(shifted, form), "Speed (km/h)": d.v * 3.6, "U (V)": d.u, "I (A)": d.i}
        file = tmp_path / "drive.csv"
        pd.DataFrame(table).to_csv(file, index=False)
        (log,) = read_table(file).logs
        assert log.array("time_s").tolist() == d.t.tolist()


@pytest.mark.parametrize(
    ("name", "cells", "words"),
    [
        ("Speed (km/h)", ["03. Jan", "12. Mrz"], "a spreadsheet made dates of the numbers"),
        ("Time (s)", ["start", "later"], "seconds that increase"),
        ("Time (s)", [7, 7], "seconds that increase"),
    ],
)
def test_a_column_that_is_there_and_does_not_fit_is_named_with_its_first_cell(
    tmp_path, name, cells, words
) -> None:
    d = drive()
    table = {"Time (s)": d.t, "Speed (km/h)": d.v * 3.6, "U (V)": d.u, "I (A)": d.i} | {name: cells * 350}
    pd.DataFrame(table).to_csv(tmp_path / "drive.csv", index=False)
    with pytest.raises(InvalidInput) as caught:
        read_table(tmp_path / "drive.csv")
    text = f"{caught.value}"
    assert f"column does not fit: {tmp_path}/drive.csv column {name!r}: got '{cells[0]}'" in text
    assert words in text


CAR = load_vehicle("bmw_i3_60ah")


def with_charge(power: pd.Series, time: pd.Series, name: str, capacity_kwh: float) -> Columns:
    """A state of charge in percent that falls with the energy of a power, from 90 %."""
    used_wh = (
        np.concatenate(([0.0], np.cumsum(0.5 * (power[1:].to_numpy() + power[:-1].to_numpy())))) / 3600.0
    )
    return {name: 90.0 - used_wh / capacity_kwh / 10.0}


@pytest.mark.parametrize(("factor", "right"), [(1.0, True), (0.36, False), (3.6, False), (-1.0, True)])
@pytest.mark.parametrize("every", [1, 12])
def test_an_energy_that_the_charge_contradicts_is_a_fault_of_the_log(tmp_path, factor, right, every) -> None:
    """Too small, too large, or of the wrong sign where rows are too rare to see accelerations."""
    d = drive(3000)
    power = d.u * d.i
    charge = with_charge(power, d.t, "SoC (%)", usable_energy_wh(CAR.battery) / 1000.0)
    table = {"Time (s)": d.t, "Speed (km/h)": d.v * 3.6, "HV kW": factor * power / 1000.0, **charge}
    pd.DataFrame(table)[::every].to_csv(tmp_path / "drive.csv", index=False)
    if not right:
        with pytest.raises(InvalidInput, match=r"energy contradicts state of charge: .*drive\.csv"):
            read_table(tmp_path / "drive.csv", vehicle=CAR)
        return
    (log,) = read_table(tmp_path / "drive.csv", vehicle=CAR).logs
    true_wh = float(np.trapezoid(power[::every], d.t[::every])) / 3600.0
    assert log.observed_energy_wh == pytest.approx(true_wh, rel=0.02)


@pytest.mark.parametrize("charged", [0.0, 20.0])
def test_what_a_battery_gives_and_gets_in_a_gap_says_nothing_of_the_energy(tmp_path, charged) -> None:
    """Between two drives of a file the car stands for an hour under load, or is charged."""
    d = drive(3000)
    power = d.u * d.i
    charge = with_charge(power, d.t, "SoC (%)", usable_energy_wh(CAR.battery) / 1000.0)["SoC (%)"]
    later = d.t.to_numpy() >= 1500.0
    table = {
        "Time (s)": d.t + 3600.0 * later,
        "Speed (km/h)": d.v * 3.6,
        "HV kW": np.where(np.abs(d.t - 1500.0) < 3.0, 9000.0, power) / 1000.0,
        "SoC (%)": charge - 30.0 + charged * later,
    }
    pd.DataFrame(table).to_csv(tmp_path / "drive.csv", index=False)
    (file,) = read_table(tmp_path / "drive.csv", vehicle=CAR).report.files
    assert (file.logs, file.faults) == (1, ())


HILLS = {"gentle": (8.0, 4000.0), "steep": (80.0, 6000.0)}
"""Name -> amplitude [m] and length [m] of the waves of a road."""


@pytest.mark.parametrize("hills", [*HILLS])
@pytest.mark.parametrize(
    ("change", "is_right"),
    [
        ("nothing", True),
        ("noise of a satellite", True),
        ("offset", True),
        ("some heights of zero", True),
        ("a gap", True),
        ("a clock set back", True),
        ("wrong sign", False),
        ("another column", False),
        ("ten times", False),
    ],
)
def test_grades_that_contradict_the_heights_are_a_fault_of_the_log(tmp_path, hills, change, is_right) -> None:
    """By more than their errors: on a gentle road the errors of the heights hide a wrong sign."""
    d, rng = drive(3000), np.random.default_rng(2)
    way, (size, length) = np.cumsum(d.v.to_numpy()), HILLS[hills]
    height = 300.0 + size * np.sin(2.0 * np.pi * way / length)
    grade = size * 2.0 * np.pi / length * np.cos(2.0 * np.pi * way / length)
    time = d.t.to_numpy()
    match change:
        case "noise of a satellite":
            height = height + np.repeat(rng.normal(0.0, 6.0, 100), 30)
        case "offset":
            grade = grade + 0.02
        case "some heights of zero":
            height[rng.random(3000) < 0.05] = 0.0
        case "a gap":
            time = time + 7200.0 * (time > 1400.0)
        case "a clock set back":
            time = time - 600.0 * (time > 1400.0)
        case "wrong sign":
            grade = -grade
        case "another column":
            grade = 0.3 * np.sin(way / 700.0)
        case "ten times":
            grade = 10.0 * np.clip(grade, -0.05, 0.05)
    table = {"time_s": time, "speed_m_s": d.v, "voltage_v": d.u, "current_a": d.i}
    table |= {"grade": grade, "elevation_m": height}
    pd.DataFrame(table).to_csv(tmp_path / "drive.csv", index=False)
    if is_right or (hills, change) == ("gentle", "wrong sign"):
        (file,) = read_table(tmp_path / "drive.csv").report.files
        assert (file.logs, file.faults) == (1, ())
        return
    refuses(r"grade contradicts heights: .*drive\.csv: got .* m apart", read_table, tmp_path / "drive.csv")


@pytest.mark.parametrize("name", ["SoC BMS (%)", "bms_soc", "SoC (%)", "soc_display"])
@pytest.mark.parametrize("beside", [{}, {"displayed SoC": 2.5}])
def test_percent_of_the_battery_management_are_of_the_whole_battery(tmp_path, name, beside) -> None:
    d = drive(3000)
    power = d.u * d.i
    is_whole = "bms" in name.lower() or ("display" not in name and bool(beside))
    beside = {} if "display" in name else beside
    whole = replace(CAR.battery, displayed_zero_soc=0.0, displayed_full_soc=1.0)
    kwh = usable_energy_wh(whole if is_whole else CAR.battery) / 1000.0
    table = {"Time (s)": d.t, "Speed (km/h)": d.v * 3.6, **with_charge(power, d.t, name, kwh), **beside}
    pd.DataFrame(table).to_csv(tmp_path / "drive.csv", index=False)
    (log,) = read_table(tmp_path / "drive.csv", vehicle=CAR).logs
    assert log.observed_energy_wh == pytest.approx(float(np.trapezoid(power, d.t)) / 3600.0, rel=0.01)
