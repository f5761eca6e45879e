"""Outputs appear complete or not at all: they are written to another name first and then renamed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

from tripwatt.errors import Fault, InvalidInput

LAST: Final = "results.json"
"""The file that comes last: where it stands, everything beside it belongs to it."""


def check_writable(out: Path) -> None:
    """Whether results can be written into `out`, without writing anything.

    Raises
    ------
    InvalidInput
        When `out` is not a folder or cannot be made or written.
    """
    if out.exists() and not out.is_dir():
        raise InvalidInput(Fault("output is not a folder", "--out", str(out), "a new or existing folder"))
    nearest = next(place for place in (out, *out.absolute().parents) if place.exists())
    if not nearest.is_dir():
        raise InvalidInput(_unwritable(out, f"{nearest} is not a folder"))
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InvalidInput(_unwritable(out, f"no permission to write into {nearest}"))


def unfinished_folder(out: Path) -> Path:
    """Make the folder where a run keeps what is not finished: beside OUT while there is no OUT, in it afterwards.

    Raises
    ------
    InvalidInput
        When it cannot be made.
    """
    beside = out.absolute().parent / f"{out.absolute().name}.unfinished"
    folder = out / ".unfinished" if out.is_dir() and not beside.exists() else beside
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(_unwritable(out, error.strerror or str(error))) from error
    return folder


def finished_folds(unfinished: Path) -> int:
    """How many finished folds an interrupted run has left."""
    return sum(1 for _ in unfinished.glob("folds/*/*.npz"))


def write_whole(write: Callable[[Path], None], out: Path, unfinished: Path) -> None:
    """Let `write` fill a folder in `unfinished`, then bring its content to `out` and remove `unfinished`.

    A new `out` appears by one rename. In an `out` that exists, older files of the same names are moved away first
    (`results.json` before all others) and `results.json` comes last; when one cannot be moved, the older ones come
    back.

    Raises
    ------
    InvalidInput
        When something cannot be written; `out` is then as it was.
    """
    made, older = (unfinished / f"{what}-{os.getpid()}" for what in ("writing", "older"))
    try:
        for folder in (made, older):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        write(made)
        if out.exists():
            _replace(made, out, older)
        else:
            made.rename(out)
    except OSError as error:
        for folder in (made, older):
            shutil.rmtree(folder, ignore_errors=True)
        raise InvalidInput(_unwritable(out, error.strerror or str(error))) from error
    shutil.rmtree(unfinished, ignore_errors=True)


def write_text(text: str, path: Path) -> None:
    """Write one file, whole or not at all.

    Raises
    ------
    InvalidInput
        When it cannot be written.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True) if partial.parent.is_dir() else None
        got = error.strerror or str(error)
        raise InvalidInput(Fault("cannot write the file", "--out", f"{path}: {got}")) from error


def _replace(made: Path, out: Path, older: Path) -> None:
    names = sorted((path.name for path in made.iterdir()), key=lambda name: (name == LAST, name))
    away: list[str] = []
    came: list[str] = []
    try:
        for name in reversed(names):
            if os.path.lexists(out / name):
                (out / name).rename(older / name)
                away.append(name)
        for name in names:
            (made / name).rename(out / name)
            came.append(name)
    except OSError:
        for name in reversed(came):
            (out / name).rename(made / name)
        for name in reversed(away):
            (older / name).rename(out / name)
        raise


def _unwritable(out: Path, why: str) -> Fault:
    return Fault("cannot write the results", "--out", f"{out}: {why}", "a writable folder")
