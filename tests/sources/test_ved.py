"""The VED reader: electric cars only, each trip once, units and signs as ours."""

import datetime as dt
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.sources import read_logs
from tripwatt.sources.ved import read_ved
from tripwatt.trips import TripSet
from tripwatt.trips.messages import message

HEADER = (
    "DayNum,VehId,Trip,Timestamp(ms),Latitude[deg],Longitude[deg],Vehicle Speed[km/h],MAF[g/sec],Engine RPM[RPM],"
    "OAT[DegC],Fuel Rate[L/hr],Air Conditioning Power[Watts],Heater Power[Watts],HV Battery Current[A],"
    "HV Battery SOC[%],HV Battery Voltage[V]"
)
LEAF = "1.5,10,{trip},{ms},42.2,-83.7,36.0,,,5.0,,150,2250,-21.5,96.5,386.0"
HYBRID = "2.5,371,7,{ms},42.2,-83.7,36.0,,0,5.0,,150,0,-21.5,96.5,386.0"
COMBUSTION = "2.5,8,9,{ms},42.2,-83.7,36.0,4.1,900,NaN,NaN,,,,,"


def week(*trips):
    rows = [row.format(trip=trip, ms=400 * i) for row, trip in trips for i in range(5)]
    return "\n".join([HEADER, *rows]) + "\n"


def faults_of(folder):
    with pytest.raises(InvalidInput) as caught:
        read_ved(folder, strict=True)
    return caught.value.faults


def test_electric_cars_are_read_and_others_are_counted(tmp_path):
    (tmp_path / "VED_171101_week.csv").write_text(week((LEAF, 1558), (HYBRID, 0), (COMBUSTION, 0)))
    (tmp_path / "VED_171108_week.csv").write_text(week((LEAF.replace("1.5,", "9.25,", 1), 1600)))
    fleet = read_logs(tmp_path, "ved")
    assert [t.trip_id for t in fleet.trips] == ["VED10-1558", "VED10-1600"]
    samples = fleet.trips[0].samples
    assert samples.time_s.tolist() == pytest.approx([0.0, 0.4, 0.8, 1.2, 1.6])
    row = samples.iloc[0].to_dict()
    assert row["speed_m_s"] == pytest.approx(10.0)
    assert row["current_a"] == 21.5  # + discharges
    assert row["soc"] == pytest.approx(0.965)
    assert (row["heating_power_w"], row["aircon_power_w"]) == (2250.0, 150.0)
    assert fleet.trips[1].context.started_at == dt.datetime(2017, 11, 9, 6)
    assert any("2 trips of combustion cars and hybrids" in note for note in map(message, fleet.notes))
    assert any("elevation" in note for note in map(message, fleet.notes))
    assert "Apache-2.0" in fleet.citation


def test_folders_and_files_that_are_none(tmp_path):
    assert faults_of(tmp_path / "nowhere")[0].what == "no such folder"
    assert faults_of(tmp_path)[0].what == "no trips"
    path = tmp_path / "VED_171101_week.csv"
    path.write_text(week((COMBUSTION, 0)))
    assert faults_of(path)[0].what == "not a folder"
    assert faults_of(tmp_path)[0].what == "no trips"
    path.write_text(week((LEAF, 1)).replace("OAT[DegC]", "Outside"))
    (fault,) = faults_of(tmp_path)
    assert fault.what == "missing column"
    assert "'OAT[DegC]'" in fault.allowed
    path.write_text(week((LEAF, 1)).replace("10,1,", "10.5,1,"))
    assert "column 'VehId'" in faults_of(tmp_path)[0].where
    path.write_text(week((LEAF, 1)))
    (tmp_path / "VED_171108_week.csv").write_text(week((LEAF, 1)).replace("-21.5", "oops", 1))
    (fault,) = faults_of(tmp_path)
    assert "row 2 column 'HV Battery Current[A]'" in fault.where
    (tmp_path / "VED_171108_week.csv").write_text(week((LEAF, 1)))
    (fault,) = faults_of(tmp_path)
    assert fault.what == "duplicate trip id"


@given(junk=st.binary(max_size=12), at=st.integers(0, 700), remove=st.integers(0, 60))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_damage_ends_in_a_fleet_or_in_invalid_input(tmp_path, junk, at, remove):
    data = week((LEAF, 1558), (HYBRID, 0)).encode()
    (tmp_path / "VED_171101_week.csv").write_bytes(data[:at] + junk + data[at + remove :])
    try:
        fleet = read_ved(tmp_path)
    except InvalidInput as error:
        fleet = error
    assert isinstance(fleet, TripSet) or fleet.faults


def test_the_published_files(data_dir):
    fleet = read_ved(Path(data_dir) / "ved")
    assert len(fleet.trips) == 211
    assert sum(map(len, fleet.trips)) == 172_484
    assert sum(t.trip_id.startswith("VED541-") for t in fleet.trips) == 10
    days = [t.context.started_at for t in fleet.trips]
    assert days == sorted(days)
    assert fleet.trips[0].context.day == dt.date(2017, 11, 1)
    assert all(0.0 < t.samples.soc.max() <= 1.0 for t in fleet.trips)
    assert sum(t.observed_energy_wh for t in fleet.trips) > 0
