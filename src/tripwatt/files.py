"""Files read within bounds, and files and folders written whole or not at all.

Only regular files of a bounded size are read; `containers` bounds what is packed in them. An output is written under
another name first and then renamed in one step. What a killed process left behind is removed by the next process that
writes the same output.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import glob
import json
import os
import platform
import shutil
import stat
import sys
import threading
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final

from tripwatt.errors import InvalidInput

if sys.platform != "win32":
    import fcntl

if TYPE_CHECKING:
    import pandas as pd

MAX_FILE_BYTES: Final = 1 << 30
"""Largest file of samples [bytes]: about twenty years of driving at 1 Hz with ten signals."""

MAX_TEXT_BYTES: Final = 1 << 18
"""Largest TOML file of a car or a mapping; the largest of the package has 30 kB."""

WRITING: Final = ".writing"
"""End of the hidden name of a file or folder that is being written."""

_EXCHANGE: Final = 2
"""Flag of `renameat2`, see renameat2(2)."""
_AT_FDCWD: Final = -100
_NO_EXCHANGE: Final = (errno.EINVAL, errno.ENOSYS, errno.EXDEV, errno.EBUSY, errno.EOPNOTSUPP, errno.EPERM)
"""Errors of a file system that cannot exchange two names, and of a mount point."""


def read_file(
    path: Path | str,
    max_bytes: int = MAX_FILE_BYTES,
    *,
    what: str = "cannot read the file",
    allowed: str = "a readable file",
) -> bytes:
    """The content of a regular file. O(bytes).

    A pipe or a device is refused: it may never end.

    Parameters
    ----------
    path : path
    max_bytes : int
        Largest size [bytes].
    what, allowed : str
        Texts of the fault.

    Raises
    ------
    InvalidInput
        When the file does not exist, cannot be read, is not a regular file or is too large.

    Examples
    --------
    >>> read_file("/dev/zero")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: cannot read the file: /dev/zero: got no regular file; ...
    """
    try:
        with open_regular(Path(path)) as stream:
            # files that the system makes up have size 0
            size = max(os.fstat(stream.fileno()).st_size, 1 << 16)
            content = stream.read(min(size, max_bytes) + 1)  # allocates this memory before it reads
    except (OSError, ValueError) as error:
        got = getattr(error, "strerror", None) or str(error)
        fix = "write its content into a file first" if got == _NOT_REGULAR else ""
        raise InvalidInput.of(what, f"{path}", got, allowed, fix) from error
    if len(content) > max_bytes:
        raise InvalidInput.of("file too large", f"{path}", f"over {max_bytes} bytes", f"{max_bytes} bytes")
    return content


def file_head(path: Path | str, count: int = 4096) -> bytes:
    """The first bytes of a regular file; empty if the file cannot be read."""
    try:
        with open_regular(Path(path)) as stream:
            return stream.read(count)
    except (OSError, ValueError):
        return b""


_NOT_REGULAR: Final = "no regular file"


def open_regular(path: Path) -> IO[bytes]:
    """Open a regular file for reading.

    Raises
    ------
    OSError
        When the file cannot be opened or is not a regular file, such as a pipe or a device.
    """
    # without O_NONBLOCK, opening a pipe waits for its writer
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        raise OSError(errno.EINVAL, _NOT_REGULAR)
    return os.fdopen(descriptor, "rb")


def read_text_file(path: Path | str, max_bytes: int, **more: str) -> str:
    """The text of a regular file in UTF-8; the parameters are those of `read_file`.

    Raises
    ------
    InvalidInput
        As `read_file`, and when the content is not UTF-8.
    """
    try:
        return read_file(path, max_bytes, **more).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidInput.of("not a text file", f"{path}", str(error)[:120], "text in UTF-8") from error


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The document of a TOML text.

    Raises
    ------
    InvalidInput
        When the text is not TOML.
    """
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InvalidInput.of("not a TOML file", where, str(error)[:200], "TOML 1.0") from error


def strict_json(data: bytes | str) -> Any:
    """The value of a JSON text; NaN and infinities are refused.

    Raises
    ------
    ValueError
        When the text is not JSON.
    RecursionError
        When the text is nested too deeply.

    Examples
    --------
    >>> strict_json("[1, null]")
    [1, None]
    """

    def refuse(constant: str) -> float:
        raise ValueError(f"{constant} is no JSON number")

    return json.loads(data, parse_constant=refuse)


def shipped_toml(place: str) -> dict[str, Any]:
    """The document of a TOML file of the package, by its path below `tripwatt`.

    Examples
    --------
    >>> sorted(shipped_toml("trips/flags.toml"))[:2]
    ['flags', 'names']
    """
    return tomllib.loads((Path(__file__).parent / place).read_text("utf-8"))


