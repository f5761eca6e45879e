"""Which models a protocol compares, and on which physics they stand.

In the protocol `paper` the correctors always stand on `physics-paper`, also when the default physics gets better.
Inside the fold their settings are chosen by what the table scores: the absolute error at the end of the trip.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting import DEFAULT_CORRECTOR
from tripwatt.hybrid import (
    POWER_CORRECTORS,
    DataOnly,
    EnergyModel,
    EnergyRegression,
    HybridModel,
    PhysicsOnly,
    Table2Corrector,
)

PHYSICS_PRESETS: Final[Mapping[str, str]] = MappingProxyType({"physics-paper": "paper", "physics": "default"})
"""Name of the simulated energy -> preset of the vehicle."""

FOUR: Final = ("distance_km", "duration_h", "cold_h", "hot_h")
SIX: Final = (*FOUR, "cubed_speed", "acceleration_work")


@dataclass(frozen=True, slots=True)
class ModelSpec:
    """A model of a protocol: its name in every table, and how to make it from a seed.

    Attributes
    ----------
    name : str
    title : str
        What it is, in a few words.
    """

    name: str
    title: str

    def build(self, seed: int) -> EnergyModel:
        """A fresh, unfitted model."""
        match self.name:
            case "constant":
                return EnergyRegression(("distance_km",))
            case "linear4":
                return EnergyRegression(FOUR)
            case "linear6":
                return EnergyRegression(SIX)
            case "physics-paper" | "physics":
                return PhysicsOnly(self.name)
            case "physics4":
                return EnergyRegression(FOUR[1:], simulation="physics")
            case "forest":
                from tripwatt.forest import ClusteredForest

                forest = ClusteredForest(random_state=seed, score_rows="last", loss="absolute")
                return HybridModel(forest, "physics-paper", shares_folds=True)
            case "gamm":
                return HybridModel(Table2Corrector(), "physics-paper")
            case "boosting":
                return HybridModel(_boosting(seed), "physics-paper", shares_folds=True)
            case "boosting-only":
                return DataOnly(_boosting(seed), shares_folds=True)
        raise InvalidInput(Fault("unknown model", "models", self.name, ", ".join(MODEL_NAMES)))


def _boosting(seed: int) -> Any:
    from tripwatt.boosting import ClusteredBoosting

    return ClusteredBoosting(random_state=seed, score_rows="last", loss="absolute")


PAPER_MODELS: Final = (
    ModelSpec("constant", "constant energy per km"),
    ModelSpec("linear4", "regression, 4 coefficients"),
    ModelSpec("linear6", "regression, 6 coefficients"),
    ModelSpec("physics-paper", "physics as in the paper"),
    ModelSpec("physics", "physics, default preset"),
    ModelSpec("physics4", "default physics + 4 coefficients"),
    ModelSpec("gamm", "hybrid, GAMM with Student's t errors"),
    ModelSpec("forest", "hybrid, clustered forest"),
    ModelSpec("boosting", "hybrid, clustered boosting"),
    ModelSpec("boosting-only", "boosting without physics"),
)

_CORRECTOR_TITLES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "linear": "default physics, each cause scaled",
        "kriging": "default physics + additive Gaussian process on power",
        "boosting": "default physics + boosting on power",
        "forest": "default physics + forest on power",
        "gamm": "default physics + GAMM on power",
        "ensemble": "default physics + mean of Gaussian process and boosting on power",
        "channels": "default physics + climate and driving corrected apart, by Gaussian processes and boosting",
    }
)

FORECAST_MODELS: Final = (
    *(
        spec
        for spec in PAPER_MODELS
        if spec.name in ("constant", "linear4", "linear6", "physics", "physics4")
    ),
    ModelSpec("boosting-only", "boosting on the power of blocks, without physics"),
    *(
        ModelSpec(f"power-{name}", _CORRECTOR_TITLES.get(name, f"default physics + {name} on power"))
        for name in POWER_CORRECTORS
        if name != DEFAULT_CORRECTOR
    ),
    ModelSpec("hybrid", f"the forecast: {_CORRECTOR_TITLES[DEFAULT_CORRECTOR]}, with intervals and updates"),
)
"""The default corrector's own row is `hybrid`: its centre is that corrector's prediction."""

PROTOCOLS: Final[Mapping[str, tuple[ModelSpec, ...]]] = MappingProxyType(
    {"paper": PAPER_MODELS, "forecast": FORECAST_MODELS}
)
MODEL_NAMES: Final = tuple(spec.name for spec in PAPER_MODELS)


def protocol_models(protocol: str, names: tuple[str, ...] | None = None) -> tuple[ModelSpec, ...]:
    """The models of a protocol, or those of them that are named.

    Raises
    ------
    InvalidInput
        On an unknown protocol or model.

    Examples
    --------
    >>> [spec.name for spec in protocol_models("paper", ("physics", "constant"))]
    ['constant', 'physics']
    """
    if protocol not in PROTOCOLS:
        raise InvalidInput(Fault("unknown protocol", "--protocol", protocol, ", ".join(PROTOCOLS)))
    specs = PROTOCOLS[protocol]
    if names is None:
        return specs
    known = [spec.name for spec in specs]
    wrong = [name for name in names if name not in known]
    if wrong:
        raise InvalidInput([Fault("unknown model", "--models", name, ", ".join(known)) for name in wrong])
    return tuple(spec for spec in specs if spec.name in names)
