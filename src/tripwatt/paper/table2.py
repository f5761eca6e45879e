"""The GAMM of the paper's Table 2 as a corrector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray

TABLE2: Final = (
    "weather",
    "s(time_s)",
    "s(ambient_temperature_degc)",
    "s(speed_m_s)",
    "s(elevation_difference_m)",
    "s(time_s, by=season)",
    "s(ambient_temperature_degc, by=season)",
    "s(ambient_temperature_degc, elevation_difference_m, k=30)",
    's(trip, bs="re")',
)
"""Terms of the paper's Table 2; `season` is an ordered factor, whose smooths are the difference of winter from summer,
`trip` the cluster."""

SEASONS: Final = ("summer", "winter")
"""Levels of `season`; the first is the reference."""


@dataclass
class Table2Corrector:
    """The paper's GAMM with Student's t errors (its Table 2) as a corrector.

    Terms whose covariates no trip has, or that are the same in all training rows, are left out. A missing value counts
    as the training rows' median (a trip
    without elevation counts as flat). Unseen weather and covariates outside the training range follow the engine's
    rule, which is bounded: the mean effect, and the range's edge.

    Parameters
    ----------
    every_rows : int
        The fit takes every so many rows of a trip and its last one. At 1 s the residuals of successive rows are so
        alike (correlation 0.999) that every smooth would run to its largest number of degrees of freedom.

    Attributes
    ----------
    model_ : GAMM
        The fitted engine, for summary, diagnosis and effects.
    left_out_ : tuple of str
        Terms of `TABLE2` that the training rows do not determine.
    """

    every_rows: int = 60
    model_: Any = None
    medians_: pd.Series | None = None
    left_out_: tuple[str, ...] = ()

    def fit(self, X: pd.DataFrame, y: FloatArray, groups: IntArray) -> Self:
        """Fit by performance iteration and fREML. O(rows x coefficients^2)."""
        self.medians_ = X.select_dtypes("number").median()
        frame, rows = self.training_frame(X, groups)
        varied = {name for name in map(str, frame) if len(frame[name].unique()) > 1}
        terms = [term for term in TABLE2 if varied.issuperset(_names_in(term))]
        self.left_out_ = tuple(term for term in TABLE2 if term not in terms)
        self.model_ = self._engine(terms).fit(frame, np.asarray(y)[rows], groups=groups[rows])
        return self

    def predict(self, X: pd.DataFrame) -> FloatArray:
        """Predicted `y` of new trips: their random effect is 0."""
        return np.asarray(self.model_.predict(self.frame(X)), dtype=np.float64)

    def training_frame(self, X: pd.DataFrame, groups: IntArray) -> tuple[pd.DataFrame, IntArray]:
        """The rows that `fit` takes, as the engine sees them, and their numbers."""
        position = pd.Series(groups).groupby(groups, sort=False).cumcount().to_numpy()
        last = np.append(groups[1:] != groups[:-1], True)
        rows = np.flatnonzero((position % self.every_rows == 0) | last).astype(np.int64)
        return self.frame(X.iloc[rows], groups[rows]), rows

    @staticmethod
    def _engine(terms: Sequence[str]) -> Any:
        from tripwatt.gam import GAMM

        return GAMM("y ~ " + " + ".join(terms), family="scat")

    def frame(self, X: pd.DataFrame, groups: IntArray | None = None) -> pd.DataFrame:
        """Covariates as the engine sees them; with `groups`, the trips are those of the fit. Needs `fit`."""
        assert self.medians_ is not None
        frame = X.fillna(self.medians_.to_dict())
        if "season" in frame:
            winter = (
                (frame["season"] == "winter").to_numpy().astype(np.intp)
            )  # an unknown season counts as summer
            frame["season"] = pd.Categorical.from_codes(
                winter, dtype=pd.CategoricalDtype(list(SEASONS), ordered=True)
            )
        if groups is not None:
            frame["trip"] = groups.astype(str)
        return frame


def _names_in(term: str) -> list[str]:
    """Column names that a term of `TABLE2` needs."""
    inner = term[2:-1] if term.startswith("s(") else term
    parts = [part.strip() for part in inner.split(",")]
    return [p.removeprefix("by=") for p in parts if "=" not in p or p.startswith("by=")]
