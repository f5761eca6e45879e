"""Held-out runs: leave one trip out, leave one day out, over every set of trips and every model.

Everything that is fitted, tuned or scaled is fitted inside the fold. A fold is one task; finished folds are kept on
disk, so that an interrupted run goes on where it stopped and ends with the identical table.
"""

from __future__ import annotations

import hashlib
import json
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

import tripwatt
from tripwatt.auditing import Audit, audit
from tripwatt.errors import Fault, InvalidInput
from tripwatt.evaluation.protocols import PHYSICS_PRESETS, ModelSpec, protocol_models
from tripwatt.evaluation.results import Evaluation, EvaluationRun, FoldResult, assemble
from tripwatt.hybrid import HybridModel, IntArray, TripTable, build_table
from tripwatt.parallel import map_unordered
from tripwatt.trips import Fleet, Trip, value_faults
from tripwatt.trips.messages import message
from tripwatt.vehicles import Vehicle, load_vehicle

if TYPE_CHECKING:
    from tripwatt.evaluation.forecast_sets import ForecastSet

FOLDS_PER_TASK: Final = 4
MIN_FOLDS: Final = 3

Progress = Callable[[int, int], None]
"""Called with (finished folds, all folds)."""


@dataclass(frozen=True)
class _Task:
    """Some folds of one model in one evaluation."""

    evaluation: int
    spec: ModelSpec
    table: TripTable
    folds: IntArray
    members: tuple[int, ...]
    seed: int


def evaluate(
    fleet: Fleet,
    *,
    protocol: str = "paper",
    models: Sequence[str] | None = None,
    vehicle: str = "bmw_i3_60ah",
    overrides: Mapping[str, float | str] | None = None,
    seed: int = 0,
    n_jobs: int = -1,
    work_dir: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    test_fleet: Fleet | None = None,
) -> EvaluationRun:
    """Audit, simulate, train and score every model of a protocol on trips it has not seen.

    Parameters
    ----------
    fleet : Fleet
        Raw trips of one car.
    protocol : {"paper", "forecast"}
    models : sequence of str, optional
        Some of the protocol's models; all by default.
    vehicle : str
        Name or path of the vehicle's TOML.
    overrides : mapping of str to (float or str), optional
        Values of the car that replace those of its TOML, as for `load_vehicle`; the notes of the run name them.
    seed : int
        Makes the run identical, also over a different number of processes.
    n_jobs : int
        Processes; -1 takes all cores.
    work_dir : Path, optional
        Where finished folds are kept.
    resume : bool
        Use the finished folds that are there, if they belong to the same trips, models, seed and version.
    progress : callable, optional
    test_fleet : Fleet, optional
        Protocol "forecast" alone: fit on `fleet`, score on these trips.

    Raises
    ------
    InvalidInput
        On an unknown protocol, model, vehicle or override, or when too few trips are left.
    """
    specs = protocol_models(protocol, None if models is None else tuple(models))
    if protocol == "forecast":
        keep = _StoreAt(work_dir, specs, seed, resume)
        return _evaluate_forecast(fleet, test_fleet, specs, vehicle, overrides, seed, n_jobs, keep, progress)
    if test_fleet is not None:
        raise InvalidInput(
            Fault("option not available", "--test", f"protocol {protocol!r}", "protocol 'forecast'")
        )
    physics = {name: load_vehicle(vehicle, preset, overrides) for name, preset in PHYSICS_PRESETS.items()}
    given = [f"{physics['physics'].name} with {key} = {value}" for key, value in (overrides or {}).items()]
    audited = audit(fleet)
    evaluations, notes = _evaluations(fleet, audited, lambda trips: build_table(trips, physics))
    store = _FoldStore.open(work_dir, evaluations, specs, seed, resume)
    results = _run_folds(evaluations, specs, seed, n_jobs, store, progress)
    return assemble(
        evaluations,
        results,
        specs=specs,
        fleet=fleet,
        audited=audited,
        protocol=protocol,
        seed=seed,
        physics=physics,
        notes=(*map(message, fleet.notes), *given, *notes),
    )


