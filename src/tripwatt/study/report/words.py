"""Numbers and names inside sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tripwatt.study.report.model_styles import model_style
from tripwatt.study.report.view import printable


def percent(fraction: float | None, digits: int = 1) -> str:
    r"""Format a fraction as percent; returns a dash if it is unknown.

    Examples
    --------
    >>> percent(0.1034)
    '10.3\xa0%'
    """
    return "–" if fraction is None or not np.isfinite(fraction) else f"{100 * fraction:.{digits}f}\u00a0%"


def points(difference: float) -> str:
    """Format a difference of two fractions as percentage points, with a sign unless it rounds to 0.

    Examples
    --------
    >>> points(-0.0123)
    '−1.2 points'
    >>> points(-0.0004)
    '0.0 points'
    """
    sign = "" if abs(difference) < 0.0005 else "−" if difference < 0 else "+"
    return f"{sign}{abs(100 * difference):.1f} points"


def model_label(model: str) -> str:
    """Return a model's name for a sentence."""
    return printable(model_style(model).label)


def listed(items: Sequence[str]) -> str:
    """Join items with commas and a final `and`; returns "none" if there are no items.

    Examples
    --------
    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else "none"
