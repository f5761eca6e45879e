"""Refused inputs, a line for each."""

from collections.abc import Callable

import pytest

from tripwatt.errors import InvalidInput


def refusal(call: Callable[..., object], *given: object, **named: object) -> str:
    """What, where, got and allowed of every fault of the input, a line for each; fails if the input is taken."""
    with pytest.raises(InvalidInput) as found:
        call(*given, **named)
    return str(found.value)


def refuses(pattern: str, call: Callable[..., object], *given: object, **named: object) -> None:
    """Fails unless the input is refused with a message that has the pattern."""
    with pytest.raises(InvalidInput, match=pattern):
        call(*given, **named)
