"""Models from outside the package in a protocol: correctors, and whole models of the energy of a trip."""

from __future__ import annotations

import copy
import inspect
import pickle
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import joblib

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import InvalidInput
from tripwatt.hybrid import Corrector
from tripwatt.hybrid.outside import is_regressor, require_fitting
from tripwatt.learners.outside import checked
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.tasks import Fitted, Method, ModelSpec
from tripwatt.trips import Plan, Trip

HOW: Final = (
    "a name of the protocol, a regressor of scikit-learn's kind, fit(table) and predict(table) for a corrector, "
    "or fit(trips) and predict(trip) for a whole model"
)


class WholeModel(Protocol):
    """A model of the energy of a trip; the name `trips` of the argument of `fit` distinguishes it from a corrector.

    Examples
    --------
    >>> class PerKilometre:
    ...     def fit(self, trips):
    ...         self.wh_m = sum(t.observed_energy_wh for t in trips) / sum(Plan.from_trip(t).distance_m for t in trips)
    ...     def predict(self, trip):
    ...         return self.wh_m * trip.distance_m
    >>> import tripwatt as tw
    >>> from tripwatt.study.evaluation import Execution
    >>> run = tw.evaluate(tw.sample_trips(), models=["constant", PerKilometre()], execution=Execution(n_jobs=1))
    >>> run.folds["model"].unique().tolist()
    ['constant', 'PerKilometre']
    """

    def fit(self, trips: Sequence[Trip]) -> object:
        """Fit to recorded trips with measured energy.

        Parameters
        ----------
        trips : sequence of Trip
            Training trips of one fold.

        Examples
        --------
        >>> model.fit(fleet.trips)  # doctest: +SKIP
        """

    def predict(self, trip: Plan) -> float:
        """Predict the energy of a trip [Wh].

        Parameters
        ----------
        trip : Plan
            What is known before departure: speed trace, road and `departure`.

        Returns
        -------
        float
            Energy at the battery terminals [Wh].

        Examples
        --------
        >>> model.predict(plan)  # doctest: +SKIP
        """


AnyModel = str | Corrector | WholeModel
"""A model of `evaluate`: a name of the protocol, or an object from outside."""


@dataclass(frozen=True, slots=True)
class WholeMethod(Method[Sequence[Trip]]):
    """A whole model from outside; each fold fits a copy of it.

    Attributes
    ----------
    model : WholeModel
    """

    model: WholeModel

    def fit(self, data: Sequence[Trip], train: IntArray, seed: int) -> Fitted:
        """Fit a copy of the model to the trips; a scored trip is passed as a plan."""
        model = copy.deepcopy(self.model)
        model.fit([data[i] for i in train])

        def predict(test: IntArray) -> FloatArray:
            return checked([model.predict(Plan.from_trip(data[i])) for i in test], len(test), model)

        return Fitted(predict)

    def required_data(self, hold_out: HoldOut[Any], scored: IntArray) -> Sequence[Trip]:
        """Return the trips of the protocol's data."""
        return tuple(hold_out.data.trips)


def is_whole_model(model: object) -> bool:
    """Check whether a model is a whole model: the first argument of its `fit` is `trips`.

    Raises
    ------
    InvalidInput
        If the model is no regressor and that argument is neither `trips` nor `table`, or `fit` or `predict` is missing.
    """
    require_fitting(model, "models", HOW)
    if is_regressor(model):
        return False
    argument = next(iter(inspect.signature(model.fit).parameters), "")  # type: ignore[attr-defined]  # checked above
    if argument not in ("trips", "table"):
        raise InvalidInput.of(
            "unknown kind of model", "models", f"fit({argument}) of {type(model).__name__}", HOW
        )
    return argument == "trips"


def outside_spec(name: str, model: object, method: Method[Any], simulation: str | None) -> ModelSpec:
    """Make the row of a model from outside; finished folds are reused for an equal object of a class with equal source."""
    try:
        digest = str(joblib.hash((model, inspect.getsource(type(model)))))
    # the class has no source, or the model holds something that cannot be hashed
    except (OSError, TypeError, pickle.PicklingError, AttributeError):
        digest = secrets.token_hex(16)
    title = " ".join(repr(model).split())
    title = type(model).__name__ if " object at 0x" in title else title
    return ModelSpec(name, f"from outside: {title[:120]}", method, simulation, digest)
