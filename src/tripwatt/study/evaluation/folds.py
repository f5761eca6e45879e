"""Run the splits of a protocol; finished splits are kept on disk, so that a resumed run gives the same results."""

from __future__ import annotations

import hashlib
import json
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tripwatt.files import write_bytes
from tripwatt.learners.folds import Split
from tripwatt.parallel import map_unordered, one_blas_thread
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.tasks import FoldResult, Task

Progress = Callable[[int, int], None]
"""Called with (finished splits, all splits)."""


@dataclass(frozen=True, slots=True)
class Execution:
    """Settings of a run: processes, and reuse of finished splits.

    Attributes
    ----------
    n_jobs : int
        Number of processes; -1 uses all cores. The results do not depend on it.
    work_dir : Path or None
        Folder for finished splits; None keeps none.
    resume : bool
        Whether to use finished splits in `work_dir` of the same trips, models, seed and source code.
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
    comparisons: Sequence[Comparison], seed: int, execution: Execution, *, inner_errors: bool = False
) -> list[Comparison]:
    """Run the comparisons and return them with their results; equal models, trips and splits run once.

    Parameters
    ----------
    comparisons : sequence of Comparison
    seed : int
    execution : Execution
    inner_errors : bool
        Whether to compare settings inside the folds of the reference trips.
    """
    keys = [_key(comparison) for comparison in comparisons]
    folder = _folds_folder(execution, [_code_digest(), seed, keys])
    results: dict[int, list[FoldResult]] = {keys.index(key): [] for key in keys}
    tasks: list[Task] = []
    for index, results_of_index in results.items():
        hold_out = comparisons[index].hold_out
        for spec in comparisons[index].specs:
            kept = [_load(_file(folder, index, spec.name, split)) for split in hold_out.splits]
            results_of_index += [result for result in kept if result is not None]
            missing = [split for split, result in zip(hold_out.splits, kept, strict=True) if result is None]
            tasks += spec.tasks(
                index, hold_out, missing, seed, inner_errors=inner_errors and hold_out.is_reference
            )
    tasks.sort(key=lambda task: task.rank)
    finished = sum(map(len, results.values()))
    total = finished + sum(len(task.splits) for task in tasks)
    report = execution.progress or (lambda finished, total: None)
    report(finished, total)
    for number, new_results in map_unordered(_run, tasks, n_jobs=execution.n_jobs):
        index = tasks[number].comparison
        for result in new_results:
            if (file := _file(folder, index, result.model, result.split)) is not None:
                write_bytes(file, pickle.dumps(result))
        results[index] += new_results
        finished += len(new_results)
        report(finished, total)
    return [
        replace(comparison, results=tuple(results[keys.index(key)]))
        for comparison, key in zip(comparisons, keys, strict=True)
    ]


@one_blas_thread
def _run(task: Task) -> list[FoldResult]:
    """Run a task in another process, with one BLAS thread: more threads would wait longer than they calculate."""
    return task.run()


def _key(comparison: Comparison) -> str:
    """Return a key that is equal for the same models on the same trips and splits."""
    hold_out = comparison.hold_out
    splits = [[s.number, s.train.tolist(), s.test.tolist()] for s in hold_out.splits]
    return json.dumps(
        [hold_out.table.digest(), splits, [spec.name + spec.digest for spec in comparison.specs]]
    )


def _folds_folder(execution: Execution, identity: object) -> Path | None:
    """Return the folder of finished splits of the same code, trips, models and seed; emptied unless the run resumes.

    Returns None if finished splits are not kept.
    """
    if execution.work_dir is None:
        return None
    folder = execution.work_dir / hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    for old in () if execution.resume else folder.glob("*.fold"):
        old.unlink()
    return folder


def _file(folder: Path | None, comparison: int, model: str, split: Split) -> Path | None:
    return None if folder is None else folder / f"{comparison}.{model}.{split.number}.fold"


def _load(file: Path | None) -> FoldResult | None:
    """Load a finished split; returns None if there is none or its file is damaged, and the split runs again."""
    try:
        result = None if file is None else pickle.loads(file.read_bytes())  # our own file, of our own folder
    except (OSError, EOFError, ValueError, LookupError, pickle.UnpicklingError):
        return None
    return result if isinstance(result, FoldResult) else None


def _code_digest() -> str:
    """SHA-256 of the package's source, so that folds of other code are not reused."""
    root = Path(__file__).parents[2]
    sha = hashlib.sha256()
    for path in sorted(p for p in root.rglob("*") if p.suffix in {".py", ".toml"}):
        sha.update(path.read_bytes())
    return sha.hexdigest()
