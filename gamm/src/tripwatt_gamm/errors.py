"""One error for all faults of an input: each names the problem, its place, the value found and what is allowed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Fault(NamedTuple):
    """One thing that is wrong with an input.

    Attributes
    ----------
    what, where : str
        The problem in a few words; the term, column or argument that has the problem.
    got, allowed : str
        The value found, and the values that are allowed.
    fix : str
        What the user can do, empty when `allowed` is enough.

    Examples
    --------
    >>> print(Fault("k too small", "s(x)", "k=2", "at least 3"))
    k too small: s(x): got k=2; allowed: at least 3
    """

    what: str
    where: str
    got: str = ""
    allowed: str = ""
    fix: str = ""

    def __str__(self) -> str:
        labels = (("got ", self.got), ("allowed: ", self.allowed), ("", self.fix))
        details = "; ".join(f"{label}{text}" for label, text in labels if text)
        return f"{self.what}: {self.where}" + (f": {details}" if details else "")


class InvalidInput(ValueError):
    """A formula, a frame or a setting that cannot be used; the message has a line for each fault.

    Parameters
    ----------
    faults : iterable of Fault
        Everything that is wrong with the input.

    Examples
    --------
    >>> print(InvalidInput([Fault("no rows", "frame"), Fault("no groups", "groups=")]))
    no rows: frame
    no groups: groups=
    >>> InvalidInput.of("no rows", "frame").faults
    (Fault(what='no rows', where='frame', got='', allowed='', fix=''),)
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(map(str, self.faults)))

    @classmethod
    def of(cls, what: str, where: str, got: str = "", allowed: str = "", fix: str = "") -> InvalidInput:
        """Build the error of a single fault.

        Parameters
        ----------
        what, where, got, allowed, fix : str
            Fields of the `Fault`.

        Returns
        -------
        InvalidInput
            The error, for the caller to raise.
        """
        return cls([Fault(what, where, got, allowed, fix)])

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[tuple[Fault, ...]]]:
        return type(self), (self.faults,)  # so that a worker process can return the error


class NotFittedError(InvalidInput, AttributeError):
    """A result that a model has after a fit only; an AttributeError too, as scikit-learn's error of this name is.

    Parameters
    ----------
    faults : iterable of Fault
        What is missing.

    Examples
    --------
    >>> issubclass(NotFittedError, ValueError) and issubclass(NotFittedError, AttributeError)
    True
    """


def raise_faults(faults: Iterable[Fault]) -> None:
    """Raise `InvalidInput` with all distinct faults; do nothing if there are none."""
    listed = tuple(dict.fromkeys(faults))
    if listed:
        raise InvalidInput(listed)
