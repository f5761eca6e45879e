"""Errors and faults: every fault names what is wrong, where, what is there instead and what is allowed.

The library raises errors; the command line and the service show them in their own form. One `InvalidInput` holds all
faults of an input, so that a user mends a file once.
"""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from types import UnionType
from typing import Any, Final, ParamSpec, Self, TypeVar, cast

Given = ParamSpec("Given")
Checked = TypeVar("Checked")

MAX_FAULTS: Final = 50
"""Faults of one kind that are listed one by one; the others are counted."""

MAX_HINTS: Final = 10
"""Largest number of unknown names for which a similar known name is suggested: each search compares with every known name."""

MAX_CHARACTERS: Final = 2000
"""Largest number of characters that a message shows of one text of a fault."""

OTHER_NAMES: Final[Mapping[str, str]] = {"vehicle": "car", "vehicle_figures": "car"}
"""Name that stands for a car elsewhere -> the name of the field, for the hint of a refusal."""

_SHORT: Final = reprlib.Repr()
_SHORT.maxlevel = 3
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 200


def excerpt(value: Any, length: int = 60) -> str:
    """The beginning of the representation of a value from outside, however large or deeply nested it is.

    Examples
    --------
    >>> excerpt("speed"), excerpt([[[[[1]]]]]), excerpt(12345, length=3)
    ("'speed'", '[[[[...]]]]', '123')
    """
    return _SHORT.repr(value)[:length]


def did_you_mean(name: object, known: Collection[str]) -> str:
    """A question with the most similar of the known names, or the first that has the name among its words; an empty text if there is none.

    Examples
    --------
    >>> did_you_mean("tmie", ["time", "vel"]), did_you_mean("km", ["kind", "distance_km"]), did_you_mean("colour", ["time"])
    ("did you mean 'time'?", "did you mean 'distance_km'?", '')
    >>> did_you_mean("vehicle", ["car", "model"])
    "did you mean 'car'?"
    """
    text = OTHER_NAMES.get(str(name), str(name))[:60]
    near = difflib.get_close_matches(text, known, n=1) or [one for one in known if f"_{text}_" in f"_{one}_"]
    return f"did you mean {near[0]!r}?" if near else ""


