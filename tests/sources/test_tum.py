"""The TUM reader: all spellings of one file read alike, and each damage is named with its place."""

import datetime as dt
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.sources import DATASETS, read_logs
from tripwatt.sources.tum import REFERENCE_TRIPS, read_tum
from tripwatt.trips import COLUMNS, TripSet
from tripwatt.trips.messages import message


def faults_of(folder):
    with pytest.raises(InvalidInput) as caught:
        read_tum(folder, strict=True)
    return caught.value.faults


def faults_if_refused(folder):
    """Faults, none when the folder is read; anything but a fleet or an InvalidInput fails the test."""
    try:
        fleet = read_tum(folder)
    except InvalidInput as error:
        return error.faults
    assert isinstance(fleet, TripSet)
    return ()


def one_trip(folder, data):
    (folder / "TripA01.csv").write_bytes(data)
    return read_tum(folder).trips[0]


def test_units_and_signs_are_ours(tmp_path, tum_bytes):
    samples = one_trip(tmp_path, tum_bytes()).samples
    assert samples["speed_m_s"][0] == pytest.approx(10.0)
    assert samples["current_a"][0] == pytest.approx(20.25)  # + discharges
    assert samples["soc"][0] == pytest.approx(0.869)
    assert samples["displayed_soc"][0] == pytest.approx(0.995)
    assert samples["heating_power_w"][0] == pytest.approx(1500.0)
    assert samples["aircon_power_w"][0] == pytest.approx(400.0)
    assert samples["motor_torque_nm"][0] == 20.5
    assert list(samples.columns) == [c for c in COLUMNS if c in samples.columns]
    assert (samples.dtypes == np.float64).all()


@pytest.mark.parametrize(
    ("encoding", "newline", "delimiter"),
    [("latin-1", "\r\n", ";"), ("utf-8", "\n", ","), ("utf-8-sig", "\r\n", ","), ("utf-16", "\n", "\t")],
)
def test_resaved_copies_read_alike(tmp_path, tum_bytes, encoding, newline, delimiter):
    original = one_trip(tmp_path, tum_bytes())
    copy = one_trip(tmp_path, tum_bytes(encoding, newline, delimiter=delimiter))
    assert copy.samples.equals(original.samples)


def test_odd_headers_read_alike(tmp_path, tum_bytes):
    original = one_trip(tmp_path, tum_bytes()).samples
    data = tum_bytes()
    odd = [
        data.replace(b"Velocity [km/h]", b"Velocity [km/h]]]"),
        data.replace(b"\r\n", b";\r\n"),  # a delimiter at the end of every line
        data.replace(b"\r\n", b";\r\n", 1),  # only at the end of the header
        data.replace("°".encode("latin-1"), b"?"),
        data.replace(b"Battery Voltage [V]", b'" Battery Voltage [V] "'),
        data.replace(b"Throttle [%]", b"SoC [%]  ".replace(b"SoC", b"Vent")).replace(
            b"max. SoC [%)", b"Vent [%]"
        ),
        data.replace(b"Throttle [%]", b""),  # an unnamed column
        b"\r\n" + data + b"\r\n\r\n",
    ]
    for variant in odd:
        assert one_trip(tmp_path, variant).samples.equals(original)


def test_empty_cells_are_missing_values_and_lin_wins_over_can(tmp_path, tum_bytes):
    data = tum_bytes().replace(b";86.9;", b";;", 1).replace(b"Throttle [%]", b"Heating Power LIN [W]")
    samples = one_trip(tmp_path, data).samples
    assert np.isnan(samples["soc"][0])
    assert samples["soc"][1:].notna().all()
    assert (samples["heating_power_w"] == 12.0).all()


