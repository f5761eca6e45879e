"""What an evaluation protocol is: models, ways to hold trips out, results, and panels of the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy.typing as npt

from tripwatt.arrays import FloatArray
from tripwatt.auditing import Audit
from tripwatt.errors import Fault, InvalidInput
from tripwatt.evaluation.hold_outs import HoldOut
from tripwatt.trips import Fleet
from tripwatt.vehicles import Vehicle


@dataclass(frozen=True, eq=False)
class FoldResult:
    """Held-out predictions of one fold.

    Attributes
    ----------
    evaluation : int
        Number of the hold-out.
    model : str
    fold : int
    predicted_wh : ndarray
        Cumulative energy at every row of the fold's trips, or the energy of each of them [Wh].
    fit_s, predict_ms : float
    extra : mapping of str to ndarray
        What a protocol keeps beside the prediction, by name.
    """

    evaluation: int
    model: str
    fold: int
    predicted_wh: FloatArray
    fit_s: float
    predict_ms: float
    extra: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)


class Task(Protocol):
    """Some folds of one model of one hold-out, to be run anywhere."""

    @property
    def evaluation(self) -> int:
        """Number of the hold-out."""
        ...

    @property
    def members(self) -> tuple[int, ...]:
        """Numbers of the folds."""
        ...

    @property
    def rank(self) -> int:
        """Tasks of a lower rank take longer and start first, so that no core waits for one at the end."""
        ...

    def run(self) -> list[FoldResult]:
        """Fit and predict."""
        ...


class ModelSpec(Protocol):
    """A model of a protocol.

    Attributes
    ----------
    name : str
        In every table and file.
    title : str
        A short description.
    simulation : str or None
        Name of the simulated energy that the model corrects; None without physics.
    """

    @property
    def name(self) -> str: ...  # noqa: D102 - see Attributes

    @property
    def title(self) -> str: ...  # noqa: D102

    @property
    def simulation(self) -> str | None: ...  # noqa: D102

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """Numbers of the folds to run; empty where the model does not take part."""
        ...

    def tasks(self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int) -> Iterator[Task]:
        """Tasks for some folds of the hold-out with this number."""
        ...


@dataclass(frozen=True, slots=True)
class ReportSection:
    """A heading of the report, and the names under which `tripwatt.report` registers the panels below it."""

    key: str
    title: str
    panels: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Prepared:
    """Trips as a protocol evaluates them.

    Attributes
    ----------
    hold_outs : list of HoldOut
        The main one first.
    fleet, test_fleet : Fleet, Fleet or None
    audited : Audit
        Of the trips that are scored.
    cars : mapping of str to Vehicle
        Name of the simulated energy -> car.
    notes : tuple of str
    """

    hold_outs: list[HoldOut]
    fleet: Fleet
    test_fleet: Fleet | None
    audited: Audit
    cars: Mapping[str, Vehicle]
    notes: tuple[str, ...]

    @property
    def scored_fleet(self) -> Fleet:
        """The fleet whose trips are scored."""
        return self.test_fleet or self.fleet


@dataclass(frozen=True, slots=True)
class CarChoice:
    """A car by name or path, and values that replace those of its file."""

    name: str
    overrides: Mapping[str, float | str] | None = None


class EvaluationProtocol(Protocol):
    """Models, hold-outs and scores under one name.

    Attributes
    ----------
    name, title : str
        Name by which a run is asked for, and the title of its report.
    models : tuple of ModelSpec
        Models that are compared.
    sections : tuple of ReportSection
        The report of a run.
    focus : str or None
        Model that the report describes; None for the hybrid with the lowest mean error.
    published : mapping of str to float
        Mean errors that the paper reports for its data set, by model.
    given : str
        Condition of every error, repeated beside it; empty where there is none to state.

    Examples
    --------
    >>> from tripwatt.evaluation import find_protocol
    >>> protocol = find_protocol("paper")
    >>> protocol.name, protocol.models[0].name
    ('paper', 'constant')
    >>> prepared = protocol.prepare(fleet, None, CarChoice("bmw_i3_60ah"))  # doctest: +SKIP
    >>> protocol.assemble(prepared, results, protocol.models, seed=0)  # doctest: +SKIP
    """

    @property
    def name(self) -> str:
        """Name by which a run is asked for."""
        ...

    @property
    def title(self) -> str:
        """Title of the report."""
        ...

    @property
    def models(self) -> tuple[ModelSpec, ...]:
        """Models that are compared."""
        ...

    @property
    def sections(self) -> tuple[ReportSection, ...]:
        """Sections of the report of a run."""
        ...

    @property
    def focus(self) -> str | None:
        """Model that the report describes; None for the hybrid with the lowest mean error."""
        ...

    @property
    def published(self) -> Mapping[str, float]:
        """Mean errors that the paper reports for its data set, by model."""
        ...

    @property
    def given(self) -> str:
        """Condition of every error, repeated beside it; empty where there is none to state."""
        ...

    def extra(self, specs: Sequence[ModelSpec]) -> tuple[ModelSpec, ...]:
        """Choose the runs beside the chosen models that are no rows of the table, such as learning curves.

        Parameters
        ----------
        specs : sequence of ModelSpec
            The chosen models.

        Returns
        -------
        tuple of ModelSpec
            Empty where there are none.

        Examples
        --------
        >>> from tripwatt.evaluation import find_protocol
        >>> protocol = find_protocol("paper")
        >>> protocol.extra(protocol.models[:1])
        ()
        """
        ...

    def prepare(self, fleet: Fleet, test_fleet: Fleet | None, car: CarChoice) -> Prepared:
        """Audit the trips, simulate them and set the folds.

        Parameters
        ----------
        fleet : Fleet
            Logs to evaluate on.
        test_fleet : Fleet or None
            Logs to test on instead of held-out trips, where the protocol has such a test.
        car : CarChoice
            The car that is simulated.

        Returns
        -------
        Prepared
            Trips with their simulation, and the folds.

        Raises
        ------
        InvalidInput
            On an unknown car, or when too few trips are left.
        """
        ...

    def assemble(
        self, prepared: Prepared, results: Sequence[FoldResult], specs: Sequence[ModelSpec], seed: int
    ) -> Any:
        """Score the held-out predictions.

        Parameters
        ----------
        prepared : Prepared
            From `prepare`.
        results : sequence of FoldResult
            Of every fold.
        specs : sequence of ModelSpec
            The chosen models.
        seed : int
            Of the bootstrap.

        Returns
        -------
        EvaluationRun
            Everything that the report shows.
        """
        ...


def choose_models(protocol: EvaluationProtocol, names: Sequence[str] | None = None) -> tuple[ModelSpec, ...]:
    """Choose the models of a protocol, or those of them that are named.

    Parameters
    ----------
    protocol : EvaluationProtocol
        With its models.
    names : sequence of str, optional
        Names of models; all by default.

    Returns
    -------
    tuple of ModelSpec
        In the order of the protocol.

    Raises
    ------
    InvalidInput
        On an unknown model.

    Examples
    --------
    >>> from tripwatt.evaluation import find_protocol
    >>> [spec.name for spec in choose_models(find_protocol("paper"), ["linear6", "constant"])]
    ['constant', 'linear6']
    """
    specs = protocol.models
    if names is None:
        return specs
    known = [spec.name for spec in specs]
    wrong = [name for name in names if name not in known]
    if wrong:
        raise InvalidInput([Fault("unknown model", "--models", name, ", ".join(known)) for name in wrong])
    return tuple(spec for spec in specs if spec.name in names)


Progress = Callable[[int, int], None]
"""Called with (finished folds, all folds)."""
