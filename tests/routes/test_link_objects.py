"""Links as a user writes them, and every fault of them."""

import json
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.routes.made import TO_ROUNDING
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.physics import simulate_trip
from tripwatt.routes import LinkRoute, link_objects, parse_route, route_from_links
from tripwatt.routes.link_objects import (
    LINK_KEYS,
    columns_of_links,
    fields_of_route,
    is_links_table,
    route_from_table,
    route_with_elevation,
)
from tripwatt.trips import Flag
from tripwatt.units import GRAVITY_M_S2, WH_PER_J
from tripwatt.vehicles import load_vehicle


@pytest.mark.parametrize("grade", [0.3, -0.3, 0.4])
def test_a_steep_link_climbs_as_given(grade):
    """Streets of 0.3 exist; a link that no street has is refused."""
    flat = {"length_m": 500.0, "speed_m_s": 8.0, "grade": 0.0}
    plan = route_from_links([flat, {"length_m": 1900.0, "speed_m_s": 8.0, "grade": grade}]).plan()
    car = load_vehicle("bmw_i3_60ah")
    climb = simulate_trip(car, plan).by_cause_wh["climb"]
    expected = car.body.test_mass_kg * GRAVITY_M_S2 * grade * 1900.0 * WH_PER_J
    assert climb == pytest.approx(expected, rel=1e-3)
    with pytest.raises(
        InvalidInput, match=r"grade out of range: link 1, grade: got 0.45; allowed: -0.4 to 0.4"
    ):
        route_from_links([{"length_m": 100.0, "speed_m_s": 8.0, "grade": 0.45}])


def test_every_fault_of_the_links_at_once():
    with pytest.raises(InvalidInput) as caught:
        route_from_links(
            [
                {"length_m": 0.0, "speed_m_s": 10.0},
                {"length_m": 100.0, "speed_m_s": 10.0, "travel_time_s": 10.0},
                {"length_m": 100.0, "speed_m_s": 10.0, "grade": 3.0},
                {"length_m": 100.0, "speed_m_s": 10.0, "colour": 1.0},
                {"length_m": float("inf"), "speed_m_s": 10.0},
                {"length_m": 10**400, "speed_m_s": 10.0},
                {"length_m": True, "speed_m_s": 10.0},
            ]
        )
    said = [fault.where for fault in caught.value.faults]
    assert [f"link {k}" in " ".join(said) for k in range(1, 8)] == [True] * 7
    refuses("at most 70", route_from_links, [{"length_m": 1000.0, "speed_m_s": 100.0}])
    refuses("takes too long", route_from_links, [{"length_m": 1000.0, "speed_m_s": 0.001}])


def test_links_come_as_json_too():
    links = [{"length_m": 500.0, "speed_m_s": 10.0}]
    for document in (links, {"links": links}):
        route = parse_route(json.dumps(document).encode())
        assert isinstance(route, LinkRoute)
        assert route.duration_s == 50.0


@given(
    st.lists(
        st.dictionaries(
            st.sampled_from(sorted(LINK_KEYS)),
            st.sampled_from(
                [None, -1.0, 0, 0.0, 0.3, 0.5, 5, 9.5, 50.0, 1e400, 10**400, math.nan, True, "5"]
            ),
            max_size=6,
        ),
        max_size=4,
    )
)
def test_columns_of_links_are_those_of_the_links_one_by_one(links: list[dict[str, Any]]) -> None:
    """A look at all links at once takes what a look at each takes, to the same values, and nothing else."""
    if not links:
        return
    columns, faults = columns_of_links(links)
    alone = [columns_of_links([link]) for link in links]
    assert bool(faults) == any(its_faults for _, its_faults in alone)
    for name, values in columns.items():
        assert values.tobytes() == np.concatenate([its_columns[name] for its_columns, _ in alone]).tobytes()


LINK = {"length_m": 100.0, "speed_m_s": 10.0}


