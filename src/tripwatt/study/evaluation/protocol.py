"""The interface of an evaluation protocol: models, hold-outs and results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from tripwatt.errors import Fault, raise_faults
from tripwatt.hybrid import Corrector
from tripwatt.hybrid.outside import packaged_correctors
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.hold_outs import CarChoice, HoldOutChoice, Prepared, numbered_names
from tripwatt.study.evaluation.outside import AnyModel, WholeModel
from tripwatt.study.evaluation.results import EvaluationRun
from tripwatt.study.evaluation.tasks import ModelSpec
from tripwatt.trips import TripSet
from tripwatt.trips.columns import Column, number_faults


class EvaluationProtocol(Protocol):
    """Models, hold-outs and scores under one name.

    Attributes
    ----------
    name : str
        Name of the protocol.
    models : tuple of ModelSpec
        Models that are compared.
    focus : str or None
        Model that the report describes; None for the hybrid with the lowest mean error.
    published : mapping of str to float
        Mean errors that the paper reports for its data set, by model.
    given : str
        Condition of every error, repeated beside it; empty if there is none.

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
    models: tuple[ModelSpec, ...]
    focus: str | None
    published: Mapping[str, float]
    given: str

    def further_comparisons(
        self, prepared: Prepared[Any], specs: Sequence[ModelSpec], seed: int
    ) -> list[Comparison]:
        """Choose comparisons in addition to the chosen models on the hold-outs, such as learning curves.

        Parameters
        ----------
        prepared : Prepared
            From `prepare`.
        specs : sequence of ModelSpec
            The chosen models.
        seed : int
            Seed of random draws.

        Returns
        -------
        list of Comparison
            Further comparisons; empty if there are none.

        Examples
        --------
        >>> protocol.further_comparisons(prepared, protocol.models, seed=0)  # doctest: +SKIP
        """

    def from_outside(self, name: str, model: Corrector | WholeModel) -> ModelSpec:
        """Make the row of a model from outside.

        Parameters
        ----------
        name : str
            Name of the row.
        model : Corrector or WholeModel
            Unfitted model.

        Returns
        -------
        ModelSpec
            Model to run beside those of the protocol.

        Raises
        ------
        InvalidInput
            If the protocol cannot use such an object.

        Examples
        --------
        >>> protocol.from_outside("ridge", Ridge())  # doctest: +SKIP
        """

    def prepare(
        self, fleet: TripSet, test_fleet: TripSet | None, car: CarChoice, choice: HoldOutChoice
    ) -> Prepared[Any]:
        """Audit the trips, simulate them and set the folds.

        Parameters
        ----------
        fleet : TripSet
            Logs to evaluate on.
        test_fleet : TripSet or None
            Logs to test on instead of held-out trips, if the protocol has such a test.
        car : CarChoice
            The car that is simulated.
        choice : HoldOutChoice
            The hold-outs that run.

        Returns
        -------
        Prepared
            Trips with their simulation, and the folds.

        Raises
        ------
        InvalidInput
            If the car or a hold-out is unknown, or too few trips are left.
        """

    def assemble(
        self, prepared: Prepared[Any], main: Sequence[Comparison], further: Sequence[Comparison], seed: int
    ) -> EvaluationRun:
        """Score the held-out predictions.

        Parameters
        ----------
        prepared : Prepared
            From `prepare`.
        main : sequence of Comparison
            Results of the chosen models on each hold-out.
        further : sequence of Comparison
            Results of the comparisons from `further_comparisons`.
        seed : int
            Seed of the bootstrap.

        Returns
        -------
        EvaluationRun
            Everything that the report shows.
        """


def choose_models(
    protocol: EvaluationProtocol,
    models: Sequence[AnyModel] | Mapping[str, AnyModel] | None = None,
    seed: int = 0,
) -> tuple[ModelSpec, ...]:
    """Choose all or the named models of a protocol, and models from outside.

    Parameters
    ----------
    protocol : EvaluationProtocol
        Protocol whose models are chosen.
    models : sequence or mapping of str to (str, Corrector or WholeModel), optional
        Names of models of the protocol and of correctors of installed packages, and objects from outside. A mapping
        gives the names of their rows. All models of the protocol by default.
    seed : int
        Seed for correctors of packages.

    Returns
    -------
    tuple of ModelSpec
        Models in the order of the protocol, then those from outside.

    Raises
    ------
    InvalidInput
        If a model is unknown, its name is taken, or an object is no model.

    Examples
    --------
    >>> from tripwatt.study.evaluation import find_protocol
    >>> [spec.name for spec in choose_models(find_protocol("paper"), ["linear6", "constant"])]
    ['constant', 'linear6']
    """
    raise_faults(number_faults("seed", seed, Column("", 0, 2**63 - 1, ""), whole=True))
    if models is None:
        return protocol.models
    own_names, packaged = [spec.name for spec in protocol.models], packaged_correctors()
    # the name of a row is the key of a mapping, or the model's name or class
    named = dict(models if isinstance(models, Mapping) else zip(numbered_names(models), models, strict=True))
    unknown = [m for m in named.values() if isinstance(m, str) and m not in (*own_names, *packaged)]
    taken = [name for name, model in named.items() if name in own_names and not isinstance(model, str)]
    faults = [Fault.unknown("unknown model", "models", name, [*own_names, *packaged]) for name in unknown]
    allowed = "a name that no model of the protocol has"
    raise_faults([*faults, *(Fault("name is taken", "models", name, allowed) for name in taken)])
    further_models = {
        name: packaged[model].load()(seed) if isinstance(model, str) else model
        for name, model in named.items()
        if not (isinstance(model, str) and model in own_names)
    }
    outside = [protocol.from_outside(name, model) for name, model in further_models.items()]
    shown = {model: name for name, model in named.items() if isinstance(model, str)}
    own_models = [replace(spec, name=shown[spec.name]) for spec in protocol.models if spec.name in shown]
    return (*own_models, *outside)