def test_context_from_the_sheet(tmp_path, tum_bytes, write_overview):
    for name in ("TripA01", "TripB02", "TripB99"):
        (tmp_path / f"{name}.csv").write_bytes(tum_bytes())
    write_overview(
        tmp_path,
        [
            ["TripA01", "2019-06-25_13-21-14", "East", " Sunny", 23, None, 1.0, 9.9, None, "Auto", None],
            [None] * 11,
            [
                "TripB02 ",
                "2019_12_08_09-38-26",
                None,
                "dark",
                "warm",
                None,
                "14.8",
                "=1/2",
                None,
                "Auto",
                "FTM (directly after previous trip), + 160 kg, '+70kg",
            ],
        ],
    )
    fleet = read_tum(tmp_path)
    first, second, third = (t.context for t in fleet.trips)
    assert (first.season, first.weather, first.route) == ("summer", "sunny", "East")
    assert first.started_at == dt.datetime(2019, 6, 25, 13, 21, 14)
    assert (first.cabin_setpoint_degc, first.payload_mass_kg, first.follows_trip) == (23.0, 0.0, False)
    assert (second.season, second.started_at) == ("winter", dt.datetime(2019, 12, 8, 9, 38, 26))
    assert (second.cabin_setpoint_degc, second.payload_mass_kg, second.follows_trip) == (None, 230.0, True)
    assert third.season is None
    assert third.weather is None
    assert any("TripB99" in note for note in map(message, fleet.notes))
    assert "10.21227/6jr9-5235" in fleet.citation
    assert "CC BY 4.0" in fleet.citation


def test_without_the_sheet_season_and_weather_are_unknown_and_said_so(tmp_path, tum_bytes):
    (tmp_path / "TripA01.csv").write_bytes(tum_bytes())
    fleet = read_tum(tmp_path)
    assert fleet.trips[0].context.season is None
    assert fleet.trips[0].context.weather is None
    assert any("Overview.xlsx is missing" in note for note in map(message, fleet.notes))


def test_damaged_sheet_is_refused(tmp_path, tum_bytes):
    (tmp_path / "TripA01.csv").write_bytes(tum_bytes())
    (tmp_path / "Overview.xlsx").write_bytes(b"PK\x03\x04 not a workbook")
    assert "unreadable sheet" in faults_of(tmp_path)[0].what
    openpyxl.Workbook().save(tmp_path / "Overview.xlsx")
    assert "missing column" in faults_of(tmp_path)[0].what


def test_folders_that_are_none(tmp_path, tum_bytes):
    assert faults_of(tmp_path / "nowhere")[0].what == "no such folder"
    assert faults_of(tmp_path)[0].what == "no trips"
    assert "mapping suggest" not in faults_of(tmp_path)[0].fix
    (tmp_path / "own.csv").write_text("t,v\n0,1\n")
    assert f"`tripwatt mapping suggest {tmp_path}`" in faults_of(tmp_path)[0].fix
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "TripA01.csv").write_bytes(tum_bytes())
    assert str(tmp_path / "below") in faults_of(tmp_path)[0].fix
    assert faults_of(tmp_path / "below" / "TripA01.csv")[0].what == "not a folder"
    (tmp_path / "below" / "TripA01 (1).csv").write_bytes(tum_bytes())
    assert faults_of(tmp_path / "below")[0].what == "two files of one trip"


@pytest.mark.parametrize(
    ("damage", "what", "where"),
    [
        (lambda d: b"", "empty file", "TripA01.csv"),
        (lambda d: b" \r\n \r\n", "empty file", "TripA01.csv"),
        (lambda d: d.splitlines()[0] + b"\r\n", "no samples", "TripA01.csv"),
        (lambda d: d.splitlines()[0], "no samples", "TripA01.csv"),
        (lambda d: b"".join(d.splitlines(keepends=True)[:2]), "too few samples", "TripA01.csv"),
        (lambda d: bytes(range(256)) * 20, "not a text file", "TripA01.csv"),
        (lambda d: d.replace(b";", b" "), "missing column", "row 1"),
        (lambda d: d.replace(b"Battery Current [A]", b"Amps"), "missing column", "row 1"),
        (lambda d: d.replace(b"Throttle [%]", b"Velocity [km/h] "), "duplicate column", "Velocity [km/h]"),
        (
            lambda d: d.replace(b";-20.25;", b";oops;", 1),
            "not a number",
            "row 2 column 'Battery Current [A]'",
        ),
        (
            lambda d: d.replace(b";-20.25;", b";inf;", 1),
            "number out of range",
            "row 2 column 'Battery Current [A]'",
        ),
        (
            lambda d: d.replace(b";-21.25;", b";1e300;", 1),
            "number out of range",
            "row 3 column 'Battery Current",
        ),
        (lambda d: d.replace(b"390.5", b"390,5"), "decimal comma", "row 2 column 'Battery Voltage [V]'"),
        (lambda d: d.replace(b";", b",").replace(b"390.5", b"390,5"), "wrong number of columns", "row 2"),
        (lambda d: d[:-40], "truncated file", "row 31"),
        (lambda d: d.replace(b";12;", b";", 1), "wrong number of columns", "row 2"),
    ],
)
def test_damage_is_named_with_its_place(tmp_path, tum_bytes, damage, what, where):
    (tmp_path / "TripA01.csv").write_bytes(damage(tum_bytes()))
    faults = faults_of(tmp_path)
    assert {f.what for f in faults} == {what}, faults
    assert where in faults[0].where
    assert "TripA01.csv" in faults[0].where
    assert faults[0].allowed or faults[0].fix


