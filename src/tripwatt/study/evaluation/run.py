"""Audit, simulate, train and score: every model of a protocol on trips it was not fitted on.

Everything that is fitted, tuned or scaled is fitted inside the fold.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from tripwatt.errors import Fault, InvalidInput, require_type
from tripwatt.sources import read_logs
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.folds import Execution, run_folds
from tripwatt.study.evaluation.forecast_protocol import ForecastProtocol
from tripwatt.study.evaluation.hold_outs import CarChoice, HoldOutChoice, HoldOuts
from tripwatt.study.evaluation.outside import AnyModel
from tripwatt.study.evaluation.paper_protocol import PaperProtocol
from tripwatt.study.evaluation.protocol import EvaluationProtocol, choose_models
from tripwatt.study.evaluation.results import EvaluationRun
from tripwatt.trips import Recorded, Trip, TripSet
from tripwatt.vehicles import Vehicle

PROTOCOLS: Final[Mapping[str, EvaluationProtocol]] = {
    protocol.name: protocol for protocol in (PaperProtocol(), ForecastProtocol())
}
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
        The protocol.

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
        raise InvalidInput(Fault.unknown("unknown protocol", "protocol", name, PROTOCOLS))
    return PROTOCOLS[name]


def evaluate(
    trips: TripSet | Sequence[Trip] | Path | str,
    car: Vehicle | CarChoice | Path | str = "bmw_i3_60ah",
    *,
    protocol: str | EvaluationProtocol = DEFAULT_PROTOCOL,
    models: Sequence[AnyModel] | Mapping[str, AnyModel] | None = None,
    hold_outs: HoldOuts | None = None,
    seed: int = 0,
    test_fleet: TripSet | None = None,
    execution: Execution | None = None,
) -> EvaluationRun:
    """Audit, simulate, train and score every model of a protocol on held-out trips.

    Parameters
    ----------
    trips : TripSet, sequence of Trip, or path
        Trips of one car as they were recorded. A path is read as by `read_logs`, strictly; read other kinds of logs than
        those of TUM with `read_logs` first.
    car : Vehicle, str or path, or CarChoice
        The car, its name, or the path of its TOML. The values of a `CarChoice` replace those of the car, also under a
        preset of the protocol; the notes of protocol "paper" name them.
    protocol : {"paper", "forecast"} or EvaluationProtocol
        Decides which models run, which trips are held out, and what is scored.
    models : sequence, or mapping of str to model, optional
        Names of some of the protocol's models, and models from outside: a regressor of scikit-learn's kind as a corrector, an
        object with ``fit(table)`` and ``predict(table)`` as a corrector on segments (protocol "forecast"), or one with
        ``fit(trips)`` and ``predict(trip)`` as a whole model. The keys of a mapping are the names of the rows. All
        models of the protocol by default.
    hold_outs : str, splitter, or sequence of them, optional
        Which hold-outs run: a scheme ("leave_one_trip_out"), a set of trips ("reference"), both
        ("leave_one_trip_out:reference"), or a splitter of scikit-learn's kind over the trips of the main set, with
        their days as groups. The studies beside the table run only by default, that is with all hold-outs of the
        protocol.
    seed : int
        Runs with equal seeds are identical, whatever the number of processes.
    test_fleet : TripSet, optional
        Only for protocol "forecast": fit on `trips`, score these trips.
    execution : Execution, optional
        Number of processes, and folder of finished folds.

    Returns
    -------
    EvaluationRun
        Scores of every model, paired comparisons, the audit and the notes of the run. A trip that a model fails to predict is left
        out for all models; `EvaluationRun.failed` has the reasons.

    Raises
    ------
    InvalidInput
        If every trip fails, a protocol, model, car, value or hold-out is unknown, an object is no model, or too few trips are left.

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.study.evaluation import Execution
    >>> tw.evaluate(tw.sample_trips(), models=["constant", "physics"], execution=Execution(n_jobs=1))
    <EvaluationRun protocol paper, 2 models, 15 trips read>
    """
    chosen = find_protocol(protocol) if isinstance(protocol, str) else protocol
    specs, choice = choose_models(chosen, models, seed), HoldOutChoice.from_argument(hold_outs)
    car = car if isinstance(car, CarChoice) else CarChoice(car)
    prepared = chosen.prepare(_fleet(trips), test_fleet, car, choice)
    main = [Comparison(hold_out, specs) for hold_out in prepared.hold_outs]
    further = chosen.further_comparisons(prepared, specs, seed) if choice.chosen is None else []
    done = run_folds([*main, *further], seed, execution or Execution(), inner_errors=bool(further))
    complete, rest = done[: len(main)], [comparison.without_failed() for comparison in done[len(main) :]]
    failed = [row for comparison in complete for row in comparison.failed]
    scored = [left for comparison in complete if (left := comparison.without_failed()).results]
    if not scored:
        raise InvalidInput.of("no trip was scored", "evaluate", failed[0]["reason"], "a prediction of a trip")
    notes = (*prepared.notes, *(_note(comparison) for comparison in complete if comparison.failed))
    prepared = replace(prepared, hold_outs=[comparison.hold_out for comparison in scored], notes=notes)
    run = chosen.assemble(prepared, scored, rest, seed)
    return replace(run, results=run.results | {"failed": failed})


def _note(comparison: Comparison) -> str:
    """Return how many trips of a hold-out were scored, and why the first of the others was not."""
    failed, n = comparison.failed, len(comparison.hold_out.scored)
    trips, first = len({row["trip"] for row in failed}), f"{failed[0]['trip']} ({failed[0]['reason']})"
    where = f"{comparison.hold_out.scheme}:{comparison.hold_out.trips}"
    return f"{where}: {n - trips} of {n} trips scored; {trips} failed: {first}{', ...' if trips > 1 else ''}"


def _fleet(trips: TripSet | Sequence[Trip] | Path | str) -> TripSet:
    """Read trips as a fleet.

    Raises
    ------
    InvalidInput
        If `read_logs` raises it, or an element is no trip.
    """
    if isinstance(trips, TripSet):
        return trips
    if isinstance(trips, str | Path):
        return read_logs(trips, strict=True)
    allowed = "trips, logs, a TripSet or a folder"
    logs = require_type("trips", trips, Iterable, allowed)
    return TripSet("trips", tuple(require_type("trips", log, Recorded, allowed) for log in logs))
