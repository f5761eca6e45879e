"""Run the splits of a protocol. Finished ones are kept on disk, so that an interrupted run ends with the same table."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tripwatt.parallel import map_unordered, one_blas_thread
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecasts
from tripwatt.study.evaluation.hold_outs import Split
from tripwatt.study.evaluation.tasks import FoldResult, Task

Progress = Callable[[int, int], None]
"""Called with (finished splits, all splits)."""


@dataclass(frozen=True, slots=True)
class Execution:
    """How an evaluation is run.

    Attributes
    ----------
    n_jobs : int
        Processes; -1 takes all cores. The results do not depend on it.
    work_dir : Path or None
        Where finished splits are kept.
    resume : bool
        Use the finished splits that are there, if they belong to the same trips, models, seed and version.
    progress : callable or None
        Called with (finished splits, all splits).

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
    comparisons: Sequence[Comparison], seed: int, execution: Execution, *, compares: bool = False
) -> list[Comparison]:
    """The comparisons with their results; those of the same models, trips and splits run once.

    Parameters
    ----------
    comparisons : sequence of Comparison
    seed : int
    execution : Execution
    compares : bool
        Whether settings are compared inside the folds of the reference trips.
    """
    store = FoldStore.open(execution, comparisons, seed)
    keys = [_key(comparison) for comparison in comparisons]
    results: dict[int, list[FoldResult]] = {keys.index(key): [] for key in keys}
    tasks: list[Task] = []
    for index, done in results.items():
        hold_out = comparisons[index].hold_out
        for spec in comparisons[index].specs:
            loaded = store.load(index, spec.name, hold_out.splits)
            known = {result.split.number for result in loaded}
            missing = [split for split in hold_out.splits if split.number not in known]
            tasks += spec.tasks(index, hold_out, missing, seed, compares=compares and hold_out.is_reference)
            done += loaded
    tasks.sort(key=lambda task: task.rank)
    finished = sum(map(len, results.values()))
    total = finished + sum(len(task.splits) for task in tasks)
    report = execution.progress or (lambda finished, total: None)
    report(finished, total)
    for number, fresh in map_unordered(_run, tasks, n_jobs=execution.n_jobs):
        index = tasks[number].comparison
        store.save(index, fresh)
        results[index] += fresh
        finished += len(fresh)
        report(finished, total)
    return [
        replace(comparison, results=tuple(results[keys.index(key)]))
        for comparison, key in zip(comparisons, keys, strict=True)
    ]


@one_blas_thread
def _run(task: Task) -> list[FoldResult]:
    """Importable by name, for other processes. Threads of BLAS wait for each other longer than they calculate."""
    return task.run()


def _key(comparison: Comparison) -> str:
    """Equal for the same models on the same trips and splits."""
    hold_out = comparison.hold_out
    splits = [[s.number, s.train.tolist(), s.test.tolist()] for s in hold_out.splits]
    return json.dumps(
        [hold_out.table.digest(), splits, [spec.name + spec.digest for spec in comparison.specs]]
    )


@dataclass(frozen=True)
class FoldStore:
    """Finished splits on disk, one .npz for each, in a folder that is named by what they belong to."""

    folder: Path | None

    @classmethod
    def open(cls, execution: Execution, comparisons: Sequence[Comparison], seed: int) -> FoldStore:
        """The splits of an earlier run of the same code, trips and seed, or an empty folder."""
        if execution.work_dir is None:
            return cls(None)
        what = json.dumps([_code_digest(), seed, [_key(comparison) for comparison in comparisons]])
        folder = execution.work_dir / hashlib.sha256(what.encode()).hexdigest()[:16]
        folder.mkdir(parents=True, exist_ok=True)
        if not execution.resume:
            for old in folder.glob("*.npz"):
                old.unlink()
        return cls(folder)

    def load(self, comparison: int, model: str, splits: Sequence[Split]) -> list[FoldResult]:
        """Finished splits of a model; a damaged file is removed, and its split runs again."""
        results = []
        for split in splits if self.folder is not None else ():
            path = self._path(comparison, model, split)
            try:
                with np.load(path, allow_pickle=False) as stored:
                    times = [stored[name].item() for name in ("fit_s", "predict_ms", "inner_error")]
                    kept = {
                        f.name: stored[f.name] for f in fields(HeldOutForecasts) if f.name in stored.files
                    }
                    result = FoldResult(model, split, stored["predicted_wh"], *times)
                results.append(replace(result, forecasts=HeldOutForecasts(**kept)) if kept else result)
            except FileNotFoundError:
                continue
            except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
                path.unlink()  # half-written when the run was interrupted
        return results

    def save(self, comparison: int, results: Sequence[FoldResult]) -> None:
        """Keep finished splits."""
        for result in results if self.folder is not None else ():
            names = ("predicted_wh", "fit_s", "predict_ms", "inner_error")
            arrays: dict[str, npt.NDArray[Any]] = {name: np.array(getattr(result, name)) for name in names}
            arrays |= {} if result.forecasts is None else vars(result.forecasts)
            path = self._path(comparison, result.model, result.split)
            half = path.with_suffix(".part")
            with half.open("wb") as stream:
                np.savez(stream, **arrays)  # type: ignore[arg-type]  # numpy's stub mistakes ** for its own keyword
            half.replace(path)

    def _path(self, comparison: int, model: str, split: Split) -> Path:
        assert self.folder is not None
        return self.folder / f"{comparison}.{model}.{split.number}.npz"


def _code_digest() -> str:
    """SHA-256 of the package's own source: a fold of other code is another fold."""
    root = Path(__file__).parents[2]
    sha = hashlib.sha256()
    for path in sorted(p for p in root.rglob("*") if p.suffix in {".py", ".toml"}):
        sha.update(path.read_bytes())
    return sha.hexdigest()
