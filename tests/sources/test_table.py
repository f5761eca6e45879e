"""Any table through a mapping: units, signs, layouts, what is missing, and every wrong input in one message."""

import datetime as dt
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.support.refusals import refuses

from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.physics import simulate_trip
from tripwatt.sources import read_logs
from tripwatt.sources.canonical import read_canonical
from tripwatt.sources.columnar import open_table
from tripwatt.sources.mapping import load_mapping, parse_mapping, shipped_mappings
from tripwatt.sources.suggest import suggest_mapping
from tripwatt.sources.table import Distances, air_unit_of, distances_of, read_table, speed_unit_of
from tripwatt.trips import Plan, TripSet
from tripwatt.trips.messages import message
from tripwatt.vehicles import load_vehicle

MAPPING = """
[columns]
time_s = { column = "Time", unit = "s" }
speed_m_s = { column = "Speed", unit = "km/h" }
voltage_v = { column = "Volt", unit = "V" }
current_a = { column = "Amp", unit = "A" }
ambient_temperature_degc = { column = "Outside", unit = "degF" }
elevation_m = { column = "Height", unit = "ft" }

[current]
positive = "charge"
"""


def driven(n=600, seed=0):
    """A drive in the units and with the sign of MAPPING."""
    rng = np.random.default_rng(seed)
    time = np.arange(float(n))
    speed = np.maximum(12.0 + 9.0 * np.sin(time / 11.0 + seed) + 3.0 * np.sin(time / 4.3), 0.0)
    power = 1500.0 * speed * np.gradient(speed, time) + 250.0 * speed + 900.0
    current = power / 390.0 + rng.normal(0.0, 0.2, n)
    return pd.DataFrame(
        {
            "Time": time,
            "Speed": 3.6 * speed,
            "Volt": 390.0 - 0.1 * current,
            "Amp": -current,
            "Outside": 50.0 + 4.0 * np.sin(time / 200.0),
            "Height": 1000.0 + 0.1 * time,
        }
    )


