"""XML texts: their root, their depth, their bounds."""

from tests.routes.made import faults_of

from tripwatt.routes import read_gpx, read_kml, xml_events
from tripwatt.routes.xml_events import root_name


def test_the_root_begins_within_its_first_bytes():
    assert xml_events.ROOT_BYTES == 65_536
    for spaces, root in ((65_536 - 5, "gpx"), (65_536 - 4, "")):
        assert root_name(b"<!--" + b" " * (spaces - 7) + b"-->" + b"<gpx>") == root
    assert root_name(b"<a:b:kml/>") == "kml"


def test_a_level_of_xml_ends_with_its_element():
    wide = b"<gpx>" + b"<a><b/></a>" * 70
    route = b'<rte><rtept lat="1" lon="1"/><rtept lat="2" lon="1"/></rte></gpx>'
    assert len(read_gpx(wide + route)) == 2


def test_the_root_of_another_format_is_cut():
    (fault,) = faults_of(read_kml, b"<" + b"x" * 50 + b"/>")
    assert (fault.what, fault.got, fault.allowed) == ("not KML", f"<{'x' * 40}>", "<kml>")
    (fault,) = faults_of(read_gpx, b'<?xml version="1.0" encoding="' + b"e" * 200 + b'"?><gpx/>')
    assert fault.what == "not well-formed XML"
    assert len(fault.got) <= 120
