"""What is packed is bounded before it is unpacked, and bombs cost next to nothing."""

import zipfile

import numpy as np
import pytest
from tests.support.bombs import BOMBS, LONGEST_S, MAX_BYTES, cost_of, zipped
from tests.support.refusals import refuses

from tripwatt.containers import ANY_RATIO_BYTES, INSIDE, LIMITS, MAX_ENTRIES, Budget, open_archive
from tripwatt.errors import InvalidInput


def test_an_archive_is_measured_before_it_is_inflated() -> None:
    packed = zipped({"a": b"\0" * 600, "b": b"\0" * 400})
    assert len(open_archive(packed, Budget("x.npz", {INSIDE: 1000})).infolist()) == 2
    with pytest.raises(
        InvalidInput, match=r"archive too large: x.npz: got 1000 bytes when inflated; allowed: at most 999"
    ):
        open_archive(packed, Budget("x.npz", {INSIDE: 999}))


def test_what_is_nested_takes_from_one_budget() -> None:
    budget, packed = Budget("x.zip", {INSIDE: 1500}), zipped({"a": bytes(1000)})
    open_archive(packed, budget)
    refuses("got 2000 bytes when inflated; allowed: at most 1500", open_archive, packed, budget)


def test_the_ratio_of_an_archive_is_bounded_unless_it_is_small() -> None:
    assert open_archive(zipped({"a": bytes(ANY_RATIO_BYTES)}), Budget("x.zip")).namelist() == ["a"]
    large = zipped({"a": bytes(ANY_RATIO_BYTES + 1)})
    with pytest.raises(InvalidInput, match=f"at most {ANY_RATIO_BYTES} bytes"):
        open_archive(large, Budget("x.zip"))
    assert open_archive(large, Budget("x.npz"), max_ratio=5000).namelist() == ["a"]
    budget = Budget("x.zip")
    digits = np.random.default_rng(1).bytes(ANY_RATIO_BYTES)
    open_archive(zipped({"a": digits}), budget)
    assert budget.limits == LIMITS


def test_entries_and_methods_of_an_archive_are_bounded() -> None:
    with pytest.raises(InvalidInput, match=f"too many files: x.zip: .*at most {MAX_ENTRIES}"):
        open_archive(b"PK\1\2" * (MAX_ENTRIES + 1), Budget("x.zip"))
    for method in (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2):
        refuses("unusual compression", open_archive, zipped({"a": b"x"}, method), Budget("x.zip"))


@pytest.mark.parametrize("kind", BOMBS)
def test_a_bomb_is_refused_at_next_to_no_cost(kind: str) -> None:
    for k in range(2):
        bomb = BOMBS[kind](np.random.default_rng([5, sorted(BOMBS).index(kind), k]))
        cost = cost_of(*bomb)
        assert cost.refused
        assert cost.memory_bytes < MAX_BYTES
        # `benchmarks.hostile` has the bound; other tests run beside this one
        assert cost.seconds < 5 * LONGEST_S
