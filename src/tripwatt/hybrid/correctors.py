"""The correctors of power by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.hybrid.channels import channel_corrector
from tripwatt.hybrid.power import (
    LINES,
    EnsembleCorrector,
    GammCorrector,
    KrigingCorrector,
    PowerCorrector,
    boosting_corrector,
    forest_corrector,
)

POWER_CORRECTORS: Final[Mapping[str, Callable[[int], PowerCorrector]]] = MappingProxyType(
    {
        "linear": lambda seed: KrigingCorrector(LINES),
        "kriging": lambda seed: KrigingCorrector(),
        "boosting": boosting_corrector,
        "forest": forest_corrector,
        "gamm": lambda seed: GammCorrector(),
        "channels": channel_corrector,
        "ensemble": lambda seed: EnsembleCorrector([KrigingCorrector(), boosting_corrector(seed)]),
    }
)
"""Correctors of power by name; each makes a fresh one from a seed."""


def power_corrector(name: str, seed: int = 0) -> PowerCorrector:
    """A fresh corrector.

    Raises
    ------
    InvalidInput
        On an unknown name.
    """
    if name not in POWER_CORRECTORS:
        raise InvalidInput(Fault("unknown corrector", "corrector", name, ", ".join(POWER_CORRECTORS)))
    return POWER_CORRECTORS[name](seed)