@dataclass(frozen=True)
class _StoreAt:
    """Where and how finished folds are kept."""

    work_dir: Path | None
    specs: Sequence[ModelSpec]
    seed: int
    resume: bool

    def open(self, evaluations: Sequence[Evaluation]) -> _FoldStore:
        return _FoldStore.open(self.work_dir, evaluations, self.specs, self.seed, self.resume)


def _evaluate_forecast(
    fleet: Fleet,
    test_fleet: Fleet | None,
    specs: Sequence[ModelSpec],
    vehicle: str,
    overrides: Mapping[str, float | str] | None,
    seed: int,
    n_jobs: int,
    store_at: _StoreAt,
    progress: Progress | None,
) -> EvaluationRun:
    from tripwatt.evaluation.forecast_results import assemble_forecast
    from tripwatt.evaluation.forecast_sets import ForecastSet, fitted_elsewhere, held_out

    car = load_vehicle(vehicle, "default", overrides)

    def prepare(trips: Sequence[Trip]) -> ForecastSet:
        return ForecastSet.of(trips, car)

    audited = audit(fleet)
    notes = list(map(message, fleet.notes))
    shown = audited
    if test_fleet is None:
        evaluations, sets, more = held_out(fleet, audited, prepare)
    else:
        shown = audit(test_fleet)
        evaluations, sets, more = fitted_elsewhere(fleet, audited, test_fleet, shown, prepare)
        notes = [*notes, *map(message, test_fleet.notes)]
    store = store_at.open(evaluations)
    results = _run_forecast_folds(evaluations, sets, specs, seed, n_jobs, store, car, progress)
    return assemble_forecast(
        evaluations,
        sets,
        results,
        specs=specs,
        fleet=fleet,
        test_fleet=test_fleet,
        audited=shown,
        seed=seed,
        vehicle=car,
        notes=(*notes, *more),
    )


def _run_forecast_folds(
    evaluations: Sequence[Evaluation],
    sets: Sequence[ForecastSet],
    specs: Sequence[ModelSpec],
    seed: int,
    n_jobs: int,
    store: _FoldStore,
    vehicle: Vehicle,
    progress: Progress | None,
) -> list[FoldResult]:
    from tripwatt.evaluation.forecast_results import CURVE, alike
    from tripwatt.evaluation.forecast_run import CURVE_MODELS, cost_of, curve_tasks, run_task, tasks_of

    results: list[FoldResult] = []
    tasks: list[Any] = []
    same_as = _first_alike(evaluations)
    own = [(i, e) for i, e in enumerate(evaluations) if same_as[i] == i]
    for index, evaluation in own:
        for spec in specs:
            done = store.load(index, spec.name)
            results.extend(done)
            every = set(evaluation.folds[evaluation.folds >= 0].tolist())
            missing = sorted(every - {r.fold for r in done})
            tasks.extend(tasks_of(index, evaluation, sets[index], spec, missing, seed, vehicle))
    if evaluations[0].scheme == "leave_one_trip_out" and set(CURVE_MODELS) <= {s.name for s in specs}:
        done = store.load(0, CURVE)
        results.extend(done)
        drawn = {r.fold for r in done}
        tasks.extend(t for t in curve_tasks(0, sets[0], seed) if t.fold not in drawn)
    tasks.sort(key=cost_of)
    finished = len(results)
    total = finished + sum(len(task.members) for task in tasks)
    if progress:
        progress(finished, total)
    for index, found in map_unordered(run_task, tasks, n_jobs=n_jobs):
        store.save(tasks[index].evaluation, found[0].model, found)
        results.extend(found)
        finished += len(found)
        if progress:
            progress(finished, total)
    for index, first in enumerate(same_as):
        if first != index:
            results.extend(alike(results, index, first))
    return results


