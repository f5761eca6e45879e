"""GPX texts as tracks."""

import numpy as np
import pytest
from tests.routes.made import NO, SPEED, drive, faults_of, gpx

from tripwatt.errors import InvalidInput
from tripwatt.routes import read_gpx, xml_events


def test_a_logged_drive_comes_back_from_gpx():
    track = read_gpx(gpx(drive(SPEED, np.linspace(500.0, 530.0, len(SPEED)))))
    trip = track.plan()
    assert track.is_log
    assert trip.departure.departs_at.hour == 8
    assert trip.distance_m == pytest.approx(float(np.trapezoid(SPEED)), rel=0.01)
    assert np.abs(trip.array("speed_m_s") - SPEED).max() < 1.0
    assert np.all(trip.array("speed_m_s")[138:146] == 0.0)
    assert trip.array("elevation_m")[[0, -1]].tolist() == pytest.approx([500.0, 530.0], abs=0.1)


def gpx_text(first, last='<rtept lat="2" lon="1"/>'):
    return f"<gpx><rte>{first}{last}</rte></gpx>".encode()


def test_a_hundred_characters_of_an_element_are_read():
    """The parser hands over what it has when a piece of more than 8192 characters follows."""
    for zeros, height in ((98, 5.0), (99, 0.0)):
        inside = "0" * zeros + "&#48;" + "5" + " " * 9000
        assert (
            read_gpx(gpx_text(f'<rtept lat="1" lon="1"><ele>{inside}</ele></rtept>')).elevation_m[0] == height
        )


def test_numbers_of_gpx_are_cut_in_messages():
    (fault,) = faults_of(read_gpx, gpx_text(f'<rtept lat="{"x" * 50}" lon="1"/>'))
    assert (fault.where, fault.got) == ("route, point 1, lat", repr("x" * 40))
    assert faults_of(read_gpx, gpx_text('<rtept lat="inf" lon="1"/>'))[0].got == "'inf'"
    (fault,) = faults_of(read_gpx, gpx_text('<rtept lat="1"/>'), where="mine")
    assert (fault.where, fault.got) == ("mine, point 1, lon", "''")
    (fault,) = faults_of(read_gpx, gpx_text('<rtept lat="1" lon="1"><ele>high</ele></rtept>'))
    assert (fault.where, fault.got) == ("route, point 1, ele", "'high'")


def test_an_element_belongs_to_the_point_around_it():
    """Heights and times of extensions, of tracks and of other points are others."""
    inside = "<ele> 7 </ele><x><ele>8</ele><time>never</time></x>"
    found = read_gpx(gpx_text(f'<ele>9</ele><rtept lat="1" lon="1">{inside}</rtept><time>never</time>'))
    np.testing.assert_array_equal(found.elevation_m, [7.0, NO])
    assert found.time_s is None


def test_points_of_the_first_track_alone_are_counted_with_the_others():
    two = '<trkpt lat="1" lon="1"/><trkpt lat="2" lon="1"/>'
    tracks = f"<trk>{two}</trk><trk><trkseg>{two}</trkseg></trk><rte>{two.replace('trkpt', 'rtept')}</rte>"
    found = read_gpx(f"<gpx>{tracks}</gpx>".encode())
    assert [(flag.code, flag.value) for flag in found.flags] == [("first_of_several", 3.0)]
    nested = f"<gpx><trk>{two}<trk/></trk></gpx>"
    assert read_gpx(nested.encode()).flags == ()


def xml(inside: str) -> bytes:
    return f'<gpx version="1.1">{inside}</gpx>'.encode()


def points(tag: str, *places: tuple[float, float], more: str = "") -> str:
    return "".join(f'<{tag} lat="{a}" lon="{b}">{more}</{tag}>' for a, b in places)