@pytest.fixture
def mapping(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text(MAPPING)
    return path


def faults_of(path, mapping):
    with pytest.raises(InvalidInput) as caught:
        read_table(path, mapping, strict=True)
    return caught.value.faults


def test_csv_and_parquet_files_become_trips_in_our_units(tmp_path, mapping):
    folder = tmp_path / "logs"
    folder.mkdir()
    driven().to_csv(folder / "monday.csv", index=False)
    driven(seed=1).to_parquet(folder / "tuesday.parquet")
    driven(seed=2).to_csv(folder / "wednesday.csv", index=False, sep=";", decimal=".")
    (folder / "readme.txt").write_text("Three drives of last week.\n")
    (folder / "._monday.csv").write_bytes(b"\0\5")
    fleet = read_logs(folder, "table", mapping)
    assert [t.trip_id for t in fleet.trips] == ["monday", "tuesday", "wednesday"]
    row = fleet.trips[0].samples.iloc[0].to_dict()
    raw = driven().iloc[0]
    assert row["speed_m_s"] == pytest.approx(raw.Speed / 3.6)
    assert row["current_a"] == pytest.approx(-raw.Amp)
    assert row["ambient_temperature_degc"] == pytest.approx(10.0)
    assert row["elevation_m"] == pytest.approx(304.8)
    assert all(t.observed_energy_wh > 0 for t in fleet.trips)
    assert audit(fleet).set_aside == {}


def test_one_file_with_a_column_of_trips_and_time_stamps(tmp_path):
    start = pd.Timestamp("2024-05-31T08:00:00Z")
    frames = [
        driven(seed=k).assign(
            Time=lambda d, k=k: start + pd.to_timedelta(d.Time + 4000 * k, unit="s"), Drive=f"d{k}"
        )
        for k in range(3)
    ]
    table = pd.concat(frames)
    table = table.reset_index(drop=True)
    table.loc[:4, "Drive"] = ""
    text = MAPPING.replace('unit = "s"', 'unit = "timestamp"') + '[trip]\ncolumn = "Drive"\n'
    for name, write in (("all.csv", pd.DataFrame.to_csv), ("all.parquet", pd.DataFrame.to_parquet)):
        write(table, tmp_path / name)
        fleet = read_table(tmp_path / name, parse_mapping(text, "my.toml"))
        assert [t.trip_id for t in fleet.trips] == ["d0", "d1", "d2"]
        assert fleet.trips[1].array("time_s")[:2].tolist() == [0.0, 1.0]
        assert fleet.trips[2].context.started_at >= dt.datetime(2024, 5, 31, 10, 13, 20)
        assert any("rows without a trip" in note for note in map(message, fleet.notes))


def test_energy_from_soc_with_its_uncertainty(tmp_path):
    raw = driven(1200)
    table = pd.DataFrame({"Time": raw.Time, "Speed": raw.Speed, "SoC": np.round(80.0 - raw.Time / 100.0)})
    table.to_csv(tmp_path / "drive.csv", index=False)
    text = """
    [columns]
    time_s = { column = "Time" }
    speed_m_s = { column = "Speed", unit = "km/h" }
    soc = { column = "SoC", unit = "%" }
    [battery]
    usable_capacity_kwh = 50
    usable_capacity_uncertainty = 0.1
    """
    fleet = read_table(tmp_path / "drive.csv", parse_mapping(text, "my.toml"))
    (trip,) = fleet.trips
    assert trip.observed_energy_wh == pytest.approx(50_000 * 0.12)
    assert trip.observed_energy_std_wh == pytest.approx(np.hypot(600.0, 500.0 / np.sqrt(6.0)), rel=1e-6)
    assert any("standard error" in note for note in map(message, fleet.notes))
    result = audit(fleet)
    assert result.set_aside == {}
    assert result.trips[0].observed_energy_wh == trip.observed_energy_wh
    bare = read_table(tmp_path / "drive.csv", parse_mapping(text.split("[battery]")[0], "my.toml"))
    assert bare.trips[0].observed_energy_wh is None
    assert any("no energy is measured" in note for note in map(message, bare.notes))
    assert "the energy is not measured" in audit(bare).set_aside["drive"]


def test_a_row_for_each_value(tmp_path):
    raw = driven()
    names = {"Speed": "Speed (GPS)", "Volt": "[BMS] HV battery voltage", "Amp": "[BMS] HV battery current"}
    rows = ['"SECONDS";"PID";"VALUE";"UNITS";']
    for i in range(len(raw)):
        for j, (ours, pid) in enumerate(names.items()):
            sign = -1.0 if ours == "Amp" else 1.0
            rows.append(f'"{raw.Time[i] + 0.1 * j:.1f}";"{pid}";"{sign * raw[ours][i]}";"";')
        rows.append(f'"{raw.Time[i]:.1f}";"Gear";"D";"";')
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    text = load_text("car_scanner")
    (trip,) = read_table(tmp_path / "log.csv", parse_mapping(text, "car_scanner")).trips
    assert len(trip) == 3 * len(raw)
    assert trip.samples["current_a"].notna().sum() >= 3 * len(raw) - 3  # held for its 10 s
    assert trip.samples["speed_m_s"][0] == pytest.approx(raw.Speed[0] / 3.6)
    (fault,) = faults_of(
        tmp_path / "log.csv", parse_mapping(text.replace("HV battery current", "Current"), "m")
    )
    assert fault.what == "missing signal"
    assert "[BMS] HV battery current" in fault.fix


def load_text(name):
    from importlib import resources

    return (resources.files("tripwatt.sources") / "mappings" / f"{name}.toml").read_text("utf-8")


def test_shipped_mappings_are_sound_and_name_their_source():
    assert {"abrp", "teslamate", "ovms", "torque", "car_scanner"} <= set(shipped_mappings())
    for name in shipped_mappings():
        assert load_mapping(name).columns
        assert load_text(name).startswith("# ")


@pytest.mark.parametrize(
    ("damage", "what", "words"),
    [
        (lambda d: d.rename(columns={"Amp": "Ampere"}), "missing column", "did you mean 'Ampere'?"),
        (lambda d: d.assign(Speed=d.Speed * 10), "value out of range", "-36 to 324 km/h"),
        (lambda d: d.assign(Volt=12.6), "value out of range", "12 V on-board system"),
        (lambda d: d.assign(Amp=-d.Amp), "current has the wrong sign", 'positive = "discharge"'),
        (lambda d: d.assign(Volt=np.nan), "empty column", "Volt"),
        (lambda d: d.assign(Volt="high"), "not a number", "'high'"),
        (lambda d: d.iloc[:1], "too few samples", "at least 2"),
    ],
)
def test_wrong_tables_are_named(tmp_path, mapping, damage, what, words):
    damage(driven()).to_csv(tmp_path / "drive.csv", index=False)
    faults = faults_of(tmp_path / "drive.csv", mapping)
    assert {f.what for f in faults} == {what}
    assert words in " ".join(map(str, faults))


def test_wrong_value_names_file_row_and_column(tmp_path, mapping):
    table = driven()
    table["Speed"] = 900.0
    table.to_csv(tmp_path / "drive.csv", index=False)
    (fault,) = faults_of(tmp_path / "drive.csv", mapping)
    assert "drive.csv row 2 column 'Speed'" in fault.where
    assert fault.got.startswith("900 km/h")


def test_gaps_of_minutes_are_told_with_their_row(tmp_path, mapping):
    table = driven(1200)
    table.loc[table.index >= 700, "Time"] += 400.0
    table.to_csv(tmp_path / "drive.csv", index=False)
    fleet = read_table(tmp_path / "drive.csv", mapping)
    assert any("row 702" in note and "401 s" in note for note in map(message, fleet.notes))
    assert [t.trip_id for t in audit(fleet).trips] == ["drive-1", "drive-2"]


def test_two_trips_with_one_id_and_all_faults_at_once(tmp_path, mapping):
    folder = tmp_path / "logs"
    folder.mkdir()
    driven().to_csv(folder / "a.csv", index=False)
    driven().assign(Speed=30.0).to_parquet(folder / "a.parquet")
    (fault,) = faults_of(folder, mapping)
    assert fault.what == "duplicate trip id"
    (folder / "a.parquet").unlink()
    driven().assign(Volt=12.0, Speed=20.0).to_csv(folder / "b.csv", index=False)
    (folder / "c.parquet").write_bytes(b"no parquet")
    faults = faults_of(folder, mapping)
    assert {f.what for f in faults} == {"value out of range", "unreadable Parquet file"}


def test_wrong_mappings_are_named_by_their_keys(tmp_path):
    text = """
    [columns]
    time_s = { column = "Time", unit = "s" }
    speed = { column = "Speed" }
    voltage_v = { column = "Volt", unit = "furlong" }
    current_a = "Amp"
    [current]
    positive = "up"
    [battery]
    nominal_voltage_v = 12
    usable_capacity = 30
    [colums]
    """
    path = tmp_path / "my.toml"
    path.write_text(text)
    with pytest.raises(InvalidInput) as caught:
        load_mapping(path)
    said = str(caught.value)
    for part in (
        "[columns] speed",
        "[columns] speed_m_s",
        "voltage_v.unit",
        "current_a",
        "positive",
        "12",
        "[colums]",
    ):
        assert part in said
    assert "did you mean 'columns'?" in said
    path.write_text("[columns")
    refuses("not a TOML file", load_mapping, path)
    refuses("cannot read the mapping", load_mapping, tmp_path / "none.toml")


def test_without_a_mapping_our_names_are_needed(tmp_path):
    driven().to_csv(tmp_path / "drive.csv", index=False)
    (fault,) = faults_of(tmp_path / "drive.csv", None)
    assert "mapping suggest" in fault.fix
    raw = driven()
    ours = pd.DataFrame(
        {"time_s": raw.Time, "speed_m_s": raw.Speed / 3.6, "voltage_v": raw.Volt, "current_a": -raw.Amp}
    )
    ours.to_csv(tmp_path / "ours.csv", index=False)
    (trip,) = read_table(tmp_path / "ours.csv").trips
    assert trip.array("speed_m_s")[0] == pytest.approx(raw.Speed[0] / 3.6)


@given(junk=st.binary(max_size=12), at=st.integers(0, 2000), remove=st.integers(0, 60))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_damage_ends_in_a_fleet_or_in_invalid_input(tmp_path, mapping, junk, at, remove):
    stamped = driven(20).assign(Time=lambda d: pd.Timestamp("2024-05-31") + pd.to_timedelta(d.Time, unit="s"))
    data = stamped.to_csv(index=False).encode()
    (tmp_path / "drive.csv").write_bytes(data[:at] + junk + data[at + remove :])
    text = MAPPING.replace('unit = "s"', 'unit = "timestamp"')
    for read in (lambda p: read_table(p, parse_mapping(text, "m")), suggest_mapping):
        try:
            found = read(tmp_path / "drive.csv")
        except InvalidInput as error:
            found = error
        assert not isinstance(found, TripSet) or found.trips


@given(text=st.text(max_size=60), at=st.integers(0, 400))
@settings(max_examples=80, deadline=None)
def test_any_mapping_is_read_or_refused(text, at):
    try:
        parsed = parse_mapping(MAPPING[:at] + text + MAPPING[at:], "my.toml")
    except InvalidInput as error:
        parsed = error
    assert isinstance(parsed, InvalidInput) or parsed.columns


def test_the_index_that_pandas_writes_is_no_column(tmp_path):
    rows = driven().rename(columns={"Time": "time_s", "Speed": "speed_m_s"})[["time_s", "speed_m_s"]]
    every_third_or_so = rows[(rows.index % 3 == 0) | (rows.index == 4)]
    every_third_or_so.to_parquet(tmp_path / "part.parquet")
    assert "__index_level_0__" in pq.ParquetFile(tmp_path / "part.parquet").schema_arrow.names
    samples = read_canonical(tmp_path / "part.parquet")
    assert list(samples.columns) == ["time_s", "speed_m_s"]
    assert samples["time_s"].tolist() == every_third_or_so["time_s"].tolist()


def test_heights_come_from_positions_where_a_file_has_none(tmp_path: Path) -> None:
    time = np.arange(300.0)
    log = pd.DataFrame(
        {
            "time_s": time,
            "speed_m_s": 10.0,
            "voltage_v": 350.0,
            "current_a": 10.0,
            "Latitude": 47.5 + time / 11_119.5,
            "Longitude": 9.5,
        }
    )
    (tmp_path / "logs").mkdir()
    log.to_csv(tmp_path / "logs" / "flat.csv", index=False)
    log.assign(elevation_m=12.0).to_csv(tmp_path / "logs" / "own.csv", index=False)

    def hill(latitude: FloatArray, longitude: FloatArray) -> FloatArray:
        assert longitude == pytest.approx(np.full(300, 9.5))
        return 400.0 + 1000.0 * (latitude - 47.5)

    without = {trip.trip_id: trip for trip in read_table(tmp_path / "logs").logs}
    found = {trip.trip_id: trip for trip in read_table(tmp_path / "logs", heights=hill).logs}
    assert not without["flat"].has("elevation_m")
    assert found["flat"].array("elevation_m") == pytest.approx(400.0 + time / 11.1195)
    assert (found["own"].array("elevation_m") == 12.0).all()
    assert not {"Latitude", "latitude_deg"} & set(found["flat"].samples.columns), "positions are not kept"
    unknown = read_table(tmp_path / "logs", heights=lambda latitude, _: np.full(len(latitude), np.nan))
    assert not next(trip for trip in unknown.logs if trip.trip_id == "flat").has("elevation_m")


def test_a_log_whose_first_positions_are_missing_is_simulated_on_the_heights_that_are_known(
    tmp_path: Path,
) -> None:
    """A receiver without a fix writes nothing, or zeros, where no tile is."""
    time = np.arange(300.0)
    speed = 10.0 + 2.0 * np.sin(time / 20.0)
    log = pd.DataFrame({"time_s": time, "speed_m_s": speed, "voltage_v": 350.0, "current_a": 2.0 * speed})
    latitude, longitude = 47.5 + time / 11_119.5, np.full(300, 9.5)
    latitude[:20], longitude[:20] = np.nan, np.nan
    latitude[20:30], longitude[20:30] = 0.0, 0.0
    log.assign(Latitude=latitude, Longitude=longitude).to_csv(tmp_path / "drive.csv", index=False)

    def hill(north: FloatArray, east: FloatArray) -> FloatArray:
        return np.where(north > 40.0, 400.0 + 1000.0 * (north - 47.5), np.nan)

    (trip,) = audit(read_table(tmp_path / "drive.csv", heights=hill)).trips
    assert np.isfinite(trip.array("elevation_m")).sum() == 270
    run = simulate_trip(load_vehicle("vw_id3"), Plan.from_trip(trip))
    climbed_m = 1000.0 * (latitude[-1] - latitude[30])
    mass_kg = load_vehicle("vw_id3").body.test_mass_kg
    assert run.by_cause_wh["climb"] == pytest.approx(mass_kg * 9.81 * climbed_m / 3600.0, rel=0.1)


def test_the_standard_error_of_a_charge_that_stands_still_is_at_most_the_energy(tmp_path: Path) -> None:
    table = driven()
    sample = pd.DataFrame({"Time (s)": table.iloc[:, 0], "Speed (m/s)": 10.0, "soc": 80})
    sample.to_csv(tmp_path / "drive.csv", index=False)
    notes = read_table(tmp_path / "drive.csv", vehicle=load_vehicle("bmw_i3_60ah")).notes
    assert [note.value for note in notes if note.code == "energy_from_soc"] == [1.0]


FACTORS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704}


