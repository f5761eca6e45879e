"""What an evaluation protocol is: models, ways to hold trips out, and results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from tripwatt.errors import Fault, raise_faults
from tripwatt.hybrid import Corrector
from tripwatt.hybrid.outside import packaged_correctors
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.hold_outs import CarChoice, HoldOutChoice, Prepared
from tripwatt.study.evaluation.outside import AnyModel, WholeModel, named_models
from tripwatt.study.evaluation.results import EvaluationRun
from tripwatt.study.evaluation.tasks import ModelSpec
from tripwatt.trips import TripSet


class EvaluationProtocol(Protocol):
    """Models, hold-outs and scores under one name.

    Attributes
    ----------
    name, title : str
        Name by which a run is asked for, and the title of its report.
    models : tuple of ModelSpec
        Models that are compared.
    focus : str or None
        Model that the report describes; None for the hybrid with the lowest mean error.
    published : mapping of str to float
        Mean errors that the paper reports for its data set, by model.
    given : str
        Condition of every error, repeated beside it; empty where there is none to state.

    Examples
    --------
    >>> from tripwatt.study.evaluation import find_protocol
    >>> protocol = find_protocol("paper")
    >>> protocol.name, protocol.models[0].name
    ('paper', 'constant')
    >>> prepared = protocol.prepare(fleet, None, CarChoice("bmw_i3_60ah"), HoldOutChoice())  # doctest: +SKIP
    >>> protocol.assemble(prepared, results, protocol.models, seed=0)  # doctest: +SKIP
    """

    name: str
    title: str
    models: tuple[ModelSpec, ...]
    focus: str | None
    published: Mapping[str, float]
    given: str

    def beside(self, prepared: Prepared[Any], specs: Sequence[ModelSpec], seed: int) -> list[Comparison]:
        """Choose what runs beside the chosen models on the hold-outs, such as learning curves.

        Parameters
        ----------
        prepared : Prepared
            From `prepare`.
        specs : sequence of ModelSpec
            The chosen models.
        seed : int
            Of random draws.

        Returns
        -------
        list of Comparison
            Empty where there are none.

        Examples
        --------
        >>> protocol.beside(prepared, protocol.models, seed=0)  # doctest: +SKIP
        """
        ...

    def from_outside(self, name: str, model: Corrector | WholeModel) -> ModelSpec:
        """Make a row of a model from outside.

        Parameters
        ----------
        name : str
            Of the row.
        model : Corrector or WholeModel
            Unfitted.

        Returns
        -------
        ModelSpec
            To run beside the models of the protocol.

        Raises
        ------
        InvalidInput
            When the protocol has no use for such an object.

        Examples
        --------
        >>> protocol.from_outside("ridge", Ridge())  # doctest: +SKIP
        """
        ...

    def prepare(
        self, fleet: TripSet, test_fleet: TripSet | None, car: CarChoice, wanted: HoldOutChoice
    ) -> Prepared[Any]:
        """Audit the trips, simulate them and set the folds.

        Parameters
        ----------
        fleet : TripSet
            Logs to evaluate on.
        test_fleet : TripSet or None
            Logs to test on instead of held-out trips, where the protocol has such a test.
        car : CarChoice
            The car that is simulated.
        wanted : HoldOutChoice
            The hold-outs that run.

        Returns
        -------
        Prepared
            Trips with their simulation, and the folds.

        Raises
        ------
        InvalidInput
            On an unknown car or hold-out, or when too few trips are left.
        """
        ...

    def assemble(
        self, prepared: Prepared[Any], main: Sequence[Comparison], beside: Sequence[Comparison], seed: int
    ) -> EvaluationRun:
        """Score the held-out predictions.

        Parameters
        ----------
        prepared : Prepared
            From `prepare`.
        main : sequence of Comparison
            Results of the chosen models on each hold-out.
        beside : sequence of Comparison
            Results of what `beside` chose.
        seed : int
            Of the bootstrap.

        Returns
        -------
        EvaluationRun
            Everything that the report shows.
        """
        ...


def choose_models(
    protocol: EvaluationProtocol,
    models: Sequence[AnyModel] | Mapping[str, AnyModel] | None = None,
    seed: int = 0,
) -> tuple[ModelSpec, ...]:
    """Choose the models of a protocol, or those of them that are named, and models from outside.

    Parameters
    ----------
    protocol : EvaluationProtocol
        With its models.
    models : sequence or mapping of str to (str, Corrector or WholeModel), optional
        Names of models of the protocol and of correctors of installed packages, and objects from outside, perhaps with names of
        their rows; all models of the protocol by default.
    seed : int
        For correctors of packages.

    Returns
    -------
    tuple of ModelSpec
        In the order of the protocol; those from outside at the end.

    Raises
    ------
    InvalidInput
        On an unknown model, and an object that is no model.

    Examples
    --------
    >>> from tripwatt.study.evaluation import find_protocol
    >>> [spec.name for spec in choose_models(find_protocol("paper"), ["linear6", "constant"])]
    ['constant', 'linear6']
    """
    if models is None:
        return protocol.models
    known, packaged = [spec.name for spec in protocol.models], packaged_correctors()
    named = named_models(models)
    names = [model for model in named.values() if isinstance(model, str)]
    unknown = [name for name in names if name not in known and name not in packaged]
    taken = [name for name, model in named.items() if name in known and not isinstance(model, str)]
    faults = [Fault.unknown("unknown model", "models", name, [*known, *packaged]) for name in unknown]
    allowed = "a name that no model of the protocol has"
    raise_faults([*faults, *(Fault("name is taken", "models", name, allowed) for name in taken)])
    others = {
        name: packaged[model](seed) if isinstance(model, str) else model
        for name, model in named.items()
        if not (isinstance(model, str) and model in known)
    }
    outside = [protocol.from_outside(name, model) for name, model in others.items()]
    rows = {model: name for name, model in named.items() if isinstance(model, str)}
    own = [replace(spec, name=rows[spec.name]) for spec in protocol.models if spec.name in rows]
    return (*own, *outside)
