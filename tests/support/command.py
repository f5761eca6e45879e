"""The command line in this process, through the same function as the installed script."""

from collections.abc import Callable
from typing import NamedTuple


class Answer(NamedTuple):
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


Run = Callable[..., Answer]
"""Called with the arguments of the command."""
