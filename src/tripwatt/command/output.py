"""Write outputs completely or not at all: first under another name, then renamed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

from tripwatt.errors import system_errors
from tripwatt.files import replace_folder, write_file

UNWRITABLE: Final = ("cannot write the results", "--out", "a writable folder")


def unfinished_folder(out: Path) -> Path:
    """Create the folder beside `out` in which a run keeps unfinished results.

    Raises
    ------
    InvalidInput
        If the folder cannot be created.
    """
    place = out.resolve()
    folder = place.with_name(f"{place.name}.unfinished")
    with system_errors(*UNWRITABLE, out):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def write_whole(write: Callable[[Path], None], out: Path, unfinished: Path) -> None:
    """Call `write` to fill a new folder, replace `out` by it in one step, and remove `unfinished`.

    Files of an older `out` that `write` does not make are kept.

    Raises
    ------
    InvalidInput
        If something cannot be written; `out` is then unchanged.
    """

    def fill(made: Path) -> None:
        write(made)
        if out.is_dir():
            names = set(os.listdir(made))
            shutil.copytree(
                out,
                made,
                symlinks=True,
                dirs_exist_ok=True,
                ignore=lambda place, _: names if Path(place) == out else (),
            )

    with system_errors(*UNWRITABLE, out):
        replace_folder(out, fill)
    shutil.rmtree(unfinished, ignore_errors=True)


def write_text(text: str, path: Path) -> None:
    """Write the file of the option --out, completely or not at all.

    Raises
    ------
    InvalidInput
        If the file cannot be written; an existing file is then unchanged.
    """
    with system_errors("cannot write the file", "--out", "", path):
        if path.exists() and not path.is_file():
            raise OSError(f"{'a folder' if path.is_dir() else 'no regular file'}")
        write_file(path, lambda partial: partial.write_bytes(text.encode("utf-8")))
