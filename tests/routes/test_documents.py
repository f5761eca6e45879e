"""Bytes and JSON from outside: how much is read, and what messages quote."""

import numpy as np
import pytest
from tests.routes.made import NO, TO_ROUNDING, faults_of
from tests.support.refusals import refusal, refuses

from tripwatt.errors import InvalidInput
from tripwatt.routes import documents, points
from tripwatt.routes.documents import Node, intervals, parse_json, read_content, speeds_at_points


def test_the_most_bytes_and_points_of_a_route(monkeypatch, tmp_path):
    refuses("cannot read", read_content, tmp_path / "none.gpx")
    monkeypatch.setattr(documents, "MAX_BYTES", 4)
    (tmp_path / "four").write_bytes(b"1234")
    (tmp_path / "five").write_bytes(b"12345")
    assert read_content(b"1234") == (b"1234", "route")
    assert read_content(tmp_path / "four") == (b"1234", "four")
    for source in (b"12345", tmp_path / "five"):
        refuses("too large", read_content, source)


def test_numbers_and_lists_of_json():
    assert Node(2, "t").number(minimum=2.0) == 2.0
    for value in (1.9, True, "2", None, float("inf"), 10**400):
        refuses("2 or more", Node(value, "t").number, minimum=2.0)
    with pytest.raises(InvalidInput, match=f"got {10**59};"):
        Node(10**400, "t").entries()
    assert [entry.value for entry in Node([1], "t").entries(min_count=1)] == [1]
    refuses("too few entries", Node([], "t").entries, min_count=1)
    assert Node({}, "t").members() == {}


def test_positions_of_geojson():
    found = Node([[11.0, 48.0], [12.0, 49.0, None], [13.0, 50.0, 500.0]], "t").coordinates()
    np.testing.assert_array_equal(found, [[48.0, 11.0, NO], [49.0, 12.0, NO], [50.0, 13.0, 500.0]])
    np.testing.assert_array_equal(Node([[1, 2, 3, 4], [1, 2]], "t").coordinates()[0], [2.0, 1.0, 3.0])
    for wrong in ([[11.0, 48.0]], [[11.0], [12.0, 49.0]]):
        refuses("at least 2", Node(wrong, "t").coordinates)
    assert refusal(Node(5, "t").coordinates).startswith("not a list: t: got 5")
    for k, (wrong, name) in enumerate((([0, 91], "latitude"), ([181, 0], "longitude"))):
        places = [[0, 0], [0, 0]]
        places[k] = wrong
        assert name in refusal(Node(places, "t").coordinates)
    for wrong, where in (([[1, 2], [1, "x"]], "t[1][1]"), ([[1, 2], [1, 2, "x"]], "t[1][2]")):
        assert faults_of(Node(wrong, "t").coordinates)[0].where == where


def test_the_most_positions(monkeypatch):
    monkeypatch.setattr(points, "MAX_POINTS", 2)
    assert len(Node([[1, 2]] * 2, "t").coordinates()) == 2
    found = refusal(Node([[1, 2], [1, 2], "none"], "t").coordinates)
    assert found == "too many points: t: got 3; allowed: at most 2"
    assert points.require_on_earth(np.zeros(2), np.zeros(2), "t") is None
    assert faults_of(points.require_on_earth, np.zeros(3), np.zeros(3), "t")[0].got == "3"


def test_lists_of_numbers():
    assert Node([1, 2.5], "t").numbers(minimum=1.0).tolist() == [1.0, 2.5]
    assert faults_of(Node([1, 0.9], "t").numbers, minimum=1.0)[0].where == "t[1]"
    assert Node(-5, "t").number() == -5.0
    assert faults_of(Node(NO, "t").number)[0].allowed == "a finite number"
    assert faults_of(Node("x", "t").number, minimum=0)[0].allowed == "a finite number, 0 or more"
    assert faults_of(Node([1, 2, 3], "t").members)[0].got == "[1, 2, 3]"
    assert faults_of(Node({"a": 1, "b": 2}, "t").entries)[0].got == "{'a': 1, 'b': 2}"
    assert faults_of(Node(True, "t").entries)[0].got == "True"


def test_what_is_no_json_is_cut_in_messages():
    (fault,) = faults_of(parse_json, b"[" * 100_000, "t")
    assert fault.got == "nested too deeply"
    (fault,) = faults_of(parse_json, b"NaN", "t")
    assert fault.got == "NaN is no JSON number"
    assert len(faults_of(parse_json, b"\xff" * 9, "t")[0].got) <= 120
    assert parse_json(b"[1e3]", "t") == [1000.0]


def test_intervals_of_points():
    found = intervals(Node([[0, 2, 5.0], [2, 2, None]], "t"), 3)
    assert [(start, end, value.value) for start, end, value in found] == [(0, 2, 5.0), (2, 2, None)]
    for wrong in ([0, 3, 5.0], [2, 1, 5.0], [0.5, 1, 5.0], [0, 1.5, 5.0]):
        with pytest.raises(InvalidInput, match="point index out of range"):
            [v.number(minimum=0.0) for _, _, v in intervals(Node([wrong], "t"), 3)]
    for wrong in ([0, 1], [-1, 1, 5.0], [0, 1, -5.0]):
        with pytest.raises(InvalidInput):
            [v.number(minimum=0.0) for _, _, v in intervals(Node([wrong], "t"), 3)]


def test_speeds_of_intervals():
    found = speeds_at_points(Node([[0, 2, 36.0], [2, 2, 72.0], [3, 4, 0.0]], "t"), 5)
    np.testing.assert_allclose(found, [10.0, 10.0, 20.0, NO, NO], **TO_ROUNDING)
    assert np.isnan(speeds_at_points(Node(None, "t"), 2)).all()
