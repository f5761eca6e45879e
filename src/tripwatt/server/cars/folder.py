"""Create, open and erase folders of cars, and issue the tokens with which cars send."""

from __future__ import annotations

import hashlib
import re
import secrets
import unicodedata
from collections.abc import Iterable
from contextlib import ExitStack
from functools import partial
from glob import escape
from itertools import chain
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput, excerpt, require_type, system_errors
from tripwatt.files import WRITING, folder_lock
from tripwatt.forecasting.storage import vehicle_values
from tripwatt.population.cars import for_car
from tripwatt.server.cars import older
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.car_file import FILE, FORGET, CarFile
from tripwatt.server.cars.live_car import CLOSE, VALID_NAME, make_car_folder, require_valid_name
from tripwatt.vehicles import Vehicle, load_vehicle

UPLOADS: Final = "uploads"
"""Folder of logs that were sent and are not learned yet."""


def folder_name(label: str) -> str:
    """Return a valid folder name for a car, made from its owner's name for it.

    Examples
    --------
    >>> folder_name("My Model 3"), folder_name("Zoé"), folder_name("my-leaf"), folder_name("???")
    ('My-Model-3', 'Zoe', 'my-leaf', 'car')
    """
    folded = unicodedata.normalize("NFKD", label.replace("ß", "ss")).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9._]+", "-", folded).strip("-.")[:64] or "car"


def create_car(
    folder: Path | str, vehicle: Vehicle | str | Path, *, base: Path | str | None = None, label: str = ""
) -> Car:
    """Make the folder of a car whose model will be adapted to its trips.

    Parameters
    ----------
    folder : path
        New or empty folder, or that of a car on the road, which then gets a description. If its name cannot be part of a URL, such
        as "My Model 3", this name becomes the label of the car, and the folder is called "My-Model-3".
    vehicle : Vehicle, str or path
        A vehicle, the name of one in the library, or a TOML file.
    base : path, optional
        A stored model to adapt; the bundled one by default.
    label : str
        The owner's name for the car; the name of the folder by default.

    Returns
    -------
    Car
        A car without trips.

    Raises
    ------
    InvalidInput
        When there is no such vehicle or base, the folder is in use, or the label has control characters.

    Examples
    --------
    >>> import tripwatt as tw
    >>> car = tw.create_car("my-leaf", "nissan_leaf_24")  # doctest: +SKIP
    """
    wanted = Path(require_type("folder", folder, str | Path, "a path"))
    path, label = _car_folder(wanted), require_type("label", label or wanted.name, str, "a text")
    if not label.isprintable():  # it is shown on terminals, and could turn the text around it
        raise InvalidInput.of("control characters", "name", excerpt(label), "printable characters")
    car = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    entries = {entry.name for entry in path.iterdir()} if path.is_dir() else set[str]()
    foreign = {name for name in entries if name not in (FILE, older.LIVE) and not name.startswith(f"{FILE}-")}
    allowed = "a new or empty folder, or that of a car on the road"
    in_use = Fault("folder in use", f"{path}", "not empty", allowed)
    if foreign or (path.exists() and not path.is_dir()) or is_car(path):
        raise InvalidInput(in_use)
    root = None if base is None else Path(require_type("base", base, str | Path, "a path")).resolve()
    for_car(root, car)
    with system_errors("cannot write the folder", f"{path}", "a writable folder"):
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        settings = {"vehicle": vehicle_values(car), "base": None if root is None else f"{root}"}
        settings |= {"label": label, "state": secrets.token_hex(8)}
        if not CarFile(path).prepare(partial(older.read_into, path), settings):
            raise InvalidInput(in_use)
        new_car = Car(path)
        new_car.file.checkpoint()
    return new_car


def is_car(folder: Path | str) -> bool:
    """Return whether a folder is that of a car with a description.

    Parameters
    ----------
    folder : Path or str
        Any folder.

    Returns
    -------
    bool
        False for a car that only sends on the road, because it has no description.

    Examples
    --------
    >>> is_car("no-such-folder")
    False
    """
    return setting_of(folder, "state") is not None


