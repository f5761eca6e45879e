"""Flags: data about what a forecast, a route or a reader assumed or could not use. `messages` turns flags into sentences."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Flag:
    """One thing that a user should see beside a result.

    Attributes
    ----------
    code : str
        A code of `flags.toml`, which has its words.
    subject : str
        The field, signal, file or part of the car that it is about.
    value : float, str or None
        Value that was read or assumed, in `unit`.
    unit : str
        As in the names of the project's columns: "m_s", "degc", "s"; "1" for a share or a count.
    seen : tuple of float, optional
        Lowest and highest value of the subject in the training trips, in the unit of its name. Only the sentence has them.

    Examples
    --------
    >>> Flag("links_too_long", "links", 6000.0, "m")
    Flag(code='links_too_long', subject='links', value=6000.0, unit='m')
    """

    code: str
    subject: str
    value: float | str | None = None
    unit: str = ""
    seen: tuple[float, float] | None = field(default=None, repr=False)
