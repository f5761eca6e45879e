"""A model on disk: a directory of `metadata.json` and parts in open formats. No pickle is ever written or read.

`metadata.json` has the version of the format, the inputs and the origin of the model, and the SHA-256 of every part. Its
own SHA-256 is computed over its bytes with zeros in place of the 64 digits of that value. A part is an `.npz` of plain
arrays or a `.json`. A directory that was damaged or altered is refused; the error names the part. This module handles
arrays and JSON, independent of their meaning.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from tripwatt.containers import INSIDE, Budget, open_archive
from tripwatt.errors import Check, Fault, InvalidInput, excerpt, require_type, system_errors
from tripwatt.files import read_file, replace_folder, strict_json

Arrays = Mapping[str, npt.NDArray[Any]]
Part = Arrays | Mapping[str, Any]
"""Arrays for a part named `*.npz`, plain JSON values for one named `*.json`."""

FORMAT: Final = "tripwatt model"
FORMAT_VERSION: Final = 3
METADATA: Final = "metadata.json"
ANEW: Final = "fit it again with this version of tripwatt, or adapt its base again"
_SUFFIXES: Final = (".npz", ".json")
_BLANK: Final = "0" * 64

MAX_PART_BYTES: Final = 1 << 27
"""Largest part of a model, also when inflated; the largest known part has 2 MB."""

READ_ATTEMPTS: Final = 50
"""Attempts to read a model that another process replaces in the meantime."""

RETRY_S: Final = 0.02
"""Time between two attempts [s]."""


@dataclass(frozen=True, eq=False)
class ModelFile:
    """The checked content of a model directory.

    Attributes
    ----------
    metadata : mapping
        As written, with `format`, `format_version`, `parts` and `sha256`.
    parts : mapping of str to Part
    """

    metadata: Mapping[str, Any]
    parts: Mapping[str, Part]


def write_model(folder: Path | str, metadata: Mapping[str, Any], parts: Mapping[str, Part]) -> None:
    """Write a model directory, whole or not at all; an older model in the same place is replaced. O(bytes).

    Parameters
    ----------
    folder : path
        A new or an empty folder, or one that holds a model.
    metadata : mapping
        Plain JSON values; `format`, `format_version`, `parts` and `sha256` are added.
    parts : mapping of str to Part
        File name -> its content. Equal content gives equal bytes.

    Raises
    ------
    InvalidInput
        When the folder contains other files or cannot be written, or a part is neither arrays nor JSON.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     write_model(Path(place) / "m", {"about": "two"}, {"a.npz": {"x": np.array([1.0, 2.0])}})
    ...     read_model(Path(place) / "m").parts["a.npz"]["x"]
    array([1., 2.])
    """
    out = Path(require_type("folder", folder, str | Path, "a path"))
    require_place(out)
    content = {name: _encode(name, part) for name, part in sorted(parts.items())}
    listed = {n: {"sha256": hashlib.sha256(b).hexdigest(), "bytes": len(b)} for n, b in content.items()}
    document = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        **metadata,
        "parts": listed,
        "sha256": _BLANK,
    }
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    content[METADATA] = text.replace(f'"sha256": "{_BLANK}"', f'"sha256": "{digest}"').encode()

    def write(place: Path) -> None:
        for name, raw in content.items():
            (place / name).write_bytes(raw)

    with system_errors("cannot write the model", "--out", "a writable folder", out):
        replace_folder(out, write)


def read_model(folder: Path | str) -> ModelFile:
    """Read a model directory and check every byte of it. O(bytes).

    If another process replaces the model in the meantime, either the whole old or the whole new model is returned.

    Raises
    ------
    InvalidInput
        With every part that is missing, damaged or altered; also when the folder is not a model, or of another format version.
    """

    def read(path: Path) -> ModelFile:
        metadata = _read_metadata(path)
        if metadata["format_version"] != FORMAT_VERSION:
            place, got = f"{path / METADATA}, format_version", str(metadata["format_version"])
            raise InvalidInput.of("model of an older format", place, got, str(FORMAT_VERSION), ANEW)
        return ModelFile(metadata, _read_parts(path, metadata["parts"]))

    return _while_replaced(read, Path(folder))


def read_metadata(folder: Path | str) -> dict[str, Any]:
    """The checked `metadata.json` of a model, also of one in an older format; the parts are not read.

    Raises
    ------
    InvalidInput
        When there is no `metadata.json`, it is damaged or altered, or its format is newer than this program.
    """
    return _while_replaced(_read_metadata, Path(folder))


Read = TypeVar("Read")


def _while_replaced(read: Callable[[Path], Read], path: Path) -> Read:
    """The result of ``read(path)``, which is repeated if it fails because another process replaces the folder."""
    for _ in range(READ_ATTEMPTS):
        before = _identity(path)
        try:
            return read(path)
        except InvalidInput:
            if before is not None and _identity(path) == before:
                raise
            if before is None and not any(path.absolute().parent.glob(f".{path.name}.*")):
                raise  # there is no model, and none is on its way
        time.sleep(RETRY_S)
    return read(path)


def _identity(folder: Path) -> tuple[int, int, int] | None:
    """Device, inode and time of change; the time differs where the inode of a removed folder is used again."""
    try:
        status = folder.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_mtime_ns


def _read_metadata(path: Path) -> dict[str, Any]:
    where = f"{path}"
    if not path.is_dir():
        got = "a file" if path.exists() else "nothing"
        raise InvalidInput.of("no model", where, got, "a folder that `tripwatt fit` wrote")
    raw = _bytes(path / METADATA)
    if raw is None:
        fix = "give the whole folder that `tripwatt fit` wrote"
        raise InvalidInput.of("no model", where, f"no {METADATA}", f"a folder with {METADATA}", fix)
    with _damage(path / METADATA, "JSON"):
        document = strict_json(raw)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        actual = document.get("format") if isinstance(document, dict) else type(document).__name__
        raise InvalidInput.of("no model", f"{path / METADATA}, format", excerpt(actual), repr(FORMAT))
    version = document.get("format_version")
    if not isinstance(version, int) or not 1 <= version <= FORMAT_VERSION:
        fix = "update tripwatt" if isinstance(version, int) and version > FORMAT_VERSION else ""
        place = f"{path / METADATA}, format_version"
        raise InvalidInput.of("unknown model format", place, excerpt(version), str(FORMAT_VERSION), fix)
    digest = str(document.get("sha256"))
    blanked = raw.replace(f'"sha256": "{digest}"'.encode(), f'"sha256": "{_BLANK}"'.encode(), -1)
    with _damage(path / METADATA, "name, SHA-256 and bytes of each part, and the SHA-256 of all"):
        _require_digest(blanked, digest)
        # a digest is no signature: altered metadata may have a right one
        for about in document["parts"].values():
            if not (isinstance(about["sha256"], str) and isinstance(about["bytes"], int)):
                raise TypeError(f"parts {excerpt(document['parts'])}")
    return document


def require_place(folder: Path, kept: str | None = METADATA) -> None:
    """Check that a folder can be written in place of the folder of an option `--out`, without writing anything.

    Parameters
    ----------
    folder : path
    kept : str, optional
        File that a folder with content must have to be replaced, so that nothing else is lost; None if all of it is kept.

    Raises
    ------
    InvalidInput
        When there is something else than a folder, a folder with other files, or a folder that cannot be replaced or created.
    """
    allowed = "a new or empty folder, or a folder with a model" if kept else "a new or existing folder"
    if os.path.lexists(folder) and not folder.is_dir():
        got = f"{folder} -> {folder.readlink()}" if folder.is_symlink() else f"{folder}"
        raise InvalidInput.of("output is not a folder", "--out", got, allowed)
    if kept and folder.is_dir() and any(folder.iterdir()) and not (folder / kept).is_file():
        raise InvalidInput.of("folder contains other files", "--out", f"{folder}", allowed)
    place = folder.resolve()
    if place.is_mount() or Path.cwd().is_relative_to(place):
        raise InvalidInput.of("output cannot be replaced", "--out", f"{folder}", "a folder below it")
    nearest = next(parent for parent in place.parents if parent.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK | os.X_OK):
        got = f"{folder}: no permission to write into {nearest}"
        raise InvalidInput.of("cannot write the output", "--out", got, "a writable folder")


def _read_parts(path: Path, listed: Mapping[str, Any]) -> dict[str, Part]:
    content = {  # all parts are read before any is checked, so that a replacement seldom falls in between
        name: _bytes(path / name) if Path(name).name == name and Path(name).suffix in _SUFFIXES else None
        for name in listed
    }
    with Check() as check:
        return {name: check(_checked_part, path / name, raw, listed[name]) for name, raw in content.items()}


def _checked_part(place: Path, raw: bytes | None, about: Mapping[str, Any]) -> Part:
    if raw is None:
        allowed = "the file that `tripwatt fit` wrote"
        raise InvalidInput.of("part of the model is missing", f"{place}", "nothing", allowed)
    with _damage(place, f"{about['bytes']} bytes of arrays without pickled objects, or of JSON"):
        _require_digest(raw, about["sha256"])
        return _decode(place, raw)


def _require_digest(raw: bytes, digest: str) -> None:
    if (actual := hashlib.sha256(raw).hexdigest()) != digest:
        raise ValueError(f"{len(raw)} bytes with SHA-256 {actual} in place of {digest[:64]}")


@contextmanager
def _damage(place: Path, allowed: str) -> Iterator[None]:
    """Raise `InvalidInput` in place of any other error of a damaged or altered file, within a `with` block."""
    try:
        yield
    except InvalidInput:
        raise
    except Exception as error:  # damaged archives and headers make NumPy and zipfile raise a dozen types
        what, fix = "part of the model is damaged or altered", "copy the model again, or fit it again"
        raise InvalidInput.of(what, f"{place}", f"{error}"[:200], allowed, fix) from error


def _bytes(path: Path) -> bytes | None:
    if not os.path.lexists(path):
        return None
    return read_file(path, MAX_PART_BYTES, what="cannot read a part of the model", allowed="a file")


def _encode(name: str, part: Part) -> bytes:
    suffix = Path(name).suffix
    if Path(name).name != name or suffix not in _SUFFIXES or name == METADATA:
        raise InvalidInput.of("invalid name of a part", "parts", repr(name), "NAME.npz or NAME.json")
    if suffix == ".json":
        return (json.dumps(part, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
    arrays = {key: np.asarray(value) for key, value in part.items()}
    objects = [key for key, value in arrays.items() if value.dtype.hasobject]
    if objects:
        where = f"parts, {name}"
        raise InvalidInput([Fault("not a plain array", where, key, "numbers or text") for key in objects])
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]  # its stubs take `allow_pickle` for an array
    return buffer.getvalue()


def _decode(place: Path, raw: bytes) -> Part:
    if place.suffix == ".json":
        document = strict_json(raw)
        if not isinstance(document, dict):
            raise ValueError("not a JSON object")
        return document
    open_archive(raw, Budget(f"{place}", {INSIDE: MAX_PART_BYTES}), max_ratio=MAX_PART_BYTES)
    with np.load(io.BytesIO(raw), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}