@pytest.mark.parametrize("assumed", FACTORS)
@pytest.mark.parametrize("true", FACTORS)
def test_positions_give_the_unit_of_the_speed(tmp_path: Path, assumed: str, true: str) -> None:
    degrees = assumed != true  # as degrees and minutes
    time = np.arange(600.0)
    speed = 14.0 + 4.0 * np.sin(time / 20.0)
    way = np.cumsum(speed)
    north, east = 48.0 + 0.6 * way / 111_195.0, 11.0 + 0.8 * way / 111_195.0 / np.cos(np.radians(48.0))
    spelled = [f"{int(x)} {60 * (x - int(x)):.5f}" if degrees else f"{x:.7f}" for x in (*north, *east)]
    pd.DataFrame({"Lat": spelled[:600], "Long": spelled[600:]}).to_csv(tmp_path / "a.csv", index=False)
    distances = distances_of(
        open_table(tmp_path / "a.csv", faults=[]), time, speed / FACTORS[true] * FACTORS[assumed]
    )
    assert speed_unit_of(assumed, [distances]) == true


def test_an_odometer_needs_twenty_kilometres() -> None:
    assert speed_unit_of("km/h", [Distances(0.0, 0.0, 12_000.0, 19_300.0)]) == "km/h"
    assert speed_unit_of("km/h", [Distances(0.0, 0.0, 13_000.0, 20_900.0)]) == "mph"


@pytest.mark.parametrize("air", [-15.0, 0.0, 12.0, 30.0])
@pytest.mark.parametrize("battery_above", [0.0, 6.0])
def test_air_is_nearer_to_the_battery_in_its_own_unit(air: float, battery_above: float) -> None:
    celsius = air + np.linspace(-3.0, 8.0, 50)
    battery = [celsius + battery_above]
    assert air_unit_of("degc", [celsius], battery) == "degc"
    assert air_unit_of("degf", [celsius * 1.8 + 32.0], battery) == "degf"
    if air >= 0.0:
        assert air_unit_of("degc", [celsius * 1.8 + 32.0], battery) == "degf"
