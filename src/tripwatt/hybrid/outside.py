"""Correctors from outside: regressors of scikit-learn's kind, and objects that are fitted to a table of segments."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable
from typing import Any, Final, Protocol

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput
from tripwatt.hybrid.covariates import CovariateCorrector
from tripwatt.hybrid.power import LearnerCorrector, PowerCorrector, Uncertain, familiarity_of, summed
from tripwatt.hybrid.segments import SegmentTable
from tripwatt.learners.outside import OutsideRegressor, checked

ENTRY_POINTS: Final = "tripwatt.correctors"
"""Group of entry points in which a package names its correctors: functions from a seed to a `Corrector`."""

HOW: Final = "a regressor of scikit-learn's kind, or fit(table) and predict(table) on a SegmentTable"


class Corrector(Protocol):
    """A corrector from outside: a regressor of scikit-learn's kind, or an object on a `SegmentTable`.

    A regressor has `get_params`, as every estimator of scikit-learn. It is fitted to `TREE_FEATURES` of the segments and
    their residual power [W]. Any other object has ``fit(table)`` and ``predict(table)``, and may have other methods
    of `PowerCorrector`. The given object is not changed: clones or copies of it are fitted.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> corrector: Corrector = Ridge()
    """

    @property
    def fit(self) -> Callable[..., Any]:
        """Fit to ``(X, y)``, or to a table."""

    @property
    def predict(self) -> Callable[..., Any]:
        """Predict the residual power [W] of each row of ``X``, or of a table."""


class TableCorrector(PowerCorrector):
    """An object from outside with `fit` and `predict` on a table of segments.

    Parameters
    ----------
    unfitted : Corrector
        Object that each fit copies.

    Attributes
    ----------
    model : Corrector
        The fitted copy.
    """

    def __init__(self, unfitted: Any) -> None:
        self.unfitted = unfitted
        self.model: Any = unfitted

    def fit(self, table: SegmentTable) -> TableCorrector:
        """Fit a copy of the unfitted object."""
        self.model = copy.deepcopy(self.unfitted)
        self.model.fit(table)
        self.familiarity = familiarity_of(table)
        return self

    def clone_tuned(self) -> TableCorrector:
        """Return an unfitted copy, with the settings that `fit` chose if the object has `clone_tuned`."""
        own = self._own("clone_tuned")
        return TableCorrector(own() if own else self.unfitted)

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]."""
        return checked(self.model.predict(table), len(table.hours), self.model)

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Result of the object's own method if it has one; otherwise its prediction without uncertainty."""
        own: Any = self._own("predict_with_uncertainty") or super().predict_with_uncertainty
        power, factor = own(table)
        return power, summed(factor, hours)

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Result of the object's own method if it has one; otherwise as of any corrector without a prior."""
        own: Any = self._own("outside_factor") or super().outside_factor
        return own(table)  # type: ignore[no-any-return]  # of an object from outside

    def predict_climate(self, table: SegmentTable) -> FloatArray | None:
        """Result of the object's own method; None if it has none."""
        own = self._own("predict_climate")
        return None if own is None else own(table)

    def _own(self, name: str) -> Any:
        """Method of the object by name; None if it has none, or only that of `PowerCorrector`."""
        empty = getattr(type(self.model), name, None) is getattr(PowerCorrector, name)
        return None if empty else getattr(self.model, name, None)


def outside_corrector(corrector: Corrector, seed: int) -> PowerCorrector:
    """Make an unfitted corrector of power from an object from outside.

    Parameters
    ----------
    corrector : Corrector
    seed : int
        Random state of a regressor that has none set.

    Raises
    ------
    InvalidInput
        If the object is of neither of the two kinds of `Corrector`.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> type(outside_corrector(Ridge(), 0)).__name__
    'LearnerCorrector'
    """
    require_fitting(corrector, "corrector", HOW)
    if is_regressor(corrector):
        return LearnerCorrector(OutsideRegressor(corrector, seed))
    return TableCorrector(corrector)


def is_regressor(model: object) -> bool:
    """Whether an object is an estimator of scikit-learn's kind."""
    return hasattr(model, "get_params")


def require_fitting(model: object, where: str, how: str) -> None:
    """Raise `InvalidInput` for a class, a classifier, or an object without `fit` and `predict`."""
    if inspect.isclass(model):
        raise InvalidInput.of("class in place of an object", where, model.__name__, f"{model.__name__}()")
    from sklearn.base import is_classifier

    if is_regressor(model) and is_classifier(model):
        raise InvalidInput.of("object cannot be fitted", where, f"the classifier {type(model).__name__}", how)
    if not all(callable(getattr(model, name, None)) for name in ("fit", "predict")):
        raise InvalidInput.of("object cannot be fitted", where, f"{model!r}"[:80], how)


def packaged_correctors() -> dict[str, Any]:
    """Entry points of the correctors of installed packages, by name; `load` imports a package and gives the maker of its corrector."""
    from importlib.metadata import entry_points  # slow to import

    return {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}


def fitted_outside(corrector: PowerCorrector | None) -> Any:
    """The fitted object from outside in a corrector; None for a corrector of tripwatt."""
    if isinstance(corrector, CovariateCorrector):
        return fitted_outside(corrector.base)
    if isinstance(corrector, TableCorrector):
        return corrector.model
    if isinstance(corrector, LearnerCorrector) and isinstance(corrector.model, OutsideRegressor):
        return corrector.model.regressor_
    return None
