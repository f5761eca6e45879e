"""Charging stations: of a file, near a line, inside of bounds."""

import os

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.roads.journey.charging import AMERICAN, EUROPEAN
from tripwatt.roads.maps import stations
from tripwatt.roads.maps.stations import HOUSEHOLD, PLUG_KINDS, Plug, Station, near, read_stations, within
from tripwatt.routes.places import Place

DEGREE_M = 111_195.0797343687
"""Of a great circle of the mean earth."""


def table(path, *rows, header="latitude_deg,longitude_deg,power_kw"):
    path.write_text("\n".join((header, *rows)) + "\n")
    return path


def test_bounds_of_a_file_of_stations(tmp_path):
    path = tmp_path / "s.csv"
    assert read_stations(table(path, "90,180,1500", "-90,-180,1")) == (
        Station(90.0, 180.0, "", 1_500_000.0, direct_current=True),
        Station(-90.0, -180.0, "", 1000.0),
    )
    for row in ("90.1,0,50", "-90.1,0,50", "0,180.1,50", "0,-180.1,50", "0,0,0.9", "0,0,1500.1", "0,,50"):
        with pytest.raises(InvalidInput, match=r"value out of range: s\.csv, column '.*', row 2"):
            read_stations(table(path, "0,0,50", row, row))


def test_direct_current_begins_at_43_001_watts(tmp_path):
    found = read_stations(table(tmp_path / "s.csv", "0,0,43", "0,0,43.001"))
    assert [(s.power_w, s.direct_current, s.power_known) for s in found] == [
        (43_000.0, False, True),
        (43_001.0, True, True),
    ]


def test_the_most_stations_of_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr(stations, "MAX_STATIONS", 2)
    path = table(tmp_path / "s.csv", "0,0,50", "0,0,50")
    assert len(read_stations(path)) == 2
    with pytest.raises(InvalidInput, match=r"too many stations: s.csv: got 3; allowed: at most 2"):
        read_stations(table(path, *["0,0,50"] * 5))


@pytest.mark.parametrize("cell", ["0101000020E610000000289516", "1" * 400_000, "9e99999999", "0x10", "nan"])
def test_what_is_no_number_is_a_fault_and_no_crash(tmp_path, cell):
    """A hexadecimal geometry ended the interpreter in the float parser of pandas."""
    for row in (f"{cell},0,50", f"0,0,{cell}"):
        with pytest.raises(InvalidInput, match=r"value out of range|cannot read") as caught:
            read_stations(table(tmp_path / "s.csv", row))
        assert len(caught.value.faults[0].got) <= 80