@pytest.mark.parametrize(
    ("change", "sound"),
    [
        ({"grade": 0.4}, True),
        ({"grade": -0.4}, True),
        ({"grade": 0.41}, False),
        ({"grade": -0.41}, False),
        ({"length_m": 0.0}, False),
        ({"speed_m_s": 0.0}, False),
        ({"speed_m_s": None, "travel_time_s": 0.0}, False),
        ({"speed_m_s": None, "travel_time_s": 0.5, "stop_s": 0.25}, False),
        ({"speed_m_s": None, "travel_time_s": 5.0}, True),
        ({"travel_time_s": 5.0}, False),
        ({"speed_m_s": None}, False),
        ({"length_m": None}, False),
        ({"start_elevation_m": 5.0}, False),
        ({"end_elevation_m": 5.0}, False),
        ({"start_elevation_m": 5.0, "end_elevation_m": 6.0}, True),
        ({"start_elevation_m": 5.0, "end_elevation_m": 6.0, "grade": 0.01}, False),
        ({"start_elevation_m": 5.0, "grade": 0.01}, False),
    ],
)
def test_a_link_is_sound_or_refused(change, sound):
    given = [LINK, {**LINK, **change}]
    columns, faults = columns_of_links(given)
    assert len(columns["length_m"]) == 2
    assert bool(faults) != (sound or change.get("travel_time_s") == 0.5)
    if sound:
        assert len(route_from_links(given)) == 2
        return
    with pytest.raises(InvalidInput):
        route_from_links(given)


def faults_of_links(links):
    with pytest.raises(InvalidInput) as caught:
        route_from_links(links)
    return [str(fault) for fault in caught.value.faults]


def test_three_alike_faults_are_named_and_more_are_counted():
    found = faults_of_links([LINK, *[{**LINK, "colour": 1.0}] * 3])
    assert [
        f"unknown key: link {k}: got 'colour'" in text for k, text in zip((2, 3, 4), found, strict=True)
    ] == [True] * 3
    (counted,) = faults_of_links([LINK, *[{**LINK, "colour": 1.0}] * 4])
    assert "link 2: got 'colour' (and 3 more links);" in counted
    found = faults_of_links([{**LINK, "colour": 1.0, "length_m": -1.0}] * 50)
    assert [text.partition(":")[0] for text in found] == ["unknown key", "link out of range"]


def test_fifty_faults_are_named_and_the_rest_counted():
    def faults(n):
        return faults_of_links([{**LINK, **{f"c{k}": 1.0 for k in range(n)}}])

    assert len(faults(50)) == 50
    assert (len(faults(51)), faults(51)[-1].partition(";")[0]) == (51, "unknown key: links: got 1 more")
    assert (len(faults(53)), faults(53)[-1].partition(";")[0]) == (51, "unknown key: links: got 3 more")


def test_a_table_of_links_is_its_rows():
    rows = [{**LINK, "stop_s": 5.0}, LINK]
    by_rows, by_table = route_from_links(rows), route_from_links(pd.DataFrame(rows))
    for name in ("length_m", "travel_time_s", "stop_s"):
        np.testing.assert_array_equal(getattr(by_table, name), getattr(by_rows, name))
    with pytest.raises(InvalidInput, match="not a number: link 2, length_m: got 'far'"):
        route_from_links(pd.DataFrame([LINK, {**LINK, "length_m": "far"}]))


def test_too_many_links_are_refused_before_they_are_read(monkeypatch):
    monkeypatch.setattr(link_objects, "MAX_LINKS", 3)
    assert len(route_from_links([LINK] * 3)) == 3
    refuses("too many links", route_from_links, (LINK for _ in range(4)))
    refuses("no links", route_from_links, [])


def test_heights_of_links():
    by_grade = route_from_links([{**LINK, "grade": 0.02}, LINK, {**LINK, "length_m": 300.0, "grade": -0.01}])
    assert by_grade.elevation_position_m.tolist() == [0.0, 100.0, 200.0, 500.0]
    np.testing.assert_allclose(
        by_grade.elevation_m, [1.0, 3.0, 3.0, 0.0], **TO_ROUNDING
    )  # above the lowest place
    assert by_grade.flags == (Flag("elevation_relative", "road"),)
    ends = {"start_elevation_m": 5.0, "end_elevation_m": 7.0}
    known = route_from_links(
        [{**LINK, **ends}, LINK, {**LINK, "start_elevation_m": 9.0, "end_elevation_m": 1.0}]
    )
    assert known.elevation_position_m.tolist() == [0.0, 100.0, 200.0, 300.0]
    assert known.elevation_m.tolist() == [5.0, 7.0, 9.0, 1.0]
    assert known.flags == (Flag("elevation_interpolated", "links"),)
    assert route_from_links([{**LINK, **ends}]).flags == ()
    refuses("grade and elevation mixed", route_from_links, [{**LINK, **ends}, {**LINK, "grade": 0.01}])
    assert route_from_links([LINK]).elevation_m is None


