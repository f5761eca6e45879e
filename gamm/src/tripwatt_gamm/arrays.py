"""Types of arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Array of floating-point numbers."""

BoolArray = npt.NDArray[np.bool_]
"""Array of booleans, such as a mask of rows."""

Index = npt.NDArray[np.intp]
"""Array of positions, such as numbers of rows."""
