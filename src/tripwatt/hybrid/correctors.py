"""The correctors of power by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.hybrid.covariates import CovariateCorrector
from tripwatt.hybrid.outside import Corrector, outside_corrector, packaged_correctors
from tripwatt.hybrid.power import (
    LINES,
    EnsembleCorrector,
    GammCorrector,
    GPCorrector,
    PowerCorrector,
    SplitCorrector,
    boosting_corrector,
    forest_corrector,
    split_corrector,
)
from tripwatt.trips.columns import Column, number_faults

POWER_CORRECTORS: Final[Mapping[str, Callable[[int], PowerCorrector]]] = {
    "linear": lambda seed: GPCorrector(LINES),
    "gp": lambda seed: GPCorrector(),
    "boosting": boosting_corrector,
    "forest": forest_corrector,
    "gamm": lambda seed: GammCorrector(),
    "split": split_corrector,
    "ensemble": lambda seed: EnsembleCorrector([GPCorrector(), boosting_corrector(seed)]),
}
"""Name -> function that makes an unfitted corrector from a seed."""

STORABLE: Final = ("linear", "gp", "boosting", "forest", "split", "ensemble")
"""Correctors that can be stored: all but the GAMM."""


TUNED: Final = ("boosting", "forest", "ensemble", "split")
"""Correctors with settings that are chosen on the trips of a fit."""


def power_corrector(corrector: str | Corrector, seed: int = 0) -> PowerCorrector:
    """Make a corrector that is not fitted.

    Parameters
    ----------
    corrector : str or Corrector
        One of `POWER_CORRECTORS`, the name of a corrector of an installed package, or an object from outside.
    seed : int
        Seed of the corrector's random choices.

    Returns
    -------
    PowerCorrector
        Unfitted corrector with its usual settings.

    Raises
    ------
    InvalidInput
        If the name is unknown, or the object cannot be fitted.

    Examples
    --------
    >>> type(power_corrector("linear")).__name__, sorted(POWER_CORRECTORS)
    ('GPCorrector', ['boosting', 'ensemble', 'forest', 'gamm', 'gp', 'linear', 'split'])
    """
    raise_faults(number_faults("seed", seed, Column("", 0, 2**63 - 1, ""), whole=True))
    if not isinstance(corrector, str):
        return outside_corrector(corrector, seed)
    if corrector in POWER_CORRECTORS:
        return POWER_CORRECTORS[corrector](seed)
    packaged = packaged_correctors()
    if corrector not in packaged:
        raise InvalidInput(
            Fault.unknown("unknown corrector", "corrector", corrector, (*POWER_CORRECTORS, *packaged))
        )
    return outside_corrector(packaged[corrector].load()(seed), seed)


def corrector_name(corrector: str | Corrector) -> str:
    """Name of a corrector; for an object from outside, the name of its class.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> corrector_name("gp"), corrector_name(Ridge())
    ('gp', 'Ridge')
    """
    return corrector if isinstance(corrector, str) else type(corrector).__name__


def fresh_corrector(name: str, seed: int, like: PowerCorrector) -> PowerCorrector:
    """Make an unfitted corrector that treats climate control, separately or jointly, as a fitted corrector does.

    Parameters
    ----------
    name : str
        One of `POWER_CORRECTORS`.
    seed : int
    like : PowerCorrector
        A fitted corrector of the same name.
    """
    if isinstance(like, CovariateCorrector):
        return CovariateCorrector(fresh_corrector(name, seed, like.base), like.names)
    corrector = power_corrector(name, seed)
    if isinstance(corrector, SplitCorrector) and isinstance(like, SplitCorrector):
        corrector.split = like.split_
    return corrector
