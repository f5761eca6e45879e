"""The message of a refused input, so that a table of wrong inputs takes a line for each."""

from collections.abc import Callable

import pytest

from tripwatt.errors import InvalidInput


def refusal(call: Callable[..., object], *given: object, **named: object) -> str:
    """What, where, got and allowed of every fault of the input, a line for each; fails if the input is taken."""
    with pytest.raises(InvalidInput) as found:
        call(*given, **named)
    return str(found.value)