def printable(text: str) -> str:
    r"""A text with its control characters escaped, so that no input can control a terminal or fake a line of output.

    Examples
    --------
    >>> printable("speed\x1b[2J\n"), printable("Überland, 5 °C")
    ('speed\\x1b[2J\\n', 'Überland, 5 °C')
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class TripwattError(Exception):
    """Base of every error that the library raises on purpose."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong with an input.

    Attributes
    ----------
    what : str
        The problem in a few words.
    where : str
        File, row, column, key or argument.
    got : str
        What is there instead.
    allowed : str
        What would have been right.
    fix : str
        What the user can do, empty when `allowed` is enough.
    count : int
        Cells, rows or files that this fault stands for.
    at : tuple of str and int, optional
        The place by keys and indices from 0, inside of what is checked; None if `where` alone tells it. Equal faults may differ in it.

    Examples
    --------
    >>> print(Fault("speed out of range", "A01.csv row 12", "912", "0 to 250 km/h"))
    speed out of range: A01.csv row 12: got 912; allowed: 0 to 250 km/h
    """

    what: str
    where: str
    got: str = ""
    allowed: str = ""
    fix: str = ""
    count: int = 1
    at: tuple[str | int, ...] | None = field(default=None, compare=False)

    @classmethod
    def unknown(cls, what: str, where: str, name: object, known: Collection[str]) -> Self:
        """The fault of an unknown name; it lists the known names and suggests the most similar one.

        Examples
        --------
        >>> print(Fault.unknown("unknown model", "models", "forst", ("forest", "gamm")))
        unknown model: models: got 'forst'; allowed: forest, gamm; did you mean 'forest'?
        """
        return cls(what, where, excerpt(name), ", ".join(known), did_you_mean(name, known))

    @property
    def texts(self) -> dict[str, str]:
        """The texts of the fault that are not empty, by the name of their field, after a code for its kind."""
        code = re.sub(r"[^a-z]+", "-", self.what.lower()).strip("-")[:60]
        return {"code": code} | {
            name: text for name, text in asdict(self).items() if text and isinstance(text, str)
        }

    def __str__(self) -> str:
        text = f"{self.what}: {printable(self.where[:MAX_CHARACTERS])}"
        parts = [
            f"{label}{printable(value[:MAX_CHARACTERS])}"
            for label, value in (("got ", self.got), ("allowed: ", self.allowed), ("", self.fix))
            if value
        ]
        return f"{text}: {'; '.join(parts)}" if parts else text


EXTRAS: Final[Mapping[str, tuple[str, ...]]] = {
    "figures": ("matplotlib",),
    "workbooks": ("openpyxl",),
    "parquet": ("pyarrow",),
    "learners": ("sklearn", "lightgbm"),
    "study": ("tripwatt_gamm", "sklearn", "lightgbm", "matplotlib", "jinja2", "openpyxl", "pyarrow"),
    "service": ("fastapi", "pydantic", "uvicorn", "orjson", "prometheus_client"),
    "fleet": ("deltalake", "pyarrow", "lightgbm", "matplotlib"),
    "routing": ("httpx",),
    "elevation": ("rasterio",),
    "live": ("aiomqtt",),
    "mcp": ("mcp",),
    "gamm": ("tripwatt_gamm",),
}
"""Extra of the package -> the modules without which none of its commands works."""


ON_AN_INDEX: Final = False
"""Whether the package can be installed from an index. `python -m tools.docs.install_lines` sets this and every line that installs."""


def install(*extras: str) -> str:
    """The advice how to install extras: by the name of the package, or as an editable install of a clone.

    A wheel that is installed already needs no index: pip adds what its extras need.

    Examples
    --------
    >>> install("service", "fleet")
    "run pip install -e '.[service,fleet]' in the clone of tripwatt"
    """
    if ON_AN_INDEX or not Path(__file__).parents[2].joinpath("pyproject.toml").is_file():
        return f"run pip install 'tripwatt[{','.join(extras)}]'"
    return f"run {clone_line(extras)} in the clone of tripwatt"


def clone_line(extras: Iterable[str]) -> str:
    """The command that installs extras in a clone; the extras `gamm` and `study` also install the clone's folder `gamm`.

    Examples
    --------
    >>> clone_line(["service", "gamm"])
    "pip install -e gamm -e '.[service,gamm]'"
    """
    names = tuple(extras)
    return f"pip install {'-e gamm ' * bool({'gamm', 'study'} & {*names})}-e '.[{','.join(names)}]'"


def extras_faults(needed: Mapping[str, str]) -> list[Fault]:
    """One fault for each extra that is not installed, with the command that installs all missing extras.

    Parameters
    ----------
    needed : mapping of str to str
        Extra -> the command or option that needs it.

    Examples
    --------
    >>> extras_faults({})
    []
    """
    missing = {extra: [name for name in EXTRAS[extra] if not _is_there(name)] for extra in needed}
    missing = {extra: modules for extra, modules in missing.items() if modules}
    what, fix = "missing package", install(*missing)
    return [
        Fault(what, needed[extra], f"no {', '.join(modules)}", f"the extra {extra}", fix)
        for extra, modules in missing.items()
    ]


def require_extras(needed: Mapping[str, str]) -> None:
    """Raise `InvalidInput` with the faults of `extras_faults`, if there are any.

    Examples
    --------
    >>> require_extras({})
    """
    raise_faults(extras_faults(needed))


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ValueError:  # imported already, by something that is no finder
        return True


def counted(number: int, thing: str) -> str:
    """A number of things, with the thing in the plural unless there is one.

    Examples
    --------
    >>> counted(1, "trip"), counted(0, "trip"), counted(12, "file")
    ('1 trip', '0 trips', '12 files')
    """
    return f"{number} {thing}{'s' * (number != 1)}"


def percent(value: float | None, digits: int = 0, sign: str = "") -> str:
    """A share in percent, for people, a half upwards as a display of 12.5 % reads 13 %; "unknown" for None.

    Examples
    --------
    >>> percent(0.8), percent(-0.0001, 1), percent(0.0774, 1, "+"), percent(None)
    ('80 %', '0.0 %', '+7.7 %', 'unknown')
    >>> percent(0.125), percent(0.135), percent(0.145), percent(0.1449)
    ('13 %', '14 %', '15 %', '14 %')
    """
    return "unknown" if value is None else f"{100.0 * value + 1e-9:{sign}z.{digits}f} %"


def and_more(bad: Sized, what: str = "row") -> str:
    """The end of a message that shows the first of several wrong values; an empty text if there is only one.

    Examples
    --------
    >>> and_more([4, 7, 9]), and_more([4])
    (' (and 2 more rows)', '')
    """
    return f" (and {counted(len(bad) - 1, f'more {what}')})" if len(bad) > 1 else ""


def require_type(name: str, value: Checked, types: type | UnionType, allowed: str, fix: str = "") -> Checked:
    """Check that an argument has one of some types, and return it.

    Raises
    ------
    InvalidInput
        If it has another type; of a type of Python, the message shows the value.

    Examples
    --------
    >>> require_type("folder", 5, str | Path, "a path")
    Traceback (most recent call last):
        ...
    tripwatt.errors.InvalidInput: unknown type: folder: got 5; allowed: a path
    """
    if isinstance(value, types):
        return value
    got = excerpt(value, 40) if type(value).__module__ == "builtins" else type(value).__name__
    raise InvalidInput.of("unknown type", name, got, allowed, fix)


def require_one(names: str, one: object, other: object) -> None:
    """Raise `InvalidInput` unless exactly one of two values is given, that is, is not None.

    Examples
    --------
    >>> require_one("car, model", "vw_id3", None)
    """
    if (one is None) == (other is None):
        got = "neither" if one is None else "both"
        raise InvalidInput.of("one of them is needed", names, got, "one of the two")


def first_faults(faults: Sequence[Fault], where: str, most: int = MAX_FAULTS) -> list[Fault]:
    """The first `most` faults; if there are more, one further fault with the number of those left out.

    Examples
    --------
    >>> [fault.got for fault in first_faults([Fault("wrong", "a", str(k)) for k in range(5)], "a", 2)]
    ['0', '1', '3 more']
    """
    if len(faults) <= most:
        return list(faults)
    return [*faults[:most], Fault("further faults", where, f"{len(faults) - most} more")]


def grouped(faults: Iterable[Fault]) -> list[Fault]:
    """Merge faults that differ only by their place into one fault with the number of the other places.

    Examples
    --------
    >>> [fault.where for fault in grouped([Fault("no vehicle", "a.csv"), Fault("no vehicle", "b.csv")])]
    ['a.csv (and 1 more place)']
    """
    kinds: dict[Fault, list[Fault]] = {}
    for fault in faults:
        kinds.setdefault(replace(fault, where="", count=1), []).append(fault)
    return [replace(group[0], where=group[0].where + and_more(group, "place")) for group in kinds.values()]


class InvalidInput(TripwattError):
    """An input cannot be used; the error lists all its faults.

    Parameters
    ----------
    faults : Fault or iterable of Fault
        What is wrong; the message has a line for each.

    Examples
    --------
    >>> error = InvalidInput([Fault("no trips", "data/", "0 CSV files", "at least one Trip*.csv")])
    >>> print(error)
    no trips: data/: got 0 CSV files; allowed: at least one Trip*.csv
    """

    def __init__(self, faults: Iterable[Fault] | Fault) -> None:
        self.faults: tuple[Fault, ...] = (faults,) if isinstance(faults, Fault) else tuple(faults)
        super().__init__("\n".join(map(str, self.faults)))

    @classmethod
    def of(cls, what: str, where: str, got: str = "", allowed: str = "", fix: str = "") -> Self:
        """An error with a single fault, made of the same arguments as `Fault`.

        Parameters
        ----------
        what : str
            The problem in a few words.
        where : str
            File, row, column, key or argument.
        got : str
            What is there instead.
        allowed : str
            What would have been right.
        fix : str
            What the user can do.

        Returns
        -------
        InvalidInput
            The error, for the caller to raise.

        Examples
        --------
        >>> print(InvalidInput.of("no trips", "data/", "0 CSV files"))
        no trips: data/: got 0 CSV files
        """
        return cls(Fault(what, where, got, allowed, fix))

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[tuple[Fault, ...]]]:
        return (type(self), (self.faults,))  # survives the way back from a worker process


def raise_faults(faults: Iterable[Fault]) -> None:
    """Raise `InvalidInput` with all the faults; do nothing if there are none.

    Parameters
    ----------
    faults : iterable of Fault
        What is wrong; the iterable is exhausted before the error is raised.

    Raises
    ------
    InvalidInput
        With all the faults, in their order.

    Examples
    --------
    >>> raise_faults([])
    >>> raise_faults([Fault("no trips", "data/")])
    Traceback (most recent call last):
        ...
    tripwatt.errors.InvalidInput: no trips: data/
    """
    listed = tuple(faults)
    if listed:
        raise InvalidInput(listed)


class RemoteError(InvalidInput):
    """A server gave no answer, or one that cannot be used: a router, a search for places, a weather service.

    Examples
    --------
    >>> print(RemoteError(Fault("the router does not respond", "127.0.0.1:8002", "connection refused")))
    the router does not respond: 127.0.0.1:8002: got connection refused
    """


@contextmanager
def system_errors(what: str, where: str, allowed: str, path: object = "") -> Iterator[None]:
    """Raise `InvalidInput` for an error of the system, such as a full disk or a missing permission.

    Parameters
    ----------
    what, where, allowed : str
        Texts of the fault; its `got` is the message of the system.
    path : object
        Shown before the message of the system.

    Examples
    --------
    >>> with system_errors("cannot write the file", "--out", "a writable folder", "out.csv"):
    ...     raise PermissionError(13, "Permission denied")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: cannot write the file: --out: got out.csv: Permission denied; allowed: a writable folder
    """
    try:
        yield
    except OSError as error:
        got = f"{path}: {error.strerror or error}" if path else f"{error.strerror or error}"
        raise InvalidInput.of(what, where, got, allowed) from error


DAMAGE: Final = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""Errors of reading values that are damaged, such as those of JSON."""


