"""Defaults and limits of the service, and what may be listened on without a token."""

from __future__ import annotations

import dataclasses

import pytest

from tripwatt.errors import Fault, InvalidInput
from tripwatt.server.http.settings import MIN_TOKEN_LENGTH, Limits, Settings, is_loopback, parse_limits


def faults_of(*pairs: str) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        parse_limits(list(pairs))
    return caught.value.faults


def test_every_limit_has_its_documented_default() -> None:
    assert dataclasses.asdict(Limits()) == {
        "body_bytes": 4_000_000,  # a trip of 50,000 samples with four columns
        "batch_bytes": 64_000_000,
        "samples": 50_000,  # more than half a day at one sample per second
        "links": 20_000,
        "duration_s": 43_200.0,  # half a day: the computing time grows with its square
        "batch": 5_000,
        "waiting": 64,
        "arriving_bytes": 256_000_000,
        "batches": 2,
        "timeout_s": 20.0,
        "body_timeout_s": 20.0,
        "upload_bytes": 64_000_000,  # a month of drives of a logger, packed
        "car_bytes": 512_000_000,
        "learn_s": 1800.0,
        "listeners": 64,
        "live_every_s": 5.0,
        "memory_bytes": 2_000_000_000,  # ten million rows of a log take less
    }


def test_the_service_is_for_this_machine_by_default() -> None:
    found = Settings()
    assert (found.host, found.port, found.workers, found.token) == ("127.0.0.1", 8000, 2, "")
    assert (dict(found.models), found.limits, found.atlas.map, found.cars) == ({}, Limits(), "", None)
    assert MIN_TOKEN_LENGTH == 16


def test_the_token_is_not_shown() -> None:
    assert "secret" not in repr(Settings(token="secret"))


@pytest.mark.parametrize("host", ["localhost", "LocalHost", "127.0.0.1", "127.9.8.7", "::1"])
def test_loopback_is_recognised(host: str) -> None:
    assert is_loopback(host) is True


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "128.0.0.1", "myhost", "localhost.evil", ""])
def test_other_addresses_and_names_are_not_loopback(host: str) -> None:
    assert is_loopback(host) is False


def test_names_that_the_host_header_may_have() -> None:
    assert Settings(host="::1").hosts == {"localhost", "127.0.0.1", "[::1]", "::1"}
    assert Settings(host="LOCALHOST").hosts == {"localhost", "127.0.0.1", "[::1]"}
    assert Settings(host="myhost").hosts == frozenset()


def test_limits_are_parsed_by_their_type() -> None:
    found = parse_limits(["samples=7", "timeout_s=1.5"])
    assert found == Limits(samples=7, timeout_s=1.5)
    assert type(found.samples) is int
    assert parse_limits([]) == Limits()


def test_a_limit_is_below_a_million_millions() -> None:
    assert parse_limits(["samples=999999999999"]).samples == 999_999_999_999
    assert faults_of("samples=1000000000000")[0].what == "value out of range"
    assert faults_of("timeout_s=nan", "samples=0", "timeout_s=inf")[2].got == "inf"


def test_values_that_are_no_numbers_are_out_of_range() -> None:
    whole, number = faults_of("samples=1.5", "timeout_s=fast")
    assert whole == Fault("value out of range", "--limit samples", "1.5", "a whole number above 0")
    assert number == Fault("value out of range", "--limit timeout_s", "fast", "a number above 0")


def test_unknown_limits_are_listed_with_the_known_ones() -> None:
    first, second = faults_of("colour=1", "samples=x")
    assert (first.what, first.where, first.got) == ("unknown limit", "--limit", "'colour'")
    assert first.allowed.split(", ") == [field.name for field in dataclasses.fields(Limits)]
    assert second.where == "--limit samples"
