"""Links in a CSV table, and every fault of one."""

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes import link_objects, link_table, parse_route, route_from_links
from tripwatt.routes.link_table import is_links_table, route_from_table

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
        for module in (link_table, link_objects):
            monkeypatch.setattr(module, "MAX_LINKS", 3)
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