@contextmanager
def damage(path: object, allowed: str, fix: str = "", what: str = "damaged file") -> Iterator[None]:
    """Raise `InvalidInput` for a file that tripwatt wrote and whose content was damaged since.

    Parameters
    ----------
    path : object
        The file.
    allowed, fix, what : str
        Texts of the fault.

    Examples
    --------
    >>> with damage("car/plan.json", "a plan"):
    ...     {}["request"]
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: damaged file: car/plan.json: got no 'request'; allowed: a plan
    """
    try:
        yield
    except DAMAGE as error:
        got = f"no {error}" if isinstance(error, KeyError) else f"{error}"
        raise InvalidInput.of(what, f"{path}", got[:200], allowed, fix) from error


def or_none(call: Callable[Given, Checked], *args: Given.args, **more: Given.kwargs) -> Checked | None:
    """The result of a call, or None if the call raises `InvalidInput`; a `RemoteError` is raised.

    Examples
    --------
    >>> or_none(int, "3"), or_none(raise_faults, [Fault("no trips", "data/")])
    (3, None)
    """
    try:
        return call(*args, **more)
    except RemoteError:
        raise
    except InvalidInput:
        return None


@contextmanager
def each_fault(change: Callable[[Fault], Fault]) -> Iterator[None]:
    """Change each fault that the block raises; the kind of the error stays.

    Examples
    --------
    >>> with each_fault(lambda fault: replace(fault, fix="measure again")):
    ...     raise InvalidInput.of("not a number", "soc")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: not a number: soc: measure again
    """
    try:
        yield
    except InvalidInput as error:
        raise type(error)(map(change, error.faults)) from error


