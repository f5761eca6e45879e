"""Defaults and limits of the service, and what may be listened on without a token."""

from __future__ import annotations

import dataclasses
import math

import pytest

from tripwatt.errors import Fault, InvalidInput
from tripwatt.server.http.settings import Limits, Settings, is_loopback, limits_of


def faults_of(**given: float | str) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        limits_of(given)
    return caught.value.faults


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


def test_limits_have_their_type() -> None:
    found = limits_of({"samples": 7.0, "timeout_s": 1.5})
    assert found == Limits(samples=7, timeout_s=1.5)
    assert type(found.samples) is int
    assert limits_of({}) == Limits()


def test_a_limit_is_below_a_million_millions() -> None:
    assert limits_of({"samples": 999_999_999_999.0}).samples == 999_999_999_999
    assert faults_of(samples=1e12)[0].what == "value out of range"
    assert faults_of(timeout_s=math.nan, samples=0.0, compute_s=math.inf)[2].got == "inf"


def test_values_that_are_no_numbers_are_out_of_range() -> None:
    whole, number = faults_of(samples=1.5, timeout_s="fast")
    assert whole == Fault("value out of range", "--limit samples", "1.5", "a whole number above 0")
    assert number == Fault("value out of range", "--limit timeout_s", "fast", "a number above 0")


def test_unknown_limits_are_listed_with_the_known_ones() -> None:
    first, second = faults_of(colour=1.0, samples="x")
    assert (first.what, first.where, first.got) == ("unknown limit", "--limit", "'colour'")
    assert first.allowed.split(", ") == [field.name for field in dataclasses.fields(Limits)]
    assert second.where == "--limit samples"