def test_a_device_or_pipe_is_no_file_of_stations(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in ("/dev/zero", pipe):
        with pytest.raises(InvalidInput, match="cannot read the stations"):
            read_stations(path)


def test_a_station_is_near_up_to_a_distance():
    """The straight line through the earth: a degree of 111 195 m has a chord that is 1.4 m shorter."""
    north = [Station(48.0, 9.0, "a", 5e4)]
    assert near(north, [Place(47.0, 9.0)], DEGREE_M - 1.0) == [(0, 0)]
    assert near(north, [Place(47.0, 9.0)], DEGREE_M - 2.0) == []
    east = [Station(0.0, 10.0, "a", 5e4)]
    assert near(east, [Place(0.0, 9.0)], DEGREE_M - 1.0) == [(0, 0)]
    assert near(east, [Place(0.0, 9.0)], DEGREE_M - 2.0) == []
    polar = [Station(60.0, 10.0, "a", 5e4)]
    assert near(polar, [Place(60.0, 9.0)], 0.5 * DEGREE_M) == [(0, 0)]
    assert near(polar, [Place(60.0, 9.0)], 0.5 * DEGREE_M - 5.0) == []


def test_stations_inside_of_bounds_those_with_power_first():
    made = [
        Station(47.0, 9.0, "slow", 11e3),
        Station(47.2, 9.2, "fast", 150e3),
        Station(47.1, 9.3, "far", 5e4),
    ]
    found = lambda *bounds, limit=9: [s.name for s in within(made, *bounds, limit)]  # noqa: E731
    assert found(47.0, 9.0, 47.2, 9.2) == ["fast", "slow"]
    assert found(47.0, 9.0, 47.2, 9.3, limit=2) == ["fast", "far"]
    assert found(47.01, 9.0, 47.19, 9.2) == found(46.0, 9.4, 48.0, 9.5) == []


def test_stations_near_a_line_in_its_order():
    stations = [Station(47.0, 9.05, "c", 5e4), Station(47.0, 9.0, "a", 5e4), Station(47.1, 9.0, "far", 5e4)]
    line = [Place(47.0, 9.0), Place(47.0, 9.02), Place(47.0, 9.05)]
    assert near(stations, line, 100.0) == [(1, 0), (0, 2)]
    assert near(stations, line, 12_000.0) == [(1, 0), (2, 0), (0, 2)]
    assert near([], line, 100.0) == near(stations, [], 100.0) == []


def test_a_file_of_stations(tmp_path):
    path = tmp_path / "stations.csv"
    path.write_text("name,latitude_deg,longitude_deg,power_kw\nA,47.0,9.0,150\n,47.1,9.1,43\nC,47.1,9.1,44\n")
    assert read_stations(path) == (
        Station(47.0, 9.0, "A", 150_000.0, direct_current=True),
        Station(47.1, 9.1, "", 43_000.0),
        Station(47.1, 9.1, "C", 44_000.0, direct_current=True),
    )
    path.write_text("latitude_deg,longitude_deg,power_kw\n47.0,9.0,22\n")
    assert read_stations(path)[0].name == ""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("latitude_deg,power_kw\n1,2\n", "missing column: stations.csv: got longitude_deg"),
        (
            "latitude_deg,longitude_deg,power_kw\n91,9,150\n47,181,x\n",
            "value out of range: stations.csv, column 'latitude_deg', row 1: got '91'; allowed: -90 to 90\n"
            "value out of range: stations.csv, column 'longitude_deg', row 2: got '181'; allowed: -180 to 180\n"
            "value out of range: stations.csv, column 'power_kw', row 2: got 'x'; allowed: 1 to 1500",
        ),
        ("", "missing column: stations.csv: got latitude_deg, longitude_deg, power_kw"),
    ],
)
def test_every_fault_of_a_file_of_stations_is_named(tmp_path, text, message):
    (tmp_path / "stations.csv").write_text(text)
    with pytest.raises(InvalidInput) as caught:
        read_stations(tmp_path / "stations.csv")
    assert message in str(caught.value)


def test_a_car_has_the_power_of_its_own_plug():
    plugs = (Plug("type2_combo", 50e3), Plug("chademo", 100e3), Plug("type2", 22e3, power_known=False))
    station = Station.with_plugs(47.0, 9.0, "", *plugs)
    used = {car: station.usable_with({car}) for car in ("type2_combo", "chademo", "type2", "type1")}
    assert used.pop("type1") is None
    assert [(s.power_w, s.plug, s.direct_current, s.power_known) for s in used.values()] == [
        (50e3, "type2_combo", True, True),
        (100e3, "chademo", True, True),
        (22e3, "type2", False, False),
    ]
    assert all(s.plugs == plugs for s in used.values())
    assert station.usable_with(frozenset()) == station
    unknown = Station(47.0, 9.0, "", 5e4)
    assert unknown.usable_with({"type1"}) is unknown


def test_a_car_uses_the_plug_with_which_it_charges_fastest():
    """A car that takes 43 kW with alternating current and 20 kW with direct current, or 7 kW and 100 kW."""
    station = Station.with_plugs(47.0, 9.0, "", Plug("type2_combo", 50e3), Plug("type2", 43e3))
    both = {"type2", "type2_combo"}
    assert [station.usable_with(both, most).plug for most in ((43e3, 20e3), (7e3, 100e3))] == [
        "type2",
        "type2_combo",
    ]


def test_every_plug_of_a_car_has_a_kind():
    assert {*PLUG_KINDS} >= EUROPEAN | AMERICAN
    assert {*PLUG_KINDS} >= HOUSEHOLD
