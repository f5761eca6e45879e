"""Types of arrays, and slopes of functions of arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Array of floating-point numbers."""

BoolArray = npt.NDArray[np.bool_]
"""Array of booleans, such as a mask of rows."""

Index = npt.NDArray[np.intp]
"""Array of positions, such as numbers of rows."""


def central_differences(f: Callable[[FloatArray], Any], x: FloatArray, step: float) -> FloatArray:
    """Differentiate a function of `x` (q,) numerically; returns (q, ...), the shape of its values last."""
    return np.array([f(x + s) - f(x - s) for s in step * np.eye(len(x))]) / (2 * step)