def test_all_faults_of_all_files_come_at_once(tmp_path, tum_bytes):
    (tmp_path / "TripA01.csv").write_bytes(
        tum_bytes().replace(b";571;", b";high;").replace(b";21;", b";warm;", 1)
    )
    (tmp_path / "TripA02.csv").write_bytes(b"")
    (tmp_path / "TripA03.csv").write_bytes(tum_bytes())
    (tmp_path / "Overview.xlsx").write_bytes(b"x")
    faults = faults_of(tmp_path)
    places = " ".join(f.where for f in faults)
    assert all(p in places for p in ("Elevation [m]", "Battery Temperature", "TripA02.csv", "Overview.xlsx"))
    assert any("29 more rows" in f.got for f in faults)  # counted, not listed


@given(
    cut=st.integers(0, 3000),
    junk=st.binary(max_size=12),
    at=st.integers(0, 3000),
    remove=st.integers(0, 60),
)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_damage_ends_in_a_fleet_or_in_invalid_input(tmp_path, tum_bytes, cut, junk, at, remove):
    data = tum_bytes()
    data = data[:at] + junk + data[at + remove :]
    (tmp_path / "TripA01.csv").write_bytes(data[: len(data) - cut])
    faults = faults_if_refused(tmp_path)
    assert all("TripA01.csv" in f.where for f in faults)


@given(junk=st.binary(max_size=200), at=st.integers(0, 8000))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_damage_of_the_sheet_ends_in_a_fleet_or_in_invalid_input(
    tmp_path, tum_bytes, write_overview, junk, at
):
    (tmp_path / "TripA01.csv").write_bytes(tum_bytes())
    path = write_overview(tmp_path, [["TripA01", "2019-06-25_13-21-14", "East", "sunny", 23]])
    data = path.read_bytes()
    path.write_bytes(data[:at] + junk + data[at + len(junk) :])
    faults = faults_if_refused(tmp_path)
    assert all("Overview.xlsx" in f.where for f in faults)


def test_datasets_are_known_by_name(tmp_path, tum_bytes):
    (tmp_path / "TripA01.csv").write_bytes(tum_bytes())
    assert read_logs(tmp_path, "tum").name == "tum"
    assert "tum" in DATASETS
    with pytest.raises(InvalidInput, match="unknown data set"):
        read_logs(tmp_path, "nothing")


def test_the_published_files(data_dir):
    fleet = read_tum(Path(data_dir) / "tum")
    assert (len(fleet.trips), sum(map(len, fleet.trips))) == (60, 787_129)
    assert len(fleet.reference_trips()) == len(REFERENCE_TRIPS) == 58
    ended = next(t for t in fleet.reference_trips() if t.trip_id == "TripB28")
    assert ended.array("time_s")[-1] == pytest.approx(1203.9)
    assert not {"TripB02", "TripB34"} & set(REFERENCE_TRIPS)
    assert {t.context.season for t in fleet.trips} == {"summer", "winter"}
    assert all(t.context.weather and t.context.day and t.context.cabin_setpoint_degc for t in fleet.trips)
    payloads = {t.trip_id: t.context.payload_mass_kg for t in fleet.trips if t.context.payload_mass_kg}
    assert payloads["TripB33"] == 160.0
    assert payloads["TripB22"] == 80.0
    assert len(payloads) == 6
    assert {t.trip_id for t in fleet.trips if t.context.follows_trip} == {"TripB16", "TripB17", "TripB28"}
    b34 = next(t for t in fleet.trips if t.trip_id == "TripB34")
    assert b34.observed_energy_wh == pytest.approx(1415, abs=1.0)
