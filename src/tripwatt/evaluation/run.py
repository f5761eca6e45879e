"""Audit, simulate, train and score: every model of a protocol on trips it was not fitted on.

Everything that is fitted, tuned or scaled is fitted inside the fold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

from tripwatt.errors import InvalidInput
from tripwatt.evaluation.comparison import Comparison
from tripwatt.evaluation.folds import Execution, run_folds
from tripwatt.evaluation.forecast_protocol import ForecastProtocol
from tripwatt.evaluation.hold_outs import CarChoice
from tripwatt.evaluation.paper_protocol import PaperProtocol
from tripwatt.evaluation.protocol import EvaluationProtocol, choose_models
from tripwatt.evaluation.results import EvaluationRun
from tripwatt.trips import Fleet

PROTOCOLS: Final[Mapping[str, EvaluationProtocol]] = MappingProxyType(
    {protocol.name: protocol for protocol in (PaperProtocol(), ForecastProtocol())}
)
"""Protocols by name."""

DEFAULT_PROTOCOL: Final = "paper"


def find_protocol(name: str) -> EvaluationProtocol:
    """Find a protocol by its name.

    Parameters
    ----------
    name : str
        A key of `PROTOCOLS`.

    Returns
    -------
    EvaluationProtocol
        With its models and the sections of its report.

    Raises
    ------
    InvalidInput
        On an unknown name.

    Examples
    --------
    >>> [model.name for model in find_protocol("paper").models][:3]
    ['constant', 'linear4', 'linear6']
    """
    if name not in PROTOCOLS:
        raise InvalidInput.of("unknown protocol", "--protocol", name, ", ".join(PROTOCOLS))
    return PROTOCOLS[name]


def evaluate(
    fleet: Fleet,
    *,
    protocol: str | EvaluationProtocol = DEFAULT_PROTOCOL,
    models: Sequence[str] | None = None,
    vehicle: str = "bmw_i3_60ah",
    overrides: Mapping[str, float | str] | None = None,
    seed: int = 0,
    test_fleet: Fleet | None = None,
    execution: Execution | None = None,
) -> EvaluationRun:
    """Audit, simulate, train and score every model of a protocol on held-out trips.

    Parameters
    ----------
    fleet : Fleet
        Raw trips of one car.
    protocol : {"paper", "forecast"} or EvaluationProtocol
        Which models, which trips are held out, and what is scored.
    models : sequence of str, optional
        Some of the protocol's models; all by default.
    vehicle : str
        Name or path of the vehicle's TOML.
    overrides : mapping of str to (float or str), optional
        Values of the car that replace those of its TOML, as for `load_vehicle`; the notes of the run name them.
    seed : int
        Makes the run identical, also over a different number of processes.
    test_fleet : Fleet, optional
        Protocol "forecast" alone: fit on `fleet`, score on these trips.
    execution : Execution, optional
        Processes, and where finished folds are kept.

    Returns
    -------
    EvaluationRun
        Scores of every model, paired comparisons, the audit and the notes of the run.

    Raises
    ------
    InvalidInput
        On an unknown protocol, model, vehicle or override, or when too few trips are left.

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.evaluation import Execution
    >>> tw.evaluate(tw.synthetic_fleet(6), models=["constant", "physics"], execution=Execution(n_jobs=1))
    <EvaluationRun protocol paper, 2 models, 6 trips read>
    """
    chosen = find_protocol(protocol) if isinstance(protocol, str) else protocol
    specs = choose_models(chosen, models)
    prepared = chosen.prepare(fleet, test_fleet, CarChoice(vehicle, overrides))
    main = [Comparison(hold_out, specs) for hold_out in prepared.hold_outs]
    done = run_folds([*main, *chosen.beside(prepared, specs, seed)], seed, execution or Execution())
    return chosen.assemble(prepared, done[: len(main)], done[len(main) :], seed)
