"""Run the folds of a protocol. Finished folds are kept on disk, so that an interrupted run ends with the same table."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tripwatt.evaluation.hold_outs import HoldOut
from tripwatt.evaluation.protocol import FoldResult, ModelSpec, Progress, Task
from tripwatt.parallel import map_unordered


@dataclass(frozen=True, slots=True)
class Execution:
    """How an evaluation is run.

    Attributes
    ----------
    n_jobs : int
        Processes; -1 takes all cores. The results do not depend on it.
    work_dir : Path or None
        Where finished folds are kept.
    resume : bool
        Use the finished folds that are there, if they belong to the same trips, models, seed and version.
    progress : callable or None
        Called with (finished folds, all folds).

    Examples
    --------
    >>> Execution(n_jobs=1).resume
    False
    """

    n_jobs: int = -1
    work_dir: Path | None = None
    resume: bool = False
    progress: Progress | None = None


def run_folds(
    hold_outs: Sequence[HoldOut],
    specs: Sequence[ModelSpec],
    extra: Sequence[ModelSpec],
    seed: int,
    execution: Execution,
) -> list[FoldResult]:
    """Held-out predictions of every model under every hold-out; hold-outs with the same trips and folds run once.

    Parameters
    ----------
    hold_outs : sequence of HoldOut
    specs : sequence of ModelSpec
    extra : sequence of ModelSpec
        Run for the first hold-out alone.
    seed : int
    execution : Execution
    """
    store = FoldStore.open(execution, hold_outs, seed)
    same_as = _first_alike(hold_outs)
    results: list[FoldResult] = []
    tasks: list[Task] = []
    wanted = [(i, spec) for i, first in enumerate(same_as) if first == i for spec in specs]
    for index, spec in [*wanted, *((0, spec) for spec in extra)]:
        done = store.load(index, spec.name)
        results.extend(done)
        missing = sorted(spec.folds(hold_outs[index]) - {r.fold for r in done})
        tasks.extend(spec.tasks(index, hold_outs[index], missing, seed))
    tasks.sort(key=lambda task: task.rank)
    finished = len(results)
    total = finished + sum(len(task.members) for task in tasks)
    report = execution.progress or (lambda finished, total: None)
    report(finished, total)
    for _, found in map_unordered(_run, tasks, n_jobs=execution.n_jobs):
        store.save(found)
        results.extend(found)
        finished += len(found)
        report(finished, total)
    names = {spec.name for spec in specs}
    for index, first in enumerate(same_as):
        if first != index:
            own = [r for r in results if r.evaluation == first and r.model in names]
            results.extend(replace(r, evaluation=index) for r in own)
    return results


def _run(task: Task) -> list[FoldResult]:
    """Importable by name, for other processes."""
    return task.run()


def _first_alike(hold_outs: Sequence[HoldOut]) -> list[int]:
    """For each hold-out the first one with the same trips in the same folds."""
    keys = [(h.table.digest(), h.folds.tobytes()) for h in hold_outs]
    return [keys.index(key) for key in keys]


@dataclass(frozen=True)
class FoldStore:
    """Finished folds on disk, one .npz for each; the name of the folder tells what they belong to."""

    folder: Path | None

    @classmethod
    def open(cls, execution: Execution, hold_outs: Sequence[HoldOut], seed: int) -> FoldStore:
        """The folds of an earlier run of the same code, trips and seed, or an empty folder."""
        if execution.work_dir is None:
            return cls(None)
        what = json.dumps(
            [
                _code_digest(),
                seed,
                [[h.scheme, h.trips, h.table.digest(), h.folds.tolist()] for h in hold_outs],
            ]
        )
        folder = execution.work_dir / hashlib.sha256(what.encode()).hexdigest()[:16]
        folder.mkdir(parents=True, exist_ok=True)
        if not execution.resume:
            for old in folder.glob("*.npz"):
                old.unlink()
        return cls(folder)

    def load(self, evaluation: int, model: str) -> list[FoldResult]:
        """Finished folds of a model; a damaged file is removed, and its fold runs again."""
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
                path.unlink()  # half-written when the run was interrupted
        return found

    def save(self, results: Sequence[FoldResult]) -> None:
        """Keep finished folds."""
        if self.folder is None:
            return
        for result in results:
            path = self.folder / f"{result.evaluation}.{result.model}.{result.fold}.npz"
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
    root = Path(__file__).parents[1]
    sha = hashlib.sha256()
    for path in sorted(p for p in root.rglob("*") if p.suffix in {".py", ".toml"}):
        sha.update(path.read_bytes())
    return sha.hexdigest()