def write_file(path: Path, write: Callable[[Path], object]) -> None:
    """Write one file, whole or not at all: `write` writes to a temporary name beside it, which is then renamed.

    A symbolic link is kept: the file that it points to is replaced.

    Raises
    ------
    OSError
        When the file cannot be written; an existing file is then unchanged.
    """
    path = path.resolve() if path.is_symlink() else path.absolute()
    with _beside(path, folder=False) as partial:
        write(partial)
        partial.replace(path)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all: see `write_file`."""
    write_file(path, lambda partial: partial.write_bytes(content))


def move_new(file: Path, path: Path) -> None:
    """Give a file a new name in one step, but never replace another file; the old name may remain as well.

    Raises
    ------
    FileExistsError
        When `path` exists; it is then unchanged.
    """
    try:
        os.link(file, path)
    except OSError:  # the name is taken, or the file system has no hard links
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), f"{path}") from None
        file.rename(path)


def write_text(path: Path, text: str) -> None:
    """Write a file of text in UTF-8, whole or not at all: see `write_file`."""
    write_bytes(path, text.encode())


FORMULAS: Final = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20", "\t", "\n", "'")
"""First characters of a text that a spreadsheet may run as a formula or leave out, with the mark before such texts itself."""


def csv_text(table: pd.DataFrame) -> str:
    r"""A table as CSV that a spreadsheet can open: a text that would be a formula has an apostrophe before it. Numbers stay as they are.

    Whoever reads such a table with a program takes one apostrophe off the texts that begin with one.

    Examples
    --------
    >>> import pandas as pd
    >>> csv_text(pd.DataFrame({"driver": ["=1+1", "Ann"], "energy_wh": [-2.5, 1.0]}))
    "driver,energy_wh\n'=1+1,-2.5\nAnn,1.0\n"
    """

    def harmless(cell: Any) -> Any:
        if not isinstance(cell, str):
            return cell
        text = cell.replace("\r", "\n")  # a writer of CSV leaves it unquoted, and a reader begins a row there
        return f"'{text}" if text.startswith(FORMULAS) else text

    texts = table.select_dtypes(exclude=["number", "bool", "datetime", "datetimetz", "timedelta"])
    safe = table.assign(**{f"{name}": texts[name].astype(object).map(harmless) for name in texts})
    return safe.rename(columns=harmless).to_csv(index=False, lineterminator="\n")


def replace_folder(out: Path, write: Callable[[Path], None]) -> None:
    """Write a folder, whole or not at all: `write` fills a temporary folder beside it, which is then renamed.

    On Linux the two names are exchanged in one step. If the file system cannot do that, the older folder is moved away
    first; if the process is killed between the two moves, the next call moves the older folder back.

    Raises
    ------
    OSError
        When the folder cannot be written; an existing folder is then unchanged.
    """
    out = out.resolve() if out.is_symlink() else out.absolute()
    out.parent.mkdir(parents=True, exist_ok=True)
    restore_folder(out)
    with _beside(out, folder=True) as filled:
        write(filled)
        if not out.exists():
            filled.rename(out)
        elif not exchange(filled, out):
            older = _older(out)
            out.rename(older)
            try:
                filled.rename(out)
            except OSError:
                older.rename(out)
                raise
            shutil.rmtree(older, ignore_errors=True)


def restore_folder(out: Path) -> None:
    """Move back an older folder that a killed process had moved away, or remove it if the new folder is in place."""
    older = _older(out)
    if not older.is_dir():
        return
    if out.exists():
        shutil.rmtree(older, ignore_errors=True)
    else:
        older.rename(out)


def _older(out: Path) -> Path:
    return out.with_name(f".{out.name}.older")


def exchange(one: Path, other: Path) -> bool:
    """Exchange the names of two files or folders in one step.

    Returns
    -------
    bool
        False if the system or the file system cannot exchange names; nothing is changed then.

    Raises
    ------
    OSError
        When the exchange fails for another reason.

    References
    ----------
    Linux manual, renameat2(2), RENAME_EXCHANGE.
    """
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):  # another system, or an old C library
        return False
    if rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _EXCHANGE) == 0:
        return True
    code = ctypes.get_errno()
    if code in _NO_EXCHANGE:
        return False
    raise OSError(code, os.strerror(code), str(other))


@contextlib.contextmanager
def _beside(path: Path, *, folder: bool) -> Iterator[Path]:
    """Make a temporary file or folder beside a path, and remove it at the end.

    Those that ended processes of this machine left behind are removed first.
    """
    name = f".{path.name}.{platform.node()}"
    for left in path.parent.glob(f"{glob.escape(name)}.*{WRITING}"):
        if not _is_running(left.name.split(".")[-2]):
            _remove(left)
    partial = path.with_name(f"{name}.{threading.get_native_id()}.{os.getpid()}{WRITING}")
    _remove(partial)  # of a process with the same number, such as in a container that was started again
    partial.mkdir() if folder else partial.touch()
    try:
        yield partial
    finally:
        _remove(partial)


def _is_running(pid: str) -> bool:
    try:
        os.kill(int(pid), 0)
    except (OSError, ValueError, OverflowError) as error:  # such as a process of another user
        return not isinstance(error, ProcessLookupError)
    return True


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def folder_lock(folder: Path, fix: str = "wait for it to end, or choose another folder") -> Iterator[None]:
    """Hold the lock of a folder until the block or the process ends. Windows has no such lock.

    Parameters
    ----------
    folder : Path
    fix : str
        What to do when another process holds the lock.

    Raises
    ------
    InvalidInput
        When another process holds the lock.
    """
    if sys.platform == "win32":
        yield
        return
    with contextlib.ExitStack() as stack:
        try:
            descriptor = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, descriptor)
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            got = "a run at work"
            raise InvalidInput.of(
                "another run writes this output", f"{folder}", got, "one run", fix
            ) from error
        yield
