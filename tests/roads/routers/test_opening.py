"""Kinds of routers by URL."""

import pytest

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.routers import is_server, open_server, split_kind
from tripwatt.routes.places import Place


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
    with pytest.raises(RemoteError, match=r"127\.0\.0\.1:1"):
        open_server("http://127.0.0.1:1").outline(Place(47.0, 9.0), 10.0)
    graphhopper = open_server("graphhopper=https://h/api")
    assert (graphhopper.kind, graphhopper.client.host) == ("graphhopper", "h")
    assert open_server("openrouteservice=https://h").client.base_url == "https://h"
    with pytest.raises(
        InvalidInput, match="unknown kind of server: --router: got google; allowed: valhalla, osrm"
    ):
        open_server("google=http://h")
    assert split_kind("http://h/a=b", {"x": 1}, "w") == ("x", "http://h/a=b")
