"""Limits of the service by their numbers, the addresses that are this machine's, and what is refused at the start."""

from __future__ import annotations

import socket
from dataclasses import asdict

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.service import serving
from tripwatt.service.serving import open_socket, require_safe, url_of
from tripwatt.service.settings import Limits, Settings, is_loopback, parse_limits
from tripwatt.trips import MOST_DURATION_S


def test_the_usual_limits() -> None:
    assert asdict(Limits()) == {
        "body_bytes": 4_000_000,
        "batch_bytes": 64_000_000,
        "samples": 50_000,  # a trip of 12 h at 1 Hz has 43,200
        "links": 20_000,
        "duration_s": 43_200.0,
        "batch": 5_000,
        "waiting": 64,
        "bodies": 128,
        "batches": 2,
        "timeout_s": 20.0,
        "body_timeout_s": 20.0,
        "rate_per_s": 50.0,
        "burst": 100,
    }
    assert Limits().duration_s <= MOST_DURATION_S


def test_the_usual_settings() -> None:
    usual = Settings()
    assert (usual.host, usual.port, usual.workers, usual.token) == ("127.0.0.1", 8000, 2, "")
    assert "secret" not in repr(Settings(token="secret" * 4))


@pytest.mark.parametrize(
    ("host", "own"),
    [
        ("LocalHost", True),
        ("127.8.9.1", True),
        ("::1", True),
        ("0.0.0.0", False),
        ("example.org", False),
        ("", False),
    ],
)
def test_addresses_of_this_machine(host: str, own: bool) -> None:
    assert is_loopback(host) is own


def test_names_in_the_host_header() -> None:
    assert Settings(host="127.0.0.5").hosts == {"localhost", "127.0.0.1", "[::1]", "127.0.0.5"}
    assert Settings(host="example.org").hosts == frozenset()


def test_limits_of_texts() -> None:
    found = parse_limits(["samples=2000", "timeout_s=2.5", "rate_per_s=0", "batch=1"])
    assert (found.samples, found.timeout_s, found.rate_per_s, found.batch) == (2000, 2.5, 0.0, 1)
    assert found.links == Limits().links
    assert parse_limits([]) == Limits()
    assert parse_limits(["timeout_s=999999999999"]).timeout_s == 999_999_999_999.0


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        ("sample=3", "unknown limit: --limit: got sample=3; allowed: body_bytes, batch_bytes, samples"),
        ("samples=0", "value out of range: --limit samples: got 0; allowed: a whole number above 0"),
        ("samples=2.5", "--limit samples: got 2.5"),
        ("samples=-1", "--limit samples: got -1"),
        ("timeout_s=0", "--limit timeout_s: got 0; allowed: a number above 0"),
        ("timeout_s=1e12", "--limit timeout_s: got 1e12"),
        ("timeout_s=nan", "--limit timeout_s: got nan"),
        ("timeout_s", "--limit timeout_s: "),
    ],
)
def test_limits_that_are_none(pair: str, words: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        parse_limits([pair])
    assert words in str(caught.value)


def test_every_wrong_limit_is_named() -> None:
    with pytest.raises(InvalidInput) as caught:
        parse_limits(["a=1", "samples=x", "links=3"])
    assert [fault.where for fault in caught.value.faults] == ["--limit", "--limit samples"]


LONG = "t" * serving.MIN_TOKEN_LENGTH


@pytest.mark.parametrize(
    "settings",
    [Settings(), Settings(token=LONG), Settings(host="0.0.0.0", token=LONG), Settings(workers=1)],
)
def test_settings_that_are_safe(settings: Settings) -> None:
    require_safe(settings)


@pytest.mark.parametrize(
    ("settings", "faults"),
    [
        (Settings(host="0.0.0.0"), ["token is missing"]),
        (Settings(token=LONG[1:]), ["token is too short or not printable"]),
        (Settings(token=LONG + "\n"), ["token is too short or not printable"]),
        (Settings(workers=0), ["no workers"]),
        (Settings(host="0.0.0.0", workers=0), ["token is missing", "no workers"]),
    ],
)
def test_settings_that_are_refused(settings: Settings, faults: list[str]) -> None:
    with pytest.raises(InvalidInput) as caught:
        require_safe(settings)
    assert [fault.what for fault in caught.value.faults] == faults


def test_a_socket_and_its_url() -> None:
    with open_socket(Settings(port=0)) as listener:
        port = listener.getsockname()[1]
        assert url_of(listener) == f"http://127.0.0.1:{port}"
        with pytest.raises(InvalidInput, match=f"cannot listen: --host, --port: got 127.0.0.1 port {port}"):
            open_socket(Settings(port=port))
        with socket.create_connection(("127.0.0.1", port), 5.0):
            pass
