"""Access to the GAMM engine, a separate distribution: imported only if needed, with its errors raised as those of tripwatt."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from tripwatt.errors import Fault, InvalidInput, require_extras


@contextmanager
def gamm_engine() -> Iterator[ModuleType]:
    """Context manager that imports and yields `tripwatt_gamm`.

    Raises
    ------
    InvalidInput
        If the engine is not installed, or refuses an input in the block.

    Examples
    --------
    >>> with gamm_engine() as engine:
    ...     engine.GAMM("y ~ s(x, kk=3)").fit({"x": [], "y": []})
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: unknown argument: term 's(x, kk=3)' at character 5: got kk; allowed: bs, k, by, knots; did you mean k?
    """
    require_extras({"gamm": "a GAMM"})
    import tripwatt_gamm

    try:
        yield tripwatt_gamm
    except tripwatt_gamm.InvalidInput as error:
        raise InvalidInput(Fault(*fault) for fault in error.faults) from error
