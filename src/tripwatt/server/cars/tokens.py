"""The token with which a car sends its messages: made once, and kept as its digest."""

from __future__ import annotations

import hashlib
import json
import secrets
from pathlib import Path
from typing import Final

from tripwatt.errors import damage
from tripwatt.files import read_text_file, write_text
from tripwatt.server.cars.folder import live_folder
from tripwatt.server.cars.own_car import LIVE, TOKEN

MOST_BYTES: Final = 1 << 12


def has_token(folder: Path | str) -> bool:
    """Tell whether a folder is that of a car with a token.

    Parameters
    ----------
    folder : Path or str
        Of a car.

    Returns
    -------
    bool
        Without opening the car.

    Examples
    --------
    >>> has_token("no-such-folder")
    False
    """
    return (Path(folder) / LIVE / TOKEN).is_file()


def issue_token(folder: Path | str) -> str:
    """Make the token with which a car sends its samples; an earlier one is no longer accepted.

    The folder holds a digest of the token, from which it cannot be found.

    Parameters
    ----------
    folder : Path or str
        Of a car; made where it is missing.

    Returns
    -------
    str
        The token; it cannot be read again.

    Raises
    ------
    InvalidInput
        As `RoadCar`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     token = issue_token(Path(folder, "my-leaf"))
    ...     print(len(token), token_digest(Path(folder, "my-leaf")) == digest_of(token))
    32 True
    """
    token = secrets.token_urlsafe(24)
    path = live_folder(Path(folder).absolute()) / TOKEN
    write_text(path, json.dumps({"sha256": digest_of(token)}) + "\n")
    return token


def digest_of(token: str) -> str:
    """SHA-256 of a token; tokens are random, so that a digest needs no salt."""
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()


def token_digest(folder: Path | str) -> str | None:
    """The digest of a car's token; None where it has none.

    Raises
    ------
    InvalidInput
        When the file is damaged.
    """
    path = Path(folder) / LIVE / TOKEN
    if not path.is_file():
        return None
    with damage(path, "the digest of a token"):
        return f"{json.loads(read_text_file(path, MOST_BYTES))['sha256']}"
