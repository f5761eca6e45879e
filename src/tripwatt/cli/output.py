"""Outputs appear complete or not at all: they are written to another name first and then renamed."""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import InvalidInput, system_errors
from tripwatt.files import replace_folder, restore_folder, write_file

UNWRITABLE: Final = ("cannot write the results", "--out", "a writable folder")
LAST: Final = "results.json"
"""The file that comes last: where it stands, everything beside it belongs to it."""


def check_writable(out: Path) -> None:
    """Whether results can be written into `out`, without writing anything.

    Raises
    ------
    InvalidInput
        When `out` is not a folder, a link to nothing or the root, or cannot be made or written.
    """
    if out.is_symlink() and not out.exists():
        got = f"{out} -> {os.readlink(out)}"
        raise InvalidInput.of("output is a link to nothing", "--out", got, "a new or existing folder")
    if out.resolve() == Path(out.absolute().anchor):
        raise InvalidInput.of("output is the root folder", "--out", str(out), "a new or existing folder")
    if out.exists() and not out.is_dir():
        raise InvalidInput.of("output is not a folder", "--out", str(out), "a new or existing folder")
    nearest = next(place for place in (out, *out.absolute().parents) if place.exists())
    with system_errors(*UNWRITABLE, out):
        if not nearest.is_dir():
            raise NotADirectoryError(f"{nearest} is not a folder")
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise PermissionError(f"no permission to write into {nearest}")


def unfinished_folder(out: Path) -> Path:
    """Make the folder where a run keeps what is not finished: beside OUT while there is no OUT, in it afterwards.

    Raises
    ------
    InvalidInput
        When it cannot be made.
    """
    beside = out.absolute().parent / f"{out.absolute().name}.unfinished"
    folder = out / ".unfinished" if out.is_dir() and not beside.exists() else beside
    with system_errors(*UNWRITABLE, out):
        restore_folder(out)
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def finished_folds(unfinished: Path) -> int:
    """How many finished folds an interrupted run has left."""
    return sum(1 for _ in unfinished.glob("folds/*/*.npz"))


def write_whole(write: Callable[[Path], None], out: Path, unfinished: Path) -> None:
    """Let `write` fill a new folder, then put it in the place of `out` in one step and remove `unfinished`.

    Files of an older `out` that the new one lacks are kept. Where `out` cannot be exchanged (a mount point, the current
    folder, a parent that cannot be written), its files are replaced one by one, `results.json` last; after a kill in
    between, the next call brings the older ones back first.

    Raises
    ------
    InvalidInput
        When something cannot be written; `out` is then as it was.
    """
    with system_errors(*UNWRITABLE, out):
        if _can_be_exchanged(out):
            replace_folder(out, lambda made: _fill(made, out, write))
        else:
            _fill_in_place(write, out, unfinished)
    shutil.rmtree(unfinished, ignore_errors=True)


def _can_be_exchanged(out: Path) -> bool:
    place = out.resolve()
    if not place.exists():
        return True
    kinds = (entry.lstat().st_mode for entry in place.iterdir())
    return (
        not os.path.ismount(place)
        and os.access(place.parent, os.W_OK | os.X_OK)
        and not Path.cwd().is_relative_to(place)
        and all(stat.S_ISREG(k) or stat.S_ISDIR(k) or stat.S_ISLNK(k) for k in kinds)
    )


def _fill(made: Path, out: Path, write: Callable[[Path], None]) -> None:
    """Fill a new folder, with what the older one has beside it."""
    write(made)
    if out.is_dir():
        left = {".unfinished", *os.listdir(made)}
        how: dict[str, Any] = {"symlinks": True, "copy_function": _link, "dirs_exist_ok": True}
        shutil.copytree(out, made, ignore=lambda place, _: left if Path(place) == out else (), **how)


def _link(source: str, target: str) -> None:
    """A second name of a file, or a copy where the file system has none."""
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, target)


def _fill_in_place(write: Callable[[Path], None], out: Path, unfinished: Path) -> None:
    made, older = unfinished / "writing", unfinished / "older"
    _bring_back(older, out)
    shutil.rmtree(made, ignore_errors=True)
    for folder in (made, older):
        folder.mkdir(parents=True)
    try:
        write(made)
        _replace(made, out, older)
    finally:
        shutil.rmtree(made, ignore_errors=True)
    shutil.rmtree(older, ignore_errors=True)


def _bring_back(older: Path, out: Path) -> None:
    """Put the files back that a killed process had moved away; files of its own that stand in their place go."""
    if not older.is_dir():
        return
    entries = sorted(older.iterdir(), key=lambda path: (path.name == LAST, path.name))
    if not (out / LAST).exists() or any(path.name == LAST for path in entries):
        for path in entries:
            if (out / path.name).is_dir() and not (out / path.name).is_symlink():
                shutil.rmtree(out / path.name)
            path.replace(out / path.name)
    shutil.rmtree(older, ignore_errors=True)


def write_text(text: str, path: Path, option: str = "--out") -> None:
    """Write one file, whole or not at all; parameters and errors are those of `write_bytes`."""
    write_bytes(text.encode("utf-8"), path, option)


def write_bytes(content: bytes, path: Path, option: str = "--out") -> None:
    """Write one file, whole or not at all.

    Parameters
    ----------
    content : bytes
    path : Path
    option : str
        The option that names the file, for messages.

    Raises
    ------
    InvalidInput
        When it cannot be written; a file that was there is as before.
    """
    with system_errors("cannot write the file", option, "", path):
        if path.exists() and not path.is_file():
            raise OSError(f"{'a folder' if path.is_dir() else 'no regular file'}")
        write_file(path, lambda partial: partial.write_bytes(content))


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