def places_named(names: Mapping[str, str]) -> AbstractContextManager[None]:
    """Rename the places of the faults that the block raises.

    Examples
    --------
    >>> with places_named({"mass_kg": "--mass"}):
    ...     raise InvalidInput.of("not a number", "mass_kg")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: not a number: --mass
    """
    return each_fault(lambda fault: replace(fault, where=names.get(fault.where, fault.where)))


def places_within(place: str) -> AbstractContextManager[None]:
    """Put a text before the places of the faults that the block raises.

    Examples
    --------
    >>> with places_within("trips[3]."):
    ...     raise InvalidInput.of("not a number", "soc")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: not a number: trips[3].soc
    """
    return each_fault(lambda fault: replace(fault, where=f"{place}{fault.where}"))


class Check:
    """Run several checks of one input, and raise the faults of all of them at the end of a `with` block.

    Examples
    --------
    >>> with Check() as check:
    ...     number = check(int, "7")
    ...     check(raise_faults, [Fault("no trips", "data/")])
    ...     check(raise_faults, [Fault("no car", "car.toml")])
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: no trips: data/
    no car: car.toml
    """

    def __init__(self) -> None:
        self.faults: dict[Fault, None] = {}
        self.failed = False

    def __enter__(self) -> Self:
        return self

    def __call__(self, check: Callable[Given, Checked], *args: Given.args, **more: Given.kwargs) -> Checked:
        """Run a check and return its result; if the check fails, keep its faults for the end of the block.

        Parameters
        ----------
        check : callable
            Returns a result or raises `InvalidInput`.
        *args, **more
            Arguments of the callable.

        Returns
        -------
        object
            The result of the check. If the check fails, None; the end of the block then raises.

        Examples
        --------
        >>> Check()(len, "abc")
        3
        """
        try:
            return check(*args, **more)
        except InvalidInput as error:
            self.faults |= dict.fromkeys(error.faults)
            self.failed = True
            return cast(Checked, None)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Raise `InvalidInput` with the faults of all failed checks, each fault once."""
        if kind is None and self.failed:
            raise InvalidInput(self.faults)
