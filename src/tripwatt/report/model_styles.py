"""How a model is called and coloured: the one place from which every table and figure takes it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal["constant", "baseline", "physics", "data", "hybrid"]


@dataclass(frozen=True, slots=True)
class ModelStyle:
    """The reader's name and the colour of a model.

    Attributes
    ----------
    label : str
        Name for tables and axes.
    colour : str
        sRGB hex. At least 3:1 in contrast on the light and on the dark page; a label or a marker always repeats
        it, so that nothing depends on colour alone.
    kind : {"constant", "baseline", "physics", "data", "hybrid"}
        `hybrid` = simulation + correction, `data` = fitted without simulation.
    meaning : str
        One line for the legend of the table.
    stands_on : str or None
        The simulation that a hybrid corrects.
    without_physics : str or None
        The same learner without the simulation.
    rivals : tuple of str
        Models of few coefficients with which the sentences compare it.
    own_physics : str or None
        Its own simulation, with everything that a fold identifies.
    published : str or None
        The same model with published values of the car alone.
    preset : str
        Short name of a simulation.
    """

    label: str
    colour: str
    kind: Kind
    meaning: str
    stands_on: str | None = None
    without_physics: str | None = None
    rivals: tuple[str, ...] = ()
    own_physics: str | None = None
    published: str | None = None
    preset: str = ""


def _power(learner: str, colour: str, correction: str) -> ModelStyle:
    return ModelStyle(f"Power: {learner}", colour, "hybrid", f"default physics{correction}", "physics")


MODELS: Final[Mapping[str, ModelStyle]] = {
    "constant": ModelStyle(
        "Constant Wh/km", "#7c7c7c", "constant", "one consumption per distance for every trip"
    ),
    "linear4": ModelStyle(
        "Linear (4 coefficients)",
        "#8a7f55",
        "baseline",
        "distance, time, and time weighted by cold and by heat",
    ),
    "linear6": ModelStyle(
        "Linear (6 coefficients)",
        "#5f7f8f",
        "baseline",
        "the four, and sums for air drag and for acceleration",
    ),
    "physics-paper": ModelStyle(
        "Physics (paper preset)",
        "#d55e00",
        "physics",
        "simulation as in the paper: 50 % regeneration, no climate",
        preset="paper preset",
    ),
    "physics": ModelStyle(
        "Physics (default preset)",
        "#a6761d",
        "physics",
        "simulation with the values of public sources",
        preset="default preset",
    ),
    "physics4": ModelStyle(
        "Physics + 4 coefficients",
        "#9a6a4f",
        "hybrid",
        "default simulation in place of distance, and the other three coefficients",
        "physics",
    ),
    "forest": ModelStyle(
        "Hybrid forest",
        "#1f8a5b",
        "hybrid",
        "paper preset + forest with subject-level bootstrap",
        "physics-paper",
    ),
    "boosting": ModelStyle(
        "Hybrid boosting",
        "#0072b2",
        "hybrid",
        "paper preset + marginal boosting",
        "physics-paper",
        without_physics="boosting-only",
    ),
    "boosting-only": ModelStyle(
        "Boosting without physics",
        "#c2609c",
        "data",
        "the same boosting on what was measured, not on the residual",
    ),
    "gamm": ModelStyle(
        "Hybrid GAMM", "#7d6bc6", "hybrid", "paper preset + GAMM with Student's t errors", "physics-paper"
    ),
    "physics-identified": ModelStyle(
        "Physics (identified)",
        "#946c1e",
        "physics",
        "stages identified from torque, heater, standing power and voltage of the other trips",
    ),
    "power-linear": _power("linear", "#b8860b", ", each cause scaled"),
    "power-kriging": _power("Gaussian process", "#5b7fbf", " + process on its power"),
    "power-boosting": _power("boosting", "#2f8fd0", " + boosting on its power"),
    "power-forest": _power("forest", "#4a9a6a", " + forest on its power"),
    "power-gamm": _power("GAMM", "#8f7fd0", " + GAMM on its power"),
    "power-ensemble": _power("ensemble", "#3b8f9f", " + mean of two correctors"),
    "hybrid-published": ModelStyle(
        "Hybrid, published values only",
        "#3d8a93",
        "hybrid",
        "default physics + learned correction of its power",
        "physics",
    ),
    "hybrid": ModelStyle(
        "Hybrid forecast",
        "#0f8797",
        "hybrid",
        "identified physics + learned correction of its power",
        "physics",
        without_physics="boosting-only",
        rivals=("physics4", "linear6"),
        own_physics="physics-identified",
        published="hybrid-published",
    ),
}
"""Display name, colour and kind of every model, in the order of the tables."""

PAPER: Final = "arXiv:2405.10984, Table 3"
"""Where the paper states its average errors."""

PAPER_CAR: Final = "bmw_i3_60ah"
"""The bundled vehicle that is the paper's car."""

PAPER_TRIPS: Final = 72
"""Trips that the paper's data set has, each of which it leaves out once (arXiv:2405.10984, Methodology)."""

PAPER_IMPROVED: Final = "over 90 % of the trips"
"""The paper's words on the share of trips that a corrector improves over the physics (its conclusion)."""

_UNKNOWN_COLOUR: Final = "#7c7c7c"


def model_style(name: str) -> ModelStyle:
    """The style of a model; a model without an entry keeps its own name and a neutral colour.

    Examples
    --------
    >>> model_style("boosting").label
    'Hybrid boosting'
    >>> model_style("brand-new").label
    'brand-new'
    """
    return MODELS.get(name) or ModelStyle(name, _UNKNOWN_COLOUR, "data", "")


def ordered(names: Iterable[str]) -> list[str]:
    """Model names in the order of the tables, unknown ones last and by name.

    Examples
    --------
    >>> ordered(["forest", "zebra", "constant"])
    ['constant', 'forest', 'zebra']
    """
    rank = {name: i for i, name in enumerate(MODELS)}
    return sorted(set(names), key=lambda name: (rank.get(name, len(rank)), name))
