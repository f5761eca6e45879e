"""Types of arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Numbers."""

IntArray = npt.NDArray[np.int64]
"""Counts."""

BoolArray = npt.NDArray[np.bool_]
"""Masks."""
