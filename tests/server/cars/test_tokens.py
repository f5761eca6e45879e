"""The token of a car is kept as its digest alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.server.cars import has_token, issue_token
from tripwatt.server.cars.tokens import digest_of, token_digest


def test_a_token_is_that_of_one_car_and_is_not_stored(folder: Path) -> None:
    assert not has_token(folder)
    token, other = issue_token(folder), issue_token(folder.with_name("other"))
    assert has_token(folder)
    assert (
        token_digest(folder)
        == digest_of(token)
        != token_digest(folder.with_name("other"))
        == digest_of(other)
    )
    again = issue_token(folder)
    assert token_digest(folder) == digest_of(again)
    assert len({token, other, again}) == 3
    assert again.encode() not in (folder / "live" / "token.json").read_bytes()
    (folder / "live" / "token.json").write_text("[]")
    with pytest.raises(InvalidInput, match="damaged file"):
        token_digest(folder)
    assert token_digest(folder.with_name("third")) is None