def _evaluations(
    fleet: Fleet, audited: Audit, build: Callable[[Sequence[Trip]], TripTable]
) -> tuple[list[Evaluation], list[str]]:
    """Each set of trips under leave-one-trip-out, and the main set under leave-one-day-out."""
    usable, notes = _usable(fleet.trips)
    sets: dict[str, Sequence[Trip]] = {
        "reference": fleet.reference_trips(),
        "audited": audited.trips,
        "all": usable,
    }
    evaluations: list[Evaluation] = []
    for name, trips in sets.items():
        if not trips:
            if name == "reference" and fleet.reference is not None:
                notes.append(f"none of the reference trips of the data set {fleet.name!r} is here")
            continue
        evaluations.append(_leave_one_trip_out(name, build(trips)))
    if not evaluations or max(len(e.table) for e in evaluations) < MIN_FOLDS:
        got = f"{len(audited.trips)} of {len(fleet.trips)}"
        fault = Fault(
            "too few trips after the audit", fleet.name, got, f"at least {MIN_FOLDS} with measured energy"
        )
        raise InvalidInput(fault)
    main = evaluations[0]
    days = [t.context.day for t in main.table.trips]
    if any(day is None for day in days) or len(set(days)) < MIN_FOLDS:
        notes.append("leave-one-day-out left out: the dates of the trips are unknown or fewer than three")
    else:
        _, folds = np.unique(np.array([str(day) for day in days]), return_inverse=True)
        evaluations.append(Evaluation("leave_one_day_out", main.trips, main.table, folds.astype(np.int64)))
    notes.extend(main.table.notes)
    return evaluations, notes


def _leave_one_trip_out(name: str, table: TripTable) -> Evaluation:
    return Evaluation("leave_one_trip_out", name, table, np.arange(len(table), dtype=np.int64))


def _usable(trips: Sequence[Trip]) -> tuple[list[Trip], list[str]]:
    """Unaudited trips that can be simulated and scored at all; the others are named."""
    usable, notes = [], []
    for trip in trips:
        faults = list(value_faults(trip.samples, trip.trip_id))
        if trip.observed_energy_wh is None or not trip.observed_energy_wh > 0:
            faults.append(Fault("no measured, positive energy", trip.trip_id))
        if faults:
            notes.append(f"unaudited row leaves out {faults[0]}")
        else:
            usable.append(trip)
    return usable, notes


def _run_folds(
    evaluations: Sequence[Evaluation],
    specs: Sequence[ModelSpec],
    seed: int,
    n_jobs: int,
    store: _FoldStore,
    progress: Progress | None,
) -> list[FoldResult]:
    results: list[FoldResult] = []
    same_as = _first_alike(evaluations)
    own = [(index, evaluation) for index, evaluation in enumerate(evaluations) if same_as[index] == index]
    total = sum(int(e.folds.max()) + 1 for _, e in own) * len(specs)
    tasks: list[_Task] = []
    for index, evaluation in own:
        for spec in specs:
            done = store.load(index, spec.name)
            results.extend(done)
            missing = sorted(set(range(int(evaluation.folds.max()) + 1)) - {r.fold for r in done})
            tasks.extend(_tasks(index, evaluation, spec, missing, seed))
    finished = len(results)
    if progress:
        progress(finished, total)
    tasks.sort(
        key=lambda task: -len(task.members)
    )  # the long tasks first, so that no core waits for one at the end
    for index, found in map_unordered(_run_task, tasks, n_jobs=n_jobs):
        store.save(tasks[index].evaluation, tasks[index].spec.name, found)
        results.extend(found)
        finished += len(found)
        if progress:
            progress(finished, total)
    for index, first in enumerate(same_as):
        if first != index:
            results.extend([replace(r, evaluation=index) for r in results if r.evaluation == first])
    return results


def _first_alike(evaluations: Sequence[Evaluation]) -> list[int]:
    """For each evaluation the first one with the same trips in the same folds: it is run once."""
    keys = [(e.table.digest(), e.folds.tobytes()) for e in evaluations]
    return [keys.index(key) for key in keys]


def _tasks(
    index: int, evaluation: Evaluation, spec: ModelSpec, missing: Sequence[int], seed: int
) -> Iterator[_Task]:
    if not missing:
        return
    model = spec.build(seed)
    slim = evaluation.table.without_samples()
    together = isinstance(model, HybridModel) and model.shares_folds
    size = len(missing) if together or not isinstance(model, HybridModel) else FOLDS_PER_TASK
    for start in range(0, len(missing), size):
        yield _Task(index, spec, slim, evaluation.folds, tuple(missing[start : start + size]), seed)


def _run_task(task: _Task) -> list[FoldResult]:
    model = task.spec.build(task.seed)
    if isinstance(model, HybridModel) and model.shares_folds:
        return _run_shared(task, model)
    return [_run_fold(task, fold) for fold in task.members]