def open_car(folder: Path | str) -> Car:
    """Open the folder of a car that `create_car` or `tripwatt car new` made.

    Parameters
    ----------
    folder : path
        Where the car was made.

    Returns
    -------
    Car
        The car with its trips, model and diary.

    Raises
    ------
    InvalidInput
        When the folder is not that of a car, is damaged, or is of a newer format.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.open_car("my-leaf").diary.score  # doctest: +SKIP
    Score(trips=12, error=0.09, weighted_error=0.08, bias=0.01, coverage=0.92, width=0.4)
    """
    path = _car_folder(Path(require_type("folder", folder, str | Path, "a path")))
    if not is_car(path):
        got = "a folder" if path.is_dir() else "a file" if path.exists() else "no such folder"
        fix = "make one: tripwatt car new"
        if holds_car(path) and not CarFile(path).is_finished:
            got, fix = "a car that was not finished", FORGET
        raise InvalidInput.of("not a car", f"{path}", got, "a folder of `tripwatt car new`", fix)
    return Car(path)


def describe_cars(folders: Iterable[Path]) -> tuple[list[dict[str, Any]], dict[Path, InvalidInput]]:
    """Describe cars, as `Car.about`; those that cannot be read are given with their faults. Cars that only send on the road are left out.

    Examples
    --------
    >>> describe_cars([])
    ([], {})
    """
    cars, damaged = [], {}
    for folder in folders:
        try:
            if is_car(folder) or not CarFile(folder).is_finished:
                require_valid_name(folder)
                cars.append(open_car(folder).about())
        except InvalidInput as error:
            damaged[folder] = error
    return cars, damaged


def holds_car(folder: Path) -> bool:
    """Return whether a folder is that of a car: sound, damaged, not finished, or without a description."""
    return (folder / FILE).is_file() or older.is_older_folder(folder)


def _car_folder(folder: Path) -> Path:
    """Return the folder of a car, given with its name or its label as last part."""
    usual = folder.name == "" or VALID_NAME.fullmatch(folder.name) is not None or holds_car(folder)
    return folder if usual else folder.with_name(folder_name(folder.name))


def forget_car(folder: Path | str) -> None:
    """Erase a car, also a damaged one: its trips, model, diary, samples and uploads. Other files in the folder stay.

    The name is erased last, so that a call that was killed or that failed can be repeated.

    Parameters
    ----------
    folder : Path or str
        Folder of the car.

    Raises
    ------
    InvalidInput
        When the folder is not that of a car, another process follows the car, or a part of it cannot be removed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     place = create_car(Path(folder, "my-leaf"), "nissan_leaf_24").folder
    ...     forget_car(place)
    ...     print(place.exists())
    False
    """
    path = _car_folder(Path(folder))
    if not holds_car(path):
        path = open_car(folder).folder  # not a car
    with ExitStack() as locks:
        for place in filter(Path.is_dir, (path, path / older.LIVE)):  # older versions lock the latter
            locks.enter_context(folder_lock(place, CLOSE))
        killed = (path.parent.glob(f".{escape(path.name)}.*{WRITING}"), path.glob(f".*{WRITING}"))
        files = [*path.glob(f"{FILE}-*"), path / FILE]
        for part in (*chain(*killed), path / UPLOADS, *older.older_parts(path), *files):
            allowed = "files that can be removed; then erase it again"
            with system_errors("cannot erase the car", f"{part}", allowed):
                older.remove(part)
        if not any(path.iterdir()):
            path.rmdir()


def issue_token(folder: Path | str) -> str:
    """Make the token with which a car sends its samples; an earlier token is no longer accepted.

    The folder holds only a digest, from which the token cannot be recovered.

    Parameters
    ----------
    folder : Path or str
        Folder of a car; created if missing.

    Returns
    -------
    str
        The token; it cannot be read again.

    Raises
    ------
    InvalidInput
        When the folder's name is not a valid car name, or the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     token = issue_token(Path(folder, "my-leaf"))
    ...     print(len(token), setting_of(Path(folder, "my-leaf"), "token") == digest_of(token))
    32 True
    """
    token, path = secrets.token_urlsafe(24), Path(folder).absolute()
    make_car_folder(path)
    car = Car(path)
    with system_errors("cannot write the folder", f"{path}", "a writable folder"), car.file.write() as db:
        db.put_settings({"token": digest_of(token), "token_of": path.name})
    return token


def digest_of(token: str) -> str:
    """Return the SHA-256 digest of a token; tokens are random, so a digest needs no salt."""
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()


def setting_of(folder: Path | str, name: str) -> Any:
    """Return a setting of the car in a folder, such as `state`, which changes when it learns, or `token`, the digest of its token.

    Returns
    -------
    object
        None if there is no car or no such setting.

    Raises
    ------
    InvalidInput
        When the file is damaged.

    Examples
    --------
    >>> setting_of("no-such-folder", "token") is None
    True
    """
    if older.is_older_folder(Path(folder)):
        Car(folder)
    file = CarFile(Path(folder))
    return file.setting(name) if file.path.is_file() else None
