"""Numbers and names inside sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tripwatt.report.model_styles import model_style
from tripwatt.report.view import Record, plain


def percent(fraction: float | None, digits: int = 1) -> str:
    r"""A fraction as percent; a dash when unknown.

    Examples
    --------
    >>> percent(0.1034)
    '10.3\xa0%'
    """
    return "–" if fraction is None or not np.isfinite(fraction) else f"{100 * fraction:.{digits}f}\u00a0%"


def points(difference: float) -> str:
    """A difference of two fractions as signed percentage points.

    Examples
    --------
    >>> points(-0.0123)
    '−1.2 points'
    >>> points(-0.0004)
    '0.0 points'
    """
    sign = "" if abs(difference) < 0.0005 else "−" if difference < 0 else "+"
    return f"{sign}{abs(100 * difference):.1f} points"


def points_between(low: float, high: float) -> str:
    """An interval of differences of two fractions.

    Examples
    --------
    >>> points_between(-0.01, 0.02)
    '−1.0 to +2.0 points'
    """
    return f"{points(low).removesuffix(' points')} to {points(high)}"


def label(model: str) -> str:
    """A model's name inside a sentence."""
    return plain(model_style(model).label)


def listed(items: Sequence[str]) -> str:
    """Items in a row, with an `and`.

    Examples
    --------
    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else "none"


def interval(score: Record) -> str:
    """The 95 % interval of a mean APE in words, empty when there is none."""
    low, high = score.get("mape_ci95") or (None, None)
    return "" if low is None or high is None else f" (95 % interval {100 * low:.1f} to {100 * high:.1f} %)"


def compared(
    pairs: Sequence[Record], model: str, others: Sequence[str], subject: str = "Its mean error"
) -> str:
    """How the mean error of a model compares with that of others, from paired differences; empty without any.

    Examples
    --------
    >>> pair = {"a": "physics4", "b": "hybrid", "diff": 0.0149, "ci95": [0.004, 0.026]}
    >>> compared([pair], "hybrid", ["physics4"])
    'Its mean error is 1.5 percentage points lower than that of Physics + 4 coefficients (95 % interval 0.4 to 2.6).'
    """
    parts = [
        _difference(pair, model, other)
        for other in others
        for pair in pairs
        if {pair["a"], pair["b"]} == {model, other}
    ]
    return f"{subject} {listed(parts)}." if parts else ""


def is_significant(pair: Record) -> bool:
    """As the results say; for a pair without a word on it, whether its interval leaves out 0.

    Examples
    --------
    >>> is_significant({"ci95": [0.01, 0.02]}), is_significant({"ci95": [0.0001, 0.02], "significant": False})
    (True, False)
    """
    low, high = pair["ci95"]
    return bool(pair.get("significant", low > 0 or high < 0))


def _difference(pair: Record, model: str, other: str) -> str:
    """The end of a sentence on one pair, as seen from `model`."""
    sign = 1.0 if pair["a"] == model else -1.0
    low, high = sorted(sign * float(end) for end in pair["ci95"])
    difference = sign * float(pair["diff"])
    if not is_significant(pair):
        bounds = f"{points(difference)}, 95 % interval {points_between(low, high)}"
        return f"is not significantly different from that of {label(other)} ({bounds})"
    word = "lower" if difference < 0 else "higher"
    ends = sorted((abs(low), abs(high)))
    return (
        f"is {abs(100 * difference):.1f} percentage points {word} than that of {label(other)} "
        f"(95 % interval {100 * ends[0]:.1f} to {100 * ends[1]:.1f})"
    )