def _run_fold(task: _Task, fold: int) -> FoldResult:
    held_out = np.flatnonzero(task.folds == fold)
    model = task.spec.build(task.seed)
    started = time.perf_counter()
    model.fit(task.table.take(np.flatnonzero(task.folds != fold)))
    fitted = time.perf_counter()
    test = task.table.take(held_out)
    predicted = model.predict(test)
    done = time.perf_counter()
    return FoldResult(
        task.evaluation,
        task.spec.name,
        fold,
        predicted,
        fit_s=fitted - started,
        predict_ms=1000.0 * (done - fitted) / len(held_out),
    )


def _run_shared(task: _Task, model: HybridModel) -> list[FoldResult]:
    """All folds of a model that yields them at once; its times are those of one plain fit."""
    predicted = model.predict_held_out(task.table, task.folds)
    started = time.perf_counter()
    plain = task.spec.build(task.seed).fit(task.table)
    fitted = time.perf_counter()
    plain.predict(task.table)
    predict_ms = 1000.0 * (time.perf_counter() - fitted) / len(task.table)
    return [
        FoldResult(
            task.evaluation,
            task.spec.name,
            fold,
            predicted[task.table.rows_of(np.flatnonzero(task.folds == fold))],
            fit_s=fitted - started,
            predict_ms=predict_ms,
        )
        for fold in task.members
    ]


@dataclass(frozen=True)
class _FoldStore:
    """Finished folds on disk, one .npz per fold; the folder's name tells what they belong to."""

    folder: Path | None

    @classmethod
    def open(
        cls,
        work_dir: Path | None,
        evaluations: Sequence[Evaluation],
        specs: Sequence[ModelSpec],
        seed: int,
        resume: bool,
    ) -> _FoldStore:
        if work_dir is None:
            return cls(None)
        what = json.dumps(
            [
                _code_digest(),
                seed,
                [[e.scheme, e.trips, e.table.digest(), e.folds.tolist()] for e in evaluations],
            ]
        )
        folder = work_dir / hashlib.sha256(what.encode()).hexdigest()[:16]
        folder.mkdir(parents=True, exist_ok=True)
        if not resume:
            for old in folder.glob("*.npz"):
                old.unlink()
        return cls(folder)

    def load(self, evaluation: int, model: str) -> list[FoldResult]:
        if self.folder is None:
            return []
        found = []
        for path in sorted(self.folder.glob(f"{evaluation}.{model}.*.npz")):
            try:
                with np.load(path, allow_pickle=False) as stored:
                    fold, fit_s, predict_ms = (stored[key].item() for key in ("fold", "fit_s", "predict_ms"))
                    extra = {k.removeprefix("x_"): stored[k] for k in stored.files if k.startswith("x_")}
                    energy = stored["predicted_wh"]
                    found.append(FoldResult(evaluation, model, int(fold), energy, fit_s, predict_ms, extra))
            except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
                path.unlink()  # half-written when the run was interrupted: that fold is run again
        return found

    def save(self, evaluation: int, model: str, results: Sequence[FoldResult]) -> None:
        if self.folder is None:
            return
        for result in results:
            path = self.folder / f"{evaluation}.{model}.{result.fold}.npz"
            arrays: dict[str, npt.NDArray[Any]] = {
                "fold": np.array(result.fold),
                "fit_s": np.array(result.fit_s),
                "predict_ms": np.array(result.predict_ms),
                "predicted_wh": result.predicted_wh,
                **{f"x_{name}": values for name, values in result.extra.items()},
            }
            half = path.with_suffix(".part")
            with half.open("wb") as stream:
                np.savez(stream, **arrays)  # type: ignore[arg-type]  # numpy's stub mistakes ** for its own keyword
            half.replace(path)


def _code_digest() -> str:
    """SHA-256 of the package's own source: a fold of other code is another fold."""
    root = Path(tripwatt.__file__).parent
    sha = hashlib.sha256()
    for path in sorted(p for p in root.rglob("*") if p.suffix in {".py", ".toml"}):
        sha.update(path.read_bytes())
    return sha.hexdigest()
