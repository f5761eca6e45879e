"""Names and colours of models, for all tables and figures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final, Literal

from tripwatt.files import shipped_toml

Kind = Literal["constant", "baseline", "physics", "data", "hybrid"]


@dataclass(frozen=True, slots=True)
class ModelStyle:
    """Name and colour of a model for readers.

    Attributes
    ----------
    label : str
        Name for tables and axes.
    colour : str
        sRGB hex. A label or a marker always accompanies it, so that nothing depends on colour alone.
    kind : {"constant", "baseline", "physics", "data", "hybrid"}
        `hybrid` = simulation + correction, `data` = fitted without simulation.
    meaning : str
        One line for the legend of the table.
    stands_on : str or None
        The simulation that a hybrid corrects.
    without_physics : str or None
        The same learner without the simulation.
    published : str or None
        The same model with only published values of the car.
    preset : str
        Short name of a simulation.
    """

    label: str
    colour: str
    kind: Kind
    meaning: str
    stands_on: str | None = None
    without_physics: str | None = None
    published: str | None = None
    preset: str = ""


@cache
def model_styles() -> Mapping[str, ModelStyle]:
    """Return the style of every model in the order of the tables, from `models.toml`."""
    return {name: ModelStyle(**style) for name, style in shipped_toml("study/report/models.toml").items()}


PAPER: Final = "arXiv:2405.10984, Table 3"
"""Source of the paper's average errors."""

_UNKNOWN_COLOUR: Final = "#7c7c7c"


def model_style(name: str) -> ModelStyle:
    """Return the style of a model; without an entry, its own name and a neutral colour.

    Examples
    --------
    >>> model_style("boosting").label
    'Hybrid boosting'
    >>> model_style("brand-new").label
    'brand-new'
    """
    return model_styles().get(name) or ModelStyle(name, _UNKNOWN_COLOUR, "data", "")


def in_table_order(names: Iterable[str]) -> list[str]:
    """Sort model names in the order of the tables; unknown names come last, by alphabet.

    Examples
    --------
    >>> in_table_order(["forest", "zebra", "constant"])
    ['constant', 'forest', 'zebra']
    """
    rank = {name: i for i, name in enumerate(model_styles())}
    return sorted(set(names), key=lambda name: (rank.get(name, len(rank)), name))