class TestGpx:
    def test_the_first_track_of_two_points_before_any_route(self) -> None:
        route = f"<rte>{points('rtept', (10, 1), (11, 2))}</rte>"
        alone = f"<trk><trkseg>{points('trkpt', (20, 1))}</trkseg></trk>"
        two = f"<trk><trkseg>{points('trkpt', (30, 1))}</trkseg><trkseg>{points('trkpt', (31, 2))}</trkseg></trk>"
        found = read_gpx(xml(route + alone + two))
        assert found.latitude_deg.tolist() == [30.0, 31.0]
        assert found.longitude_deg.tolist() == [1.0, 2.0]
        assert np.isnan(found.piece_speed_m_s).tolist() == [True]
        (flag,) = found.flags
        assert flag.value == 2
        assert read_gpx(xml(route)).flags == ()
        assert read_gpx(xml(route + alone)).latitude_deg.tolist() == [10.0, 11.0]

    def test_heights_and_times(self) -> None:
        inside = "<ele> 520.5 </ele><time>2026-05-01T08:00:0{}Z</time>"
        rows = "".join(points("trkpt", (48 + k, 11), more=inside.format(k)) for k in range(2))
        other = "<extensions><ele>9</ele></extensions>"
        found = read_gpx(
            xml(f"<trk>{other}<trkseg>{rows}{points('trkpt', (50, 11), more=other)}</trkseg></trk>")
        )
        assert found.elevation_m[:2].tolist() == [520.5, 520.5]
        assert np.isnan(found.elevation_m[2])
        assert found.time_s is None
        assert [f.code for f in found.flags] == ["times_ignored"]

    def test_names_with_a_prefix(self) -> None:
        text = f'<g:gpx xmlns:g="x"><g:rte>{points("g:rtept", (1, 1), (2, 2))}</g:rte></g:gpx>'
        assert len(read_gpx(text.encode())) == 2

    def test_points_outside_of_tracks_do_not_count(self) -> None:
        strange = f"<other><trk>{points('trkpt', (7, 1), (8, 2))}</trk></other>"
        found = read_gpx(xml(f"{strange}<rte>{points('rtept', (1, 1), (2, 2))}</rte>"))
        assert found.latitude_deg.tolist() == [1.0, 2.0]
        with pytest.raises(InvalidInput, match="a trk or rte of two points"):
            read_gpx(xml(strange))

    def test_depth(self) -> None:
        """64 levels with <gpx>."""
        route = f"<rte>{points('rtept', (1, 1), (2, 2))}</rte>"
        assert len(read_gpx(xml("<a>" * 63 + "</a>" * 63 + route))) == 2
        with pytest.raises(InvalidInput, match="got 65 levels; allowed: at most 64"):
            read_gpx(xml("<a>" * 64 + "</a>" * 64 + route))

    def test_number_of_points(self, monkeypatch) -> None:
        monkeypatch.setattr(xml_events, "MAX_POINTS", 2)
        assert len(read_gpx(xml(f"<rte>{points('rtept', (1, 1), (2, 2))}</rte>"))) == 2
        with pytest.raises(InvalidInput, match="more than 2"):
            read_gpx(xml(f"<rte>{points('rtept', (1, 1), (2, 2), (3, 3))}</rte>"))


@pytest.mark.parametrize("void", ["NaN", "nan", "-32768", "-9999", "32767", ""])
def test_a_height_of_no_place_is_not_known(void: str) -> None:
    ends = (
        '<trkpt lat="48" lon="11"><ele>520</ele></trkpt>{}<trkpt lat="48.2" lon="11"><ele>540</ele></trkpt>'
    )
    middle = f'<trkpt lat="48.1" lon="11"><ele>{void}</ele></trkpt>'
    track = read_gpx(f"<gpx><trk><trkseg>{ends.format(middle)}</trkseg></trk></gpx>".encode())
    assert track.elevation()[1].tolist() == [520.0, 540.0]
    assert [flag.code for flag in track.elevation()[2]] == ["elevation_interpolated"]
