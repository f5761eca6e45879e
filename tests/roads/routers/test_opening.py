"""Kinds of routers by URL."""

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.roads.routers import is_server, open_server, split_kind


def test_kinds_of_servers(tmp_path, monkeypatch):
    kinds = {"first": 1, "other": 2}
    assert split_kind("other=http://h/", kinds, "x") == ("other", "http://h")
    assert split_kind("http://h/", kinds, "x") == ("first", "http://h")
    for text in ("third=http://h", "h", "=http://h"):
        with pytest.raises(InvalidInput):
            split_kind(text, kinds, "x")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a:").mkdir()
    (tmp_path / "a:" / "map").mkdir()
    assert not is_server("a://map")
    assert is_server("a://other")


def test_a_server_is_named_by_kind_and_url():
    assert open_server("http://h:8002").name == "valhalla at h:8002"
    assert open_server("graphhopper=https://h/api").name == "graphhopper at h"
    assert open_server("openrouteservice=https://h").client.base_url == "https://h"
    with pytest.raises(
        InvalidInput, match="unknown kind of server: --router: got google; allowed: valhalla, osrm"
    ):
        open_server("google=http://h")
    assert split_kind("http://h/a=b", {"x": 1}, "w") == ("x", "http://h/a=b")