def test_values_that_are_no_numbers_are_named_once():
    with pytest.raises(InvalidInput) as caught:
        route_from_links([{"length_m": "x", "speed_m_s": "y", "grade": "z", "stop_s": float("inf")}])
    assert [f.what for f in caught.value.faults] == ["not a number"] * 3 + ["not a finite number"]


@pytest.mark.parametrize("name", ["grade", "stop_s", "length_m", "speed_m_s", "moving_speed_m_s"])
def test_an_endless_value_is_one_fault(name):
    with pytest.raises(InvalidInput) as caught:
        route_from_links([{**LINK, name: float("inf")}])
    assert [str(fault) for fault in caught.value.faults] == [
        f"not a finite number: link 1, {name}: got inf; allowed: a finite number"
    ]


def test_links_leave_out_what_is_not_known() -> None:
    route = route_from_links(
        [
            {"length_m": 100.0, "speed_m_s": 10.0, "speed_limit_m_s": 14.0, "stop_s": 2.0},
            {"length_m": 50.0, "travel_time_s": 5.0},
        ]
    )
    first, second = fields_of_route(route)["links"]
    assert (first["length_m"], first["stop_s"], first["speed_limit_m_s"]) == (100.0, 2.0, 14.0)
    assert (second["length_m"], second["travel_time_s"]) == (50.0, 5.0)
    assert "speed_limit_m_s" not in second
    assert all(value == value for link in (first, second) for value in link.values())


def test_the_fields_of_a_route_give_it_again() -> None:
    links = [
        {"length_m": 100.0, "speed_m_s": 10.0, "grade": 0.03},
        {"length_m": 50.0, "travel_time_s": 5.0, "grade": 0.0},
    ]
    route = route_from_links(links)
    fields = fields_of_route(route)
    again = route_with_elevation(route_from_links(fields["links"]), **fields["elevation"])
    for name in (
        "length_m",
        "travel_time_s",
        "stop_s",
        "moving_speed_m_s",
        "elevation_m",
        "elevation_position_m",
    ):
        assert np.array_equal(getattr(again, name), getattr(route, name), equal_nan=True), name
    assert "no_elevation" not in {flag.code for flag in again.flags}


TABLE = "length_m;speed_m_s;grade;stop_s\n500;10,5;0,01;\n\n250;5;;20\n"


def test_links_come_as_csv_too(tmp_path):
    objects = route_from_links(
        [{"length_m": 500, "speed_m_s": 10.5, "grade": 0.01}, {"length_m": 250, "speed_m_s": 5, "stop_s": 20}]
    )
    for text in (
        TABLE,
        TABLE.replace(",", ".").replace(";", ","),
        TABLE.replace(";", "\t").replace("\n", "\r\n"),
        TABLE.replace(";", "|"),
    ):
        (tmp_path / "route.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
        route = parse_route(tmp_path / "route.csv")
        for name in ("length_m", "travel_time_s", "stop_s", "elevation_m"):
            np.testing.assert_array_equal(getattr(route, name), getattr(objects, name))


def test_every_fault_of_a_table_at_once():
    with pytest.raises(InvalidInput) as caught:
        parse_route(b"length_km,speed_km_h,colour\n1,50,red\n")
    said = str(caught.value)
    assert "did you mean length_m?" in said
    assert "did you mean speed_m_s?" in said
    assert "'colour'" in said
    assert said.count("missing column") == 2
    with pytest.raises(InvalidInput) as caught:
        parse_route(b"length_m,speed_m_s,grade\nx,9,0\n5,-9,7\n,nan,0\n8,9,0,1\n")
    said = str(caught.value)
    for words in ("link 1, length_m: got 'x'", "link 2, speed_m_s", "link 2, grade", "missing key: route, link 3",
                  "link 3, speed_m_s: got nan", "too many cells"):  # fmt: skip
        assert words in said
    assert "missing key: route, link 1" not in said
    with pytest.raises(InvalidInput) as caught:
        parse_route(b"length_m,speed_m_s\n" + b"0,0\n" * 20_000)
    assert len(caught.value.faults) == 2
    assert "(and 19999 more links)" in str(caught.value.faults[-1])


class TestTable:
    def test_headers(self) -> None:
        assert is_links_table(b"a;length_m\n1;2")
        assert not is_links_table(b"length_m;time_s\n")
        assert not is_links_table(b"a;b\n")
        assert all(map(is_links_table, (b"km,speed\n", b"speed,Distance [km]\n")))
        assert not any(map(is_links_table, (b"km_h,v\n", b"km,time\n", b"datum,km2\n")))
        assert is_links_table(b"x" * 3993 + b",length_m\n")  # the word ends with the 4000th byte
        assert not is_links_table(b"x" * 3994 + b",length_m\n")

    def test_cells(self) -> None:
        made = route_from_table(b'"Length_M" ; speed_m_s;stop_s\n1000,5;10;\n\n;;\n500;5;20\n')
        assert made.length_m.tolist() == [1000.5, 500.0]
        assert made.travel_time_s.tolist() == [100.05, 100.0]  # of which 20 s stand
        tabs = route_from_table(b"length_m\tspeed_m_s\n1000,5\t10\n")
        assert tabs.length_m.tolist() == [1000.5]
        assert route_from_table(b"length_m,travel_time_s\n1000.5,50").travel_time_s.tolist() == [50.0]

    def faults(self, text: bytes) -> list[str]:
        with pytest.raises(InvalidInput) as caught:
            route_from_table(text)
        return [str(fault) for fault in caught.value.faults]

    def test_bytes_that_are_no_text(self) -> None:
        assert self.faults(b"length_m,speed_m_s\n\xff,5\n")[0].startswith("not a table")

    def test_the_first_line_alone_is_the_header(self) -> None:
        assert is_links_table(b"length_m,name\n5,time of day\n")
        assert not is_links_table(b"name,speed\nlength_m,time\n")
        assert not is_links_table(b"length_m,time_s\n5,6\n")
        assert is_links_table(b"\xef\xbb\xbf LENGTH \t b")
        assert len(route_from_table(b"length_m,speed_m_s\n5,6\n").length_m) == 1

    def test_so_many_links_are_read(self, monkeypatch) -> None:
        """Empty lines do not count."""
        monkeypatch.setattr(link_objects, "MAX_LINKS", 3)
        head, row = b"length_m,speed_m_s\n", b"500,5\n"
        assert len(route_from_table(head + b"\n,\n" + row + b"\n" + row * 2)) == 3
        assert self.faults(head + row * 4)[0].startswith("too many links: links: got more than 3")
        assert self.faults(head + b"\n\n\n" + row * 4)[0].startswith("too many links")
        assert len(self.faults(head + row * 3 + b"x,5\n")) == 2

    def test_fifty_unknown_columns_are_named_and_ten_have_hints(self) -> None:
        names = [f"length_{k}_m" for k in range(52)]
        found = self.faults(",".join(["length_m", "speed_m_s", *names]).encode() + b"\n5,5\n")
        assert [f.split(":")[0] for f in found] == ["unknown column"] * 51
        assert found[-1].startswith("unknown column: links: got 2 more; ")
        assert ["did you mean" in f for f in found] == [True] * 10 + [False] * 41

    def test_words_of_a_header_are_cut(self) -> None:
        found = self.faults(f"length_m,speed_m_s,{'c' * 80}\n5,5\n".encode())
        assert f"links, column '{'c' * 60}': got {'c' * 60}; " in found[0]
        missing = self.faults(f"speed_m_s,{'c' * 200}\n5,5\n".encode())
        assert f"got speed_m_s, {'c' * 109}; allowed: length_m" in missing[1]
        neither = self.faults(f"length_m,{'c' * 200}\n5,5\n".encode())
        assert f"got length_m, {'c' * 110}; allowed: speed_m_s or travel_time_s" in neither[1]

    def test_fifty_rows_with_too_many_cells_are_named(self) -> None:
        for number, faults in ((50, 50), (53, 51)):
            found = self.faults(b"length_m,speed_m_s\n" + b"5,5,5\n" * number)
            assert len(found) == faults
            assert found[0].startswith("too many cells: links, link 1: got 3")
        assert found[-1] == "further faults: links: got 3 more"
